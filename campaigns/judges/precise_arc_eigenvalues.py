"""Eigenvalues of focusing arcs by a second method: the complete Galerkin matrix on graded panels, entry by entry.

``python -m campaigns.judges.precise_arc_eigenvalues`` prints what tests/spectral/bounds/test_adapted_panels.py holds
the enclosures against. The entries are integrals over the polygons of each number of hits
(kernels/discretisation/arcs.py), which share nothing with rows, residuals and adapted panels but the law; moduli
converge from below.
"""

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec

HALF_ANGLES = (0.6, 0.9, 1.2)
DEGREE, SMALLEST = 4, 1e-3

if __name__ == "__main__":
    for half_angle in HALF_ANGLES:
        basis = ker.Panels.for_wall(geo.focusing_arcs(half_angle), DEGREE, SMALLEST)
        found = spec.spectrum(ker.discretise(ker.CircularArcLaw(half_angle), basis), k=3)
        print(half_angle, *(f"{value:.12f}" for value in found.values[1:]), flush=True)
