"""Draw the eighteen figures of Rudzis 2022, one function each: python docs/examples/paper_figures.py FOLDER

The drawings are new; the numbers in them are computed by the library. The first line of each docstring is the caption.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from asperity import geometry as geo
from asperity import kernels as ker

# Blue: rays and paths of the model, specular where two kinds are told apart. Red: retroreflected rays. Green: disks and
# satellites, and their paths. Purple: normals, measured lengths and marks.
BLUE, RED, GREEN, PURPLE, GREY = "#0072B2", "#D55E00", "#009E73", "#9B4F96", "0.5"
DARK_GREEN = "#00523B"
SOLID = "0.82"
DPI = 110


def canvas(width: float = 6.0, height: float = 3.6) -> tuple[Figure, Axes]:
    """Return a figure with axes of equal scale and without frame."""
    figure = Figure(figsize=(width, height), layout="constrained")
    ax = figure.subplots()
    ax.set_aspect("equal")
    ax.axis("off")
    return figure, ax


def arrow(ax: Axes, start: np.ndarray, end: np.ndarray, colour: str = "black", style: str = "-|>") -> None:
    """Draw an arrow between two points, within the limits of the axes."""
    ax.plot(*np.array([start, end]).T, alpha=0.0)
    look = {"arrowstyle": style, "color": colour, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", xy=tuple(end), xytext=tuple(start), arrowprops=look)


def angle_mark(ax: Axes, corner: np.ndarray, size: float, start: float, end: float, text: str) -> None:
    """Draw an arc between two directions, with a letter."""
    t = np.linspace(start, end, 60)
    ax.plot(corner[0] + size * np.cos(t), corner[1] + size * np.sin(t), color=GREY, linewidth=1)
    middle = 0.5 * (start + end)
    ax.text(corner[0] + 1.45 * size * math.cos(middle), corner[1] + 1.45 * size * math.sin(middle), text,
            ha="center", va="center")  # fmt: skip


def solid_wall(ax: Axes, wall: geo.Wall, cells: range, floor: float, scale: float = 1.0, level: float = 0.0) -> None:
    """Draw the cells of a wall, enlarged by ``scale``, with its tops at ``level``."""
    line = scale * wall.outline(1e-4 * wall.period)[:-1]
    x = np.concatenate(
        [line[:, 0] + k * scale * wall.period for k in cells] + [[(cells[-1] + 1) * scale * wall.period]]
    )
    y = np.concatenate([np.tile(line[:, 1], len(cells)), line[:1, 1]]) + level
    ax.fill_between(x, y, floor, color=SOLID, linewidth=0, zorder=2)
    ax.plot(x, y, color="black", linewidth=1.1, zorder=2.5)


def asperities_on_two_bodies() -> Figure:
    """Two rough bodies before a collision, with the asperities of both enlarged where they meet (section 1.1.2)."""
    figure = Figure(figsize=(8, 3.6), layout="constrained")
    whole, near = figure.subplots(1, 2, width_ratios=[1.2, 1])
    angle = np.linspace(0, 2 * np.pi, 6001)
    for ax in (whole, near):
        for centre, radius, colour, teeth in (((-1.04, 0.0), 1.0, GREEN, 90), ((0.86, 0.0), 0.8, DARK_GREEN, 64)):
            wave = np.abs((angle * teeth / (2 * np.pi)) % 1.0 - 0.5)
            r = radius * (1.0 - 0.06 * wave * 2.0 * np.pi / teeth * 10.0)
            x, y = centre[0] + r * np.cos(angle), centre[1] + r * np.sin(angle)
            ax.fill(x, y, color=colour, alpha=0.25, linewidth=0)
            ax.plot(x, y, color=colour, linewidth=1)
        ax.set_aspect("equal")
        ax.set_xticks([])
        ax.set_yticks([])
    arrow(whole, np.array([-1.04, 0.0]), np.array([-0.4, 0.12]), GREEN)
    arrow(whole, np.array([0.86, 0.0]), np.array([0.4, -0.08]), DARK_GREEN)
    near.set_xlim(-0.2, 0.2)
    near.set_ylim(-0.2, 0.2)
    whole.indicate_inset_zoom(near, edgecolor="black")
    return figure


def reflection_by_a_wall() -> Figure:
    """A ray enters the wall at x with the angle θ and leaves it at x' with the angle θ' (section 1.2.2)."""
    figure = Figure(figsize=(6.5, 3.8), layout="constrained")
    ax = figure.subplots()
    wall = geo.Wall.from_vertices([(0, 0), (0.15, -0.35), (0.4, -0.1), (0.62, -0.45), (0.85, -0.25), (1, 0)])
    entry, theta = 0.58, 0.9
    ray = geo.trace(wall, entry, theta)
    geo.draw_wall(wall, entry, theta, ax=ax)
    for x, angle, text in ((entry, theta, "θ"), (float(ray.x), float(ray.theta), "θ'")):
        angle_mark(ax, np.array([x, 0.0]), 0.08, 0.0, angle, text)
    ax.text(entry - 0.03, 0.02, "x", ha="right")
    ax.text(float(ray.x) - 0.04, 0.02, "x'", ha="right")
    return figure


def liouville_coordinates() -> Figure:
    """The coordinates (x, t, θ) of a ray above the wall: its area element is sin θ dx dt (section 1.2.2)."""
    figure, ax = canvas()
    theta = 0.95
    along = np.array([math.cos(theta), math.sin(theta)])
    t, dt, dx = 1.1, 0.25, 0.35
    ax.plot([-0.4, 2.2], [0, 0], color="black", linewidth=1.2)
    corners = np.array([along * t, along * (t + dt), along * (t + dt) + [dx, 0], along * t + [dx, 0]])
    ax.fill(corners[:, 0], corners[:, 1], color=BLUE, alpha=0.35)
    for x in (0.0, dx):
        ax.plot([x, x + 1.5 * along[0]], [0, 1.5 * along[1]], color=BLUE, linewidth=1)
    angle_mark(ax, np.zeros(2), 0.28, 0.0, theta, "θ")
    arrow(ax, np.array([0.0, -0.12]), np.array([dx, -0.12]), style="<|-|>")
    ax.text(0.5 * dx, -0.22, "dx", ha="center", va="center")
    ax.text(*(0.5 * t * along + [-0.12, 0.06]), "t", ha="center")
    ax.text(*((t + 0.5 * dt) * along + [-0.12, 0.04]), "dt", ha="center")
    ax.plot([1.7, 1.7], [0, t * along[1]], color=GREY, linestyle=":")
    ax.text(1.74, 0.5 * t * along[1], "y = t sin θ", va="center")
    return figure


def outcomes_of_rectangular_teeth() -> Figure:
    """Rays on rectangular teeth: specular ones in blue, retroreflected ones in orange (section 1.2.3)."""
    figure, ax = canvas(7.0, 3.6)
    wall, theta = geo.rectangular_teeth(0.8), 1.1
    solid_wall(ax, wall, range(-1, 2), -0.95)
    for x in np.linspace(0.03, 0.97, 16):
        ray, points = geo.trace(wall, x, theta), geo.trajectory(wall, x, theta)
        colour = RED if abs(float(ray.theta) - theta) < 1e-9 else BLUE
        incoming = points[0] + 0.45 * np.array([math.cos(theta), math.sin(theta)])
        outgoing = points[-1] + 0.45 * np.array([math.cos(float(ray.theta)), math.sin(float(ray.theta))])
        path = np.vstack([incoming, points, outgoing])
        ax.plot(path[:, 0], path[:, 1], color=colour, linewidth=0.9)
    for colour, text in ((BLUE, "specular"), (RED, "retroreflected")):
        ax.plot([], [], color=colour, label=text)
    ax.legend(loc="lower right", frameon=False)
    chances, _ = ker.RectangularTeethLaw(0.8).branches(theta)
    ax.set_xlim(-0.6, 1.6)
    ax.set_title(f"θ = {theta}: probabilities " + " and ".join(f"{p:.3f}" for p in sorted(np.ravel(chances))))
    return figure


def unfolded_crevice() -> Figure:
    """The unfolded crevice between rectangular teeth; bands of rays by their number of side hits (section 2.2.1)."""
    figure, ax = canvas(8.0, 4.4)
    depth, theta = 1.2, 0.95
    notch = geo.Wall.from_vertices([(0, 0), (0, -depth), (1, -depth), (1, 0)])
    shift = 2.0 * depth / math.tan(theta)
    last = math.ceil(shift) + 1
    for k in range(-last + 1, 2):
        ax.plot([k, k], [0, -2 * depth], color="black", linewidth=1.2)
    ax.plot([1 - last, 1], [-depth, -depth], color=GREY, linestyle="--", linewidth=1)
    ax.plot([0, 1], [0, 0], color=GREY, linestyle=":", linewidth=1)
    ax.text(1.08, 0.0, "opening", va="center")
    ax.plot([1 - last, 1], [-2 * depth, -2 * depth], color=GREY, linestyle=":", linewidth=1)
    split = shift % 1.0
    for low, high in ((0.0, split), (split, 1.0)):
        hits = math.floor(shift - low) + 1 if low < split else math.floor(shift)
        outcome, colour = ("specular", BLUE) if hits % 2 == 0 else ("retroreflected", RED)
        ax.fill([low, high, high - shift, low - shift], [0, 0, -2 * depth, -2 * depth], color=colour, alpha=0.25)
        # the middle of the band would meet a corner of the bottom
        middle = 0.4 * low + 0.6 * high
        traced = int(geo.trace(notch, middle, theta).collisions) - 1
        assert traced == hits
        ax.plot([middle, middle - shift], [0, -2 * depth], color=colour, linewidth=1.2)
        ax.text(middle, 0.08, f"{hits}", color=colour, ha="center", va="bottom")
        side = "right" if low < split else "left"
        ends = f"{hits} side{'s' * (hits > 1)}:\n{outcome}"
        ax.text(0.5 * (low + high) - shift + (0.05 if side == "left" else 0.0), -2 * depth - 0.1, ends, color=colour,
                ha=side, va="top")  # fmt: skip
    ax.text(1.08, -depth, "bottom", va="center")
    return figure


def unfolded_teeth() -> Figure:
    """The unfolding between two triangular teeth: a straight ray crosses a fan of triangles (section 2.2.2)."""
    figure, ax = canvas(6.5, 4.8)
    psi, theta, entry = 0.5, 0.75, 0.4
    wall = geo.triangular_teeth(psi)
    apex = np.array([0.5, -wall.depth])
    hits = int(geo.trace(wall, entry, theta).collisions)
    ends = [np.array([0.0, 0.0]), np.array([1.0, 0.0])]

    def turned(point: np.ndarray, k: int) -> np.ndarray:
        c, s = math.cos(k * psi), math.sin(k * psi)
        return apex + np.array([[c, -s], [s, c]]) @ (point - apex)

    sides = range(hits + 1)
    for k in sides:
        a, b = turned(ends[0], k), turned(ends[1], k)
        ax.fill(*np.array([apex, a, b]).T, facecolor=GREY, alpha=0.12 if k else 0.3)
        ax.plot(*np.array([apex, a]).T, color="black", linewidth=1)
        ax.plot(*np.array([apex, b]).T, color="black", linewidth=1)
        ax.plot(*np.array([a, b]).T, color=GREY, linestyle="--", linewidth=1)
        middle = 0.5 * (a + b)
        ax.text(*(middle + 0.12 * (middle - apex)), str(k), ha="center", va="center")
    along = -np.array([math.cos(theta), math.sin(theta)])
    start = np.array([entry, 0.0])
    a, b = turned(ends[0], hits), turned(ends[1], hits)
    time = np.linalg.solve(np.stack([along, a - b], axis=1), a - start)[0]
    path = np.array([start - 0.5 * along, start + (time + 0.5) * along])
    ax.plot(*path.T, color=BLUE, linewidth=1.4)
    arrow(ax, path[1] - 0.1 * along, path[1], BLUE)
    ax.set_title(f"apex angle {psi}, θ = {theta}: {hits} hits")
    return figure


def arcs_with_letters() -> Figure:
    """A focusing arc with its centre C, radius R, half angle ξ, and the positions γ of the hits (section 2.2.3)."""
    figure, ax = canvas(6.0, 4.6)
    xi, theta, entry = 1.2, 2.35, 0.06
    wall = geo.focusing_arcs(xi)
    (arc,) = wall.pieces
    centre, radius = np.array(arc.center), arc.semi_axes[0]
    solid_wall(ax, wall, range(1), -0.62)
    points = geo.trajectory(wall, entry, theta)
    ray = geo.trace(wall, entry, theta)
    directions = [np.array([math.cos(a), math.sin(a)]) for a in (theta, float(ray.theta))]
    path = np.vstack([points[0] + 0.3 * directions[0], points, points[-1] + 0.3 * directions[1]])
    ax.plot(path[:, 0], path[:, 1], color=BLUE, linewidth=1.2)
    for end in ((0.0, 0.0), (1.0, 0.0), (centre[0], centre[1] - radius)):
        ax.plot([centre[0], end[0]], [centre[1], end[1]], color=GREY, linewidth=0.9, linestyle="--")
    ax.plot(*centre, "ko", markersize=3)
    ax.text(centre[0] + 0.02, centre[1] + 0.03, "C")
    ax.text(0.5 * centre[0], 0.5 * centre[1] + 0.03, "R", ha="right", va="bottom")
    angle_mark(ax, centre, 0.14, -0.5 * math.pi, -0.5 * math.pi + xi, "ξ")
    for number, point in enumerate(points[1:-1], start=1):
        ax.plot(*point, "o", color=PURPLE, markersize=4, zorder=3)
        gamma = math.atan2(point[0] - centre[0], centre[1] - point[1])
        where = point + np.array([0.08, 0.0]) if gamma > 0.5 else point + 0.13 * (point - centre)
        place = "left" if gamma > 0.5 else "center"
        ax.text(*where, f"γ{number} = {gamma:.2f}", color=PURPLE, ha=place, va="center", zorder=3)
    ax.text(entry, 0.03, "X", ha="center")
    ax.set_xlim(-0.1, 1.35)
    return figure


def generations_of_mushrooms() -> Figure:
    """Mushrooms with stems of a third of their width, two generations: the flat tops become hollow (section 2.2.4)."""
    figure = Figure(figsize=(6.5, 3.8), layout="constrained")
    ax = figure.subplots()
    geo.draw_wall(geo.mushrooms(0.33, 0.4, 2), 0.42, 1.0, ax=ax)
    opened = [geo.MushroomGenerations(0.33, 0.4, g).opened for g in (1, 2, 10)]
    ax.set_title("open after 1, 2, 10 generations: " + ", ".join(f"{p:.3f}" for p in opened))
    return figure


def elliptical_arcs() -> Figure:
    """Elliptical arcs, and the circular arcs that they become when they are foreshortened (section 2.3.3)."""
    figure = Figure(figsize=(8, 3.4), layout="constrained")
    first, second = figure.subplots(1, 2)
    disk = geo.Disk(1.0, 0.5)
    wall = geo.elliptical_arcs(1.1, disk)
    geo.draw_wall(wall, ax=first)
    geo.draw_wall(wall.foreshorten(disk), 0.7, 1.1, ax=second)
    first.set_title("the wall of the disk")
    second.set_title(f"y divided by κ = {disk.foreshortening:.4f}")
    return figure


def disk_above_a_wall() -> Figure:
    """The whole disk with its satellites above the wall, whose tops are at the height -1 (section 1.3.1)."""
    figure, ax = canvas(5.6, 5.4)
    wall, scale, count, alpha = geo.triangular_teeth(1.2), 0.12, 16, 0.07
    solid_wall(ax, wall, range(-10, 10), -1.32, scale, -1.0)
    t = np.linspace(0, 2 * np.pi, 400)
    ax.plot(np.cos(t), np.sin(t) + 0.02, color=GREY, linestyle="--", linewidth=1)
    charts = geo.RollingCharts(2 * math.pi / count)
    # the charts measure heights from the tops
    dots = np.array([charts.satellite(np.array([0.0, 0.0, alpha]), k) for k in range(count)])
    dots[:, 1] -= 0.98
    ax.plot(*dots.T, "o", color=GREEN, markersize=5)
    ax.plot(0, 0.02, "k.", markersize=4)
    ax.plot([0, dots[0, 0]], [0.02, dots[0, 1]], color=GREEN, linewidth=1)
    ax.plot([0, 0], [0.02, -0.98], color=GREY, linewidth=1, linestyle=":")
    angle_mark(ax, np.array([0.0, 0.02]), 0.6, -0.5 * math.pi, -0.5 * math.pi + alpha, "α")
    ax.text(dots[0, 0] + 0.03, dots[0, 1] + 0.07, "S0", color=GREEN)
    ax.text(dots[1, 0] + 0.03, dots[1, 1] + 0.05, "S1", color=GREEN)
    ax.text(-0.06, 0.06, "(x₁, x₂)", ha="right")
    ax.set_xlim(-1.15, 1.15)
    return figure


def impulse_at_a_contact() -> Figure:
    """A satellite on the side of a tooth: the normal k, the lever to the centre and the angle β (section 3)."""
    figure, ax = canvas(5.4, 4.4)
    tooth = np.array([[-1.6, -1.1], [0.0, 0.0], [1.6, -1.1]])
    ax.fill(*np.vstack([tooth, [[1.6, -1.3], [-1.6, -1.3]]]).T, color=SOLID)
    ax.plot(*tooth.T, color="black")
    contact = 0.55 * tooth[2]
    edge = (tooth[2] - tooth[1]) / np.linalg.norm(tooth[2] - tooth[1])
    normal = np.array([-edge[1], edge[0]])
    lever = 1.7 * np.array([-0.12, 1.0])
    t = np.linspace(-0.5, 0.5, 50)
    radius = np.linalg.norm(lever)
    middle = contact + lever
    base = math.atan2(-lever[1], -lever[0])
    ax.plot(middle[0] + radius * np.cos(base + t), middle[1] + radius * np.sin(base + t), color=GREY, linestyle="--")
    arrow(ax, contact, contact + 0.9 * normal, PURPLE)
    arrow(ax, contact, contact + 0.97 * lever, GREEN)
    ax.plot(*contact, "o", color=GREEN, markersize=7)
    first, second = math.atan2(normal[1], normal[0]), math.atan2(lever[1], lever[0])
    angle_mark(ax, contact, 0.55, first, second, "β")
    ax.text(*(contact + 0.95 * normal + [0.06, 0]), "k", color=PURPLE)
    ax.text(*(contact + 0.75 * lever + [-0.1, 0]), "x - σ", color=GREEN, ha="right")
    ax.text(contact[0] + 0.06, contact[1] - 0.2, "σ")
    return figure


def velocity_coordinates() -> Figure:
    """The frame of velocities and the angles θ and ψ of a unit velocity w (section 1.3.6)."""
    figure = Figure(figsize=(5, 4.6), layout="constrained")
    ax = figure.add_subplot(projection="3d")
    theta, psi = np.meshgrid(np.linspace(0, np.pi, 25), np.linspace(0, np.pi, 25))
    ax.plot_wireframe(
        np.cos(theta) * np.sin(psi), np.cos(psi), np.sin(theta) * np.sin(psi), color="0.85", linewidth=0.5
    )
    disk = geo.Disk(1.0, 0.5)
    w = disk.from_angles(1.0, 0.9)
    a, up, roll = (float(disk.inner(w, row)) for row in np.asarray(disk.frame))
    ax.quiver(0, 0, 0, a, roll, up, color=BLUE, arrow_length_ratio=0.08)
    ax.text(1.05 * a, 1.05 * roll, 1.08 * up, "w", color=BLUE)
    for x, y, z, text in ((1.2, 0, 0, "χ⊥"), (0, 1.2, 0, "χ"), (0, 0, 1.2, "e₂")):
        ax.quiver(0, 0, 0, x, y, z, color="black", arrow_length_ratio=0.06, linewidth=1)
        ax.text(1.06 * x, 1.06 * y, 1.06 * z, text)
    t = np.linspace(0, 1.0, 30)
    ax.plot(0.45 * np.cos(t), 0 * t, 0.45 * np.sin(t), color=GREY)
    ax.text(0.52 * math.cos(0.5), 0, 0.52 * math.sin(0.5), "θ", color=GREY)
    t = np.linspace(0, 0.9, 30)
    side = math.cos(1.0), math.sin(1.0)
    ax.plot(0.6 * side[0] * np.sin(t), 0.6 * np.cos(t), 0.6 * side[1] * np.sin(t), color=GREY)
    ax.text(0.66 * side[0] * math.sin(0.4), 0.66 * math.cos(0.4), 0.66 * side[1] * math.sin(0.4), "ψ", color=GREY)
    ax.set_axis_off()
    ax.view_init(22, -30)
    ax.set_box_aspect((1, 1, 0.6))
    return figure


def configuration_space() -> Figure:
    """A section of the configuration space; in the coloured bands two satellites can touch the wall (section 4.1)."""
    figure = Figure(figsize=(6.5, 4.2), layout="constrained")
    spacing = 2 * math.pi / 12
    space = geo.ConfigurationSpace(geo.triangular_teeth(1.2), geo.Disk(1.0, 1.0), spacing / 14.5, spacing)
    ax = space.draw_section(-0.6, figure.subplots())
    ax.legend(loc="upper right")
    return figure


def rolling_about_a_satellite() -> Figure:
    """The disk turned about its lowest satellite, which stays where it is (section 1.3.3)."""
    figure, ax = canvas(6.0, 3.6)
    spacing = 2 * math.pi / 14
    charts = geo.RollingCharts(spacing)
    t = np.linspace(0, 2 * np.pi, 300)
    for alpha, colour in ((-0.2, "#7FCDB7"), (0.0, GREEN), (0.2, DARK_GREEN)):
        x1, x2, turn = charts.roll(np.zeros(2), alpha)
        ax.plot(x1 + np.cos(t), x2 + 1.0 + np.sin(t), color=colour, linewidth=1, linestyle="--", label=f"α = {alpha:g}")
        for k in (-1, 0, 1):
            dot = charts.satellite(np.array([x1, x2, turn]), k)
            ax.plot(*dot, "o", color=colour, markersize=5 if k else 7)
        ax.plot(x1, x2 + 1.0, ".", color=colour)
    ax.plot([-1.3, 1.3], [0, 0], color="black", linewidth=1)
    ax.text(0.0, -0.12, "S₀", ha="center")
    ax.legend(loc="upper left", frameon=False)
    ax.set_xlim(-2.1, 1.3)
    ax.set_ylim(-0.25, 1.25)
    return figure


def foreshortening() -> Figure:
    """The wall seen along the direction of rolling χ: x is compressed by (1 + m/J)^(-1/2) (section 1.3.7)."""
    figure = Figure(figsize=(8, 3.4), layout="constrained")
    disk, wall = geo.Disk(1.0, 0.5), geo.triangular_teeth(1.2)
    first, second = figure.subplots(1, 2, sharey=True)
    for ax, factor, title in ((first, 1.0, "the wall"), (second, disk.foreshortening, "along χ")):
        line = wall.outline(1e-3)
        x, y = np.concatenate([line[:-1, 0] + k for k in range(-1, 4)]), np.tile(line[:-1, 1], 5)
        ax.fill_between(factor * x, y, -1.1, color=SOLID, linewidth=0)
        ax.plot(factor * x, y, color="black", linewidth=1.1)
        arrow(ax, np.array([0.0, 0.08]), np.array([factor, 0.08]), style="<|-|>")
        ax.text(0.5 * factor, 0.14, "ε" if factor == 1.0 else f"{factor:.3f} ε", ha="center")
        ax.set_aspect("equal")
        ax.set_xlim(-0.6, 1.6)
        ax.set_ylim(-1.1, 0.35)
        ax.set_title(title)
        ax.set_axis_off()
    return figure


def two_satellites_at_a_tooth() -> Figure:
    """Two satellites beside a tooth and the isosceles triangle with the disk's centre (section 4.1, Claim 4.2.1)."""
    figure, ax = canvas(5.6, 5.0)
    rho, alpha = 0.62, 0.24
    angles = np.array([alpha, alpha - rho])
    dots = np.stack([np.sin(angles), -np.cos(angles)], axis=1)
    level = dots[:, 1].max() + 0.02
    lowest = dots[:, 1].min() - 0.06
    tooth = np.array([[-0.62, lowest], [-0.02, level], [0.5, lowest]])
    ax.fill(*tooth.T, color=SOLID)
    ax.plot(*tooth.T, color="black", linewidth=1)
    ax.axhline(level, color=GREY, linestyle=":", linewidth=1)
    t = np.linspace(-1.0, 1.0, 100)
    ax.plot(np.sin(t), -np.cos(t), color=GREY, linestyle="--", linewidth=1)
    ax.fill(*np.vstack([[0.0, 0.0], dots]).T, color=GREEN, alpha=0.12)
    ax.plot(*np.vstack([[0.0, 0.0], dots, [0.0, 0.0]]).T, color=GREEN, linewidth=1.2)
    ax.plot(*dots.T, "o", color=GREEN, markersize=7)
    angle_mark(ax, np.zeros(2), 0.25, -0.5 * math.pi + angles[1], -0.5 * math.pi + angles[0], "ρ")
    for k in range(2):
        ax.text(*(0.5 * dots[k] + [0.05 * (-1) ** k, 0.0]), "1", ha="center", color=GREEN)
    drop = 2.0 * math.sin(0.5 * rho) * math.sin(0.5 * rho - alpha)
    assert math.isclose(dots[1, 1] - dots[0, 1], drop, rel_tol=1e-12)
    ax.plot([0.62, 0.62], dots[::-1, 1], color=PURPLE)
    ax.plot([dots[0, 0], 0.65], [dots[0, 1]] * 2, color=PURPLE, linewidth=0.6)
    ax.plot([dots[1, 0], 0.65], [dots[1, 1]] * 2, color=PURPLE, linewidth=0.6)
    ax.text(0.69, dots[:, 1].mean(), "2 sin(ρ/2) sin(ρ/2 - |α|)", color=PURPLE, va="center")
    low = dots.mean(axis=0)
    ax.text(low[0], low[1] - 0.12, "2 sin(ρ/2)", color=GREEN, ha="center", va="top")
    ax.set_xlim(-0.95, 1.5)
    ax.set_ylim(lowest - 0.16, 0.1)
    return figure


def radius_of_transversality() -> Figure:
    """Bands within the radius of transversality of each flight, and the contacts of the true disk (section 5.3.4)."""
    figure = Figure(figsize=(6.0, 4.6), layout="constrained")
    ax = figure.subplots()
    disk = geo.Disk(1.0, 1.0)
    space = geo.ConfigurationSpace(geo.triangular_teeth(1.3), disk, 3e-5)
    state = [0.5 * space.scale, 0.2 * space.spacing], -disk.from_angles(1.25, 1.2)
    pair = geo.shadow(space, *state)
    pair.draw(ax)
    radii = ", ".join(f"{radius:.3f}" for radius in pair.radii)
    ax.set_title(f"radii {radii}; velocities differ by less than {pair.error:.3f}")
    return figure


def projected_segments() -> Figure:
    """The path of the contact of a true disk at two scales, and the straight segments of the limit (section 5.3)."""
    figure, ax = canvas(6.0, 4.6)
    disk, wall = geo.Disk(1.0, 1.0), geo.triangular_teeth(1.3)
    entry, velocity = 0.62, -disk.from_angles(1.25, 0.6)
    solid_wall(ax, wall, range(-1, 2), -0.75)
    for scale, colour, style in ((0.2, GREEN, "-"), (0.05, DARK_GREEN, "-"), (1e-9, BLUE, "--")):
        path = geo.collision_path(disk, wall, scale, [scale * entry, 0.0], velocity)
        charts = geo.ConfigurationSpace(wall, disk, scale).zoomed
        legs = [a + np.linspace(0, 1, 40)[:, None] * (b - a) for a, b in pairwise(path)]
        track = charts.satellite(np.vstack(legs) / scale, 0)
        ax.plot(*track.T, color=colour, linestyle=style, linewidth=1.3, label=f"ε = {scale:g}")
    ax.axhline(0.0, color=GREY, linestyle=":", linewidth=1)
    ax.legend(loc="upper left", frameon=False)
    ax.set_xlim(-0.4, 1.6)
    ax.set_ylim(-0.75, 0.4)
    return figure


# In the order of the paper's sections.
FIGURES: tuple[Callable[[], Figure], ...] = (
    asperities_on_two_bodies, reflection_by_a_wall, liouville_coordinates, outcomes_of_rectangular_teeth,
    disk_above_a_wall, rolling_about_a_satellite, velocity_coordinates, foreshortening, unfolded_crevice,
    unfolded_teeth, arcs_with_letters, generations_of_mushrooms, elliptical_arcs, impulse_at_a_contact,
    configuration_space, two_satellites_at_a_tooth, radius_of_transversality, projected_segments,
)  # fmt: skip


def page() -> str:
    """Return the page of the figures in Markdown; the pictures lie in ``generated/figures``."""
    blocks = []
    for number, figure in enumerate(FIGURES, start=1):
        caption = str(figure.__doc__).splitlines()[0]
        name = figure.__name__
        picture = f"/generated/figures/{name}.png\n:alt: {name.replace('_', ' ').capitalize()}\n"
        blocks.append(f"```{{figure}} {picture}({number}) {caption}\n```\n")
    return "\n".join(blocks)


def main(folder: Path) -> dict[str, int]:
    """Write all figures as PNG files; returns their number."""
    folder.mkdir(parents=True, exist_ok=True)
    for figure in FIGURES:
        figure().savefig(folder / f"{figure.__name__}.png", dpi=DPI)
    return {"figures": len(FIGURES)}


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "paper-figures"))
