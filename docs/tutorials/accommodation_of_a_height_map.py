r"""
From a height map to an accommodation coefficient
=================================================

A microscope has measured a map of heights. We read it, find the fraction of its tangential momentum that a gas leaves
on the surface, ask how far a patch stands for the whole, and compare with what a single line of the map would say.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec

# %%
# The file
# --------
# Heights are in nanometres at points 0.5 µm apart, with the tilt of the mount. This file is made by a program, so that
# the page can be built anywhere; put the name of yours in the place of ``path``.

rng = np.random.default_rng(5)
whole = geo.Surface.random(geo.HeightCorrelation(2.0), 128, rms_slope=0.6, period=64.0, rng=rng)
patch = whole.heights[:64, :64]
x, y = np.meshgrid(0.5 * np.arange(64), 0.5 * np.arange(64), indexing="ij")
path = Path(tempfile.mkdtemp()) / "map.txt"
np.savetxt(path, 1000.0 * (patch + 0.05 * x - 0.02 * y), fmt="%.2f")

# %%
# `read_surface` takes the tilt off and makes the map periodic by its mirror image. With slopes of 0.6 the surface is
# rough for a molecule: facets are turned by some 30 degrees.

surface = geo.read_surface(path, spacing=0.5, units=("um", "nm"))
print(surface, surface.unit)
assert 0.55 < surface.rms_slope < 0.65 and surface.unit == "um"
assert 28 < np.degrees(np.arctan(surface.rms_slope)) < 34

# %%
# Two rays on the surface, seen from above. A dot marks where a ray enters, a ring where it leaves. A ray enters on the
# plane of the highest point and hits the surface once or a few times.

surface.plot([[10.0, 12.0], [40.0, 20.0]], [[0.9, 0.5, -0.6], [-0.8, 0.2, -0.3]])
plt.show()

# %%
# The coefficient
# ---------------
# The law of velocities is that of patches of the surface in random directions, and the tangential coefficient is 1 less
# the mean fraction of the tangential momentum that is kept. For a mirror it is 0, for diffuse reflection 1.

law = ker.SurfaceLaw(surface)
degrees = [10, 30, 60, 75, 85]
found = spec.accommodation(law, tolerance=3e-3, incidence_deg=degrees)
print(f"tangential {found.tangential}, normal {found.normal}")
assert 0.5 < float(found.tangential) < 0.6 and float(found.normal) > 0.95

# %%
# The surface takes on half of the tangential momentum, and nearly all of the normal one. Maxwell's model has one
# fraction of diffuse reflection for both; the best one is near the tangential coefficient.

print(f"Maxwell's fraction {found.maxwell_fraction}")
assert float(found.tangential) < float(found.maxwell_fraction) < 0.65

# %%
# The coefficient falls from two thirds to less than a half towards grazing incidence, where molecules meet only the
# sides of the highest hills.

for angle, value, error in zip(degrees, found.tangential_at, found.tangential_errors, strict=True):
    print(f"{angle:3} degrees: {value:.3f} +- {error:.3f}")
assert abs(found.tangential_at[0] - 2 / 3) < 0.03 and found.tangential_at[-1] < 0.48

# %%
# The outgoing velocities at 60 degrees as a density over the cosine law, which would be 1 everywhere. The ring marks
# specular reflection.

law.plot([np.sin(np.pi / 3), 0.0, -np.cos(np.pi / 3)])
plt.show()

# %%
# How far is it true?
# -------------------
# The error above is that of the rays. A patch is a sample of the surface: its quarters differ by more.

quarters = np.array([float(spec.accommodation(ker.SurfaceLaw(q), 1e-2).tangential) for q in surface.quarters()])
print("quarters:", quarters.round(3), "spread", quarters.std(ddof=1).round(3))
assert np.ptp(quarters) > 3 * found.tangential.error

# %%
# Here the whole is known, and its coefficient differs from that of the patch by no more than twice the spread.

true = spec.accommodation(ker.SurfaceLaw(whole), 5e-3).tangential
print(f"patch {found.tangential}, whole surface {true}")
assert abs(float(true) - float(found.tangential)) < 2 * quarters.std(ddof=1)

# %%
# A single line of the map is a profile of grooves, which keep the velocity along them. Its coefficient is a third.

line = ker.WallLaw(geo.Wall.from_profile(geo.Profile(x[:, 0], surface.heights[:64, 20], "um")))
grooves = spec.accommodation(ker.HemisphereLaw(line), tolerance=2e-2).tangential
print(f"from a single line {grooves}")
assert 0.3 < float(grooves) / float(found.tangential) < 0.36

# %%
# For another code
# ----------------
# A simulation draws outgoing velocities from a table, whose file is described on the page on :doc:`tables </tables>`.

table = law.table(12, 13, 13, tolerance=2e-2, rng=1)
file = table.save(path.with_name("law.csv"))
print(*file.read_text().splitlines()[:4], sep="\n")
assert np.loadtxt(file, delimiter=",").shape == (1 + 12 * 12, 4 + 13)

# %%
# The coefficient must come out again, within the table's error.

radius, angle = np.sqrt(rng.random(100_000)), 2 * np.pi * rng.random(100_000)
incoming = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), -np.sqrt(1 - radius**2)])
outgoing = table.sample(incoming, rng)
tangential = 1 - 2 * np.mean(np.sum(incoming[:, :2] * outgoing[:, :2], axis=1))
print(f"tangential {tangential:.3f} from the table with the error {table.error:.3f}, {found.tangential} from the law")
assert abs(tangential - float(found.tangential)) < table.error

# %%
# On the command line ``asperity study map.txt:units=um/nm --spacing 0.5 --table law.csv`` does most of this page at
# once. Further: :doc:`the theory </theory/surfaces>`.
