"""Surfaces that are rough in two directions: height maps, their files, and rays on them."""
