"""Make src/asperity/bench/standard_references.json: ``python -m campaigns.speed.references [PROBLEM...]``.

The benchmark's references come from this script, not from the benchmark's own runs. Polygons that resolve into beams
are exact and confirmed by a second method. Arcs use `exact_rows`, and grazing limits use closed forms. Transmissions
use Clausing's equation by another rule, or particles. All other walls are sampled by 16 independent scrambled Sobol
sequences, whose spread is the error. A scene takes about a minute of one core. Problems are patterns as for ``asperity
bench``; other problems in the file are unchanged.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Sequence
from functools import cache, partial
from itertools import pairwise

import numpy as np

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.bench.problems import DISK, correlation_of, problem_names
from asperity.bench.quantities import DIFFUSE, LAW_BASIS, LENGTH, MOMENT_BASIS, RESISTANCE_BASIS, resistance_of, wall_of
from asperity.bench.standard_set import FILE
from asperity.core.checks import Floats
from asperity.kernels.discretisation.method import Budget
from asperity.kernels.discretisation.traced import traced_matrix
from asperity.kernels.laws.law import sum_of
from campaigns.errors.transmission import TOGETHER, Case, passed
from campaigns.judges.clausing_equation import by_trapezoids

from .exact_rows import ArcRow, Atoms, crevice_row, mean_over_angles, tooth_row
from .reference_eigenvalues import reference_eigenvalue
from .reference_rays import NETS, SEED, Found, mean_and_error, sampled_sums

# Rays of the sampled references of scenes, and of random walls, for which only a moment is sampled.
RAYS, RANDOM_RAYS = 2**25, 2**23
# Particles of the reference of a transmission, two minutes.
PARTICLES = 2**26
BASES = {"law": LAW_BASIS, "moment": MOMENT_BASIS, "resistance": RESISTANCE_BASIS}
# Beams with a larger unresolved part give no reference.
RESOLVED = 1e-10
# Tolerance of the adaptive conditionals that confirm beams; if they do not reach ROWS_CONFIRM, rays confirm the beams.
ROW_TOLERANCE, MOST_ROW_RAYS, ROWS_CONFIRM = 1e-9, 2_000_000, 1e-6
ROWS = {
    "triangular-teeth": partial(tooth_row, psi=0.7),
    "rectangular-teeth": partial(crevice_row, height_to_width=2.0),
    "focusing-arc": partial(ArcRow.of, xi=1.2),
}
ROWS_BY_FORMULA = "rows by formula and Gauss-Kronrod in theta"
# Two methods for an arc's law must agree to MOST_APART. Conditionals of atoms jump between bins, and those of
# rectangular teeth have infinitely many breakpoints at grazing, so their tolerances are larger.
MOST_APART = 1e-8
ARC_TOLERANCE, TRIANGULAR_TOLERANCE, RECTANGULAR_TOLERANCE = 1e-13, 1e-8, 1e-5


Row = Callable[[float], Atoms | ArcRow]


def sampled_matrices(wall: geo.Wall, names: tuple[str, ...], rays: int) -> dict[str, Found]:
    """Matrices by sampling."""
    nets = sampled_sums(wall, {name: BASES[name] for name in names}, rays)
    source = f"{rays} rays of {NETS} scrambled Sobol sequences of their own, by their spread"
    return {name: Found(*mean_and_error(values), source) for name, values in nets.items()}


def beam_matrices(wall: geo.Wall, names: tuple[str, ...]) -> dict[str, Found] | None:
    """Matrices of a polygon whose beams resolve; adaptive conditionals must agree within their accuracy."""
    if not (wall.is_polygonal and wall.closes) or float(ker.PolygonLaw(wall).unresolved) > RESOLVED:
        return None
    found = {}
    for name in names:
        exact = ker.discretise(ker.PolygonLaw(wall), BASES[name], "exact")
        other, uncertainty, _ = traced_matrix(wall, BASES[name], Budget(ROW_TOLERANCE, segments=MOST_ROW_RAYS))
        way = "adaptive angles"
        if uncertainty > ROWS_CONFIRM:
            rays = sampled_matrices(wall, (name,), RANDOM_RAYS)[name]
            other, uncertainty, way = rays.value, 4.0 * rays.error, rays.source
        found[name] = _confirmed(exact, other, uncertainty, way)
    return found


def _confirmed(exact: ker.KernelMatrix, other: Floats, uncertainty: float, way: str) -> Found:
    """An exact matrix with its own error bound, if another method agrees; else the script ends."""
    distance = float(np.linalg.norm(exact.symmetric - other))
    if distance > uncertainty + 10.0 * exact.error.value:
        raise SystemExit(f"{exact!r} and {way} differ by {distance:.2g}, more than {uncertainty:.2g}")
    return Found(exact.symmetric, exact.error.value, f"exact; {way} agree to {max(distance, 1e-15):.0e}")


def _beside(found: Found, matrix: ker.KernelMatrix) -> Found:
    """The independent matrix, with an error of at least its distance from the library's matrix."""
    distance = float(np.linalg.norm(found.value - matrix.symmetric))
    if distance > MOST_APART:
        raise SystemExit(f"{matrix!r} and {found.source} differ by {distance:.2g}")
    return Found(found.value, max(found.error, distance), found.source)


def law_of_rows(row: Row, tolerance: float) -> Found:
    """The law in bins, from conditionals by formula of a mirror-symmetric law, by adaptive Gauss-Kronrod in theta."""
    bins = LAW_BASIS.size
    edges, half, fluxes, uncertainties = np.sort(np.arccos(np.linspace(-1.0, 1.0, bins + 1))), bins // 2, [], []
    for low, high in pairwise(edges[: half + 1]):
        flux, uncertainty = mean_over_angles(
            lambda theta: np.diff(row(theta).distribution(edges)), low, high, tolerance
        )
        fluxes.append(flux)
        uncertainties.append(uncertainty)
    law = bins * np.array([*fluxes, *(flux[::-1] for flux in reversed(fluxes))])
    # every entry of a row may have the error of this row
    error = bins * float(np.linalg.norm(uncertainties)) * (2.0 * bins) ** 0.5
    return Found(0.5 * (law + law.T), error, ROWS_BY_FORMULA)


def plane_of_rows(row: Row, tolerance: float) -> dict[str, Found]:
    """The moment and the matrix in 1, cos and sin, from conditionals by formula."""

    def outer(theta: float) -> Floats:
        mean = row(theta).mean()
        return np.outer([1.0, np.cos(theta), np.sin(theta)], [1.0, mean.real, mean.imag])

    table, uncertainty = mean_over_angles(outer, tolerance=tolerance)
    probe = np.array([0.5, 1.1, 2.0])
    plane = np.stack([np.ones(3), np.cos(probe), np.sin(probe)], axis=1)
    change = np.linalg.solve(plane, RESISTANCE_BASIS.evaluate(probe))
    size = float(np.linalg.norm(change, 2)) ** 2
    return {
        "moment": Found(np.diag([1.0, 3.0 * table[1, 1]]), 3.0 * uncertainty, ROWS_BY_FORMULA),
        "resistance": Found(change.T @ table @ change, 3.0 * size * uncertainty, ROWS_BY_FORMULA),
    }


def teeth_matrices(wall: geo.Wall, names: tuple[str, ...]) -> dict[str, Found] | None:
    """The library's closed forms for triangular and rectangular teeth, confirmed by independent conditionals."""
    law = sum_of(ker.WallLaw(wall).parts)
    if isinstance(law, ker.TriangularTeethLaw):
        row, tolerance = partial(tooth_row, psi=law.angle), TRIANGULAR_TOLERANCE
    elif isinstance(law, ker.RectangularTeethLaw):
        row, tolerance = partial(crevice_row, height_to_width=law.height_to_width), RECTANGULAR_TOLERANCE
    else:
        return None
    other = plane_of_rows(row, tolerance)
    if "law" in names:
        other["law"] = law_of_rows(row, tolerance)
    return {
        name: _confirmed(ker.discretise(law, BASES[name]), other[name].value, other[name].error, ROWS_BY_FORMULA)
        for name in names
    }


def best_matrices(wall: geo.Wall, names: tuple[str, ...], rays: int) -> dict[str, Found]:
    """Matrices by formula, by beams, or by sampling."""
    return teeth_matrices(wall, names) or beam_matrices(wall, names) or sampled_matrices(wall, names, rays)


@cache
def matrices_of(scene: str) -> dict[str, Found]:
    """All matrices of a scene that its quantities need."""
    wall = wall_of(scene)
    if scene == "focusing-arc":
        row = ROWS[scene]
        found = {"law": law_of_rows(row, ARC_TOLERANCE), **plane_of_rows(row, ARC_TOLERANCE)}
        return {name: _beside(one, ker.discretise(ker.WallLaw(wall), BASES[name])) for name, one in found.items()}
    random = scene.startswith("random")
    names = ("moment",) if random else tuple(BASES)
    return best_matrices(wall, names, RANDOM_RAYS if random else RAYS)


@cache
def collision_of(scene: str) -> Found:
    """The collision's correlation, from the moment of the foreshortened wall."""
    wall = wall_of(scene).foreshorten(DISK)
    found = best_matrices(wall, ("moment",), RAYS)["moment"]
    slope = correlation_of(1.0) - correlation_of(0.0)
    value = np.asarray(correlation_of(float(found.value[1, 1])))
    return Found(value, slope * found.error, f"{found.source}; psi by hand")


def entry_of(scene: str) -> Found:
    """<u, P u>/<u, u>."""
    found = matrices_of(scene)["moment"]
    return Found(found.value[1, 1], found.error, found.source)


def resistance_found(scene: str) -> Found:
    """The resistance from the matrix in 1, cos, sin."""
    found = matrices_of(scene)["resistance"]
    return Found(np.asarray(resistance_of(found.value)), found.error, found.source)


def distance_found(scene: str) -> Found:
    """W_1 between conditional distributions and Lambert's, averaged over angles, from formulas of the conditionals."""
    # slow if there are many breakpoints
    tolerance = 1e-11 if scene == "triangular-teeth" else 1e-7
    value, error = mean_over_angles(
        lambda theta: np.array([ROWS[scene](theta).distance_to_lambert()]), 0.0, 0.5 * np.pi, tolerance
    )
    return Found(2.0 * value[0], 2.0 * error + tolerance, ROWS_BY_FORMULA)


def eta_found(scene: str) -> Found:
    """The diffusivity from zeta by hand: flat tops and vertical ends of semicircles preserve grazing rays, corners do
    not."""
    zeta, words = {
        "focusing-arc": (0.0, "no piece at a tip is level or vertical: zeta = 0"),
        "koch": ((2.0 / 3.0) ** 4, "only the flat (2/3)^4 of the period keeps grazing flights"),
        "mixed": (0.1 - 0.3 * np.log(3.0) / 4.0, "a flat tenth, and 0.3 of a semicircle, whose zeta is -(ln 3)/4"),
    }[scene]
    return Found(np.asarray((1.0 + zeta) / (1.0 - zeta)), 0.0, words)


def transmission_found(scene: str) -> Found:
    """The integral equation of diffuse reflection by another rule, or flights with formulas of their own."""
    if scene in DIFFUSE:
        value, error = by_trapezoids(DIFFUSE[scene], LENGTH)
        return Found(np.asarray(value), error, "integral equation by the trapezoidal rule, extrapolated")
    case = Case(0, scene, ker.WallLaw(wall_of(scene)), wall_of(scene), 0.0, LENGTH)
    rng = np.random.default_rng([SEED, PARTICLES])
    value = sum(passed(case, rng) for _ in range(PARTICLES // TOGETHER)) / PARTICLES
    return Found(
        np.asarray(value), (value * (1.0 - value) / PARTICLES) ** 0.5, f"{PARTICLES} particles, by their spread"
    )


MAKERS = {
    "law": lambda scene: matrices_of(scene)["law"],
    "moment": entry_of,
    "collision": collision_of,
    "disk": collision_of,
    "lambda2": reference_eigenvalue,
    "resistance": resistance_found,
    "distance": distance_found,
    "eta": eta_found,
    "transmission": transmission_found,
}


def main(patterns: Sequence[str]) -> None:
    """Make the requested references, or all."""
    names = problem_names(patterns or ["*"])
    table = json.loads(FILE.read_text(encoding="utf-8")) if FILE.exists() else {}
    for name in names:
        scene, quantity = name.split("/")
        start = time.process_time()
        found = MAKERS[quantity](scene)
        if found is None:
            continue
        print(f"{name}: error {found.error:.2g}, {time.process_time() - start:.1f} s; {found.source}", flush=True)
        table[name] = {"value": _rounded(found), "error": float(f"{found.error:.2g}"), "source": found.source}
        lines = ",\n".join(f" {json.dumps(key)}: {json.dumps(table[key])}" for key in sorted(table))
        FILE.write_text(f"{{\n{lines}\n}}\n", encoding="utf-8")


def _rounded(found: Found) -> float | list[float]:
    """A number, or the upper triangle of a symmetric matrix, rounded to the digits that its error permits."""
    digits = 17 if found.error < 1e-12 else 12
    if found.value.ndim == 0:
        return float(f"{float(found.value):.{digits}g}")
    upper = found.value[np.triu_indices(len(found.value))]
    return [float(f"{entry:.{digits}g}") for entry in upper]


if __name__ == "__main__":
    main(sys.argv[1:])
