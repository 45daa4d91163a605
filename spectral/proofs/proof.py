"""Prove the spectral gap of a law in ball arithmetic, with a certificate that others can check."""

from __future__ import annotations

import json
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from typing import Any

from ...core.checks import number_between
from ...core.errors import InputError, ProofError
from ...core.estimates import Summary
from ...core.files import text_of, write_whole
from ...core.long_runs import reported
from ...core.version import __version__
from ...kernels import Law
from .checker import Refused, check, ctx, enclose
from .description import described, in_words
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
