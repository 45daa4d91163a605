"""Ensembles: mean and spread of quantities over random walls, and the mean of their laws."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...core.checkpoints import Stored
from ...core.checks import Floats, Rng, check_memory, generator, positive_number, whole_number
from ...core.errors import AsperityError, InputError
from ...core.estimates import LEVEL, NORMAL_95, Estimate, Summary, student_95
from ...core.long_runs import Engine, all_parts, identity_of
from ...core.tables import data_frame
from ...kernels import Basis, KernelMatrix, discretise
from ...kernels.bases.basis import checked_basis
from ...kernels.sampling.counts import half_width
from .running import SEED, Family, UserQuantity, in_words, law_of, name_of, sweep
from .table import SweepTable, csv_text

if TYPE_CHECKING:
    from pandas import DataFrame

# What ``rng=None`` stands for: an ensemble without seed is the same each time, so that it goes on from its checkpoint.
SEED_WITHOUT_RNG = 0


@dataclass(frozen=True, repr=False)
class EnsembleRow(Summary):
    """One quantity over all realisations.

    Attributes
    ----------
    quantity : str
    mean, spread : Estimate
        Expected value and standard deviation over the random walls that are not refused, which are all of them if
        ``refused`` is 0. Otherwise they are conditional, ``method`` says so, and their errors say nothing of the
        refused walls, whose values are not known and can differ in any manner.
    realisations, refused : int
        Number of all realisations, and of those without a value.
    """

    quantity: str
    mean: Estimate
    spread: Estimate
    realisations: int
    refused: int


MEANS = ("quantity", "mean", "mean_error", "spread", "spread_error", "realisations", "refused")


def _cells(row: EnsembleRow) -> list[str | float | int]:
    mean, spread = row.mean, row.spread
    return [row.quantity, mean.value, mean.error, spread.value, spread.error, row.realisations, row.refused]


@dataclass(frozen=True, repr=False)
class Ensemble(Summary):
    """Quantities over random walls; made by `ensemble`.

    Attributes
    ----------
    table : SweepTable
        Every realisation, with the parameter ``rng``: the seed with which the family makes it again.
    rows : tuple of EnsembleRow
        Mean and spread of each quantity.
    """

    table: SweepTable
    rows: tuple[EnsembleRow, ...]

    def _facts(self) -> dict[str, object]:
        means = {row.quantity: f"mean {row.mean}, spread {row.spread}" for row in self.rows}
        return {"walls": self.rows[0].realisations, **means, "refused": self.table.refusals()}

    def of(self, quantity: str) -> EnsembleRow:
        """Mean and spread of one quantity.

        Raises
        ------
        InputError
            If there is no such quantity.
        """
        for row in self.rows:
            if row.quantity == quantity:
                return row
        raise InputError(f"quantity: expected one of {', '.join(self.table.quantities)}, got {quantity!r}")

    def to_frame(self) -> DataFrame:
        """A pandas frame with a line for each quantity.

        Raises
        ------
        InputError
            If pandas is not installed.
        """
        cells = [_cells(row) for row in self.rows]
        found: DataFrame = data_frame({name: [row[k] for row in cells] for k, name in enumerate(MEANS)})
        return found

    def to_csv(self) -> str:
        """The same lines as CSV, numbers with all their digits."""
        return csv_text(MEANS, [_cells(row) for row in self.rows])


def ensemble(
    family: Family,
    realisations: int,
    quantities: str | UserQuantity | Sequence[str | UserQuantity] = ("gap",),
    tolerance: float = 1e-6,
    *,
    rng: Rng = None,
    checkpoint: str | Path | None = None,
    key: str | None = None,
    client: Any = None,
    progress: bool = False,
) -> Ensemble:
    """Mean and spread of quantities over random walls, with errors.

    Parameters
    ----------
    family : callable
        Takes ``rng``, a whole number, by name and returns a wall or a law: ``functools.partial(geo.random_wall,
        geo.HeightCorrelation(0.1), 64, rms_slope=0.1)``, or a function of one's own.
    realisations : int
        Number of walls, at least 4.
    quantities, tolerance, checkpoint, key, client, progress
        As of `sweep`, which computes the realisations.
    rng : None, int or numpy.random.Generator
        Source of the seeds. None stands for a fixed one.

    Returns
    -------
    Ensemble
        The error of a mean is the half width of 95 % over the realisations plus the mean of their own errors. Walls
        that are too rare to be among the realisations are not in it. Of quantities that are refused for some walls it
        is the mean over the others; see `EnsembleRow`.

    Raises
    ------
    InputError
        As `sweep`, and if there are fewer than four realisations.

    Warns
    -----
    UserWarning
        If realisations were refused: how many, and why the first of them.

    Examples
    --------
    >>> import numpy as np
    >>> from asperity import kernels as ker
    >>> def half_diffuse(rng):
    ...     return ker.maxwell(np.random.default_rng(rng).uniform(0.25, 0.75))
    >>> gap = ensemble(half_diffuse, 100, "gap").of("gap")
    >>> abs(gap.mean.value - 0.5) < gap.mean.error, abs(gap.spread.value - 0.5 / 12**0.5) < gap.spread.error
    (True, True)
    """
    number = whole_number("realisations", realisations, FEWEST)
    table = sweep(
        family, {SEED: _seeds(rng, number)}, quantities, tolerance, checkpoint=checkpoint, key=key,
        client=client, progress=progress,
    )  # fmt: skip
    rows = tuple(_row(table, name) for name in table.quantities)
    most = max(rows, key=lambda row: row.refused)
    reason = next((row.message for row in table.of(most.quantity) if row.value is None), "")
    _warn_of_refused(f"mean and spread of {most.quantity} are over", most.refused, number, reason)
    return Ensemble(table, rows)


def _seeds(rng: Rng, number: int) -> list[int]:
    """The seeds of so many realisations; fewer are the first of more."""
    root = [int(word) for word in generator(rng, SEED_WITHOUT_RNG).integers(0, 2**63, size=2)]
    # of 53 bits, which every reader of JSON keeps
    return [int(seed) >> 11 for seed in np.random.SeedSequence(root).generate_state(number, np.uint64)]


def _row(table: SweepTable, quantity: str) -> EnsembleRow:
    rows = table.of(quantity)
    known = [(row.value, row.error) for row in rows if row.value is not None and row.error is not None]
    refused = len(rows) - len(known)
    if len(known) < FEWEST:
        nothing = Estimate(math.nan, math.inf, "estimate", f"{refused} of {len(rows)} realisations were refused")
        return EnsembleRow(quantity, nothing, nothing, len(rows), refused)
    values, errors = zip(*known, strict=True)
    mean, spread = mean_estimate(values, errors), spread_estimate(values, errors)
    if refused:
        mean, spread = (
            replace(one, method=f"{one.method} that were not refused, of {len(rows)}") for one in (mean, spread)
        )
    return EnsembleRow(quantity, mean, spread, len(rows), refused)


def _warn_of_refused(what: str, refused: int, realisations: int, reason: str) -> None:
    if refused:
        words = f"{refused} of {realisations} realisations were refused, the first because of: {reason}"
        # of the user's line
        warnings.warn(f"{what} those that were not: {words}", stacklevel=3)


@dataclass(frozen=True)
class _Matrices:
    """The matrices of all realisations, each a part; what a worker is sent."""

    family: Family
    basis: Basis
    tolerance: float
    seeds: NDArray[np.int64]

    def stored(self, _: int) -> dict[str, Stored]:
        """What the arrays of a part must be."""
        return {
            "refused": Stored("U", ()), "symmetric": Stored("f", (self.basis.size, self.basis.size)),
            "error": Stored("f", (), 0.0, math.inf), "unresolved": Stored("f", (), 0.0, 1.0),
            "reversible": Stored("b", ()), "mirror_symmetric": Stored("b", ()), "frame": Stored("U", ()),
        }  # fmt: skip

    def arrays(self, part: int) -> dict[str, Any]:
        """The matrix of one realisation with what is known of it; or 0 and the reason why there is none."""
        refused = ""
        try:
            found = discretise(
                law_of(self.family(**{SEED: int(self.seeds[part])})), self.basis, tolerance=self.tolerance
            )
        except Exception as reason:  # a realisation must not stop the others
            refused = in_words(reason)
            nothing = Estimate(0.0, 0.0, "bound", refused)
            found = KernelMatrix(np.zeros((self.basis.size, self.basis.size)), self.basis, nothing)
        return {
            "refused": refused, "symmetric": found.symmetric, "error": float(found.error),
            "unresolved": float(found.unresolved), "reversible": found.reversible is True,
            "mirror_symmetric": found.mirror_symmetric is True, "frame": found.frame,
        }  # fmt: skip


def mean_law(
    family: Family,
    realisations: int,
    basis: Basis,
    tolerance: float = 1e-6,
    *,
    rng: Rng = None,
    checkpoint: str | Path | None = None,
    key: str | None = None,
    client: Any = None,
) -> KernelMatrix:
    """The matrix of the mean law of random walls: of reflection from a surface of patches of many of them.

    Parameters
    ----------
    family, realisations, rng
        As of `ensemble`; the walls are the same as there.
    basis : Basis
    tolerance : float
        Frobenius error asked of each matrix.
    checkpoint, key, client
        As of `sweep`.

    Returns
    -------
    KernelMatrix
        Its error is the 95 % quantile of the Frobenius distance from the expected matrix, by the spread of the
        realisations, plus the mean of their own errors. ``replicates`` are the matrices of the realisations, from
        which the errors of eigenvalues follow. Where realisations were refused it is the mean
        over the others, and ``law`` says of how many.

    Raises
    ------
    InputError
        As `ensemble`.
    AsperityError
        If the laws of all realisations but three or fewer are refused. The message has the seed of the first.

    Warns
    -----
    UserWarning
        If realisations were refused: how many, and why the first of them.

    Examples
    --------
    >>> import numpy as np
    >>> from asperity import kernels as ker
    >>> def half_diffuse(rng):
    ...     return ker.maxwell(np.random.default_rng(rng).uniform(0.25, 0.75))
    >>> mean = mean_law(half_diffuse, 50, ker.Bins(4))
    >>> exact = ker.discretise(ker.maxwell(0.5), ker.Bins(4))
    >>> bool(np.linalg.norm(mean.symmetric - exact.symmetric) < mean.error.value < 0.15)
    True
    """
    number = whole_number("realisations", realisations, FEWEST)
    checked_basis(basis)
    check_memory("realisations", f"{number} matrices in {basis!r}", 2 * number * basis.size**2)
    seeds = _seeds(rng, number)
    job = _Matrices(family, basis, positive_number("tolerance", tolerance), np.array(seeds))
    engine: Engine = {"checkpoint": checkpoint, "key": key, "client": client}
    parts = all_parts(job.arrays, number, identity_of("mean law", job), engine, job.stored)
    known = [part for part in parts if not part["refused"]]
    refused = number - len(known)
    first = next((k for k, part in enumerate(parts) if part["refused"]), 0)
    seed, reason = seeds[first], parts[first]["refused"]
    if len(known) < FEWEST:
        raise AsperityError(f"family: {refused} of {number} laws were refused, that of rng={seed} because of: {reason}")
    _warn_of_refused("the mean law is that of", refused, number, f"{reason} (rng={seed})")
    of = f"{len(known)} of {number} not refused" if refused else f"{number}"
    frames = {part["frame"].item() for part in known}
    if len(frames) > 1:
        raise InputError("family: expected laws in one convention, got some in each; use law.in_specular_frame()")
    arrays = [part["symmetric"] for part in known]
    symmetric = np.mean(arrays, axis=0)
    error = half_width(symmetric, arrays) + math.fsum(part["error"] for part in known) / len(known)
    return KernelMatrix(
        symmetric,
        basis,
        Estimate(error, error, "estimate", f"spread of {len(known)} realisations"),
        replicates=tuple(arrays),
        method="mean law",
        law=f"mean of {of} of {name_of(family)}",
        reversible=True if all(part["reversible"] for part in known) else None,
        mirror_symmetric=True if all(part["mirror_symmetric"] for part in known) else None,
        frame=frames.pop(),
        unresolved=math.fsum(part["unresolved"] for part in known) / len(known),
    )


# Fewer values tell nothing of their spread.
FEWEST = 4
# Values that differ by less than this many roundings are equal.
ROUNDINGS = 64.0


def mean_estimate(values: Sequence[float], errors: Sequence[float]) -> Estimate:
    r"""The mean of the population of which independent values are known to within errors.

    The error is the half width of 95 % by Student's t, plus the mean of the errors, which covers errors that all have
    one sign too. Where the values are skew, the quantile of t is increased by the next term of the expansion in
    1/n, z (gamma^2 (z^4 + 2 z^2 - 3)/18 - kappa (z^2 - 3)/12)/n (Hall, The Bootstrap and Edgeworth Expansion, 1992,
    section 2.6), with skewness gamma and excess kurtosis kappa; it is never decreased.

    Examples
    --------
    >>> mean_estimate([1.0, 2.0, 2.0, 3.0], [0.0] * 4).value, mean_estimate([0.5] * 4, [0.25] * 4).error
    (2.0, 0.25)
    """
    known = np.asarray(values, dtype=np.float64)
    number = len(known)
    deviation = _deviation(known)
    skewness, excess = _shape(known)
    z = NORMAL_95
    further = z * (skewness**2 * (z**4 + 2.0 * z**2 - 3.0) / 18.0 - excess * (z**2 - 3.0) / 12.0) / number
    quantile = student_95(number) + max(further, 0.0)
    error = quantile * deviation / math.sqrt(number) + float(np.mean(errors))
    return Estimate(float(known.mean()), error, "estimate", f"mean of {number} realisations")


def spread_estimate(values: Sequence[float], errors: Sequence[float]) -> Estimate:
    """The standard deviation of the population of which independent values are known to within errors.

    The error is the longest side of two intervals of 95 %: that of normal values by chi^2, and that of the mean squared
    deviation as `mean_estimate` has it, for values of any distribution. The root mean square of the errors is added,
    by which they change the standard deviation at most.
    """
    from scipy.special import chdtri

    known = np.asarray(values, dtype=np.float64)
    number = len(known)
    deviation = _deviation(known)
    low, high = (math.sqrt((number - 1) / float(chdtri(number - 1, 0.5 * (1.0 + end * LEVEL)))) for end in (-1, 1))
    squares = (known - known.mean()) ** 2 * (number / (number - 1))
    below = max(deviation**2 - mean_estimate(squares.tolist(), [0.0] * number).error, 0.0)
    side = max(deviation * (1.0 - low), deviation * (high - 1.0), deviation - math.sqrt(below))
    own = math.sqrt(float(np.sum(np.square(errors))) / (number - 1))
    return Estimate(deviation, side + own, "estimate", f"standard deviation of {number} realisations")


def _deviation(values: Floats) -> float:
    """The standard deviation; 0 for values that are equal to rounding."""
    equal = np.ptp(values) <= ROUNDINGS * np.spacing(np.abs(values).max())
    return 0.0 if equal else float(values.std(ddof=1))


def _shape(values: Floats) -> tuple[float, float]:
    """Skewness and excess kurtosis, with their bias for normal values removed; 0 for equal values."""
    from scipy.stats import kurtosis, skew

    if not _deviation(values):
        return 0.0, 0.0
    return float(skew(values, bias=False)), float(kurtosis(values, bias=False))
