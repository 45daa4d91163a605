"""Sections 2.2.3 and 2.3.3: the law of focusing circular arcs, and their foreshortened form, elliptical arcs."""

from __future__ import annotations

from typing import Any

import numpy as np
import sympy as sp

from ...geometry import focusing_arcs, trace
from ...geometry.disk import symbolic as sym
from ...geometry.disk.disk import foreshortening
from ...kernels.walls.circular_arc import CircularArcLaw
from ...verification import Verdict, agreement, every, holds, verify
from ..entry import Code, row

HALF_ANGLES = (0.3, 0.8, 1.3)
RAYS = 4000
# Rounding error of a ray on an arc with up to a hundred bounces.
TRACED = 1e-9
# Rays this close to a change of N may round to either side.
UNDECIDED = 1e-9
# Distances from a corner, along the entry line and of the first hit.
BESIDE_THE_CORNER, NEAR = 1e-9, 1e-5


def first_hit(x: Any, theta: Any, xi: float) -> Any:
    """gamma, the angle from the bottom of the first hit of the ray that enters at x, from the chord of the circle."""
    radius = 0.5 / np.sin(xi)
    px, py = x - 0.5, -radius * np.cos(xi)
    v1, v2 = -np.cos(theta), -np.sin(theta)
    along = px * v1 + py * v2
    time = -along + np.sqrt(along**2 + radius**2 - px**2 - py**2)
    return np.arctan2(px + time * v1, -(py + time * v2))


def every_arc(check: Code) -> Verdict:
    return every(*(check(xi) for xi in HALF_ANGLES))


def rays(xi: float) -> tuple[Any, Any, Any]:
    """Entry points, angles, and positions of the first hit."""
    rng = np.random.default_rng(4)
    x, theta = rng.random(RAYS), rng.uniform(0.05, np.pi - 0.05, RAYS)
    return x, theta, first_hit(x, theta, xi)


def step_and_hits(theta: Any, gamma: Any, xi: float, rounded: Code = np.ceil) -> tuple[Any, Any]:
    """Delta gamma, the angle from one hit to the next, and the number N of hits."""
    forward = theta - gamma >= np.pi / 2
    step = np.where(forward, 2 * (np.pi - theta + gamma), -2 * (theta - gamma))
    return step, rounded((xi - np.where(forward, gamma, -gamma)) / np.abs(step))


def undecided(theta: Any, gamma: Any, xi: float) -> Any:
    exact = step_and_hits(theta, gamma, xi, rounded=lambda hits: hits)[1]
    return np.abs(exact - np.rint(exact)) < UNDECIDED


def entry_of(theta: Any, gamma: Any, xi: Any, numerator: Any, xp: Any) -> Any:
    """X from the angle whose cosine is in the numerator of eq. 2.18."""
    return (xp.cos(numerator) - xp.cos(theta + xi)) / (xp.cos(theta - xi) - xp.cos(theta + xi))


@row(
    id="S2.09",
    section="2.2.3",
    printed=r"t_n(x) = \tfrac{\epsilon_n}2 \cot\xi - \sqrt{\tfrac{\epsilon_n^2}4 \csc^2\xi - (x -"
    r" \tfrac{\epsilon_n}2)^2}",
    right=lambda x, eps, xi, xp: eps / (2 * xp.tan(xi)) - xp.sqrt((eps / (2 * xp.sin(xi))) ** 2 - (x - eps / 2) ** 2),
    wrong=lambda x, eps, xi, xp: eps / (2 * xp.sin(xi)) - xp.sqrt((eps / (2 * xp.sin(xi))) ** 2 - (x - eps / 2) ** 2),
)
def focusing_tooth_function(function: Code) -> Verdict:
    """Focusing arcs: the tooth function, its centre and radius.

    It vanishes at both ends of the cell and is (ε/2) tan(ξ/2) deep. The radius (ε/2)/sin ξ makes the arc subtend 2ξ.
    """
    eps, xi = sp.Symbol("epsilon", positive=True), sp.Symbol("xi", positive=True)
    ends_and_bottom = [function(x, eps, xi, sp) for x in (sp.Integer(0), eps, eps / 2)]
    return verify(ends_and_bottom, [0, 0, -eps / 2 * sp.tan(xi / 2)], [xi < sp.pi / 2])


@row(
    id="S2.10",
    status="convention",
    section="2.2.3",
    kind="numeric",
    printed=r"X = 0 \implies \gamma = -\xi, \quad X = 1 \implies \gamma = \xi",
    wrong=lambda theta, xi: (np.full_like(theta, -xi), np.full_like(theta, xi)),
    corrected=r"\gamma|_{X=0} = \begin{cases} -\xi & \theta \le \pi - \xi \\ 2\theta + \xi - 2\pi & \text{else}"
    r" \end{cases},"
    r"\quad \gamma|_{X=1} = \begin{cases} \xi & \theta \ge \xi \\ 2\theta - \xi & \text{else} \end{cases}",
    right=lambda theta, xi: (
        np.where(theta <= np.pi - xi, -xi, 2 * theta + xi - 2 * np.pi),
        np.where(theta >= xi, xi, 2 * theta - xi),
    ),
)
def hits_at_the_ends(positions: Code) -> Verdict:
    """Focusing arcs: where rays that enter at the two ends of the cell hit.

    A ray flatter than the arc's tangent at the corner leaves the corner and hits the far side. The printed values hold
    for the steeper ones.
    """

    def check(xi: float) -> Verdict:
        theta = np.linspace(0.05, np.pi - 0.05, 301)
        theta = theta[np.minimum(np.abs(theta - xi), np.abs(theta - np.pi + xi)) > 0.01]
        left, right = positions(theta, xi)
        return every(
            agreement(left, first_hit(BESIDE_THE_CORNER, theta, xi), NEAR, theta=theta),
            agreement(right, first_hit(1 - BESIDE_THE_CORNER, theta, xi), NEAR, theta=theta),
        )

    return every_arc(check)


@row(
    id="S2.11",
    section="2.2.3",
    kind="numeric",
    printed=r"\Delta\gamma = \begin{cases} 2(\pi - \theta + \gamma) & \theta \ge \frac\pi2 + \gamma \\"
    r" -2(\theta - \gamma) & \text{else} \end{cases}, \quad"
    r" N = \Bigl\lceil \frac{\xi \mp \gamma}{|\Delta\gamma|} \Bigr\rceil",
    right=step_and_hits,
    wrong=lambda theta, gamma, xi: step_and_hits(theta, gamma, xi, np.floor),
)
def hits_on_an_arc(step_and_number: Code) -> Verdict:
    """Focusing arcs: the step Δγ of the hits, its direction, and their number N.

    Equal chords of a circle follow each other, and the ray leaves when the next would end beyond ±ξ. Where the quotient
    is whole the ray meets a corner.
    """

    def check(xi: float) -> Verdict:
        x, theta, gamma = rays(xi)
        hits = trace(focusing_arcs(xi), x, theta).collisions
        decided = ~undecided(theta, gamma, xi)
        step, number = step_and_number(theta, gamma, xi)
        # the direction after the first hit, and the other end of the chord in this direction
        at_circle, moving = np.exp(1j * gamma), -np.exp(1j * (theta + np.pi / 2))  # from the bottom, counter-clockwise
        moving = moving - 2 * np.real(moving * np.conj(at_circle)) * at_circle
        following = at_circle - 2 * np.real(moving * np.conj(at_circle)) * moving
        return every(
            agreement(number[decided], hits[decided], 0.0, x=x[decided]),
            agreement(np.abs(following / at_circle - np.exp(1j * step)), 0.0, TRACED, x=x, theta=theta),
            holds((np.abs(step) > 0) & (np.abs(step) <= np.pi), "steps are less than a turn"),
        )

    return every_arc(check)


@row(
    id="S2.12",
    status="convention",
    section="2.2.3",
    equation="2.17",
    kind="numeric",
    printed=r"\Theta' = \theta + N \Delta\gamma",
    wrong=lambda rotated, forward: rotated,
    corrected=r"\Theta' = \theta + N \Delta\gamma - \pi \ (\theta \ge \tfrac\pi2 + \gamma), \quad"
    r" \Theta' = \theta + N \Delta\gamma + \pi \text{ else}",
    right=lambda rotated, forward: rotated + np.where(forward, -np.pi, np.pi),
)
def outgoing_angle_of_an_arc(angle: Code) -> Verdict:
    """Focusing arcs: the outgoing angle.

    The incoming velocity has the angle π + θ, so the formula is right mod π, for unoriented lines. In (0, π) it needs
    the π, as in the law of the library.
    """

    def check(xi: float) -> Verdict:
        x, theta, gamma = rays(xi)
        decided = ~undecided(theta, gamma, xi)
        x, theta, gamma = x[decided], theta[decided], gamma[decided]
        out = trace(focusing_arcs(xi), x, theta).theta
        step, hits = step_and_hits(theta, gamma, xi)
        found = angle(theta + hits * step, theta - gamma >= np.pi / 2)
        return every(
            agreement(found, out, TRACED, x=x, theta=theta),
            agreement(CircularArcLaw(xi).reflect(x, theta), out, TRACED, x=x, theta=theta),
        )

    return every_arc(check)


@row(
    id="S2.13",
    section="2.2.3",
    equation="2.18, second line",
    printed=r"X = \frac{\cos(\theta + \gamma) - \cos(\theta + \xi)}{\cos(\theta - \xi) - \cos(\theta + \xi)}",
    wrong=lambda theta, gamma, xi, xp: entry_of(theta, gamma, xi, theta + gamma, xp),
    corrected=r"X = \frac{\cos(\theta - \gamma) - \cos(\theta + \xi)}{\cos(\theta - \xi) - \cos(\theta + \xi)}",
    right=lambda theta, gamma, xi, xp: entry_of(theta, gamma, xi, theta - gamma, xp),
)
def entry_from_the_first_hit(entry: Code) -> Verdict:
    """Focusing arcs: the position of entry as a function of the position of the first hit.

    Going back from the point of the arc along the ray gives the first line of the equation, which is right. The second
    line equals it only with cos(θ − γ).
    """
    theta, gamma, xi = sp.symbols("theta gamma xi", real=True)
    half_chord = 2 * sp.sin(xi)
    hit1, hit2 = sp.Rational(1, 2) + sp.sin(gamma) / half_chord, (sp.cos(xi) - sp.cos(gamma)) / half_chord
    return verify(
        entry(theta, gamma, xi, sp),
        hit1 - hit2 * sp.cot(theta),
        [theta > 0, theta < sp.pi, xi > 0, xi < sp.pi / 2, gamma > -sp.pi / 2, gamma < sp.pi / 2],
    )


@row(
    id="S2.14",
    section="2.2.3",
    kind="numeric",
    printed=r"\theta + \gamma \in [-\tfrac\pi2, 0] \cup [\pi, \tfrac{3\pi}2)",
    wrong=lambda theta, gamma: (
        ((-np.pi / 2 <= theta + gamma) & (theta + gamma <= 0))
        | ((np.pi <= theta + gamma) & (theta + gamma < 3 * np.pi / 2))
    ),
    corrected=r"\theta - \gamma \in (0, \pi)",
    right=lambda theta, gamma: (theta > gamma) & (theta - gamma < np.pi),
)
def range_of_the_arccosine(condition: Code) -> Verdict:
    """Focusing arcs: the range of the angle whose arccosine is taken, and hence the branch.

    A ray hits the arc from inside, so sin(θ − γ) > 0. The ordinary arccosine is the right one, and no other branch is
    needed.
    """

    def check(xi: float) -> Verdict:
        x, theta, gamma = rays(xi)
        return holds(condition(theta, gamma), "rays", x=x, theta=theta)

    # a ray hits the arc at gamma from inside if and only if it moves along the outward normal there
    rng = np.random.default_rng(5)
    theta, gamma = rng.uniform(0, np.pi, RAYS), rng.uniform(-np.pi / 2, np.pi / 2, RAYS)
    gamma[::4], gamma[1::4] = theta[::4] + 1e-4, theta[1::4] - 1e-4
    gamma[2::8], gamma[3::8] = theta[2::8] - np.pi - 1e-4, theta[3::8] - np.pi + 1e-4
    outward = np.sin(theta) * np.cos(gamma) - np.cos(theta) * np.sin(gamma) > 0
    return every(every_arc(check), holds(condition(theta, gamma) == outward, "directions", theta=theta, gamma=gamma))


@row(
    id="S2.15",
    section="2.2.3",
    kind="numeric",
    printed=r"\gamma = -\theta + \mathrm{Arccos}(X \cos(\theta - \xi) + (1 - X) \cos(\theta + \xi))",
    wrong=lambda theta, delta: -theta + delta,
    corrected=r"\gamma = \theta - \arccos(X \cos(\theta - \xi) + (1 - X) \cos(\theta + \xi))",
    right=lambda theta, delta: theta - delta,
)
def first_hit_from_the_entry(position: Code) -> Verdict:
    """Focusing arcs: the position of the first hit as a function of the position of entry.

    It solves the corrected eq. 2.18, in which θ − γ lies in (0, π). The printed sign puts the hit elsewhere for every
    ray.
    """

    def check(xi: float) -> Verdict:
        x, theta, gamma = rays(xi)
        delta = np.arccos(x * np.cos(theta - xi) + (1 - x) * np.cos(theta + xi))
        return agreement(position(theta, delta), gamma, TRACED, x=x, theta=theta)

    return every_arc(check)


@row(
    id="S2.16",
    section="2.2.3",
    printed=r"\frac{dX}{d\gamma} = \frac{\sin(\theta - \gamma)}{2 \sin\theta \sin\xi} > 0",
    right=lambda theta, gamma, xi, xp: xp.sin(theta - gamma) / (2 * xp.sin(theta) * xp.sin(xi)),
    wrong=lambda theta, gamma, xi, xp: xp.sin(theta + gamma) / (2 * xp.sin(theta) * xp.sin(xi)),
)
def entry_increases_with_the_hit(derivative: Code) -> Verdict:
    """Focusing arcs: X increases with γ.

    This is the derivative of the corrected eq. 2.18, and it is positive because θ − γ is in (0, π). So X and γ
    determine each other.
    """
    theta, gamma, xi = sp.symbols("theta gamma xi", real=True)
    slope = sp.diff(entry_of(theta, gamma, xi, theta - gamma, sp), gamma)
    return verify(slope, derivative(theta, gamma, xi, sp))


@row(
    id="S2.22",
    section="2.3.3",
    printed=r"t_n = \tfrac{\epsilon_n}2 \cot\xi - (1 + m/J)^{-1/2} \sqrt{\tfrac{\epsilon_n^2}4 \csc^2\xi -"
    r" (x - \tfrac{\epsilon_n}2)^2} \quad\text{(the shift is described, not quoted)}",
    wrong=lambda centre, root, factor: centre - factor * root,
    corrected=r"t_n = (1 + m/J)^{-1/2} \Bigl[\tfrac{\epsilon_n}2 \cot\xi - \sqrt{\tfrac{\epsilon_n^2}4 \csc^2\xi -"
    r" (x - \tfrac{\epsilon_n}2)^2}\Bigr]",
    right=lambda centre, root, factor: factor * (centre - root),
)
def elliptical_tooth_function(function: Code) -> Verdict:
    """The elliptical arcs whose foreshortened wall is the wall of circular arcs.

    With the shift unscaled the function is positive at 0. Scaled as a whole, it is the circular arc after compression
    along x, up to scale.
    """
    x, eps, xi = sp.symbols("x epsilon xi", positive=True)
    centre, radius = eps / (2 * sp.tan(xi)), eps / (2 * sp.sin(xi))
    root = sp.sqrt(radius**2 - (x - eps / 2) ** 2)
    factor = foreshortening(sym.m, sym.J, sp)
    # the point (factor x, t) of the foreshortened wall lies on the circle of period factor eps
    off_centre = (function(centre, root, factor) - factor * centre) ** 2 + (factor * (x - eps / 2)) ** 2
    # at the ends of the cell the root is the height of the centre, and the function vanishes
    return every(verify(off_centre, (factor * radius) ** 2), verify(function(centre, centre, factor), 0))
