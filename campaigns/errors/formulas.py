"""Walls y = f(x): heights, slopes and second derivatives of their pieces against f and its derivatives."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from asperity import geometry as geo
from campaigns.engine import Campaign, Judged

# Points of a piece.
POINTS = 129
KINDS = ("waves", "exponential of waves", "rational", "cubic between breakpoints", "narrow peak or step")


class Formula(NamedTuple):
    """A function with two derivatives, its period, its breakpoints, and the tolerance of the wall."""

    kind: str
    of: tuple[Callable[[np.ndarray], np.ndarray], ...]
    period: float
    breakpoints: np.ndarray
    tolerance: float


def draw(number: int) -> Formula:
    """A random function of the kinds in turn."""
    rng = np.random.default_rng([62, number])
    kind, period = KINDS[number % len(KINDS)], float(np.exp(rng.uniform(-3.0, 3.0)))
    tolerance, breakpoints = 10.0 ** rng.uniform(-10.0, -3.0), np.empty(0)
    size = period * np.exp(rng.uniform(-4.0, 0.5))
    if kind == "rational":
        middle, width = rng.uniform(0.2, 0.8) * period, period * np.exp(rng.uniform(-2.5, -0.5))
        u = lambda x: (x - middle) / width  # noqa: E731
        of = (
            lambda x: size / (1.0 + u(x) ** 2),
            lambda x: -2.0 * size * u(x) / (1.0 + u(x) ** 2) ** 2 / width,
            lambda x: size * (6.0 * u(x) ** 2 - 2.0) / (1.0 + u(x) ** 2) ** 3 / width**2,
        )
    elif kind == "narrow peak or step":
        middle, width = rng.uniform(0.2, 0.8) * period, period * np.exp(rng.uniform(-9.0, -2.0))
        u = lambda x: (x - middle) / width  # noqa: E731
        if rng.random() < 0.5:
            of = (
                lambda x: size * np.arctan(u(x)),
                lambda x: size / (1.0 + u(x) ** 2) / width,
                lambda x: -2.0 * size * u(x) / (1.0 + u(x) ** 2) ** 2 / width**2,
            )
        else:
            of = (
                lambda x: size * np.exp(-(u(x) ** 2)),
                lambda x: -2.0 * size * u(x) * np.exp(-(u(x) ** 2)) / width,
                lambda x: size * (4.0 * u(x) ** 2 - 2.0) * np.exp(-(u(x) ** 2)) / width**2,
            )
    elif kind == "cubic between breakpoints":
        breakpoints = np.sort(rng.uniform(0.1, 0.9, int(rng.integers(1, 4)))) * period
        edges = np.r_[0.0, breakpoints, period]
        parts = [np.polynomial.Polynomial(size * rng.normal(size=4), [a, b]) for a, b in pairwise(edges)]
        of = tuple(_by_pieces([part.deriv(k) if k else part for part in parts], breakpoints) for k in range(3))
    else:
        waves = np.arange(1, int(rng.integers(2, 6)))
        a, phase, k = (
            rng.normal(size=waves.size) / waves,
            rng.uniform(0.0, 2.0 * np.pi, waves.size),
            2.0 * np.pi / period,
        )
        g = [lambda x, n=n: np.cos(np.multiply.outer(x, k * waves) + phase + 0.5 * np.pi * n) @ (a * (k * waves) ** n)
             for n in range(3)]  # fmt: skip
        if kind == "waves":
            of = tuple(lambda x, one=one: size * one(x) for one in g)
        else:
            of = (
                lambda x: size * np.exp(g[0](x)),
                lambda x: size * np.exp(g[0](x)) * g[1](x),
                lambda x: size * np.exp(g[0](x)) * (g[1](x) ** 2 + g[2](x)),
            )
    return Formula(kind, of, period, breakpoints, tolerance)


def _by_pieces(parts: list[Callable], breakpoints: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    def values(x: np.ndarray) -> np.ndarray:
        which = np.searchsorted(breakpoints, x, side="right")
        return np.select([which == k for k in range(len(parts))], [part(x) for part in parts])

    return values


def judge(formula: Formula) -> Iterator[Judged]:
    """Every piece beside the function."""
    f, slope, bend = formula.of
    step = formula.tolerance * formula.period
    wall = geo.Wall.from_function(f, formula.period, formula.tolerance, formula.breakpoints)
    s = np.clip(np.linspace(0.0, 1.0, POINTS), 1e-9, 1.0 - 1e-9)
    level, worst = None, np.zeros(3)
    for piece in wall.pieces:
        width = piece.end[0] - piece.start[0]
        if width == 0.0:
            continue
        at, tangent = piece.point(s), piece.tangent(s)
        x, steep = at[:, 0], tangent[:, 1] / tangent[:, 0]
        level = at[0, 1] - f(x)[0] if level is None else level
        off = (
            np.abs(at[:, 1] - level - f(x)),
            np.abs(steep - slope(x)) * width / 10.0,
            np.abs([piece.curvature(t) for t in s] * np.hypot(1.0, steep) ** 3 - bend(x)) * width**2 / 100.0,
        )
        worst = np.maximum(worst, [one.max() for one in off])
    # the level is that of one point, within the tolerance
    yield Judged(f"heights, {formula.kind}", 2.0 * step, float(worst[0]))
    yield Judged(f"slopes, {formula.kind}", step, float(worst[1]))
    yield Judged(f"second derivatives, {formula.kind}", step, float(worst[2]))


CAMPAIGNS = (
    Campaign(
        "formulas", "Are walls of functions within the stated distances?", draw, judge, 500, range(5), seconds=120.0
    ),
)
