"""Sections 1.2.2 and 1.2.3: reflection of a point particle by a wall, and the first example."""

from __future__ import annotations

from typing import Any

import numpy as np
import sympy as sp

from ...geometry.tracing.tracing import trace
from ...geometry.walls.named import dispersing_arcs, focusing_arcs, rectangular_teeth, triangular_teeth
from ...verification import Verdict, agreement, every, holds, verify
from ..entry import Code, by_reading, row

RAYS = 400
# Rounding error of a ray. It grows with curvature and bounces, both small here.
REFLECTED = 1e-10
# Central differences of step 1e-5: truncation is 1e-10 times third derivatives up to 1e4, rounding is 1e-11.
STEP, DIFFERENTIATED = 1e-5, 1e-4


def rays() -> tuple[Any, Any]:
    """Entry points and angles, away from grazing."""
    rng = np.random.default_rng(1)
    return rng.random(RAYS), rng.uniform(0.2, np.pi - 0.2, RAYS)


@row(
    id="S1.01",
    section="1.2.2",
    equation="Proposition on deterministic reflections (i)",
    kind="numeric",
    printed=r"P^W \circ P^W = \mathrm{id}",
    right=lambda theta: theta,
    wrong=lambda theta: np.pi - theta,
)
def reflection_is_an_involution(identified: Code) -> Verdict:
    """The reflection by a wall is an involution: the ray that leaves comes back where it entered.

    Angles are those of minus the incoming and of the outgoing velocity, so time reversal exchanges them. With another
    identification of the two half circles the square is not the identity.
    """

    def check(wall: Any) -> Verdict:
        x, theta = rays()
        there = trace(wall, x, theta)
        back = trace(wall, there.x, identified(there.theta))
        return every(
            agreement(back.x, x, REFLECTED, x=x, theta=theta),
            agreement(identified(back.theta), theta, REFLECTED, x=x, theta=theta),
        )

    return every(*(check(wall) for wall in (focusing_arcs(1.2), triangular_teeth(0.9))))


@row(
    id="S1.02",
    section="1.2.2",
    equation="1.5; Proposition on deterministic reflections (ii)",
    kind="numeric",
    printed=r"\Lambda^1(dx\, d\theta) = \sin\theta\, dx\, d\theta",
    right=np.sin,
    wrong=lambda theta: np.sin(theta) ** 2,
)
def reflection_preserves_the_flux(density: Code) -> Verdict:
    """The reflection by a wall preserves sin θ dx dθ.

    The Jacobian determinant, by differences between rays of one itinerary, is the quotient of the densities. It is
    Liouville's theorem for a section of the flow.
    """
    x, theta = rays()

    def differences(wall: Any, dx: float, dtheta: float) -> tuple[Any, Any, Any]:
        right, left = (trace(wall, x + s * dx, theta + s * dtheta) for s in (1.0, -1.0))
        same = right.collisions == left.collisions
        return (right.x - left.x) / (2 * STEP), (right.theta - left.theta) / (2 * STEP), same

    def check(wall: Any) -> Verdict:
        (xx, tx, same_x), (xt, tt, same_t) = differences(wall, STEP, 0.0), differences(wall, 0.0, STEP)
        same = same_x & same_t
        found = (np.abs(xx * tt - xt * tx) * density(trace(wall, x, theta).theta) / density(theta))[same]
        return every(
            agreement(found, 1.0, DIFFERENTIATED, x=x[same], theta=theta[same]),
            holds(density(theta) > 0, "densities are positive", theta=theta),
        )

    return every(*(check(wall) for wall in (focusing_arcs(0.8), dispersing_arcs(0.5))))


@row(
    id="S1.03",
    section="1.2.2",
    equation="figure",
    printed=r"x_2 = t \sin\theta: \quad \sin\theta\, dx_1\, dt\, d\theta",
    right=lambda theta, xp: xp.sin(theta),
    wrong=lambda theta, xp: xp.cos(theta),
)
def liouville_in_entry_coordinates(density: Code) -> Verdict:
    """In the coordinates (x₁, t, θ) of entry and time, Liouville's measure is sin θ dx₁ dt dθ.

    The Jacobian determinant of (x₁ + t cos θ, t sin θ, θ) is sin θ. The flux measure Λ¹ is what is left of it without
    time.
    """
    x1, t, theta = sp.symbols("x1 t theta", real=True)
    chart = sp.Matrix([x1 + t * sp.cos(theta), t * sp.sin(theta), theta])
    return verify(chart.jacobian([x1, t, theta]).det(), density(theta, sp))


@row(
    id="S1.05",
    section="1.2.3, 2.2.1",
    kind="numeric",
    printed=r"W_n \text{ is } \epsilon_n\text{-periodic}",
    wrong=lambda width: width,
    corrected=r"W_n = W(\Sigma, 2\epsilon_n), \text{ tooth on } [0, \tfrac12]",
    right=lambda width: 2 * width,
)
def period_of_rectangular_teeth(period: Code) -> Verdict:
    """The period of the wall of rectangular teeth of width ε.

    A tooth and a crevice of width ε each make a period of 2ε. Then X is uniform on the cell, a ray meets a tooth with
    probability 1/2, and the crevice of the cell is r/2 deep.
    """
    height_to_width, width = 1.5, 0.25
    x = np.random.default_rng(2).random(RAYS)

    def tooth_function(x: Any) -> Any:
        return np.where(np.floor(x / width) % 2 == 0, 0.0, -height_to_width * width)

    shifted = agreement(tooth_function(x + period(width)), tooth_function(x), 0.0, x=x)
    cell = rectangular_teeth(height_to_width)
    return every(shifted, agreement(height_to_width * width / period(width), cell.depth / cell.period, 1e-15))


@row(
    id="S1.06",
    section="1.2.3, 2.2.1",
    kind="numeric",
    printed=r"v^+ \in \{(v_1, -v_2), -v\}, \quad \theta' \in \{\pi - \theta, \theta\}",
    right=lambda v1, v2: [(v1, -v2), (-v1, -v2)],
    wrong=lambda v1, v2: [(v1, -v2)],
)
def rectangular_teeth_reverse_components(outgoing: Code) -> Verdict:
    """Rectangular teeth reverse the vertical velocity, and the horizontal one or not.

    Each hit reverses one component, and a ray that leaves has hit floor or top once. Traced rays leave with one of the
    two velocities.
    """
    x, theta = rays()
    found = trace(rectangular_teeth(1.3), x, theta).theta
    distances = [
        np.hypot(np.cos(found) - v1, np.sin(found) - v2) for v1, v2 in outgoing(-np.cos(theta), -np.sin(theta))
    ]
    return agreement(np.min(distances, axis=0), 0.0, REFLECTED, x=x, theta=theta)


spaces_of_convergence = by_reading(
    id="S1.04",
    section="1.2.2",
    equation="1.6, 1.11",
    statement="The spaces, the measure and the variables of the convergence of reflections in the half plane.",
    printed=r"(\mathbb R \times \mathbb S^2_+)^2, \quad \Lambda^2, \quad (y, w)",
    corrected=r"(\mathbb R \times \mathbb S^1_+)^2, \quad \Lambda^1, \quad (x, \theta)",
    reason="A point particle has a half circle of velocities, not a half sphere. The notation is that of the disk, "
    "three sections later.",
)

position_of_the_wall = by_reading(
    id="S1.11",
    section="1.3.1",
    equation="A3'",
    statement="The strip in which the wall's boundary lies.",
    printed=r"\partial W \subset [-1 - \epsilon, -1] \times \mathbb R",
    corrected=r"\partial W \subset \mathbb R \times [-1 - \epsilon, -1]",
    reason="The wall is horizontal, so that the second coordinate is the bounded one. The factors are exchanged.",
)
