r"""
Retroreflectors
===============

Four hollows that send nearly every ray back where it came from, and how far each is from retroreflection.
"""

# sphinx_gallery_thumbnail_path = "generated/thumbnails/retroreflectors.png"

import matplotlib.pyplot as plt

from asperity import geometry as geo
from asperity import kernels as ker

# %%
# The distance is the mean of :math:`|\theta' - \theta|` over rays. The helmet has no parameter; the other three tend
# to retroreflection in limits of theirs. The mushroom is far from it here, because it stands between flat tops.

walls = {
    "mushroom": geo.mushrooms(0.3, 0.05),
    "helmet": geo.double_parabola(),
    "notched angle": geo.notched_angle(0.6, 12),
    "tube": geo.tube(4, 0.2, 0.4),
}
for name, wall in walls.items():
    print(f"{name:14} {ker.retroreflection_distance(wall, rng=0)}")
for notches in (20, 200, 2000):
    print(notches, "notches", ker.retroreflection_distance(geo.notched_angle(0.05, notches), rng=0))

# %%
# A ray in each. In the notched angle and the tube it leaves beside its point of entry.

fig, axes = plt.subplots(1, 4, layout="constrained", figsize=(11, 4))
for ax, (name, wall) in zip(axes, walls.items(), strict=True):
    geo.draw_wall(wall, 0.53, 1.1, ax=ax)
    ax.set(title=name, xlabel="x (periods)", xticks=[0.0, 0.5, 1.0])
plt.show()
