"""Reported errors of conditionals and matrices by quadrature over traced rays, against references.

The judge of random curved walls is a second method (`campaigns.judges.reference_rows`), of walls with an exact law this
law, and of other matrices one of ten times as many ray segments. Errors are estimates, but 99 % of them must hold.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.core.checks import Floats
from asperity.kernels.discretisation.method import Budget
from asperity.kernels.discretisation.traced import traced_matrix
from asperity.kernels.walls.conditionals import WallConditionals
from campaigns.cases.random_curved_walls import COUNT, random_curved_wall
from campaigns.engine import Campaign, Judged
from campaigns.judges.reference_rows import references

# A wall with a basis, its exact or fine matrix, the error of that matrix, and the kind of the case.
Reference = dict[str, Any]
Case = tuple[geo.Wall, ker.Basis, Floats, float, str]
TOLERANCES, SEGMENTS = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9), 8_000_000
MATRIX_TOLERANCES, MATRIX_SEGMENTS, REFERENCE_FACTOR = (1e-1, 1e-2, 1e-3, 1e-4), 2_000_000, 10
BASES = (ker.Bins(8), ker.Bins(32), ker.Legendre(8))
EXACT = (
    geo.focusing_arcs(0.5), geo.focusing_arcs(1.0), geo.focusing_arcs(1.4), geo.rectangular_teeth(0.5),
    geo.rectangular_teeth(3.0), geo.triangular_teeth(0.4), geo.triangular_teeth(0.9), geo.koch(1), geo.koch(2),
    geo.Wall.from_vertices([(0, 0), (0.2, 0), (0.2, -0.3), (0.45, -0.5), (0.7, -0.3), (0.7, 0), (0.9, 0)]),
)  # fmt: skip
# Rectangular teeth of random sizes, traced on purpose: ranges of depth over width, of width over period, and bins.
TEETH_COUNT, TEETH_DEPTHS, TEETH_WIDTHS, TEETH_BINS = 40, (0.4, 8.0), (0.2, 0.95), (8, 16, 24, 32, 48)
TEETH_TOLERANCES, TEETH_SEGMENTS = (3e-2, 1e-2, 3e-3, 1e-3), 1_000_000


def judge_curved(entry: Reference) -> Iterator[Judged]:
    """Conditional expectations and the first moment of a curved wall, which ends where the segments are used up."""
    for tolerance in TOLERANCES:
        yield from expectations(entry, tolerance)
    for tolerance in TOLERANCES:
        found = first_moment(entry, tolerance, SEGMENTS)
        yield found
        if found.claimed > tolerance:
            return


def expectations(entry: Reference, tolerance: float) -> Iterator[Judged]:
    """E[cos theta'] for some incoming angles."""
    conditionals = WallConditionals(random_curved_wall(entry["kind"]), 1, np.empty(0))
    found, _ = conditionals(np.array(entry["angles"]), tolerance)
    away = np.abs(found.mean(np.cos) - [float.fromhex(value) for value in entry["rows"]])
    for error, true, judge_error in zip(found.error, away, entry["row_errors"], strict=True):
        yield Judged(f"expectation to {tolerance:.0e}", float(error), float(true), judge_error)


def first_moment(entry: Reference, tolerance: float, segments: int) -> Judged:
    """<u, P u>/<u, u>."""
    budget = Budget(tolerance, segments=segments)
    matrix, error, _ = traced_matrix(random_curved_wall(entry["kind"]), ker.Legendre(2), budget)
    true = abs(float(matrix[1, 1]) - float.fromhex(entry["moment"]))
    return Judged(f"first moment to {tolerance:.0e}", error, true, entry["moment_error"])


def draw_matrix(number: int) -> Case:
    """Curved walls with a fine matrix, and walls with an exact law, in three bases each."""
    number, basis = number // len(BASES), BASES[number % len(BASES)]
    if number < COUNT:
        wall = random_curved_wall(number)
        return _fine(wall, basis, 1e-9, REFERENCE_FACTOR * MATRIX_SEGMENTS, f"curved, {basis!r}")
    return _exact(EXACT[number - COUNT], basis, f"exact, {basis!r}")


def draw_teeth(number: int) -> Case:
    """Rectangular teeth in bins, hollows with a channel and a level floor."""
    rng = np.random.default_rng([0, number])
    ratio, width = float(np.exp(rng.uniform(*np.log(TEETH_DEPTHS)))), float(rng.uniform(*TEETH_WIDTHS))
    left, depth = 1.0 - width, ratio * width
    wall = geo.Wall.from_vertices([(0, 0), (left, 0), (left, -depth), (1, -depth), (1, 0)])
    return _exact(wall, ker.Bins(int(rng.choice(TEETH_BINS))), "teeth")


def _exact(wall: geo.Wall, basis: ker.Basis, kind: str) -> Case:
    found = ker.discretise(ker.WallLaw(wall), basis, tolerance=1e-8)
    return wall, basis, found.symmetric, float(found.error), kind


def _fine(wall: geo.Wall, basis: ker.Basis, tolerance: float, segments: int, kind: str) -> Case:
    matrix, error, _ = traced_matrix(wall, basis, Budget(tolerance, segments=segments))
    return wall, basis, matrix, error, kind


def _judge_matrices(case: Case, tolerances: Sequence[float], segments: int) -> Iterator[Judged]:
    """Matrices to finer and finer tolerances, until the segments are used up."""
    wall, basis, truth, known, kind = case
    for tolerance in tolerances:
        matrix, error, _ = traced_matrix(wall, basis, Budget(tolerance, segments=segments))
        yield Judged(f"{kind} to {tolerance:.0e}", error, float(np.linalg.norm(matrix - truth)), known)
        if error > tolerance:
            return


CAMPAIGNS = (
    Campaign(
        "curved-walls", "Do errors of quadrature over traced rays hold?",
        lambda number: references()[number], judge_curved, COUNT, [2], level=0.99,
    ),
    Campaign(
        "traced-matrices", "Do errors of matrices over traced rays hold?", draw_matrix,
        lambda case: _judge_matrices(case, MATRIX_TOLERANCES, MATRIX_SEGMENTS),
        len(BASES) * (COUNT + len(EXACT)), [len(BASES) * COUNT], level=0.99,
    ),
    Campaign(
        "traced-teeth", "Do they hold for rectangular teeth, traced although their law is exact?", draw_teeth,
        lambda case: _judge_matrices(case, TEETH_TOLERANCES, TEETH_SEGMENTS), TEETH_COUNT, [0], level=0.99,
    ),
)  # fmt: skip
