"""Laws of velocities on the half sphere: of walls with grooves, and sums and products of laws of one wall."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeAlias, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import (
    Floats,
    Rng,
    choice,
    finite_number,
    foreign,
    frozen,
    generator,
    instance,
    read_only,
    shaped,
    whole_number,
)
from ...core.errors import InputError
from ...core.estimates import ErrorKind, Estimate, Summary
from ...core.given import seed_by_name
from ...core.rounding import EPS
from ...core.tables import axes_or_new
from ..bases.angles import clipped_inside
from ..bases.basis import Basis
from ..bases.polynomials import Legendre
from ..bases.spaces import Zernike, zernike_functions
from ..discretisation.discretisation import discretise
from ..discretisation.method import SEED_WITHOUT_RNG
from ..discretisation.radiosity import UnscatteredRays
from ..laws.law import Law, in_frame
from ..laws.structure import Discretiser, SpatialLaw, holds_of_all
from ..laws.sums import as_weight, drawn_terms, used_terms
from ..matrices.matrix import KernelMatrix, frobenius_error
from ..matrices.output import COLOUR_POWER
from ..walls.faceted_law import FacetedLaw
from .direction_tables import DirectionTable, directions, incoming_velocities, polar, tabulated

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Ratio of the largest degree between the factors of a product to that of the matrix, and of the error that the limit on
# the degree leaves to the change from half of it.
BETWEEN_FACTORS, CHANGE = 2, 3.0
# Rays of a picture, and its cells of equal area by radius and by azimuth.
SHOWN_RAYS, RINGS, SECTORS = 200_000, 20, 60
TICKS = (-1.0, -0.5, 0.0, 0.5, 1.0)
# Weight, and the laws applied one after the other.
Term: TypeAlias = "tuple[float, tuple[DirectionFactor, ...]]"
Orientation: TypeAlias = float | Literal["random"]
FacetsInSpace: TypeAlias = Literal["finer grooves", "diffuse in space"]


@dataclass(frozen=True, repr=False)
class AzimuthalBlock(Summary):
    """The matrix of a rotation-invariant law on the Zernike functions of one azimuthal order.

    Attributes
    ----------
    symmetric : array of shape (k, k)
        <f_{n,m}, P f_{n',m}>, symmetric if the law is reversible; read-only. Of a surface it is complex, because one
        that differs from its mirror image turns velocities to one side, and then Hermitian if the law is reversible.
    degrees : array of int, shape (k,)
        n = m, m + 2, ..., at most the degree asked for.
    order : int
        m.
    error : Estimate
        The error in the operator norm, in value and half width: no eigenvalue of a symmetric matrix is wrong by more.
    """

    symmetric: NDArray[Any]
    degrees: NDArray[np.int64]
    order: int
    error: Estimate


class OnDisc(NamedTuple):
    """A matrix in Zernike functions, and its error as an operator and in the Frobenius norm."""

    symmetric: Floats
    error: float
    frobenius: float
    kind: ErrorKind


class DirectionLaw(SpatialLaw):
    """A law of directions in three dimensions: a sum of products of laws of grooves and of surfaces.

    Products are those of operators, ``first @ second``: after the first wall the particle crosses to the second with
    its tangential velocity unchanged, as in a channel. A sum such as ``0.3 * H1 + 0.7 * H2`` reflects each particle by
    one of the laws, and ``0.3 * H1`` need not have the sum 1 until it is used.
    """

    # A law is an operator, not an array: with None, numpy leaves ``np.float64(0.3) * H`` to this class.
    __array_ufunc__ = None

    @abstractmethod
    def products(self) -> tuple[Term, ...]:
        """(weight, laws applied one after the other), of which the law is the sum."""

    @property
    def parts(self) -> tuple[Term, ...]:
        """The products; raises InputError if a weight is negative or the weights do not sum to 1 within 1e-12."""
        return used_terms(self.products(), self)

    @property
    def rotation_invariant(self) -> bool:
        """Whether all grooves and surfaces have random directions."""
        return all(law.orientation == "random" for _, laws in self.products() for law in laws)

    @property
    def reversible(self) -> bool | None:
        """Whether the law is symmetric with respect to the cosine law; None if unknown.

        Grooves of random direction are reversible with every reversible planar law P~: the mean of P~ J and of its
        mirror image J P~ is symmetric.
        """
        palindromes = all(laws == laws[::-1] for _, laws in self.products())
        known = all(law.symmetric for _, laws in self.products() for law in laws)
        return True if palindromes and known else None

    @seed_by_name
    def sample(self, velocity: ArrayLike, rng: Rng = None) -> Floats:
        """Draw an outgoing velocity for every incoming one, of the same speed.

        Parameters
        ----------
        velocity : array_like of shape (..., 3)
            Incoming velocities in any unit. The wall is the plane of the first two components, and the third, along
            the outward normal, is negative.
        rng : None, int or numpy.random.Generator

        Returns
        -------
        array of shape (..., 3)
            Outgoing velocities, with a positive third component.

        Raises
        ------
        InputError
            If the shape is wrong, a number is not finite or a third component is not negative.

        Examples
        --------
        >>> from asperity import kernels as ker
        >>> along_x = ker.HemisphereLaw(ker.retroreflection(), orientation=0.0)
        >>> along_x.sample([[2.0, 3.0, -1.0]], rng=0).round(12).tolist()
        [[2.0, -3.0, 1.0]]
        """
        incoming = incoming_velocities(velocity)
        source, terms = generator(rng), self.parts
        outgoing = incoming.reshape(-1, 3).copy()
        chosen = drawn_terms(terms, outgoing.shape[:1], source)
        for index, (_, laws) in enumerate(terms):
            mine = np.flatnonzero(chosen == index)
            for number, law in enumerate(laws):
                # a wall on the other side of the channel
                arriving = outgoing[mine] * [1.0, 1.0, -1.0 if number else 1.0]
                outgoing[mine] = law.reflected(arriving, source)
        return outgoing.reshape(incoming.shape)

    def table(
        self, n_in: int, n_out: int, n_azimuth: int, *, n_turn: int = 32, tolerance: float = 1e-2, rng: Rng = None
    ) -> DirectionTable:
        """The inverse distribution functions of the outgoing velocity on a grid, for other codes to draw from.

        Parameters
        ----------
        n_in, n_out, n_azimuth : int
            Numbers of incoming angles with the normal, of probabilities of the outgoing one, and of probabilities of
            the azimuth between two of these; at least 2.
        n_turn : int
            Number of incoming azimuths, at least 2, of a law that is not rotation-invariant; any other has one.
        tolerance : float
            Error of the distribution functions of the outgoing angle with the normal, from 1e-3: the number of rays of
            each incoming velocity is log(40 n_in n_turn)/(2 tolerance^2) at least.
        rng : None, int or numpy.random.Generator
            ``np.random.default_rng(0)`` by default, so that a table repeats.

        Returns
        -------
        DirectionTable
            Quantiles and the error of interpolation between them; ``save`` writes a .csv, .npz or .h5 file,
            ``sample`` draws from the table.

        Raises
        ------
        InputError
            If a number is not a whole one of at least 2, or the tolerance is not in (1e-3, 1).

        Examples
        --------
        >>> from asperity import kernels as ker
        >>> table = ker.HemisphereLaw(ker.specular()).table(2, 3, 3, tolerance=0.1)
        >>> table.quantile[:, 0].round(12).tolist(), round(table.error, 12)
        ([[0.25, 0.25, 0.25], [0.75, 0.75, 0.75]], 0.0)
        >>> table.sample([[3.0, 4.0, -5.0]], rng=1).round(12).tolist()
        [[3.0, 4.0, 5.0]]
        """
        sizes = n_in, n_out, n_azimuth, n_turn
        return tabulated(self.sample, self.rotation_invariant, repr(self), sizes, tolerance, rng)

    def plot(self, velocity: ArrayLike, ax: Axes | None = None, *, rng: Rng = None) -> Axes:
        """Draw the density of outgoing velocities on the disc of the tangential ones, for one incoming velocity.

        Parameters
        ----------
        velocity : array_like, shape (3,)
            In any unit, with a negative third component.
        ax : matplotlib Axes, optional
            By default the axes of a new figure.
        rng : None, int or numpy.random.Generator
            ``np.random.default_rng(0)`` by default, so that a picture repeats.

        Returns
        -------
        matplotlib Axes
            The density, by 200,000 rays in cells of equal area, is 1 of the cosine law. A ring marks specular
            reflection; dotted circles have 30 and 60 degrees with the normal.

        Raises
        ------
        InputError
            If the shape is wrong, a number is not finite or the third component is not negative.

        Examples
        --------
        >>> from asperity import kernels as ker
        >>> ax = ker.HemisphereLaw(ker.lambertian()).plot([1.0, 0.0, -1.0])
        >>> float(ax.collections[0].get_array().mean().round(12))
        1.0
        """
        _, square, turn = polar(incoming_velocities(shaped("velocity", velocity, 3)))
        incoming = directions(square, turn) * [1.0, 1.0, -1.0]
        outgoing = self.sample(np.tile(incoming, (SHOWN_RAYS, 1)), generator(rng, SEED_WITHOUT_RNG))
        return draw_on_disc(outgoing, incoming, axes_or_new(ax))

    def matrix(self, degree: int, m: int, **discretisation: Any) -> AzimuthalBlock:
        r"""The block of azimuthal order m in the functions f_{n,m} = sqrt(n + 1) R_n^m(r) e^{i m phi}.

        Parameters
        ----------
        degree : int
            The largest degree n.
        m : int
            The order, from 0 to the degree. The block of -m is the same.
        **discretisation
            Keywords of `discretise` for the planar laws and the surfaces, such as ``tolerance``.

        Returns
        -------
        AzimuthalBlock
            A real matrix, or a complex one of surfaces. The largest eigenvalue off the constants is a lower bound of
            the law's, but for the error.

        Raises
        ------
        InputError
            If a groove or surface has a fixed direction, which couples different orders, or the order is above the
            degree.

        Notes
        -----
        The entries need the planar matrix in polynomials of the same degree only and exact Gauss rules, so their error
        is that of the planar matrix. The matrix of a product has polynomials of twice the degree between its factors;
        an estimate of what this leaves out is added.

        Examples
        --------
        >>> from asperity import kernels as ker
        >>> block = ker.HemisphereLaw(ker.lambertian()).matrix(5, 1)
        >>> block.degrees.tolist(), block.symmetric.diagonal().round(12).tolist()
        ([1, 3, 5], [0.5, 0.25, 0.166666666667])
        """
        degree = whole_number("degree", degree, 0)
        m = whole_number("m", m, 0, most=degree)
        if not self.rotation_invariant:
            raise InputError(
                f"{self!r}: a fixed direction couples different orders; use ker.discretise(H, ker.Zernike({degree}))"
            )
        found = self.entries(degree, m, partial(discretise, **discretisation))
        half = found.symmetric.shape[0] // 2 if m else 0
        # of e^(i m phi): between cosines, and from cosines to sines where there is a sense of rotation
        block, turning = found.symmetric[half:, half:], found.symmetric[half:, :half]
        whole = read_only(block + 1j * turning) if turning.any() else frozen(block)
        how = "error of the factors' matrices, and of a product what polynomials between its factors leave out"
        return AzimuthalBlock(whole, np.arange(m, degree + 1, 2), m, frobenius_error(found.error, found.kind, how))

    def matrix_on(self, basis: Basis, discretise: partial[KernelMatrix]) -> KernelMatrix:
        """The matrix in Zernike functions."""
        instance("basis", basis, Zernike, "ker.Zernike(8) for a law of directions")
        assert isinstance(basis, Zernike)
        found = self.entries(basis.degree, None, discretise)
        total = frobenius_error(found.frobenius, found.kind, "error of the factors' matrices on the disc")
        return KernelMatrix(
            found.symmetric, basis, total,
            method="quadrature", law=repr(self), reversible=self.reversible, frame="specular",
        )  # fmt: skip

    def entries(self, degree: int, order: int | None, discretise: Discretiser) -> OnDisc:
        """The matrix in functions of degrees up to ``degree``, of one order or all.

        Those of one order are sines, then cosines, by degree.
        """
        total, errors, kinds = np.zeros(()), np.zeros(2), set()
        for weight, laws in self.parts:
            most = _between(degree, laws)
            degrees, orders = _functions(most, order)
            each = [law.on_zernike(most, degrees, orders, discretise) for law in laws]
            factors = [one.symmetric for one in each]
            product = _product(factors, degrees <= degree, np.ones(degrees.size, dtype=bool))
            # laws are contractions, so that in either norm the errors of factors add up
            wrong = np.prod([(1.0 + one.error, 1.0 + one.frobenius) for one in each], axis=0) - 1.0 + degrees.size * EPS
            if len(laws) > 1:
                coarser = _product(factors, degrees <= degree, degrees <= max(degree, most // 2))
                wrong += CHANGE * float(np.linalg.norm(product - coarser))
            kinds |= {one.kind for one in each} | ({"estimate"} if len(laws) > 1 else set())
            total, errors = total + weight * product, errors + weight * wrong
        if self.reversible:
            total = 0.5 * (total + total.T)
        return OnDisc(total, float(errors[0]), float(errors[1]), "bound" if kinds == {"bound"} else "estimate")

    def __matmul__(self, other: DirectionLaw) -> DirectionLaw:
        """This law, then the other."""
        if not isinstance(other, DirectionLaw):
            return foreign(other)
        pairs = [(w * v, (*first, *second)) for w, first in self.products() for v, second in other.products()]
        return HemisphereCombination(tuple(pairs))

    def __rmul__(self, weight: float) -> DirectionLaw:
        factor = as_weight(weight)
        if factor is None:
            return foreign(weight)  # type: ignore[no-any-return]
        return HemisphereCombination(tuple((factor * own, laws) for own, laws in self.products()))

    __mul__ = __rmul__

    def __add__(self, other: DirectionLaw) -> DirectionLaw:
        if not isinstance(other, DirectionLaw):
            return foreign(other)
        return HemisphereCombination(self.products() + other.products())


class DirectionFactor(DirectionLaw):
    """The law of one wall, of which `DirectionLaw` makes sums and products.

    Attributes
    ----------
    orientation : float or "random"
    """

    orientation: Orientation

    @property
    @abstractmethod
    def symmetric(self) -> bool | None:
        """Whether the law itself is symmetric with respect to the cosine law; None if unknown."""

    @abstractmethod
    def on_zernike(
        self, degree: int, degrees: NDArray[np.int64], orders: NDArray[np.int64], discretise: Discretiser
    ) -> OnDisc:
        """The matrix in Zernike functions of these degrees, at most ``degree``, and orders."""

    @abstractmethod
    def reflected(self, incoming: Floats, rng: np.random.Generator) -> Floats:
        """`sample` for checked velocities of shape (n, 3)."""

    def products(self) -> tuple[Term, ...]:
        """The only term, the law itself."""
        return ((1.0, (self,)),)


def checked_orientation(orientation: Orientation) -> Orientation:
    """An angle in radians or "random"; raises InputError for others, as for degrees."""
    if isinstance(orientation, str):
        if orientation != "random":
            raise InputError(f"orientation: expected an angle in radians or 'random', got {orientation!r}")
        return orientation
    turn = finite_number("orientation", orientation)
    if abs(turn) > 2.0 * np.pi:
        raise InputError(f"orientation: expected an angle in radians, at most 2 pi, got {turn!r}")
    return turn


@dataclass(frozen=True, repr=False)
class HemisphereLaw(DirectionFactor):
    r"""The law of velocities in space of a wall with grooves, whose cross section has a planar law.

    A groove keeps the component b of the velocity along it. Across, it acts by the planar law on the direction in the
    cross section, whose tangential component is a / sqrt(1 - b^2) for a particle of speed 1 with the component a across
    the grooves. The law keeps the cosine law, which is the uniform measure on the disc of the tangential velocities
    (v_x, v_y), and a smooth wall is the identity of this disc. In polar coordinates about the grooves the cosine law is
    sin(theta) sin(psi)^2 d theta d psi: the law is that of `CollisionLaw`, without foreshortening.

    Parameters
    ----------
    law : Law
        The law of the cross section, in either convention.
    orientation : float or "random"
        Direction of the grooves in the plane of the wall, the angle with the x axis in radians; the cross section is
        seen against the direction of the grooves, so that grooves along y (pi/2) have the wall's x along x.
        ``"random"``: a direction that each particle finds at random, uniformly: an isotropic wall of patches of grooves
        that are wide against the roughness.
    facets : {"finer grooves", "diffuse in space"}, optional
        Needed where the law contains a `FacetedLaw`. ``"finer grooves"``: facets too keep the component b along the
        grooves. ``"diffuse in space"``: facets diffuse in part, such as ``maxwell(0.2)``, draw b anew by the cosine law
        at each diffuse hit; across the grooves nothing changes.

    Raises
    ------
    InputError
        If the law is none or its weights do not sum to 1, or the orientation is neither an angle up to 2 pi nor
        "random". If ``facets`` is missing, or diffuse in space though the law is not that of facets diffuse in part.

    Notes
    -----
    ``0.3 * H1 + 0.7 * H2`` is a mixture and ``H1 @ H2`` the product; see `DirectionLaw`.

    Source: R. Feres and G. Yablonsky, Chemical Engineering Science 59 (2004) 1541, for grooves of arcs.

    Examples
    --------
    >>> import numpy as np
    >>> from asperity import kernels as ker
    >>> H = 0.25 * HemisphereLaw(ker.specular()) + 0.75 * HemisphereLaw(ker.lambertian())
    >>> H.matrix(2, 0).symmetric.diagonal().round(12).tolist()
    [1.0, 0.5]
    """

    law: Law
    orientation: Orientation = "random"
    facets: FacetsInSpace | None = None

    def __post_init__(self) -> None:
        instance("law", self.law, Law, "ker.WallLaw(wall)")
        _ = self.law.parts  # raises InputError unless the weights of a combination make it a law
        self._set(orientation=checked_orientation(self.orientation))
        if self.facets is not None:
            choice("facets", self.facets, get_args(FacetsInSpace))
        elif not holds_of_all(self.law, lambda part: not isinstance(part, FacetedLaw)):
            raise InputError(
                f"facets: expected one of {get_args(FacetsInSpace)} for {self.law!r}, got None; pass "
                "facets='diffuse in space' if a diffuse facet draws the velocity along the grooves anew, or "
                "facets='finer grooves' if it keeps this velocity"
            )
        if self.facets == "diffuse in space" and self.redrawing is None:
            raise InputError(
                "facets: 'diffuse in space' expected a FacetedLaw whose facets are diffuse in part, such as "
                f"ker.maxwell(0.2), got {self.law!r}; pass facets='finer grooves', or add and multiply such laws by "
                "0.3 * H1 + 0.7 * H2 and H1 @ H2"
            )

    @cached_property
    def redrawing(self) -> FacetedLaw | None:
        """The law, in the paper's convention, whose diffuse facets draw the component along the grooves anew."""
        paper = in_frame(self.law, "paper")
        if self.facets != "diffuse in space" or not isinstance(paper, FacetedLaw) or paper.diffuse_fraction is None:
            return None
        return paper

    @property
    def specular(self) -> Law:
        """The planar law in the specular frame, the convention of the disc."""
        return in_frame(self.law, "specular")

    @property
    def symmetric(self) -> bool | None:
        return self.law.reversible if self.orientation == "random" else self.specular.reversible

    def on_zernike(
        self, degree: int, degrees: NDArray[np.int64], orders: NDArray[np.int64], discretise: Discretiser
    ) -> OnDisc:
        planar = discretise(self.specular, Legendre(degree + 1))
        matrix = matrix_of_average if isinstance(self.orientation, str) else matrix_of_grooves
        angle = () if isinstance(self.orientation, str) else (self.orientation,)
        error, kind = float(planar.error), planar.error.kind
        if self.redrawing is None:
            found = matrix(planar.symmetric, None, degrees, orders, *angle)
        else:
            rest = discretise(UnscatteredRays(self.redrawing, "specular"), Legendre(degree + 1))
            found = matrix(rest.symmetric, planar.symmetric - rest.symmetric, degrees, orders, *angle)
            # the planar error acts on means over b only, that of the unscattered rays on the rest
            error, kind = max(error, float(rest.error)), rest.error.kind
        return OnDisc(found, error, math.sqrt(degree + 1.0) * error, kind)

    def reflected(self, incoming: Floats, rng: np.random.Generator) -> Floats:
        """`sample` for checked velocities of shape (n, 3)."""
        # scaled, because products and sums of the largest doubles overflow
        size = np.abs(incoming).max(axis=1, initial=0.0)[:, None]
        x, y, down = (incoming / size).T
        angle: Any = self.orientation
        if isinstance(self.orientation, str):
            angle = rng.uniform(0.0, 2.0 * np.pi, x.size)
        cosine, sine = np.cos(angle), np.sin(angle)
        across, along = x * sine - y * cosine, x * cosine + y * sine
        theta, speed = clipped_inside(np.arctan2(-down, -across)), np.hypot(across, down)
        if self.redrawing is None:
            theta = in_frame(self.law, "paper").sample(theta, rng)
        else:
            theta, scattered = self.redrawing.scattered(theta, rng)
            # one component of a uniform point of the disc
            b = np.sqrt(rng.random(theta.size)) * np.cos(2.0 * np.pi * rng.random(theta.size))
            whole = np.hypot(speed, along)
            along, speed = np.where(scattered, [whole * b, whole * np.sqrt(1.0 - b * b)], [along, speed])
        tangential = in_the_plane(speed * np.cos(theta), along, angle)
        return np.asarray(size * np.column_stack([tangential, speed * np.sin(theta)]))

    def __repr__(self) -> str:
        angle = "" if isinstance(self.orientation, str) else f", orientation={self.orientation:.12g}"
        facets = "" if self.facets is None else f", facets={self.facets!r}"
        return f"HemisphereLaw({self.law!r}{angle}{facets})"


@dataclass(frozen=True, repr=False)
class HemisphereCombination(DirectionLaw):
    """A weighted sum of products of laws of walls; made by ``0.3 * H1 + 0.7 * H2`` and ``H1 @ H2``.

    Parameters
    ----------
    terms : tuple of (float, tuple of DirectionFactor)
        Weights, and laws applied one after the other.

    Raises
    ------
    InputError
        If a weight is not finite.

    Examples
    --------
    >>> from asperity import kernels as ker
    >>> rough = ker.HemisphereLaw(ker.lambertian())
    >>> 0.5 * rough @ rough + 0.5 * ker.HemisphereLaw(ker.specular())
    0.5*HemisphereLaw(lambertian()) @ HemisphereLaw(lambertian()) + 0.5*HemisphereLaw(specular())
    """

    terms: tuple[Term, ...]

    def __post_init__(self) -> None:
        for weight, _ in self.terms:
            finite_number("weight", weight)

    def products(self) -> tuple[Term, ...]:
        """The terms."""
        return self.terms

    def __repr__(self) -> str:
        factors = ("" if weight == 1.0 else f"{weight:.12g}*" for weight, _ in self.terms)
        products = (" @ ".join(map(repr, laws)) for _, laws in self.terms)
        return " + ".join(map("".join, zip(factors, products, strict=True)))


def _between(degree: int, laws: Sequence[DirectionLaw]) -> int:
    """The largest degree between the factors of a product."""
    return degree if len(laws) == 1 else BETWEEN_FACTORS * degree


def _functions(degree: int, order: int | None) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Degrees and orders of the Zernike functions, of one azimuthal order (sines, then cosines) or of all."""
    if order is None:
        every = Zernike(degree)
        return every.degrees, every.orders
    degrees = np.arange(order, degree + 1, 2)
    signs = (-1, 1) if order else (1,)
    return np.tile(degrees, len(signs)), np.repeat(order * np.array(signs), degrees.size)


def _product(factors: Sequence[Floats], ends: NDArray[np.bool_], between: NDArray[np.bool_]) -> Floats:
    """The product of matrices, restricted to ``between`` between its factors and to ``ends`` at both ends."""
    product = np.eye(ends.size)[ends]
    for number, factor in enumerate(factors):
        product = (product * between if number else product) @ factor
    return product[:, ends]


def draw_on_disc(outgoing: Floats, incoming: Floats, ax: Axes) -> Axes:
    """Draw the density of the tangential parts of velocities of speed 1, over that of the cosine law."""
    from matplotlib.colors import PowerNorm

    (x, y, _), bins, ends = outgoing.T, (RINGS, SECTORS), ((0.0, 1.0), (-np.pi, np.pi))
    counts, squares, angles = np.histogram2d(x * x + y * y, np.arctan2(y, x), bins, ends)
    density, radius = counts * (counts.size / len(outgoing)), np.sqrt(squares)[:, None]
    norm = PowerNorm(COLOUR_POWER, vmin=0.0, vmax=density.max())
    cells = ax.pcolormesh(radius * np.cos(angles), radius * np.sin(angles), density, norm=norm, rasterized=True)
    ax.plot(*incoming[:2], "o", mfc="none", mec="white", markersize=9, mew=2)
    for circle in (0.5, np.sqrt(0.75)):
        ax.plot(circle * np.cos(angles), circle * np.sin(angles), ":", color="white", linewidth=0.8)
    ax.set(aspect="equal", xlabel="$v_x$ / speed", ylabel="$v_y$ / speed", xticks=TICKS, yticks=TICKS)
    ax.figure.colorbar(cells, ax=ax, label="density over that of the cosine law")
    return ax


Indices = NDArray[np.int64]


def matrix_of_grooves(
    planar: Floats, redrawn: Floats | None, degrees: Indices, orders: Indices, angle: float
) -> Floats:
    """<f_i, P f_j> of grooves in a direction of the plane, in the Zernike functions with these degrees and orders.

    ``planar`` is the matrix in the specular frame in Legendre(n), with n above all degrees, of rays that keep b, and
    ``redrawn`` that of rays that draw b anew. The rules are exact: products of the integrals over x with l + l' even
    are polynomials in b, with l + l' odd sqrt(1 - b^2) times such. The integrals themselves are so for l even and odd.
    """
    count = len(planar)
    x, weight = np.polynomial.legendre.leggauss(count)
    moments = 0.5 * weight[:, None] * Legendre(count).evaluate(np.arccos(x))
    odd = np.add.outer(np.arange(count), np.arange(count)) % 2
    node = np.pi * np.arange(1, count + 1) / (count + 1)
    chebyshev = np.cos(node), 2.0 / (count + 1) * np.sin(node) ** 2
    legendre = x, 2.0 / np.pi * np.sqrt(1.0 - x * x) * weight
    total, means = np.zeros((degrees.size, degrees.size)), np.zeros((degrees.size, count))
    for parity, (b, mass) in enumerate((chebyshev, legendre)):
        part = np.where(odd == parity, planar, 0.0)
        if part.any() or redrawn is not None:
            across, along = -np.sqrt(1.0 - b * b)[:, None] * x, np.broadcast_to(b[:, None], (count, count))
            values = zernike_functions(in_the_plane(across, along, angle), degrees, orders)
            found = np.einsum("bxk,xl->bkl", values, moments, optimize=True)
            total += np.tensordot(mass[:, None, None] * found, found @ part.T, axes=([0, 2], [0, 2]))
            means[:, parity::2] = np.tensordot(mass, found[..., parity::2], axes=1)
    return total if redrawn is None else total + means @ redrawn @ means.T


def in_the_plane(across: Floats, along: Floats, angle: float | Floats) -> Floats:
    """The vectors (v_x, v_y), shape (..., 2), with these components across and along grooves in a direction.

    Across, along and the outward normal are right-handed: grooves along y have x across.
    """
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.stack([across * sine + along * cosine, along * sine - across * cosine], axis=-1)


def matrix_of_average(planar: Floats, redrawn: Floats | None, degrees: Indices, orders: Indices) -> Floats:
    """The mean of `matrix_of_grooves` over all directions; with the order m, -m has to be there too.

    Turning multiplies e^(i m phi) by a number of modulus 1 that averages to 0 between different orders. Between equal
    ones the mean is that of the blocks of cosines and of sines, because grooves along x do not distinguish phi and
    pi - phi.
    """
    fixed, total = matrix_of_grooves(planar, redrawn, degrees, orders, 0.0), np.zeros((degrees.size, degrees.size))
    for order in range(int(orders.max(initial=0)) + 1):
        cosines, sines = np.flatnonzero(orders == order), np.flatnonzero(orders == -order)
        block = 0.5 * (fixed[np.ix_(cosines, cosines)] + fixed[np.ix_(sines, sines)])
        total[np.ix_(cosines, cosines)] = total[np.ix_(sines, sines)] = block
    return total
