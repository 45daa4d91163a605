"""Spectra and gaps of reflection laws, and what follows from them, with errors that can be quoted.

Names are imported when they are first used, so that ``import asperity`` stays quick.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .channel import ExitTimes, exit_times
    from .cheeger import Conductance, conductance
    from .diffusion import Diffusivity, diffusivity
    from .eigenvalues import Spectrum, SpectrumErrors, spectrum
    from .enclosure import Enclosure, Enclosures, enclosures
    from .error_and_time import work_precision
    from .essential import EssentialEdge, essential_edge
    from .fitted_order import FittedOrder, fit_order
    from .gap import SpectralGap, gaps_in_both_conventions, spectral_gap
    from .laplacian import LaplacianComparison, laplacian_comparison, mean_squared_slope
    from .leading import LeadingEigenvalues, leading_eigenvalues
    from .machine import Machine
    from .reference_value import ReferenceValue
    from .relaxation import MixingTime, mixing_time
    from .sampling import bootstrap_intervals
    from .work_problem import WorkMethod, WorkProblem
    from .work_report import MethodFacts, WorkReport
    from .work_row import WorkRow

_HOMES = {
    "Conductance": "cheeger",
    "Diffusivity": "diffusion",
    "Enclosure": "enclosure",
    "Enclosures": "enclosure",
    "EssentialEdge": "essential",
    "ExitTimes": "channel",
    "FittedOrder": "fitted_order",
    "LaplacianComparison": "laplacian",
    "LeadingEigenvalues": "leading",
    "Machine": "machine",
    "MethodFacts": "work_report",
    "MixingTime": "relaxation",
    "ReferenceValue": "reference_value",
    "SpectralGap": "gap",
    "Spectrum": "eigenvalues",
    "SpectrumErrors": "eigenvalues",
    "WorkMethod": "work_problem",
    "WorkProblem": "work_problem",
    "WorkReport": "work_report",
    "WorkRow": "work_row",
    "bootstrap_intervals": "sampling",
    "conductance": "cheeger",
    "diffusivity": "diffusion",
    "enclosures": "enclosure",
    "essential_edge": "essential",
    "exit_times": "channel",
    "fit_order": "fitted_order",
    "gaps_in_both_conventions": "gap",
    "laplacian_comparison": "laplacian",
    "leading_eigenvalues": "leading",
    "mean_squared_slope": "laplacian",
    "mixing_time": "relaxation",
    "spectral_gap": "gap",
    "spectrum": "eigenvalues",
    "work_precision": "error_and_time",
}

__all__ = [
    "Conductance",
    "Diffusivity",
    "Enclosure",
    "Enclosures",
    "EssentialEdge",
    "ExitTimes",
    "FittedOrder",
    "LaplacianComparison",
    "LeadingEigenvalues",
    "Machine",
    "MethodFacts",
    "MixingTime",
    "ReferenceValue",
    "SpectralGap",
    "Spectrum",
    "SpectrumErrors",
    "WorkMethod",
    "WorkProblem",
    "WorkReport",
    "WorkRow",
    "bootstrap_intervals",
    "conductance",
    "diffusivity",
    "enclosures",
    "essential_edge",
    "exit_times",
    "fit_order",
    "gaps_in_both_conventions",
    "laplacian_comparison",
    "leading_eigenvalues",
    "mean_squared_slope",
    "mixing_time",
    "spectral_gap",
    "spectrum",
    "work_precision",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f".{_HOMES[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
