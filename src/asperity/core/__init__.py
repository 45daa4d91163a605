"""The ground floor: checks of arguments, errors, estimates, rounding, checkpoints, workers and the version."""
