"""A number together with its error: where the error comes from and how big it is."""

from .core.estimates import DECIMALS, LEVEL, NORMAL_95, ErrorKind, Estimate, student_95

__all__ = ["DECIMALS", "LEVEL", "NORMAL_95", "ErrorKind", "Estimate", "student_95"]
