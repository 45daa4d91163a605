"""The two generated pages: docs/benchmarks.md and docs/stability.md, and the pictures of the first."""

from __future__ import annotations

import shutil
from pathlib import Path

from asperity.bench.run import BenchRun

DOCS = Path(__file__).parents[1] / "docs"
BENCHMARKS, STABILITY, PICTURES = DOCS / "benchmarks.md", DOCS / "stability.md", DOCS / "benchmark-pictures"
BEGIN, END = "<!-- measured -->", "<!-- end -->"


def write_between_marks(page: Path, text: str) -> None:
    """Put the text where the page's marks are."""
    head, rest = page.read_text(encoding="utf-8").split(BEGIN)
    page.write_text(f"{head}{BEGIN}\n{text}\n{END}{rest.split(END)[1]}", encoding="utf-8")


def pictures(run: BenchRun, folder: Path) -> list[str]:
    """Put the pictures of a saved run into the documentation instead of those there; the lines that show them."""
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
