"""The configuration space of a disk with satellites above a wall, its sections, the path and plot of a collision."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, finite_array, number_between, positive_number, shaped
from ...core.errors import InputError
from ...core.tables import axes_or_new
from ..curves.curve import Curve
from ..disk import rolling
from ..disk.disk import Disk, InnerDisk, contact_normal
from ..disk.satellites import RollingCharts, Satellites
from ..plotting.walls import LEVEL, RAY_COLOURS, SOLID, draw_solid
from ..walls.wall import Wall
from .rigid import check_kinds, collide

if TYPE_CHECKING:
    from matplotlib.axes import Axes


MOST_CONTACTS = 200


def collision_path(
    disk: Disk, wall: Wall, scale: float, position: ArrayLike, velocity: ArrayLike, spacing: float | None = None
) -> Floats:
    """Return the configurations (x1, x2, alpha) of one disk at height 0, at k contacts, and at height 0 again.

    Parameters
    ----------
    disk, wall, scale, spacing
        As in `collide`.
    position : array_like, shape (2,)
    velocity : array_like, shape (3,)

    Returns
    -------
    ndarray, shape (k + 2, 3)

    Raises
    ------
    InputError
        As in `collide`, and if the disk does not come back or has more than 200 contacts.

    Examples
    --------
    >>> from asperity import geometry as geo
    >>> path = collision_path(geo.Disk(), geo.triangular_teeth(2.0), 0.01, [0.0025, 0.0], [0.0, -1.0, 0.0])
    >>> path.shape, bool(path[0, 1] == 0.0), bool(path[1, 1] < 0.0), abs(float(path[-1, 1])) < 1e-15
    ((4, 3), True, True, True)
    """
    start, moving = finite_array("position", position)[None], finite_array("velocity", velocity)[None]
    whole = collide(disk, wall, scale, start, moving, spacing)
    contacts = int(whole.contacts[0])
    if not whole.escaped[0] or contacts > MOST_CONTACTS:
        state = next(name for name, count in whole.counts().items() if count)
        raise InputError(
            f"position, velocity: expected a disk that comes back after at most {MOST_CONTACTS} contacts, got {state} "
            f"after {contacts}"
        )
    # a run limited to k contacts ends at contact k + 1; the heights follow from the times
    legs = [collide(disk, wall, scale, start, moving, spacing, max_contacts=k) for k in range(1, contacts)]
    states = [(leg.position[0], leg.velocity[0], float(leg.time[0])) for leg in [*legs, whole]]
    before = _first_time(start[0], moving[0], *states[0])
    height = moving[0, 1] * before
    path = [(*start[0], 0.0), (*(start[0] + moving[0, [0, 2]] * before), height)]
    for configuration, w, at in states:
        height += w[1] * (at - before)
        before = at
        path.append((*configuration, height))
    return np.array(path)[:, [0, 2, 1]]


def _first_time(start: Floats, moving: Floats, configuration: Floats, w: Floats, end: float) -> float:
    """Return the time of the first contact of a disk that is at ``configuration`` at the time ``end``.

    ``moving`` and ``w`` are its velocities before and after the contact.
    """
    change = w[[0, 2]] - moving[[0, 2]]
    reached = configuration - start - end * w[[0, 2]]
    # start + v first + w (end - first) = position
    if not np.any(change):
        # only v2 changed: the time follows from the return to height 0
        return float(end * w[1] / (w[1] - moving[1]))
    return float(-(change @ reached) / (change @ change))


# Number of points on a satellite's nearly straight path between two contacts.
FLIGHT_POINTS = 40
# Free space shown above the tops, in depths of the wall, and cells shown beside the contacts.
FREE, MARGIN = 1.0, 1.0
# Pixels per side of a section of the space.
SECTION = 500


@dataclass(frozen=True)
class ConfigurationSpace:
    """The configuration space M of a disk above a wall, and its straightened form M_cyl.

    Parameters
    ----------
    wall : Wall
        Of any period; the tops are at height 0 (in the paper at -1).
    disk : Disk
        Of radius 1.
    scale : float
        eps, greater than 0: the disk collides with ``wall.scaled(scale)``.
    spacing : float, optional
        rho, the angle between satellites, 2 pi over a whole number; by default, as in ``collide``, the least spacing of
        at least scale^0.4 at which no three satellites reach the wall.

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
        check_kinds(disk, wall)
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
    def inner_disk(self) -> InnerDisk:
        """D_0, the disk inside the satellites, whose clearance tells whether it can touch the wall (eq. 1.34)."""
        return InnerDisk(self.spacing, self.depth)

    @property
    def gap_radius(self) -> float:
        """delta_0 = arcsin(depth/(2 sin(rho/2))), section 4.1.

        Two satellites can be below the tops only if alpha is within delta_0 of an odd multiple of rho/2. The bound is
        sharp for a wall that reaches its depth near every point.
        """
        return float(rolling.gap_radius(self.depth, self.spacing))

    def is_single(self, alpha: ArrayLike) -> NDArray[np.bool_]:
        """Return whether alpha is in Z, where only one satellite can touch; Z is 1 - 2 delta_0/rho of all angles."""
        bar = self.charts.residual(alpha)
        return np.asarray(np.abs(bar) <= 0.5 * self.spacing - self.gap_radius)

    def good_half_width(self, length: float = 1.0) -> float:
        """Return how far alpha may be from multiples of rho in the set Xi, in units of ``scale`` (section 5.3.5).

        From such an angle log(1/rho)/(4 log log(1/rho)) flights of length L log(1/rho), with L = ``length`` in units of
        the wall, end before a second satellite comes below the tops. The angles are nearly all if the scale is small,
        and none if the number is negative. The half-width that is printed is negative for all rho < 1.

        Raises
        ------
        InputError
            If ``length`` is not positive, or the spacing is not less than exp(-e), so that log log(1/rho) is below 1.

        Examples
        --------
        >>> from asperity import geometry as geo
        >>> space = ConfigurationSpace(geo.triangular_teeth(1.2), Disk(), scale=1e-9)
        >>> round(space.good_half_width() / (0.5 * space.spacing / space.scale), 3)
        0.977
        """
        flight = positive_number("length", length)
        if not self.spacing < math.exp(-math.e):
            raise InputError(
                f"spacing: expected less than exp(-e) = 0.066, got {self.spacing:.6g}; take a smaller scale"
            )
        return float(rolling.good_half_width(self.scale, self.depth, self.spacing, flight))

    def contains(self, configuration: ArrayLike) -> NDArray[np.bool_]:
        """Return whether configurations (..., 3) are in M: no satellite is in the interior of the solid.

        Only the two lowest satellites are tested. A third satellite reaches the wall only if the lowest one is below
        the whole wall, that is, in the solid.
        """
        values = _configurations(configuration)
        bar, zoomed = self.charts.residual(values[..., 2]), values / self.scale
        # one k for both, because rounding a tie twice could give the same satellite twice
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
            The wall's unit normals at the contact, out of the solid.

        Returns
        -------
        ndarray, shape (..., 3)
            Of norm 1 in the kinetic-energy metric; a frictionless impact takes the velocity v to v - 2 <v, n> n.

        Examples
        --------
        >>> from asperity import geometry as geo
        >>> ConfigurationSpace(geo.flat(), Disk(4.0), 0.01).normal(0.0, 0, [0.0, 1.0]).tolist()
        [0.0, 0.5, 0.0]
        """
        k = shaped("wall_normal", wall_normal, "...", 2)
        angle = finite_array("alpha", alpha) + finite_array("number", number) * self.spacing
        n = contact_normal(self.disk.mass, self.disk.rim_mass, (k[..., 0], k[..., 1]), angle)
        return np.stack(np.broadcast_arrays(*n), axis=-1)

    def draw_collision(self, position: ArrayLike, velocity: ArrayLike, ax: Axes | None = None) -> Axes:
        """Draw one collision near the wall: the rim at every contact, and the paths of the satellites near the wall.

        Parameters
        ----------
        position, velocity : array_like, shapes (2,) and (3,)
            As in `collision_path`.
        ax : matplotlib Axes, optional
            By default the axes of a new figure.

        Returns
        -------
        matplotlib Axes
            Lengths are in units of the wall. Dots are the satellites at height 0 and at every contact, lines are their
            paths. The rim between satellites, dashed, does not touch the wall.

        Examples
        --------
        >>> from asperity import geometry as geo
        >>> space = geo.ConfigurationSpace(geo.triangular_teeth(2.0), geo.Disk(), 0.01)
        >>> space.draw_collision([0.0025, 0.0], [0.0, -1.0, 0.0]).get_ylabel()
        'height above the tops'
        """
        wall, eps = self.wall, self.scale
        path = collision_path(self.disk, wall, eps, position, velocity, self.spacing)
        ax = axes_or_new(ax)
        lowest = -self.charts.nearest(path[:, 2])
        numbers = np.arange(lowest.min() - 1, lowest.max() + 2)
        low = self.zoomed.satellite(path / eps, lowest)
        cells = np.array([low[:, 0].min(), low[:, 0].max()]) / wall.period
        left, right = np.floor(cells[0] - MARGIN), np.ceil(cells[1] + MARGIN)
        top = FREE * max(wall.depth, 0.3 * wall.period)
        draw_solid(ax, wall, range(int(left) - 1, int(right) + 1), -2.0 * top)
        for j, number in enumerate(numbers):
            colour = RAY_COLOURS[j % len(RAY_COLOURS)]
            for before, after in pairwise(path):
                fraction = np.linspace(0.0, 1.0, FLIGHT_POINTS)[:, None]
                track = self.zoomed.satellite((before + fraction * (after - before)) / eps, number)
                ax.plot(track[:, 0], track[:, 1], color=colour, linewidth=1.1)
        self._draw_rims(ax, path, numbers)
        ax.axhline(0.0, color=LEVEL, linewidth=0.8, linestyle=":")
        ax.set_xlim(left * wall.period, right * wall.period)
        ax.set_ylim(-1.15 * max(wall.depth, 0.1 * wall.period), top)
        ax.set_aspect("equal")
        ax.set_xlabel("x (length units of the wall)")
        ax.set_ylabel("height above the tops")
        return ax

    def _draw_rims(self, ax: Axes, path: Floats, numbers: Floats) -> None:
        """Draw the rim of the disk with its satellites at start, contacts and end."""
        angles = np.linspace(-1.5 * self.spacing, 1.5 * self.spacing, 4 * FLIGHT_POINTS)
        for configuration in path:
            x1, x2, alpha = configuration / self.scale
            x = x1 + np.sin(angles) / self.scale
            y = x2 + 2.0 * np.sin(0.5 * angles) ** 2 / self.scale
            ax.plot(x, y, color=LEVEL, linewidth=0.7, linestyle=(0, (4, 3)), zorder=1.5)
            for j, number in enumerate(numbers):
                dot = self.zoomed.satellite(np.array([x1, x2, alpha]), number)
                ax.plot(*dot, "o", color=RAY_COLOURS[j % len(RAY_COLOURS)], markersize=4.5, zorder=4)

    def draw_section(self, height: float, ax: Axes | None = None) -> Axes:
        """Draw the section of the space at one ``height`` of the lowest satellite.

        The section covers two cells and two spacings. Free configurations are white. For alpha in Z the solid is a bent
        cylinder over the wall, x1 + sin(alpha) constant. In the coloured bands two satellites may be below the tops,
        and two cylinders cross.

        Parameters
        ----------
        height : float
            Height of the lowest satellite relative to the tops, in units of the depth of the scaled wall, in (-1, 0).
        ax : matplotlib Axes, optional

        Returns
        -------
        matplotlib Axes

        Examples
        --------
        >>> from asperity import geometry as geo
        >>> space = ConfigurationSpace(geo.triangular_teeth(2.0), geo.Disk(), 0.01)
        >>> space.draw_section(-0.5).get_images()[0].get_extent()
        [0.0, 2.0, -1.0, 1.0]
        """
        height = number_between("height", height, -1.0, 0.0)
        ax = axes_or_new(ax)
        width, rho = self.scale * self.wall.period, self.spacing
        x1 = width * (np.arange(SECTION) + 0.5) / SECTION * 2.0
        alpha = rho * (2.0 * (np.arange(SECTION) + 0.5) / SECTION - 1.0)
        grid = np.stack(np.meshgrid(x1, alpha, indexing="xy"), axis=-1)
        x2 = height * self.depth - 2.0 * np.sin(0.5 * self.charts.residual(grid[..., 1])) ** 2
        free = self.contains(np.stack([grid[..., 0], x2, grid[..., 1]], axis=-1))
        extent = (0.0, 2.0 * self.wall.period, -1.0, 1.0)
        ax.imshow(np.where(free, 1.0, float(SOLID)), cmap="gray", vmin=0.0, vmax=1.0, origin="lower", extent=extent,
                  aspect="auto", interpolation="nearest")  # fmt: skip
        gap = self.gap_radius / rho
        for middle in (-0.5, 0.5):
            label = "two satellites can be low" if middle < 0.0 else None
            ax.axhspan(middle - gap, middle + gap, color=RAY_COLOURS[4], alpha=0.25, linewidth=0, label=label)
        ax.set_xlabel("x1 / eps")
        ax.set_ylabel("alpha / rho")
        ax.legend(loc="upper right", fontsize="small")
        return ax


def _configurations(value: ArrayLike) -> Floats:
    return shaped("configuration", value, "...", 3)


# Number of bisections of the parameter interval [0, 1] that leave two neighbouring floats near 1.
HALVINGS = 53


def in_solid(wall: Wall, points: Floats) -> NDArray[np.bool_]:
    """Return whether points of shape (..., 2) are in the interior of the solid; boundary points are not.

    A point is interior if it is on the solid side in all four limits (x +- 0, y +- 0). For points within a few units
    in the last place of a curved boundary the result depends on rounding.
    """
    flat = points.reshape(-1, 2)
    x, y = np.mod(flat[:, 0], wall.period), flat[:, 1]
    # parity of the crossings above each point, for y +- 0 (first axis) and x +- 0 (second axis)
    odd = np.zeros((2, 2, len(flat)), dtype=bool)
    for path in (wall.pieces, *wall.islands):
        for piece in path:
            low, high = piece.box[0], piece.box[2]
            for copy in range(int(np.floor(-high / wall.period)), int(np.ceil((wall.period - low) / wall.period)) + 1):
                _cross(piece, x - copy * wall.period, y, odd)
    below = y < -wall.depth
    return np.asarray((odd.all(axis=(0, 1)) | below).reshape(points.shape[:-1]))


def _cross(piece: Curve, x: Floats, y: Floats, odd: NDArray[np.bool_]) -> None:
    """Flip the parities of the points below the piece."""
    for start, end in pairwise([0.0, *piece.turning_points(0), 1.0]):
        left, right = (float(piece.point(s)[0]) for s in (start, end))
        if left == right:
            continue
        low, high = min(left, right), max(left, right)
        near = ((low <= x) & (x <= high)).nonzero()[0]
        if not len(near):
            continue
        height = _height(piece, start, end, x[near])
        for side, between in enumerate(((low <= x[near]) & (x[near] < high), (low < x[near]) & (x[near] <= high))):
            odd[0, side, near] ^= between & (height > y[near])
            odd[1, side, near] ^= between & (height >= y[near])


def _height(piece: Curve, start: float, end: float, x: Floats) -> Floats:
    """Return the heights at ``x`` of the part from ``start`` to ``end``, which is monotone in x."""
    if piece.is_straight:
        (x0, y0), (x1, y1) = piece.start, piece.end
        return np.asarray(y0 + (x - x0) * ((y1 - y0) / (x1 - x0)))
    first, last = np.full_like(x, start), np.full_like(x, end)
    rises = piece.point(end)[0] > piece.point(start)[0]
    for _ in range(HALVINGS):
        middle = 0.5 * (first + last)
        before = (piece.point(middle)[:, 0] < x) == rises
        first, last = np.where(before, middle, first), np.where(before, last, middle)
    return np.asarray(piece.point(0.5 * (first + last))[:, 1])
