"""Comparison of a law with the billiard Laplacian, the limit of the laws of shallow walls."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...core.checks import Floats, frozen, instance, whole_number
from ...core.estimates import Summary
from ...geometry import Wall
from ...kernels import Law, Legendre, discretise

# Chords of a wall's pieces and twice as many, whose difference tells the error of the mean squared slope.
CHORDS = 4096
# Ratio of the steepest slopes of the two levels that indicates a vertical tangent. There the steepest slope grows like
# the root of the number of chords.
STEEPENING = 1.2


@dataclass(frozen=True, repr=False)
class LaplacianComparison(Summary):
    r"""Comparison of a law in Feres' convention with 1 + 2 h d/dz (1 - z^2) d/dz, z = cos(theta).

    Attributes
    ----------
    flatness : float
        h, computed as (1 - <e_1, P_F e_1>)/4 with e_1 = sqrt(3) cos(theta).
    degrees : array of int, shape (n,)
        1, ..., n.
    deficits : array of shape (n,)
        1 - <e_l, P_F e_l> for the normalised Legendre polynomials e_l.
    ratios : array of shape (n,)
        deficits / (2 h l (l + 1)), which is 1 if the Laplacian describes the law.
    error : float
        Frobenius error of the matrix.
    """

    flatness: float
    degrees: Floats
    deficits: Floats
    ratios: Floats
    error: float


def laplacian_comparison(law: Law, degrees: int = 6, tolerance: float = 1e-8) -> LaplacianComparison:
    """Compare the diagonal of a law in Legendre polynomials with the eigenvalues of the billiard Laplacian.

    Parameters
    ----------
    law : Law
        The law, in either convention; it is compared in Feres'.
    degrees : int
        Number of Legendre polynomials.
    tolerance : float
        Wanted Frobenius error of the matrix.

    Notes
    -----
    Source: R. Feres and H.-K. Zhang, Commun. Math. Phys. 299 (2010): P_F - 1 is about 2 h times the Legendre operator
    for walls of mean squared slope h, so 1 - lambda_l is about 2 h l (l + 1), and the gap 4 h.

    Examples
    --------
    >>> from asperity import kernels as ker
    >>> found = laplacian_comparison(ker.CircularArcLaw(0.1), 2)
    >>> [round(float(ratio), 2) for ratio in found.ratios]
    [1.0, 0.99]
    """
    whole_number("degrees", degrees, 1)
    instance("law", law, Law, "ker.WallLaw(wall)")
    specular = law if law.frame == "specular" else law.in_specular_frame()
    matrix = discretise(specular, Legendre(2 * degrees + 2), tolerance=tolerance)
    order = np.arange(1, degrees + 1)
    diagonal = np.diagonal(matrix.symmetric)[order]
    deficits = 1.0 - diagonal
    flatness = float(deficits[0]) / 4.0
    ratios = deficits / (2.0 * flatness * order * (order + 1)) if flatness > 0.0 else np.full(degrees, np.nan)
    return LaplacianComparison(flatness, frozen(order), frozen(deficits), frozen(ratios), float(matrix.error))


def mean_squared_slope(wall: Wall) -> float:
    """The mean squared slope h of a wall over a period; ``inf`` if a piece is vertical or overhangs.

    Examples
    --------
    >>> from asperity import geometry as geo
    >>> round(mean_squared_slope(geo.triangular_teeth(np.pi / 2)), 12)
    1.0
    """
    instance("wall", wall, Wall, "geo.koch(2)")
    coarse, fine = (_slope_sum(wall, chords) for chords in (CHORDS, 2 * CHORDS))
    if not np.isfinite(fine[0]) or fine[1] > STEEPENING * coarse[1]:
        # a vertical tangent, where the integral diverges
        return float("inf")
    # chords have the error 1/chords^2
    return float((fine[0] + (fine[0] - coarse[0]) / 3.0) / wall.period)


def _slope_sum(wall: Wall, chords: int) -> tuple[float, float]:
    """The integral of the squared slope of the chords of a wall's pieces, and the largest slope."""
    total, steepest = 0.0, 0.0
    for piece in wall.pieces:
        points = piece.point(np.linspace(0.0, 1.0, chords + 1))
        run, rise = np.diff(points, axis=0).T
        if np.any(run <= 0.0):
            return np.inf, np.inf
        total += float(np.sum(rise**2 / run))
        steepest = max(steepest, float(np.max(np.abs(rise / run))))
    return total, steepest
