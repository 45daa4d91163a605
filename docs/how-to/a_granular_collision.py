r"""
A granular collision
====================

Two rough grains collide. How their coefficients of restitution depend on the angle of impact.
"""

# sphinx_gallery_thumbnail_path = "generated/thumbnails/a_granular_collision.png"

import matplotlib.pyplot as plt
import numpy as np

from asperity import geometry as geo
from asperity import kernels as ker

# %%
# Two rods of glass in SI units, 10 mm long, with radii of 2 mm and 3 mm. They are uniform, so the moment of inertia
# is half of :math:`m r^2`; `geo.Disk.from_inertia` takes a measured moment in kg m^2. The larger rod is at rest, the
# other one comes without spin at 0.5 m/s. `PairLaw.from_wall` takes the relative roughness of the rims.

radii, speed = (2e-3, 3e-3), 0.5  # m, m/s
first, second = (geo.Disk(2500.0 * np.pi * r**2 * 0.01, 0.5, radius=r) for r in radii)  # kg, no unit, m
for disk in (first, second):
    print(f"radius {disk.radius:.0e} m, mass {disk.mass:.3g} kg, inertia {disk.inertia:.3g} kg m^2")
laws = {
    "rough": ker.PairLaw.from_wall(geo.dispersing_arcs(curvature=1.0), first, second),
    "no-slip": ker.PairLaw(ker.retroreflection(), first, second),
    "smooth": ker.PairLaw(ker.specular(), first, second),
}

# %%
# At the point of contact the surfaces have a normal and a tangential relative velocity. A coefficient of restitution is
# minus the ratio of one after and before the collision. Smooth grains keep the tangential velocity, no-slip grains
# reverse it. Rough ones do neither, and exchange energy between the two: in oblique impacts the normal restitution may
# exceed 1, although no collision changes the energy. The third velocity of a disk is that of its rim by the spin,
# :math:`r\omega` in m/s; the angular velocity is that over the radius.


def contact(one, two):
    """Relative velocity of the surfaces along x and y; the first grain is above the second."""
    return one[..., 0] - two[..., 0] + one[..., 2] + two[..., 2], one[..., 1] - two[..., 1]


degrees = np.linspace(10.0, 80.0, 15)  # between the velocity and the normal
angle = np.radians(np.repeat(degrees[:, None], 4000, axis=1))
before = np.stack([speed * np.sin(angle), -speed * np.cos(angle), 0.0 * angle], axis=-1)  # m/s
normal, rest = np.broadcast_to([0.0, 1.0], (*angle.shape, 2)), np.zeros_like(before)
fig, axes = plt.subplots(2, 1, sharex=True, layout="constrained", figsize=(6.4, 6.4))
for (name, law), style in zip(laws.items(), ("-", "--", ":"), strict=True):
    after = law.sample(normal, before, rest, rng=0)
    found = [-v / u for v, u in zip(contact(*after), contact(before, rest), strict=True)]
    for ax, restitution in zip(axes, found, strict=True):
        ax.plot(degrees, restitution.mean(axis=1), style, label=name)
        ax.fill_between(degrees, *np.quantile(restitution, [0.1, 0.9], axis=1), alpha=0.2)
axes[0].set(ylim=(-3.0, 3.0), ylabel="tangential restitution", title="mean, and 10 % to 90 % of the collisions")
axes[1].set(ylim=(0.0, 3.0), ylabel="normal restitution", xlabel="angle of impact (degrees from the normal)")
axes[0].legend()
plt.show()

# %%
# The spins of no-slip rods after an impact at 45 degrees, in rad/s:

one, two = laws["no-slip"].sample([0.0, 1.0], speed * np.sqrt(0.5) * np.array([1.0, -1.0, 0.0]), [0.0, 0.0, 0.0])
print(f"omega {one[2] / first.radius:.1f} and {two[2] / second.radius:.1f} rad/s")
