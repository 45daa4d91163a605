"""Single rays on extreme walls and at extreme angles, against 50 digits.

The script ``campaigns/judges/precise_extremes.py`` writes the rays and their references to ``extreme_rays.json``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from asperity import geometry as geo
from asperity.core.rounding import EPS

from .row import ExtremeRow, stored
from .walls import extreme_walls

DATA = Path(__file__).with_name("extreme_rays.json")
UNIT = "eps x condition"
# Measured errors of the tracer are below 5 in these units; the margin is a factor six.
UNITS = 32.0
# Classes of rays: the ray passes every corner at a distance that double precision resolves; it meets a corner if its
# angle changes by at most half an ulp; it meets a corner if the wall changes by its rounding; its first hit is more ray
# segments away than the tracer follows.
CLEAR, IN_ANGLE, IN_WALL, TOO_FAR = range(4)
REASONS = {
    CLEAR: "no corner is within half an ulp of the angle, but double-double arithmetic does not settle it either",
    IN_WALL: "the opening, seen along the ray, is thinner than the rounding of the wall's coordinates",
    TOO_FAR: "the first hit is more than 10^6 cells away",
}


@dataclass(frozen=True)
class KnownRay:
    """One ray with its exact result.

    Attributes
    ----------
    x, theta : float
    out : float
        The exact outgoing angle, rounded once; NaN if the exact path is unknown.
    hits : int
    condition : float
        1 + the sum of the absolute derivatives of the outgoing state.
    clearance : int
        ``CLEAR``, ``IN_ANGLE``, ``IN_WALL`` or ``TOO_FAR``.
    others : mapping of float to int
        Angles and hits of rays a few ulps away on other paths, and of this ray if the wall's rounded coordinates change
        its path.
    """

    x: float
    theta: float
    out: float
    hits: int
    condition: float
    clearance: int
    others: Mapping[float, int]

    @property
    def is_open(self) -> bool:
        """Whether one ulp of the ray changes its outgoing angle completely."""
        return EPS * self.condition >= 1.0

    def error(self, theta: float, hits: int) -> tuple[float, bool]:
        """Error of the tracer's result in ``UNIT``, and whether it refers to a ray a few ulps away."""
        scale = EPS * (1.0 + self.hits) * self.condition
        here = abs(theta - self.out) / scale if hits == self.hits or self.is_open else np.inf
        beside = min((abs(theta - out) / scale for out in self.others), default=np.inf)
        return (here, False) if here <= UNITS or here <= beside else (beside, True)


def ray_cases() -> dict[str, Callable[[], ExtremeRow]]:
    """The cases by name."""
    return {name: partial(_case, name, build) for name, build in extreme_walls().items()}


def _case(name: str, build: Callable[[], geo.Wall]) -> ExtremeRow:
    return compare_rays(name, build())


def known_rays(name: str) -> tuple[str, tuple[KnownRay, ...]]:
    """The reference of a case, and its rays."""
    case = stored(DATA)[name]
    return case["reference"], tuple(
        KnownRay(
            float.fromhex(x), float.fromhex(theta), float("nan") if out is None else float.fromhex(out), hits or 0,
            condition, clearance, {float.fromhex(other): number for other, number in others},
        )
        for x, theta, out, hits, condition, clearance, others in case["rays"]
    )  # fmt: skip


def compare_rays(name: str, wall: geo.Wall) -> ExtremeRow:
    """Trace the rays of a case and compare each ray with its exact result."""
    reference, rays = known_rays(name)
    traced = geo.trace(wall, [ray.x for ray in rays], [ray.theta for ray in rays])
    errors = [
        ray.error(float(theta), int(hits))
        for ray, theta, hits, gone in zip(rays, traced.theta, traced.collisions, traced.escaped, strict=True)
        if gone
    ]
    worst = max((error for error, _ in errors), default=0.0)
    flags = [ray.clearance for ray, gone in zip(rays, traced.escaped, strict=True) if not gone]
    right = flags.count(IN_ANGLE)
    notes = [f"{sum(moved for _, moved in errors)} beside a jump"] if any(moved for _, moved in errors) else []
    undecided = sum(ray.is_open for ray in rays)
    notes += [f"{undecided} whose way out is decided by less than an ulp of them"] if undecided else []
    notes += [f"{right} flagged rightly: half an ulp of the angle meets a corner"] if right else []
    notes += [f"{flags.count(flag)} flagged: {reason}" for flag, reason in REASONS.items() if flag in flags]
    return ExtremeRow(
        name, reference, float(worst), UNITS, UNIT, counts=traced.counts(), flagged_rightly=right,
        note="; ".join(notes),
    )  # fmt: skip
