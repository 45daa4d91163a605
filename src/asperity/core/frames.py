"""Tables as data frames of pandas, and arrays with coordinates of xarray."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any

from .errors import InputError


def needed(library: str, method: str, extra: str = "studies") -> Any:
    """The module of an extra that a method needs.

    Raises
    ------
    InputError
        If it is not installed.
    """
    try:
        return import_module(library)
    except ImportError as reason:
        raise InputError(f"{method}: needs {library}; install it with: pip install 'asperity[{extra}]'") from reason


def data_frame(columns: Mapping[str, Any]) -> Any:
    """A pandas.DataFrame of named columns; an InputError if pandas is not installed."""
    return needed("pandas", "to_frame").DataFrame(dict(columns))


def data_array(values: Any, **described: Any) -> Any:
    """An xarray.DataArray, with its dimensions, coordinates, name and attributes; an InputError without xarray."""
    return needed("xarray", "to_xarray").DataArray(values, **described)
