"""The edge of the essential spectrum of a law, and the law without the identity in it.

The part of a wall's law from rays that meet straight pieces only is a sum of isometries, whose edge is found by orbits.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from ...core.checks import Floats, instance
from ...core.estimates import ErrorKind, Summary, with_error
from ...kernels import FacetedLaw, Law, WallLaw
from ...kernels.laws.law import in_frame, is_identity, sum_of
from ...kernels.laws.structure import Rules, fold
from ...kernels.walls.wall_law import made_of_isometries
from .grazing import SWAP, GrazingLimit, grazing_limit
from .straight_rays import specular_part, straight_part

ROUNDING = 1e-15


@dataclass(frozen=True, repr=False)
class EssentialEdge(Summary):
    """An interval that contains the supremum of the essential spectrum.

    Attributes
    ----------
    low, high : float
        Ends of the interval, between 0 and 1; equal if the supremum follows from the structure of the law.
    kind : {"bound", "estimate"}
    reasons : tuple of str
    """

    low: float
    high: float
    kind: ErrorKind
    reasons: tuple[str, ...]

    @property
    def value(self) -> float:
        """The midpoint of the interval."""
        return 0.5 * (self.low + self.high)

    @property
    def error(self) -> float:
        """Half of the width of the interval."""
        return 0.5 * (self.high - self.low)


@dataclass(frozen=True)
class _Part:
    """The action of a law on fast oscillations and on functions of grazing angles."""

    # an interval for the top of the spectrum of its isometries Q; ``fraction`` is <1, Q 1>
    modulus: tuple[float, float]
    grazing: Floats
    error: float
    entry_error: float
    certain: bool
    notes: tuple[str, ...] = ()
    fraction: float = 0.0


def essential_edge(law: Law) -> EssentialEdge:
    r"""The supremum of the essential spectrum of a reversible law, as an interval.

    Parameters
    ----------
    law : Law

    Returns
    -------
    EssentialEdge

    Notes
    -----
    A law is the sum of a compact part and of two parts that are not compact. *Isometries*, theta' = +-theta + c: for
    suitable large n all n c are nearly multiples of 2 pi, so cos(n theta) times a slow function is mapped to
    cos(n theta) times a slow function. Therefore the whole spectrum of the isometric part Q, a sub-Markov operator, is
    essential; see `straight_part`. *Grazing rays*: see `grazing_limit`. Sums and products of laws have the sums and
    products of these symbols. The remainder is compact by a theorem for densities and matrices. For curved walls this
    assumes that the outgoing angle is a piecewise analytic function of the entry point, so the edge is an estimate.

    Examples
    --------
    >>> from asperity import kernels as ker
    >>> essential_edge(0.25 * ker.lambertian() + 0.75 * ker.TriangularTeethLaw(0.7)).value
    0.75
    """
    instance("law", law, Law, "ker.WallLaw(wall)")
    part = fold(law, ISOMETRIES) if made_of_isometries(law) else _taken_apart(law)
    matrix = part.grazing
    root = float(np.linalg.eigvalsh(0.5 * (matrix + matrix.T))[-1])
    low = min(max(part.modulus[0], root - part.error), 1.0)
    high = min(max(part.modulus[1], root + part.error, low), 1.0)
    notes = tuple(dict.fromkeys(part.notes))
    if part.certain and part.modulus[0] == part.modulus[1] >= root - ROUNDING - part.error:
        # fast oscillations attain the norm of the part that is not compact
        low = high = min(part.modulus[0], 1.0)
    return EssentialEdge(low, high, "bound" if part.certain and low == high else "estimate", notes)


def grazing_symbol(law: Law) -> GrazingLimit:
    """The `grazing_limit` of a law, from sums and products of the limits of its parts."""
    part = _taken_apart(law)
    return GrazingLimit(part.grazing, part.error, part.entry_error)


def _taken_apart(law: Law) -> _Part:
    return fold(law, Rules(_leaf, _mixture, _chain, _in_other_frame))


def _leaf(law: Law) -> _Part:
    if law.is_compact:
        return _Part((0.0, 0.0), np.zeros((2, 2)), 0.0, 0.0, True, (f"{law!r} is compact",))
    if made_of_isometries(law):
        if law.retro is not None:
            return replace(_isometric(law), grazing=np.eye(2) if law.retro else SWAP)
        limit = grazing_limit(law)
        # the grazing limit of an isometric law matters in sums with other laws only
        return replace(_isometric(law), grazing=limit.matrix, error=limit.error, entry_error=limit.entry_error)
    limit = grazing_limit(law)
    if isinstance(law, FacetedLaw):
        return _of_facets(law, limit)
    errors = (limit.error, limit.entry_error)
    how = f"-> {with_error(limit.root, limit.error)} as theta -> 0 or pi"
    if not limit.resolved:
        how = "has no limit that can be told in double precision, so the essential spectrum may reach 1"
    elif limit.error == 0.0:
        how += ", by the shape of the wall at y = 0"
    note = f"{law!r}: grazing rays, E[sin(theta)/sin(theta')] {how}"
    if law.has_density:
        return _Part((0.0, 0.0), limit.matrix, *errors, False, (note, f"{law!r} has a density, taken as bounded"))
    if law.angle_map is not None and law.reversible:
        reason = f"{law!r} is an involution: f + f o T is kept for every f"
        return _Part((0.0, 1.0), limit.matrix, *errors, True, (reason,))
    modulus, fraction = (0.0, 0.0), 0.0
    notes = [note]
    if isinstance(law, WallLaw):
        straight = straight_part(law)
        modulus, fraction = (straight.low, straight.high), straight.fraction
        if straight.high > 0.0:
            reach = f"{modulus[0]:.6g}" if modulus[0] == modulus[1] else f"{modulus[0]:.6g} to {modulus[1]:.6g}"
            notes.append(
                f"a fraction {fraction:.4g} of the rays meets straight pieces only: isometries, whose part of the law "
                f"has a spectrum up to {reach}"
            )
    return _Part(modulus, limit.matrix, *errors, False, tuple(notes), fraction)


def _of_facets(law: FacetedLaw, limit: GrazingLimit) -> _Part:
    """The part of a wall with facets of their own: specular rays of weight (1 - a)^N, beside a compact rest."""
    errors = (limit.error, limit.entry_error)
    if law.diffuse_fraction is None or not law.wall.closes:
        what = (
            "facets that are not diffuse in part and else specular" if law.wall.closes else "a wall that does not close"
        )
        return _Part(
            (0.0, 1.0), limit.matrix, *errors, False, (f"{law!r}: {what}: the essential spectrum may reach 1",)
        )
    found = specular_part(law)
    note = (
        f"{law!r}: the essential spectrum is that of specular rays with the weight (1 - a)^N after N hits, a = "
        f"{law.diffuse_fraction:.6g}, because rays that a facet scatters are argued to add a compact operator: of "
        f"straight pieces it reaches {found.low:.6g} to {found.high:.6g}, at grazing "
        f"{with_error(limit.root, limit.error)}"
    )
    return _Part((found.low, found.high), limit.matrix, *errors, False, (note,), found.fraction)


def _isometric(law: Law) -> _Part:
    """The part of an isometric law, which has the edge 1, without its grazing limit."""
    note = f"{law!r} is made of isometries theta' = +-theta + const: cos(n theta) is nearly kept for suitable n"
    return _Part((1.0, 1.0), np.zeros((2, 2)), 0.0, 0.0, True, (note,), 1.0)


def _mixture(terms: Sequence[tuple[float, _Part]]) -> _Part:
    fraction = sum(w * part.fraction for w, part in terms)
    return _Part(
        # for positive operators the top of a sum is at least the top of each weighted term, and at least its fraction
        (max(fraction, *(w * part.modulus[0] for w, part in terms)), sum(w * part.modulus[1] for w, part in terms)),
        sum((w * part.grazing for w, part in terms), np.zeros((2, 2))),
        sum(w * part.error for w, part in terms),
        sum(w * part.entry_error for w, part in terms),
        all(part.certain for _, part in terms),
        tuple(note for _, part in terms for note in part.notes),
        fraction,
    )


def _chain(parts: Sequence[_Part]) -> _Part:
    whole = reduce(_product, parts, _Part((1.0, 1.0), np.eye(2), 0.0, 0.0, True, fraction=1.0))
    if parts and all(part is parts[0] for part in parts):
        # a power
        low, high = parts[0].modulus
        whole = replace(whole, modulus=(low ** len(parts), high ** len(parts)))
    return whole


def _product(first: _Part, second: _Part) -> _Part:
    fraction = first.fraction * second.fraction
    # a factor whose top is 1 does not change the top
    low = {(True, True): 1.0, (True, False): second.modulus[0], (False, True): first.modulus[0]}.get(
        (first.modulus[0] == 1.0, second.modulus[0] == 1.0), fraction
    )
    return _Part(
        (low, first.modulus[1] * second.modulus[1]),
        first.grazing @ second.grazing,
        # row sums are at most 1 plus the errors
        first.error + second.error + first.error * second.error,
        2.0 * (first.entry_error + second.entry_error + first.entry_error * second.entry_error),
        first.certain and second.certain,
        first.notes + second.notes,
        fraction,
    )


def _in_other_frame(part: _Part) -> _Part:
    return replace(part, grazing=part.grazing @ SWAP)


# The rules for laws made of isometries only, whose grazing limits are not needed.
ISOMETRIES = Rules(_isometric, _mixture, _chain, _in_other_frame)


def without_identity(law: Law) -> tuple[float, Law]:
    """The weight 1 - a and the law R in P = a 1 + (1 - a) R, if P is a sum with an identity term; else 1 and P.

    The identity is retroreflection in the paper's convention and specular reflection in the other.

    Examples
    --------
    >>> from asperity import kernels as ker
    >>> without_identity(0.75 * ker.retroreflection() + 0.25 * ker.henyey_greenstein(0.5))
    (0.25, henyey_greenstein(0.5))
    """
    return _without(law, is_identity)


def without_lambertian(law: Law) -> tuple[float, Law]:
    """The weight 1 - a and the law R in P = a L + (1 - a) R, if P is a sum with a Lambertian term; else 1 and P.

    Off the constants P is (1 - a) R.

    Examples
    --------
    >>> from asperity import kernels as ker
    >>> without_lambertian(0.75 * ker.lambertian() + 0.25 * ker.henyey_greenstein(0.5))
    (0.25, henyey_greenstein(0.5))
    """
    return _without(law, lambda term: term.is_lambertian)


def _without(law: Law, is_left_out: Callable[[Law], bool]) -> tuple[float, Law]:
    terms = [(weight, in_frame(term, law.frame)) for weight, term in in_frame(law, "paper").parts]
    rest = [(weight, term) for weight, term in terms if not is_left_out(term)]
    if len(rest) in (0, len(terms)):
        return 1.0, law
    fraction = math.fsum(weight for weight, _ in rest)
    return fraction, sum_of(tuple((weight / fraction, term) for weight, term in rest))
