"""Laws as weighted sums of words: compositions simplified by algebraic rules.

A word is a chain of laws in the order of application; the empty word is the identity. The rules hold for operators that
preserve sin(theta) d theta. Retroreflection is the identity. Specular reflection J commutes with mirror-symmetric laws.
J and other involutions have the square 1. HG(g) HG(h) = HG(g h) and J HG(g) = HG(-g). A chain that contains the
Lambertian law is the Lambertian law.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from ..laws.ideal import LambertianLaw, lambertian
from ..laws.involution import InvolutionLaw
from ..laws.law import Composition, IsometryLaw, Law, SpecularFrame, retroreflection, specular
from ..laws.phase_function import HenyeyGreensteinLaw
from ..laws.structure import Rules, fold

Word = tuple[Law, ...]
Sum = dict[Word, float]

# Compositions of sums are multiplied out if the result has at most this many words.
MOST_WORDS = 24
# Limit on the laws of a word; each is compared with its neighbours whenever one is added.
LONGEST_WORD = 100


def words_of(law: Law) -> Sum | None:
    """The law as a weighted sum of words, in the paper's frame; None if there are more than `MOST_WORDS` words.

    Also None if a word is longer than `LONGEST_WORD`.

    Raises an InputError if a sum in the law has negative weights or weights that do not sum to 1.

    Examples
    --------
    >>> from asperity.kernels.laws.phase_function import henyey_greenstein
    >>> from asperity.kernels import maxwell
    >>> words_of(retroreflection() @ henyey_greenstein(0.5) @ specular())
    {(henyey_greenstein(-0.5),): 1.0}
    >>> words_of(maxwell(0.5) ** 2)
    {(lambertian(),): 0.75, (): 0.25}
    """
    return fold(law, Rules(_leaf, _mixture, _chain, lambda words: _chain((words, _leaf(specular())))))


def law_of(word: Word) -> Law:
    """The word as one law; a law followed by J becomes a `SpecularFrame`, which has more methods."""
    if not word:
        return retroreflection()
    if len(word) == 1:
        return word[0]
    if len(word) == 2 and word[1] == specular():
        return SpecularFrame(word[0])
    return Composition(word)


def _leaf(law: Law) -> Sum | None:
    # a wall's law in closed form, or as a table of isometries
    return {reduced((law.exact_law or law,)): 1.0}


def _mixture(terms: Sequence[tuple[float, Sum | None]]) -> Sum | None:
    total: Sum = {}
    for weight, words in terms:
        if words is None:
            return None
        for word, fraction in words.items():
            total[word] = total.get(word, 0.0) + weight * fraction
    return total


def _chain(parts: Sequence[Sum | None]) -> Sum | None:
    total: Sum = {(): 1.0}
    for words in parts:
        if words is None:
            return None
        product: Sum = {}
        for word, weight in total.items():
            for other, fraction in words.items():
                longer = reduced(word + other)
                product[longer] = product.get(longer, 0.0) + weight * fraction
        if len(product) > MOST_WORDS or max(map(len, product)) > LONGEST_WORD:
            return None
        total = product
    return total


def reduced(word: Word) -> Word:
    """The word for the same operator after applying the rules above."""
    return _joined(_mirror_moved(_forgotten(word)))


def _forgotten(word: Word) -> Word:
    """Remove identities, and all laws that have no effect beside a Lambertian law."""
    word = tuple(law for law in word if law != retroreflection())
    diffuse = [k for k, law in enumerate(word) if _is_lambertian(law)]
    if not diffuse:
        return word
    after = word[diffuse[-1] + 1 :]
    irreversible = next((k for k, law in enumerate(after) if not law.reversible), len(after))
    return (lambertian(), *after[irreversible:])


def _mirror_moved(word: Word) -> Word:
    """Move J through mirror-symmetric laws: each run of these has at most one J, absorbed by an HG law if possible."""
    found: list[Law] = []
    run: list[Law] = []
    for law in (*word, None):
        if law is not None and law.mirror_symmetric:
            run.append(law)
            continue
        others = [one for one in run if not isinstance(one, IsometryLaw)]
        if (len(run) - len(others)) % 2:
            index = next((k for k, one in enumerate(others) if isinstance(one, HenyeyGreensteinLaw)), None)
            if index is not None:
                others[index] = HenyeyGreensteinLaw(-others[index].g)  # type: ignore[attr-defined]
            else:
                others.append(specular())
        found += others
        run = []
        if law is not None:
            found.append(law)
    return tuple(found)


def _joined(word: Word) -> Word:
    """Merge neighbouring HG laws, and cancel pairs of equal involutions."""
    for index, (first, second) in enumerate(pairwise(word)):
        if isinstance(first, InvolutionLaw) and first == second:
            return reduced(word[:index] + word[index + 2 :])
        if isinstance(first, HenyeyGreensteinLaw) and isinstance(second, HenyeyGreensteinLaw):
            joint = HenyeyGreensteinLaw(first.g * second.g)
            return reduced((*word[:index], joint, *word[index + 2 :]))
    return word


def _is_lambertian(law: Law) -> bool:
    return isinstance(law, LambertianLaw) or (isinstance(law, HenyeyGreensteinLaw) and law.g == 0.0)
