"""Runs one peer, in the peers' own environment: ``python peer_worker.py PEER DATA.npz`` prints one line of JSON.

Imports nothing of asperity. Rays: x, theta in, theta out and hits by the reference; the wall is a tooth with the
vertices ``corners``. Spectra: a row-stochastic matrix and its right gap.
"""

from __future__ import annotations

import json
import sys
import time
from importlib.metadata import version
from itertools import pairwise

import numpy as np

MOST_BOUNCES = 100
# How far a ray is moved off a surface before it goes on: the usual remedy against hitting it again, and its cost.
STEP = 1e-6
# The z extent of the extruded wall.
DEPTH = 10.0
FEW_RAYS = 2_000


def triangles(corners):
    """The extruded polyline: two triangles an edge, numbered 2 k and 2 k + 1."""
    found = []
    for (x0, y0), (x1, y1) in pairwise(corners):
        a, b, c, d = (x0, y0, -DEPTH), (x1, y1, -DEPTH), (x1, y1, DEPTH), (x0, y0, DEPTH)
        found += [[a, b, c], [a, c, d]]
    return np.array(found, dtype=np.float32)


def bounce(corners, x, theta, nearest):
    """Outgoing angles (NaN: lost) with a peer's ``nearest(origins, directions)`` giving distance and triangle."""
    edges = np.diff(corners, axis=0)
    normals = np.column_stack([-edges[:, 1], edges[:, 0]]) / np.hypot(*edges.T)[:, None]
    point = np.column_stack([x, np.zeros((len(x), 2))])
    way = np.column_stack([-np.cos(theta), -np.sin(theta), np.zeros(len(x))])
    out, alive = np.full(len(x), np.nan), np.arange(len(x))
    for _ in range(MOST_BOUNCES):
        distance, triangle = nearest(point[alive].astype(np.float32), way[alive].astype(np.float32))
        missed = triangle < 0
        gone = alive[missed & (way[alive, 1] > 0.0)]
        out[gone] = np.arctan2(way[gone, 1], way[gone, 0])
        alive, hit, far = alive[~missed], triangle[~missed] // 2, distance[~missed]
        if not len(alive):
            break
        point[alive] += far[:, None] * way[alive]
        along = np.sum(way[alive, :2] * normals[hit], axis=1)
        way[alive, :2] -= 2.0 * along[:, None] * normals[hit]
        point[alive] += STEP * way[alive]
    return out


def embree(data):
    from embreex import mesh_construction, rtcore_scene

    scene = rtcore_scene.EmbreeScene()
    mesh_construction.TriangleMesh(scene, triangles(data["corners"]))

    def nearest(origins, directions):
        found = scene.run(origins, directions, output=1)
        return found["tfar"].astype(float), found["primID"].astype(int)

    return rays(data, nearest, "embreex")


def mitsuba(data):
    import mitsuba as mi

    mi.set_variant("llvm_ad_rgb")
    corners = triangles(data["corners"])
    mesh = mi.Mesh("wall", 3 * len(corners), len(corners))
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = mi.Float(corners.ravel())
    parameters["faces"] = mi.UInt32(np.arange(3 * len(corners), dtype=np.uint32))
    parameters.update()
    scene = mi.load_dict({"type": "scene", "wall": mesh})

    def nearest(origins, directions):
        ray = mi.Ray3f(mi.Point3f(*origins.T.copy()), mi.Vector3f(*directions.T.copy()))
        found = scene.ray_intersect_preliminary(ray)
        distance = np.array(found.t, dtype=float)
        triangle = np.array(found.prim_index).astype(int)
        return distance, np.where(np.isfinite(distance), triangle, -1)

    return rays(data, nearest, "mitsuba")


def billiards(data):
    """Two endless lines and a point: the package's only straight obstacle; one ray at a time."""
    from billiards import Billiard
    from billiards.obstacles import InfiniteWall

    corners = data["corners"]
    few = slice(0, FEW_RAYS)
    out = np.full(FEW_RAYS, np.nan)
    start = time.perf_counter()
    for k, (x, theta) in enumerate(np.column_stack([data["x"][few], data["theta"][few]])):
        walls = [InfiniteWall(a, b, inside="left") for a, b in pairwise(corners)]
        table = Billiard(walls)
        table.add_ball((x, 0.0), (-np.cos(theta), -np.sin(theta)))
        for _ in range(MOST_BOUNCES):
            seconds, _, _ = table.obstacles_next
            position, velocity = table.balls_position[0], table.balls_velocity[0]
            if velocity[1] > 0.0 and (
                not np.isfinite(seconds) or position[1] + velocity[1] * (seconds - table.time) > 0
            ):
                out[k] = np.arctan2(velocity[1], velocity[0])
                break
            if not np.isfinite(seconds):
                break
            table.bounce_ballobstacle()
    return judged(out, data["out"][few], time.perf_counter() - start, "billiards")


def rays(data, nearest, package):
    """Warm up on a few rays, then measure all."""
    bounce(data["corners"], data["x"][:8], data["theta"][:8], nearest)
    start = time.perf_counter()
    out = bounce(data["corners"], data["x"], data["theta"], nearest)
    return judged(out, data["out"], time.perf_counter() - start, package)


def judged(out, right, seconds, package):
    lost = np.isnan(out)
    # single precision holds an angle to 1e-7; a hundred bounces and a step of 1e-6 do not make 1e-3 of that
    wrong = ~lost & (np.abs(out - right) > 1e-3)
    return {
        "version": version(package), "rate": len(out) / seconds, "wrong": float(wrong.mean()),
        "lost": float(lost.mean()),
    }  # fmt: skip


def deeptime(data):
    from deeptime.markov.msm import MarkovStateModel

    start = time.perf_counter()
    values = np.sort(np.real(MarkovStateModel(data["matrix"]).eigenvalues(2)))
    return spectral(1.0 - values[0], data, time.perf_counter() - start, "deeptime")


def deeptime_wells(data):
    """The leading eigenvalues of a sparse chain."""
    from deeptime.markov.tools.analysis import eigenvalues
    from scipy.sparse import csr_matrix

    matrix = csr_matrix((data["entries"], data["columns"], data["starts"]))
    start = time.perf_counter()
    values = eigenvalues(matrix, k=int(data["wanted"]))
    seconds = time.perf_counter() - start
    return {"version": version("deeptime"), "seconds": seconds, "values": np.real(values).tolist()}


def pydtmc(data):
    from pydtmc import MarkovChain

    start = time.perf_counter()
    chain = MarkovChain(data["matrix"])
    slem = chain.spectral_gap
    return spectral(float("nan") if slem is None else float(slem), data, time.perf_counter() - start, "PyDTMC")


def spectral(gap, data, seconds, package):
    # JSON has no NaN
    found = gap if np.isfinite(gap) else None
    return {"version": version(package), "seconds": seconds, "gap": found, "right": float(data["gap"])}


if __name__ == "__main__":
    peer, file = sys.argv[1:]
    with np.load(file) as loaded:
        print(json.dumps(globals()[peer](dict(loaded))))
