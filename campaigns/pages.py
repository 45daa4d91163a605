"""Output of the scripts: tables line by line, and tables between the marks of a page."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from asperity.core.tables import table_lines

DOCS = Path(__file__).parents[1] / "docs"
END = "<!-- end -->"


def write_between_marks(page: Path, text: str, name: str = "measured") -> None:
    """Put the text where the page's marks of this name are."""
    begin = f"<!-- {name} -->"
    head, rest = page.read_text(encoding="utf-8").split(begin)
    page.write_text(f"{head}{begin}\n{text}\n{END}{rest.split(END, 1)[1]}", encoding="utf-8")


def print_table(heads: str, rows: Iterable[str | Iterable[object]]) -> str:
    """Print a table line by line, each line as soon as it is available; return the whole."""
    lines = []
    for line in table_lines(heads, rows):
        print(line, flush=True)
        lines.append(line)
    return "\n".join(lines)
