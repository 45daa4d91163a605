"""Find the numbers of a certificate in floating point; nothing of a proof rests on them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ...core.checks import Floats
from ...kernels import Law
from .checker import Bumps, Refused, exact

# Bits of balls, and of integrals; the angle below which nothing is known but the size of the trial function.
BITS, ACCURACY, FIRST = 96, 40, "1e-7"
# Cosines and sines in trial functions that are tried, and Gauss nodes of a piece.
TERMS, NODES = (6, 8, 10, 12, 14), 60
# Bins of a half turn, and the angle below which all is grazing.
BINS, GRAZING, RATIO = 150, 1e-4, 1.08
# Thresholds between the gap and the next eigenvalue that are tried, as fractions of the distance.
FRACTIONS = 0.85, 0.7, 0.5, 0.35
# The part of the width that the residual may take.
PART = 0.9


@dataclass(frozen=True)
class _Class:
    """The least eigenvalues of 1 - sign P on odd or even functions, by Galerkin's method."""

    odd: bool
    sign: int
    value: float
    following: float
    coefficients: Floats
    residual: float


def certificates(law: Law, content: dict[str, Any], width: float) -> Iterator[dict[str, Any]]:
    """Certificates without their intervals, better and better ones, of what `described` gives."""
    if content["law"]["family"] == "powers":
        yield {**content, "precision": BITS}
        return
    law, curvature = law.in_specular_frame(), exact(content["law"]["curvature"])
    signs = {True: 1 if content["frame"] == "specular" else -1, False: 1}
    bumps, bins = Bumps(curvature), _bins()
    spaces = [{odd: _galerkin(law, float(bumps.steepest), odd, sign, n) for odd, sign in signs.items()} for n in TERMS]
    weight, specular, retro, _ = (float(middle) for middle, _ in content["weights"].values())

    def mixed(one: _Class, value: float) -> float:
        return 1.0 - one.sign * (specular + (-retro if one.odd else retro)) - weight * (1.0 - value)

    best = min(spaces[-1].values(), key=lambda one: mixed(one, one.value))
    other, gap = spaces[-1][not best.odd], mixed(best, best.value)
    distance = best.following - best.value
    threshold, above = _threshold(bumps, bins, best, [best.value + part * distance for part in FRACTIONS])
    # where the mixture of the other parity has the gap, and some of the way beyond
    level = (gap - mixed(other, other.value)) / weight + other.value
    _, beyond = _threshold(bumps, bins, other, [level + part * (other.value - level) for part in (0.3, 0.1, 0.03)])
    tried = [space[best.odd] for space in spaces]
    small = [one for one in tried if one.residual**2 <= PART * width * gap / weight * (threshold - one.value)]
    mine = small[0] if small else min(tried, key=lambda one: one.residual)
    yield {
        **content, "precision": BITS, "odd": mine.odd, "trial": [repr(float(c)) for c in mine.coefficients],
        "guess": repr(mine.value), "threshold": above, "other": beyond, "bins": bins, "first": FIRST, "bits": ACCURACY,
    }  # fmt: skip


def _galerkin(law: Law, steepest: float, odd: bool, sign: int, terms: int) -> _Class:
    """The lowest two values of the form on the first functions of `Trial`, without the constants."""

    def functions(angle: Floats) -> Floats:
        degrees = range(int(odd), terms + int(odd))
        return np.stack([(np.sin if (m + odd) % 2 else np.cos)(m * angle) for m in degrees], axis=-1)

    node, weight = np.polynomial.legendre.leggauss(NODES)
    place, weight = 0.5 * (node + 1.0), 0.5 * weight
    # denser towards grazing; pieces between the kinks of a quarter turn, the other one is a mirror image
    kinks = [x for x in (steepest, 3.0 * steepest, math.pi - 3.0 * steepest) if x < 0.5 * math.pi - 1e-9]
    pieces = list(pairwise(sorted([0.0, *kinks, 0.5 * math.pi])))
    angle = np.concatenate([low + (high - low) * place**2 for low, high in pieces])
    weight = np.concatenate([(high - low) * 2.0 * place * weight for low, high in pieces]) * np.sin(angle)
    own, after = functions(angle), law.apply(functions, angle)
    if not odd:
        means = (weight @ own) / weight.sum()
        own, after = own - means, after - means
    triangular = np.linalg.qr(np.sqrt(weight)[:, None] * own, mode="r")
    basis = np.linalg.pinv(triangular, rcond=1e-10)
    own, after = own @ basis, after @ basis
    change = own - sign * after
    form = own.T @ (weight[:, None] * change)
    values, vectors = np.linalg.eigh(0.5 * (form + form.T))
    # the other columns of a basis of less than all dimensions are 0
    first = int(np.argmax(np.abs(vectors.T @ (own.T @ (weight[:, None] * own)) @ vectors).diagonal() > 0.5))
    missed = (change - values[first] * own) @ vectors[:, first]
    residual = float(np.sqrt(weight @ missed**2))
    return _Class(odd, sign, float(values[first]), float(values[first + 1]), basis @ vectors[:, first], residual)


def _bins() -> list[str]:
    """Edges of bins up to a quarter turn: geometric near grazing, then equal."""
    edges = [GRAZING]
    while edges[-1] * (RATIO - 1.0) < math.pi / BINS:
        edges.append(edges[-1] * RATIO)
    return [repr(float(x)) for x in (*edges[:-1], *np.linspace(edges[-1], 0.5 * math.pi, BINS // 2 + 1)[:-1])]


def _threshold(bumps: Bumps, bins: list[str], one: _Class, tried: list[float]) -> tuple[float, str]:
    """The first threshold below which are as many eigenvalues as expected, as a number and as text."""
    most = (0 if tried[0] < one.value else 1) + (0 if one.odd else 1)
    for value in tried:
        try:
            found, moved = bumps.count(bins, one.odd, one.sign, exact(repr(value)))
        except Refused:
            continue
        if found <= most:
            return float(moved.mid()), repr(value)
    return tried[-1], repr(tried[-1])
