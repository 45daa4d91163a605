"""Laws as users write them, with the truth about them, and laws with a fault.

Each kind is a function of a generator that returns a `Drawn`: how the object is made, the calls that suit it, and
what is true of it. A broken object names the calls that see its fault.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from asperity import kernels as ker
from campaigns.judges.plain_quadrature import Array, Truth, averaged

Rng = np.random.Generator
RETRO = ker.retroreflection()
# The calls, by the names of `campaigns.errors.users_objects`, that suit any law, and laws with a density.
MEANS, MATRICES = ("sampled", "applied"), ("in_polynomials", "drag")
DENSITIES = (*MEANS, "in_bins", *MATRICES, "gap", "mixing", "far", "diffusive")


@dataclass(frozen=True)
class Drawn:
    """An object to be made, the calls that suit it, and the truth about it, or its fault.

    Attributes
    ----------
    kind : str
    make : callable
        Makes the object; of a broken one the constructor may refuse.
    tools : tuple of str
        Calls; of a broken object those that see the fault.
    truth : Any
        What the calls need to know; None of a broken object.
    told : callable, optional
        Makes the object with its breakpoints, where a refusal asks for them.
    careless : bool
        Whether the object changes the angles that it is given, so that a refusal is as good as the right number.
    """

    kind: str
    make: Callable[[], Any]
    tools: tuple[str, ...]
    truth: Any = None
    told: Callable[[], Any] | None = None
    careless: bool = False


# ---- densities ------------------------------------------------------------------------------------------------------
def random_shape(rng: Rng) -> tuple[Callable[[Array], Array], tuple[float, ...]]:
    """A function of mean 0 and at most 1, with the angles where it is not smooth."""
    at, width = float(rng.uniform(0.4, 2.7)), float(rng.choice([0.07, 0.3, 1.0]))
    k, a, b = int(rng.choice([1, 2, 5, 37])), float(rng.normal()), float(rng.normal())
    shapes: tuple[tuple[Callable[[Array], Array], tuple[float, ...]], ...] = (
        (lambda x: np.cos(k * x), ()), (lambda x: a * np.cos(x) + b * np.cos(x) ** 3, ()),
        (lambda x: np.abs(np.cos(x) - np.cos(at)), (at,)), (lambda x: np.sqrt(np.abs(x - at)), (at,)),
        (lambda x: np.maximum(1.0 - np.abs(x - at) / width, 0.0), (at - width, at, at + width)),
        (lambda x: (x < at) * 1.0, (at,)), (lambda x: (np.abs(x - at) < width) * 1.0, (at - width, at + width)),
    )  # fmt: skip
    shape, breaks = shapes[rng.choice(len(shapes), p=[0.25, 0.15, 0.15, 0.1, 0.15, 0.1, 0.1])]
    breaks = tuple(each for each in breaks if 0.0 < each < np.pi)
    mean = averaged(shape, breaks)
    most = float(np.abs(shape(np.linspace(1e-9, np.pi - 1e-9, 20001)) - mean).max()) * 1.001
    return lambda x: (shape(x) - mean) / most, breaks


@dataclass(frozen=True)
class Kernel:
    """The density sin(theta')/2 (1 + sum c_ij g_i(theta) h_j(theta')); h = g where it is reversible."""

    coupling: Array
    one: tuple[Callable[[Array], Array], ...]
    other: tuple[Callable[[Array], Array], ...]
    breaks: tuple[float, ...]

    @classmethod
    def drawn(cls, rng: Rng, reversible: bool = True) -> Kernel:
        """Of rank 1 or 2."""
        one = [random_shape(rng) for _ in range(int(rng.integers(1, 3)))]
        other = one if reversible else [random_shape(rng) for _ in one]
        size = rng.uniform(0.2, 0.95) * rng.dirichlet(np.ones(len(one))) * rng.choice([-1.0, 1.0], len(one))
        breaks = sorted({each for _, some in (*one, *other) for each in some})
        return cls(np.diag(size), tuple(g for g, _ in one), tuple(h for h, _ in other), tuple(breaks))

    def density(self, theta: Array, out: Array) -> Array:
        left, right = (np.stack([f(x) for f in some]) for some, x in ((self.one, theta), (self.other, out)))
        return 0.5 * np.sin(out) * (1.0 + sum(self.coupling[i, j] * left[i] * right[j] for i, j in self.pairs))

    @property
    def pairs(self) -> list[tuple[int, int]]:
        return list(np.ndindex(*self.coupling.shape))

    @property
    def gram(self) -> Array:
        """<h_i, g_j>."""
        return np.array(
            [[averaged(lambda x, g=g, h=h: g(x) * h(x), self.breaks) for g in self.one] for h in self.other]
        )

    def squared(self) -> Kernel:
        """That of the second power."""
        return replace(self, coupling=self.coupling @ self.gram @ self.coupling)

    def sample(self, theta: Array, rng: Rng) -> Array:
        """By rejection."""
        found, waiting = np.empty(theta.shape), np.ones(theta.shape, dtype=bool)
        while waiting.any():
            draw = np.arccos(rng.uniform(-1.0, 1.0, theta.shape))
            taken = waiting & (rng.uniform(0.0, np.sin(draw)) < self.density(theta, draw))
            found[taken], waiting = draw[taken], waiting & ~taken
        return found

    def truth(self, weight: float = 1.0) -> Truth:
        """Of a fraction ``weight`` of the law, and retroreflection for the rest."""
        rest = 1.0 - weight
        spectrum = rest + weight * np.append(np.linalg.eigvals(self.coupling @ self.gram).real, 0.0)
        return Truth(
            lambda theta, out: weight * self.density(theta, out), ((lambda x: rest, lambda x: x),) if rest else (),
            self.breaks, 1.0 - float(spectrum.max()), float(np.abs(spectrum).max()), (1.0 - rest) / (1.0 + rest),
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Written(ker.Law):
    """A law by the recipe, from a user's two functions."""

    draw: Callable[[Array, Rng], Array]
    rows: Callable[[Array, float, int, Array], ker.Conditionals]
    reversible: bool | None = None

    def _sample(self, theta: Array, rng: Rng) -> Array:
        return self.draw(theta, rng)

    def _conditionals(self, theta: Array, tolerance: float, degree: int, edges: Array) -> ker.Conditionals:
        return self.rows(theta, tolerance, degree, edges)


# ---- good laws -----------------------------------------------------------------------------------------------------
def density(rng: Rng) -> Drawn:
    """A reversible density, with or without its breakpoints; alone, its square, or mixed with retroreflection."""
    kernel, form = Kernel.drawn(rng), str(rng.choice(["alone", "square", "mixed"], p=[0.7, 0.15, 0.15]))
    told = kernel.breaks if rng.random() < 0.5 else ()
    weight = float(rng.uniform(0.2, 0.8)) if form == "mixed" else 1.0

    def make(told: tuple[float, ...] = told) -> ker.Law:
        law = ker.DensityLaw(kernel.density, told)
        return law @ law if form == "square" else law if weight == 1.0 else weight * law + (1 - weight) * RETRO

    tools = DENSITIES if form == "alone" else (*MEANS, *MATRICES, "gap", "mixing", "diffusive")
    truth = (kernel.squared() if form == "square" else kernel).truth(weight)
    return Drawn(f"density, {form}", make, tools, truth, lambda: make(kernel.breaks))


def one_way_density(rng: Rng) -> Drawn:
    """A density that preserves sin(theta) d theta and is not reversible."""
    kernel = Kernel.drawn(rng, reversible=False)
    return Drawn(
        "density, not reversible", lambda: ker.DensityLaw(kernel.density, kernel.breaks),
        (*MEANS, "in_bins", *MATRICES, "far"), kernel.truth(),
    )  # fmt: skip


def recipe_of(kernel: Kernel, told: bool) -> Callable[[Array, float, int, Array], ker.Conditionals]:
    breaks = kernel.breaks if told else None
    return lambda theta, tolerance, degree, edges: ker.Conditionals.of_density(
        kernel.density, theta, degree, edges, breakpoints=breaks, tolerance=tolerance
    )


def written_density(rng: Rng) -> Drawn:
    """A class with a density."""
    kernel, told = Kernel.drawn(rng), bool(rng.random() < 0.5)
    return Drawn(
        "class with a density", lambda: Written(kernel.sample, recipe_of(kernel, told), True), DENSITIES, kernel.truth()
    )


def careless_class(rng: Rng) -> Drawn:
    """A class that changes the angles that it is given."""
    kernel = Kernel.drawn(rng)
    rows = recipe_of(kernel, True)

    def changing(function: Callable[..., Any]) -> Callable[..., Any]:
        def changed(theta: Array, *rest: Any) -> Any:
            found = function(theta.copy(), *rest)
            theta[...] = 0.5
            return found

        return changed

    def make() -> ker.Law:
        return Written(changing(kernel.sample), changing(rows), True)

    return Drawn("careless class", make, (*MEANS, "in_bins", *MATRICES), kernel.truth(), careless=True)


def random_atoms(rng: Rng) -> tuple[Callable[[Array, Rng], Array], Callable[..., ker.Conditionals], Truth]:
    """Retroreflection with a probability that depends on sin(theta), else specular reflection: reversible."""
    a, b = float(rng.uniform(0.1, 0.5)), float(rng.uniform(0.0, 0.5))

    def back(theta: Array) -> Array:
        return a + b * np.sin(theta)

    def rows(theta: Array, *_: Any) -> ker.Conditionals:
        weights = np.stack([back(theta), 1.0 - back(theta)], axis=1)
        return ker.Conditionals.of_atoms(np.stack([theta, np.pi - theta], axis=1), weights, 0.0)

    maps = ((back, lambda x: x), (lambda x: 1.0 - back(x), lambda x: np.pi - x))
    return (
        lambda theta, source: np.where(source.random(theta.shape) < back(theta), theta, np.pi - theta),
        rows,
        Truth(maps=maps),
    )


def written_atoms(rng: Rng) -> Drawn:
    """A class of two atoms."""
    draw, rows, truth = random_atoms(rng)
    return Drawn("class of atoms", lambda: Written(draw, rows, True), (*MEANS, *MATRICES), truth)


def exchanged(low: float, high: float) -> Callable[[Array], Array]:
    """The involution that turns an interval of u = cos(theta) round and leaves the others as they are."""

    def image(theta: Array) -> Array:
        u = np.cos(theta)
        return np.arccos(np.clip(np.where((u > low) & (u < high), low + high - u, u), -1.0, 1.0))

    return image


def involution(rng: Rng) -> Drawn:
    """Specular reflection of an interval of cosines, retroreflection elsewhere."""
    low, high = np.sort(rng.uniform(-0.95, 0.95, 2)).tolist()
    image = exchanged(low, high)
    truth = Truth(maps=((np.ones_like, image),), breaks=(float(np.arccos(low)), float(np.arccos(high))))
    return Drawn("involution", lambda: ker.InvolutionLaw(image), (*MEANS, *MATRICES), truth)


def exchange(rng: Rng) -> Drawn:
    """The exchange of intervals with a given matrix: its pieces in order, by the fractions of the measure."""
    array = random_rows(rng, (2, 3, 5))
    size = len(array)
    starts = (np.arange(size)[:, None] + np.cumsum(array, axis=1) - array) / size

    def image(theta: Array) -> Array:
        at = 0.5 * (1.0 - np.cos(theta))
        piece = np.searchsorted(starts.ravel(), at, side="right") - 1
        i, j = np.divmod(piece, size)
        return np.asarray(np.arccos(np.clip(1.0 - 2.0 * (starts[j, i] + at - starts[i, j]), -1.0, 1.0)))

    def make() -> ker.Law:
        return ker.IntervalExchangeLaw(ker.discretise(ker.MatrixLaw(array), ker.Bins(size)))

    breaks = tuple(np.unique(np.arccos(1.0 - 2.0 * starts.ravel()[1:])).tolist())
    return Drawn("exchange", make, (*MEANS, *MATRICES), Truth(maps=((np.ones_like, image),), breaks=breaks))


def random_rows(rng: Rng, sizes: tuple[int, ...] = (2, 3, 8, 40)) -> Array:
    """A doubly stochastic symmetric array."""
    size = int(rng.choice(sizes))
    array = np.mean([np.eye(size)[rng.permutation(size)] for _ in range(int(rng.integers(2, 9)))], axis=0)
    return 0.5 * (array + array.T)


def matrix_law(rng: Rng) -> Drawn:
    """Transitions between bins."""
    array = random_rows(rng)
    size = len(array)
    edges = np.arccos(np.clip(1.0 - 2.0 * np.arange(size + 1) / size, -1.0, 1.0))

    def value(theta: Array, out: Array) -> Array:
        i, j = (np.clip(np.searchsorted(edges, x) - 1, 0, size - 1) for x in (theta, out))
        return 0.5 * np.sin(out) * size * array[i, j]

    spectrum = np.append(np.linalg.eigvalsh(array - 1.0 / size), 0.0)
    truth = Truth(
        value, (), tuple(edges[1:-1].tolist()), 1.0 - float(spectrum.max()), float(np.abs(spectrum).max()), 1.0
    )
    # 40 bins are many for the judge's rules in two angles
    return Drawn(
        "matrix law", lambda: ker.MatrixLaw(array), DENSITIES if size < 40 else (*MEANS, "gap", "mixing"), truth
    )


# ---- broken laws ----------------------------------------------------------------------------------------------------
def broken_density(rng: Rng) -> Drawn:
    """A function that is no density."""
    kernel, at = Kernel.drawn(rng), float(rng.uniform(0.5, 2.5))
    p, size = kernel.density, float(rng.choice([1e-4, 0.1, 1.0]))
    faults: dict[str, Callable[[Array, Array], Any]] = {
        "signed": lambda a, b: 0.5 * np.sin(b) * (1.0 + 1.5 * np.cos(a) * np.cos(b)),
        "unnormalised": lambda a, b: (1.0 + size) * p(a, b), "nan": lambda a, b: np.where(a + b > 4.0, np.nan, p(a, b)),
        "unnormalised at some angles": lambda a, b: (1.0 + size * (a > at)) * p(a, b), "list": lambda a, b: [1.0, 2.0],
        "shape": lambda a, b: p(a, b)[..., None], "complex": lambda a, b: p(a, b) + 1e-9j, "flat": lambda a, b: 1.0,
        "raises": lambda a, b: {}["no such key"],
    }  # fmt: skip
    name = str(rng.choice(list(faults)))
    # means at some angles are right there
    means = () if name == "unnormalised at some angles" else MEANS
    if rng.random() < 0.5:
        return Drawn(f"density: {name}", lambda: ker.DensityLaw(faults[name]), (*means, *MATRICES, "gap"))
    rows = recipe_of(replace_density(kernel, faults[name]), False)
    tools = (*MATRICES, "gap", *(["applied"] if means else []))
    return Drawn(f"class with a density: {name}", lambda: Written(kernel.sample, rows), tools)


def replace_density(kernel: Kernel, density: Callable[[Array, Array], Any]) -> Any:
    """What `recipe_of` needs of a kernel, with another density."""
    return type("Other", (), {"density": staticmethod(density), "breaks": kernel.breaks})


def broken_sampler(rng: Rng) -> Drawn:
    """A class whose samples are no angles."""
    kernel = Kernel.drawn(rng)
    faults: dict[str, Callable[[Array], Any]] = {
        "beyond pi": lambda x: x + 1.0, "negative": lambda x: x - 1.0, "nan": lambda x: np.where(x > 1.5, np.nan, x),
        "one less": lambda x: x[:-1], "one number": lambda x: 1.0, "texts": lambda x: x.astype(str),
        "complex": lambda x: x + 0j, "raises": lambda x: {}["no such key"], "None": lambda x: None,
    }  # fmt: skip
    name = str(rng.choice(list(faults)))

    def draw(theta: Array, source: Rng) -> Any:
        return faults[name](kernel.sample(theta, source))

    return Drawn(f"samples: {name}", lambda: Written(draw, recipe_of(kernel, True)), ("sampled",))


def broken_atoms(rng: Rng) -> Drawn:
    """A class whose conditional distributions are none, or are not reversible although it says so."""
    draw, rows, _ = random_atoms(rng)
    size = float(rng.choice([1e-3, 0.3]))

    def of(nodes: Callable[[Array], Array], weights: Callable[[Array], Array]) -> Callable[..., Any]:
        def changed(theta: Array, *_: Any) -> Any:
            found = rows(theta)
            return ker.Conditionals.of_atoms(
                nodes(found.nodes.reshape(-1, 2)), weights(found.weights.reshape(-1, 2)), 0.0
            )

        return changed

    same: Callable[[Array], Array] = lambda x: x  # noqa: E731
    faults: dict[str, Callable[..., Any]] = {
        "signed": of(same, lambda w: w + np.array([1.0, -1.0])), "halves": of(same, lambda w: 0.5 * w),
        "sum": of(same, lambda w: (1.0 + size) * w), "nan": of(same, lambda w: np.where(w > 0.5, np.nan, w)),
        "beyond pi": of(lambda x: x + 2.0, same), "one angle": lambda theta, *_: rows(theta[:1]),
        "a pair": lambda theta, *_: (theta, theta), "None": lambda *_: None, "raises": lambda *_: {}["no such key"],
    }  # fmt: skip
    if rng.random() < 0.15:
        kernel = Kernel.drawn(rng, reversible=False)
        tools = ("gap", "mixing")
        return Drawn("asymmetric", lambda: Written(kernel.sample, recipe_of(kernel, True), True), tools)
    name = str(rng.choice(list(faults)))
    # at each single angle "one angle" is a law, whose gap 0 follows from single angles
    tools = ("applied", *MATRICES, *(() if name == "one angle" else ("gap",)))
    return Drawn(f"atoms: {name}", lambda: Written(draw, faults[name], True), tools)


def broken_array(rng: Rng) -> Drawn:
    """An array that is no matrix of probabilities, or a map that is no involution of the measure."""
    array = random_rows(rng)
    shift, negative = np.roll(np.eye(4), 1, axis=1), array.copy()
    negative[0, 0], negative[0, -1] = -0.25, array[0, 0] + array[0, -1] + 0.25
    makes: dict[str, Callable[[], ker.Law]] = {
        "sums": lambda: ker.MatrixLaw(0.99 * array), "nan": lambda: ker.MatrixLaw(np.nan * array),
        "negative": lambda: ker.MatrixLaw(negative), "row": lambda: ker.MatrixLaw(array[0]),
        "not square": lambda: ker.MatrixLaw(array[:-1]), "complex": lambda: ker.MatrixLaw(array + 0j),
        "no involution": lambda: ker.InvolutionLaw(lambda x: 0.5 * x),
        "map beyond pi": lambda: ker.InvolutionLaw(lambda x: x + 1.0),
        "map that stretches": lambda: ker.InvolutionLaw(lambda x: 2.0 * np.arctan(0.5 / np.tan(0.5 * x))),
        "exchange": lambda: ker.IntervalExchangeLaw(ker.discretise(ker.MatrixLaw(shift), ker.Bins(4))),
    }  # fmt: skip
    name = str(rng.choice(list(makes)))
    return Drawn(f"array or map: {name}", makes[name], (*MEANS, *MATRICES, "gap"))


def broken_measure(rng: Rng) -> Drawn:
    """A law that does not keep sin(theta) d theta, where a quantity assumes it."""
    array = np.array([[0.5, 0.0, 0.5], [0.25, 0.75, 0.0], [0.25, 0.75, 0.0]])
    makes = (lambda: ker.MatrixLaw(array), lambda: ker.DensityLaw(lambda a, b: 1.0 / np.pi + 0.0 * (a + b)))
    return Drawn("measure not kept", makes[rng.integers(2)], ("diffusive", "gap", "mixing"))


# Kinds and their shares.
GOOD = {
    density: 7, one_way_density: 2, written_density: 4, careless_class: 1, written_atoms: 3, involution: 2, exchange: 1,
    matrix_law: 4,
}  # fmt: skip
BROKEN = {broken_density: 5, broken_sampler: 3, broken_atoms: 4, broken_array: 2, broken_measure: 1}
