"""The exceptions of asperity: each message says what was expected, what came, and what to do."""

from .core.errors import AccuracyError, AsperityError, FileExistsRefusal, InputError, ProofError, WallError

__all__ = ["AccuracyError", "AsperityError", "FileExistsRefusal", "InputError", "ProofError", "WallError"]
