"""The tolerances of the planar tracer."""

from __future__ import annotations

from ...core.rounding import EPS

# Distance from a joint, in eps times the hollow's size, within which double precision does not resolve a hit:
# positions have a few rounding errors of one ulp of the size each.
JOINT_ULPS = 16.0
# Error, in eps times the size of the terms, below which a tangent hit and a miss are not distinguished. Each of B and F
# in D = B^2 + 2 kappa |v|^2 F has about eight rounding errors of its terms, see `pieces.tangent_error`; so has g of a
# Bezier piece at its extrema and at its ends.
TANGENT_ULPS = 16.0
# Largest angle, radians, between the tangents at a smooth joint. Both pieces then reflect a ray at the joint alike,
# within twice this angle. Tangents at joints meant to be smooth agree to a few rounding errors.
SMOOTH_JOINT = 1e-9
# Distance from the start of a ray, as a fraction of the hollow's size, within which a hit is tested again: rounding may
# have put the start on either side of the piece. From a start within 16 ulps of a piece, a ray at an angle of 1e-8 or
# more to the piece meets it within this distance.
NEARBY = 2.0**-20
# Margin of the circles about Bezier pieces, as a fraction of the sizes that NEARBY refers to: outside of them there is
# no hit, no contact and no hit to be tested again.
NEARBY_MARGIN = 4.0 * NEARBY
# NEARBY as a multiple of the slack, JOINT_ULPS rounding errors of the hollow's size; all are powers of 2.
NEARBY_SLACKS = NEARBY / (JOINT_ULPS * EPS)
# Margin of the boxes about lines, in units of the hollow's size: corners within the slack of a ray lie in boxes that it
# meets, and rounding in the test of a box loses none.
BOX_MARGIN = 4.0 * JOINT_ULPS * EPS
