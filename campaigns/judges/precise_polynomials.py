"""Coefficients of the polynomials in `tracing/compiled/trigonometry`, from 60 digits: run as a script, it prints them.

Each polynomial interpolates its function at Chebyshev nodes, which is within a small factor of the best approximation.
"""

from __future__ import annotations

from collections.abc import Callable

import mpmath as mp

DIGITS = 60


def sine_rest(u: mp.mpf) -> mp.mpf:
    """(sin z - z) / z^3 of u = z^2."""
    return (mp.sin(mp.sqrt(u)) / mp.sqrt(u) - 1) / u


def cosine_rest(u: mp.mpf) -> mp.mpf:
    """(cos z - 1 + z^2 / 2) / z^4 of u = z^2."""
    return (mp.cos(mp.sqrt(u)) - 1 + u / 2) / u**2


def arcsine_rest(u: mp.mpf) -> mp.mpf:
    """(arcsin z - z) / z^3 of u = z^2."""
    return (mp.asin(mp.sqrt(u)) / mp.sqrt(u) - 1) / u


# Name in `trigonometry`, function, end of its interval in u a little widened, number of coefficients.
POLYNOMIALS: dict[str, tuple[Callable[[mp.mpf], mp.mpf], float, int]] = {
    "SINE": (sine_rest, 0.617, 6),
    "COSINE": (cosine_rest, 0.617, 6),
    "ARCSINE": (arcsine_rest, 0.5001, 18),
}


def coefficients(name: str) -> tuple[float, ...]:
    """Coefficients of one polynomial in u, the constant first, rounded to double."""
    function, end, count = POLYNOMIALS[name]
    with mp.workdps(DIGITS):
        nodes = [mp.mpf(end) * (1 + mp.cos(mp.pi * (2 * k + 1) / (2 * count))) / 2 for k in range(count)]
        powers = mp.matrix([[node**j for j in range(count)] for node in nodes])
        return tuple(float(c) for c in mp.lu_solve(powers, mp.matrix([function(node) for node in nodes])))


if __name__ == "__main__":
    for name in POLYNOMIALS:
        print(f"{name} = (")
        for value in coefficients(name):
            print(f"    {value!r},")
        print(")")
