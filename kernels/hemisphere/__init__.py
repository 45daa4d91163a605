"""Laws on the half sphere of velocities of walls with grooves, from planar laws."""
