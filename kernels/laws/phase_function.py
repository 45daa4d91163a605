"""The Henyey-Greenstein law, whose known spectrum makes it the reference kernel of the spectral methods."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, finite_array, number_between, shaped, whole_number
from ..bases.angles import clipped_inside, mirrored_angle
from ..bases.measure import SINE
from .density import DensityLaw, angle_pair


@dataclass(frozen=True, repr=False)
class HenyeyGreensteinLaw(DensityLaw):
    r"""The law of cos(theta) if the direction on the sphere is scattered with the Henyey-Greenstein phase function.

    With u = cos(theta), the kernel with respect to du' is

        k(u, u') = sum over l of (2 l + 1)/2 g^l P_l(u) P_l(u')
                 = (1 - g^2) E(m) / (pi (A - B) sqrt(A + B)),    m = 2 B / (A + B),

    A = 1 + g^2 - 2 g u u', B = 2 g sin(theta) sin(theta'), E the complete elliptic integral. The law is reversible with
    respect to sin(theta) d theta, has the eigenvalue g^l on the polynomial P_l, and satisfies HG(g) HG(h) = HG(g h).

    Parameters
    ----------
    g : float
        Mean cosine of the scattering angle, -1 < g < 1. In the paper's convention the law tends to retroreflection
        (theta' = theta) for g -> 1 and to specular reflection (theta' = pi - theta) for g -> -1; g = 0 is Lambertian.

    Notes
    -----
    Source: L. G. Henyey and J. L. Greenstein, Astrophys. J. 93 (1941) 70. The azimuthal mean has the closed form above.

    Examples
    --------
    >>> law = henyey_greenstein(0.5)
    >>> law
    henyey_greenstein(0.5)
    >>> law.eigenvalue(3)
    0.125
    >>> round(float(law.apply(np.cos, np.pi / 3)), 14)         # g cos(theta)
    0.25
    """

    g: float

    reversible = True
    mirror_symmetric = True

    def __post_init__(self) -> None:
        g = number_between("g", self.g, -1.0, 1.0)
        self._set(g=g, is_lambertian=g == 0.0)

    @property
    def eigenvalue_ratio(self) -> float:
        return self.g

    def eigenvalue(self, degree: int) -> float:
        """The eigenvalue g^l of the Legendre polynomial of degree l in cos(theta)."""
        return float(self.g ** whole_number("degree", degree, 0))

    def density(self, theta: ArrayLike, theta_out: ArrayLike) -> Floats:
        """p(theta, theta') with respect to d theta', in the shape to which the two arguments broadcast."""
        from scipy.special import elliprg

        theta, theta_out = angle_pair(theta, theta_out)
        weight = 2.0 * SINE.density(theta_out)
        # g < 0 is g > 0 followed by theta' -> pi - theta'. As sums of squares, A - B and A + B have no cancellation.
        g, target = abs(self.g), theta_out if self.g >= 0.0 else np.pi - theta_out
        least = (1.0 - g) ** 2 + 4.0 * g * np.sin(0.5 * (theta - target)) ** 2
        most = (1.0 - g) ** 2 + 4.0 * g * np.sin(0.5 * (theta + target)) ** 2
        # Carlson's form E(m) = 2 R_G(0, 1 - m, 1) needs 1 - m = (A - B)/(A + B), which is accurate near m = 1.
        elliptic = 2.0 * elliprg(0.0, least / most, 1.0)
        return np.asarray(weight * (1.0 - g) * (1.0 + g) * elliptic / (np.pi * least * np.sqrt(most)))

    def panels(self, theta: Floats) -> Floats:
        """Edges whose distances from the peak double; the width of the peak is about 1 - |g|."""
        distance = (1.0 - abs(self.g)) * 2.0 ** np.arange(self._doublings())
        theta = finite_array("theta", theta)
        peak = (theta if self.g >= 0.0 else np.pi - theta)[..., None]
        ends = np.zeros_like(peak)
        edges = [ends, peak - distance[::-1], peak, peak + distance, ends + np.pi]
        return np.asarray(np.clip(np.concatenate(edges, axis=-1), 0.0, np.pi))

    @property
    def resolution(self) -> float:
        """Width 1 - |g| of the peak, in radians."""
        return 1.0 - abs(self.g)

    def incoming_edges(self, edges: Floats) -> Floats:
        """Angles whose distances from the edges double, because the integrals change where the peak passes an edge."""
        edges = shaped("edges", edges, "n")
        centre = edges if self.g >= 0.0 else np.pi - edges[::-1]
        distance = self.resolution * 2.0 ** np.arange(self._doublings())
        # Distances end at the middle between two edges, beyond which the next edge is nearer.
        half = 0.5 * np.diff(centre)[:, None]
        right, left = centre[:-1, None] + distance, centre[1:, None] - distance
        near = distance <= half
        # Edges between one and two peak widths apart get a middle, so that no interval is wider than the peak.
        halved = (0.5 * self.resolution < half) & (half < self.resolution)
        middle = 0.5 * (centre[1:] + centre[:-1])[halved[:, 0]]
        return np.unique(np.concatenate((centre[1:-1], middle, right[near], left[near])))

    def _doublings(self) -> int:
        return 1 + int(np.ceil(np.log2(np.pi / (1.0 - abs(self.g)))))

    def _sample(self, theta: Floats, rng: np.random.Generator) -> Floats:
        g, draw = abs(self.g), rng.random(theta.shape)
        azimuth = 2.0 * np.pi * rng.random(theta.shape)
        # The inverse cdf of the phase function, as sine and cosine of half the scattering angle, without cancellation.
        scale = 1.0 - g + 2.0 * g * draw
        half_sine = (1.0 - g) * np.sqrt((1.0 - draw) * (1.0 + g * draw)) / scale
        half_cosine = (1.0 + g) * np.sqrt(draw * (1.0 - g + g * draw)) / scale
        along, across = half_cosine**2 - half_sine**2, 2.0 * half_sine * half_cosine
        forward = along * np.cos(theta) - across * np.cos(azimuth) * np.sin(theta)
        upward = along * np.sin(theta) + across * np.cos(azimuth) * np.cos(theta)
        outgoing = clipped_inside(np.arctan2(np.hypot(upward, across * np.sin(azimuth)), forward))
        return outgoing if self.g >= 0.0 else mirrored_angle(outgoing)

    def __repr__(self) -> str:
        return f"henyey_greenstein({self.g!r})"


def henyey_greenstein(g: float) -> HenyeyGreensteinLaw:
    """The Henyey-Greenstein law with mean cosine ``g``, -1 < g < 1; see `HenyeyGreensteinLaw`.

    Raises InputError if g is not in this range.

    Examples
    --------
    >>> henyey_greenstein(-0.5).eigenvalue(3)
    -0.125
    """
    return HenyeyGreensteinLaw(g)
