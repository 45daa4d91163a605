"""The states of disks in containers after their collisions; their paths, phase portraits and animations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, choice, instance, number_between, shaped, whole_number
from ...core.estimates import Summary
from ...core.tables import axes_or_new
from ...geometry import Container, Disk
from ...geometry.tables.boundary import FlightStatus
from ...geometry.tracing.tracing import numbers_of

if TYPE_CHECKING:
    from matplotlib.animation import FuncAnimation
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D


Coordinates = Literal["boundary", "velocity"]
# Colours, one a disk, and again from the first.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
# Radius of a drawn disk, and length of the trace behind it in flights, relative to the picture and the mean flight.
DRAWN_RADIUS, TRACE = 0.02, 5.0
# Seconds that an animation may take: a day. Timers count milliseconds as integers.
LONGEST = 86_400.0


@dataclass(frozen=True, repr=False)
class BilliardRecord(Summary):
    """States of n disks after each of their collisions; the first entry of every array is the initial state.

    A disk that meets no further wall, or whose next collision is not resolved, has fewer ``collisions`` than
    ``steps``; its last state is repeated. The other disks move as without it.

    Attributes
    ----------
    container : Container
    disk : Disk
    time : array, shape (steps + 1, n)
    position : array, shape (steps + 1, n, 2)
    angle : array, shape (steps + 1, n)
        Angle of rotation since the start, radians, not reduced modulo 2 pi.
    velocity : array, shape (steps + 1, n, 3)
        (v1, v2, r omega) after the collision.
    wall : array of int, shape (steps + 1, n)
        Index of the wall, -1 at the start.
    collisions : array of int, shape (n,)
    status : array of int, shape (n,)
        Values of ``FlightStatus``. ``FLYING``: all were computed. ``FREE``: no wall is ahead. ``CORNER``: the
        next one is at a corner, where the outcome depends on which wall is met first. ``GRAZING``: the path runs along
        a wall that bends towards it. ``UNREFLECTED``: the law of the wall found no outgoing velocity.
    """

    container: Container
    disk: Disk
    time: Floats
    position: Floats
    angle: Floats
    velocity: Floats
    wall: NDArray[np.int64]
    collisions: NDArray[np.int64]
    status: NDArray[np.uint8]
    _show = "container disk time collisions"

    def counts(self) -> dict[str, int]:
        """Return the number of disks with every ``FlightStatus``, by name in lower case.

        Examples
        --------
        Of two disks in a square one runs into a corner; the other goes on:

        >>> from asperity import geometry as geo, kernels as ker
        >>> square = geo.Container.polygon([(0, 0), (2, 0), (2, 2), (0, 2)])
        >>> record = ker.play(square, ker.smooth(geo.Disk()), [1.0, 1.0], [[1.0, 1.0, 0.0], [1.0, 0.5, 0.0]], 8)
        >>> {name: count for name, count in record.counts().items() if count}, record.collisions.tolist()
        ({'flying': 1, 'corner': 1}, [0, 8])
        """
        return numbers_of(self.status, FlightStatus)

    @property
    def radius(self) -> float | None:
        """The radius of the disks relative to the container; None where only the centres count."""
        return None

    @property
    def energy(self) -> Floats:
        """Kinetic energies <w, w>/2, shape (steps + 1, n)."""
        return np.asarray(0.5 * self.disk.inner(self.velocity, self.velocity))

    @property
    def _at_walls(self) -> NDArray[np.bool_]:
        """Which entries after the first are new collisions with walls."""
        return np.asarray(np.arange(len(self.wall) - 1)[:, None] < self.collisions)

    def _seen(self, position: Floats) -> Floats:
        """Positions (..., 2) as they are drawn."""
        return position

    def _corners(self, seen: Floats) -> Floats:
        """Points (k, 2) that the centres of drawn disks may reach."""
        return seen.reshape(-1, 2)

    def _images(self, position: Floats) -> Floats:
        """Where a disk is drawn, shape (k, 2)."""
        return position[None]

    def extent(self, direction: ArrayLike = (1.0, 0.0)) -> Floats:
        """Range, shape (n,), of the collision positions along a direction, without the start."""
        along = self.position[1:] @ shaped("direction", direction, 2)
        return np.asarray(np.ptp(along, axis=0))

    def draw_paths(self, ax: Axes | None = None) -> Axes:
        """Draw the container and the path of the centre of every disk.

        Parameters
        ----------
        ax : matplotlib Axes, optional

        Returns
        -------
        matplotlib Axes

        Examples
        --------
        >>> from asperity import geometry as geo, kernels as ker
        >>> record = ker.play(geo.Container.circle(), ker.smooth(geo.Disk()), [0.5, 0.0], [0.0, 1.0, 0.0], 9)
        >>> len(record.draw_paths().lines)
        2
        """
        axes = self.container.draw(ax)
        for k in range(self.position.shape[1]):
            axes.plot(*self.position[:, k].T, color=COLOURS[k % len(COLOURS)], linewidth=0.6, alpha=0.8)
        axes.set_xlabel("$x_1$")
        axes.set_ylabel("$x_2$")
        return axes

    def phase_portrait(self, coordinates: Coordinates = "boundary") -> tuple[Floats, Floats]:
        """Return the points of a phase portrait of the outgoing states at the walls.

        Parameters
        ----------
        coordinates : {"boundary", "velocity"}
            "boundary": the arc length s of the point of contact and the tangential velocity v1 over the speed; the
            measure ds dv1 is invariant for smooth walls. "velocity": the tangential velocity and the spin, (sqrt(m) v1,
            sqrt(J) omega) in units of sqrt(2 energy), the projection of the half sphere of outgoing velocities on the
            unit disk, where the flux has constant density.

        Returns
        -------
        (array, array), each of shape (collisions, n)
            NaN after the last collision of a disk that left, or whose next collision is not resolved.

        Raises
        ------
        InputError
            If the coordinates are unknown, or "boundary" and the container has straight walls without ends.

        Notes
        -----
        The second portrait is that of C. Cox and R. Feres, No-slip billiards in dimension two (2016).

        Examples
        --------
        In a circle the tangential velocity of a smooth disk is constant:

        >>> from asperity import geometry as geo, kernels as ker
        >>> record = ker.play(geo.Container.circle(), ker.smooth(geo.Disk()), [0.6, 0.0], [0.0, 2.0, 0.0], 9)
        >>> s, along = record.phase_portrait()
        >>> along[:, 0].round(12).tolist() == [0.6] * 9
        True
        """
        choice("coordinates", coordinates, ("boundary", "velocity"))
        instance("container", self.container, Container, "geo.Container.circle()")
        wall, position, velocity = self.wall[1:], self.position[1:], self.velocity[1:]
        met = self._at_walls
        first, second = np.full(wall.shape, np.nan), np.full(wall.shape, np.nan)
        tangent = np.zeros((*wall.shape, 2))
        for k in range(self.container.wall_count):
            here = met & (wall == k)
            tangent[here] = self.container.touch(k, position[here]).tangent
        along = np.sum(velocity[..., :2] * tangent, axis=-1)
        if coordinates == "boundary":
            first[met] = self.container.length_at(position[met], wall[met])
            second[met] = along[met] / np.hypot(velocity[met][:, 0], velocity[met][:, 1])
        else:
            norm = np.sqrt(2.0 * self.energy[1:][met])
            first[met] = np.sqrt(self.disk.mass) * along[met] / norm
            second[met] = np.sqrt(self.disk.rim_mass) * velocity[met][:, 2] / norm
        return first, second

    def draw_phase_portrait(self, coordinates: Coordinates = "boundary", ax: Axes | None = None) -> Axes:
        """Draw a phase portrait, one colour a disk; the coordinates are those of `phase_portrait`.

        Raises
        ------
        InputError
            As `phase_portrait`.

        Examples
        --------
        >>> from asperity import geometry as geo, kernels as ker
        >>> record = ker.play(geo.Container.circle(), ker.smooth(geo.Disk()), [0.6, 0.0], [0.0, 2.0, 0.0], 9)
        >>> record.draw_phase_portrait().get_xlabel()
        'arc length $s$'
        """
        first, second = self.phase_portrait(coordinates)
        axes = axes_or_new(ax)
        # a few points are to be seen too
        size = float(np.clip(300.0 / len(first), 1.2, 5.0))
        for k in range(first.shape[1]):
            colour = COLOURS[k % len(COLOURS)]
            axes.plot(first[:, k], second[:, k], ".", markersize=size, markeredgewidth=0, color=colour)
        if coordinates == "boundary":
            axes.set(xlim=(0.0, self.container.perimeter), ylim=(-1.0, 1.0), xlabel="arc length $s$")
            axes.set_ylabel("tangential velocity $v_1/|v|$")
        else:
            turn = np.linspace(0.0, 2.0 * np.pi, 361)
            axes.plot(np.cos(turn), np.sin(turn), color="black", linewidth=0.8)
            axes.set(xlabel=r"tangential velocity $\sqrt{m}\,v_1$", ylabel=r"spin $\sqrt{J}\,\omega$", aspect="equal")
        return axes

    def animate(self, frames: int = 200, duration: float = 10.0) -> FuncAnimation:
        """Make an animation of the disks, each with a spoke that shows its rotation and a trace behind it.

        Disks are drawn small, because walls bound the centres; those of a gas are drawn in their size. The animation
        ends when the first disk that went on has made its last collision.

        Parameters
        ----------
        frames : int
            Number of pictures, equally spaced in time.
        duration : float
            Seconds that it takes to show them, at most a day.

        Returns
        -------
        matplotlib.animation.FuncAnimation
            ``animation.save("disks.gif")`` writes a file, and ``animation.to_jshtml()`` shows it in a notebook.

        Raises
        ------
        InputError
            If a number is out of range.

        Examples
        --------
        >>> from asperity import geometry as geo, kernels as ker
        >>> record = ker.play(geo.Container.circle(), ker.smooth(geo.Disk()), [0.5, 0.0], [0.0, 1.0, 0.0], 9)
        >>> record.animate(frames=12).to_jshtml().count("data:image/png")
        12
        """
        count = whole_number("frames", frames, 2)
        seconds = number_between("duration", duration, 0.0, LONGEST, closed="high")
        from matplotlib.animation import FuncAnimation

        axes = self.container.draw()
        axes.set(xlabel="$x_1$", ylabel="$x_2$")
        went_on = self.time[-1, self.status == FlightStatus.FLYING]
        times = np.linspace(0.0, float(went_on.min() if went_on.size else self.time[-1].max()), count)
        small = DRAWN_RADIUS * max(np.ptp(self.position[..., 0]), np.ptp(self.position[..., 1]))
        size = self.radius or small
        seen = self._seen(self.position)
        corners = self._corners(seen)
        low, high = corners.min(axis=0) - 1.2 * size, corners.max(axis=0) + 1.2 * size
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        trace = TRACE * float(np.mean(np.diff(self.time, axis=0)))
        lines: list[list[Line2D]] = []
        for k in range(self.position.shape[1]):
            colour = COLOURS[k % len(COLOURS)]
            lines.append([axes.plot([], [], color=colour, linewidth=width)[0] for width in (0.6, 1.5, 1.5)])
        rim = np.linspace(0.0, 2.0 * np.pi, 37)

        def show(frame: int) -> list[Artist]:
            now = times[frame]
            for k, (tail, edge, spoke) in enumerate(lines):
                path, angle = path_between(self.time[:, k], self.position[:, k], self.angle[:, k], now, trace)
                path += self._seen(path[-1]) - path[-1]
                tail.set_data(*path.T)
                drawn = self._images(path[-1])
                for line, turns in ((edge, rim), (spoke, np.array([angle]))):
                    line.set_data(*_outlines(drawn, size, turns, from_centre=line is spoke))
            return [line for group in lines for line in group]

        # of an axes in a subfigure, the figure above it
        figure = axes.figure.figure
        animation = FuncAnimation(figure, show, frames=count, interval=1e3 * seconds / count, blit=False)
        # matplotlib warns of an animation of which no picture was drawn
        figure.canvas.draw()
        return animation


def _outlines(centres: Floats, size: float, angles: Floats, *, from_centre: bool) -> Floats:
    """Points (2, n) at these angles about each of the centres, and those themselves, with gaps between them."""
    points = centres[:, None] + size * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    begun = centres[:, None] if from_centre else points[:, :0]
    gap = np.full((len(centres), 1, 2), np.nan)
    return np.asarray(np.concatenate([begun, points, gap], axis=1).reshape(-1, 2)[:-1].T)


def path_between(time: Floats, position: Floats, angle: Floats, now: float, trace: float) -> tuple[Floats, float]:
    """Return the polyline (k, 2) through the positions of a disk in the last time ``trace``, and the angle now."""
    start = max(0.0, now - trace)
    # of a long record the part around these times
    first, last = np.searchsorted(time, [start, now])
    part = slice(max(int(first) - 1, 0), int(last) + 1)
    time, position = time[part], position[part]
    at = np.concatenate([[start], time[(time > start) & (time < now)], [now]])
    path = np.stack([np.interp(at, time, position[:, axis]) for axis in (0, 1)], axis=1)
    return path, float(np.interp(now, time, angle[part]))
