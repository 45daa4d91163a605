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
    from .discretisation import discretise
    from .estimation import estimate
    from .ideal import lambertian, maxwell, retroreflection, specular
    from .involution import InvolutionLaw
    from .law import BranchLaw, DrivenLaw, Law
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
    from .satellite_law import SatelliteLaw
    from .specular_frame import SpecularFrame
    from .symmetry import Defect, SymmetryDefect
    from .tensor import TensorBasis
    from .triangular import TriangularTeethLaw
    from .wall_law import WallLaw
    from .weighted_sum import Combination, mixture

_HOMES = {
    "AngularMeasure": "measure",
    "Basis": "basis",
    "BilliardRecord": "billiard",
    "Bins": "bins",
    "BranchLaw": "law",
    "CircularArcLaw": "circular",
    "CollisionLaw": "collision",
    "Combination": "weighted_sum",
    "Composition": "composition",
    "Defect": "symmetry",
    "DensityLaw": "density",
    "DrivenLaw": "law",
    "InvolutionLaw": "involution",
    "KernelMatrix": "matrix",
    "Law": "law",
    "Legendre": "legendre",
    "LimitStudy": "convergence",
    "MatrixLaw": "matrix_law",
    "Panels": "panels",
    "PolygonLaw": "polygon_law",
    "Power": "composition",
    "RectangularTeethLaw": "rectangular",
    "Reflector": "billiard",
    "SINE": "measure",
    "SINE_SQUARED": "measure",
    "SatelliteLaw": "satellite_law",
    "SpecularFrame": "specular_frame",
    "SymmetryDefect": "symmetry",
    "TensorBasis": "tensor",
    "TriangularTeethLaw": "triangular",
    "WallLaw": "wall_law",
    "discretise": "discretisation",
    "draw_limit": "limit_picture",
    "estimate": "estimation",
    "henyey_greenstein": "phase_function",
    "lambertian": "ideal",
    "limit_study": "convergence",
    "load_matrix": "matrixfile",
    "maxwell": "ideal",
    "mixture": "weighted_sum",
    "no_slip_matrix": "collision_matrices",
    "play": "billiard",
    "retroreflection": "ideal",
    "smooth_matrix": "collision_matrices",
    "specular": "ideal",
}

__all__ = [
    "SINE",
    "SINE_SQUARED",
    "AngularMeasure",
    "Basis",
    "BilliardRecord",
    "Bins",
    "BranchLaw",
    "CircularArcLaw",
    "CollisionLaw",
    "Combination",
    "Composition",
    "Defect",
    "DensityLaw",
    "DrivenLaw",
    "InvolutionLaw",
    "KernelMatrix",
    "Law",
    "Legendre",
    "LimitStudy",
    "MatrixLaw",
    "Panels",
    "PolygonLaw",
    "Power",
    "RectangularTeethLaw",
    "Reflector",
    "SatelliteLaw",
    "SpecularFrame",
    "SymmetryDefect",
    "TensorBasis",
    "TriangularTeethLaw",
    "WallLaw",
    "discretise",
    "draw_limit",
    "estimate",
    "henyey_greenstein",
    "lambertian",
    "limit_study",
    "load_matrix",
    "maxwell",
    "mixture",
    "no_slip_matrix",
    "play",
    "retroreflection",
    "smooth_matrix",
    "specular",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f".{_HOMES[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
