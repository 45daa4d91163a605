"""The columns of the tables of the functions that split beams; a row of ``vertices`` is a line, of ``real`` a beam."""

from __future__ import annotations

# Lines, the vertices of the polygons of beams, counterclockwise in (theta, p).
LINE_P = 0  # x at height 0 times sin(theta)
LINE_S = 1  # sin(theta)
LINE_C = 2  # cos(theta)
CUT_X = 3  # the unfolded point whose functional vanishes on the edge to the next vertex
CUT_Y = 4
VERTEX_COLUMNS = 5

# whole[beam], integers.
FIRST = 0  # row of the polygon's first vertex
COUNT = 1  # number of vertices
EDGE = 2  # the triangle's edge through which the beam enters
SIGN = 3  # 1 or -1: orientation of the unfolding isometry
BOUNCES = 4
WHOLE_COLUMNS = 5

# real[beam]: the flux and its divisor, then the unfolding isometry V -> R V + T in two parts each, and the rounding
# errors of T.
FLUX = 0
DIVISOR = 1  # flux / divisor is the priority, the flux expected to be cut off by the next split
TURN = 2  # angle of R, radians
TURN_LOW = 3
T_X = 4
T_X_LOW = 5
T_Y = 6
T_Y_LOW = 7
ERROR_X = 8
ERROR_Y = 9
REAL_COLUMNS = 10

# Rows of the pieces of a beam: an interval of theta (radians), the probability times sin(theta), the offset of theta'.
PIECE_LOW = 0
PIECE_HIGH = 1
PIECE_SINE = 2  # factor of sin(theta)
PIECE_COSINE = 3  # factor of cos(theta)
PIECE_OFFSET = 4  # radians
PIECE_COLUMNS = 5

# Tags of pieces, integers.
TAG_LEAF = 0  # number of the beam
TAG_SIGN = 1
TAG_BOUNCES = 2
TAG_COLUMNS = 3

# Codes in `Triangulation.beyond`: of edges at the opening or at a wall. Numbers >= 0 are edges of other triangles; a
# wall edge e has the code FIRST_WALL - e.
OPENING = -1
FIRST_WALL = -2
