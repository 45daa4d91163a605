"""Kernel matrices from given pairs of incoming and outgoing angles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, angles, check_memory
from ...core.errors import InputError
from ..bases.basis import Basis, checked_basis
from ..bases.bins import Bins
from ..bases.measure import SINE
from ..matrices.defects import invariance_z_score
from ..matrices.matrix import KernelMatrix
from .counts import (
    BATCHES,
    Counts,
    count_pairs,
    matrix_from_counts,
    matrix_from_sums,
    sum_products,
    with_missed_events,
)

# Incoming angles count as not invariant if their totals in bins deviate from the measure by this z-score.
NOT_INVARIANT_Z = 4.0
# Number of bins for these totals if the basis is not `Bins`.
TEST_BINS = 32
# Batches of weighted pairs whose spread gives the error; in smaller batches the weights would be less even.
WEIGHTED_BATCHES = 8


def estimate(
    theta_in: ArrayLike,
    theta_out: ArrayLike,
    basis: Basis,
    symmetrise: bool = False,
    *,
    invariant: bool | None = None,
) -> KernelMatrix:
    r"""Estimate the matrix of a law from measured, traced or simulated pairs (theta, theta').

    Parameters
    ----------
    theta_in, theta_out : array_like
        Incoming and outgoing angles of independent pairs, in (0, pi), in radians, in the same shape.
    basis : Basis
        Bins, Legendre or Panels.
    symmetrise : bool
        Whether each pair counts in both directions, which is valid for reversible laws. The flux is then symmetric, but
        rows of ``array`` sum to 1 only within the sampling error; `KernelMatrix.symmetry_defect` still belongs to the
        raw pairs. If False, rows sum to 1.
    invariant : bool, optional
        Whether the incoming angles follow sin(theta) d theta. By default a test of their totals in bins decides. If
        they do not, C - C^T contains no information about reversibility, and counts are not averages over their bins.
        Every pair is then weighted by the measure of the angles that are nearer to its incoming angle than to any
        other incoming angle of its batch.

    Returns
    -------
    KernelMatrix
        The matrix, with the raw ``counts`` for Bins. Its ``error`` is the 95 % quantile of the sampling error, from
        the variance of multinomial counts or from the spread of batches (32 in bases without cells, 8 of weighted
        pairs), and at least the change by an event that none of the pairs may have met. The truncation to the basis is
        not included.

    Raises
    ------
    InputError
        If the shapes differ, an angle is outside (0, pi), or there are too few pairs.
    AccuracyError
        If a bin has no incoming pair; use more pairs or fewer bins.

    Examples
    --------
    >>> P = estimate([0.5, 1.0, 2.0, 2.5], [0.5, 2.0, 1.0, 2.5], Bins(2))
    >>> P.array.round(14).tolist(), P.counts.tolist()
    ([[0.5, 0.5], [0.5, 0.5]], [[1, 1], [1, 1]])
    """
    incoming, outgoing = angles("theta_in", theta_in), angles("theta_out", theta_out)
    if incoming.shape != outgoing.shape:
        raise InputError(
            f"theta_out: expected the shape of theta_in, {incoming.shape}, got {outgoing.shape}; pass pairs"
        )
    checked_basis(basis)
    check_memory("basis", f"the matrix in {basis!r}", basis.size**2)
    if basis.measure != SINE:
        raise InputError(f"basis: expected one for sin(theta), got {basis!r}")
    incoming, outgoing = incoming.ravel(), outgoing.ravel()
    least = 1 if basis.is_partition else 2 * WEIGHTED_BATCHES
    if incoming.size < least:
        raise InputError(f"theta_in: expected at least {least} pairs for {basis!r}, got {incoming.size}")
    follows = _follows_measure(incoming, basis) if invariant is None else bool(invariant)
    counts = count_pairs(basis, incoming, outgoing) if basis.is_partition else None
    if counts is not None and (follows or incoming.size < 2 * WEIGHTED_BATCHES):
        return matrix_of_pairs(basis, counts, None, follows, incoming.size, symmetrise)
    means = _batch_means(basis, incoming, outgoing, follows)
    return matrix_of_pairs(basis, counts, means, follows, incoming.size, symmetrise)


def matrix_of_pairs(
    basis: Basis, counts: Counts | None, means: list[Floats] | None, follows: bool, pairs: int, symmetrise: bool
) -> KernelMatrix:
    """The matrix from counts of all pairs, or from means of e_i(theta) e_j(theta') over batches if there are any."""
    if means is None:
        found = matrix_from_counts([counts], basis, symmetrise=symmetrise, independent=True)
    elif counts is not None:
        fluxes = [mean / (basis.normalisation[:, None] * basis.normalisation) for mean in means]
        found = matrix_from_counts(fluxes, basis, symmetrise=symmetrise, independent=False)
    else:
        found = matrix_from_sums(means, basis, symmetrise=symmetrise, keeps_measure=False)
    return replace(
        with_missed_events(found, pairs),
        counts=counts,
        samples=pairs,
        method="pairs",
        reversible=True if symmetrise else None,
        metadata={"incoming_angles_follow_measure": follows},
    )


def bins_of_test(basis: Basis) -> Bins:
    """The bins in which the totals of incoming angles are tested."""
    return basis if isinstance(basis, Bins) else Bins(TEST_BINS)


def _follows_measure(incoming: Floats, basis: Basis) -> bool:
    bins = bins_of_test(basis)
    totals = np.bincount(bins.index(incoming), minlength=bins.size)
    return invariance_z_score(totals, bins.weights) < NOT_INVARIANT_Z


def _batch_means(basis: Basis, incoming: Floats, outgoing: Floats, follows: bool) -> list[Floats]:
    """Means of e_i(theta) e_j(theta') over batches of at least two pairs."""
    means, number = [], min(BATCHES, incoming.size // 2) if follows else WEIGHTED_BATCHES
    for batch in range(number):
        theta, image = incoming[batch::number], outgoing[batch::number]
        weight = np.full(theta.size, 1.0 / theta.size) if follows else nearest_measure(theta)
        means.append(sum_products(basis, theta, image, weight))
    return means


def nearest_measure(theta: Floats) -> Floats:
    """Measure of the angles nearest to each given angle, divided equally among equal angles."""
    distinct, owner, number = np.unique(theta, return_inverse=True, return_counts=True)
    middle = 0.5 * (distinct[1:] + distinct[:-1])
    mass = SINE.mass(np.concatenate(([0.0], middle)), np.concatenate((middle, [np.pi])))
    return np.asarray((mass / number)[owner])
