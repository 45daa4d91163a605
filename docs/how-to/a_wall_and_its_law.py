r"""
A wall and its law
==================

Particles fall on a wall of circular arcs. At what angles do they leave?
"""

import matplotlib.pyplot as plt
import numpy as np

from asperity import geometry as geo
from asperity import kernels as ker

# %%
# The wall has period 1 and lies below :math:`y = 0`. The half angle of the arcs is the slope angle at their ends. A dot
# marks where a ray enters, a ring where it leaves.

wall = geo.focusing_arcs(half_angle=1.2)
geo.draw_wall(wall, x=[0.2, 0.5, 0.7], theta=[1.0, 1.9, 0.7])
plt.show()

# %%
# If the entry point is uniform on a period, the outgoing angle is random. Its law is a value that can be sampled. Equal
# angles in and out mean that the particle returns where it came from.

law = ker.WallLaw(wall)
outgoing = law.sample(np.full(5, 1.0), np.random.default_rng(0))
print(outgoing.round(3))

# %%
# The matrix of the law on 64 intervals of angles, with its error. The picture is its density with respect to
# :math:`\tfrac12 \sin\theta\,d\theta`. It is symmetric, because the wall is reversible.

P = ker.discretise(law, ker.Bins(64))
print(P.error)
P.plot()
plt.show()
