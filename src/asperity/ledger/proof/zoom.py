"""Sections 4.2, 5.3.1 and 5.3.2: the cylinder M_cyl, the map H_1 onto M, and the zoomed charts f*, H_eps and G_eps."""

from __future__ import annotations

from typing import Any

import numpy as np
import sympy as sp

from ...geometry.disk import rolling
from ...geometry.disk import symbolic as sym
from ...verification import Verdict, agreement, every, holds, no_excess, verify
from ..entry import Code, by_reading, row
from ..simulated import generator, is_free, kinetic_norm, random_disks, residual, tooth, unit_velocities


@row(
    id="S4.12",
    section="4.2",
    printed=r"f_{\mathrm{lin}}(x_1, x_2, \alpha) = (x_1 - \alpha,\ x_2 + 1,\ \alpha)",
    right=rolling.roll_linear,
    wrong=lambda s1, s2, alpha: (s1 + alpha, s2, alpha),
)
def linear_chart(chart: Code) -> Verdict:
    """f_lin, the linear part of F at α = 0, parametrises M_cyl.

    It is the value and the derivative of F at α = 0, and it takes (s₁, s₂) to a point with x₁ + α = s₁. Heights are
    here measured from the tops, which takes the 1 away.
    """
    s1, s2 = sp.symbols("s1 s2", real=True)
    rolled = (*rolling.roll(s1, s2, sym.alpha, 1, sp), sym.alpha)
    linear = [sp.series(e, sym.alpha, 0, 2).removeO() for e in rolled]
    found = chart(s1, s2, sym.alpha)
    return every(verify(found, linear), verify(rolling.straight_contact(*found), (s1, s2)))


@row(
    id="S4.13",
    section="4.2",
    equation="4.43",
    printed=r"H_1(y) = (y_1 + \bar\alpha - \sin\bar\alpha,\ y_2 - 1 + \cos\bar\alpha,\ \alpha)",
    right=lambda y1, y2, bar, xp: rolling.bend(y1, y2, bar, 1, xp),
    wrong=lambda y1, y2, bar, xp: (y1 + rolling.slip(bar, xp), y2 + rolling.rise(bar, xp)),
)
def straightening(bend: Code) -> Verdict:
    """H₁, its inverse, and H₁ ∘ f_lin = F on Z⁰.

    f_lin goes along the tangent of the circle that F goes along. The constant in the second coordinate is right.
    """
    s1, s2 = sp.symbols("s1 s2", real=True)
    y1, y2, _ = rolling.roll_linear(s1, s2, sym.alpha)
    bent = bend(y1, y2, sym.alpha, sp)
    x1, x2 = bend(s1, s2, sym.alpha, sp)
    back = rolling.straighten(x1, x2, sym.alpha, 1, sp)
    return every(verify(bent, rolling.roll(s1, s2, sym.alpha, 1, sp)), verify(back, (s1, s2)))


@row(
    id="S4.14",
    section="5.3.1",
    equation="5.71",
    kind="numeric",
    printed=r"H_\varepsilon(M^*_{\mathrm{cyl}}\cap Z^*) = M^*\cap Z^*",
    wrong=lambda k: np.ones(k.shape, dtype=bool),
    corrected=r"H_\varepsilon(M^*_{\mathrm{cyl}}\cap Z^{0*}) = M^*\cap Z^{0*}\quad\text{(as eq. 4.46)}",
    right=lambda k: k == 0,
)
def components_of_the_straightening(claimed: Code) -> Verdict:
    """On which components Zᵏ of the angles H takes the cylinder onto the configurations.

    On Zᵏ the image is off by kρ along the wall, which is a period only if ρ/ε is a whole number. Membership is decided
    by a search over all satellites.
    """
    rng = generator()
    count, eps = 40, 0.001
    spacing = 2 * np.pi / count
    limit = spacing / 2 - float(rolling.gap_radius(eps, spacing))
    k, bar = rng.integers(-2, 3, 4000), rng.uniform(-limit, limit, 4000)
    alpha = bar + k * spacing
    y1, y2 = rng.uniform(-1, 1, 4000), rng.uniform(-eps, 0, 4000)
    contact, height = rolling.straight_contact(y1, y2, alpha)
    straight = height >= eps * tooth(contact / eps)
    x1, x2 = rolling.bend(y1, y2, bar, 1.0)
    free = is_free(np.stack([x1, x2, alpha]), eps, count)
    components = np.arange(-2, 3)
    equal = np.array([np.all((straight == free)[k == component]) for component in components])
    return holds(claimed(components) == equal, "components", k=components)


@row(
    id="S4.15",
    status="convention",
    section="4.2",
    equation="3.6",
    kind="numeric",
    printed=r"\sup\|H_1 - \mathrm{Id}\| \le |\sin(\rho/2) - \rho/2| + |\cos(\rho/2) - 1|",
    wrong=lambda rho, m: rolling.slip(rho / 2) + rolling.rise(rho / 2),
    corrected=r"\sup\|H_1 - \mathrm{Id}\| \le m^{1/2}\bigl(|\sin(\rho/2) - \rho/2| + |\cos(\rho/2) - 1|\bigr)",
    right=lambda rho, m: np.sqrt(m) * (rolling.slip(rho / 2) + rolling.rise(rho / 2)),
)
def size_of_the_straightening(bound: Code) -> Verdict:
    """How far H₁ is from the identity.

    The norm is the kinetic one, and the text takes m = 1. It is of the order ρ² for every m, and the bound is attained
    up to a factor 1 + ρ/5, because the second coordinate alone moves by 1 - cos(ρ/2).
    """
    rng, m, J = random_disks()
    rho = rng.uniform(0, 4, m.size)
    moved = np.stack([*rolling.bend(0.0, 0.0, rng.uniform(-0.5, 0.5, m.size) * rho, 1.0), 0 * rho])
    end = np.sqrt(m) * (0.5 * rho - np.sin(0.5 * rho) + 1 - np.cos(0.5 * rho))
    return every(
        no_excess(kinetic_norm(moved, m, J), bound(rho, m), 1e-15, m=m, rho=rho),
        agreement(bound(rho, m), end, 1e-14, m=m, rho=rho),
        # the greater of the two terms alone, of order rho^2, is attained
        no_excess(bound(rho, m), (1 + rho / 5) * np.sqrt(m) * (1 - np.cos(0.5 * rho)), 1e-15, m=m, rho=rho),
    )


@row(
    id="S4.16",
    section="4.2",
    equation="Lemma 4.7",
    printed=r"(x_1 + \alpha,\ x_2 - 1)",
    wrong=lambda x1, x2, alpha: (x1 + alpha, x2 - 1),
    corrected=r"(x_1 + \alpha,\ x_2)",
    right=rolling.straight_contact,
)
def point_of_the_shifted_wall(point: Code) -> Verdict:
    """The point of the shifted wall Γᵢ + e₂ that belongs to a point of the cylinder's boundary.

    The shift by e₂ is made twice, in the point and in the wall. The same holds for S, p, U and φ in that proof.
    """
    s1, s2 = sp.symbols("s1 s2", real=True)
    x1, x2, alpha = rolling.roll_linear(s1, s2 + 1, sym.alpha)  # the paper's f_lin, with heights from the centre
    return verify(point(x1, x2, alpha), (s1, s2 + 1))


@row(
    id="S4.17",
    section="4.3.3",
    printed=r"H_1(x_1, 0, \alpha)_2 = \cos\bar\alpha - 1",
    right=lambda bar, xp: xp.cos(bar) - 1,
    wrong=lambda bar, xp: -(bar**2) / 2,
)
def graph_of_the_bent_plane(graph: Code) -> Verdict:
    """The graph u that H₁ makes of the plane x₂ = 0, concave between the gaps; sliding along χ keeps M_cyl.

    The second derivative of u is -cos ᾱ < 0. M_cyl depends on x₁ + α and x₂ only, which χ̃ = (-1, 0, 1) of either sign
    keeps.
    """
    x1, x2, s = sp.symbols("x1 x2 s", real=True)
    u = graph(sym.alpha, sp)
    slid = rolling.straight_contact(x1 - s, x2, sym.alpha + s)
    return every(
        verify(rolling.bend(x1, 0, sym.alpha, 1, sp)[1], u),
        verify(sp.diff(u, sym.alpha, 2), -sp.cos(sym.alpha)),
        verify(slid, rolling.straight_contact(x1, x2, sym.alpha)),
    )


null_set = by_reading(
    id="S4.22",
    section="4.3.1",
    statement="The set A₂ in the proof of Proposition 4.8, and a missing sign in Proposition 4.10.",
    printed=r"A_2 \subset \{x_2 \ge 0\}\cap M",
    corrected=r"A_2 \subset \{x_2 \ge 0\}\cap\overline{M^c}",
    reason="The set that is meant is the null set of Proposition 4.1 (vii). In Proposition 4.10 an equality sign is "
    "missing.",
)
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
