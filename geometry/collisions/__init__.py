"""The collision of a disk with satellites, in the plane and in the straightened configuration space."""
