"""Laws made of other laws: recursion over sums, products and powers, words, and laws of several angles.

A word is a chain of laws in the order of application; the empty word is the identity.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain, product
from typing import Generic, TypeAlias, TypeVar

import numpy as np

from ...core.checks import Value
from ...core.errors import InputError
from ..bases.basis import Basis
from ..bases.spaces import TensorBasis
from ..matrices.matrix import KernelMatrix
from .law import Combination, Composition, Law, Power, SpecularFrame, retroreflection, simplified, specular

Fact = TypeVar("Fact")
Word = tuple[Law, ...]
Sum = dict[Word, float]
# Compositions of sums are multiplied out if the result has at most this many words.
MOST_WORDS = 24
# Limit on the laws of a word.
LONGEST_WORD = 100
# Breakpoint limit and incoming angle (in radians) of the test whether a law lists isometries.
FEW_BREAKPOINTS, PROBE = 8, np.array([1.0])


@dataclass(frozen=True)
class Rules(Generic[Fact]):
    """The rules by which `fold` computes a property ("fact") of a compound law from the facts of its parts.

    Parameters
    ----------
    leaf : callable
        From a law that is not compound to its fact.
    mixture : callable
        From the (weight, fact) pairs of a weighted sum, without terms of weight 0.
    chain : callable
        From the facts of composed laws, in their order of application; an empty list stands for the identity.
    mirrored : callable
        From the fact of a law to the fact of the law in the other frame.
    """

    leaf: Callable[[Law], Fact]
    mixture: Callable[[Sequence[tuple[float, Fact]]], Fact]
    chain: Callable[[Sequence[Fact]], Fact]
    mirrored: Callable[[Fact], Fact]


def fold(law: Law, rules: Rules[Fact]) -> Fact:
    """The fact of a law computed from the facts of its `parts`, and of their parts.

    Examples
    --------
    The mean number of reflections of a law:

    >>> from asperity.kernels import TriangularTeethLaw, specular
    >>> count = Rules(lambda law: 1.0, lambda terms: sum(w * n for w, n in terms), sum, lambda n: n)
    >>> fold(0.5 * specular() + 0.5 * (specular() @ TriangularTeethLaw(1.0)) ** 2, count)
    2.5
    """
    if isinstance(law, Composition):
        return rules.chain([fold(part, rules) for part in law.laws])
    if isinstance(law, Power):
        return rules.chain([fold(law.law, rules)] * len(law.factors()))
    if isinstance(law, SpecularFrame):
        return rules.mirrored(fold(law.law, rules))
    parts = law.parts
    if len(parts) > 1:
        return rules.mixture([(weight, fold(term, rules)) for weight, term in parts])
    return rules.leaf(law) if parts[0][1] is law else fold(parts[0][1], rules)


def has_chain(law: Law) -> bool:
    """Whether the law contains a composition or power, so that numbers of branches multiply."""
    return fold(law, Rules(lambda _: False, lambda terms: any(fact for _, fact in terms), lambda _: True, lambda f: f))


def holds_of_all(law: Law, test: Callable[[Law], bool]) -> bool:
    """Whether every part of a law that is not compound passes the test."""
    # of a power without its factors, which may be millions
    law = law.law if isinstance(law, Power) else law
    return fold(law, Rules(test, lambda terms: all(fact for _, fact in terms), all, lambda fact: fact))


def lists_branches(law: Law) -> bool:
    """Whether every part of a law lists its isometries and breakpoints; walls of straight pieces may not."""
    return holds_of_all(
        law, lambda part: part._branches(PROBE) is not None and math.isfinite(part.breakpoints(FEW_BREAKPOINTS)[1])
    )


def words_of(law: Law) -> Sum | None:
    """The law as a weighted sum of words, in the paper's frame; None if there are more than `MOST_WORDS` words.

    Also None if a word is longer than `LONGEST_WORD`.

    Raises an InputError if a sum in the law has negative weights or weights that do not sum to 1.

    Examples
    --------
    >>> from asperity.kernels import lambertian
    >>> words_of((0.5 * lambertian() + 0.5 * specular()) ** 2)
    {(lambertian(),): 0.75, (specular(), specular()): 0.25}
    """
    return fold(law, Rules(_word, _mixed, _multiplied, lambda words: _multiplied((words, _word(specular())))))


def multiplied_out(law: Law) -> Law:
    """The law as a sum of words if there are few, else as a sum or composition without other ones of its kind in it.

    Walls are replaced by the sum of their parts.

    Examples
    --------
    >>> from asperity.kernels import lambertian
    >>> multiplied_out((0.5 * lambertian() + 0.5 * specular()) ** 2)
    0.75*lambertian() + 0.25*specular().in_specular_frame()
    """
    words = words_of(law) if has_chain(law) else None
    if words is not None:
        law = sum_of_words((weight, word) for word, weight in words.items())
    factors: Rules[Word] = Rules(
        lambda leaf: (leaf,),
        lambda terms: (sum_of_words(terms),),
        lambda words: tuple(chain.from_iterable(words)),
        lambda word: (*word, specular()),
    )
    return law_of(fold(law, factors))


def sum_of_words(terms: Iterable[tuple[float, Word]]) -> Law:
    """The sum in the paper's frame, also of words that `law_of` writes as laws in the other frame."""
    laws: list[tuple[float, Law]] = []
    for weight, word in terms:
        law = law_of(word)
        laws += [(weight * fraction, term) for fraction, term in Combination.of(law).terms]
    if len(laws) == 1:
        return laws[0][1]
    whole = object.__new__(Combination)
    whole._set(terms=tuple(laws), frame="paper")
    return whole


def law_of(word: Word) -> Law:
    """The word as one law; a law followed by specular reflection becomes a `SpecularFrame`, which has more methods."""
    if not word:
        return retroreflection()
    if len(word) == 1:
        return word[0]
    if len(word) == 2 and word[1] == specular():
        if isinstance(word[0], Combination):
            return sum_of_words((weight, (term, word[1])) for weight, term in word[0].terms)
        return word[0].in_specular_frame()
    return Composition(word)


def _word(law: Law) -> Sum | None:
    return {simplified((law,)): 1.0}


def _added(words: Iterable[tuple[Word, float]]) -> Sum:
    """The sum of weighted words."""
    total: Sum = {}
    for word, weight in words:
        total[word] = total.get(word, 0.0) + weight
    return total


def _mixed(terms: Sequence[tuple[float, Sum | None]]) -> Sum | None:
    if any(words is None for _, words in terms):
        return None
    return _added((word, weight * fraction) for weight, words in terms for word, fraction in (words or {}).items())


def _multiplied(parts: Sequence[Sum | None]) -> Sum | None:
    total: Sum = {(): 1.0}
    for words in parts:
        if words is None:
            return None
        pairs = product(total.items(), words.items())
        total = _added((simplified(word + other), weight * fraction) for (word, weight), (other, fraction) in pairs)
        if len(total) > MOST_WORDS or max(map(len, total)) > LONGEST_WORD:
            return None
    return total


# Weight, law of theta, and whether psi becomes pi - psi (else it is unchanged).
Term: TypeAlias = tuple[float, Law, bool]
# `discretise` with all its arguments but law and basis.
Discretiser: TypeAlias = "Callable[[Law | SpatialLaw, Basis], KernelMatrix]"


class SpatialLaw(Value, ABC):
    """A law of several angles or of velocities in space, whose matrix is computed in ways of its own."""

    @abstractmethod
    def matrix_on(self, basis: Basis, discretise: partial[KernelMatrix]) -> KernelMatrix:
        """The matrix in a basis, from those of other laws or by the keywords of the call alone.

        Raises InputError for a basis of other functions.
        """


class TensorLaw(SpatialLaw):
    """A law of the angles (theta, psi), computed from laws of the single angles."""

    @abstractmethod
    def parts_checked(self) -> tuple[Term, ...]:
        """The terms, of which the law is the sum; raises InputError if their weights do not sum to 1 within 1e-12."""


def checked_pair(basis: Basis) -> TensorBasis:
    """The basis, if it is a product of one for theta and one for psi; else raises InputError."""
    if isinstance(basis, TensorBasis) and [factor.measure.name for factor in basis.factors] == ["sin", "sin2"]:
        return basis
    raise InputError(
        "basis: expected a product of one basis in theta and one in psi, such as "
        f"TensorBasis((Bins(16), Bins(8, weight='sin2'))), got {basis!r}"
    )
