r"""
For a granular engineer: rough disks
====================================

Grains in a simulation are smooth disks with a coefficient of friction, or they have a tangential restitution. What does
a rim with real teeth do? Disks hit a plate, disks hit each other, and a box of disks finds its balance between
translation and spin.
"""

# sphinx_gallery_thumbnail_path = "generated/thumbnails/rough_disks.png"

import matplotlib.pyplot as plt
import numpy as np

from asperity import Estimate
from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec

# %%
# The disk and the plate
# ----------------------
# A steel rod, 10 mm long, with a radius of 5 mm, moves in the plane of its section, in SI units. Its laws depend on
# :math:`J/(m r^2)`, which is 1/2 for a uniform disk. Velocities are those of the centre and, for the spin, that of the
# rim, :math:`r\omega`, all in m/s, and energies are in joules.

radius, density, length = 5e-3, 7800.0, 10e-3  # m, kg/m^3, m
mass = density * np.pi * radius**2 * length  # kg
disk = geo.Disk(mass, inertia_ratio=0.5, radius=radius)  # kg, no unit, m
print(f"mass {1e3 * mass:.2f} g, inertia {disk.inertia:.3g} kg m^2")

# %%
# The roughness is fine: bumps much smaller than the disk. Only its shape counts, not its size. Here a plate has round
# bumps, one for each period. What the disk feels is a steeper wall, by the factor :math:`\sqrt{1 + m/J}`, because a
# push at the rim also turns the disk.

plate = geo.dispersing_arcs(curvature=1.0)
felt = plate.foreshorten(disk)
fig, axes = plt.subplots(1, 2, layout="constrained", figsize=(9, 2.2))
for ax, wall, title in zip(axes, (plate, felt), ("the plate", "what the disk feels"), strict=True):
    geo.draw_wall(wall, ax=ax).set(title=title, ylim=(-0.3, 0.1))
plt.show()
print(f"foreshortening {disk.foreshortening:.4f}")

# %%
# One collision
# -------------
# The law of the collision draws the velocity after it: along the plate, away from it, and of the rim by the spin. Every
# draw conserves the energy, and the momentum about the point of contact.

K = ker.CollisionLaw.from_wall(plate, disk)
speed = 1.0  # m/s
before = speed * np.array([np.sin(np.pi / 4), -np.cos(np.pi / 4), 0.0])
after = K.sample(np.tile(before, (20_000, 1)), rng=0)
change = disk.inner(after, after) / disk.inner(before, before) - 1
print("mean velocity after", after.mean(axis=0).round(4), "m/s")
print(f"largest change of the energy {abs(change).max():.1e} of it")
assert abs(change).max() < 1e-12
assert np.allclose(disk.rolling_momentum(after), disk.rolling_momentum(before), rtol=1e-10)

# %%
# The disk came at 45 degrees without spin. Its velocities are on half an ellipse, of which
# :doc:`/generated/how-to/a_disk` has a picture. Here is the spin that it gets, with those of a smooth and of a no-slip
# disk, which leave in one way only.

fig, ax = plt.subplots(layout="constrained")
ax.hist(after[:, 2], bins=80, density=True, color="0.7", label="rough plate")
for name, matrix, style in (("smooth", ker.smooth_matrix(disk), "-"), ("no-slip", ker.no_slip_matrix(disk), "--")):
    ax.axvline((matrix @ before)[2], color="C0" if name == "smooth" else "C1", linestyle=style, label=name)
ax.set(xlabel="velocity of the rim after the collision (m/s)", ylabel="probability density (s/m)")
ax.legend()
plt.show()

# %%
# Where the energy goes
# ---------------------
# A disk without spin comes at several angles from the normal. What part of its energy is in the spin afterwards? A
# smooth plate turns nothing into spin. A no-slip plate reverses the velocity of the contact: the flatter the impact,
# the more spin. Round bumps also turn disks that come straight down.

degrees = np.arange(0.0, 90.0, 7.5)
angle = np.radians(np.repeat(degrees[:, None], 4000, axis=1))
incoming = np.stack([np.sin(angle), -np.cos(angle), 0.0 * angle], axis=-1)
laws = {"round bumps": K, "no-slip": ker.no_slip(disk), "smooth": ker.smooth(disk)}
spin, energy = {}, disk.inner(incoming, incoming)
fig, ax = plt.subplots(layout="constrained")
for (name, law), style in zip(laws.items(), ("o-", "s--", "^:"), strict=True):
    after = law.sample(incoming, rng=1)
    spin[name] = (disk.rim_mass * after[..., 2] ** 2 / energy).mean(axis=1)
    ax.plot(degrees, spin[name], style, label=name)
ax.set(xlabel="angle of impact (degrees from the normal)", ylabel="part of the energy in the spin", ylim=(0, None))
ax.legend()
plt.show()
assert spin["round bumps"][0] > 0.05 and spin["no-slip"][0] < 1e-12 and spin["smooth"].max() < 1e-12

# %%
# The limit
# ---------
# The law is that of infinitely fine bumps. How fine is fine? A true disk has points on its rim, hits a plate with bumps
# of a given size, turns, and may hit it several times. With bumps of a thousandth of the radius its mean velocities
# agree with the law within the spread of 4000 collisions.

true = ker.SatelliteLaw(plate, disk, 1e-3)
found = true.sample(np.tile(before, (4000, 1)), rng=2)
limit = K.sample(np.tile(before, (200_000, 1)), rng=3)
spread = 1.96 * found.std(axis=0) / np.sqrt(len(found))
sampled = zip(found.mean(axis=0), spread, strict=True)
print("true disk", *(Estimate(*pair, "estimate", "4000 collisions") for pair in sampled))
print("law      ", limit.mean(axis=0).round(3))
assert np.all(abs(found.mean(axis=0) - limit.mean(axis=0)) < 2 * spread)

# %%
# Two disks
# ---------
# Two equal disks behave like one reduced disk of half the mass and half the inertia at a wall. A collision conserves
# momentum, angular momentum and energy. The first disk comes from above at 45 degrees, the second one is at rest.

pair = ker.PairLaw.from_wall(plate, disk, disk)
one, two = pair.sample([0.0, 1.0], [1.0, -1.0, 0.0], [0.0, 0.0, 0.0], rng=0)
print("after one collision", one.round(3), two.round(3))
assert np.allclose(mass * (one + two)[:2], mass * np.array([1.0, -1.0]))
assert np.isclose(disk.inner(one, one) + disk.inner(two, two), 2 * mass)

# %%
# Restitution by angle
# --------------------
# At the contact the surfaces have a normal and a tangential relative velocity. The coefficients of restitution are
# minus the ratios of these after and before. Codes take constants: for smooth disks 1 and -1, for no-slip disks 1 and
# 1. For rough ones both are random, and their means depend on the angle. The page
# :doc:`/generated/how-to/a_granular_collision` draws their spread.


def contact(first, second):
    """Tangential and normal relative velocity of the surfaces, the first disk above the second."""
    return first[..., 0] - second[..., 0] + first[..., 2] + second[..., 2], first[..., 1] - second[..., 1]


oblique = degrees[2:]
moving = incoming[2:]
normal, rest = np.broadcast_to([0.0, 1.0], (*moving.shape[:2], 2)), np.zeros_like(moving)
restitution = {}
fig, axes = plt.subplots(1, 2, layout="constrained", figsize=(10, 4), sharex=True)
for name, wall in (("round bumps, K = 1", plate), ("flatter bumps, K = 1/3", geo.dispersing_arcs(1 / 3))):
    after = ker.PairLaw.from_wall(wall, disk, disk).sample(normal, moving, rest, rng=0)
    restitution[name] = [(-v / u).mean(axis=1) for v, u in zip(contact(*after), contact(moving, rest), strict=True)]
    for ax, values in zip(axes, restitution[name], strict=True):
        ax.plot(oblique, values, "o-", label=name)
for ax, title in zip(axes, ("tangential", "normal"), strict=True):
    ax.set(xlabel="angle of impact (degrees from the normal)", ylabel=f"mean {title} restitution")
axes[0].axhline(-1.0, color="0.5", linestyle=":", label="smooth")
axes[0].axhline(1.0, color="0.5", linestyle="--", label="no-slip")
axes[0].legend()
plt.show()
assert restitution["flatter bumps, K = 1/3"][0][3] < restitution["round bumps, K = 1"][0][3] < 1

# %%
# The same numbers as a table, for a code with a tangential restitution that depends on the angle:

print("degrees   tangential  normal")
for row in zip(oblique, *restitution["round bumps, K = 1"], strict=True):
    print("{:7.1f}   {:10.3f}  {:6.3f}".format(*row))

# %%
# A box of disks
# --------------
# Now the question of a granular gas: how is the energy shared between translation and spin? Two hundred disks begin
# without spin in a box with smooth walls, of which they cover a fifth. No collision loses energy. In two dimensions a
# disk has two directions of translation and one of rotation, so equipartition means that a third of the energy is in
# the spin. Velocities are again :math:`(v_1, v_2, r\omega)`, all in m/s.

number, across = 200, 20
seat = radius * np.sqrt(np.pi / 0.2)  # m, the side of a square of which a disk covers a fifth
places = seat * (np.stack(np.divmod(np.arange(number), across), axis=-1) + 0.5)
room = geo.Container.polygon(seat * np.array([(0, 0), (number // across, 0), (number // across, across), (0, across)]))
rims = {
    "round bumps, K = 1": pair,
    "flatter bumps, K = 1/3": ker.PairLaw.from_wall(geo.dispersing_arcs(1 / 3), disk),
    "smooth": ker.PairLaw(ker.specular(), disk),
}


def play(rim, events, seed, **kept):
    velocity = np.random.default_rng(seed).standard_normal((number, 3)) * [1.0, 1.0, 0.0]  # m/s
    return ker.play_gas(room, rim, places, velocity, events, rng=seed, **kept)


# %%
# The first collisions: eight gases for each rim, with states that are stored every 5 ms. The points are means of the
# eight, the bars their errors of 95 %, 2.36 standard errors by Student's distribution.

step, shown, starts = 5e-3, 50, 8  # s, states, gases
times = 1e3 * step * np.arange(shown)  # ms
begun = {}
fig, ax = plt.subplots(layout="constrained")
for name, rim in rims.items():
    gases = [play(rim, 4500, seed, interval=step) for seed in range(starts)]
    part = np.array([(gas.rotational_energy / gas.energy.sum(axis=1))[:shown] for gas in gases])
    begun[name] = part.mean(axis=0)
    ax.errorbar(times, begun[name], 2.36 * part.std(axis=0, ddof=1) / starts**0.5, fmt=".", elinewidth=0.8, label=name)
ax.axhline(1 / 3, color="0.4", linestyle="--", linewidth=0.8, label="a third")
ax.set(xlabel="time (ms)", ylabel="part of the energy in the spin")
ax.legend(loc="center right")
plt.show()

# %%
# Rough disks find equipartition, bumps of curvature 1 within 60 ms, flatter ones in some 200 ms. Smooth disks never
# spin.

round_bumps, flatter, smooth = begun.values()
assert flatter[12] < 0.2 and round_bumps[12] > 0.29 and flatter[40] > 0.28 and smooth.max() < 1e-20

# %%
# Is it exactly a third? A million events take two seconds. No state but the last is stored, and means are exact over
# all events after the first fifth. The errors are found from the run itself, and are larger for the flatter bumps,
# whose energies are remembered for longer.

lengths = {"round bumps, K = 1": (20_000, 100_000, 1_000_000), "flatter bumps, K = 1/3": (20_000, 100_000)}
found = {name: [play(rims[name], n, 20, every=n).statistics() for n in runs] for name, runs in lengths.items()}
fig, ax = plt.subplots(layout="constrained")
for (name, runs), shift, marker in zip(lengths.items(), (0.94, 1.06), "os", strict=True):
    parts = [means.spin_fraction for means in found[name]]
    ax.errorbar(shift * np.array(runs), [e.value for e in parts], [e.error for e in parts], fmt=marker, capsize=4.0,
                label=name)  # fmt: skip
ax.axhline(1 / 3, color="0.4", linestyle="--", linewidth=0.8, label="a third")
ax.set(xlabel="events", ylabel="part of the energy in the spin, mean over time", xscale="log")
ax.legend(loc="lower right")
plt.show()
whole = found["round bumps, K = 1"][-1]
print(f"part in the spin    {whole.spin_fraction}")
print(f"collisions          {whole.collision_rate} of a disk in a second")
print(f"kurtosis of spins   {whole.spin_kurtosis}")

# %%
# It is a third within one per cent. Each disk collides with others a hundred times a second, and the kurtosis of
# the spins is the 3 of a normal distribution.

assert abs(3 * float(whole.spin_fraction) - 1) < min(0.01, 6 * whole.spin_fraction.error)
assert 95 < float(whole.collision_rate) < 105
assert abs(float(whole.spin_kurtosis) - 3) < 0.05
assert found["flatter bumps, K = 1/3"][1].spin_fraction.error > found["round bumps, K = 1"][1].spin_fraction.error

# %%
# How fast? The spectral gap of the collision law says what part of a direction is forgotten in each collision. For
# flatter bumps it is smaller.

gaps = {name: spec.spectral_gap(rims[name].reduced_law, tolerance=1e-3) for name in list(rims)[:2]}
for name, gap in gaps.items():
    print(f"{name:24} gap {gap}")

# %%
# Further: grains of different sizes in :doc:`/generated/how-to/a_granular_collision`, disks between plates in
# :doc:`/generated/how-to/no_slip_billiards`, true disks in the page on :doc:`the true disk </theory/true-disk>`, and
# the theory of :doc:`the collision </theory/collision>`.
