"""Peers in the same run: installed into an environment of their own, each in a process with a time limit."""

from __future__ import annotations

import json
import subprocess
import sys
import time
import venv
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec

from .metastable import WELLS, Solver

WORKER = Path(__file__).with_name("peer_worker.py")
# name in `peer_worker` and requirements
TRACERS = {"embree": ("embreex",), "mitsuba": ("mitsuba",), "billiards": ("billiards",)}
CHAINS = {"deeptime": ("deeptime",), "pydtmc": ("PyDTMC",)}
INSTALL_SECONDS, RUN_SECONDS = 600.0, 120.0
RAYS, REPEATS, ANGLE = 2**17, 3, 0.7
# Maxwell's law in bins: a gap that any solver finds, and one that only a careful one tells from 0.
BINS, GAPS = 256, (0.5, 1e-9)


def peer_table(folder: Path) -> str:
    """Rays and spectra by the peers and by asperity, as Markdown."""
    folder.mkdir(parents=True, exist_ok=True)
    python = _environment(folder / "environment")
    return "\n".join([*_tracers(folder, python), "", *_chains(folder, python)])


def deeptime_solver(folder: Path) -> Solver:
    """Eigenvalues by deeptime, in a process of the peers' environment; its start is part of the time."""
    folder.mkdir(parents=True, exist_ok=True)
    python, data = _environment(folder / "environment"), folder / "wells.npz"
    # before anything is timed
    _install(python, CHAINS["deeptime"])

    def solve(matrix: csr_array[Any]) -> tuple[np.ndarray[Any, Any], str]:
        np.savez(data, entries=matrix.data, columns=matrix.indices, starts=matrix.indptr, wanted=WELLS)
        answer = _run(python, "deeptime_wells", CHAINS["deeptime"], data)
        if isinstance(answer, str):
            raise RuntimeError(answer)
        return np.array(answer["values"]), f"none; {answer['version']}, {answer['seconds']:.2f} s without its start"

    return solve


def _tracers(folder: Path, python: Path) -> list[str]:
    wall, rng = geo.triangular_teeth(ANGLE), np.random.default_rng(0)
    x, theta = rng.random(RAYS), np.arccos(1.0 - 2.0 * rng.random(RAYS))
    best = np.inf
    for _ in range(REPEATS):
        start = time.perf_counter()
        traced = geo.trace(wall, x, theta, threads=1)
        best = min(best, time.perf_counter() - start)
    data = folder / "rays.npz"
    np.savez(data, corners=wall.vertices, x=x, theta=theta, out=traced.theta)
    lines = [
        "| tracer of triangular teeth | version | million rays/s | wrong | lost |", "|---|---|---|---|---|",
        f"| asperity, one thread | - | {RAYS / best / 1e6:.3g} | reference | {float(np.mean(~traced.escaped)):.1e} |",
    ]  # fmt: skip
    for peer, packages in TRACERS.items():
        found = _run(python, peer, packages, data)
        if isinstance(found, str):
            lines.append(f"| {peer} | - | {found} | - | - |")
        else:
            rates = f"{found['rate'] / 1e6:.3g} | {found['wrong']:.1e} | {found['lost']:.1e}"
            lines.append(f"| {peer} | {found['version']} | {rates} |")
    return lines


def _chains(folder: Path, python: Path) -> list[str]:
    lines = ["| gap of a chain | version | right | found | relative error | seconds |", "|---|---|---|---|---|---|"]
    for gap in GAPS:
        matrix = ker.discretise(ker.maxwell(gap), ker.Bins(BINS))
        start = time.perf_counter()
        found = spec.spectrum(matrix, k=2).gap
        seconds = time.perf_counter() - start
        lines.append(f"| asperity | - | {gap:g} | {found:.6g} | {abs(found / gap - 1.0):.1e} | {seconds:.2g} |")
        data = folder / "chain.npz"
        np.savez(data, matrix=matrix.array, gap=gap)
        for peer, packages in CHAINS.items():
            answer = _run(python, peer, packages, data)
            if isinstance(answer, str):
                lines.append(f"| {peer} | - | {gap:g} | {answer} | - | - |")
            else:
                value = answer["gap"]
                figures = "none | -" if value is None else f"{value:.6g} | {abs(value / gap - 1.0):.1e}"
                lines.append(f"| {peer} | {answer['version']} | {gap:g} | {figures} | {answer['seconds']:.2g} |")
    return lines


def _environment(folder: Path) -> Path:
    """The interpreter of an environment that is made if it is not there."""
    python = folder / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")
    if not python.exists():
        venv.create(folder, with_pip=True)
    return python


def _run(python: Path, peer: str, packages: tuple[str, ...], data: Path) -> dict[str, Any] | str:
    """What the peer printed; or in words why it did not."""
    refusal = _install(python, packages)
    if refusal:
        return refusal
    try:
        command = [str(python), str(WORKER), peer, str(data)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=RUN_SECONDS, check=False)
    except subprocess.TimeoutExpired as reason:
        return f"ended after {reason.timeout:g} s"
    if done.returncode:
        return f"fails: {_last_line(done.stderr)}"
    answer: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return answer


@lru_cache
def _install(python: Path, packages: tuple[str, ...]) -> str:
    """Put packages into the environment, once; empty, or in words why they are not there."""
    command = [str(python), "-m", "pip", "install", "--quiet", "numpy", *packages]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=INSTALL_SECONDS, check=False)
    except subprocess.TimeoutExpired as reason:
        return f"cannot be installed within {reason.timeout:g} s"
    return f"cannot be installed: {_last_line(done.stderr)}" if done.returncode else ""


def _last_line(text: str) -> str:
    lines = [line for line in text.splitlines() if line.strip()]
    return lines[-1].strip().replace("|", "/") if lines else "no message"
