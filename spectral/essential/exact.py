"""The weight of the identity in a law, and the law without it."""

from __future__ import annotations

import math

from ...kernels import Law
from ...kernels.laws.law import in_frame, is_identity, sum_of


def without_identity(law: Law) -> tuple[float, Law]:
    """The weight 1 - a and the law R in P = a 1 + (1 - a) R, if P is a sum with an identity term; else 1 and P.

    The identity is retroreflection in the paper's convention and specular reflection in the other.

    Examples
    --------
    >>> from asperity import kernels as ker
    >>> without_identity(0.75 * ker.retroreflection() + 0.25 * ker.henyey_greenstein(0.5))
    (0.25, henyey_greenstein(0.5))
    """
    terms = [(weight, in_frame(term, law.frame)) for weight, term in in_frame(law, "paper").parts]
    rest = [(weight, term) for weight, term in terms if not is_identity(term)]
    if len(rest) in (0, len(terms)):
        return 1.0, law
    fraction = math.fsum(weight for weight, _ in rest)
    return fraction, sum_of(tuple((weight / fraction, term) for weight, term in rest))
