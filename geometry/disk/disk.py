"""The disk: its masses, its kinetic-energy metric, its frame, the angles of its velocities, and bodies of its shape.

``xp`` is the arithmetic: ``numpy`` for arrays, ``sympy`` for expressions. The library computes with these formulas,
and the ledger proves them. A `SatelliteDisk` has round satellites of any sizes and positions on its rim, or teeth; it
is the body of a true collision. `InnerDisk` is D_0 inside the satellites, which never touches the wall.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import (
    Floats,
    Value,
    angles,
    broadcast,
    finite_array,
    finite_number,
    frozen,
    instance,
    positive_number,
    whole_number,
)
from ...core.errors import InputError
from . import rolling


def frame_rows(mass: Any, inertia: Any, xp: Any = np) -> list[list[Any]]:
    """Return the orthonormal frame chi_perp, e2^, chi in the coordinates (v1, v2, omega).

    Source: Rudzis 2022, section 1.3.6, with the sign of chi of the index of notation.
    """
    across = 1 / xp.sqrt(1 / mass + 1 / inertia)
    along = 1 / xp.sqrt(mass + inertia)
    return [[across / mass, 0, across / inertia], [0, 1 / xp.sqrt(mass), 0], [-along, 0, along]]


def direction(theta: Any, psi: Any, xp: Any = np) -> list[Any]:
    """Return the components of a unit velocity in the frame: (cos theta sin psi, sin theta sin psi, cos psi).

    Source: Rudzis 2022, eq. 1.27'.
    """
    return [xp.cos(theta) * xp.sin(psi), xp.sin(theta) * xp.sin(psi), xp.cos(psi)]


def foreshortening(mass: Any, inertia: Any, xp: Any = np) -> Any:
    """Return kappa = (1 + m/J)^(-1/2), the factor by which the disk's rotation compresses a wall along x (eq. 1.66)."""
    return 1 / xp.sqrt(1 + mass / inertia)


def branch_block(sign: Any, cosine: Any, sine: Any) -> list[list[Any]]:
    """Return the matrix of theta' = sign theta + offset, psi' = pi - psi, in the frame.

    Arguments are the sign, and cos and sin of the offset. The matrix maps the incoming to the outgoing velocity. The
    signs follow from the convention that theta and psi are the angles of *minus* the incoming velocity. The chi
    component is invariant.
    """
    return [[-cosine, sign * sine, 0], [-sine, -sign * cosine, 0], [0, 0, 1]]


def contact_normal(mass: Any, inertia: Any, wall_normal: Any, turn: Any, xp: Any = np) -> list[Any]:
    """Return the inward unit normal n(q), in (v1, v2, omega), for contact of the satellite at the angle ``turn``.

    The satellite is at (x1 + sin turn, x2 - cos turn) with turn = alpha + j rho, and ``wall_normal`` = (k1, k2) is the
    wall's unit normal, into the free side. In the kinetic-energy metric n(q) has length 1.

    Source: Rudzis 2022, remark 4.6 and eq. 3.26, corrected: the angle is alpha + j rho, and the square root is taken
    of 1/m + (k1 cos turn + k2 sin turn)^2 / J.
    """
    k1, k2 = wall_normal
    torque = k1 * xp.cos(turn) + k2 * xp.sin(turn)
    length = xp.sqrt(1 / mass + torque**2 / inertia)
    return [k1 / (mass * length), k2 / (mass * length), torque / (inertia * length)]


@dataclass(frozen=True)
class Disk:
    """A disk, free to move and rotate, with velocities w = (v1, v2, r omega).

    All three velocities have one unit: the third one is the velocity of the rim that is due to the spin. The angular
    velocity is omega = ``w[..., 2] / disk.radius``. Masses, lengths and times may have any consistent units, such as
    those of SI. The laws of collisions depend on the radius nowhere else.

    Parameters
    ----------
    mass : float
        m, greater than 0.
    inertia_ratio : float
        J/(m r^2), a number without unit, greater than 0: 1/2 for a uniform disk, 1 for a ring. More than 1 is accepted,
        although no real disk has it.
    radius : float
        r, greater than 0. It matters for distances and angles only.
    inertia : None
        Refused, with the ratio to write; `from_inertia` takes a moment of inertia with its radius.

    Attributes
    ----------
    inertia : float
        J = ``inertia_ratio`` m r^2, the moment of inertia about the centre.
    rim_mass : float
        J/r^2, which takes the place of J in formulas with r omega. The pages of theory and the paper have r = 1, and
        write J.

    Raises
    ------
    InputError
        If a parameter is not a finite number greater than 0, J or J/r^2 is not, or ``inertia`` is given.

    Notes
    -----
    The inner product is that of kinetic energy, <w, w'> = m v1 v1' + m v2 v2' + J omega omega'. The sign of chi follows
    the index of notation of Rudzis 2022; sections 1.3.6 and 4.2 print the opposite sign.

    Examples
    --------
    >>> disk = Disk(mass=1.0, inertia_ratio=1 / 3)
    >>> disk.foreshortening
    0.5
    >>> disk.rolling_momentum((1.0, 0.0, 3.0))
    array(0.)
    >>> Disk(mass=4.0, radius=0.5).inertia
    0.5
    """

    mass: float
    inertia_ratio: float
    radius: float

    def __init__(
        self, mass: float = 1.0, inertia_ratio: float = 0.5, radius: float = 1.0, *, inertia: float | None = None
    ) -> None:
        for name, value in (("mass", mass), ("inertia_ratio", inertia_ratio), ("radius", radius)):
            object.__setattr__(self, name, positive_number(name, value))
        if inertia is not None:
            known = Disk.from_inertia(self.mass, inertia, self.radius)
            raise InputError(
                f"inertia: expected inertia_ratio, which is J / (mass * radius**2), got inertia={inertia!r}; write "
                f"{known!r} if the radius is {known.radius!r}, or pass another radius to "
                f"geo.Disk.from_inertia({known.mass!r}, {inertia!r}, radius)"
            )
        positive_number("mass * inertia_ratio", self.rim_mass)
        positive_number("mass * inertia_ratio * radius**2", self.inertia)

    @classmethod
    def from_inertia(cls, mass: float, inertia: float, radius: float) -> Disk:
        """Return the disk with a moment of inertia about its centre, in the units of mass times radius squared.

        Raises
        ------
        InputError
            If a parameter, or the ratio, is not a finite number greater than 0.

        Examples
        --------
        >>> Disk.from_inertia(mass=4.0, inertia=0.5, radius=0.5)
        Disk(mass=4.0, inertia_ratio=0.5, radius=0.5)
        """
        parts = (("mass", mass), ("inertia", inertia), ("radius", radius))
        m, j, r = (positive_number(name, value) for name, value in parts)
        return cls(m, j / m / r / r, r)

    @property
    def rim_mass(self) -> float:
        return self.mass * self.inertia_ratio

    @property
    def inertia(self) -> float:
        return self.rim_mass * self.radius * self.radius

    @property
    def foreshortening(self) -> float:
        """kappa = (1 + m/J)^(-1/2) < 1, with r = 1: the factor by which the rotation compresses a wall along x."""
        return float(foreshortening(1.0, self.inertia_ratio))

    @property
    def frame(self) -> Floats:
        """The frame: rows chi_perp, e2^ and chi, orthonormal for ``inner``; shape (3, 3), read-only.

        chi_perp = (1/m + 1/J)^(-1/2) (1/m, 0, 1/J), e2^ = m^(-1/2) (0, 1, 0), chi = (m + J)^(-1/2) (-1, 0, 1),
        with r = 1.
        """
        return frozen(frame_rows(self.mass, self.rim_mass))

    def inner(self, w: ArrayLike, w2: ArrayLike) -> Floats:
        """Return the kinetic-energy inner products of velocities of shape (..., 3), broadcast."""
        products = _velocities("w", w) * _velocities("w2", w2)
        return np.asarray(self.mass * (products[..., 0] + products[..., 1]) + self.rim_mass * products[..., 2])

    def rolling_momentum(self, w: ArrayLike) -> Floats:
        """Return -m v1 + J omega/r, invariant in every collision; shape (...) for velocities of shape (..., 3)."""
        velocity = _velocities("w", w)
        return np.asarray(-self.mass * velocity[..., 0] + self.rim_mass * velocity[..., 2])

    def to_angles(self, w: ArrayLike) -> tuple[Floats, Floats]:
        """Return the angles (theta, psi) of velocities, which do not depend on the speed.

        Parameters
        ----------
        w : array_like, shape (..., 3)
            Velocities (v1, v2, r omega) with v2 > 0. For an incoming velocity pass minus the velocity.

        Returns
        -------
        theta, psi : ndarray, shape (...)
            In (0, pi), radians, with w = speed (cos theta sin psi chi_perp + sin theta sin psi e2^ + cos psi chi).

        Raises
        ------
        InputError
            If some v2 is not positive.

        Examples
        --------
        >>> theta, psi = Disk().to_angles((0.0, 2.0, 0.0))
        >>> bool(theta == np.pi / 2), bool(psi == np.pi / 2)
        (True, True)
        """
        velocity = _velocities("w", w)
        if not np.all(velocity[..., 1] > 0.0):
            where = tuple(int(i) for i in np.argwhere(~(velocity[..., 1] > 0.0))[0])
            index_text = f" at index {where}" if where else ""
            raise InputError(
                f"w: expected velocities with v2 > 0, got v2 = {float(velocity[where][1])!r}{index_text}; "
                "pass minus the velocity of an incoming disk"
            )
        across = (velocity[..., 0] + velocity[..., 2]) / math.sqrt(1.0 / self.mass + 1.0 / self.rim_mass)
        upward = math.sqrt(self.mass) * velocity[..., 1]
        rolling = self.rolling_momentum(velocity) / math.sqrt(self.mass + self.rim_mass)
        # two arctangents are accurate at grazing angles and at the poles, where arccos loses half of the digits
        return np.arctan2(upward, across), np.arctan2(np.hypot(upward, across), rolling)

    def from_angles(self, theta: ArrayLike, psi: ArrayLike, speed: ArrayLike = 1.0) -> Floats:
        """Return velocities (v1, v2, r omega) with the given angles.

        Parameters
        ----------
        theta, psi : array_like
            Angles in (0, pi), radians.
        speed : array_like
            The norm <w, w>^(1/2), greater than 0; the three arguments broadcast.

        Returns
        -------
        ndarray, shape (..., 3)

        Raises
        ------
        InputError
            If an angle is outside (0, pi), a speed is not positive, or the shapes do not broadcast.

        Examples
        --------
        >>> velocity = Disk(mass=4.0).from_angles(np.pi / 2, np.pi / 2)
        >>> float(velocity[1])
        0.5
        """
        norms = finite_array("speed", speed)
        if not np.all(norms > 0.0):
            raise InputError(f"speed: expected numbers greater than 0, got {float(np.min(norms))!r}")
        theta, psi, norms = broadcast(theta=angles("theta", theta), psi=angles("psi", psi), speed=norms)
        parts = norms[..., np.newaxis] * np.stack(direction(theta, psi), axis=-1)
        # a sum instead of a matrix product preserves the relative accuracy of each component
        return np.asarray(np.sum(parts[..., :, np.newaxis] * self.frame, axis=-2))


def _velocities(name: str, w: ArrayLike) -> Floats:
    array = finite_array(name, w)
    if array.ndim == 0 or array.shape[-1] != 3:
        raise InputError(f"{name}: expected velocities (v1, v2, r omega) of shape (..., 3), got shape {array.shape}")
    return array


FEWEST = 3


class Features(NamedTuple):
    """Points and edges of a body next to another one, relative to the body's position.

    ``arms`` (k, 2) and ``sizes`` (k,) of round satellites; ``starts``, ``ends`` and outward unit ``normals`` (m, 2) of
    edges, which are ``width`` thick on either side.
    """

    arms: Floats
    sizes: Floats
    starts: Floats
    ends: Floats
    normals: Floats
    width: float


@dataclass(frozen=True)
class SatelliteDisk(Value):
    """A disk that touches other bodies with its satellites only, round bumps on its rim, or with teeth.

    Parameters
    ----------
    disk : Disk
        Masses, and the radius that its spin r omega refers to.
    count : int
        Number of satellites, at least 3.
    size : float or array_like, shape (count,)
        The radii of the satellites; 0 for points. Arcs on the rim are satellites that overlap.
    radius : float or array_like, shape (count,)
        The distances of the satellites' centres from the centre of the disk, by default its radius.
    angles : array_like, shape (count,), optional
        Satellite k is at the angle alpha + ``angles[k]``, increasing in [0, 2 pi); by default 2 pi k/count.
    joined : bool
        Whether neighbours are joined by straight edges, as thick as the satellites. Points at two radii in turn are
        then the tips and notches of teeth. All sizes must be equal.

    Raises
    ------
    InputError
        If a number is not in its range, the angles do not increase or leave half a turn free, or joined satellites have
        different sizes.

    Source: Rudzis 2022, section 1.3.1, where the satellites are points and equally spaced, and remark 1.13.

    Examples
    --------
    >>> from asperity import geometry as geo
    >>> round(geo.SatelliteDisk(geo.Disk(), 100, 0.05).spacing, 6)
    0.062832
    >>> gear = geo.SatelliteDisk(geo.Disk(), 8, 0.0, [1.0, 0.75] * 4, joined=True)
    >>> gear.radii.tolist(), gear.largest
    ([1.0, 0.75, 1.0, 0.75, 1.0, 0.75, 1.0, 0.75], 1.0)
    """

    disk: Disk
    count: int
    size: ArrayLike
    radius: ArrayLike | None = None
    angles: ArrayLike | None = None
    joined: bool = False

    def __post_init__(self) -> None:
        instance("disk", self.disk, Disk, "geo.Disk(mass=1.0, inertia_ratio=0.5)")
        instance("joined", self.joined, bool, "True")
        n = whole_number("count", self.count, FEWEST)
        object.__setattr__(self, "count", n)
        if self.radius is None:
            object.__setattr__(self, "radius", self.disk.radius)
        for name, least in (("size", 0.0), ("radius", np.finfo(float).tiny)):
            value: ArrayLike = getattr(self, name)
            if not np.iterable(value):
                if finite_number(name, value) != 0.0 or least > 0.0:
                    object.__setattr__(self, name, positive_number(name, value))
                continue
            array = finite_array(name, value)
            if array.shape != (n,) or np.any(array < least):
                raise InputError(f"{name}: expected {n} numbers of at least 0, got {array.tolist()}")
            object.__setattr__(self, name, tuple(array.tolist()))
        if self.angles is not None:
            angles = finite_array("angles", self.angles)
            if angles.shape != (n,) or angles[0] < 0.0 or np.any(np.diff(angles) <= 0.0) or angles[-1] >= 2.0 * math.pi:
                raise InputError(f"angles: expected {n} increasing angles in [0, 2 pi), got {angles.tolist()}")
            if np.diff(angles, append=angles[0] + 2.0 * math.pi).max() >= math.pi:
                raise InputError("angles: expected gaps of less than half a turn")
            object.__setattr__(self, "angles", tuple(angles.tolist()))
        if self.joined and np.ptp(self.sizes) > 0.0:
            raise InputError("size: expected equal sizes of joined satellites")

    @cached_property
    def sizes(self) -> Floats:
        """The radii of the satellites, shape (count,)."""
        return frozen(np.broadcast_to(np.asarray(self.size, dtype=np.float64), (self.count,)))

    @cached_property
    def radii(self) -> Floats:
        """The distances of the satellites' centres from the disk's, shape (count,)."""
        return frozen(np.broadcast_to(np.asarray(self.radius, dtype=np.float64), (self.count,)))

    @cached_property
    def turns(self) -> Floats:
        """The angles of the satellites for alpha = 0, radians, shape (count,)."""
        even = 2.0 * math.pi * np.arange(self.count) / self.count
        return frozen(even if self.angles is None else np.asarray(self.angles, dtype=np.float64))

    @property
    def spacing(self) -> float:
        """The mean distance of neighbouring satellites along the rim of mean radius."""
        return 2.0 * math.pi * float(self.radii.mean()) / self.count

    @cached_property
    def largest(self) -> float:
        """The largest distance of a point of the body from its centre."""
        return float((self.radii + self.sizes).max())

    def arms(self, alpha: float) -> Floats:
        """Return the positions (count, 2) of the satellites relative to the centre of the disk."""
        turn = finite_number("alpha", alpha) + self.turns
        found = np.empty((self.count, 2))
        found[:, 0], found[:, 1] = self.radii * np.cos(turn), self.radii * np.sin(turn)
        return found

    def features(self, alpha: float, near: NDArray[np.bool_]) -> Features:
        """Return the satellites of the mask ``near`` (count,), and the edges at them."""
        arms = self.arms(alpha)
        if not self.joined:
            none = np.empty((0, 2))
            return Features(arms[near], self.sizes[near], none, none, none, 0.0)
        edges = np.flatnonzero(near | np.roll(near, -1))
        starts, ends = arms[edges], arms[(edges + 1) % self.count]
        along = (ends - starts) / np.hypot(*(ends - starts).T)[:, np.newaxis]
        normals = np.stack([along[:, 1], -along[:, 0]], axis=1)
        return Features(arms[near], self.sizes[near], starts, ends, normals, float(self.sizes[0]))


@dataclass(frozen=True)
class InnerDisk:
    """D_0, the disk of radius 1 - 2 rho^2 about the centre of the rough disk; its satellites are the only other points.

    A rough disk is the union of D_0 and its satellites. `collide` lets only the satellites touch the wall. That is
    right if D_0 stays above the tops in every configuration, which is the case if ``clearance`` is positive.

    Parameters
    ----------
    spacing : float
        rho, the angle between satellites, in (0, 2^(-1/2)).
    depth : float
        The depth of the scaled wall in units of the disk's radius, eps times the depth of its cell; at least 0.

    Attributes
    ----------
    radius : float
        1 - 2 rho^2.
    clearance : float
        2 rho^2 - depth - (1 - cos(rho/2)), to rounding: the least height of D_0 above the tops of a wall that reaches
        its depth near every point, and a lower bound for other walls.
    is_clear : bool
        Whether the clearance is positive. It is for depth <= 15/8 rho^2.

    Raises
    ------
    InputError
        If a number is out of range.

    Source: Rudzis 2022, section 1.3.1, eq. 1.34.

    Examples
    --------
    >>> inner = InnerDisk(spacing=0.25, depth=0.0625)
    >>> inner.radius, inner.is_clear, InnerDisk(0.25, 0.125).is_clear
    (0.875, True, False)
    """

    spacing: float
    depth: float

    def __post_init__(self) -> None:
        rho, depth = positive_number("spacing", self.spacing), finite_number("depth", self.depth)
        if not 2.0 * rho * rho < 1.0:
            raise InputError(f"spacing: expected less than 2^(-1/2), so that D_0 has a radius, got {rho!r}")
        if depth < 0.0:
            raise InputError(f"depth: expected a number of at least 0, got {depth!r}")
        object.__setattr__(self, "spacing", rho)
        object.__setattr__(self, "depth", depth)

    @property
    def radius(self) -> float:
        return 1.0 - 2.0 * self.spacing * self.spacing

    @property
    def clearance(self) -> float:
        return math.fsum([2.0 * self.spacing * self.spacing, -self.depth, -float(rolling.rise(0.5 * self.spacing))])

    @property
    def is_clear(self) -> bool:
        return self.clearance > 0.0

    def contains(self, configuration: ArrayLike, point: ArrayLike) -> NDArray[np.bool_]:
        """Return whether points (..., 2) are in D_0, boundary included, of a disk at configurations (..., 3).

        Heights of points are relative to the tops, and the configuration (x1, x2, alpha) has its centre at the height
        1 + x2.

        Examples
        --------
        >>> inner = InnerDisk(spacing=0.25, depth=0.0625)
        >>> inner.contains([0.0, 0.0, 0.0], [[0.0, 0.125], [0.0, 0.0]]).tolist()
        [True, False]
        """
        centre, points = finite_array("configuration", configuration), finite_array("point", point)
        for name, array, size in (("configuration", centre, 3), ("point", points, 2)):
            if array.ndim == 0 or array.shape[-1] != size:
                raise InputError(f"{name}: expected an array of shape (..., {size}), got shape {array.shape}")
        x, y = points[..., 0] - centre[..., 0], points[..., 1] - centre[..., 1] - 1.0
        return np.asarray(np.hypot(x, y) <= self.radius)
