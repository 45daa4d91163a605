"""The configuration space of a disk with satellites above a wall."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, finite_array, positive_number
from ...core.errors import InputError
from ..disk import rolling
from ..disk.charts import RollingCharts
from ..disk.disk import Disk, contact_normal
from ..disk.satellites import Satellites
from ..walls.interior import in_solid
from ..walls.wall import Wall


@dataclass(frozen=True)
class ConfigurationSpace:
    """The configurations M of a disk and a wall, and its straightened neighbour M_cyl.

    Parameters
    ----------
    wall : Wall
        Of any period; its tops are at height 0, where the paper's are at -1.
    disk : Disk
        Its radius is 1.
    scale : float
        eps, greater than 0: the disk meets ``wall.scaled(scale)``.
    spacing : float, optional
        rho, the angle between satellites, 2 pi over a whole number; by default the least of at least scale^0.4 at which
        no three satellites reach the wall, as in ``collide``.

    Attributes
    ----------
    charts : RollingCharts
        The maps F, f_lin, H_1, eta in the disk's unit of length.
    zoomed : RollingCharts
        The maps f*, H_eps, G_eps in the unit ``scale``.

    Raises
    ------
    InputError
        If an argument is of the wrong kind, or three satellites could reach the wall: scale * depth must be less than
        1 - cos(rho) (Rudzis 2022, Proposition 4.1 (vi)).

    Examples
    --------
    >>> from asperity import geometry as geo
    >>> space = ConfigurationSpace(geo.triangular_teeth(1.2), Disk(), scale=0.01)
    >>> space.contains([[0.0, 0.0, 0.0], [0.005, -0.001, 0.0], [0.0, -0.001, 0.0]]).tolist()
    [True, True, False]
    """

    wall: Wall
    disk: Disk
    scale: float
    spacing: float

    def __init__(self, wall: Wall, disk: Disk, scale: float, spacing: float | None = None) -> None:
        if not isinstance(wall, Wall) or not isinstance(disk, Disk):
            raise InputError(f"wall, disk: expected a Wall and a Disk, got {wall!r} and {disk!r}")
        eps = positive_number("scale", scale)
        spacing = Satellites.around(eps, eps * wall.depth, spacing).spacing
        for name, value in (("wall", wall), ("disk", disk), ("scale", eps), ("spacing", spacing)):
            object.__setattr__(self, name, value)

    @property
    def depth(self) -> float:
        """The depth of the scaled wall."""
        return self.scale * self.wall.depth

    @property
    def charts(self) -> RollingCharts:
        """The charts in the disk's unit of length."""
        return RollingCharts(self.spacing)

    @property
    def zoomed(self) -> RollingCharts:
        """The charts in the unit ``scale``."""
        return RollingCharts(self.spacing, self.scale)

    @property
    def gap_radius(self) -> float:
        """delta_0: within it of odd multiples of rho/2 two satellites may be below the tops (section 4.1).

        arcsin(depth/(2 sin(rho/2))), which is sharp for a wall that reaches its depth close to every point.
        """
        return float(rolling.gap_radius(self.depth, self.spacing))

    def is_single(self, alpha: ArrayLike) -> NDArray[np.bool_]:
        """Return whether alpha is in Z, where only one satellite can touch; the rest has the fraction 2 delta_0/rho."""
        bar = self.charts.residual(alpha)
        return np.asarray(np.abs(bar) <= 0.5 * self.spacing - self.gap_radius)

    def contains(self, configuration: ArrayLike) -> NDArray[np.bool_]:
        """Return whether configurations (..., 3) are in M: no satellite in the interior of the solid.

        Only the two lowest satellites are looked at, as no third one reaches the wall; and where the centre is so low
        that the lowest satellite is below the whole wall, it is in the solid.
        """
        values = _configurations(configuration)
        bar, zoomed = self.charts.residual(values[..., 2]), values / self.scale
        # one k for both: two roundings of a tie would give the same satellite twice
        lowest = -self.charts.nearest(values[..., 2])
        beside = lowest + np.where(bar > 0.0, -1, 1)
        centres = (self.zoomed.satellite(zoomed, number) for number in (lowest, beside))
        return np.asarray(~np.any([in_solid(self.wall, centre) for centre in centres], axis=0))

    def cylinder_contains(self, configuration: ArrayLike) -> NDArray[np.bool_]:
        """Return whether configurations (..., 3) are in M_cyl: (x1 + alpha, x2) is not in the interior of the solid.

        Section 4.2; section 1.3.3 prints (x1 + alpha, alpha).
        """
        values = _configurations(configuration)
        centre = np.stack(rolling.straight_contact(*np.moveaxis(values, -1, 0)), axis=-1)
        return ~in_solid(self.wall, centre / self.scale)

    def normal(self, alpha: ArrayLike, number: ArrayLike, wall_normal: ArrayLike) -> Floats:
        """Return the unit normals (..., 3) of M where satellite ``number`` touches the wall, into M.

        Parameters
        ----------
        alpha : array_like
            The disk's angle.
        number : array_like
            j: the satellite is at the angle alpha + j rho (eq. 3.26 prints alpha - j rho).
        wall_normal : array_like, shape (..., 2)
            The wall's unit normals there, out of the solid.

        Returns
        -------
        ndarray, shape (..., 3)
            Of norm 1 in the kinetic-energy metric: v - 2 <v, n> n is the velocity v after a frictionless impact.

        Examples
        --------
        >>> from asperity import geometry as geo
        >>> ConfigurationSpace(geo.flat(), Disk(4.0), 0.01).normal(0.0, 0, [0.0, 1.0]).tolist()
        [0.0, 0.5, 0.0]
        """
        k = finite_array("wall_normal", wall_normal)
        if k.ndim == 0 or k.shape[-1] != 2:
            raise InputError(f"wall_normal: expected an array of shape (..., 2), got shape {k.shape}")
        angle = finite_array("alpha", alpha) + np.asarray(number) * self.spacing
        n = contact_normal(self.disk.mass, self.disk.inertia, (k[..., 0], k[..., 1]), angle)
        return np.stack(np.broadcast_arrays(*n), axis=-1)


def _configurations(value: ArrayLike) -> Floats:
    array = finite_array("configuration", value)
    if array.ndim == 0 or array.shape[-1] != 3:
        raise InputError(f"configuration: expected (x1, x2, alpha) of shape (..., 3), got shape {array.shape}")
    return array
