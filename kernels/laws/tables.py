"""Inverse distribution functions of the outgoing angle on a grid of incoming angles and probabilities."""

from __future__ import annotations

import json
import math
from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import IO, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, Rng, angles, check_memory, frozen, generator, shortened, whole_number
from ...core.errors import InputError
from ...core.estimates import Summary
from ...core.files import write_whole
from ...core.given import seed_by_name
from ...core.long_runs import slices
from ...core.tables import needed, numbers_as_csv
from ..bases.basis import Frame
from ..bases.measure import LARGEST_ANGLE, SINE, SMALLEST_ANGLE
from ..expectations.conditionals import Conditionals, Distributions

# Cells of equal angle whose masses give a distribution function: of coarse tables, and for each probability of others.
LEAST_CELLS, CELLS_FOR_EACH = 512, 4
# Probabilities at which a table is compared, for each of its own.
COMPARED = 4
# The quantile at 0 and at 1 is that at this distance from them: less is rounding of the masses.
END = 1e-12
# Outgoing angles drawn for each incoming one where the law's own error misses the tolerance, and the rounding of angles
# beside which an atom lies on either side of an edge.
DRAWN, ROUNDED = 2**16, 1e-9
# Incoming angles whose conditional distributions are in memory at a time.
AT_ONCE = 32
CONVENTIONS = {
    "paper": "theta_out = theta_in is retroreflection, theta_out = pi - theta_in is specular reflection",
    "specular": "theta_out = theta_in is specular reflection, theta_out = pi - theta_in is retroreflection",
}

# Of a part of a law: its conditional distributions at incoming angles, for edges, and which of their nodes are atoms.
WithAtoms: TypeAlias = Callable[[Floats, Floats], tuple[Conditionals, NDArray[np.bool_]]]
# Outgoing angles of a law at incoming ones.
Sampler: TypeAlias = Callable[[Floats, np.random.Generator], Floats]
# A law as a sum, with weights.
Parts: TypeAlias = Sequence[tuple[float, WithAtoms]]


class SavedTable(Summary):
    """A table that other codes read from a file."""

    @abstractmethod
    def _header(self) -> list[str]:
        """The comments of a .csv."""

    @abstractmethod
    def _rows(self) -> Floats:
        """The numbers of a .csv."""

    def save(self, path: str | Path, overwrite: bool = False) -> Path:
        """Write a file for other codes: .csv, or .npz or .h5 (extra ``hdf5``), with all attributes by their names.

        In a .csv comments begin with #; they say what the rows and columns of numbers are. An existing file is
        replaced only with ``overwrite``, when all is written.
        """
        target = Path(path)
        if target.suffix.lower() == ".csv":
            write_whole(target, numbers_as_csv(self._header(), self._rows().tolist()), overwrite=overwrite)
        elif target.suffix.lower() == ".npz":
            write_whole(target, lambda stream: np.savez_compressed(stream, **self._content()), overwrite=overwrite)
        elif target.suffix.lower() == ".h5":
            library = needed("h5py", "save", "hdf5")
            write_whole(target, lambda stream: self._write_hdf5(library, stream), overwrite=overwrite)
        else:
            raise InputError(f"path: expected a name that ends in .csv, .npz or .h5, got {shortened(str(path))}")
        return target

    def _content(self) -> dict[str, Any]:
        """All attributes by their names, and the header."""
        content = {field.name: getattr(self, field.name) for field in fields(self)}  # type: ignore[arg-type]
        return {**content, "header": "\n".join(self._header())}

    def _write_hdf5(self, library: Any, stream: IO[bytes]) -> None:
        """Write arrays as data sets in radians, other attributes as those of the file."""
        with library.File(stream, "w") as file:
            for name, value in self._content().items():
                (file if isinstance(value, np.ndarray) else file.attrs)[name] = value


@dataclass(frozen=True, eq=False, repr=False)
class Table(SavedTable):
    """The inverse distribution functions of a law on a grid, for other codes to interpolate.

    The first row of numbers of a .csv has 0 and the probabilities; each other row has an incoming angle and its
    quantiles.

    Attributes
    ----------
    theta : array of shape (n_in,)
        Incoming angles (i + 1/2) pi / n_in, radians. Retroreflection and specular reflection are linear in them.
    probability : array of shape (n_out,)
        Probabilities j / (n_out - 1).
    quantile : array of shape (n_in, n_out)
        Outgoing angles, radians: below ``quantile[i, j]`` the outgoing angle lies with ``probability[j]``, given
        ``theta[i]``.
    error : float
        Mean error of the outgoing angle, radians: the difference from the law's own quantiles, integrated over the
        probability and averaged over intermediate incoming angles with the weight sin(theta). It is an estimate, by
        comparison with four times as many probabilities from cells half as wide. Add pi/2 times ``distribution_error``.
    largest_error : float
        The largest of the compared differences. Of a law with atoms, whose quantiles jump, it is up to the height of
        a jump and does not decrease on finer grids; ``error`` does.
    distribution_error : float
        Error of the law's distribution functions, the largest at the grid's incoming angles. If the law does not know
        it, or it misses the tolerance, it is a half width of 95 %, by independent outgoing angles.
    tolerance : float
        The distribution error that was asked for.
    frame : {"paper", "specular"}
        The convention.
    law : str
    """

    theta: Floats
    probability: Floats
    quantile: Floats
    error: float
    largest_error: float
    distribution_error: float
    tolerance: float
    frame: Frame
    law: str

    @property
    def _missed(self) -> str:
        return f"{self.distribution_error:.3g}{' (above the tolerance)' * (self.distribution_error > self.tolerance)}"

    def _facts(self) -> dict[str, object]:
        return {**super()._facts(), "distribution_error": self._missed}

    @seed_by_name
    def sample(self, theta: ArrayLike, rng: Rng = None) -> Floats:
        """Draw one outgoing angle for every incoming angle from the table, by bilinear interpolation."""
        source, incoming = generator(rng), angles("theta", theta)
        return self._at(incoming, source.random(incoming.shape))

    def _rows(self) -> Floats:
        corner = np.concatenate(([0.0], self.probability))
        return np.vstack([corner, np.column_stack([self.theta, self.quantile])])

    def _header(self) -> list[str]:
        n_in, n_out = self.quantile.shape
        return [
            f"asperity table 1: outgoing angles by incoming angle and probability of the law {json.dumps(self.law)}",
            "unit: radians, in (0, pi), from the positive x-axis; theta_in of the reversed incoming velocity",
            f"convention: {self.frame}; {CONVENTIONS[self.frame]}",
            f"rows: theta_in = (i + 1/2) pi / {n_in}, i = 0 .. {n_in - 1}, equal steps of the angle",
            f"columns: theta_in, then quantiles for p = j / {n_out - 1}, j = 0 .. {n_out - 1}; first row: 0, then p",
            f"error of bilinear interpolation, estimated: {self.error:.3g} mean, {self.largest_error:.3g} largest",
            f"error of the distribution functions: {self._missed}, {self.tolerance:.3g} wanted",
        ]

    def _at(self, theta: Floats, probability: Floats) -> Floats:
        """Quantiles by bilinear interpolation, continued linearly beyond the outer incoming angles."""
        n_in, n_out = self.quantile.shape
        row, column = theta * (n_in / np.pi) - 0.5, probability * (n_out - 1)
        i = np.clip(row.astype(np.intp), 0, n_in - 2)
        j = np.clip(column.astype(np.intp), 0, n_out - 2)
        s, t = row - i, column - j
        low = (1.0 - t) * self.quantile[i, j] + t * self.quantile[i, j + 1]
        high = (1.0 - t) * self.quantile[i + 1, j] + t * self.quantile[i + 1, j + 1]
        return np.asarray(np.clip((1.0 - s) * low + s * high, SMALLEST_ANGLE, LARGEST_ANGLE))


def tabulated(parts: Parts, sample: Sampler, n_in: int, n_out: int, tolerance: float, frame: Frame, law: str) -> Table:
    """The table of a law, compared with its quantiles at intermediate incoming angles."""
    rows, columns = whole_number("n_in", n_in, 2), whole_number("n_out", n_out, 2)
    check_memory("n_in, n_out", "the table", 2 * COMPARED * rows * columns)
    cells = max(LEAST_CELLS, CELLS_FOR_EACH * columns)
    theta = np.asarray((np.arange(rows) + 0.5) * (np.pi / rows))
    probability = np.asarray(np.linspace(0.0, 1.0, columns), dtype=np.float64)
    quantile, missed, below = _quantiles(parts, theta, probability, cells)
    chance = math.sqrt(math.log(40.0 * rows) / (2.0 * DRAWN))
    if not missed <= max(tolerance, chance):
        missed = float(np.fmin(missed, chance + _distance(theta, below, sample)))
    unchecked = Table(frozen(theta), frozen(probability), frozen(quantile), 0.0, 0.0, missed, tolerance, frame, law)
    # the middle between neighbours, and the outer half cells, whose quantiles are extrapolated
    between = np.concatenate(([0.25], np.arange(1, rows), [rows - 0.25])) * (np.pi / rows)
    fine = (np.arange(COMPARED * (columns - 1)) + 0.5) / (COMPARED * (columns - 1))
    own, *_ = _quantiles(parts, between, fine, 2 * cells)
    difference = np.abs(unchecked._at(*np.broadcast_arrays(between[:, None], fine)) - own)
    mean = float(np.average(difference.mean(axis=1), weights=SINE.density(between)))
    return replace(unchecked, error=mean, largest_error=float(difference.max()))


def _distance(theta: Floats, below: Floats, sample: Sampler) -> float:
    """The largest distance of distribution functions, shape (angles, edges), from those of drawn outgoing angles.

    The latter are off by sqrt(log(2 n/q)/(2 DRAWN)) at any of n angles with probability q (Dvoretzky, Kiefer and
    Wolfowitz; P. Massart, Ann. Probab. 18, 1990).
    """
    edges, rng, worst = np.linspace(0.0, np.pi, below.shape[1]), np.random.default_rng(0), 0.0
    for angle, own in zip(theta, below, strict=True):
        drawn = np.sort(sample(np.full(DRAWN, angle), rng))
        low, high = (np.searchsorted(drawn, edges + side) / DRAWN for side in (-ROUNDED, ROUNDED))
        worst = max(worst, float((low - own).max()), float((own - high).max()))
    return worst


def _quantiles(parts: Parts, theta: Floats, probability: Floats, cells: int) -> tuple[Floats, float, Floats]:
    """Quantiles, shape (angles, probabilities), the largest error of the distribution functions, and these at edges."""
    edges, at = np.linspace(0.0, np.pi, cells + 1), np.clip(probability, END, 1.0 - END)
    found, missed, whole = np.empty((theta.size, at.size)), 0.0, np.zeros((theta.size, cells + 1))
    for own in slices(theta.size, AT_ONCE):
        chosen = theta[own]
        below, error = np.zeros((chosen.size, cells + 1)), np.zeros(chosen.size)
        atoms = [np.empty((2, chosen.size, 0))]
        for weight, with_atoms in parts:
            each, atomic = with_atoms(chosen, edges[1:-1])
            error += weight * each.error
            whole[own, 1:] += weight * np.cumsum(each.masses(edges), axis=1)
            spread = each._replace(weights=weight * np.where(atomic, 0.0, each.weights))
            below[:, 1:] += np.cumsum(spread.masses(edges), axis=1)
            if atomic.any():
                atoms.append(np.stack(each._replace(weights=weight * np.where(atomic, each.weights, 0.0)).atoms()))
        found[own] = Distributions.of_parts(edges, below, *np.concatenate(atoms, axis=2)).quantile(
            np.tile(at, (chosen.size, 1))
        )
        missed = float(np.maximum(missed, error.max()))
    return np.clip(found, SMALLEST_ANGLE, LARGEST_ANGLE), missed, whole
