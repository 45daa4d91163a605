"""Kernel matrices from sampled rays, with their sampling errors."""
