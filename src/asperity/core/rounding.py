"""The rounding error of double precision, in units of which tolerances are given."""

from __future__ import annotations

# The distance from 1 to the next double; one operation is wrong by half of it at most.
EPS = 2.0**-52
UNIT_ROUNDOFF = 2.0**-53
