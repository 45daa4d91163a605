"""Goals of a wished tolerance on walls of every kind, of large matrices, and of a user's first commands.

Each is computed once as a user would, after a rough run that compiles. Where no independent value is known, the
reached error is the reported one, which other campaigns test.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.bench.quantities.walls import wall_of

from .bounces import FIRST_RAYS, LARGE_PROFILE, first_rays, timed

# Tolerance of the rough runs that compile.
ROUGH = 1e-2
LARGE, LARGE_SAMPLES = 10_000, 2**22
# Limit on the beams of a hollow that is only limited by its tolerance.
MANY_BEAMS = 10**7
WALLS: dict[str, Callable[[], geo.Wall]] = {
    "cusps": lambda: wall_of("cusps"),
    "mushroom": lambda: wall_of("mushroom"),
    "tooth, arc and Bezier": lambda: wall_of("mixed"),
    "skew Bezier": lambda: geo.Wall([geo.Bezier([(0, 0), (0.1, -0.6), (0.7, -0.5), (1, 0)])]),
}
# Fresh processes of each kind, of which the least time counts: the first reads the libraries from the disk.
FRESH = 3
# Half angles of dispersing arcs.
BUMPS = (1.0 / 3.0, 2.0 / 3.0, 1.0)
PROGRAMS = {
    "first trace, empty cache": (
        "from asperity import geometry as geo; geo.trace(geo.focusing_arcs(1.2), [0.3, 0.4], [1.0, 2.0])", 2.5
    ),
    "first trace of a mushroom, empty cache": (
        "from asperity import geometry as geo; geo.trace(geo.mushrooms(0.3), [0.3, 0.4], [1.0, 2.0])", 2.5
    ),
    "first gap of focusing arcs, empty cache": (
        "from asperity import geometry as geo, kernels as ker, spectral as spec\n"
        "spec.spectral_gap(ker.WallLaw(geo.focusing_arcs(1.2)))", 4.0,
    ),
    "first gap of triangular teeth, empty cache": (
        "from asperity import geometry as geo, kernels as ker, spectral as spec\n"
        "spec.spectral_gap(ker.WallLaw(geo.triangular_teeth(0.7)))", 4.0,
    ),
    "first gap of dispersing arcs, empty cache": (
        "from asperity import geometry as geo, kernels as ker, spectral as spec\n"
        "spec.spectral_gap(ker.WallLaw(geo.dispersing_arcs(1.0)))", 4.0,
    ),
}  # fmt: skip


@dataclass(frozen=True)
class Goal:
    """One goal: its name, its required value, and the value reached."""

    what: str
    goal: str
    reached: str
    is_met: bool


def wall_goals() -> list[Goal]:
    """All of them, in about two minutes."""
    return [*_laws_and_resistances(), *_gaps(), *_koch(), *_distances(), *_large_matrices(), *_programs()]


def _laws_and_resistances() -> list[Goal]:
    goals = []
    for name, make in WALLS.items():
        goals += [
            _within(
                f"law in Bins(64) by quadrature, {name}", 1e-4, 5.0,
                lambda tolerance, make=make: _matrix(make(), tolerance),
            ),
            _within(
                f"resistance, {name}", 1e-8, 20.0,
                lambda tolerance, make=make: ker.resistance(ker.WallLaw(make()), tolerance).error,
            ),
        ]  # fmt: skip
    return goals


def _matrix(wall: geo.Wall, tolerance: float) -> float:
    law = ker.WallLaw(wall)
    return float(ker.discretise(law, ker.Bins(64), method="quadrature", tolerance=tolerance).error)


def _gaps() -> list[Goal]:
    return [
        _within(
            f"gap of dispersing arcs of {half_angle:.2g}", 1e-9, 1.0,
            lambda tolerance, half_angle=half_angle: spec.spectral_gap(
                ker.WallLaw(geo.dispersing_arcs(half_angle)), tolerance
            ).error,
        )
        for half_angle in BUMPS
    ]  # fmt: skip


def _koch() -> list[Goal]:
    """Koch 5 as an exact law, with the mass of its unresolved beams, and Koch 8 by rays."""
    return [
        _within("Koch 5 as an exact law", 1e-6, 20.0, lambda tolerance: _unresolved(geo.koch(5), tolerance)),
        _within(
            "resistance of Koch 8", 1e-3, 10.0,
            lambda tolerance: ker.resistance(ker.WallLaw(geo.koch(8)), tolerance).error,
        ),
    ]  # fmt: skip


def _unresolved(wall: geo.Wall, tolerance: float) -> float:
    law = ker.PolygonLaw(wall, tolerance, max_beams=MANY_BEAMS)
    law.branches(1.0)
    return float(law.unresolved)


def _distances() -> list[Goal]:
    arc, teeth = ker.WallLaw(geo.focusing_arcs(1.2)), ker.WallLaw(geo.triangular_teeth(0.7))
    kinds: tuple[tuple[Any, float, float], ...] = (("rows", 1e-6, 1.0), ("joint", 1e-3, 5.0))
    return [
        _within(
            f"distance of arc and teeth, {kind}", goal, limit,
            lambda tolerance, kind=kind: ker.distance(arc, teeth, kind=kind, tolerance=tolerance).error,
        )
        for kind, goal, limit in kinds
    ]  # fmt: skip


def _large_matrices() -> list[Goal]:
    """Gaps with the check that none is missing; the time of making the matrix is not counted."""
    basis, arc = ker.Bins(LARGE), ker.CircularArcLaw(1.2)
    matrices = {
        "Henyey-Greenstein 0.9": ker.discretise(ker.henyey_greenstein(0.9), basis),
        "focusing arc": ker.discretise(arc, basis, method="qmc", samples=LARGE_SAMPLES, rng=0),
    }
    return [
        _in_seconds(
            f"gap of {LARGE:,} bins, checked to be complete, {name}",
            12.0,
            lambda matrix=matrix: spec.spectrum(matrix, k=2),
        )
        for name, matrix in matrices.items()
    ]


def _programs() -> list[Goal]:
    """A large profile, and fresh processes."""
    goals = [_in_seconds(f"profile of {LARGE_PROFILE:,} points, wall to {FIRST_RAYS:,} rays", 4.0, first_rays)]
    for what, (script, limit) in PROGRAMS.items():
        goals.append(_in_seconds(what, limit, lambda script=script: _compile_and_run(script), FRESH))
    with TemporaryDirectory() as folder:
        study = ["-m", "asperity", "study", "focusing-arcs", "--force", "--out", str(Path(folder) / "study")]
        # a warm command has its bytecode, too
        keeping = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
        _run(study, keeping)
        goals.append(_in_seconds("asperity study focusing-arcs, warm", 3.0, lambda: _run(study, keeping), FRESH))
    return goals


def _compile_and_run(script: str) -> None:
    with TemporaryDirectory() as empty:
        _run(["-c", script], {**os.environ, "NUMBA_CACHE_DIR": empty})


def _run(arguments: list[str], environment: Any) -> None:
    subprocess.run([sys.executable, *arguments], check=True, env=environment, capture_output=True)


def _within(what: str, tolerance: float, limit: float, solve: Callable[[float], float]) -> Goal:
    solve(ROUGH)
    return in_time(what, tolerance, limit, *timed(perf_counter, lambda: solve(tolerance)))


def in_time(what: str, tolerance: float, limit: float, error: float, seconds: float) -> Goal:
    """A goal of a tolerance and seconds, with the reported error and the seconds that were reached."""
    reached = f"reported {error:.1e} in {seconds:.2g} s"
    return Goal(what, f"{tolerance:.0e} in {limit:g} s", reached, error <= tolerance and seconds <= limit)


def _in_seconds(what: str, limit: float, run: Callable[[], object], repeats: int = 1) -> Goal:
    seconds = min(timed(perf_counter, run)[1] for _ in range(repeats))
    return Goal(what, f"{limit:g} s", f"{seconds:.2g} s", seconds <= limit)
