"""The work space of rays in waves: where the columns of its array begin. Loads numba.

The columns have constant distances, so the compiler knows that they do not overlap, and computes several rays at once.
"""

from __future__ import annotations

from ...scene.compiled.compiling import inlined

# Rays of a wave, and the distance of columns: not close to each other modulo 4 kB, where the processor takes a number
# that it reads for one that it has just written.
WAVE = 256
ROOM = WAVE + 56
# Of the rays: position, velocity, the piece on which they start and what was before it, bounces, and number.
PX, PY, VX, VY, OWN, BEFORE, BOUNCES, RAY = (ROOM * k for k in range(8))
STARTS = PX, PY, VX, VY, OWN, BEFORE
RAY_COLUMNS = *STARTS, BOUNCES, RAY
# Of their nearest hits so far: time, piece, and parameter on a Bezier piece; above 0, if rounding could change them.
TIME, PIECE, HIT_S, UNCERTAIN = (ROOM * k for k in range(8, 12))
# Of the hits: position, unit normal, and what a hit needs; whether the ray is not inside any more, and its velocity
# before the hit.
HIT_X, HIT_Y, HIT_NX, HIT_NY, NEED, GONE, OLD_VX, OLD_VY = (ROOM * k for k in range(12, 20))
BEFORE_HIT, AT_HIT = (PX, PY, VX, VY, TIME), (HIT_X, HIT_Y, HIT_NX, HIT_NY, NEED)
# Of rays that begin or end: velocity and angle.
END_VX, END_VY, END_ANGLE = (ROOM * k for k in range(20, 23))
WORK = ROOM * 23
# Of rays near a Bezier piece, in a second array of the same length: the part on which g falls, the values at its ends,
# the root, and whether there is one and it is still sought. In the first array: whether a ray is near.
LOW, HIGH, VALUE_LOW, VALUE_HIGH, ROOT, FALLS, SOUGHT = (ROOM * k for k in range(12, 19))
NEAR = ARC_TIME = END_VX
# Values of NEED: the hit may begin a run, or is at a corner.
BEFORE_RUN, AT_CORNER = 1.0, 2.0
# Numbers of pieces in OWN, PIECE and BEFORE: of a row of a table that of its kind plus the row; of the opening; and
# of no hit. After a hit on a curve, BEFORE is HIT_S.
NO_HIT, OPENING, ARCS, BEZIERS, LINES = 0.0, 1.0, 2.0**20, 2.0**30, 2.0**40
# Mask that tells the compiler that an index is not negative, so that it need not count from the end. A longer mask is
# an instruction whose register of one byte makes a step of a ray wait for that of the ray before, in some compilations.
NATURAL = (1 << 31) - 1


@inlined
def ray_at(work, i):
    """-> (px, py, vx, vy): the position and the velocity of ray i."""
    return work[PX + i], work[PY + i], work[VX + i], work[VY + i]
