r"""
A wall for a law
================

Which wall reflects half of the particles diffusely and half of them specularly?
"""

# sphinx_gallery_thumbnail_path = "generated/thumbnails/a_wall_for_a_law.png"

import matplotlib.pyplot as plt

from asperity import kernels as ker

# %%
# The law of a wall is the mixture of the laws of its hollows, each with the width of its opening. A mixture of polygons
# is computed whose law has the first 6 by 6 moments of Maxwell's.

wanted = ker.maxwell(0.5)
found = ker.wall_for(wanted, moments=6)
print(f"{len(found.hollows)} hollows, defect {float(found.defect):.1e}")
found.plot()
plt.show()

# %%
# The wall is checked by its own law: the matrix of the wall minus that of the wanted law, in polynomials.

basis = ker.Legendre(6)
difference = ker.discretise(ker.WallLaw(found.wall), basis).array - ker.discretise(wanted, basis).array
print(f"largest difference {abs(difference).max():.1e}")

# %%
# Moments are not everything. The distance between the laws:

print(found.distance)
