"""Approximate eigenfunctions on panels that are divided where the residual is large."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import count
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...core.long_runs import progress_bar
from ...kernels import Law, Legendre, Panels
from ...kernels.bases.assembly import one_blas_thread
from ...kernels.bases.measure import SINE
from ...kernels.expectations.angle_panels import KRONROD, NODES
from ..eigenvalues.dense import Parity
from .images import expectations, is_traced

# Degree on each panel, for which Kronrod's rule is exact for products of two functions.
DEGREE = 6
# Number of the law's breakpoints that are edges of the first level, and width of its widest panel.
FIRST_BREAKPOINTS, WIDEST = 40, np.pi / 10
# Least distance of two edges, and limit on the halvings of a panel at grazing between two levels.
NARROWEST, MOST_HALVINGS = 1e-7, 12
# Largest fraction of the wanted squared residual that counts as that of the other panels.
MOST_BESIDE = 0.9
# Each level divides the worst panels, with this fraction of the squared residuals.
FRACTION = 0.9
# Limit on the levels, and limits on the panels: for traced laws down to the tolerance `FINE`, and for others.
MOST_LEVELS, TRACED_PANELS, FINE, MOST_PANELS = 12, 60, 1e-5, 200
# Trial functions beyond the wanted ones, to estimate the next eigenvalues.
EXTRA = 2
# Additional functions of one parity in the iteration.
GUARD = 12
MOST_ITERATIONS, FILTER_DEGREE, CONVERGED = 60, 6, 0.02
# Rank of eigenvalues: by modulus (np.abs) or by value (np.positive).
Rank = Callable[[Floats], Floats]
PARITIES: dict[int, Parity] = {1: "even", -1: "odd", 0: "none"}
# Error of conditional expectations as a fraction of the wanted residual.
MEAN_FRACTION = 0.03


@dataclass(frozen=True)
class TrialSpace:
    """Approximate eigenfunctions of a law, constants first, then by decreasing eigenvalue.

    Attributes
    ----------
    basis : Panels
    values : array of shape (k,)
        Approximate eigenvalues.
    vectors : array of shape (n, k)
        Coefficients in ``basis``, of unit norm.
    following_values, following : arrays of shape (2,) and (n, 2)
        Eigenvalues and coefficients of the next eigenfunctions by rank.
    parities : tuple of {"even", "odd", "none"}
        Parities of ``vectors``.
    mirrored : bool
        Whether every function is even or odd under theta -> pi - theta.
    finer : array
        Edges of the panels of another level, up to pi/2 if ``mirrored``.
    square : float
        Sum of the squared residuals of ``vectors``, at the nodes of the panels.
    """

    basis: Panels
    values: Floats
    vectors: Floats
    following_values: Floats
    following: Floats
    parities: tuple[Parity, ...]
    mirrored: bool
    finer: Floats
    square: float


def adapted_trial_space(
    law: Law, k: int, tolerance: float, rank: Rank = np.abs, start: Floats | None = None
) -> TrialSpace:
    """Trial functions for the k eigenvalues of highest rank, with Kato-Temple bounds of about the tolerance.

    The first panels have the edges ``start``, the ``finer`` ones of an earlier space.

    Notes
    -----
    On every level the functions P e_j are evaluated at the Kronrod nodes, and their inner products with e_i form a
    matrix. It is accurate for smooth functions but not symmetric, because single P e_j have breakpoints inside panels.
    Subspace iteration from smooth functions gives its leading eigenvectors. Panels with large residuals are divided.
    """
    with progress_bar(MOST_LEVELS, "level", "enclosures") as bar:
        return _adapted(law, k, tolerance, rank, start, bar)


def _adapted(law: Law, k: int, tolerance: float, rank: Rank, start: Floats | None, bar: Any) -> TrialSpace:
    """The trial functions; the bar shows their residual."""
    mirrored = bool(law.mirror_symmetric)
    edges = _first_edges(law, mirrored) if start is None else start
    most_panels = TRACED_PANELS if is_traced(law) and tolerance >= FINE else MOST_PANELS
    goal, before = float(np.sqrt(tolerance)), None
    for number in count(1):
        level = _Level(law, edges, mirrored, MEAN_FRACTION * goal)
        with one_blas_thread():
            values, vectors, parity = level.leading(k + EXTRA, CONVERGED * goal, rank)
        squares = level.squared_residuals(values, vectors, parity)
        goal = float(np.sqrt(tolerance * _room(rank(values), k)))
        joint = float(np.sqrt(squares[:, :k].sum()))
        bar.describe(f"residual {joint:.1g}, asked for {goal:.1g}")
        bar.update()
        now = _Residuals(edges, squares[:, :k].sum(axis=1))
        finer = _divided(now, before, goal, mirrored)
        if joint <= goal or number == MOST_LEVELS or len(edges) > most_panels:
            break
        edges, before = finer, now
    first = np.arange(1, k)[np.argsort(-values[1:k], kind="stable")]
    chosen = np.append(0, first)
    whole = level.extended(vectors, parity)
    return TrialSpace(
        level.panels, values[chosen], whole[:, chosen], values[k:], whole[:, k:],
        tuple(PARITIES[int(sign)] for sign in parity[chosen]), mirrored, finer, joint**2,
    )  # fmt: skip


class _Residuals(NamedTuple):
    """The edges of panels and their squared residuals."""

    edges: Floats
    squares: Floats


class _Level:
    """The law at the Kronrod nodes of panels, for a mirror-symmetric law on (0, pi/2) only.

    Coefficients refer to these panels; parity gives the coefficients on the others.
    """

    def __init__(self, law: Law, edges: Floats, mirrored: bool, mean_tolerance: float) -> None:
        whole = np.concatenate([edges, np.pi - edges[-2::-1]]) if mirrored else edges.copy()
        whole[-1] = np.pi
        self.panels, self.mirrored = Panels(whole, DEGREE), mirrored
        half = 0.5 * np.diff(edges)
        angle = (0.5 * (edges[1:] + edges[:-1]))[:, None] + half[:, None] * NODES
        self.angle, self.weight = angle, half[:, None] * SINE.density(angle) * KRONROD * (2.0 if mirrored else 1.0)
        images, _ = expectations(law, self.panels)(angle.ravel(), mean_tolerance)
        # values of each panel's functions, shape (panels, nodes, degree + 1), normalised on (0, pi) or (0, pi/2)
        self.norm = np.sqrt(0.5) if mirrored else 1.0
        self.local = self.panels.local(angle)[1] * self.norm
        self._signs = (-1.0) ** np.arange(DEGREE + 1)
        # of the functions of each parity, 0 without mirror symmetry, shape (angles, functions)
        self.images = {0: images}
        if mirrored:
            blocks = images.reshape(angle.size, -1, DEGREE + 1)
            own, other = blocks[:, : len(angle)], self._signs * blocks[:, ::-1][:, : len(angle)]
            self.images = {sign: self.norm * (own + sign * other).reshape(angle.size, -1) for sign in (1, -1)}

    def projected(self, values: Floats) -> Floats:
        """Coefficients of functions with given values at the nodes, shape (angles, k)."""
        shaped = values.reshape(*self.angle.shape, -1) * self.weight[..., None]
        return np.asarray(np.einsum("pqd,pqk->pdk", self.local, shaped).reshape(-1, values.shape[1]))

    def expanded(self, vectors: Floats) -> Floats:
        """Values at the nodes, shape (angles, k)."""
        blocks = vectors.reshape(len(self.angle), DEGREE + 1, -1)
        return np.asarray(np.einsum("pqd,pdk->pqk", self.local, blocks).reshape(self.angle.size, -1))

    def leading(self, k: int, algebraic: float, rank: Rank) -> tuple[Floats, Floats, NDArray[np.intp]]:
        """Eigenvalues of highest rank, constants first, with vectors and parities (0 without mirror symmetry)."""
        signs = list(self.images)
        found = [self._leading_of(parity, k, algebraic, rank) for parity in signs]
        values = np.concatenate([part[0] for part in found])
        vectors = np.concatenate([part[1] for part in found], axis=1)
        parity = np.concatenate([np.full(len(part[0]), sign) for part, sign in zip(found, signs, strict=True)])
        order = np.argsort(-rank(values), kind="stable")
        # the constants are the first vector of the first part, regardless of rounding
        order = np.append(0, order[order != 0])[:k]
        return values[order], vectors[:, order], parity[order]

    def _leading_of(self, parity: int, k: int, algebraic: float, rank: Rank) -> tuple[Floats, Floats]:
        matrix = self.projected(self.images[parity])
        start = Legendre(2 * (k + GUARD) if self.mirrored else k + GUARD).evaluate(self.angle.ravel())
        start = start[:, (0 if parity >= 0 else 1) :: 2] if self.mirrored else start
        block = np.linalg.qr(self.projected(start))[0]
        constant = block[:, :1].copy()
        wanted = slice(0, k)
        for _ in range(MOST_ITERATIONS):
            image = matrix @ block
            values, turn = _ritz(block.T @ image, rank)
            vectors = block @ turn
            rest = (image @ turn - vectors * values)[:, wanted]
            if float(np.abs(rest).max()) <= 0.1 * algebraic and float(np.linalg.norm(rest)) <= algebraic:
                break
            # Chebyshev's polynomial grows fast beyond the least modulus that the block reaches
            least = float(np.abs(values).min())
            before, now = block, image / least
            for _ in range(FILTER_DEGREE - 1):
                before, now = now, (2.0 / least) * (matrix @ now) - before
            block = np.linalg.qr(now)[0]
        vectors = vectors / np.linalg.norm(vectors, axis=0)
        if parity >= 0:
            nearest = int(np.argmax(np.abs(constant.T @ vectors)))
            order = np.append(nearest, np.delete(np.arange(len(values)), nearest))
            values, vectors = values[order], vectors[:, order]
            values[0], vectors[:, 0] = 1.0, constant[:, 0]
        return values[wanted], vectors[:, wanted]

    def squared_residuals(self, values: Floats, vectors: Floats, parity: NDArray[np.intp]) -> Floats:
        """The contribution of every panel to the squared residuals, shape (panels, k)."""
        rest = np.empty((self.angle.size, len(values)))
        for sign in np.unique(parity):
            own = parity == sign
            rest[:, own] = self.images[int(sign)] @ vectors[:, own] - self.expanded(vectors[:, own]) * values[own]
        squares = (rest**2).reshape(*self.angle.shape, -1)
        return np.asarray(np.einsum("pq,pqk->pk", self.weight, squares))

    def extended(self, vectors: Floats, parity: NDArray[np.intp]) -> Floats:
        """Coefficients on all panels."""
        if not self.mirrored:
            return vectors
        blocks = self.norm * vectors.reshape(len(self.angle), DEGREE + 1, -1)
        other = blocks[::-1] * self._signs[:, None] * parity
        return np.concatenate([blocks, other]).reshape(-1, vectors.shape[1])


def _ritz(projected: Floats, rank: Rank) -> tuple[Floats, Floats]:
    """Eigenvalues, by decreasing rank, and eigenvectors of a nearly symmetric matrix."""
    values, vectors = np.linalg.eig(projected)
    if np.iscomplexobj(values) and np.any(values.imag != 0.0):
        values, vectors = np.linalg.eigh(0.5 * (projected + projected.T))
    values, vectors = np.real(values), np.real(vectors)
    order = np.argsort(-rank(values), kind="stable")
    return values[order], vectors[:, order]


def _room(ranks: Floats, k: int) -> float:
    """Distance of the last wanted rank from the next, at least a hundredth of it."""
    return float(max(ranks[k - 1] - ranks[k], 0.01 * abs(ranks[k - 1]))) if len(ranks) > k else 1.0


def _first_edges(law: Law, mirrored: bool) -> Floats:
    """Edges from 0 to pi or pi/2: known breakpoints of the law, and panels between them not wider than `WIDEST`."""
    end = 0.5 * np.pi if mirrored else np.pi
    points, left_out = law.breakpoints(FIRST_BREAKPOINTS)
    used = (points > NARROWEST) & (points < end - NARROWEST) & math.isfinite(left_out)
    marks = np.append(points[used], [0.0, end])
    marks = np.unique(marks)
    marks = marks[np.append(np.diff(marks) > NARROWEST, True)]
    parts = np.ceil(np.diff(marks) / WIDEST).astype(int)
    pieces = [low + (high - low) * np.arange(n) / n for low, high, n in zip(marks, marks[1:], parts, strict=False)]
    return np.append(np.concatenate(pieces), end)


def _divided(now: _Residuals, before: _Residuals | None, goal: float, mirrored: bool) -> Floats:
    """More edges: the middles of the panels with the largest residuals, and at grazing angles nearer to the end."""
    edges, squares = now
    width, order = np.diff(edges), np.argsort(-squares)
    enough = int(np.searchsorted(np.cumsum(squares[order]), FRACTION * squares.sum())) + 1
    chosen = order[:enough]
    chosen = chosen[width[chosen] > 2.0 * NARROWEST]
    parts = [edges, 0.5 * (edges[chosen] + edges[chosen + 1])]
    for panel, inward in ((0, 1.0),) if mirrored else ((0, 1.0), (-1, -1.0)):
        if before is not None and panel % len(squares) in chosen:
            distance = width[panel] * 0.5 ** np.arange(2, 1 + _halvings(now, before, panel, goal))
            parts.append(edges[panel] + inward * distance[distance > NARROWEST])
    return np.unique(np.concatenate(parts))


def _halvings(now: _Residuals, before: _Residuals, panel: int, goal: float) -> int:
    """How often to halve the panel at grazing, so that with its residual the joint one is about the goal.

    Its squared residual is taken as a power of its width, whose exponent the level before tells.
    """
    width, width_before = (float(np.diff(level.edges)[panel]) for level in (now, before))
    square, square_before = (float(level.squares[panel]) for level in (now, before))
    allowed = goal**2 - min(float(now.squares.sum()) - square, MOST_BESIDE * goal**2)
    if not (width < width_before and allowed < square < square_before):
        return 1
    exponent = math.log(square_before / square) / math.log(width_before / width)
    return min(math.ceil(math.log2(square / allowed) / exponent), MOST_HALVINGS)
