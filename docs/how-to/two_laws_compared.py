r"""
Two laws compared
=================

Maxwell let a fraction of the particles leave diffusely and the others specularly. How near does his law come to that of
a rough wall?
"""

import matplotlib.pyplot as plt
import numpy as np

from asperity import kernels as ker
from asperity import spectral as spec

# %%
# The distance of the outgoing angles in radians, averaged over the incoming ones, for several diffuse fractions.

rough = ker.CircularArcLaw(half_angle=0.5)
fractions = np.array([0.0, 0.125, 0.25, 0.5, 1.0])
distances = [ker.distance(rough, ker.maxwell(a), tolerance=1e-2) for a in fractions]
best = fractions[np.argmin([float(d) for d in distances])]
print(f"nearest at {best:.3f}, at the distance {min(distances, key=float)}")

fig, ax = plt.subplots(layout="constrained")
ax.errorbar(fractions, [float(d) for d in distances], [d.error for d in distances], marker="o", capsize=3)
ax.set(xlabel="diffuse fraction of Maxwell's law", ylabel="distance (radians)", ylim=(0, None))
plt.show()

# %%
# Momentum accommodation also has a nearest Maxwell law. It compares mean velocities only.

found = spec.accommodation(rough)
print(f"fraction {found.maxwell_fraction}, misfit {found.misfit}")

# %%
# Other distances: ``kind="pseudometric"``, and ``kind="joint"`` by optimal transport, measure the weak convergence of
# the theorems on rough walls; ``kind="sup"`` is the supremum over incoming angles.

nearest = ker.maxwell(float(best))
print(ker.distance(rough, nearest, kind="pseudometric", tolerance=1e-2))
