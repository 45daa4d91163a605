"""Find the numbers of a certificate in floating point; nothing of a proof rests on them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ...core.checks import Floats
from ...kernels import CircularArcLaw, Law, Panels, discretise
from ...kernels.bases.assembly import reflection_matrix
from .checker import Bumps, FocusingArcs, Refused, Wall, ctx, exact

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
# Of focusing arcs: bits, because integrals of polynomials cancel; degree and greatest width of the pieces; how many
# kinks at half angle (1 +- 1/k) are edges; reflections that are followed; numbers of bins of a quarter turn that are
# tried, and how small the relative width may be with so many intervals a piece, at first.
ARC_BITS, DEGREE, PIECE, KINKS, REFLECTIONS, ARC_BINS = 192, 4, 0.1, 4, 50, (100, 200, 300, 450)
PARTS, PARTS_WIDTH = 100, 2e-5
ARC_FRACTIONS = 0.6, 0.4, 0.25
# Kinks nearer to each other, relative to the half angle, count as one.
APART = 1e-3


@dataclass(frozen=True)
class _Class:
    """The least eigenvalues of 1 - sign P on odd or even functions, by Galerkin's method."""

    odd: bool
    sign: int
    value: float
    following: float
    coefficients: Floats
    residual: float = 0.0


def certificates(law: Law, content: dict[str, Any], width: float) -> Iterator[dict[str, Any]]:
    """Certificates without their intervals, better and better ones, of what `described` gives."""
    if content["law"]["family"] == "powers":
        yield {**content, "precision": BITS}
        return
    if content["law"]["family"] == "focusing arcs":
        yield from _of_arcs(content, width)
        return
    law, curvature = law.in_specular_frame(), exact(content["law"]["curvature"])
    signs = {True: 1 if content["frame"] == "specular" else -1, False: 1}
    bumps, bins = Bumps(curvature, {}), _bins()
    spaces = [{odd: _galerkin(law, float(bumps.steepest), odd, sign, n) for odd, sign in signs.items()} for n in TERMS]
    weight, specular, retro, _ = (float(middle) for middle, _ in content["weights"].values())

    def mixed(one: _Class, value: float) -> float:
        return 1.0 - one.sign * (specular + (-retro if one.odd else retro)) - weight * (1.0 - value)

    best = min(spaces[-1].values(), key=lambda one: mixed(one, one.value))
    other, gap = spaces[-1][not best.odd], mixed(best, best.value)
    distance = best.following - best.value
    threshold = _threshold(bumps, bins, best, [best.value + part * distance for part in FRACTIONS])
    # where the mixture of the other parity has the gap, and some of the way beyond
    level = (gap - mixed(other, other.value)) / weight + other.value
    beyond = _threshold(bumps, bins, other, [level + part * (other.value - level) for part in (0.3, 0.1, 0.03)])
    tried = [space[best.odd] for space in spaces]
    small = [one for one in tried if one.residual**2 <= PART * width * gap / weight * (threshold - one.value)]
    mine = small[0] if small else min(tried, key=lambda one: one.residual)
    yield {
        **content, "precision": BITS, "odd": mine.odd, "trial": [repr(float(c)) for c in mine.coefficients],
        "guess": repr(mine.value), "threshold": repr(threshold), "other": repr(beyond), "bins": bins,
        "effort": {"first": FIRST, "bits": ACCURACY},
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


def _threshold(law: Wall, bins: list[str], one: _Class, tried: list[float]) -> float:
    """The first threshold below which are as many eigenvalues as expected."""
    most = (0 if tried[0] < one.value else 1) + (0 if one.odd else 1)
    for value in tried:
        try:
            if law.count(bins, one.odd, one.sign, exact(repr(value))) <= most:
                return value
        except Refused:
            continue
    raise Refused(f"{most} eigenvalues of {'odd' if one.odd else 'even'} functions below {tried[-1]:.6f}")


def _of_arcs(content: dict[str, Any], width: float) -> Iterator[dict[str, Any]]:
    """Certificates of focusing arcs, with more and more intervals."""
    half_angle = float(content["law"]["half_angle"][0])
    edges, classes = _piecewise(half_angle, content["frame"])
    # that of the certificate; the caller sets it back
    ctx.prec = ARC_BITS
    law = FocusingArcs(exact(content["law"]["half_angle"]), {})
    for number in ARC_BINS:
        bins = _arc_bins(half_angle, number)
        try:
            thresholds = [
                _threshold(law, bins, one, [one.value + part * (one.following - one.value) for part in ARC_FRACTIONS])
                for one in classes
            ]
            break
        except Refused:
            if number == ARC_BINS[-1]:
                raise
    parts = math.ceil(PARTS * math.sqrt(PARTS_WIDTH / width))
    for growth in (1, 2, 4):
        yield {
            **content, "precision": ARC_BITS, "edges": edges, "bins": bins,
            "effort": {"parts": growth * parts, "reflections": REFLECTIONS},
            "parities": [
                {"trial": [[repr(x) for x in p] for p in one.coefficients.tolist()], "guess": repr(one.value),
                 "threshold": repr(threshold)}
                for one, threshold in zip(classes, thresholds, strict=True)
            ],
        }  # fmt: skip


def _piecewise(half_angle: float, frame: str) -> tuple[list[str], list[_Class]]:
    """Edges up to a quarter turn, and the least values on even and odd functions with the polynomials between them."""
    # where rays with another number of reflections begin
    kinks = half_angle * np.array([1.0, *(1.0 + sign / k for k in range(1, KINKS + 1) for sign in (-1, 1))])
    ends = np.unique([0.0, 0.5 * np.pi, *(t for x in kinks for t in (x, np.pi - x) if 0.0 < t < 0.5 * np.pi)])
    ends = ends[np.append(np.diff(ends) > APART * half_angle, True)]
    inner = [np.linspace(a, b, 2 + int((b - a) / PIECE))[:-1] for a, b in pairwise(ends)]
    edges = np.concatenate((*inner, ends[-1:]))
    basis = Panels(np.concatenate((edges, np.pi - edges[-2::-1])), DEGREE)
    matrix = discretise(CircularArcLaw(half_angle), basis, tolerance=1e-9).symmetric
    half, classes, lengths = basis.size // 2, [], np.diff(edges)[:, None]
    mirrored = matrix @ reflection_matrix(basis)
    for odd in (False, True):
        fold, sign = -1 if odd else 1, -1 if odd and frame == "paper" else 1
        # in the specular frame the law is that of the paper and a mirror image
        block = fold * sign * (matrix + fold * mirrored)[:half, :half]
        values, vectors = np.linalg.eigh(np.eye(half) - 0.5 * (block + block.T))
        first = 0 if odd else 1
        padded = np.concatenate((vectors[:, first], np.zeros(half)))[:, None]
        series = basis.legendre_series(padded)[: len(lengths), :, 0]
        powers = np.array([np.polynomial.legendre.leg2poly(one) for one in series])
        powers = powers * (2.0 / lengths) ** np.arange(DEGREE + 1)
        classes.append(_Class(odd, sign, float(values[first]), float(values[first + 1]), powers))
    return [repr(float(x)) for x in edges[1:-1]], classes


def _arc_bins(half_angle: float, number: int) -> list[str]:
    """Edges of bins up to a quarter turn, denser near grazing angles and where these lead, at twice the half angle."""
    first = min(4.0 / number, 0.4 * min(half_angle, np.pi - 2.0 * half_angle))
    angle = np.linspace(first, 0.5 * np.pi, 10**5)
    from_image = np.abs(angle - min(2.0 * half_angle, np.pi - 2.0 * half_angle))
    total = np.cumsum(0.5 / angle + 1.0 + 0.2 / (from_image + 0.02))
    return [repr(float(x)) for x in np.interp(np.linspace(total[0], total[-1], number + 1)[:-1], total, angle)]
