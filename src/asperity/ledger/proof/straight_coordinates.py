"""Section 4.2: the cylinder M_cyl, the map H_1 onto M, and the graph that H_1 makes of the entry plane."""

from __future__ import annotations

import numpy as np
import sympy as sp

from ...geometry.disk import rolling
from ...geometry.disk import symbolic as sym
from ...verification import Verdict, agreement, every, holds, no_excess, verify
from ..entry import Code, by_reading, row
from ..simulated import generator, is_free, kinetic_norm, random_disks, tooth


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
