"""Tables of isometries: the isometries of a law, the intervals of angles where they act, and their probabilities."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import KW_ONLY, dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, Value, angles, read_only, whole_number
from ...core.errors import InputError
from ...core.long_runs import NUMBERS_AT_ONCE, slices
from ...core.rounding import EPS
from ..bases.angles import MOST_BREAKPOINTS, clipped_inside, joined_lists, without_extremal
from ..bases.measure import SINE

Whole = NDArray[np.int64]
COLUMNS = "sign", "offset", "low", "high", "start", "end"
# Offsets that differ by less are equal: they are sums of a few angles of the wall, with dozens of roundings below 2 pi.
SAME_OFFSET = 64.0 * np.pi * EPS
# Sums of probabilities that differ from 1 by less than this differ by rounding; they are normalised.
ROUNDED_SUM = 1e-9
# Approximate number of entries in the index for each piece.
ENTRIES_PER_PIECE = 4.0


@dataclass(frozen=True)
class Crevice:
    """A rectangular hollow, given by its shape because it has infinitely many pieces, which accumulate at grazing.

    Parameters
    ----------
    fraction : float
        The opening as a fraction of the period.
    height_to_width : float
        Depth over width, r. With d = 2 r |cot theta|, the probability of retroreflection is ``fraction`` times the
        distance from d to the nearest even number; the rest of ``fraction`` is specular reflection.
    exchanged : bool
        Whether the two outcomes are exchanged, as in the specular frame.
    """

    fraction: float
    height_to_width: float
    exchanged: bool = False


@dataclass(frozen=True, eq=False)
class IsometryTable(Value):
    r"""Pieces theta' = sign theta + offset for low < theta < high, and rectangular crevices.

    On a piece the probability is p(theta) = a + b cot(theta). The sinusoid p(theta) sin(theta) is given by its values
    ``start`` and ``end`` at the two ends. Between them it is the sum of two non-negative terms, without cancellation:

        p(theta) sin(theta) = (start sin(high - theta) + end sin(theta - low)) / sin(high - low).

    Parameters
    ----------
    sign, offset, low, high, start, end : array_like, shape (pieces,)
        One entry for each piece; no piece is longer than pi/2.
    crevices : tuple of Crevice
    unresolved : float
        Upper bound on the measure of unresolved rays, which the table retroreflects by convention.
    offset_error : float
        Bound on errors of offsets beyond rounding, radians.

    Examples
    --------
    A mirror, cut at pi/2:

    >>> import numpy as np
    >>> table = IsometryTable.flat(1.0)
    >>> probability, sign, offset = table.conditionals(1.0)
    >>> probability.round(15).tolist(), sign.tolist(), (offset / np.pi).tolist()
    ([1.0], [-1.0], [1.0])
    """

    sign: Floats
    offset: Floats
    low: Floats
    high: Floats
    start: Floats
    end: Floats
    _: KW_ONLY
    crevices: tuple[Crevice, ...] = ()
    unresolved: float = 0.0
    offset_error: float = 0.0

    def __post_init__(self) -> None:
        columns = [np.atleast_1d(np.asarray(getattr(self, name), dtype=np.float64)) for name in COLUMNS]
        columns[4:] = (read_only(np.maximum(column, 0.0)) for column in columns[4:])
        used = (columns[3] > columns[2]) & ((columns[4] > 0.0) | (columns[5] > 0.0))
        if np.any(columns[3] - columns[2] > 0.5 * np.pi * (1.0 + 1e-15)):
            raise InputError("table: expected pieces not longer than pi/2; cut the others at pi/2")
        everything = bool(used.all())
        for name, column in zip(COLUMNS, columns, strict=True):
            shared = everything and not column.flags.writeable
            object.__setattr__(self, name, column if shared else read_only(column[used]))

    # ---- constructors ------------------------------------------------------------------------------------------
    @classmethod
    def of_pieces(
        cls,
        sign: ArrayLike,
        offset: ArrayLike,
        low: ArrayLike,
        high: ArrayLike,
        sine: ArrayLike,
        cosine: ArrayLike,
        unresolved: float = 0.0,
        offset_error: float = 0.0,
    ) -> IsometryTable:
        """The table of pieces of any length with probability ``sine + cosine cot(theta)``; pieces are cut at pi/2."""
        columns = np.broadcast_arrays(*np.atleast_1d(sign, offset, low, high, sine, cosine))
        sign, offset, low, high, sine, cosine = (read_only(np.array(column, dtype=np.float64)) for column in columns)
        right = 0.5 * np.pi
        cut = (low < right) & (high > right)
        if cut.any():
            low, high = (
                np.concatenate([low, np.full(cut.sum(), right)]),
                np.concatenate([np.where(cut, right, high), high[cut]]),
            )
            sign, offset, sine, cosine = (
                np.concatenate([column, column[cut]]) for column in (sign, offset, sine, cosine)
            )
        start, end = (sine * np.sin(at) + cosine * np.cos(at) for at in (low, high))
        return cls(sign, offset, low, high, start, end, unresolved=unresolved, offset_error=offset_error)

    @classmethod
    def flat(cls, fraction: float) -> IsometryTable:
        """Specular reflection with probability ``fraction``."""
        return cls.of_pieces(-1.0, np.pi, 0.0, np.pi, fraction, 0.0)

    @classmethod
    def retroreflected(cls, fraction: float) -> IsometryTable:
        """Retroreflection with probability ``fraction``."""
        return cls.of_pieces(1.0, 0.0, 0.0, np.pi, fraction, 0.0)

    @classmethod
    def of_crevice(cls, fraction: float, height_to_width: float) -> IsometryTable:
        """The table of one rectangular crevice, whose opening is ``fraction`` of the period."""
        return cls(*(np.empty(0),) * 6, crevices=(Crevice(fraction, height_to_width),))

    @classmethod
    def joined(cls, tables: Iterable[IsometryTable]) -> IsometryTable:
        """The sum of tables, whose probabilities should sum to 1."""
        parts = list(tables)
        columns = [np.concatenate([getattr(table, name) for table in parts]) for name in COLUMNS]  # names of this class
        crevices: dict[tuple[float, bool], float] = {}
        for crevice in (crevice for table in parts for crevice in table.crevices):
            key = crevice.height_to_width, crevice.exchanged
            crevices[key] = crevices.get(key, 0.0) + crevice.fraction
        merged = tuple(Crevice(fraction, *key) for key, fraction in crevices.items())
        unresolved, offset_error = sum(table.unresolved for table in parts), max(table.offset_error for table in parts)
        return cls(*columns, crevices=merged, unresolved=unresolved, offset_error=offset_error)

    def scaled(self, fraction: float) -> IsometryTable:
        """The table with every probability multiplied by ``fraction``."""
        crevices = tuple(replace(crevice, fraction=fraction * crevice.fraction) for crevice in self.crevices)
        start, end = fraction * self.start, fraction * self.end
        return replace(self, start=start, end=end, crevices=crevices, unresolved=fraction * self.unresolved)

    def mirrored(self) -> IsometryTable:
        """The table of the mirror image of the wall: both angles theta become pi - theta."""
        offset = np.where(self.sign > 0.0, -self.offset, 2.0 * np.pi - self.offset)
        low, high = np.pi - self.high, np.pi - self.low
        return replace(self, offset=offset, low=low, high=high, start=self.end, end=self.start)

    def in_specular_frame(self) -> IsometryTable:
        """The table with every outgoing angle theta' replaced by pi - theta'."""
        crevices = tuple(replace(crevice, exchanged=not crevice.exchanged) for crevice in self.crevices)
        return replace(self, sign=-self.sign, offset=np.pi - self.offset, crevices=crevices)

    # ---- queries -----------------------------------------------------------------------------------------------
    @cached_property
    def isometries(self) -> tuple[Floats, Floats, Whole]:
        """Sign and offset of the different isometries, and the index of the isometry of each piece.

        The first two isometries are always specular reflection and retroreflection, even if the table lacks them.
        """
        sign = np.concatenate([[-1.0, 1.0], self.sign])
        offset = np.concatenate([[np.pi, 0.0], self.offset])
        number, groups = np.empty(sign.size, dtype=np.int64), 0
        for one in np.unique(sign).tolist():
            ours = sign == one
            ordered = np.sort(offset[ours])
            least = ordered[np.diff(ordered, prepend=-np.inf) > SAME_OFFSET]
            number[ours] = groups + np.searchsorted(least, offset[ours], side="right") - 1
            groups += least.size
        # Each group takes the offset of its first piece. The ideal isometries come first and keep exact offsets.
        first = np.empty(groups, dtype=np.int64)
        first[number[::-1]] = np.arange(number.size)[::-1]
        rank = np.argsort(np.argsort(first))
        where = np.sort(first)
        return sign[where], offset[where], np.asarray(rank[number][2:], dtype=np.int64)

    @cached_property
    def ends(self) -> Floats:
        """The distinct ends of pieces inside (0, pi): the breakpoints of the law without those of crevices."""
        ends = np.unique(np.concatenate([self.low, self.high]))
        return ends[(ends > 0.0) & (ends < np.pi)]

    def mass(self) -> float:
        """The total measure of all pieces and crevices: 1 up to rounding if the table is complete."""
        return float(self.masses().sum() + sum(crevice.fraction for crevice in self.crevices))

    def masses(self) -> Floats:
        """The measure of each piece."""
        middle, half = 0.5 * (self.low + self.high), 0.5 * (self.high - self.low)
        return np.asarray(np.sin(half) * self.density(middle))

    def density(self, theta: Floats, piece: Whole | slice = slice(None)) -> Floats:
        """p(theta) sin(theta) of the given piece at each angle."""
        low, high = self.low[piece], self.high[piece]
        raised = self.start[piece] * np.sin(high - theta) + self.end[piece] * np.sin(theta - low)
        return np.asarray(raised / np.sin(high - low))

    def images(self, theta: Floats, piece: Whole | slice = slice(None)) -> Floats:
        """The angle to which the given piece maps each angle."""
        return clipped_inside(self.sign[piece] * theta + self.offset[piece])

    def conditionals(self, theta: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """Probability, sign and offset of the branches at each angle, shape ``theta.shape + (branches,)``.

        Between two breakpoints every slot is one isometry. Unused slots have probability 0 and the first isometry.
        """
        incoming = angles("theta", theta)
        flat = incoming.ravel()
        sign, offset, _ = self.isometries
        owner, isometry, probability = self._entries(flat)
        key, group = np.unique(owner * sign.size + isometry, return_inverse=True)
        total = np.bincount(group, weights=probability, minlength=key.size)
        key, total = key[total > 0.0], total[total > 0.0]
        query, number = np.divmod(key, sign.size)
        whole = np.bincount(query, weights=total, minlength=flat.size)
        fraction = total / np.where(np.abs(whole - 1.0) < ROUNDED_SUM, whole, 1.0)[query]
        count = np.bincount(query, minlength=flat.size)
        _, slot = joined_lists(count)
        slots = int(count.max(initial=1))
        filled = np.zeros((flat.size, slots))
        which = np.zeros((flat.size, slots), dtype=np.int64)
        filled[query, slot] = fraction
        which[query, slot] = number
        which = np.where(filled > 0.0, which, which[:, :1])
        shape = (*incoming.shape, slots)
        return filled.reshape(shape), sign[which].reshape(shape), offset[which].reshape(shape)

    def branches(self, theta: ArrayLike) -> tuple[Floats, Floats]:
        """Probabilities and outgoing angles of the branches of `conditionals`."""
        probability, sign, offset = self.conditionals(theta)
        return probability, clipped_inside(sign * angles("theta", theta)[..., None] + offset)

    def _entries(self, theta: Floats) -> tuple[Whole, Whole, Floats]:
        """All (angle, isometry, probability); pieces with the same isometry are not yet merged."""
        number = self.isometries[2]
        first, members = self._index
        buckets = first.size - 1
        found: list[tuple[Whole, Whole, Floats]] = []
        bucket = np.clip((theta * (buckets / np.pi)).astype(np.int64), 0, buckets - 1)
        size = first[bucket + 1] - first[bucket]
        step = max(NUMBERS_AT_ONCE // max(int(size.max(initial=1)), 1), 1)
        for part in slices(max(theta.size, 1), step):
            owner, group = joined_lists(size[part])
            query = part.start + owner
            piece = members[first[bucket[query]] + group]
            at = theta[query]
            # A breakpoint belongs to the piece on its right.
            inside = (self.low[piece] <= at) & (at < self.high[piece])
            query, piece, at = query[inside], piece[inside], at[inside]
            found.append((query, number[piece], self.density(at, piece) / np.sin(at)))
        everyone = np.arange(theta.size)
        for crevice in self.crevices:
            retro = crevice.fraction * crevice_retro(crevice.height_to_width, theta)
            pair = (1, 0) if crevice.exchanged else (0, 1)
            for isometry, probability in zip(pair, (crevice.fraction - retro, retro), strict=True):
                found.append((everyone, np.full(theta.size, isometry), probability))
        query, number, probability = (np.concatenate(column) for column in zip(*found, strict=True))
        return query, number, probability

    @cached_property
    def _index(self) -> tuple[Whole, Whole]:
        """The pieces that meet each bucket of angles: the offset of each bucket's list, and the joined lists."""
        width = float(np.sum(self.high - self.low))
        buckets = int(np.clip(ENTRIES_PER_PIECE * self.low.size * np.pi / max(width, 1e-300), 1, 2**20))
        # the same monotone function as that of the angles, so an angle between the ends is in one of these buckets
        left, right = (
            np.clip((end * (buckets / np.pi)).astype(np.int64), 0, buckets - 1) for end in (self.low, self.high)
        )
        piece, group = joined_lists(right - left + 1)
        bucket = left[piece] + group
        # sorting numbers is faster than a stable order of indices; a list has less than 2^32 entries
        order = np.sort((bucket << 32) | np.arange(bucket.size)) & (2**32 - 1)
        first = np.concatenate([[0], np.cumsum(np.bincount(bucket, minlength=buckets))])
        return np.asarray(first, dtype=np.int64), np.asarray(piece[order], dtype=np.int64)

    def breakpoints(self, limit: int) -> tuple[Floats, float]:
        """Ends of pieces and breakpoints of crevices, about ``limit`` at most, and the measure with others left out."""
        lists, left_out = [self.ends], 0.0
        for crevice in self.crevices:
            breakpoints, omitted = crevice_breakpoints(crevice.height_to_width, max(limit // len(self.crevices), 1))
            lists.append(breakpoints)
            left_out = max(left_out, omitted)
        found = np.unique(np.concatenate(lists))
        surplus = self.ends.size - limit
        if surplus <= 0:
            return found, left_out
        # Drop the breakpoints nearest to grazing.
        found, beyond = without_extremal(found, surplus)
        return found, min(left_out + beyond, 1.0)


# d = 2 r |cot theta|, with r depth over width, has a relative error of about 2 eps in float64. Above the first limit
# d mod 2 needs double-double arithmetic, above the second multiple precision. Theta and r count as exact numbers.
LARGEST_PLAIN, LARGEST_DOUBLE_DOUBLE = 2.0**6, 2.0**48
# Guard bits beyond the bits of d itself.
MORE_BITS = 80
SPACING = float(np.spacing(np.pi))


def crossings_modulo_two(height_to_width: float, theta: Floats) -> Floats:
    """d mod 2 for d = 2 ``height_to_width`` |cot theta|, in [0, 2], with an error below 1e-13 for every float64 theta.

    Examples
    --------
    >>> rest = crossings_modulo_two(1.5, np.array([2.0**-30]))[0]    # d = 3 2^30 - 2^-30 + ...
    >>> float(2.0 - rest) == 2.0**-30
    True
    """
    theta = np.asarray(theta, dtype=np.float64)
    with np.errstate(over="ignore"):
        crossings = np.asarray(2.0 * height_to_width / np.abs(np.tan(theta)))
    # tan is finite at the float64 nearest to pi/2.
    rest = np.asarray(np.mod(np.where(crossings <= LARGEST_PLAIN, crossings, 0.0), 2.0))
    many = crossings > LARGEST_PLAIN
    if np.any(many):
        from ...geometry.tracing.double_double.numbers import crossings_modulo_two as in_double_double

        exceeding = many & (crossings > LARGEST_DOUBLE_DOUBLE)
        rest[many] = in_double_double(2.0 * height_to_width, theta[many])
        rest[exceeding] = [_in_many_digits(height_to_width, float(angle)) for angle in theta[exceeding]]
    return rest


def _in_many_digits(height_to_width: float, theta: float) -> float:
    import mpmath

    # d is below 2^(exponent of r - exponent of the sine + 2); the sine is at least the spacing near pi.
    bits = math.frexp(height_to_width)[1] - math.frexp(min(theta, SPACING))[1] + MORE_BITS
    with mpmath.workprec(max(bits, 0) + MORE_BITS):
        return float(mpmath.fmod(2 * mpmath.mpf(height_to_width) * abs(mpmath.cot(mpmath.mpf(theta))), 2))


def crevice_retro(height_to_width: float, theta: Floats) -> Floats:
    """The probability of retroreflection in a crevice: the distance from d to the nearest even number."""
    rest = crossings_modulo_two(height_to_width, theta)
    return np.asarray(np.minimum(rest, 2.0 - rest))


def crevice_breakpoints(height_to_width: float, limit: int) -> tuple[Floats, float]:
    """The angles where d is a whole number, about ``limit`` at most, and the measure of the angles beyond them."""
    last = max((whole_number("limit", limit, 0, most=MOST_BREAKPOINTS) - 1) // 2, 0)
    if last == 0:
        return np.empty(0), 1.0
    steep = np.arctan(2.0 * height_to_width / np.arange(last, 0, -1))
    breakpoints = np.concatenate([steep, [0.5 * np.pi], np.pi - steep[::-1]])
    return breakpoints, float(2.0 * SINE.cdf(steep[0]))
