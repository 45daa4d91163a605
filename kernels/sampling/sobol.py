"""Rays from scrambled Sobol sequences that can be continued, and begun at any point."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats, new_seed
from ...core.errors import InputError
from ...core.long_runs import Engine
from ..bases.angles import clipped_inside
from ..bases.assembly import is_mirror_symmetric
from ..bases.basis import Basis
from ..bases.measure import SINE
from ..laws.law import entry_inside, outgoing_angles
from ..matrices.matrix import KernelMatrix
from . import chunks
from .chunks import Job, RaySums, count_long

if TYPE_CHECKING:
    from scipy.stats.qmc import Sobol

# Replicates of a Sobol sequence whose spread gives the error; eight determine the spread within a quarter. With more
# replicates each would have fewer rays and be less accurate.
PARTS = 8
# Binary digits of the sequences. The digits beyond are one random shift of all points, so that points hit a corner at a
# dyadic position only by chance.
SOBOL_BITS = 32


@dataclass(frozen=True, eq=False)
class SobolRays(Job):
    """Rays ``start`` to ``end - 1`` of each of eight shifted Sobol sequences, in tasks.

    Attributes
    ----------
    dimension : int
        Numbers that determine a ray: of an entry point and an incoming angle two. Rays of other spaces override it and
        `add_points`.
    shifts, beyond : ndarray of shape (PARTS, dimension)
        Of the digits of each part, and of the digits beyond.
    seed : tuple of int
        Of the sequence, which tells it and the shifts from others.
    halved : bool
        Whether all rays have theta < pi/2.
    start, end : int
        Powers of two; ``start`` may be 0.
    rays_a_task : int
        Rounded to whole chunks.
    """

    dimension: ClassVar[int] = 2

    shifts: NDArray[np.uint64]
    beyond: Floats
    seed: tuple[int, ...]
    halved: bool
    start: int
    end: int
    rays_a_task: int = field(default_factory=lambda: chunks.RAYS_A_TASK)
    tables = PARTS

    @cached_property
    def chunk(self) -> int:
        """Points of a chunk, at most."""
        return max(RaySums(self.law, self.basis, 0).chunk // PARTS, 1)

    @cached_property
    def points_a_task(self) -> int:
        return self.chunk * max(self.rays_a_task // (PARTS * self.chunk), 1)

    @property
    def tasks(self) -> int:
        return -(-self.end // self.points_a_task) - self.start // self.points_a_task

    def range_of(self, task: int) -> tuple[int, int]:
        """The first point of a task, and the one after its last."""
        low = (self.start // self.points_a_task + task) * self.points_a_task
        return max(self.start, low), min(self.end, low + self.points_a_task)

    def rays_of(self, task: int) -> int:
        low, high = self.range_of(task)
        return PARTS * (high - low)

    def first_table(self, task: int) -> int:
        return 0

    def add_to(self, sums: RaySums, first: int, task: int) -> None:
        low, high = self.range_of(task)
        sequence = sobol_sequence(self.seed, low, self.dimension)
        for start in range(low, high, self.chunk):
            points = shifted_points(sequence, min(self.chunk, high - start), self.shifts, self.beyond)
            self.add_points(sums, first, points)

    def add_points(self, sums: RaySums, first: int, points: Floats) -> None:
        """Add the rays of points of the unit cube, shape (PARTS, rays, dimension), to the tables from ``first`` on."""
        sums.add_rows(first, *self.traced(sums, points))

    def traced(self, sums: RaySums, points: Floats) -> tuple[Floats, Floats]:
        """Incoming and outgoing angles; those that did not escape are counted."""
        reflect = self.law.random_map()
        assert reflect is not None  # checked by the sampler
        x, u = np.moveaxis(points, -1, 0)
        theta = self.incoming(u)
        outgoing, escaped = reflect(entry_inside(x), theta.copy())
        sums.count_unresolved(escaped)
        return theta, outgoing_angles(outgoing, theta, self.law)

    def incoming(self, u: Floats) -> Floats:
        """The incoming angles of uniform numbers."""
        return clipped_inside(SINE.quantile(0.5 * u if self.halved else u))

    def identity(self) -> dict[str, Any]:
        return {
            "computation": "scrambled Sobol sequences", "rays": PARTS * self.end, "seed": list(self.seed),
            "chunk": self.chunk, "points a task": self.points_a_task,
        }  # fmt: skip


def sobol_sequence(seed: tuple[int, ...], start: int, dimension: int = 2) -> Sobol:
    """The scrambled sequence of a seed, of which ``start`` points are passed over."""
    from scipy.stats.qmc import Sobol

    sequence = Sobol(dimension, bits=SOBOL_BITS, rng=np.random.default_rng(seed))
    return sequence.fast_forward(start) if start else sequence


def random_shifts(seed: tuple[int, ...], dimension: int) -> tuple[NDArray[np.uint64], Floats]:
    """The shifts of the digits of each part, and of the digits beyond, shape (PARTS, dimension) each."""
    source = np.random.default_rng(seed)
    shifts = source.integers(0, 2**SOBOL_BITS, size=(PARTS, dimension), dtype=np.uint64)
    return shifts, source.random((PARTS, dimension)) * 2.0**-SOBOL_BITS


def shifted_points(sequence: Sobol, number: int, shifts: NDArray[np.uint64], beyond: Floats) -> Floats:
    """The next points of a sequence in each part, shape (PARTS, number, dimension)."""
    return shifted(next_digits(sequence, number), shifts, beyond)


def next_digits(sequence: Sobol, number: int) -> NDArray[np.uint64]:
    """The digits of the next points of a sequence, shape (number, dimension)."""
    return np.asarray((sequence.random(number) * 2.0**SOBOL_BITS).astype(np.uint64))


def shifted(digits: NDArray[np.uint64], shifts: NDArray[np.uint64], beyond: Floats) -> Floats:
    """Points with these digits after each shift of shape (..., dimension), shape (..., number, dimension)."""
    return np.asarray((digits ^ shifts[..., None, :]) * 2.0**-SOBOL_BITS + beyond[..., None, :])


def whole_sequences(samples: int) -> int:
    """At least ``samples`` rays: eight times a power of two.

    >>> whole_sequences(8), whole_sequences(17)
    (8, 32)
    """
    return PARTS << (max(-(-samples // PARTS), 1) - 1).bit_length()


class SobolSampler:
    """Sampler of rays of a law driven by uniform numbers, with incoming angles from the invariant measure.

    The rays form eight parts of equal size. Each part is the same scrambled Sobol sequence with its own random digital
    shift, so it is a scrambled Sobol sequence. Given the sequence, the parts are independent and identically
    distributed, so their spread gives the error of their mean. Each call continues the same sequence, so the rays of a
    pilot run are reused. If the law and the basis are mirror-symmetric, the rays have theta < pi/2 and every ray counts
    with its mirror image, which makes the sequence twice as dense.

    Parameters
    ----------
    law : Law
    basis : Basis
    rng : numpy.random.Generator
    rays : type
        Of the rays: `SobolRays` for laws of angles that one number drives.

    Raises
    ------
    InputError
        If the law needs more randomness.
    """

    def __init__(self, law: Any, basis: Basis, rng: np.random.Generator, rays: type[SobolRays] = SobolRays) -> None:
        if law.random_map() is None:
            raise InputError(
                f"method: {law!r} is not driven by a uniform number, so it has no 'qmc'; use 'monte-carlo'"
            )
        self.sums, self.rays = RaySums(law, basis, PARTS), rays
        self.halved = law.mirror_symmetric is True and is_mirror_symmetric(basis)
        self.seed = new_seed(rng)
        self.shifts, self.beyond = random_shifts(self.seed, rays.dimension)

    def sampled(self, samples: int, *, symmetrise: bool, engine: Engine | None = None) -> KernelMatrix:
        """The matrix from at least ``samples`` rays, rounded up to 8 times a power of two; see `RaySums.matrix`.

        With an ``engine`` its workers trace the rays and its checkpoint stores the sums, which are the same to the last
        bit: the points of a task depend only on its number.

        Raises
        ------
        InputError
            If the sequence has fewer points, or the checkpoint is of other rays or cannot be written.
        """
        each = whole_sequences(samples) // PARTS
        if each > 1 << SOBOL_BITS:
            most = PARTS << SOBOL_BITS
            raise InputError(
                f"samples: a Sobol sequence has at most {most} rays, got {samples}; use method 'monte-carlo'"
            )
        if each > self.sums.each:
            rays = self.rays(
                self.sums.law, self.sums.basis, self.shifts, self.beyond, self.seed, self.halved,
                self.sums.each, each,
            )  # fmt: skip
            # earlier matrices have the tables of their replicates
            self.sums.tables = self.sums.tables.copy() if self.sums.each else self.sums.tables
            count_long(self.sums, rays, engine or {})
            self.sums.each = each
        return self.sums.matrix(symmetrise=symmetrise, mirrored=self.halved)
