"""Intervals that contain eigenvalues of a law, and the trial functions, residuals and norms behind them."""
