"""Run all measurements: ``python -m campaigns`` writes ``benchmarks.md`` and ``extremes.md`` into a folder.

The parts are the tables of speed and goals, the standard set, the random walls, the stability report, and the savings
of the tracer; ``--peers`` adds the peers. Each part has a time limit, together 43 minutes. Tables and pictures go to
the folder ``--out``, in which an interrupted run continues. A finished run, or a run with other options, starts again.
"""

from __future__ import annotations

import argparse
import json
from itertools import product
from pathlib import Path

from asperity import __version__

from .pieces import PICTURE, SPEEDS_OF_PIECES
from .sections import SECTIONS, section_text, write_section

# File with the options of an unfinished run.
RUN = "run.json"


def main() -> None:
    """Run all measurements, or one section of them."""
    parser = argparse.ArgumentParser(prog="python -m campaigns", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="short ladders and small cases")
    parser.add_argument("--peers", action="store_true", help="install the peers beside the rows and measure them too")
    parser.add_argument("--out", type=Path, default=Path("bench-results"), help="folder of the tables and pictures")
    parser.add_argument(
        "--section", choices=[one.name for one in SECTIONS], help="measure this part only, in this process"
    )
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    if options.section:
        write_section(options.section, options.quick, options.out)
        return
    command = " ".join(["python -m campaigns", *(f"--{name}" for name in ("quick", "peers") if getattr(options, name))])
    measured = f"Measured by `{command}`."
    begin_or_go_on(options.out, options.quick)
    texts = {
        section.name: (section.title, section_text(section, options.quick, options.out))
        for section in SECTIONS
        if options.peers or section.name != "peers"
    }
    _, stability = texts.pop("stability")
    page = [measured]
    for name, (title, text) in texts.items():
        page += [f"## {title}\n\n{text}" if title else text, *pictures(options.out, name)]
    for name, text in (("benchmarks.md", "\n\n".join(page)), ("extremes.md", f"{measured}\n\n{stability}")):
        print(text, end="\n\n")
        (options.out / name).write_text(f"{text}\n", encoding="utf-8")
    (options.out / RUN).unlink()


def pictures(folder: Path, section: str) -> list[str]:
    """The lines that show a section's pictures, which lie in its folder."""
    found = sorted((folder / section).glob("*.png"))
    words = {PICTURE: SPEEDS_OF_PIECES}
    return [f"![{words.get(p.name, f'Error against run time: {p.stem}')}]({section}/{p.name})" for p in found]


def begin_or_go_on(folder: Path, quick: bool) -> None:
    """Keep the results of an interrupted run with the same options, and delete all others."""
    this = {"quick": quick, "version": __version__}
    mark = folder / RUN
    if mark.exists() and json.loads(mark.read_text(encoding="utf-8")) == this:
        return
    stale = [folder / f"{section.name}.md" for section in SECTIONS]
    rows_and_pictures = product(SECTIONS, ("*.json", "*.png"))
    stale += [path for section, kind in rows_and_pictures for path in (folder / section.name).glob(kind)]
    for path in stale:
        path.unlink(missing_ok=True)
    mark.write_text(json.dumps(this), encoding="utf-8")


if __name__ == "__main__":
    main()
