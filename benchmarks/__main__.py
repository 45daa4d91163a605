"""Run all measurements: ``python -m benchmarks --write`` regenerates the generated pages of the documentation.

The parts are the tables of speed and goals, the standard set, the random walls, the stability report, and the savings
of the tracer; ``--peers`` adds the peers. Each part has a time limit, together 43 minutes. An interrupted run
continues in the folder ``--out``. A finished run, or a run with other options, starts again.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from asperity import __version__
from asperity.bench.run import DATA, BenchRun

from .pages import BENCHMARKS, STABILITY, pictures, with_picture, write_between_marks
from .pieces import PICTURE, SPEEDS_OF_PIECES
from .sections import SECTIONS, section_text, write_section

# File with the options of an unfinished run.
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
        if options.write and name == "peers":
            page[-1] = with_picture(page[-1], options.out / name / PICTURE, SPEEDS_OF_PIECES)
    text = "\n\n".join(page)
    print(text, stability, sep="\n\n")
    if options.write:
        write_between_marks(BENCHMARKS, text)
        write_between_marks(STABILITY, stability)
    (options.out / RUN).unlink()


def begin_or_go_on(folder: Path, quick: bool) -> None:
    """Keep the results of an interrupted run with the same options, and delete all others."""
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
