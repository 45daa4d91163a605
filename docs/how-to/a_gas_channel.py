r"""
A gas channel
=============

How fast a rarefied gas spreads in a channel of a given length, and how much of it passes.
"""

import matplotlib.pyplot as plt
import numpy as np

from asperity import Estimate
from asperity import kernels as ker
from asperity import spectral as spec

# %%
# Two plates 0.2 mm apart, with a gas so dilute that its particles meet only the plates. They move in the plane of the
# section at the mean speed of nitrogen at room temperature. The plates are diffuse, have shallow or deep arcs, or
# follow Maxwell's law.

radius, speed = 1e-4, 470.0  # half the width in m, m/s
laws = {
    "diffuse": ker.lambertian(),
    "arcs, half angle 0.3": ker.CircularArcLaw(0.3),
    "arcs, half angle 1.2": ker.CircularArcLaw(1.2),
    "Maxwell, 80 % diffuse": ker.maxwell(0.8),
}

# %%
# `diffusivity` does not depend on the length. It is the slope of :math:`L^2/\tau` against :math:`\ln L` for very long
# channels, and the same for all walls that turn grazing flights.

for name, law in laws.items():
    print(f"{name:22}", spec.diffusivity(law, radius, speed))

# %%
# `channel_diffusivity` simulates particles until they leave :math:`|x| < L`. With their mean exit time :math:`\tau` the
# diffusivity of this channel is :math:`L^2/(2\tau)`. At 10 mm it differs by a factor of six between walls with the same
# slope.

lengths = radius * np.array([2.0, 5.0, 10.0, 20.0, 50.0, 100.0])
fig, ax = plt.subplots(layout="constrained")
for name, law in laws.items():
    found = spec.channel_diffusivity(law, lengths, 1000, rng=1, radius=radius, speed=speed)
    ax.errorbar(1e3 * lengths, found.values, found.errors, marker="o", markersize=4, capsize=3, label=name)
    time = Estimate(1e6 * found.times[3], 1e6 * found.time_errors[3], "estimate", "1000 particles")
    print(f"{name:22} leaves |x| < 2 mm after {time} us")
ax.set(xscale="log", yscale="log", xlabel="L, half of the length (mm)", ylabel=r"diffusivity $L^2/(2\tau)$ (m$^2$/s)")
ax.set_yticks(ticks := [0.02, 0.05, 0.1, 0.2, 0.5], labels=ticks)
ax.minorticks_off()
ax.legend()
plt.show()

# %%
# Of the particles that enter a channel of ten widths at one end, this fraction leaves it at the other one.

passing = {name: spec.transmission(law, 10.0, tolerance=2e-2, rng=1) for name, law in laws.items()}
for name, fraction in passing.items():
    print(f"{name:22} {fraction}")
