"""What laws, bases, matrices and the tools built upon them refuse: the call, and the words that name the argument."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.errors import AccuracyError, InputError, WallError
from asperity.estimates import Estimate
from asperity.geometry.polygons.beams import beams_of
from asperity.kernels.bases.measure import measure_by_name
from asperity.kernels.billiards.record import BilliardRecord
from asperity.kernels.collisions.collision_law import CollisionCombination
from asperity.kernels.inverse.exchange_wall import ExchangeHollow
from asperity.spectral.consequences.random_flights import ChannelPaths
from asperity.spectral.work_diagrams.report import WorkRow

EXACT = Estimate(0.0, 0.0, "bound", "given")
MIRROR, DIFFUSE, BACK, HG = ker.specular(), ker.lambertian(), ker.retroreflection(), ker.henyey_greenstein
TEETH, CREVICES, ARC = ker.TriangularTeethLaw(0.9), ker.RectangularTeethLaw(0.8), ker.CircularArcLaw(1.0)
FLAT = geo.flat()
DISK, STRIP, CIRCLE = geo.Disk(1.0, 0.5), geo.Container.strip(), geo.Container.circle(1.0)
SMOOTH, NO_SLIP, PAIR = ker.smooth(DISK), ker.no_slip(DISK), ker.PairLaw(BACK, DISK)
ROUGH, GROOVES = ker.CollisionLaw(TEETH, DISK), ker.HemisphereLaw(DIFFUSE)
COIN, BUMPS = 0.5 * MIRROR + 0.5 * BACK, ker.WallLaw(geo.dispersing_arcs(0.8))
TWO_DEPTHS = geo.Wall.from_vertices([(0, 0), (0, -0.3), (0.4, -0.3), (0.4, -0.7), (0.9, -0.7), (0.9, 0), (1, 0)])
LEANING = geo.Wall.from_vertices([(0, 0), (0.2, -0.4), (1, 0)])
ANGLES = ker.Legendre(5), ker.Legendre(4, weight="sin2")
FLOOR, PLACES = geo.Wall.from_vertices([(0, -1), (1, -1)]), ker.PositionLaw([0.0, 1.0], [MIRROR])
ALONG = ker.CollisionAlongWall(PLACES, DISK)
SQUARE = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
PENTAGON = [(math.cos(0.4 * math.pi * k), math.sin(0.4 * math.pi * k)) for k in range(5)]
BODY = ker.PolygonalBody([[(-2.5, -1.5), (-1.0, -1.5), (-2.5, 0.0)]])
PLATE = [geo.Segment((0.2, -0.1), (0.4, -0.1)), geo.Segment((0.4, -0.1), (0.2, -0.1))]
ROOM, SEATS = geo.Container.polygon([(0, 0), (9, 0), (9, 6), (0, 6)]), [[2, 3], [6, 3]]
STEEP, ARRAY = [[1.1, -0.1], [0.0, 1.0]], np.array([[0.75, 0.25], [0.25, 0.75]])
WORK, METHOD = spec.WorkProblem("a", spec.ReferenceValue(1.0, 0.0, "by hand")), spec.WorkMethod("b", float)


def matrix(entries: object, basis: ker.Basis) -> ker.KernelMatrix:
    return ker.KernelMatrix(np.array(entries, dtype=float), basis, EXACT)


def counted() -> ker.KernelMatrix:
    theta = np.linspace(0.1, 3.0, 40)
    return ker.estimate(theta, theta, ker.Bins(2))


def moments(entries: object, weight: str = "sin") -> ker.KernelMatrix:
    return matrix(entries, ker.Legendre(len(entries), weight))  # type: ignore[arg-type]


def density(function: Callable) -> Callable:
    return lambda: ker.DensityLaw(function)


def wedge_record() -> BilliardRecord:
    return ker.play(geo.Container.wedge(1.0), SMOOTH, [1.0, 0.5], [-1.0, 0.1, 0.0], 20)


def paths(bend: float = math.inf) -> ChannelPaths:
    return spec.channel_paths(DIFFUSE, [1, 2, 3], 10, 0, bend=bend)


def design(**changed: object) -> Callable:
    given = {"objective": ker.resistance, "family": geo.triangular_teeth, "bounds": [(0.5, 2.0)], "grid": 3}
    return lambda: ker.design_wall(**given | changed)


def hollow(cells: int = 2, opening: float = 1e-2) -> ExchangeHollow:
    return ker.exchange_hollow(ker.IntervalExchangeLaw(ker.discretise(DIFFUSE, ker.Bins(cells))), opening)


def estimate(theta: list[float], out: list[float], basis: object) -> Callable:
    return lambda: ker.estimate(theta, out, basis)


def stream(given: object) -> Callable:
    return lambda: ker.estimate_stream(given, ker.Bins(2))


REFUSED = {
    "laws": [
        *((lambda make=make, size=size: make(size), "expected")
          for make in (ker.TriangularTeethLaw, ker.RectangularTeethLaw, ker.CircularArcLaw)
          for size in (0.0, -1.0, math.nan, math.inf)),
        *((lambda theta=theta: ARC.apply(np.cos, theta), "theta") for theta in (0.0, math.pi, -0.1, math.nan)),
        *((lambda law=law, x=x: law.reflect(x, 1.0), "x: expected entry points")
          for law in (TEETH, ARC, CREVICES) for x in (0.0, 1.0, -0.5)),
        (lambda: TEETH.sample(1.0, np.random), "Generator"),
        *((lambda a=a: ker.maxwell(a), "diffuse_fraction") for a in (-0.1, 1.1, math.nan)),
        *((lambda g=g: HG(g), "g: expected") for g in (1.0, -1.0, 1.5, math.nan)),
        (density(lambda a, b: np.sin(b)), r"rows that integrate to 1, got 2 at theta"),
        (density(lambda a, b: ker.SINE.density(b) * (1.0 + 3.0 * np.cos(b) + 0.0 * a)), "values of at least 0"),
        (density(lambda a, b: np.ones(5)), "vectorised"),
        (density(lambda a, b: np.full(np.broadcast_shapes(a.shape, b.shape), math.nan)), "finite"),
        (density(3.0), "function of"),  # type: ignore[arg-type]
        (lambda: ker.DensityLaw(lambda a, b: 1.0 / math.pi).adjoint(), "one that preserves sin"),
        *((lambda law=law, pair=pair: law.density(*pair), f"^{name}: expected angles in the open interval")
          for law in (HG(0.5), DIFFUSE, ker.MatrixLaw([[1.0]]), ker.DensityLaw(lambda a, b: 0.5 * np.sin(b)))
          for name, pair in (("theta_out", (1.0, -1.0)), ("theta", (4.0, 1.0)), ("theta_out", (1.0, [1.0, math.pi])))),
        (lambda: ker.SINE.density([1.0, -1.0]), "^angle: expected angles in the open interval"),
        (lambda: ker.InvolutionLaw(lambda t: np.arccos(np.cos(t) / 2.0)), "expected an involution"),
        # a rotation of u preserves the measure and is no involution (ledger S1.08)
        (lambda: ker.InvolutionLaw(lambda t: np.arccos(1.0 - np.mod(0.6 - np.cos(t), 2.0))), "expected an involution"),
        # tan(T/2) tan(theta/2) = 1/2 is an involution and stretches the measure
        (lambda: ker.InvolutionLaw(lambda t: 2.0 * np.arctan(0.5 / np.tan(0.5 * t))), r"d theta to be preserved"),
        (lambda: ker.InvolutionLaw(lambda t: t + math.pi), r"angles in \(0, pi\)"),
        (lambda: ker.InvolutionLaw(lambda t: np.ones(3)), "vectorised"),
        (lambda: ker.InvolutionLaw(lambda t: np.full(t.shape, math.nan)), "finite"),
        (lambda: ker.MatrixLaw([[1.0, 0.0], [0.5, 0.4]]), r"rows that sum to 1, got 0\.9 in row 1"),
        (lambda: ker.MatrixLaw(STEEP), r"probabilities, got -0\.1 in row 0, column 1"),
        (lambda: ker.MatrixLaw([[0.5, 0.5]]), "square"),
        (lambda: ker.MatrixLaw(moments(np.eye(3))), "on Bins in theta"),
        (lambda: ker.MatrixLaw(matrix(np.eye(2), ker.Bins(2, weight="sin2"))), "on Bins in theta"),
        (lambda: ker.MatrixLaw([[0.9, 0.5], [0.1, 0.5]]), "its columns sum to 1: pass the transpose"),
        (lambda: ker.MatrixLaw([[0.9, 0.5], [0.2, 0.5]]), "divided by their sums"),
        (lambda: ker.IntervalExchangeLaw(matrix(np.eye(3)[[1, 2, 0]], ker.Bins(3))), "symmetric"),
        (lambda: ker.IntervalExchangeLaw(matrix(0.5 * np.eye(3), ker.Bins(3))), "sum to 1"),
        (lambda: ker.WallLaw("koch"), "expected a Wall"),
        (lambda: ker.WallLaw(geo.dispersing_arcs(1.0)).branches(1.0), "no branches"),
        (lambda: ker.WallLaw(FLAT).conditionals([1.0], 1e-320), r"tolerance: expected a number of at least 2\.2e-16"),
        (lambda: ker.PolygonLaw(geo.Wall([geo.Segment((0, -1), (1, -1))], islands=[PLATE])), "WallLaw"),
        (lambda: ker.PolygonLaw(1.0), "wall"),
        (lambda: geo.MushroomGenerations(0.0, 0.1, 2), "stem_to_cap"),
        (lambda: geo.MushroomGenerations(0.5, -1.0, 2), "stem_aspect"),
        (lambda: geo.MushroomGenerations(0.5, 0.0, 2), "larger stem_aspect"),
        (lambda: geo.MushroomGenerations(0.5, 0.1, 0), "generations"),
        (lambda: ker.MushroomLaw(FLAT), "MushroomGenerations"),
        (lambda: beams_of([(1, 0), (0.5, -1), (0, 0)]), "left < right"),
        (lambda: beams_of([(0, 0), (0.5, 1), (1, 0)]), "y <= 0"),
    ],
    "sums and products": [
        (lambda: (0.3 * MIRROR + 0.6 * DIFFUSE).apply(np.cos, 1.0), r"expected a sum of 1, got 0\.89"),
        (lambda: (0.3 * MIRROR).sample(1.0, rng=0), "expected a sum of 1"),
        (lambda: (0.3 * MIRROR).branches(1.0), "expected a sum of 1"),
        (lambda: ((0.3 * MIRROR) @ MIRROR).apply(np.cos, 1.0), "expected a sum of 1"),
        (lambda: (1.5 * MIRROR + -0.5 * DIFFUSE).apply(np.cos, 1.0), r"ones, got -0\.5 for term 1, lambertian\(\)"),
        (lambda: math.nan * MIRROR, "finite weights"),
        (lambda: MIRROR**-1, "exponent"),
        (lambda: 0.5 * MIRROR + 0.5 * DIFFUSE.in_specular_frame(), "cannot add laws in different frames"),
        (lambda: (MIRROR**200000).apply(np.cos, 1.0), "power of at most 100000"),
        # from the numbers of angles that are known, before any are computed: within 10 s also under load
        (lambda: (HG(0.999) ** 4).conditionals(1.0), r"over 1e\+08 outgoing angles"),
        (lambda: (ker.TriangularTeethLaw(0.123) ** 6).branches(np.linspace(0.07, 3.05, 23)), "at most 64"),
    ],
    "positions": [
        (lambda: geo.join_walls([FLOOR]), "begin at height 0"),
        (lambda: geo.join_walls([FLAT], 0), "repeats"),
        (lambda: ker.PositionLaw([1.0, 0.0], [MIRROR]), "increasing"),
        (lambda: ker.PositionLaw([0.0, 1.0], []), "one for each"),
        (lambda: ker.PositionLaw([0.0, 1.0], [MIRROR.in_specular_frame()]), "convention"),
        (lambda: PLACES.sample(1.5, 1.0), "positions from 0 to 1"),
        (lambda: ker.position_distance(PLACES, ker.PositionLaw([0.0, 2.0], [MIRROR])), "length"),
        (lambda: ker.displacements(FLOOR, 200, rng=0).tail_exponent(), "more rays"),
        (lambda: ker.displacements(geo.mushrooms(0.4), 200, rng=0).tail_exponent(), "closes"),
    ],
    "walls on springs": [
        (lambda: ker.SpringWall(0.0, 1.0), "mass_ratio"),
        (lambda: ker.SpringWall(1.0, 0.0, depth=0.0), "depth"),
        (lambda: ker.SpringWall(1.0, 1.0).sample([[0.0, 1.0]]), "v2 < 0"),
        (lambda: ker.SpringWall(1.0, 1.0).sample([0.0, -1.0]), "shape"),
        (lambda: ker.SpringWall(1.0, 1.0).energy_accommodation(1.0), "differs"),
        (lambda: ker.SpringWall(1e308, 1e308), "acceleration is finite"),
        (lambda: ker.SpringWall(1.0, 1.0, 1e308), "acceleration is finite"),
        (lambda: ker.SpringWall(1.0, 1e308, 1e-300), "acceleration is finite"),
        (lambda: ker.SpringWall(1.0, 1.0, 1e10, 1e300), "acceleration is finite"),
        (lambda: ker.SpringWall(1.0, 1.0).sample([[1.0, -1e308]], rng=0), r"velocity: overflow .* against SpringWall"),
    ],
    "bases": [
        (lambda: ker.Bins(0), "whole number of at least 1"),
        (lambda: ker.Bins([0.0, 2.0, 1.0, np.pi]), "increasing"),
        (lambda: ker.Bins([0.1, np.pi]), "from 0 to pi"),
        (lambda: ker.Bins([0.0, np.nan, np.pi]), "finite"),
        (lambda: ker.Bins(3, weight="cos"), "weight"),
        (lambda: ker.Legendre(2.5), "whole number"),
        (lambda: ker.Panels([0.0, np.pi], -1), "degree"),
        (lambda: ker.TensorBasis((ker.Bins(2),)), r"as in TensorBasis\(\(Bins\(16\), Bins\(8, weight='sin2'\)\)\)"),
        (lambda: ker.TensorBasis((3, 4)), r"as in TensorBasis\(\(Bins\(16\), Bins\(8, weight='sin2'\)\)\)"),
        (lambda: ker.TensorBasis((ker.Bins(3), ker.Bins(3))).measure, "factors"),
        *((lambda size=size: ker.Panels.for_wall(FLAT, smallest=size), "smallest") for size in (2.0, 1e-13)),
        (lambda: ker.Panels.for_wall(geo.focusing_arcs(1.2), smallest=0.6), "smallest"),
        (lambda: ker.Legendre(0), "at least 1"),
        (lambda: ker.SINE.quantile([0.2, -0.5]), r"probability: expected numbers in \[0, 1\], got -0.5"),
        (lambda: ker.SINE_SQUARED.quantile([0.2, 1.5]), r"probability: expected numbers in \[0, 1\], got 1.5"),
        (lambda: ker.SINE.sample(-1), "size: expected a whole number of at least 0"),
        (lambda: ker.SINE.quadrature([0.0, np.pi], 0), "order: expected a whole number of at least 1"),
        (lambda: measure_by_name("cos"), "got 'cos'"),
        (lambda: ker.Bins(10**15), "GB of memory"),
        (lambda: ker.Panels([0.0, np.pi], 10**9), "GB of memory"),
    ],
    "matrices": [
        (lambda: ker.KernelMatrix(np.eye(3), ker.Bins(2), EXACT), "expected shape"),
        (lambda: ker.KernelMatrix(np.full((2, 2), np.nan), ker.Bins(2), EXACT), "finite"),
        (lambda: ker.KernelMatrix(np.eye(2), "bins", EXACT), "basis"),
        (lambda: ker.KernelMatrix(np.eye(2), ker.Bins(2), 0.1), "Estimate"),
        (lambda: ker.KernelMatrix(np.eye(2), ker.Bins(2), Estimate(math.nan, 0.0, "bound", "given")), "^error: expect"),
        *((lambda name=name, wrong=wrong: ker.KernelMatrix(np.eye(2), ker.Bins(2), EXACT, **{name: wrong}),
           f"^{name}: expected")
          for name, wrong in (("law", 3), ("method", None), ("metadata", 3), ("frame", "lab"), ("reversible", "yes"),
                              ("counts", np.full((2, 2), 0.5)), ("unresolved", math.nan), ("samples", 0.5))),
        *((lambda given=given: Estimate(*given), f"^{name}: expected") for given, name in (
            ((1.0, -1.0, "bound", ""), "error"), ((1.0, math.nan, "bound", ""), "error"),
            ((1.0, 0.1, "guess", ""), "kind"), (("many", 0.1, "bound", ""), "value"),
            ((10**400, 0.1, "bound", ""), "value"), ((1.0, 0.1, "bound", 3), "method"),
        )),
        *((call, r"1000000\) takes (8e\+03|4\.8e\+04) GB of memory") for basis in (ker.Bins(10**6), ker.Legendre(10**6))
          for call in (lambda basis=basis: ker.discretise(DIFFUSE, basis), estimate([1.0] * 100, [1.0] * 100, basis))),
        (lambda: matrix(np.eye(2), ker.Bins(2)) @ np.ones(3), "expected 2 entries"),
        (lambda: matrix(np.eye(2), ker.Bins(2)) ** -1, "exponent"),
        (lambda: matrix(np.eye(2), ker.Bins(2)) @ matrix(np.eye(3), ker.Bins(3)), "different bases"),
        (lambda: moments(np.eye(3)).flux, "flux"),
        (lambda: moments(np.eye(2)).tensor(moments(np.eye(2))).plot(), "one angle"),
        (lambda: matrix(np.eye(2), ker.Bins([0.0, 1.0, np.pi])).in_specular_frame(), "discretise law"),
        (lambda: matrix([[0.4, 0.6], [0.6, 0.4]], ker.Bins(2)).save("/no/folder/kernel.npz"), "cannot write"),
        (lambda: ker.load_matrix("missing.npz"), "No such file"),
        (lambda: ker.discretise("flat", ker.Bins(4)), "law: expected a Law"),
        (lambda: ker.discretise(DIFFUSE, 12), "basis: expected a Basis such as"),
        (lambda: ker.discretise(DIFFUSE, ker.Bins(4, weight="sin2")), "weight 'sin'"),
        (lambda: ker.discretise(DIFFUSE, ker.Bins(4), "guess"), "method: expected 'auto', "),
        (lambda: ker.discretise(DIFFUSE, ker.Bins(4), "exact"), "it has quadrature, monte-carlo"),
        (lambda: ker.discretise(DIFFUSE, ker.Bins(4), "qmc"), "it has quadrature, monte-carlo"),
        (lambda: ker.discretise(ker.maxwell(0.5), ker.Bins(4), "exact"), "lambertian.*no method 'exact'; it has quad"),
        (lambda: ker.discretise(ker.WallLaw(geo.mushrooms(0.3, 0.5)), ker.Bins(4), "exact"), "it has quadrature, qmc"),
        (lambda: ker.discretise(DIFFUSE, ker.Bins(4), tolerance=-1.0), "tolerance"),
        (lambda: ker.discretise(DIFFUSE, ker.Bins(4), samples=0), "samples"),
        (lambda: ker.discretise(DIFFUSE, ker.Bins(4), rng="three"), "rng"),
        (lambda: ker.discretise(0.5 * DIFFUSE, ker.Bins(4)), "sum of 1"),
        (lambda: ker.discretise(ARC @ TEETH, ker.Bins(10_000)), "GB"),
        # Gauss's and Kronrod's rule agreed by chance: a sixth of the error for one of these laws
        *((lambda law=law: ker.discretise(law, ker.Bins(6), "quadrature"), "quadrature")
          for law in (CREVICES, 0.3 * CREVICES + 0.7 * TEETH)),
        (lambda: ker.discretise(ROUGH, ker.Bins(8)), "one in psi"),
        (lambda: ker.discretise(DIFFUSE, ker.Bins(4, weight="sin2")), "preserves sin"),
        (estimate([0.5, 1.0], [0.5], ker.Bins(1)), "shape"),
        (estimate([0.0, 1.0], [0.5, 1.0], ker.Bins(1)), "theta_in: expected angles"),
        (estimate([0.5, 1.0], [0.5, np.nan], ker.Bins(1)), "theta_out: expected finite"),
        (estimate([0.5, 1.0], [0.5, 4.0], ker.Bins(1)), "theta_out: expected angles"),
        (estimate([0.5, 1.0], [0.5, 1.0], 3), "basis"),
        (estimate([0.5, 1.0], [0.5, 1.0], ker.Bins(2, weight="sin2")), "sin"),
        (estimate([], [], ker.Bins(1)), "at least 1"),
        (estimate([0.5] * 10, [0.5] * 10, ker.Legendre(2)), "at least 16"),
        (lambda: ker.estimate_stream((np.linspace(0.1, 3.0, 4000),) * 2, ker.Bins(6)), "pass invariant=False"),
        (stream([]), "at least 1 pairs"),
        (stream(np.ones((3, 3))), r"shape \(n, 2\)"),
        (stream("text"), "iterable of chunks"),
        (stream(7), "iterable of chunks"),
        (stream([([0.5, 1.0], [0.5])]), "as many outgoing as incoming"),
        (stream([([0.5], [4.0])]), "theta_out: expected angles"),
        (stream([0.5, 1.0]), "expected chunks"),
        (stream((np.ones(3), np.ones(4))), "one length"),
    ],
    "collisions": [
        *((lambda up=up: SMOOTH.sample([[[1.0, -1.0, 0.0]], *[[[1.0, up, 0.0]]] * 2]), r"v2 >= 0 at row \[1, 0\]")
          for up in (0.0, 1e-300, 2.0)),
        *((lambda wrong=wrong: SMOOTH.sample(wrong), "shape")
          for wrong in (3.0, [1.0, -1.0], [[1.0, -1.0, 0.0, 2.0]])),
        (lambda: ker.CollisionLaw(FLAT, DISK), "law"),
        (lambda: ker.CollisionLaw(DIFFUSE, DISK).branches(0.5), "isometries"),
        (lambda: ker.CollisionLaw(MIRROR, 3), "disk"),
        (lambda: ker.CollisionLaw(MIRROR.in_specular_frame(), DISK), "paper"),
        (lambda: ker.CollisionLaw(0.5 * DIFFUSE, DISK), "sum of 1"),
        (lambda: ker.CollisionLaw.from_wall(MIRROR, DISK), "wall"),
        (lambda: ROUGH @ ker.CollisionLaw(MIRROR, geo.Disk(1.0, 1.0)), "different disks"),
        (lambda: (0.3 * ROUGH).sample([[0.0, -1.0, 0.0]]), "sum of 1"),
        (lambda: -0.5 * ROUGH, "at least 0"),
        (lambda: (0.5 * ROUGH + 0.5 * (ROUGH @ ROUGH)) ** -1, "exponent"),
        (lambda: ROUGH.apply_to_states(lambda y, t, p: p, [1.0, 2.0, 3.0], 1.0, 1.0), "shape"),
        (lambda: (ROUGH @ ROUGH).operator(*ANGLES).theta_matrix, "no term of this law flips"),
        *((lambda terms=terms: CollisionCombination(terms, DISK), words) for terms, words in (
            ((), "one with flip"), (((1.0, MIRROR, True),) * 2, "one with flip"), (([1.0, MIRROR, True],), "tuples"),
            (((1.0, MIRROR.in_specular_frame(), True),), "paper's convention"))),
        (lambda: SMOOTH.apply(lambda t, p: np.stack([t * p, p * t], axis=-1), 1.0, 1.0), r"1\), got \(\d+, 1, 2\)"),
        (lambda: ker.CollisionAlongWall(MIRROR, DISK), "PositionLaw"),
        (lambda: ker.play(CIRCLE, ALONG, [0.0, 0.0], [1.0, 0.0, 0.0], 1), "length of wall 0"),
        (lambda: ALONG.sample_at([0.5], [1.0, -1.0, 0.0]), "shape"),
        (lambda: ALONG.sample_at([1.5], [[1.0, -1.0, 0.0]]), "positions from 0 to 1"),
        (lambda: ker.play(STRIP, [ALONG, ker.smooth(geo.Disk(1.0, 1.0))], [0.0, 0.5], [0.0, 1.0, 0.0], 1), "same disk"),
        (lambda: ker.weak_limit(DISK, FLAT, [1e-2], window=0.0), "window"),
        (lambda: ker.weak_limit(DISK, FLAT, [1e-2], repetitions=1), "repetitions"),
        (lambda: ker.weak_limit(DISK, FLAT, [1e-2], {}), "pairs"),
        (lambda: ker.weak_limit(DISK, FLAT, [[1e-2]]), "scales"),
        *((lambda e=e: ker.weak_limit(DISK, FLAT, e, rng=0, samples=8), "scales: .*at least") for e in (1e-20, 1e-300)),
        (lambda: ker.limit_study(DISK, FLAT, [1e-3], rng=0, psi=[[1.0]]), "psi"),
    ],
    "billiards": [
        (lambda: ker.play(STRIP, NO_SLIP, [[0.0, 2.0]], [[0.0, 1.0, 0.0]], 3), "centres in the container"),
        (lambda: ker.play(STRIP, [NO_SLIP], [[0.0, 0.0]], [[0.0, 1.0, 0.0]], 3), "one for each of the 2 walls"),
        (lambda: ker.play(STRIP, NO_SLIP, [[0.0, 0.0]], [[0.0, 1.0]], 3), r"shape \(1, 3\)"),
        (lambda: geo.Container.polygon([(0, 0), (1, 0), (0.2, 0.2), (0, 1)]), "convex"),
        (lambda: geo.Container.polygon([(0, 0), (0, 1), (1, 0)]), "counterclockwise"),
        (lambda: geo.Container([[0, 0]], [[0, 2]]), "unit vectors"),
        (lambda: wedge_record().phase_portrait("boundary"), "from curves"),
        (lambda: wedge_record().phase_portrait("angle"), "'boundary' or 'velocity'"),
        (lambda: wedge_record().animate(duration=1e308), "duration: expected a number in"),
        (lambda: spec.channel_paths("lambertian", [1, 2, 3]), "expected a Law such as"),
        (lambda: spec.channel_paths(DIFFUSE, [1, 2]), "increasing positive times"),
        (lambda: spec.channel_diffusivity(DIFFUSE, [20.0], 4, speed=5e-324), r"speed: expected a number in \(1e-150"),
        *((lambda r=r: spec.channel_paths(DIFFUSE, [1, 2, 3], bend=r, speed=1e308), "flights") for r in (3, math.inf)),
        (lambda: spec.channel_paths(DIFFUSE, [1, 2, 3], bend=1.0), "greater than the radius"),
        (lambda: spec.channel_paths(DIFFUSE, [1, 2, 3], arrangement="shifted"), "arrangement"),
        (lambda: paths().limit_variance(), "at least 320"),
        (lambda: paths().variance_rate(), "bent channel"),
        (lambda: paths(bend=3.0).limit_variance(), "straight channel"),
        (lambda: ker.play_gas(ROOM, PAIR, [[1, 1], [1, 2]], np.zeros((2, 3)), 1), "2 apart, got disks 0 and 1"),
        (lambda: ker.play_gas(ROOM, ker.PairLaw(MIRROR, geo.Disk(), geo.Disk(radius=2.0)), SEATS,
                              np.zeros((2, 3)), 1), "two equal disks"),
        (lambda: ker.play_gas(ROOM, PAIR, SEATS, np.zeros((2, 3)), 1, MIRROR), "law of angles"),
        (lambda: ker.play_gas(ROOM, PAIR, SEATS, np.zeros((2, 3)), 1, ker.smooth(geo.Disk(2.0))), "disk of the pair"),
        (lambda: PAIR.sample([0.0, 1.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.0]), "approach each other"),
        (lambda: PAIR.sample([0.0, 2.0], [0.0, -1.0, 0.0], [0.0, 0.0, 0.0]), "unit vectors"),
        (lambda: ker.play_gas(ROOM, PAIR, SEATS, [[1.0, 0.1, 0.0], [0, 0, 0]], 5).rotational_fraction(1.0), "burn_in"),
        (lambda: ker.lyapunov_exponent(STRIP, SMOOTH), "outer loop"),
        (lambda: ker.lyapunov_exponent(CIRCLE, ker.CollisionLaw(DIFFUSE, DISK)), "random law"),
        (lambda: ker.lyapunov_exponent(CIRCLE, MIRROR), "law of angles"),
        (lambda: ker.lyapunov_exponent(CIRCLE, ALONG, rng=0), "collision laws"),
    ],
    "bodies": [
        (lambda: BODY.scatter_in(geo.Container.polygon([(-3, -2), (4, -2), (4, 3)]), 10), "contains the body"),
        (lambda: BODY.scatter_in(geo.Container.strip(9.0), 10), "outer loop"),
        (lambda: BODY.scatter_in(FLAT, 10), "Container"),
        (lambda: BODY.scatter_in(geo.Container.sinai(9.0, 0.5), 10), "convex"),
        (lambda: ker.PolygonalBody([[(0, 0), (1, 0)]]), "three points"),
        (lambda: ker.PolygonalBody([[(0, 0), (1, 0), (2, 0)]]), "area"),
        (lambda: ker.PolygonalBody([]), "polygons"),
        (lambda: BODY.scatter([[5.0, 5.0]], [[0.0, 0.0]]), "other than 0"),
        (lambda: BODY.scatter_in_circle(10, 0, radius=0.1), "to contain"),
        (lambda: ker.spin_force(MIRROR.in_specular_frame(), 0.1), "convention"),
        (lambda: BODY.force(0.0, 10), "rays"),
        (lambda: ker.RoughBody.polygon([MIRROR], [(0, 0), (1, 0), (0, 1)]), "one for every side"),
        (lambda: ker.RoughBody.ellipse([MIRROR] * 720, 2.0, 1.0), "one for every side"),
        (lambda: ker.RoughBody.polygon(MIRROR, 2 * SQUARE), "in sum 2 times"),
        (lambda: ker.RoughBody.polygon(MIRROR, [PENTAGON[2 * k % 5] for k in range(5)]), "in sum 2 times"),
        (lambda: ker.RoughBody.polygon(MIRROR, [(0, 0), (1, 0), (2, 0)]), "convex"),
        (lambda: ker.RoughBody((), (), MIRROR), "of length 0"),
        (lambda: ker.RoughBody((), (), MIRROR, radius=np.cos), "at least 0"),
        (lambda: ker.RoughBody((), (), MIRROR, radius=lambda n: 2.0 + np.cos(n)), "misses itself"),
        (lambda: ker.PolygonalBody([SQUARE[:1] + 2 * SQUARE[1:]]), "meets itself nowhere"),
        (lambda: ker.PolygonalBody([[PENTAGON[2 * k % 5] for k in range(5)]]), "meets itself nowhere"),
        (lambda: ker.PolygonalBody([SQUARE, [(0.5, 0.5), (2, 0.5), (2, 2)]]), "disjoint interiors"),
        (lambda: ker.PolygonalBody([SQUARE]).scatter([[0.5, 0.5]], [[1.0, 0.0]]), "outside of the body"),
        (lambda: ker.RoughBody.polygon(MIRROR, [(0, 0), (1, 2), (1, 0)]), "against the clock"),
        (lambda: ker.RoughBody.disk(lambda: MIRROR), "law: expected a function from the direction"),
        (lambda: ker.RoughBody.disk(lambda normal: math.sqrt(-1.0 - normal)), "math domain error"),
        (lambda: ker.RoughBody.disk(lambda normal: ker.maxwell(-1.0)), "diffuse_fraction"),
        (lambda: ker.RoughBody.disk(MIRROR).resistance(cost=lambda u, v: np.exp(1j * u)), "expected numbers"),
        (lambda: ker.RoughBody.disk(MIRROR).resistance(cost=lambda u, v: math.cos(u - v)), "vectorised"),
        (lambda: ker.RoughBody.disk(MIRROR).resistance(directions=lambda u: np.ones(7)), "vectorised"),
        *((lambda law=law: ker.RoughBody.disk(law), "law: expected") for law in (None, 1.0, DISK, int)),
    ],
    "distances": [
        (lambda: ker.distance(matrix(np.eye(2), ker.Bins(2)), matrix(np.eye(3), ker.Bins(3))), "different bases"),
        (lambda: ker.distance(MIRROR, MIRROR, kind="nearby"), "kind"),
        (lambda: ker.distance(MIRROR, MIRROR, order=0.5), "at least 1"),
        *((lambda order=order: ker.distance(MIRROR, MIRROR, order), "order: expected")
          for order in (-1, np.nan, np.inf, "two")),
        (lambda: ker.difference_test(counted(), counted(), 0.5), "order: expected"),
        (lambda: ker.distance(moments(np.eye(4)), matrix(np.eye(4), ker.Bins(4))), "on Bins"),
        (lambda: ker.difference_test(matrix(np.eye(2), ker.Bins(2)), matrix(np.eye(2), ker.Bins(2))), "counts"),
        (lambda: ker.distance(SMOOTH, MIRROR), "two collision laws"),
        (lambda: ker.distance(matrix(np.eye(2), ker.Bins(2)), SMOOTH), "two collision laws"),
        (lambda: ker.distance(SMOOTH, NO_SLIP, kind="pseudometric"), "expected 'rows', 'sup' or 'joint'"),
        (lambda: ker.distance(SMOOTH, SMOOTH @ SMOOTH), "both turn psi into pi - psi, or both keep it"),
        (lambda: ker.retroreflection_distance(MIRROR.in_specular_frame()), "Wall, or a law"),
        (lambda: ker.retroreflection_distance(FLAT, 10), "rays"),
    ],
    "walls for wishes": [
        (lambda: geo.notched_angle(math.pi, 3), "angle"),
        (lambda: geo.notched_angle(0.3, 0), "notches"),
        (lambda: geo.tube(2_000_000, 0.1), "at most 1000000"),
        (lambda: geo.tube(3, 0.4, 0.1), "at least the height"),
        (lambda: ker.exchange_hollow(DIFFUSE, 0.1), "exchange: expected"),
        (lambda: hollow(opening=0.0), "opening"),
        (lambda: hollow(opening=0.5), "opening"),
        (lambda: hollow().generations(0), "number"),
        (lambda: hollow().generations(2, neck=0.0), "neck"),
        (lambda: hollow().generations(2, neck=1e6), "neck"),
        (design(wanted="most"), "wanted"),
        (design(bounds=[(1.0, 0.5)]), "bounds"),
        (lambda: ker.wall_for("lambert"), "law: expected a Law"),
        (lambda: ker.wall_for(DIFFUSE, moments=1), "moments"),
        (lambda: ker.wall_for(DIFFUSE, tolerance=0.0), "tolerance"),
        (lambda: ker.wall_for(DIFFUSE, hollows=[]), "hollows: expected at least one"),
        (lambda: ker.wall_for(DIFFUSE, hollows=["flat"]), r"hollows\[0\]: expected a Wall"),
        (lambda: ker.wall_for(DIFFUSE, most_hollows=0), "most_hollows"),
        (lambda: ker.wall_for(TEETH @ HG(0.5)), "symmetric"),
        (lambda: ker.wall_for(moments([[1, 0, 0], [0, 0.3, 0.2], [0, 0.1, 0.2]])), "from their transpose by 0.14"),
        (lambda: ker.wall_for(moments([[1.0, 0.1], [0.1, 0.3]])), "miss those of a law by 0.1"),
        (lambda: ker.wall_for(moments(np.eye(3), "sin2")), "weight sin"),
        (lambda: ker.wall_for(moments([[1.0]])), "at least 2 moments"),
        (lambda: ker.dichotomy([FLAT, FLAT]), "at least 4 walls"),
    ],
    "spectra": [
        (lambda: spec.spectrum(MIRROR, k=0), "k: expected"),
        (lambda: spec.spectrum(HG(0.5), tolerance=5e-324), "tolerance"),
        (lambda: spec.spectrum(np.eye(3)), "kernel: expected"),
        (lambda: spec.spectral_gap(DIFFUSE, tolerance=0.0), "tolerance"),
        (lambda: spec.enclosures(DIFFUSE, 0), "k: expected"),
        (lambda: spec.enclosures(np.eye(2), 1), "law: expected"),
        (lambda: spec.enclosures(HG(0.5) @ HG(0.8), 2), "no known error"),
        *((lambda width=width: spec.prove_gap(DIFFUSE, width), "width") for width in (0.0, 1.0, math.nan)),
        *((lambda law=law: spec.prove_gap(law), "law: expected the law of")
          for law in (ARC @ ARC, ARC @ HG(0.5), TEETH, BUMPS @ HG(0.5), 0.5 * HG(0.5) + 0.5 * HG(0.2),
                      (0.5 * BUMPS + 0.5 * HG(0.2)).in_specular_frame())),
        *((lambda law=law: spec.diffusivity(law), "equally long")
          for law in (CREVICES, ker.WallLaw(geo.rectangular_teeth(2.0)), CREVICES @ ker.RectangularTeethLaw(0.5), COIN,
                      BACK.in_specular_frame(), ker.WallLaw(TWO_DEPTHS))),
        *((lambda law=law, call=call, lengths=lengths: call(law, lengths, 10), "every ray keeps its angle")
          for law in (CREVICES, COIN)
          for call, lengths in ((spec.channel_diffusivity, [5.0]), (spec.exit_times, [1.0, 2.0, 4.0]))),
        (lambda: spec.prove_gap(np.eye(2)), "law: expected a Law such as"),
        # an array that stands for a law is not printed, but what makes a law of it
        *((call, r"(?s)^(?!.*0\.75).*ker\.MatrixLaw\(array\)") for call in (
            lambda: ker.KernelMatrix(ARRAY, ker.Bins(2)), lambda: spec.spectral_gap(ARRAY),
            lambda: spec.spectrum(ARRAY), lambda: spec.enclosures(ARRAY), lambda: spec.diffusivity(ARRAY),
            lambda: spec.exit_times(ARRAY, [1.0, 2.0, 3.0], 10), lambda: ker.distance(ARRAY, ARRAY),
            lambda: ker.discretise(ARRAY, ker.Bins(2)))),
        *((lambda angle=angle: spec.accommodation(DIFFUSE, theta=[1.0, angle]), "take one beside it")
          for angle in (np.pi / 2, np.arcsin(np.pi / 4), np.pi - np.arcsin(np.pi / 4))),
        (lambda: spec.accommodation(FLAT), r"law: expected a Law such as ker\.WallLaw.*; take ker\.WallLaw\(wall\)"),
        (lambda: spec.diffusivity(MIRROR), "infinite"),
        (lambda: spec.diffusivity(DIFFUSE, arrangement="glide"), "arrangement"),
        *((lambda lengths=lengths: spec.channel_diffusivity(DIFFUSE, lengths), "^lengths: expected ")
          for lengths in ([], [0.0], [-1.0], [2.0, 1.0], [1.0, np.inf], [np.nan])),
        (lambda: spec.sweep(ker.maxwell, {"diffuse_fraction": [0.5]}, quantities=["diffusivity"]), "eta times 4"),
    ],
    "accommodation and fractions by angle": [
        *((lambda degrees=degrees: spec.accommodation(DIFFUSE, incidence_deg=degrees), "^incidence_deg: .*" + words)
          for degrees, words in (
              ([0, 90], "-90, 90"), ([-120.0], "-90, 90"), ([], "at least one angle"), ([np.nan], "finite"),
              (np.degrees(np.arccos(np.pi / 4)), "take one beside it"))),
        (lambda: spec.accommodation(DIFFUSE, theta=1.0, incidence_deg=30.0), "either this or theta"),
        (lambda: spec.accommodation(GROOVES, incidence_deg=30.0), "^incidence_deg: expected none"),
        (lambda: spec.accommodation(GROOVES, theta=[1.0]), "theta: expected none"),
        (lambda: spec.accommodation(GROOVES @ GROOVES), r"1 - H.matrix\(1, 1\)"),
        (lambda: spec.bounce_shares(FLAT, 95.0), "^incidence_deg: "),
        (lambda: spec.bounce_shares(FLAT, []), "^incidence_deg: "),
        (lambda: spec.bounce_shares(FLAT, 0.0, 0), "^most: "),
        (lambda: spec.bounce_shares(DIFFUSE, 0.0), "^wall: "),
        (lambda: spec.specular_share(MIRROR, [0.0, 90.0]), "^incidence_deg: "),
        *((lambda law=law: spec.specular_share(law), "^law: expected")
          for law in (TEETH @ TEETH, ker.LeastResistanceLaw(), BUMPS**2)),
    ],
    "transmission": [
        *((lambda more=more: spec.transmission(**{"law": DIFFUSE, "length": 1.0} | more), words) for more, words in (
            ({"law": "diffuse"}, "law: expected a Law"),
            ({"length": 0.0}, r"length: expected a number in \(0, "),
            ({"length": -1.0}, r"length: expected a number in \(0, "),
            ({"length": math.inf}, "length: expected finite"),
            ({"length": [1.0, 2.0]}, "length: expected one number"),
            ({"section": "square"}, "section: expected 'channel' or 'tube'"),
            ({"tolerance": 0.0}, "tolerance: expected a number greater than 0"),
            ({"section": "tube", "law": ARC}, "law: in a tube expected lambertian"),
            ({"section": "tube", "length": 2.1e5}, r"length: in a tube expected at most 200000 radii"),
            ({"section": "tube", "law": ker.maxwell(0.5), "length": 5e5}, "over the diffuse fraction, got 500000, 0.5"),
            ({"law": 2.0 * DIFFUSE}, "weights"),
            ({"law": 0.5 * ker.HemisphereLaw(ARC), "section": "tube"}, "weights"),
            ({"law": ker.CollisionLaw(ARC, DISK)}, "law: expected a Law"),
            ({"other": DIFFUSE, "section": "tube"}, "other: a tube has one wall.*take section='channel'"),
            ({"other": ker.HemisphereLaw(ARC)}, "other: expected a Law in the plane such as"),
            ({"other": ARC, "law": ker.HemisphereLaw(ARC)}, "other: expected a DirectionLaw such as ker.HemisphereLaw"),
            ({"rng": -1}, "rng: expected"))),
        *((lambda call=call: call(ARC, [1.0, 2.0, 4.0], 10, other=DIFFUSE.in_specular_frame()),
           r"other: expected a law in the convention of the first, .*; call in_specular_frame\(\) on one of them")
          for call in (spec.channel_paths, spec.channel_diffusivity, spec.exit_times, lambda law, *_, other:
                       spec.transmission(law, 1.0, other=other))),
        *((lambda call=call: call(CREVICES, [1.0, 2.0, 4.0], 10, other=COIN), "every ray keeps its angle")
          for call in (spec.channel_diffusivity, spec.exit_times)),
    ],
    "laws of directions": [
        (lambda: ker.HemisphereLaw(FLAT), "law: expected a Law"),
        (lambda: ker.HemisphereLaw(0.5 * DIFFUSE), "weights: expected a sum of 1"),
        (lambda: ker.HemisphereLaw(DIFFUSE, "along"), "orientation: expected an angle in radians or 'random'"),
        (lambda: ker.HemisphereLaw(DIFFUSE, np.nan), "orientation: expected finite"),
        (lambda: ker.HemisphereLaw(DIFFUSE, 90), "orientation: expected an angle in radians, at most 2 pi"),
        (lambda: GROOVES.sample([[0.0, 0.0, 1.0]]), r"incoming ones.*got \[0.0, 0.0, 1.0\] at row \[0\]"),
        (lambda: GROOVES.sample([[0.0, 0.0, -1.0], [0.0, 0.0, 0.0]]), r"at row \[1\]"),
        (lambda: GROOVES.sample([[0.0, np.inf, -1.0]]), "velocity: expected finite"),
        (lambda: GROOVES.sample([[0.0, -1.0]]), r"velocity: expected shape \(..., 3\)"),
        (lambda: (0.5 * GROOVES).sample([[0.0, 0.0, -1.0]]), "weights: expected a sum of 1"),
        (lambda: (2.0 * GROOVES + -1.0 * ker.HemisphereLaw(MIRROR)).matrix(2, 0), "weights: expected non-negative"),
        (lambda: np.inf * GROOVES, "weight"),
        (lambda: GROOVES.matrix(2, 3), "m: expected a whole number from 0 to 2"),
        (lambda: GROOVES.matrix(-1, 0), "degree"),
        (lambda: ker.HemisphereLaw(DIFFUSE, 0.1).matrix(4, 1), r"use ker.discretise\(H, ker.Zernike\(4\)\)"),
        (lambda: ker.discretise(GROOVES, ker.Legendre(4)), "basis: expected a Zernike"),
        (lambda: ker.discretise(DIFFUSE, ker.Zernike(4)), r"use it with ker.HemisphereLaw\(law\)"),
        (lambda: ker.Zernike(-1), "degree"),
        (lambda: ker.Zernike(2).evaluate([1.0, 0.0, 0.0]), "expected shape"),
    ],
    "tables": [
        *((lambda given=given: DIFFUSE.table(*given), f"^{name}: ") for given, name in (
            ((1, 5), "n_in"), ((5, 1), "n_out"), ((2.5, 5), "n_in"), ((5, 5, 0.0), "tolerance"),
            ((10**9, 10**9), "n_in, n_out"))),
        (lambda: (0.5 * MIRROR + 0.4 * DIFFUSE).table(4, 4), "weights"),
    ],
    "work": [
        (lambda: spec.ReferenceValue(np.nan, 0.0, "?"), "value: expected finite"),
        (lambda: spec.ReferenceValue(1.0, -1.0, "?"), "error: expected"),
        (lambda: spec.ReferenceValue(1.0, 0.0, ""), "source: expected words"),
        (lambda: spec.WorkProblem("none", ()), "references: expected at least one"),
        (lambda: WorkRow("a", 1, "finished"), "status: expected"),
        (lambda: spec.fit_order([1, 2, 3], [1, 0, 1]), "positive numbers"),
        (lambda: spec.fit_order([1, 2, 3], [1, 1, 1], [1, 1]), "for each of 3 sizes"),
        (lambda: spec.fit_order([1, 2, 3], [1, 1, 1], [1, 1, 0]), "for each of 3 sizes"),
        (lambda: spec.work_precision(WORK, [], [1]), "methods: expected at least one"),
        (lambda: spec.work_precision(WORK, [METHOD], {"simpson": [1]}), "budgets: expected"),
        (lambda: spec.work_precision(WORK, [METHOD] * 2, [1]), "with different names"),
    ],
}  # fmt: skip
NOT_SYMMETRIC = ker.MatrixLaw(np.roll(np.eye(8), 1, axis=1))
INACCURATE = [
    (lambda: spec.spectrum(ker.discretise(NOT_SYMMETRIC, ker.Bins(8))), "not symmetric"),
    (lambda: spec.spectral_gap(NOT_SYMMETRIC), "not symmetric"),
    (lambda: spec.enclosures(NOT_SYMMETRIC, 2), "not symmetric"),
    *(
        (lambda law=law: spec.spectral_gap(law), "not known to be symmetric")
        for law in (ker.HemisphereLaw(ARC) @ GROOVES, ker.HemisphereLaw(ker.PolygonLaw(LEANING), 0.2))
    ),
    (lambda: spec.mixing_time(MIRROR), "not known to have a gap"),
    (lambda: ker.play_gas(ROOM, PAIR, SEATS, np.zeros((2, 3)), 1), "no disk meets"),
    (lambda: ker.estimate([0.5, 1.2], [0.5, 3.0], ker.Bins(4)), r"2 of 4 bins have no incoming pair \(bins 2, 3\)"),
]


@pytest.mark.parametrize(("call", "words"), [row for rows in REFUSED.values() for row in rows])
def test_wrong_arguments_are_refused_in_words_that_name_them(call: Callable, words: str) -> None:
    with pytest.raises(InputError, match=words):
        call()


@pytest.mark.parametrize(("call", "words"), INACCURATE)
def test_what_cannot_be_computed_is_refused_with_the_defect(call: Callable, words: str) -> None:
    with pytest.raises(AccuracyError, match=words):
        call()


def test_hollows_that_cross_themselves_are_no_hollows() -> None:
    with pytest.raises(WallError, match="cross itself"):
        beams_of([(0, 0), (1, -1), (0, -1), (1, 0)])


def test_operands_of_another_kind_are_left_to_python() -> None:
    for call in (lambda: "a" * MIRROR, lambda: True * MIRROR, lambda: MIRROR + 1.0, lambda: MIRROR @ 1.0,
                 lambda: np.ones(2) * MIRROR, lambda: MIRROR * MIRROR, lambda: ROUGH + 1.0,
                 lambda: GROOVES + DIFFUSE, lambda: GROOVES @ 1.0, lambda: "a" * GROOVES):  # fmt: skip
        with pytest.raises(TypeError):
            call()
