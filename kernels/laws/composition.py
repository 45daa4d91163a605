"""Laws applied one after the other."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...checks import Floats, angles, whole_number
from ...errors import InputError
from .branches import chained, chained_kinks
from .law import AngleFunction, Law, set_facts
from .weighted_sum import Combination, as_factor, common_frame

# More evaluations than this for one incoming angle are not a computation that anybody wants to wait for.
MOST_EVALUATIONS = 10**7
# Nested calls of `apply` beyond this would meet Python's own limit on recursion.
DEEPEST_POWER = 100


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
    >>> from asperity.kernels.laws.ideal import retroreflection, specular
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
        set_facts(self, laws=tuple(flat), frame=common_frame(flat, "compose"))
        palindrome = all(law is back or law == back for law, back in zip(flat, reversed(flat), strict=True))
        set_facts(self, reversible=True if palindrome and all(law.reversible for law in flat) else None)
        set_facts(self, mirror_symmetric=True if all(law.mirror_symmetric for law in flat) else None)
        set_facts(self, fan_out=math.prod(law.fan_out for law in flat))

    @staticmethod
    def of(first: Law, second: Law) -> Law:
        """First one law, then the other; bilinear, so that ``0.6 * law @ other`` is 0.6 times the composition.

        A combination whose weights sum to 1 is kept whole.
        """
        for place, law in enumerate((first, second)):
            if isinstance(law, Combination) and not law.sums_to_one:
                pairs = [(term, second) if place == 0 else (first, term) for _, term in law.terms]
                weights = [weight for weight, _ in law.terms]
                return Combination(tuple((w, Composition.of(*pair)) for w, pair in zip(weights, pairs, strict=True)))
        return Composition((first, second))

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
        return " @ ".join(as_factor(law) for law in self.laws)


@dataclass(frozen=True, repr=False)
class Power(Law):
    """A law applied n times, ``law ** n``; n = 0 is the identity f -> f.

    `apply` evaluates its function at ``fan_out ** n`` angles and raises an InputError where that is out of reach:
    use ``discretise(law, basis) ** n`` there.

    Examples
    --------
    >>> from asperity.kernels.laws.ideal import specular
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
        return f"{as_base(self.law)} ** {self.exponent}"


def as_base(law: Law) -> str:
    """The name of a law before an exponent or a method."""
    return f"({law!r})" if isinstance(law, Power) else as_factor(law)


def _check_cost(law: Law) -> None:
    if law.fan_out > MOST_EVALUATIONS:
        raise InputError(
            f"apply: {law!r} needs {law.fan_out:.1e} evaluations for each angle (at most {MOST_EVALUATIONS:.0e}); use "
            "discretise() and compose the matrices"
        )


def _pulled_back(law: Law, function: AngleFunction) -> AngleFunction:
    return lambda angle: law.apply(function, angle)
