"""Exact division of the rays into a polygonal hollow into beams of equal itinerary."""

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
    r"""The law of a polygonal hollow as a list of pieces, each with one formula.

    Piece k: for low < theta < high and X uniform over the hollow's opening, with probability
    sine + cosine cot(theta) the ray leaves at theta' = sign theta + offset after ``bounces`` bounces. A *leaf* is the
    set of all rays with one itinerary; it has one piece for every interval of theta between vertices of its polygon.

    Parameters
    ----------
    sign : array of int8
        +1 or -1.
    offset : array
        Radians; the offsets of equal isometries agree within one or two ulp.
    low, high : arrays
        The interval of theta of the piece, radians.
    sine, cosine : arrays
        The probability times sin(theta) is sine sin(theta) + cosine cos(theta).
    leaf, bounces : arrays of int
        The index of the leaf, and the number of reflections.
    unresolved : float
        Fraction of the opening's flux, sin(theta)/2 dtheta dx/width, without resolved outgoing angle.
    unresolved_low, unresolved_high, unresolved_sine, unresolved_cosine : arrays
        The pieces of the unresolved flux.
    defect : float
        Absolute difference between the total flux of all pieces and 1.
    rounding : float
        Bound on the fraction of the flux that double precision may have put into the wrong leaf.
    complete : bool
        Whether ``unresolved`` met the tolerance; if not, the limit of beams was reached.
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

    def flux(self) -> Floats:
        """Return the fraction of the opening's flux in each piece, shape (pieces,)."""
        return _flux(self.low, self.high, self.sine, self.cosine)

    def resolved(self) -> float:
        """Return the fraction of the opening's flux in all pieces together."""
        return float(self.flux().sum())


def beams_of(
    hollow_vertices: ArrayLike,
    *,
    tolerance: float = TOLERANCE,
    max_beams: int = MAX_BEAMS,
    mirror_symmetric: bool = False,
) -> Beams:
    """Divide the rays into a polygonal hollow into beams of equal itinerary.

    The hollow is triangulated, and the triangles are unfolded along the rays. A beam is a convex polygon in the
    projective plane of lines; every triangle divides it by the line through its third vertex. The beam
    that has the largest flux, divided by the number of slivers that it has lost in a row, is divided first.

    Parameters
    ----------
    hollow_vertices : array_like of shape (n, 2)
        The chain from (left, 0) to (right, 0), with the hollow above it: ``wall.vertices[h.first : h.last + 1]``.
    tolerance : float
        Largest unresolved fraction of the flux.
    max_beams : int
        Limit on the number of beams, and on the triangles that they pass, 64 for each; cavities with narrow necks never
        resolve completely.
    mirror_symmetric : bool
        Whether the hollow is its own mirror image: then only rays with theta < pi/2 are divided, and mirrored.

    Returns
    -------
    Beams

    Raises
    ------
    InputError
        If the chain is not a hollow; see `triangulated`.
    WallError
        If the chain crosses itself.

    Notes
    -----
    Cost: about 1 microsecond per beam, once compiled.

    Examples
    --------
    A right-angled notch reflects once, or twice with retroreflection:

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
    """Return half the integral of sine sin(theta) + cosine cos(theta), without cancellation on short intervals."""
    middle, half = 0.5 * (low + high), np.sin(0.5 * (high - low))
    return np.asarray(half * (sine * np.sin(middle) + cosine * np.cos(middle)))


def _flux_of(rows: Floats) -> Floats:
    """Return the flux of each row of `pieces_of`."""
    return _flux(*rows[:, (PIECE_LOW, PIECE_HIGH, PIECE_SINE, PIECE_COSINE)].T)


def _with_mirror_images(rows: Floats, tags: NDArray[np.int64]) -> tuple[Floats, NDArray[np.int64]]:
    """Return the rows and tags of `pieces_of` and of the mirror image, with theta and theta' replaced by pi - theta."""
    low, high, sine, cosine, offset = rows.T
    offset = np.where(tags[:, TAG_SIGN] > 0, -offset, 2.0 * np.pi - offset)
    images, named = np.column_stack([np.pi - high, np.pi - low, sine, -cosine, offset]), tags.copy()
    named[:, TAG_LEAF] += tags[tags[:, TAG_LEFT] == 1, TAG_LEAF].max(initial=-1) + 1
    return np.concatenate([rows, images]), np.concatenate([tags, named])


def _fixed(array: NDArray[Any]) -> NDArray[Any]:
    array = np.ascontiguousarray(array)
    array.setflags(write=False)
    return array
