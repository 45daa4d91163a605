"""Ctrl-C ends long work at once: in another process, which is sent the signal while it computes."""

import os
import signal
import time

import pytest

from commands import started

pytestmark = pytest.mark.skipif(os.name != "posix", reason="a signal to another process is sent differently here")

# Flat rays above a floor of many curved pieces, or few, under a disk meet neither for 10^6 cells.
PROGRAM = """
import signal, time
import numpy as np
from asperity import geometry as geo, kernels as ker, spectral as spec
# a process started in the background ignores the signal, and so do its children
signal.signal(signal.SIGINT, signal.default_int_handler)
x = np.linspace(0.0, 1.0, 151)
floor = [
    geo.Bezier([(a, -1.0), (0.5 * (a + b), -1.001), (b, -1.0)]) for a, b in zip(x.tolist(), x[1:].tolist())
]
wall = geo.Wall(floor, islands=[[geo.Arc((0.5, -0.5), 0.01, 0.0, -2.0 * np.pi)]])
few = geo.Wall([geo.Segment((0, -1), (1, -1))], islands=[[geo.Arc((0.5, -0.5), 0.01, 0.0, -2.0 * np.pi)]])
bumps = ker.WallLaw(geo.dispersing_arcs(1.0))
try:
    {easy}
except ValueError:
    pass
print("ready", flush=True)
try:
    {call}
except KeyboardInterrupt:
    print(time.time())
    raise
"""
# The same call on harmless numbers compiles what is needed before the signal may come; others begin in three seconds.
WARMED = {
    "one ray": ("geo.trace(wall, 0.3, {angle})", "1e-14"),
    "many rays": ("geo.trace(few, np.full(100_000, 0.3), {angle}, threads=1)", "1e-14"),
    "matrix": ("ker.discretise(ker.WallLaw(wall), ker.Bins(8), 'qmc', {angle}, samples=2**24, rng=0)", "1e-12"),
    "collide": (
        "geo.collide(geo.Disk(), few, 1e-6, np.zeros((100_000, 2)), [[1.0, -{angle}, 0.0]], threads=1)",
        "1e-9",
    ),
}
BEGUN = {
    "rays": "ker.discretise(bumps, ker.Bins(64), 'monte-carlo', samples=2**32)",
    "quadrature": "ker.discretise(bumps, ker.Bins(600), 'quadrature', 1e-12)",
    "gap": "spec.spectral_gap(ker.WallLaw(geo.mushrooms(0.3, 0.2)), 1e-9, time_limit=1e4)",
    "transmission": "spec.transmission(bumps, 20.0, tolerance=1e-7)",
    "proof": "spec.prove_gap(ker.CircularArcLaw(0.9), 1e-12)",
}
# Seconds in which the call must end, and the process: an idle machine takes a tenth of one, and half of one.
SOON, ENDED = 3.0, 20.0


@pytest.mark.parametrize("name", [*WARMED, *(pytest.param(name, marks=pytest.mark.slow) for name in BEGUN)])
def test_an_interrupt_ends_long_work_soon(name):
    if name in WARMED:
        call, hard = WARMED[name]
        easy = call.replace("100_000", "10").replace("2**24", "2**10").replace("wall, 0.3", "few, [0.3] * 40")
        program = PROGRAM.format(easy=easy.format(angle="1.0"), call=call.format(angle=hard))
    else:
        program = PROGRAM.format(easy="pass", call=BEGUN[name])
    with started("-c", program) as process:
        try:
            assert process.stdout.readline() == "ready\n"
            time.sleep(0.3 if name in WARMED else 3.0)
            process.send_signal(signal.SIGINT)
            sent = time.time()
            caught, errors = process.communicate(timeout=ENDED)
        finally:
            process.kill()
    assert "KeyboardInterrupt" in errors
    assert float(caught) - sent < SOON
