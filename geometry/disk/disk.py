"""The disk: its masses, its kinetic-energy metric, its frame, and the angles of its velocities.

``xp`` is the arithmetic: ``numpy`` for arrays, ``sympy`` for expressions. The library computes with these formulas,
and the ledger proves them.
"""

from __future__ import annotations

import math
from dataclasses import InitVar, dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, angles, broadcast, finite_array, frozen, positive_number
from ...core.errors import InputError


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
    """A disk of radius 1, free to move and rotate, with velocities w = (v1, v2, omega).

    Parameters
    ----------
    mass : float
        m, greater than 0.
    inertia : float
        J, the moment of inertia about the centre, greater than 0. A uniform disk has J = m/2 and a ring J = m;
        J > m is accepted, although no real disk of radius 1 has such an inertia.
    radius : float
        1, the unit of lengths. A disk of radius R moves as Disk(m, J / R^2), with R omega in place of omega.

    Raises
    ------
    InputError
        If a parameter is not a finite number greater than 0, or the radius is not 1.

    Notes
    -----
    The inner product is that of kinetic energy, <w, w'> = m v1 v1' + m v2 v2' + J omega omega'. The sign of chi follows
    the index of notation of Rudzis 2022; sections 1.3.6 and 4.2 print the opposite sign.

    Examples
    --------
    >>> disk = Disk(mass=1.0, inertia=1 / 3)
    >>> disk.foreshortening
    0.5
    >>> disk.rolling_momentum((1.0, 0.0, 3.0))
    array(0.)
    """

    mass: float = 1.0
    inertia: float = 0.5
    radius: InitVar[float] = 1.0

    def __post_init__(self, radius: float) -> None:
        object.__setattr__(self, "mass", positive_number("mass", self.mass))
        object.__setattr__(self, "inertia", positive_number("inertia", self.inertia))
        if positive_number("radius", radius) != 1.0:
            raise InputError(
                f"radius: expected 1, the unit of lengths, got {radius!r}; a disk of radius R moves as "
                f"Disk(mass={self.mass!r}, inertia={self.inertia / float(radius) / float(radius)!r}), whose inertia is "
                "J / R**2, with R * omega in place of omega"
            )

    @property
    def foreshortening(self) -> float:
        """kappa = (1 + m/J)^(-1/2) < 1: the factor by which the disk's rotation compresses a wall along x."""
        return float(foreshortening(self.mass, self.inertia))

    @property
    def frame(self) -> Floats:
        """The frame: rows chi_perp, e2^ and chi, orthonormal for ``inner``; shape (3, 3), read-only.

        chi_perp = (1/m + 1/J)^(-1/2) (1/m, 0, 1/J), e2^ = m^(-1/2) (0, 1, 0), chi = (m + J)^(-1/2) (-1, 0, 1).
        """
        return frozen(frame_rows(self.mass, self.inertia))

    def inner(self, w: ArrayLike, w2: ArrayLike) -> Floats:
        """Return the kinetic-energy inner products of velocities of shape (..., 3), broadcast."""
        products = _velocities("w", w) * _velocities("w2", w2)
        return np.asarray(self.mass * (products[..., 0] + products[..., 1]) + self.inertia * products[..., 2])

    def rolling_momentum(self, w: ArrayLike) -> Floats:
        """Return -m v1 + J omega, invariant in every collision; shape (...) for velocities of shape (..., 3)."""
        velocity = _velocities("w", w)
        return np.asarray(-self.mass * velocity[..., 0] + self.inertia * velocity[..., 2])

    def to_angles(self, w: ArrayLike) -> tuple[Floats, Floats]:
        """Return the angles (theta, psi) of velocities, which do not depend on the speed.

        Parameters
        ----------
        w : array_like, shape (..., 3)
            Velocities (v1, v2, omega) with v2 > 0. For an incoming velocity pass minus the velocity.

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
        across = (velocity[..., 0] + velocity[..., 2]) / math.sqrt(1.0 / self.mass + 1.0 / self.inertia)
        upward = math.sqrt(self.mass) * velocity[..., 1]
        rolling = self.rolling_momentum(velocity) / math.sqrt(self.mass + self.inertia)
        # two arctangents are accurate at grazing angles and at the poles, where arccos loses half of the digits
        return np.arctan2(upward, across), np.arctan2(np.hypot(upward, across), rolling)

    def from_angles(self, theta: ArrayLike, psi: ArrayLike, speed: ArrayLike = 1.0) -> Floats:
        """Return velocities (v1, v2, omega) with the given angles.

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
        raise InputError(f"{name}: expected velocities (v1, v2, omega) of shape (..., 3), got shape {array.shape}")
    return array
