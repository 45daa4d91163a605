from .basis import Basis as Basis
from .billiard import BilliardRecord as BilliardRecord
from .billiard import Reflector as Reflector
from .billiard import play as play
from .bins import Bins as Bins
from .circular import CircularArcLaw as CircularArcLaw
from .collision import CollisionLaw as CollisionLaw
from .collision_matrices import no_slip_matrix as no_slip_matrix
from .collision_matrices import smooth_matrix as smooth_matrix
from .composition import Composition as Composition
from .composition import Power as Power
from .convergence import LimitStudy as LimitStudy
from .convergence import limit_study as limit_study
from .density import DensityLaw as DensityLaw
from .difference import DifferenceTest as DifferenceTest
from .difference import difference_test as difference_test
from .discretisation import discretise as discretise
from .distances import Distance as Distance
from .distances import distance as distance
from .estimation import estimate as estimate
from .extremal import ExtremalResistance as ExtremalResistance
from .extremal import extremal_resistance as extremal_resistance
from .functional import air_resistance as air_resistance
from .functional import resistance as resistance
from .hollow_search import BestHollow as BestHollow
from .hollow_search import best_hollow as best_hollow
from .ideal import (
    lambertian as lambertian,
)
from .ideal import (
    maxwell as maxwell,
)
from .ideal import (
    retroreflection as retroreflection,
)
from .ideal import (
    specular as specular,
)
from .interval_exchange import IntervalExchangeLaw as IntervalExchangeLaw
from .involution import InvolutionLaw as InvolutionLaw
from .law import BranchLaw as BranchLaw
from .law import DrivenLaw as DrivenLaw
from .law import Law as Law
from .least_resistance import LeastResistanceLaw as LeastResistanceLaw
from .legendre import Legendre as Legendre
from .limit_picture import draw_limit as draw_limit
from .matrix import KernelMatrix as KernelMatrix
from .matrix_law import MatrixLaw as MatrixLaw
from .matrixfile import load_matrix as load_matrix
from .measure import SINE as SINE
from .measure import SINE_SQUARED as SINE_SQUARED
from .measure import AngularMeasure as AngularMeasure
from .panels import Panels as Panels
from .phase_function import henyey_greenstein as henyey_greenstein
from .polygon_law import PolygonLaw as PolygonLaw
from .rectangular import RectangularTeethLaw as RectangularTeethLaw
from .rough_body import RoughBody as RoughBody
from .satellite_law import SatelliteLaw as SatelliteLaw
from .specular_frame import SpecularFrame as SpecularFrame
from .symmetry import Defect as Defect
from .symmetry import SymmetryDefect as SymmetryDefect
from .tensor import TensorBasis as TensorBasis
from .triangular import TriangularTeethLaw as TriangularTeethLaw
from .two_mirror_hollow import TwoMirrorHollow as TwoMirrorHollow
from .two_mirror_hollow import two_mirrors as two_mirrors
from .wall_convergence import (
    Convergence as Convergence,
)
from .wall_convergence import (
    ConvergenceStep as ConvergenceStep,
)
from .wall_convergence import (
    study_convergence as study_convergence,
)
from .wall_law import WallLaw as WallLaw
from .weighted_sum import Combination as Combination
from .weighted_sum import mixture as mixture
