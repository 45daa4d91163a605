"""Runs one peer, in the peers' own environment: ``python peer_worker.py PEER DATA.npz`` prints one line of JSON.

It imports nothing of asperity. Every peer is run as its expert users run it. Data of rays: x, incoming theta, outgoing
theta of the reference, and the ``corners`` of the wall. Data of chains: a row-stochastic ``matrix``, and the number
``wanted`` of eigenvalues.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from importlib.metadata import version
from itertools import pairwise
from pathlib import Path

import numpy as np

MOST_BOUNCES = 100
# Distance by which a ray is moved off a surface, the usual remedy against hitting it again, which costs accuracy: this
# one, or a fraction of the mean width of a side.
STEP, SIDE_FRACTION = 1e-6, 0.01
# Fewer sides are rectangles, more are one mesh.
MOST_RECTANGLES = 8
# The z extent of the extruded wall.
DEPTH = 10.0
# The first run compiles.
RUNS = 4


def embree(data):
    """A C program, compiled here, with Embree's own interface and no Python between reflections."""
    source = Path(__file__).with_name("embree_peer.c")
    corners, x, theta = (np.asarray(data[name], np.float32) for name in ("corners", "x", "theta"))
    step = np.float32(step_off(corners))
    with tempfile.TemporaryDirectory() as folder:
        program, file = Path(folder) / "embree_peer", Path(folder) / "rays"
        flags = ["-O3", "-march=native", "-o", str(program), str(source), "-lembree3", "-lm"]
        subprocess.run(["cc", *flags], check=True)
        file.write_bytes(
            np.array([len(corners), len(x)], np.int32).tobytes()
            + step.tobytes()
            + b"".join(map(bytes, (corners, x, theta)))
        )
        told = subprocess.run([str(program), str(file)], check=True, capture_output=True, text=True).stdout
        out = np.frombuffer(file.read_bytes(), np.float32)[-len(x) :]
    seconds, found = told.split()
    return judged(out.astype(float), data["out"], float(seconds), found)


def mitsuba(data):
    """All reflections in one loop that Dr.Jit compiles with LLVM; the sides of the teeth are rectangles; one thread."""
    import drjit as dr
    import mitsuba as mi

    mi.set_variant("llvm_ad_rgb")
    dr.set_thread_count(1)
    corners, step = data["corners"], step_off(data["corners"])
    if len(corners) <= MOST_RECTANGLES + 1:
        sides = {f"side{k}": rectangle(mi, *pair) for k, pair in enumerate(pairwise(corners))}
    else:
        sides = {"sides": mesh(mi, corners)}
    scene = mi.load_dict({"type": "scene", **sides})
    x, theta = (mi.Float(data[name].astype(np.float32)) for name in ("x", "theta"))

    def goes_on(point, way, inside, bounces):
        return inside & (bounces < MOST_BOUNCES)

    def reflect(point, way, inside, bounces):
        ray = mi.Ray3f(point, way)
        found = scene.ray_intersect_preliminary(ray)
        surface = found.compute_surface_interaction(ray, mi.RayFlags.Minimal)
        inside = inside & found.is_valid()
        way = dr.select(inside, way - 2.0 * dr.dot(way, surface.n) * surface.n, way)
        return dr.select(inside, surface.p + step * way, point), way, inside, bounces + 1

    seconds = []
    for _ in range(RUNS):
        start = time.perf_counter()
        point, way = mi.Point3f(x, 0.0, 0.0), mi.Vector3f(-dr.cos(theta), -dr.sin(theta), 0.0)
        _, way, inside, _ = dr.while_loop((point, way, mi.Bool(x >= 0.0), mi.UInt32(0)), goes_on, reflect)
        out = dr.select(inside | (way.y <= 0.0), dr.nan, dr.atan2(way.y, way.x))
        dr.eval(out)
        dr.sync_thread()
        seconds.append(time.perf_counter() - start)
    return judged(np.array(out, dtype=float), data["out"], min(seconds), version("mitsuba"))


def step_off(corners):
    return float(min(STEP, SIDE_FRACTION * np.ptp(corners[:, 0]) / (len(corners) - 1)))


def mesh(mi, corners):
    """All sides, extruded: two triangles each."""
    vertices = np.column_stack([np.repeat(corners, 2, axis=0), np.tile([-DEPTH, DEPTH], len(corners))])
    halves = np.array([[0, 2, 1], [1, 2, 3]])
    faces = 2 * np.arange(len(corners) - 1)[:, None, None] + halves
    made = mi.Mesh("sides", len(vertices), faces.size // 3)
    buffers = mi.traverse(made)
    buffers["vertex_positions"], buffers["faces"] = vertices.astype(np.float32).ravel(), faces.astype(np.uint32).ravel()
    buffers.update()
    return made


def rectangle(mi, start, end):
    """One side of a tooth, extruded; the normal is on its left."""
    along = (end - start) / np.hypot(*(end - start))
    normal = np.array([-along[1], along[0], 0.0])
    frame = np.eye(4)
    frame[:3, 0] = *(0.5 * (end - start)), 0.0
    frame[:3, 1] = DEPTH * np.cross(normal, [*along, 0.0])
    frame[:3, 2] = normal
    frame[:2, 3] = 0.5 * (start + end)
    return {"type": "rectangle", "to_world": mi.ScalarTransform4f(frame)}


def judged(out, right, seconds, version):
    lost = np.isnan(out)
    # single precision resolves angles to 1e-7, and a hundred bounces and a step of 1e-6 stay below 1e-3
    error = np.where(lost, np.inf, np.abs(out - right))
    return {
        "version": version, "rate": len(out) / seconds, "wrong": float(np.mean(error[~lost] > 1e-3)),
        "lost": float(lost.mean()), "error": float(np.median(error)),
    }  # fmt: skip


def deeptime(data):
    """The leading eigenvalues of a chain."""
    from deeptime.markov.tools.analysis import eigenvalues

    matrix = data["matrix"]
    # with reversibility and the stationary law given, deeptime uses its symmetric solver
    uniform = np.full(matrix.shape[0], 1.0 / matrix.shape[0])
    start = time.perf_counter()
    values = eigenvalues(matrix, k=int(data["wanted"]), reversible=True, mu=uniform)
    seconds = time.perf_counter() - start
    return {"version": version("deeptime"), "seconds": seconds, "gaps": (1.0 - np.real(values)).tolist()}


if __name__ == "__main__":
    peer, file = sys.argv[1:]
    with np.load(file) as loaded:
        print(json.dumps(globals()[peer](dict(loaded))))
