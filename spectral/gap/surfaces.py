r"""The spectral gap of the law of a surface that is rough in two directions.

On a triangulated surface v' = g v, where g is a product of reflections in facets. With a random orientation the
averages smooth the radial kernel of every g that changes the angle with the normal, and what is left is multiplication
by p(r), the probability that a ray with the tangential speed r leaves with the same one: level facets,
retroreflections and turns about the normal. By this argument, which is no proof, the essential spectrum is the
essential range of p. Rays measure p. At a fixed orientation Zernike functions give an upper bound only.
"""

from __future__ import annotations

import math

import numpy as np

from ...core.checks import Floats
from ...core.estimates import student_95, with_error
from ...kernels import SurfaceLaw, Zernike, discretise
from ...kernels.matrices.matrix import KernelMatrix
from ..eigenvalues.spectra import ONE_MATRIX, Verdict
from .verdict import SpectralGap

# Degree of the Zernike functions, of which half is compared.
DEGREE = 16
# Tangential speeds at which rays are asked whether they keep it, besides some near normal incidence; rays at each.
SPEEDS, NEAR_NORMAL, RAYS = 24, (1e-6, 1e-3), 2**13
# Two tangential speeds nearer than this are the same.
SAME = 1e-9


def gap_of_surface(law: SurfaceLaw, tolerance: float, rng: np.random.Generator) -> SpectralGap:
    """The gap of one surface, with the kept tangential speeds as evidence."""
    if _in_one_plane(law):
        reason = "all normals are in one plane: every function of the velocity across it is kept"
        if law.orientation != "random" or law.surface.rms_slope == 0.0:
            return SpectralGap(0.0, 0.0, "bound", "structure of the surface", "no gap", (reason,), "specular")
    matrix = discretise(law, Zernike(DEGREE), tolerance=0.1 * tolerance, rng=rng)
    if law.orientation != "random":
        return _upper_bound(matrix)
    kept, kept_error, always = kept_speeds(law, rng)
    top, noise = _top(matrix, DEGREE)
    change = abs(top - _top(matrix, DEGREE // 2)[0])
    facts = (
        f"the Rayleigh quotient of functions of degree {DEGREE} bounds the gap from above: at most {1.0 - top:.6g} but "
        f"for noise, half the degree changes it by {change:.2g}",
        f"rays keep their tangential speed with a probability of at most {with_error(kept, kept_error)}, which by "
        "argument is the largest number in the essential spectrum",
    )
    if always:
        reason = f"all of {RAYS} rays keep their tangential speed at one such speed: by argument, 1 is in the spectrum"
        return SpectralGap(0.0, 0.0, "estimate", "rays", "no gap", (*facts, reason), "specular", self_adjoint=True)
    error = noise + change
    verdict: Verdict = "isolated" if top - error > kept + kept_error else "undecided"
    if verdict == "undecided":
        # without an isolated eigenvalue convergence may be slow
        error = noise + ONE_MATRIX * change
        if kept > top:
            top, error = kept, max(error, kept_error)
    method = f"{Zernike(DEGREE)!r}, change from half the degree + spread of the rays"
    return SpectralGap(1.0 - top, error, "estimate", method, verdict, facts, "specular").cut_at_zero()


def _in_one_plane(law: SurfaceLaw) -> bool:
    """Whether the slopes of all facets are along one line, to rounding."""
    slopes = law.surface.facet_slopes()
    return bool(np.linalg.svd(slopes.reshape(-1, 2), compute_uv=False)[-1] <= SAME * max(law.surface.rms_slope, 1.0))


def _upper_bound(matrix: KernelMatrix) -> SpectralGap:
    """Of a fixed orientation the interval from 0 to 1 minus the largest modulus of an eigenvalue of P J."""
    turned = matrix.symmetric * (-1.0) ** matrix.basis.degrees  # type: ignore[attr-defined]
    values, vectors = np.linalg.eigh(turned[1:, 1:])
    largest = int(np.argmax(np.abs(values)))
    parts = [one * (-1.0) ** matrix.basis.degrees for one in matrix.replicates]  # type: ignore[attr-defined]
    noise = _noise([one[1:, 1:] for one in parts], values, vectors, largest)
    most = min(max(1.0 - abs(float(values[largest])) + noise, 0.0), 1.0)
    reasons = (
        f"the norm of P J on functions of degree {DEGREE} bounds the gap from above, by {most:.6g}",
        "at a fixed orientation the gap of a polyhedron may be 0, and no theorem is known that decides it",
    )
    method = f"half the upper bound of {matrix.basis!r}"
    return SpectralGap(
        0.5 * most, 0.5 * most, "estimate", method, "undecided", reasons, "specular", self_adjoint=False
    )  # fmt: skip


def _top(matrix: KernelMatrix, degree: int) -> tuple[float, float]:
    """The largest eigenvalue off the constants on functions up to a degree, and the error that the rays leave in it."""
    basis, best = matrix.basis, (-np.inf, 0.0)
    assert isinstance(basis, Zernike)
    for order in range(degree + 1):
        own = np.flatnonzero((np.abs(basis.orders) == order) & (basis.degrees <= degree) & (basis.degrees > 0))
        if own.size:
            values, vectors = np.linalg.eigh(matrix.symmetric[np.ix_(own, own)])
            if values[-1] > best[0]:
                parts = [one[np.ix_(own, own)] for one in matrix.replicates]
                best = float(values[-1]), _noise(parts, values, vectors, values.size - 1)
    return best


def _noise(parts: list[Floats], values: Floats, vectors: Floats, index: int) -> float:
    """The error of an eigenvalue of the mean of several matrices: of its Rayleigh quotients, and the bias."""
    vector = vectors[:, index]
    images = np.array([part @ vector for part in parts])
    quotients = images @ vector
    half = student_95(len(parts)) * float(np.std(quotients, ddof=1)) / math.sqrt(len(parts))
    # second order in the noise, but for eigenvalues as near as this
    beside = images - values[index] * vector
    square = float(np.sum((beside - beside.mean(axis=0)) ** 2)) / (len(parts) * (len(parts) - 1))
    distance = float(np.min(np.abs(np.delete(values, index) - values[index]), initial=np.inf))
    return half + min(math.sqrt(square), square / max(distance, 1e-300))


def kept_speeds(law: SurfaceLaw, rng: np.random.Generator) -> tuple[float, float, bool]:
    """The largest probability to keep a tangential speed, its error, and whether all rays keep one of the speeds."""
    speeds = np.append(NEAR_NORMAL, np.sqrt((np.arange(SPEEDS) + 0.5) / SPEEDS))
    angle = rng.uniform(0.0, 2.0 * np.pi, (speeds.size, RAYS))
    radius = speeds[:, None]
    across = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)
    incoming = np.concatenate(
        [across, np.broadcast_to(-np.sqrt(1.0 - radius**2)[..., None], (*angle.shape, 1))], axis=-1
    )
    outgoing = law.sample(incoming, rng)
    same = np.abs(np.hypot(outgoing[..., 0], outgoing[..., 1]) - radius) < SAME
    found = same.mean(axis=1)
    largest = float(found.max())
    # of the largest of so many fractions
    wide = 3.5 * np.sqrt(max(largest * (1.0 - largest), 4.0 / RAYS) / RAYS)
    return largest, float(wide), bool(same.all(axis=1).any())
