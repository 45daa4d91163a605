"""Intervals that hold eigenvalues of a law itself, and the trial functions, residuals and norms behind them."""
