"""Random polygonal hollows for tests: graphs, star-shaped cavities and plates of no thickness."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Chain = NDArray[np.float64]


def graph_hollow(vertices: int, rng: np.random.Generator) -> Chain:
    """A chain from (0, 0) to (1, 0) whose x increases."""
    x = np.sort(rng.uniform(0.02, 0.98, vertices - 2))
    y = -rng.uniform(0.05, 1.0, vertices - 2)
    return np.vstack([[0.0, 0.0], np.column_stack([x, y]), [1.0, 0.0]])


def star_hollow(vertices: int, rng: np.random.Generator) -> Chain:
    """A chain from (0, 0) to (1, 0) around a point below the opening, with overhangs wherever it is wide."""
    center = np.array([0.5, -0.4])
    first, last = np.arctan2(0.4, -0.5), np.arctan2(0.4, 0.5) + 2.0 * np.pi
    angle = np.sort(rng.uniform(first + 0.05, last - 0.05, vertices - 2))
    radius = rng.uniform(0.2, 1.2, vertices - 2)
    # no vertex rises above the opening
    up = np.sin(angle) > 0.0
    radius[up] = np.minimum(radius[up], 0.36 / np.sin(angle[up]))
    inner = center + radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    return np.vstack([[0.0, 0.0], inner, [1.0, 0.0]])


def random_hollow(seed: int) -> Chain:
    """Hollow number ``seed``: 3 to 16 vertices, even numbers graphs, odd numbers star-shaped."""
    rng = np.random.default_rng([seed, 2027])
    vertices = int(rng.integers(3, 17))
    return (star_hollow if seed % 2 else graph_hollow)(vertices, rng)


def wall_with(hollow: Chain) -> Chain:
    """Vertices of a wall of period 3 with the hollow between x = 1 and x = 2, below flat tops."""
    return np.vstack([[0.0, 0.0], hollow + np.array([1.0, 0.0]), [3.0, 0.0]])
