"""Sections 5.3.1 and 5.3.2: the zoomed charts f*, H_eps and G_eps, and lengths under dG_eps."""

from __future__ import annotations

from typing import Any

import numpy as np
import sympy as sp

from ...geometry.disk import rolling
from ...geometry.disk import symbolic as sym
from ...verification import Verdict, agreement, every, no_excess, verify
from ..entry import Code, row
from ..simulated import generator, kinetic_norm, random_disks, residual, unit_velocities

# A zoomed configuration and the scale.
ZOOMED = (*sp.symbols("x1 x2 bar", real=True), sym.epsilon)


@row(
    id="S5.14",
    section="5.3.1",
    equation="3.56",
    kind="numeric",
    printed=r"\bar\alpha^* = \alpha - \bar k^*\rho",
    wrong=lambda alpha, k, rho, eps: alpha - k * rho,
    corrected=r"\bar\alpha^* = \alpha - \bar k^*\rho/\varepsilon,\quad "
    r"f^*(x) = \varepsilon^{-1}f(\varepsilon x_1, \varepsilon(x_2 + 1) - 1, \varepsilon\alpha)",
    right=lambda alpha, k, rho, eps: alpha - k * rho / eps,
)
def zoomed_residual(bar_of: Code) -> Verdict:
    """The part ᾱ* of a zoomed angle beyond the nearest multiple, and f* as f in zoomed coordinates.

    Zoomed satellites are ρ/ε apart. As printed |ᾱ*| exceeds ρ/(2ε) many times; the right-hand side of eq. 3.56 is
    right.
    """
    rng = generator()
    eps, rho = 1e-3, 2 * np.pi / 100
    alpha = rng.uniform(-4, 4, 4000)
    k, bar = residual(alpha, rho)
    found = bar_of(alpha / eps, k, rho, eps)
    x1, x2 = rng.uniform(-1, 1, (2, 4000))
    zoomed = rolling.roll(x1, x2, found, eps)
    plain = rolling.roll(eps * x1, eps * x2, bar, 1.0)
    return every(agreement(eps * found, bar, 1e-12, alpha=alpha), agreement(np.stack(plain) / eps, zoomed, 1e-9))


@row(
    id="S5.15",
    section="5.3.1",
    equation="3.54",
    printed=r"H_\varepsilon(y) = (y_1 + \bar\alpha^* - \varepsilon^{-1}\sin(\varepsilon\bar\alpha^*),\ "
    r"y_2 - \varepsilon^{-1}(1 - \cos(\varepsilon\bar\alpha^*)),\ \alpha)",
    right=rolling.bend,
    wrong=lambda y1, y2, bar, scale, xp: rolling.bend(y1, y2, scale * bar, 1, xp),
)
def zoomed_straightening(bend: Code) -> Verdict:
    """H_ε = ε⁻¹ H₁(ε ·), with ᾱ* = α - k̄*ρ/ε.

    Lengths are divided by ε, angles are not; the library's differential is that of this map. The same formula at scale
    1 is row S4.13.
    """
    y1, y2, bar, eps = ZOOMED
    plain = [eps * y1 + eps * bar - sp.sin(eps * bar), eps * y2 - 1 + sp.cos(eps * bar)]
    bent = bend(y1, y2, bar, eps, sp)
    jacobian = sp.Matrix([*bent, bar]).jacobian([y1, y2, bar])
    return every(verify(bent, [e / eps for e in plain]), verify(jacobian, rolling.bend_differential(bar, eps, sp)))


@row(
    id="S5.16",
    section="5.3.1",
    kind="numeric",
    printed=r"\sup|\mathrm{Error}| \to 0",
    wrong=lambda eps, rho: 0.0 * eps,
    corrected=r"\sup|\mathrm{Error}_2| \sim \rho^2/(8\varepsilon) \to \infty",
    right=lambda eps, rho: rho**2 / (8 * eps),
)
def error_of_the_straightening(size: Code) -> Verdict:
    """The supremum of the error H_ε - Id, whose derivatives vanish uniformly.

    The disk rises by ρ²/8 between satellites, which is much more than ε. The error vanishes locally uniformly in α and
    its derivatives, at most sin(ρ/2), uniformly.
    """
    eps = np.array([1e-3, 1e-5, 1e-7])
    rho = eps**0.4
    bar = np.linspace(-0.5, 0.5, 1001)[:, np.newaxis] * rho / eps
    _, risen = rolling.bend(0.0, 0.0, bar, eps)
    slopes = np.array([rolling.bend_differential(bar, eps)[i][2] for i in (0, 1)])
    return every(
        agreement(np.abs(risen).max(axis=0) / (rho**2 / eps), size(eps, rho) / (rho**2 / eps), 2e-5, eps=eps),
        no_excess(np.abs(slopes), np.sin(rho / 2), 1e-15),
    )


@row(
    id="S5.17",
    status="convention",
    section="5.3.2",
    equation="3.60'",
    printed=r"G_\varepsilon = (x_1 + \varepsilon^{-1}\sin(\varepsilon\bar\alpha^*),\ \ldots)",
    wrong=lambda x1, bar, turn, eps, xp: x1 + xp.sin(eps * bar) / eps,
    corrected=r"G_0\circ H_\varepsilon^{-1} = (x_1 + \varepsilon^{-1}\sin(\varepsilon\bar\alpha^*) + \bar "
    r"k^*\rho/\varepsilon,\ \ldots)",
    right=lambda x1, bar, turn, eps, xp: x1 + xp.sin(eps * bar) / eps + turn,
)
def contact_as_a_product(first: Code) -> Verdict:
    """G_ε as the product G₀ ∘ H_ε⁻¹.

    As printed it is the product on Z⁰* only. On all components it is the map that takes M* onto the free part of the
    plane, and that is what the library calls G_ε.
    """
    x1, x2, bar, eps = ZOOMED
    turn = sp.Symbol("turn", real=True)
    y1, y2 = rolling.straighten(x1, x2, bar, eps, sp)
    product = rolling.straight_contact(y1, y2, bar + turn)
    contact = rolling.satellite(x1, x2, bar, eps, sp)
    return every(verify(product[0], first(x1, bar, turn, eps, sp)), verify(product[1], contact[1]))


@row(
    id="S5.18",
    section="5.3.2",
    equation="3.66",
    printed=r"dG_\varepsilon(w) = (v_1 + \omega\cos(\varepsilon\bar\alpha^*),\ v_2 +"
    r" \omega\sin(\varepsilon\bar\alpha^*))",
    right=rolling.satellite_differential,
    wrong=lambda bar, scale, xp: rolling.satellite_differential(-bar, scale, xp),
)
def differential_of_the_contact(differential: Code) -> Verdict:
    """The differential of G_ε.

    It is the velocity of the satellite in contact. The scale cancels.
    """
    x1, x2, bar, eps = ZOOMED
    image = sp.Matrix(rolling.satellite(x1, x2, bar, eps, sp))
    return verify(image.jacobian([x1, x2, bar]), differential(bar, eps, sp))


def _sine_to(w: Any, direction: Any, m: Any, J: Any) -> Any:
    """The sine of the kinetic angle between unit velocities and a direction."""
    unit = direction / kinetic_norm(direction, m, J)
    along = m * (w[0] * unit[0] + w[1] * unit[1]) + J * w[2] * unit[2]
    return kinetic_norm(w - along * unit, m, J)


@row(
    id="S5.19",
    status="convention",
    section="5.3.2",
    equation="3.62'",
    kind="numeric",
    printed=r"\|\cdot\|\text{ Euclidean on }Q_0",
    wrong=lambda image, m: np.hypot(*image),
    corrected=r"\|\cdot\| = m^{1/2}|\cdot|\text{ on }Q_0",
    right=lambda image, m: np.sqrt(m) * np.hypot(*image),
)
def lengths_under_the_linear_contact(norm: Code) -> Verdict:
    """sin φ ≤ ‖dG₀(w)‖ ≤ (1 + m/J)^(1/2) sin φ for a unit velocity w at the angle φ from χ.

    The norm on Q₀ is the kinetic one, as on the configurations. For m = 1 there is no difference.
    """
    rng, m, J = random_disks()
    w = unit_velocities(rng, m, J)
    length = norm(np.stack([w[0] + w[2], w[1]]), m)
    sine = _sine_to(w, np.stack([-np.ones_like(m), 0 * m, np.ones_like(m)]), m, J)
    return every(
        no_excess(sine, length, 1e-12, m=m, J=J), no_excess(length, np.sqrt(1 + m / J) * sine, 1e-12, m=m, J=J)
    )


@row(
    id="S5.20",
    section="5.3.2",
    equation="5.79 (Lemma 5.6)",
    kind="numeric",
    printed=r"\sin\phi,\quad\phi = \angle(w, \chi)",
    wrong=lambda x: np.stack([-np.ones_like(x), np.zeros_like(x), np.ones_like(x)]),
    corrected=r"\sin\phi_x,\quad\phi_x = \angle(w, (m + J)^{-1/2}(-\cos x, -\sin x, 1)),\quad x ="
    r" \varepsilon\bar\alpha^*",
    right=lambda x: np.stack([-np.cos(x), -np.sin(x), np.ones_like(x)]),
)
def lengths_under_the_contact(null: Code) -> Verdict:
    """Upper bound of ‖dG_ε(w)‖ for unit w: (1 + m/J)^(1/2) times the sine of an angle.

    The null direction of dG_ε turns with the disk: at w = χ any multiple of sin φ is 0, but dG_ε(χ) is not. Additively
    sin φ - (m/J)^(1/2)|x| ≤ ‖dG_ε(w)‖ ≤ (1 + m/J)^(1/2) sin φ + (m/J)^(1/2)|x|.
    """
    rng, m, J = random_disks()
    x = rng.uniform(-0.5, 0.5, m.size)
    w = unit_velocities(rng, m, J)
    w[:, ::4] = (np.stack([-np.ones_like(m), 0 * m, np.ones_like(m)]) / np.sqrt(m + J))[:, ::4]
    (a, b, c), (d, e, f) = rolling.satellite_differential(x, 1.0)
    length = np.sqrt(m) * np.hypot(a * w[0] + b * w[1] + c * w[2], d * w[0] + e * w[1] + f * w[2])
    sine, straight = _sine_to(w, null(x), m, J), _sine_to(w, null(0 * x), m, J)
    slack, factor = np.sqrt(m / J) * np.abs(x), np.sqrt(1 + m / J)
    return every(
        no_excess(sine, length, 1e-12, m=m, J=J, x=x),
        no_excess(length, factor * sine, 1e-12, m=m, J=J, x=x),
        no_excess(straight - slack, length, 1e-12, m=m, J=J, x=x),
        no_excess(length, factor * straight + slack, 1e-12, m=m, J=J, x=x),
    )


@row(
    id="S5.21",
    section="5.3.2",
    equation="3.67",
    printed=r"E = 2\omega[-v_1(1 - \cos x) + v_2\sin x] + \omega^2\sin^2 x",
    wrong=lambda v1, v2, omega, x, xp: 2 * omega * (-v1 * (1 - xp.cos(x)) + v2 * xp.sin(x)) + omega**2 * xp.sin(x) ** 2,
    corrected=r"E = 2\omega[-v_1(1 - \cos x) + v_2\sin x]",
    right=lambda v1, v2, omega, x, xp: 2 * omega * (-v1 * (1 - xp.cos(x)) + v2 * xp.sin(x)),
)
def change_of_the_length(excess: Code) -> Verdict:
    """E = |dG_ε(w)|² - |dG₀(w)|².

    The ω² cos² x of the first component was dropped. Hence |E| ≤ (mJ)^(-1/2)|x|, for all m and J.
    """
    v1, v2, omega, x = sp.symbols("v1 v2 omega x", real=True)
    first = (v1 + omega * sp.cos(x)) ** 2 + (v2 + omega * sp.sin(x)) ** 2
    return verify(first - (v1 + omega) ** 2 - v2**2, excess(v1, v2, omega, x, sp))


@row(
    id="S5.22",
    section="5.3.2",
    kind="numeric",
    printed=r"\sqrt{x + h} \le \sqrt x\,(1 + h)",
    wrong=lambda x, h: np.sqrt(x) * (1 + h),
    corrected=r"\sqrt{x + h} \le \sqrt x\,(1 + h/(2x))",
    right=lambda x, h: np.sqrt(x) * (1 + h / (2 * x)),
)
def root_of_a_sum(bound: Code) -> Verdict:
    """An upper bound of the root of a sum.

    The root is below its tangent, for h of either sign. As printed it fails for x < 1/2.
    """
    rng = generator()
    x = np.exp(rng.uniform(-6, 3, 4000))
    h = np.where(rng.random(4000) < 0.5, rng.uniform(-1, 0, 4000) * x, np.exp(rng.uniform(-9, 2, 4000)))
    small = 1e-5 * x
    return every(
        no_excess(np.sqrt(x + h), bound(x, h), 1e-12, x=x, h=h),
        # the bound touches the root at h = 0
        agreement(bound(x, small) / np.sqrt(x + small), 1.0, 1e-10, x=x),
    )
