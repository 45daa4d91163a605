"""Walls for three laws
====================

Which wall reflects as Lambert's law, or as Maxwell's, and on which does a disk collide without slip half the time?

The law of a wall is the mixture of the laws of its hollows, each with the width of its opening. Polygons enough have
Lambert's law in their hull, and so a few dozen of them side by side have its first moments to rounding.
"""

# sphinx_gallery_thumbnail_path = "generated/thumbnails/a_wall_for_a_law.png"
from __future__ import annotations

import sys
from pathlib import Path

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.kernels.inverse.wall_for_law import WallForLaw

DISK = geo.Disk(1.0, 0.5)
COIN = 0.5 * ker.specular() + 0.5 * ker.retroreflection()


def main(moments: int = 10, picture: str | Path | None = None) -> dict[str, WallForLaw]:
    """A wall for each law; draws them to ``picture`` if that is given."""
    wall = ker.wall_for(ker.lambertian(), moments=moments)
    found = {
        "Lambert": wall,
        "Maxwell, one half diffuse": ker.wall_for(ker.maxwell(0.5), moments=moments),
        "a disk's fair coin of smooth and no-slip collisions": ker.collision_for(
            ker.CollisionLaw(COIN, DISK), moments=moments
        ),
    }
    if picture is not None:
        from matplotlib.figure import Figure

        figure = Figure(figsize=(8.0, 9.0), layout="constrained")
        for (name, one), axes in zip(found.items(), figure.subplots(3), strict=True):
            one.plot(axes)
            axes.set_title(f"{name}: {len(one.hollows)} hollows, defect {float(one.defect):.1g}")
        figure.savefig(picture, dpi=120)
    return found


if __name__ == "__main__":
    for name, one in main(picture=sys.argv[1] if len(sys.argv) > 1 else None).items():
        print(f"{name}: {one}; joint distance {one.distance}")
