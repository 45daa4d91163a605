"""Spectra and spectral gaps of reflection laws, and their consequences, with errors.

Names are imported on first use, so ``import asperity`` is quick. The stub beside this file lists their modules.

- Compute spectra and gaps: SpectralGap, spectral_gap, spectrum, Spectrum, enclosures, essential_edge,
  hilbert_schmidt_norm.
- Compute what follows from a law: accommodation, bounce_shares, channel_diffusivity, channel_paths, conductance,
  diffusivity, exit_times, laplacian_comparison, mean_squared_slope, mixing_time, specular_share, transmission.
- Vary parameters: Between, SweepTable, ensemble, mean_law, sweep.
- Prove a gap: Proof, check_proof, prove_gap.
- Measure error against time: ReferenceValue, WorkMethod, WorkProblem, WorkReport, fit_order, work_precision.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
