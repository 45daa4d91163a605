"""Rays on Bezier pieces against balls: the roots of the polynomials by flint, in 3,000 bits."""

from __future__ import annotations

import flint
import numpy as np
import pytest
from campaigns.judges.bezier_pieces import parabola_as_a_cubic, wall_with_inflections

from asperity import geometry as geo
from asperity.core.rounding import EPS
from asperity.geometry.scene.columns import END_X, END_Y, SIZE, START_X, START_Y, X1, X2, X3, Y1, Y2, Y3
from asperity.geometry.tracing.refinement import refined_trace

RAYS, BITS, NEAR = 100, 3_000, 2.0**-160
# Errors in units of eps times the amplification and the number of segments; errors made on the way may grow by more.
MOST = 32.0
BOTTOM = -np.sqrt(2.0)


WALLS = {
    "double parabola": geo.double_parabola(),
    "nearly quadratic": geo.Wall(
        [
            parabola_as_a_cubic((0, 0), (0, BOTTOM / 2), (0.5, BOTTOM), 1e-13),
            parabola_as_a_cubic((0.5, BOTTOM), (1, BOTTOM / 2), (1, 0), -1e-6),
        ]
    ),
    "nearly linear": geo.Wall(
        [
            geo.Bezier([(0, 0), (0.2, -0.3 + 1e-9), (0.3, -0.45), (0.4, -0.6)]),
            geo.Bezier([(0.4, -0.6), (0.6, -0.4 - 2e-15), (1, 0)]),
        ]
    ),
    "inflections": wall_with_inflections(),
    "nearly a cusp": geo.Wall([geo.Bezier([(0, 0), (0.999, -1.2), (0.001, -1.2), (1, 0)])]),
    "vertical ends": geo.Wall([geo.Bezier([(0, 0), (0, -0.6), (1, -0.6), (1, 0)])]),
}


def ball(number):
    return flint.arb(float(number))


def pieces_of(scene):
    """Coefficients of the pieces in x and in y; the highest takes each piece to its end."""
    for row in scene.beziers:
        degree = 3 if row[X3] or row[Y3] else 2
        lower = [[ball(row[c]) for c in columns[:degree]] for columns in ((START_X, X1, X2), (START_Y, Y1, Y2))]
        yield [[*part, ball(row[end]) - sum(part)] for part, end in zip(lower, (END_X, END_Y), strict=True)]


def hits_of(x, y, px, py, vx, vy):
    """Times and tangents of the hits from the front."""
    side = flint.arb_poly(x) * vy - flint.arb_poly(y) * vx - (px * vy - py * vx)
    for root in flint.acb_poly(side).roots(tol=2.0**-300, maxprec=3 * BITS):
        s = root.real
        if root.imag.contains(0) and s >= 0 and s <= 1 and side.derivative()(s) < 0:
            tangent = flint.arb_poly(x).derivative()(s), flint.arb_poly(y).derivative()(s)
            yield (flint.arb_poly(x)(s) - px) * vx + (flint.arb_poly(y)(s) - py) * vy, tangent


def trace_in_balls(pieces, x, theta):
    """Position, angle and number of hits at the exit."""
    px, py = ball(x), ball(0)
    vx, vy = -ball(theta).cos(), -ball(theta).sin()
    hits = 0
    while True:
        ahead = (hit for piece in pieces for hit in hits_of(*piece, px, py, vx, vy) if hit[0] > NEAR)
        time, (tx, ty) = min(ahead, key=lambda hit: float(hit[0]), default=(ball(np.inf), (None, None)))
        leave = -py / vy
        if vy > 0 and leave < time:
            return px + leave * vx, flint.arb.atan2(vy, vx), hits
        px, py = px + time * vx, py + time * vy
        w = 2 * (vy * tx - vx * ty) / (tx * tx + ty * ty)
        vx, vy, hits = vx + w * ty, vy - w * tx, hits + 1


@pytest.mark.parametrize("name", WALLS)
def test_rays_on_bezier_pieces_end_where_balls_say(name, monkeypatch):
    wall, rng = WALLS[name], np.random.default_rng(1)
    scene = wall.scene
    x, theta = rng.random(RAYS), np.arccos(1.0 - 2.0 * rng.random(RAYS))
    found = geo.trace(wall, x, theta)
    assert np.all(found.escaped)
    room = MOST * EPS * refined_trace(scene, x, theta).amplification * (found.collisions + 1)
    scale = 1.0 + scene.hollows[0, SIZE]
    monkeypatch.setattr(flint.ctx, "prec", BITS)
    pieces = list(pieces_of(scene))
    for i in range(RAYS):
        end, angle, hits = trace_in_balls(pieces, x[i], theta[i])
        assert found.collisions[i] == hits
        assert abs(float(end - ball(found.x[i]))) * np.sin(found.theta[i]) <= room[i] * scale
        assert abs(float(angle - ball(found.theta[i]))) <= room[i]
