"""What tests share: every wall, law, basis and matrix as a fixture; a test that takes ``wall`` runs on all of them."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest

from asperity import kernels as ker
from asperity.kernels.laws.law import DrivenLaw
from wall_shapes import CLOSED, OPEN

# ---- walls -------------------------------------------------------------------------------------------------------
built = cache(lambda name: (CLOSED | OPEN)[name]())


@pytest.fixture(params=CLOSED | OPEN)
def wall(request):
    """Each wall by its name."""
    return built(request.param)


@pytest.fixture(params=CLOSED)
def closed_wall(request):
    """Each wall without islands."""
    return built(request.param)


# ---- laws, bases and matrices --------------------------------------------------------------------------------------
# What is made of the library is made inside functions: a fault that the mutants write into it must fail in tests.
LAWS = (
    "specular",
    "retroreflection",
    "lambertian",
    "maxwell",
    "scattering",
    "scattering back",
    "density",
    "tilted density",
    "triangles",
    "narrow triangles",
    "blunt triangles",
    "flat triangles",
    "rectangles",
    "shallow rectangles",
    "deep rectangles",
    "arcs",
    "shallow arcs",
    "semicircles",
    "least resistance",
    "involution",
    "exchange",
    "cycle",
    "lopsided matrix",
    "polygon",
    "wall in closed form",
    "traced wall",
    "rays alone",
    "rays and their mirror images",
    "mushrooms",
    "sum",
    "sum of isometries",
    "product",
    "product of isometries",
    "product of matrices",
    "power",
    "other frame",
    "product in the other frame",
)
DIAGONAL = (
    "lambertian",
    "maxwell",
    "maxwell in the other frame",
    "scattering back",
    "two scatterings",
    "three parts",
    "part of the identity",
    "product",
    "mirrored product",
    "power",
)
BASES = (
    "bins",
    "uneven bins",
    "polynomials",
    "panels",
)


@cache
def bounced_law() -> type[DrivenLaw]:
    """A class of triangular teeth, known only by their rays."""

    @dataclass(frozen=True)
    class Bounce(DrivenLaw):
        mirror_symmetric: bool | None = None

        reversible = True

        def reflect(self, x: np.ndarray, theta: np.ndarray) -> np.ndarray:
            return ker.TriangularTeethLaw(1.1).reflect(x, theta)

    return Bounce


@cache
def laws() -> dict[str, ker.Law]:
    """Every law of the library, alone and in sums, products, powers and the other frame."""
    from asperity import geometry as geo

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
    return {
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
        "polygon": ker.PolygonLaw(geo.Wall.from_vertices([(0, 0), (0.3, -0.5), (1, 0)])),
        "wall in closed form": ker.WallLaw(geo.triangular_teeth(0.7)),
        "traced wall": ker.WallLaw(geo.dispersing_arcs(1.0)),
        "rays alone": bounced_law()(),
        "rays and their mirror images": bounced_law()(mirror_symmetric=True),
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


@cache
def bases() -> dict[str, ker.Basis]:
    """A basis of every kind, with and without the mirror symmetry."""
    return {
        "bins": ker.Bins(8),
        "uneven bins": ker.Bins([0.0, 0.3, 1.1, 2.0, np.pi]),
        "polynomials": ker.Legendre(6),
        "panels": ker.Panels([0.0, 0.4, 2.0, np.pi], 2),
    }


@cache
def diagonal_laws() -> dict[str, tuple[ker.Law, Callable]]:
    """Laws that polynomials diagonalise, and the eigenvalue that belongs to that of each degree l > 0."""
    return {
        "lambertian": (ker.lambertian(), lambda degree: 0.0 * degree),
        "maxwell": (ker.maxwell(0.3), lambda degree: 0.7 * (-1.0) ** degree),
        "maxwell in the other frame": (ker.maxwell(0.3).in_specular_frame(), lambda degree: 0.7 + 0.0 * degree),
        "scattering back": (ker.henyey_greenstein(-0.7), lambda degree: (-0.7) ** degree),
        "two scatterings": (
            0.5 * ker.henyey_greenstein(0.9) + 0.5 * ker.henyey_greenstein(-0.5),
            lambda degree: 0.5 * 0.9**degree + 0.5 * (-0.5) ** degree,
        ),
        "three parts": (
            0.25 * ker.maxwell(0.5) + 0.75 * ker.henyey_greenstein(0.6),
            lambda degree: 0.125 * (-1.0) ** degree + 0.75 * 0.6**degree,
        ),
        "part of the identity": (
            0.25 * ker.retroreflection() + 0.75 * ker.henyey_greenstein(0.5),
            lambda degree: 0.25 + 0.75 * 0.5**degree,
        ),
        "product": (ker.henyey_greenstein(0.5) @ ker.henyey_greenstein(0.8), lambda degree: 0.4**degree),
        "mirrored product": (ker.specular() @ ker.henyey_greenstein(0.5), lambda degree: (-0.5) ** degree),
        "power": (ker.henyey_greenstein(-0.7) ** 3, lambda degree: (-0.343) ** degree),
    }


@pytest.fixture(params=LAWS)
def law(request: pytest.FixtureRequest) -> ker.Law:
    """Every law of the library, alone and in sums, products, powers and the other frame."""
    return laws()[request.param]


@pytest.fixture
def bounce() -> type[DrivenLaw]:
    """Makes triangular teeth, known only by their rays; whether the mirror symmetry is known is its argument."""
    return bounced_law()


@pytest.fixture(params=BASES)
def basis(request: pytest.FixtureRequest) -> ker.Basis:
    """A basis of every kind, with and without the mirror symmetry."""
    return bases()[request.param]


@pytest.fixture(params=DIAGONAL)
def diagonal(request: pytest.FixtureRequest) -> tuple[ker.Law, np.ndarray]:
    """A law and its eigenvalues, that of the polynomial of degree l in place l."""
    law, eigenvalue = diagonal_laws()[request.param]
    return law, np.append(1.0, eigenvalue(np.arange(1.0, 400.0)))


@pytest.fixture
def matrix(law: ker.Law, basis: ker.Basis) -> ker.KernelMatrix:
    """The matrix of every law in every basis, by the method that is chosen for a rough tolerance; computed once."""
    key = id(law), id(basis)
    if key not in MATRICES:
        MATRICES[key] = ker.discretise(law, basis, tolerance=1e-3, samples=2**13, rng=5)
    return MATRICES[key]


MATRICES: dict[tuple[int, int], ker.KernelMatrix] = {}


# ---- workers -----------------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def workers():
    """Two workers in threads of this process."""
    distributed = pytest.importorskip("distributed")
    with distributed.Client(
        n_workers=2, threads_per_worker=1, processes=False, dashboard_address="127.0.0.1:0"
    ) as client:
        yield client


@pytest.fixture(scope="module")
def worker_processes():
    """Two workers in processes of their own."""
    pytest.importorskip("distributed")
    from asperity.core.workers import connected

    with connected(2) as client:
        yield client
