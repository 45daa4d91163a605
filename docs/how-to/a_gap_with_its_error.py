r"""
A gap with its error
====================

The spectral gap says how quickly a particle forgets its direction when it is reflected again and again. For bumps whose
radius is three periods Feres and Zhang (2010) published the gap 0.0373.
"""

import matplotlib.pyplot as plt

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec

# %%
# The literature quotes gaps in the convention where specular reflection is the identity. The digit in brackets is the
# error of the last digit.

law = ker.WallLaw(geo.dispersing_arcs(curvature=1 / 3)).in_specular_frame()
gap = spec.spectral_gap(law, tolerance=1e-5)
print(gap)
print(gap.verdict)

# %%
# *Isolated* means that the gap ends at an eigenvalue. Intervals that contain the largest eigenvalues of the law itself,
# not of a matrix, come from residuals of trial functions:

for found in spec.enclosures(law, 4):
    print(f"{found.low:.9f} to {found.high:.9f}")

# %%
# A picture of the leading eigenvalues. The gap is shaded.

spec.spectrum(law, k=6).plot()
plt.show()
