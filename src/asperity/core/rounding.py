"""The rounding of double precision, in which tolerances are measured."""

from __future__ import annotations

# The distance from 1 to the next double; one operation is wrong by half of it at most.
EPS = 2.0**-52
UNIT_ROUNDOFF = 2.0**-53
