"""Enclosures of the eigenvalues of six curved walls, against far finer ones and against a second method.

The second method is the matrix in Legendre polynomials, whose eigenvalues can only have too small a modulus.
"""

from __future__ import annotations

from collections.abc import Iterator

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from campaigns.engine import Campaign, Judged

# The eigenvalue of the constants and the next two by modulus.
LISTED = 3
DEGREES, MATRIX_TOLERANCE = 24, 1e-6


# Walls with the tolerances of a coarse and a fine run: two with a closed form, and four that are traced; one is so
# shallow that it smooths jumps of trial functions over less than the distance of nodes, one has no mirror symmetry.
Case = tuple[str, geo.Wall, float, float]
SKEW = geo.Wall([geo.Bezier([(0, 0), (0.2, -0.5), (0.7, -0.3), (1, 0)])], period=1.0)
CASES: tuple[Case, ...] = (
    ("focusing arcs, 1.2", geo.focusing_arcs(1.2), 1e-5, 1e-9),
    ("focusing arcs, 0.6", geo.focusing_arcs(0.6), 1e-5, 1e-9),
    ("dispersing arcs, 1.0", geo.dispersing_arcs(1.0), 1e-4, 1e-8),
    ("dispersing arcs, 0.001", geo.dispersing_arcs(1e-3), 1e-10, 1e-12),
    ("elliptical arcs, 1.2", geo.elliptical_arcs(1.2, geo.Disk()), 1e-4, 1e-6),
    ("cubic Bezier, skew", SKEW, 1e-3, 1e-5),
)


def judge(case: Case) -> Iterator[Judged]:
    """Each enclosure off the constants must contain the far finer one and not lie inside the matrix's eigenvalue."""
    name, wall, *tolerances = case
    law = ker.WallLaw(wall)
    coarse, fine = (spec.enclosures(law, LISTED, tolerance=tolerance) for tolerance in tolerances)
    matrix = ker.discretise(law, ker.Legendre(DEGREES), tolerance=MATRIX_TOLERANCE)
    values = spec.spectrum(matrix, k=LISTED).values
    for wide, narrow, value in zip(coarse[1:], fine[1:], values[1:], strict=True):
        fault = ""
        if not wide.low <= narrow.low <= narrow.high <= wide.high:
            fault = f"[{narrow.low:.12f}, {narrow.high:.12f}] is not in [{wide.low:.12f}, {wide.high:.12f}]"
        beyond = value - wide.high if value > 0.0 else wide.low - value
        if beyond > float(matrix.error):
            fault += f" the matrix has {value:.9f} +- {float(matrix.error):.1e}"
        yield Judged(name, 0.5 * wide.width, abs(wide.value - narrow.value), 0.5 * narrow.width, fault)


CAMPAIGNS = (
    Campaign(
        "enclosures", "Does each interval contain its eigenvalue, with the right number?", CASES.__getitem__, judge,
        len(CASES), [0],
    ),
)  # fmt: skip
