"""The small pictures of pages whose own pictures have several parts, or that have none: one thing each, large."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from asperity import geometry as geo
from asperity import kernels as ker

if TYPE_CHECKING:
    from matplotlib.axes import Axes

INCHES, DOTS = (4.0, 2.8), 100
BLUE, RED = "#0072B2", "#D55E00"


def write_thumbnails(folder: Path) -> None:
    """Draw those that do not exist, without axes and titles."""
    from matplotlib.figure import Figure

    folder.mkdir(parents=True, exist_ok=True)
    for name, draw in PICTURES.items():
        if not (path := folder / f"{name}.png").exists():
            figure = Figure(figsize=INCHES, dpi=DOTS)
            ax = figure.add_axes((0.0, 0.0, 1.0, 1.0))
            draw(ax)
            ax.set_axis_off()
            ax.set(title="")
            figure.savefig(path)


def wall_with(wall: geo.Wall, x: float, theta: float, low: float, high: float) -> Callable[[Axes], None]:
    """A wall with one ray, between these heights, as wide as the picture."""

    def draw(ax: Axes) -> None:
        geo.draw_wall(wall, x, theta, ax=ax)
        ax.axhspan(low, -wall.depth, color="0.82", linewidth=0, zorder=0)
        half = 0.5 * (high - low) * INCHES[0] / INCHES[1]
        ax.set(xlim=(0.5 - half, 0.5 + half), ylim=(low, high))

    return draw


def law_of(law: ker.Law) -> Callable[[Axes], None]:
    """The density of a law in bins."""

    def draw(ax: Axes) -> None:
        P = ker.discretise(law, ker.Bins(48), tolerance=1e-2)
        ax.pcolormesh(P.basis.edges, P.basis.edges, np.sqrt(P.array.T), cmap="viridis")

    return draw


def plates(law: ker.Law, collisions: int) -> Callable[[Axes], None]:
    """A disk between two plates."""

    def draw(ax: Axes) -> None:
        disk = geo.Disk(mass=1.0, inertia_ratio=0.5)
        start = disk.from_angles(0.9, 1.3)
        record = ker.play(geo.Container.strip(), ker.CollisionLaw(law, disk), [0.0, 0.0], start, collisions, 3)
        x, y = record.position[:, 0].T
        ax.plot(x, y, color=BLUE)
        ax.hlines([y.min(), y.max()], x.min() - 1, x.max() + 1, color="black", linewidth=2.0)
        ax.set(ylim=(y.min() - 0.3, y.max() + 0.3))

    return draw


def stadium(ax: Axes) -> None:
    """The path of a disk in a stadium."""
    container = geo.Container.stadium()
    ker.play(container, ker.no_slip(geo.Disk()), [0.1, 0.2], [0.6, 0.8, 0.1], 40).draw_paths(ax)


def grains(ax: Axes) -> None:
    """Two grains that touch."""
    from matplotlib.patches import Circle

    for centre, radius, colour in (((0.0, 0.0), 1.5, "0.75"), ((1.5, 2.0), 1.0, BLUE)):
        ax.add_patch(Circle(centre, radius, facecolor=colour, edgecolor="black", alpha=0.7))
    ax.annotate("", (1.5, 2.0), (3.6, 2.8), arrowprops={"arrowstyle": "-|>", "linewidth": 2.0, "mutation_scale": 22})
    ax.set(xlim=(-2.8, 4.6), ylim=(-1.7, 3.4), aspect="equal")


def gas(ax: Axes) -> None:
    """Disks of a gas between collisions, each with a spoke."""
    from matplotlib.patches import Circle

    seats = np.array([(2.5 * i, 2.5 * j) for i in range(10) for j in range(7)])
    velocity = np.random.default_rng(1).standard_normal((len(seats), 3))
    pair = ker.PairLaw(ker.retroreflection(), geo.Disk())
    record = ker.play_gas(geo.Torus(25.0, 17.5), pair, seats, velocity, 400, every=400)
    for (x, y), angle in zip(record.position[-1] % (25.0, 17.5), record.angle[-1], strict=True):
        ax.add_patch(Circle((x, y), 1.0, facecolor=BLUE, edgecolor="black", alpha=0.7))
        ax.plot([x, x + np.cos(angle)], [y, y + np.sin(angle)], color="black")
    ax.set(xlim=(2.0, 23.0), ylim=(1.5, 16.2), aspect="equal")


def rough_disks(ax: Axes) -> None:
    """Two disks with bumps on their rims."""
    turn = np.linspace(0.0, 2.0 * np.pi, 1441)
    rim = 0.84 + 0.16 * np.abs(np.sin(10.0 * turn))
    for x, y, colour in ((0.0, 0.0, "0.75"), (1.55, 1.2, BLUE)):
        ax.fill(x + rim * np.cos(turn), y + rim * np.sin(turn), facecolor=colour, edgecolor="black", alpha=0.7)
    ax.set(xlim=(-1.9, 3.4), ylim=(-1.2, 2.4), aspect="equal")


def for_lambert(ax: Axes) -> None:
    """Some hollows of a wall for Lambert's law."""
    wall_with(ker.wall_for(ker.lambertian(), 6).wall, 0.4, 1.2, -0.25, 0.25)(ax)


def true_disk(ax: Axes) -> None:
    """A collision of a true disk, near the wall."""
    geo.ConfigurationSpace(geo.triangular_teeth(1.2), geo.Disk(), 0.01).draw_collision(
        [0.002, 0.0], [0.3, -1.0, 0.2], ax
    )


def least_resistance(ax: Axes) -> None:
    """The law of least resistance."""
    theta = np.linspace(0.0, np.pi, 602)[1:-1]
    probability, outgoing = ker.extremal_resistance(64).law.images(theta)
    for slot in (0, 1):
        used = probability[:, slot] > 0
        ax.plot(theta[used], outgoing[used, slot], ".", color=(BLUE, RED)[slot], markersize=5.0)


def profile(ax: Axes) -> None:
    """A part of a measured profile."""
    x = np.linspace(0.0, 1.0, 81)
    waves = np.random.default_rng(5).standard_normal((2, 12)) / np.arange(1, 13)
    angles = 2.0 * np.pi * x[:, None] * np.arange(1, 13)
    height = np.cos(angles) @ waves[0] + np.sin(angles) @ waves[1]
    wall_with(geo.Wall.from_profile(x, 0.08 * height, "step"), 0.5, 1.2, -0.5, 0.2)(ax)


def height_map(ax: Axes) -> None:
    """A random surface, lit from the left."""
    field = geo.Surface.random(geo.HeightCorrelation(0.12), 96, rms_slope=0.7, rng=2).heights
    slope = np.tile(np.roll(field, -1, axis=0) - field, (2, 1))[: int(96 * INCHES[0] / INCHES[1])]
    ax.pcolormesh(slope.T, cmap="gray", shading="gouraud")


def hollows(ax: Axes) -> None:
    """A wall for Maxwell's law."""
    wall_with(ker.wall_for(ker.maxwell(0.5), 4).wall, 0.4, 1.2, -0.4, 0.4)(ax)


def exchange(ax: Axes) -> None:
    """A chamber that exchanges intervals of angles."""
    law = ker.IntervalExchangeLaw(ker.discretise(ker.lambertian(), ker.Bins(4)))
    geo.draw_wall(ker.exchange_hollow(law, 1e-2).wall, ax=ax)


PICTURES: dict[str, Callable[[Axes], None]] = {
    "a_gas_of_rough_disks": gas,
    "a_granular_collision": grains,
    "a_measured_surface": height_map,
    "a_wall_for_a_law": hollows,
    "rough_disks": rough_disks,
    "walls_converge": for_lambert,
    "no_slip_billiards": plates(ker.retroreflection(), 40),
    "retroreflectors": wall_with(geo.notched_angle(0.6, 12), 0.53, 1.1, -1.7, 0.3),
    "billiards": stadium,
    "exchange_hollow": exchange,
    "disk_in_a_strip": plates(ker.CircularArcLaw(1.2), 40),
    "least_resistance": least_resistance,
    "maxwell_or_rough": law_of(ker.CircularArcLaw(0.5)),
    "measured_profile": profile,
    "no_slip_or_smooth": wall_with(geo.rectangular_teeth(1.0), 0.6, 1.1, -0.6, 0.3),
    "best_proved_gap": wall_with(geo.focusing_arcs(0.752), 0.3, 1.1, -0.4, 0.4),
    "published_gap": wall_with(geo.dispersing_arcs(1.0), 0.35, 1.1, -0.3, 0.4),
    "true_disk": true_disk,
}
