"""Output of the scripts: the generated pages docs/benchmarks.md and docs/stability.md, and tables line by line."""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from pathlib import Path

from asperity.bench.run import BenchRun
from asperity.core.tables import table_lines

DOCS = Path(__file__).parents[1] / "docs"
BENCHMARKS, STABILITY, PICTURES = DOCS / "benchmarks.md", DOCS / "stability.md", DOCS / "benchmark-pictures"
END = "<!-- end -->"


def write_between_marks(page: Path, text: str, name: str = "measured") -> None:
    """Put the text where the page's marks of this name are."""
    begin = f"<!-- {name} -->"
    head, rest = page.read_text(encoding="utf-8").split(begin)
    page.write_text(f"{head}{begin}\n{text}\n{END}{rest.split(END, 1)[1]}", encoding="utf-8")


def print_table(heads: str, rows: Iterable[str | Iterable[object]]) -> None:
    """Print a table line by line, each line as soon as it is available."""
    for line in table_lines(heads, rows):
        print(line, flush=True)


def pictures(run: BenchRun, folder: Path) -> list[str]:
    """Replace the figures in the documentation by the figures of a saved run; return the lines that show them."""
    PICTURES.mkdir(exist_ok=True)
    for old in PICTURES.glob("*.png"):
        old.unlink()
    lines = []
    for scene in run.by_scene():
        name = f"{scene}.png"
        if (folder / name).exists():
            shutil.copyfile(folder / name, PICTURES / name)
            lines.append(f"![Error against run time: {scene}](benchmark-pictures/{name})")
    return lines


def with_picture(text: str, picture: Path, what: str) -> str:
    """Copy a picture into the documentation; return the text with a line that shows it, if there is one."""
    if not picture.exists():
        return text
    PICTURES.mkdir(exist_ok=True)
    shutil.copyfile(picture, PICTURES / picture.name)
    return f"{text}\n\n![{what}](benchmark-pictures/{picture.name})"
