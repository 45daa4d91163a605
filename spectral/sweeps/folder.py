"""A sweep in a folder: its checkpoint, its tables and its picture, for the command line."""

from __future__ import annotations

import os
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import IO

import numpy as np

from ...core.checkpoints import Checkpoint
from ...core.errors import FileExistsRefusal, InputError
from ...core.files import draw_whole, write_whole
from .ensembles import Ensemble
from .table import FILES, SweepTable

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
