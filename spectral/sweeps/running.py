"""Sweeps: quantities of a family of laws at many points, in one process or in many, stopped and gone on with."""

from __future__ import annotations

import inspect
import json
import re
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from traceback import format_exception_only
from types import MappingProxyType
from typing import Any, TypeAlias, cast

from ...core.checkpoints import Checkpoint
from ...core.checks import finite_number, instance, positive_number, shortened
from ...core.contents import content, told
from ...core.errors import AsperityError, InputError
from ...core.estimates import Estimate
from ...core.long_runs import Engine, progress_bar
from ...core.version import __version__
from ...core.workers import connected, results
from ...geometry import Wall
from ...kernels import CollisionLaw, Law, WallLaw, resistance
from ...kernels.laws.law import in_frame
from ...kernels.laws.matrix_law import check_law
from ..consequences.diffusion import logarithmic_slope
from ..consequences.mixing import relaxation_time, slem_from_gap
from ..consequences.momentum_accommodation import accommodation
from ..gap.gap import modulus_gap, spectral_gap
from ..gap.verdict import SpectralGap
from .points import Grid, Point, SweepRow, key_of
from .table import SweepTable

# Walls of a sweep, evenly spread over its points, by which a checkpoint tells it from others.
TOLD_APART = 1000
# The parameter of a family that makes its walls differ.
SEED = "rng"
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
            SweepRow(
                point, name, number.value, number.error, number.kind, verdict, number.method, seconds, __version__, ""
            )
            for name, number in zip(quantity.names, numbers, strict=True)
        ]

    def read(self, key: str, text: str, parameters: Sequence[str]) -> list[SweepRow]:
        """The rows of a point as they are stored, each checked."""
        names = [name for one in quantities_from(self.asked) for name in one.names]
        rows = [SweepRow.of_list(parameters, cells) for cells in json.loads(text)]
        for row, name in zip(rows, names, strict=True):
            if key_of(dict(row.point)) != key:
                raise ValueError(f"rows of the point {row.point}")
            row.check(name)
        return rows

    def identity(self, grid: Grid, by_name: bool) -> dict[str, Any]:
        """What tells a sweep from others; ``by_name`` of the user's functions and classes only their names."""
        walls = [_made(self.family, point, by_name) for point in grid.some(TOLD_APART)]
        return {
            "computation": "sweep", "version": __version__, "family": self.family,
            "first wall": walls[0], "last wall": walls[-1], "walls": content(walls),
            "grid": grid.as_dict(), "zipped": grid.zipped, "quantities": self.asked, "tolerance": self.tolerance,
        }  # fmt: skip


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
    _check_names(family, points.some(1)[0])
    study = _Study(family, listed, wanted)
    engine: Engine = {"checkpoint": checkpoint, "key": key, "client": client}
    rows = _all_rows(study, points, found[0].names[0], engine, progress)
    # walls of the command line have a text, functions a name
    name = str(getattr(family, "text", getattr(family, "__name__", "")))
    return SweepTable(points.names, rows, not points.is_product, study.rows, "" if "<" in name else name)


def _all_rows(study: _Study, grid: Grid, leading: str, engine: Engine, progress: bool) -> tuple[SweepRow, ...]:
    """The rows of all points, in the order of the grid."""
    path, key = engine["checkpoint"], engine["key"]
    points: list[Point] = []
    found: dict[str, list[SweepRow]] = {}

    def value(point: Point) -> float:
        row = next(row for row in found[key_of(point)] if row.quantity == leading)
        # a point that was refused
        return 0.0 if row.value is None else row.value

    try:
        with ExitStack() as stack:
            store, known = None, {}
            if path is not None:
                store = stack.enter_context(Checkpoint(path, study.identity(grid, key is not None), key=key))
                known = dict(store.parts(partial(study.read, parameters=grid.names)))
            workers = stack.enter_context(connected(engine["client"]))
            words = ("realisation", "ensemble") if grid.names == (SEED,) else ("point", "sweep")
            bar = stack.enter_context(progress_bar(grid.size, *words, shown=progress))
            for portion in grid.portions(value):
                points += portion
                found |= {one: known[one] for one in map(key_of, portion) if one in known}
                bar.update(len([point for point in portion if key_of(point) in known]))
                rest = [point for point in portion if key_of(point) not in known]
                for point, rows in results(study.rows, rest, workers):
                    found[key_of(point)] = rows
                    bar.update()
                    if store is not None:
                        store.put(key_of(point), json.dumps([row.as_list() for row in rows]))
    except KeyboardInterrupt as stop:
        done = f"stopped after {len(found)} of {grid.size} points"
        where = f"{done}, which are in {path}; the same call goes on from there"
        raise KeyboardInterrupt(f"{done}; without a checkpoint they are lost" if path is None else where) from stop
    return tuple(row for point in grid.in_order(points) for row in found[key_of(point)])


def law_of(made: object) -> Law:
    """The law of what a family returns."""
    if isinstance(made, Wall):
        return WallLaw(made)
    if isinstance(made, CollisionLaw):
        return made.law
    check_law("family", made, "a function that returns a wall or a law")
    return cast(Law, made)


def in_words(reason: Exception) -> str:
    """Why a computation failed: our own messages say what to do, others need the name of their class."""
    words = str(reason) if isinstance(reason, AsperityError) else format_exception_only(reason)[-1].strip()
    # halves of characters, as in names of files, cannot be written
    return words.encode(errors="backslashreplace").decode()


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
        return f"refused: {in_words(reason)}"
    return str(told("family", law, by_name=by_name))


UserQuantity = Callable[[Law], Estimate]
Numbers = dict[str, Estimate]


@dataclass(frozen=True)
class Quantity:
    """One or several numbers of a law.

    Attributes
    ----------
    names : tuple of str
        What the numbers are called in the table.
    find : callable
        From a law and a tolerance to the numbers and the verdict on the gap behind them, empty where there is none.
    """

    names: tuple[str, ...]
    find: Callable[[Law, float], tuple[Sequence[Estimate], str]]


def _gap(law: Law, tolerance: float) -> tuple[Sequence[Estimate], str]:
    found = spectral_gap(law, tolerance)
    return [found], found.verdict


def _slem(law: Law, tolerance: float) -> tuple[Sequence[Estimate], str]:
    found = modulus_gap(law, tolerance)
    return [slem_from_gap(found)], found.verdict


def _relaxation_time(law: Law, tolerance: float) -> tuple[Sequence[Estimate], str]:
    found = modulus_gap(law, tolerance)
    return [relaxation_time(found)], found.verdict


def _resistance(law: Law, tolerance: float) -> tuple[Sequence[Estimate], str]:
    return [resistance(in_frame(law, "paper"), tolerance)], ""


def _eta(law: Law, tolerance: float) -> tuple[Sequence[Estimate], str]:
    found = logarithmic_slope(law, 1.0, 1.0, "mirror")
    return [Estimate(found.eta, found.eta_error, found.kind, found.method)], ""


def _accommodation(law: Law, tolerance: float) -> tuple[Sequence[Estimate], str]:
    found = accommodation(law, tolerance)
    return [found.tangential, found.normal, found.maxwell_fraction, found.misfit], ""


_ACCOMMODATION = ("tangential_accommodation", "normal_accommodation", "maxwell_fraction", "maxwell_misfit")
QUANTITIES: Mapping[str, Quantity] = MappingProxyType(
    {
        "gap": Quantity(("gap",), _gap),
        "gap_specular": Quantity(("gap_specular",), lambda law, tol: _gap(in_frame(law, "specular"), tol)),
        "slem": Quantity(("slem",), _slem),
        "relaxation_time": Quantity(("relaxation_time",), _relaxation_time),
        "resistance": Quantity(("resistance",), _resistance),
        "eta": Quantity(("eta",), _eta),
        "accommodation": Quantity(_ACCOMMODATION, _accommodation),
    }
)


def listed_quantities(asked: str | UserQuantity | Sequence[str | UserQuantity]) -> tuple[str | UserQuantity, ...]:
    """One quantity or several as a tuple; an InputError for anything else."""
    if isinstance(asked, str) or callable(asked):
        return (asked,)
    if not isinstance(asked, Sequence):
        raise InputError(f"quantities: expected names or functions such as ['gap', 'eta'], got {shortened(asked)}")
    return tuple(asked)


def quantities_from(asked: str | UserQuantity | Sequence[str | UserQuantity]) -> tuple[Quantity, ...]:
    """The quantities that names and functions mean, each once.

    Raises
    ------
    InputError
        If there is none, a name is unknown, or two quantities have the same.

    Examples
    --------
    >>> [one.names for one in quantities_from(["gap", "eta"])]
    [('gap',), ('eta',)]
    """
    found = [_quantity(one) for one in listed_quantities(asked)]
    names = [name for one in found for name in one.names]
    twice = {name for name in names if names.count(name) > 1}
    if not names or twice:
        what = f"{sorted(twice)[0]!r} twice" if twice else "none"
        raise InputError(f"quantities: expected different ones of {', '.join(QUANTITIES)} or functions, got {what}")
    return tuple(found)


def _quantity(asked: str | UserQuantity) -> Quantity:
    if isinstance(asked, str):
        if asked not in QUANTITIES:
            raise InputError(
                f"quantities: expected one of {', '.join(QUANTITIES)} or a function of a law, got {asked!r}"
                + "; the diffusivity in a channel is eta times 4 radius speed / pi" * (asked == "diffusivity")
            )
        return QUANTITIES[asked]
    if not callable(asked):
        raise InputError(f"quantities: expected a name or a function that takes a law, got {asked!r}")

    def find(law: Law, tolerance: float) -> tuple[Sequence[Estimate], str]:
        value = asked(law)
        instance(name, value, Estimate, 'Estimate(0.5, 0.0, "bound", "closed form")')
        return [value], value.verdict if isinstance(value, SpectralGap) else ""

    name = name_of(asked)
    return Quantity((name.rpartition(".")[2],), find)


def name_of(function: Callable[..., object]) -> str:
    """Module and name of a function; of another callable those of its class, or what it is printed as.

    Examples
    --------
    >>> name_of(name_of)
    'asperity.spectral.sweeps.running.name_of'
    """
    # functions have names, the user's other callables may
    name = getattr(function, "__qualname__", None)
    # without addresses, which differ from process to process
    return f"{function.__module__}.{name}" if name else re.sub(r" at 0x[0-9a-fA-F]+", "", repr(function))
