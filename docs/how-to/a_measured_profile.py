r"""
A measured profile
==================

From a file with two columns to the law of the measured surface.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec

# %%
# A file as an instrument writes it: positions in micrometres, heights in nanometres. Here it contains a random profile
# with a correlation length of about 2 µm and a standard deviation of 0.3 µm.

rng = np.random.default_rng(1)
x = np.arange(0.0, 40.0, 0.4)
noise = rng.standard_normal(len(x))
height = np.convolve(noise, np.exp(-(np.linspace(-2, 2, 11) ** 2)), mode="same")
height *= 300.0 / height.std()
path = Path(tempfile.mkdtemp()) / "profile.txt"
np.savetxt(path, np.column_stack([x, height]), fmt="%.6f", delimiter=", ", header="x [um], height [nm]", comments="")

# %%
# The units in the header are honoured. The profile becomes periodic by its mirror image.

profile = geo.read_profile(path)
wall = geo.Wall.from_profile(profile)
print(f"period {wall.period:g} {profile.unit}, depth {wall.depth:.3g} {profile.unit}")
geo.draw_wall(wall, x=[15.0, 42.0, 68.0], theta=[1.2, 2.0, 0.9])
plt.show()

# %%
# The law of the wall, and the fraction of the tangential and of the normal momentum that the surface takes on. The wall
# consists of straight pieces, so its law has no spectral gap; accommodation needs none.

law = ker.WallLaw(wall)
found = spec.accommodation(law, tolerance=1e-2)
print(f"tangential {found.tangential}, normal {found.normal}")

P = ker.discretise(law, ker.Bins(48), tolerance=1e-2)
P.plot()
plt.show()
