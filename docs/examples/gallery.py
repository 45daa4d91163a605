"""Draw the pictures of docs/gallery.md: python docs/examples/gallery.py docs/gallery"""

from __future__ import annotations

import sys
from pathlib import Path

import exchange_hollow
import least_resistance
import measured_profile
import wall_for_a_law
import walls_converge

from asperity import geometry as geo
from asperity.study import PICTURES, Study, study_wall
from asperity.study.pictures import draw_gallery


def main(folder: Path, tolerance: float = 1e-3) -> dict[str, Study]:
    """Write the named walls, the least resistance, walls for laws, and two studies, which are returned."""
    folder.mkdir(parents=True, exist_ok=True)
    draw_gallery(folder / "walls.png", overwrite=True)
    least_resistance.main(picture=folder / "least-resistance.png")
    wall_for_a_law.main(picture=folder / "wall-for-a-law.png")
    walls_converge.main(picture=folder / "walls-converge.png")
    exchange_hollow.main(picture=folder / "exchange-hollow.png")
    studies = {
        "focusing-arcs": study_wall(geo.focusing_arcs(1.2), "focusing-arcs", tolerance=tolerance),
        "measured-profile": measured_profile.main(tolerance=tolerance),
    }
    for name, report in studies.items():
        paths = report.save(folder / name, overwrite=True)
        for path in paths:
            # the page shows the pictures; matrices and numbers are made again by the command above each of them
            if path.name in PICTURES:
                path.rename(folder / f"{name}-{path.name}")
            else:
                path.unlink()
        (folder / name).rmdir()
    return studies


if __name__ == "__main__":
    for report in main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/gallery")).values():
        print(report.summary(), end="\n\n")
