r"""
For a gas physicist: a gas over a measured surface
==================================================

A profile of a ground metal plate is measured. The gas is so dilute that its molecules meet the surface, not each other.
From the file we get the accommodation of momentum by angle, the flow through a channel of such plates, and a table for
a simulation code.
"""

# sphinx_gallery_thumbnail_path = "generated/thumbnails/measured_profile.png"

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec

# %%
# A file of the instrument
# ------------------------
# Positions are in micrometres, heights in nanometres. The plate was mounted with a tilt of about 2 mrad, and two points
# have no height. This file is made by a program, so that the page can be built anywhere; put the name of yours in the
# place of ``path``.

rng = np.random.default_rng(7)
x = np.arange(0.0, 120.0, 0.5)
grain = np.exp(-(np.abs(np.linspace(-3, 3, 13)) ** 1.5))
rough = np.convolve(rng.standard_normal(x.size + grain.size - 1), grain, mode="valid")
height = 600.0 * rough / rough.std() + 2.0 * x
height[[60, 61]] = np.nan
path = Path(tempfile.mkdtemp()) / "plate.txt"
np.savetxt(path, np.column_stack([x, height]), fmt="%.3f", delimiter=", ", header="x [um], height [nm]", comments="")
print(*path.read_text().splitlines()[:4], sep="\n")

# %%
# Reading it
# ----------
# `read_profile` honours the units of the header. The tilt and the undefined points are for you to decide about; each
# decision is a method with a name. The page :doc:`/generated/how-to/a_measured_profile` is about other formats.

raw = geo.read_profile(path)
profile = raw.interpolated().detrended()
print(f"{raw.undefined} undefined heights; both columns in {profile.unit}")
assert raw.undefined == 2 and profile.unit == "um"

# %%
# The wall is the polygon through the points, followed by its mirror image, so that it is periodic. Its heights are a
# hundredth of its length, so the upper picture is stretched. The lower picture shows 24 micrometres in their true
# shape. With slopes near 1/2 the plate is rough for a molecule.

wall = geo.Wall.from_profile(profile)
slope = np.sqrt(spec.mean_squared_slope(wall))
print(f"rms height {profile.height.std():.2f} um, rms slope {slope:.2f}, period {wall.period:g} um")
assert 0.5 < profile.height.std() < 0.7 and 0.3 < slope < 0.7
rays = {"x": [85.0, 92.0, 96.0], "theta": [1.2, 2.0, 1.0]}
fig, (above, below) = plt.subplots(2, 1, layout="constrained", figsize=(9, 6), height_ratios=(3, 2))
geo.draw_wall(wall, ax=above)
geo.draw_wall(wall, **rays, ax=below).set(aspect=1, xlim=(78, 102), ylim=(-4, 3), ylabel="y (um)")
plt.show()

# %%
# Where a molecule goes
# ---------------------
# Angles are measured from the surface in the library, and from the normal in this field; functions for the field take
# ``incidence_deg``. How many bounces does a molecule make before it leaves? About one of nine bounces twice when it
# comes steeply; a grazing one only meets the flanks of the highest grains.

incidence = [0, 30, 60, 75, 85]
shares = np.array([[float(share) for share in row] for row in spec.bounce_shares(wall, incidence, most=3)])
print("degrees   once  twice  three  more")
for angle, row in zip(incidence, shares, strict=True):
    print(f"{angle:7}", *(f"{share:6.3f}" for share in row))
assert np.allclose(shares.sum(axis=1), 1.0, atol=1e-6) and 1 / 10 < shares[0, 1] < 1 / 8 and shares[-1, 0] > 0.95

# %%
# The law of the outgoing angle for every incoming angle, as a density. A mirror would be the dotted line alone. The
# plate scatters about it so broadly that most of the square is filled. The bright lines parallel to it are the slopes
# that occur most often in this profile.

law = ker.WallLaw(wall)
P = ker.discretise(law, ker.Bins(48), tolerance=1e-2)
P.plot()
plt.show()

# %%
# Accommodation
# -------------
# What fraction of its tangential and of its normal momentum does a molecule leave at the surface? The averages belong
# to slow flows. In Maxwell's model a fraction :math:`f` of the molecules is reflected diffusely and the others as by a
# mirror, and both coefficients are :math:`f`. Here they differ. The best :math:`f` is between them, and the misfit says
# how far the mean reflected velocities of the model are off, in units of the speed.

found = spec.accommodation(law, tolerance=1e-2)
print(f"tangential {found.tangential}, normal {found.normal}")
print(f"Maxwell's fraction {found.maxwell_fraction}, misfit {found.misfit}")
fraction = float(found.maxwell_fraction)
assert float(found.tangential) < fraction < float(found.normal)

# %%
# A single fraction is not the whole truth. In Maxwell's model it is the same at every angle. The plate accommodates
# less of the tangential momentum of grazing molecules, which are those that carry the flow in a long channel.

degrees = np.array([5, 15, 25, 35, 45, 55, 65, 75, 85])
by_angle = spec.accommodation(law, tolerance=1e-2, incidence_deg=degrees)
fig, ax = plt.subplots(layout="constrained")
ax.errorbar(degrees, by_angle.tangential_at, by_angle.tangential_errors, marker="o", capsize=3, label="tangential")
ax.errorbar(degrees, by_angle.maxwell_fraction_at, by_angle.maxwell_fraction_errors, marker="s", capsize=3,
            label="Maxwell fraction that fits best")  # fmt: skip
ax.axhline(fraction, color="0.5", linestyle="--", label="the same, for all angles together")
ax.set(xlabel="incidence (degrees from the normal)", ylabel="fraction", ylim=(0, None))
ax.legend()
plt.show()
assert by_angle.tangential_at[0] > 0.8 and by_angle.tangential_at[-1] < 0.65

# %%
# How far does the result depend on the instrument? A coarser sampling misses the steep parts. Every second point of the
# profile gives a smoother wall, and less accommodation.

coarse = geo.Wall.from_profile(geo.Profile(profile.x[::2], profile.height[::2], profile.unit))
less = spec.accommodation(ker.WallLaw(coarse), tolerance=1e-2)
print(f"tangential {found.tangential} at 0.5 um, {less.tangential} at 1 um")
assert float(less.tangential) < float(found.tangential)

# %%
# In space
# --------
# The profile was taken across the grooves of the grinding. A molecule keeps its velocity along the grooves. If patches
# of grooves have random directions, the plate accommodates half of what the section does, for each tangential
# direction.

space = spec.accommodation(ker.HemisphereLaw(law), tolerance=1e-2)
print(f"tangential in space {space.tangential}")
assert abs(2 * float(space.tangential) - float(found.tangential)) < 0.05

# %%
# Does the planar theory apply to an isotropic surface?
# -----------------------------------------------------
# No, it applies to grooves. On a surface that is rough in two directions a molecule leaves the plane of a profile, so
# that the law, its gap and directions are those of a :doc:`height map </theory/surfaces>`. The tangential coefficient
# alone is nearly right, that of the plane and not half of it: a profile has half of the mean squared slope of the
# surface, and grooves act on one of two components. A random surface with a slope of 0.4 shows it, by its profiles
# along x and y.

surface = geo.Surface.random(geo.HeightCorrelation(0.06), 64, rms_slope=0.4, rng=1)
whole = spec.accommodation(ker.SurfaceLaw(surface), tolerance=1e-2)
profiles = [*surface.heights[::8], *surface.heights.T[::8]]
walls = [geo.Wall.from_profile(geo.Profile(np.arange(64) / 64, line, "um")) for line in profiles]
planar = [spec.accommodation(ker.WallLaw(one), tolerance=1e-2) for one in walls]
along, across = (np.array([float(getattr(one, name)) for one in planar]) for name in ("tangential", "normal"))
print(f"tangential {whole.tangential}, of {len(walls)} profiles {along.mean():.2f}, spread {along.std():.2f}")
print(f"normal {whole.normal}, of {len(walls)} profiles {across.mean():.2f}, spread {across.std():.2f}")
assert 0.9 < along.mean() / float(whole.tangential) < 1.1 and 0.75 < across.mean() / float(whole.normal) < 0.92

# %%
# Over four such surfaces, and 32 profiles of each, the mean tangential coefficient of the profiles is that of the
# surface to 5 % at a slope of 0.1, 4 % above it at 0.4 and 9 % at 0.8. The normal one is a quarter too small at 0.1, a
# sixth at 0.4, and right at 0.8. One profile alone is off by a fifth to a third.

# %%
# A channel
# ---------
# Two such plates make a channel of ten widths, with grooves across. What fraction of the molecules that enter leaves at
# the other end? Diffuse walls are the usual assumption. For them the integral equation is solved to all digits.

diffuse = spec.transmission(ker.lambertian(), 10.0)
maxwell = spec.transmission(ker.maxwell(fraction), 10.0)
plate = spec.transmission(law, 10.0, tolerance=5e-3, rng=1)
print("diffuse", diffuse)
print("Maxwell", maxwell)
print("plate  ", plate)
assert abs(float(diffuse) - 0.24056) < 1e-5 and 1.2 < float(plate) / float(diffuse) < 1.35
assert 0.02 < 1 - float(maxwell) / float(plate) < 0.08

# %%
# The plate passes a quarter more than a diffuse channel, and Maxwell's model with the best fraction is nearly right. It
# falls short by some percent: at grazing angles its fraction is too large. The same for several lengths:

lengths = np.array([1.0, 2.0, 5.0, 10.0, 20.0])
fig, ax = plt.subplots(layout="constrained")
for name, part, style in (("diffuse", 1.0, "o-"), (f"Maxwell, {fraction:.0%} diffuse", fraction, "^-")):
    model = [float(spec.transmission(ker.maxwell(part), length)) for length in lengths]
    ax.plot(lengths, model, style, label=name)
passing = [spec.transmission(law, length, tolerance=1e-2, rng=1) for length in lengths]
ax.errorbar(lengths, [*map(float, passing)], [one.error for one in passing], fmt="s-", capsize=3, label="plate")
ax.set(xscale="log", xlabel="length / width of the channel", ylabel="fraction that passes", ylim=(0, 1))
ax.set_xticks(lengths, labels=[f"{length:g}" for length in lengths])
ax.minorticks_off()
ax.legend()
plt.show()

# %%
# As a flow: nitrogen at room temperature has the mean speed 470 m/s. Through a slit of 0.2 mm by 10 mm and 2 mm length
# the conductance is, in litres per second:

conductance = [1000 * 0.2e-3 * 10e-3 * 470 / 4 * float(one) for one in (diffuse, maxwell, plate)]
print("diffuse {:.4f} l/s, Maxwell {:.4f} l/s, plate {:.4f} l/s".format(*conductance))

# %%
# A table for your code
# ---------------------
# A simulation draws outgoing angles from a table of quantiles: for each incoming angle the outgoing angles at equally
# spaced probabilities. The page :doc:`/generated/how-to/a_table_for_dsmc` says how large it should be, the page on
# :doc:`tables </tables>` has samplers in C++ and Fortran.

table = law.table(32, 33, 1e-2)
file = table.save(path.with_name("plate.csv"))
print(*(line for line in file.read_text().splitlines()[1:6]), sep="\n")
print(f"mean error of an angle {table.error:.3f} rad")

# %%
# Your code reads it in one line. It should pass two tests. Molecules that come with the cosine law must leave with it,
# whatever the surface; and the tangential accommodation must come out again.

quantile = np.loadtxt(file, delimiter=",")[1:, 1:]


def reflect(theta, rng):
    """Bilinear interpolation in the table."""
    n_in, n_out = quantile.shape
    row, column = theta * n_in / np.pi - 0.5, rng.random(theta.shape) * (n_out - 1)
    i, j = np.clip(row.astype(int), 0, n_in - 2), np.clip(column.astype(int), 0, n_out - 2)
    s, t = row - i, column - j
    low = (1 - t) * quantile[i, j] + t * quantile[i, j + 1]
    high = (1 - t) * quantile[i + 1, j] + t * quantile[i + 1, j + 1]
    return np.clip((1 - s) * low + s * high, 1e-12, np.pi - 1e-12)


incoming = np.arccos(rng.uniform(-1, 1, 200_000))
outgoing = reflect(incoming, rng)
tangential = 1 + 3 * np.mean(np.cos(incoming) * np.cos(outgoing))
print(f"mean square of the cosine {np.mean(np.cos(outgoing) ** 2):.4f}, to be 1/3")
print(f"tangential accommodation {tangential:.3f} from the table, {found.tangential} from the law")
assert abs(np.mean(np.cos(outgoing) ** 2) - 1 / 3) < 0.01
assert abs(tangential - float(found.tangential)) < 0.03

# %%
# Further: :doc:`/generated/how-to/a_gas_channel` and :doc:`/generated/how-to/a_tube`, diffusion in long channels in
# :doc:`/generated/how-to/knudsen_diffusion`, and the :doc:`command line </command-line>`, where ``asperity study
# plate.txt --incidence 0,30,60 --table plate.csv`` does most of this page at once.
