r"""
A rough surface with partly diffuse facets
==========================================

Gas codes reflect a fraction of the particles diffusely and the others as by a mirror. On a rough surface each facet
does so, and a particle may meet several. The accommodation of the whole surface, which a code for flat walls needs, is
larger than the fraction of one facet.
"""

import matplotlib.pyplot as plt
import numpy as np

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec

# %%
# Grooves with sides of 63 degrees, and shallow ones of 20 degrees. In space somebody has to say what a diffuse hit does
# to the velocity along the grooves: ``facets="diffuse in space"`` draws it anew, ``facets="finer grooves"`` keeps it.

walls = {"steep grooves": geo.triangular_teeth(0.9), "shallow grooves": geo.triangular_teeth(2.45)}
fractions = np.array([0.05, 0.2, 0.5, 1.0])


def surface(wall, fraction):
    return ker.HemisphereLaw(ker.FacetedLaw(wall, ker.maxwell(fraction)), facets="diffuse in space")


found = {name: [spec.accommodation(surface(wall, a), 1e-3) for a in fractions] for name, wall in walls.items()}

# %%
# Along the grooves the accommodation is exactly the probability of a diffuse hit, :math:`1 - E(1 - a)^N` over specular
# rays with :math:`N` hits. Across, steep grooves turn particles round whatever their facets do: more than 1, because
# they scatter back. The dashed line is a guess, the value of mirrors plus the fraction of what is missing to 1. The
# computed values are above it. Error bars are smaller than the markers.

fig, axes = plt.subplots(1, 2, figsize=(8.5, 4), sharey=True, layout="constrained")
for ax, (name, wall) in zip(axes, walls.items(), strict=True):
    mirrors = float(spec.accommodation(ker.HemisphereLaw(ker.WallLaw(wall)), 1e-4).tangential)
    for k, (side, marker) in enumerate((("across", "s"), ("along", "^"), ("tangential", "o"))):
        numbers = [getattr(one, side) for one in found[name]]
        ax.errorbar(
            fractions, [float(one) for one in numbers], [one.error for one in numbers], fmt=f"{marker}-", color=f"C{k}",
            capsize=3, markersize=4, label={"tangential": "mean of both"}.get(side, f"{side} the grooves"),
        )  # fmt: skip
    ax.plot([0, 1], [mirrors, 1], "--", color="C2", label="guess: mirrors + fraction")
    ax.plot([0, 1], [0, 1], ":", color="0.5", label="flat wall")
    ax.set(title=name, xlabel="diffuse fraction a of a facet", xlim=(0, 1.02), ylim=(0, 1.4))
    print(name, *(f"a = {a}: {one.tangential}" for a, one in zip(fractions, found[name], strict=True)), sep="\n  ")
axes[0].set_ylabel("tangential accommodation")
axes[1].legend(fontsize=8, loc="upper left")
plt.show()

# %%
# A particle code takes the Maxwell fraction nearest to the mean velocities, or better the law itself, from incoming
# velocities, whose third component is towards the wall, to outgoing ones.

nearest = found["steep grooves"][1].maxwell_fraction
velocities = np.array([[300.0, 0.0, -400.0], [-100.0, 50.0, -20.0]])
reflected = surface(walls["steep grooves"], 0.2).sample(velocities, rng=1)
print(f"nearest Maxwell fraction of steep grooves with a = 0.2: {nearest}")
print(reflected.round(1))
