"""A disk with round satellites of any sizes and places on its rim, or with teeth: the body of a true collision."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, Value, finite_array, finite_number, frozen, instance, positive_number, whole_number
from ...core.errors import InputError
from .disk import Disk

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
        Mass and inertia.
    count : int
        Number of satellites, at least 3.
    size : float or array_like, shape (count,)
        The radii of the satellites; 0 for points. Arcs on the rim are satellites that overlap.
    radius : float or array_like, shape (count,)
        The distances of the satellites' centres from the centre of the disk.
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
    radius: ArrayLike = 1.0
    angles: ArrayLike | None = None
    joined: bool = False

    def __post_init__(self) -> None:
        instance("disk", self.disk, Disk, "geo.Disk(mass=1.0, inertia=0.5)")
        instance("joined", self.joined, bool, "True")
        n = whole_number("count", self.count, FEWEST)
        object.__setattr__(self, "count", n)
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
