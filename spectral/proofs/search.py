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
from .checker import Bumps, Refused, Trial, arb, exact

BITS = 64
# Powers of sin(theta) in trial functions, at first and at most, and Gauss nodes of a quarter turn.
POWERS, NODES = (6, 8, 10, 12), 40
# Bins of a half turn, and the angle below which all is grazing.
BINS, GRAZING, RATIO = 150, 1e-4, 1.08
# Thresholds between the gap and the next eigenvalue that are tried, as fractions of the distance.
FRACTIONS = 0.85, 0.7, 0.5, 0.35
# Parts of the width that the first angle and the trial function's own residual may take, and all boxes of residuals.
FIRST, OWN, BOXES = 0.01, 0.15, 0.5
# Resolutions of the boxes: ratios of angles less 1 and tolerances.
RESOLUTIONS = (
    (0.08, 1e-4),
    (0.04, 3e-5),
    (0.02, 1e-5),
    (0.01, 3e-6),
    (0.005, 1e-6),
    (0.0025, 3e-7),
    (0.00125, 1e-7),
    (0.0006, 3e-8),
)
# Ratio of angles where little of the residual is, below SMALL; beyond WIDE angles are equidistant.
COARSE, SMALL, WIDE = 0.05, 0.02, 0.3
FEW, MOST_HALVINGS = 1000, 2 * 10**6


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
    law = law.in_specular_frame()
    signs = {True: 1 if content["frame"] == "specular" else -1, False: 1}
    for powers in POWERS:
        classes = {odd: _galerkin(law, odd, sign, powers) for odd, sign in signs.items()}
        yield from _of_bumps(content, classes, width, powers == POWERS[-1])


def _galerkin(law: Law, odd: bool, sign: int, powers: int) -> _Class:
    """The lowest two values of the form on cos(theta)^odd sin(theta)^k, k < powers, without the constants."""

    def functions(angle: Floats) -> Floats:
        rising = np.sin(angle)[..., None] ** np.arange(powers)
        return np.asarray(rising * np.cos(angle)[..., None] if odd else rising)

    node, weight = np.polynomial.legendre.leggauss(NODES)
    place = 0.5 * (node + 1.0)
    # denser towards grazing; the other quarter turn is a mirror image
    angle = 0.5 * np.pi * place**2
    weight = 0.5 * np.pi * weight * place * np.sin(angle)
    own, after = functions(angle), law.apply(functions, angle)
    if not odd:
        means = weight @ own
        own, after = own - means, after - means
    size, change = own.T @ (weight[:, None] * own), own - sign * after
    form = own.T @ (weight[:, None] * change)
    scale, axes = np.linalg.eigh(size)
    known = scale > 1e-10 * scale[-1]
    basis = axes[:, known] / np.sqrt(scale[known])
    values, vectors = np.linalg.eigh(basis.T @ (0.5 * (form + form.T)) @ basis)
    coefficients = basis @ vectors[:, 0]
    missed = (change - values[0] * own) @ coefficients
    return _Class(odd, sign, float(values[0]), float(values[1]), coefficients, float(np.sqrt(weight @ missed**2)))


def _of_bumps(
    content: dict[str, Any], classes: dict[bool, _Class], width: float, last: bool
) -> Iterator[dict[str, Any]]:
    """Certificates with a trial function of one parity, if its own residual is small enough."""
    weight, specular, retro, _ = (float(middle) for middle, _ in content["weights"].values())

    def mixed(one: _Class, value: float) -> float:
        return 1.0 - one.sign * (specular + (-retro if one.odd else retro)) - weight * (1.0 - value)

    mine = min(classes.values(), key=lambda one: mixed(one, one.value))
    other = classes[not mine.odd]
    gap = mixed(mine, mine.value)
    wanted, distance = width * gap / weight, mine.following - mine.value
    if mine.residual**2 / distance > OWN * wanted and not last:
        return
    bumps = Bumps(exact(content["law"]["curvature"]), {})
    bins = _bins()
    threshold, above = _threshold(bumps, bins, mine, [mine.value + part * distance for part in FRACTIONS])
    # where the mixture of the other parity has the gap, and some of the way beyond
    level = (gap - mixed(other, other.value)) / weight + other.value
    _, beyond = _threshold(bumps, bins, other, [level + part * (other.value - level) for part in (0.3, 0.1, 0.03)])
    trial = Trial([repr(float(c)) for c in mine.coefficients], mine.odd)
    size = float(trial.norm.mid())
    spare = wanted * (threshold - mine.value) * size
    first = math.sqrt(FIRST * 2.0 * spare) / (float(trial.largest) * (2.0 + mine.value))
    certificate = {
        **content, "precision": BITS, "odd": mine.odd, "trial": [repr(float(c)) for c in mine.coefficients],
        "guess": repr(mine.value), "threshold": above, "other": beyond, "bins": bins,
        "effort": {"halvings": _halvings(bumps, trial, mine, wanted * size)},
    }  # fmt: skip
    end = 0.5 * math.pi * (1.0 + 1e-9)
    for ratio, tolerance in RESOLUTIONS:
        bumps.effort = {"tolerance": repr(tolerance)}
        steep = np.linspace(WIDE, end, 2 + int((end - WIDE) / (WIDE * ratio)))
        angles = [*_geometric(first, SMALL, COARSE)[:-1], *_geometric(SMALL, WIDE, ratio)[:-1], *map(float, steep)]
        # a sample of the boxes foretells the sum
        sample = sum(
            float(bumps.residual(trial, mine.sign, arb(repr(mine.value)), arb(a), arb(b)).upper()) * 8
            for a, b in list(pairwise(angles))[::8]
        )
        if sample < BOXES * spare or (ratio, tolerance) == RESOLUTIONS[-1]:
            effort = certificate["effort"] | {"tolerance": repr(tolerance), "angles": [repr(a) for a in angles]}
            yield {**certificate, "effort": effort}
            return


def _geometric(low: float, high: float, ratio: float) -> list[float]:
    return [float(x) for x in np.geomspace(low, high, 2 + int(math.log(high / low) / math.log1p(ratio)))]


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


def _halvings(bumps: Bumps, trial: Trial, one: _Class, wanted: float) -> int:
    """How many halvings bring the form's uncertainty below a third of the width; it falls as their inverse."""
    bumps.effort = {"halvings": FEW}
    first = float(bumps.several(trial, one.sign).rad())
    return min(max(FEW, int(1.3 * FEW * first / (wanted / 6.0))), MOST_HALVINGS)
