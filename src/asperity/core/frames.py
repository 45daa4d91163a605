"""Tables as data frames of pandas, and arrays with coordinates of xarray."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any

from .errors import InputError


def data_frame(columns: Mapping[str, Any]) -> Any:
    """A pandas.DataFrame of named columns.

    Raises
    ------
    InputError
        If pandas is not installed.
    """
    try:
        pandas = import_module("pandas")
    except ImportError as reason:
        raise InputError("to_frame: needs pandas; install it with: pip install 'asperity[studies]'") from reason
    return pandas.DataFrame(dict(columns))


def data_array(values: Any, **described: Any) -> Any:
    """An xarray.DataArray, with its dimensions, coordinates, name and attributes.

    Raises
    ------
    InputError
        If xarray is not installed.
    """
    try:
        xarray = import_module("xarray")
    except ImportError as reason:
        raise InputError("to_xarray: needs xarray; install it with: pip install 'asperity[studies]'") from reason
    return xarray.DataArray(values, **described)
