"""The machine and the software of a measurement, and the pinning of a process to cores."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import MappingProxyType
from typing import Any

from ...core.estimates import Summary

PACKAGES = ("asperity", "numpy", "scipy", "numba")


@dataclass(frozen=True, repr=False)
class Machine(Summary):
    """The machine and the software on which times were measured.

    Attributes
    ----------
    processor : str
    cores : int
    threads : int
        Number of threads of the linear algebra, and of cores that the process was pinned to.
    pinned_to : tuple of int
        Numbers of these cores; empty if the system cannot pin.
    system, python : str
    versions : mapping of str to str
        Versions of asperity, numpy, scipy and numba.
    linear_algebra : str
        The BLAS library behind numpy.
    """

    processor: str
    cores: int
    threads: int
    pinned_to: tuple[int, ...]
    system: str
    python: str
    versions: MappingProxyType[str, str]
    linear_algebra: str

    @classmethod
    def here(cls, threads: int = 1) -> Machine:
        """This machine with the given number of threads."""
        from threadpoolctl import threadpool_info

        pools = {
            f"{pool['internal_api']} {pool['version']}" for pool in threadpool_info() if pool["user_api"] == "blas"
        }
        return cls(
            _processor(), os.cpu_count() or 1, threads, tuple(_cores(threads)), platform.platform(),
            platform.python_version(), MappingProxyType({name: _version(name) for name in PACKAGES}),
            ", ".join(sorted(pools)) or "unknown",
        )  # fmt: skip

    def as_dict(self) -> dict[str, Any]:
        """A dictionary of plain values for JSON."""
        return {**self.__dict__, "versions": dict(self.versions), "pinned_to": list(self.pinned_to)}

    @classmethod
    def of_dict(cls, data: dict[str, Any]) -> Machine:
        """The machine from the result of `as_dict`."""
        versions = MappingProxyType(dict(data["versions"]))
        return cls(**{**data, "versions": versions, "pinned_to": tuple(data["pinned_to"])})

    def is_comparable_with(self, other: Machine) -> bool:
        """Whether processor, cores and threads are the same, so that times may be compared."""
        return (self.processor, self.cores, self.threads) == (other.processor, other.cores, other.threads)

    def __str__(self) -> str:
        pinned = f"pinned to core {', '.join(map(str, self.pinned_to))}" if self.pinned_to else "not pinned"
        software = ", ".join(f"{name} {number}" for name, number in self.versions.items())
        return (
            f"{self.processor}, {self.cores} cores; {self.threads} thread{'s' * (self.threads > 1)}, {pinned}; "
            f"Python {self.python}, {software}, {self.linear_algebra}"
        )


@contextmanager
def on_few_cores(threads: int) -> Iterator[None]:
    """Pin this thread and the threads it starts to ``threads`` cores, and limit the threads of the linear algebra.

    The threads of the tracer inherit these cores.
    """
    from threadpoolctl import threadpool_limits

    chosen = _cores(threads)
    before = os.sched_getaffinity(0) if chosen else set()
    try:
        if chosen:
            os.sched_setaffinity(0, chosen)
        with threadpool_limits(limits=threads):
            yield
    finally:
        if chosen:
            os.sched_setaffinity(0, before)


def _cores(threads: int) -> list[int]:
    """The last of the allowed cores, because the first one handles interrupts; empty if the system cannot pin."""
    return sorted(os.sched_getaffinity(0))[-threads:] if hasattr(os, "sched_getaffinity") else []


def _processor() -> str:
    information = Path("/proc/cpuinfo")
    if information.exists():
        for line in information.read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
