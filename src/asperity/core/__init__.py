"""The ground floor: checks of arguments, errors, estimates, rounding and the version."""
