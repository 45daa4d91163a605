"""The algebra of laws: weighted sums, compositions, powers, and the change of frame."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..checks import Floats, angles, whole_number
from ..errors import InputError
from .branching import chained, chained_kinks, merged
from .law import AngleFunction, Frame, Law, set_facts
from .stable_angles import flipped

# Weights such as 0.1, ..., 0.4 typed in decimals sum to 1 within a few roundings; a forgotten term does not.
WEIGHT_TOLERANCE = 1e-12
# More evaluations than this for one incoming angle are not a computation that anybody wants to wait for.
MOST_EVALUATIONS = 10**7
# Nested calls of `apply` beyond this would meet Python's own limit on recursion.
DEEPEST_POWER = 100


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
    >>> from asperity.kernels.ideal import lambertian, specular
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
        set_facts(self, frame=_common_frame(laws, "add"), fan_out=sum(law.fan_out for law in laws))
        used = [law for weight, law in self.terms if weight]
        set_facts(self, reversible=_sum_promise([law.reversible for law in used]))
        set_facts(self, mirror_symmetric=_sum_promise([law.mirror_symmetric for law in used]))

    @staticmethod
    def of(law: Law) -> Combination:
        """The law itself if it is a combination, else the combination 1 * law."""
        return law if isinstance(law, Combination) else Combination(((1.0, law),))

    def terms_checked(self) -> tuple[tuple[float, Law], ...]:
        """The terms, or an InputError if a weight is negative or the weights do not sum to 1 within 1e-12."""
        for place, (weight, law) in enumerate(self.terms):
            if weight < 0.0:
                raise InputError(f"weights: expected non-negative ones, got {weight!r} for term {place}, {law!r}")
        total = math.fsum(weight for weight, _ in self.terms)
        if abs(total - 1.0) > WEIGHT_TOLERANCE:
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
        parts = [(weight, *law.branches(theta)) for weight, law in self.terms_checked()]
        probability = np.concatenate([weight * share for weight, share, _ in parts], axis=-1)
        return merged(probability, np.concatenate([angle for _, _, angle in parts], axis=-1))

    def kinks(self, limit: int) -> tuple[Floats, float]:
        parts = [law.kinks(limit) for _, law in self.terms_checked()]
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
        return " + ".join(f"{weight:.12g}*{_wrapped(law)}" for weight, law in self.terms)


@dataclass(frozen=True, repr=False)
class Composition(Law):
    """Laws applied one after the other, ``first @ second``; as an operator, f -> P_first P_second f.

    Parameters
    ----------
    laws : tuple of Law
        The first one first, all in the same frame; compositions are kept flat.

    Raises
    ------
    InputError
        If there are no laws or their frames differ: P~ @ Q_F would confuse theta with pi - theta between the two.

    Examples
    --------
    >>> from asperity.kernels.ideal import retroreflection, specular
    >>> (specular() @ specular()).branches(1.0)[1].tolist()
    [1.0]
    """

    laws: tuple[Law, ...]

    def __post_init__(self) -> None:
        flat: list[Law] = []
        for law in self.laws:
            if not isinstance(law, Law):
                raise InputError(f"laws: expected laws, got {law!r}")
            flat.extend(law.laws if isinstance(law, Composition) else (law,))
        if not flat:
            raise InputError("laws: expected at least one, got none")
        set_facts(self, laws=tuple(flat), frame=_common_frame(flat, "compose"))
        palindrome = all(law is back for law, back in zip(flat, reversed(flat), strict=True))
        set_facts(self, reversible=True if palindrome and all(law.reversible for law in flat) else None)
        set_facts(self, mirror_symmetric=True if all(law.mirror_symmetric for law in flat) else None)
        set_facts(self, fan_out=math.prod(law.fan_out for law in flat))

    def adjoint(self) -> Law:
        """(P Q)* = Q* P*."""
        return self if self.reversible else Composition(tuple(law.adjoint() for law in reversed(self.laws)))

    def branches(self, theta: ArrayLike) -> tuple[Floats, Floats]:
        return chained(self.laws, angles("theta", theta))

    def kinks(self, limit: int) -> tuple[Floats, float]:
        return chained_kinks(self.laws, limit)

    def _sample(self, theta: Floats, rng: np.random.Generator) -> Floats:
        for law in self.laws:
            theta = law.sample(theta, rng)
        return theta

    def _apply(self, function: AngleFunction, theta: Floats) -> Floats:
        _check_cost(self)
        for law in reversed(self.laws[1:]):
            function = _pulled_back(law, function)
        return self.laws[0].apply(function, theta)

    def __repr__(self) -> str:
        return " @ ".join(_wrapped(law) for law in self.laws)


@dataclass(frozen=True, repr=False)
class Power(Law):
    """A law applied n times, ``law ** n``; n = 0 is the identity f -> f.

    `apply` evaluates its function at ``fan_out ** n`` angles and raises an InputError where that is out of reach:
    use ``discretise(law, basis) ** n`` there.

    Examples
    --------
    >>> from asperity.kernels.ideal import specular
    >>> (specular() ** 3).branches(1.0)[1].tolist() == [np.pi - 1.0]
    True
    """

    law: Law
    exponent: int

    def __post_init__(self) -> None:
        whole_number("exponent", self.exponent, 0)
        set_facts(self, frame=self.law.frame, mirror_symmetric=self.law.mirror_symmetric or self.exponent == 0 or None)
        set_facts(self, reversible=self.law.reversible or self.exponent == 0 or None)
        # A float: whole numbers of 10^5 digits serve nobody.
        grown = math.exp(min(self.exponent * math.log(self.law.fan_out), 700.0))
        set_facts(self, fan_out=round(grown))

    def adjoint(self) -> Law:
        """(P^n)* = (P*)^n."""
        return self if self.reversible else Power(self.law.adjoint(), self.exponent)

    def branches(self, theta: ArrayLike) -> tuple[Floats, Floats]:
        return chained((self.law,) * self.exponent, angles("theta", theta))

    def kinks(self, limit: int) -> tuple[Floats, float]:
        return chained_kinks((self.law,) * self.exponent, limit) if self.exponent else (np.empty(0), 0.0)

    def _sample(self, theta: Floats, rng: np.random.Generator) -> Floats:
        for _ in range(self.exponent):
            theta = self.law.sample(theta, rng)
        return theta.copy() if self.exponent == 0 else theta

    def _apply(self, function: AngleFunction, theta: Floats) -> Floats:
        if self.exponent == 0:
            return np.asarray(function(theta), dtype=np.float64)
        _check_cost(self)
        if self.exponent > DEEPEST_POWER:
            raise InputError(
                f"apply: expected a power of at most {DEEPEST_POWER}, got {self.exponent}; use "
                "discretise(law, basis) ** n"
            )
        for _ in range(self.exponent - 1):
            function = _pulled_back(self.law, function)
        return self.law.apply(function, theta)

    def __repr__(self) -> str:
        return f"{_wrapped(self.law)} ** {self.exponent}"


@dataclass(frozen=True, repr=False)
class SpecularFrame(Law):
    """P J, f -> P(J f) with J f(theta) = f(pi - theta): the law in the other frame.

    Of a law in the paper's frame this is P_F, Feres' convention: specular reflection is the identity. P_F is
    self-adjoint exactly if P~ is and commutes with J; a mirror-symmetric wall suffices.

    Source: Rudzis 2022, section 1.2.6, with the convention that its formula needs (P~u - u is small for flat walls).

    Examples
    --------
    >>> from asperity.kernels.ideal import specular
    >>> frame = specular().in_specular_frame()
    >>> frame, frame.frame, frame.branches(1.0)[1].tolist() == [1.0]
    (specular().in_specular_frame(), 'specular', True)
    """

    law: Law

    def __post_init__(self) -> None:
        mirror = self.law.mirror_symmetric
        set_facts(self, frame=_other_frame(self.law.frame), mirror_symmetric=mirror, fan_out=self.law.fan_out)
        set_facts(self, reversible=mirror if self.law.reversible else None)

    @staticmethod
    def of(law: Law) -> Law:
        """The law in the other frame; of a law that was moved there, the law itself; of a sum, term by term."""
        if isinstance(law, SpecularFrame):
            return law.law
        if isinstance(law, Combination):
            return Combination(tuple((weight, SpecularFrame.of(term)) for weight, term in law.terms))
        return SpecularFrame(law)

    def adjoint(self) -> Law:
        """(P J)* = J P*, written as J (P* J) J with J a law of this frame."""
        if self.reversible:
            return self
        turned = SpecularFrame.of(self.law.adjoint())
        return turned if self.mirror_symmetric else Composition((_flip(self.frame), turned, _flip(self.frame)))

    def branches(self, theta: ArrayLike) -> tuple[Floats, Floats]:
        probability, outgoing = self.law.branches(theta)
        return probability, flipped(outgoing)

    def kinks(self, limit: int) -> tuple[Floats, float]:
        return self.law.kinks(limit)

    def _sample(self, theta: Floats, rng: np.random.Generator) -> Floats:
        return flipped(self.law.sample(theta, rng))

    def _apply(self, function: AngleFunction, theta: Floats) -> Floats:
        return self.law.apply(lambda angle: function(flipped(angle)), theta)

    def __repr__(self) -> str:
        return f"{_wrapped(self.law)}.in_specular_frame()"


def mixture(laws: Sequence[Law], weights: ArrayLike) -> Combination:
    """The law that follows ``laws[k]`` with probability ``weights[k]``.

    Raises an InputError if the numbers of laws and weights differ, a weight is negative or they do not sum to 1.

    Examples
    --------
    >>> from asperity.kernels.ideal import retroreflection, specular
    >>> mixture([specular(), retroreflection()], [0.5, 0.5])
    0.5*specular() + 0.5*retroreflection()
    """
    weight = np.asarray(weights, dtype=np.float64)
    if weight.shape != (len(laws),):
        raise InputError(f"weights: expected one for each of {len(laws)} laws, got an array of shape {weight.shape}")
    total = Combination(tuple(zip(weight.tolist(), laws, strict=True)))
    total.terms_checked()
    return total


def _other_frame(frame: Frame) -> Frame:
    return "paper" if frame == "specular" else "specular"


def _flip(frame: Frame) -> Law:
    """The operator J as a law of the given frame."""
    from .ideal import retroreflection, specular

    return specular() if frame == "paper" else SpecularFrame(retroreflection())


def _common_frame(laws: Sequence[Law], verb: str) -> Frame:
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


def _wrapped(law: Law) -> str:
    return f"({law!r})" if isinstance(law, (Combination, Composition)) else repr(law)


def _check_cost(law: Law) -> None:
    if law.fan_out > MOST_EVALUATIONS:
        raise InputError(
            f"apply: {law!r} needs {law.fan_out:.1e} evaluations for each angle (at most {MOST_EVALUATIONS:.0e}); use "
            "discretise() and compose the matrices"
        )


def _pulled_back(law: Law, function: AngleFunction) -> AngleFunction:
    return lambda angle: law.apply(function, angle)
