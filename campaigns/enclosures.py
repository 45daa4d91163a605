"""Enclosures of the eigenvalues of five curved walls, against a far finer run and against a second method.

``python -m campaigns.enclosures`` prints for each wall the enclosures at a coarse tolerance and whether they contain
the far finer ones. It also prints the ratio of width to error, and the eigenvalues of a matrix in Legendre polynomials,
whose moduli can only be too small.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec

from .pages import print_table

# The eigenvalue of the constants and the next two by modulus.
LISTED = 3
DEGREES, MATRIX_TOLERANCE = 24, 1e-6


@dataclass(frozen=True)
class Case:
    """A wall, and the tolerances of its enclosures."""

    name: str
    wall: geo.Wall
    coarse: float
    fine: float


def cases() -> tuple[Case, ...]:
    """Five walls: two with a closed form, three traced, the last without mirror symmetry."""
    skew = geo.Wall([geo.Bezier([(0, 0), (0.2, -0.5), (0.7, -0.3), (1, 0)])], period=1.0)
    return (
        Case("focusing arcs, 1.2", geo.focusing_arcs(1.2), 1e-5, 1e-9),
        Case("focusing arcs, 0.6", geo.focusing_arcs(0.6), 1e-5, 1e-9),
        Case("dispersing arcs, 1.0", geo.dispersing_arcs(1.0), 1e-4, 1e-8),
        Case("elliptical arcs, 1.2", geo.elliptical_arcs(1.2, geo.Disk()), 1e-4, 1e-6),
        Case("cubic Bezier, skew", skew, 1e-3, 1e-5),
    )


@dataclass(frozen=True)
class Held:
    """One enclosure, its far finer enclosure, and the eigenvalue of a matrix with its error."""

    wall: str
    coarse: spec.Enclosure
    fine: spec.Enclosure
    matrix: float
    matrix_error: float

    @property
    def is_confirmed(self) -> bool:
        """Whether the finer interval is inside, and the matrix eigenvalue exceeds it by at most its error."""
        low, high = self.coarse.low, self.coarse.high
        inside = low <= self.fine.low and self.fine.high <= high
        if self.matrix > 0.0:
            return inside and self.matrix <= high + self.matrix_error
        return inside and self.matrix >= low - self.matrix_error

    @property
    def exaggeration(self) -> float:
        """Width over the error of the coarse value, as far as the finer run resolves this error."""
        error = abs(self.coarse.value - 0.5 * (self.fine.low + self.fine.high))
        return self.coarse.width / max(error, 0.5 * self.fine.width)


def held(case: Case) -> Iterator[Held]:
    """Compare each eigenvalue off the constants."""
    law = ker.WallLaw(case.wall)
    coarse = spec.enclosures(law, LISTED, tolerance=case.coarse)
    fine = spec.enclosures(law, LISTED, tolerance=case.fine)
    matrix = ker.discretise(law, ker.Legendre(DEGREES), tolerance=MATRIX_TOLERANCE)
    values = spec.spectrum(matrix, k=LISTED).values
    for place in range(1, LISTED):
        yield Held(case.name, coarse[place], fine[place], float(values[place]), float(matrix.error))


def main() -> None:
    """Print the table."""
    print_table("wall | enclosure | label | far finer | Legendre | width / error | confirmed | s", _rows())


def _rows() -> Iterator[str]:
    for case in cases():
        start = time.process_time()
        for row in held(case):
            coarse, fine = row.coarse, row.fine
            yield (
                f"{row.wall} | [{coarse.low:.9f}, {coarse.high:.9f}] | {coarse.label} "
                f"| {0.5 * (fine.low + fine.high):.11f} +- {0.5 * fine.width:.1e} "
                f"| {row.matrix:.7f} +- {row.matrix_error:.1e} | {row.exaggeration:.0f} "
                f"| {'yes' if row.is_confirmed else '**no**'} | {time.process_time() - start:.1f}"
            )


if __name__ == "__main__":
    main()
