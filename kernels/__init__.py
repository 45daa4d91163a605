"""Reflection laws and collision laws as Markov kernels: bases, laws and their algebra, matrices, estimation.

Names are imported when they are first used, so that ``import asperity`` stays quick.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .basis import Basis
    from .billiard import BilliardRecord, Reflector, play
    from .bins import Bins
    from .circular import CircularArcLaw
    from .collision import CollisionLaw
    from .collision_matrices import no_slip_matrix, smooth_matrix
    from .composition import Composition, Power
    from .convergence import LimitStudy, limit_study
    from .density import DensityLaw
    from .difference import DifferenceTest, difference_test
    from .discretisation import discretise
    from .distances import Distance, distance
    from .estimation import estimate
    from .extremal import ExtremalResistance, extremal_resistance
    from .functional import air_resistance, resistance
    from .hollow_search import BestHollow, best_hollow
    from .ideal import lambertian, maxwell, retroreflection, specular
    from .interval_exchange import IntervalExchangeLaw
    from .involution import InvolutionLaw
    from .law import BranchLaw, DrivenLaw, Law
    from .least_resistance import LeastResistanceLaw
    from .legendre import Legendre
    from .limit_picture import draw_limit
    from .matrix import KernelMatrix
    from .matrix_law import MatrixLaw
    from .matrixfile import load_matrix
    from .measure import SINE, SINE_SQUARED, AngularMeasure
    from .panels import Panels
    from .phase_function import henyey_greenstein
    from .polygon_law import PolygonLaw
    from .rectangular import RectangularTeethLaw
    from .rough_body import RoughBody
    from .satellite_law import SatelliteLaw
    from .specular_frame import SpecularFrame
    from .symmetry import Defect, SymmetryDefect
    from .tensor import TensorBasis
    from .triangular import TriangularTeethLaw
    from .two_mirror_hollow import TwoMirrorHollow, two_mirrors
    from .wall_convergence import Convergence, ConvergenceStep, study_convergence
    from .wall_law import WallLaw
    from .weighted_sum import Combination, mixture

_HOMES = {
    "AngularMeasure": "measure",
    "Basis": "basis",
    "BilliardRecord": "billiard",
    "BestHollow": "hollow_search",
    "Bins": "bins",
    "BranchLaw": "law",
    "CircularArcLaw": "circular",
    "CollisionLaw": "collision",
    "Combination": "weighted_sum",
    "Composition": "composition",
    "Convergence": "wall_convergence",
    "ConvergenceStep": "wall_convergence",
    "Defect": "symmetry",
    "DensityLaw": "density",
    "DifferenceTest": "difference",
    "Distance": "distances",
    "DrivenLaw": "law",
    "ExtremalResistance": "extremal",
    "IntervalExchangeLaw": "interval_exchange",
    "InvolutionLaw": "involution",
    "KernelMatrix": "matrix",
    "Law": "law",
    "LeastResistanceLaw": "least_resistance",
    "Legendre": "legendre",
    "LimitStudy": "convergence",
    "MatrixLaw": "matrix_law",
    "Panels": "panels",
    "PolygonLaw": "polygon_law",
    "Power": "composition",
    "RectangularTeethLaw": "rectangular",
    "Reflector": "billiard",
    "RoughBody": "rough_body",
    "SINE": "measure",
    "SINE_SQUARED": "measure",
    "SatelliteLaw": "satellite_law",
    "SpecularFrame": "specular_frame",
    "SymmetryDefect": "symmetry",
    "TensorBasis": "tensor",
    "TriangularTeethLaw": "triangular",
    "TwoMirrorHollow": "two_mirror_hollow",
    "WallLaw": "wall_law",
    "air_resistance": "functional",
    "best_hollow": "hollow_search",
    "difference_test": "difference",
    "discretise": "discretisation",
    "distance": "distances",
    "draw_limit": "limit_picture",
    "estimate": "estimation",
    "extremal_resistance": "extremal",
    "henyey_greenstein": "phase_function",
    "lambertian": "ideal",
    "limit_study": "convergence",
    "load_matrix": "matrixfile",
    "maxwell": "ideal",
    "mixture": "weighted_sum",
    "no_slip_matrix": "collision_matrices",
    "resistance": "functional",
    "play": "billiard",
    "retroreflection": "ideal",
    "smooth_matrix": "collision_matrices",
    "specular": "ideal",
    "study_convergence": "wall_convergence",
    "two_mirrors": "two_mirror_hollow",
}

__all__ = [
    "SINE",
    "SINE_SQUARED",
    "AngularMeasure",
    "Basis",
    "BestHollow",
    "BilliardRecord",
    "Bins",
    "BranchLaw",
    "CircularArcLaw",
    "CollisionLaw",
    "Combination",
    "Composition",
    "Convergence",
    "ConvergenceStep",
    "Defect",
    "DensityLaw",
    "DifferenceTest",
    "Distance",
    "DrivenLaw",
    "ExtremalResistance",
    "IntervalExchangeLaw",
    "InvolutionLaw",
    "KernelMatrix",
    "Law",
    "LeastResistanceLaw",
    "Legendre",
    "LimitStudy",
    "MatrixLaw",
    "Panels",
    "PolygonLaw",
    "Power",
    "RectangularTeethLaw",
    "Reflector",
    "RoughBody",
    "SatelliteLaw",
    "SpecularFrame",
    "SymmetryDefect",
    "TensorBasis",
    "TriangularTeethLaw",
    "TwoMirrorHollow",
    "WallLaw",
    "air_resistance",
    "best_hollow",
    "difference_test",
    "discretise",
    "distance",
    "draw_limit",
    "estimate",
    "extremal_resistance",
    "henyey_greenstein",
    "lambertian",
    "limit_study",
    "load_matrix",
    "maxwell",
    "mixture",
    "no_slip_matrix",
    "play",
    "resistance",
    "retroreflection",
    "smooth_matrix",
    "specular",
    "study_convergence",
    "two_mirrors",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f".{_HOMES[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
