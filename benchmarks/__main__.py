"""Everything that is measured, in one run: ``python -m benchmarks --write`` regenerates the pages of the documentation.

The tables of speed and of the goals, the standard set and the random walls, the stability report, and what scenes
leave out; with ``--peers`` the peers too. Every part has its time, together 39 minutes. A run that was stopped goes on
where it was, in the folder ``--out``; one that was finished, or was made with other options, begins anew.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from asperity import __version__
from asperity.bench.run import DATA, BenchRun

from .pages import BENCHMARKS, STABILITY, pictures, write_between_marks
from .sections import SECTIONS, section_text, write_section

# What a folder says of the run that it belongs to, until that run is finished.
RUN = "run.json"


def main() -> None:
    """Run all measurements, or one section of them."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="short ladders and small cases")
    parser.add_argument("--peers", action="store_true", help="install the peers beside the rows and measure them too")
    parser.add_argument("--write", action="store_true", help="put the tables and pictures into docs/")
    parser.add_argument("--out", type=Path, default=Path("bench-results"), help="folder of the rows and pictures")
    parser.add_argument(
        "--section", choices=[one.name for one in SECTIONS], help="measure this part only, in this process"
    )
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    if options.section:
        write_section(options.section, options.quick, options.out)
        return
    flags = [f"--{name}" for name in ("quick", "peers", "write") if getattr(options, name)]
    command = " ".join(["python -m benchmarks", *flags])
    begin_or_go_on(options.out, options.quick)
    texts = {
        section.name: (section.title, section_text(section, options.quick, options.out))
        for section in SECTIONS
        if options.peers or section.name != "peers"
    }
    _, stability = texts.pop("stability")
    stability = f"Measured by `{command}`.\n\n{stability}"
    page = [f"Measured by `{command}`."]
    for name, (title, text) in texts.items():
        page += [f"## {title}\n\n{text}" if title else text]
        data = options.out / name / DATA
        if options.write and name == "standard" and data.exists():
            run = BenchRun.of_json(data.read_text(encoding="utf-8"))
            page += ["### Pictures", *pictures(run, options.out / name)]
    text = "\n\n".join(page)
    print(text, stability, sep="\n\n")
    if options.write:
        write_between_marks(BENCHMARKS, text)
        write_between_marks(STABILITY, stability)
    (options.out / RUN).unlink()


def begin_or_go_on(folder: Path, quick: bool) -> None:
    """Keep what an interrupted run with the same options left, and nothing else."""
    this = {"quick": quick, "version": __version__}
    mark = folder / RUN
    if mark.exists() and json.loads(mark.read_text(encoding="utf-8")) == this:
        return
    stale = [folder / f"{section.name}.md" for section in SECTIONS]
    stale += [path for section in SECTIONS for path in (folder / section.name).glob("*.json")]
    for path in stale:
        path.unlink(missing_ok=True)
    mark.write_text(json.dumps(this), encoding="utf-8")


if __name__ == "__main__":
    main()
