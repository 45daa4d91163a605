r"""
A sweep over a family of walls
==============================

How does the gap depend on the shape of the wall?
"""

import matplotlib.pyplot as plt
import numpy as np

from asperity import geometry as geo
from asperity import spectral as spec

# %%
# Arcs from shallow to semicircular. With ``checkpoint=`` each finished point is stored in a file, with ``client=``
# several processes compute.

grid = {"half_angle": np.linspace(0.3, np.pi / 2, 5)}
table = spec.sweep(geo.focusing_arcs, grid, "gap", tolerance=1e-3)
for row in table.rows:
    print(f"{row.point['half_angle']:.3f}: gap {row.value:.4f}, error {row.error:.0e}, {row.verdict}")

# %%
# The shape of a marker is the verdict. For semicircles the gap ends at the essential spectrum.

table.plot()
plt.show()

# %%
# ``table.extremum("gap")`` computes further points and returns the largest gap, with the errors of gap and parameter.
# ``table.save("arcs")`` writes the table to files.
