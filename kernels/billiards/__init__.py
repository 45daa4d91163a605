"""Billiards with collision laws: one disk in a container, phase portraits, Lyapunov exponents, and gases of disks."""
