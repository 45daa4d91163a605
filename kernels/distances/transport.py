"""Wasserstein distances between probability measures on an interval, for many pairs at once."""

from __future__ import annotations

import numpy as np

from ...core.checks import Floats, finite_number
from ...core.errors import InputError
from ...core.rounding import EPS
from ..expectations.distribution_functions import SMALLEST_STEP, Distributions

# If the ends of a piece agree to this fraction, divided by p^(4/5), two terms of the series about the middle are used.
# The divided difference would then lose more digits than the third term, 1/1920 of the fourth power, contributes.
EQUAL_ENDS = (1920.0 * EPS) ** 0.2


def wasserstein(first: Distributions, second: Distributions, order: float = 1.0) -> Floats:
    r"""The exact W_p between corresponding distributions, shape (rows,).

    W_p^p is the integral over t in (0, 1) of the p-th power of the absolute difference of the two quantile functions.
    Between neighbouring levels of the two functions this difference is linear in t, and its power is integrated in
    closed form.

    Examples
    --------
    >>> one = Distributions.of_atoms(np.array([[0.0, 1.0]]), np.array([[0.5, 0.5]]))
    >>> other = Distributions.of_atoms(np.array([[0.5]]), np.array([[1.0]]))
    >>> wasserstein(one, other, 2.0).tolist()
    [0.5]
    """
    levels = np.sort(np.concatenate((first.level, second.level), axis=1), axis=1)
    width = np.diff(levels, axis=1)
    quarter, three = levels[:, :-1] + 0.25 * width, levels[:, :-1] + 0.75 * width
    early = first.quantile(quarter) - second.quantile(quarter)
    late = first.quantile(three) - second.quantile(three)
    # steps of zero width have arbitrary quantiles
    start, end = (np.where(width > 0.0, side, 0.0) for side in (1.5 * early - 0.5 * late, 1.5 * late - 0.5 * early))
    # divided by the largest, because powers of angles underflow or overflow at high orders
    largest = np.maximum(np.abs(start), np.abs(end)).max(axis=1, initial=0.0)
    unit = np.where(largest > 0.0, largest, 1.0)[:, None]
    power = np.sum(width * _mean_power(start / unit, end / unit, order), axis=1)
    return np.asarray(largest * power ** (1.0 / order))


def absolute_area(width: Floats, start: Floats, middle: Floats, end: Floats) -> Floats:
    """The integrals of abs(f), shape (rows,), for piecewise quadratic f, from its values at ends and middles of pieces.

    All arrays have the shape (rows, pieces).

    Examples
    --------
    >>> values = (np.array([[x - 0.25]]) for x in (0.0, 0.5, 1.0))
    >>> absolute_area(np.ones((1, 1)), *values).tolist()
    [0.3125]
    """
    area = np.abs(start + 4.0 * middle + end) / 6.0
    signs = np.stack((start, middle, end))
    mixed = (signs.max(axis=0) > 0.0) & (signs.min(axis=0) < 0.0)
    if mixed.any():
        start, middle, end = signs[:, mixed]
        # f(t) = start + slope t + bend t^2 for t in (0, 1)
        slope, bend = 4.0 * middle - 3.0 * start - end, 2.0 * (start + end - 2.0 * middle)
        root = np.sqrt(np.maximum(slope * slope - 4.0 * bend * start, 0.0))
        sum_of_both = -0.5 * (slope + np.where(slope < 0.0, -root, root))
        zeros = [
            np.clip(np.divide(top, base, out=np.zeros_like(top), where=np.abs(base) > SMALLEST_STEP), 0.0, 1.0)
            for top, base in ((sum_of_both, bend), (start, sum_of_both))
        ]
        cut = np.stack((np.zeros_like(slope), np.minimum(*zeros), np.maximum(*zeros), np.ones_like(slope)))
        primitive = cut * (start + cut * (0.5 * slope + cut * bend / 3.0))
        area[mixed] = np.abs(np.diff(primitive, axis=0)).sum(axis=0)
    return np.asarray((width * area).sum(axis=1))


def _mean_power(start: Floats, end: Floats, order: float) -> Floats:
    """The mean of |f|^p for a linear function f between two values."""
    rise, middle = end - start, 0.5 * (start + end)
    flat = np.abs(rise) <= EQUAL_ENDS / order**0.8 * np.maximum(np.abs(start), np.abs(end))
    bend = order * rise / np.where(flat & (middle != 0.0), middle, np.inf)
    near = np.abs(middle) ** order * (1.0 + (1.0 - 1.0 / order) * bend**2 / 24.0)
    primitive = [np.sign(value) * np.abs(value) ** (order + 1.0) / (order + 1.0) for value in (start, end)]
    return np.where(flat, near, (primitive[1] - primitive[0]) / np.where(flat, 1.0, rise))


def power_mean(values: Floats, weights: Floats, order: float) -> Floats:
    """(sum_j w_j v_j^p)^(1/p) over the last axis, for nonnegative values and any order p.

    Examples
    --------
    >>> float(power_mean(np.array([3.0, 3.0]), np.array([0.5, 0.5]), 1e6))
    3.0
    """
    largest = np.asarray(values.max(axis=-1, initial=0.0))
    unit = np.where(largest > 0.0, largest, 1.0)
    return np.asarray(largest * ((values / unit[..., None]) ** order @ weights) ** (1.0 / order))


def wasserstein_order(order: float) -> float:
    """The checked order p of a Wasserstein distance, a finite number of at least 1."""
    power = finite_number("order", order)
    if power < 1.0:
        raise InputError(f"order: expected a number of at least 1, got {order!r}")
    return power


def grid_wasserstein(first: Floats, second: Floats, points: Floats, order: float = 1.0) -> Floats:
    """W_p between corresponding probability vectors on the same increasing points, shape ``first.shape[:-1]``.

    For p = 1 it is the integral of the absolute difference of the distribution functions, without sorting.
    """
    if order == 1.0:
        return np.asarray(np.abs(np.cumsum(first - second, axis=-1)[..., :-1]) @ np.diff(points))
    flat = [np.reshape(array, (-1, points.size)) for array in (first, second)]
    one, other = (Distributions.of_atoms(np.broadcast_to(points, array.shape), array) for array in flat)
    return wasserstein(one, other, order).reshape(first.shape[:-1])
