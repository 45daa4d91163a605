"""Campaigns of faults: odd arguments, damaged files, false formulas."""
