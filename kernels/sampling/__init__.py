"""Kernel matrices estimated from sampled rays, with their sampling errors."""
