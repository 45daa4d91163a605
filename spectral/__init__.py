"""Spectra and gaps of reflection laws, with errors that can be quoted; error against run time."""

from .eigenvalues import Spectrum, SpectrumErrors, spectrum
from .enclosure import Enclosure, Enclosures, enclosures
from .error_and_time import work_precision
from .essential import EssentialEdge, essential_edge
from .fitted_order import FittedOrder, fit_order
from .gap import SpectralGap, spectral_gap
from .machine import Machine
from .reference_value import ReferenceValue
from .work_problem import WorkMethod, WorkProblem
from .work_report import MethodFacts, WorkReport
from .work_row import WorkRow

__all__ = [
    "Enclosure",
    "Enclosures",
    "EssentialEdge",
    "FittedOrder",
    "Machine",
    "MethodFacts",
    "ReferenceValue",
    "SpectralGap",
    "Spectrum",
    "SpectrumErrors",
    "WorkMethod",
    "WorkProblem",
    "WorkReport",
    "WorkRow",
    "enclosures",
    "essential_edge",
    "fit_order",
    "spectral_gap",
    "spectrum",
    "work_precision",
]
