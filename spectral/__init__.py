"""Spectra and gaps of reflection laws, with errors that can be quoted."""

from .eigenvalues import Spectrum, SpectrumErrors, spectrum
from .enclosure import Enclosure, Enclosures, enclosures
from .essential import EssentialEdge, essential_edge
from .gap import SpectralGap, spectral_gap

__all__ = [
    "Enclosure",
    "Enclosures",
    "EssentialEdge",
    "SpectralGap",
    "Spectrum",
    "SpectrumErrors",
    "enclosures",
    "essential_edge",
    "spectral_gap",
    "spectrum",
]
