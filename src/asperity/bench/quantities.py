"""The quantities of the standard set: what they are, by which methods, and against which references."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import geometry as geo
from ..checks import Floats
from ..estimates import Estimate
from ..kernels import Bins, CollisionLaw, KernelMatrix, Legendre, Panels, WallLaw
from ..spectral import ReferenceValue, WorkMethod, spectral_gap, spectrum
from .matrix_references import matrix_references
from .routes import Route, routes_for

if TYPE_CHECKING:
    from ..geometry import Wall
    from ..kernels import Basis

LAW_BASIS, MOMENT_BASIS = Bins(32), Legendre(2)
# A disk of uniform mass.
DISK = geo.Disk(1.0, 0.5)
# lambda_2 of a law made of isometries is the supremum of its essential spectrum.
POLYGONAL_EDGE = 1.0
# Means over Lambda^2 of sin(psi)^2 and cos(psi)^2.
SINE_MEAN, COSINE_MEAN = 0.75, 0.25
# Panels of the reference for lambda_2: degrees and smallest angles, the finer ones last.
QUICK_PANELS, FULL_PANELS = ((2, 1e-2), (3, 1e-2)), ((3, 1e-2), (4, 1e-3))
# True disks at every scale: their noise is about 0.002.
TRUE_DISKS = 2**18


@dataclass(frozen=True)
class Quantity:
    """A quantity of a wall.

    Attributes
    ----------
    name : str
    summary : str
    methods : callable
        ``methods(wall)`` gives pairs of a `WorkMethod` and its budgets (quick, full).
    references : callable
        ``references(wall, quick)`` gives the references; none where no independent one is known.
    """

    name: str
    summary: str
    methods: Callable[[Wall], list[tuple[WorkMethod, tuple[float, ...], tuple[float, ...]]]]
    references: Callable[[Wall, bool], tuple[ReferenceValue, ...]]


Methods = list[tuple[WorkMethod, tuple[float, ...], tuple[float, ...]]]


def _by_routes(basis: Basis, read: Callable[[KernelMatrix], Any], in_bins: bool = False) -> Callable[[Wall], Methods]:
    """Methods for what can be read off a matrix."""

    def method(wall: Wall, route: Route) -> WorkMethod:
        # strata and nets do better than 3/4 where the integrand does not jump: declared for bins alone
        order = route.order if in_bins or route.order == 0.5 else None
        return WorkMethod(
            route.name, lambda budget, *rng: read(route.matrix(wall, basis, budget, *rng)), route.is_random, order
        )

    return lambda wall: [(method(wall, route), route.quick, route.full) for route in routes_for(wall)]


def _law_references(wall: Wall, quick: bool) -> tuple[ReferenceValue, ...]:
    return tuple(
        ReferenceValue(matrix.symmetric, error, source, made_by)
        for matrix, error, source, made_by in matrix_references(wall, LAW_BASIS, quick)
    )


def moment_of(matrix: KernelMatrix) -> Estimate:
    """<u, P u>/<u, u>, from the matrix in Legendre polynomials."""
    return Estimate(float(matrix.symmetric[1, 1]), matrix.error.value, matrix.error.kind, matrix.method)


def _moment_references(wall: Wall, quick: bool) -> tuple[ReferenceValue, ...]:
    return tuple(
        ReferenceValue(matrix.symmetric[1, 1], error, source, made_by)
        for matrix, error, source, made_by in matrix_references(wall, MOMENT_BASIS, quick)
    )


def velocity_share() -> tuple[float, float]:
    """Factors a, b of v1 = a cos(theta) sin(psi) + b cos(psi) at speed 1."""
    frame = np.asarray(DISK.frame)
    return float(frame[0, 0]), float(frame[2, 0])


def correlation_of(moment: float) -> float:
    r"""<v1, K v1>/<v1, v1> in Lambda^2 from <u, P~ u>/<u, u>.

    v1 = a cos theta sin psi + b cos psi, and K keeps sin psi and turns the sign of cos psi.
    """
    along, roll = (share**2 for share in velocity_share())
    plane = along * SINE_MEAN / 3.0
    return (plane * moment - roll * COSINE_MEAN) / (plane + roll * COSINE_MEAN)


def _collision_references(wall: Wall, quick: bool) -> tuple[ReferenceValue, ...]:
    slope = correlation_of(1.0) - correlation_of(0.0)
    return tuple(
        ReferenceValue(correlation_of(float(one.value)), slope * one.error, f"{one.source}, psi by hand", one.made_by)
        for one in _moment_references(wall.foreshorten(DISK), quick)
    )


def _collision_methods(wall: Wall) -> Methods:
    rays = tuple(4.0**k for k in (6, 7, 8, 9, 10, 11))
    return [
        (
            WorkMethod("auto", lambda budget: _by_operator(wall, tolerance=1.0 / budget)),
            (1e2, 1e6),
            (1e2, 1e4, 1e6, 1e8),
        ),
        (
            WorkMethod("QMC operator", lambda n, rng: _by_operator(wall, method="qmc", samples=n, rng=rng), True),
            rays[:3],
            rays,
        ),
        (WorkMethod("sampled velocities", lambda n, rng: _by_velocities(wall, n, rng), True, 0.5), rays[:3], rays),
        (WorkMethod("means over outgoing angles", lambda n: _by_action(wall, n)), (8, 16), (8, 16, 32, 64, 128)),
    ]


def _by_operator(wall: Wall, **how: Any) -> Estimate:
    """From the matrix of K on polynomials of degree below 2 in either angle, which hold v1."""
    operator = CollisionLaw.from_wall(wall, DISK).operator(Legendre(2), Legendre(2, weight="sin2"), **how)
    along, roll = velocity_share()
    # v1 in the orthonormal product basis: only the mean over psi of sin(psi) is not a polynomial, so split by hand
    moment = operator.theta_matrix.symmetric[1, 1]
    psi = operator.flip[1, 1]
    plane, turn = along**2 * SINE_MEAN / 3.0, roll**2 * COSINE_MEAN
    error = plane / (plane + turn) * operator.theta_matrix.error.value
    value = (plane * moment + turn * psi) / (plane + turn)
    return Estimate(value, error, operator.theta_matrix.error.kind, operator.theta_matrix.method)


def _by_velocities(wall: Wall, number: int, rng: np.random.Generator) -> float:
    """Sampled in the original coordinates: incoming velocities from Lambda^2, one collision each."""
    incoming = -sampled_velocities(number, rng)
    outgoing = CollisionLaw.from_wall(wall, DISK).sample(incoming, rng)
    return float(np.mean(-incoming[:, 0] * outgoing[:, 0]) / _square_of_v1())


def sampled_velocities(number: int, rng: np.random.Generator) -> Floats:
    """Outgoing velocities of speed 1 from Lambda^2, shape (number, 3)."""
    cos_theta = 1.0 - 2.0 * rng.random(number)
    # sin(psi)^2 d psi is the law of the polar angle of a uniform point on the three-dimensional sphere
    gauss = rng.standard_normal((number, 4))
    psi = np.arccos(gauss[:, 0] / np.linalg.norm(gauss, axis=1))
    return np.asarray(DISK.from_angles(np.arccos(cos_theta), psi))


def _square_of_v1() -> float:
    along, roll = velocity_share()
    return along**2 * SINE_MEAN / 3.0 + roll**2 * COSINE_MEAN


def _by_action(wall: Wall, nodes: int) -> float:
    """From K v1 at Gauss nodes in cos(theta) and Gauss-Chebyshev nodes in psi."""
    along, roll = velocity_share()
    cosines, weights = np.polynomial.legendre.leggauss(nodes)
    theta = np.arccos(cosines)[:, None]
    psi = np.pi * np.arange(1, 5) / 5.0
    psi_weights = np.sin(psi) ** 2 / np.sum(np.sin(psi) ** 2)

    def v1(angle: Any, roll_angle: Any) -> Floats:
        return np.asarray(along * np.cos(angle) * np.sin(roll_angle) + roll * np.cos(roll_angle))

    image = CollisionLaw.from_wall(wall, DISK).apply(v1, theta, psi)
    total = np.sum(0.5 * weights[:, None] * psi_weights * v1(theta, psi) * image)
    return float(total) / _square_of_v1()


def _second(matrix_or_law: Any, **how: Any) -> Estimate:
    found = spectrum(matrix_or_law, k=2, **how)
    return Estimate(1.0 - found.gap, found.gap_error, "estimate", f"{found.basis!r}, {found.method}")


def _auto_second(wall: Wall, budget: float) -> Estimate:
    gap = spectral_gap(WallLaw(wall), tolerance=1.0 / budget)
    return Estimate(1.0 - gap.value, gap.error, gap.kind, f"{gap.verdict}: {gap.method}")


def _eigenvalue_methods(wall: Wall) -> Methods:
    sizes = (4.0, 8.0, 16.0)
    found: Methods = [
        (WorkMethod("auto", lambda budget: _auto_second(wall, budget)), (1e2,), (1e2, 1e4, 1e6)),
        (WorkMethod("Legendre", lambda n: _second(WallLaw(wall), basis=Legendre(n))), sizes, (*sizes, 32.0, 64.0)),
        (WorkMethod("bins", lambda n: _second(WallLaw(wall), basis=Bins(n))), sizes, (*sizes, 32.0, 64.0, 128.0)),
        (
            WorkMethod(
                "panels", lambda n: _second(WallLaw(wall), basis=Panels.for_wall(wall, degree=n, smallest=1e-3))
            ),
            (1.0, 2.0),
            (1.0, 2.0, 3.0, 4.0),
        ),
    ]
    return found


def _eigenvalue_references(wall: Wall, quick: bool) -> tuple[ReferenceValue, ...]:
    if wall.is_polygonal:
        return (ReferenceValue(POLYGONAL_EDGE, 0.0, "theorem: 1 is in the essential spectrum of isometries"),)
    if WallLaw(wall).closed_form is None:
        return ()
    coarse, fine = (
        _second(WallLaw(wall), basis=Panels.for_wall(wall, degree=degree, smallest=smallest))
        for degree, smallest in (QUICK_PANELS if quick else FULL_PANELS)
    )
    source = "two families of graded panels, the error their difference"
    return (ReferenceValue(fine.value, abs(fine.value - coarse.value), source),)


def _disk_methods(wall: Wall) -> Methods:
    scales = (10.0, 100.0, 1000.0)
    method = WorkMethod("true disk, budget 1/eps", lambda inverse, rng: _by_true_disks(wall, 1.0 / inverse, rng), True)
    return [(method, scales, (*scales, 1e4, 1e5))]


def _disk_references(wall: Wall, quick: bool) -> tuple[ReferenceValue, ...]:
    """Those of the limit; none without the rigid tracer, and none for pieces that it does not have."""
    if not hasattr(geo, "collide") or "beziers" in wall.scene.primitives:
        return ()
    return _collision_references(wall, quick)


def _by_true_disks(wall: Wall, scale: float, rng: np.random.Generator) -> float:
    """<v1, K v1>/<v1, v1> of the disk with satellites above a wall of this scale."""
    incoming = -sampled_velocities(TRUE_DISKS, rng)
    position = np.column_stack([scale * wall.period * rng.random(TRUE_DISKS), 2.0 * np.pi * rng.random(TRUE_DISKS)])
    # the incoming velocities follow sin(theta), as the flux through x2 = 0 does
    hit = geo.collide(DISK, wall, scale, position, incoming)  # type: ignore[attr-defined, unused-ignore]
    found = float(np.mean((-incoming[:, 0] * hit.velocity[:, 0])[hit.escaped]))
    return found / _square_of_v1()


QUANTITIES: Mapping[str, Quantity] = MappingProxyType(
    {
        one.name: one
        for one in (
            Quantity(
                "law", "the matrix of the law in 32 bins",
                _by_routes(LAW_BASIS, lambda matrix: matrix, in_bins=True), _law_references,
            ),
            Quantity("moment", "<u, P u>/<u, u>", _by_routes(MOMENT_BASIS, moment_of), _moment_references),
            Quantity(
                "lambda2", "the largest spectral value off the constants", _eigenvalue_methods, _eigenvalue_references
            ),
            Quantity(
                "collision", "<v1, K v1>/<v1, v1> of a uniform disk", _collision_methods, _collision_references
            ),
            Quantity("disk", "that of the true disk at scale eps", _disk_methods, _disk_references),
        )
    }
)  # fmt: skip
