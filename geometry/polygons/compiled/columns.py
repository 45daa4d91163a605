"""The columns of the tables of the function that splits beams; a slot of ``corners``, ``whole``, ``real`` is a beam."""

from __future__ import annotations

# corners[slot, i]: vertex i of the beam's polygon, which is a line; counterclockwise in (theta, p).
LINE_P = 0  # x at height 0 times sin(theta)
LINE_S = 1  # sin(theta)
LINE_C = 2  # cos(theta)
CUT_X = 3  # the unfolded point whose functional vanishes on the edge to vertex i + 1
CUT_Y = 4
VERTEX_COLUMNS = 5

# whole[slot], integers.
COUNT = 0  # number of vertices
EDGE = 1  # the triangle's edge through which the beam enters
SIGN = 2  # 1 or -1: orientation of the unfolding isometry
BOUNCES = 3
LEAF = 4  # 1 for a beam that has left the hollow
CUTS = 5  # splits in which the beam was the larger part, since it last was the smaller one
WHOLE_COLUMNS = 6

# real[slot]: the flux, then the unfolding isometry V -> R V + T in two parts each, and the rounding errors of T.
FLUX = 0
TURN = 1  # angle of R, radians
TURN_LOW = 2
T_X = 3
T_X_LOW = 4
T_Y = 5
T_Y_LOW = 6
ERROR_X = 7
ERROR_Y = 8
PRIORITY = 9  # flux expected to be cut off by the next split
REAL_COLUMNS = 10

# wall_lines: one row for each edge of the hollow.
WALL_NORMAL_X = 0  # unit normal
WALL_NORMAL_Y = 1
WALL_DISTANCE = 2  # distance of the line from the origin, along the normal
WALL_COLUMNS = 3

# Rows of `pieces_of`: an interval of theta (radians), the probability times sin(theta), the offset of theta'.
PIECE_LOW = 0
PIECE_HIGH = 1
PIECE_SINE = 2  # factor of sin(theta)
PIECE_COSINE = 3  # factor of cos(theta)
PIECE_OFFSET = 4  # radians
PIECE_COLUMNS = 5

# Tags of `pieces_of`, integers.
TAG_LEAF = 0  # number of the leaf
TAG_SIGN = 1
TAG_BOUNCES = 2
TAG_LEFT = 3  # 1 for rays that have left the hollow
TAG_COLUMNS = 4
