"""Prove the spectral gap of a law in ball arithmetic, with a certificate that others can check.

The numbers of a certificate are found in floating point, and nothing of a proof rests on them.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from decimal import Decimal
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from ...core.checks import Floats, instance, number_between
from ...core.errors import InputError, ProofError
from ...core.estimates import Summary
from ...core.files import text_of, write_whole
from ...core.long_runs import reported
from ...core.version import __version__
from ...geometry import Arc, dispersing_arcs
from ...kernels import CircularArcLaw, Law, Panels, WallLaw, discretise, lambertian, specular
from ...kernels.bases.assembly import reflection_matrix
from ...kernels.laws.structure import words_of
from .checker import Bumps, FocusingArcs, Refused, Wall, check, ctx, enclose, exact

FORMAT = "asperity proved gap 1"
# Digits of the ends of an interval.
DIGITS = 16
LEMMAS = {
    "bins": "The form of rays that are surely reflected once is at least a matrix on bins, and row sums on the rest.",
    "next arc": "A ray that leaves an arc hits the next one if K cos a > sin s and cos s + K sin a < 1, and only then.",
    "two reflections": "No ray is reflected more than twice; which are is decided by one zero of an explicit function.",
    "grazing": "Angles below eps change the number of eigenvalues below a threshold only if it is moved by a bound.",
    "law applied": "P v is an elementary term and an integral of an analytic function over rays reflected twice.",
    "form and residual": "<v, (1 - P) v> and |(1 - P - g) v|^2 are integrals of P v, analytic between known angles.",
    "chords": "A ray keeps its angle s with a focusing arc, and leaves it in the direction 2 k s - theta.",
    "intervals": "<v, P v> and |(1 - P - r) v|^2 are sums over intervals: values in the middle and slopes in balls.",
    "mixtures": "Mixtures with specular reflection, retroreflection and Lambert's law keep the eigenfunctions.",
    "powers": "The Henyey-Greenstein law has the eigenvalue g^l on the Legendre polynomial of degree l.",
    "Temple": "With one eigenvalue below nu, it is at least q - r^2/(nu - q) for the quotient q and the residual r.",
}
OF_BUMPS = "bins", "next arc", "two reflections", "grazing", "law applied", "form and residual", "mixtures", "Temple"
USED = {
    "powers": ("mixtures", "powers"),
    "dispersing arcs": OF_BUMPS,
    "focusing arcs": ("bins", "grazing", "mixtures", "Temple", "chords", "intervals"),
}


@dataclass(frozen=True, repr=False)
class Proof(Summary):
    """A theorem on the spectral gap of a law: what `prove_gap` returns.

    Attributes
    ----------
    interval : tuple of two decimal.Decimal
        The gap lies in it; decimal numbers, rounded outwards.
    statement : str
        The theorem with its hypotheses.
    lemmas : tuple of (str, str)
        Name and statement of each lemma; the proofs are in docs/theory/proved-gaps.md.
    certificate : dict
        The numbers of which the proof consists.
    """

    interval: tuple[Decimal, Decimal]
    statement: str
    lemmas: tuple[tuple[str, str], ...]
    certificate: dict[str, Any]

    def save(self, path: str | Path, overwrite: bool = False) -> Path:
        """Write the certificate as JSON; an existing file is replaced only with ``overwrite``."""
        target = Path(path)
        if target.suffix.lower() != ".json":
            raise InputError(f"path: expected a name that ends in .json, got {str(path)!r}")
        text = json.dumps(self.certificate, indent=1) + "\n"
        write_whole(target, text, overwrite=overwrite)
        return target


@reported("proof of the gap")
def prove_gap(law: Law, width: float = 1e-4) -> Proof:
    """Prove that the spectral gap of a law lies in an interval.

    Every inequality is decided in ball arithmetic, no one in floating point. The gap is that of `spectral_gap`: the
    distance between 1 and the rest of the spectrum, on functions of mean 0.

    Parameters
    ----------
    law : Law
        The law of ``dispersing_arcs`` of a curvature below sqrt(2), of ``focusing_arcs`` of a half angle below pi/2 or
        the Henyey-Greenstein law, in either convention, or a mixture with specular reflection, retroreflection and
        Lambert's law. Weights, curvatures, half angles and mean cosines are known to 2^-52 of themselves: the theorem
        holds of 1/3 as of the double beside it.
    width : float
        The width of the interval relative to the gap, at most. One core takes five to forty
        seconds for 1e-5.

    Returns
    -------
    Proof

    Raises
    ------
    InputError
        If there is no theorem on this law, or the width is out of range.
    ProofError
        If a step of the proof fails, or the interval is wider; the message says which step and what would help.

    Notes
    -----
    The method is Temple's inequality for a trial function; see the page "Proved gaps". The interval is that of
    `checker.py`, which needs python-flint alone: ``python checker.py < gap.json`` checks a saved certificate.

    Examples
    --------
    >>> from asperity import kernels as ker, spectral as spec
    >>> proof = spec.prove_gap(0.25 * ker.specular() + 0.75 * ker.lambertian())
    >>> [round(float(end), 14) for end in proof.interval]
    [0.75, 0.75]
    """
    (base, content), wanted = described(law), number_between("width", width, 0.0, 1.0)
    try:
        # the checker sets the precision of the library of balls
        with ctx.workprec(BITS):
            for certificate in certificates(base, content, wanted):
                certificate["format"] = FORMAT
                low, high = enclose(certificate)
                ends = _decimal(low, down=True), _decimal(high, down=False)
                certificate["interval"] = [str(end) for end in ends]
                if ends[1] - ends[0] <= Decimal(wanted) * ends[1]:
                    return _proof(certificate)
                reason = f"the interval [{ends[0]}, {ends[1]}] is wider than asked; ask for a greater width"
    except Refused as refusal:
        reason = f"expected {refusal}"
    raise ProofError(f"the gap of {in_words(content)} is not proved: {reason}")


def check_proof(path: str | Path) -> Proof:
    """Read a certificate, check all its inequalities in ball arithmetic, and return the proof.

    Raises
    ------
    InputError
        If the file cannot be read or is no certificate.
    ProofError
        If an inequality does not hold.
    """
    try:
        certificate = json.loads(text_of(Path(path)))
        with ctx.workprec(BITS):
            check(certificate)
    except Refused as refusal:
        raise ProofError(f"{path}: the certificate is refused, expected {refusal}") from refusal
    except InputError:
        raise
    except (
        RecursionError,
        ValueError,
        KeyError,
        TypeError,
        AttributeError,
        IndexError,
        OverflowError,
        ZeroDivisionError,
    ) as reason:
        raise InputError(f"path: expected a certificate that Proof.save wrote, got {path} ({reason!r})") from reason
    return _proof(certificate)


def _proof(certificate: dict[str, Any]) -> Proof:
    low, high = (Decimal(end) for end in certificate["interval"])
    certificate.setdefault("written by", f"asperity {__version__}")
    convention = "specular" if certificate["frame"] == "specular" else "paper's"
    statement = (
        f"In the {convention} convention every law P = {in_words(certificate)} has a spectral gap, "
        f"inf spec(1 - P) on functions of mean 0, between {low} and {high}."
    )
    used = tuple((name, LEMMAS[name]) for name in USED[certificate["law"]["family"]])
    return Proof((low, high), statement, used, certificate)


def _decimal(end: Any, down: bool) -> Decimal:
    """An end of an interval, rounded outwards to a decimal number."""
    # exact, so that it has one integer part
    with ctx.workprec(8 * BITS):
        scaled = end * 10**DIGITS
        whole = int((scaled.floor() if down else scaled.ceil()).unique_fmpz())
    return Decimal(whole).scaleb(-DIGITS)


# The weights and the curvature of a theorem have this relative radius, so that it holds of 1/3 as of the double beside.
RADIUS = 2.0**-52
# Relative difference of the arcs of a wall from those of bumps, at most.
ROUNDED = 1e-14


def described(law: Law) -> tuple[Law, dict[str, Any]]:
    """The law without ideal ones beside it, and what a certificate says; InputError if there is no theorem."""
    instance("law", law, Law, "ker.henyey_greenstein(0.5)")
    specular_frame = law.frame == "specular"
    # the kernel that keeps angles, and the one that turns them
    ideal = ("specular", "retroreflection") if specular_frame else ("retroreflection", "specular")
    weights, base = dict.fromkeys(("law", "specular", "retroreflection", "lambertian"), 0.0), None
    for word, weight in (words_of(law) or {(law, law, law): 1.0}).items():
        if all(one == specular() for one in word):
            weights[ideal[len(word) % 2]] += weight
        elif word[0] == lambertian():
            weights["lambertian"] += weight
        elif word[1:] == ((specular(),) if specular_frame else ()) and base in (None, word[0]):
            weights["law"], base = weights["law"] + weight, word[0]
        else:
            raise InputError(_expected(law))
    base = lambertian() if base is None else base
    texts = {name: _with_radius(weight) for name, weight in weights.items()}
    return base, {"law": _family(base, law), "weights": texts, "frame": law.frame}


def in_words(content: dict[str, Any]) -> str:
    """The law of a certificate."""

    def number(given: str | list[str]) -> str:
        return given if isinstance(given, str) else " +/- ".join(given)

    name = {
        "dispersing arcs": "dispersing arcs of curvature {curvature}",
        "focusing arcs": "focusing arcs of half angle {half_angle}",
        "powers": "Henyey-Greenstein of mean cosine {mean_cosine}",
    }
    text = name[content["law"]["family"]].format_map({key: number(given) for key, given in content["law"].items()})
    terms = [
        f"({number(given)}) {text if key == 'law' else key}"
        for key, given in content["weights"].items()
        if given not in (_with_radius(0.0), "0")
    ]
    return " + ".join(terms)


def _family(law: Law, whole: Law) -> dict[str, Any]:
    if law.eigenvalue_ratio is not None:
        return {"family": "powers", "mean_cosine": _with_radius(law.eigenvalue_ratio)}
    if isinstance(law, CircularArcLaw):
        return {"family": "focusing arcs", "half_angle": _with_radius(law.half_angle)}
    if isinstance(law, WallLaw) and (curvature := _curvature(law)) is not None:
        return {"family": "dispersing arcs", "curvature": _with_radius(curvature)}
    raise InputError(_expected(whole))


def _curvature(law: WallLaw) -> float | None:
    """K of a wall of bumps of radius period/K; None of another wall."""
    pieces = [piece for piece in law.wall.cell.pieces if isinstance(piece, Arc)]
    if len(pieces) != 2 or len(law.wall.cell.pieces) != 2:
        return None
    size = float(law.wall.period)
    curvature = size / float(pieces[0].semi_axes[0])
    if not 0.0 < curvature < 2.0:
        return None
    for mine, other in zip(pieces, dispersing_arcs(curvature).pieces, strict=True):
        for name in ("center", "semi_axes", "start_angle", "end_angle"):
            unit = 1.0 if name.endswith("angle") else size
            found = np.asarray(getattr(mine, name)) / unit
            if np.abs(found - getattr(other, name)).max() > ROUNDED * max(1.0, 1.0 / curvature):
                return None
    return curvature


def _with_radius(number: float) -> list[str]:
    return [repr(number), repr(abs(number) * RADIUS)]


def _expected(law: Law) -> str:
    return (
        "law: expected the law of ker.WallLaw(wall) of geo.dispersing_arcs(K) or geo.focusing_arcs(xi), or "
        "ker.henyey_greenstein(g), in either convention, or its mixture with specular(), retroreflection() and "
        f"lambertian(), got {law!r}"
    )


# Bits of balls, and of integrals; the angle below which nothing is known but the size of the trial function.
BITS, ACCURACY, FIRST = 96, 40, "1e-7"
# Cosines and sines in trial functions that are tried, and Gauss nodes of a piece.
TERMS, NODES = (6, 8, 10, 12, 14), 60
# Bins of a half turn, and the angle below which all is grazing.
BINS, GRAZING, RATIO = 150, 1e-4, 1.08
# Thresholds between the gap and the next eigenvalue that are tried, as fractions of the distance.
FRACTIONS = 0.85, 0.7, 0.5, 0.35
# The part of the width that the residual may take.
PART = 0.9
# Of focusing arcs: bits, because integrals of polynomials cancel; degree and greatest width of the pieces; how many
# kinks at half angle (1 +- 1/k) are edges; reflections that are followed; numbers of bins of a quarter turn that are
# tried, and how small the relative width may be with so many intervals a piece, at first.
ARC_BITS, DEGREE, PIECE, KINKS, REFLECTIONS, ARC_BINS = 192, 4, 0.1, 4, 50, (100, 200, 300, 450)
PARTS, PARTS_WIDTH = 100, 2e-5
ARC_FRACTIONS = 0.6, 0.4, 0.25
# Kinks nearer to each other, relative to the half angle, count as one.
APART = 1e-3


@dataclass(frozen=True)
class _Class:
    """The least eigenvalues of 1 - sign P on odd or even functions, by Galerkin's method."""

    odd: bool
    sign: int
    value: float
    following: float
    coefficients: Floats
    residual: float = 0.0


def certificates(law: Law, content: dict[str, Any], width: float) -> Iterator[dict[str, Any]]:
    """Certificates without their intervals, better and better ones, of what `described` gives."""
    if content["law"]["family"] == "powers":
        yield {**content, "precision": BITS}
        return
    if content["law"]["family"] == "focusing arcs":
        yield from _of_arcs(content, width)
        return
    law, curvature = law.in_specular_frame(), exact(content["law"]["curvature"])
    signs = {True: 1 if content["frame"] == "specular" else -1, False: 1}
    bumps, bins = Bumps(curvature, {}), _bins()
    spaces = [{odd: _galerkin(law, float(bumps.steepest), odd, sign, n) for odd, sign in signs.items()} for n in TERMS]
    weight, specular, retro, _ = (float(middle) for middle, _ in content["weights"].values())

    def mixed(one: _Class, value: float) -> float:
        return 1.0 - one.sign * (specular + (-retro if one.odd else retro)) - weight * (1.0 - value)

    best = min(spaces[-1].values(), key=lambda one: mixed(one, one.value))
    other, gap = spaces[-1][not best.odd], mixed(best, best.value)
    distance = best.following - best.value
    threshold = _threshold(bumps, bins, best, [best.value + part * distance for part in FRACTIONS])
    # where the mixture of the other parity has the gap, and some of the way beyond
    level = (gap - mixed(other, other.value)) / weight + other.value
    beyond = _threshold(bumps, bins, other, [level + part * (other.value - level) for part in (0.3, 0.1, 0.03)])
    tried = [space[best.odd] for space in spaces]
    small = [one for one in tried if one.residual**2 <= PART * width * gap / weight * (threshold - one.value)]
    mine = small[0] if small else min(tried, key=lambda one: one.residual)
    yield {
        **content, "precision": BITS, "odd": mine.odd, "trial": [repr(float(c)) for c in mine.coefficients],
        "guess": repr(mine.value), "threshold": repr(threshold), "other": repr(beyond), "bins": bins,
        "effort": {"first": FIRST, "bits": ACCURACY},
    }  # fmt: skip


def _galerkin(law: Law, steepest: float, odd: bool, sign: int, terms: int) -> _Class:
    """The lowest two values of the form on the first functions of `Trial`, without the constants."""

    def functions(angle: Floats) -> Floats:
        degrees = range(int(odd), terms + int(odd))
        return np.stack([(np.sin if (m + odd) % 2 else np.cos)(m * angle) for m in degrees], axis=-1)

    node, weight = np.polynomial.legendre.leggauss(NODES)
    place, weight = 0.5 * (node + 1.0), 0.5 * weight
    # denser towards grazing; pieces between the kinks of a quarter turn, the other one is a mirror image
    kinks = [x for x in (steepest, 3.0 * steepest, math.pi - 3.0 * steepest) if x < 0.5 * math.pi - 1e-9]
    pieces = list(pairwise(sorted([0.0, *kinks, 0.5 * math.pi])))
    angle = np.concatenate([low + (high - low) * place**2 for low, high in pieces])
    weight = np.concatenate([(high - low) * 2.0 * place * weight for low, high in pieces]) * np.sin(angle)
    own, after = functions(angle), law.apply(functions, angle)
    if not odd:
        means = (weight @ own) / weight.sum()
        own, after = own - means, after - means
    triangular = np.linalg.qr(np.sqrt(weight)[:, None] * own, mode="r")
    basis = np.linalg.pinv(triangular, rcond=1e-10)
    own, after = own @ basis, after @ basis
    change = own - sign * after
    form = own.T @ (weight[:, None] * change)
    values, vectors = np.linalg.eigh(0.5 * (form + form.T))
    # the other columns of a basis of less than all dimensions are 0
    first = int(np.argmax(np.abs(vectors.T @ (own.T @ (weight[:, None] * own)) @ vectors).diagonal() > 0.5))
    missed = (change - values[first] * own) @ vectors[:, first]
    residual = float(np.sqrt(weight @ missed**2))
    return _Class(odd, sign, float(values[first]), float(values[first + 1]), basis @ vectors[:, first], residual)


def _bins() -> list[str]:
    """Edges of bins up to a quarter turn: geometric near grazing, then equal."""
    edges = [GRAZING]
    while edges[-1] * (RATIO - 1.0) < math.pi / BINS:
        edges.append(edges[-1] * RATIO)
    return [repr(float(x)) for x in (*edges[:-1], *np.linspace(edges[-1], 0.5 * math.pi, BINS // 2 + 1)[:-1])]


def _threshold(law: Wall, bins: list[str], one: _Class, tried: list[float]) -> float:
    """The first threshold below which are as many eigenvalues as expected."""
    most = (0 if tried[0] < one.value else 1) + (0 if one.odd else 1)
    for value in tried:
        try:
            if law.count(bins, one.odd, one.sign, exact(repr(value))) <= most:
                return value
        except Refused:
            continue
    raise Refused(f"{most} eigenvalues of {'odd' if one.odd else 'even'} functions below {tried[-1]:.6f}")


def _of_arcs(content: dict[str, Any], width: float) -> Iterator[dict[str, Any]]:
    """Certificates of focusing arcs, with more and more intervals."""
    half_angle = float(content["law"]["half_angle"][0])
    edges, classes = _piecewise(half_angle, content["frame"])
    # that of the certificate; the caller sets it back
    ctx.prec = ARC_BITS
    law = FocusingArcs(exact(content["law"]["half_angle"]), {})
    for number in ARC_BINS:
        bins = _arc_bins(half_angle, number)
        try:
            thresholds = [
                _threshold(law, bins, one, [one.value + part * (one.following - one.value) for part in ARC_FRACTIONS])
                for one in classes
            ]
            break
        except Refused:
            if number == ARC_BINS[-1]:
                raise
    parts = math.ceil(PARTS * math.sqrt(PARTS_WIDTH / width))
    for growth in (1, 2, 4):
        yield {
            **content, "precision": ARC_BITS, "edges": edges, "bins": bins,
            "effort": {"parts": growth * parts, "reflections": REFLECTIONS},
            "parities": [
                {"trial": [[repr(x) for x in p] for p in one.coefficients.tolist()], "guess": repr(one.value),
                 "threshold": repr(threshold)}
                for one, threshold in zip(classes, thresholds, strict=True)
            ],
        }  # fmt: skip


def _piecewise(half_angle: float, frame: str) -> tuple[list[str], list[_Class]]:
    """Edges up to a quarter turn, and the least values on even and odd functions with the polynomials between them."""
    # where rays with another number of reflections begin
    kinks = half_angle * np.array([1.0, *(1.0 + sign / k for k in range(1, KINKS + 1) for sign in (-1, 1))])
    ends = np.unique([0.0, 0.5 * np.pi, *(t for x in kinks for t in (x, np.pi - x) if 0.0 < t < 0.5 * np.pi)])
    ends = ends[np.append(np.diff(ends) > APART * half_angle, True)]
    inner = [np.linspace(a, b, 2 + int((b - a) / PIECE))[:-1] for a, b in pairwise(ends)]
    edges = np.concatenate((*inner, ends[-1:]))
    basis = Panels(np.concatenate((edges, np.pi - edges[-2::-1])), DEGREE)
    matrix = discretise(CircularArcLaw(half_angle), basis, tolerance=1e-9).symmetric
    half, classes, lengths = basis.size // 2, [], np.diff(edges)[:, None]
    mirrored = matrix @ reflection_matrix(basis)
    for odd in (False, True):
        fold, sign = -1 if odd else 1, -1 if odd and frame == "paper" else 1
        # in the specular frame the law is that of the paper and a mirror image
        block = fold * sign * (matrix + fold * mirrored)[:half, :half]
        values, vectors = np.linalg.eigh(np.eye(half) - 0.5 * (block + block.T))
        first = 0 if odd else 1
        padded = np.concatenate((vectors[:, first], np.zeros(half)))[:, None]
        series = basis.legendre_series(padded)[: len(lengths), :, 0]
        powers = np.array([np.polynomial.legendre.leg2poly(one) for one in series])
        powers = powers * (2.0 / lengths) ** np.arange(DEGREE + 1)
        classes.append(_Class(odd, sign, float(values[first]), float(values[first + 1]), powers))
    return [repr(float(x)) for x in edges[1:-1]], classes


def _arc_bins(half_angle: float, number: int) -> list[str]:
    """Edges of bins up to a quarter turn, denser near grazing angles and where these lead, at twice the half angle."""
    first = min(4.0 / number, 0.4 * min(half_angle, np.pi - 2.0 * half_angle))
    angle = np.linspace(first, 0.5 * np.pi, 10**5)
    from_image = np.abs(angle - min(2.0 * half_angle, np.pi - 2.0 * half_angle))
    total = np.cumsum(0.5 / angle + 1.0 + 0.2 / (from_image + 0.02))
    return [repr(float(x)) for x in np.interp(np.linspace(total[0], total[-1], number + 1)[:-1], total, angle)]
