"""Pictures of disks in containers: paths, phase portraits, and an animation."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from ...core.checks import Floats, choice, instance, positive_number, whole_number
from ...geometry.tables.boundary import FlightStatus
from .billiard import BilliardRecord

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


def draw_paths(record: BilliardRecord, ax: Axes | None = None) -> Axes:
    """Draw the container and the path of the centre of every disk.

    Parameters
    ----------
    record : BilliardRecord
    ax : matplotlib Axes, optional

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    InputError
        If ``record`` is no BilliardRecord.

    Examples
    --------
    >>> from asperity import geometry as geo, kernels as ker
    >>> record = ker.play(geo.Container.circle(), ker.smooth(geo.Disk()), [0.5, 0.0], [0.0, 1.0, 0.0], 9)
    >>> len(ker.draw_paths(record).lines)
    2
    """
    instance("record", record, BilliardRecord, "ker.play(container, laws, position, velocity, collisions)")
    axes = record.container.draw(ax)
    for k in range(record.position.shape[1]):
        axes.plot(*record.position[:, k].T, color=COLOURS[k % len(COLOURS)], linewidth=0.6, alpha=0.8)
    axes.set_xlabel("$x_1$")
    axes.set_ylabel("$x_2$")
    return axes


def phase_portrait(record: BilliardRecord, coordinates: Coordinates = "boundary") -> tuple[Floats, Floats]:
    """Return the points of a phase portrait of the outgoing states at the walls.

    Parameters
    ----------
    record : BilliardRecord
    coordinates : {"boundary", "velocity"}
        "boundary": the arc length s of the point of contact and the tangential velocity v1 over the speed; the measure
        ds dv1 is invariant for smooth walls. "velocity": the tangential velocity and the spin, (sqrt(m) v1, sqrt(J)
        omega) in units of sqrt(2 energy), the projection of the half sphere of outgoing velocities on the unit disk,
        where the flux has constant density.

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
    >>> s, along = ker.phase_portrait(record)
    >>> along[:, 0].round(12).tolist() == [0.6] * 9
    True
    """
    instance("record", record, BilliardRecord, "ker.play(container, laws, position, velocity, collisions)")
    choice("coordinates", coordinates, ("boundary", "velocity"))
    wall, position, velocity = record.wall[1:], record.position[1:], record.velocity[1:]
    met = np.arange(len(wall))[:, None] < record.collisions
    first, second = np.full(wall.shape, np.nan), np.full(wall.shape, np.nan)
    tangent = np.zeros((*wall.shape, 2))
    for k in range(record.container.wall_count):
        here = met & (wall == k)
        tangent[here] = record.container.touch(k, position[here]).tangent
    along = np.sum(velocity[..., :2] * tangent, axis=-1)
    if coordinates == "boundary":
        first[met] = record.container.length_at(position[met], wall[met])
        second[met] = along[met] / np.hypot(velocity[met][:, 0], velocity[met][:, 1])
    else:
        norm = np.sqrt(2.0 * record.energy[1:][met])
        first[met] = np.sqrt(record.disk.mass) * along[met] / norm
        second[met] = np.sqrt(record.disk.inertia) * velocity[met][:, 2] / norm
    return first, second


def draw_phase_portrait(record: BilliardRecord, coordinates: Coordinates = "boundary", ax: Axes | None = None) -> Axes:
    """Draw a phase portrait, one colour a disk; the coordinates are those of `phase_portrait`.

    Raises
    ------
    InputError
        As `phase_portrait`.

    Examples
    --------
    >>> from asperity import geometry as geo, kernels as ker
    >>> record = ker.play(geo.Container.circle(), ker.smooth(geo.Disk()), [0.6, 0.0], [0.0, 2.0, 0.0], 9)
    >>> ker.draw_phase_portrait(record).get_xlabel()
    'arc length $s$'
    """
    first, second = phase_portrait(record, coordinates)
    from matplotlib import pyplot

    axes = pyplot.subplots()[1] if ax is None else ax
    for k in range(first.shape[1]):
        axes.plot(first[:, k], second[:, k], ".", markersize=1.2, markeredgewidth=0, color=COLOURS[k % len(COLOURS)])
    if coordinates == "boundary":
        axes.set(xlim=(0.0, record.container.perimeter), ylim=(-1.0, 1.0), xlabel="arc length $s$")
        axes.set_ylabel("tangential velocity $v_1/|v|$")
    else:
        turn = np.linspace(0.0, 2.0 * np.pi, 361)
        axes.plot(np.cos(turn), np.sin(turn), color="black", linewidth=0.8)
        axes.set(xlabel=r"tangential velocity $\sqrt{m}\,v_1$", ylabel=r"spin $\sqrt{J}\,\omega$", aspect="equal")
    return axes


def animate(record: BilliardRecord, frames: int = 200, duration: float = 10.0) -> FuncAnimation:
    """Make an animation of the disks of a record, each with a spoke that shows its rotation and a trace behind it.

    Disks are drawn small, because walls bound the centres; those of a gas are drawn in their size.

    Parameters
    ----------
    record : BilliardRecord
        The animation ends when the first disk that went on has made its last collision.
    frames : int
        Number of pictures, equally spaced in time.
    duration : float
        Seconds that it takes to show them.

    Returns
    -------
    matplotlib.animation.FuncAnimation
        ``animation.save("disks.gif")`` writes a file, and ``animation.to_jshtml()`` shows it in a notebook.

    Raises
    ------
    InputError
        If ``record`` is no BilliardRecord, or a number is not positive.

    Examples
    --------
    >>> from asperity import geometry as geo, kernels as ker
    >>> record = ker.play(geo.Container.circle(), ker.smooth(geo.Disk()), [0.5, 0.0], [0.0, 1.0, 0.0], 9)
    >>> ker.animate(record, frames=12).to_jshtml().count("data:image/png")
    12
    """
    instance("record", record, BilliardRecord, "ker.play(container, laws, position, velocity, collisions)")
    count, seconds = whole_number("frames", frames, 2), positive_number("duration", duration)
    from matplotlib.animation import FuncAnimation

    axes = draw_paths(record)
    for line in axes.lines[-record.position.shape[1] :]:
        line.remove()
    went_on = record.time[-1, record.status == FlightStatus.FLYING]
    times = np.linspace(0.0, float(went_on.min() if went_on.size else record.time[-1].max()), count)
    small = DRAWN_RADIUS * max(np.ptp(record.position[..., 0]), np.ptp(record.position[..., 1]))
    size = record.radius or small
    low, high = record.position.min(axis=(0, 1)) - 1.2 * size, record.position.max(axis=(0, 1)) + 1.2 * size
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    trace = TRACE * float(np.mean(np.diff(record.time, axis=0)))
    lines: list[list[Line2D]] = []
    for k in range(record.position.shape[1]):
        colour = COLOURS[k % len(COLOURS)]
        lines.append([axes.plot([], [], color=colour, linewidth=width)[0] for width in (0.6, 1.5, 1.5)])
    rim = np.linspace(0.0, 2.0 * np.pi, 37)

    def show(frame: int) -> list[Artist]:
        now = times[frame]
        for k, (tail, edge, spoke) in enumerate(lines):
            path = path_between(record, k, max(0.0, now - trace), now)
            tail.set_data(*path.T)
            (x, y), angle = path[-1], float(np.interp(now, record.time[:, k], record.angle[:, k]))
            edge.set_data(x + size * np.cos(rim), y + size * np.sin(rim))
            spoke.set_data([x, x + size * np.cos(angle)], [y, y + size * np.sin(angle)])
        return [line for group in lines for line in group]

    # of an axes in a subfigure, the figure above it; `get_figure(root=True)` needs matplotlib 3.10
    figure = axes.figure.figure
    animation = FuncAnimation(figure, show, frames=count, interval=1e3 * seconds / count, blit=False)
    # matplotlib warns of an animation of which no picture was drawn
    figure.canvas.draw()
    return animation


def path_between(record: BilliardRecord, disk: int, start: float, end: float) -> Floats:
    """Return the polyline of the centre of one disk between two times, shape (k, 2)."""
    time, position = record.time[:, disk], record.position[:, disk]
    inner = time[(time > start) & (time < end)]
    at = np.concatenate([[start], inner, [end]])
    return np.stack([np.interp(at, time, position[:, axis]) for axis in (0, 1)], axis=1)
