"""The machine and the software of a measurement, and the pinning of a process to cores."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from ...core.estimates import Summary

PACKAGES = ("asperity", "numpy", "scipy", "numba")


@dataclass(frozen=True, repr=False)
class Machine(Summary):
    """The machine and the software on which times were measured.

    Attributes
    ----------
    hardware : str
        Processor and number of cores; times on others are not comparable.
    software : str
        Pinning, system, and the versions of Python, asperity, numpy, scipy, numba and the BLAS library behind numpy.
    """

    hardware: str
    software: str

    @classmethod
    def here(cls) -> Machine:
        """This machine."""
        from threadpoolctl import threadpool_info

        core = _last_core()
        pools = {
            f"{pool['internal_api']} {pool['version']}" for pool in threadpool_info() if pool["user_api"] == "blas"
        }
        software = (
            "1 thread", "not pinned" if core is None else f"pinned to core {core}", platform.platform(),
            f"Python {platform.python_version()}", *(f"{name} {_version(name)}" for name in PACKAGES), *sorted(pools),
        )  # fmt: skip
        return cls(f"{_processor()}, {os.cpu_count() or 1} cores", ", ".join(software))

    def __str__(self) -> str:
        return f"{self.hardware}; {self.software}"


@contextmanager
def on_one_core() -> Iterator[None]:
    """Pin this thread and the threads it starts to one core, and the linear algebra to one thread."""
    from threadpoolctl import threadpool_limits

    core = _last_core()
    before = set() if core is None else os.sched_getaffinity(0)
    try:
        if core is not None:
            os.sched_setaffinity(0, {core})
        with threadpool_limits(limits=1):
            yield
    finally:
        if core is not None:
            os.sched_setaffinity(0, before)


def _last_core() -> int | None:
    """The last of the allowed cores, because the first one handles interrupts; None if the system cannot pin."""
    return max(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else None


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
