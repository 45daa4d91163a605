"""Sections 4.2 and 4.3: the cylinder M_cyl, the map H_1 onto M, and the transfer eta of the entry plane."""

from __future__ import annotations

import numpy as np

from ...verification import (
    Formula,
    Verdict,
    agreement,
    by_reading,
    convention,
    erratum,
    every,
    no_excess,
    verified,
    verify,
)
from ...verification.entry import Code
from .. import rolling
from .trials import generator, is_free, kinetic_norm, masses, tooth, unit_velocities


@verified(
    id="S4.12",
    section="4.2",
    statement="f_lin, the linear part of F at α = 0, parametrises M_cyl.",
    printed=Formula(r"f_{\mathrm{lin}}(x_1, x_2, \alpha) = (x_1 - \alpha,\ x_2 + 1,\ \alpha)", rolling.roll_linear),
    perturbed=lambda s1, s2, alpha: (s1 + alpha, s2, alpha),
    reason="It is the value and the derivative of F at α = 0, and it takes (s₁, s₂) to a point with x₁ + α = s₁. "
    "Heights are here measured from the tops, which takes the 1 away.",
)
def linear_chart(chart: Code) -> Verdict:
    import sympy as sp

    from .. import symbolic as sym

    s1, s2 = sp.symbols("s1 s2", real=True)
    rolled = (*rolling.roll(s1, s2, sym.alpha, 1, sp), sym.alpha)
    linear = [sp.series(e, sym.alpha, 0, 2).removeO() for e in rolled]
    found = chart(s1, s2, sym.alpha)
    return every(verify(found, linear), verify(rolling.straight_contact(*found), (s1, s2)))


@verified(
    id="S4.13",
    section="4.2",
    equation="4.43",
    statement="H₁, its inverse, and H₁ ∘ f_lin = F on Z⁰.",
    printed=Formula(r"H_1(y) = (y_1 + \bar\alpha - \sin\bar\alpha,\ y_2 - 1 + \cos\bar\alpha,\ \alpha)", rolling.bend),
    perturbed=lambda y1, y2, bar, scale, xp: (y1 + rolling.slip(bar, xp), y2 + rolling.rise(bar, xp)),
    reason="f_lin goes along the tangent of the circle that F goes along. The constant in the second coordinate is "
    "right.",
)
def straightening(bend: Code) -> Verdict:
    import sympy as sp

    from .. import symbolic as sym

    s1, s2 = sp.symbols("s1 s2", real=True)
    y1, y2, _ = rolling.roll_linear(s1, s2, sym.alpha)
    bent = bend(y1, y2, sym.alpha, 1, sp)
    x1, x2 = bend(s1, s2, sym.alpha, 1, sp)
    back = rolling.straighten(x1, x2, sym.alpha, 1, sp)
    return every(verify(bent, rolling.roll(s1, s2, sym.alpha, 1, sp)), verify(back, (s1, s2)))


@erratum(
    id="S4.14",
    section="5.3.1",
    equation="5.71",
    statement="On which components Zᵏ of the angles H takes the cylinder onto the configurations.",
    kind="numeric",
    printed=Formula(r"H_\varepsilon(M^*_{\mathrm{cyl}}\cap Z^*) = M^*\cap Z^*", lambda k: np.ones(k.shape, dtype=bool)),
    corrected=Formula(
        r"H_\varepsilon(M^*_{\mathrm{cyl}}\cap Z^{0*}) = M^*\cap Z^{0*}\quad\text{(as eq. 4.46)}", lambda k: k == 0
    ),
    reason="On Zᵏ the image is off by kρ along the wall, which is a period only if ρ/ε is a whole number. Membership "
    "is decided by a search over all satellites.",
)
def components_of_the_straightening(claimed: Code) -> Verdict:
    rng = generator()
    count, eps = 40, 0.001
    spacing = 2 * np.pi / count
    limit = spacing / 2 - float(rolling.gap_radius(eps, spacing))
    k, bar = rng.integers(-2, 3, 4000), rng.uniform(-limit, limit, 4000)
    alpha = bar + k * spacing
    y1, y2 = rng.uniform(-1, 1, 4000), rng.uniform(-eps, 0, 4000)
    place, height = rolling.straight_contact(y1, y2, alpha)
    straight = height >= eps * tooth(place / eps)
    x1, x2 = rolling.bend(y1, y2, bar, 1.0)
    free = is_free(np.stack([x1, x2, alpha]), eps, count)
    wrong = (straight != free) & claimed(k)
    return agreement(wrong, 0.0, 0.0, k=k, alpha=alpha)


@convention(
    id="S4.15",
    section="4.2",
    equation="3.6",
    statement="How far H₁ is from the identity.",
    kind="numeric",
    printed=Formula(
        r"\sup\|H_1 - \mathrm{Id}\| \le |\sin(\rho/2) - \rho/2| + |\cos(\rho/2) - 1|",
        lambda rho, m: rolling.slip(rho / 2) + rolling.rise(rho / 2),
    ),
    corrected=Formula(
        r"\sup\|H_1 - \mathrm{Id}\| \le m^{1/2}\bigl(|\sin(\rho/2) - \rho/2| + |\cos(\rho/2) - 1|\bigr)",
        lambda rho, m: np.sqrt(m) * (rolling.slip(rho / 2) + rolling.rise(rho / 2)),
    ),
    reason="The norm is the kinetic one, and the text takes m = 1. It is of the order ρ² for every m.",
)
def size_of_the_straightening(bound: Code) -> Verdict:
    rng = generator()
    m, J = masses(rng)
    rho = rng.uniform(0, 1, m.size)
    moved = np.stack([*rolling.bend(0.0, 0.0, rng.uniform(-0.5, 0.5, m.size) * rho, 1.0), 0 * rho])
    return no_excess(kinetic_norm(moved, m, J), bound(rho, m), 1e-15, m=m, rho=rho)


@erratum(
    id="S4.16",
    section="4.2",
    equation="Lemma 4.7",
    statement="The point of the shifted wall Γᵢ + e₂ that belongs to a point of the cylinder's boundary.",
    printed=Formula(r"(x_1 + \alpha,\ x_2 - 1)", lambda x1, x2, alpha: (x1 + alpha, x2 - 1)),
    corrected=Formula(r"(x_1 + \alpha,\ x_2)", rolling.straight_contact),
    reason="The shift by e₂ is made twice, in the point and in the wall. The same holds for S, p, U and φ in that "
    "proof.",
)
def point_of_the_shifted_wall(point: Code) -> Verdict:
    import sympy as sp

    from .. import symbolic as sym

    s1, s2 = sp.symbols("s1 s2", real=True)
    x1, x2, alpha = rolling.roll_linear(s1, s2 + 1, sym.alpha)  # the paper's f_lin, with heights from the centre
    return verify(point(x1, x2, alpha), (s1, s2 + 1))


@verified(
    id="S4.17",
    section="4.3.3",
    statement="u = cos ᾱ - 1 is the graph that H₁ makes of the plane x₂ = 0, concave between the gaps; sliding along "
    "χ keeps M_cyl.",
    printed=Formula(r"H_1(x_1, 0, \alpha)_2 = \cos\bar\alpha - 1", lambda bar, xp: xp.cos(bar) - 1),
    perturbed=lambda bar, xp: -(bar**2) / 2,
    reason="The second derivative of u is -cos ᾱ < 0. M_cyl depends on x₁ + α and x₂ only, which χ̃ = (-1, 0, 1) of "
    "either sign keeps.",
)
def graph_of_the_bent_plane(graph: Code) -> Verdict:
    import sympy as sp

    from .. import symbolic as sym

    x1, x2, s = sp.symbols("x1 x2 s", real=True)
    u = graph(sym.alpha, sp)
    slid = rolling.straight_contact(x1 - s, x2, sym.alpha + s)
    return every(
        verify(rolling.bend(x1, 0, sym.alpha, 1, sp)[1], u),
        verify(sp.diff(u, sym.alpha, 2), -sp.cos(sym.alpha)),
        verify(slid, rolling.straight_contact(x1, x2, sym.alpha)),
    )


@convention(
    id="S4.18",
    section="4.3.3",
    equation="4.65, Lemma 4.13",
    statement="The velocities S²₊ρ/₂ that cross the graph of u upwards wherever they meet it.",
    kind="numeric",
    printed=Formula(r"\{\langle w, e_2\rangle > \sin(\rho/2)\}", lambda m, J, rho: np.sin(rho / 2) / m),
    corrected=Formula(r"\{v_2 > J^{-1/2}\sin(\rho/2)\}", lambda m, J, rho: np.sin(rho / 2) / np.sqrt(J)),
    reason="The gradient of u has norm J^(-1/2) |sin ᾱ|, and |ω| is at most J^(-1/2). The printed set is right for m "
    "= J = 1.",
)
def transversal_velocities(floor: Code) -> Verdict:
    rng = generator()
    m, J = masses(rng)
    rho = rng.uniform(0.01, 1, m.size)
    w = unit_velocities(rng, m, J)
    low = floor(m, J, rho)
    # half of the velocities start on the edge of the set, with all the spin that there can be
    edge = (rng.random(m.size) < 0.5) & (m * low**2 < 1)
    w[:, edge] = np.stack([0 * low, low * (1 + 1e-9), np.sqrt(np.maximum(0, 1 - m * low**2) / J)])[:, edge]
    inside = w[1] > low
    bar = np.where(rng.random(m.size) < 0.5, -0.5, rng.uniform(-0.5, 0.5, m.size)) * rho
    upward = w[1] + np.sin(bar) * w[2]
    return no_excess(0.0, upward[inside], m=m[inside], J=J[inside], rho=rho[inside])


@verified(
    id="S4.19",
    section="4.3.3",
    equation="4.66",
    statement="Ψ carries a configuration along its velocity to the plane x₂ = 0.",
    printed=Formula(r"\Psi(y, w) = (y - (x_2/v_2)\,w,\ w)", rolling.project),
    perturbed=lambda x1, x2, alpha, v1, v2, omega: (x1 - x2 * v1, alpha - x2 * omega),
    reason="⟨y, e₂⟩/⟨w, e₂⟩ is x₂/v₂ for every m. The null space of the differential is spanned by (w, 0).",
)
def projection_along_velocities(project: Code) -> Verdict:
    import sympy as sp

    y, t = sp.symbols("x1 x2 alpha", real=True), sp.Symbol("t", real=True)
    w = (sp.Symbol("v1", real=True), sp.Symbol("v2", positive=True), sp.Symbol("omega", real=True))
    image = sp.Matrix(project(*y, *w))
    moved = project(*(a + t * b for a, b in zip(y, w, strict=True)), *w)
    on_the_plane = project(y[0], 0, y[2], *w)
    jacobian = image.jacobian(sp.Matrix([*y, *w]))
    return every(
        verify(list(moved), list(image)),
        verify(list(on_the_plane), [y[0], y[2]]),
        verify(jacobian, sp.Matrix(rolling.project_differential(y[1], *w))),
        verify(jacobian[:, :3] * sp.Matrix(w), sp.zeros(2, 1)),
    )


@erratum(
    id="S4.20",
    section="4.3.3",
    equation="before 4.75",
    statement="The first coordinate of H₁(y) - y.",
    printed=Formula(r"|\alpha - \sin\bar\alpha|", lambda alpha, bar, xp: alpha - xp.sin(bar)),
    corrected=Formula(r"|\bar\alpha - \sin\bar\alpha|", lambda alpha, bar, xp: bar - xp.sin(bar)),
    reason="Only with both bars is it of the order ρ³. As printed it grows with α.",
)
def slip_of_the_straightening(size: Code) -> Verdict:
    import sympy as sp

    from .. import symbolic as sym

    x1, x2, bar = sp.symbols("x1 x2 bar", real=True)
    return verify(rolling.bend(x1, x2, bar, 1, sp)[0] - x1, size(sym.alpha, bar, sp))


@verified(
    id="S4.21",
    section="4.3.3",
    equation="4.75",
    statement="η is within a multiple of ρ of the identity; the constant depends on m and J.",
    kind="numeric",
    printed=Formula(r"\|\eta - \mathrm{Id}\| \le C\rho", lambda: 1.0),
    perturbed=lambda: 2.0,
    reason="1 - cos ᾱ is of the order ρ², and v₂ may be as small as ρ. The fitted order is 1, and C is J^(1/2)/4 "
    "where v₂ > J^(-1/2) sin(ρ/2), m/4 on the printed set.",
)
def size_of_the_transfer(order: Code) -> Verdict:
    counts = np.array([100, 400, 1600, 6400])
    slopes = []
    for m, J in ((1.0, 1.0), (9.0, 1.0), (1.0, 0.3)):
        sizes = []
        for rho in 2 * np.pi / counts:
            w = unit_velocities(generator(), m, J)
            floor = np.sin(rho / 2) / np.sqrt(J)
            w[:, ::2] = np.array([[0.0], [floor], [np.sqrt((1 - m * floor**2) / J)]])
            w = w[:, w[1] >= floor]
            bar = np.full(w.shape[1], rho / 2)
            x1, alpha = rolling.transfer(0.0, bar, bar, (w[0], w[1], w[2]), 1.0)
            sizes.append(kinetic_norm(np.stack([x1, 0 * x1, alpha - bar]), m, J).max())
        slopes.append(-np.polyfit(np.log(counts), np.log(sizes), 1)[0])
    return agreement(slopes, order(), 0.05)


null_set = by_reading(
    id="S4.22",
    section="4.3.1",
    statement="The set A₂ in the proof of Proposition 4.8, and a missing sign in Proposition 4.10.",
    printed=r"A_2 \subset \{x_2 \ge 0\}\cap M",
    corrected=r"A_2 \subset \{x_2 \ge 0\}\cap\overline{M^c}",
    reason="The set that is meant is the null set of Proposition 4.1 (vii). In Proposition 4.10 an equality sign is "
    "missing.",
)
