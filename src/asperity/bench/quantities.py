"""What the standard set computes, and of which walls: those of the set, random walls outside it, and walls of the user.

The quantities of a law are its matrix, first moment, resistance, distance from Lambert's law, largest spectral value,
diffusion and transmission.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import pairwise
from math import pi
from typing import Any

import numpy as np

from .. import geometry as geo
from ..core.checks import Floats
from ..core.errors import InputError
from ..core.estimates import Estimate
from ..geometry import Wall
from ..geometry.curves.curve import Curve
from ..kernels import (
    Basis,
    Bins,
    HemisphereLaw,
    KernelMatrix,
    Law,
    Legendre,
    Panels,
    PolygonLaw,
    WallLaw,
    discretise,
    distance,
    estimate,
    lambertian,
)
from ..kernels.bases.polynomials import MEAN_SINE, SINE_NORM, Directions
from ..kernels.discretisation.method import Budget
from ..kernels.discretisation.traced import traced_matrix
from ..kernels.matrices.matrix import frobenius_error
from ..spectral import WorkMethod, diffusivity, spectral_gap, spectrum, transmission
from ..spectral.consequences.clausing import Section

Point = tuple[float, float]

METRES_PER_DEGREE = 111_200.0
TRANSECT_ROW, EXAGGERATION = 170, 3.0
RANDOM_WALLS = 20


def terrain_profile() -> tuple[Floats, Floats]:
    """Distance along one row of matplotlib's elevation model, and height there, both in metres.

    The model shows the Jacksboro fault, from the U.S. Geological Survey's National Elevation Dataset.
    """
    from matplotlib import cbook

    with np.load(cbook.get_sample_data("jacksboro_fault_dem.npz", asfileobj=False)) as model:
        height = np.asarray(model["elevation"], dtype=np.float64)[TRANSECT_ROW]
        spacing = METRES_PER_DEGREE * float(model["dx"]) * np.cos(np.radians(float(model["ymin"])))
    return spacing * np.arange(len(height)), height


def _measured() -> geo.Wall:
    x, height = terrain_profile()
    return geo.Wall.from_profile(x, EXAGGERATION * height, seam="mirror")


def _mixed() -> geo.Wall:
    lines = geo.Segment.path(np.array([(0.0, 0.0), (0.2, -0.3), (0.35, 0.0), (0.45, 0.0)]))
    arc = geo.Arc((0.6, 0.0), 0.15, pi, 2.0 * pi)
    return geo.Wall([*lines, arc, geo.Bezier([(0.75, 0.0), (0.8, -0.4), (0.95, -0.4), (1.0, 0.0)])], period=1.0)


def random_wall(number: int) -> geo.Wall:
    """Random wall ``number``: the first valid wall from its own generator.

    The generator is ``numpy.random.default_rng([8, number])``. One to four joints have positions uniform in (0.1, 0.9)
    and depths uniform in (0.05, 0.8). Walls of even number are polygons. On the others every piece is, with equal
    probability, a segment, a circular arc whose height over its chord is 0.05 to 0.3 chords, to either side, or a cubic
    whose inner control points are off the chord by up to 0.35 chords. Every third wall has an additional flat top of
    length 0.25.
    """
    rng = np.random.default_rng([8, number])
    while True:
        inner = np.sort(rng.uniform(0.1, 0.9, int(rng.integers(1, 5))))
        joints = [(0.0, 0.0), *((float(x), -float(rng.uniform(0.05, 0.8))) for x in inner), (1.0, 0.0)]
        try:
            pieces = [_piece(start, end, number % 2 == 1, rng) for start, end in pairwise(joints)]
            if number % 3 == 0:
                pieces.append(geo.Segment((1.0, 0.0), (1.25, 0.0)))
            return geo.Wall(pieces, period=1.25 if number % 3 == 0 else 1.0)
        except InputError:
            # its pieces cross; draw again
            continue


def _piece(start: Point, end: Point, curved: bool, rng: np.random.Generator) -> Curve:
    kind = int(rng.integers(0, 3)) if curved else 0
    if kind == 0:
        return geo.Segment(start, end)
    first, last = np.array(start), np.array(end)
    along = last - first
    chord = float(np.hypot(*along))
    normal = np.array([along[1], -along[0]])
    if kind == 1:
        side = float(rng.choice([-1.0, 1.0]))
        height = float(rng.uniform(0.05, 0.3)) * chord
        radius = (0.25 * chord**2 + height**2) / (2.0 * height)
        center = 0.5 * (first + last) + side * (height - radius) / chord * normal
        begin, finish = (float(np.arctan2(*(point - center)[::-1])) for point in (first, last))
        if side * (finish - begin) < 0.0:
            finish += side * 2.0 * pi
        return geo.Arc(tuple(center), radius, begin, finish).pinned(start, end)
    bends = rng.uniform(-0.35, 0.35, 2)
    control = [tuple(first + (k + 1) / 3 * along + bends[k] * normal) for k in range(2)]
    return geo.Bezier([start, *control, end])


_STANDARD: dict[str, Callable[[], geo.Wall]] = {
    "triangular-teeth": partial(geo.triangular_teeth, 0.7),
    "rectangular-teeth": partial(geo.rectangular_teeth, 2.0),
    "focusing-arc": partial(geo.focusing_arcs, 1.2),
    "cusps": partial(geo.dispersing_arcs, 2.0),
    "mushroom": partial(geo.mushrooms, 0.3, 0.5),
    "koch": partial(geo.koch, 4),
    "profile": _measured,
    "mixed": _mixed,
}
_RANDOM = {f"random-{number}": partial(random_wall, number) for number in range(RANDOM_WALLS)}


def scenes() -> tuple[str, ...]:
    """Names of the walls with stored references: the standard set and the random walls."""
    return (*_STANDARD, *_RANDOM)


def standard_names() -> tuple[str, ...]:
    """Names of the scenes of the standard set."""
    return tuple(_STANDARD)


@cache
def wall_of(scene: str) -> geo.Wall:
    """The wall of a scene, or of a text as `wall_from_text` reads it, constructed once in each process."""
    build = (_STANDARD | _RANDOM).get(scene)
    return geo.wall_from_text(scene) if build is None else build()


# Methods with their budgets in the quick set and in the full set.
Methods = list[tuple[WorkMethod, tuple[float, ...], tuple[float, ...]]]
# Numbers of rays of sampling methods; the full ladder resolves orders to 0.15.
QUICK_RAYS, RAYS = tuple(4.0**k for k in (6, 7, 8)), tuple(4.0**k for k in (5, 6, 7, 8, 9, 10))
# Names of methods that are the library's own choice, or make references.
AUTO, CLOSED_FORM, BEAMS, ROWS, QMC = "auto", "closed form", "beams", "adaptive angles", "randomised QMC"
FLIGHTS = "flights"
# The error of sampled rays decreases with order 1/2. Strata and scrambled Sobol sequences in two dimensions reach 3/4
# if the integrand jumps along curves, as for indicators of bins and the laws of most walls.
RANDOM_ORDER, JUMPING_ORDER = 0.5, 0.75
# If the pieces of a wall are smaller than a stratum, its rays are as good as independent. A million strata have a side
# of 1/1024, so walls with more pieces than half of 1024 count as random.
MANY_PIECES = 512


@dataclass(frozen=True)
class Quantity:
    """A quantity of a wall.

    Attributes
    ----------
    name : str
    methods : callable
        ``methods(wall)`` returns triples of a `WorkMethod` and its budgets (quick, full).
    scenes : tuple of str
        Scenes of the standard set on which the quantity is measured.
    """

    name: str
    methods: Callable[[Wall], Methods]
    scenes: tuple[str, ...]


def matrix_methods(wall: Wall, basis: Basis) -> Methods:
    """The methods for the matrix of a wall's law that apply to the wall, the library's own choice first.

    The budget of "auto" and "adaptive angles" is 1/tolerance, that of "beams" the beams a hollow, with a bound for the
    others; all other methods have rays.

    >>> from asperity.bench.quantities import wall_of
    >>> [[method.order for method, *_ in matrix_methods(wall_of(name), Bins(4))][-3:] for name in ("cusps", "profile")]
    [[0.75, 0.75, 0.5], [0.5, 0.5, 0.5]]
    """
    # strata and Sobol sequences exceed 3/4 for continuous integrands, so orders are declared for bins only
    order = (RANDOM_ORDER if len(wall.pieces) > MANY_PIECES else JUMPING_ORDER) if isinstance(basis, Bins) else None

    def chosen(budget: float, rng: np.random.Generator) -> KernelMatrix:
        # each repeat has its own generator for sampling
        return discretise(WallLaw(wall), basis, tolerance=1.0 / budget, rng=rng)

    def sobol(rays: float, rng: np.random.Generator) -> KernelMatrix:
        return discretise(WallLaw(wall), basis, "qmc", samples=int(rays), rng=rng)

    def beams(number: float) -> KernelMatrix:
        return discretise(PolygonLaw(wall, max_beams=int(number)), basis, "exact")

    def by_formula(_: float) -> KernelMatrix:
        return discretise(WallLaw(wall), basis)

    found: Methods = [(WorkMethod(AUTO, chosen, True), (1e2, 1e6), (1e2, 1e3, 1e4, 1e6, 1e8))]
    if not WallLaw(wall).has_traced_parts:
        found.append((WorkMethod(CLOSED_FORM, by_formula), (1.0,), (1.0,)))
    if wall.is_polygonal and wall.closes:
        found.append((WorkMethod(BEAMS, beams), (1e3, 1e4), (1e2, 1e3, 1e4, 1e5)))
    adaptive = WorkMethod(ROWS, lambda budget: adaptive_matrix(wall, basis, 1.0 / budget))
    sampled = (
        WorkMethod(QMC, sobol, True, order),
        WorkMethod("stratified", lambda rays, rng: stratified_matrix(wall, basis, rays, rng), True, order),
        WorkMethod("Monte Carlo", lambda rays, rng: monte_carlo_matrix(wall, basis, rays, rng), True, RANDOM_ORDER),
    )
    found.append((adaptive, (1e2, 1e3), (1e2, 1e3, 1e4, 1e6, 1e8)))
    return [*found, *((method, QUICK_RAYS, RAYS) for method in sampled)]


def adaptive_matrix(wall: Wall, basis: Basis, tolerance: float) -> KernelMatrix:
    """By adaptive conditional distributions, for every wall."""
    symmetric, error, rays = traced_matrix(wall, basis, Budget(tolerance))
    how = frobenius_error(error, "estimate", f"adaptive angles, {rays} rays")
    return KernelMatrix(symmetric, basis, how, method="adaptive angles")


def stratified_matrix(wall: Wall, basis: Basis, budget: float, rng: np.random.Generator) -> KernelMatrix:
    """From one ray in every cell of a square grid over entry point and u."""
    side = round(budget**0.5)
    cell = np.arange(side)
    x = (cell[:, None] + rng.random((side, side))) / side
    u = -1.0 + 2.0 * (cell + rng.random((side, side))) / side
    theta = np.arccos(-u).ravel()
    return estimate(theta, WallLaw(wall).reflect(x.ravel(), theta), basis)


def monte_carlo_matrix(wall: Wall, basis: Basis, budget: float, rng: np.random.Generator) -> KernelMatrix:
    """From ``budget`` independent rays, traced even if a closed form could be sampled."""
    theta = np.arccos(1.0 - 2.0 * rng.random(int(budget)))
    return estimate(theta, WallLaw(wall).reflect(rng.random(int(budget)), theta), basis)


LAW_BASIS, MOMENT_BASIS, RESISTANCE_BASIS = Bins(32), Legendre(2), Directions()
# Scenes whose conditional distributions have a closed form.
DISTANCE_SCENES = ("triangular-teeth", "rectangular-teeth", "focusing-arc")
SAMPLED_BINS = 64


def _read_from(basis: Basis, read: Callable[[KernelMatrix], Any]) -> Callable[[Wall], Methods]:
    """Methods for a quantity that ``read`` computes from a matrix."""

    def reading(method: WorkMethod) -> WorkMethod:
        return replace(method, solve=lambda *how: read(method.solve(*how)))

    return lambda wall: [(reading(method), quick, full) for method, quick, full in matrix_methods(wall, basis)]


def moment_of(matrix: KernelMatrix) -> Estimate:
    """<u, P u>/<u, u>, from the matrix in Legendre polynomials."""
    return Estimate(float(matrix.symmetric[1, 1]), matrix.error.value, matrix.error.kind, matrix.method)


def resistance_of(symmetric: Floats) -> float:
    """(3/4) E[1 + cos(theta' - theta)] from the matrix in orthonormalised 1, cos and sin."""
    sine = np.array([MEAN_SINE, 0.0, SINE_NORM])
    return float(0.75 * (1.0 + symmetric[1, 1] / 3.0 + sine @ symmetric @ sine))


def _resistance(matrix: KernelMatrix) -> Estimate:
    # the norm of the coefficients of the matrix
    size = 0.75 * float(np.hypot(1.0 / 3.0, MEAN_SINE**2 + SINE_NORM**2))
    return Estimate(resistance_of(matrix.symmetric), size * matrix.error.value, matrix.error.kind, matrix.method)


def _distance_methods(wall: Wall) -> Methods:
    law = WallLaw(wall)

    def of_laws(budget: float) -> Estimate:
        return distance(law, lambertian(), tolerance=1.0 / budget)

    def of_bins(number: int) -> Estimate:
        return _to_lambert(discretise(law, Bins(number)))

    def of_samples(rays: float, rng: np.random.Generator) -> Estimate:
        return _to_lambert(monte_carlo_matrix(wall, Bins(SAMPLED_BINS), rays, rng))

    sizes = (16.0, 32.0, 64.0)
    # samples have a noise floor from their bins, and bins an error from their width, so neither has one order
    return [
        (WorkMethod(AUTO, of_laws), (1e2, 1e4), (1e2, 1e3, 1e4, 1e5, 1e6)),
        (WorkMethod("bins", of_bins), sizes, (*sizes, 128.0, 256.0, 512.0)),
        (WorkMethod("Monte Carlo", of_samples, True), (4.0**7, 4.0**8), tuple(4.0**k for k in (7, 8, 9, 10))),
    ]


def _to_lambert(matrix: KernelMatrix) -> Estimate:
    return distance(matrix, discretise(lambertian(), matrix.basis))


# The matrix of the law in bins, <u, P u>/<u, u>, and the mean resistance of a body with this wall.
LAW = Quantity("law", lambda wall: matrix_methods(wall, LAW_BASIS), standard_names())
MOMENT = Quantity("moment", _read_from(MOMENT_BASIS, moment_of), standard_names())
RESISTANCE = Quantity(
    "resistance", _read_from(RESISTANCE_BASIS, _resistance), ("triangular-teeth", "focusing-arc", "mixed")
)
DISTANCE = Quantity("distance", _distance_methods, DISTANCE_SCENES)
# Entry points at one grazing angle; the error of their midpoint rule is below the error of the finite angle.
ENTRY_POINTS = 2**16
ETA_SCENES = ("focusing-arc", "koch", "mixed")


def _second(wall: Wall, basis: Basis) -> Estimate:
    # the spectrum of the matrix, because for the law theorems and essential edges would be used
    found = spectrum(discretise(WallLaw(wall), basis), k=2)
    return Estimate(1.0 - found.gap, found.gap_error, "estimate", f"{found.basis!r}, {found.method}")


def _auto_second(wall: Wall, budget: float, rng: np.random.Generator) -> Estimate:
    gap = spectral_gap(WallLaw(wall), tolerance=1.0 / budget, rng=rng)
    return Estimate(1.0 - gap.value, gap.error, gap.kind, f"{gap.verdict}: {gap.method}")


def _eigenvalue_methods(wall: Wall) -> Methods:
    def panels(degree: int) -> Estimate:
        return _second(wall, Panels.for_wall(wall, degree=degree, smallest=1e-3))

    sizes = (4.0, 8.0, 16.0)
    return [
        (WorkMethod(AUTO, lambda n, rng: _auto_second(wall, n, rng), True), (1e2,), (1e2, 1e4, 1e6)),
        (WorkMethod("Legendre", lambda n: _second(wall, Legendre(n))), sizes, (*sizes, 32.0, 64.0)),
        (WorkMethod("bins", lambda n: _second(wall, Bins(n))), sizes, (*sizes, 32.0, 64.0, 128.0)),
        (WorkMethod("panels", panels), (1.0, 2.0), (1.0, 2.0, 3.0, 4.0)),
    ]


def _diffusivity_methods(wall: Wall) -> Methods:
    angles = (1e1, 1e2, 1e3)
    return [
        (WorkMethod(AUTO, lambda budget: _auto_eta(wall)), (1.0,), (1.0,)),
        (WorkMethod("rays at the angle 1/budget", lambda n: eta_at(wall, 1.0 / n)), angles, (*angles, 1e4, 1e5, 1e6)),
    ]


def _auto_eta(wall: Wall) -> Estimate:
    found = diffusivity(WallLaw(wall))
    return Estimate(found.eta, found.eta_error, found.kind, found.method)


def eta_at(wall: Wall, angle: float) -> float:
    """(1 + zeta)/(1 - zeta) with zeta = E[cot(Theta)/cot(theta)] at a small angle and its mirror image."""
    entry = (np.arange(ENTRY_POINTS) + 0.5) / ENTRY_POINTS
    law, total = WallLaw(wall), 0.0
    for theta in (angle, np.pi - angle):
        # the sign of cot(Theta) is opposite in the specular convention
        total -= float(np.mean(np.tan(theta) / np.tan(law.reflect(entry, theta))))
    return (1.0 + 0.5 * total) / (1.0 - 0.5 * total)


# The largest spectral value off the constants.
EIGENVALUE = Quantity("lambda2", _eigenvalue_methods, standard_names())
# The slope of L^2/tau against ln L in a long channel, over that between diffuse walls.
DIFFUSIVITY = Quantity("eta", _diffusivity_methods, ETA_SCENES)
LENGTH = 10.0
# Scenes that have no wall: their channel or tube reflects diffusely.
DIFFUSE: dict[str, Section] = {"diffuse-channel": "channel", "diffuse-tube": "tube"}


def diffuse_methods(scene: str) -> Methods:
    """The methods for diffuse reflection."""
    return _methods(lambertian(), DIFFUSE[scene])


def _methods(law: Law, section: Section) -> Methods:
    def chosen(budget: float, rng: np.random.Generator) -> Estimate:
        return transmission(law, LENGTH, section, 1.0 / budget, rng)

    def flights(budget: float, rng: np.random.Generator) -> Estimate:
        # in space, where no polynomials are tried
        return transmission(HemisphereLaw(law, 0.5 * np.pi), LENGTH, section, 1.0 / budget, rng)

    found: Methods = [(WorkMethod(AUTO, chosen, True), (1e2, 1e3), (1e2, 1e3, 1e4, 1e5))]
    # laws of grooves contain no diffuse reflection in a tube
    if section == "channel":
        found.append((WorkMethod(FLIGHTS, flights, True), (4e2, 1e3), (4e2, 1e3, 2e3)))
    return found


# The probability that a particle passes.
TRANSMISSION = Quantity("transmission", lambda wall: _methods(WallLaw(wall), "channel"), ("focusing-arc", *DIFFUSE))
