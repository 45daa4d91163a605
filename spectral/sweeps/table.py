"""The long table of a sweep: a row for each point and quantity, and its forms in other libraries and in files."""

from __future__ import annotations

import csv
import io
import json
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...core.errors import FileExistsRefusal, InputError
from ...core.estimates import Summary
from ...core.files import write_whole
from ...core.tables import data_frame, needed
from .extremum import Extremum, draw_curves, refined_extremum
from .points import COLUMNS, UNITS, Point, SweepRow, key_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame
    from xarray import Dataset

FORMAT = 1
FILES = ("table.csv", "table.json")


@dataclass(frozen=True, repr=False)
class SweepTable(Summary):
    """What a sweep found.

    Attributes
    ----------
    parameters : tuple of str
    rows : tuple of SweepRow
        By points in the order of the grid, then by quantities.
    zipped : bool
        Whether the points are no product of values.
    solve : callable or None
        Computes the rows of further points; None for a table that was read.
    family : str
        The name of the walls or laws, for the axis of pictures; empty of a function without name.

    Examples
    --------
    >>> from asperity import kernels as ker, spectral as spec
    >>> table = spec.sweep(ker.maxwell, {"diffuse_fraction": [0.25, 0.5]}, ["gap", "eta"])
    >>> [(row.point["diffuse_fraction"], row.quantity, round(row.value, 12)) for row in table.rows]
    [(0.25, 'gap', 0.25), (0.25, 'eta', 7.0), (0.5, 'gap', 0.5), (0.5, 'eta', 3.0)]
    """

    parameters: tuple[str, ...]
    rows: tuple[SweepRow, ...]
    zipped: bool = False
    solve: Callable[[Point], Sequence[SweepRow]] | None = field(default=None, repr=False, compare=False)
    family: str = field(default="", repr=False)
    _more = ".rows, .of(quantity), .to_frame(), .plot(), .extremum()"

    def _headline(self) -> str:
        return f"over {', '.join(self.parameters)}"

    def _facts(self) -> dict[str, object]:
        """The points, least and greatest value of each quantity, and why rows were refused."""
        facts: dict[str, object] = {"points": len(self.of(self.quantities[0])) if self.rows else 0}
        for name in self.quantities:
            known = sorted((row for row in self.of(name) if row.value is not None), key=lambda row: row.value or 0.0)
            facts[name] = " to ".join(dict.fromkeys(row.in_words() for row in (known[:1] + known[-1:])))
        return {**facts, "refused": self.refusals()}

    def refusals(self) -> str | None:
        """How many rows have no value, and why the first of them, or None."""
        refused = [row.message for row in self.rows if row.value is None]
        return f"{len(refused)} of {len(self.rows)}: {refused[0]}" if refused else None

    @property
    def quantities(self) -> tuple[str, ...]:
        """The names of the quantities."""
        return tuple(dict.fromkeys(row.quantity for row in self.rows))

    def of(self, quantity: str) -> tuple[SweepRow, ...]:
        """The rows of one quantity.

        Raises
        ------
        InputError
            If the table has no such quantity.
        """
        found = tuple(row for row in self.rows if row.quantity == quantity)
        if not found:
            raise InputError(f"quantity: expected one of {', '.join(self.quantities)}, got {quantity!r}")
        return found

    def to_frame(self) -> DataFrame:
        """A pandas frame with a column for each parameter and the columns of the rows; refused values are NaN.

        Raises
        ------
        InputError
            If pandas is not installed.
        """
        rows = [[*row.point.values(), *row.cells()] for row in self.rows]
        names = [*self.parameters, *COLUMNS]
        frame: DataFrame = data_frame({name: [row[k] for row in rows] for k, name in enumerate(names)})
        return frame.astype({"value": "float64", "error": "float64", "seconds": "float64"})

    def to_xarray(self) -> Dataset:
        """An xarray data set with the variables ``Q``, ``Q_error`` and ``Q_verdict`` of each quantity Q.

        Its dimensions are the parameters, or ``point`` where the points are no product. Every variable has its unit
        and its method in its attributes.

        Raises
        ------
        InputError
            If xarray is not installed.
        """
        xarray = needed("xarray", "to_xarray")
        frame = self.to_frame()
        if self.zipped:
            numbers = {key_of(dict(row.point)): number for number, row in enumerate(self.of(self.quantities[0]))}
            frame["point"] = [numbers[key_of(dict(row.point))] for row in self.rows]
        dimensions = ["point"] if self.zipped else list(self.parameters)
        found: Dataset = xarray.Dataset()
        for quantity in self.quantities:
            own = frame[frame["quantity"] == quantity].set_index(dimensions)
            for suffix, column in (("", "value"), ("_error", "error"), ("_verdict", "verdict")):
                variable = own[column].to_xarray()
                variable.attrs = {"long_name": f"{quantity.replace('_', ' ')}{suffix.replace('_', ', ')}"}
                if column != "verdict":
                    variable.attrs["units"] = UNITS.get(quantity, "1")
                found[f"{quantity}{suffix}"] = variable
            if self.zipped:
                found = found.assign_coords({name: ("point", own[name].to_numpy()) for name in self.parameters})
        return found

    def to_csv(self) -> str:
        """The table as CSV: numbers with all their digits, refused values empty."""
        rows = [(*row.point.values(), *row.cells()) for row in self.rows]
        return csv_text([*self.parameters, *COLUMNS], rows)

    def to_json(self) -> str:
        """The table as JSON, which `of_json` reads."""
        data = {
            "format": FORMAT, "family": self.family, "parameters": self.parameters, "zipped": self.zipped,
            "columns": ["point", *COLUMNS], "rows": [row.as_list() for row in self.rows],
        }  # fmt: skip
        return json.dumps(data, indent=1, allow_nan=False)

    @staticmethod
    def of_json(text: str) -> SweepTable:
        """The table that `to_json` gave.

        Raises
        ------
        InputError
            If the text is something else.
        """
        try:
            data = json.loads(text)
            if data["format"] != FORMAT or data["columns"] != ["point", *COLUMNS]:
                raise InputError(f"JSON: expected a table of format {FORMAT}, got {data['format']}")
            rows = tuple(SweepRow.of_list(data["parameters"], cells) for cells in data["rows"])
            family = str(data.get("family", ""))
            return SweepTable(tuple(data["parameters"]), rows, bool(data["zipped"]), family=family)
        except (ValueError, KeyError, TypeError, RecursionError) as reason:
            raise InputError(f"JSON: expected what SweepTable.to_json() gives: {reason}") from reason

    def to_parquet(self, path: str | Path) -> None:
        """Write the frame into a Parquet file, in place of an earlier one.

        Raises
        ------
        InputError
            If pandas or pyarrow is not installed, or the file cannot be written.
        """
        frame = self.to_frame()
        # pandas loads it by its name
        needed("pyarrow", "to_parquet")
        write_whole(Path(path), lambda stream: frame.to_parquet(stream, engine="pyarrow", index=False), overwrite=True)

    def save(self, folder: str | Path, *, overwrite: bool = False) -> list[Path]:
        """Write ``table.csv`` and ``table.json``; returns their paths.

        Raises
        ------
        FileExistsRefusal
            If one of them exists and ``overwrite`` is False; nothing is written then.
        InputError
            If they cannot be written.
        """
        target = Path(folder)
        existing = [name for name in FILES if os.path.exists(target / name)]
        if existing and not overwrite:
            raise FileExistsRefusal(f"{target}: {', '.join(existing)} exist; pass overwrite=True to replace them")
        try:
            target.mkdir(parents=True, exist_ok=True)
        except OSError as reason:
            raise InputError(f"{target}: cannot write there ({reason}); choose another folder") from reason
        texts = dict(zip(FILES, (self.to_csv(), self.to_json() + "\n"), strict=True))
        for name, text in texts.items():
            write_whole(target / name, text, overwrite=overwrite)
        return [target / name for name in FILES]

    def plot(self, quantity: str | None = None, ax: Axes | None = None) -> Axes:
        """Draw a quantity, by default the first, against the first parameter that is a number.

        The error is a band, the verdict a marker, and where there is no gap the ground is shaded. Each combination of
        the other parameters is a curve.
        """
        name = self.quantities[0] if quantity is None else quantity
        return draw_curves(self.of(name), self.parameters, name, self.family, ax)

    def extremum(self, quantity: str | None = None, *, largest: bool = True, evaluations: int = 40) -> Extremum:
        """The largest or smallest value, by default of the first quantity, refined between the points of the sweep.

        See `Extremum` for what it says and what it presumes.

        Raises
        ------
        InputError
            If the table has several parameters, or one that is no number; if it was read from a file, so that nothing
            more can be computed; if no point has a value.
        """
        name = self.quantities[0] if quantity is None else quantity
        return refined_extremum(self.of(name), self.parameters, self.solve, largest, evaluations)


def csv_text(names: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    """A table as CSV: numbers with all their digits, None as nothing."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)
    for row in rows:
        writer.writerow([repr(float(cell)) if isinstance(cell, float) else cell for cell in row])
    return text.getvalue()
