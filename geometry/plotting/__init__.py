"""Plots of walls with rays."""
