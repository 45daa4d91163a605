"""The weight of the identity in a law, and the law without it."""

from __future__ import annotations

import math

from ...kernels import Law
from ...kernels.laws.law import Combination, IsometryLaw, SpecularFrame


def without_identity(law: Law) -> tuple[float, Law]:
    """The weight 1 - a and the law R in P = a 1 + (1 - a) R, if P is a sum with an identity term; else 1 and P.

    The identity is retroreflection in the paper's convention and specular reflection in the other.

    Examples
    --------
    >>> from asperity import kernels as ker
    >>> without_identity(0.75 * ker.retroreflection() + 0.25 * ker.henyey_greenstein(0.5))
    (0.25, henyey_greenstein(0.5))
    """
    in_frame = isinstance(law, SpecularFrame)
    inner = law.law if isinstance(law, SpecularFrame) else law
    inner = inner.closed_form or inner
    if not isinstance(inner, Combination):
        return 1.0, law
    terms = [(weight, SpecularFrame.of(term) if in_frame else term) for weight, term in inner.terms_checked()]
    rest = [(weight, term) for weight, term in terms if weight > 0.0 and not _keeps_angles(term)]
    if not rest or len(rest) == sum(weight > 0.0 for weight, _ in terms):
        return 1.0, law
    fraction = math.fsum(weight for weight, _ in rest)
    return fraction, rest[0][1] if len(rest) == 1 else Combination(
        tuple((weight / fraction, term) for weight, term in rest)
    )


def _keeps_angles(law: Law) -> bool:
    inner = law.law if isinstance(law, SpecularFrame) else law
    return isinstance(inner, IsometryLaw) and inner.retro == (law.frame == "paper")
