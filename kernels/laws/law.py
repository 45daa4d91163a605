"""Reflection laws P~(theta, d theta') on (0, pi) and their algebra: sums, products, powers and change of convention."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from itertools import islice
from typing import TYPE_CHECKING, TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import (
    Floats,
    Rng,
    Value,
    angles,
    common_shape,
    finite_array,
    finite_number,
    foreign,
    frozen,
    generator,
    instance,
    number_between,
    numbers,
    sequence,
    shaped,
    shortened,
    whole_number,
)
from ...core.errors import AccuracyError, AsperityError, InputError
from ...core.estimates import html_table
from ...core.given import Vectorised, seed_by_name
from ...core.long_runs import OutOfTime
from ...core.rounding import EPS
from ..bases.angles import cell_among, clipped_inside, mirrored_angle
from ..bases.basis import AngleFunction, Frame
from ..expectations.conditionals import Conditionals
from ..expectations.piecewise import INTERVALS_OF_MEANS, MOST_OF_MEANS, SEEN, Piecewise
from .isometry_table import IsometryTable
from .sums import (
    MOST_BRANCHES,
    WEIGHT_TOLERANCE,
    as_weight,
    chained,
    chained_breakpoints,
    drawn_terms,
    joined,
    merged,
    outcomes_of,
    total_weight,
    used_terms,
)
from .tables import Table, WithAtoms, tabulated

if TYPE_CHECKING:
    from ...geometry import Wall

# Smallest and largest float64 in (0, 1), up to subnormal numbers.
SMALLEST, LARGEST = np.finfo(np.float64).tiny, np.nextafter(1.0, 0.0)
# Limit on the outgoing angles of a composition at all incoming angles. A density takes some 200 ns for each, and eight
# times as long with the polynomial that it is multiplied by.
MOST_VALUES, WITH_POLYNOMIAL = 10**8, 8
# Entry points of a driven law, each an atom.
ENTRY_POINTS = 4096
# The tolerance of `apply`, the incoming angles with which it begins, and outgoing angles in memory at a time.
TOLERANCE, FIRST_ANGLES, NODES_AT_ONCE = 1e-8, 16, 2**20
# Degree of the functions that `conditionals` averages by default.
DEGREE = 8
# Wanted error of the distribution functions of a table.
TABLE_TOLERANCE = 1e-4
# Breakpoints of laws at which the means under the law before them are cut.
CUTS = 64
# Incoming angle, tolerance, and degrees with edges of the test whether conditional distributions depend on these.
PROBE, PROBE_TOLERANCE = np.array([1.0]), 1e-2
PROBE_FUNCTIONS = (0, np.empty(0)), (64, np.linspace(0.05, 3.09, 32))
# Limit on the exponents of powers, some seconds of work, and on the factors that are no isometries or whose breakpoints
# are asked for: the work grows like the square of their number, or faster.
LARGEST_POWER, LONGEST_CHAIN = 10**5, 100

T = TypeVar("T")
# A map from uniform numbers and incoming angles to the outgoing angles and, for traced rays, whether each ray escaped.
RandomMap: TypeAlias = Callable[[Floats, Floats], tuple[Floats, "NDArray[np.bool_] | None"]]


class Law(Value, ABC):
    """A Markov kernel P~(theta, d theta') on the half circle (0, pi).

    In the paper's convention theta' = theta is retroreflection and theta' = pi - theta is specular reflection.

    Attributes
    ----------
    reversible : bool or None
        Whether P~ is symmetric with respect to sin(theta) d theta; None if unknown.
    mirror_symmetric : bool or None
        Whether P~ commutes with J f(theta) = f(pi - theta); None if unknown.
    frame : {"paper", "specular"}
        ``"specular"`` after `in_specular_frame`, where specular reflection is the identity (Feres' convention).
    is_lambertian : bool
        Whether the outgoing angle has the density sin(theta')/2 for every incoming angle.
    retro : bool or None
        True for theta' = theta, False for theta' = pi - theta, None for other laws.
    outgoing_breakpoints : ndarray
        The known outgoing angles at which densities jump or have a kink for every incoming angle.
    is_compound : bool
        Whether the law is a sum, composition, power or change of frame of other laws.
    is_driven : bool
        Whether `random_map` is the reflection of a ray that enters at a random point, piecewise smooth in this point.

    Notes
    -----
    Laws compose as operators, ``first @ second``, and both must be in the same frame. The outgoing angle of one
    collision is the incoming angle of the next. In the paper's frame the velocity is thus reversed in between. In the
    specular frame the particle crosses a straight channel to the mirror image of the wall, so powers of
    ``law.in_specular_frame()`` describe repeated collisions in a channel.
    """

    reversible: bool | None = None
    mirror_symmetric: bool | None = None
    frame: Frame = "paper"
    is_lambertian: bool = False
    retro: bool | None = None
    outgoing_breakpoints: Floats = frozen(())
    is_compound: bool = False
    is_driven: bool = False
    # A law is an operator, not an array: with None, numpy leaves ``np.float64(0.3) * law`` to this class.
    __array_ufunc__ = None

    # ---- sampling and expectations ---------------------------------------------------------------------------
    @seed_by_name
    def sample(self, theta: ArrayLike, rng: Rng = None) -> Floats:
        """Draw one outgoing angle for every incoming angle ``theta``; the same shape, radians in (0, pi).

        A whole number as ``rng``, the seed, is given by name: ``law.sample(0.7, rng=1)`` draws one angle, and
        ``law.sample(np.full(1000, 0.7))`` draws 1000 of them.
        """
        source, incoming = generator(rng), angles("theta", theta)
        return outgoing_angles(answer_of(self, self._sample, incoming, source), incoming, self)

    def apply(self, function: AngleFunction, theta: ArrayLike, edges: ArrayLike = ()) -> Floats:
        """The expectation E[f(Theta') | theta] of a vectorised f, whose values have shape ``theta.shape + extra``.

        It is computed from `conditionals`. Intervals are halved until f agrees with polynomials to 1e-8 of its mean
        size; jumps and kinks are found so. Atoms average any f exactly. The law's own error is that of `conditionals`.
        In compositions, means under the later laws are replaced by polynomials in the same way, to 1e-4.

        Parameters
        ----------
        function : callable
        theta : array_like
            Incoming angles in (0, pi), radians.
        edges : array_like, optional
            Outgoing angles at which f is not smooth, such as those of a peak narrower than 0.005.

        Raises
        ------
        AccuracyError
            If halving does not resolve f; the message names the outgoing angle, ``defect`` is the error of the mean.
        """
        wanted = shaped("edges", edges, "n")
        given, incoming = Vectorised.of(function), angles("theta", theta)
        if not incoming.size:
            # Only the function determines the shape of its values.
            return np.empty(incoming.shape + given(np.empty(incoming.shape)).shape[incoming.ndim :])
        mean = self._mean(Piecewise.of(given, wanted), incoming.ravel())
        return mean.reshape(incoming.shape + mean.shape[1:])

    def _mean(self, given: Piecewise, theta: Floats) -> Floats:
        """The means of a function at incoming angles, shape ``theta.shape + extra``."""
        distinct, back = self._distinct(theta)
        start, step, found = 0, FIRST_ANGLES, []
        while start < distinct.size:
            angle = distinct[start : start + step]
            part = self.conditionals(angle, TOLERANCE, given.degree, given.edges)
            values = given.function(part.nodes)
            found.append(part.sums(values))
            if given.edges.size:
                self._refuse_unresolved(given, angle, part, values)
            start += step
            step = max(1, NODES_AT_ONCE * part.error.size // part.nodes.size)
        return np.concatenate(found)[back]

    def _refuse_unresolved(self, given: Piecewise, theta: Floats, part: Conditionals, values: Floats) -> None:
        """Raise an AccuracyError if the distance of a function from polynomials matters at other nodes than atoms."""
        cell = cell_among(np.concatenate(([0.0], given.edges, [np.pi])), part.nodes)
        distance = np.where(is_flat_top(self, theta, part), 0.0, given.distance[cell])
        size = np.abs(values).reshape(values.shape[0], -1).max(axis=1)
        error = part.sums(distance)
        bad = ~(error <= given.tolerance * np.maximum(given.size, part.sums(size)))
        if bad.any() and not is_atomic(self):
            node = int(np.argmax(np.where(bad[part.owner], part.weights * distance, -1.0)))
            row = part.owner[node]
            raise AccuracyError(
                f"function: not resolved near theta' = {part.nodes[node]:.6g}: two rules for its mean under {self!r} "
                f"at theta = {theta[row]:.6g} differ by {error[row]:.2g}; give the angles where it is not smooth as "
                "edges=, or bound it",
                float(error[row]),
            )

    def conditionals(
        self, theta: ArrayLike, tolerance: float = TOLERANCE, degree: int = DEGREE, edges: ArrayLike = ()
    ) -> Conditionals:
        """The conditional distributions P~(theta_k, .) as weighted outgoing angles, each with its error.

        Parameters
        ----------
        theta : array_like
            Incoming angles in (0, pi), radians, in any order.
        tolerance : float
            Wanted error of the mean of a function of sup norm 1. Rough walls may not reach it.
        degree : int
            Highest degree of the functions to be averaged, as trigonometric polynomials, or as polynomials between
            the edges; 0 if they are constant there.
        edges : array_like
            Outgoing angles where these functions are not smooth, in increasing order.

        Returns
        -------
        Conditionals
            One conditional distribution per angle, in the order of ``theta``, with the error reached.

        Raises
        ------
        InputError
            If what the law finds are no distributions: a weight is negative or not finite, weights do not sum to 1
            within the error, or an angle is not in (0, pi).
        AccuracyError
            If more than a fraction of 1e-4 of the rays of a wall did not escape.

        Examples
        --------
        >>> from asperity.kernels import maxwell
        >>> conditionals = maxwell(0.25).conditionals([0.5, 1.5])
        >>> conditionals.mean(np.cos).round(12).tolist() == (-0.75 * np.cos([0.5, 1.5])).round(12).tolist()
        True
        """
        incoming, given = np.atleast_1d(angles("theta", theta)).ravel(), finite_array("edges", edges)
        if finite_number("tolerance", tolerance) < EPS:
            raise InputError(f"tolerance: expected a number of at least {EPS:.2g}, the rounding, got {tolerance!r}")
        whole_number("degree", degree, 0)
        if given.ndim != 1 or np.any(np.diff(given) < 0.0):
            raise InputError(f"edges: expected increasing angles, got {shortened(edges)}")
        found = answer_of(self, self._conditionals, incoming, tolerance, degree, given.copy())
        return checked_conditionals(found, incoming, self)

    def table(self, n_in: int, n_out: int, tolerance: float = TABLE_TOLERANCE) -> Table:
        """The inverse distribution functions of the outgoing angle on a grid, for other codes to draw from.

        Parameters
        ----------
        n_in, n_out : int
            Numbers of incoming angles, the middles of equal intervals, and of probabilities, 0 and 1 among them; at
            least 2.
        tolerance : float
            Wanted error of the distribution functions. Rough walls may not reach it; the table says so.

        Returns
        -------
        Table
            Angles, probabilities, quantiles and the error of bilinear interpolation between them; ``save`` writes a
            .csv, .npz or .h5 file, ``sample`` draws from the table.

        Examples
        --------
        >>> from asperity.kernels import lambertian
        >>> table = lambertian().table(2, 5)
        >>> table.quantile[0].round(4).tolist()
        [0.0, 1.0472, 1.5708, 2.0944, 3.1416]

        It has an error because the quantiles are not linear in the probability:

        >>> round(table.error, 3), round(lambertian().table(2, 65).error, 4)
        (0.087, 0.0016)
        """
        wanted = number_between("tolerance", tolerance, EPS, 1.0, closed="low high")
        parts = [(weight, _with_atoms(part, wanted)) for weight, part in self.parts]
        return tabulated(parts, self.sample, n_in, n_out, wanted, self.frame, repr(self))

    def branches(self, theta: ArrayLike) -> tuple[Floats, Floats]:
        """Probabilities and outgoing angles of a law made of isometries theta' = +-theta + const.

        Returns two arrays of shape ``theta.shape + (branches,)``. Branches with equal isometry are merged; unused
        slots have probability 0 and the angle of another branch. Raises InputError for other laws, and for compositions
        with more than 64 branches.
        """
        found = self._branches(angles("theta", theta))
        if found is None:
            raise InputError(
                f"{self!r} is not known to be a mixture of at most {MOST_BRANCHES} isometries, so it has no branches; "
                "use sample(), apply() or discretise()"
            )
        return found

    @abstractmethod
    def _sample(self, theta: Floats, rng: np.random.Generator) -> Floats:
        """`sample` for checked arguments, of which it gets a copy; called by `sample` only, which checks the angles."""

    def _sample_with_status(self, theta: Floats, rng: np.random.Generator) -> tuple[Floats, NDArray[np.bool_] | None]:
        """`sample`, and which rays escaped if rays are traced; the others count as retroreflected, however many."""
        return self.sample(theta, rng), None

    def _branches(self, theta: Floats) -> tuple[Floats, Floats] | None:
        """`branches` for checked angles; None if there are none, or too many."""
        return None

    @abstractmethod
    def _conditionals(self, theta: Floats, tolerance: float, degree: int, edges: Floats) -> Conditionals:
        """`conditionals` for checked arguments, of which it gets copies; called by `conditionals` only."""

    @cached_property
    def _probe(self) -> Conditionals:
        """The conditional distribution at one incoming angle, for functions that are constant."""
        return self.conditionals(PROBE, PROBE_TOLERANCE, 0)

    def _distinct(self, theta: Floats) -> tuple[Floats, NDArray[np.intp]]:
        """Angles among those given that have all their conditional distributions, and which of them each angle has."""
        if self.is_lambertian:
            return theta[:1], np.zeros(theta.size, dtype=np.intp)
        return theta, np.arange(theta.size)

    def _repr_html_(self) -> str:
        known = {True: "yes", False: "no", None: "not known"}
        whole = self if isinstance(self, Combination) else sum_of(self.parts)
        lines = {
            "convention": self.frame, "reversible": known[self.reversible],
            "mirror-symmetric": known[self.mirror_symmetric], "parts": None if whole is self else whole,
            "more": ".sample(theta), .apply(function, theta), .branches(theta), ker.discretise(law, basis)",
        }  # fmt: skip
        return html_table(f"Law {self!r}", lines)

    # ---- optional properties, each with a default -------------------------------------------------------------
    @property
    def parts(self) -> tuple[tuple[float, Law], ...]:
        """The law as a sum of simpler laws with positive weights; by default this law itself with weight 1.

        `sum_of` makes one law of them. Compositions, powers and laws in the other frame are no sums;
        `asperity.kernels.laws.structure.fold` divides the laws in them.
        """
        return ((1.0, self),)

    @property
    def has_density(self) -> bool:
        """Whether every conditional distribution has a density, bounded as a function of both angles."""
        return self.is_lambertian

    @property
    def eigenvalue_ratio(self) -> float | None:
        """The g of a law that multiplies the Legendre polynomial of degree l in cos(theta) by g^l; else None."""
        return 0.0 if self.is_lambertian else None

    @property
    def is_compact(self) -> bool:
        """Whether the law is known to be a compact operator."""
        return self.eigenvalue_ratio is not None

    @property
    def is_isometric(self) -> bool:
        """Whether by theorem the law is a mixture of isometries theta' = +-theta + const for almost every angle."""
        return self.retro is not None

    @property
    def keeps_sine(self) -> bool:
        """Whether it is known that theta' is theta or pi - theta."""
        return self.retro is not None

    @property
    def lambertian_fraction(self) -> float:
        """The known fraction a in P~ = a L + (1 - a) R, with L Lambertian and R a law."""
        return 1.0 if self.is_lambertian else 0.0

    @property
    def angle_map(self) -> Callable[[Floats], Floats] | None:
        """The map T of a deterministic law theta' = T(theta), an involution if the law is reversible; else None."""
        return None

    @property
    def traced_wall(self) -> Wall | None:
        """The wall of a law that is known by its rays only; None for walls with parts or isometries and other laws."""
        return None

    def breakpoints(self, limit: int) -> tuple[Floats, float]:
        """Increasing incoming angles in (0, pi) between which P~(theta, .) varies smoothly, about ``limit`` at most.

        Also returns the measure under sin(theta)/2 d theta of the angles whose breakpoints were left out, or inf if
        the law does not know all its breakpoints.
        """
        return np.empty(0), math.inf

    def random_map(self) -> RandomMap | None:
        """The law as a map of a uniform number in (0, 1) and the incoming angle; None if it needs more randomness."""
        return None

    def isometry_table(self) -> IsometryTable | None:
        """All isometries of the law with their probabilities; None if the law is no such mixture or cannot list it."""
        return None

    # ---- the algebra -----------------------------------------------------------------------------------------
    def adjoint(self) -> Law:
        """The adjoint kernel in L^2(sin theta d theta); the law itself if it is reversible."""
        if self.reversible:
            return self
        raise InputError(
            f"{self!r} is not known to be reversible and has no closed adjoint; discretise it and use "
            "KernelMatrix.adjoint()"
        )

    def in_specular_frame(self) -> Law:
        """P_F = P~ J, the law in Feres' convention, where specular reflection is the identity; an involution."""
        return SpecularFrame(self)

    def __matmul__(self, other: Law) -> Law:
        """This law followed by the other."""
        if not isinstance(other, Law):
            return foreign(other)
        return Composition.of(self, other)

    def __pow__(self, exponent: int) -> Law:
        """The law applied ``exponent`` times, a whole number of at least 0."""
        whole_number("exponent", exponent, 0)
        return Power(self, int(exponent))

    def __rmul__(self, weight: float) -> Combination:
        factor = as_weight(weight)
        if factor is None:
            return foreign(weight)  # type: ignore[no-any-return]
        return Combination(tuple((factor * own, law) for own, law in Combination.of(self).terms))

    __mul__ = __rmul__

    def __add__(self, other: Law) -> Combination:
        if not isinstance(other, Law):
            return foreign(other)
        return Combination(Combination.of(self).terms + Combination.of(other).terms)


class BranchLaw(Law):
    """A law made of isometries theta' = sign theta + offset, whose probabilities are smooth between breakpoints.

    Subclasses define `_branches` and `breakpoints`. Between two neighbouring breakpoints every slot of `branches` is
    one fixed isometry with a smooth probability, so that quadrature between breakpoints is exact to rounding.
    """

    reversible = True
    is_isometric = True

    @abstractmethod
    def _branches(self, theta: Floats) -> tuple[Floats, Floats]: ...

    @abstractmethod
    def breakpoints(self, limit: int) -> tuple[Floats, float]:
        """Increasing angles in (0, pi) where the branches change, at most about ``limit`` of them, and the measure
        under sin(theta)/2 d theta of the angles, mostly near grazing, whose breakpoints were left out."""

    def random_map(self) -> RandomMap:
        """The map that takes the branch in whose part of (0, 1) the number lies."""
        return lambda x, theta: (self._branch_taken(x, theta), None)

    def _sample(self, theta: Floats, rng: np.random.Generator) -> Floats:
        return self._branch_taken(rng.random(theta.shape), theta)

    def _branch_taken(self, x: Floats, theta: Floats) -> Floats:
        probability, outgoing = self._branches(theta)
        cumulative = np.cumsum(probability, axis=-1)
        choice = np.argmax(x[..., None] * cumulative[..., -1:] < cumulative, axis=-1)
        return np.asarray(np.take_along_axis(outgoing, choice[..., None], axis=-1)[..., 0])

    def _conditionals(self, theta: Floats, tolerance: float, degree: int, edges: Floats) -> Conditionals:
        probability, outgoing = self._branches(theta)
        return Conditionals.of_atoms(outgoing, probability, 0.0)


class DrivenLaw(Law):
    """A law theta' = reflect(X, theta) with X uniform in (0, 1): the reflection of a ray that enters at random.

    Subclasses define `reflect`. By default conditional distributions have one atom for each of 4096 equally spaced
    entry points, without a known error.
    """

    is_driven = True

    @abstractmethod
    def reflect(self, x: ArrayLike, theta: ArrayLike) -> Floats:
        """Outgoing angle for the entry point ``x``, a fraction of the period in (0, 1), and the angle ``theta``."""

    def reflect_with_status(self, x: ArrayLike, theta: ArrayLike) -> tuple[Floats, NDArray[np.bool_] | None]:
        """Outgoing angles, and which rays escaped if rays are traced."""
        return self.reflect(x, theta), None

    def random_map(self) -> RandomMap:
        """The map `reflect_with_status`."""
        return self.reflect_with_status

    def _sample(self, theta: Floats, rng: np.random.Generator) -> Floats:
        return self.reflect(entry_inside(rng.random(theta.shape)), theta)

    def _sample_with_status(self, theta: Floats, rng: np.random.Generator) -> tuple[Floats, NDArray[np.bool_] | None]:
        return self.reflect_with_status(entry_inside(rng.random(theta.shape)), theta)

    def _conditionals(self, theta: Floats, tolerance: float, degree: int, edges: Floats) -> Conditionals:
        outgoing = self.reflect((np.arange(ENTRY_POINTS) + 0.5) / ENTRY_POINTS, theta[:, None])
        return Conditionals.of_atoms(outgoing, np.full(outgoing.shape, 1.0 / ENTRY_POINTS), np.nan)


def in_frame(law: Law, frame: Frame) -> Law:
    """The law in a convention, whichever it is in."""
    return law if law.frame == frame else law.in_specular_frame()


def check_paper_frame(name: str, law: Law, example: str = "ker.lambertian()") -> None:
    """Refuse what is no law in the paper's convention."""
    instance(name, law, Law, example)
    if law.frame != "paper":
        raise InputError(f"{name}: expected one in the paper's convention, got {law!r}; call in_specular_frame() on it")


def answer_of(law: Law, method: Callable[..., T], theta: Floats, *wanted: object) -> T:
    """What a method of a law, perhaps of a user, returns for a copy of the angles; its own failures name the law."""
    try:
        return method(theta.copy(), *wanted)
    except (AsperityError, OutOfTime, MemoryError):
        raise
    except Exception as reason:
        raise InputError(
            f"{method.__name__} of {law!r} failed at theta = {shortened(theta)}: {type(reason).__name__}: {reason}"
        ) from reason


def outgoing_angles(found: ArrayLike, theta: Floats, law: Law) -> Floats:
    """The outgoing angles that a law has drawn: one for each incoming angle, in (0, pi) up to rounding."""
    plain = type(found) in (np.ndarray, np.float64) and np.asarray(found).dtype == np.float64
    outgoing = np.asarray(found) if plain else numbers(f"outgoing angles of {law!r}", found)
    if outgoing.shape != theta.shape:
        raise InputError(f"outgoing angles of {law!r}: expected shape {theta.shape}, got {outgoing.shape}")
    if outgoing.size and not (outgoing.min() > 0.0 and outgoing.max() < np.pi):
        count = np.arange(outgoing.size + 1)
        atoms = Conditionals(outgoing.ravel(), np.ones(outgoing.size), count, np.zeros(outgoing.size))
        outgoing = checked_conditionals(atoms, theta.ravel(), law).nodes.reshape(theta.shape)
    return outgoing


def checked_conditionals(found: Conditionals, theta: Floats, law: Law) -> Conditionals:
    """The conditional distributions that a law has found, if they are distributions on (0, pi)."""
    if not isinstance(found, Conditionals):
        raise InputError(f"_conditionals of {law!r}: expected ker.Conditionals, got {shortened(found)}")
    fault = found.fault(theta.size)
    if fault is not None:
        raise InputError(f"law {law!r}: expected {fault[1]} at theta = {theta[fault[0]]:g}")
    return found._replace(nodes=clipped_inside(found.nodes))


def entry_inside(x: Floats) -> Floats:
    """Clip uniform numbers to the open interval (0, 1)."""
    return np.asarray(np.clip(x, SMALLEST, LARGEST))


def entries(x: ArrayLike, theta: ArrayLike) -> tuple[Floats, Floats]:
    """Return entry points and incoming angles as float64, whose shapes broadcast."""
    at, incoming = entry_points(x), angles("theta", theta)
    common_shape(x=at, theta=incoming)
    return at, incoming


def entry_points(x: ArrayLike) -> Floats:
    """Return ``x`` as float64; raises InputError unless every value lies in the open interval (0, 1)."""
    array = finite_array("x", x)
    bad = ~((array > 0.0) & (array < 1.0))
    if bad.any():
        where = tuple(int(i) for i in np.argwhere(bad)[0])
        index = f" at index {where}" if where else ""
        raise InputError(
            f"x: expected entry points in the open interval (0, 1), as fractions of the period, got {array[where]!r}"
            f"{index} ({int(bad.sum())} such)"
        )
    return array


@dataclass(frozen=True, repr=False)
class Combination(Law):
    """A weighted sum of laws, ``0.3 * law + 0.7 * other``.

    It is a law if its weights are non-negative and sum to 1; otherwise `sample`, `apply`, `branches` and `adjoint`
    raise InputError.

    Parameters
    ----------
    terms : tuple of (float, Law)
        Weights and laws, all in the same frame; ``+`` flattens nested sums.

    Raises
    ------
    InputError
        If there are no terms, a weight is not finite, or the frames differ.

    Examples
    --------
    >>> from asperity.kernels import lambertian, specular
    >>> law = 0.25 * specular() + 0.75 * lambertian()
    >>> law
    0.25*specular() + 0.75*lambertian()
    >>> round(float(law.apply(np.cos, np.pi / 3)), 14)
    -0.125
    """

    terms: tuple[tuple[float, Law], ...]

    is_compound = True

    def __post_init__(self) -> None:
        pairs = isinstance(self.terms, tuple) and all(isinstance(term, tuple) and len(term) == 2 for term in self.terms)
        if not pairs or not self.terms:
            raise InputError(f"terms: expected at least one (weight, law), got {shortened(self.terms)}")
        for weight, law in self.terms:
            if not isinstance(law, Law):
                raise InputError(f"terms: expected laws, got {law!r}")
            if not math.isfinite(weight):
                raise InputError(f"terms: expected finite weights, got {weight!r} for {law!r}")
        frame, used = common_frame([law for _, law in self.terms], "add"), [law for weight, law in self.terms if weight]
        reversible, mirror = ([law.reversible for law in used], [law.mirror_symmetric for law in used])
        self._set(frame=frame, reversible=_sum_property(reversible), mirror_symmetric=_sum_property(mirror))

    @staticmethod
    def of(law: Law) -> Combination:
        """The law itself if it is a combination, else the combination 1 * law."""
        return law if isinstance(law, Combination) else Combination(((1.0, law),))

    @property
    def sums_to_one(self) -> bool:
        """Whether the weights sum to 1 within 1e-12."""
        return abs(total_weight(self.terms) - 1.0) <= WEIGHT_TOLERANCE

    @property
    def parts(self) -> tuple[tuple[float, Law], ...]:
        """The terms; raises InputError if a weight is negative or the weights do not sum to 1 within 1e-12."""
        return used_terms(self.terms, self)

    def in_specular_frame(self) -> Combination:
        """The sum of the transformed terms."""
        return Combination(tuple((weight, term.in_specular_frame()) for weight, term in self.terms))

    def adjoint(self) -> Law:
        """The combination of the adjoints, with the same weights."""
        parts = self.parts
        return self if self.reversible else Combination(tuple((weight, law.adjoint()) for weight, law in parts))

    def _branches(self, theta: Floats) -> tuple[Floats, Floats] | None:
        found = [(weight, law._branches(theta)) for weight, law in self.parts]
        parts = [(weight * each[0], each[1]) for weight, each in found if each is not None]
        if len(parts) < len(found):
            return None
        probability, outgoing = (np.concatenate(both, axis=-1) for both in zip(*parts, strict=True))
        return merged(probability, outgoing)

    def breakpoints(self, limit: int) -> tuple[Floats, float]:
        return joined([law.breakpoints(limit) for weight, law in self.parts])

    def isometry_table(self) -> IsometryTable | None:
        """The sum of the terms' tables; None if a term has none."""
        terms = [(weight, law.isometry_table()) for weight, law in self.parts]
        tables = [table.scaled(weight) for weight, table in terms if table is not None]
        return IsometryTable.joined(tables) if len(tables) == len(terms) else None

    def _sample(self, theta: Floats, rng: np.random.Generator) -> Floats:
        terms = self.parts
        return outcomes_of([law for _, law in terms], drawn_terms(terms, theta.shape, rng), theta, rng)

    def _conditionals(self, theta: Floats, tolerance: float, degree: int, edges: Floats) -> Conditionals:
        wanted = theta, tolerance, degree, edges
        return Conditionals.mixed([(weight, law.conditionals(*wanted)) for weight, law in self.parts])

    def _mean(self, given: Piecewise, theta: Floats) -> Floats:
        return np.asarray(sum(weight * law._mean(given, theta) for weight, law in self.parts))

    def __repr__(self) -> str:
        return " + ".join(f"{weight:.12g}*{as_factor(law)}" for weight, law in self.terms)


def sum_of(parts: tuple[tuple[float, Law], ...]) -> Law:
    """The weighted sum of the parts of a law, or the only part."""
    return parts[0][1] if len(parts) == 1 else Combination(parts)


def common_frame(laws: Sequence[Law], verb: str) -> Frame:
    """The common frame of the laws; raises InputError if their frames differ, with ``verb`` in its message."""
    for law in laws[1:]:
        if law.frame != laws[0].frame:
            raise InputError(
                f"cannot {verb} laws in different frames: {laws[0]!r} is in the {laws[0].frame} frame, {law!r} in the "
                f"{law.frame} frame; call in_specular_frame() on one of them"
            )
    return laws[0].frame


def _sum_property(promises: Sequence[bool | None]) -> bool | None:
    """Whether a sum has a property that each term has (True), lacks (False) or may have (None)."""
    if all(promises):
        return True
    # The sum certainly lacks the property only if one term lacks it and all others have it; two terms can cancel.
    certain = [known for known in promises if known is True]
    return False if len(certain) == len(promises) - 1 and False in promises else None


def as_factor(law: Law) -> str:
    """The text of a law as a factor of a product."""
    return f"({law!r})" if isinstance(law, (Combination, Composition)) else repr(law)


class _Chain(Law):
    """Laws applied one after the other."""

    is_compound = True

    @abstractmethod
    def factors(self) -> tuple[Law, ...]:
        """The laws in their order of application; raises InputError if they are too many."""

    def _branches(self, theta: Floats) -> tuple[Floats, Floats] | None:
        return chained([law._branches for law in self.factors()], theta)

    def breakpoints(self, limit: int) -> tuple[Floats, float]:
        return _breakpoints_of_chain(self.factors(), limit)

    def _sample(self, theta: Floats, rng: np.random.Generator) -> Floats:
        for law in self.factors():
            theta = law.sample(theta, rng)
        return theta

    @cached_property
    def _error_of_atoms(self) -> float:
        """The sum of the errors of the laws, if all are made of isometries."""
        return sum(float(law._probe.error[0]) for law in self.factors())

    @cached_property
    def _atomic_factors(self) -> int:
        """The number of laws with finitely many atoms before the first other one."""
        laws = self.factors()
        return next((k for k, law in enumerate(laws) if not is_atomic(law)), len(laws))

    def _refuse_long(self, factors: int, values: int = 0) -> None:
        if factors > LONGEST_CHAIN:
            raise InputError(f"apply: expected at most {LONGEST_CHAIN} factors; use discretise(law, basis) ** n")
        if values > MOST_VALUES:
            raise InputError(
                f"apply: {self!r} needs over {MOST_VALUES:.0e} outgoing angles; use discretise() and compose the "
                "matrices, or fewer angles at a time"
            )

    def _leaves(self) -> Iterator[Law]:
        """The laws in their order of application, without compositions and powers among them."""
        for law in self.factors():
            yield from law._leaves() if isinstance(law, _Chain) else (law,)

    def _mean(self, given: Piecewise, theta: Floats) -> Floats:
        """The means; those under the later laws are replaced by polynomials, unless all earlier laws are atoms."""
        laws = tuple(islice(self._leaves(), LONGEST_CHAIN + 1))
        first = next((k for k, law in enumerate(laws) if not is_atomic(law)), None)
        if first is None or self._branches(theta[:1]) is not None:
            return super()._mean(given, theta)
        for k in range(len(laws) - 1, first, -1):
            # an interval is halved about once; a Lambertian law has one distribution for all angles
            parts = [
                law.conditionals(theta[:1], edges=given.edges) for _, law in laws[k].parts if not law.is_lambertian
            ]
            each = 2 * WITH_POLYNOMIAL * SEEN.size * max(1, sum(part.nodes.size for part in parts))
            self._refuse_long(len(laws), each * INTERVALS_OF_MEANS * (len(laws) - first))
            most = min(MOST_VALUES // (each * (len(laws) - first)), MOST_OF_MEANS + given.edges.size)
            after = partial(_means_of, laws[k], given)
            given = Piecewise.mean_of(given, after, _breakpoints_of_start(laws[k:]), most)
        if first == 0:
            return laws[0]._mean(given, theta)
        return Composition(laws[:first]).conditionals(theta).mean(partial(_means_of, laws[first], given))

    def _conditionals(self, theta: Floats, tolerance: float, degree: int, edges: Floats) -> Conditionals:
        """The conditional distributions; means under a law are cut at the next law's breakpoints."""
        laws = self.factors()
        branches = self._branches(theta)
        if branches is not None:
            return Conditionals.of_atoms(branches[1], branches[0], self._error_of_atoms)
        self._refuse_long(len(laws))
        found = Conditionals.of_atoms(theta[:, None], np.ones((theta.size, 1)), 0.0)
        cuts = [*(_breakpoints_of_start(laws[k:]) for k in range(1, len(laws))), edges]
        pairs = zip(laws, cuts, strict=True)
        rules = [partial(law.conditionals, tolerance=tolerance, degree=degree, edges=cut) for law, cut in pairs]
        each = [rule(theta[:1]).nodes.size for rule in rules]
        for index, rule in enumerate(rules):
            self._refuse_long(0, math.prod(each[index:], start=found.nodes.size))
            found = found.followed_by(rule, index <= self._atomic_factors)
        return found


@dataclass(frozen=True, repr=False)
class Composition(_Chain):
    """Laws applied one after the other, ``first @ second``; as an operator, f -> P_first P_second f.

    Parameters
    ----------
    laws : tuple of Law
        The laws in their order of application, all in the same frame; nested compositions are flattened.

    Raises
    ------
    InputError
        If there are no laws or their frames differ: P~ @ Q_F would confuse theta with pi - theta between the factors.

    Examples
    --------
    >>> from asperity.kernels import retroreflection, specular
    >>> (specular() @ specular()).branches(1.0)[1].tolist()
    [1.0]
    """

    laws: tuple[Law, ...]

    def __post_init__(self) -> None:
        flat: list[Law] = []
        for law in sequence("laws", self.laws, Law, "ker.lambertian()"):
            flat.extend(law.laws if isinstance(law, Composition) else (law,))
        if not flat:
            raise InputError("laws: expected at least one, got none")
        self._set(laws=tuple(flat), frame=common_frame(flat, "compose"))
        palindrome = all(law is back or law == back for law, back in zip(flat, reversed(flat), strict=True))
        reversible = palindrome and all(law.reversible for law in flat)
        mirror_symmetric = all(law.mirror_symmetric for law in flat)
        self._set(reversible=reversible or None, mirror_symmetric=mirror_symmetric or None)

    @staticmethod
    def of(first: Law, second: Law) -> Law:
        """The first law followed by the second, bilinear: ``0.6 * law @ other`` is 0.6 times the composition.

        A combination whose weights sum to 1 remains one factor. Laws without effect are left out, see `simplified`.
        """
        for index, law in enumerate((first, second)):
            if isinstance(law, Combination) and not law.sums_to_one:
                pairs = [(term, second) if index == 0 else (first, term) for _, term in law.terms]
                weights = [weight for weight, _ in law.terms]
                return Combination(tuple((w, Composition.of(*pair)) for w, pair in zip(weights, pairs, strict=True)))
        chain = Composition((first, second))
        laws = simplified(chain.laws)
        if len(laws) < 2:
            return laws[0] if laws else first
        return chain if laws == chain.laws else Composition(laws)

    def adjoint(self) -> Law:
        """(P Q)* = Q* P*."""
        return self if self.reversible else Composition(tuple(law.adjoint() for law in reversed(self.laws)))

    def factors(self) -> tuple[Law, ...]:
        return self.laws

    def __repr__(self) -> str:
        return " @ ".join(as_factor(law) for law in self.laws)


def simplified(laws: tuple[Law, ...]) -> tuple[Law, ...]:
    """A chain without identities, and without the laws that have no effect beside a Lambertian law.

    The reversible laws after it preserve its measure; of others this is not known.
    """
    laws = tuple(law for law in laws if not is_identity(law))
    last = max((k for k, law in enumerate(laws) if law.is_lambertian), default=None)
    if last is None:
        return laws
    after = laws[last + 1 :]
    return (laws[last], *after[next((k for k, law in enumerate(after) if not law.reversible), len(after)) :])


def is_identity(law: Law) -> bool:
    """Whether a law keeps all angles: retroreflection, or specular reflection in the other frame."""
    return in_frame(law, "paper").retro is (law.frame == "paper")


@dataclass(frozen=True, repr=False)
class Power(_Chain):
    """A law applied n times, ``law ** n``; n = 0 is the identity f -> f.

    The number of outgoing angles of its conditional distributions grows like a power with exponent n, unless isometries
    merge. `apply` and `conditionals` raise InputError above 10^8 in all, or for n > 100 if the law has no `branches`,
    and every method does for n > 10^5; use ``discretise(law, basis) ** n`` then.

    Examples
    --------
    >>> from asperity.kernels import specular
    >>> (specular() ** 3).branches(1.0)[1].tolist() == [np.pi - 1.0]
    True
    """

    law: Law
    exponent: int

    def __post_init__(self) -> None:
        instance("law", self.law, Law, "ker.lambertian()")
        whole_number("exponent", self.exponent, 0)
        law, identity = self.law, self.exponent == 0
        mirror, reversible = law.mirror_symmetric or identity or None, law.reversible or identity or None
        self._set(frame=law.frame, mirror_symmetric=mirror, reversible=reversible)

    def adjoint(self) -> Law:
        """(P^n)* = (P*)^n."""
        return self if self.reversible else Power(self.law.adjoint(), self.exponent)

    def factors(self) -> tuple[Law, ...]:
        if self.exponent > LARGEST_POWER:
            raise InputError(
                f"law: expected a power of at most {LARGEST_POWER}, got {self.exponent}; "
                "use discretise(law, basis) ** n"
            )
        return (self.law,) * self.exponent

    def breakpoints(self, limit: int) -> tuple[Floats, float]:
        return (np.empty(0), math.inf) if self.exponent > LONGEST_CHAIN else super().breakpoints(limit)

    def __repr__(self) -> str:
        return f"{as_base(self.law)} ** {self.exponent}"


def as_base(law: Law) -> str:
    """The text of a law before an exponent or a method call."""
    return f"({law!r})" if isinstance(law, Power) else as_factor(law)


def is_atomic(law: Law) -> bool:
    """Whether the conditional distributions of a law are finitely many atoms, which average any function exactly."""
    return knows_errors(law) and has_fixed_nodes(law)


def has_fixed_nodes(law: Law) -> bool:
    """Whether conditional distributions have the same nodes for all functions: they are atoms, or those of samples."""
    whole, cut = (law.conditionals(PROBE, PROBE_TOLERANCE, degree, edges) for degree, edges in PROBE_FUNCTIONS)
    return np.array_equal(whole.nodes, cut.nodes)


def is_flat_top(law: Law, theta: Floats, given: Conditionals) -> NDArray[np.bool_]:
    """Which nodes of conditional distributions at ``theta`` are those of flat tops, the only atoms of traced walls."""
    specular = np.pi - theta
    found = specular if law.frame == "paper" else mirrored_angle(specular)
    return np.asarray((given.nodes == found[given.owner]) & (not law.is_lambertian))


def _with_atoms(law: Law, tolerance: float) -> WithAtoms:
    """The conditional distributions for functions constant between edges, and which of their nodes are atoms."""
    fixed = has_fixed_nodes(law)

    def given_and_atoms(theta: Floats, edges: Floats) -> tuple[Conditionals, NDArray[np.bool_]]:
        given = law.conditionals(theta, tolerance, 0, edges)
        return given, np.ones(given.nodes.shape, dtype=bool) if fixed else is_flat_top(law, theta, given)

    return given_and_atoms


def _breakpoints_of_chain(laws: Sequence[Law], limit: int) -> tuple[Floats, float]:
    return chained_breakpoints([law._branches for law in laws], [law.breakpoints(limit) for law in laws])


def _breakpoints_of_start(laws: Sequence[Law]) -> Floats:
    """Breakpoints of the first of the composed laws, of as many as know theirs together."""
    for number in range(len(laws), 0, -1):
        found, left_out = _breakpoints_of_chain(laws[:number], CUTS)
        if math.isfinite(left_out):
            return found
    return laws[0].breakpoints(CUTS)[0]


def knows_errors(law: Law) -> bool:
    """Whether the errors of conditional distributions are known, as one incoming angle shows."""
    return not np.isnan(law._probe.error).any()


def _means_of(law: Law, given: Piecewise, theta: Floats) -> Floats:
    mean = law._mean(given, theta.ravel())
    return mean.reshape(theta.shape + mean.shape[1:])


@dataclass(frozen=True, repr=False)
class SpecularFrame(Law):
    """P J, f -> P(J f) with J f(theta) = f(pi - theta): the law in the other frame.

    For a law P~ in the paper's frame this is P_F, the law in Feres' convention, where specular reflection is the
    identity. If P~ is self-adjoint, P_F is self-adjoint exactly if P~ commutes with J, as for mirror-symmetric walls.

    Source: Rudzis 2022, section 1.2.6, with the convention that its formula needs (P~u - u is small for flat walls).

    Examples
    --------
    >>> from asperity.kernels import specular
    >>> frame = specular().in_specular_frame()
    >>> frame, frame.frame, frame.branches(1.0)[1].tolist() == [1.0]
    (specular().in_specular_frame(), 'specular', True)
    """

    law: Law

    is_compound = True

    def __post_init__(self) -> None:
        instance("law", self.law, Law, "ker.lambertian()")
        mirror = self.law.mirror_symmetric
        self._set(frame="paper" if self.law.frame == "specular" else "specular", mirror_symmetric=mirror)
        self._set(reversible=mirror if self.law.reversible else None, is_lambertian=self.law.is_lambertian)
        self._set(outgoing_breakpoints=frozen(np.pi - self.law.outgoing_breakpoints[::-1]))

    def in_specular_frame(self) -> Law:
        """The inner law."""
        return self.law

    def adjoint(self) -> Law:
        """(P J)* = J P*, written as J (P* J) J, where J is a law in this frame."""
        if self.reversible:
            return self
        transformed = self.law.adjoint().in_specular_frame()
        return (
            transformed if self.mirror_symmetric else Composition((_flip(self.frame), transformed, _flip(self.frame)))
        )

    def _branches(self, theta: Floats) -> tuple[Floats, Floats] | None:
        found = self.law._branches(theta)
        return None if found is None else (found[0], mirrored_angle(found[1]))

    def breakpoints(self, limit: int) -> tuple[Floats, float]:
        return self.law.breakpoints(limit)

    def random_map(self) -> RandomMap | None:
        inner = self.law.random_map()
        if inner is None:
            return None

        def mirrored(x: Floats, theta: Floats) -> tuple[Floats, NDArray[np.bool_] | None]:
            outgoing, escaped = inner(x, theta)
            return mirrored_angle(outgoing), escaped

        return mirrored

    def isometry_table(self) -> IsometryTable | None:
        table = self.law.isometry_table()
        return None if table is None else table.in_specular_frame()

    def _sample(self, theta: Floats, rng: np.random.Generator) -> Floats:
        return mirrored_angle(self.law.sample(theta, rng))

    def _conditionals(self, theta: Floats, tolerance: float, degree: int, edges: Floats) -> Conditionals:
        return self.law.conditionals(theta, tolerance, degree, np.pi - edges[::-1]).mirrored()

    def __repr__(self) -> str:
        return f"{as_base(self.law)}.in_specular_frame()"


def _flip(frame: Frame) -> Law:
    """The operator J as a law of the given frame."""
    return specular() if frame == "paper" else SpecularFrame(retroreflection())


@dataclass(frozen=True, repr=False)
class IsometryLaw(BranchLaw):
    """The deterministic law theta' = theta (``retro``) or theta' = pi - theta."""

    retro: bool = field()

    mirror_symmetric = True

    def _branches(self, theta: Floats) -> tuple[Floats, Floats]:
        """One branch, of probability 1."""
        outgoing = theta.copy() if self.retro else mirrored_angle(theta)
        return np.ones((*theta.shape, 1)), outgoing[..., None]

    def breakpoints(self, limit: int) -> tuple[Floats, float]:
        """No breakpoints, and none left out."""
        return np.empty(0), 0.0

    def isometry_table(self) -> IsometryTable:
        """The table of this single isometry."""
        return IsometryTable.retroreflected(1.0) if self.retro else IsometryTable.flat(1.0)

    def __repr__(self) -> str:
        return "retroreflection()" if self.retro else "specular()"


def specular() -> IsometryLaw:
    """Specular reflection, theta' = pi - theta in the paper's convention: the law of a flat wall.

    Examples
    --------
    >>> float(specular().sample(np.pi / 4, np.random.default_rng(0))) == np.pi * 3 / 4
    True
    """
    return IsometryLaw(retro=False)


def retroreflection() -> IsometryLaw:
    """Retroreflection, theta' = theta in the paper's convention: the particle leaves in the direction it came from.

    Examples
    --------
    >>> float(retroreflection().sample(0.5, np.random.default_rng(0)))
    0.5
    """
    return IsometryLaw(retro=True)
