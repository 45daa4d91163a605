"""The tolerances of the planar tracer, in units of the rounding error."""

from __future__ import annotations

from ...core.rounding import EPS

# A joint that a ray meets, or a hit that a joint meets, within this fraction of the hollow's size is not resolved in
# double precision: positions carry a few rounding errors of one ulp of the size each.
JOINT_ULPS = 16.0
# D = B^2 + 2 kappa |v|^2 F carries about eight rounding errors of B^2, and so does g of a Bezier piece at its extrema;
# below them hit and miss are not told apart.
TANGENT_ULPS = 16.0
# A hit closer to a ray's start than this fraction of the hollow's size is looked at again, because rounding may have
# put the start on either side of the piece. Within 16 ulps of a piece, a ray that meets it at 1e-8 or more is as close.
NEARBY = 2.0**-20
# The same as a multiple of the slack, JOINT_ULPS rounding errors of the hollow's size: all of them are powers of 2.
NEARBY_SLACKS = NEARBY / (JOINT_ULPS * EPS)
