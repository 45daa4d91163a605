"""Reflection and collision laws of rough walls, with their spectra and errors.

The three rooms are ``geometry`` (walls, disks, tracers), ``kernels`` (laws and their matrices) and ``spectral``
(spectra and gaps); each is loaded when it is first used.

Examples
--------
>>> import asperity
>>> asperity.Estimate(0.5, 0.0, "bound", "closed form").value
0.5
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from .core.errors import AccuracyError, AsperityError, FileExistsRefusal, InputError, WallError
from .core.estimates import Estimate
from .core.version import __version__

if TYPE_CHECKING:
    from .verification import Verdict, verify

__all__ = [
    "AccuracyError",
    "AsperityError",
    "Estimate",
    "FileExistsRefusal",
    "InputError",
    "Verdict",
    "WallError",
    "__version__",
    "geometry",
    "kernels",
    "spectral",
    "verify",
]

_ROOMS = ("geometry", "kernels", "spectral")
# these two load numpy
_VERIFICATION = ("Verdict", "verify")


def __getattr__(name: str) -> Any:
    if name in _ROOMS:
        return import_module(f".{name}", __name__)
    if name in _VERIFICATION:
        return getattr(import_module(".verification", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
