"""Spectra of kernel matrices, with separate algebraic, discretisation and sampling errors, and their pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats, frozen, whole_number
from ...core.errors import AccuracyError
from ...core.estimates import NORMAL_95, Estimate, Summary, student_95, with_error
from ...core.rounding import EPS
from ...core.tables import axes_or_new, data_frame
from ...kernels import Basis, Bins, KernelMatrix
from ...kernels.sampling.counts import missed_fraction
from .dense import ExtremalEigenvalues, Parity, compressed, end_values, extremal_by_parity, parity_basis

if TYPE_CHECKING:
    from matplotlib.axes import Axes


# Ratio of the changes by two successive doublings of the basis, for order 2, the lowest order of the bases.
EARLIER_FRACTION = 0.25
# On one matrix the distance from the law's eigenvalue is at most this many times the change from the coarser basis for
# 97 % of 156 gaps of walls and scatterings in Legendre polynomials and bins; at most the change itself for 81 %.
ONE_MATRIX = 3.0
UNREFINED = "one matrix: its basis was not refined, and the error estimates the distance from the law's eigenvalue"
ALONE = "one matrix: no coarser basis (`Basis.coarsened`) has such an eigenvalue, so the error is not known"
Verdict = Literal["isolated", "essential edge", "no gap", "undecided"]
# A sampled matrix is rejected as irreversible if its antisymmetric part has a z-score above this. Under reversibility
# the score is standard normal and exceeds 5 once in 3.5 million matrices.
REVERSIBLE_Z = 5.0
# Relative antisymmetry allowed beyond the error of an unsampled matrix, a thousand times the rounding of its entries.
REVERSIBLE_ROUNDING = 1e-12
# Angles per curve, and curves in a plot.
ANGLES, SHOWN_FUNCTIONS = 400, 5
# Label of eigenvalues in plots.
EIGENVALUE = "eigenvalue with its total error"


def two_grid_changes(matrix: KernelMatrix, found: ExtremalEigenvalues) -> Floats:
    """Change of every eigenvalue off the constants from the coarser basis, matched by rank from its spectral end.

    A refinement can leave an eigenvalue unchanged by chance, so a fraction of the previous change is a lower limit.
    ``inf`` if the coarser basis has no such eigenvalue.
    """
    grids = _coarser_grids(matrix, found.top, len(found.values) - found.top)
    changes = np.abs(np.diff([found.values, *grids], axis=0))
    if not len(changes):
        return np.full(len(found.values), np.inf)
    last = np.where(np.isnan(changes[0]), np.inf, changes[0])
    return np.asarray(np.fmax(last, EARLIER_FRACTION * changes[1]) if len(changes) > 1 else last)


def _coarser_grids(matrix: KernelMatrix, top: int, bottom: int) -> list[Floats]:
    """The eigenvalues of these ranks on two successively coarser bases, if there are; NaN for missing eigenvalues."""
    from scipy.sparse import csr_array

    found: list[Floats] = []
    basis, array = matrix.basis, matrix.symmetric
    for _ in range(2):
        if isinstance(basis, Bins) and basis.size > 1:
            # a large matrix of zeros would take longer than its products
            joined, owner, entries = basis.joined()
            embedding = csr_array((entries, (owner, np.arange(basis.size))), shape=(joined.size, basis.size))
            basis = joined
        else:
            coarser = basis.coarsened()
            if coarser is None:
                break
            basis, embedding = coarser[0], csr_array(coarser[1])
        array = compressed(array, embedding)
        upper, lower = end_values(array, np.asarray(basis.constant), top, bottom)
        found.append(np.concatenate([_padded(upper, top), _padded(lower, bottom)[::-1]]))
    return found


def _padded(values: Floats, length: int) -> Floats:
    return np.concatenate([values, np.full(length - len(values), np.nan)])


@dataclass(frozen=True, repr=False)
class SpectrumErrors(Summary):
    """The three errors of every eigenvalue, each of shape (k,).

    Attributes
    ----------
    algebraic : array
        Bound, to rounding, of the distance from the eigenvalue of the same rank in the matrix
        (``Spectrum.completeness``) and of the norm of S v - lambda v.
    discretisation : array
        Three times the change of the eigenvalue from the basis of half the size, or a quarter of the previous change if
        that is larger (``inf`` without a coarser basis), plus the Frobenius error of an unsampled matrix. It estimates
        the distance from the law's eigenvalue; the distance from the matrix's own is ``algebraic``. The change is left
        out of a matrix that has the law's eigenvalues (``KernelMatrix.beyond``).
    sampling : array
        One standard error from the randomness of the rays, an estimate; 0 for unsampled matrices.
    quantile : float
        Half width of a 95 % interval in standard errors: 1.96, or Student's quantile if the standard error comes from
        a few replicates.
    """

    algebraic: Floats
    discretisation: Floats
    sampling: Floats
    quantile: float = NORMAL_95

    def total(self) -> Floats:
        """Half width of an interval of about 95 %: algebraic + discretisation + quantile x sampling error."""
        return np.asarray(self.algebraic + self.discretisation + self.quantile * self.sampling)

    def at(self, indices: NDArray[np.intp], factor: float | Floats = 1.0) -> SpectrumErrors:
        """The errors of some eigenvalues, or these times a factor for each eigenvalue."""
        algebraic, discretisation, sampling = (
            frozen((factor * part)[indices]) for part in (self.algebraic, self.discretisation, self.sampling)
        )
        return SpectrumErrors(algebraic, discretisation, sampling, self.quantile)


@dataclass(frozen=True, repr=False)
class Spectrum(Summary):
    """The k eigenvalues of largest modulus of a reversible law, sorted descending.

    Attributes
    ----------
    values : array of shape (k,)
        Eigenvalues; the first belongs to the constants.
    vectors : array of shape (n, k)
        Coefficients of the orthonormal eigenfunctions in ``basis``, constants first.
    residuals : array of shape (k,)
        Norm of S v - lambda v; S is averaged with its mirror image if the eigenfunctions have parities.
    gap, slem : float
        1 minus the largest spectral value off the constants, and the largest modulus off the constants. They include
        the essential spectrum of a law; for a matrix they come from its eigenvalues.
    gap_errors : SpectrumErrors
        The three errors of the gap, each of shape (1,).
    convention : str
        ``"paper"`` (retroreflection is the identity) or ``"specular"`` (Feres: specular reflection is the identity).
    errors : SpectrumErrors
    basis : Basis
    method : str
        The method that computed the matrix.
    matrix_error : float
        The part of the discretisation errors that comes from the entries of an unsampled matrix.
    parity : tuple of {"even", "odd", "none"}
        Parities of the eigenfunctions under theta -> pi - theta; "none" if the law is not known to be mirror-symmetric.
        In the other convention the odd eigenvalues have the opposite sign.
    completeness : str
        The check, in floating point with rounding bounds, that no eigenvalue of larger modulus off the constants is
        missing: for the matrix, or for the law if
        the values are enclosed.
    verdict : {"isolated", "essential edge", "no gap", "undecided"}
        Verdict on the gap of a law, as in `SpectralGap`; "undecided" for a matrix.
    evidence : tuple of str
        The evidence for the verdict.
    """

    values: Floats
    vectors: Floats
    residuals: Floats
    errors: SpectrumErrors
    gap: float
    gap_errors: SpectrumErrors
    slem: float
    convention: str
    basis: Basis
    method: str
    matrix_error: float = 0.0
    parity: tuple[Parity, ...] = ()
    completeness: str = ""
    verdict: Verdict = "undecided"
    evidence: tuple[str, ...] = ()
    _more = ".errors, .completeness, .evidence, .plot(), .plot_eigenfunctions(), .to_frame()"

    @property
    def intervals(self) -> Floats:
        """The intervals value -+ total error, shape (k, 2)."""
        width = self.errors.total()
        return np.stack([self.values - width, self.values + width], axis=1)

    @property
    def gap_error(self) -> float:
        """Total error of the gap, as in ``errors.total()``."""
        return float(self.gap_errors.total()[0])

    def at(self, indices: NDArray[np.intp]) -> Spectrum:
        """The same with these eigenvalues only, in this order."""
        return replace(
            self, values=frozen(self.values[indices]), vectors=frozen(self.vectors[:, indices]),
            residuals=frozen(self.residuals[indices]), errors=self.errors.at(indices),
            parity=tuple(self.parity[i] for i in indices),
        )  # fmt: skip

    def estimates(self) -> tuple[Estimate, ...]:
        """Every eigenvalue with its total error.

        Examples
        --------
        >>> from asperity import kernels as ker, spectral as spec
        >>> found = spec.spectrum(ker.henyey_greenstein(0.5), k=2).estimates()[1]
        >>> abs(float(found) - 0.5) <= found.error, found.kind
        (True, 'estimate')
        """
        method = f"{self.basis!r}, {self.method}; algebraic + two-grid and matrix + {self.errors.quantile:.3g} sampling"
        method += f"; {ALONE}" if ALONE in self.evidence else ""
        pairs = zip(self.values, self.errors.total(), strict=True)
        return tuple(Estimate(float(value), float(error), "estimate", method) for value, error in pairs)

    def eigenfunction(self, index: int, theta: Any) -> Floats:
        """Values at the angles theta of the eigenfunction of ``values[index]``, normalised to the mean square 1."""
        number = whole_number("index", index, -len(self.values), most=len(self.values) - 1)
        return np.asarray(self.basis.evaluate(theta) @ self.vectors[:, number])

    def plot_eigenfunctions(self, ax: Axes | None = None) -> Axes:
        """Draw up to five eigenfunctions, without the constants, against the incoming angle."""
        theta = np.linspace(0.0, np.pi, ANGLES + 2)[1:-1]
        labels, functions = [], []
        for index in range(1, min(len(self.values), 1 + SHOWN_FUNCTIONS)):
            parity = self.parity[index] if self.parity else "none"
            labels.append(f"{self.values[index]:.6g}" + (f" ({parity})" if parity != "none" else ""))
            functions.append(self.eigenfunction(index, theta))
        return draw_eigenfunctions(theta, np.array(functions), labels, self.convention, ax)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the eigenvalues with their intervals."""
        gap = self.gap, f"1 - second eigenvalue of this matrix: {self.gap:.4g}"
        return draw_eigenvalues(self.values, self.errors.total(), self.convention, EIGENVALUE, gap, ax)

    def to_frame(self) -> Any:
        """One row an eigenvalue, with its errors and its parity, as a pandas.DataFrame (extra ``studies``)."""
        errors = self.errors
        parts = {part: getattr(errors, part) for part in ("algebraic", "discretisation", "sampling")}  # its fields
        parity = self.parity or ("none",) * len(self.values)
        return data_frame({"value": self.values, "error": errors.total(), "parity": parity, **parts})

    def _headline(self) -> str:
        return f"gap {with_error(self.gap, self.gap_error)}, {self.verdict}"

    def _facts(self) -> dict[str, object]:
        names = [f"{k} {parity}" if parity != "none" else str(k) for k, parity in enumerate(self.parity)]
        names = names or [str(k) for k in range(len(self.values))]
        numbers = dict(zip(names, self.estimates(), strict=True))
        unknown = None if np.isfinite([self.gap_error, *self.errors.total()]).all() else "; ".join(self.evidence)
        return {"convention": self.convention, "basis": self.basis, "inf": unknown, **numbers}


def matrix_spectrum(matrix: KernelMatrix, k: int, margin: float = ONE_MATRIX) -> Spectrum:
    """The k eigenvalues of largest modulus of a matrix, sorted descending: see `spectrum`.

    The changes from the coarser basis are multiplied by ``margin``; for a sequence of bases, which shows how they
    decrease, 1 serves.

    Raises
    ------
    AccuracyError
        If the matrix is not symmetric within its error.
    """
    check_reversible(matrix)
    constant = np.asarray(matrix.basis.constant)
    rest, names = extremal_by_parity(matrix.symmetric, parity_basis(matrix.basis, matrix), constant, max(k - 1, 1))
    chosen = np.sort(np.argsort(-np.abs(rest.values), kind="stable")[: k - 1])
    image = 0.5 * (matrix.symmetric @ constant + constant @ matrix.symmetric)
    first = float(constant @ image)
    defect = float(np.linalg.norm(image - first * constant))
    # the pair of the constants, then the others
    values, vectors = np.append(first, rest.values), np.column_stack([constant, rest.vectors])
    residuals, algebraic = np.append(defect, rest.residuals), np.append(defect, rest.errors)
    # a matrix of a law that is known beyond the basis has the law's eigenvalues
    exact = matrix.beyond is not None
    reason = "the matrix of a law that is known beyond its basis" if exact else UNREFINED
    changes = np.zeros(len(values)) if exact else margin * np.append(0.0, two_grid_changes(matrix, rest))

    algebraic = algebraic + matrix.basis.size * EPS
    # errors of entries change an eigenvalue by at most their Frobenius norm; sampling errors are separate
    discretisation = changes + (0.0 if matrix.samples else float(matrix.error))
    sampling = sampling_errors(matrix, vectors, values)
    errors = SpectrumErrors(algebraic, discretisation, sampling, sampling_quantile(matrix))
    # without a second function the gap is 1 by convention, with unknown error
    unknown = frozen([np.inf])
    gap, slem, gap_errors = 1.0, 0.0, SpectrumErrors(unknown, unknown, unknown)
    if len(rest.values):
        gap_errors = errors.at(np.array([1]))
        gap, slem = float(1.0 - rest.values[0]), float(np.abs(rest.values).max())
    if matrix.beyond is not None:
        gap_errors = gap_errors if len(rest.values) else errors.at(np.array([0]))
        gap, slem = min(gap, 1.0 - max(matrix.beyond)), max(slem, *np.abs(matrix.beyond).tolist())
    indices = np.append(0, 1 + chosen)
    return Spectrum(
        values=frozen(values[indices]),
        vectors=frozen(vectors[:, indices]),
        residuals=frozen(residuals[indices]),
        errors=errors.at(indices),
        gap=gap,
        gap_errors=gap_errors,
        slem=slem,
        convention=matrix.frame,
        basis=matrix.basis,
        method=matrix.method,
        matrix_error=0.0 if matrix.samples else float(matrix.error),
        parity=("none" if "none" in names or not names else "even", *(names[i] for i in chosen)),
        completeness=rest.method,
        evidence=(reason if exact or (len(rest.values) and np.isfinite(changes).all()) else ALONE,),
    )


def check_reversible(matrix: KernelMatrix) -> None:
    """Raise an AccuracyError if the matrix is not symmetric within its error.

    The matrix of a law that is reversible by theorem is accepted, unless sampled counts contradict it.
    """
    if matrix.reversible and matrix.raw_defect is None:
        return
    defect = matrix.symmetry_defect()
    if defect.z_score is not None:
        refused = defect.z_score > REVERSIBLE_Z
    else:
        # an antisymmetric part of the size of the matrix error is no evidence
        scale = float(np.linalg.norm(matrix.symmetric)) or 1.0
        allowed = REVERSIBLE_ROUNDING + 2.0 * float(matrix.error) / scale
        refused = float(defect) > allowed
    if refused:
        raise AccuracyError(
            f"the kernel is not symmetric with respect to sin(theta) d theta: {defect}; its spectrum need not be real. "
            "Use (P + P.adjoint()) / 2 or P @ P.adjoint() if one of these is what you mean"
            + ("" if defect.z_score is None else ", or sample it better"),
            float(defect),
        )


def sampling_quantile(matrix: KernelMatrix) -> float:
    """Half width of a 95 % interval in standard errors of `sampling_errors`."""
    return student_95(len(matrix.replicates)) if len(matrix.replicates) > 1 else NORMAL_95


def sampling_errors(matrix: KernelMatrix, vectors: Floats, values: Floats) -> Floats:
    """One standard error of each eigenvalue, shape (k,); zeros for unsampled matrices.

    To first order an eigenvalue changes by v^T (S_hat - S) v. If the matrix has replicates, the spread of v^T S_r v
    over them is used; otherwise the multinomial variance of the counts. An event that no ray met, of probability p at
    all angles, changes an eigenvalue by at most 2 p; see `missed_fraction`.
    """
    errors = np.zeros(len(values))
    if len(matrix.replicates) > 1:
        each = np.array([np.sum(vectors * (replicate @ vectors), axis=0) for replicate in matrix.replicates])
        errors = np.asarray(each.std(axis=0, ddof=1) / np.sqrt(len(each)))
    elif matrix.counts is not None:
        errors = np.sqrt(_count_variances(matrix, vectors))
    if matrix.samples == 0:
        return errors
    beside = np.maximum(1.0 - (matrix.basis.constant @ vectors) ** 2, 0.0)
    return np.maximum(errors, 2.0 * missed_fraction(matrix.samples) * beside / sampling_quantile(matrix))


def _count_variances(matrix: KernelMatrix, vectors: Floats) -> Floats:
    """Variance of the mean of phi(i) phi(j) over the counted pairs, phi = v / sqrt(w).

    If rows were normalised, each row i is an independent multinomial sample; otherwise all pairs are one sample.
    """
    counts = np.asarray(matrix.counts, dtype=np.float64)
    weights = np.asarray(matrix.weights)
    phi = vectors / np.sqrt(weights)[:, None]
    # one product for the means of phi and of its square, before any division of the counts
    means = counts @ np.column_stack([phi, phi**2, np.ones(len(phi))])
    first, square, totals = means[:, : phi.shape[1]], means[:, phi.shape[1] : -1], means[:, -1]
    if matrix.symmetrised:
        number = totals.sum()
        mean = np.sum(phi * first, axis=0) / number
        spread = np.sum(phi**2 * square, axis=0) / number - mean**2
        return np.asarray(np.maximum(spread, 0.0) / number)
    totals = np.maximum(totals, 1.0)[:, None]
    spread = np.maximum(square / totals - (first / totals) ** 2, 0.0)
    return np.asarray(((weights[:, None] * phi) ** 2 * spread / totals).sum(axis=0))


# Okabe and Ito's blue and vermilion, which colour-blind readers can distinguish.
KNOWN, UNKNOWN = "#0072B2", "#D55E00"
CONVENTIONS = {"paper": "retroreflection is the identity", "specular": "specular reflection is the identity"}


def draw_eigenvalues(
    values: Floats, width: Floats, convention: str, label: str, gap: tuple[float, str] | None, ax: Axes | None = None
) -> Axes:
    """Draw eigenvalues by rank, with their intervals.

    Parameters
    ----------
    values, width : ndarray, shape (k,)
        Eigenvalues, sorted descending, and the half widths of their intervals; not finite if unknown.
    convention : {"paper", "specular"}
    label : str
        Legend of the eigenvalues.
    gap : (float, str) or None
        The gap, which is shaded, and its legend; None for a law without gap.
    ax : matplotlib Axes, optional
        By default axes of a new figure.
    """
    ax = axes_or_new(ax)
    rank = np.arange(len(values))
    known = np.isfinite(width)
    ax.axhline(0.0, color="0.6", linewidth=0.8, zorder=1)
    if gap is None:
        ax.axhline(1.0, color="0.3", linewidth=1.2, linestyle="--", zorder=1,
                   label="the law has no gap: 1 is in its essential spectrum")  # fmt: skip
    else:
        ax.axhspan(1.0 - gap[0], 1.0, color="0.87", zorder=0, label=gap[1])
    # without a gap the eigenvalues belong to the grid, so the markers are hollow
    ax.errorbar(
        rank[known], values[known], yerr=width[known], fmt="o", markersize=5.5, capsize=3, color=KNOWN, zorder=3,
        mfc="white" if gap is None else KNOWN, label=label,
    )  # fmt: skip
    if not known.all():
        ax.plot(rank[~known], values[~known], "s", mfc="none", color=UNKNOWN, zorder=3, label="error not known")
    ax.set_xticks(rank)
    ax.set_xlabel(f"rank among the {len(rank)} largest moduli, sorted descending")
    ax.set_ylabel("eigenvalue")
    # limits that contain the error bars, within [-1, 1] where the spectrum lies
    lowest = max(float(np.min(values - np.where(known, width, 0.0))), -1.0)
    ax.set_ylim(-1.1 if lowest < -0.5 else min(-0.15, lowest - 0.1), 1.1)
    ax.set_title(f"Spectrum, {convention} convention ({CONVENTIONS[convention]})", fontsize=11)
    # below the axes, because a spectrum may fill any corner
    ax.legend(frameon=False, loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=1 if gap is None else 2)
    return ax


def draw_eigenfunctions(
    theta: Floats, functions: Floats, labels: Sequence[str], convention: str, ax: Axes | None = None
) -> Axes:
    """Draw functions on angles, shape (functions, angles), each with its label."""
    ax = axes_or_new(ax)
    for values, label in zip(functions, labels, strict=True):
        # the sign is chosen positive at small angles
        ax.plot(theta, np.sign(values[0] or 1.0) * values, label=label)
    ax.axhline(0.0, color="0.6", linewidth=0.8, zorder=1)
    ax.set_xlabel("incoming angle θ (rad)")
    ax.set_ylabel("eigenfunction")
    ax.set_title(f"Eigenfunctions, {convention} convention", fontsize=11)
    ax.legend(frameon=False, title="eigenvalue")
    return ax
