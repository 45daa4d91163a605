"""Enclosures of the spectrum of sums of words that begin and end with a Henyey-Greenstein scattering.

HG(g) has the norm |g|^n on Legendre polynomials of degree n and more. Therefore such a word differs from its matrix in
the first n polynomials by an operator of norm at most 2 |g|^n, plus the error of the matrix. The other words (identity,
specular and Lambertian reflection) are diagonal in these polynomials. By Weyl's theorem the eigenvalues off the
essential spectrum lie within this distance of the matrix eigenvalues, in order.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...core.checks import Floats
from ...core.errors import InputError
from ...core.estimates import ErrorKind
from ...core.rounding import EPS
from ...kernels import KernelMatrix, Law, Legendre, discretise
from ...kernels.discretisation.scattering import is_scattered
from ...kernels.laws.ideal import LambertianLaw
from ...kernels.laws.law import specular
from ...kernels.laws.phase_function import HenyeyGreensteinLaw
from ...kernels.laws.structure import holds_of_all
from ...kernels.walls.simplification import Sum, Word, words_of
from ..eigenvalues.parity import Parity
from ..eigenvalues.spectra import check_reversible

# Largest size of diagonal and of other matrices, and the fraction of the tolerance for the tail.
MOST_DIAGONAL, MOST_FUNCTIONS, TAIL_FRACTION = 2048, 512, 0.1
# Rounding of sums and powers of numbers below 1; it is n^(1/2) times larger for eigenvalues of an n x n matrix.
ROUNDING = 8.0 * EPS


@dataclass(frozen=True)
class ScatteredSpectrum:
    """The eigenvalues of largest modulus of a matrix that differs from the law by an operator of small norm.

    Attributes
    ----------
    values : array of shape (k,)
        The 1 of the constants first, the others by decreasing modulus.
    parities : tuple of str
    certain : tuple of bool
        Whether the index of the eigenvalue near this value is known.
    distance : float
        A bound of the norm of the difference.
    essential : float
        Largest modulus in the essential spectrum, exact.
    degrees : int
        Number of Legendre polynomials.
    kind : {"bound", "estimate"}
        ``"bound"`` if the matrix is diagonal.
    """

    values: Floats
    parities: tuple[Parity, ...]
    certain: tuple[bool, ...]
    distance: float
    essential: float
    degrees: int
    kind: ErrorKind


def scattered_words(law: Law) -> Sum | None:
    """The law as a sum of words with scatterings at their ends or diagonal; None for other laws."""
    if holds_of_all(law, lambda part: not isinstance(part, HenyeyGreensteinLaw)):
        return None
    words = words_of(law)
    if words is None:
        return None
    return words if all(_is_diagonal(word) or _is_enclosed(word) for word in words) else None


def scattered_spectrum(law: Law, words: Sum, k: int, tolerance: float) -> ScatteredSpectrum:
    """The spectrum of a self-adjoint law, from its words.

    Raises
    ------
    InputError
        If a scattering is so concentrated that more than 512 polynomials are needed.
    """
    diagonal = all(map(_is_diagonal, words))
    most = MOST_DIAGONAL if diagonal else MOST_FUNCTIONS
    wanted = EPS if diagonal else TAIL_FRACTION * tolerance
    degrees = k + 1
    while degrees < most and _tail(words, degrees) > wanted:
        degrees = min(2 * degrees, most)
    if not diagonal and _tail(words, degrees) > tolerance:
        raise InputError(
            f"law: {law!r} has a scattering that leaves {_tail(words, degrees):.2g} of degree {degrees}, "
            "the highest that is followed in compositions; ask for a tolerance above that, or for spectrum(law)"
        )
    symmetric, error = (
        _diagonal(words, degrees) if diagonal else _checked(discretise(law, Legendre(degrees), tolerance=wanted))
    )
    distance = error + 2.0 * _tail(words, degrees)
    even, odd = (sum(w * _high_degree_value(word, sign) for word, w in words.items()) for sign in (1.0, -1.0))
    essential = max(abs(even), abs(odd))
    values, parities = _eigenvalues(symmetric, law.mirror_symmetric is True)
    listed = values[: k - 1]
    certain = [_is_certain(values, index, k - 1, distance, essential) for index in range(len(listed))]
    first: Parity = "even" if law.mirror_symmetric is True else "none"
    return ScatteredSpectrum(
        np.append(1.0, listed), (first, *parities[: k - 1]), (True, *certain), float(distance), essential, degrees,
        "bound" if diagonal else "estimate",
    )  # fmt: skip


def _is_diagonal(word: Word) -> bool:
    return not word or (len(word) == 1 and (word[0] == specular() or _has_eigenvalues(word[0])))


def _has_eigenvalues(law: Law) -> bool:
    return isinstance(law, (LambertianLaw, HenyeyGreensteinLaw))


def _is_enclosed(word: Word) -> bool:
    ends = isinstance(word[0], HenyeyGreensteinLaw) and isinstance(word[-1], HenyeyGreensteinLaw)
    return ends and is_scattered(word)


def _factor(word: Word) -> float:
    """The larger |g| of the two ends of a word; 0 if neither end is a scattering."""
    ends = [part for part in (*word[:1], *word[-1:]) if isinstance(part, HenyeyGreensteinLaw)]
    return max((abs(part.g) for part in ends), default=0.0)


def _tail(words: Sum, degrees: int) -> float:
    return float(sum(weight * _factor(word) ** degrees for word, weight in words.items()))


def _high_degree_value(word: Word, sign: float) -> float:
    """The eigenvalue of a word on even or odd polynomials of high degree, which is not 0 for isometries only."""
    if not word:
        return 1.0
    return sign if word == (specular(),) else 0.0


def _diagonal(words: Sum, degrees: int) -> tuple[Floats, float]:
    degree = np.arange(float(degrees))
    total = np.zeros(degrees)
    for word, weight in words.items():
        if word and isinstance(word[0], HenyeyGreensteinLaw):
            total += weight * word[0].g ** degree
        elif word and isinstance(word[0], LambertianLaw):
            total += weight * (degree == 0.0)
        else:
            total += weight * (np.where(degree % 2.0, -1.0, 1.0) if word else 1.0)
    return np.diag(total), ROUNDING


def _checked(matrix: KernelMatrix) -> tuple[Floats, float]:
    check_reversible(matrix)
    symmetric = np.asarray(0.5 * (matrix.symmetric + matrix.symmetric.T))
    asymmetry = float(np.linalg.norm(matrix.symmetric - symmetric))
    return symmetric, float(matrix.error) + asymmetry + ROUNDING * len(symmetric) ** 0.5


def _eigenvalues(symmetric: Floats, mirrored: bool) -> tuple[Floats, tuple[Parity, ...]]:
    """Eigenvalues without the constants, by decreasing modulus, with their parities."""
    inner = symmetric[1:, 1:]
    values: Floats
    names: list[Parity] = ["none"] * len(inner)
    if np.array_equal(inner, np.diag(np.diag(inner))):
        values = np.diag(inner)
        if mirrored:
            names = ["odd" if index % 2 == 0 else "even" for index in range(len(values))]
    elif mirrored:
        # matrix entries between the two parities are errors
        odd, even = (np.linalg.eigvalsh(inner[start::2, start::2]) for start in (0, 1))
        values = np.asarray(np.append(odd, even), dtype=np.float64)
        names[: len(odd)], names[len(odd) :] = ["odd"] * len(odd), ["even"] * len(even)
    else:
        values = np.asarray(np.linalg.eigvalsh(inner), dtype=np.float64)
    order = np.argsort(-np.abs(values), kind="stable")
    return values[order], tuple(names[index] for index in order)


def _is_certain(values: Floats, index: int, number: int, distance: float, essential: float) -> bool:
    """Whether the index of a value is known: all values that may have its modulus are listed and have its sign."""
    if abs(values[index]) - distance <= essential + distance:
        return False
    # the cluster of values whose moduli are not separated by gaps
    modulus = np.abs(values)
    apart = np.flatnonzero(modulus[:-1] - modulus[1:] > 2.0 * distance) + 1
    first = int(apart[apart <= index].max(initial=0))
    last = int(apart[apart > index].min(initial=len(values)))
    same_sign = bool(np.all(np.sign(values[first:last]) == np.sign(values[index])))
    return same_sign and last <= number and modulus[last - 1] - distance > essential + distance
