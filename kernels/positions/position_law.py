"""Laws P~(x, theta, d theta') that depend on the position, as of a wall whose cell changes along a body."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import (
    Floats,
    Rng,
    angles,
    broadcast,
    finite_array,
    frozen,
    generator,
    sequence,
)
from ...core.errors import InputError
from ...core.estimates import Summary
from ..bases.given import Vectorised, seed_by_name
from ..laws.law import Combination, Law

PositionFunction = Callable[[Floats, Floats], Floats]


@dataclass(frozen=True, eq=False, repr=False)
class PositionLaw(Summary):
    r"""A law P(x, theta; dx' d theta') = delta_x(dx') P~(x, theta, d theta') whose P~ is constant on intervals of x.

    Laws of this form, each P~(x, .) symmetric for sin(theta) d theta, are exactly the limits of walls whose
    displacements x' - x tend to 0. A cell that changes with x in any measurable manner is a limit of such laws.

    Parameters
    ----------
    edges : array_like, shape (n + 1,)
        Increasing positions.
    laws : sequence of n Laws
        P~ on each interval, in the paper's convention.

    Raises
    ------
    InputError
        If the edges do not increase, the numbers do not match, or a law is in the specular frame.

    Source: Rudzis 2022, section 1.2.5 and Theorem 1.7.

    Examples
    --------
    A wall that is smooth on the left and a retroreflector on the right:

    >>> from asperity import kernels as ker
    >>> law = ker.PositionLaw([0.0, 1.0, 3.0], [ker.specular(), ker.retroreflection()])
    >>> law.sample([0.5, 2.0], 0.25).round(12).tolist()
    [2.89159265359, 0.25]
    >>> law.mean().terms[0]
    (0.3333333333333333, specular())
    """

    edges: Floats
    laws: tuple[Law, ...]

    def __post_init__(self) -> None:
        edges = np.atleast_1d(finite_array("edges", self.edges))
        laws = sequence("laws", self.laws, Law, "ker.lambertian()")
        if edges.ndim != 1 or len(edges) < 2 or not np.all(np.diff(edges) > 0.0):
            raise InputError(f"edges: expected at least two increasing positions, got {edges.tolist()}")
        if len(laws) != len(edges) - 1:
            raise InputError(f"laws: expected one for each of {len(edges) - 1} intervals, got {len(laws)}")
        for law in laws:
            if law.frame != "paper":
                raise InputError(f"laws: expected laws in the paper's convention, got {law!r}")
        object.__setattr__(self, "edges", frozen(edges))
        object.__setattr__(self, "laws", laws)

    @property
    def weights(self) -> Floats:
        """The length of every interval divided by that of the piece."""
        return np.asarray(np.diff(self.edges) / (self.edges[-1] - self.edges[0]))

    @property
    def reversible(self) -> bool | None:
        """Whether P is symmetric with respect to dx sin(theta) d theta: every law is; None if unknown."""
        return True if all(law.reversible for law in self.laws) else None

    def at(self, x: float) -> Law:
        """P~(x, .)."""
        return self.laws[int(self.interval(finite_array("x", x)))]

    def mean(self) -> Combination:
        """The law for x uniform on the piece: the mixture of all laws by their lengths."""
        return Combination(tuple(zip(self.weights.tolist(), self.laws, strict=True)))

    @seed_by_name
    def sample(self, x: ArrayLike, theta: ArrayLike, rng: Rng = None) -> Floats:
        """Draw an outgoing angle for every state (x, theta); the arrays broadcast. The position stays x."""
        at, incoming = broadcast(x=finite_array("x", x), theta=angles("theta", theta))
        source = generator(rng)
        where, outgoing = self.interval(at), np.empty(at.shape)
        for k, law in enumerate(self.laws):
            here = where == k
            if here.any():
                outgoing[here] = law.sample(incoming[here], source)
        return outgoing

    def apply(self, function: PositionFunction, x: ArrayLike, theta: ArrayLike, edges: ArrayLike = ()) -> Floats:
        """The expectation E[f(x', Theta') | x, theta] of a vectorised f(x, theta), with x' = x, as `Law.apply`."""
        at, incoming = broadcast(x=finite_array("x", x), theta=angles("theta", theta))
        flat, value = at.ravel(), np.empty(at.size)
        where, directions = self.interval(flat), incoming.ravel()
        for position in np.unique(flat):
            here = flat == position
            law = self.laws[int(where[here][0])]
            value[here] = law.apply(Vectorised(partial(function, position), scalar=True), directions[here], edges)
        return value.reshape(at.shape)

    def interval(self, x: Floats) -> NDArray[np.intp]:
        """The index of the interval of every position; raises InputError outside of the piece."""
        x = finite_array("x", x)
        outside = (x < self.edges[0]) | (x > self.edges[-1])
        if np.any(outside):
            worst = float(np.atleast_1d(x)[np.atleast_1d(outside)][0])
            raise InputError(f"x: expected positions from {self.edges[0]:g} to {self.edges[-1]:g}, got {worst:g}")
        return np.asarray(np.clip(np.searchsorted(self.edges, x, side="right") - 1, 0, len(self.laws) - 1))
