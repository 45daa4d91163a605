"""Arguments that every public callable and method takes, for tests and campaigns that replace one after the other."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.estimates import Estimate
from asperity.study import study_wall

TEETH, DISK, LAW = geo.triangular_teeth(1.0), geo.Disk(), ker.henyey_greenstein(0.5)
MUSHROOMS = geo.MushroomGenerations(0.25, 0.5, 2)
BINS, MATRIX = ker.Bins(4), ker.discretise(LAW, ker.Bins(4))
SAMPLED = ker.discretise(LAW, BINS, "monte-carlo", samples=64, rng=0)
COLLISION, SPACE = ker.CollisionLaw(LAW, DISK), geo.ConfigurationSpace(TEETH, DISK, 0.01)
PROFILE, STRIP = geo.Profile([0.0, 1.0, 2.0], [0.0, -1.0, 0.5], "um"), geo.Container.strip()
CIRCLE = geo.Container.circle()
BUMPS = geo.SatelliteDisk(DISK, 9, 0.1)
SURFACE = geo.Surface([[0.0, 0.3], [0.5, 0.1]], 0.5, "um")
PAIR, GROOVES = ker.PairLaw(LAW, DISK), ker.HemisphereLaw(LAW)
RECORD = ker.play(CIRCLE, ker.smooth(DISK), [0.5, 0.0], [0.0, 1.0, 0.0], 3)
GAS = ker.play_gas(CIRCLE, PAIR, [[0.0, 0.0]], [[1.0, 0.0, 0.0]], 3, rng=0)
VELOCITY, POSITION = [[0.2, -1.0, 0.1]], [[0.3, 0.1]]
ARC, SINE = geo.Arc((0.5, 0.0), 0.5, 3.2, 4.0), ker.SINE
EDGES = np.array([0.0, 1.0, 2.0, np.pi])
TRIANGLES, ROUGH = ker.TriangularTeethLaw(1.0), ker.RoughBody.disk(LAW)
ALONG = ker.PositionLaw([0.0, 1.0], [LAW])
MOMENTUM_BINS = ker.Bins(2, "sin2")
HALVES = ker.IntervalExchangeLaw(ker.discretise(ker.lambertian(), ker.Bins(2)))
TRIANGLE = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)]
REFERENCE = spec.ReferenceValue(0.0, 0.0, "by hand")
INCOMING, OUTGOING = [0.5, 1.0, 2.0, 2.5], [0.5, 2.0, 1.0, 2.5]


def arc_of(half_angle: float) -> geo.Wall:
    return geo.focusing_arcs(half_angle)


def seeded(rng: int) -> ker.Law:
    return ker.maxwell(np.random.default_rng(rng).uniform())


# Methods that operators and brackets call.
OPERATORS = ("__call__", "__getitem__", "__matmul__", "__add__", "__sub__", "__mul__", "__rmul__", "__pow__")
# Functions of the first pages (README.md, docs/index.md, docs/quickstart.md) and their kin; all constructors join them.
FIRST = {
    "accommodation", "collide", "CollisionLaw.sample", "dispersing_arcs", "discretise", "distance", "elliptical_arcs",
    "focusing_arcs", "henyey_greenstein", "koch", "Law.apply", "Law.sample", "maxwell", "no_slip",
    "rectangular_teeth", "resistance", "smooth", "spectral_gap", "spectrum", "trace", "trajectory",
    "triangular_teeth", "Wall.foreshorten", "wall_for", "wall_from_text",
}  # fmt: skip
# How Python and numpy refuse what is no number, no length, no truth, or no path; the lines of the call say the rest.
PLAIN = (TypeError, ValueError)
# They hold what the library found, take no arguments, or are bases and protocols; `verify` has its own fuzz, and
# `check_proof` its own damaged certificates.
LEFT_OUT = {
    "Basis", "check_proof", "Conditionals", "Container", "DiskStatus", "double_parabola", "flat", "invisible_body",
    "lambertian", "Law", "LeastResistanceLaw", "Proof", "retroreflection", "SpectralGap", "Spectrum", "specular",
    "Status", "SweepTable", "verify", "WorkReport", "zero_resistance_body",
}  # fmt: skip


def is_strict(name: str, function: Callable[..., Any]) -> bool:
    """Whether it is a constructor or a function of the first pages, which refuse wrong arguments with InputErrors."""
    return name in FIRST or inspect.isclass(function) or inspect.isclass(getattr(function, "__self__", None))


def methods_of(kind: type) -> set[tuple[type, str]]:
    """The public methods of a class that take arguments, with the class that defines them."""
    found = set()
    for base in kind.__mro__:
        if not base.__module__.startswith("asperity") or getattr(base, "_is_protocol", False):
            continue
        for name, member in vars(base).items():
            function = member.__func__ if isinstance(member, (classmethod, staticmethod)) else member
            public = name in OPERATORS or not name.startswith("_")
            if public and inspect.isfunction(function):
                own = 0 if isinstance(member, staticmethod) else 1
                found |= {(base, name)} if len(inspect.signature(function).parameters) > own else set()
    return found


# One object of every class whose methods take arguments, several where methods depend on what the object holds.
OBJECTS: tuple[Any, ...] = (
    ARC, geo.Bezier([(0, 0), (0.5, -1), (1, 0)]), geo.Segment((0, 0), (1, 0)), TEETH, DISK, PROFILE, SPACE, BUMPS,
    MUSHROOMS, STRIP, CIRCLE, geo.Torus(9.0, 7.0), geo.InnerDisk(0.25, 0.1), geo.RollingCharts(np.pi / 30.0, 1.0),
    geo.HeightCorrelation(0.1), geo.SelfAffine(0.5), SURFACE,
    BINS, ker.Legendre(4), ker.Panels([0.0, 1.0, np.pi], 2), ker.TensorBasis((ker.Bins(2), MOMENTUM_BINS)), SINE,
    MATRIX, SAMPLED, LAW, ker.lambertian(), ker.specular(), TRIANGLES, ker.RectangularTeethLaw(1.0),
    ker.CircularArcLaw(1.2), ker.PolygonLaw(geo.Wall.from_vertices([(0, 0), (0.3, -0.4), (0.6, -0.1), (1, 0)])),
    ker.WallLaw(geo.elliptical_arcs(1.0)), ker.WallLaw(TEETH), ker.MushroomLaw(MUSHROOMS), ker.MatrixLaw(MATRIX),
    ker.FacetedLaw(TEETH, ker.maxwell(0.5)),
    HALVES, ker.InvolutionLaw(lambda theta: np.pi - theta), ker.DensityLaw(lambda a, b: 0.5 * np.sin(b) + 0.0 * a),
    ker.LeastResistanceLaw(), 0.5 * LAW + 0.5 * ker.specular(), TRIANGLES @ ker.specular(), TRIANGLES**2,
    LAW.in_specular_frame(), LAW.conditionals(1.0), COLLISION, 0.5 * COLLISION + 0.5 * ker.smooth(DISK),
    ker.no_slip(DISK),
    GROOVES, 0.5 * GROOVES + 0.5 * GROOVES @ GROOVES, ker.SurfaceLaw(SURFACE), ker.Zernike(2),
    ker.SatelliteLaw(TEETH, DISK, 0.01), PAIR, ROUGH, ker.PolygonalBody([TRIANGLE]), ALONG, ker.SpringWall(0.5, 1.0),
    ker.CollisionAlongWall(ALONG, DISK), RECORD, GAS, geo.WALLS["koch"], ker.displacements(TEETH, 200, rng=0),
    ker.exchange_hollow(HALVES, 0.05), spec.spectrum(LAW, 2, tolerance=0.1),
)  # fmt: skip
# Good arguments by name, quick ones, because some calls do work; of a class alone after its name. Others have their
# defaults.
ARGUMENTS: dict[str, Any] = {
    "theta": [0.5, 1.0], "psi": [1.0, 2.0], "theta_out": [1.0, 2.0], "x": [0.3, 0.4], "edges": EDGES, "limit": 10,
    "function": np.cos, "basis": BINS, "rng": 0, "velocity": VELOCITY, "position": POSITION, "angle": [0.5, 1.0],
    "angles": (0.5, 1.0), "n": 4, "factor": 2.0, "exponent": 2, "tolerance": 0.1, "low": [0.5],
    "high": [1.0], "probability": [0.3, 0.6], "order": 3, "size": 3, "degree": 2, "smallest": 0.01, "half_angle": 1.0,
    "dx": 0.1, "dy": 0.1, "start": (0.0, 0.0), "end": (1.0, 0.0), "s": 0.5, "axis": 1, "x_factor": 2.0,
    "y_factor": 1.0, "configuration": [0.1, 1.0, 0.2], "alpha": [0.1, 0.2], "number": [0, 1], "point": [0.1, 0.2],
    "points": 8, "period": 1.0, "wall": TEETH, "direction": 1.0, "radius": 1.0, "region": CIRCLE, "law": LAW, "a": 1.0,
    "b": 0.5, "vertices": TRIANGLE, "index": 1, "path": "no/such", "disk": DISK, "generation": 1,
    "max_collisions": 9, "max_contacts": 1000, "speed": 1.0, "threads": 1, "gap": 1.0, "rays": 128, "most_hits": 9,
    "most": 0.1, "cells": BINS, "vectors": np.ones((6, 2)), "panel": np.array([0, 1]), "wall_normal": [0.0, 1.0],
    "w": [0.0, 1.0, 0.0], "w2": [0.0, 1.0, 0.0], "theta_basis": BINS, "psi_basis": MOMENTUM_BINS, "samples": 64,
    "neck": 0.1,
    "unfollowed": 0.0, "distance": 0.1, "scale": 0.01, "largest": 4, "temperature": 1.0, "left": 0.0, "right": 1.0,
    "intervals": 2, "walls": [TEETH], "repeats": 1, "container": CIRCLE, "n_in": 3, "n_out": 3, "centre": [0.0, 0.0],
    "n_azimuth": 3, "n_turn": 3,
    "normal": [0.0, 1.0], "scales": [0.01], "first_velocity": [0.0, -1.0, 0.0], "second_velocity": [0.0, 0.0, 0.0],
    "coordinates": "velocity", "frames": 3, "duration": 1.0, "side": 2.0, "curves": CIRCLE.curves,
    "m": 1, "generations": 1, "height": [0, 1], "height_to_width": 1.0, "curvature": 1.0, "stem_to_cap": 0.2,
    "stem_aspect": 0.5, "grid": 2, "moments": 2, "matrix": MATRIX, "particles": 4, "realisations": 4,
    "incidence_deg": [30.0], "k": 2, "quantities": "gap", "repetitions": 2, "openings": [0], "iterations": 2,
    "lengths": [1.0, 2.0, 4.0], "pair": PAIR, "space": SPACE, "polygons": [TRIANGLE], "family": seeded,
    "collisions": 64, "kernel": MATRIX, "name": "a", "error": 0.0, "value": 0.0, "max_beams": 1000, "length": 1.0,
    "burn_in": 0.1, "g": 0.5, "diffuse_fraction": 0.5, "spin": 0.5, "text": "flat", "degrees": 2,
    "plates": 2, "notches": 2, "spectrum": geo.SelfAffine(0.5), "rms_slope": 0.1, "exchange": HALVES, "opening": 0.05,
    "times": [1.0, 2.0, 4.0], "bend": 3.0, "mass_ratio": 0.5, "hurst": 0.5, "orientation": 0.5, "factors": (BINS, BINS),
    "control_points": [(0, 0), (0.5, -1), (1, 0)], "center": (0.5, 0.0), "semi_axes": 0.5, "islands": [],
    "pieces": [geo.Segment((0, 0), (1, 0))], "body": BUMPS, "methods": [spec.WorkMethod("b", float)],
    "references": (REFERENCE,), "problem": spec.WorkProblem("a", (REFERENCE,)), "budgets": [1.0], "seconds": 0.1,
    "warm_up": False, "solve": float, "source": "by hand", "theta_in": INCOMING, "pairs": [(INCOMING, OUTGOING)],
    "bins": 2, "bounds": [(0.5, 1.0)], "objective": "drag", "wanted": "max", "permutations": 19, "trajectories": 8,
    "events": 3, "normals": [0.0, 2.0, 4.0], "count": 4, "joined": True, "map": lambda theta: np.pi - theta,
    "symmetric": MATRIX.symmetric, "seam": "mirror", "most_hollows": 3, "smallest_opening": 0.01, "resolution": 0.1,
    "width": 0.1, "within": 0.25, "collision": COLLISION, "divisions": 4, "inertia": 0.5, "reflector": TEETH,
    "inertia_ratio": 0.5, "mass": 1.0,
    "surface": SURFACE, "laws": ker.smooth(DISK),
    "ConfigurationSpace.height": -0.5, "ConfigurationSpace.position": POSITION[0], "Container.wall": [0],
    "ConfigurationSpace.velocity": VELOCITY[0], "BilliardRecord.direction": (1.0, 0.0), "Container.angle": 1.0,
    "RollingCharts.position": [0.1, 0.2], "RollingCharts.velocity": [0.1, -1.0, 0.2], "Container.last": [-1],
    "CollisionAlongWall.position": [0.3, 0.0], "CollisionAlongWall.wall": 0, "CollisionAlongWall.x": [0.3],
    "Displacements.probability": 0.5, "KernelMatrix.other": MATRIX, "SpringWall.velocity": [[0.2, -1.0]],
    "SpringWall.n": 4096, "CollisionLaw.other": COLLISION, "CollisionLaw.function": lambda t, p: t * p,
    "PositionLaw.function": lambda x, theta: np.cos(theta), "ExchangeHollow.function": lambda a, b: a * b,
    "TensorBasis.function": lambda angle: angle[..., 0], "Zernike.function": lambda at: at[..., 0],
    "Zernike.angle": [0.5, 0.1], "HemisphereLaw.velocity": [[0.2, 0.1, -1.0]], "ExchangeHollow.number": 2,
    "SurfaceLaw.velocity": [[0.2, 0.1, -1.0]],
    "HemisphereCombination.velocity": [[0.2, 0.1, -1.0]], "PairLaw.first": DISK, "PairLaw.second": DISK,
    "Wall.vertices": [(0, 0), (0.5, -1), (1, 0)], "SatelliteDisk.alpha": 0.1,
    "Container.position": [[0.3, 0.1]], "Container.velocity": [[0.2, -1.0]], "Container.length": [0.1],
    "PolygonalBody.position": [[3.0, 0.1]], "PolygonalBody.velocity": [[-1.0, 0.0]], "Displacements.scale": 1.0,
    "SpringWall.gas_temperature": 2.0, "Composition.first": LAW, "Composition.second": LAW,
    "Segment.vertices": TRIANGLE, "SpringWall.speed": [1.0, 2.0],
    "Surface.points": [[0.3, 0.1]], "Surface.velocities": [[0.2, 0.1, -1.0]], "Surface.point": [0.3, 0.1],
    "Surface.velocity": [0.2, 0.1, -1.0], "Surface.heights": [[0.0, 0.3], [0.5, 0.1]], "Surface.spacing": 0.5,
    "Panels.moments": np.ones((2, 2, 3)),
}  # fmt: skip
# Other arguments of single calls.
SPECIAL: dict[str, dict[str, Any]] = {
    "Arc": {"start": 3.0, "end": 4.0},
    "Between": {"low": 0.2, "high": 0.4, "points": 4},
    "CollisionAlongWall": {"law": ALONG},
    "Container.ellipse": {"b": 0.2},
    "Container.length_on": {"wall": 0, "position": [0.3, 0.1]},
    "Container.sinai": {"radius": 0.2},
    "Container.stadium": {"length": 1.0},
    "Container.touch": {"wall": 0, "position": [0.3, 0.1]},
    "Conditionals.of_atoms": {"nodes": [[0.5, 1.0]], "weights": [[0.25, 0.75]]},
    "Conditionals.of_density": {"density": lambda a, b: 0.5 * np.sin(b) + 0.0 * a, "tolerance": 1e-8},
    "DensityLaw": {"density": lambda a, b: 0.5 * np.sin(b) + 0.0 * a},
    "Disk": {"inertia": None},
    "Estimate": {"kind": "bound", "method": "by hand"},
    "FacetedLaw": {"facets": LAW},
    "HeightCorrelation": {"length": 0.1},
    "HemisphereLaw": {"facets": "finer grooves"},
    "InnerDisk": {"spacing": 0.25, "depth": 0.1},
    "KernelMatrix": {"error": MATRIX.error, "samples": None, "law": None},
    "KernelMatrix.save": {"path": "no/kernel.npz"},
    "Law.__mul__": {"weight": 0.5},
    "MushroomGenerations": {"generations": 2},
    "MushroomLaw": {"wall": MUSHROOMS},
    "NamedWall.build": {"generations": 1},
    "Panels": {"edges": [0.0, 1.0, np.pi]},
    "PolygonLaw": {"tolerance": 1e-10},
    "DirectionLaw.plot": {"velocity": VELOCITY[0]},
    "PositionLaw": {"edges": [0.0, 1.0], "laws": [LAW]},
    "PositionLaw.at": {"x": 0.3},
    "Profile": {"x": [0, 1], "unit": "um"},
    "Profile.in_unit": {"unit": "nm"},
    "Profile.detrended": {"degree": 1},
    "RollingCharts": {"spacing": np.pi / 30.0, "scale": 1.0},
    "RoughBody": {
        "normals": 2.0 * np.pi * np.arange(3) / 3.0, "lengths": [1.0, 1.0, 1.0], "radius": np.ones_like,
        "breakpoints": [1.0],
    },
    "SatelliteDisk": {"size": 0.1, "angles": [0.0, 1.0, 3.0, 5.0]},
    "SatelliteLaw.draw_limit": {"samples": 4},
    "Surface.random": {"points": 8},
    "TriangularTeethLaw": {"angle": 1.0},
    "Wall.from_function": {"height": abs, "tolerance": 1e-3},
    "Wall.from_profile": {"x": [0, 1]},
    "Wall.save": {"path": "wall.toml", "overwrite": True},
    "WorkMethod": {"order": None},
    "bounce_shares": {"most": 2},
    "channel_diffusivity": {"other": ker.lambertian()},
    "channel_paths": {"other": ker.lambertian()},
    "collide_pair": {"first": BUMPS, "second": BUMPS, "position": [[[0, 4, 0], [0, 0, 0]]],
                     "velocity": [[[0, -1, 0], [0, 0, 0]]]},
    "collide_rim": {"scale": 0.1, "position": [[0.0, 0.0]], "velocity": [[0.0, -1.0, 0.0]]},
    "collision_path": {"position": POSITION[0], "velocity": VELOCITY[0]},
    "design_wall": {"family": arc_of},
    "dichotomy": {"cells": [TEETH, TEETH]},
    "difference_test": {"first": SAMPLED, "second": SAMPLED, "order": 1},
    "discretise": {"samples": None},
    "distance": {"first": MATRIX, "second": MATRIX, "order": 1},
    "enclosures": {"basis": None},
    "estimate": {"theta_out": OUTGOING, "basis": ker.Bins(2)},
    "estimate_stream": {"basis": ker.Bins(2)},
    "exit_times": {"other": ker.lambertian()},
    "extremal_resistance": {"curvature": None},
    "fit_order": {"size": [1, 2, 4], "error": [1.0, 0.5, 0.25], "repeats": None},
    "good_fraction": {"samples": 10},
    "limit_study": {"scales": [0.1, 0.05, 0.02], "psi": 1.2, "limit": None, "samples": (2, 2, 2)},
    "mixing_time": {"distance": "total variation", "start": "density"},
    "notched_angle": {"angle": 0.5},
    "play": {"laws": COLLISION, "container": STRIP, "position": [[0.0, 0.0]], "velocity": [[1.0, 1.0, 0.0]],
             "collisions": 2},
    "play_gas": {"position": [[0.0, 0.0]], "velocity": [[1.0, 0.0, 0.0]], "walls": None, "every": 1, "interval": 0.5},
    "position_distance": {"first": geo.flat(), "second": geo.flat(), "tolerance": 0.5, "rays": 16},
    "shadow": {"position": [0.0, 0.0], "velocity": [0.0, -1.0, 0.0]},
    "spectrum": {"kernel": LAW},
    "study_wall": {"wall": geo.flat(), "disk": None},
    "sweep": {"family": ker.maxwell, "grid": {"diffuse_fraction": [0.5]}},
    "Torus": {"width": 9.0, "height": 7.0},
    "trajectory": {"x": 0.3, "theta": 1.0},
    "triangular_teeth": {"angle": 1.0},
    "transmission": {"other": ker.lambertian()},
    "tube": {"height": 0.2, "spacing": 1.0},
    "weak_limit": {"samples": 8, "pairs": None},
    "work_precision": {"path": None},
}  # fmt: skip
# They take other functions of the library, an array into which they write, or what other functions have checked.
UNCALLED = {
    "matrix_on", "entries", "on_zernike", "reflected", "add_products", "attempt", "apply_to_states", "save", "draw",
    "plot", "plot_eigenfunctions", "features", "Spectrum.at", "of_lists", "mixed", "followed_by",
    "sums", "fault", "exit_velocities", "map_powers", "wave_powers",
    # of a piece, asked by walls, containers and tables
    "arrival", "curvature", "cut", "from_table", "goes_in_waves", "has_parts", "heights", "hull", "is_on", "joined",
    "largest_curvature", "length_to", "of_table", "parameter_of", "point_at_length", "row", "signed_area", "steps",
    "to_table", "touch",
}  # fmt: skip
# Functions of the user, what is handed on, how a matrix was made, and angles of which one gives no number, stay away.
UNREPLACED = {
    "engine", "client", "checkpoint", "key", "runner", "metadata", "counts", "replicates", "symmetrised",
    "reversible", "mirror_symmetric", "frame", "requested_tolerance", "unresolved", "norm_bound", "raw_defect",
    "beyond", "cost", "incoming", "accommodation.incidence_deg", "accommodation.azimuth_deg",
    "study_wall.incidence_deg",
}  # fmt: skip


def good_call(label: str, function: Callable[..., Any]) -> tuple[Callable[..., Any], dict[str, Any]]:
    """A function with arguments that it takes: those of the label, of its class, of their names, or the defaults."""
    own, kind = SPECIAL.get(label, {}), label.partition(".")[0]
    found = {}
    for name, parameter in inspect.signature(function).parameters.items():
        many = parameter.kind in (parameter.VAR_KEYWORD, parameter.VAR_POSITIONAL)
        if many or {name, f"{label}.{name}"} & UNREPLACED:
            continue
        given = own.get(name, ARGUMENTS.get(f"{kind}.{name}", ARGUMENTS.get(name, parameter.default)))
        if given is parameter.empty:
            raise LookupError(f"no good argument {name} of {label}")
        found[name] = given
    return function, found | own


# Methods of every kind of argument, which are replaced one after the other like those of all functions; those of a
# class are called of the first of `OBJECTS` that is of it.
METHODS = (
    "AngularMeasure.cdf", "AngularMeasure.sample", "Arc.moved", "Arc.split", "Arc.stretched", "BilliardRecord.animate",
    "BilliardRecord.phase_portrait", "Bins.evaluate", "CollisionLaw.__matmul__", "CollisionLaw.apply",
    "CollisionLaw.from_wall", "CollisionLaw.operator",
    "CollisionLaw.sample", "Conditionals.of_atoms", "Conditionals.of_density", "ConfigurationSpace.contains",
    "ConfigurationSpace.draw_collision", "ConfigurationSpace.draw_section", "ConfigurationSpace.good_half_width",
    "Container.draw", "Container.ellipse", "Container.from_curves", "Container.polygon", "Container.sinai",
    "Container.stadium", "Disk.from_angles", "Disk.inner", "Disk.rolling_momentum", "Disk.to_angles",
    "GasRecord.rotational_fraction", "HemisphereLaw.matrix", "HemisphereLaw.sample", "InnerDisk.contains",
    "KernelMatrix.__pow__", "KernelMatrix.save", "KernelMatrix.tensor", "Law.__mul__", "Law.__pow__", "Law.apply",
    "Law.sample", "MatrixLaw.density", "MushroomGenerations.generation", "MushroomGenerations.trace",
    "MushroomGenerations.width", "NamedWall.build", "PairLaw.from_wall", "PairLaw.sample", "Panels.for_wall",
    "Profile.detrended", "Profile.in_unit", "RollingCharts.nearest", "RoughBody.sample", "SatelliteLaw.draw_limit",
    "Surface.random", "Surface.trace", "Surface.trajectory",
    "TriangularTeethLaw.breakpoints", "TriangularTeethLaw.branches", "TriangularTeethLaw.conditionals",
    "Wall.foreshorten", "Wall.from_function", "Wall.from_profile", "Wall.from_vertices", "Wall.outline", "Wall.save",
    "Wall.scaled", "Wall.unforeshorten",
)  # fmt: skip


def _method(label: str) -> Callable[..., Any]:
    kind, _, name = label.partition(".")
    return getattr(next(one for one in OBJECTS if kind in [base.__name__ for base in type(one).__mro__]), name)


# Parameters without an example, by their functions; a test names them, and the calls are left out elsewhere.
MISSING: set[str] = set()


def _good_calls(
    functions: Iterable[tuple[str, Callable[..., Any]]],
) -> dict[str, tuple[Callable[..., Any], dict[str, Any]]]:
    """By their labels the functions with arguments that they take; a label that occurs again tells its object."""
    found: dict[str, tuple[Callable[..., Any], dict[str, Any]]] = {}
    for label, function in functions:
        try:
            call = good_call(label, function)
        except LookupError as reason:
            MISSING.add(str(reason))
        else:
            found[f"{label} of {function.__self__!r}" if label in found else label] = call
    return found


# Every public callable, and these methods, with arguments that they take.
CALLS = _good_calls(
    [(name, getattr(room, name)) for room in (geo, ker, spec) for name in room.__all__
     if callable(getattr(room, name)) and name not in LEFT_OUT]
    + [(one.__name__, one) for one in (Estimate, study_wall)]
    + [(label, _method(label)) for label in METHODS]
)  # fmt: skip


def method_calls() -> dict[str, tuple[Callable[..., Any], dict[str, Any]]]:
    """Every public method of `OBJECTS` with arguments that it takes."""
    named = ((thing, name) for thing in OBJECTS for name in sorted({name for _, name in methods_of(type(thing))}))
    methods = ((f"{type(thing).__name__}.{name}", thing, name) for thing, name in named)
    left_out = UNCALLED | set(OPERATORS)
    return _good_calls((label, getattr(thing, name)) for label, thing, name in methods if not {label, name} & left_out)


# What is of a wrong kind for most arguments.
CIRCULAR: list[Any] = []
CIRCULAR.append(CIRCULAR)
WRONG: dict[str, Any] = {
    "None": None, "text": "text", "number as text": "0.5", "bytes": b"bytes", "list": [], "dict": {"a": 1},
    "array": np.array([1.0, 2.0, 3.0]), "matrix": np.zeros((2, 2)), "ragged": [[1, 2], [3]],
    "texts": np.array(["a", "b"]), "objects": np.array([None, {}], dtype=object), "nan": np.nan, "inf": np.inf,
    "negative": -1, "zero": 0, "fraction": 2.5, "beyond double": 10**400, "complex": 1j,
    "function": lambda: 0, "class": int, "law": LAW, "disk": DISK, "kernel": MATRIX, "wall": TEETH, "nul": "a\0b",
    "surrogate": "\ud800", "object": object(), "set": {1, 2}, "tuple": (1, 2), "list of None": [None], "large": 1e300,
    "tiny": 5e-324, "true": True, "seven": 7, "list in itself": CIRCULAR,
    "span of time": np.timedelta64(3, "s"),
}  # fmt: skip
# A function of the user that fails, or returns nonsense, fails in its own way; a bound may be met after hours.
FUNCTIONS = ("density", "map", "function", "spacing", "family", "objective", "cost", "solve", "spectrum", "quantities")
ENDLESS_KINDS = ("zero", "beyond double", "tiny", "large")
ENDLESS = {"tolerance", "lengths", "smallest_opening", "permutations", "max_contacts", "max_collisions", "iterations"}


def wrong_kinds(label: str, parameter: str) -> dict[str, Any]:
    """What replaces an argument of a call, without functions where the user's are called and endless work."""
    label = label.partition(" of ")[0]
    of_user = parameter in FUNCTIONS or (label == "RoughBody" and parameter in ("law", "radius"))
    left_out = ENDLESS_KINDS if parameter in ENDLESS else ()
    return {kind: wrong for kind, wrong in WRONG.items() if kind not in left_out and not (callable(wrong) and of_user)}
