r"""
No-slip billiards
=================

Between two no-slip plates a disk stays in a bounded part of the strip for ever. Between rough plates it does not.
"""

# sphinx_gallery_thumbnail_path = "generated/thumbnails/no_slip_billiards.png"

import matplotlib.pyplot as plt
import numpy as np

from asperity import geometry as geo
from asperity import kernels as ker

# %%
# No-slip plates send every particle back where it came from: the law of retroreflection. The rough plates have the law
# of a wall of arcs.

disk = geo.Disk(mass=1.0, inertia_ratio=0.5)
plates = {
    "no-slip plates": ker.CollisionLaw(ker.retroreflection(), disk),
    "rough plates": ker.CollisionLaw.from_wall(geo.focusing_arcs(half_angle=1.2), disk),
}

# %%
# Eight disks start in the middle, with the same velocity for both kinds of plates. The plates bound the centre of the
# disk. No-slip plates confine it to the width :math:`\ell\sqrt{1 + m/J}`, where :math:`\ell = \sqrt{1/v_2^2 - 1}` and
# :math:`v_2` is the fraction of the kinetic speed across the strip.

rng = np.random.default_rng(0)
velocity = disk.from_angles(rng.uniform(0.5, 2.6, 8), rng.uniform(0.5, 2.6, 8))
bound = np.sqrt((1 / (disk.mass * velocity[:, 1] ** 2) - 1) * (1 + 1.0 / disk.inertia_ratio))

fig, axes = plt.subplots(2, 1, sharex=True, layout="constrained")
ratio = {}
for ax, (name, law) in zip(axes, plates.items(), strict=True):
    record = ker.play(geo.Container.strip(), law, np.zeros((8, 2)), velocity, 200, rng)
    ratio[name] = record.extent() / bound
    for k in range(3):
        ax.plot(record.position[:40, k, 0], record.position[:40, k, 1], linewidth=0.8)
    ax.set(title=name, ylabel="y")
axes[-1].set_xlabel("x along the strip")
plt.show()

# %%
# The picture has the first 40 collisions of three disks. Widths of the first 200 collisions, as fractions of the bound:

for name, fractions in ratio.items():
    print(f"{name}: from {fractions.min():.3f} to {fractions.max():.3f}")
