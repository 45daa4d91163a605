"""The rays into a polygonal hollow, divided exactly into beams of equal itinerary."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, frozen, number_between, whole_number
from ..tracing.threads import interruptibly
from .compiled.columns import (
    PIECE_COSINE,
    PIECE_HIGH,
    PIECE_LOW,
    PIECE_OFFSET,
    PIECE_SINE,
    TAG_BOUNCES,
    TAG_LEAF,
    TAG_LEFT,
    TAG_SIGN,
)
from .triangulation import triangulated

TOLERANCE = 1e-13
MAX_BEAMS = 200_000


@dataclass(frozen=True, eq=False)
class Beams:
    r"""Where a polygonal hollow sends every ray, as a list of pieces on which the law is one formula.

    Row k: for low < theta < high and X uniform over the hollow's opening, with probability
    sine + cosine cot(theta) the ray leaves at theta' = sign theta + offset after so many bounces. A *leaf* is the set
    of all rays with one itinerary; it has a row for every interval of theta between two vertices of its polygon.

    Parameters
    ----------
    sign : array of int8
        +1 or -1.
    offset : array
        Radians; equal isometries are equal within an ulp or two.
    low, high : arrays
        The piece's interval of theta, radians.
    sine, cosine : arrays
        The probability times sin(theta) is sine sin(theta) + cosine cos(theta).
    leaf, bounces : arrays of int
        The number of the leaf, and of its reflections.
    unresolved : float
        Share of the opening's flux, sin(theta)/2 dtheta dx/width, whose outgoing angle was not resolved.
    unresolved_low, unresolved_high, unresolved_sine, unresolved_cosine : arrays
        Where that flux is, in pieces likewise.
    defect : float
        Distance of the flux of all pieces together from 1.
    rounding : float
        Bound on the fraction of the flux that double precision may have put into the wrong leaf.
    complete : bool
        Whether ``unresolved`` met the tolerance; if not, the budget of beams ran out.
    """

    sign: NDArray[np.int8]
    offset: Floats
    low: Floats
    high: Floats
    sine: Floats
    cosine: Floats
    leaf: NDArray[np.int64]
    bounces: NDArray[np.int64]
    unresolved: float
    unresolved_low: Floats
    unresolved_high: Floats
    unresolved_sine: Floats
    unresolved_cosine: Floats
    defect: float
    rounding: float
    complete: bool

    @property
    def leaf_count(self) -> int:
        """The number of leaves."""
        return int(self.leaf[-1]) + 1 if len(self.leaf) else 0

    def flux(self) -> Floats:
        """Share of the opening's flux in each piece, shape (pieces,)."""
        return _flux(self.low, self.high, self.sine, self.cosine)

    def resolved(self) -> float:
        """Share of the opening's flux in all pieces together."""
        return float(self.flux().sum())


def beams_of(
    hollow_vertices: ArrayLike,
    *,
    tolerance: float = TOLERANCE,
    max_beams: int = MAX_BEAMS,
    mirror_symmetric: bool = False,
) -> Beams:
    """Sort the rays into a polygonal hollow into beams that are reflected alike.

    The hollow is cut into triangles and carried along by unfolding; a beam is a convex polygon in the projective plane
    of lines, which every triangle divides by the line through its third vertex. The largest beam is divided first.

    Parameters
    ----------
    hollow_vertices : array_like of shape (n, 2)
        The chain from (left, 0) to (right, 0), with the hollow above it: ``wall.vertices[h.first : h.last + 1]``.
    tolerance : float
        Stop when the unresolved fraction of the flux is no more than this.
    max_beams : int
        Stop when there are so many beams; cavities with narrow necks never resolve completely.
    mirror_symmetric : bool
        The hollow is its own mirror image: carry half of the rays, those with theta < pi/2, and mirror the result.

    Returns
    -------
    Beams

    Raises
    ------
    InputError
        If the chain is no hollow; see `triangulated`.
    WallError
        If it crosses itself.

    Notes
    -----
    Cost: about a microsecond a beam, once compiled.

    Examples
    --------
    A right-angled notch: one reflection, or two and straight back.

    >>> beams = beams_of([(0, 0), (0.5, -0.5), (1, 0)])
    >>> sorted({(int(n), int(s)) for n, s in zip(beams.bounces, beams.sign)})
    [(1, -1), (2, 1)]
    >>> beams.unresolved, bool(abs(beams.resolved() - 1.0) < 1e-15)
    (0.0, True)
    """
    from .compiled.splitting import DONE, pieces_of, split_beams

    number_between("tolerance", tolerance, 0.0, 1.0, closed="low")
    whole_number("max_beams", max_beams, 2)
    triangulation = triangulated(hollow_vertices)
    width = triangulation.width
    entrances = 1 if mirror_symmetric else 2
    corners, real, whole, used, rounding, _, status = interruptibly(
        lambda: split_beams(triangulation.tables, tolerance, max_beams * entrances // 2, entrances)
    )
    rows, tags = pieces_of(corners, real, whole, used, width)
    if mirror_symmetric:
        rows, tags, rounding = *_with_mirror_images(rows, tags), 2.0 * rounding
    out = tags[:, TAG_LEFT] == 1
    leaving, rest = rows[out], rows[~out]
    unresolved = float(_flux_of(rest).sum())
    return Beams(
        sign=_fixed(tags[out, TAG_SIGN].astype(np.int8)),
        offset=frozen(leaving[:, PIECE_OFFSET]),
        low=frozen(leaving[:, PIECE_LOW]),
        high=frozen(leaving[:, PIECE_HIGH]),
        sine=frozen(leaving[:, PIECE_SINE]),
        cosine=frozen(leaving[:, PIECE_COSINE]),
        leaf=_fixed(tags[out, TAG_LEAF]),
        bounces=_fixed(tags[out, TAG_BOUNCES]),
        unresolved=unresolved,
        unresolved_low=frozen(rest[:, PIECE_LOW]),
        unresolved_high=frozen(rest[:, PIECE_HIGH]),
        unresolved_sine=frozen(rest[:, PIECE_SINE]),
        unresolved_cosine=frozen(rest[:, PIECE_COSINE]),
        defect=abs(float(_flux_of(rows).sum()) - 1.0),
        rounding=float(rounding) / (2.0 * width),
        complete=bool(status == DONE),
    )


def _flux(low: Floats, high: Floats, sine: Floats, cosine: Floats) -> Floats:
    """Half the integral of sine sin(theta) + cosine cos(theta), as products that do not cancel on short intervals."""
    middle, half = 0.5 * (low + high), np.sin(0.5 * (high - low))
    return np.asarray(half * (sine * np.sin(middle) + cosine * np.cos(middle)))


def _flux_of(rows: Floats) -> Floats:
    """The flux of each row of `pieces_of`."""
    return _flux(*rows[:, (PIECE_LOW, PIECE_HIGH, PIECE_SINE, PIECE_COSINE)].T)


def _with_mirror_images(rows: Floats, tags: NDArray[np.int64]) -> tuple[Floats, NDArray[np.int64]]:
    """The rows and tags of `pieces_of` with those of the mirror image: both angles replaced by pi minus them."""
    low, high, sine, cosine, offset = rows.T
    offset = np.where(tags[:, TAG_SIGN] > 0, -offset, 2.0 * np.pi - offset)
    images, named = np.column_stack([np.pi - high, np.pi - low, sine, -cosine, offset]), tags.copy()
    named[:, TAG_LEAF] += tags[tags[:, TAG_LEFT] == 1, TAG_LEAF].max(initial=-1) + 1
    return np.concatenate([rows, images]), np.concatenate([tags, named])


def _fixed(array: NDArray[Any]) -> NDArray[Any]:
    array = np.ascontiguousarray(array)
    array.setflags(write=False)
    return array
