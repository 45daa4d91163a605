"""sympy and the symbols of the disk, loaded when a check first uses them: the rows are listed without."""

from __future__ import annotations

from importlib import import_module
from typing import Any


class _Loaded:
    """A module by its name."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __getattr__(self, attribute: str) -> Any:
        return getattr(import_module(self._name), attribute)


sp: Any = _Loaded("sympy")
sym: Any = _Loaded("asperity.geometry.disk.symbolic")
