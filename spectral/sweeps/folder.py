"""A sweep in a folder: its checkpoint, its tables and its picture, for the command line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from ...core.checkpoints import Checkpoint
from ...core.errors import FileExistsRefusal, InputError
from ...geometry import WALLS, Wall, wall_from_text
from .points import Between, Value
from .table import FILES, SweepTable

CHECKPOINT, PICTURE, PARQUET = "sweep.checkpoint", "table.png", "table.parquet"


@dataclass(frozen=True)
class NamedFamily:
    """Walls by name and parameters, as on the command line.

    Examples
    --------
    >>> NamedFamily("rectangular-teeth")(height_to_width=4).depth
    2.0
    """

    text: str

    def __call__(self, **parameters: Value) -> Wall:
        pairs = ",".join(f"{name}={value}" for name, value in parameters.items())
        return wall_from_text(f"{self.text}{',' if ':' in self.text else ':'}{pairs}")


def wall_by_name(wall: str) -> Wall:
    """The wall that a text describes; the name of the parameter is that of the column of a table."""
    return wall_from_text(wall)


def family_and_grid(walls: Sequence[str], over: Sequence[str], adaptive: bool) -> tuple[Any, dict[str, Any]]:
    """What `sweep` is given, from the words of the command line.

    Examples
    --------
    >>> family_and_grid(["koch"], ["generations=1:3:3"], adaptive=False)
    (NamedFamily(text='koch'), {'generations': [1, 2, 3]})
    """
    if not over:
        if adaptive:
            raise InputError("--adaptive: expected --over NAME=LOW:HIGH:POINTS with it")
        return wall_by_name, {"wall": list(walls)}
    if len(walls) > 1:
        raise InputError(f"--over: expected one named wall, got {', '.join(walls)}; several are swept without --over")
    name = walls[0].partition(":")[0].strip().lower().replace("_", "-")
    if name not in WALLS:
        raise InputError(f"--over: expected a named wall, one of {', '.join(WALLS)}, got {walls[0]!r}")
    grid = dict(_axis(text, adaptive) for text in over)
    unknown = sorted(set(grid) - set(WALLS[name].defaults))
    if unknown:
        known = ", ".join(WALLS[name].defaults) or "it has none"
        raise InputError(f"--over: {name} has no parameter {unknown[0]!r} (parameters: {known})")
    return NamedFamily(walls[0]), grid


def _axis(text: str, adaptive: bool) -> tuple[str, Any]:
    """``name=low:high:points`` or ``name=value,value``."""
    name, _, values = text.partition("=")
    ends = values.split(":")
    try:
        if len(ends) == 1:
            return name.replace("-", "_"), [_number(value) for value in values.split(",")]
        low, high, number = float(ends[0]), float(ends[1]), int(ends[2])
    except (ValueError, IndexError) as reason:
        raise InputError(f"--over: expected NAME=LOW:HIGH:POINTS or NAME=VALUE,VALUE, got {text!r}") from reason
    if adaptive:
        return name.replace("-", "_"), Between(low, high, number)
    if number < 1:
        raise InputError(f"--over: expected at least one point, got {text!r}")
    values_between = np.linspace(low, high, number)
    whole = "." not in ends[0] + ends[1] and np.array_equal(values_between, np.round(values_between))
    return name.replace("-", "_"), [int(x) if whole else float(x) for x in values_between]


def _number(text: str) -> float | int:
    return int(text) if text.strip().lstrip("+-").isdigit() else float(text)


def checkpoint_in(folder: Path, *, overwrite: bool) -> Path:
    """Make the folder and say where its checkpoint is; with ``overwrite`` what another sweep left is removed.

    Raises
    ------
    FileExistsRefusal
        If there are tables without a checkpoint, so that nobody knows of what they are.
        Or if another process has the checkpoint open.
    InputError
        If the folder cannot be made.
    """
    checkpoint = folder / CHECKPOINT
    results = [name for name in (*FILES, PICTURE, PARQUET) if (folder / name).exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if overwrite:
            # opened first: a sweep that still runs in the folder is not robbed of its checkpoint
            with Checkpoint(checkpoint, {}, overwrite=True):
                for name in (*results, CHECKPOINT):
                    (folder / name).unlink(missing_ok=True)
    except OSError as reason:
        raise InputError(f"{folder}: cannot write there ({reason}); choose another folder") from reason
    if results and not overwrite and not checkpoint.exists():
        raise FileExistsRefusal(f"{folder}: {', '.join(results)} exist; use another folder or --force to replace them")
    return checkpoint


def save_all(table: SweepTable, folder: Path) -> list[Path]:
    """Write tables and, where something can be drawn, a picture of every quantity; returns the paths."""
    written = table.save(folder, overwrite=True)
    if find_spec("pandas") and find_spec("pyarrow"):
        table.to_parquet(folder / PARQUET)
        written.append(folder / PARQUET)
    try:
        _draw(table, folder / PICTURE)
    except InputError:
        # walls by name alone are no axis
        return written
    return [*written, folder / PICTURE]


def _draw(table: SweepTable, path: Path) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    from ...core.files import write_whole

    number = len(table.quantities)
    figure = Figure(figsize=(6.4, 3.2 * number), layout="constrained")
    FigureCanvasAgg(figure)
    for quantity, panel in zip(table.quantities, np.atleast_1d(figure.subplots(number)), strict=True):
        table.plot(quantity, panel)
    write_whole(path, lambda stream: figure.savefig(stream, dpi=100, format="png"), overwrite=True)


def in_words(table: SweepTable) -> str:
    """How many rows have values, and why the others have none."""
    refused = [row for row in table.rows if row.value is None]
    lines = [f"{len(table.rows)} rows, {len(refused)} of them refused"]
    reasons = dict.fromkeys(row.message for row in refused)
    return "\n".join([*lines, *(f"refused: {reason}" for reason in reasons)])
