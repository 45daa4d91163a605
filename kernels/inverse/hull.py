"""The point of a convex hull that is nearest to a target, and how much nearer any other point could be."""

from __future__ import annotations

import numpy as np

from ...core.checks import Floats

# Weights below this fraction of the largest are rounding of the solver.
NO_WEIGHT = 1e-15
# Points tried in the place of one, those first along which the distance falls most, and the least gain of an exchange.
EXCHANGES, LEAST_GAIN = 8, 1e-3


def nearest_weights(points: Floats, target: Floats) -> Floats:
    """Weights w >= 0 of sum 1, shape (points,), with the least norm of w @ points - target; most of them are 0.

    The least ||A w|| on the simplex has the direction of the y >= 0 that minimises ||A y||^2 + (1 - sum y)^2 (Lawson
    and Hanson 1974, ch. 23), so that non-negative least squares needs no large weight for the constraint.

    Examples
    --------
    >>> corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    >>> nearest_weights(corners, np.array([0.25, 0.25])).round(14).tolist()
    [0.5, 0.25, 0.25]
    """
    from scipy.optimize import nnls

    rows = np.vstack([(points - target).T, np.ones(len(points))])
    wanted = np.zeros(len(rows))
    wanted[-1] = 1.0
    found, _ = nnls(rows, wanted, maxiter=50 * len(points))
    found[found < NO_WEIGHT * found.max()] = 0.0
    return np.asarray(found / found.sum())


def few_weights(points: Floats, target: Floats, cost: Floats, most: float) -> Floats:
    """Weights as `nearest_weights`, of points whose costs sum to at most ``most``; not the best, but a local optimum.

    Orthogonal matching pursuit, then exchanges of one point for another as long as one makes the distance smaller.
    """
    chosen: list[int] = []

    def fitted(members: list[int]) -> tuple[float, Floats]:
        weights = np.zeros(len(points))
        weights[members] = nearest_weights(points[members], target)
        return float(np.linalg.norm(weights @ points - target)), weights

    weights = np.zeros(len(points))
    for _ in range(len(points)):
        residual = weights @ points - target
        order = np.argsort(points @ residual)
        room = most - sum(cost[k] for k in chosen)
        new = next((int(k) for k in order if k not in chosen and cost[k] <= room), None)
        if new is None:
            break
        chosen.append(new)
        weights = fitted(chosen)[1]
        chosen = [k for k in chosen if weights[k] > 0.0]
        if new not in chosen:
            break
    best, weights = fitted(chosen)
    improved = True
    while improved:
        improved = False
        for index in range(len(chosen)):
            others = chosen[:index] + chosen[index + 1 :]
            without = fitted(others)[1] if others else np.zeros(len(points))
            room = most - sum(cost[k] for k in others)
            steepest = np.argsort(points @ (without @ points - target)).tolist()
            for new in [k for k in steepest if cost[k] <= room and k not in others][:EXCHANGES]:
                distance, found = fitted([*others, new])
                if distance < best * (1.0 - LEAST_GAIN):
                    best, weights, improved = distance, found, True
                    chosen = [k for k in (*others, new) if found[k] > 0.0]
                    break
            if improved:
                break
    return weights


def possible_gain(points: Floats, target: Floats, weights: Floats) -> float:
    """By how much the distance to the target could be smaller, at most, for any other weights of the same points.

    With r = w @ points - target and g = max over k of <r, w @ points - point_k>, the duality gap of the conditional
    gradient, all points of the hull lie beyond a plane at the distance ||r|| - g/||r|| from the target.

    Examples
    --------
    >>> possible_gain(np.array([[1.0, 0.0], [0.0, 1.0]]), np.zeros(2), np.array([0.5, 0.5]))
    0.0
    """
    mean = weights @ points
    residual = mean - target
    distance = float(np.linalg.norm(residual))
    gap = max(float(residual @ mean - np.min(points @ residual)), 0.0)
    return gap / distance if gap < distance * distance else distance
