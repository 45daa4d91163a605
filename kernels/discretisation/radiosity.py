"""The matrix of a wall with facets that are diffuse in part: view factors between cells of the boundary."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats, generator, read_only
from ...core.errors import AccuracyError
from ...geometry import Segment, Wall, trace
from ...geometry.curves import columns as c
from ...geometry.curves.curve import Curve
from ...geometry.tracing.compiled.pieces.records import FIRST_CURVE, LINE, States
from ...geometry.tracing.tracing import Status
from ..bases.angles import clipped_inside
from ..bases.assembly import add_products, is_mirror_symmetric, largest_square_sum, mirror_image
from ..bases.basis import Basis, Frame
from ..bases.measure import SINE
from ..laws.law import Law
from ..laws.structure import SpatialLaw
from ..matrices.matrix import KernelMatrix, frobenius_error
from ..sampling.counts import half_width, keep_constant
from ..sampling.sobol import PARTS, random_shifts, shifted_points, sobol_sequence, whole_sequences
from ..walls.conditionals import UNRESOLVED_TOLERANCE
from ..walls.faceted_law import MOST_HITS, FacetedLaw, FacetRays
from .method import DEFAULT_SAMPLES, SEED_WITHOUT_RNG, Budget, rounding

# Pairs of cells into which the boundary is divided, at least one for each piece, and limit on the pieces.
PAIRS, MOST_PIECES = 32, 640
# Specular rays for each diffuse one, which takes about ten times as long.
DIFFUSE = 2
# A ray of less weight is left; the weights of all that are left are counted.
LEAST_WEIGHT = 1e-9
# What the error consists of.
HOW = "spread of 8 parts, and change by cells twice as long"
# Steps of the scaling to sums of rows 1: each reduces the distance along an eigenvalue r by the factor (1 - r)/2.
# Where r is near -1, the sums remain 1 within the error.
STEPS = 40


def has_radiosity(law: Law, basis: Basis) -> bool:
    """Whether the law is that of a wall of lines and arcs that closes, with facets diffuse in part."""
    if not isinstance(law, FacetedLaw) or law.diffuse_fraction is None or not law.wall.closes:
        return False
    return not len(law.wall.scene.beziers) and 0 < len(law.wall.cell.pieces) <= MOST_PIECES


class Boundary:
    """The pieces of the hollows of a wall, in cells of equal length, in pairs.

    Attributes
    ----------
    lengths : ndarray of shape (cells,)
    """

    def __init__(self, wall: Wall) -> None:
        self.wall, joints, number = wall, wall.scene.joints, [0] * len(Curve.traced())
        pieces: list[tuple[int, int, int, Curve]] = []
        for h, hollow in enumerate(wall.cell.hollows):
            j = int(wall.scene.hollows[h, c.FIRST_JOINT])
            for piece in wall.cell.pieces[hollow.first : hollow.last]:
                if joints[j, c.STARTS_LINE]:
                    ends = joints[j : j + 2, [c.JOINT_X, c.JOINT_Y]].tolist()
                    pieces.append((h, LINE, j, Segment(*ends)))
                    j += 1
                    continue
                for part in piece.cut():
                    pieces.append((h, FIRST_CURVE + part.table, number[part.table], part))
                    number[part.table] += 1
                    j += 1
        self.pieces = [piece for *_, piece in pieces]
        self.places = np.array([place for *place, _ in pieces])
        length = np.array([piece.length for piece in self.pieces])
        self.counts = 2 * np.maximum(1, np.rint(PAIRS * length / length.sum()).astype(np.int64))
        self.steps = length / self.counts
        self.first = np.concatenate(([0], np.cumsum(self.counts)))
        self.lengths = np.repeat(self.steps, self.counts)
        _, kind, row = self.places.T
        self.rows = np.full((FIRST_CURVE + len(number), max(len(joints), row.max() + 1)), -1)
        self.rows[kind, row] = np.arange(len(pieces))

    def leaving(self, points: Floats) -> FacetRays:
        """Rays from points of the unit square in each cell, shape (cells, rays, 2), of the cosine law."""
        found = [
            piece.touch(
                piece.point_at_length((step * (np.arange(end - first)[:, None] + points[first:end, :, 0])).ravel())
            )
            for piece, step, first, end in zip(self.pieces, self.steps, self.first[:-1], self.first[1:], strict=True)
        ]
        point, tangent = (np.concatenate([one[k] for one in found]) for k in range(2))
        place = np.repeat(self.places, self.counts * points.shape[1], axis=0).T
        return FacetRays.leaving(self.wall, *place, point, tangent, SINE.quantile(points[..., 1].ravel()))

    def cells_at(self, states: States, who: NDArray[np.int64]) -> NDArray[np.int64]:
        """The cells of some rays."""
        piece, cell = self.rows[states.kind[who], states.number[who]], np.empty(len(who), np.int64)
        for k in np.flatnonzero(np.bincount(piece)):
            own = np.flatnonzero(piece == k)
            at = self.pieces[k].length_to(states.point[who[own]]) / self.steps[k]
            cell[own] = self.first[k] + np.clip(at.astype(np.int64), 0, self.counts[k] - 1)
        return cell


def exchanged(boundary: Boundary, kept: float, points: Floats, basis: Basis) -> tuple[Floats, Floats, float]:
    """Next diffuse hits and exits of rays from each cell, the fraction ``kept`` of which each hit reflects specularly.

    Returns
    -------
    hits : array of shape (cells, cells)
        The probability that the next diffuse hit of a ray is in a cell, symmetric after multiplication by lengths.
    exits : array of shape (cells, n)
        The mean of e_j(theta') over rays that escape before.
    lost : float
        The weight of rays that neither do, as a fraction.
    """
    cells, each = points.shape[:2]
    rays, weight = boundary.leaving(points), np.ones(cells * each)
    hits, states = np.zeros(cells * cells), rays.states
    who = rays.advance(np.arange(cells * each))
    for _ in range(MOST_HITS):
        if not len(who):
            break
        pair = who // each * cells + boundary.cells_at(states, who)
        np.add.at(hits, pair, weight[who] * (1.0 - kept))
        weight[who] *= kept
        who = who[weight[who] > LEAST_WEIGHT]
        states.angle[who] = np.pi - states.angle[who]
        who = rays.advance(who)
    escaped = states.status == Status.ESCAPED
    lost = float(weight[~escaped].sum()) / weight.size
    weight[~escaped] = 0.0
    exits = np.zeros((cells, basis.size))
    if basis.is_partition:
        index = np.arange(weight.size) // each * basis.size + basis.index(np.where(escaped, states.angle, 1.0))
        exits = np.bincount(index, weight, exits.size).reshape(exits.shape) * basis.normalisation
    else:
        for k in range(cells):
            own = slice(k * each, (k + 1) * each)
            exits[k] = weight[own] @ basis.evaluate(np.where(escaped[own], states.angle[own], 1.0))
    flux = hits.reshape(cells, cells) / each * boundary.lengths[:, None]
    return balanced(0.5 * (flux + flux.T), flux.sum(axis=1)), exits / each, lost


def by_radiosity(law: FacetedLaw, basis: Basis, budget: Budget) -> KernelMatrix:
    """The matrix of a wall with facets diffuse in part, from specular rays and view factors between cells.

    Facets a Lambertian + (1 - a) specular give P = B + R. B f = E[(1 - a)^N f(theta')] over specular rays with N hits.
    R = a/W E^T (1 - G)^-1 E over rays that some facet scatters, W the period: E is the exit of a diffuse ray without
    another diffuse hit, G its next diffuse hit. Points of Sobol sequences have two dimensions, for any number of hits.
    The error is the 95 % quantile of the spread of eight parts, plus the change by cells twice as long.
    """
    cell = law.wall.cell
    kept, boundary = 1.0 - (law.diffuse_fraction or 0.0), Boundary(cell)
    seeds = budget.rng.integers(0, 2**63, size=(3, 2)).tolist()
    mirrored = law.mirror_symmetric is True and is_mirror_symmetric(basis)
    number, cells = whole_sequences(budget.rays) // PARTS, len(boundary.lengths)
    each = whole_sequences(max(budget.rays // (DIFFUSE * cells), 1)) // PARTS
    unscattered, lost = specular_sums(cell, kept, basis, number, seeds[0], mirrored)
    points = shifted_points(sobol_sequence(seeds[1], 0), each, *random_shifts(seeds[1], 2))
    moved = np.random.default_rng(seeds[2]).random((cells, 1, 2))
    found = (exchanged(boundary, kept, (part + moved) % 1.0, basis) for part in points)
    all_hits, all_exits, left = zip(*found, strict=True)
    flat = (1.0 - kept) * cell.flat_top / cell.period * np.outer(basis.constant, basis.constant)

    def matrix(direct: Floats, hits: Floats, exits: Floats, lengths: Floats = boundary.lengths) -> Floats:
        scattered = exits.T @ (lengths[:, None] * np.linalg.solve(np.diag(lengths) - hits, lengths[:, None] * exits))
        found = 0.5 * (direct + direct.T) + (1.0 - kept) / cell.period * scattered + flat
        if mirrored:
            found = 0.5 * (found + mirror_image(found, basis))
        return with_row_sums(found, basis)

    direct, hits, exits = unscattered.mean(axis=0), np.mean(all_hits, axis=0), np.mean(all_exits, axis=0)
    whole = matrix(direct, hits, exits)
    # of all parts but one
    left_out = [
        matrix(*((PARTS * mean - own) / (PARTS - 1.0) for mean, own in zip((direct, hits, exits), part, strict=True)))
        for part in zip(unscattered, all_hits, all_exits, strict=True)
    ]
    centre = np.mean(left_out, axis=0)
    replicates = tuple(read_only(whole + (PARTS - 1.0) * (centre - part)) for part in left_out)
    # of two cells the lengths and fluxes add up, and their exits have the mean weighted by lengths, which are equal
    coarse = matrix(
        direct, hits.reshape(cells // 2, 2, -1, 2).sum(axis=(1, 3)), exits.reshape(cells // 2, 2, -1).mean(axis=1),
        boundary.lengths.reshape(-1, 2).sum(axis=1),
    )  # fmt: skip
    lost = max(lost, float(np.mean(left)))
    error = half_width(whole, replicates) + float(np.linalg.norm(whole - coarse)) + rounding(basis)
    if lost > UNRESOLVED_TOLERANCE:
        raise AccuracyError(f"{law!r}: {lost:.2g} of the rays did not escape, more than {UNRESOLVED_TOLERANCE:g}", lost)
    error += 2.0 * lost * largest_square_sum(basis)
    return KernelMatrix(
        read_only(whole), basis, frobenius_error(error, "estimate", HOW),
        method="qmc", replicates=replicates, samples=PARTS * (number + cells * each), unresolved=lost, symmetrised=True,
    )  # fmt: skip


def one_diffuse_hit(law: FacetedLaw, basis: Basis, rays: int) -> Floats:
    """The matrix D of rays whose only hit is diffuse: P >= a D as kernels, for the diffuse fraction a."""
    boundary = Boundary(law.wall.cell)
    each = max(rays // len(boundary.lengths), 1)
    points = sobol_sequence((0,), 0).random(1 << (each - 1).bit_length())
    moved = np.random.default_rng(0).random((len(boundary.lengths), 1, 2))
    exits = exchanged(boundary, 0.0, (points + moved) % 1.0, basis)[1]
    flat = law.wall.cell.flat_top * np.outer(basis.constant, basis.constant)
    return (exits.T @ (boundary.lengths[:, None] * exits) + flat) / law.wall.cell.period


def specular_sums(
    wall: Wall, kept: float, basis: Basis, number: int, seed: tuple[int, ...], halved: bool = False
) -> tuple[Floats, float]:
    """The matrix of the rays that no facet scatters, in each part of a Sobol sequence, and the fraction unresolved."""
    points = shifted_points(sobol_sequence(seed, 0), number, *random_shifts(seed, 2))
    angle = SINE.quantile((0.5 if halved else 1.0) * points[..., 1])
    theta, total = clipped_inside(angle), np.zeros((PARTS, basis.size, basis.size))
    if kept == 0.0:
        return total, 0.0
    rays = trace(wall, points[..., 0] * wall.period, theta)
    weight = np.where(rays.escaped, kept**rays.collisions, 0.0) / number
    for part in range(PARTS):
        outgoing = np.where(rays.escaped[part], rays.theta[part], theta[part])
        add_products(total[part], basis, theta[part], outgoing, weight[part])
    return total, 1.0 - float(np.mean(rays.escaped))


@dataclass(frozen=True)
class UnscatteredRays(SpatialLaw):
    """The part B f = E[(1 - a)^N f(theta')] of a wall with facets diffuse in part: its rays keep their plane in space.

    Its matrix comes from rays of a Sobol sequence, as many as ``samples`` of the call say.
    """

    law: FacetedLaw
    frame: Frame = "paper"

    def matrix_on(self, basis: Basis, discretise: partial[KernelMatrix]) -> KernelMatrix:
        asked = discretise.keywords
        seed = tuple(generator(asked.get("rng"), SEED_WITHOUT_RNG).integers(0, 2**63, size=2).tolist())
        number = whole_sequences(asked.get("samples") or DEFAULT_SAMPLES) // PARTS
        cell, kept = self.law.wall.cell, 1.0 - (self.law.diffuse_fraction or 0.0)
        parts, lost = specular_sums(cell, kept, basis, number, seed)
        parts = 0.5 * (parts + parts.transpose(0, 2, 1))
        if self.frame == "specular":
            parts = np.array([mirror_image(part, basis, rows=False) for part in parts])
        whole = parts.mean(axis=0)
        error = half_width(whole, tuple(parts)) + rounding(basis) + 2.0 * lost * largest_square_sum(basis)
        return KernelMatrix(read_only(whole), basis, frobenius_error(error, "estimate", HOW), method="qmc")


def with_row_sums(matrix: Floats, basis: Basis) -> Floats:
    """A symmetric matrix near a given one that keeps the constants, and its zeros and signs if the basis has cells."""
    if not basis.is_partition:
        keep_constant(matrix, basis.constant, both=True)
        return matrix
    size = np.outer(basis.constant, basis.constant)
    empty = np.flatnonzero(matrix @ basis.constant <= 0.0)
    if empty.size:
        raise AccuracyError(
            f"{empty.size} of {basis.size} bins have no rays; use more samples, or fewer bins",
            float(basis.weights[empty].sum()),
        )
    return balanced(matrix * size, basis.weights) / size


def balanced(flux: Floats, sums: Floats) -> Floats:
    """A symmetric array of fluxes, multiplied by a factor for each cell such that rows have the given sums."""
    for _ in range(STEPS):
        found = flux.sum(axis=1)
        scale = np.sqrt(np.divide(sums, found, out=np.ones(len(sums)), where=found > 0.0))
        flux = scale[:, None] * flux * scale
    return flux
