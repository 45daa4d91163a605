"""Fixtures that several folders of tests share."""

from __future__ import annotations

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker

# ---- laws, bases and matrices --------------------------------------------------------------------------------------
SKEW = geo.Wall.from_vertices([(0, 0), (0.3, -0.5), (1, 0)])


def halves_exchanged(theta: np.ndarray) -> np.ndarray:
    """Exchanges the two halves of (0, pi), keeping the orientation of u = -cos(theta)."""
    u = -np.cos(theta)
    return np.arccos(-np.where(u < 0.0, u + 1.0, u - 1.0))


def tilted(theta: np.ndarray, out: np.ndarray) -> np.ndarray:
    """A density that preserves sin(theta) d theta and is neither reversible nor mirror symmetric."""
    return (1.0 + 0.5 * np.cos(theta) * (1.5 * np.cos(out) ** 2 - 0.5)) * ker.SINE.density(out)


# Cycles of three equal bins preserve the measure, but are not reversible; the other matrix is, but has no symmetry.
CYCLE = ker.MatrixLaw([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
LOPSIDED = ker.MatrixLaw([[0.5, 0.5, 0.0], [0.5, 0.25, 0.25], [0.0, 0.25, 0.75]])
TEETH, CREVICES, ARCS = ker.TriangularTeethLaw(0.7), ker.RectangularTeethLaw(0.8), ker.CircularArcLaw(1.2)
LAWS = {
    "specular": ker.specular(),
    "retroreflection": ker.retroreflection(),
    "lambertian": ker.lambertian(),
    "maxwell": ker.maxwell(0.3),
    "scattering": ker.henyey_greenstein(0.6),
    "scattering back": ker.henyey_greenstein(-0.7),
    "density": ker.DensityLaw(lambda a, b: (1.0 + 0.5 * np.cos(a) * np.cos(b)) * ker.SINE.density(b)),
    "tilted density": ker.DensityLaw(tilted),
    "triangles": TEETH,
    "narrow triangles": ker.TriangularTeethLaw(0.02),
    "blunt triangles": ker.TriangularTeethLaw(2.0),
    "flat triangles": ker.TriangularTeethLaw(np.pi - 1e-4),
    "rectangles": CREVICES,
    "shallow rectangles": ker.RectangularTeethLaw(1e-6),
    "deep rectangles": ker.RectangularTeethLaw(2.5),
    "arcs": ARCS,
    "shallow arcs": ker.CircularArcLaw(0.02),
    "semicircles": ker.CircularArcLaw(0.5 * np.pi),
    "least resistance": ker.LeastResistanceLaw(),
    "involution": ker.InvolutionLaw(halves_exchanged),
    "exchange": ker.IntervalExchangeLaw(ker.discretise(ker.lambertian(), ker.Bins(3))),
    "cycle": CYCLE,
    "lopsided matrix": LOPSIDED,
    "polygon": ker.PolygonLaw(SKEW),
    "wall in closed form": ker.WallLaw(geo.triangular_teeth(0.7)),
    "traced wall": ker.WallLaw(geo.dispersing_arcs(1.0)),
    "mushrooms": ker.MushroomLaw(geo.MushroomGenerations(0.25, 0.5, 3)),
    "sum": 0.2 * ker.specular() + 0.5 * TEETH + 0.3 * ker.lambertian(),
    "sum of isometries": 0.4 * TEETH + 0.6 * ker.specular() @ TEETH,
    "product": TEETH @ ker.henyey_greenstein(0.7),
    "product of isometries": ker.TriangularTeethLaw(2.0 * np.pi / 7.0) @ CREVICES,
    "product of matrices": CYCLE @ LOPSIDED,
    "power": CREVICES**4,
    "other frame": ARCS.in_specular_frame(),
    "product in the other frame": (TEETH @ TEETH).in_specular_frame(),
}
BASES = {
    "bins": ker.Bins(8),
    "uneven bins": ker.Bins([0.0, 0.3, 1.1, 2.0, np.pi]),
    "polynomials": ker.Legendre(6),
    "panels": ker.Panels([0.0, 0.4, 2.0, np.pi], 2),
}


@pytest.fixture(params=LAWS)
def law(request: pytest.FixtureRequest) -> ker.Law:
    """Every law of the library, alone and in sums, products, powers and the other frame."""
    return LAWS[request.param]


@pytest.fixture(params=BASES)
def basis(request: pytest.FixtureRequest) -> ker.Basis:
    """A basis of every kind, with and without the mirror symmetry."""
    return BASES[request.param]
