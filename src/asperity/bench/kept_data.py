"""References that are kept beside the code: JSON files that committed scripts have written."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any


@cache
def kept(file: str) -> dict[str, Any]:
    """The table in a JSON file of this folder, read once a process.

    Examples
    --------
    >>> sorted(kept("extreme_disks.json"))[:2]
    ['0.0001', '0.001']
    """
    table: dict[str, Any] = json.loads(Path(__file__).with_name(file).read_text(encoding="utf-8"))
    return table
