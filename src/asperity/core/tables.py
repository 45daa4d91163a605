"""Tables in Markdown, CSV and as data frames, arrays with coordinates, axes of pictures and text shown as it is."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any

from .checks import instance
from .errors import InputError

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def table_lines(heads: str, rows: Iterable[str | Iterable[object]]) -> Iterator[str]:
    """The lines of a table, each as soon as its row is there; cells are listed, or joined by bars already.

    Examples
    --------
    >>> print(*table_lines("wall | bounces", ["teeth | 2.9", ("arc", 1)]), sep="\\n")
    | wall | bounces |
    |---|---|
    | teeth | 2.9 |
    | arc | 1 |
    """
    yield f"| {heads} |"
    yield "|" + "---|" * len(heads.split(" | "))
    for cells in rows:
        yield f"| {cells if isinstance(cells, str) else ' | '.join(map(str, cells))} |"


def table(heads: str, rows: Iterable[str | Iterable[object]]) -> str:
    """The whole table as one text; see `table_lines`."""
    return "\n".join(table_lines(heads, rows))


def numbers_as_csv(comments: Iterable[str], rows: Iterable[Sequence[float]]) -> str:
    """Lines of numbers, each as short as it is exact, below comments that begin with #.

    Examples
    --------
    >>> numbers_as_csv(["radians"], [[0.1, 1.0]])
    '# radians\\n0.1,1.0\\n'
    """
    lines = [f"# {' '.join(comment.split())}" for comment in comments]
    return "\n".join([*lines, *(",".join(map(repr, row)) for row in rows), ""])


def axes_or_new(ax: Axes | None, **figure: Any) -> Axes:
    """The axes of matplotlib that a user gives, or those of a new figure."""
    from matplotlib import axes, pyplot

    if ax is None:
        return pyplot.figure(layout="constrained", **figure).subplots()
    instance("ax", ax, axes.Axes, "matplotlib.pyplot.subplots()[1]")
    return ax


def verbatim(text: str) -> str:
    r"""Text of a user for matplotlib, which shows it letter by letter: nothing in it is a formula.

    Examples
    --------
    >>> print(verbatim(r"load $\frac{$"))
    load \$\frac{\$
    """
    # fonts have no letters for halves of surrogate pairs
    return text.encode("utf-8", "replace").decode().replace("$", r"\$")


def needed(library: str, method: str, extra: str = "studies") -> Any:
    """The module of an extra that a method needs.

    Raises
    ------
    InputError
        If it is not installed.
    """
    try:
        return import_module(library)
    except ImportError as reason:
        raise InputError(f"{method}: needs {library}; install it with: pip install 'asperity[{extra}]'") from reason


def data_frame(columns: Mapping[str, Any]) -> Any:
    """A pandas.DataFrame of named columns; an InputError if pandas is not installed."""
    return needed("pandas", "to_frame").DataFrame(dict(columns))


def data_array(values: Any, **described: Any) -> Any:
    """An xarray.DataArray, with its dimensions, coordinates, name and attributes; an InputError without xarray."""
    return needed("xarray", "to_xarray").DataArray(values, **described)
