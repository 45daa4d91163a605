"""The satellites of the disk, evenly spaced points on its rim, and the charts of rolling about them.

The satellites are the only points that touch the wall. The charts are the maps of rolling about a satellite, and the
maps that straighten it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, finite_array, positive_number
from ...core.errors import InputError
from . import rolling
from .rolling import Matrix, Vector

# Power of the scale in the default spacing, in (0, 1/2): the theorem needs spacing -> 0 and scale/spacing^2 -> 0.
SPACING_POWER = 0.4
# Least number of satellites; with fewer, the lowest satellite may be at the side of the disk.
FEWEST = 4
# Relative difference allowed between a given spacing and 2 pi/n, which differ by a few rounding errors.
DIVISOR_TOLERANCE = 1e-12


@dataclass(frozen=True)
class Satellites:
    """Points at the angles k spacing, k = 0, ..., count - 1, on the rim of a disk of radius 1 above a wall.

    Parameters
    ----------
    count : int
        At least 4.
    depth : float
        The depth of the wall below its tops, in units of the disk's radius.

    Raises
    ------
    InputError
        If there are fewer than 4 satellites, or the depth is not less than both 1 - cos(spacing) (at most two
        satellites touch the wall) and cos(spacing/2) (no satellite at the side of the disk touches the wall).

    Source: Rudzis 2022, section 1.3.1, eq. 1.38, and Proposition 4.1 (vi).

    Examples
    --------
    >>> Satellites.around(scale=0.01, depth=0.01).count
    39
    """

    count: int
    depth: float

    def __post_init__(self) -> None:
        if self.count < FEWEST:
            raise InputError(f"spacing: expected at least {FEWEST} satellites on the circle, got {self.count}")
        if not self.depth < self.deepest:
            raise InputError(
                f"scale and spacing: expected scale * depth < {self.deepest:.6g} (1 - cos(spacing), and below "
                f"cos(spacing/2)) so that at most two satellites touch the wall, got {self.depth:.6g}; make the scale "
                "smaller or the spacing larger"
            )

    @classmethod
    def around(cls, scale: float, depth: float, spacing: Any = None) -> Satellites:
        """Return the satellites of the given spacing, by default the least allowed spacing of at least scale^0.4.

        Raises
        ------
        InputError
            If the spacing does not divide 2 pi, or is too small for the depth.
        """
        if spacing is not None:
            gap = positive_number("spacing", spacing)
            count = round(2.0 * math.pi / gap)
            if count < 1 or abs(count * gap - 2.0 * math.pi) > DIVISOR_TOLERANCE * 2.0 * math.pi:
                below, above = (2.0 * math.pi / max(n, 1) for n in (math.ceil(2.0 * math.pi / gap), count or 1))
                raise InputError(
                    f"spacing: expected 2 pi divided by a whole number, got {gap!r}; for example {below!r} or {above!r}"
                )
            return cls(count, depth)
        count = max(FEWEST, math.floor(2.0 * math.pi / scale**SPACING_POWER))
        while count > FEWEST and not depth < cls.deepest_for(count):
            count -= 1
        return cls(count, depth)

    @staticmethod
    def deepest_for(count: int) -> float:
        """Return the depth of the wall below which at most two of ``count`` satellites are below the wall's tops."""
        return min(float(rolling.rise(2.0 * math.pi / count)), math.cos(math.pi / count))

    @property
    def deepest(self) -> float:
        """The upper bound, exclusive, on the depth of the wall."""
        return self.deepest_for(self.count)

    @property
    def spacing(self) -> float:
        """rho = 2 pi / count, the angle between neighbours, in radians."""
        return 2.0 * math.pi / self.count

    @property
    def reach(self) -> float:
        """The largest angle from the lowest point at which a satellite can be below the wall's tops."""
        return 2.0 * math.asin(math.sqrt(0.5 * self.lowest))

    @property
    def lowest(self) -> float:
        """The largest depth of the disk's centre below height 0: -x2 <= depth + 1 - cos(spacing/2)."""
        return self.depth + float(rolling.rise(0.5 * self.spacing))


@dataclass(frozen=True)
class RollingCharts:
    """The maps between the configurations of a disk with satellites and the cylinder of straightened configurations.

    Satellites are points on the rim of the unit disk, ``spacing`` apart. The centre of a disk that rolls about its
    lowest satellite moves on a circle, on the cylinder along a straight line; `bend` maps the line to the circle.

    Parameters
    ----------
    spacing : float
        rho in radians, 2 pi over a whole number of at least 4 (to rounding).
    scale : float
        Unit of length, greater than 0: 1 for the maps F, f_lin, H_1, eta of Rudzis 2022, section 4; eps for the zoomed
        maps f*, H_eps, G_eps of section 5.3. The third coordinate has the same unit: alpha/scale.

    Attributes
    ----------
    spacing : float
        Exactly 2 pi over ``satellites``.
    satellites : int
        The number of satellites.

    Raises
    ------
    InputError
        If a number is not positive or the spacing does not divide 2 pi.

    Notes
    -----
    Arrays broadcast. Heights of centres and of satellites are 0 if a satellite at the lowest point of the rim touches
    the tops of the wall, as in `Wall`; the paper's heights of satellites are less by 1/scale. 1 - cos and x - sin x
    are computed without cancellation. The formulas are in `asperity.geometry.disk.rolling`, which also takes
    ``xp=sympy``; the ledger proves them.

    Examples
    --------
    >>> charts = RollingCharts(np.pi / 2)
    >>> charts.satellites
    4
    >>> charts.nearest([0.0, 3.0]).tolist()
    [0, 2]
    >>> charts.straighten(charts.bend([0.25, 0.5, 0.0])).tolist()
    [0.25, 0.5, 0.0]
    """

    spacing: float
    scale: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "spacing", Satellites.around(1.0, 0.0, self.spacing).spacing)
        object.__setattr__(self, "scale", positive_number("scale", self.scale))

    @property
    def satellites(self) -> int:
        """The number N of satellites, 2 pi/rho."""
        return round(2.0 * math.pi / self.spacing)

    def nearest(self, alpha: ArrayLike) -> NDArray[np.int64]:
        """Return k-bar, where k-bar rho is the multiple of rho nearest to alpha (of two nearest, the greater).

        The lowest satellite is number -k-bar, modulo ``satellites`` (the paper prints S_k-bar).
        """
        turns = finite_array("alpha", alpha) * (self.scale / self.spacing)
        return np.floor(turns + 0.5).astype(np.int64)

    def residual(self, alpha: ArrayLike) -> Floats:
        """Return alpha-bar = alpha - k-bar rho/scale, in [-rho/2, rho/2] divided by the scale."""
        rotation = finite_array("alpha", alpha)
        return np.asarray(rotation - self.nearest(rotation) * (self.spacing / self.scale))

    def satellite(self, configuration: ArrayLike, number: ArrayLike) -> Floats:
        """Return the positions (..., 2) of the satellites S_k, k = ``number``, with height 0 at the tops (eq. 1.38).

        Examples
        --------
        >>> RollingCharts(np.pi / 2).satellite([2.0, 0.0, 0.0], [0, 2]).round(15).tolist()
        [[2.0, 0.0], [2.0, 2.0]]
        """
        x1, x2, alpha = _split("configuration", configuration, 3)
        bar = alpha + finite_array("number", number) * (self.spacing / self.scale)
        return _join(rolling.satellite(x1, x2, bar, self.scale))

    def contact(self, configuration: ArrayLike) -> Floats:
        """Return the position (..., 2) of the lowest satellite: G_eps as the map of M* to the plane (eq. 3.60')."""
        x1, x2, alpha = _split("configuration", configuration, 3)
        return _join(rolling.satellite(x1, x2, self.residual(alpha), self.scale))

    def contact_differential(self, configuration: ArrayLike) -> Floats:
        """Return the differential (..., 2, 3) of `contact`: dG_eps (eq. 3.66)."""
        _, _, alpha = _split("configuration", configuration, 3)
        return _matrix(rolling.satellite_differential(self.residual(alpha), self.scale), alpha.shape)

    def roll(self, point: ArrayLike, alpha: ArrayLike) -> Floats:
        """Return the configurations (..., 3) with the lowest satellite at ``point`` (..., 2), rotated by ``alpha``.

        F (eq. 4.4) with ``scale`` 1, f* (eq. 3.56, corrected: alpha-bar* = alpha - k-bar* rho/eps) with eps.

        Examples
        --------
        >>> charts = RollingCharts(np.pi / 2, scale=1e-8)
        >>> charts.contact(charts.roll([3.0, -0.25], 0.125)).tolist()
        [3.0, -0.25]
        """
        s1, s2 = _split("point", point, 2)
        rotation = finite_array("alpha", alpha)
        return _join((*rolling.roll(s1, s2, self.residual(rotation), self.scale), rotation))

    def roll_linear(self, point: ArrayLike, alpha: ArrayLike) -> Floats:
        """Return f_lin = (s1 - alpha, s2, alpha), the linear part of `roll` at alpha = 0 and the chart of M_cyl."""
        s1, s2 = _split("point", point, 2)
        rotation = finite_array("alpha", alpha)
        return _join(rolling.roll_linear(s1, s2, rotation))

    def bend(self, configuration: ArrayLike) -> Floats:
        """Return H_1 (eq. 4.43), or H_eps (eq. 3.54), of configurations (..., 3).

        The map takes M_cyl with alpha in Z^0 to the configuration space M; with every alpha if rho is a whole multiple
        of the wall's period (eq. 5.71, corrected). For alpha in Z^0, `bend` o `roll_linear` = `roll`.
        """
        y1, y2, alpha = _split("configuration", configuration, 3)
        return _join((*rolling.bend(y1, y2, self.residual(alpha), self.scale), alpha))

    def straighten(self, configuration: ArrayLike) -> Floats:
        """Return the inverse of `bend` at configurations (..., 3)."""
        x1, x2, alpha = _split("configuration", configuration, 3)
        return _join((*rolling.straighten(x1, x2, self.residual(alpha), self.scale), alpha))

    def bend_differential(self, configuration: ArrayLike) -> Floats:
        """Return the differential (..., 3, 3) of `bend`; its determinant is 1."""
        _, _, alpha = _split("configuration", configuration, 3)
        return _matrix(rolling.bend_differential(self.residual(alpha), self.scale), alpha.shape)

    def transfer(self, position: ArrayLike, velocity: ArrayLike) -> Floats:
        """Return phi_w, the position of eta(y, w): `bend`, then motion along the velocity back to height 0.

        Parameters
        ----------
        position : array_like, shape (..., 2)
            y = (x1, alpha) on the plane x2 = 0.
        velocity : array_like, shape (..., 3)
            w = (v1, v2, omega) with v2 other than 0, invariant under eta.

        Returns
        -------
        ndarray, shape (..., 2)
            (x1 + abar - sin abar + (1 - cos abar) v1/v2, alpha + (1 - cos abar) omega/v2). Section 5.2 prints all
            terms in abar with the wrong sign.

        Examples
        --------
        >>> RollingCharts(np.pi / 2).transfer([1.0, 0.0], [3.0, 2.0, 1.0]).tolist()
        [1.0, 0.0]
        """
        x1, alpha = _split("position", position, 2)
        w = _velocity(velocity)
        return _join(rolling.transfer(x1, alpha, self.residual(alpha), w, self.scale))

    def transfer_differential(self, position: ArrayLike, velocity: ArrayLike) -> Floats:
        """Return the differential (..., 2, 5) of `transfer` in (x1, alpha, v1, v2, omega).

        The first two columns are d phi_w (section 5.2, corrected), with determinant U = 1 + sin(abar) omega/v2.
        """
        x1, alpha = _split("position", position, 2)
        w = _velocity(velocity)
        entries = rolling.transfer_differential(self.residual(alpha), w, self.scale)
        return _matrix(entries, np.broadcast_shapes(x1.shape, w[0].shape))

    @staticmethod
    def plane_crossing(configuration: ArrayLike, velocity: ArrayLike) -> Floats:
        """Return (x1, alpha) at x2 = 0 on the line through a configuration along its velocity: Psi (eq. 4.66).

        Parameters
        ----------
        configuration : array_like, shape (..., 3)
            (x1, x2, alpha).
        velocity : array_like, shape (..., 3)
            (v1, v2, omega) with v2 other than 0.

        Returns
        -------
        ndarray, shape (..., 2)

        Raises
        ------
        InputError
            If a number is not finite, a shape is wrong or some v2 is 0.

        Examples
        --------
        >>> RollingCharts.plane_crossing([1.0, 2.0, 3.0], [1.0, 4.0, 2.0]).tolist()
        [0.5, 2.0]
        """
        return _join(rolling.project(*_split("configuration", configuration, 3), *_velocity(velocity)))

    @staticmethod
    def plane_crossing_differential(configuration: ArrayLike, velocity: ArrayLike) -> Floats:
        """Return the differential (..., 2, 6) of `plane_crossing` in (x1, x2, alpha, v1, v2, omega).

        Arguments and errors are the same as for `plane_crossing`.

        Examples
        --------
        >>> RollingCharts.plane_crossing_differential([0.0, 2.0, 0.0], [1.0, 2.0, 0.0])[0].tolist()
        [1.0, -0.5, 0.0, -1.0, 0.5, 0.0]
        """
        _, x2, _ = _split("configuration", configuration, 3)
        w = _velocity(velocity)
        return _matrix(rolling.project_differential(x2, *w), np.broadcast_shapes(x2.shape, w[0].shape))


def _split(name: str, value: ArrayLike, size: int) -> tuple[Floats, ...]:
    array = finite_array(name, value)
    if array.ndim == 0 or array.shape[-1] != size:
        raise InputError(f"{name}: expected an array of shape (..., {size}), got shape {array.shape}")
    return tuple(array[..., i] for i in range(size))


def _velocity(value: ArrayLike) -> tuple[Floats, ...]:
    w = _split("velocity", value, 3)
    if not np.all(w[1]):
        raise InputError("velocity: expected v2 other than 0, got 0: that line never meets the plane x2 = 0")
    return w


def _join(parts: Vector) -> Floats:
    return np.stack(np.broadcast_arrays(*parts), axis=-1)


def _matrix(entries: Matrix, shape: tuple[int, ...]) -> Floats:
    rows = [np.stack([np.broadcast_to(entry, shape) for entry in row], axis=-1) for row in entries]
    return np.asarray(np.stack(rows, axis=-2), dtype=np.float64)
