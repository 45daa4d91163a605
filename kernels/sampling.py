"""Matrices of laws by sampling rays: plain Monte Carlo and randomised quasi-Monte Carlo."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..checks import Floats
from ..errors import AccuracyError, InputError
from .basis import Basis
from .branch_quadrature import largest_square_sum
from .counting import SampledArray, array_from_counts, array_from_sums, count_pairs, sum_products
from .involution import InvolutionLaw
from .law import BranchLaw, DrivenLaw, Law
from .measure import SINE
from .reflection import is_mirror_symmetric, reflection_matrix
from .specular_frame import SpecularFrame
from .stable_angles import flipped, kept_inside
from .wall_law import LOST_TOLERANCE

SamplingMethod = Literal["qmc", "monte-carlo"]
# Outgoing angles and, for traced rays, which of them escaped.
Response: TypeAlias = tuple[Floats, "NDArray[np.bool_] | None"]

# About a second of traced rays.
DEFAULT_SAMPLES = 2**20
# Independent randomisations: the spread of eight gives an error within a quarter.
RANDOMISATIONS = 8
# Rays at a time, and more where adding up the matrix of counts would take longer than the rays themselves; a power of
# two, which keeps the balance of Sobol points.
SMALLEST_CHUNK = 2**16
# Digits of the nets: scrambling them takes a time like their number squared. What lies beyond is one random shift of
# all points, so that none falls on a corner at a dyadic place but by chance.
SOBOL_BITS = 32
SLOW_SECONDS = 2.0


def sampled_array(
    law: Law, basis: Basis, method: SamplingMethod, samples: int, rng: np.random.Generator, symmetrise: bool
) -> tuple[SampledArray, int, float]:
    """The matrix of a law from rays with incoming angles from the invariant measure.

    Rays come in chunks. A chunk's rays depend on a number drawn from ``rng``, the randomisation and the chunk's own
    index alone, and chunks are added as integers (as floats in a fixed order for bases without cells).
    Nets of a mirror-symmetric law have theta < pi/2, in a basis with that symmetry: every ray counts with its mirror
    image, and the net is twice as dense.

    Returns
    -------
    array : SampledArray
    samples : int
        Rays used: for ``"qmc"`` rounded up to 8 times a power of two.
    lost : float
        Share of rays that did not escape; they were sent back, and twice their share times sup |e|^2 is in the error.
    """
    respond = responder(law) if method == "qmc" else None
    if method == "qmc" and respond is None:
        raise InputError(f"method: {law!r} is not driven by a uniform number, so it has no 'qmc'; use 'monte-carlo'")
    root = [int(word) for word in rng.integers(0, 2**63, size=2)]
    independent = method == "monte-carlo" and basis.is_partition
    randomisations = 1 if independent else RANDOMISATIONS
    each = max(-(-samples // randomisations), 1)
    if method == "qmc":
        each = 1 << (each - 1).bit_length()
    halved = method == "qmc" and law.mirror_symmetric is True and is_mirror_symmetric(basis)
    parts: list[Any] = []
    add: Callable[[Basis, Floats, Floats], Any] = count_pairs if basis.is_partition else sum_products
    chunk = max(SMALLEST_CHUNK, 1 << (basis.size**2 // 16).bit_length()) if basis.is_partition else SMALLEST_CHUNK
    lost = 0
    with _progress(randomisations * each) as bar:
        for randomisation in range(randomisations):
            total = np.zeros((basis.size, basis.size), dtype=np.int64 if basis.is_partition else np.float64)
            for incoming, outgoing, escaped in _rays(law, respond, each, chunk, [*root, randomisation], halved):
                total += add(basis, incoming, outgoing)
                lost += 0 if escaped is None else int(escaped.size - np.count_nonzero(escaped))
                bar.update(incoming.size)
            parts.append(total + _mirrored(basis, total) if halved else total)
    used = randomisations * each
    share = lost / used
    if share > LOST_TOLERANCE:
        raise AccuracyError(
            f"{law!r}: {share:.2g} of {used} rays did not escape, more than {LOST_TOLERANCE:g}; geometry.trace(wall, "
            "x, theta).counts() says how they ended",
            share,
        )
    if basis.is_partition:
        array = array_from_counts(parts, basis, symmetrise=symmetrise, independent=independent)
    else:
        means = [part / (2 * each if halved else each) for part in parts]
        array = array_from_sums(means, basis, symmetrise=symmetrise, keeps_measure=bool(law.reversible))
    if share > 0.0:
        extra = 2.0 * share * largest_square_sum(basis)
        array = SampledArray(array.symmetric, array.error + extra, array.replicates, array.raw_defect, array.counts)
    return array, used, share


def responder(law: Law) -> Callable[[Floats, Floats], Response] | None:
    """The law as a function of a uniform number and the incoming angle; None for laws that need more randomness."""
    if isinstance(law, SpecularFrame):
        inner = responder(law.law)
        if inner is None:
            return None

        def turned(x: Floats, theta: Floats) -> Response:
            outgoing, escaped = inner(x, theta)
            return flipped(outgoing), escaped

        return turned
    outcomes = getattr(law, "outcomes", None)
    if outcomes is not None:
        return lambda x, theta: outcomes(x, theta)
    if isinstance(law, DrivenLaw):
        return lambda x, theta: (law.respond(x, theta), None)
    if isinstance(law, InvolutionLaw):
        return lambda x, theta: (np.asarray(law.map(theta), dtype=np.float64), None)
    if isinstance(law, BranchLaw):
        return lambda x, theta: (_branch_taken(law, x, theta), None)
    return None


def _branch_taken(law: BranchLaw, x: Floats, theta: Floats) -> Floats:
    probability, outgoing = law.branches(theta)
    cumulative = np.cumsum(probability, axis=-1)
    choice = np.argmax(x[..., None] * cumulative[..., -1:] < cumulative, axis=-1)
    return np.asarray(np.take_along_axis(outgoing, choice[..., None], axis=-1)[..., 0])


def _rays(
    law: Law,
    respond: Callable[[Floats, Floats], Response] | None,
    number: int,
    chunk: int,
    key: list[int],
    halved: bool,
) -> Iterator[tuple[Floats, Floats, NDArray[np.bool_] | None]]:
    """Incoming angles, outgoing angles and escapes, chunk by chunk; of nets only the half below pi/2 if ``halved``."""
    smallest, largest = np.finfo(np.float64).tiny, np.nextafter(1.0, 0.0)
    if respond is not None:
        from scipy.stats.qmc import Sobol

        source = np.random.default_rng(key)
        engine = Sobol(2, scramble=True, bits=SOBOL_BITS, rng=source)
        beyond = source.random(2) * 2.0**-SOBOL_BITS
        for start in range(0, number, chunk):
            points = engine.random(min(chunk, number - start)) + beyond
            theta = kept_inside(SINE.quantile(0.5 * points[:, 1] if halved else points[:, 1]))
            yield theta, *respond(np.clip(points[:, 0], smallest, largest), theta)
        return
    traced = getattr(law, "outcomes", None) if getattr(law, "closed_form", None) is None else None
    for index, start in enumerate(range(0, number, chunk)):
        own = np.random.default_rng([*key, index])
        theta = SINE.sample(min(chunk, number - start), own)
        if traced is None:
            yield theta, law.sample(theta, own), None
        else:
            yield theta, *traced(np.clip(own.random(theta.shape), smallest, largest), theta)


def _mirrored(basis: Basis, total: Any) -> Any:
    """Counts of pairs, or sums of products, of the mirror images (pi - theta, pi - theta')."""
    if basis.is_partition:
        return total[::-1, ::-1]
    flip = reflection_matrix(basis)
    return flip @ total @ flip.T


def _progress(total: int) -> AbstractContextManager[Any]:
    from tqdm import tqdm

    bar: AbstractContextManager[Any] = tqdm(
        total=total, unit="ray", unit_scale=True, delay=SLOW_SECONDS, disable=None, leave=False
    )
    return bar
