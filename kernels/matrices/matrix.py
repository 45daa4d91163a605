"""A kernel as a matrix in an orthonormal basis, its algebra and its error.

Bounds and quantiles of 95 % are added as they are, whether the terms are independent or not: a quantile of one term
and bounds of the others are a quantile, and of several quantiles the sum is exceeded in less than 5 % of cases where
errors are normal.
"""

from __future__ import annotations

import json
import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args, overload

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from ...core.checks import (
    Floats,
    Value,
    choice,
    finite_array,
    finite_number,
    foreign,
    frozen,
    instance,
    number_between,
    read_only,
    whole_number,
)
from ...core.errors import InputError
from ...core.estimates import ErrorKind, Estimate, html_table
from ...core.rounding import EPS
from ...core.tables import data_array, data_frame
from ..bases.assembly import is_mirror_symmetric, mirror_image
from ..bases.basis import AngleFunction, Basis, BasisOfPoints, Frame, checked_basis
from ..bases.partitions import Bins
from ..bases.spaces import TensorBasis
from . import output as archive
from .defects import STOCHASTIC_NORM, STOCHASTIC_NORM_CELLS, Defect, SymmetryDefect, relative_asymmetry
from .output import Arrays, Record, Stored, draw_kernel

# Cells a side when a kernel in polynomials is drawn.
GRID = 240
# A file is refused if its entries are wrong by more than this many times the stated error, which is that of 95 of 100
# matrices, and the rounding of an entry.
BEYOND_CHANCE, ENTRY_ROUNDING = 10.0, 64.0 * EPS
# Of samples, and of counts: they are held as int64.
MOST = 2**63 - 1
LARGEST_LOGARITHM = float(np.log(np.finfo(np.float64).max))
# What a file holds as it is.
PLAIN_FIELDS = (
    "symmetrised", "samples", "method", "law", "reversible", "mirror_symmetric", "frame", "requested_tolerance",
    "unresolved", "norm_bound", "beyond",
)  # fmt: skip


def check_same_basis(first: KernelMatrix, second: KernelMatrix) -> None:
    """Raise an InputError unless both are in the same basis and the same convention."""
    if first.basis != second.basis:
        raise InputError(f"the matrices have different bases, {first.basis!r} and {second.basis!r}; discretise again")
    check_same_frame(first, second)


def check_same_frame(first: KernelMatrix, second: KernelMatrix) -> None:
    """Raise an InputError unless both are in the same convention."""
    if first.frame != second.frame:
        raise InputError(
            f"the matrices are in different conventions, {first.frame!r} and {second.frame!r}; "
            "use in_specular_frame() on both or on neither"
        )


def joint_kind(first: KernelMatrix, second: KernelMatrix) -> ErrorKind:
    """Whether what is computed from both has a bound for its error, or an estimate."""
    return "bound" if first.error.kind == second.error.kind == "bound" else "estimate"


def frobenius_error(error: float, kind: ErrorKind, method: str) -> Estimate:
    """The Estimate that ``KernelMatrix.error`` holds: its value and its half width are both the Frobenius error, a
    bound or a quantile of 95 %."""
    return Estimate(error, error, kind, method)


def _beyond(combined: Callable[..., float], *matrices: KernelMatrix) -> tuple[float, float] | None:
    """``beyond`` of a matrix computed from others; None unless all of them have it."""
    pairs = [matrix.beyond for matrix in matrices if matrix.beyond is not None]
    even, odd = zip(*pairs, strict=True) if len(pairs) == len(matrices) else ((), ())
    return (combined(*even), combined(*odd)) if even else None


def _derived(
    matrix: KernelMatrix, symmetric: Floats, error: Estimate, law: str, basis: TensorBasis | None = None, **facts: Any
) -> KernelMatrix:
    """A matrix that is no sample any more, of a new array."""
    symmetric.setflags(write=False)
    return type(matrix)(symmetric, basis or matrix.basis, error, method="algebra", law=law, frame=matrix.frame, **facts)


@dataclass(frozen=True)
class Mapped(Sequence[Any]):
    """A function of each replicate, computed when it is asked for."""

    parts: Sequence[Any]
    function: Callable[[Any], Any]

    def __len__(self) -> int:
        return len(self.parts)

    def __getitem__(self, number: Any) -> Any:
        return self.function(self.parts[number])


def _name(matrix: KernelMatrix) -> str:
    return matrix.law or matrix.method


def _both(first: bool | None, second: bool | None) -> bool | None:
    return True if first and second else None


if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from scipy.sparse.linalg import LinearOperator


@dataclass(frozen=True, eq=False, repr=False)
class KernelMatrix(Value):
    r"""The matrix of a Markov kernel P in a basis of L^2 of the invariant measure.

    Made by `discretise`, `estimate` or `load_matrix`, and by the algebra: ``P @ Q`` (first P, then Q),
    ``a * P + b * Q``, ``P ** n``, ``P.adjoint()``, ``P.tensor(Q)``, ``P.in_specular_frame()``. The algebra is that of
    the matrices: in general the product of two Galerkin matrices is not the Galerkin matrix of the product.

    Parameters
    ----------
    symmetric : ndarray, shape (n, n)
        <e_i, P e_j> in the orthonormal basis; a symmetric array where the kernel is reversible. Read-only.
    basis : Basis
        The basis, of n functions.
    error : Estimate
        The Frobenius error of ``symmetric``, in its ``.value`` and, being all that is known, in its ``.error`` too. Of
        kind ``"bound"`` the distance from the exact matrix is within it; of kind ``"estimate"`` in 95 of 100 cases: of
        a sampled matrix it is the 95 % quantile of that distance over the rays.
    counts : ndarray of int64, shape (n, n), optional
        Raw counts of sampled pairs (incoming bin, outgoing bin), before any symmetrisation.
    replicates : sequence of arrays
        ``symmetric`` from equal parts of the rays; their mean is ``symmetric``. For errors.
    symmetrised : bool
        Whether each sampled pair was counted both ways.
    samples : int
        Number of sampled pairs, 0 where nothing was sampled.
    method : str
        The method that was used: ``"exact"``, ``"quadrature"``, ``"qmc"``, ``"monte-carlo"``, or how the matrix came.
    law : str
        The law, as its repr.
    reversible, mirror_symmetric : bool or None
        As for a law; None where it is not known.
    frame : {"paper", "specular"}
        The convention; see `in_specular_frame`.
    requested_tolerance : float, optional
        The Frobenius error that was asked for.
    unresolved : float
        Share of the flux whose way through the wall is not known: beams that were not resolved, or traced rays that
        did not escape.
    norm_bound : float
        Upper bound of the operator norm of the exact matrix: 1 for Markov kernels that keep the measure.
    raw_defect : SymmetryDefect, optional
        The symmetry defect of the raw sample, with its z-score.
    beyond : pair of floats, optional
        The numbers by which the law multiplies even and odd functions orthogonal to the basis, if it maps the span of
        the basis to itself and is such a multiple there. The spectrum of the matrix and these are then the law's.
    metadata : mapping
        Anything else that belongs to the record, as plain JSON values.

    Examples
    --------
    >>> from asperity.kernels import Bins
    >>> P = KernelMatrix([[0.75, 0.25], [0.25, 0.75]], Bins(2), Estimate(0.0, 0.0, "bound", "given"))
    >>> (P @ P).array.round(14).tolist(), float(P.symmetry_defect())
    ([[0.625, 0.375], [0.375, 0.625]], 0.0)
    """

    symmetric: Floats
    basis: Basis
    error: Estimate = None  # type: ignore[assignment]
    counts: NDArray[np.int64] | None = field(default=None, kw_only=True)
    replicates: Sequence[Floats] = field(default=(), kw_only=True)
    symmetrised: bool = field(default=False, kw_only=True)
    samples: int = field(default=0, kw_only=True)
    method: str = field(default="given", kw_only=True)
    law: str = field(default="", kw_only=True)
    reversible: bool | None = field(default=None, kw_only=True)
    mirror_symmetric: bool | None = field(default=None, kw_only=True)
    frame: Frame = field(default="paper", kw_only=True)
    requested_tolerance: float | None = field(default=None, kw_only=True)
    unresolved: float = field(default=0.0, kw_only=True)
    norm_bound: float = field(default=1.0, kw_only=True)
    raw_defect: SymmetryDefect | None = field(default=None, kw_only=True)
    beyond: tuple[float, float] | None = field(default=None, kw_only=True)
    metadata: Mapping[str, Any] = field(default_factory=dict, kw_only=True)

    # numpy must leave ``mu @ P`` and ``np.float64(2) * P`` to this class
    __array_ufunc__ = None

    def __post_init__(self) -> None:
        checked_basis(self.basis)
        symmetric = finite_array("symmetric", self.symmetric)
        n = self.basis.size
        if symmetric.shape != (n, n):
            raise InputError(f"symmetric: expected shape {(n, n)} for {self.basis!r}, got {symmetric.shape}")
        if not isinstance(self.error, Estimate) or not self.error.value >= 0.0:
            raise InputError(
                "error: expected an Estimate of at least 0 such as Estimate(0.0, 0.0, 'bound', 'given'), got "
                f"{self.error!r}; the law of transition probabilities between bins, ker.MatrixLaw(array), needs none"
            )
        self._set(symmetric=frozen(symmetric))
        if self.counts is not None:
            counts = np.asarray(self.counts)
            if counts.dtype.kind not in "iu":
                finite_array("counts", self.counts)
            if counts.shape != (n, n) or counts.dtype.kind not in "iu" or counts.min() < 0 or counts.max() > MOST:
                raise InputError(
                    f"counts: expected whole numbers of at least 0, shape {(n, n)}, got {counts.dtype} of shape "
                    f"{counts.shape}"
                )
            self._set(counts=frozen(counts, np.int64))
        self._check_fields()

    def _check_fields(self) -> None:
        """Refuse plain fields that no matrix has."""
        plain: dict[str, Any] = {"samples": whole_number("samples", self.samples, 0, most=MOST)}
        for name, most in (("unresolved", 1.0), ("norm_bound", np.inf), ("requested_tolerance", np.inf)):
            if getattr(self, name) is not None or name != "requested_tolerance":  # names of fields of this class
                plain[name] = number_between(name, getattr(self, name), 0.0, most, closed="low high")
        for name in ("symmetrised", "reversible", "mirror_symmetric"):
            value = getattr(self, name)  # names of fields of this class
            if not isinstance(value, (bool, np.bool_)) and (value is not None or name == "symmetrised"):
                raise InputError(f"{name}: expected True or False, got {value!r}")
            plain[name] = value if value is None else bool(value)
        if self.beyond is not None:
            bound = plain["norm_bound"]
            even, odd = (number_between("beyond", part, -bound, bound, closed="low high") for part in self.beyond)
            plain["beyond"] = even, odd
        instance("method", self.method, str, "'exact'")
        instance("law", self.law, str, "'a smooth wall'")
        instance("metadata", self.metadata, Mapping, "{'made': 'by hand'}")
        choice("frame", self.frame, get_args(Frame))
        defect = self.raw_defect
        if defect is not None:
            instance("raw_defect", defect, SymmetryDefect, "matrix.symmetry_defect()")
            instance("raw_defect.norm", defect.norm, str, "'Frobenius'")
            if not (0.0 <= defect < np.inf and (defect.z_score is None or -np.inf <= defect.z_score <= np.inf)):
                raise InputError("raw_defect: expected numbers, got NaN or a defect below 0")
        self.__dict__.update(plain)

    # ---- the arrays ------------------------------------------------------------------------------------------
    @property
    def size(self) -> int:
        """Number of basis functions."""
        return self.basis.size

    @cached_property
    def array(self) -> Floats:
        """P[i, j] = P(bin i -> bin j) for partitions, <e_i, P e_j> for other bases; shape (n, n), read-only."""
        normalisation = self.basis.normalisation
        return read_only(np.asarray(normalisation[:, None] * self.symmetric / normalisation))

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[Any]:
        """``np.asarray(P)`` is ``P.array``."""
        return np.array(self.array, dtype=dtype, copy=copy)

    def __getstate__(self) -> dict[str, Any]:
        # without ``array``, which is as large again
        return {field.name: getattr(self, field.name) for field in fields(self)} | {"replicates": (*self.replicates,)}

    @property
    def weights(self) -> Floats:
        """Invariant probability measure of the cells, sum 1 (squared coefficients of 1 for other bases)."""
        return self.basis.weights

    @property
    def flux(self) -> Floats:
        """Probability of going from cell i to cell j under the invariant measure: ``weights[:, None] * array``."""
        if not self.basis.is_partition:
            raise InputError(f"flux: {self.basis!r} has no cells; use Bins, or .symmetric for <e_i, P e_j>")
        root = np.sqrt(self.weights)
        return np.asarray(root[:, None] * self.symmetric * root)

    @property
    def tolerance_met(self) -> bool | None:
        """Whether the error is within the tolerance that was asked for; None where none was."""
        return None if self.requested_tolerance is None else float(self.error) <= self.requested_tolerance

    def symmetry_defect(self) -> SymmetryDefect:
        """Distance from reversibility: relative Frobenius norm of the antisymmetric part in an orthonormal basis.

        For sampled kernels it is that of the raw sample, also when it was symmetrised, and ``.z_score`` says how
        far it lies above the sampling noise.
        """
        if self.raw_defect is not None:
            return self.raw_defect
        return SymmetryDefect(relative_asymmetry(self.symmetric))

    def stochastic_defect(self) -> Defect:
        """How far P 1 is from 1: the largest row defect for partitions, the L^2 norm for other bases."""
        if self.basis.is_partition:
            return Defect(float(np.max(np.abs(self.array.sum(axis=1) - 1.0))), STOCHASTIC_NORM_CELLS)
        constant = self.basis.constant
        return Defect(float(np.linalg.norm(self.symmetric @ constant - constant)), STOCHASTIC_NORM)

    # ---- the algebra -----------------------------------------------------------------------------------------
    @overload
    def __matmul__(self, other: KernelMatrix) -> KernelMatrix: ...
    @overload
    def __matmul__(self, other: ArrayLike | AngleFunction) -> Floats: ...
    def __matmul__(self, other: KernelMatrix | ArrayLike | AngleFunction) -> KernelMatrix | Floats:
        """``P @ Q``: first P, then Q. ``P @ f``: the operator on values in the cells (or coefficients), or on a
        function of the angle, which is projected."""
        if isinstance(other, KernelMatrix):
            return self._followed_by(other)
        return np.asarray(self.array @ self._coordinates(other, "f"))

    def __rmatmul__(self, measure: ArrayLike | AngleFunction) -> Floats:
        """``mu @ P``: the measure after one step, from the masses of the cells (for other bases the integrals of
        the e_i), or from a density with respect to the invariant measure."""
        if callable(measure):
            return np.asarray((self._coordinates(measure, "mu") / self.basis.normalisation**2) @ self.array)
        return np.asarray(self._coordinates(measure, "mu", axis=-1) @ self.array)

    def _followed_by(self, other: KernelMatrix) -> KernelMatrix:
        """S_1 S_2, with S_1 S_2 - S_1* S_2* = E_1 S_2* + S_1 E_2."""
        check_same_basis(self, other)
        mine, yours = float(self.error), float(other.error)
        how = f"product of ({self.error.method}) and ({other.error.method})"
        total = mine * other.norm_bound + (self.norm_bound + mine) * yours
        return _derived(
            self, self.symmetric @ other.symmetric, frobenius_error(total, joint_kind(self, other), how),
            f"{_name(self)} @ {_name(other)}",
            reversible=self.reversible if self is other else None,
            mirror_symmetric=_both(self.mirror_symmetric, other.mirror_symmetric),
            norm_bound=self.norm_bound * other.norm_bound,
            beyond=_beyond(operator.mul, self, other),
        )  # fmt: skip

    def __mul__(self, factor: float) -> KernelMatrix:
        factor = finite_number("factor", factor)
        return _derived(
            self, factor * self.symmetric,
            frobenius_error(abs(factor) * float(self.error), self.error.kind, self.error.method),
            f"{factor:g}*{_name(self)}", replicates=Mapped(self.replicates, lambda part: factor * part),
            reversible=self.reversible, mirror_symmetric=self.mirror_symmetric,
            norm_bound=abs(factor) * self.norm_bound, beyond=_beyond(lambda number: factor * number, self),
        )  # fmt: skip

    __rmul__ = __mul__

    def __neg__(self) -> KernelMatrix:
        return -1.0 * self

    def __add__(self, other: KernelMatrix) -> KernelMatrix:
        if not isinstance(other, KernelMatrix):
            return foreign(other)
        check_same_basis(self, other)
        replicates: Sequence[Floats] = ()
        # parts of different samples cannot be paired; those of one term are shifted by the other where it has none
        if self.replicates and not other.replicates:
            replicates = Mapped(self.replicates, lambda part: part + other.symmetric)
        elif other.replicates and not self.replicates:
            replicates = Mapped(other.replicates, lambda part: part + self.symmetric)
        how = f"sum of ({self.error.method}) and ({other.error.method})"
        error = frobenius_error(float(self.error) + float(other.error), joint_kind(self, other), how)
        return _derived(
            self, self.symmetric + other.symmetric, error, f"{_name(self)} + {_name(other)}", replicates=replicates,
            reversible=_both(self.reversible, other.reversible),
            mirror_symmetric=_both(self.mirror_symmetric, other.mirror_symmetric),
            norm_bound=self.norm_bound + other.norm_bound,
            beyond=_beyond(operator.add, self, other),
        )  # fmt: skip

    def __sub__(self, other: KernelMatrix) -> KernelMatrix:
        return self + -1.0 * other if isinstance(other, KernelMatrix) else foreign(other)

    def __pow__(self, exponent: int) -> KernelMatrix:
        # Telescoping S^n - S*^n with ||S*|| <= b, ||S|| <= b + e gives (b + e)^n - b^n.
        exponent, bound, error = whole_number("exponent", exponent, 0), self.norm_bound, float(self.error)
        if bound == 1.0:
            with np.errstate(over="ignore"):
                whole = float(np.expm1(exponent * np.log1p(error)))
        else:
            if exponent * np.log(bound + error) > LARGEST_LOGARITHM:
                raise InputError(f"exponent: {exponent} is too large for norm {bound:.3g}; divide the matrix by it")
            whole = (bound + error) ** exponent - bound**exponent
        power = frobenius_error(whole, self.error.kind, f"power {exponent} of: {self.error.method}")
        array = np.linalg.matrix_power(self.symmetric, exponent)
        return _derived(
            self, array, power, f"({_name(self)})**{exponent}",
            reversible=True if exponent == 0 else self.reversible,
            mirror_symmetric=True if exponent == 0 else self.mirror_symmetric, norm_bound=bound**exponent,
            beyond=_beyond(lambda number: number**exponent, self),
        )  # fmt: skip

    def adjoint(self) -> KernelMatrix:
        """The matrix of the adjoint kernel in L^2 of the invariant measure."""
        return replace(
            self,
            symmetric=self.symmetric.T,
            counts=None if self.counts is None else self.counts.T,
            replicates=Mapped(self.replicates, lambda part: part.T),
            law=self.law if self.reversible else f"adjoint of {self.law or self.method}",
        )

    def tensor(self, other: KernelMatrix) -> KernelMatrix:
        """The kernel that applies this one to the first angle and the other to the second, independently."""
        instance("other", other, KernelMatrix, "ker.discretise(ker.lambertian(), ker.Bins(4))")
        # A x B - A* x B* = E_A x B + A* x E_B, in the Frobenius norm
        check_same_frame(self, other)
        mine, yours = float(self.error), float(other.error)
        size = float(np.linalg.norm(self.symmetric)) + mine
        error = mine * float(np.linalg.norm(other.symmetric)) + size * yours
        return _derived(
            self, np.asarray(np.kron(self.symmetric, other.symmetric), dtype=np.float64),
            frobenius_error(error, joint_kind(self, other), "tensor product"), f"({_name(self)}) x ({_name(other)})",
            TensorBasis((self.basis, other.basis)), reversible=_both(self.reversible, other.reversible),
            mirror_symmetric=_both(self.mirror_symmetric, other.mirror_symmetric),
            norm_bound=self.norm_bound * other.norm_bound,
        )  # fmt: skip

    def in_specular_frame(self) -> KernelMatrix:
        """P J, J f(theta) = f(pi - theta): Feres' convention, where specular reflection is the identity.

        Of a matrix that is in that convention already this gives back the paper's, as for laws.
        Raises an InputError where J does not keep the span of the basis; discretise the law's own
        ``in_specular_frame()`` then.
        """
        if not is_mirror_symmetric(self.basis):
            raise InputError(
                f"{self.basis!r} is not kept by theta -> pi - theta; discretise law.in_specular_frame() instead"
            )
        return replace(
            self,
            symmetric=mirror_image(self.symmetric, self.basis, rows=False),
            counts=None,
            replicates=Mapped(self.replicates, lambda part: mirror_image(part, self.basis, rows=False)),
            symmetrised=False,
            law=f"({_name(self)}).in_specular_frame()",
            # P J is self-adjoint exactly if P commutes with J
            reversible=self.reversible if self.mirror_symmetric else None,
            beyond=None if self.beyond is None else (self.beyond[0], -self.beyond[1]),
            frame="paper" if self.frame == "specular" else "specular",
            raw_defect=None,
            metadata={},
        )

    def as_linear_operator(self) -> LinearOperator:
        """``array`` as a scipy LinearOperator, with its transpose."""
        from scipy.sparse.linalg import aslinearoperator

        return aslinearoperator(self.array)

    # ---- files and pictures ----------------------------------------------------------------------------------
    def save(self, path: str | Path, overwrite: bool = False) -> Path:
        """Write everything to an .npz file that `load_matrix` reads; an existing file only with ``overwrite``.

        A name that ends in .csv gets P[i, j] with the edges of its bins, for other programs: comments begin with #, two
        rows have the lower and the upper edges of the outgoing bins in radians, below two zeros, and each other row has
        both edges of an incoming bin and its probabilities. An InputError for .csv unless the basis is `Bins`.
        """
        if Path(path).suffix.lower() == ".csv":
            return archive.write_csv(path, self.array, self._bin_edges("save"), self._described(), overwrite=overwrite)
        return archive.write(path, *self._packed(), self.basis, overwrite=overwrite)

    def to_frame(self) -> Any:
        """P[i, j] as a pandas.DataFrame (extra ``studies``): a row for each incoming, a column for each outgoing bin.

        Both are labelled by the centres of the bins in radians. ``attrs`` has the Frobenius error of ``symmetric``, its
        kind, the convention, the law and the method. An InputError unless the basis is `Bins`.
        """
        edges = self._bin_edges("to_frame")
        centres = 0.5 * (edges[1:] + edges[:-1])
        frame = data_frame({str(k): column for k, column in enumerate(self.array.T)})
        frame.index, frame.columns = centres, centres
        frame = frame.rename_axis(index="incoming", columns="outgoing")
        frame.attrs.update(self._described())
        return frame

    def to_xarray(self) -> Any:
        """P[i, j] as an xarray.DataArray (extra ``studies``) with the dimensions ``incoming`` and ``outgoing``.

        Their coordinates are the centres of the bins in radians; ``incoming_low``, ``incoming_high`` and so on are the
        edges, ``weight`` the invariant measure of an incoming bin. ``attrs`` as of `to_frame`. An InputError unless the
        basis is `Bins`.
        """
        edges = self._bin_edges("to_xarray")
        coordinates: dict[str, Any] = {"weight": ("incoming", self.weights)}
        for name in ("incoming", "outgoing"):
            unit = {"units": "rad"}
            coordinates[name] = (name, 0.5 * (edges[1:] + edges[:-1]), unit)
            coordinates |= {f"{name}_low": (name, edges[:-1], unit), f"{name}_high": (name, edges[1:], unit)}
        names = "incoming", "outgoing"
        return data_array(self.array, dims=names, coords=coordinates, name="probability", attrs=self._described())

    def _bin_edges(self, what: str) -> Floats:
        if not isinstance(self.basis, Bins):
            raise InputError(f"{what}: {self.basis!r} has no bins of one angle; discretise in Bins(64)")
        return self.basis.edges

    def _described(self) -> dict[str, Any]:
        """What a table says of this matrix."""
        return {
            "frobenius_error": float(self.error), "error_kind": self.error.kind, "convention": self.frame,
            "law": self.law, "method": self.method,
        }  # fmt: skip

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the density with respect to the invariant measure; returns the axes."""
        return draw_kernel(*self._density(), self.frame, ax)

    def _density(self) -> tuple[Floats, Floats]:
        """Edges of cells, and the density with respect to the invariant measure on pairs of them."""
        basis = self.basis
        if isinstance(basis, BasisOfPoints):
            raise InputError(f"plot: expected a kernel of one angle, got one in {basis!r}")
        if isinstance(basis, Bins):
            return basis.edges, self.array / basis.weights
        edges = np.linspace(0.0, np.pi, GRID + 1)
        values = basis.evaluate(0.5 * (edges[1:] + edges[:-1]))
        return edges, values @ self.symmetric @ values.T

    def _repr_html_(self) -> str:
        lines = {
            "law": self.law, "method": self.method, "Frobenius error": f"{float(self.error):.2g} ({self.error.kind})",
            "tolerance": self.requested_tolerance and f"{self.requested_tolerance:g}", "samples": self.samples or "",
            "convention": self.frame, "more": ".array, .error.method, .plot(), .symmetry_defect(), .to_frame()",
        }  # fmt: skip
        return html_table(f"KernelMatrix in {self.basis!r}", lines)

    def __repr__(self) -> str:
        error = f"error {float(self.error):.2g} ({self.error.kind})"
        parts = [repr(self.basis), self.law, self.method, error]
        if self.samples:
            parts.append(f"{self.samples} samples")
        if self.frame == "specular":
            parts.append("specular frame")
        if self.tolerance_met is False:
            parts.append(f"tolerance {self.requested_tolerance:g} not met")
        return f"KernelMatrix({', '.join(part for part in parts if part)})"

    def _packed(self) -> tuple[Record, Arrays]:
        """The record of plain values and the arrays of a file, all but the basis."""
        arrays: Arrays = {"symmetric": self.symmetric}
        if self.counts is not None:
            arrays["counts"] = self.counts
        record = {name: getattr(self, name) for name in PLAIN_FIELDS}  # names of fields of this class, in one list
        error, defect = self.error, self.raw_defect
        record["error"] = [error.value, error.error, error.kind, error.method]
        record["raw_defect"] = None if defect is None else [float(defect), defect.norm, defect.z_score]
        record["metadata"] = dict(self.metadata)
        record["replicates"] = len(self.replicates)
        arrays |= {f"replicate{k}": part for k, part in enumerate(self.replicates)}
        return record, arrays

    # ---- internals -------------------------------------------------------------------------------------------
    def _coordinates(self, other: ArrayLike | AngleFunction, name: str, axis: int = 0) -> Floats:
        if callable(other):
            return np.asarray(self.basis.normalisation * self.basis.project(other))
        values = finite_array(name, other)
        if values.ndim not in (1, 2) or values.shape[axis] != self.size:
            raise InputError(f"{name}: expected {self.size} entries for {self.basis!r}, got shape {values.shape}")
        return values


def load_matrix(path: str | Path) -> KernelMatrix:
    """Read a matrix that `KernelMatrix.save` wrote: every field, to the last bit.

    Raises
    ------
    InputError
        If there is no such file, or it is not such a file.

    Examples
    --------
    >>> load_matrix("no/such/file.npz")
    Traceback (most recent call last):
    asperity.errors.InputError: cannot read no/such/file.npz: No such file or directory
    """
    return archive.read(path, _restored)


def _restored(record: Record, arrays: Stored, basis: Basis) -> KernelMatrix:
    defect, n = record["raw_defect"], basis.size
    matrix = KernelMatrix(
        arrays.read("symmetric", "f8", (n, n)),
        basis,
        Estimate(*record["error"]),
        counts=arrays.read("counts", "i8", (n, n)) if "counts" in arrays else None,
        replicates=tuple(arrays.read(f"replicate{k}", "f8", (n, n)) for k in range(record["replicates"])),
        raw_defect=None if defect is None else SymmetryDefect(*defect),
        metadata=record["metadata"],
        # files from before this field was introduced have no "beyond"
        **{name: record[name] for name in PLAIN_FIELDS if name != "beyond" or name in record},
    )
    for name, value in matrix._packed()[0].items():
        if _as_floats(value) != _as_floats(record.get(name)):
            raise InputError(f"{name}: expected a value of another kind than {record[name]!r}")
    with np.errstate(all="ignore"):
        _check_entries(matrix)
    return matrix


def _as_floats(value: Any) -> str:
    """A plain value as text, in which whole numbers and floats are the same but truth and numbers are not."""
    return repr(json.loads(json.dumps(value), parse_int=float))


def _check_entries(matrix: KernelMatrix) -> None:
    """Refuse entries that contradict the error and the norm that the file states, by more than any chance."""
    symmetric, constant = matrix.symmetric, matrix.basis.constant
    rounding = BEYOND_CHANCE * ENTRY_ROUNDING * matrix.size * (1.0 + matrix.norm_bound)
    excess = BEYOND_CHANCE * float(matrix.error) + rounding
    if matrix.error.value != matrix.error.error:
        raise InputError(f"the Frobenius error is stated as {matrix.error.value:g} and as {matrix.error.error:g}")
    # of mirror-symmetric laws every ray counts with its mirror image
    if matrix.counts is not None and not matrix.counts.sum(dtype=np.float64) <= 2 * matrix.samples * (1.0 + rounding):
        raise InputError(f"the counts add up to more than twice the stated number of samples, {matrix.samples}")
    if matrix.replicates:
        mean = sum(matrix.replicates) / len(matrix.replicates)
        if not np.abs(mean - symmetric).max() <= rounding:
            raise InputError("the mean of the replicates is not the matrix")
    if not np.linalg.norm(symmetric @ constant) <= matrix.norm_bound * np.linalg.norm(constant) + excess:
        raise InputError(f"the entries contradict the bound {matrix.norm_bound:g} of the norm")
    if matrix.reversible and not np.linalg.norm(symmetric - symmetric.T) <= 2.0 * excess:
        raise InputError("the entries are not symmetric, although the kernel is stated to be reversible")
    # differences and multiples of kernels are matrices too
    if matrix.method == "algebra":
        return
    if not np.linalg.norm(symmetric @ constant - constant) <= excess:
        raise InputError(f"the rows do not sum to 1 within the stated error {float(matrix.error):g}")
    if matrix.basis.is_partition and symmetric.min() < -excess:
        raise InputError(f"entries are negative, down to {symmetric.min():g}, beyond the stated error")
