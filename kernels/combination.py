"""The algebra of laws: weighted sums, compositions, powers, and the change of frame."""

from .composition import Composition, Power
from .specular_frame import SpecularFrame
from .weighted_sum import Combination, mixture

__all__ = ["Combination", "Composition", "Power", "SpecularFrame", "mixture"]
