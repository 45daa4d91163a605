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
    from .essential import EssentialEdge, essential_edge
    from .gap import SpectralGap, gaps_in_both_conventions, spectral_gap
    from .laplacian import LaplacianComparison, laplacian_comparison, mean_squared_slope
    from .leading import LeadingEigenvalues, leading_eigenvalues
    from .relaxation import MixingTime, mixing_time
    from .sampling import bootstrap_intervals

_HOMES = {
    "Conductance": "cheeger",
    "Diffusivity": "diffusion",
    "Enclosure": "enclosure",
    "Enclosures": "enclosure",
    "EssentialEdge": "essential",
    "ExitTimes": "channel",
    "LaplacianComparison": "laplacian",
    "LeadingEigenvalues": "leading",
    "MixingTime": "relaxation",
    "SpectralGap": "gap",
    "Spectrum": "eigenvalues",
    "SpectrumErrors": "eigenvalues",
    "bootstrap_intervals": "sampling",
    "conductance": "cheeger",
    "diffusivity": "diffusion",
    "enclosures": "enclosure",
    "essential_edge": "essential",
    "exit_times": "channel",
    "laplacian_comparison": "laplacian",
    "gaps_in_both_conventions": "gap",
    "leading_eigenvalues": "leading",
    "mean_squared_slope": "laplacian",
    "mixing_time": "relaxation",
    "spectral_gap": "gap",
    "spectrum": "eigenvalues",
}

__all__ = [
    "Conductance",
    "Diffusivity",
    "Enclosure",
    "Enclosures",
    "EssentialEdge",
    "ExitTimes",
    "LaplacianComparison",
    "LeadingEigenvalues",
    "MixingTime",
    "SpectralGap",
    "Spectrum",
    "SpectrumErrors",
    "bootstrap_intervals",
    "conductance",
    "diffusivity",
    "enclosures",
    "essential_edge",
    "exit_times",
    "gaps_in_both_conventions",
    "laplacian_comparison",
    "leading_eigenvalues",
    "mean_squared_slope",
    "mixing_time",
    "spectral_gap",
    "spectrum",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f".{_HOMES[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
