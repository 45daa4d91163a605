"""The weight of the identity in a law, and the law without it."""

from __future__ import annotations

import math

from ...kernels import Law
from ...kernels.laws.law import sum_of


def without_identity(law: Law) -> tuple[float, Law]:
    """The weight 1 - a and the law R in P = a 1 + (1 - a) R, if P is a sum with an identity term; else 1 and P.

    The identity is retroreflection in the paper's convention and specular reflection in the other.

    Examples
    --------
    >>> from asperity import kernels as ker
    >>> without_identity(0.75 * ker.retroreflection() + 0.25 * ker.henyey_greenstein(0.5))
    (0.25, henyey_greenstein(0.5))
    """
    in_frame = law.frame == "specular"
    inner = law.in_specular_frame() if in_frame else law
    terms = [(weight, term.in_specular_frame() if in_frame else term) for weight, term in inner.parts]
    rest = [(weight, term) for weight, term in terms if not _keeps_angles(term)]
    if len(rest) in (0, len(terms)):
        return 1.0, law
    fraction = math.fsum(weight for weight, _ in rest)
    return fraction, sum_of(tuple((weight / fraction, term) for weight, term in rest))


def _keeps_angles(law: Law) -> bool:
    inner = law.in_specular_frame() if law.frame == "specular" else law
    return inner.retro is (law.frame == "paper")
