"""Intervals that hold eigenvalues of a law itself, and the trial functions and residuals they rest on."""
