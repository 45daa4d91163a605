"""Collision laws of a disk: in the limit of small scale, of the true disk, and in billiards."""
