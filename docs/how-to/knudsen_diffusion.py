r"""
Diffusivity of a rough channel
==============================

A gas so dilute that its particles meet only the walls diffuses along a channel. The coefficient follows from grazing
flights alone. A simulation confirms it.
"""

import matplotlib.pyplot as plt
import numpy as np

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec

# %%
# The ratio :math:`\eta` of the diffusivity :math:`D`, a slope in the logarithm of the length, to
# :math:`D_0 = 4rs/\pi`, its value for diffuse walls. Walls without flat
# tops and vertical sides turn all grazing flights, and have :math:`\eta = 1`, whatever their shape. The page about
# :doc:`Knudsen diffusion </theory/knudsen-diffusion>` explains the limit.

laws = {
    "diffuse": ker.lambertian(),
    "arcs, half angle 1.2": ker.CircularArcLaw(1.2),
    "bumps": ker.WallLaw(geo.dispersing_arcs(curvature=1.0)),
    "semicircles": ker.CircularArcLaw(np.pi / 2),
    "Maxwell, half diffuse": ker.maxwell(0.5),
}
found = {name: spec.diffusivity(law) for name, law in laws.items()}
for name, diffusivity in found.items():
    print(f"{name:22} eta = {diffusivity.eta:.6f}, D = {diffusivity}")

# %%
# The mean time :math:`\tau` in which particles leave :math:`|x| < L` is :math:`L^2/(D\ln(L/r))` in the limit of large
# :math:`L`. So :math:`L^2/(D_0\tau)` against :math:`\ln L` has the slope :math:`\eta`. The dashed lines have the slopes
# above and go through the last points: for Maxwell's law the slope is reached slowly.

lengths = 10.0 * 2.0 ** np.arange(0, 4.5, 0.5)
fig, ax = plt.subplots(layout="constrained")
for k, name in enumerate(("diffuse", "semicircles", "Maxwell, half diffuse")):
    times = spec.exit_times(laws[name], lengths, 1000, rng=5)
    line = times.scaled[-1] + found[name].eta * np.log(lengths / lengths[-1])
    ax.plot(lengths, times.scaled, "o", color=f"C{k}", label=name)
    ax.plot(lengths, line, "--", color=f"C{k}")
    print(f"{name:22} eta = {times.eta()} from exit times")
ax.set(xscale="log", xlabel="L / r", ylabel=r"$L^2 / (D_0 \tau)$")
ax.legend()
plt.show()

# %%
# Paths tell the two central limit theorems. In a straight channel :math:`X_t/\sqrt{t\ln t}` has the limiting variance
# :math:`D/2`; in a bent one flights are bounded, and :math:`X_t/\sqrt t` has a limit. The histograms are of the
# positions over their scale, the curves of normal variables with the variances above.

straight = spec.channel_paths(laws["diffuse"], [50, 200, 800], 4000, rng=1)
bent = spec.channel_paths(laws["diffuse"], [50, 100, 200], 4000, rng=1, bend=3.0)
variances = straight.limit_variance(), bent.variance_rate()
print(f"straight: {variances[0]} for D/2 = {float(found['diffuse']) / 2:.4f}; bent: {variances[1]}")
fig, axes = plt.subplots(1, 2, layout="constrained", figsize=(8, 3))
for ax, paths, variance, title in zip(axes, (straight, bent), variances, ("straight", "bent"), strict=True):
    paths.draw(variance, ax)
    ax.set_title(title)
plt.show()
