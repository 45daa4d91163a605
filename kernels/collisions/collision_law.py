"""The collision law of a disk and a rough wall, K = delta (x) P~ (x) delta_{pi - psi}, and the algebra of such laws."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial, reduce
from operator import add

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import (
    Floats,
    Rng,
    angles,
    broadcast,
    common_shape,
    finite_number,
    foreign,
    generator,
    instance,
    shaped,
    shortened,
    whole_number,
)
from ...core.errors import InputError
from ...core.estimates import Estimate, html_table
from ...core.given import Vectorised, seed_by_name
from ...geometry import Disk, Wall
from ...geometry.collisions.rigid import checked_states
from ..bases.angles import clipped_inside
from ..bases.assembly import reflection_matrix
from ..bases.basis import Basis
from ..bases.polynomials import Legendre
from ..discretisation.discretisation import discretise
from ..laws.law import Law, check_paper_frame, retroreflection, specular
from ..laws.structure import Discretiser, TensorLaw, Term, checked_pair
from ..laws.sums import WEIGHT_TOLERANCE, as_weight, outcomes_of
from ..matrices.defects import SymmetryDefect
from ..matrices.matrix import KernelMatrix
from ..walls.wall_law import WallLaw, isometries
from .operator import CollisionOperator, isometry_matrix

# Pairs of angles are evaluated as a grid if the grid of their distinct values has at most this many points per pair.
GRID_EXCESS = 4
DEFECT_SIZES = (32, 8)

VelocityFunction = Callable[[Floats, Floats], Floats]
StateFunction = Callable[[Floats, Floats, Floats], Floats]


class VelocityLaw(TensorLaw):
    """A law of velocities in the algebra of collision laws: a sum of P~ (x) J and Q~ (x) 1, with J the flip of psi.

    Every law acts on states (y, w) with y = (y1, y3), and leaves y unchanged. Laws of one disk combine as operators in
    the paper's convention: ``K1 @ K2`` is K2 applied to minus the outgoing velocity of K1, ``0.3 * K1 + 0.7 * K2`` a
    mixture, ``K ** n`` a power, ``K.adjoint()`` the adjoint with respect to dy Lambda^2. Products of two collision laws
    leave psi unchanged, because each of them flips it.

    Source: Rudzis 2022, section 1.3.6.
    """

    # A law is an operator, not an array: with None, numpy leaves ``np.float64(0.3) * K`` to this class.
    __array_ufunc__ = None

    disk: Disk

    @abstractmethod
    def parts(self) -> tuple[Term, ...]:
        """(weight, law of theta, whether psi is flipped): at most one term with the flip, and one without."""

    def parts_checked(self) -> tuple[Term, ...]:
        """`parts`; raises InputError if the weights do not sum to 1 within 1e-12."""
        total = math.fsum(weight for weight, _, _ in self.parts())
        if abs(total - 1.0) > WEIGHT_TOLERANCE:
            raise InputError(f"weights: expected a sum of 1, got {total!r} for {self!r}; scale the weights")
        return self.parts()

    # ---- states and velocities -------------------------------------------------------------------------------
    @seed_by_name
    def sample(self, velocity: ArrayLike, rng: Rng = None) -> Floats:
        """Draw an outgoing velocity for every incoming one.

        Parameters
        ----------
        velocity : array_like of shape (..., 3)
            Incoming (v1, v2, r omega) with v2 < 0.
        rng : None, int or numpy.random.Generator

        Returns
        -------
        array of shape (..., 3)
            Outgoing (v1, v2, r omega) with v2 > 0, of the same kinetic energy and rolling momentum. A term without
            flip, as in ``K @ K``, reverses the rolling momentum: it keeps that of minus the incoming velocity.

        Raises
        ------
        InputError
            If the shape is wrong or some v2 is not negative.
        """
        incoming = shaped("velocity", velocity, "...", 3)
        if not np.all(incoming[..., 1] < 0.0):
            worst = np.argwhere(~(incoming[..., 1] < 0.0))[0].tolist()
            raise InputError(f"velocity: expected incoming velocities with v2 < 0, got v2 >= 0 at row {worst}")
        rng = generator(rng)
        frame = np.asarray(self.disk.frame)
        along, up, roll = (self.disk.inner(incoming, np.broadcast_to(direction, incoming.shape)) for direction in frame)
        # angle and length of minus the incoming velocity in the plane of chi_perp and e2^; the flip leaves ``roll``.
        # Rounding may put the angle on an end of (0, pi).
        theta = clipped_inside(np.arctan2(np.abs(up), -along))
        outgoing, flipped = self._sample(theta, rng)
        size = np.hypot(along, up)
        parts = (size * np.cos(outgoing), size * np.sin(outgoing), np.where(flipped, roll, -roll))
        return np.asarray(sum(part[..., None] * direction for part, direction in zip(parts, frame, strict=True)))

    def _sample(self, theta: Floats, rng: np.random.Generator) -> tuple[Floats, Floats]:
        """Outgoing theta, and for each whether psi is flipped."""
        terms = self.parts_checked()
        if len(terms) == 1:
            return terms[0][1].sample(theta, rng), np.full(theta.shape, terms[0][2])
        first = rng.random(theta.shape) < terms[0][0]
        outgoing = outcomes_of([law for _, law, _ in terms], np.where(first, 0, 1), theta, rng)
        return outgoing, first == terms[0][2]

    @seed_by_name
    def sample_states(self, position: ArrayLike, velocity: ArrayLike, rng: Rng = None) -> tuple[Floats, Floats]:
        """Draw an outgoing state (y', w') for every incoming one; y' = y.

        Parameters
        ----------
        position : array_like, shape (n, 2)
            (x1, alpha) at x2 = 0, as in `geometry.collide`: coordinates of y.
        velocity : array_like, shape (n, 3)
            Incoming (v1, v2, r omega) with v2 < 0.
        rng : None, int or numpy.random.Generator

        Returns
        -------
        (position, velocity)
            Of shapes (n, 2) and (n, 3). The position is that before the collision.

        Raises
        ------
        InputError
            If a shape is wrong or some v2 is not negative.

        Examples
        --------
        >>> from asperity import geometry as geo, kernels as ker
        >>> K = ker.CollisionLaw(ker.specular(), geo.Disk(1.0, 1.0))
        >>> position, velocity = K.sample_states([[0.25, 3.0]], [[1.0, -1.0, 0.0]], rng=0)
        >>> position.tolist(), velocity.round(12).tolist()
        ([[0.25, 3.0]], [[1.0, 1.0, 0.0]])
        """

        at, moving = checked_states(position, velocity)
        return at.copy(), self.sample(moving, rng=rng)

    # ---- expectations ----------------------------------------------------------------------------------------
    def apply(self, function: VelocityFunction, theta: ArrayLike, psi: ArrayLike, edges: ArrayLike = ()) -> Floats:
        """The expectation E[f(Theta', Psi') | theta, psi] for a vectorised function f(theta, psi) that broadcasts.

        ``theta`` and ``psi`` in (0, pi) are the angles of minus the incoming velocity; they broadcast. Psi' is
        pi - psi, and psi in a term without flip. ``edges`` are outgoing theta at which f is not smooth; raises an
        AccuracyError if halving does not resolve f in theta.
        """
        first, second = broadcast(theta=angles("theta", theta), psi=angles("psi", psi))
        given = Vectorised(function, scalar=True)
        terms = [w * _expectation(law, flip, given, first, second, edges) for w, law, flip in self.parts_checked()]
        return np.asarray(sum(terms[1:], terms[0]))

    def apply_to_states(
        self,
        function: StateFunction,
        position: ArrayLike,
        theta: ArrayLike,
        psi: ArrayLike,
        edges: ArrayLike = (),
    ) -> Floats:
        """The expectation E[f(y', Theta', Psi') | y, theta, psi] for a function of states; y' = y.

        Parameters
        ----------
        function : callable
            f(y, theta, psi), vectorised: y has shape (..., 2), the angles broadcast with its leading axes.
        position : array_like, shape (..., 2)
            y, in any coordinates of the plane x2 = 0.
        theta, psi : array_like
            Angles of minus the incoming velocity in (0, pi), radians; they broadcast with ``position.shape[:-1]``.

        Raises
        ------
        InputError
            If a shape is wrong, a number is not finite or an angle is not in (0, pi).

        Examples
        --------
        >>> from asperity import geometry as geo, kernels as ker
        >>> K = ker.CollisionLaw(ker.lambertian(), geo.Disk())
        >>> value = K.apply_to_states(lambda y, theta, psi: y[..., 0] * np.cos(theta) ** 2, [6.0, 0.0], 1.0, 2.0)
        >>> round(float(value), 9)
        2.0
        """
        at = shaped("position", position, "...", 2)
        first, second = angles("theta", theta), angles("psi", psi)
        shape = common_shape(position=at[..., 0], theta=first, psi=second)
        points = np.broadcast_to(at, (*shape, 2)).reshape(-1, 2)
        first, second = np.broadcast_to(first, shape).ravel(), np.broadcast_to(second, shape).ravel()
        value = np.empty(first.size)
        points_used, index = np.unique(points, axis=0, return_inverse=True)
        for k, point in enumerate(points_used):
            here = index.ravel() == k
            value[here] = self.apply(partial(function, point), first[here], second[here], edges)
        return value.reshape(shape)

    def branches(self, theta: ArrayLike) -> list[tuple[Floats, Floats]]:
        """Probabilities and 3x3 velocity matrices of the branches of a law made of isometries.

        Parameters
        ----------
        theta : array_like
            Angle of minus the incoming velocity, in (0, pi), radians.

        Returns
        -------
        list of (probability, matrix)
            Probability of shape ``theta.shape``, matrix of shape ``theta.shape + (3, 3)``. Each matrix maps the
            incoming (v1, v2, r omega) to the outgoing one. Branches with probability 0 everywhere are omitted.

        Raises
        ------
        InputError
            If the law is not made of isometries.
        """
        found = []
        for weight, law, flip in self.parts_checked():
            probability, sign, offset = isometries(law, theta)
            matrices = isometry_matrix(self.disk, sign, offset, flip)
            found += [
                (weight * probability[..., slot], matrices[..., slot, :, :])
                for slot in range(probability.shape[-1])
                if np.any(weight * probability[..., slot] > 0.0)
            ]
        return found

    # ---- matrices --------------------------------------------------------------------------------------------
    def operator(self, theta_basis: Basis, psi_basis: Basis, **discretisation: object) -> CollisionOperator:
        """The matrix of the law on a product of two bases, as a linear operator that never forms the product.

        ``theta_basis`` is for the weight sin(theta), ``psi_basis`` for sin(psi)^2 (``weight="sin2"``). Further keywords
        are passed to `discretise`. A law with a closed form, such as that of `from_wall` for teeth and for the
        elliptical arcs of the disk, is discretised by it, without rays.
        """

        parts: dict[bool, KernelMatrix] = {}
        for weight, law, flip in self.parts_checked():
            matrix = discretise(law, theta_basis, **discretisation)  # type: ignore[arg-type]
            parts[flip] = matrix if weight == 1.0 else weight * matrix
        return CollisionOperator(parts.get(True), psi_basis, parts.get(False))

    def matrix_on(self, basis: Basis, discretise: Discretiser) -> KernelMatrix:
        """The matrix on a basis of products e_i(theta) f_j(psi): the sum of the tensor products of its terms."""

        theta_basis, psi_basis = checked_pair(basis).factors
        exact = Estimate(0.0, 0.0, "bound", "the flip of psi")
        terms = []
        for weight, law, flip in self.parts_checked():
            rolled = reflection_matrix(psi_basis) if flip else np.eye(psi_basis.size)
            name = "psi -> pi - psi" if flip else "psi -> psi"
            factor = KernelMatrix(rolled, psi_basis, exact, law=name, reversible=True, mirror_symmetric=True)
            term = discretise(law, theta_basis).tensor(factor)
            terms.append(term if weight == 1.0 else weight * term)
        return sum(terms[1:], terms[0])

    def symmetry_defect(
        self, theta_basis: Basis | None = None, psi_basis: Basis | None = None, **discretisation: object
    ) -> SymmetryDefect:
        """The asymmetry of the law with respect to Lambda^2, measured on two bases.

        The default bases are polynomials of degree below 32 in cos theta and below 8 in cos psi.
        """
        theta_basis = Legendre(DEFECT_SIZES[0]) if theta_basis is None else theta_basis
        psi_basis = Legendre(DEFECT_SIZES[1], weight="sin2") if psi_basis is None else psi_basis
        return self.operator(theta_basis, psi_basis, **discretisation).symmetry_defect()

    # ---- the algebra -----------------------------------------------------------------------------------------
    @property
    def reversible(self) -> bool | None:
        """Whether the law is symmetric with respect to Lambda^2; None if unknown."""
        return True if all(law.reversible for _, law, _ in self.parts()) else None

    def adjoint(self) -> VelocityLaw:
        """The adjoint in L^2(dy Lambda^2): that of every law of theta. InputError if one of them is not known."""
        if self.reversible:
            return self
        return _law_of([(weight, law.adjoint(), flip) for weight, law, flip in self.parts()], self.disk)

    def __matmul__(self, other: VelocityLaw) -> VelocityLaw:
        """This law, then the other on minus the outgoing velocity: the composition of operators."""
        if not isinstance(other, VelocityLaw):
            return foreign(other)
        self._check_disk(other, "compose")
        pairs = [
            (weight * other_weight, law @ other_law, flip != other_flip)
            for weight, law, flip in self.parts()
            for other_weight, other_law, other_flip in other.parts()
        ]
        return _law_of(pairs, self.disk)

    def __pow__(self, exponent: int) -> VelocityLaw:
        """The composition of ``exponent`` equal factors, a whole number of at least 0; 0 is the identity."""
        whole_number("exponent", exponent, 0)
        if exponent == 1:
            return self
        if len(self.parts()) == 1 or exponent == 0:
            ((weight, law, flip), *_) = self.parts()
            power = law**exponent if exponent else retroreflection()
            return _law_of([(weight**exponent, power, flip and exponent % 2 == 1)], self.disk)
        half = self ** (exponent // 2)
        return half @ half if exponent % 2 == 0 else half @ half @ self

    def __rmul__(self, weight: float) -> VelocityLaw:
        factor = as_weight(weight)
        if factor is None:
            return foreign(weight)  # type: ignore[no-any-return]
        return _law_of([(factor * own, law, flip) for own, law, flip in self.parts()], self.disk)

    __mul__ = __rmul__

    def __add__(self, other: VelocityLaw) -> VelocityLaw:
        if not isinstance(other, VelocityLaw):
            return foreign(other)
        self._check_disk(other, "add")
        return _law_of([*self.parts(), *other.parts()], self.disk)

    def _repr_html_(self) -> str:
        facts = {"convention": "paper", "foreshortening": f"{self.disk.foreshortening:.6g}"}
        more = ".sample(velocity), .apply(function, theta, psi), .branches(theta), .operator(theta_basis, psi_basis)"
        return html_table(repr(self), {**facts, "more": more})

    def _check_disk(self, other: VelocityLaw, verb: str) -> None:
        if self.disk != other.disk:
            raise InputError(f"cannot {verb} laws of different disks, {self.disk!r} and {other.disk!r}")


@dataclass(frozen=True)
class CollisionLaw(VelocityLaw):
    r"""The collision law K of a rough disk with a rough wall, in the limit of small roughness.

    K maps *minus* the incoming velocity, w = cos theta sin psi chi_perp + sin theta sin psi e2^ + cos psi chi, to the
    outgoing velocity. It maps theta by P~ and psi to pi - psi, and leaves the position unchanged. It conserves the
    kinetic energy and the rolling momentum -m v1 + J omega/r, and is symmetric with respect to
    Lambda^2 = sin(theta) sin(psi)^2 d theta d psi. Because of the minus sign, K composed with itself is not the law of
    the next collision.

    Parameters
    ----------
    law : Law
        P~, the law of the *foreshortened* wall; `from_wall` foreshortens.
    disk : Disk

    Source: Rudzis 2022, Theorem 1.2 and eq. 1.27', 1.28' (sign of chi corrected).

    Examples
    --------
    >>> import numpy as np
    >>> from asperity import geometry as geo, kernels as ker
    >>> K = ker.CollisionLaw(ker.retroreflection(), geo.Disk(mass=1.0, inertia_ratio=0.5))
    >>> K.sample([[1.0, -1.0, 0.0]], np.random.default_rng(0)).round(12).tolist()
    [[0.333333333333, 1.0, -1.333333333333]]

    The composition of the law of a no-slip wall with itself is the identity: it sends minus the velocity on.

    >>> (K @ K).sample([[1.0, -1.0, 2.0]]).round(12).tolist()
    [[-1.0, 1.0, -2.0]]
    """

    law: Law
    disk: Disk

    def __post_init__(self) -> None:
        check_paper_frame("law", self.law, "ker.WallLaw(wall.foreshorten(disk))")
        _ = self.law.parts  # raises InputError unless the weights of a combination make it a law
        instance("disk", self.disk, Disk, "geo.Disk(mass=1.0, inertia_ratio=0.5)")

    @classmethod
    def from_wall(cls, wall: Wall, disk: Disk) -> CollisionLaw:
        """The collision law of a disk with a wall: P~ is the law of ``wall.foreshorten(disk)``.

        Source: Rudzis 2022, section 1.3.7 and Theorem 5.1.
        """

        instance("wall", wall, Wall, "geo.triangular_teeth(0.7)")
        return cls(WallLaw(wall.foreshorten(disk)), disk)

    def parts(self) -> tuple[Term, ...]:
        """The only term, P~ with the flip of psi."""
        return ((1.0, self.law, True),)


@dataclass(frozen=True)
class CollisionCombination(VelocityLaw):
    """A law w P~ (x) J + w' Q~ (x) 1 in the algebra of collision laws; made by ``K1 @ K2``, ``0.3 * K1``, ``K ** n``.

    Sums and products of which only a term with flip and weight 1 remains are a `CollisionLaw` again.

    Parameters
    ----------
    terms : tuple of (float, Law, bool)
        Weight, law of theta in the paper's convention, and whether psi becomes pi - psi. At most one term with the
        flip, and one without. A weighted law such as ``0.3 * K1`` need not have the sum 1 until it is used.
    disk : Disk

    Raises
    ------
    InputError
        If a weight is negative or not finite, there are no terms or two of one kind, or a law is in the other frame.

    Examples
    --------
    >>> from asperity import geometry as geo, kernels as ker
    >>> disk = geo.Disk()
    >>> smooth, rough = ker.CollisionLaw(ker.specular(), disk), ker.CollisionLaw(ker.retroreflection(), disk)
    >>> 0.5 * smooth + 0.5 * rough
    CollisionLaw(law=0.5*specular() + 0.5*retroreflection(), disk=Disk(mass=1.0, inertia_ratio=0.5, radius=1.0))
    >>> smooth @ rough
    CollisionCombination(terms=((1.0, specular(), False),), disk=Disk(mass=1.0, inertia_ratio=0.5, radius=1.0))
    >>> float((smooth @ smooth).apply(lambda theta, psi: psi, 1.0, 0.25))
    0.25
    """

    terms: tuple[Term, ...]
    disk: Disk

    def __post_init__(self) -> None:
        instance("disk", self.disk, Disk, "geo.Disk(mass=1.0, inertia_ratio=0.5)")
        if not isinstance(self.terms, tuple) or not all(isinstance(t, tuple) and len(t) == 3 for t in self.terms):
            raise InputError(f"terms: expected tuples (weight, law, flip), got {shortened(self.terms)}")
        if not self.terms or len({bool(flip) for _, _, flip in self.terms}) < len(self.terms):
            raise InputError(f"terms: expected one with flip, one without, or both, got {len(self.terms)} terms")
        for weight, law, _ in self.terms:
            check_paper_frame("terms", law)
            if finite_number("weights", weight) < 0.0:
                raise InputError(f"weights: expected ones of at least 0, got {weight!r} for {law!r}")

    def parts(self) -> tuple[Term, ...]:
        """The terms."""
        return self.terms


def _law_of(terms: Sequence[Term], disk: Disk) -> VelocityLaw:
    """The sum of the terms, with those of one kind joined to one; a CollisionLaw if it is one."""
    joined: list[Term] = []
    for flip in (True, False):
        same = [(weight, law) for weight, law, own in terms if own is flip]
        used = [(weight, law) for weight, law in same if weight != 0.0]
        if len(used) == 1:
            joined.append((*used[0], flip))
        elif used:
            total = math.fsum(weight for weight, _ in used)
            joined.append((total, reduce(add, ((weight / total) * law for weight, law in used)), flip))
    joined = joined or [terms[0]]
    (weight, law, flip), *others = joined
    if flip and not others and abs(weight - 1.0) <= WEIGHT_TOLERANCE:
        return CollisionLaw(law, disk)
    return CollisionCombination(tuple(joined), disk)


def _expectation(
    law: Law, flip: bool, function: VelocityFunction, theta_all: Floats, psi_all: Floats, edges: ArrayLike
) -> Floats:
    """E[f(Theta', pi - psi)], or E[f(Theta', psi)] without flip, for arrays of equal shape."""
    theta_values, theta_index = np.unique(theta_all, return_inverse=True)
    psi_values, psi_index = np.unique(psi_all, return_inverse=True)
    rolled = np.pi - psi_values if flip else psi_values
    if theta_values.size * psi_values.size <= GRID_EXCESS * theta_all.size:
        # one call for the grid, with psi as an additional axis of the function's values
        grid = law.apply(lambda outgoing: function(outgoing[..., None], rolled), theta_values, edges)
        return np.asarray(grid[theta_index, psi_index].reshape(theta_all.shape))
    value = np.empty(theta_all.shape)
    for k, angle in enumerate(rolled):
        here = psi_index.reshape(psi_all.shape) == k
        value[here] = law.apply(partial(_with_psi, function, angle), theta_all[here], edges)
    return value


def _with_psi(function: VelocityFunction, psi: Floats, theta: Floats) -> Floats:
    return function(theta, np.asarray(psi))


def no_slip(disk: Disk) -> CollisionLaw:
    """The no-slip collision law, K of retroreflection: it reverses v2 and the slip v1 + r omega.

    Source: Rudzis 2022, eq. 2.25; its velocity matrix is `no_slip_matrix`.

    Examples
    --------
    >>> from asperity import geometry as geo, kernels as ker
    >>> (ker.no_slip(geo.Disk(1.0, 1.0)).sample([1.0, -1.0, 0.0]).round(12) + 0.0).tolist()
    [0.0, 1.0, -1.0]
    """
    return CollisionLaw(retroreflection(), disk)


def smooth(disk: Disk) -> CollisionLaw:
    """The smooth collision law, K of specular reflection: it reverses v2, and leaves v1 and omega unchanged.

    Source: Rudzis 2022, eq. 2.25; its velocity matrix is `smooth_matrix`.

    Examples
    --------
    >>> from asperity import geometry as geo, kernels as ker
    >>> (ker.smooth(geo.Disk(1.0, 1.0)).sample([1.0, -1.0, 3.0]).round(12) + 0.0).tolist()
    [1.0, 1.0, 3.0]
    """
    return CollisionLaw(specular(), disk)
