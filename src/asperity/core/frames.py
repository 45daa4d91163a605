"""Tables as data frames of pandas."""

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
