"""The disk D_0 inside the satellites, which never touches the wall."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import finite_array, finite_number, positive_number
from ...core.errors import InputError
from . import rolling


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
