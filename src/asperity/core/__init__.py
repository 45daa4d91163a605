"""The ground floor: checks, errors, estimates, rounding and the version."""
