"""The problems SCENE/QUANTITY: their names, and what is computed of them in a process that can be killed."""

from __future__ import annotations

from collections.abc import Sequence
from fnmatch import fnmatch
from functools import cache
from typing import Any

import numpy as np

from ..core.errors import InputError
from ..spectral import ReferenceValue, WorkMethod, WorkProblem
from ..spectral.work_diagrams.problem import on_one_core
from ..spectral.work_diagrams.report import WorkRow
from ..spectral.work_diagrams.runs import measure, parts_of, solve_once
from .quantities.collision import COLLISION, DISK, TRUE_DISK, by_true_disks
from .quantities.laws import (
    DIFFUSE,
    DIFFUSIVITY,
    DISTANCE,
    EIGENVALUE,
    LAW,
    MOMENT,
    RESISTANCE,
    TRANSMISSION,
    diffuse_methods,
)
from .quantities.methods import Methods
from .quantities.walls import scenes, standard_names, wall_of

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
