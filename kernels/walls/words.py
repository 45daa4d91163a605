"""Laws as weighted sums of words: compositions simplified by the algebra alone.

A word is a chain of laws, the first one first; the empty word is the identity. As operators, for laws that keep
sin(theta) d theta: retroreflection is the identity; specular reflection J commutes with laws that are mirror-symmetric;
J J = 1, as for other involutions; HG(g) HG(h) = HG(g h) and J HG(g) = HG(-g); after the Lambertian law nothing before
it matters, and nothing after it either; rectangular teeth of one shape several times are known in closed form.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from ..laws.ideal import LambertianLaw, lambertian
from ..laws.involution import InvolutionLaw
from ..laws.law import Composition, IsometryLaw, Law, SpecularFrame, retroreflection, specular
from ..laws.phase_function import HenyeyGreensteinLaw
from ..laws.structure import Rules, fold
from .rectangular import RectangularTeethLaw
from .repeated_teeth import MOST_TIMES, RepeatedTeethLaw

Word = tuple[Law, ...]
Sum = dict[Word, float]

# Sums of compositions are multiplied out as long as no more words than this come of it.
MOST_WORDS = 24


def words_of(law: Law) -> Sum | None:
    """The law as a sum of words with their weights, in the paper's frame; None if there would be too many words.

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
    """The word as one law; of a law before a flip it is that law in the other frame, which has more methods."""
    if not word:
        return retroreflection()
    if len(word) == 1:
        return word[0]
    if len(word) == 2 and word[1] == specular():
        return SpecularFrame(word[0])
    return Composition(word)


def _leaf(law: Law) -> Sum | None:
    # a polygonal wall's law as a table of isometries
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
        if len(product) > MOST_WORDS:
            return None
        total = product
    return total


def reduced(word: Word) -> Word:
    """The shortest word for the same operator that the rules above lead to."""
    return _joined(_mirrored_angle(_forgotten(word)))


def _forgotten(word: Word) -> Word:
    """Without identities, and without what the Lambertian law makes no difference to."""
    word = tuple(law for law in word if law != retroreflection())
    diffuse = [k for k, law in enumerate(word) if _is_lambertian(law)]
    if not diffuse:
        return word
    after = word[diffuse[-1] + 1 :]
    irreversible = next((k for k, law in enumerate(after) if not law.reversible), len(after))
    return (lambertian(), *after[irreversible:])


def _mirrored_angle(word: Word) -> Word:
    """With flips moved through mirror-symmetric laws: one at most in each run of these, in a scattering if there is."""
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
    """With neighbouring scatterings, or teeth, as one, and without involutions that undo each other."""
    for index, (first, second) in enumerate(pairwise(word)):
        if isinstance(first, InvolutionLaw) and first == second:
            return reduced(word[:index] + word[index + 2 :])
        if isinstance(first, HenyeyGreensteinLaw) and isinstance(second, HenyeyGreensteinLaw):
            joint = HenyeyGreensteinLaw(first.g * second.g)
            return reduced((*word[:index], joint, *word[index + 2 :]))
        again = _repeated(first, second)
        if again is not None:
            return reduced((*word[:index], again, *word[index + 2 :]))
    return word


def _repeated(first: Law, second: Law) -> Law | None:
    """Rectangular teeth of the same shape one after the other."""
    teeth = [law for law in (first, second) if isinstance(law, (RectangularTeethLaw, RepeatedTeethLaw))]
    times = sum(law.times if isinstance(law, RepeatedTeethLaw) else 1 for law in teeth)
    shapes = {law.height_to_width for law in teeth}
    return (
        RepeatedTeethLaw(shapes.pop(), times) if len(teeth) == 2 and len(shapes) == 1 and times <= MOST_TIMES else None
    )


def _is_lambertian(law: Law) -> bool:
    return isinstance(law, LambertianLaw) or (isinstance(law, HenyeyGreensteinLaw) and law.g == 0.0)
