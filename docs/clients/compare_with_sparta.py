"""Laws in SPARTA beside asperity's numbers: ``python compare_with_sparta.py path/to/spa_serial`` in a folder with
in.channel, in.plate, plate.surf and SPARTA's ar.species. It writes the tables and takes twenty minutes."""

import subprocess
import sys

import numpy as np

from asperity import Estimate
from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec

# Argon as in ar.species, and timestep / fnum of in.plate.
MASS, PER_PARTICLE, ENTERING = 6.63e-26, 1e-3 / 1e-5, 2000
MOST_PROBABLE_SPEED = float(np.sqrt(2.0 * 1.380649e-23 * 300.0 / MASS))
STUDENT_20 = 2.093  # for 95 % and the mean of 20 blocks
TOLERANCE = 3e-4

ARCS = ker.CircularArcLaw(1.2)
LOPSIDED = ker.WallLaw(geo.Wall.from_function(lambda x: 0.25 * np.cos(2 * np.pi * x) + 0.08 * np.sin(4 * np.pi * x)))
SURFACE = ker.SurfaceLaw(geo.Surface.random(geo.HeightCorrelation(0.12), 48, rms_slope=0.7, rng=2))
GROOVES = ker.HemisphereLaw(ARCS)
TABLES = {
    "arcs": lambda: ARCS.table(256, 257),
    "lopsided": lambda: LOPSIDED.table(256, 257, 1e-3),
    "grooves": lambda: GROOVES.table(32, 33, 65, tolerance=3e-3),
    "surface": lambda: SURFACE.table(32, 33, 65, tolerance=3e-3),
}


def run(program, script, table, **given):
    """Run a script of SPARTA with variables."""
    variables = [word for name, value in given.items() for word in ("-var", name, str(value))]
    quiet = ["-log", "none", "-screen", "none"]
    subprocess.run([program, "-in", script, *quiet, "-var", "table", f"{table}.csv", *variables], check=True)


def channel(program, table, steps=5000, **orientation):
    """The transmission of a slit ten times as long as high, with the error of counts and of particles still inside."""
    run(program, "in.channel", table, steps=steps, **orientation)
    value, energy, left = np.loadtxt("channel.out")
    assert abs(energy) < 1e-12, "the walls took no energy"
    entered = ENTERING * steps
    error = 1.96 * float(np.sqrt(value * (1.0 - value) / entered)) + left / entered
    return Estimate(float(value), error, "estimate", "counts")


def plate(program, table, vx, vy, temperature, steps):
    """Momentum along the plate and away from it that a particle leaves on a side, in units of the drift; 20 blocks."""
    run(program, "in.plate", table, vx=vx, vy=vy, temp=temperature, steps=steps)
    rows = np.loadtxt("plate.out")[:, 1:].reshape(20, 2, 4)
    # a beam hits one side, a gas both
    n, fx, fy, energy = np.moveaxis(rows[:, rows[0, :, 0] > 0], -1, 0)
    assert abs(energy.sum() * PER_PARTICLE) < 1e-12 * 0.5 * MASS * MOST_PROBABLE_SPEED**2 * n.sum()
    scale = PER_PARTICLE / (MASS * np.hypot(vx, vy))
    return [(scale * np.sign(v) * f / n).mean(axis=1) for v, f in ((vx, fx), (vy, fy))]


def estimate(blocks):
    """Mean and error of blocks."""
    return Estimate(float(blocks.mean()), STUDENT_20 * float(blocks.std(ddof=1)) / 20**0.5, "estimate", "20 blocks")


def row(quantity, law, measured, expected, error=None):
    """A row of the page, with no more than six digits of asperity's number."""
    value, error = (expected.value, expected.error) if error is None else (expected, error)
    print(f"| {quantity} | {law} | {measured} | {Estimate(float(value), max(float(error), 1e-6), 'estimate', '')} |")


def beam(program, name, degrees, side, law, normal_of_diffuse, steps=400):
    """Coefficients of a cold beam at 1000 m/s, from above (side -1) or below (1), at this angle with the normal."""
    sine, cosine = np.sin(np.radians(degrees)), np.cos(np.radians(degrees))
    along, away = plate(program, name, 1000.0 * sine, side * 1000.0 * cosine, 1e-6, steps)
    # asperity counts angles of the reversed velocity, and a surface's from 0 on
    found = spec.accommodation(law, TOLERANCE, incidence_deg=abs(degrees) if law is SURFACE else -degrees)
    tangential, normal = estimate(along / abs(sine)), estimate((2 * cosine - away) / (cosine - normal_of_diffuse))
    way = "along x" if degrees > 0 else "against x"
    row(f"tangential, beam {way}", name, tangential, found.tangential_at[0], found.tangential_errors[0])
    row(f"normal, beam {way}", name, normal, found.normal_at[0], found.normal_errors[0])


def write_tables():
    """The files that SPARTA reads."""
    for name, made in TABLES.items():
        table = made()
        table.save(f"{name}.csv", overwrite=True)
        print(f"{name}: errors {table.error:.2g} and {table.distribution_error:.2g}", flush=True)


def channels(program):
    """Transmissions; grooves in random directions by the table of their cross section and by that of directions."""
    row("transmission", "arcs", channel(program, "arcs"), spec.transmission(ARCS, 10.0))
    row("transmission", "lopsided", channel(program, "lopsided"), spec.transmission(LOPSIDED, 10.0, tolerance=2e-4))
    mean = spec.transmission(GROOVES, 10.0, tolerance=4e-4)
    row("transmission", "arcs, random", channel(program, "arcs", floor="random", ceiling="random"), mean)
    row("transmission", "grooves", channel(program, "grooves"), mean)
    row("transmission", "surface", channel(program, "surface"), spec.transmission(SURFACE, 10.0, tolerance=4e-4))


def plates(program):
    """Accommodation by a gas that drifts slowly, and by a beam; the lopsided wall feels the beam from either side."""
    for name, law in (("arcs", ARCS), ("lopsided", LOPSIDED), ("grooves", GROOVES), ("surface", SURFACE)):
        along, _ = plate(program, name, 0.1 * MOST_PROBABLE_SPEED, 0.0, 300.0, 4000)
        row("tangential, slow drift", name, estimate(along), spec.accommodation(law, TOLERANCE).tangential)
    beam(program, "arcs", 60, -1, ARCS, np.pi / 4)
    beam(program, "lopsided", 60, -1, LOPSIDED, np.pi / 4)
    beam(program, "lopsided", -60, 1, LOPSIDED, np.pi / 4)
    beam(program, "surface", 60, -1, SURFACE, 2 / 3)


if __name__ == "__main__":
    write_tables()
    channels(sys.argv[1])
    plates(sys.argv[1])
