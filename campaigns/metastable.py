"""A chain of 30 wells: the same matrix solved by asperity, by scipy and, in the peers' environment, by deeptime."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import csr_array, diags_array
from scipy.sparse.linalg import eigsh

from asperity.core.tables import table
from asperity.spectral import leading_eigenvalues

WELLS, STATES = 30, (10, 333)
# Rates between the wells: three groups, which give three clusters of ten eigenvalues.
RATES = np.repeat([1e-6, 1e-9, 1e-12], [10, 10, 9])


class Solution(NamedTuple):
    """The eigenvalues found by a solver, its own statement on them, and its seconds if it measured them itself."""

    values: np.ndarray[Any, Any]
    claim: str
    seconds: float | None = None


Solver = Callable[["csr_array[Any]"], Solution]


def chain(inside: int) -> csr_array[Any]:
    """Hopping at rate 1/4 within wells of ``inside`` states, and at ``RATES`` between wells."""
    hop = np.full(WELLS * inside - 1, 0.25)
    hop[inside - 1 :: inside] = RATES
    diagonal = 1.0 - np.append(hop, 0.0) - np.append(0.0, hop)
    return csr_array(diags_array([hop, diagonal, hop], offsets=[-1, 0, 1]))


def expected_gaps(inside: int) -> np.ndarray[Any, Any]:
    """1 - lambda to first order in the rates: the gaps of the chain of wells, divided by ``inside``."""
    coarse = np.diag(np.append(RATES, 0.0) + np.append(0.0, RATES)) - np.diag(RATES, 1) - np.diag(RATES, -1)
    return np.asarray(np.sort(np.linalg.eigvalsh(coarse)) / inside)


def _row(name: str, solve: Solver, inside: int) -> str:
    """One solver on one chain; a gap 1 - lambda is wrong if its error exceeds a tenth of it and 1e-13."""
    matrix = chain(inside)
    start = time.perf_counter()
    try:
        found = solve(matrix)
    except Exception as reason:  # a peer's failure is a result
        seconds = time.perf_counter() - start
        return f"{name} | {WELLS * inside} | {seconds:.2f} | - | {type(reason).__name__}: {reason}"
    seconds = time.perf_counter() - start if found.seconds is None else found.seconds
    gaps, expected = np.sort(1.0 - np.asarray(found.values).real)[:WELLS], expected_gaps(inside)
    wrong = int(np.sum(np.abs(gaps - expected) > np.maximum(0.1 * expected, 1e-13))) + WELLS - len(gaps)
    return f"{name} | {WELLS * inside} | {seconds:.2f} | {wrong} | {found.claim}"


def _ours(matrix: csr_array[Any]) -> Solution:
    found = leading_eigenvalues(matrix, WELLS)
    return Solution(found.values, f"{'complete' if found.complete else 'not complete'}, error below {found.error:.1e}")


def metastable_table(peers: Mapping[str, Solver]) -> str:
    """Every solver on every chain, in Markdown."""
    solvers: dict[str, Solver] = {
        "asperity.leading_eigenvalues": _ours,
        "scipy eigsh, shifted": lambda matrix: Solution(eigsh(matrix.tocsc(), WELLS, sigma=1.0 + 1e-9)[0], "none"),
        **peers,
    }
    rows = (_row(name, solve, inside) for inside in STATES for name, solve in solvers.items())
    return table("solver | states | seconds | of 30 gaps wrong | what it says", rows)


if __name__ == "__main__":
    print(metastable_table({}))
