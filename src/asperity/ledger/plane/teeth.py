"""Sections 2.2.1, 2.2.2, 2.3.1, 2.3.2: the laws of rectangular and triangular teeth, also of the foreshortened ones."""

from __future__ import annotations

from typing import Any

import numpy as np
import sympy as sp

from ...geometry import focusing_arcs, rectangular_teeth, trace, triangular_teeth
from ...geometry.disk import symbolic as sym
from ...geometry.disk.disk import foreshortening
from ...kernels.laws.isometry_table import crevice_retro
from ...kernels.walls.polygons import TriangularTeethLaw
from ...kernels.walls.rectangular import RectangularTeethLaw
from ...verification import Verdict, agreement, every, holds, verify
from ..entry import Code, row
from ..simulated import FRACTION_ERROR, fraction

HEIGHTS_TO_WIDTHS = (0.4, 1.0, 2.7)


def fraction_of_specular(height_to_width: float, theta: Any, low: float) -> Any:
    """The fraction of rays with entry points between ``low`` and 1 that leave specularly, by tracing."""

    def is_specular(x: Any, theta: Any) -> Any:
        out = trace(rectangular_teeth(height_to_width), x, theta).theta
        return np.abs(out + theta - np.pi) < np.abs(out - theta)

    return fraction(is_specular, theta, low)


def compared_with_tracing(probability: Code, low: float) -> Verdict:
    """The probability of specular reflection compared with its frequency, for several teeth."""
    theta = np.linspace(0.15, 3.0, 40)
    ratios = np.array(HEIGHTS_TO_WIDTHS)
    found = [probability(ratio, theta) for ratio in ratios]
    traced = [fraction_of_specular(ratio, theta, low) for ratio in ratios]
    return agreement(found, traced, FRACTION_ERROR, height_to_width=ratios[:, None], theta=theta)


def exchanged_cases(height_to_width: float, theta: Any) -> Any:
    """The conditional probability for a crevice as printed; p_r as printed is the mean of 1 and this."""
    whole, rest = np.divmod(2 * height_to_width / np.abs(np.tan(theta)), 1.0)
    return np.where(whole % 2 == 0, rest, 1.0 - rest)


@row(
    id="S2.01",
    section="2.2.1",
    kind="numeric",
    printed=r"p_r(\theta) = \begin{cases} \frac12 + \frac12\{d\} & \lfloor d \rfloor \text{ even} \\"
    r" 1 - \frac12\{d\} & \lfloor d \rfloor \text{ odd} \end{cases}",
    wrong=lambda ratio, theta: 0.5 + 0.5 * exchanged_cases(ratio, theta),
    corrected=r"p_r(\theta) = \begin{cases} 1 - \frac12\{d\} & \lfloor d \rfloor \text{ even} \\"
    r" \frac12 + \frac12\{d\} & \lfloor d \rfloor \text{ odd} \end{cases}, \quad d = 2r\,|\cot\theta|",
    right=lambda ratio, theta: RectangularTeethLaw(ratio).branches(theta)[0][..., 0],
)
def specular_fraction_of_rectangular_teeth(probability: Code) -> Verdict:
    """Rectangular teeth: the probability of specular reflection, r the height over the width.

    Steep rays, with d near 0, meet no side and are specular, so the even case is the one that starts at 1. The two
    cases are exchanged.
    """
    return compared_with_tracing(probability, 0.0)


@row(
    id="S2.02",
    section="2.2.1",
    kind="numeric",
    printed=r"\begin{cases} \{d\} & \lfloor d \rfloor \text{ even} \\"
    r" 1 - \{d\} & \lfloor d \rfloor \text{ odd} \end{cases}",
    wrong=exchanged_cases,
    corrected=r"\begin{cases} 1 - \{d\} & \lfloor d \rfloor \text{ even} \\"
    r" \{d\} & \lfloor d \rfloor \text{ odd} \end{cases}",
    right=lambda ratio, theta: 1.0 - crevice_retro(ratio, theta),
)
def specular_fraction_of_a_crevice(probability: Code) -> Verdict:
    """Rectangular teeth: the probability of specular reflection for rays that enter a crevice.

    Unfolded, the ray crosses d widths, hence ⌊d⌋ or ⌊d⌋ + 1 sides, the latter with probability {d}. An even number of
    sides makes it specular.
    """
    return compared_with_tracing(probability, 0.5)


@row(
    id="S2.18",
    section="2.3.1",
    equation="2.5",
    printed=r"\tilde r = (1 + m/J)^{-1/2} r",
    wrong=lambda r, m, J, xp: r / xp.sqrt(1 + m / J),
    corrected=r"\tilde r = (1 + m/J)^{1/2} r",
    right=lambda r, m, J, xp: r * xp.sqrt(1 + m / J),
)
def ratio_of_foreshortened_teeth(ratio: Code) -> Verdict:
    """The ratio r̃ of the foreshortened rectangular teeth.

    Widths are compressed and heights are not, so height over width grows. The printed exponent is for width over
    height, which section 2.3.1 says and sections 1.2.3 and 2.2.1 do not use.
    """
    width, height = sp.symbols("width height", positive=True)
    felt = height / (foreshortening(sym.m, sym.J, sp) * width)
    return verify(ratio(height / width, sym.m, sym.J, sp), felt)


APEX_ANGLES = (0.35, 0.9, 1.6, 2.4)
ENTRIES = 2000
# Distances from the angles at which N changes, and from the tips.
EDGE, TIP = 1e-4, 1e-9
# Rounding error of a ray between straight sides with up to twenty bounces.
TRACED = 1e-11
# Error of a midpoint sum over angles at which the law has breakpoints.
FLUX_ERROR = 1e-4


def rays_between(psi: float, low: float, high: float, number: int) -> tuple[Any, Any, Any]:
    """Entry points (rows), angles (columns) in an open interval, and traces; no ray meets a corner."""
    theta = low + (high - low) * (np.arange(number) + 0.381966) / number
    x = (np.arange(ENTRIES) + 0.5) / ENTRIES
    return x, theta, trace(triangular_teeth(psi), x[:, None], theta)


def every_apex(check: Code) -> Verdict:
    return every(*(check(psi) for psi in APEX_ANGLES))


def most_hits(psi: float, theta: Any) -> Any:
    """N = ceil(2 theta/psi), the number of triangles that the extreme ray crosses."""
    return np.ceil(2 * theta / psi)


def fraction_of_fewer(psi: float, theta: Any, shift: float = 0.0) -> Any:
    """p_psi, with N shifted for comparison."""
    last = (most_hits(psi, theta) + shift - 0.5) * psi - theta
    return (np.cos(theta - psi / 2) - np.cos(last)) / (2 * np.sin(theta) * np.sin(psi / 2))


def outgoing_angles(psi: float, theta: Any, half: Code) -> tuple[Any, Any]:
    """The two outgoing angles of eq. 2.10, for N - 1 hits and for N; ``half`` rounds N/2."""
    hits = most_hits(psi, theta)
    pairs = half(hits / 2)
    back, forth = np.pi + theta - 2 * psi * pairs, psi * (2 * pairs + 1) - theta
    even = hits % 2 == 0
    return np.where(even, forth - 2 * psi, back), np.where(even, back, forth)


def two_outgoing_angles(psi: float, theta: Any) -> tuple[Any, Any]:
    """Probabilities and angles of the two-outcome form, applied to all theta."""
    fewer = np.clip(fraction_of_fewer(psi, theta), 0.0, 1.0)
    return np.stack([fewer, 1.0 - fewer], axis=-1), np.stack(outgoing_angles(psi, theta, np.floor), axis=-1)


@row(
    id="S2.03",
    section="2.2.2",
    kind="numeric",
    printed=r"t_n(x) = -\cot\tfrac\psi2\, x, \quad \cot\tfrac\psi2\, (x - 1) \quad\text{(on every cell)}",
    wrong=lambda x, cell, period, cotangent, left: np.where(left, -cotangent * x, cotangent * (x - 1.0)),
    corrected=r"t_n(x) = \begin{cases} -\cot\frac\psi2\, (x - \epsilon_n k) &"
    r" \epsilon_n k \le x < \epsilon_n (k + \frac12) \\"
    r" \cot\frac\psi2\, (x - \epsilon_n (k + 1)) & \epsilon_n (k + \frac12) \le x < \epsilon_n (k + 1) \end{cases}",
    right=lambda x, cell, period, cotangent, left: np.where(
        left, -cotangent * (x - period * cell), cotangent * (x - period * (cell + 1))
    ),
)
def tooth_function(function: Code) -> Verdict:
    """The tooth function of triangular teeth of period ε and apex angle ψ.

    The printed function is right for ε = 1 and k = 0 only. On other cells it is not periodic and takes positive values.
    """
    period, x = 0.25, np.linspace(0.0, 2.0, 401)[:-1]
    cell = np.floor(x / period)

    def check(psi: float) -> Verdict:
        outline = triangular_teeth(psi).scaled(period).vertices
        expected = np.interp(x - period * cell, outline[:, 0], outline[:, 1])
        left = x - period * cell < period / 2
        return agreement(function(x, cell, period, 1 / np.tan(psi / 2), left), expected, 1e-12, x=x)

    return every_apex(check)


@row(
    id="S2.04",
    section="2.2.2",
    equation="2.10",
    kind="numeric",
    printed=r"\text{the formulas below with } \lceil N/2 \rceil \text{ for } \lfloor N/2 \rfloor"
    r"\text{ and a stray } -\theta \quad\text{(described, not quoted)}",
    wrong=lambda psi, theta: outgoing_angles(psi, theta, np.ceil),
    corrected=r"\theta' = \begin{cases} \psi(N-1) - \theta,\ \pi + \theta - \psi N & N \text{ even} \\"
    r" \pi + \theta - \psi(N-1),\ \psi N - \theta & N \text{ odd} \end{cases}, \quad"
    r" N = \lceil 2\theta/\psi \rceil",
    right=lambda psi, theta: outgoing_angles(psi, theta, np.floor),
)
def outgoing_angles_of_triangular_teeth(angles: Code) -> Verdict:
    """Triangular teeth: the two outgoing angles for θ ≤ (π − ψ)/2, after N − 1 and after N hits.

    N triangles are crossed by N − 1 reflections, not by N. With that, floors replace the ceilings, the stray term goes,
    and every angle lies in (0, π).
    """

    def check(psi: float) -> Verdict:
        _, theta, traced = rays_between(psi, 0.05, (np.pi - psi) / 2, 17)
        fewer, more = angles(psi, theta)
        hits = most_hits(psi, theta)
        expected = np.where(traced.collisions == hits, more, np.where(traced.collisions == hits - 1, fewer, np.nan))
        return agreement(traced.theta, expected, TRACED, theta=theta)

    return every_apex(check)


@row(
    id="S2.05",
    section="2.2.2",
    kind="numeric",
    printed=r"N = \lceil 2\theta/\psi \rceil",
    right=most_hits,
    wrong=lambda psi, theta: np.floor(2 * theta / psi),
)
def number_of_hits(most: Code) -> Verdict:
    """The number N of triangles that the extreme ray crosses, so that there are N − 1 or N hits.

    Unfolded about the bottom, the sides are rays at multiples of ψ. Traced rays with θ ≤ (π − ψ)/2 hit N − 1 or N
    times.
    """

    def check(psi: float) -> Verdict:
        _, theta, traced = rays_between(psi, 0.05, (np.pi - psi) / 2, 17)
        missing = most(psi, theta) - traced.collisions
        # at the multiples of psi/2, where N changes, the rays next to the two tips
        edges = psi / 2 * np.arange(1, np.floor((np.pi - psi) / psi) + 1)
        beside = np.concatenate([[0.1 * psi], edges - EDGE, edges + EDGE])
        beside = beside[beside < (np.pi - psi) / 2]
        extreme = trace(triangular_teeth(psi), np.array([[TIP], [1 - TIP]]), beside).collisions.max(axis=0)
        return every(
            holds((missing == 0) | (missing == 1), "rays", theta=theta),
            agreement(most(psi, beside), extreme, 0.0, theta=beside),
        )

    return every_apex(check)


@row(
    id="S2.06",
    section="2.2.2",
    kind="numeric",
    printed=r"p_\psi(\theta) = [\ldots]_+ \quad\text{(off by up to 0.49; described, not quoted)}",
    wrong=lambda psi, theta: np.clip(fraction_of_fewer(psi, theta, shift=1.0), 0.0, 1.0),
    corrected=r"p_\psi(\theta) = \frac{\cos(\theta - \psi/2) - \cos((N - \frac12)\psi - \theta)}{2 \sin\theta"
    r" \sin(\psi/2)}",
    right=lambda psi, theta: TriangularTeethLaw(psi).branches(theta)[0][..., 0],
)
def probability_of_fewer_hits(probability: Code) -> Verdict:
    """Triangular teeth: the probability of N − 1 hits for θ ≤ (π − ψ)/2.

    This is the fraction of entry points left of the ray through the last corner, and it is positive. No shift of N
    makes the printed formula right; the check is shown to refute one with N + 1 for N.
    """

    def check(psi: float) -> Verdict:
        theta = rays_between(psi, 0.05, (np.pi - psi) / 2, 17)[1]
        wall = triangular_teeth(psi)
        found = fraction(lambda x, theta: trace(wall, x, theta).collisions == most_hits(psi, theta) - 1, theta)
        named = agreement(fraction_of_fewer(psi, theta), found, FRACTION_ERROR, theta=theta)
        return every(named, agreement(probability(psi, theta), found, FRACTION_ERROR, theta=theta))

    return every_apex(check)


@row(
    id="S2.07",
    section="2.2.2",
    kind="numeric",
    printed=r"\text{two outcomes, for all } \theta",
    wrong=lambda psi, x, theta: np.where(
        x < fraction_of_fewer(psi, theta),
        outgoing_angles(psi, theta, np.floor)[0],
        outgoing_angles(psi, theta, np.floor)[1],
    ),
    corrected=r"h = \arccos\bigl(\cos(\theta - \tfrac\psi2) - 2X \sin\theta \sin\tfrac\psi2\bigr),\ "
    r"n = \Bigl\lfloor \frac{\theta + h}{\psi} + \frac12 \Bigr\rfloor,\ "
    r"\theta' = \begin{cases} \pi + \theta - n\psi & n \text{ even} \\ n\psi - \theta & n \text{ odd} \end{cases}"
    r"\ (h < \tfrac\pi2); \text{ else the mirror image}",
    right=lambda psi, x, theta: TriangularTeethLaw(psi).reflect(x, theta),
)
def law_of_triangular_teeth(reflection: Code) -> Verdict:
    """Triangular teeth: the law for all θ, ray by ray.

    Rays with θ > (π − ψ)/2 may pass the bottom on its right, where the mirror image of the law holds: up to four
    outcomes. The corrected law agrees with traced rays for all ψ and θ.
    """

    def check(psi: float) -> Verdict:
        x, theta, traced = rays_between(psi, 0.05, np.pi - 0.05, 23)
        return agreement(reflection(psi, x[:, None], theta), traced.theta, TRACED, x=x[:, None], theta=theta)

    return every_apex(check)


@row(
    id="S2.08",
    section="2.2.2",
    kind="numeric",
    printed=r"\int E[\cos^2\theta'] \sin\theta\, d\theta = 1.039 \ne \tfrac23",
    wrong=two_outgoing_angles,
    corrected=r"\int_0^\pi \tilde P f(\theta) \sin\theta\, d\theta = \int_0^\pi f(\theta) \sin\theta\, d\theta",
    right=lambda psi, theta: TriangularTeethLaw(psi).branches(theta),
)
def flux_of_triangular_teeth(law: Code) -> Verdict:
    """Triangular teeth: the law leaves sin θ dθ invariant.

    A law of a wall preserves the flux, and the printed one does not. The check refutes even its repair, two outcomes
    for all θ, whose mass is right and whose flux is not.
    """
    z = -1 + (2 * np.arange(20_000) + 1) / 20_000
    theta = np.arccos(z)

    def check(psi: float) -> Verdict:
        probability, angle = law(psi, theta)
        square = np.mean(np.sum(probability * np.cos(angle) ** 2, axis=-1))
        # a symmetric law satisfies <f, P g> = <P f, g>
        forward = np.mean(z * np.sum(probability * np.cos(angle) ** 3, axis=-1))
        backward = np.mean(z**3 * np.sum(probability * np.cos(angle), axis=-1))
        # the law is compared with the outcomes of traced rays and their frequencies
        x, some, traced = rays_between(psi, 0.05, np.pi - 0.05, 7)
        probability, angle = law(psi, some)
        apart = np.abs(traced.theta[..., None] - angle)
        nearest = np.argmin(np.where(probability > 0, apart, np.inf), axis=-1)
        occurs = np.stack([np.mean(nearest == i, axis=0) for i in range(probability.shape[-1])], axis=-1)
        return every(
            agreement(square, 1 / 3, FLUX_ERROR),
            agreement(forward, backward, FLUX_ERROR),
            agreement(np.min(apart, axis=-1), 0.0, TRACED, x=x[:, None], theta=some),
            agreement(probability, occurs, 5.0 / ENTRIES),
        )

    return every_apex(check)


@row(
    id="S2.21",
    section="2.3.2",
    printed=r"\tilde\psi = 2 \arctan\bigl((1 + m/J)^{-1/2} \tan(\psi/2)\bigr)",
    right=lambda psi, m, J, xp: 2 * xp.atan(xp.tan(psi / 2) / xp.sqrt(1 + m / J)),
    wrong=lambda psi, m, J, xp: 2 * xp.atan(xp.tan(psi / 2) * xp.sqrt(1 + m / J)),
)
def apex_angle_of_foreshortened_teeth(angle: Code) -> Verdict:
    """The apex angle of foreshortened triangular teeth.

    tan(ψ/2) is half the width over the depth, and widths are compressed. Teeth become narrower.
    """
    psi = sym.psi
    half_width, depth = sp.Rational(1, 2), sp.cot(psi / 2) / 2
    felt = foreshortening(sym.m, sym.J, sp) * half_width / depth
    return verify(sp.tan(angle(psi, sym.m, sym.J, sp) / 2), felt, [psi > 0, psi < sp.pi])


@row(
    id="S2.29",
    status="convention",
    section="2.2",
    kind="numeric",
    printed=r"\text{all of them}",
    wrong=lambda psi, ratio: (psi > 0, ratio > 0),
    corrected=r"\psi \ge 2 \arctan\tfrac12 \text{ (triangular)}, \quad r \le 2 \text{ (rectangular)}, \quad"
    r" \text{all arcs}",
    right=lambda psi, ratio: (psi >= 2 * np.arctan(0.5), ratio <= 2),
)
def cells_within_one_period(condition: Code) -> Verdict:
    """Which cells of the examples are at most one period deep, as condition B3 asks.

    The depths are cot(ψ/2)/2, r/2 and tan(ξ/2)/2. The laws hold for all parameters, so that B3 is only a matter of
    units of depth.
    """
    beside = np.array([-1e-4, 1e-4])
    psi = np.append(np.linspace(0.1, 3.0, 57), 2 * np.arctan(0.5) + beside)
    ratio, half_angle = np.append(np.linspace(0.05, 4.0, 57), 2 + beside), np.linspace(0.1, np.pi / 2, 59)
    triangular, rectangular = condition(psi, ratio)
    within = [
        np.array([wall(value).depth <= 1.0 for value in values])
        for wall, values in ((triangular_teeth, psi), (rectangular_teeth, ratio), (focusing_arcs, half_angle))
    ]
    return holds(
        [triangular == within[0], rectangular == within[1], within[2]], "cells", psi=psi, height_to_width=ratio
    )
