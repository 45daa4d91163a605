"""Output of the scripts: tables line by line."""

from __future__ import annotations

from collections.abc import Iterable

from asperity.core.tables import table_lines


def print_table(heads: str, rows: Iterable[str | Iterable[object]]) -> None:
    """Print a table line by line, each line as soon as it is available."""
    for line in table_lines(heads, rows):
        print(line, flush=True)
