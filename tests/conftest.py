"""What tests share: every wall, law, basis and matrix as a fixture; a test that takes ``wall`` runs on all of them."""

import gc
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.kernels.laws.law import DrivenLaw
from wall_shapes import CLOSED, OPEN

# Made once, by what makes it.
made = cache(lambda make: make())


@pytest.fixture
def uncollected():
    """No collection of garbage: one takes over a second, as all tests and their modules are in memory."""
    gc.disable()
    yield
    gc.enable()


# ---- walls -------------------------------------------------------------------------------------------------------
@pytest.fixture(params=CLOSED | OPEN)
def wall(request):
    """Each wall by its name."""
    return made((CLOSED | OPEN)[request.param])


@pytest.fixture(params=CLOSED)
def closed_wall(request):
    """Each wall without islands."""
    return made(CLOSED[request.param])


# ---- laws, bases and matrices --------------------------------------------------------------------------------------
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


def halves_exchanged(theta: np.ndarray) -> np.ndarray:
    """Exchanges the two halves of (0, pi), keeping the orientation of u = -cos(theta)."""
    u = -np.cos(theta)
    return np.arccos(-np.where(u < 0.0, u + 1.0, u - 1.0))


def tilted(theta: np.ndarray, out: np.ndarray) -> np.ndarray:
    """A density that preserves sin(theta) d theta and is neither reversible nor mirror symmetric."""
    return (1.0 + 0.5 * np.cos(theta) * (1.5 * np.cos(out) ** 2 - 0.5)) * ker.SINE.density(out)


# What is made of the library is made inside functions: a fault that the mutants write into it must fail in tests.
# Cycles of three equal bins preserve the measure, but are not reversible; the other matrix is, but has no symmetry.
CYCLE = partial(ker.MatrixLaw, [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
LOPSIDED = partial(ker.MatrixLaw, [[0.5, 0.5, 0.0], [0.5, 0.25, 0.25], [0.0, 0.25, 0.75]])
TEETH, CREVICES = partial(ker.TriangularTeethLaw, 0.7), partial(ker.RectangularTeethLaw, 0.8)
ARCS = partial(ker.CircularArcLaw, 1.2)
# Every law of the library, alone and in sums, products, powers and the other frame.
LAWS: dict[str, Callable[[], ker.Law]] = {
    "specular": ker.specular,
    "retroreflection": ker.retroreflection,
    "lambertian": ker.lambertian,
    "maxwell": lambda: ker.maxwell(0.3),
    "scattering": lambda: ker.henyey_greenstein(0.6),
    "scattering back": lambda: ker.henyey_greenstein(-0.7),
    "density": lambda: ker.DensityLaw(lambda a, b: (1.0 + 0.5 * np.cos(a) * np.cos(b)) * ker.SINE.density(b)),
    "tilted density": lambda: ker.DensityLaw(tilted),
    "triangles": TEETH,
    "narrow triangles": lambda: ker.TriangularTeethLaw(0.02),
    "blunt triangles": lambda: ker.TriangularTeethLaw(2.0),
    "flat triangles": lambda: ker.TriangularTeethLaw(np.pi - 1e-4),
    "rectangles": CREVICES,
    "shallow rectangles": lambda: ker.RectangularTeethLaw(1e-6),
    "deep rectangles": lambda: ker.RectangularTeethLaw(2.5),
    "arcs": ARCS,
    "shallow arcs": lambda: ker.CircularArcLaw(0.02),
    "semicircles": lambda: ker.CircularArcLaw(0.5 * np.pi),
    "least resistance": ker.LeastResistanceLaw,
    "involution": lambda: ker.InvolutionLaw(halves_exchanged),
    "exchange": lambda: ker.IntervalExchangeLaw(ker.discretise(ker.lambertian(), ker.Bins(3))),
    "cycle": CYCLE,
    "lopsided matrix": LOPSIDED,
    "polygon": lambda: ker.PolygonLaw(geo.Wall.from_vertices([(0, 0), (0.3, -0.5), (1, 0)])),
    "wall in closed form": lambda: ker.WallLaw(geo.triangular_teeth(0.7)),
    "traced wall": lambda: ker.WallLaw(geo.dispersing_arcs(1.0)),
    "rays alone": lambda: bounced_law()(),
    "rays and their mirror images": lambda: bounced_law()(mirror_symmetric=True),
    "facets diffuse in part": lambda: ker.FacetedLaw(geo.triangular_teeth(0.9), ker.maxwell(0.3)),
    "mushrooms": lambda: ker.MushroomLaw(geo.MushroomGenerations(0.25, 0.5, 3)),
    "sum": lambda: 0.2 * ker.specular() + 0.5 * TEETH() + 0.3 * ker.lambertian(),
    "sum of isometries": lambda: 0.4 * TEETH() + 0.6 * ker.specular() @ TEETH(),
    "product": lambda: TEETH() @ ker.henyey_greenstein(0.7),
    "product of isometries": lambda: ker.TriangularTeethLaw(2.0 * np.pi / 7.0) @ CREVICES(),
    "product of matrices": lambda: CYCLE() @ LOPSIDED(),
    "power": lambda: CREVICES() ** 4,
    "other frame": lambda: ARCS().in_specular_frame(),
    "product in the other frame": lambda: (TEETH() @ TEETH()).in_specular_frame(),
}
# A basis of every kind, with and without the mirror symmetry.
BASES: dict[str, Callable[[], ker.Basis]] = {
    "bins": lambda: ker.Bins(8),
    "uneven bins": lambda: ker.Bins([0.0, 0.3, 1.1, 2.0, np.pi]),
    "polynomials": lambda: ker.Legendre(6),
    "panels": lambda: ker.Panels([0.0, 0.4, 2.0, np.pi], 2),
}
# Laws that polynomials diagonalise, and the eigenvalue that belongs to that of each degree l > 0.
DIAGONAL: dict[str, tuple[Callable[[], ker.Law], Callable]] = {
    "lambertian": (ker.lambertian, lambda degree: 0.0 * degree),
    "maxwell": (lambda: ker.maxwell(0.3), lambda degree: 0.7 * (-1.0) ** degree),
    "maxwell in the other frame": (lambda: ker.maxwell(0.3).in_specular_frame(), lambda degree: 0.7 + 0.0 * degree),
    "scattering back": (lambda: ker.henyey_greenstein(-0.7), lambda degree: (-0.7) ** degree),
    "two scatterings": (
        lambda: 0.5 * ker.henyey_greenstein(0.9) + 0.5 * ker.henyey_greenstein(-0.5),
        lambda degree: 0.5 * 0.9**degree + 0.5 * (-0.5) ** degree,
    ),
    "three parts": (
        lambda: 0.25 * ker.maxwell(0.5) + 0.75 * ker.henyey_greenstein(0.6),
        lambda degree: 0.125 * (-1.0) ** degree + 0.75 * 0.6**degree,
    ),
    "part of the identity": (
        lambda: 0.25 * ker.retroreflection() + 0.75 * ker.henyey_greenstein(0.5),
        lambda degree: 0.25 + 0.75 * 0.5**degree,
    ),
    "product": (lambda: ker.henyey_greenstein(0.5) @ ker.henyey_greenstein(0.8), lambda degree: 0.4**degree),
    "mirrored product": (lambda: ker.specular() @ ker.henyey_greenstein(0.5), lambda degree: (-0.5) ** degree),
    "power": (lambda: ker.henyey_greenstein(-0.7) ** 3, lambda degree: (-0.343) ** degree),
}


@pytest.fixture(params=LAWS)
def law(request: pytest.FixtureRequest) -> ker.Law:
    """Every law of the library, alone and in sums, products, powers and the other frame."""
    return made(LAWS[request.param])


@pytest.fixture
def bounce() -> type[DrivenLaw]:
    """Makes triangular teeth, known only by their rays; whether the mirror symmetry is known is its argument."""
    return bounced_law()


@pytest.fixture(params=BASES)
def basis(request: pytest.FixtureRequest) -> ker.Basis:
    """A basis of every kind, with and without the mirror symmetry."""
    return made(BASES[request.param])


@pytest.fixture(params=DIAGONAL)
def diagonal(request: pytest.FixtureRequest) -> tuple[ker.Law, np.ndarray]:
    """A law and its eigenvalues, that of the polynomial of degree l in place l."""
    make, eigenvalue = DIAGONAL[request.param]
    return made(make), np.append(1.0, eigenvalue(np.arange(1.0, 400.0)))


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
