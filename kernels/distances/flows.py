"""Bounds of W_1 between measures on the square of angles that have far more cells than plans between cells allow.

A flow of mass from cell to cell bounds the distance from above, the integral of a potential with slopes of at most 1
from below (Beckmann's and Kantorovich's problems, which have the same value).
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from ...core.checks import Floats

# Mean distance of the points of a unit square from a corner, and its diagonal: the most that mass of a cell moves on
# the way to a uniform density, and to other mass of the cell.
TO_UNIFORM, WITHIN = (math.sqrt(2.0) + math.asinh(1.0)) / 3.0, math.sqrt(2.0)
# Steps towards the best potential, how often its value is taken, and the ratio of both step lengths, of the size of a
# potential to that of a flow.
STEPS, TAKEN_EVERY, RATIO = 200, 20, 4.0
# Nodes along a side of the coarsest cells.
COARSEST = 5
# (Largest singular value of the gradients at corners, in the inverse of a cell's side)^2.
LARGEST = 32.0
CORNERS = [(i, j) for i in (0, 1) for j in (0, 1)]


def flow_cost(one: Floats, other: Floats, side: float) -> float:
    """An upper bound of W_1 between measures of which the masses of square cells are known, shape (n, n) each.

    Mass in common stays within its cell. The rest is first spread over its cell, and then flows down the gradient of
    the solution u of a discrete Poisson equation. Inside a cell each component of this flow is linear in its own
    direction, so that the mean of its length is at most that at the four corners.

    Examples
    --------
    >>> one = np.array([[0.5, 0.5], [0.0, 0.0]])
    >>> round(flow_cost(one, one[::-1], 1.0) - 2.0 * TO_UNIFORM, 12)
    1.0
    """
    from scipy.fft import dctn, idctn

    common = float(np.minimum(one, other).sum())
    difference = one - other
    wave = 2.0 - 2.0 * np.cos(np.pi / len(one) * np.arange(len(one)))
    eigenvalue = wave[:, None] + wave
    eigenvalue[0, 0] = np.inf
    u = idctn(dctn(difference) / eigenvalue)
    across, along = (np.zeros(np.add(u.shape, shape)) for shape in ((1, 0), (0, 1)))
    across[1:-1], along[:, 1:-1] = -np.diff(u, axis=0), -np.diff(u, axis=1)
    length = sum(float(np.hypot(across[i : len(u) + i], along[:, j : len(u) + j]).sum()) for i, j in CORNERS)
    return side * (0.25 * length + WITHIN * common + TO_UNIFORM * float(np.abs(difference).sum()))


def potential_value(moments: Floats, side: float) -> float:
    """A lower bound of W_1 from the difference of the moments of two measures on square cells, shape (n, 3, n, 3).

    The moments are integrals of x^k y^l, from the middles of the cells and in their sides. The potential is bilinear on
    each cell, so that its integral is known, and its slope is largest at a corner. It is found by the primal-dual
    method of Chambolle and Pock (2011), on coarse cells first, and divided by its largest slope.

    Examples
    --------
    >>> moments = np.zeros((2, 3, 2, 3))
    >>> moments[:, 0, 0, 0] = 1.0, -1.0
    >>> round(potential_value(moments, 1.0), 6)
    1.0
    """
    size = len(moments)
    load = np.zeros((size + 1, size + 1))
    for i, j in CORNERS:
        x, y = i - 0.5, j - 0.5
        # the function of a corner is (1/2 + x' x)(1/2 + y' y), with x' and y' = +-1
        part = 0.25 * moments[:, 0, :, 0] + x * moments[:, 1, :, 0] + y * moments[:, 0, :, 1]
        load[i : size + i, j : size + j] += part + 4.0 * x * y * moments[:, 1, :, 1]
    loads = [load]
    while len(loads[-1]) % 2 and len(loads[-1]) > COARSEST:
        loads.append(_halved(_halved(loads[-1]).T).T)
    size = len(loads[-1]) - 1
    best, potential, flow = 0.0, np.zeros((size + 1, size + 1)), np.zeros((2, 2, 2, size, size))
    for level, load in reversed(list(enumerate(loads))):
        value, potential, flow = _climbed(load, potential, flow)
        best = max(best, 2.0**level * value)
        # in cells of half the side slopes stay, and half of the flow passes through each
        potential, flow = 2.0 * _doubled(_doubled(potential).T).T, 0.5 * flow.repeat(2, axis=3).repeat(2, axis=4)
    return side * best


def _climbed(load: Floats, potential: Floats, flow: Floats) -> tuple[float, Floats, Floats]:
    """The largest integral of a potential of slope 1 on the way from a first one, and the last potential and flow."""
    size, norm = len(load) - 1, float(np.linalg.norm(load))
    if not norm:
        return 0.0, potential, flow
    rising, falling = LARGEST**-0.5 * RATIO / norm, LARGEST**-0.5 / RATIO * norm
    ahead, best = potential, 0.0
    for number in range(STEPS + 1):
        if number % TAKEN_EVERY == 0:
            steepest = max(float(np.hypot(*slope).max()) for _, slope in _slopes(potential))
            best = max(best, float(np.sum(load * potential)) / max(steepest, 1e-300))
        divergence = np.zeros_like(load)
        for (i, j), slope in _slopes(ahead):
            found = flow[i, j] + falling * slope
            flow[i, j] = x, y = found * np.maximum(1.0 - falling / np.maximum(np.hypot(*found), 1e-300), 0.0)
            divergence[1:, j : size + j] += x
            divergence[:-1, j : size + j] -= x
            divergence[i : size + i, 1:] += y
            divergence[i : size + i, :-1] -= y
        before, potential = potential, potential - rising * (divergence - load)
        ahead = 2.0 * potential - before
    return best, potential, flow


def _slopes(potential: Floats) -> Iterator[tuple[tuple[int, int], Floats]]:
    """The gradients at the four corners of the cells, shape (2, n, n) each."""
    x, y, size = np.diff(potential, axis=0), np.diff(potential, axis=1), len(potential) - 1
    for i, j in CORNERS:
        yield (i, j), np.stack((x[:, j : size + j], y[i : size + i]))


def _doubled(values: Floats) -> Floats:
    """Values at nodes with their means between, along the first axis."""
    found = np.repeat(values, 2, axis=0)[:-1]
    found[1::2] = 0.5 * (values[:-1] + values[1:])
    return found


def _halved(values: Floats) -> Floats:
    """The adjoint of `_doubled`."""
    found = values[::2].copy()
    found[:-1] += 0.5 * values[1::2]
    found[1:] += 0.5 * values[1::2]
    return found
