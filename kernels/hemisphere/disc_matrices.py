r"""Matrices of the laws of grooves in Zernike functions on the disc of tangential velocities.

A groove keeps the component b of the velocity along it and acts by the planar law on x = -a / sqrt(1 - b^2), with a the
component across: with x = cos(theta) in the specular frame, on L^2(dx/2) x L^2((2/pi) sqrt(1 - b^2) db), which is L^2
of the uniform measure on the disc.

No planar matrix is truncated: a polynomial of degree N in (a, b) is a sum of e_l(x) sqrt(1 - b^2)^l p(b) with l + deg p
<= N, because the products of Legendre polynomials in x and sqrt(1 - b^2)^l times the Gegenbauer polynomials in b are an
orthogonal basis of these polynomials (T. Koornwinder, 1975). Only the planar entries <e_l, P e_l'> with l, l' <= N
occur. An error E of them changes the operator by E x 1, whose compression to polynomials has a norm of at most that of
E, hence at most its Frobenius norm. Its Frobenius norm is at most sqrt(N + 1) |E|, because for each pair (l, l') the
factors of b are compressed to a space of dimension N + 1 - max(l, l').
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ..bases.legendre import Legendre
from ..bases.zernike import zernike_functions

Indices = NDArray[np.int64]


def matrix_of_grooves(planar: Floats, degrees: Indices, orders: Indices, angle: float) -> Floats:
    """<f_i, P f_j> of grooves in a direction of the plane, in the Zernike functions with these degrees and orders.

    ``planar`` is the matrix in the specular frame in Legendre(n), with n above all degrees. The rules are exact:
    products of the integrals over x with l + l' even are polynomials in b, with l + l' odd sqrt(1 - b^2) times such.
    """
    count = len(planar)
    x, weight = np.polynomial.legendre.leggauss(count)
    moments = 0.5 * weight[:, None] * Legendre(count).evaluate(np.arccos(x))
    odd = np.add.outer(np.arange(count), np.arange(count)) % 2
    node = np.pi * np.arange(1, count + 1) / (count + 1)
    chebyshev = np.cos(node), 2.0 / (count + 1) * np.sin(node) ** 2
    legendre = x, 2.0 / np.pi * np.sqrt(1.0 - x * x) * weight
    total = np.zeros((degrees.size, degrees.size))
    for part, (b, mass) in ((np.where(odd, 0.0, planar), chebyshev), (np.where(odd, planar, 0.0), legendre)):
        if part.any():
            across, along = -np.sqrt(1.0 - b * b)[:, None] * x, np.broadcast_to(b[:, None], (count, count))
            values = zernike_functions(in_the_plane(across, along, angle), degrees, orders)
            found = np.einsum("bxk,xl->bkl", values, moments, optimize=True)
            total += np.tensordot(mass[:, None, None] * found, found @ part.T, axes=([0, 2], [0, 2]))
    return total


def in_the_plane(across: Floats, along: Floats, angle: float | Floats) -> Floats:
    """The vectors (v_x, v_y), shape (..., 2), with these components across and along grooves in a direction.

    Across, along and the outward normal are right-handed: grooves along y have x across.
    """
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.stack([across * sine + along * cosine, along * sine - across * cosine], axis=-1)


def matrix_of_average(planar: Floats, degrees: Indices, orders: Indices) -> Floats:
    """The mean of `matrix_of_grooves` over all directions; with the order m, -m has to be there too.

    Turning multiplies e^(i m phi) by a number of modulus 1 that averages to 0 between different orders. Between equal
    ones the mean is that of the blocks of cosines and of sines, because grooves along x do not distinguish phi and
    pi - phi.
    """
    fixed, total = matrix_of_grooves(planar, degrees, orders, 0.0), np.zeros((degrees.size, degrees.size))
    for order in range(int(orders.max(initial=0)) + 1):
        cosines, sines = np.flatnonzero(orders == order), np.flatnonzero(orders == -order)
        block = 0.5 * (fixed[np.ix_(cosines, cosines)] + fixed[np.ix_(sines, sines)])
        total[np.ix_(cosines, cosines)] = total[np.ix_(sines, sines)] = block
    return total
