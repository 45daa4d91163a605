"""Sections 1.2 and 2.3.4: reflection of a point particle by a wall, symmetric kernels, shallow walls, resistance."""

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
POINTS = 2000
# Error of a sum over POINTS equal cells, for a piecewise linear integrand.
GRID_ERROR = 1e-5
# The next term changes the coefficient by O(K), with a factor below 1/100 at K = 0.1; the grid adds 2e-4.
SHALLOW_ERROR = 1e-3


@row(
    id="S1.07",
    section="1.2.5",
    equation="1.18'",
    printed=r"\tilde P(\theta, d\theta') = \tfrac12 \sin\theta'\, d\theta', \quad "
    r"\tilde P(\theta, d\theta') = \delta_\theta(d\theta')",
    right=lambda theta_out, xp: xp.sin(theta_out) / 2,
    wrong=lambda theta_out, xp: 1 / xp.pi,
)
def lambert_is_symmetric(density: Code) -> Verdict:
    """Lambert's kernel is symmetric with respect to sin θ dθ, and so is retroreflection.

    The flux sin θ · sin θ′/2 does not change when θ and θ′ are exchanged, and the density integrates to 1.
    Retroreflection is the identity, which is symmetric for every measure.
    """
    theta, theta_out = sp.symbols("theta theta'", real=True)
    mass = sp.integrate(density(theta_out, sp), (theta_out, 0, sp.pi))
    flux = sp.sin(theta) * density(theta_out, sp)
    backward = sp.sin(theta_out) * density(theta, sp)
    return every(verify(mass, 1), verify(flux, backward))


@row(
    id="S1.08",
    section="1.2.5",
    kind="numeric",
    printed=r"T \text{ preserves the measure}",
    wrong=lambda u: (u + 0.3) % 1.0,
    corrected=r"T \text{ preserves the measure and } T \circ T = \mathrm{id}",
    right=lambda u: (u + 0.5) % 1.0,
)
def symmetric_deterministic_laws(transformation: Code) -> Verdict:
    """Which transformations T of (0, 1) give a symmetric deterministic law.

    Symmetry of δ_T forces T ∘ T = id. A rotation by 0.3 preserves the measure without being symmetric, one by 1/2 is an
    involution and symmetric.
    """
    u = (np.arange(POINTS) + 0.5) / POINTS
    image = transformation(u)
    return agreement(np.mean(u * image**2), np.mean(u**2 * image), GRID_ERROR)


@row(
    id="S1.09",
    status="convention",
    section="1.2.6",
    kind="numeric",
    printed=r"\tilde P u - u = \tfrac{k_2}{6} \mathcal L u + O(K^3), \quad \mathcal L u = \bigl((1 - z^2) u'\bigr)'",
    wrong=lambda theta_out: theta_out,
    corrected=r"\tilde P u(\pi - \theta) - u(\theta) = \tfrac{K^2}{6} \mathcal L u(\theta) + O(K^3)",
    right=lambda theta_out: np.pi - theta_out,
)
def generator_of_shallow_arcs(angle: Code) -> Verdict:
    """Shallow dispersing arcs: the generator of the limit, and the convention in which it is one.

    k₂ is not defined: the coefficient is K²/6 with K the period over the radius of the arcs. It presumes that specular
    reflection is the identity, while here it is θ′ = π − θ, where P̃u − u does not become small.
    """
    curvature, number = 0.1, 400
    z, weight = np.polynomial.legendre.leggauss(number)
    x = (np.arange(number) + 0.5) / number
    angles = angle(trace(dispersing_arcs(curvature), x[:, None], np.arccos(z)).theta)
    out = np.cos(angles)

    def coefficient(function: Code, eigenvalue: float) -> Any:
        """The coefficient of the generator, from the quadratic form of P - I at an eigenfunction of the generator."""
        change = np.mean(function(out), axis=0) - function(z)
        form = np.sum(weight * function(z) * change) / np.sum(weight * function(z) ** 2)
        return form / (eigenvalue * curvature**2)

    found = [coefficient(lambda z: z, -2.0), coefficient(lambda z: z**2 - 1 / 3, -6.0)]
    # between an even and an odd eigenfunction the form is 0, by the symmetry of the arcs
    drift = np.sum(weight * z * (np.mean(out**2, axis=0) - z**2)) / curvature**2
    return every(
        agreement(found, 1 / 6, SHALLOW_ERROR),
        agreement(drift, 0.0, SHALLOW_ERROR),
        holds((angles > 0) & (angles < np.pi), "angles are outgoing"),
    )


@row(
    id="S1.10",
    section="1.2.7",
    printed=r"\int c(u, u')\, (u \cdot n)\, \nu(du\, du'\, dn)",
    wrong=lambda cost, normal_component: cost * normal_component,
    corrected=r"\int c(u, u')\, \nu(du\, du'\, dn)",
    right=lambda cost, normal_component: cost,
)
def resistance_of_a_disk(integrand: Code) -> Verdict:
    """The functional of resistance: the flux factor is counted once.

    ν already contains (u · n)₊. For c = 1 and the unit disk the resistance is 4π, the measure of all lines that meet
    it; with the factor counted twice it is π².
    """
    angle = sp.Symbol("phi", real=True)
    incidence = integrand(sp.Integer(1), sp.cos(angle)) * sp.cos(angle)
    total = 2 * sp.pi * sp.integrate(incidence, (angle, -sp.pi / 2, sp.pi / 2))
    # the measure of the lines that meet a convex body is 2 x perimeter (Cauchy, Crofton)
    return verify(total, 4 * sp.pi)


@row(
    id="S2.26",
    section="2.3.4",
    equation="Remark",
    kind="numeric",
    printed=r"T \text{ continuous and measure preserving} \implies T(x) = \pm x",
    wrong=lambda preserves, twice: preserves,
    corrected=r"T \text{ continuous, measure preserving, } T \circ T = \mathrm{id} \implies T(x) = \pm x",
    right=lambda preserves, twice: preserves and twice,
)
def continuous_reflections(hypothesis: Code) -> Verdict:
    """Which continuous transformations of (−1, 1) are ±x.

    The tent map 1 − 2|x| is continuous and preserves the measure. A deterministic rough reflection is also an
    involution, and with that added the remark is true; the involution (1 - 2x)/(2 - x) shows that both are needed.
    """
    x = -1 + (2 * np.arange(POINTS) + 1) / POINTS
    maps: list[Code] = [
        lambda x: x, lambda x: -x, lambda x: 1 - 2 * np.abs(x), lambda x: x**3, lambda x: (1 - 2 * x) / (2 - x),
    ]  # fmt: skip

    def satisfied(image: Any, again: Any) -> bool:
        # the sorted image of a measure-preserving map is the grid itself
        preserves = bool(np.max(np.abs(np.sort(image) - x)) < 2 / POINTS)
        return bool(hypothesis(preserves, bool(np.allclose(again, x))))

    admitted = [image for image in maps if satisfied(image(x), image(image(x)))]
    # a hypothesis that admits neither map would be empty
    return every(
        holds(len(admitted) >= 2, "searches admit two maps"),
        holds([np.allclose(np.abs(image(x)), np.abs(x)) for image in admitted], "maps are x or -x"),
    )


flip_measure = by_reading(
    id="S2.17",
    section="2.3",
    equation="2.23",
    statement="The measure on the left-hand side.",
    printed=r"\ldots\, d\xi'",
    corrected=r"\ldots\, d\theta'\, d\psi'",
    reason="The outgoing velocity has the coordinates θ′ and ψ′, as on the right-hand side. ξ is an angle on an arc.",
)
limit_of_mushrooms = by_reading(
    id="S2.23",
    section="2.3.4",
    statement="Which law mushrooms approach.",
    printed=r"P_{\mathrm{spec}} = \lim P^{W_i}",
    corrected=r"P_{\mathrm{retro}} = \lim P^{W_i}",
    reason="No-slip collisions correspond to retroreflection, which is what mushrooms do. A flat wall is specular.",
)
slips_of_the_examples = by_reading(
    id="S2.27",
    section="2.2.4, 2.4",
    statement="Slips in the limits, variables and integrals of two sections.",
    printed=r"u \to \infty;\ (\ldots, \theta), (\ldots, \beta);\ \int_k^{k + \epsilon};"
    r"\ \tilde P_0 \text{ without } dx;\ + O(\delta^2);\ \mathbb S^2_+",
    corrected=r"i \to \infty;\ (\ldots, \omega);\ \int_{\epsilon k}^{\epsilon (k + 1)};\ \tilde P_0 \text{ with } dx;\ "
    r"\text{no remainder};\ \mathbb S^1_+",
    reason="Each is clear from what stands next to it. No formula that is used depends on them.",
)
