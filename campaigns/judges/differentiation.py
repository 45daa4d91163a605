"""Derivatives to rounding, for tests of differentials."""

import numpy as np

STEP = 1e-30


def complex_steps(formula, arguments: list[np.ndarray]) -> np.ndarray:
    """Return the matrix of derivatives of ``formula`` in its arguments, exact to rounding."""
    columns = []
    for i in range(len(arguments)):
        moved = [a + 1j * STEP if j == i else a + 0j for j, a in enumerate(arguments)]
        parts = np.broadcast_arrays(*formula(*moved))
        columns.append(np.stack([part.imag / STEP for part in parts], axis=-1))
    return np.stack(columns, axis=-1)
