"""Reflection laws: Markov kernels P~(theta, d theta') on (0, pi), as values that compose and mix."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike

from ...checks import Floats, angles, finite_array, generator, whole_number
from ...errors import InputError

if TYPE_CHECKING:
    from .weighted_sum import Combination

Frame = Literal["paper", "specular"]
AngleFunction = Callable[[Floats], Floats]

# Half the spacing of rng.random(): draws of exactly 0, an entry through a tip of the wall, become this instead.
SMALLEST_DRAW = 2.0**-54


class Law(ABC):
    """A Markov kernel P~(theta, d theta') on the half circle (0, pi).

    In the paper's convention theta' = theta is retroreflection and theta' = pi - theta is specular.

    Attributes
    ----------
    reversible : bool or None
        Whether P~ is symmetric with respect to sin(theta) d theta; None where it is not known.
    mirror_symmetric : bool or None
        Whether P~ commutes with J f(theta) = f(pi - theta); None where it is not known.
    frame : {"paper", "specular"}
        ``"specular"`` after `in_specular_frame`, where specular reflection is the identity (Feres' convention).
    fan_out : int
        At how many outgoing angles `apply` evaluates its function for one incoming angle: its cost.
    exact_apply : bool
        Whether `apply` gives expectations to rounding, of any function. Where it is a quadrature the answer is no, and
        `asperity.spectral.enclosures` asks for errors that it can know otherwise.

    Notes
    -----
    Laws compose as operators, ``first @ second``, and both must be in the same frame. In the paper's frame the
    outgoing angle of one collision is the next incoming angle as it stands: the velocity is reversed in between. In
    the specular frame it is pi minus that: the particle flies across a straight channel to the mirror image of the
    wall, so powers of ``law.in_specular_frame()`` are the collisions in a channel.
    """

    reversible: bool | None = None
    mirror_symmetric: bool | None = None
    frame: Frame = "paper"
    fan_out: int = 1
    exact_apply: bool = False

    # A law is an operator, not an array: numpy must leave ``0.3 * law`` to us.
    __array_ufunc__ = None

    # ---- what a law does -------------------------------------------------------------------------------------
    def sample(self, theta: ArrayLike, rng: np.random.Generator) -> Floats:
        """Draw one outgoing angle for every incoming angle ``theta``; same shape, radians in (0, pi)."""
        return self._sample(angles("theta", theta), generator(rng))

    def apply(self, function: AngleFunction, theta: ArrayLike) -> Floats:
        """The operator: E[f(Theta') | theta], for a vectorised f whose values have shape ``theta.shape + extra``."""
        return self._apply(function, angles("theta", theta))

    def branches(self, theta: ArrayLike) -> tuple[Floats, Floats]:
        """Probabilities and outgoing angles of a law made of isometries theta' = +-theta + const.

        Returns two arrays of shape ``theta.shape + (branches,)``; branches with equal isometry are merged, unused
        slots have probability 0 and the angle of another branch. Raises an InputError for laws of another kind.
        """
        raise InputError(
            f"{self!r} is not a finite mixture of isometries, so it has no branches; use sample() or apply()"
        )

    def kinks(self, limit: int) -> tuple[Floats, float]:
        """Increasing angles in (0, pi) between which rows vary smoothly with theta, at most about ``limit`` of them.

        Also returns the probability under sin(theta)/2 d theta of the angles where more kinks were left out. Raises
        an InputError for laws whose kinks are not known.
        """
        raise InputError(f"{self!r} has no list of kinks; use sample() or apply()")

    @abstractmethod
    def _sample(self, theta: Floats, rng: np.random.Generator) -> Floats:
        """`sample` for checked arguments."""

    @abstractmethod
    def _apply(self, function: AngleFunction, theta: Floats) -> Floats:
        """`apply` for checked arguments."""

    # ---- the algebra -----------------------------------------------------------------------------------------
    def adjoint(self) -> Law:
        """The adjoint kernel in L^2(sin theta d theta); the law itself where it is reversible."""
        if self.reversible:
            return self
        raise InputError(
            f"{self!r} is not known to be reversible and has no closed adjoint; discretise it and use "
            "KernelMatrix.adjoint()"
        )

    def in_specular_frame(self) -> Law:
        """P_F = P~ J: the law in Feres' convention, where specular reflection is the identity; twice gives it back."""
        from .specular_frame import SpecularFrame

        return SpecularFrame.of(self)

    def __matmul__(self, other: Law) -> Law:
        """First this law, then the other."""
        if not isinstance(other, Law):
            return NotImplemented
        from .composition import Composition

        return Composition.of(self, other)

    def __pow__(self, exponent: int) -> Law:
        """The law applied ``exponent`` times, a whole number of at least 0."""
        whole_number("exponent", exponent, 0)
        from .composition import Power

        return Power(self, int(exponent))

    def __rmul__(self, weight: float) -> Combination:
        if isinstance(weight, bool) or not isinstance(weight, (int, float, np.integer, np.floating)):
            return NotImplemented
        from .weighted_sum import Combination

        return Combination(((float(weight), self),))

    __mul__ = __rmul__

    def __add__(self, other: Law) -> Combination:
        if not isinstance(other, Law):
            return NotImplemented
        from .weighted_sum import Combination

        return Combination.of(self) + Combination.of(other)


class BranchLaw(Law):
    """A law made of isometries theta' = sign theta + offset, whose probabilities are smooth between kinks.

    Subclasses give `branches` and `kinks`. Between two neighbouring kinks every slot of `branches` is one fixed
    isometry with a smooth probability, so that quadrature between the kinks is exact to rounding.
    """

    reversible = True
    exact_apply = True

    @abstractmethod
    def branches(self, theta: ArrayLike) -> tuple[Floats, Floats]: ...

    @abstractmethod
    def kinks(self, limit: int) -> tuple[Floats, float]:
        """Increasing angles in (0, pi) where the branches change, at most about ``limit`` of them, and the
        probability under sin(theta)/2 d theta of the angles, mostly near grazing, where more were left out."""

    def _sample(self, theta: Floats, rng: np.random.Generator) -> Floats:
        probability, outgoing = self.branches(theta)
        cumulative = np.cumsum(probability, axis=-1)
        draw = rng.random(theta.shape)[..., None] * cumulative[..., -1:]
        choice = np.argmax(draw < cumulative, axis=-1)
        return np.asarray(np.take_along_axis(outgoing, choice[..., None], axis=-1)[..., 0])

    def _apply(self, function: AngleFunction, theta: Floats) -> Floats:
        probability, outgoing = self.branches(theta)
        total: Floats | None = None
        for slot in range(outgoing.shape[-1]):
            value = np.asarray(function(outgoing[..., slot]), dtype=np.float64)
            weight = probability[..., slot].reshape(theta.shape + (1,) * (value.ndim - theta.ndim))
            total = weight * value if total is None else total + weight * value
        assert total is not None  # a law has at least one branch
        return total


class DrivenLaw(Law):
    """A law theta' = respond(X, theta) with X uniform in (0, 1): the reflection of a ray that enters at random.

    Subclasses give `respond`. Unless they know better, expectations are midpoint sums over ``fan_out`` entry points:
    the error falls like 1/fan_out where respond jumps, and like its square elsewhere.
    """

    fan_out = 256

    @abstractmethod
    def respond(self, x: ArrayLike, theta: ArrayLike) -> Floats:
        """Outgoing angle for the entry point ``x`` in (0, 1), as a share of the period, and the angle ``theta``."""

    def _sample(self, theta: Floats, rng: np.random.Generator) -> Floats:
        return self.respond(np.maximum(rng.random(theta.shape), SMALLEST_DRAW), theta)

    def _apply(self, function: AngleFunction, theta: Floats) -> Floats:
        x = (np.arange(self.fan_out) + 0.5) / self.fan_out
        outgoing = self.respond(x.reshape((-1,) + (1,) * theta.ndim), theta)
        return np.asarray(np.mean(np.asarray(function(outgoing), dtype=np.float64), axis=0))


def set_facts(law: Law, **facts: object) -> None:
    """Set attributes of a law under construction; afterwards it is immutable."""
    for name, value in facts.items():
        object.__setattr__(law, name, value)


def entry_points(x: ArrayLike) -> Floats:
    """Return ``x`` as float64, every one in the open interval (0, 1), or raise an InputError."""
    array = finite_array("x", x)
    bad = ~((array > 0.0) & (array < 1.0))
    if bad.any():
        where = tuple(int(i) for i in np.argwhere(bad)[0])
        place = f" at index {where}" if where else ""
        raise InputError(
            f"x: expected entry points in the open interval (0, 1), as shares of the period, got {array[where]!r}"
            f"{place} ({int(bad.sum())} such)"
        )
    return array
