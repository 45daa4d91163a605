"""Weighted sums: weights that sum to 1, draws of their terms, and lists of branches, merged and composed.

The terms are laws of any kind: of angles, of directions, or of velocities.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats, numbers
from ...core.errors import InputError
from ...core.rounding import EPS
from ..bases.angles import clipped_inside, edges_inside

# Decimal weights such as 0.1, ..., 0.4 sum to 1 within a few roundings; a sum with a forgotten term differs by more.
WEIGHT_TOLERANCE = 1e-12
# Angles of the same isometry computed by different formulas differ by a few roundings of numbers up to 2 pi.
SAME_ANGLE = 16.0 * EPS
# Merging compares all pairs, and the number of branches of a composition grows exponentially unless they merge.
MOST_BRANCHES = 64

T = TypeVar("T")
# Probabilities and outgoing angles, shape theta.shape + (branches,); None if there are no branches, or too many.
Branches = Callable[[Floats], "tuple[Floats, Floats] | None"]


def as_weight(weight: object) -> float | None:
    """The factor of a law as a float; None for what is no number, with which Python raises a TypeError."""
    is_number = isinstance(weight, (int, float, np.integer, np.floating)) and not isinstance(weight, bool)
    return float(numbers("weight", weight)) if is_number else None  # type: ignore[arg-type]


def total_weight(terms: Sequence[tuple[float, object]]) -> float:
    """The sum of the weights of terms."""
    return math.fsum(weight for weight, _ in terms)


def used_terms(terms: Sequence[tuple[float, T]], whole: object) -> tuple[tuple[float, T], ...]:
    """The terms with a positive weight; raises InputError if one is negative or the sum is not 1 within 1e-12."""
    for index, (weight, law) in enumerate(terms):
        if weight < 0.0:
            raise InputError(f"weights: expected non-negative ones, got {weight!r} for term {index}, {law!r}")
    total = total_weight(terms)
    if abs(total - 1.0) > WEIGHT_TOLERANCE:
        raise InputError(
            f"weights: expected a sum of 1, got {total!r} for {whole!r}; scale the weights or add the missing law"
        )
    return tuple(term for term in terms if term[0])


def drawn_terms(
    terms: Sequence[tuple[float, object]], shape: tuple[int, ...], rng: np.random.Generator
) -> NDArray[np.intp]:
    """Indices of terms, each drawn with the probability that is its weight."""
    cumulative = np.cumsum([weight for weight, _ in terms])
    choice = np.searchsorted(cumulative, rng.random(shape) * cumulative[-1], side="right")
    return np.asarray(np.minimum(choice, len(terms) - 1))


def outcomes_of(laws: Sequence[Any], choice: NDArray[np.intp], incoming: Floats, rng: np.random.Generator) -> Floats:
    """Draw what becomes of incoming angles or velocities, each by the law that is chosen for it."""
    outgoing = np.empty(incoming.shape)
    for index, law in enumerate(laws):
        chosen = choice == index
        if chosen.any():
            outgoing[chosen] = law.sample(incoming[chosen], rng)
    return outgoing


def joined(parts: Sequence[tuple[Floats, float]]) -> tuple[Floats, float]:
    """The breakpoints of a sum from those of its terms."""
    left_out = sum(left for _, left in parts)
    found = np.unique(np.concatenate([points for points, _ in parts]))
    return found, left_out if math.isinf(left_out) else min(left_out, 1.0)


def merged(probability: Floats, outgoing: Floats) -> tuple[Floats, Floats]:
    """Add up branches with equal outgoing angles; slots of probability 0 get the angle of the first used slot.

    The order of slots does not change, so a slot that is one isometry between two breakpoints remains one isometry.
    """
    probability, outgoing = probability.copy(), clipped_inside(outgoing)
    slots = probability.shape[-1]
    for late in range(1, slots):
        for early in range(late):
            same = np.abs(outgoing[..., late] - outgoing[..., early]) <= SAME_ANGLE
            same &= (probability[..., early] > 0.0) & (probability[..., late] > 0.0)
            probability[..., early] += np.where(same, probability[..., late], 0.0)
            probability[..., late] = np.where(same, 0.0, probability[..., late])
    first = np.take_along_axis(outgoing, np.argmax(probability > 0.0, axis=-1)[..., None], axis=-1)
    return probability, np.where(probability > 0.0, outgoing, first)


def chained(laws: Sequence[Branches], theta: Floats) -> tuple[Floats, Floats] | None:
    """The branches of a composition of laws, merged after each law; None if a law has none, or if they are too many."""
    probability, outgoing = np.ones((*theta.shape, 1)), theta[..., None]
    for law in laws:
        found = law(outgoing)
        if found is None:
            return None
        step, angle = found
        shape = (*theta.shape, step.shape[-2] * step.shape[-1])
        probability = (probability[..., None] * step).reshape(shape)
        outgoing = angle.reshape(shape)
        probability, outgoing = _compressed(*merged(*_compressed(probability, outgoing)))
        if probability.shape[-1] > MOST_BRANCHES:
            return None
    return probability, outgoing


def chained_breakpoints(laws: Sequence[Branches], each: Sequence[tuple[Floats, float]]) -> tuple[Floats, float]:
    """Breakpoints of a composition from ``each`` law's, and the measure without them; inf unless all laws know theirs.

    These are the breakpoints of the first law and the angles that its branches map to breakpoints of later laws.
    """
    if not laws:
        return np.empty(0), 0.0
    left_out = sum(left for _, left in each)
    if math.isinf(left_out):
        return np.empty(0), math.inf
    found = each[0][0]
    for index in range(1, len(laws)):
        between = np.concatenate([[0.0], found, [np.pi]])
        sources = preimages(partial(chained, laws[:index]), between, each[index][0])
        if sources is None:
            return np.empty(0), math.inf
        found = np.unique(np.concatenate([found, sources]))
    return found, min(left_out, 1.0)


def preimages(branches: Branches, breakpoints: Floats, targets: Floats) -> Floats | None:
    """Angles that a branch maps to a target, found for every interval between breakpoints; both inputs are sorted.

    None if there are no branches.
    """
    low, high = breakpoints[:-1], breakpoints[1:]
    proper = high > low
    low, high = low[proper], high[proper]
    probe = clipped_inside(low + np.array([[0.25], [0.75]]) * (high - low))
    # Both probes in one call, so that a slot is the same isometry in both.
    found = branches(probe)
    if found is None:
        return None
    probability, angle = found
    sign = np.sign(angle[1] - angle[0])
    offset = angle[0] - sign * probe[0][:, None]
    used = (probability.sum(axis=0) > 0.0) & (sign != 0.0)
    piece, slot = np.nonzero(used)
    sign, offset = sign[piece, slot], offset[piece, slot]
    ends = sign * low[piece] + offset, sign * high[piece] + offset
    owner, target = edges_inside(targets, np.minimum(*ends), np.maximum(*ends))
    source = sign[owner] * (target - offset[owner])
    return np.asarray(source[(source > low[piece][owner]) & (source < high[piece][owner])])


def _compressed(probability: Floats, outgoing: Floats) -> tuple[Floats, Floats]:
    """Drop the slots that no incoming angle uses."""
    used = np.any(probability > 0.0, axis=tuple(range(probability.ndim - 1)))
    return probability[..., used], outgoing[..., used]
