"""How long a fresh process takes to import the package, and to make its first trace from a warm cache."""

from __future__ import annotations

import subprocess
import sys
import time

REPEATS = 5
SCRIPTS = {
    "python alone": "pass",
    "numpy": "import numpy",
    "import asperity": "import asperity",
    "first trace, warm cache": (
        "from asperity import geometry as geo; geo.trace(geo.focusing_arcs(1.2), [0.3, 0.4], [1.0, 2.0])"
    ),
}


def measure_start(repeats: int = REPEATS) -> dict[str, float]:
    """Least wall time of a process for each script, in seconds; the first run of each warms the caches."""
    return {what: min(_seconds(script) for _ in range(repeats + 1)) for what, script in SCRIPTS.items()}


def _seconds(script: str) -> float:
    start = time.perf_counter()
    subprocess.run([sys.executable, "-c", script], check=True)
    return time.perf_counter() - start
