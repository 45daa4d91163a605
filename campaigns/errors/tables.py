"""Distribution errors of tables: of measured profiles, composed laws, and laws that reach the tolerance.

The judge draws other outgoing angles: of walls by rays at entry points of its own, of other laws one law at a time.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.core.checks import Floats
from campaigns.cases.random_curved_walls import COUNT, random_curved_wall
from campaigns.engine import Campaign, Judged

CASES, ANGLES, PROBABILITIES, DRAWN = 80, 3, 33, 2**18
# Angles of the table's distribution functions between which they are linear.
CELL = np.pi / 512
KINDS = ("profile", "composition", "mixture", "curved wall")


def profile(rng: np.random.Generator) -> geo.Wall:
    """A random walk, a smoothed one, or white heights, at 100 to 2,000 points."""
    number = int(rng.integers(100, 2000))
    heights = rng.normal(size=number)
    if (kind := rng.integers(3)) < 2:
        heights = np.cumsum(heights)
    if kind == 1:
        heights = np.convolve(heights, np.ones(9) / 9.0, mode="same")
    steepness = float(rng.uniform(0.05, 2.0)) / np.abs(np.diff(heights)).mean()
    return geo.Wall.from_profile(np.arange(number), steepness * heights)


def draw(number: int) -> tuple[int, str, tuple[ker.Law, ...], float]:
    """A number for further draws, a kind, laws in the order of the collisions, and the weight of a flat wall."""
    rng, kind = np.random.default_rng([number, 24]), KINDS[number % 4]
    teeth, scatter = (
        ker.TriangularTeethLaw(float(rng.uniform(0.3, 2.0))),
        ker.henyey_greenstein(float(rng.uniform(0, 0.9))),
    )
    if kind == "profile":
        return number, kind, (ker.WallLaw(profile(rng)),), 0.0
    if kind == "curved wall":
        return number, kind, (ker.WallLaw(random_curved_wall(number // 4 % COUNT)),), 0.0
    return number, kind, (scatter, teeth), float(rng.uniform(0.1, 0.5)) * (kind == "mixture")


def drawn_angles(laws: tuple[ker.Law, ...], theta: float, rng: np.random.Generator) -> Floats:
    """Outgoing angles after all laws."""
    out = np.full(DRAWN, theta)
    for law in laws:
        if isinstance(law, ker.WallLaw):
            out = law.reflect_with_status((np.arange(DRAWN) + rng.random(DRAWN)) / DRAWN, out)[0]
        else:
            out = law.sample(out, rng)
    return out


def judge(case: tuple[int, str, tuple[ker.Law, ...], float]) -> Iterator[Judged]:
    """The largest distance of the distribution functions at the quantiles, beyond the width of a cell."""
    number, kind, laws, flat = case
    rng, law = np.random.default_rng([number, 25]), laws[0]
    for after in laws[1:]:
        law = law @ after
    table = (flat * ker.specular() + (1.0 - flat) * law if flat else law).table(ANGLES, PROBABILITIES)
    worst = 0.0
    for theta, quantile in zip(table.theta.tolist(), table.quantile, strict=True):
        out = drawn_angles(laws, theta, rng)
        out = np.sort(np.where(rng.random(DRAWN) < flat, np.pi - theta, out))
        low, high = (np.searchsorted(out, quantile[1:-1] + side * CELL) / DRAWN for side in (-1.0, 1.0))
        p = table.probability[1:-1]
        worst = max(worst, float((low - p).max()), float((p - high).max()))
    chance = float(np.sqrt(np.log(40.0 * ANGLES) / (2.0 * DRAWN)))
    missed = "above the tolerance" in repr(table)
    fault = (
        "" if missed == (table.distribution_error > table.tolerance) else "does not say that it misses the tolerance"
    )
    useless = "useless" if table.distribution_error > 0.05 else "missed" if missed else "reached"
    yield Judged(kind, table.distribution_error, worst, chance, fault, useless)


CAMPAIGNS = (Campaign("tables", "Do distribution errors of tables hold?", draw, judge, CASES, range(4), level=0.95),)
