"""Ways to the gap of a law without growing matrices: rough ones at a glance, exact ones by enclosures."""

from __future__ import annotations

import numpy as np

from ...kernels import DensityLaw, Law, Legendre
from ...kernels.expectations.basis_means import has_costly_rows, integrates_panels, traces_rows
from ..bounds.enclosure import enclosures
from ..bounds.trial_space import adapted_trials
from ..eigenvalues.spectra import matrix_spectrum
from ..essential.edge import EssentialEdge
from .refinement import EIGENVALUES, SharedMatrices
from .verdict import SpectralGap, isolated

# Eigenvalues that are enclosed in the search of the largest one off the constants; how many may be for walls, and how
# exact the look is that counts them.
ENCLOSED, MOST_ENCLOSED, FIRST_LOOK, LEVELS_OF_LOOK = 3, 8, 1e-2, 2
# Enclosures somewhat wider than the tolerance are sought once more, to this share of it; a gap whose error misses the
# tolerance is handed over as it is where that is below the largest miss, a share of the gap.
CLOSER, LARGEST_MISS = 0.25, 1e-3
# From this tolerance on, small matrices by few rays may do for the gap of a traced wall: their sizes, with the errors
# asked of them, and the rays allowed. What larger bases would change is at most this multiple of the last change where
# these changes fall like a power of the size of .6 or more.
ROUGH, GLANCES, FEW_RAYS, BEYOND_CHANGE = 2e-3, ((24, 1.0), (48, 0.1)), 2**17, 2.0


def rough_gap(law: Law, tolerance: float, matrices: SharedMatrices, edge: EssentialEdge) -> SpectralGap | None:
    """A rough gap of a traced wall from small matrices by few rays: the rows of an enclosure take ten times as long.

    None for other laws, for fine tolerances, and near the essential spectrum.
    """
    if tolerance < ROUGH or not traces_rows(law):
        return None
    for size, matrix_error in GLANCES:
        found = matrix_spectrum(matrices(law, Legendre(size), FEW_RAYS, matrix_error), EIGENVALUES)
        error = found.gap_error + (BEYOND_CHANGE - 1.0) * float(found.gap_errors.discretisation[0])
        how = f"algebraic + {BEYOND_CHANGE:.0f} x two-grid + {found.gap_errors.quantile:.3g} x sampling error"
        gap = isolated(found, error, how, edge, law.frame) if error <= tolerance else None
        if gap is not None:
            return gap
    return None


def enclosed_gap(law: Law, tolerance: float, edge: EssentialEdge) -> SpectralGap | None:
    """The gap from an indexed enclosure; None where rows or the separation of the spectrum are not known so well."""
    if isinstance(law, DensityLaw):
        found = (_gap_of_enclosures(law, number, tolerance) for number in (ENCLOSED, 2 * ENCLOSED))
        return next((gap for gap in found if gap is not None and gap.error <= tolerance), None)
    if not integrates_panels(law) or has_costly_rows(law):
        return None
    number = _number_to_enclose(law, edge)
    gap = None if number is None else _gap_of_enclosures(law, number, tolerance)
    if number is not None and gap is not None and tolerance < gap.error <= tolerance / CLOSER:
        gap = _gap_of_enclosures(law, number, CLOSER * tolerance) or gap
    # other bases than adapted panels would hardly do better
    return gap if gap is not None and gap.error <= max(tolerance, LARGEST_MISS * gap.value) else None


def _gap_of_enclosures(law: Law, number: int, tolerance: float) -> SpectralGap | None:
    found = enclosures(law, number, tolerance=tolerance)
    listed = [item for item in found if item.label == "indexed" and item.index]
    top = max(listed, key=lambda item: item.value, default=None)
    # nothing that is not listed is larger
    if top is None or top.low <= max(found.separation.radius, 0.0) or top.high >= 1.0:
        return None
    gap, error = 1.0 - 0.5 * (top.low + top.high), 0.5 * top.width
    return SpectralGap(gap, error, top.kind, f"indexed enclosure; {found.method}", "isolated", (str(top),), law.frame)


def _number_to_enclose(law: Law, edge: EssentialEdge) -> int | None:
    """How many of the largest moduli reach down to the largest value off the constants, at a first look.

    None where that value is not beyond the essential spectrum.
    """
    look = adapted_trials(law, MOST_ENCLOSED, FIRST_LOOK, LEVELS_OF_LOOK)
    values = look.values[np.argsort(-np.abs(look.values), kind="stable")]
    found = np.flatnonzero(values[1:] > edge.high)
    return int(found[0]) + 2 if found.size else None
