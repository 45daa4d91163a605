"""Settings that every test shares."""

import os

from hypothesis import settings
from threadpoolctl import threadpool_limits

# The rooms are collected once, through src/asperity, under the names by which they are imported.
collect_ignore = ["kernels", "geometry", "spectral"]

# Pictures are drawn to files; no test may open a window.
os.environ.setdefault("MPLBACKEND", "Agg")

# Reports of long calls would be found among the errors of commands; their own tests ask for them.
os.environ.setdefault("ASPERITY_QUIET", "1")

# The tests share out the cores themselves; a linear algebra with threads of its own would only get in their way.
for library in ("OMP", "OPENBLAS", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")
# a plugin of pytest has loaded numpy before
threadpool_limits(1)

# The same examples in every run; a first call may compile for seconds, which says nothing about the law under test.
settings.register_profile("asperity", deadline=None, derandomize=True)
settings.load_profile("asperity")


def pytest_report_header() -> str:
    """Whether the processor has AVX-512: the tests must pass with and without."""
    from llvmlite.binding import get_host_cpu_features

    return f"processor: {'with' if get_host_cpu_features().get('avx512f') else 'without'} AVX-512"
