r"""
The transmission of a tube
==========================

What fraction of the molecules that enter a round tube leaves it at the other end, for smooth, rough and grooved walls.
"""

import matplotlib.pyplot as plt
import numpy as np

from asperity import kernels as ker
from asperity import spectral as spec

# %%
# Molecules enter with the cosine law and meet only the wall. The wall is diffuse, as in tables of vacuum technology, or
# partly specular, or has grooves of which one planar law describes the cross section: along the tube, across it, or
# patches of random direction.

arcs = ker.CircularArcLaw(1.2)
laws = {
    "diffuse": ker.lambertian(),
    "Maxwell, 80 % diffuse": ker.maxwell(0.8),
    "grooves along": ker.HemisphereLaw(arcs, 0.0),
    "grooves across": ker.HemisphereLaw(arcs, np.pi / 2),
    "grooves at random": ker.HemisphereLaw(arcs),
}

# %%
# Grooves along the tube keep the velocity along it, as a smooth wall does: every molecule passes. Grooves across send
# some molecules back, and more than a diffuse wall does. For diffuse walls and Maxwell's an integral equation is
# solved; for the others flights are simulated to the tolerance.

lengths = [1, 2, 5, 10]  # radii
fig, ax = plt.subplots(layout="constrained")
passing = {}
for name, law in laws.items():
    found = [spec.transmission(law, length, "tube", tolerance=1e-2, rng=1) for length in lengths]
    passing[name] = found
    ax.errorbar(lengths, [*map(float, found)], [one.error for one in found], marker="o", markersize=4, label=name)
    print(f"{name:22}", *found)
ax.set(xscale="log", yscale="log", xlabel="length / radius", ylabel="fraction of molecules that pass")
ax.set_xticks(lengths, labels=lengths)
ax.set_yticks(ticks := [0.1, 0.2, 0.5, 1.0], labels=ticks)
ax.minorticks_off()
ax.legend()
plt.show()

# %%
# A transmission becomes a conductance with the area of the opening and the mean speed: here of nitrogen at room
# temperature, in a tube with a radius of 5 mm and a length of 50 mm.

area, speed = np.pi * 0.005**2, 470.0  # m^2, m/s
for name, found in passing.items():
    value, error = (1000 * area * speed / 4 * number for number in (found[3].value, found[3].error))
    print(f"{name:22} {value:.2f} +- {error:.2g} l/s")
