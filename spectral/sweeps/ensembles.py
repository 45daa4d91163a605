"""Ensembles: mean and spread of quantities over random walls, and the mean of their laws."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import numpy as np

from ...core.checkpoints import Checkpoint, Stored, packed_arrays, unpacked_arrays
from ...core.checks import Floats, Rng, check_memory, generator, instance, positive_number, whole_number
from ...core.errors import AsperityError, InputError
from ...core.estimates import Estimate, Summary
from ...core.frames import data_frame
from ...core.long_runs import reported
from ...core.version import __version__
from ...core.workers import connected, results
from ...kernels import Basis, KernelMatrix, discretise
from ...kernels.bases.basis import Frame
from ...kernels.sampling.counts import half_width
from .quantities import UserQuantity, name_of
from .running import Family, law_of, sweep
from .statistics import FEWEST, mean_estimate, spread_estimate
from .table import SweepTable, csv_text

if TYPE_CHECKING:
    from pandas import DataFrame

# What ``rng=None`` stands for: an ensemble without seed is the same each time, so that it goes on from its checkpoint.
SEED_WITHOUT_RNG = 0
# The parameter of a family that makes its walls differ.
SEED = "rng"


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
    """What a worker is sent: it makes the matrix of a realisation."""

    family: Family
    basis: Basis
    tolerance: float

    def packed(self, seed: int) -> bytes | str:
        """The matrix, with what is known of it, as a file of numpy's; or why there is none."""
        try:
            found = discretise(law_of(self.family(**{SEED: seed})), self.basis, tolerance=self.tolerance)
        except Exception as reason:  # a task must not raise
            return str(reason) if isinstance(reason, AsperityError) else f"{type(reason).__name__}: {reason}"
        return packed_arrays(
            {
                "symmetric": found.symmetric, "error": float(found.error), "unresolved": float(found.unresolved),
                "reversible": found.reversible is True, "mirror_symmetric": found.mirror_symmetric is True,
                "frame": found.frame,
            }
        )  # fmt: skip

    def read(self, _: str, content: bytes | str) -> bytes | str:
        """What `packed` gave, checked."""
        if isinstance(content, bytes):
            shape = self.basis.size, self.basis.size
            found = unpacked_arrays(
                content,
                {
                    "symmetric": Stored("f", shape), "error": Stored("f", (), 0.0, math.inf),
                    "unresolved": Stored("f", (), 0.0, 1.0), "reversible": Stored("b", ()),
                    "mirror_symmetric": Stored("b", ()), "frame": Stored("U", ()),
                },
            )  # fmt: skip
            if found["frame"].item() not in get_args(Frame):
                raise ValueError(f"frame: expected one of {', '.join(get_args(Frame))}, got {found['frame'].item()!r}")
        return content


@reported("mean law")
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
    instance("basis", basis, Basis, "ker.Bins(64)")
    check_memory("realisations", f"{number} matrices in {basis!r}", 2 * number * basis.size**2)
    job = _Matrices(family, basis, positive_number("tolerance", tolerance))
    seeds = _seeds(rng, number)
    try:
        with ExitStack() as stack:
            store = None
            if checkpoint is not None:
                store = stack.enter_context(Checkpoint(checkpoint, _identity(job, seeds), key=key))
            packed = _all_matrices(job, seeds, store, client)
    except KeyboardInterrupt as stop:
        stored = f"{checkpoint} has what was finished; the same call goes on from there"
        raise KeyboardInterrupt(f"mean_law stopped; {'nothing is stored' if checkpoint is None else stored}") from stop
    refused = {seed: reason for seed in seeds if isinstance(reason := packed[seed], str)}
    seed, first = next(iter(refused.items()), (0, ""))
    if number - len(refused) < FEWEST:
        raise AsperityError(
            f"family: {len(refused)} of {number} laws were refused, that of rng={seed} because of: {first}"
        )
    _warn_of_refused("the mean law is that of", len(refused), number, f"{first} (rng={seed})")
    return _mean(job, packed, seeds)


def _identity(job: _Matrices, seeds: Sequence[int]) -> dict[str, Any]:
    return {
        "computation": "mean law", "version": __version__, "family": job.family, "basis": job.basis,
        "tolerance": job.tolerance, "realisations": len(seeds), "seeds": np.array(seeds),
    }  # fmt: skip


def _all_matrices(
    job: _Matrices, seeds: Sequence[int], store: Checkpoint | None, client: Any
) -> Mapping[int, bytes | str]:
    """The packed matrix of each seed, those that the checkpoint has first."""
    found = {} if store is None else {int(key): value for key, value in store.parts(job.read)}
    with connected(client) as workers:
        for seed, packed in results(job.packed, [seed for seed in seeds if seed not in found], workers):
            found[seed] = packed
            if store is not None:
                store.put(str(seed), packed)
    return found


def _mean(job: _Matrices, packed: Mapping[int, bytes | str], seeds: Sequence[int]) -> KernelMatrix:
    """The mean, added up in the order of the seeds whatever the order in which they came."""
    arrays: list[Floats] = []
    properties: list[dict[str, Any]] = []
    for seed in seeds:
        content = packed[seed]
        if isinstance(content, str):
            continue
        found = unpacked_arrays(content)
        arrays.append(found.pop("symmetric"))
        properties.append({name: value.item() for name, value in found.items()})
    of = f"{len(arrays)} of {len(seeds)} not refused" if len(arrays) < len(seeds) else f"{len(arrays)}"
    frames = {one["frame"] for one in properties}
    if len(frames) > 1:
        raise InputError("family: expected laws in one convention, got some in each; use law.in_specular_frame()")
    symmetric = np.mean(arrays, axis=0)
    error = half_width(symmetric, arrays) + math.fsum(one["error"] for one in properties) / len(properties)
    return KernelMatrix(
        symmetric,
        job.basis,
        Estimate(error, error, "estimate", f"spread of {len(arrays)} realisations"),
        replicates=tuple(arrays),
        method="mean law",
        law=f"mean of {of} of {name_of(job.family)}",
        reversible=True if all(one["reversible"] for one in properties) else None,
        mirror_symmetric=True if all(one["mirror_symmetric"] for one in properties) else None,
        frame=frames.pop(),
        unresolved=math.fsum(one["unresolved"] for one in properties) / len(properties),
    )
