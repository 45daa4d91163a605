"""A transect of terrain
=====================

A measured profile: how a transect of real terrain reflects particles.

The elevation model is the sample that matplotlib ships, ``jacksboro_fault_dem.npz`` (the Jacksboro fault, Tennessee, in
metres; from the U.S. Geological Survey's National Elevation Dataset). One row of it is a profile that nobody made for
this purpose, 403 heights some 74 metres apart. As it is, it is nearly flat and its law nearly specular; exaggerated in
height it scatters. Between its samples the profile is a polygon, so that its law has no L^2 gap, however well the
matrix mixes: the study says so instead of quoting an artefact of the grid.
"""

# sphinx_gallery_thumbnail_path = "generated/thumbnails/measured_profile.png"

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from asperity import geometry as geo
from asperity.study import Study, study_wall

METRES_PER_DEGREE = 111_200.0


def transect(row: int = 170) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Distance along one row of the elevation model and height there, both in metres."""
    from matplotlib import cbook

    with np.load(cbook.get_sample_data("jacksboro_fault_dem.npz", asfileobj=False)) as model:
        height = np.asarray(model["elevation"], dtype=np.float64)[row]
        spacing = METRES_PER_DEGREE * float(model["dx"]) * np.cos(np.radians(float(model["ymin"])))
    return spacing * np.arange(len(height)), height


def main(row: int = 170, exaggeration: float = 3.0, tolerance: float = 1e-3, out: Path | None = None) -> Study:
    """Study the transect with its heights multiplied by ``exaggeration``; pictures go to ``out`` if it is given."""
    x, height = transect(row)
    wall = geo.Wall.from_profile(x, exaggeration * height, seam="mirror")
    report = study_wall(wall, f"terrain transect, heights x {exaggeration:g}", tolerance=tolerance)
    if out is not None:
        report.save(out, overwrite=True)
    return report


if __name__ == "__main__":
    print(main(out=Path(sys.argv[1]) if len(sys.argv) > 1 else None).summary())
