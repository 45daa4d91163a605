r"""
A surface rough in two directions
=================================

From a measured height map to the momentum that a gas leaves on the surface, and to the directions in which molecules
leave it.
"""

# sphinx_gallery_thumbnail_path = "generated/thumbnails/a_measured_surface.png"

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec

# %%
# A map as a microscope writes it: a matrix of heights in nanometres, at points 0.5 µm apart, with a tilt and a few
# undefined heights. Here it is a patch of a random surface.

rng = np.random.default_rng(1)
patch = geo.Surface.random(geo.HeightCorrelation(4.0), 96, rms_slope=0.5, period=48.0, rng=rng).heights[:64, :56]
x, y = np.meshgrid(*(0.5 * np.arange(n) for n in patch.shape), indexing="ij")
measured = 1000.0 * (patch + 0.02 * x - 0.01 * y)
measured[rng.random(patch.shape) < 0.01] = np.nan
path = Path(tempfile.mkdtemp()) / "map.txt"
np.savetxt(path, measured, fmt="%.3f")

# %%
# The tilt is taken off, undefined heights are interpolated, and the mirror image makes the map periodic. A ray enters
# on the plane of the highest point.

surface = geo.read_surface(path, spacing=0.5, units=("um", "nm"))
print(surface, f"rms height {surface.rms_height:.3g} {surface.unit}")
surface.plot([[20.0, 20.0], [45.0, 30.0]], [[0.5, 0.6, -0.6], [-0.8, 0.2, -0.3]])
plt.show()

# %%
# The law of velocities at a random orientation of the patch, and the fractions of tangential and of normal momentum
# that it takes on. Near grazing incidence the tangential one falls.

law = ker.SurfaceLaw(surface)
incidence = [0, 20, 40, 60, 80]
found = spec.accommodation(law, tolerance=3e-3, incidence_deg=incidence)
print(f"tangential {found.tangential}, normal {found.normal}")
fig, ax = plt.subplots(layout="constrained")
ax.errorbar(incidence, found.tangential_at, found.tangential_errors, marker="o", label="tangential")
ax.errorbar(incidence, found.normal_at, found.normal_errors, marker="s", label="normal")
ax.set_xlabel("incidence (degrees from the normal)")
ax.set_ylabel("accommodation")
ax.legend()
plt.show()

# %%
# These errors are those of the rays. The patch is a sample of the surface, and its quarters differ by more.

quarters = [spec.accommodation(ker.SurfaceLaw(one), tolerance=1e-2).tangential for one in surface.quarters()]
print("tangential, of the quarters:", *quarters)

# %%
# Molecules that come at 60 degrees, and the tangential velocities with which they leave, which are even on the disc
# where all is forgotten. The ring marks mirror reflection.

ax = law.plot([np.sin(np.pi / 3), 0.0, -np.cos(np.pi / 3)])
plt.show()

# %%
# The spectral gap, the fraction of what is not yet forgotten that each collision takes away at least.

print(gap := spec.spectral_gap(law, tolerance=1e-2), gap.verdict)
