"""Recursion over compound laws: properties of sums, products and powers from those of their parts."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

from ...core.errors import InputError
from .law import Combination, Composition, Law, Power, SpecularFrame

Fact = TypeVar("Fact")
# Asked of a law to see whether it lists isometries.
FEW_BREAKPOINTS, PROBE = 8, 1.0


@dataclass(frozen=True)
class Rules(Generic[Fact]):
    """How a fact about laws passes through the algebra.

    Parameters
    ----------
    leaf : callable
        The fact of a law that is not a combination of others.
    mixture : callable
        From the (weight, fact) pairs of a weighted sum; terms of weight 0 are left out.
    chain : callable
        From the facts of laws applied one after the other, the first one first; of none for the identity.
    turned : callable
        From the fact of a law to that of the law in the other frame.
    whole : callable, optional
        From a law that is made of others, and what its parts say, to the fact; by default what the parts say.
    """

    leaf: Callable[[Law], Fact]
    mixture: Callable[[Sequence[tuple[float, Fact]]], Fact]
    chain: Callable[[Sequence[Fact]], Fact]
    mirrored: Callable[[Fact], Fact]
    whole: Callable[[Law, Fact], Fact] = lambda law, fact: fact


def fold(law: Law, rules: Rules[Fact]) -> Fact:
    """The fact of a law from those of its parts; a wall whose law is known in closed form counts as that law.

    Examples
    --------
    How many reflections a law makes in the mean:

    >>> from asperity.kernels import retroreflection, specular
    >>> count = Rules(lambda law: 1.0, lambda terms: sum(w * n for w, n in terms), sum, lambda n: n)
    >>> fold(0.5 * specular() + 0.5 * (specular() @ retroreflection()) ** 2, count)
    2.5
    """
    if isinstance(law, Combination):
        terms = [(weight, fold(term, rules)) for weight, term in law.terms_checked() if weight > 0.0]
        return rules.whole(law, rules.mixture(terms))
    if isinstance(law, Composition):
        return rules.whole(law, rules.chain([fold(part, rules) for part in law.laws]))
    if isinstance(law, Power):
        return rules.whole(law, rules.chain([fold(law.law, rules)] * law.exponent))
    if isinstance(law, SpecularFrame):
        return rules.whole(law, rules.mirrored(fold(law.law, rules)))
    return rules.leaf(law) if law.closed_form is None else fold(law.closed_form, rules)


def is_compound(law: Law) -> bool:
    """Whether `fold` takes the law apart into others."""
    return isinstance(law, (Combination, Composition, Power, SpecularFrame))


def has_chain(law: Law) -> bool:
    """Whether laws follow one another somewhere in the law, so that the numbers of their branches multiply."""
    return fold(law, Rules(lambda _: False, lambda terms: any(fact for _, fact in terms), lambda _: True, lambda f: f))


def holds_of_all(law: Law, test: Callable[[Law], bool]) -> bool:
    """Whether every part of a law that is no combination of others keeps a promise."""
    return fold(law, Rules(test, lambda terms: all(fact for _, fact in terms), all, lambda fact: fact))


def made_of_isometries(law: Law) -> bool:
    """Whether a law is by theorem a mixture of isometries theta' = +-theta + const for almost every angle.

    So are the laws of walls of straight pieces, specular reflection, retroreflection, and all that is made of them.
    """
    return holds_of_all(law, lambda part: part.is_isometric)


def lists_branches(law: Law) -> bool:
    """Whether every part of a law answers when asked for its isometries: more than that it is made of them."""
    return holds_of_all(law, _answers)


def _answers(law: Law) -> bool:
    try:
        law.branches(PROBE)
    except InputError:
        return False
    return math.isfinite(law.breakpoints(FEW_BREAKPOINTS)[1])
