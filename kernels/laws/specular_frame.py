"""The change between the paper's convention and Feres' convention."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...checks import Floats
from ..bases.angles import flipped
from .composition import Composition, as_base
from .law import AngleFunction, Frame, Law, set_facts
from .weighted_sum import Combination


@dataclass(frozen=True, repr=False)
class SpecularFrame(Law):
    """P J, f -> P(J f) with J f(theta) = f(pi - theta): the law in the other frame.

    Of a law in the paper's frame this is P_F, Feres' convention: specular reflection is the identity. P_F is
    self-adjoint exactly if P~ is and commutes with J; a mirror-symmetric wall suffices.

    Source: Rudzis 2022, section 1.2.6, with the convention that its formula needs (P~u - u is small for flat walls).

    Examples
    --------
    >>> from asperity.kernels.laws.ideal import specular
    >>> frame = specular().in_specular_frame()
    >>> frame, frame.frame, frame.branches(1.0)[1].tolist() == [1.0]
    (specular().in_specular_frame(), 'specular', True)
    """

    law: Law

    def __post_init__(self) -> None:
        mirror = self.law.mirror_symmetric
        set_facts(self, frame=_other_frame(self.law.frame), mirror_symmetric=mirror, fan_out=self.law.fan_out)
        set_facts(self, reversible=mirror if self.law.reversible else None)

    @staticmethod
    def of(law: Law) -> Law:
        """The law in the other frame; of a law that was moved there, the law itself; of a sum, term by term."""
        if isinstance(law, SpecularFrame):
            return law.law
        if isinstance(law, Combination):
            return Combination(tuple((weight, SpecularFrame.of(term)) for weight, term in law.terms))
        return SpecularFrame(law)

    def adjoint(self) -> Law:
        """(P J)* = J P*, written as J (P* J) J with J a law of this frame."""
        if self.reversible:
            return self
        turned = SpecularFrame.of(self.law.adjoint())
        return turned if self.mirror_symmetric else Composition((_flip(self.frame), turned, _flip(self.frame)))

    def branches(self, theta: ArrayLike) -> tuple[Floats, Floats]:
        probability, outgoing = self.law.branches(theta)
        return probability, flipped(outgoing)

    def kinks(self, limit: int) -> tuple[Floats, float]:
        return self.law.kinks(limit)

    def _sample(self, theta: Floats, rng: np.random.Generator) -> Floats:
        return flipped(self.law.sample(theta, rng))

    def _apply(self, function: AngleFunction, theta: Floats) -> Floats:
        return self.law.apply(lambda angle: function(flipped(angle)), theta)

    def __repr__(self) -> str:
        return f"{as_base(self.law)}.in_specular_frame()"


def _other_frame(frame: Frame) -> Frame:
    return "paper" if frame == "specular" else "specular"


def _flip(frame: Frame) -> Law:
    """The operator J as a law of the given frame."""
    from .ideal import retroreflection, specular

    return specular() if frame == "paper" else SpecularFrame(retroreflection())
