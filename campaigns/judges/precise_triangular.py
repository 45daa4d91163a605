"""The matrix of triangular teeth on equal bins in 40 digits.

Angle and edges of bins are the doubles that the library has, taken as exact; pi is pi. So the matrix is computed where
it is used: numpy's arcsine rounds some edges differently on other processors, which changes the matrix by 1e-13. Where
rays go is the closed form of Rudzis 2022, section 2.2.2, corrected: on the left of the bottom N - 1 or N hits with the
probabilities below, on the right the mirror image. Between breakpoints, edges and the angles sent to edges every
density is a sinusoid, whose integral is its value in the middle times 2 sin(width/2).
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from itertools import pairwise

import mpmath as mp
import numpy as np

from asperity.kernels import Bins

ANGLE, BINS = 0.7, 512
DIGITS = 40
NOTHING = mp.mpf(10) ** -30


def densities(psi, middle):
    """Pairs of an isometry (sign, offset) and its density p(theta) sin(theta), valid between the breakpoints around."""
    half = psi / 2
    most, most_mirror = (max(mp.ceil(2 * angle / psi), 1) for angle in (middle, mp.pi - middle))

    def left(theta):
        return min(max(mp.sin(theta + (mp.pi - psi) / 2) / (2 * mp.sin(half)), 0), mp.sin(theta))

    def fewer_hits(theta, number):
        return max(mp.sin((number - 1) * half) * mp.sin(number * half - theta) / mp.sin(half), 0)

    def fewer(theta):
        return min(fewer_hits(theta, most), left(theta))

    def fewer_mirror(theta):
        return min(fewer_hits(mp.pi - theta, most_mirror), mp.sin(theta) - left(theta))

    def turned(number, mirror):
        even = int(number) % 2 == 0
        offset = mp.pi - number * psi if even else number * psi
        if mirror:
            offset = -offset if even else 2 * mp.pi - offset
        return 1 if even else -1, offset

    return [
        (turned(most - 1, mirror=False), fewer),
        (turned(most, mirror=False), lambda theta: left(theta) - fewer(theta)),
        (turned(most_mirror, mirror=True), lambda theta: mp.sin(theta) - left(theta) - fewer_mirror(theta)),
        (turned(most_mirror - 1, mirror=True), fewer_mirror),
    ]


def kinks_of(psi):
    """All angles at which a number of hits or a bound changes, and 0, pi/2 and pi."""
    last = int(mp.ceil((mp.pi + psi) / psi))
    around = [mp.floor(mp.pi / psi) + k + mp.mpf(1) / 2 for k in (-1, 0, 1)]
    found = [psi / 2 * k for k in range(1, last + 1)] + [k * psi - mp.pi / 2 for k in around]
    found += [(mp.pi - psi) / 2, (mp.pi + psi) / 2]
    return sorted({mp.mpf(0), mp.pi / 2, mp.pi, *(k for f in found for k in (f, mp.pi - f) if 0 < k < mp.pi)})


@mp.workdps(DIGITS)
def reference(angle=ANGLE, size=BINS):
    """W^(1/2) P W^(-1/2), each entry rounded once."""
    psi = mp.mpf(angle)
    edges = [mp.mpf(float(edge)) for edge in Bins(size).edges[:-1]] + [mp.pi]
    weight = [mp.sin((a + b) / 2) * mp.sin((b - a) / 2) for a, b in pairwise(edges)]
    flux: dict[tuple[int, int], mp.mpf] = {}
    for low, high in pairwise(kinks_of(psi)):
        for (sign, offset), density in densities(psi, (low + high) / 2):
            if density((low + high) / 2) < NOTHING:
                continue
            images = [sign * (edge - offset) for edge in edges]
            cuts = edges[bisect_right(edges, low) : bisect_left(edges, high)]
            cuts = sorted([low, high, *cuts, *(image for image in images if low < image < high)])
            for a, b in pairwise(cuts):
                middle = (a + b) / 2
                place = bisect_right(edges, middle) - 1, bisect_right(edges, sign * middle + offset) - 1
                flux[place] = flux.get(place, mp.mpf(0)) + mp.sin((b - a) / 2) * density(middle)
    assert abs(sum(flux.values()) - 1) < NOTHING
    found = np.zeros((size, size))
    for (i, j), mass in flux.items():
        found[i, j] = mass / mp.sqrt(weight[i] * weight[j])
    return found
