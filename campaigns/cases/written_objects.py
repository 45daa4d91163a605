"""Bases, bodies, containers, reflectors, functions and families as users write them, and such with a fault."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial
from scipy.special import ellipe

from asperity import geometry as geo
from asperity import kernels as ker
from campaigns.cases.written_laws import RETRO, Drawn, Kernel, Rng
from campaigns.judges.plain_quadrature import Array, Known, by_two_rules, rule

DISK = geo.Disk()
# E[1 + cos(theta' - theta)] under Lambert's law, specular reflection and retroreflection.
PUSHES = {"lambertian": 1.0 + (0.25 * np.pi) ** 2, "specular": 4.0 / 3.0, "retroreflection": 2.0}


@dataclass(frozen=True, eq=False)
class Tents(ker.Basis):
    """Continuous functions, linear in the cosine between equal steps, orthonormalised; and faults of it."""

    steps: int
    fault: str = ""
    measure = ker.SINE

    @property
    def nodes_per_interval(self) -> int:
        return 2 if self.fault == "too few nodes" else 16

    @property
    def size(self) -> int:
        return self.steps + 1

    @property
    def edges(self) -> Array:
        steps = max(self.steps // 2, 1) if self.fault == "edges of half of the kinks" else self.steps
        return np.concatenate([[0.0], np.arccos(1.0 - 2.0 * np.arange(1, steps) / steps), [np.pi]])

    @property
    def factor(self) -> Array:
        mass = np.diag(np.full(self.size, 4.0)) + np.diag(np.ones(self.steps), 1) + np.diag(np.ones(self.steps), -1)
        mass[0, 0] = mass[-1, -1] = 2.0
        return np.linalg.inv(np.linalg.cholesky(mass / (6.0 * self.steps)))

    @property
    def constant(self) -> Array:
        return np.linalg.solve(self.factor.T, np.ones(self.size))

    def evaluate(self, angle: Any) -> Array:
        at = 0.5 * self.steps * (1.0 - np.cos(np.asarray(angle, dtype=float)))
        found = np.maximum(1.0 - np.abs(at[..., None] - np.arange(self.size)), 0.0) @ self.factor.T
        changes: dict[str, Callable[[Array], Array]] = {
            "a function doubled": lambda x: x * np.append(np.ones(self.steps), 2.0), "complex": lambda x: x + 0j,
            "transposed": lambda x: np.moveaxis(x, -1, 0), "nan": lambda x: np.where(x > 0.9 * x.max(), np.nan, x),
            "one function twice": lambda x: np.concatenate([x[..., :1], x[..., :-1]], axis=-1),
        }  # fmt: skip
        return changes.get(self.fault, lambda x: x)(found)

    def key(self) -> tuple[object, ...]:
        return self.steps, self.fault

    def coarsened(self) -> None:
        return None


def user_basis(rng: Rng) -> Drawn:
    """Tents, in a matrix of a density."""
    kernel, basis = Kernel.drawn(rng), Tents(int(rng.integers(2, 12)))
    return Drawn("basis", lambda: (ker.DensityLaw(kernel.density, kernel.breaks), basis), ("in_basis",), kernel.truth())


def on_ellipse(a: float, b: float, count: int, rng: Rng) -> Array:
    """Points on an ellipse, counterclockwise."""
    turn = 2.0 * np.pi * (np.arange(count) + rng.uniform(-0.3, 0.3, count)) / count
    return np.column_stack([a * np.cos(turn), b * np.sin(turn)])


def length_of(points: Array) -> Array:
    return np.hypot(*np.diff(points, axis=0, append=points[:1]).T)


def body(rng: Rng) -> Drawn:
    """An ellipse, a polygon, or a disk with two laws by the normal; the truth is its resistance."""
    name, other = (str(rng.choice(list(PUSHES))) for _ in range(2))
    law, push = getattr(ker, name)(), PUSHES[name]
    a, ratio, form = float(rng.uniform(0.5, 2.0)), float(rng.choice([1.0, 3.0, 40.0, 1000.0])), int(rng.integers(3))
    if form == 0:
        perimeter = 4.0 * a * float(ellipe(1.0 - ratio**-2))
        return Drawn("body", lambda: ker.RoughBody.ellipse(law, a, a / ratio), ("body_drag",), 2.0 * perimeter * push)
    if form == 1:
        points = on_ellipse(a, a / ratio, int(rng.integers(3, 9)), rng)
        truth = 2.0 * float(length_of(points).sum()) * push
        return Drawn("body", lambda: ker.RoughBody.polygon(law, points), ("body_drag",), truth)
    low, width = float(rng.uniform(0.2, 3.0)), float(rng.choice([0.003, 0.1, 1.5]))

    def by_normal(normal: float) -> ker.Law:
        return getattr(ker, other)() if low < normal % (2.0 * np.pi) < low + width else law

    truth = 2.0 * a * ((2.0 * np.pi - width) * push + width * PUSHES[other])
    return Drawn("body of two laws", lambda: ker.RoughBody.disk(by_normal, a), ("body_drag",), truth)


def stream(rng: Rng) -> Drawn:
    """The force on a diffuse ellipse along an axis: 2 b, and pi/4 times the integral of (u . n)^2 over its front."""
    a, b = (float(10.0 ** rng.uniform(-2.0, 2.0)) for _ in range(2))

    def front(nodes: int) -> float:
        t, weight = rule((0.5 * np.pi,), nodes, levels=16)
        t = t - 0.5 * np.pi
        return float(weight @ ((b * np.cos(t)) ** 2 / np.hypot(b * np.cos(t), a * np.sin(t))))

    found = by_two_rules(front)
    truth = Known(2.0 * b + 0.25 * np.pi * found.value, found.error)
    return Drawn("body in a stream", lambda: ker.RoughBody.ellipse(ker.lambertian(), a, b), ("pushed",), truth)


def curved_sides(points: Array, rng: Rng) -> list[Array]:
    """Control points of the sides of a polygon, straight or bulging, also with a handle of length 0."""
    sides = []
    for start, end in zip(points, np.roll(points, -1, axis=0), strict=True):
        outward = 0.2 * rng.uniform(0.2, 1.0) * np.array([end[1] - start[1], start[0] - end[0]])
        middle = 0.5 * (start + end) + outward
        forms = ([start, end], [start, middle, end], [start, start, middle, end], [start, middle, end, end])
        sides.append(np.array(forms[rng.integers(4)]))
    return sides


def container(rng: Rng) -> Drawn:
    """A closed curve of Bezier pieces; the truth is its area and its perimeter."""
    sides = curved_sides(on_ellipse(1.0, 1.0, int(rng.integers(4, 8)), rng), rng)
    x, w = np.polynomial.legendre.leggauss(20)
    cells = np.linspace(0.0, 1.0, 33)
    t, weight = (cells[:-1, None] + 0.5 * (1.0 + x) / 32.0).ravel(), np.tile(0.5 * w / 32.0, 32)
    area = perimeter = 0.0
    for side in sides:
        coefficients = [Polynomial(each) for each in _powers(side)]
        (px, py), (dx, dy) = ([c(t) for c in coefficients], [c.deriv()(t) for c in coefficients])
        area += 0.5 * float(weight @ (px * dy - py * dx))
        perimeter += float(weight @ np.hypot(dx, dy))
    return Drawn("container", lambda: curves_of(sides), ("enclosed",), np.array([area, perimeter]))


def _powers(side: Array) -> Array:
    """Coefficients of powers of t of a Bezier curve, shape (2, degree + 1)."""
    bernstein = {2: [[1, 0], [-1, 1]], 3: [[1, 0, 0], [-2, 2, 0], [1, -2, 1]],
                 4: [[1, 0, 0, 0], [-3, 3, 0, 0], [3, -6, 3, 0], [-1, 3, -3, 1]]}  # fmt: skip
    return (np.array(bernstein[len(side)]) @ side).T


def curves_of(sides: list[Array]) -> geo.Container:
    return geo.Container.from_curves([geo.Segment(*each) if len(each) == 2 else geo.Bezier(each) for each in sides])


@dataclass(frozen=True)
class Mirror:
    """A reflector of a user's; with a fault it returns something else than the mirrored velocity."""

    change: Callable[[Array], Any] = lambda velocity: velocity * np.array([1.0, -1.0, 1.0])
    disk = DISK

    def sample(self, velocity: Array, rng: Any = None) -> Any:
        return self.change(np.asarray(velocity))


def reflector(rng: Rng) -> Drawn:
    """A smooth disk in a strip; the truth is the velocity with which it flies up."""
    return Drawn("reflector", Mirror, ("played",), rng.uniform(0.2, 2.0, 2))


def family(rng: Rng) -> Drawn:
    """Mixtures of Lambert's law with retroreflection, some of which refuse; the truth is their resistance."""
    low, width = float(rng.uniform(0.1, 0.7)), float(rng.choice([0.0, 0.2]))

    def member(a: float) -> ker.Law:
        if low < a < low + width:
            raise ValueError("no such wall")
        return a * ker.lambertian() + (1.0 - a) * RETRO

    def truth(a: float) -> float:
        return 0.75 * (a * PUSHES["lambertian"] + (1.0 - a) * 2.0)

    return Drawn("family", lambda: member, ("designed", "swept"), truth)


# ---- broken objects -------------------------------------------------------------------------------------------------
def broken_function(rng: Rng) -> Drawn:
    """A function to be averaged that has no finite real values of the shape of the angles."""
    functions: dict[str, Callable[[Array], Any]] = {
        "nan": lambda x: np.where(x > 1.0, np.nan, x), "complex": lambda x: np.exp(1j * x), "text": lambda x: "a",
        "shape": lambda x: x[:-1], "infinite": lambda x: np.where(x > 1.0, np.inf, x), "None": lambda x: None,
        "pole": lambda x: 1.0 / (x - 1.234) ** 2, "raises": lambda x: {}["no such key"],
    }  # fmt: skip
    name, kernel = str(rng.choice(list(functions))), Kernel.drawn(rng)
    return Drawn(
        f"function: {name}", lambda: (ker.DensityLaw(kernel.density, kernel.breaks), functions[name]), ("averaged",)
    )


def broken_basis(rng: Rng) -> Drawn:
    """A basis that is not orthonormal, real, or smooth between its edges."""
    faults = (
        "edges of half of the kinks", "a function doubled", "complex", "transposed", "nan", "one function twice",
        "too few nodes",
    )  # fmt: skip
    name, steps = str(rng.choice(faults)), 2 * int(rng.integers(2, 6))
    return Drawn(f"basis: {name}", lambda: (ker.henyey_greenstein(0.5), Tents(steps, name)), ("in_basis",))


def broken_body(rng: Rng) -> Drawn:
    """A polygon that is not convex or runs round twice, a law that is none."""
    square, star = on_ellipse(1.0, 1.0, 4, rng), on_ellipse(1.0, 1.0, 5, rng)[[0, 2, 4, 1, 3]]
    law, nan = ker.lambertian(), np.where(square > 0.0, np.nan, square)
    makes: dict[str, Callable[[], Any]] = {
        "round twice": lambda: ker.RoughBody.polygon(law, np.vstack([square, square])), "clockwise": lambda:
        ker.RoughBody.polygon(law, square[::-1]), "star": lambda: ker.RoughBody.polygon(law, star), "nan": lambda:
        ker.RoughBody.polygon(law, nan), "no law": lambda: ker.RoughBody.disk(lambda n: 0.5), "flat": lambda:
        ker.RoughBody.ellipse(law, 1.0, 0.0), "raises": lambda: ker.RoughBody.disk(lambda n: {}["no such key"]),
    }  # fmt: skip
    name = str(rng.choice(list(makes)))
    return Drawn(f"body: {name}", makes[name], ("body_drag",))


def broken_container(rng: Rng) -> Drawn:
    """Sides that cross, do not meet, run the other way, or are not finite."""
    sides = curved_sides(on_ellipse(1.0, 1.0, 5, rng), rng)
    straight = [each[[0, -1]] for each in sides]
    crossing = [*straight[:3], np.array([straight[3][0], straight[0][0] + 2.0, straight[3][1]]), straight[4]]
    makes: dict[str, list[Array]] = {
        "open": sides[:-1], "clockwise": [each[::-1] for each in sides[::-1]], "crossing": crossing,
        "bow-tie": [straight[0], np.array([straight[0][1], straight[2][1]]), np.array([straight[2][1], straight[2][0]]),
                    np.array([straight[2][0], straight[0][0]])],
        "nan": [sides[0] * np.nan, *sides[1:]], "apart": [sides[0] + 1e-3, *sides[1:]],
    }  # fmt: skip
    name = str(rng.choice(list(makes)))
    return Drawn(f"container: {name}", lambda: curves_of(makes[name]), ("enclosed",))


def broken_reflector(rng: Rng) -> Drawn:
    """A reflector whose velocities do not leave the wall, are not finite or have another shape."""
    faults: dict[str, Callable[[Array], Any]] = {
        "does not reflect": lambda v: v, "nan": lambda v: v * np.nan, "shape": lambda v: v[..., :2],
        "text": lambda v: "up", "along the wall": lambda v: v * np.array([1.0, 0.0, 1.0]), "None": lambda v: None,
        "raises": lambda v: {}["no such key"],
    }  # fmt: skip
    name = str(rng.choice(list(faults)))
    return Drawn(f"reflector: {name}", lambda: Mirror(faults[name]), ("played",))


def broken_family(rng: Rng) -> Drawn:
    """A family whose members all refuse, or are no laws."""
    members: dict[str, Callable[[float], Any]] = {
        "refuses": lambda a: ker.maxwell(a + 2.0), "numbers": lambda a: a, "None": lambda a: None,
        "raises": lambda a: np.linalg.inv(np.zeros((2, 2))),
    }  # fmt: skip
    name = str(rng.choice(list(members)))
    return Drawn(f"family: {name}", lambda: members[name], ("designed",))


# Kinds and their shares.
GOOD = {user_basis: 3, body: 4, stream: 2, container: 2, reflector: 1, family: 1}
BROKEN = {
    broken_function: 2, broken_basis: 3, broken_body: 2, broken_container: 2, broken_reflector: 1, broken_family: 1
}  # fmt: skip
