"""Collision laws of a disk: the limit law, the law of the true disk, and disks between walls."""
