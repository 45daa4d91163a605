"""Peers in the same run: installed in their own environment, each in a process with a time limit."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.core.tables import table

from .metastable import WELLS, Solution, metastable_table
from .pieces import PICTURE, draw_pieces, measure_pieces, pieces_table
from .timing import least_time

WORKER = Path(__file__).with_name("peer_worker.py")
# Name in `peer_worker`: precision and requirement. Embree is a system package, such as libembree-dev in Debian; its
# program needs numpy only. Mitsuba finds LLVM by itself or by DRJIT_LIBLLVM_PATH; on AMD Zen 4 19 works, 16 fails.
TRACERS = {"embree": ("single", "numpy"), "mitsuba": ("single", "mitsuba")}
CHAINS = {"deeptime": "deeptime", "pydtmc": "PyDTMC"}
INTRODUCTION = (
    "Every peer is run as its best users run it, in one thread: Embree from C, one call a ray segment; Mitsuba with "
    "the whole loop over reflections compiled by Dr.Jit, which needs a recent LLVM; deeptime told that the chain is "
    "reversible; scipy with shift and inversion. Direct simulation codes such as SPARTA are not measured: their time "
    "goes into moving particles between cells."
)
# Limits of single commands, and of all commands together.
MAKE_SECONDS, INSTALL_SECONDS, RUN_SECONDS, ALL_SECONDS = 60.0, 120.0, 40.0, 190.0
# Short timeouts, so that pip fails soon without an index.
PIP = ("--quiet", "--disable-pip-version-check", "--prefer-binary", "--timeout", "10", "--retries", "1")
RAYS, REPEATS, ANGLE = 2**17, 3, 0.7
# Maxwell's law in bins: an easy gap, and a gap that only an accurate solver distinguishes from 0.
BINS, GAPS = 256, (0.5, 1e-9)


def peer_tables(folder: Path) -> str:
    """Markdown tables of rays and spectra computed by the peers and by asperity."""
    peers = PeerEnvironment(folder / "environment")
    folder.mkdir(parents=True, exist_ok=True)
    wells = metastable_table({"deeptime": lambda matrix: _deeptime_wells(folder, peers, matrix)})
    pieces = measure_pieces(folder, peers, TRACERS)
    draw_pieces(pieces, folder / PICTURE)
    return "\n\n".join([INTRODUCTION, _tracers(folder, peers), pieces_table(pieces), _chains(folder, peers), wells])


class PeerEnvironment:
    """The peers' own Python, created in a folder at the first use; each package is installed once.

    Parameters
    ----------
    folder : Path
        An environment left there by an earlier run is reused.
    """

    def __init__(self, folder: Path) -> None:
        self.python = folder / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")
        self._folder, self._end = folder, time.monotonic() + ALL_SECONDS
        self._refusals: dict[str, str] = {}

    def run(self, peer: str, package: str, data: Path) -> dict[str, Any] | str:
        """The result of the peer's function in `peer_worker`, or the reason of its failure in words."""
        if package not in self._refusals:
            self._refusals[package] = self._make() or self._install(package)
        if self._refusals[package]:
            return self._refusals[package]
        output, refusal = self._output([str(self.python), str(WORKER), peer, str(data)], RUN_SECONDS)
        if refusal:
            return f"fails: {refusal}"
        answer: dict[str, Any] = json.loads(output.splitlines()[-1])
        return answer

    def _make(self) -> str:
        if self.python.exists() and not self._output([str(self.python), "-m", "pip", "--version"], RUN_SECONDS)[1]:
            return ""
        _, refusal = self._output([sys.executable, "-m", "venv", "--clear", str(self._folder)], MAKE_SECONDS)
        return f"no environment: {refusal}" if refusal else ""

    def _install(self, package: str) -> str:
        command = [str(self.python), "-m", "pip", "install", *PIP, "numpy", package]
        _, refusal = self._output(command, INSTALL_SECONDS)
        return f"cannot be installed: {refusal}" if refusal else ""

    def _output(self, command: list[str], seconds: float) -> tuple[str, str]:
        """The output of a command, and the reason of its failure in words, or an empty string."""
        limit = min(seconds, self._end - time.monotonic())
        if limit <= 0.0:
            return "", "the peers' time was up"
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=limit, check=False)
        except subprocess.TimeoutExpired:
            return "", f"ended after {limit:.0f} s"
        except OSError as reason:
            return "", str(reason)
        return done.stdout, _last_line(done.stderr or done.stdout) if done.returncode else ""


def _tracers(folder: Path, peers: PeerEnvironment) -> str:
    wall, rng = geo.triangular_teeth(ANGLE), np.random.default_rng(0)
    x, theta = rng.random(RAYS), np.arccos(1.0 - 2.0 * rng.random(RAYS))
    traced, seconds = least_time(lambda: geo.trace(wall, x, theta, threads=1), REPEATS)
    rate = RAYS / seconds
    data = folder / "rays.npz"
    np.savez(data, corners=wall.vertices, x=x, theta=theta, out=traced.theta)
    lost = float(np.mean(~traced.escaped))
    rows = [f"asperity, one thread | - | double | {rate / 1e6:.3g} | - | reference | {lost:.1e}"]
    for peer, (precision, package) in TRACERS.items():
        found = peers.run(peer, package, data)
        if isinstance(found, str):
            rows.append(f"{peer} | - | {precision} | {found} | - | - | -")
        else:
            speed = f"{found['rate'] / 1e6:.3g} | {rate / found['rate']:.3g}"
            rows.append(
                f"{peer} | {found['version']} | {precision} | {speed} | {found['wrong']:.1e} | {found['lost']:.1e}"
            )
    heads = "tracer of triangular teeth | version | precision | million rays/s | asperity is faster by | wrong | lost"
    return table(heads, rows)


def _chains(folder: Path, peers: PeerEnvironment) -> str:
    rows = []
    for gap in GAPS:
        matrix = ker.discretise(ker.maxwell(gap), ker.Bins(BINS))
        found, seconds = least_time(lambda matrix=matrix: spec.spectrum(matrix, k=2).gap, REPEATS)
        rows.append(f"asperity | - | {gap:g} | {found:.6g} | {abs(found / gap - 1.0):.1e} | {seconds:.2g}")
        data = folder / "chain.npz"
        np.savez(data, matrix=matrix.array, gap=gap)
        for peer, package in CHAINS.items():
            answer = peers.run(peer, package, data)
            if isinstance(answer, str):
                rows.append(f"{peer} | - | {gap:g} | {answer} | - | -")
            else:
                value = answer["gap"]
                figures = "none | -" if value is None else f"{value:.6g} | {abs(value / gap - 1.0):.1e}"
                rows.append(f"{peer} | {answer['version']} | {gap:g} | {figures} | {answer['seconds']:.2g}")
    return table("gap of a chain | version | right | found | relative error | seconds", rows)


def _deeptime_wells(folder: Path, peers: PeerEnvironment, matrix: csr_array[Any]) -> Solution:
    """Eigenvalues of a sparse chain by deeptime, timed without the start of the process."""
    data = folder / "wells.npz"
    np.savez(data, entries=matrix.data, columns=matrix.indices, starts=matrix.indptr, wanted=WELLS)
    answer = peers.run("deeptime_wells", CHAINS["deeptime"], data)
    if isinstance(answer, str):
        raise RuntimeError(answer)
    return Solution(np.array(answer["values"]), f"none; {answer['version']}", answer["seconds"])


def _last_line(text: str) -> str:
    lines = [line for line in text.splitlines() if line.strip()]
    return lines[-1].strip().replace("|", "/") if lines else "no message"
