"""Ctrl-C ends long compiled work within a second: in another process, which is sent the signal while it computes."""

from __future__ import annotations

import os
import signal
import time

import pytest

from commands import started

pytestmark = pytest.mark.skipif(os.name != "posix", reason="a signal to another process is sent differently here")

# A floor of many curved pieces under a disk: flat rays above it meet neither for 10^6 cells.
OPEN_WALL = """
import numpy as np
from asperity import geometry as geo, kernels as ker
x = np.linspace(0.0, 1.0, 151)
floor = [
    geo.Bezier([(a, -1.0), (0.5 * (a + b), -1.001), (b, -1.0)]) for a, b in zip(x.tolist(), x[1:].tolist())
]
wall = geo.Wall(floor, islands=[[geo.Arc((0.5, -0.5), 0.01, 0.0, -2.0 * np.pi)]])
few = geo.Wall([geo.Segment((0, -1), (1, -1))], islands=[[geo.Arc((0.5, -0.5), 0.01, 0.0, -2.0 * np.pi)]])
"""
LONG_WORK = {
    "one ray": ("geo.trace(wall, 0.3, {angle})", "1e-14"),
    "many rays": ("geo.trace(few, np.full(100_000, 0.3), {angle}, threads=1)", "1e-14"),
    "discretise": (
        "ker.discretise(ker.WallLaw(wall), ker.Bins(8), method='qmc', tolerance={angle}, samples=2**24, "
        "rng=np.random.default_rng(0))",
        "1e-12",
    ),
    "collide": (
        "geo.collide(geo.Disk(), few, 1e-6, np.zeros((100_000, 2)), [[1.0, -{angle}, 0.0]], threads=1)",
        "1e-9",
    ),
}
# Seconds in which the call must end, and the process: an idle machine takes a tenth of one, and half of one.
SOON, ENDED = 3.0, 20.0


@pytest.mark.parametrize("name", LONG_WORK)
def test_an_interrupt_ends_long_work_soon(name):
    call, hard = LONG_WORK[name]
    # the same call on harmless numbers compiles what is needed before the signal may come
    easy = call.replace("100_000", "10").replace("2**24", "2**10").replace("wall, 0.3", "few, [0.3] * 40")
    # a process started in the background ignores the signal, and so do its children
    program = "import signal\nsignal.signal(signal.SIGINT, signal.default_int_handler)\n"
    program += f"{OPEN_WALL}\ntry:\n    {easy.format(angle='1.0')}\nexcept ValueError:\n    pass\n"
    program += "import time\nprint('ready', flush=True)\n"
    program += f"try:\n    {call.format(angle=hard)}\nexcept KeyboardInterrupt:\n    print(time.time())\n    raise\n"
    with started("-c", program) as process:
        try:
            assert process.stdout.readline() == "ready\n"
            time.sleep(0.3)
            process.send_signal(signal.SIGINT)
            sent = time.time()
            caught, errors = process.communicate(timeout=ENDED)
        finally:
            process.kill()
    assert errors.rstrip().endswith("KeyboardInterrupt")
    assert float(caught) - sent < SOON
