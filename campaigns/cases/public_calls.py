"""Arguments that every public callable and method takes, for tests and campaigns that replace one after the other."""

from __future__ import annotations

import inspect
from collections.abc import Callable
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
PROFILE, STRIP = geo.Profile([0.0, 1.0, 2.0], [0.0, -1.0, 0.5]), geo.Container.strip()
CIRCLE = geo.Container.circle()
BUMPS = geo.SatelliteDisk(DISK, 9, 0.1)
PAIR, GROOVES = ker.PairLaw(LAW, DISK), ker.HemisphereLaw(LAW)
RECORD = ker.play(CIRCLE, ker.smooth(DISK), [0.5, 0.0], [0.0, 1.0, 0.0], 3)
VELOCITY, POSITION = [[0.2, -1.0, 0.1]], [[0.3, 0.1]]
PROBLEM = spec.WorkProblem("a", (spec.ReferenceValue(0.0, 0.0, "by hand"),))
METHOD = spec.WorkMethod("b", float)


def arc_of(half_angle: float) -> geo.Wall:
    return geo.focusing_arcs(half_angle)


def seeded(rng: int) -> ker.Law:
    return ker.maxwell(np.random.default_rng(rng).uniform())


# Methods that operators and brackets call.
OPERATORS = ("__call__", "__getitem__", "__matmul__", "__add__", "__sub__", "__mul__", "__rmul__", "__pow__")
# Of every public callable arguments that it takes; each is replaced in its turn. Quick ones: some of them do work.
CALLS: dict[str, tuple[Callable[..., Any], dict[str, Any]]] = {
    "Arc": (geo.Arc, {"center": (0.5, 0.0), "semi_axes": 0.5, "start": 3.0, "end": 4.0}),
    "Bezier": (geo.Bezier, {"control_points": [(0, 0), (0.5, -1), (1, 0)]}),
    "Segment": (geo.Segment, {"start": (0, 0), "end": (1, 0)}),
    "Disk": (geo.Disk, {"mass": 1.0, "inertia": 0.5}),
    "Disk.inner": (DISK.inner, {"w": [0.0, -1.0, 0.0], "w2": [0.0, -1.0, 0.0]}),
    "Disk.to_angles": (DISK.to_angles, {"w": [0.0, 1.0, 0.0]}),
    "Disk.from_angles": (DISK.from_angles, {"theta": 1.0, "psi": 1.0, "speed": 1.0}),
    "Profile": (geo.Profile, {"x": [0, 1], "height": [0, 1], "unit": "um"}),
    "Profile.detrended": (PROFILE.detrended, {"degree": 1}),
    "Profile.in_unit": (geo.Profile([0, 1], [0, 1], "um").in_unit, {"unit": "nm"}),
    "RollingCharts": (geo.RollingCharts, {"spacing": np.pi / 30.0, "scale": 1.0}),
    "ConfigurationSpace": (geo.ConfigurationSpace, {"wall": TEETH, "disk": DISK, "scale": 0.01, "spacing": None}),
    "Wall": (geo.Wall, {"pieces": [geo.Segment((0, 0), (1, 0))], "period": 1.0, "islands": [], "unit": ""}),
    "Wall.from_vertices": (geo.Wall.from_vertices, {"vertices": [(0, 0), (0.5, -1), (1, 0)], "unit": ""}),
    "Wall.from_profile": (geo.Wall.from_profile, {"x": [0, 1], "height": [0, 1], "seam": "mirror", "unit": ""}),
    "Wall.foreshorten": (TEETH.foreshorten, {"disk": DISK}),
    "Wall.unforeshorten": (TEETH.unforeshorten, {"disk": DISK}),
    "Wall.scaled": (TEETH.scaled, {"factor": 2.0}),
    "Wall.outline": (TEETH.outline, {"tolerance": 0.1}),
    "NamedWall.build": (geo.WALLS["koch"].build, {"generations": 1}),
    "collide": (geo.collide, {"disk": DISK, "wall": TEETH, "scale": 0.01, "position": POSITION, "velocity": VELOCITY,
                              "spacing": None, "max_contacts": 1000, "threads": 1}),
    "collide_cylinder": (geo.collide_cylinder, {"disk": DISK, "wall": TEETH, "scale": 0.01, "position": POSITION,
                                                "velocity": VELOCITY, "max_contacts": 1000, "threads": 1}),
    "collide_modified": (geo.collide_modified, {"disk": DISK, "wall": TEETH, "scale": 0.01, "position": POSITION,
                                                "velocity": VELOCITY, "spacing": None}),
    "collision_path": (geo.collision_path, {"disk": DISK, "wall": TEETH, "scale": 0.01, "position": POSITION[0],
                                            "velocity": VELOCITY[0], "spacing": None}),
    "dispersing_arcs": (geo.dispersing_arcs, {"curvature": 1.0}),
    "elliptical_arcs": (geo.elliptical_arcs, {"half_angle": 1.0, "disk": DISK}),
    "focusing_arcs": (geo.focusing_arcs, {"half_angle": 1.0}),
    "notched_angle": (geo.notched_angle, {"angle": 0.5, "notches": 2}),
    "tube": (geo.tube, {"plates": 2, "height": 0.2, "spacing": 1.0}),
    "koch": (geo.koch, {"generations": 1}),
    "mushrooms": (geo.mushrooms, {"stem_to_cap": 0.2, "stem_aspect": 0.5, "generations": 1}),
    "MushroomGenerations": (geo.MushroomGenerations, {"stem_to_cap": 0.2, "stem_aspect": 0.5, "generations": 2}),
    "MushroomGenerations.trace": (MUSHROOMS.trace, {"x": [0.3], "theta": [1.0], "max_collisions": 9, "threads": 1}),
    "MushroomGenerations.generation": (MUSHROOMS.generation, {"x": [0.3]}),
    "MushroomGenerations.width": (MUSHROOMS.width, {"generation": 2}),
    "InnerDisk": (geo.InnerDisk, {"spacing": 0.25, "depth": 0.1}),
    "InnerDisk.contains": (geo.InnerDisk(0.25, 0.1).contains, {"configuration": [0.0, 0.0, 0.0], "point": [0.0, 0.1]}),
    "MushroomLaw": (ker.MushroomLaw, {"wall": MUSHROOMS}),
    "rectangular_teeth": (geo.rectangular_teeth, {"height_to_width": 1.0}),
    "triangular_teeth": (geo.triangular_teeth, {"angle": 1.0}),
    "draw_wall": (geo.draw_wall, {"wall": TEETH, "x": [0.3], "theta": [1.0]}),
    "load_wall": (geo.load_wall, {"path": "no.toml"}),
    "HeightCorrelation": (geo.HeightCorrelation, {"length": 0.1, "shape": "gaussian"}),
    "SelfAffine": (geo.SelfAffine, {"hurst": 0.5, "longest": None, "shortest": None}),
    "random_wall": (geo.random_wall, {"spectrum": geo.SelfAffine(0.5), "points": 8, "rms_slope": 0.1,
                                      "rms_height": None, "period": 1.0, "smooth": False, "rng": 0}),
    "read_profile": (geo.read_profile, {"path": "no.txt", "row": None, "units": None}),
    "wall_from_text": (geo.wall_from_text, {"text": "flat"}),
    "trace": (geo.trace, {"wall": TEETH, "x": [0.3], "theta": [1.0], "max_collisions": 1000, "threads": 1}),
    "trajectory": (geo.trajectory, {"wall": TEETH, "x": 0.3, "theta": 1.0, "max_collisions": 1000}),
    "Bins": (ker.Bins, {"divisions": 4, "weight": "sin"}),
    "Bins.evaluate": (BINS.evaluate, {"angle": [1.0]}),
    "Legendre": (ker.Legendre, {"n": 4, "weight": "sin"}),
    "Panels": (ker.Panels, {"edges": [0.0, 1.0, np.pi], "degree": 2, "weight": "sin"}),
    "Panels.for_wall": (ker.Panels.for_wall, {"wall": TEETH, "degree": 2, "smallest": 0.01}),
    "Zernike": (ker.Zernike, {"degree": 2}),
    "TensorBasis": (ker.TensorBasis, {"factors": (BINS, BINS)}),
    "CircularArcLaw": (ker.CircularArcLaw, {"half_angle": 1.0}),
    "RectangularTeethLaw": (ker.RectangularTeethLaw, {"height_to_width": 1.0}),
    "TriangularTeethLaw": (ker.TriangularTeethLaw, {"angle": 1.0}),
    "PolygonLaw": (ker.PolygonLaw, {"wall": TEETH, "tolerance": 1e-10, "max_beams": 1000}),
    "WallLaw": (ker.WallLaw, {"wall": TEETH}),
    "CollisionLaw": (ker.CollisionLaw, {"law": LAW, "disk": DISK}),
    "CollisionLaw.from_wall": (ker.CollisionLaw.from_wall, {"wall": TEETH, "disk": DISK}),
    "CollisionLaw.sample": (COLLISION.sample, {"velocity": VELOCITY, "rng": 0}),
    "CollisionLaw.operator": (COLLISION.operator, {"theta_basis": BINS, "psi_basis": ker.Bins(4, "sin2")}),
    "HemisphereLaw": (ker.HemisphereLaw, {"law": LAW, "orientation": 0.5}),
    "HemisphereLaw.sample": (GROOVES.sample, {"velocity": [[0.2, 0.1, -1.0]], "rng": 0}),
    "HemisphereLaw.matrix": (GROOVES.matrix, {"degree": 3, "m": 1}),
    "SatelliteLaw": (ker.SatelliteLaw, {"wall": TEETH, "disk": DISK, "scale": 0.01, "spacing": None}),
    "DensityLaw": (ker.DensityLaw, {"density": lambda a, b: 0.5 * np.sin(b) + 0.0 * a, "breakpoints": ()}),
    "InvolutionLaw": (ker.InvolutionLaw, {"map": lambda theta: np.pi - theta}),
    "IntervalExchangeLaw": (ker.IntervalExchangeLaw, {"matrix": MATRIX}),
    "MatrixLaw": (ker.MatrixLaw, {"matrix": MATRIX}),
    "KernelMatrix": (ker.KernelMatrix, {"symmetric": MATRIX.symmetric, "basis": BINS, "error": MATRIX.error}),
    "KernelMatrix.tensor": (MATRIX.tensor, {"other": MATRIX}),
    "KernelMatrix.save": (MATRIX.save, {"path": "no/kernel.npz"}),
    "RoughBody": (ker.RoughBody, {"normals": [0.0, 2.0, 4.0], "lengths": [1.0, 1.0, 1.0], "law": LAW}),
    "Law.sample": (LAW.sample, {"theta": [1.0], "rng": 0}),
    "Law.apply": (LAW.apply, {"function": np.cos, "theta": [1.0]}),
    "Law.branches": (ker.specular().branches, {"theta": [1.0]}),
    "design_wall": (ker.design_wall, {"objective": "drag", "family": arc_of, "bounds": [(0.5, 1.0)], "wanted": "max",
                                      "tolerance": 0.1, "grid": 2}),
    "collision_for": (ker.collision_for, {"collision": COLLISION, "disk": DISK, "moments": 2, "tolerance": 0.1}),
    "wall_for": (ker.wall_for, {"law": LAW, "moments": 2, "tolerance": 0.1, "hollows": None, "rng": 0,
                                "most_hollows": 3, "smallest_opening": 0.01}),
    "dichotomy": (ker.dichotomy, {"cells": [TEETH, TEETH], "disk": DISK, "tolerance": 0.1, "scales": (0.01,),
                                  "rng": 0}),
    "difference_test": (ker.difference_test, {"first": SAMPLED, "second": SAMPLED, "order": 1, "kind": "rows",
                                              "permutations": 19, "rng": 0}),
    "discretise": (ker.discretise, {"law": LAW, "basis": BINS, "method": "auto", "tolerance": 0.1, "samples": None,
                                    "rng": 0, "symmetrise": False}),
    "distance": (ker.distance, {"first": MATRIX, "second": MATRIX, "order": 1, "kind": "rows", "tolerance": 0.1}),
    "SatelliteLaw.draw_limit": (ker.SatelliteLaw(TEETH, DISK, 0.01).draw_limit, {
        "angles": (1.0, 1.0), "rng": 0, "scales": [0.01], "samples": 4}),
    "estimate": (ker.estimate, {"theta_in": [0.5, 1.0, 2.0, 2.5], "theta_out": [0.5, 2.0, 1.0, 2.5],
                                "basis": ker.Bins(2), "symmetrise": False, "invariant": None}),
    "estimate_stream": (ker.estimate_stream, {"pairs": [([0.5, 1.0, 2.0, 2.5], [0.5, 2.0, 1.0, 2.5])],
                                              "basis": ker.Bins(2), "symmetrise": False, "invariant": True}),
    "extremal_resistance": (ker.extremal_resistance, {"n": 4, "which": "min", "cost": None, "curvature": None}),
    "henyey_greenstein": (ker.henyey_greenstein, {"g": 0.5}),
    "maxwell": (ker.maxwell, {"diffuse_fraction": 0.5}),
    "limit_study": (ker.limit_study, {"disk": DISK, "wall": TEETH, "scales": [0.1, 0.05, 0.02], "rng": 0, "psi": 1.2,
                                      "spacing": None, "limit": None, "samples": (2, 2, 2), "repetitions": 2}),
    "weak_limit": (ker.weak_limit, {"disk": DISK, "wall": TEETH, "scales": [0.01], "pairs": None, "rng": 0,
                                    "window": 1.0, "samples": 8, "repetitions": 2}),
    "PositionLaw": (ker.PositionLaw, {"edges": [0.0, 1.0], "laws": [LAW]}),
    "PolygonalBody": (ker.PolygonalBody, {"polygons": [[(0, 0), (1, 0), (0, 1)]]}),
    "spin_force": (ker.spin_force, {"law": LAW, "spin": 0.5, "radius": 1.0}),
    "SpringWall": (ker.SpringWall, {"mass_ratio": 0.5, "temperature": 1.0, "frequency": 1.0, "depth": 1.0}),
    "CollisionAlongWall": (ker.CollisionAlongWall, {"law": ker.PositionLaw([0.0, 1.0], [LAW]), "disk": DISK}),
    "retroreflection_distance": (ker.retroreflection_distance, {"reflector": TEETH, "rays": 200, "rng": 0}),
    "displacements": (ker.displacements, {"wall": TEETH, "rays": 200, "rng": 0}),
    "position_distance": (ker.position_distance, {"first": geo.flat(), "second": geo.flat(), "tolerance": 0.5,
                                                  "rays": 16, "rng": 0}),
    "join_walls": (geo.join_walls, {"walls": [TEETH], "repeats": 1}),
    "load_matrix": (ker.load_matrix, {"path": "no.npz"}),
    "no_slip": (ker.no_slip, {"disk": DISK}),
    "smooth": (ker.smooth, {"disk": DISK}),
    "SatelliteDisk": (geo.SatelliteDisk, {"disk": DISK, "count": 4, "size": 0.1, "radius": 1.0,
                                          "angles": [0.0, 1.0, 3.0, 5.0], "joined": True}),
    "collide_rim": (geo.collide_rim, {"body": BUMPS, "wall": TEETH, "scale": 0.1, "position": [[0.0, 0.0]],
                                      "velocity": [[0.0, -1.0, 0.0]], "max_contacts": 9}),
    "shadow": (geo.shadow, {"space": SPACE, "position": [0.0, 0.0], "velocity": [0.0, -1.0, 0.0]}),
    "good_fraction": (geo.good_fraction, {"space": SPACE, "samples": 10, "rng": 0}),
    "ConfigurationSpace.draw_collision": (SPACE.draw_collision, {"position": POSITION[0], "velocity": VELOCITY[0]}),
    "ConfigurationSpace.draw_section": (SPACE.draw_section, {"height": 1.0}),
    "ConfigurationSpace.good_half_width": (SPACE.good_half_width, {"length": 1.0}),
    "collide_pair": (geo.collide_pair, {"first": BUMPS, "second": BUMPS, "position": [[[0, 4, 0], [0, 0, 0]]],
                                        "velocity": [[[0, -1, 0], [0, 0, 0]]], "max_contacts": 9}),
    "PairLaw": (ker.PairLaw, {"law": LAW, "first": DISK, "second": DISK, "radii": (1.0, 2.0)}),
    "PairLaw.from_wall": (ker.PairLaw.from_wall, {"wall": TEETH, "first": DISK, "second": DISK, "radii": (1.0, 2.0)}),
    "PairLaw.sample": (PAIR.sample, {"normal": [0.0, 1.0], "first_velocity": [0.0, -1.0, 0.0],
                                     "second_velocity": [0.0, 0.0, 0.0], "rng": 0}),
    "play_gas": (ker.play_gas, {"container": CIRCLE, "pair": PAIR, "position": [[0.0, 0.0]],
                                "velocity": [[1.0, 0.0, 0.0]], "events": 3, "walls": None, "rng": 0}),
    "BilliardRecord.phase_portrait": (RECORD.phase_portrait, {"coordinates": "velocity"}),
    "BilliardRecord.animate": (RECORD.animate, {"frames": 3, "duration": 1.0}),
    "billiard_map": (geo.billiard_map, {"container": CIRCLE, "s": [0.1], "theta": [1.0], "iterations": 2}),
    "nested_reflection": (geo.nested_reflection, {"container": CIRCLE, "openings": [0], "s": [0.1], "theta": [1.0],
                                                  "max_collisions": 9}),
    "Container.from_curves": (geo.Container.from_curves, {"curves": CIRCLE.curves}),
    "Container.stadium": (geo.Container.stadium, {"length": 1.0, "radius": 1.0}),
    "Container.sinai": (geo.Container.sinai, {"side": 1.0, "radius": 0.2}),
    "Container.ellipse": (geo.Container.ellipse, {"a": 1.0, "b": 0.2}),
    "lyapunov_exponent": (ker.lyapunov_exponent, {"container": CIRCLE, "laws": ker.smooth(DISK), "collisions": 64,
                                                  "trajectories": 8, "rng": 0}),
    "no_slip_matrix": (ker.no_slip_matrix, {"disk": DISK}),
    "smooth_matrix": (ker.smooth_matrix, {"disk": DISK}),
    "play": (ker.play, {"container": STRIP, "laws": COLLISION, "position": [[0.0, 0.0]], "velocity": [[1.0, 1.0, 0.0]],
                        "collisions": 2, "rng": 0}),
    "resistance": (ker.resistance, {"law": LAW, "tolerance": 0.1}),
    "exchange_hollow": (ker.exchange_hollow, {
        "exchange": ker.IntervalExchangeLaw(ker.discretise(ker.lambertian(), ker.Bins(2))), "opening": 0.05}),
    "ReferenceValue": (spec.ReferenceValue, {"value": 0.0, "error": 0.0, "source": "by hand", "made_by": ()}),
    "WorkMethod": (spec.WorkMethod, {"name": "a", "solve": float, "is_random": False, "order": None}),
    "WorkProblem": (spec.WorkProblem, {"name": "a", "references": PROBLEM.references, "auto": "auto"}),
    "conductance": (spec.conductance, {"matrix": MATRIX}),
    "diffusivity": (spec.diffusivity, {"law": LAW, "radius": 1.0, "speed": 1.0, "arrangement": "mirror"}),
    "enclosures": (spec.enclosures, {"law": LAW, "k": 2, "basis": None, "tolerance": 0.1}),
    "hilbert_schmidt_norm": (spec.hilbert_schmidt_norm, {"law": LAW, "tolerance": 0.1}),
    "channel_paths": (spec.channel_paths, {"law": LAW, "times": [1.0, 2.0, 4.0], "particles": 4, "rng": 0,
        "radius": 1.0, "speed": 1.0, "bend": 3.0, "arrangement": "mirror"}),
    "prove_gap": (spec.prove_gap, {"law": ker.henyey_greenstein(0.5), "width": 0.1}),
    "essential_edge": (spec.essential_edge, {"law": LAW}),
    "channel_diffusivity": (spec.channel_diffusivity, {"law": LAW, "lengths": [1.0, 2.0], "particles": 4, "rng": 0,
        "radius": 1.0, "speed": 1.0, "arrangement": "mirror"}),
    "exit_times": (spec.exit_times, {"law": LAW, "lengths": [1.0, 2.0, 4.0], "particles": 4, "rng": 0, "radius": 1.0,
                                     "speed": 1.0, "arrangement": "mirror"}),
    "fit_order": (spec.fit_order, {"size": [1, 2, 4], "error": [1.0, 0.5, 0.25], "repeats": None}),
    "laplacian_comparison": (spec.laplacian_comparison, {"law": LAW, "degrees": 2, "tolerance": 0.1}),
    "mean_squared_slope": (spec.mean_squared_slope, {"wall": TEETH}),
    "mixing_time": (spec.mixing_time, {"kernel": MATRIX, "within": 0.25, "distance": "total variation",
                                       "initial": 1.0}),
    "accommodation": (spec.accommodation, {"law": LAW, "theta": [1.0], "tolerance": 0.1, "rng": 0}),
    "bounce_shares": (spec.bounce_shares, {"wall": TEETH, "incidence_deg": [30.0], "most": 2, "rng": 0}),
    "specular_share": (spec.specular_share, {"law": LAW, "incidence_deg": [30.0], "rng": 0}),
    "Between": (spec.Between, {"low": 0.2, "high": 0.4, "points": 4, "resolution": 0.1}),
    "transmission": (spec.transmission, {"law": LAW, "length": 1.0, "section": "channel", "tolerance": 0.1, "rng": 0}),
    "sweep": (spec.sweep, {"family": ker.maxwell, "grid": {"diffuse_fraction": [0.5]}, "quantities": "gap",
        "tolerance": 0.1, "progress": False, "zipped": False}),
    "ensemble": (spec.ensemble, {"family": seeded, "realisations": 4, "quantities": "gap", "tolerance": 0.1, "rng": 0,
                                 "progress": False}),
    "mean_law": (spec.mean_law, {"family": seeded, "realisations": 4, "basis": BINS, "tolerance": 0.1, "rng": 0}),
    "spectral_gap": (spec.spectral_gap, {"law": LAW, "tolerance": 0.1, "rng": 0}),
    "spectrum": (spec.spectrum, {"kernel": LAW, "k": 2, "tolerance": 0.1, "rng": 0}),
    "work_precision": (spec.work_precision, {"problem": PROBLEM, "methods": [METHOD], "budgets": [1.0], "repeats": 1,
                                             "seconds": 0.1, "warm_up": False, "threads": 1, "path": None}),
    "Estimate": (Estimate, {"value": 1.0, "error": 0.1, "kind": "bound", "method": "by hand"}),
    "study_wall": (study_wall, {"wall": geo.flat(), "name": "a", "disk": None, "tolerance": 0.1, "bins": 2, "rng": 0}),
}  # fmt: skip
# Functions of the first pages (README.md, docs/index.md, docs/quickstart.md) and their kin; all constructors join them.
FIRST = {
    "accommodation", "collide", "CollisionLaw.sample", "dispersing_arcs", "discretise", "distance", "elliptical_arcs",
    "focusing_arcs", "henyey_greenstein", "koch", "Law.apply", "Law.sample", "maxwell", "no_slip",
    "rectangular_teeth", "resistance", "smooth", "spectral_gap", "spectrum", "trace", "trajectory",
    "triangular_teeth", "Wall.foreshorten", "wall_for", "wall_from_text",
}  # fmt: skip
# How Python and numpy refuse what has no such method, no length, no truth, or is no path; its message and the lines
# of the call say the rest.
PLAIN = (TypeError, ValueError, AttributeError, IndexError)
# They hold what the library found, take no arguments, or are bases and protocols; `verify` has its own fuzz, and
# `check_proof` its own damaged certificates.
LEFT_OUT = {
    "Basis", "check_proof", "Container", "DiskStatus", "double_parabola", "flat", "invisible_body", "lambertian", "Law",
    "LeastResistanceLaw", "Proof", "retroreflection", "SpectralGap", "Spectrum", "specular", "Status",
    "SweepTable", "verify", "WorkReport", "zero_resistance_body",
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


ARC, SINE = geo.Arc((0.5, 0.0), 0.5, 3.2, 4.0), ker.SINE
EDGES = np.array([0.0, 1.0, 2.0, np.pi])
TRIANGLES, ROUGH = ker.TriangularTeethLaw(1.0), ker.RoughBody.disk(LAW)
# Methods of every kind of argument; the constructors and functions above are replaced argument by argument too.
METHODS: dict[str, tuple[Callable[..., Any], dict[str, Any]]] = {
    "Arc.moved": (ARC.moved, {"dx": 0.1, "dy": 0.1}),
    "Arc.split": (ARC.split, {"s": 0.5}),
    "Arc.stretched": (ARC.stretched, {"x_factor": 2.0, "y_factor": 1.0}),
    "AngularMeasure.sample": (SINE.sample, {"size": 3, "rng": 0}),
    "AngularMeasure.cdf": (SINE.cdf, {"angle": [1.0]}),
    "CollisionLaw.apply": (COLLISION.apply, {"function": lambda t, p: t * p, "theta": [1.0], "psi": [1.0]}),
    "CollisionLaw.__matmul__": (COLLISION.__matmul__, {"other": COLLISION}),
    "Container.draw": (CIRCLE.draw, {"ax": None}),
    "Container.polygon": (geo.Container.polygon, {"vertices": [(0, 0), (1, 0), (0, 1)]}),
    "ConfigurationSpace.contains": (SPACE.contains, {"configuration": [0.1, 1.0, 0.2]}),
    "Disk.rolling_momentum": (DISK.rolling_momentum, {"w": [0.0, 1.0, 0.0]}),
    "GasRecord.rotational_fraction": (
        ker.play_gas(CIRCLE, PAIR, [[0.0, 0.0]], [[1.0, 0.0, 0.0]], 3, rng=0).rotational_fraction, {"burn_in": 0.1}),
    "KernelMatrix.__pow__": (MATRIX.__pow__, {"exponent": 2}),
    "Law.__mul__": (LAW.__mul__, {"weight": 0.5}),
    "Law.__pow__": (LAW.__pow__, {"exponent": 2}),
    "Law.breakpoints": (TRIANGLES.breakpoints, {"limit": 10}),
    "Law.branches": (TRIANGLES.branches, {"theta": [1.0]}),
    "Law.conditionals": (
        TRIANGLES.conditionals, {"theta": [1.0], "tolerance": 1e-6, "degree": 4, "edges": [0.5, 1.0]},
    ),
    "MatrixLaw.density": (ker.MatrixLaw(MATRIX).density, {"theta": [1.0], "theta_out": [1.0]}),
    "RollingCharts.nearest": (geo.RollingCharts(np.pi / 30.0, 1.0).nearest, {"alpha": [0.1]}),
    "RoughBody.sample": (ROUGH.sample, {"n": 3, "rng": 0}),
    "Wall.save": (TEETH.save, {"path": "wall.toml", "overwrite": True}),
}  # fmt: skip
CALLS |= METHODS

WALL_LAW = ker.WallLaw(geo.elliptical_arcs(1.0))
MOMENTUM_BINS = ker.Bins(2, "sin2")
HALVES = ker.IntervalExchangeLaw(ker.discretise(ker.lambertian(), ker.Bins(2)))
# One object of every class whose methods take arguments, several where methods depend on what the object holds.
OBJECTS: tuple[Any, ...] = (
    ARC, geo.Bezier([(0, 0), (0.5, -1), (1, 0)]), geo.Segment((0, 0), (1, 0)), TEETH, DISK, PROFILE, SPACE, BUMPS,
    MUSHROOMS, STRIP, CIRCLE, geo.InnerDisk(0.25, 0.1), geo.RollingCharts(np.pi / 30.0, 1.0),
    geo.HeightCorrelation(0.1), geo.SelfAffine(0.5),
    BINS, ker.Legendre(4), ker.Panels([0.0, 1.0, np.pi], 2), ker.TensorBasis((ker.Bins(2), MOMENTUM_BINS)), SINE,
    MATRIX, SAMPLED, ker.lambertian(), LAW, ker.specular(), TRIANGLES, ker.RectangularTeethLaw(1.0),
    ker.CircularArcLaw(1.2), ker.PolygonLaw(geo.Wall.from_vertices([(0, 0), (0.3, -0.4), (0.6, -0.1), (1, 0)])),
    WALL_LAW, ker.WallLaw(TEETH), ker.MushroomLaw(MUSHROOMS), ker.MatrixLaw(MATRIX), HALVES,
    ker.InvolutionLaw(lambda theta: np.pi - theta), ker.DensityLaw(lambda a, b: 0.5 * np.sin(b) + 0.0 * a),
    ker.LeastResistanceLaw(), 0.5 * LAW + 0.5 * ker.specular(), TRIANGLES @ ker.specular(), TRIANGLES**2,
    LAW.in_specular_frame(), COLLISION, 0.5 * COLLISION + 0.5 * ker.smooth(DISK), ker.no_slip(DISK),
    GROOVES, 0.5 * GROOVES + 0.5 * GROOVES @ GROOVES, ker.Zernike(2),
    ker.SatelliteLaw(TEETH, DISK, 0.01), PAIR, ROUGH, ker.PolygonalBody([[(0, 0), (1, 0), (0, 1)]]),
    ker.PositionLaw([0.0, 1.0], [LAW]), ker.SpringWall(0.5, 1.0),
    ker.CollisionAlongWall(ker.PositionLaw([0.0, 1.0], [LAW]), DISK), RECORD, ker.displacements(TEETH, 200, rng=0),
    ker.exchange_hollow(HALVES, 0.05), spec.spectrum(LAW, 2, tolerance=0.1),
)  # fmt: skip
# Arguments by name, of a class alone after its name; methods that are not here are listed in `UNCALLED`.
ARGUMENTS: dict[str, Any] = {
    "theta": [0.5, 1.0], "psi": [1.0, 2.0], "theta_out": [1.0, 2.0], "x": [0.3, 0.4], "edges": EDGES, "limit": 10,
    "function": np.cos, "basis": BINS, "rng": 0, "velocity": VELOCITY, "position": POSITION, "angle": [0.5, 1.0],
    "angles": [0.5, 1.0], "n": 4, "other": LAW, "weight": 0.5, "factor": 2.0, "exponent": 2, "tolerance": 0.1,
    "low": [0.5], "high": [1.0], "probability": [0.3, 0.6], "order": 3, "size": 3, "degree": 2, "smallest": 0.01,
    "half_angle": 1.0, "ax": None, "dx": 0.1, "dy": 0.1, "start": (0.0, 0.0), "end": (1.0, 0.0), "s": 0.5, "axis": 1,
    "x_factor": 2.0, "y_factor": 1.0, "configuration": [0.1, 1.0, 0.2], "alpha": [0.1, 0.2], "number": [0, 1],
    "point": [0.1, 0.2], "points": 8, "period": 1.0, "length": [0.1, 0.2], "wall": [0, 1], "last": [0, 0],
    "direction": 1.0, "radius": 1.0, "region": CIRCLE, "law": LAW, "first": LAW, "second": LAW, "a": 1.0, "b": 0.5,
    "vertices": [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)], "index": 1, "path": "no/such", "overwrite": False,
    "disk": DISK, "generation": 1, "max_collisions": 9, "threads": 1, "unit": "nm", "gap": 1.0, "rays": 64,
    "nodes": 4, "most_hits": 9, "most": 0.1, "cells": BINS, "incoming": [0.5, 1.0], "outgoing": [1.0, 2.0],
    "total": np.zeros((4, 4)), "vectors": np.ones((6, 2)), "moments": np.ones((2, 2, 3)), "panel": np.array([0, 1]),
    "wall_normal": [0.0, 1.0], "w": [0.0, 1.0, 0.0], "w2": [0.0, 1.0, 0.0], "theta_basis": BINS,
    "psi_basis": MOMENTUM_BINS, "samples": 64, "neck": 0.1, "unfollowed": 0.0, "distance": 0.1, "scale": 1.0,
    "largest": 4, "speed": [1.0, 2.0], "gas_temperature": 1.0, "temperature": 1.0, "left": 0.0, "right": 1.0,
    "intervals": 2, "family": lambda x: LAW, "walls": [TEETH], "repeats": 1, "container": STRIP, "n_in": 3, "n_out": 3,
    "centre": [0.0, 0.0], "cost": None, "directions": None, "normal": [0.0, 1.0], "scales": [0.1],
    "first_velocity": [0.0, -1.0, 0.0], "second_velocity": [0.0, 0.0, 0.0], "near": np.array([True] * 9),
    "coordinates": "velocity", "frames": 3, "duration": 1.0, "ConfigurationSpace.height": -0.5,
    "ConfigurationSpace.position": POSITION[0], "ConfigurationSpace.velocity": VELOCITY[0],
    
    "BilliardRecord.direction": (1.0, 0.0), "TensorBasis.angle": [0.5, 1.0],
    "RollingCharts.position": [0.1, 0.2], "RollingCharts.velocity": [0.1, -1.0, 0.2], "Container.wall": [0],
    "CollisionAlongWall.position": [0.3, 0.0], "CollisionAlongWall.wall": 0, "CollisionAlongWall.x": [0.3],
    "Displacements.probability": 0.5, "KernelMatrix.other": MATRIX, "SpringWall.velocity": [[0.2, -1.0]],
    "SpringWall.n": 4096, "CollisionLaw.other": COLLISION, "CollisionCombination.other": COLLISION,
    "PositionLaw.function": lambda x, theta: np.cos(theta), "CollisionLaw.function": lambda t, p: t * p,
    "CollisionCombination.function": lambda t, p: t * p, "ExchangeHollow.function": lambda a, b: a * b,
    "TensorBasis.function": lambda angle: angle[..., 0], "Zernike.function": lambda at: at[..., 0],
    "Zernike.angle": [0.5, 0.1], "HemisphereLaw.velocity": [[0.2, 0.1, -1.0]],
    "HemisphereCombination.velocity": [[0.2, 0.1, -1.0]], "m": 1, "ExchangeHollow.number": 2, "PairLaw.wall": TEETH,
    "CollisionLaw.wall": TEETH, "Container.length": [0.1], "PolygonalBody.rays": 128, "Container.angle": 1.0,
    "Wall.vertices": [(0.0, 0.0), (0.5, -1.0), (1.0, 0.0)], "Wall.height": [0.0, 0.1], "Wall.seam": "mirror",
    "Profile.unit": "", "ConfigurationSpace.length": 1.0, "SatelliteDisk.alpha": 0.1, "Container.last": [-1],
    "Container.position": [[0.3, 0.1]], "Container.velocity": [[0.2, -1.0]], "Panels.wall": TEETH, "side": 2.0,
    "curves": CIRCLE.curves, "PairLaw.first": DISK, "PairLaw.second": DISK, "radii": (1.0, 2.0),
    "PolygonalBody.position": [[3.0, 0.1]], "PolygonalBody.velocity": [[-1.0, 0.0]], "PositionLaw.at.x": 0.3,
    "SpringWall.gas_temperature": 2.0, "Container.length_on.wall": 0, "Container.touch.wall": 0,
    "Container.length_on.position": [0.3, 0.1], "Container.touch.position": [0.3, 0.1],
}  # fmt: skip
# They take other functions of the library, an array into which they write, or what other functions have checked.
UNCALLED = {
    "matrix_on",
    "entries",
    "on_disc",
    "reflected",
    "add_products",
    "attempt",
    "apply_to_states",
    "save",
    "draw",
    "plot",
    "plot_eigenfunctions",
    "features",
}


def method_calls() -> dict[str, tuple[Callable[..., Any], dict[str, Any]]]:
    """Every public method of `OBJECTS` with arguments by their names."""
    found: dict[str, tuple[Callable[..., Any], dict[str, Any]]] = {}
    for thing in OBJECTS:
        kind = type(thing)
        for name in sorted({name for _, name in methods_of(kind)} - UNCALLED - set(OPERATORS)):
            method = getattr(thing, name)
            names = [
                name for name, one in inspect.signature(method).parameters.items() if one.kind is not one.VAR_KEYWORD
            ]
            label = f"{kind.__name__}.{name}"
            arguments = {
                one: next(
                    ARGUMENTS[key] for key in (f"{label}.{one}", f"{kind.__name__}.{one}", one) if key in ARGUMENTS
                )
                for one in names
            }
            label += "" if label not in found else f" of {thing!r}"
            found[label] = method, arguments
    return found
