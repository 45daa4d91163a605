"""Sweeps: quantities of a family of laws at many points, in one process or in many, stopped and gone on with."""

from __future__ import annotations

import inspect
import json
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias, cast

from ...core.checkpoints import Checkpoint, content, told
from ...core.checks import finite_number, positive_number
from ...core.errors import AsperityError, InputError
from ...core.long_runs import progress_bar
from ...core.version import __version__
from ...core.workers import connected, results
from ...geometry import Wall
from ...kernels import CollisionLaw, Law, WallLaw
from ...kernels.laws.matrix_law import not_a_law
from .points import Grid, Point, key_of
from .quantities import Quantity, UserQuantity, listed_quantities, name_of, quantities_from
from .row import SweepRow
from .table import SweepTable

# Walls of a sweep, evenly spread over its points, by which a checkpoint tells it from others.
TOLD_APART = 1000

Family: TypeAlias = Callable[..., Wall | Law | CollisionLaw]


@dataclass(frozen=True)
class _Study:
    """What is computed at a point; it is sent to workers."""

    family: Family
    asked: tuple[str | UserQuantity, ...]
    tolerance: float

    def rows(self, point: Point) -> list[SweepRow]:
        """All rows of a point; whatever is refused, or fails, has its message instead of a value."""
        quantities = quantities_from(self.asked)
        start = time.perf_counter()
        try:
            law = law_of(self.family(**point))
        except Exception as reason:  # a point must not stop the others
            names = [name for one in quantities for name in one.names]
            return [_refused(point, name, reason, time.perf_counter() - start) for name in names]
        return [row for one in quantities for row in self._rows_of(one, law, point)]

    def _rows_of(self, quantity: Quantity, law: Law, point: Point) -> list[SweepRow]:
        start = time.perf_counter()
        try:
            numbers, verdict = quantity.find(law, self.tolerance)
            for name, number in zip(quantity.names, numbers, strict=True):
                finite_number(name, number.value)
        except Exception as reason:  # a quantity must not stop the others
            seconds = time.perf_counter() - start
            return [_refused(point, name, reason, seconds) for name in quantity.names]
        seconds = time.perf_counter() - start
        return [
            SweepRow.of(point, name, number, verdict, seconds, __version__)
            for name, number in zip(quantity.names, numbers, strict=True)
        ]

    def as_lists(self, point: Point) -> list[list[Any]]:
        """`rows` as plain values, which travel between processes and are stored."""
        return [row.as_list() for row in self.rows(point)]


def sweep(
    family: Family,
    grid: Mapping[str, Any],
    quantities: str | UserQuantity | Sequence[str | UserQuantity] = ("gap",),
    tolerance: float = 1e-6,
    *,
    checkpoint: str | Path | None = None,
    key: str | None = None,
    client: Any = None,
    progress: bool = False,
    zipped: bool = False,
) -> SweepTable:
    """Compute quantities of a family of walls or laws at the points of a grid, each with its error.

    Parameters
    ----------
    family : callable
        Takes the parameters by name and returns a wall or a law: `asperity.geometry.focusing_arcs`,
        `asperity.geometry.wall_from_text` for files and names of walls, or a function of one's own, in which a
        parameter may be the seed of a random wall.
    grid : mapping
        For each parameter its values, numbers or texts; or a `Between` for one of them, in which the points are
        chosen.
    quantities : str, callable or sequence of these
        ``"gap"`` in the convention that the law carries, the paper's for walls, and ``"gap_specular"`` in the other;
        ``"slem"``, ``"relaxation_time"``, ``"resistance"``, ``"eta"``; ``"accommodation"``, which has four rows:
        tangential and normal coefficient, Maxwell fraction and misfit. Or functions that take a law and return an
        `Estimate`; their names are those of the rows.
    tolerance : float
        Error asked of each quantity; what was reached stands in the rows.
    checkpoint : path, optional
        A file to which finished points are added. The same call with the same file goes on where it was; of other
        families, quantities, grids, tolerances or versions of asperity a file is refused. Functions are told apart by
        their code and all that it reaches in memory, families besides by their laws at a thousand points.
    key : str, optional
        A name of one's own for the computation. With it functions, and objects of one's own classes, are told apart by
        their names alone: for those whose content cannot be compared, or changes while they run.
    client : int, str or distributed.Client, optional
        So many workers on this machine, the address of a scheduler, or a client of dask.distributed; by default this
        process. The table does not depend on it, but for the seconds.
    progress : bool
        Whether a bar is shown on a terminal.
    zipped : bool
        Whether the k-th values of all parameters belong together; by default each value goes with all others.

    Returns
    -------
    SweepTable

    Raises
    ------
    InputError
        If an argument is not as described, or the checkpoint is of something else or cannot be written.
    FileExistsRefusal
        If another process has the checkpoint open.
    AsperityError
        If the scheduler is lost. What was finished is in the checkpoint.

    Examples
    --------
    >>> from asperity import kernels as ker, spectral as spec
    >>> def walls(fraction):
    ...     return ker.maxwell(fraction)
    >>> table = spec.sweep(walls, {"fraction": [0.0, 0.25, 2.0]}, "gap")
    >>> [(row.value, row.verdict) for row in table.rows]
    [(0.0, 'no gap'), (0.25, 'isolated'), (None, '')]
    >>> table.rows[2].message
    'diffuse_fraction: expected a number in [0, 1], got 2.0'
    """
    wanted = positive_number("tolerance", tolerance)
    listed = listed_quantities(quantities)
    found = quantities_from(listed)
    if not callable(family):
        raise InputError(f"family: expected a function that returns a wall, as geo.focusing_arcs, got {family!r}")
    points = Grid.of(grid, zipped)
    _check_names(family, points.ends[0])
    study = _Study(family, listed, wanted)
    run = _Run(study, points, found[0].names[0])
    rows = run.all_rows(checkpoint, key, client, progress)
    # walls of the command line have a text, functions a name
    name = str(getattr(family, "text", getattr(family, "__name__", "")))
    return SweepTable(points.names, rows, not points.is_product, study.rows, "" if "<" in name else name)


class _Run:
    """One call of `sweep`."""

    def __init__(self, study: _Study, grid: Grid, leading: str) -> None:
        self.study, self.grid, self.leading = study, grid, leading
        self.found: dict[str, list[SweepRow]] = {}

    def all_rows(
        self, checkpoint: str | Path | None, key: str | None, client: Any, progress: bool
    ) -> tuple[SweepRow, ...]:
        """The rows of all points, in the order of the grid."""
        try:
            points = self._points(checkpoint, key, client, progress)
        except KeyboardInterrupt as stop:
            raise KeyboardInterrupt(self._where_to_go_on(checkpoint)) from stop
        return tuple(row for point in self.grid.in_order(points) for row in self.found[key_of(point)])

    def _points(self, checkpoint: str | Path | None, key: str | None, client: Any, progress: bool) -> list[Point]:
        """All points of the plan, whose rows are then found."""
        points: list[Point] = []
        with ExitStack() as stack:
            store = None
            if checkpoint is not None:
                store = stack.enter_context(Checkpoint(checkpoint, self.identity(key is not None), key=key))
            known = {} if store is None else dict(store.parts(self._read))
            workers = stack.enter_context(connected(client))
            bar = stack.enter_context(progress_bar(self.grid.size, "point", "sweep", shown=progress))
            plan = self.grid.plan()
            portion = next(plan, [])
            while portion:
                points += portion
                self._compute(portion, known, store, workers, bar)
                try:
                    portion = plan.send([self._leading_value(point) for point in portion])
                except StopIteration:
                    break
        return points

    def _compute(
        self, portion: Sequence[Point], known: Mapping[str, Any], store: Checkpoint | None, workers: Any, bar: Any
    ) -> None:
        """Find the rows of some points, those that the checkpoint has first."""
        rest = []
        for point in portion:
            if (rows := known.get(key_of(point))) is None:
                rest.append(point)
            else:
                self._keep(point, rows, bar)
        for point, rows in results(self.study.as_lists, rest, workers):
            self._keep(point, rows, bar)
            if store is not None:
                store.put(key_of(point), json.dumps(rows))

    def _keep(self, point: Point, rows: Sequence[Sequence[Any]], bar: Any) -> None:
        self.found[key_of(point)] = [SweepRow.of_list(self.grid.names, row) for row in rows]
        bar.update()

    def _leading_value(self, point: Point) -> float:
        """Of the quantity whose curve chooses the next points; 0 where it was refused."""
        row = next(row for row in self.found[key_of(point)] if row.quantity == self.leading)
        return 0.0 if row.value is None else row.value

    def _where_to_go_on(self, checkpoint: str | Path | None) -> str:
        done = f"stopped after {len(self.found)} of {self.grid.size} points"
        if checkpoint is None:
            return f"{done}; without a checkpoint they are lost"
        return f"{done}, which are in {checkpoint}; the same call goes on from there"

    def _read(self, key: str, text: str) -> list[list[Any]]:
        """The rows of a point as they are stored, each checked."""
        names = [name for one in quantities_from(self.study.asked) for name in one.names]
        rows: list[list[Any]] = json.loads(text)
        for row, name in zip(rows, names, strict=True):
            if key_of(cast(Point, dict(enumerate(row[0])))) != key:
                raise ValueError(f"rows of the point {row[0]}")
            SweepRow.of_list(self.grid.names, row).check(name)
        return rows

    def identity(self, by_name: bool) -> dict[str, Any]:
        """What tells this sweep from others; ``by_name`` of the user's functions and classes only their names."""
        first, *between, last = (_made(self.study.family, point, by_name) for point in self.grid.some(TOLD_APART))
        return {
            "computation": "sweep",
            "version": __version__,
            "family": self.study.family,
            "first wall": first,
            "last wall": last,
            "walls between": content(between),
            "grid": self.grid.as_dict(),
            "zipped": self.grid.zipped,
            "quantities": self.study.asked,
            "tolerance": self.study.tolerance,
        }


def law_of(made: object) -> Law:
    """The law of what a family returns."""
    if isinstance(made, Wall):
        return WallLaw(made)
    if isinstance(made, CollisionLaw):
        return made.law
    if not isinstance(made, Law):
        raise not_a_law("family", "a function that returns a wall or a law", made)
    return made


def in_words(reason: Exception) -> str:
    """Why a computation failed: our own messages say what to do, others need the name of their class."""
    return str(reason) if isinstance(reason, AsperityError) else f"{type(reason).__name__}: {reason}"


def _refused(point: Point, quantity: str, reason: Exception, seconds: float) -> SweepRow:
    return SweepRow(point, quantity, None, None, "", "", "", seconds, __version__, in_words(reason))


def _check_names(family: Family, point: Point) -> None:
    """Refuse parameters that the family does not take, which would fail at every point."""
    try:
        signature = inspect.signature(family)
    except ValueError:
        return
    try:
        signature.bind(**point)
    except TypeError as reason:
        raise InputError(
            f"grid: {name_of(family)}{signature} cannot be called with {', '.join(point)}: {reason}"
        ) from None


def _made(family: Family, point: Point, by_name: bool) -> str:
    """What tells what a family makes at a point from what others make."""
    try:
        law = law_of(family(**point))
    except Exception as reason:  # a refused wall is a row of the table
        return f"refused: {reason}"
    return str(told("family", law, by_name=by_name))
