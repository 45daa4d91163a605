"""The true disk at scales from 0.1 to 10^-8, against 50 digits; `true_disks` reverses it at the same scales."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from asperity import geometry as geo
from asperity.bench.problems import DISK
from asperity.core.rounding import EPS
from campaigns.engine import Campaign, Judged

# Written by campaigns/extremes/references.py
DATA = Path(__file__).with_name("extreme_disks.json")
# Measured errors are below 0.4; the limit is the limit for single rays.
UNITS = 32.0
SCALES = (1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8)
WALL = geo.triangular_teeth(0.7)


def judge(scale: float) -> Iterator[Judged]:
    """The stored disks against 50 digits, in units of EPS times the condition."""
    kind, rows = f"true disk, scale {scale:g}", json.loads(DATA.read_text(encoding="utf-8"))[f"{scale:g}"]
    start, exact = (np.array([[float.fromhex(number) for number in row[k]] for row in rows]) for k in (0, 1))
    contacts, condition = (np.array([row[k] for row in rows]) for k in (2, 3))
    found = geo.collide(DISK, WALL, scale, start[:, :2], start[:, 2:])
    error = np.abs(found.velocity - exact).max(axis=1) / (EPS * (1.0 + contacts) * condition)
    error[found.contacts != contacts] = np.inf
    for one, gone in zip(error, found.escaped, strict=True):
        yield Judged(kind, UNITS, float(one)) if gone else Judged(kind, outcome="degraded as reported")


CAMPAIGNS = (
    Campaign("extreme-disks", "Is the true disk right at all scales?", SCALES.__getitem__, judge, 6, range(6)),
)
