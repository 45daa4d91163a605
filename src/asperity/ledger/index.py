"""The index of the ledger: an entry for every checked formula of Rudzis 2022."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cache
from importlib import import_module
from pkgutil import iter_modules

from ..core.errors import InputError
from .entry import Entry, Finding

FOLDERS = ("plane", "disk", "proof")


@cache
def entries() -> tuple[Entry, ...]:
    """All entries, sorted by id; new files in the ledger's folders are found automatically.

    Examples
    --------
    >>> entries()[0].id
    'S1.01'
    """
    found: dict[str, Entry] = {}
    for folder in FOLDERS:
        package = import_module(f".{folder}", __package__)
        for module in iter_modules(package.__path__):
            for value in vars(import_module(f"{package.__name__}.{module.name}")).values():
                if isinstance(value, Entry) and found.setdefault(value.id, value) is not value:
                    raise InputError(f"{value.id}: expected one entry of this id, got two")
    return tuple(found[name] for name in sorted(found))


def selected(ids: Iterable[str]) -> tuple[Entry, ...]:
    """The entries whose id equals or starts with one of ``ids``; all entries if ``ids`` is empty.

    Raises
    ------
    InputError
        If one of ``ids`` is neither the id of an entry nor the beginning of one.
    """
    wanted = tuple(ids)
    if not wanted:
        return entries()
    for prefix in wanted:
        if not any(entry.id.startswith(prefix) for entry in entries()):
            raise InputError(f"{prefix}: no such entry; ids run from {entries()[0].id} to {entries()[-1].id}")
    return tuple(entry for entry in entries() if entry.id.startswith(wanted))


def findings(chosen: Iterable[Entry]) -> Iterator[Finding]:
    """Run the checks one by one and yield their findings."""
    for entry in chosen:
        yield entry.run()
