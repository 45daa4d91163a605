r"""
A disk that collides with a rough wall
======================================

A rough disk may change its spin in a collision. For fine roughness the law of the collision follows from the law of the
wall, foreshortened according to the masses of the disk.
"""

import matplotlib.pyplot as plt
import numpy as np

from asperity import geometry as geo
from asperity import kernels as ker

# %%
# A uniform disk of radius 1 and mass 1, and the wall that it meets.

disk = geo.Disk(mass=1.0, inertia_ratio=0.5)
wall = geo.focusing_arcs(half_angle=1.2)
K = ker.CollisionLaw.from_wall(wall, disk)

# %%
# The disk comes in at 45 degrees without spin: velocities along and across the wall, and angular velocity. A collision
# conserves the energy and the rolling momentum.

before = np.array([1.0, -1.0, 0.0])
after = K.sample(np.tile(before, (4000, 1)), np.random.default_rng(0))
print("largest change of the energy", abs(disk.inner(after, after) - disk.inner(before, before)).max())
print("of the rolling momentum", abs(disk.rolling_momentum(after) - disk.rolling_momentum(before)).max())

# %%
# The outgoing velocities are therefore on half an ellipse. A smooth disk and a no-slip disk have one outcome each.

fig, ax = plt.subplots(layout="constrained")
dots = ax.scatter(after[:, 0], after[:, 1], c=after[:, 2], s=6)
fig.colorbar(dots, label="spin after the collision (rad / time)")
for matrix, marker, label in (
    (ker.smooth_matrix(disk), "o", "smooth disk"),
    (ker.no_slip_matrix(disk), "s", "no-slip disk"),
):
    v1, v2, _ = matrix @ before
    ax.plot(v1, v2, marker, markersize=11, mfc="none", mec="crimson", mew=2, label=label)
ax.set(xlabel="v1 along the wall (radius / time)", ylabel="v2 away from the wall (radius / time)", ylim=(0, None))
ax.legend()
plt.show()
