"""The fingerprint of the results: the sha256 of the bytes of each of a fixed set of calls.

A change that only moves or renames code must leave every line unchanged:

    python -m campaigns.fingerprint > before
    python -m campaigns.fingerprint > after
    diff before after

Both runs must use one machine, because rounding depends on the processor and the version of numpy. A refused call
counts by its message.
"""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any

import click
import numpy as np

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.errors import AsperityError

Call = Callable[[], Any]
RAYS, COLLISIONS = 20_000, 1_000
ENCLOSED = ("henyey-greenstein", "triangular", "arcs", "arcs of scatter", "wall: random polygon")


def digest(result: Any) -> str:
    """The first 16 digits of the sha256 of all numbers and texts in a result, in order."""
    sha = hashlib.sha256()
    for part in _parts(result):
        sha.update(part)
    return sha.hexdigest()[:16]


def _parts(result: Any) -> Iterator[bytes]:
    if dataclasses.is_dataclass(result) and not isinstance(result, type):
        # measured times differ from run to run
        for field in dataclasses.fields(result):
            if field.name not in ("seconds", "machine"):
                yield field.name.encode()
                yield from _parts(getattr(result, field.name))
    elif isinstance(result, np.ndarray) and result.dtype != object:
        yield str(result.shape).encode()
        yield np.ascontiguousarray(result).tobytes()
    elif isinstance(result, Mapping):
        for key, value in result.items():
            yield str(key).encode()
            yield from _parts(value)
    elif isinstance(result, list | tuple):
        for value in result:
            yield from _parts(value)
    elif isinstance(result, float | np.floating):
        yield float(result).hex().encode()
    elif isinstance(result, geo.Wall):
        yield repr(result).encode()
    elif result is None or isinstance(result, str | int | bool | np.generic):
        yield str(result).encode()
    else:
        yield type(result).__name__.encode()


def walls() -> dict[str, geo.Wall]:
    """The named walls with their defaults, and walls that use every part of the tracer."""
    found = {name: wall.build() for name, wall in geo.WALLS.items()}
    rng = np.random.default_rng(5)
    x = np.sort(rng.random(12))
    found["random polygon"] = geo.Wall.from_vertices(
        [(0.0, 0.0), *zip(x.tolist(), (-0.9 * rng.random(12) - 0.05).tolist(), strict=True), (1.0, 0.0)]
    )
    found["skew teeth"] = geo.Wall.from_vertices([(0, 0), (0.3, -0.8), (1, 0)])
    loop = [(0.4, -0.5), (0.6, -0.5), (0.5, -0.3)]
    sides = [geo.Segment(loop[i], loop[(i + 1) % 3]) for i in range(3)]
    floor = [geo.Segment(p, q) for p, q in zip([(0, 0), (0, -1), (1, -1)], [(0, -1), (1, -1), (1, 0)], strict=True)]
    found["island"] = geo.Wall(floor, islands=[sides])
    found["shifted arc"] = geo.Wall(
        [geo.Arc((0.5, -0.7), 0.5, np.pi, 1.5 * np.pi), geo.Arc((0.5, -0.7), 0.5, 1.5 * np.pi, 2.0 * np.pi)]
    )
    return found


def laws() -> dict[str, ker.Law]:
    """Laws of every kind, and compound laws."""
    retro, scatter, teeth = ker.retroreflection(), ker.henyey_greenstein(0.5), ker.RectangularTeethLaw(0.8)
    arcs = ker.CircularArcLaw(0.9)
    found: dict[str, ker.Law] = {
        "specular": ker.specular(),
        "retroreflection": retro,
        "lambertian": ker.lambertian(),
        "maxwell": ker.maxwell(0.5),
        "henyey-greenstein": scatter,
        "triangular": ker.TriangularTeethLaw(1.1),
        "rectangular": teeth,
        "arcs": arcs,
        "least resistance": ker.LeastResistanceLaw(),
        "mixture": 0.3 * teeth + 0.2 * ker.lambertian() + 0.5 * arcs,
        "teeth squared": teeth**2,
        "retro of scatter": retro @ scatter,
        "scatter of triangles": scatter @ ker.TriangularTeethLaw(1.1) @ scatter,
        "arcs of scatter": arcs @ scatter,
    }
    for name in ("random polygon", "skew teeth", "mushrooms", "koch", "double-parabola", "elliptical-arcs"):
        found[f"wall: {name}"] = ker.WallLaw(WALLS[name])
    return found


WALLS = walls()


def rays(wall: geo.Wall) -> Any:
    rng = np.random.default_rng(1)
    x, theta = wall.period * rng.random(RAYS), np.arccos(1.0 - 2.0 * rng.random(RAYS))
    traced = geo.trace(wall, x, theta)
    return traced.x, traced.theta, traced.collisions, traced.status


def collisions(wall: geo.Wall) -> Any:
    rng = np.random.default_rng(2)
    velocity = rng.normal(size=(COLLISIONS, 3))
    velocity[:, 1] = -np.abs(velocity[:, 1]) - 0.1
    return geo.collide(geo.Disk(1.0, 0.5), wall, 1e-3, rng.random((COLLISIONS, 2)), velocity)


def matrix(law: ker.Law, basis: ker.Basis, method: Any) -> Any:
    samples = None if method in ("auto", "exact", "quadrature") else 2**14
    found = ker.discretise(law, basis, method, tolerance=1e-6, samples=samples, rng=np.random.default_rng(4))
    return found.symmetric, found.method, found.error


def calls() -> Iterator[tuple[str, Call]]:
    """Every call with its name."""
    for name, wall in WALLS.items():
        yield f"rays: {name}", partial(rays, wall)
    for name in ("triangular-teeth", "focusing-arcs", "double-parabola", "rectangular-teeth"):
        yield f"collisions: {name}", partial(collisions, WALLS[name])
    bases = {"legendre": ker.Legendre(8), "bins": ker.Bins(12), "panels": ker.Panels(np.linspace(0.0, np.pi, 4), 3)}
    few, many = (np.linspace(0.05, 3.09, angles) for angles in (9, 500))
    for name, law in laws().items():
        yield f"apply: {name}", partial(law.apply, np.cos, few)
        yield f"sample: {name}", partial(law.sample, many, np.random.default_rng(3))
        for label, basis in bases.items():
            for method in ("auto", "exact", "quadrature", "qmc", "monte-carlo"):
                yield f"matrix: {name}, {label}, {method}", partial(matrix, law, basis, method)
        yield f"spectrum: {name}", partial(spec.spectrum, law, 4, tolerance=1e-4)
        yield f"gap: {name}", partial(spec.spectral_gap, law, tolerance=1e-4, rng=np.random.default_rng(6))
        yield f"edge: {name}", partial(spec.essential_edge, law)
        yield f"resistance: {name}", partial(ker.resistance, law, tolerance=1e-5)
        yield f"distance: {name}", partial(ker.distance, law, ker.lambertian(), kind="rows", tolerance=1e-2)
        if name in ENCLOSED:
            yield f"enclosures: {name}", partial(spec.enclosures, law, 3, tolerance=1e-6)
    yield "least resistance", partial(ker.extremal_resistance, 32)
    yield "diffusivity", partial(spec.diffusivity, ker.maxwell(0.5))


@click.command()
@click.option("--only", default="", help="Only the calls whose names contain this.")
def main(only: str) -> None:
    """Print one line for each call: the digest of its result, and its name."""
    for name, call in calls():
        if only in name:
            try:
                found = digest(call())
            except (AsperityError, TypeError) as refusal:
                found = digest(str(refusal))
            print(f"{found}  {name}", flush=True)


if __name__ == "__main__":
    main()
