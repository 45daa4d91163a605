"""The columns of the arrays of positions and velocities of disks, by name."""

from __future__ import annotations

# position of the disk, in units of its radius
X1 = 0  # x of the centre
ALPHA = 1  # angle of the disk, radians
# velocity
V1 = 0  # of the centre
V2 = 1
OMEGA = 2  # rate of the angle
