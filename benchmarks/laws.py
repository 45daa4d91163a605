"""Error against time of the laws that need no sampling, and what Monte Carlo does in the same time."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from tests import precise_triangular

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.bench.running.timing import least_time
from asperity.geometry.polygons.beams import beams_of
from asperity.kernels.discretisation.isometry_tables import table_matrix
from asperity.kernels.discretisation.method import Budget
from asperity.kernels.discretisation.traced import row_matrix
from asperity.kernels.walls.polygon import table_of_beams

REPEATS = 3
# <u, P u> / <u, u>, u = cos(theta): closed forms and independent quadrature, see docs/theory/closed-forms.md
TRIANGULAR_MOMENT = 0.134541971359171
ARC_MOMENT = 0.327558333378
RAYS = 2**18


@dataclass(frozen=True)
class LawTime:
    """One computation: its true and reported errors, its time, and the error of Monte Carlo after the same time."""

    what: str
    error: float
    reported: float
    seconds: float
    monte_carlo: float


def measure_laws(repeats: int = REPEATS) -> list[LawTime]:
    """All rows; the least time of the repeats counts."""
    teeth, arc = geo.triangular_teeth(0.7), geo.focusing_arcs(1.2)
    rows = [
        _moment("triangular teeth, first moment", teeth, TRIANGULAR_MOMENT, repeats),
        _precise(repeats),
        _against("triangular teeth, Legendre(64)", ker.TriangularTeethLaw(0.7), ker.Legendre(64), teeth, repeats),
        _polygon(repeats),
    ]
    rows.append(_moment("focusing arc, first moment", arc, ARC_MOMENT, repeats))
    rows += [_rows(arc, tolerance, repeats) for tolerance in (1e-6, 1e-8, 1e-10)]
    return rows


def _moment(what: str, wall: geo.Wall, exact: float, repeats: int) -> LawTime:
    """By the method that the library chooses."""
    matrix, seconds = least_time(lambda: ker.discretise(ker.WallLaw(wall), ker.Legendre(2)), repeats)
    error = abs(float(matrix.symmetric[1, 1]) - exact)
    return LawTime(what, error, matrix.error.value, seconds, _monte_carlo(wall) / seconds**0.5)


def _rows(wall: geo.Wall, tolerance: float, repeats: int) -> LawTime:
    """By adaptive rows, as if the arc had no quadrature of its own."""
    (matrix, reported, _), seconds = least_time(lambda: row_matrix(wall, ker.Legendre(2), Budget(tolerance)), repeats)
    error = abs(float(matrix[1, 1]) - ARC_MOMENT)
    what = f"focusing arc by adaptive rows, first moment to {tolerance:g}"
    return LawTime(what, error, reported, seconds, _monte_carlo(wall) / seconds**0.5)


def _precise(repeats: int) -> LawTime:
    """The closed form's matrix as an operator, against 40 digits; what it reports is a bound of the Frobenius norm."""
    bins = ker.Bins(precise_triangular.BINS)
    law = ker.TriangularTeethLaw(precise_triangular.ANGLE)
    matrix, seconds = least_time(lambda: ker.discretise(law, bins), repeats)
    error = float(np.linalg.norm(matrix.symmetric - precise_triangular.reference(), 2))
    what = f"triangular teeth, Bins({bins.size}) as an operator"
    return LawTime(what, error, matrix.error.value, seconds, float("nan"))


def _against(what: str, law: ker.Law, basis: ker.Basis, wall: geo.Wall, repeats: int) -> LawTime:
    """The closed form's matrix against the one from the beams of the same hollow."""
    matrix, seconds = least_time(lambda: ker.discretise(law, basis), repeats)
    beams, _ = table_matrix(table_of_beams(beams_of(wall.vertices)), basis)
    error = float(np.linalg.norm(matrix.symmetric - beams))
    return LawTime(what, error, matrix.error.value, seconds, float("nan"))


def _polygon(repeats: int) -> LawTime:
    """A random polygon of 16 vertices over the opening: all its beams, and the bound that they carry."""
    rng = np.random.default_rng(16)
    x = np.concatenate([[0.0], np.sort(rng.random(14)), [1.0]])
    y = np.concatenate([[0.0], -0.1 - 0.8 * rng.random(14), [0.0]])
    wall = geo.Wall.from_vertices(np.column_stack([x, y]))

    def whole() -> ker.PolygonLaw:
        law = ker.PolygonLaw(wall)
        law.branches(1.0)
        return law

    law, seconds = least_time(whole, repeats)
    return LawTime("polygon of 16 vertices, whole law", float("nan"), float(law.unresolved), seconds, float("nan"))


def _monte_carlo(wall: geo.Wall) -> float:
    """Error of the first moment by Monte Carlo times the root of the seconds it took."""
    rng = np.random.default_rng(0)
    start = time.perf_counter()
    u = 1.0 - 2.0 * rng.random(RAYS)
    traced = geo.trace(wall, rng.random(RAYS), np.arccos(-u), threads=1)
    values = 3.0 * -u * np.cos(traced.theta)
    seconds = time.perf_counter() - start
    return float(values.std() * (seconds / RAYS) ** 0.5)
