"""The exceptions of asperity: each message says what was expected, what came, and what to do."""

from __future__ import annotations

from typing import Any

# Exit code of a command that Ctrl-C ended, as shells report it.
INTERRUPTED = 130


class AsperityError(Exception):
    """Base class of every exception that asperity raises on purpose."""


class InputError(AsperityError, ValueError):
    """An argument is not what the function accepts."""


class WallError(InputError):
    """A wall breaks one of the conditions on its geometry; the message names the pieces and the position."""


class FileExistsRefusal(AsperityError, FileExistsError):
    """An existing file would have been overwritten; pass ``overwrite=True`` (or ``--force``) to allow it."""


class AccuracyError(AsperityError, ArithmeticError):
    """A computation could not reach the accuracy that its result needs.

    Attributes
    ----------
    defect : float
        The measured defect, in the norm that the message names.
    """

    def __init__(self, message: str, defect: float) -> None:
        super().__init__(message)
        self.defect = defect

    def __reduce__(self) -> tuple[type[AccuracyError], tuple[str, float], dict[str, Any]]:
        # exceptions are made again from their message alone, and come out of process pools so
        return type(self), (str(self), self.defect), self.__dict__


class ProofError(AsperityError, ArithmeticError):
    """A step of a proof fails, or a certificate does not prove what it claims; the message says which step."""


# users catch them, and read them in messages, by this name
for _error in (AsperityError, InputError, WallError, FileExistsRefusal, AccuracyError, ProofError):
    _error.__module__ = "asperity.errors"
