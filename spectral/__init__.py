"""Spectra and gaps of reflection laws, with errors that can be quoted."""

from .eigenvalues import Spectrum, SpectrumErrors, spectrum
from .gap import SpectralGap, spectral_gap

__all__ = ["SpectralGap", "Spectrum", "SpectrumErrors", "spectral_gap", "spectrum"]
