"""Laws that are not known to preserve the measure, or to be self-adjoint, and their norm on functions of mean 0."""

from __future__ import annotations

import numpy as np

from ...core.checks import is_of_package
from ...core.errors import AccuracyError
from ...kernels import Law, Legendre, discretise
from ...kernels.laws.density import not_invariant
from ...kernels.laws.law import knows_errors
from ...kernels.laws.matrix_law import finite_matrix
from ...kernels.laws.structure import holds_of_all
from ..eigenvalues.spectra import check_reversible

# Polynomials whose means a law must keep to this tolerance beyond the error of their matrix; one of known error above
# UNKNOWN decides nothing.
POLYNOMIALS, TOLERANCE, UNKNOWN = 16, 1e-6, 0.05
# Size and tolerance of the matrix by which a law is examined.
EXAMINED, EXAMINED_TOLERANCE = 8, 1e-3


def self_adjoint_elsewhere(law: Law) -> Law | None:
    """The law in the other convention, if it is self-adjoint there and not known to be so in its own; else None.

    Examples
    --------
    >>> from asperity import geometry as geo, kernels as ker
    >>> wall = ker.WallLaw(geo.Wall.from_vertices([(0, 0), (0.3, -0.4), (1, 0)]))
    >>> self_adjoint_elsewhere(wall.in_specular_frame()) == wall, self_adjoint_elsewhere(wall) is None
    (True, True)
    """
    if law.reversible:
        return None
    other = law.in_specular_frame()
    return other if other.reversible else None


def refuse_unless_self_adjoint(law: Law) -> None:
    """Raise an AccuracyError if a law is not reversible, or reversible in the other frame only.

    A law of which this is not known, or said by a class of the user's, is examined by its matrix in a few polynomials.

    Raises
    ------
    AccuracyError
        The message states the bounds that hold nevertheless.
    """
    other = self_adjoint_elsewhere(law)
    if other is not None:
        raise AccuracyError(
            f"{why_not_self_adjoint(other)}. What is true: {what_is_true()}; spectral_gap(law) gives 1 - slem as its "
            f"value. The eigenvalues that exist are those of {other!r}, in the {other.frame} convention",
            np.inf,
        )
    if law.reversible is False:
        raise AccuracyError(
            f"{law!r} is not symmetric with respect to sin(theta) d theta: its spectrum need not be real. "
            "Use law @ law.adjoint() if that is what you mean",
            np.inf,
        )
    # a class of this package is trusted, and one whose distributions, of unknown error, could refute nothing
    if law.reversible is None or not holds_of_all(law, lambda part: is_of_package(part) or not knows_errors(part)):
        check_reversible(discretise(law, Legendre(EXAMINED), tolerance=EXAMINED_TOLERANCE))


def refuse_unless_invariant(law: Law, reason: str) -> None:
    """Raise an InputError if a law does not preserve sin(theta) d theta; ``reason`` says what this is needed for.

    Reversible laws preserve it, and so do their sums, products and laws in the other convention. Of other laws of
    finitely many states the masses of all bins are compared, else the means of 16 Legendre polynomials after one
    reflection, to 1e-6 beyond the error of their matrix.

    Raises
    ------
    AccuracyError
        If this error exceeds .05, so that it is not known.
    """
    if holds_of_all(law, lambda leaf: leaf.reversible is True):
        return
    matrix = finite_matrix(law)
    if matrix is None:
        matrix = discretise(law, Legendre(POLYNOMIALS), tolerance=TOLERANCE)
    constant, error = matrix.basis.project(np.ones_like), float(matrix.error)
    defect = float(np.linalg.norm(constant @ matrix.symmetric - constant))
    if defect > error + TOLERANCE:
        raise not_invariant(law, f"{defect:.2g}", reason)
    if not error <= UNKNOWN:
        raise AccuracyError(
            f"law: it is not known whether {law!r} preserves sin(theta) d theta ({matrix.method})", error
        )


def why_not_self_adjoint(other: Law) -> str:
    """The reason, in words, why P J is not known to be self-adjoint for a self-adjoint P."""
    return (
        f"P J with P = {other!r} and J f(theta) = f(pi - theta) is not known to be self-adjoint, for the cell has no "
        "mirror axis. Its spectrum need not be real"
    )


def what_is_true() -> str:
    """The statement, in words, on the norm of P J on functions of mean 0."""
    return (
        "J is unitary and keeps the constants, so on functions f of mean 0 the norm of P J is the slem of P: "
        "||P J f|| <= slem ||f||, the best constant for one step, and the spectrum off the constants lies in the disk "
        "of radius slem"
    )
