"""Prove the spectral gap of a law in ball arithmetic, with a certificate that others can check."""

from __future__ import annotations

import json
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np

from ...core.checks import instance, number_between
from ...core.errors import InputError, ProofError
from ...core.estimates import Summary
from ...core.files import text_of, write_whole
from ...core.long_runs import reported
from ...core.version import __version__
from ...geometry import Arc, dispersing_arcs
from ...kernels import CircularArcLaw, Law, WallLaw, lambertian, specular
from ...kernels.laws.structure import words_of
from .checker import Refused, check, ctx, enclose
from .search import BITS, certificates

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
