"""Single rays on extreme walls and at extreme angles, against 50 digits.

The script ``campaigns/extremes/references.py`` writes the rays and their references to ``extreme_rays.json``.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from asperity import geometry as geo
from asperity.core.rounding import EPS
from campaigns.engine import Campaign, Judged

from .walls import extreme_walls

DATA = Path(__file__).with_name("extreme_rays.json")
# Measured errors of the tracer are below 5 in these units; the margin is a factor six.
UNITS = 32.0
# Classes of rays: the ray passes every corner at a distance that double precision resolves; it meets a corner if its
# angle changes by at most half an ulp; it meets a corner if the wall changes by its rounding; its first hit is more ray
# segments away than the tracer follows.
CLEAR, IN_ANGLE, IN_WALL, TOO_FAR = range(4)
FLAGS = (
    "degraded: flagged without a corner", "flagged rightly", "degraded: the opening is thinner than rounding",
    "degraded: the first hit is too far away",
)  # fmt: skip


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
        """Error in units of EPS times the condition, and whether it refers to a ray a few ulps away."""
        scale = EPS * (1.0 + self.hits) * self.condition
        here = abs(theta - self.out) / scale if hits == self.hits or self.is_open else np.inf
        beside = min((abs(theta - out) / scale for out in self.others), default=np.inf)
        return (here, False) if here <= UNITS or here <= beside else (beside, True)


def known_rays(name: str) -> tuple[str, tuple[KnownRay, ...]]:
    """The reference of a case, and its rays."""
    case = json.loads(DATA.read_text(encoding="utf-8"))[name]
    return case["reference"], tuple(
        KnownRay(
            float.fromhex(x), float.fromhex(theta), float("nan") if out is None else float.fromhex(out), hits or 0,
            condition, clearance, {float.fromhex(other): number for other, number in others},
        )
        for x, theta, out, hits, condition, clearance, others in case["rays"]
    )  # fmt: skip


def draw(number: int) -> tuple[str, geo.Wall]:
    """A wall and the name of its rays."""
    name, build = list(extreme_walls().items())[number]
    return name, build()


def judge(case: tuple[str, geo.Wall]) -> Iterator[Judged]:
    """Each ray against its exact result, in units of EPS times its condition, or its flag."""
    name, wall = case
    _, rays = known_rays(name)
    traced = geo.trace(wall, [ray.x for ray in rays], [ray.theta for ray in rays])
    for ray, theta, hits, gone in zip(rays, traced.theta, traced.collisions, traced.escaped, strict=True):
        if gone:
            error, moved = ray.error(float(theta), int(hits))
            yield Judged(name, UNITS, float(error), outcome="beside a jump" if moved else "")
        else:
            yield Judged(name, outcome=FLAGS[ray.clearance])


# All but Koch 8.
SMALL = [number for number, name in enumerate(extreme_walls()) if "Koch 8" not in name]
CAMPAIGNS = (
    Campaign("extreme-rays", "Is each ray on an extreme wall right, or flagged?", draw, judge, len(extreme_walls()),
             SMALL),
)  # fmt: skip
