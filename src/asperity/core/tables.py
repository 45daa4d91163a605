"""Tables in Markdown."""

from __future__ import annotations

from collections.abc import Iterable, Iterator


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
