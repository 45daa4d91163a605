"""Reference matrices of the laws of walls: exact where there is a way, else from two that share no code."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..kernels import KernelMatrix, WallLaw, discretise
from .routes import AUTO, BEAMS, CLOSED_FORM, ROWS, adaptive_row_matrix, beam_matrix, closed_form_matrix

if TYPE_CHECKING:
    from ..geometry import Wall
    from ..kernels import Basis

# matrix, its error, where it comes from, which methods share its code
MatrixReference = tuple[KernelMatrix, float, str, tuple[str, ...]]
# Rays of the sampled reference, and the tolerances of adaptive rows.
QUICK_RAYS, RAYS = 2**19, 2**23
QUICK_TOLERANCE, TOLERANCE = 1e-2, 1e-6
QUICK_BEAMS, MANY_BEAMS = 5_000, 100_000
SEED = 1648


def matrix_references(wall: Wall, basis: Basis, quick: bool) -> list[MatrixReference]:
    """The references in a basis, the best first; no method made all of them."""
    found: list[MatrixReference] = []
    has_closed_form = WallLaw(wall).closed_form is not None
    if has_closed_form:
        matrix = closed_form_matrix(wall, basis)
        found.append((matrix, matrix.error.value, "closed form", (AUTO.name, CLOSED_FORM.name)))
    if wall.is_polygonal and wall.closes:
        beams = QUICK_BEAMS if quick else MANY_BEAMS
        matrix = beam_matrix(wall, basis, beams)
        makers = (BEAMS.name,) if has_closed_form else (BEAMS.name, AUTO.name)
        found.append((matrix, matrix.error.value, f"{beams} beams", makers))
    elif has_closed_form:
        tolerance = QUICK_TOLERANCE if quick else TOLERANCE
        matrix = adaptive_row_matrix(wall, basis, 1.0 / tolerance)
        found.append((matrix, matrix.error.value, f"adaptive rows to {tolerance:g}", (ROWS.name,)))
    if len(found) < 2:
        rays = QUICK_RAYS if quick else RAYS
        matrix = discretise(WallLaw(wall), basis, "qmc", samples=rays, rng=np.random.default_rng(SEED))
        source = f"{rays} rays of Sobol sequences of their own"
        found.append((matrix, matrix.error.value, source, ()))
    return found
