"""Gaps of dispersing bumps and eigenvalues of focusing arcs, each by a second method.

``python -m campaigns.judges.precise_gaps [log2 of the rays of a replicate]`` prints gaps in the specular convention,
from a Dirichlet form over rays that a tracer of its own follows. With z the cosine of the incoming angle and z' that of
the outgoing one, <f, (1 - P) f> is half the mean of (f(z) - f(z'))^2 over z uniform in (-1, 1) and entry points uniform
in (0, 1). Its least value over Legendre polynomials of degree 1 to L is the gap, from above, up to what the degrees
beyond L add. Nothing is shared with the library: disks in rows, a quadratic equation for each, rays from scrambled
Sobol points.

It also prints the eigenvalues that tests/spectral/test_adapted_panels.py holds the enclosures against: those of the
complete Galerkin matrix on graded panels, whose entries are integrals over the polygons of each number of hits
(kernels/discretisation/arcs.py). It shares nothing with expectations, residuals and adapted panels but the law; moduli
converge from below.
"""

from __future__ import annotations

import sys

import numba
import numpy as np
from scipy.linalg import eigh
from scipy.stats import t as student
from scipy.stats.qmc import Sobol

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec

REPLICATES = 8
DEGREES = (1, 8, 16, 32, 64, 96)
# The gap for curvature 1/3 and its 95 % half width, from 2^21 rays in each of the replicates, degrees to 96. Degrees to
# 16 give 0.03733057 from the same rays.
GAP_AT_ONE_THIRD = (0.037328248, 2.4e-7)


@numba.njit(cache=True)
def outgoing(x, z, radius):
    """z' of rays that enter at height 0, at x, with the velocity (z, -sqrt(1 - z^2)); nan if it does not leave."""
    px, py, vx, vy = x, 0.0, z, -np.sqrt(1.0 - z * z)
    last = -1
    first = True
    hits = 0
    while first or py < 0.0 or vy < 0.0:
        first = False
        if hits > 1000:
            return np.nan
        # disks are centred at (k + 1/2, -radius); the nearest front among cells in the order in which they are crossed
        cell = int(np.floor(px))
        step = 1 if vx > 0.0 else -1
        best, hit = np.inf, 0
        reached = False
        while not reached:
            for k in (cell - 1, cell, cell + 1):
                if k == last and hits > 0:
                    continue
                cx, cy = px - (k + 0.5), py + radius
                b = cx * vx + cy * vy
                c = cx * cx + cy * cy - radius * radius
                d = b * b - c
                if d > 0.0 and b < 0.0:
                    # the nearer root, without cancellation
                    time = max(c, 0.0) / (-b + np.sqrt(d))
                    if time < best:
                        best, hit = time, k
            # beyond this cell rays are later; upward ones have left at height 0
            edge = (cell + 1 if step > 0 else cell) - px
            at_edge = edge / vx if vx != 0.0 else np.inf
            leaves = -py / vy if vy > 0.0 else np.inf
            reached = best <= at_edge or leaves <= at_edge
            cell += step
        leaves = -py / vy if vy > 0.0 else np.inf
        if best >= leaves:
            return vx
        px, py = px + best * vx, py + best * vy
        nx, ny = (px - (hit + 0.5)) / radius, (py + radius) / radius
        s = vx * nx + vy * ny
        vx, vy = vx - 2.0 * s * nx, vy - 2.0 * s * ny
        last = hit
        hits += 1
    return vx


@numba.njit(cache=True)
def add_products(form, x, z, radius):
    """Add the products (e_l(z) - e_l(z')) (e_m(z) - e_m(z'))/2 of each ray."""
    degree = form.shape[0]
    difference = np.empty(degree)
    for i in range(x.size):
        w = outgoing(x[i], z[i], radius)
        p, q, pp, qq = 1.0, z[i], 1.0, w
        for n in range(1, degree + 1):
            difference[n - 1] = np.sqrt(2.0 * n + 1.0) * (q - qq)
            p, q = q, ((2 * n + 1) * z[i] * q - n * p) / (n + 1)
            pp, qq = qq, ((2 * n + 1) * w * qq - n * pp) / (n + 1)
        for n in range(degree):
            for m in range(n + 1):
                form[n, m] += 0.5 * difference[n] * difference[m]


def gaps(curvature, rays_log2=16, seed=0, degrees=DEGREES):
    """By degree: least value of the form, and its 95 % half width from the replicates."""
    largest, radius = max(degrees), 1.0 / curvature
    found = {degree: [] for degree in degrees}
    for replicate in range(REPLICATES):
        points = Sobol(2, scramble=True, rng=np.random.default_rng([seed, replicate])).random_base2(rays_log2)
        form = np.zeros((largest, largest))
        add_products(form, points[:, 0], 2.0 * points[:, 1] - 1.0, radius)
        form /= len(points)
        for degree in degrees:
            found[degree].append(eigh(form[:degree, :degree], lower=True, eigvals_only=True)[0])
    width = student.ppf(0.975, REPLICATES - 1) / np.sqrt(REPLICATES)
    return {degree: (np.mean(each), width * np.std(each, ddof=1)) for degree, each in found.items()}


def arc_eigenvalues(half_angle, degree=4, smallest=1e-3):
    """The second and third by modulus."""
    basis = ker.Panels.for_wall(geo.focusing_arcs(half_angle), degree, smallest)
    return spec.spectrum(ker.discretise(ker.CircularArcLaw(half_angle), basis), k=3).values[1:]


if __name__ == "__main__":
    for curvature in (1 / 3, 1.0):
        for degree, (value, error) in gaps(curvature, int(sys.argv[1]) if len(sys.argv) > 1 else 20).items():
            print(f"curvature {curvature:.6f}, degrees to {degree}: {value:.9f} +- {error:.1e}", flush=True)
    for half_angle in (0.6, 0.9, 1.2):
        print(half_angle, *(f"{value:.12f}" for value in arc_eigenvalues(half_angle)), flush=True)
