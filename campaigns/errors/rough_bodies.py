"""Whether resistance and force of random rough bodies have the errors that they report.

Bodies are ellipses of ratios up to 10^4, smooth closed curves, polygons, and curves with straight sides. Their laws are
mixtures of specular reflection, retroreflection, Lambertian reflection and a matrix of two bins, constant, with jumps,
in strips, or varying smoothly. The judge follows points along the curve, with the laws as maps of vectors and Gauss
rules between all known jumps; a narrow strip is declared to the library by its breakpoints.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import reduce
from operator import add

import numpy as np

from asperity import kernels as ker
from asperity.estimates import Estimate
from campaigns.engine import Campaign, Judged

Floats = np.ndarray
TURN = 2.0 * math.pi
# Accuracy of the judge, relative to the perimeter, and Gauss nodes along the boundary and in each half of the angles.
ROUNDING, ALONG, ANGLES = 1e-12, 20, 14
SWAP = 0.3
BINS = ker.MatrixLaw([[1.0 - SWAP, SWAP], [SWAP, 1.0 - SWAP]])
PURE = (ker.specular(), ker.retroreflection(), ker.lambertian(), BINS)
# Widths of strips: those that are found, and those whose ends are declared.
FOUND, DECLARED = (0.0017, 0.3), (1e-5, 1e-2)
Weights = Callable[[Floats], Floats]


@dataclass(frozen=True)
class Case:
    """A body, the weights of the pure laws at normals, shape (4, n), and how the judge goes along its boundary.

    ``curve`` has normals and lengths between given normals; ``jumps`` are those of the weights.
    """

    kind: str
    body: ker.RoughBody
    weights: Weights
    curve: Callable[[Floats], tuple[Floats, Floats]]
    jumps: Floats
    direction: float
    tolerance: float
    spin: tuple[ker.Law, float] | None


def draw(number: int) -> Case:
    """A random case."""
    rng = np.random.default_rng([20261127, number])
    how, weights, law, jumps, declared = _laws(rng)
    shape = rng.choice(["ellipse", "curve", "polygon", "rounded"], p=[0.4, 0.3, 0.1, 0.2])
    if shape == "ellipse":
        a, b = np.exp(rng.uniform(-1.0, 1.0)) * np.array([1.0, 10.0 ** -rng.uniform(0.0, 4.0)])[rng.permutation(2)]
        body = ker.RoughBody.ellipse(law, a, b, breakpoints=declared)
        curve = _ellipse(a, b)
    else:
        radius = _radius(rng) if shape != "polygon" else None
        sides, lengths = _sides(rng) if shape != "curve" else (np.empty(0), np.empty(0))
        body = ker.RoughBody(sides, lengths, law, radius=radius, breakpoints=declared)
        curve = _curve(radius, sides, lengths)
    spin = (law, float(rng.uniform(-2.0, 2.0))) if how == "one law" else None
    tolerance = 10.0 ** rng.uniform(-10.0, -5.0)
    return Case(f"{shape}, {how}", body, weights, curve, jumps, float(rng.uniform(0.0, TURN)), tolerance, spin)


def _mixture(weights: Floats) -> ker.Law:
    return reduce(add, (float(one) * law for one, law in zip(weights, PURE, strict=True)))


def _laws(rng: np.random.Generator) -> tuple[str, Weights, object, Floats, Floats]:
    """How the law varies, its weights at normals, the law, its jumps, and those that are declared."""
    kinds = ["one law", "pieces", "strip", "smooth", "smooth with a strip"]
    kind = str(rng.choice(kinds))
    mixtures = rng.dirichlet(np.full(4, 0.5), 4)
    if kind == "one law":
        return kind, lambda n: np.repeat(mixtures[:1].T, n.size, axis=1), _mixture(mixtures[0]), np.empty(0), ()
    if kind in ("pieces", "strip"):
        ends = np.sort(rng.uniform(0.0, TURN, 3))
        if kind == "strip":
            width = math.exp(rng.uniform(*np.log(FOUND)))
            ends = ends[0] * (1.0 - width / TURN) + np.array([0.0, width])
        laws = [_mixture(one) for one in mixtures]
        which = lambda n: np.searchsorted(ends, n, side="right") % ends.size  # noqa: E731
        return kind, lambda n: mixtures[which(n)].T, lambda n: laws[which(n)], ends, ()
    phase, start = rng.uniform(0.0, TURN, 2)
    width = math.exp(rng.uniform(*np.log(DECLARED))) if "strip" in kind else 0.0
    ends = np.array([start * (1.0 - width / TURN), start * (1.0 - width / TURN) + width])

    def weights(n: Floats) -> Floats:
        part = 0.5 + 0.5 * np.cos(n - phase) ** 3
        found = (1.0 - part) * mixtures[0][:, None] + part * mixtures[1][:, None]
        return np.where((n > ends[0]) & (n < ends[1]), mixtures[2][:, None], found)

    declared = ends if width else ()
    return kind, weights, lambda n: _mixture(weights(np.array([n]))[:, 0]), ends[: 2 * bool(width)], declared


def _radius(rng: np.random.Generator) -> Callable[[Floats], Floats]:
    orders = np.arange(2, 8)
    size, phase = rng.dirichlet(np.ones(6)) * rng.uniform(0.0, 1.0), rng.uniform(0.0, TURN, 6)
    scale = math.exp(rng.uniform(-1.0, 1.0))
    return lambda n: scale * (1.0 + np.cos(np.multiply.outer(n, orders) + phase) @ size)


def _sides(rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Directions of the normals and lengths of the sides of a random convex polygon."""
    step = rng.normal(size=(int(rng.integers(3, 8)), 2))
    step -= step.mean(axis=0)
    return np.mod(np.arctan2(-step[:, 0], step[:, 1]), TURN), np.hypot(*step.T)


def _composite(edges: Floats) -> tuple[Floats, Floats]:
    node, weight = np.polynomial.legendre.leggauss(ALONG)
    half = 0.5 * np.diff(edges)[:, None]
    return (edges[:-1, None] + half * (1.0 + node)).ravel(), (half * weight).ravel()


def _ellipse(a: float, b: float) -> Callable[[Floats], tuple[Floats, Floats]]:
    """Along (a cos t, b sin t), on panels that shrink towards the vertices."""

    def along(cuts: Floats) -> tuple[Floats, Floats]:
        shrinking = min(a / b, b / a)
        steps = shrinking * 2.0 ** np.arange(-6.0, 1.0 - math.log2(shrinking))
        vertices = 0.5 * math.pi * np.arange(5)
        edges = [vertices, *(np.add.outer(sign * steps, vertices).ravel() for sign in (-1.0, 1.0))]
        edges.append(np.mod(np.arctan2(b * np.sin(cuts), a * np.cos(cuts)), TURN))
        edge = np.unique(np.concatenate(edges))
        t, weight = _composite(edge[(edge >= 0.0) & (edge <= TURN)])
        normal = np.mod(np.arctan2(a * np.sin(t), b * np.cos(t)), TURN)
        return normal, weight * np.hypot(a * np.sin(t), b * np.cos(t))

    return along


def _curve(radius: Callable[[Floats], Floats] | None, sides: Floats, lengths: Floats) -> Callable[..., object]:
    def along(cuts: Floats) -> tuple[Floats, Floats]:
        if radius is None:
            return sides, lengths
        normal, weight = _composite(np.unique(np.concatenate((np.linspace(0.0, TURN, 60), np.mod(cuts, TURN)))))
        return np.append(sides, normal), np.append(lengths, weight * radius(normal))

    return along


def _force(normal: Floats, weights: Floats, direction: float) -> Floats:
    """Force along and across a stream on unit elements with these normals, shape (2, n), by vectors."""
    source = np.array([math.cos(direction), math.sin(direction)])
    out = np.stack([np.cos(normal), np.sin(normal)])
    tangent = np.stack([out[1], -out[0]])
    onto = np.maximum(source @ out, 0.0)
    side = np.where(source @ tangent > 0.0, 1.0, -1.0)
    mean = (
        weights[0] * (2.0 * onto * out - source[:, None]) + weights[1] * source[:, None]
        + weights[2] * 0.25 * math.pi * out
        + weights[3] * (0.25 * math.pi * out + side * 0.5 * (1.0 - 2.0 * SWAP) * tangent)
    )  # fmt: skip
    push = -onto * (source[:, None] + mean)
    return np.stack([-source @ push, np.array([source[1], -source[0]]) @ push])


def _cost(u: Floats, v: Floats) -> Floats:
    return (1.0 + np.cos(u - v)) ** 2 * (1.0 + 0.5 * np.cos(u)) + np.sin(v) ** 2


def _mean_costs(normal: Floats, weights: Floats, cost: Callable[[Floats, Floats], Floats]) -> Floats:
    """The integrals over directions of the flux times the mean of a cost, for elements with these normals."""
    node, weight = np.polynomial.legendre.leggauss(ANGLES)
    half = 0.25 * math.pi
    phi, rule = np.append(half * (node - 1.0), half * (node + 1.0)), half * np.append(weight, weight)
    flux = rule * np.cos(phi)
    n, u = normal[:, None], normal[:, None] + phi
    table = cost(u[..., None], (n + phi)[:, None, :])
    same = np.where(np.equal.outer(phi > 0.0, phi > 0.0), 1.0 - SWAP, SWAP)
    found = [cost(u, n - phi) @ flux, cost(u, u + 0.0) @ flux, 0.5 * (table @ flux) @ flux]
    found.append(np.einsum("nij,ij,i,j->n", table, same, flux, flux, optimize=True))
    return np.sum(weights * np.stack(found), axis=0)


def judge(case: Case) -> Iterator[Judged]:
    """Resistance, the mean of another cost, force, and force and torque with spin of a disk with one law."""
    cuts = np.concatenate((case.jumps, case.direction + 0.5 * math.pi * np.arange(-1.0, 2.0)))
    normal, length = case.curve(cuts)
    weights, size = case.weights(normal), float(np.sum(length))
    yield _judged("perimeter", case, case.body.perimeter, size, size)
    single = np.array([8.0 / 3.0, 4.0, 2.0 + math.pi**2 / 8.0, 2.0 + math.pi**2 / 8.0 + (0.5 - SWAP)])
    yield _judged("resistance", case, case.body.resistance(case.tolerance), float(single @ weights @ length), size)
    force = _force(normal, weights, case.direction) @ length
    found = case.body.force(case.direction, case.tolerance)
    for number, exact in zip((found.along, found.across), force, strict=True):
        yield _judged("force", case, number, exact, size)
    if "smooth" not in case.kind:
        parts = np.array_split(np.arange(normal.size), 1 + normal.size // 400)
        exact = math.fsum(float(_mean_costs(normal[k], weights[:, k], _cost) @ length[k]) for k in parts)
        yield _judged("cost", case, case.body.resistance(case.tolerance, cost=_cost), exact, size)
    if case.spin is not None:
        yield from _spin(case, *case.spin)


def _spin(case: Case, law: ker.Law, spin: float) -> Iterator[Judged]:
    """A disk of radius 1 in a stream of velocity (-1, 0), by velocities relative to the rim."""
    known = [math.asin(spin)] if abs(spin) < 1.0 else []
    phi, length = _composite(np.unique([*np.linspace(-0.5 * math.pi, 0.5 * math.pi, 40), *known]))
    out, rim = np.stack([np.cos(phi), np.sin(phi)]), np.stack([-np.sin(phi), np.cos(phi)])
    relative = np.array([[-1.0], [0.0]]) - spin * rim
    onto, level = -np.sum(relative * out, axis=0), np.sum(relative * rim, axis=0)
    speed, weights = np.hypot(onto, level), case.weights(phi)
    halved = np.where(level > 0.0, 1.0, -1.0) * 0.5 * (1.0 - 2.0 * SWAP)
    after = (
        weights[0] * (level * rim + onto * out) - weights[1] * relative
        + weights[2] * 0.25 * math.pi * speed * out
        + weights[3] * speed * (0.25 * math.pi * out - halved * rim)
    )  # fmt: skip
    push = np.cos(phi) * (relative - after)
    exact = (-push[0] @ length, -push[1] @ length, np.sum(push * rim, axis=0) @ length)
    found = ker.spin_force(law, spin)
    for number, value in zip((found.along, found.across, found.torque), exact, strict=True):
        yield _judged("spin", case, number, float(value), 4.0)


def _judged(what: str, case: Case, number: Estimate, exact: float, size: float) -> Judged:
    useless = float(number.error) > max(1e-3 * size, 100.0 * case.tolerance * size)
    fault = f"{case.kind}: error {number.error:.2g} of {exact:.6g}" if useless else ""
    return Judged(what, number.error, abs(number.value - exact), ROUNDING * size, fault)


CAMPAIGNS = (
    Campaign("rough-bodies", "Do errors of forces on rough bodies hold?", draw, judge, 400, [2, 7, 9, 13], level=0.95),
)
