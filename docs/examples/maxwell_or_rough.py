"""Maxwell's law against a rough wall
==================================

Maxwell's law against a rough wall: laws that can be mixed and composed.

Maxwell let a fraction a of the particles leave the wall as Lambert's law says, and the others specularly. A rough wall
without any diffuse fraction also scatters. Which fraction a has the same spectral gap? For Maxwell's law the gap is a,
in the convention where specular reflection is the identity, so that the gap of the wall is the answer. Mixed with
Maxwell's law, and reflected twice, the wall's gap obeys what theory says of mixtures and powers: it is at least the
mean of the two gaps, and 1 - (1 - gap)^2 after two reflections where no eigenvalue has a larger modulus.
"""

# sphinx_gallery_thumbnail_path = "generated/thumbnails/maxwell_or_rough.png"

from __future__ import annotations

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec

POLYNOMIALS = 32


def main(half_angle: float = 0.3, fraction: float = 0.25) -> dict[str, float]:
    """Gaps of focusing arcs, of Maxwell's law, of their mixture in equal parts, and of two reflections in a row."""
    basis = ker.Legendre(POLYNOMIALS)

    def gap(law: ker.Law) -> float:
        return spec.spectrum(ker.discretise(law, basis), k=4).gap

    rough = ker.CircularArcLaw(half_angle).in_specular_frame()
    maxwell = ker.maxwell(fraction).in_specular_frame()
    twice = ker.discretise(rough, basis) ** 2
    return {
        "rough wall": gap(rough),
        "Maxwell's law": gap(maxwell),
        "half and half": gap(0.5 * rough + 0.5 * maxwell),
        "rough wall, twice": spec.spectrum(twice, k=4).gap,
        "depth / period": geo.focusing_arcs(half_angle).depth,
    }


if __name__ == "__main__":
    for name, value in main().items():
        print(f"{name:20s} {value:.6f}")
