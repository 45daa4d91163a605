"""The problems SCENE/QUANTITY: their names, and what is computed of them in a process that can be killed."""

from __future__ import annotations

from collections.abc import Sequence
from fnmatch import fnmatch
from functools import cache
from typing import Any

import numpy as np

from .. import geometry as geo
from ..core.checks import Floats
from ..core.errors import InputError
from ..core.estimates import Estimate
from ..kernels import CollisionLaw, Legendre
from ..spectral import ReferenceValue, WorkMethod, WorkProblem
from ..spectral.work_diagrams.problem import on_one_core
from ..spectral.work_diagrams.report import WorkRow
from ..spectral.work_diagrams.runs import measure, parts_of, solve_once
from .quantities import (
    AUTO,
    DIFFUSE,
    DIFFUSIVITY,
    DISTANCE,
    EIGENVALUE,
    LAW,
    MOMENT,
    QUICK_RAYS,
    RANDOM_ORDER,
    RAYS,
    RESISTANCE,
    TRANSMISSION,
    Methods,
    Quantity,
    diffuse_methods,
    scenes,
    standard_names,
    wall_of,
)


def _collision_methods(wall: geo.Wall) -> Methods:
    by_tolerance = WorkMethod(AUTO, lambda n, rng: by_operator(wall, tolerance=1.0 / n, rng=rng), True)
    by_nets = WorkMethod("QMC operator", lambda n, rng: by_operator(wall, method="qmc", samples=n, rng=rng), True)
    by_sampling = WorkMethod("sampled velocities", lambda n, rng: by_velocities(wall, n, rng), True, RANDOM_ORDER)
    by_means = WorkMethod("means over outgoing angles", lambda n: by_action(wall, n))
    return [
        (by_tolerance, (1e2, 1e6), (1e2, 1e4, 1e6, 1e8)),
        (by_nets, QUICK_RAYS, RAYS),
        (by_sampling, QUICK_RAYS, RAYS),
        (by_means, (8, 16), (8, 16, 32, 64, 128)),
    ]


# <v1, K v1>/<v1, v1> of a uniform disk, in the small-scale limit and for the true disk at a scale.
COLLISION = Quantity("collision", _collision_methods, standard_names())
# Not the wall of all kinds of pieces, for which there are no reference values of collisions.
DISK_SCENES = tuple(name for name in standard_names() if name != "mixed")


def _disk_methods(wall: geo.Wall) -> Methods:
    method = WorkMethod("true disk, budget 1/eps", lambda inverse, rng: by_true_disks(wall, 1.0 / inverse, rng), True)
    return [(method, (1e1, 1e2, 1e3), (1e1, 1e2, 1e3, 1e4, 1e5))]


TRUE_DISK = Quantity("disk", _disk_methods, DISK_SCENES)
QUANTITIES = {
    one.name: one
    for one in (LAW, MOMENT, EIGENVALUE, COLLISION, TRUE_DISK, RESISTANCE, DISTANCE, DIFFUSIVITY, TRANSMISSION)
}
# The quantity of the random walls, and those of a wall of the user.
RANDOM_QUANTITY, OWN_QUANTITIES = MOMENT.name, (LAW.name, MOMENT.name, RESISTANCE.name, TRANSMISSION.name)
# The repeat whose generator makes the rays of a reference: no row has as many.
REFERENCE_REPEAT = 2**20


def problem_names(patterns: Sequence[str] = ()) -> list[str]:
    """Names SCENE/QUANTITY that match a pattern; without patterns, the names of the standard set.

    A pattern is a name with wildcards, a scene, a quantity, or a wall as `wall_from_text` reads it.
    """
    standard = {
        f"{scene}/{one.name}": (scene, one.name)
        for scene in (*standard_names(), *DIFFUSE) for one in QUANTITIES.values() if scene in one.scenes
    }  # fmt: skip
    # a quantity alone means the scenes of the standard set
    random = {f"{scene}/{RANDOM_QUANTITY}": (scene,) for scene in scenes() if scene not in standard_names()}
    chosen: list[str] = []
    for pattern in patterns:
        known = (standard | random).items()
        found = [name for name, parts in known if any(fnmatch(part, pattern) for part in (name, *parts))]
        chosen += found or _of_wall(pattern)
    return list(dict.fromkeys(chosen)) if patterns else list(standard)


def _of_wall(text: str) -> list[str]:
    try:
        wall_of(text)
    except InputError as reason:
        raise InputError(
            f"{reason}; expected a wall, or of the standard set SCENE, QUANTITY or SCENE/QUANTITY, scenes "
            f"{', '.join((*standard_names(), *DIFFUSE))}, random-N, quantities {', '.join(QUANTITIES)}"
        ) from reason
    return [f"{text}/{quantity}" for quantity in OWN_QUANTITIES]


def prepare(scene: str) -> None:
    """Load and compile everything that a new process needs for a scene, before timing starts."""
    from ..geometry import trace
    from ..geometry.polygons.beams import beams_of
    from ..kernels import Legendre, WallLaw, discretise
    from ..kernels.walls.conditionals import WallConditionals

    if scene in DIFFUSE:
        return
    wall = wall_of(scene)
    # a wall of the user has no problem with disks
    for one in (wall, wall.foreshorten(DISK)) if scene in scenes() else (wall,):
        trace(one, [0.3, 0.6], [1.0, 2.0])
        # rays towards corners require more than double precision
        trace(one, np.clip(one.vertices[:, 0], 0.0, np.nextafter(one.period, 0.0)), 0.5 * np.pi)
        WallConditionals(one, 1, np.empty(0))(np.array([1.0]), 1e-2)
    if wall.is_polygonal:
        beams_of([(0.0, 0.0), (0.3, -0.5), (0.6, -0.4), (1.0, 0.0)])
    if scene in TRUE_DISK.scenes:
        by_true_disks(wall, 1e-3, np.random.default_rng(0), 1)
    discretise(WallLaw(wall), Legendre(2), "monte-carlo", samples=16)


@cache
def methods_of(name: str) -> Methods:
    """The methods of a problem with their budgets, made once in each process."""
    scene, _, quantity = name.rpartition("/")
    return diffuse_methods(scene) if scene in DIFFUSE else QUANTITIES[quantity].methods(wall_of(scene))


def _method(problem: str, name: str) -> WorkMethod:
    return next(method for method, _, _ in methods_of(problem) if method.name == name)


def measured(
    name: str, references: tuple[ReferenceValue, ...], method: str, budget: float, repeats: int, seconds: float
) -> WorkRow:
    """One row, measured in this process on one core."""
    with on_one_core(), np.errstate(all="ignore"):
        return measure(WorkProblem(name, references), _method(name, method), budget, repeats, seconds)


def value_of(name: str, method: str, budget: float) -> tuple[Any, float | None, str]:
    """Value, reported error and description of a problem by a method, with rays that no row has."""
    return parts_of(solve_once(_method(name, method), budget, REFERENCE_REPEAT))


DISK = geo.Disk(1.0, 0.5)
# Number of true disks at every scale; their noise is about 0.002.
TRUE_DISKS = 2**18


def velocity_fraction() -> tuple[float, float]:
    """Coefficients a, b of v1 = a cos(theta) sin(psi) + b cos(psi) at speed 1."""
    frame = np.asarray(DISK.frame)
    return float(frame[0, 0]), float(frame[2, 0])


def square_of_v1() -> float:
    """<v1, v1> in Lambda^2, where the means of (cos(theta) sin(psi))^2 and of cos(psi)^2 are 1/4."""
    along, roll = velocity_fraction()
    return 0.25 * (along**2 + roll**2)


def correlation_of(moment: float, turn: float = -1.0) -> float:
    r"""<v1, K v1>/<v1, v1> in Lambda^2 from <u, P~ u>/<u, u>.

    v1 = a cos theta sin psi + b cos psi. K preserves sin psi and multiplies cos psi by ``turn``, -1.
    """
    along, roll = velocity_fraction()
    return 0.25 * (along**2 * moment + roll**2 * turn) / square_of_v1()


def sampled_velocities(number: int, rng: np.random.Generator) -> Floats:
    """Outgoing velocities of speed 1 from Lambda^2, shape (number, 3)."""
    cos_theta = 1.0 - 2.0 * rng.random(number)
    # sin(psi)^2 d psi is the distribution of the polar angle of a uniform point on the three-dimensional sphere
    gauss = rng.standard_normal((number, 4))
    psi = np.arccos(gauss[:, 0] / np.linalg.norm(gauss, axis=1))
    return np.asarray(DISK.from_angles(np.arccos(cos_theta), psi))


def by_operator(wall: geo.Wall, **how: Any) -> Estimate:
    """From the matrix of K on polynomials of degree below 2 in each angle, whose span contains v1."""
    operator = CollisionLaw.from_wall(wall, DISK).operator(Legendre(2), Legendre(2, weight="sin2"), **how)
    matrix = operator.theta_matrix
    # sin(psi) is no polynomial in the product basis, so its mean over psi is treated separately
    value = correlation_of(float(matrix.symmetric[1, 1]), float(operator.flip[1, 1]))
    error = 0.25 * velocity_fraction()[0] ** 2 / square_of_v1() * matrix.error.value
    return Estimate(value, error, matrix.error.kind, matrix.method)


def by_velocities(wall: geo.Wall, number: int, rng: np.random.Generator) -> float:
    """By sampling in the original coordinates: incoming velocities from Lambda^2, one collision each."""
    incoming = -sampled_velocities(number, rng)
    outgoing = CollisionLaw.from_wall(wall, DISK).sample(incoming, rng)
    return float(np.mean(-incoming[:, 0] * outgoing[:, 0]) / square_of_v1())


def by_action(wall: geo.Wall, nodes: int) -> float:
    """From K v1 at Gauss nodes in cos(theta) and Gauss-Chebyshev nodes in psi."""
    along, roll = velocity_fraction()
    cosines, weights = np.polynomial.legendre.leggauss(nodes)
    theta = np.arccos(cosines)[:, None]
    psi = np.pi * np.arange(1, 5) / 5.0
    psi_weights = np.sin(psi) ** 2 / np.sum(np.sin(psi) ** 2)

    def v1(angle: Any, roll_angle: Any) -> Floats:
        return np.asarray(along * np.cos(angle) * np.sin(roll_angle) + roll * np.cos(roll_angle))

    image = CollisionLaw.from_wall(wall, DISK).apply(v1, theta, psi)
    total = np.sum(0.5 * weights[:, None] * psi_weights * v1(theta, psi) * image)
    return float(total) / square_of_v1()


def by_true_disks(wall: geo.Wall, scale: float, rng: np.random.Generator, number: int = TRUE_DISKS) -> float:
    """<v1, K v1>/<v1, v1> of the disk with satellites above a wall whose period is ``scale``."""
    incoming = -sampled_velocities(number, rng)
    position = np.column_stack([scale * rng.random(number), 2.0 * np.pi * rng.random(number)])
    # the incoming velocities have the density sin(theta), as the flux through x2 = 0
    hit = geo.collide(DISK, wall, scale / wall.period, position, incoming)
    return float(np.mean((-incoming[:, 0] * hit.velocity[:, 0])[hit.escaped])) / square_of_v1()
