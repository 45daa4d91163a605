"""Sweeps of the command line: the families of walls by their names, and the folder of a sweep."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from types import MappingProxyType
from typing import IO, Any

import numpy as np

from ...core.checkpoints import Checkpoint
from ...core.errors import FileExistsRefusal, InputError
from ...core.files import draw_whole, write_whole
from ...geometry import WALLS, HeightCorrelation, SelfAffine, Wall, wall_from_text
from .ensembles import Ensemble
from .points import RESOLUTION, Between, Value
from .table import FILES, SweepTable

# How heights are correlated, by name: what makes it, and its parameters, of which the first must be given.
SPECTRA: Mapping[str, tuple[Callable[..., HeightCorrelation | SelfAffine], tuple[str, ...]]] = MappingProxyType(
    {
        "gaussian": (HeightCorrelation, ("length",)),
        "exponential": (lambda length: HeightCorrelation(length, "exponential"), ("length",)),
        "self-affine": (SelfAffine, ("hurst", "longest", "shortest")),
    }
)


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


def family_and_grid(
    walls: Sequence[str], over: Sequence[str], adaptive: bool, resolution: float | None = None
) -> tuple[Any, dict[str, Any]]:
    """What `sweep` is given, from the words of the command line.

    Examples
    --------
    >>> family_and_grid(["koch"], ["generations=1:3:3"], adaptive=False)
    (NamedFamily(text='koch'), {'generations': [1, 2, 3]})
    """
    if resolution is not None and not adaptive:
        raise InputError("--resolution: expected --adaptive with it")
    if not over:
        if adaptive:
            raise InputError("--adaptive: expected --over NAME=LOW:HIGH:POINTS with it")
        return wall_by_name, {"wall": list(walls)}
    if len(walls) > 1:
        raise InputError(f"--over: expected one named wall, got {', '.join(walls)}; several are swept without --over")
    name = walls[0].partition(":")[0].strip().lower().replace("_", "-")
    if name not in WALLS:
        raise InputError(f"--over: expected a named wall, one of {', '.join(WALLS)}, got {walls[0]!r}")
    grid = dict(_axis(text, adaptive, resolution) for text in over)
    unknown = sorted(set(grid) - set(WALLS[name].defaults))
    if unknown:
        known = ", ".join(WALLS[name].defaults) or "it has none"
        raise InputError(f"--over: {name} has no parameter {unknown[0]!r} (parameters: {known})")
    return NamedFamily(walls[0]), grid


def _axis(text: str, adaptive: bool, resolution: float | None) -> tuple[str, Any]:
    """``name=low:high:points`` or ``name=value,value``."""
    name, _, values = text.partition("=")
    ends = values.split(":")
    try:
        if len(ends) == 1:
            return name.replace("-", "_"), [_number(value) for value in values.split(",")]
        low, high, number = float(_number(ends[0])), float(_number(ends[1])), int(ends[2])
    except (ValueError, IndexError, OverflowError) as reason:
        raise InputError(f"--over: expected NAME=LOW:HIGH:POINTS or NAME=VALUE,VALUE, got {text!r}") from reason
    if adaptive:
        return name.replace("-", "_"), Between(low, high, number, RESOLUTION if resolution is None else resolution)
    if number < 1:
        raise InputError(f"--over: expected at least one point, got {text!r}")
    values_between = np.linspace(low, high, number)
    whole = "." not in ends[0] + ends[1] and np.array_equal(values_between, np.round(values_between))
    return name.replace("-", "_"), [int(x) if whole else float(x) for x in values_between]


def _number(text: str) -> float | int:
    number = int(text) if text.strip().lstrip("+-").isdigit() else float(text)
    if not np.isfinite(float(number)):
        raise ValueError("not finite")
    return number


def spectrum_from_text(text: str) -> HeightCorrelation | SelfAffine:
    """The correlation or the spectrum of heights that a text describes.

    Raises
    ------
    InputError
        If there is no such name or parameter, or a value is not a number.

    Examples
    --------
    >>> spectrum_from_text("self-affine:hurst=0.8,longest=0.5")
    SelfAffine(hurst=0.8, longest=0.5, shortest=None)
    """
    name, _, tail = text.partition(":")
    known = "; ".join(f"{one}:{','.join(f'{key}=NUMBER' for key in keys)}" for one, (_, keys) in SPECTRA.items())
    refusal = InputError(f"spectrum: expected {known}, got {text!r}")
    make, keys = SPECTRA.get(name.strip().lower().replace("_", "-"), (None, ()))
    pairs = [part.partition("=") for part in tail.split(",")]
    try:
        given = {key.strip(): float(value) for key, _, value in pairs}
    except ValueError as reason:
        raise refusal from reason
    if make is None or len(given) < len(pairs) or not set(given) <= set(keys) or keys[0] not in given:
        raise refusal
    return make(**given)


CHECKPOINT, PICTURE, PARQUET, MEANS = "sweep.checkpoint", "table.png", "table.parquet", "means.csv"
MEAN_LAW, LAW_CHECKPOINT = "mean-law.npz", "mean-law.checkpoint"


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
    results = [name for name in (*FILES, PICTURE, PARQUET, MEANS, MEAN_LAW) if os.path.exists(folder / name)]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if overwrite:
            # opened first: a sweep that still runs in the folder is not robbed of its checkpoint
            with Checkpoint(checkpoint, {}, overwrite=True):
                for name in (*results, CHECKPOINT, LAW_CHECKPOINT):
                    (folder / name).unlink(missing_ok=True)
    except OSError as reason:
        raise InputError(f"{folder}: cannot write there ({reason}); choose another folder") from reason
    if results and not overwrite and not checkpoint.exists():
        raise FileExistsRefusal(f"{folder}: {', '.join(results)} exist; use another folder or --force to replace them")
    return checkpoint


def save_all(table: SweepTable, folder: Path) -> list[Path]:
    """Write tables and, where something can be drawn, a picture of every quantity; returns the paths."""
    written = _save_tables(table, folder)
    try:
        drawn = draw_whole(folder / PICTURE, partial(_draw, table))
    except InputError:
        # walls by name alone are no axis
        return written
    return [*written, folder / PICTURE] if drawn else written


def save_ensemble(found: Ensemble, folder: Path) -> list[Path]:
    """Write the tables of all realisations, and means and spreads; returns the paths."""
    write_whole(folder / MEANS, found.to_csv(), overwrite=True)
    return [folder / MEANS, *_save_tables(found.table, folder)]


def _save_tables(table: SweepTable, folder: Path) -> list[Path]:
    written = table.save(folder, overwrite=True)
    if find_spec("pandas") and find_spec("pyarrow"):
        table.to_parquet(folder / PARQUET)
        written.append(folder / PARQUET)
    return written


def _draw(table: SweepTable, stream: IO[bytes]) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    number = len(table.quantities)
    figure = Figure(figsize=(6.4, 3.2 * number), layout="constrained")
    FigureCanvasAgg(figure)
    for quantity, panel in zip(table.quantities, np.atleast_1d(figure.subplots(number)), strict=True):
        table.plot(quantity, panel)
    figure.savefig(stream, dpi=100, format="png")
