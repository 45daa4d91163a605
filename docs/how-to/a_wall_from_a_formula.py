r"""
A wall from a formula
=====================

The commonest model of a rough wall is a cosine, and others come as formulas too.
"""

import matplotlib.pyplot as plt
import numpy as np

from asperity import geometry as geo
from asperity import spectral as spec

# %%
# ``from_function`` takes :math:`y = f(x)` on one period. Its pieces are curves, 28 of them here, within ``tolerance``
# of the heights. Slopes and curvatures are near those of :math:`f` too, because rays feel slopes: the docstring says
# how near.

wall = geo.Wall.from_function(lambda x: 0.1 * np.cos(2 * np.pi * x), tolerance=1e-9)
print(wall)
geo.draw_wall(wall, x=[0.1, 0.3, 0.6], theta=[1.0, 1.6, 2.3])
plt.show()

# %%
# Where :math:`f` or its slope jumps, name the place. Linear parts become segments, jumps vertical sides. A place that
# is not named is found and refused.

ramps = geo.Wall.from_function(lambda x: np.where(x < 0.6, 0.5 * x, 1.0 - x), breakpoints=[0.6])
print(ramps.vertices)

# %%
# The cosine is the named wall ``sinusoid``, so that ``asperity gap sinusoid:amplitude=0.5`` works. Its gap is largest
# where the wall is about a quarter of a period deep.

table = spec.sweep(geo.sinusoid, {"amplitude": [0.1, 0.2, 0.3, 0.5]}, "gap", tolerance=1e-2)
for row in table.rows:
    print(f"{row.point['amplitude']}: gap {row.value:.3f}, error {row.error:.0e}, {row.verdict}")
table.plot()
plt.show()
