"""The collision of a disk with satellites, in the plane and on the straightened configuration space."""
