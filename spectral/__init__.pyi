from .channel import ExitTimes as ExitTimes
from .channel import exit_times as exit_times
from .cheeger import Conductance as Conductance
from .cheeger import conductance as conductance
from .diffusion import Diffusivity as Diffusivity
from .diffusion import diffusivity as diffusivity
from .eigenvalues import Spectrum as Spectrum
from .eigenvalues import SpectrumErrors as SpectrumErrors
from .eigenvalues import spectrum as spectrum
from .enclosure import Enclosure as Enclosure
from .enclosure import Enclosures as Enclosures
from .enclosure import enclosures as enclosures
from .error_and_time import work_precision as work_precision
from .essential import EssentialEdge as EssentialEdge
from .essential import essential_edge as essential_edge
from .fitted_order import FittedOrder as FittedOrder
from .fitted_order import fit_order as fit_order
from .gap import (
    SpectralGap as SpectralGap,
)
from .gap import (
    gaps_in_both_conventions as gaps_in_both_conventions,
)
from .gap import (
    spectral_gap as spectral_gap,
)
from .laplacian import (
    LaplacianComparison as LaplacianComparison,
)
from .laplacian import (
    laplacian_comparison as laplacian_comparison,
)
from .laplacian import (
    mean_squared_slope as mean_squared_slope,
)
from .leading import LeadingEigenvalues as LeadingEigenvalues
from .leading import leading_eigenvalues as leading_eigenvalues
from .machine import Machine as Machine
from .reference_value import ReferenceValue as ReferenceValue
from .relaxation import MixingTime as MixingTime
from .relaxation import mixing_time as mixing_time
from .sampling import bootstrap_intervals as bootstrap_intervals
from .work_problem import WorkMethod as WorkMethod
from .work_problem import WorkProblem as WorkProblem
from .work_report import MethodFacts as MethodFacts
from .work_report import WorkReport as WorkReport
from .work_row import WorkRow as WorkRow
