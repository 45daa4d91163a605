"""Laws as random maps: functions of a uniform number and the incoming angle."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ..bases.angles import flipped
from .involution import InvolutionLaw
from .law import BranchLaw, DrivenLaw, Law, SpecularFrame

# Outgoing angles and, for traced rays, which of them escaped.
Response: TypeAlias = tuple[Floats, "NDArray[np.bool_] | None"]
# The ends of (0, 1) in double precision.
SMALLEST, LARGEST = np.finfo(np.float64).tiny, np.nextafter(1.0, 0.0)


def entry_inside(x: Floats) -> Floats:
    """Move uniform numbers that fell on an end of (0, 1) to the nearest float64 inside it."""
    return np.asarray(np.clip(x, SMALLEST, LARGEST))


def responder(law: Law) -> Callable[[Floats, Floats], Response] | None:
    """The law as a function of a uniform number and the incoming angle; None for laws that need more randomness."""
    if isinstance(law, SpecularFrame):
        inner = responder(law.law)
        if inner is None:
            return None

        def turned(x: Floats, theta: Floats) -> Response:
            outgoing, escaped = inner(x, theta)
            return flipped(outgoing), escaped

        return turned
    outcomes = getattr(law, "outcomes", None)
    if outcomes is not None:
        return lambda x, theta: outcomes(x, theta)
    if isinstance(law, DrivenLaw):
        return lambda x, theta: (law.respond(x, theta), None)
    if isinstance(law, InvolutionLaw):
        return lambda x, theta: (np.asarray(law.map(theta), dtype=np.float64), None)
    if isinstance(law, BranchLaw):
        return lambda x, theta: (_branch_taken(law, x, theta), None)
    return None


def _branch_taken(law: BranchLaw, x: Floats, theta: Floats) -> Floats:
    probability, outgoing = law.branches(theta)
    cumulative = np.cumsum(probability, axis=-1)
    choice = np.argmax(x[..., None] * cumulative[..., -1:] < cumulative, axis=-1)
    return np.asarray(np.take_along_axis(outgoing, choice[..., None], axis=-1)[..., 0])
