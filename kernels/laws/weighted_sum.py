"""Weighted sums of laws."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...checks import Floats
from ...errors import InputError
from .branches import merged
from .law import AngleFunction, Frame, Law, set_facts

# Weights such as 0.1, ..., 0.4 typed in decimals sum to 1 within a few roundings; a forgotten term does not.
WEIGHT_TOLERANCE = 1e-12


@dataclass(frozen=True, repr=False)
class Combination(Law):
    """A weighted sum of laws, ``0.3 * law + 0.7 * other``.

    It is a law once its weights are non-negative and sum to 1; `sample`, `apply`, `branches` and `adjoint` raise an
    InputError until then.

    Parameters
    ----------
    terms : tuple of (float, Law)
        Weights and laws, all in the same frame; sums are kept flat.

    Raises
    ------
    InputError
        If there are no terms, a weight is not finite, or the frames differ.

    Examples
    --------
    >>> from asperity.kernels.laws.ideal import lambertian, specular
    >>> law = 0.25 * specular() + 0.75 * lambertian()
    >>> law
    0.25*specular() + 0.75*lambertian()
    >>> round(float(law.apply(np.cos, np.pi / 3)), 14)
    -0.125
    """

    terms: tuple[tuple[float, Law], ...]

    def __post_init__(self) -> None:
        if not self.terms:
            raise InputError("terms: expected at least one (weight, law), got none")
        for weight, law in self.terms:
            if not isinstance(law, Law):
                raise InputError(f"terms: expected laws, got {law!r}")
            if not math.isfinite(weight):
                raise InputError(f"terms: expected finite weights, got {weight!r} for {law!r}")
        laws = [law for _, law in self.terms]
        set_facts(self, frame=common_frame(laws, "add"), fan_out=sum(law.fan_out for law in laws))
        used = [law for weight, law in self.terms if weight]
        set_facts(self, reversible=_sum_promise([law.reversible for law in used]))
        set_facts(self, mirror_symmetric=_sum_promise([law.mirror_symmetric for law in used]))

    @staticmethod
    def of(law: Law) -> Combination:
        """The law itself if it is a combination, else the combination 1 * law."""
        return law if isinstance(law, Combination) else Combination(((1.0, law),))

    @property
    def sums_to_one(self) -> bool:
        """Whether the weights sum to 1 within 1e-12."""
        return abs(math.fsum(weight for weight, _ in self.terms) - 1.0) <= WEIGHT_TOLERANCE

    def terms_checked(self) -> tuple[tuple[float, Law], ...]:
        """The terms, or an InputError if a weight is negative or the weights do not sum to 1 within 1e-12."""
        for place, (weight, law) in enumerate(self.terms):
            if weight < 0.0:
                raise InputError(f"weights: expected non-negative ones, got {weight!r} for term {place}, {law!r}")
        if not self.sums_to_one:
            total = math.fsum(weight for weight, _ in self.terms)
            raise InputError(
                f"weights: expected a sum of 1, got {total!r} for {self!r}; scale the weights or add the missing law"
            )
        return self.terms

    def __add__(self, other: Law) -> Combination:
        if not isinstance(other, Law):
            return NotImplemented
        return Combination(self.terms + Combination.of(other).terms)

    def __rmul__(self, weight: float) -> Combination:
        scale = super().__rmul__(weight)
        if not isinstance(scale, Combination):
            return NotImplemented
        return Combination(tuple((scale.terms[0][0] * own, law) for own, law in self.terms))

    __mul__ = __rmul__

    def adjoint(self) -> Law:
        """The combination of the adjoints, with the same weights."""
        terms = self.terms_checked()
        return self if self.reversible else Combination(tuple((weight, law.adjoint()) for weight, law in terms))

    def branches(self, theta: ArrayLike) -> tuple[Floats, Floats]:
        parts = [(weight, *law.branches(theta)) for weight, law in self.terms_checked() if weight > 0.0]
        probability = np.concatenate([weight * share for weight, share, _ in parts], axis=-1)
        return merged(probability, np.concatenate([angle for _, _, angle in parts], axis=-1))

    def kinks(self, limit: int) -> tuple[Floats, float]:
        parts = [law.kinks(limit) for weight, law in self.terms_checked() if weight > 0.0]
        return np.unique(np.concatenate([kinks for kinks, _ in parts])), min(sum(left for _, left in parts), 1.0)

    def _sample(self, theta: Floats, rng: np.random.Generator) -> Floats:
        terms = self.terms_checked()
        cumulative = np.cumsum([weight for weight, _ in terms])
        choice = np.searchsorted(cumulative, rng.random(theta.shape) * cumulative[-1], side="right")
        choice = np.minimum(choice, len(terms) - 1)
        outgoing = np.empty(theta.shape)
        for place, (_, law) in enumerate(terms):
            chosen = choice == place
            if chosen.any():
                outgoing[chosen] = law.sample(theta[chosen], rng)
        return outgoing

    def _apply(self, function: AngleFunction, theta: Floats) -> Floats:
        parts = [weight * law.apply(function, theta) for weight, law in self.terms_checked()]
        return np.asarray(sum(parts[1:], parts[0]))

    def __repr__(self) -> str:
        return " + ".join(f"{weight:.12g}*{as_factor(law)}" for weight, law in self.terms)


def mixture(laws: Sequence[Law], weights: ArrayLike) -> Combination:
    """The law that follows ``laws[k]`` with probability ``weights[k]``.

    Raises an InputError if the numbers of laws and weights differ, a weight is negative or they do not sum to 1.

    Examples
    --------
    >>> from asperity.kernels.laws.ideal import retroreflection, specular
    >>> mixture([specular(), retroreflection()], [0.5, 0.5])
    0.5*specular() + 0.5*retroreflection()
    """
    weight = np.asarray(weights, dtype=np.float64)
    if weight.shape != (len(laws),):
        raise InputError(f"weights: expected one for each of {len(laws)} laws, got an array of shape {weight.shape}")
    total = Combination(tuple(zip(weight.tolist(), laws, strict=True)))
    total.terms_checked()
    return total


def common_frame(laws: Sequence[Law], verb: str) -> Frame:
    """The frame that all the laws are in, or an InputError that says what could not be done."""
    for law in laws[1:]:
        if law.frame != laws[0].frame:
            raise InputError(
                f"cannot {verb} laws in different frames: {laws[0]!r} is in the {laws[0].frame} frame, {law!r} in the "
                f"{law.frame} frame; call in_specular_frame() on one of them"
            )
    return laws[0].frame


def _sum_promise(promises: Sequence[bool | None]) -> bool | None:
    """Whether a sum has a property that the terms have, have not, or are not known to have."""
    if all(promises):
        return True
    # One term without it spoils the sum only if no other term can make up for it.
    certain = [promise for promise in promises if promise is True]
    return False if len(certain) == len(promises) - 1 and False in promises else None


def as_factor(law: Law) -> str:
    """The name of a law as a factor."""
    from .composition import Composition

    return f"({law!r})" if isinstance(law, (Combination, Composition)) else repr(law)
