"""Sections 4.3.3 and 5.2: the map eta between the entry planes of cylinder and disk, and the tiling of a plane."""

from __future__ import annotations

from typing import Any

import numpy as np
import sympy as sp

from ...geometry.disk import rolling
from ...geometry.disk import symbolic as sym
from ...verification import Verdict, agreement, every, holds, no_excess, verify
from ..entry import Code, row
from ..simulated import generator, kinetic_norm, random_disks, unit_velocities

VELOCITY = sym.v1, sym.v2, sym.omega


@row(
    id="S4.18",
    status="convention",
    section="4.3.3",
    equation="4.65, Lemma 4.13",
    kind="numeric",
    printed=r"\{\langle w, e_2\rangle > \sin(\rho/2)\}",
    wrong=lambda m, J, rho: np.sin(rho / 2) / m,
    corrected=r"\{v_2 > J^{-1/2}\sin(\rho/2)\}",
    right=lambda m, J, rho: np.sin(rho / 2) / np.sqrt(J),
)
def transversal_velocities(floor: Code) -> Verdict:
    """The velocities S²₊ρ/₂ that cross the graph of u upwards wherever they meet it.

    The gradient of u has norm J^(-1/2) |sin ᾱ|, and |ω| is at most J^(-1/2); the floor is sharp up to a factor 1 +
    O(ρ²). The printed set is right for m = J = 1.
    """
    rng, m, J = random_disks()
    rho = rng.uniform(0.01, 1, m.size)
    w = unit_velocities(rng, m, J)
    low = floor(m, J, rho)
    # half of the velocities start on the edge of the set, with the largest possible spin
    edge = (rng.random(m.size) < 0.5) & (m * low**2 < 1)
    w[:, edge] = np.stack([0 * low, low * (1 + 1e-9), np.sqrt(np.maximum(0, 1 - m * low**2) / J)])[:, edge]
    inside = w[1] > low
    bar = np.where(rng.random(m.size) < 0.5, -0.5, rng.uniform(-0.5, 0.5, m.size)) * rho
    upward = w[1] + np.sin(bar) * w[2]
    # with the largest possible spin, v2 = sin(rho/2) |omega| at v2^2 = sin^2/(J + m sin^2)
    small = np.geomspace(1e-4, 1e-3, m.size)
    lowest = np.sin(small / 2) / np.sqrt(J + m * np.sin(small / 2) ** 2)
    return every(
        no_excess(0.0, upward[inside], m=m[inside], J=J[inside], rho=rho[inside]),
        agreement(floor(m, J, small) / lowest, 1.0, 2e-5, m=m, J=J, rho=small),
    )


@row(
    id="S4.19",
    section="4.3.3",
    equation="4.66",
    printed=r"\Psi(y, w) = (y - (x_2/v_2)\,w,\ w)",
    right=rolling.project,
    wrong=lambda x1, x2, alpha, v1, v2, omega: (x1 - x2 * v1, alpha - x2 * omega),
)
def projection_along_velocities(project: Code) -> Verdict:
    """Ψ carries a configuration along its velocity to the plane x₂ = 0.

    ⟨y, e₂⟩/⟨w, e₂⟩ is x₂/v₂ for every m. The null space of the differential is spanned by (w, 0).
    """
    y, w, t = (sym.x1, sym.x2, sym.alpha), VELOCITY, sp.Symbol("t", real=True)
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


@row(
    id="S4.20",
    section="4.3.3",
    equation="before 4.75",
    printed=r"|\alpha - \sin\bar\alpha|",
    wrong=lambda alpha, bar, xp: alpha - xp.sin(bar),
    corrected=r"|\bar\alpha - \sin\bar\alpha|",
    right=lambda alpha, bar, xp: bar - xp.sin(bar),
)
def slip_of_the_straightening(size: Code) -> Verdict:
    """The first coordinate of H₁(y) - y.

    Only with both bars is it of the order ρ³. As printed it grows with α.
    """
    x1, x2, bar = sp.symbols("x1 x2 bar", real=True)
    return verify(rolling.bend(x1, x2, bar, 1, sp)[0] - x1, size(sym.alpha, bar, sp))


@row(
    id="S4.21",
    section="4.3.3",
    equation="4.75",
    kind="numeric",
    printed=r"\|\eta - \mathrm{Id}\| \le C\rho",
    right=lambda: 1.0,
    wrong=lambda: 2.0,
)
def size_of_the_transfer(order: Code) -> Verdict:
    """η is within a multiple of ρ of the identity; the constant depends on m and J.

    1 - cos ᾱ is of the order ρ², and v₂ may be as small as ρ. The fitted order is 1, and C is J^(1/2)/4 where v₂ >
    J^(-1/2) sin(ρ/2), m/4 on the printed set.
    """
    counts = np.array([1e4, 1e5, 1e6])
    slopes, factors = [], []
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
        factors.append(sizes[-1] * counts[-1] / (2 * np.pi) / np.sqrt(J))
    return every(agreement(slopes, order(), 1e-4), agreement(factors, 1 / 4, 1e-4))


def _mirrored(x1: Any, alpha: Any, bar: Any, velocity: Any, scale: Any, xp: Any) -> Any:
    """phi_w as printed: every correction has the opposite sign."""
    right = rolling.transfer(x1, alpha, bar, velocity, scale, xp)
    return 2 * x1 - right[0], 2 * alpha - right[1]


def _mirrored_differential(bar: Any, velocity: Any, xp: Any) -> Any:
    right = rolling.transfer_differential(bar, velocity, 1, xp)
    return [[2 * (i == j) - right[i][j] for j in (0, 1)] for i in (0, 1)]


@row(
    id="S5.09",
    section="5.2",
    printed=r"\phi_w = \Bigl(x_1 - \bar\alpha + \sin\bar\alpha - (1 - \cos\bar\alpha)\frac{v_1}{v_2},\ "
    r"\alpha - (1 - \cos\bar\alpha)\frac{\omega}{v_2}\Bigr)",
    wrong=_mirrored,
    corrected=r"\phi_w = \Bigl(x_1 + \bar\alpha - \sin\bar\alpha + (1 - \cos\bar\alpha)\frac{v_1}{v_2},\ "
    r"\alpha + (1 - \cos\bar\alpha)\frac{\omega}{v_2}\Bigr)",
    right=rolling.transfer,
)
def transfer_of_the_entry(transfer: Code) -> Verdict:
    """φ_w: where the free flight with velocity w, started on the bent plane H₁(x₁, 0, α), meets x₂ = 0.

    The printed map is built from H₁⁻¹. It is recomputed from F, f_lin and the time of flight.
    """
    x1, w = sym.x1, VELOCITY
    s1, s2 = rolling.straight_contact(x1, 0, sym.alpha)
    c1, c2 = s1 - sp.sin(sym.alpha), s2 + sp.cos(sym.alpha) - 1
    time = -c2 / w[1]
    landed = c1 + time * w[0], sym.alpha + time * w[2]
    return verify(transfer(x1, sym.alpha, sym.alpha, w, 1, sp), landed)


@row(
    id="S5.10",
    section="5.2",
    printed=r"d\phi_w = \begin{pmatrix}1 & -(1 - \cos\bar\alpha) - \sin\bar\alpha\,v_1/v_2\\"
    r" 0 & 1 - \sin\bar\alpha\,\omega/v_2\end{pmatrix},\quad U = |1 - \sin\bar\alpha\,\omega/v_2|",
    wrong=_mirrored_differential,
    corrected=r"d\phi_w = \begin{pmatrix}1 & 1 - \cos\bar\alpha + \sin\bar\alpha\,v_1/v_2\\"
    r" 0 & 1 + \sin\bar\alpha\,\omega/v_2\end{pmatrix},\quad U = |1 + \sin\bar\alpha\,\omega/v_2|",
    right=lambda bar, velocity, xp: [row[:2] for row in rolling.transfer_differential(bar, velocity, 1, xp)],
)
def differential_of_the_transfer(differential: Code) -> Verdict:
    """The differential of φ_w and its determinant U.

    As printed it is the differential of the printed map. Claim 5.2.2 is not affected.
    """
    x1, w = sym.x1, VELOCITY
    image = sp.Matrix(rolling.transfer(x1, sym.alpha, sym.alpha, w, 1, sp))
    jacobian = sp.Matrix(differential(sym.alpha, w, sp))
    # the library's differential, for any scale and including the velocity
    zoomed = sp.Matrix(rolling.transfer(x1, sym.alpha, sym.alpha, w, sym.epsilon, sp))
    whole = rolling.transfer_differential(sym.alpha, w, sym.epsilon, sp)
    return every(
        verify(image.jacobian([x1, sym.alpha]), jacobian),
        verify(jacobian.det(), 1 + sp.sin(sym.alpha) * w[2] / w[1]),
        verify(zoomed.jacobian([x1, sym.alpha, *w]), sp.Matrix(whole)),
    )


@row(
    id="S5.11",
    section="5.2",
    equation="step 3",
    kind="numeric",
    printed=r"\tau'_{jk}(y) = y + (j + \lceil(1 + m/J)^{1/2}j\rho/\varepsilon\rceil)\varepsilon e_1 + (1 + "
    r"m/J)^{1/2}k\rho\chi",
    wrong=lambda j, k, m, J, ratio: (j + np.ceil(np.sqrt(1 + m / J) * j * ratio), np.sqrt(1 + m / J) * k * ratio),
    corrected=r"\tau'_{jk}(y) = y + (j + \lceil k\rho/\varepsilon\rceil)\varepsilon e_1 + (m + J)^{1/2}k\rho\chi",
    right=lambda j, k, m, J, ratio: (j + np.ceil(k * ratio), np.sqrt(m + J) * k * ratio),
)
def translation_along_the_rolling(shift: Code) -> Verdict:
    """τ′_jk, a translation along the rolling direction that turns the disk by kρ and is a whole number of periods and a
    remainder in [0, ε) along the wall.

    Three corrections: k for j, no factor in the ceiling, and the factor of χ. What is printed turns the disk by kρ only
    if J = 1.
    """
    rng, m, J = random_disks()
    j, k = rng.integers(-20, 21, (2, m.size))
    ratio = rng.uniform(1, 50, m.size)  # rho / eps
    periods, along = shift(j, k, m, J, ratio)
    rotated = along / np.sqrt(m + J)  # in units of eps; the centre moves by the opposite amount
    remainder = periods - rotated - j
    inside = (remainder > -1e-9) & (remainder < 1 + 1e-9)
    return every(
        holds(np.abs(rotated - k * ratio) < 1e-9, "turns by k rho", m=m, J=J), holds(inside, "remainders", j=j, k=k)
    )


@row(
    id="S5.12",
    section="5.2",
    equation="step 3",
    kind="numeric",
    printed=r"\vartheta\circ\tau'_{jk} = \tau_{jk}\text{ on }P_k",
    wrong=lambda k: k,
    corrected=r"\vartheta\circ\tau'_{jk} = \tau_{jk}\text{ on }P_0",
    right=lambda k: 0 * k,
)
def remainder_of_the_translation(start: Code) -> Verdict:
    """ϑ(y, w) = (y - ε(⌈kρ/ε⌉ - kρ/ε)e₁, w) on P_k takes the remainder off: ϑ ∘ τ′_jk is the symmetry y + jεe₁ + kρe₃.

    τ′_jk takes P₀ to P_k, where ϑ takes off what τ′_jk added. From P_k it goes to P_2k, whose remainder is another.
    """
    rng = generator()
    j, k = rng.integers(-20, 21, (2, 4000))
    ratio = rng.uniform(1, 50, 4000)
    arrived = start(k) + k
    taken_off = np.ceil(arrived * ratio) - arrived * ratio
    shift = j + np.ceil(k * ratio) - k * ratio - taken_off
    return holds(np.abs(shift - j) < 1e-9, "compositions", j=j, k=k, ratio=ratio)


@row(
    id="S5.13",
    section="5.2",
    printed=r"\Lambda^2(R_\varepsilon\times\mathbb S^2_+) = 2\pi\rho\varepsilon",
    wrong=lambda m, area, xp: 2 * xp.pi * area,
    corrected=r"\Lambda^2(R_\varepsilon\times\mathbb S^2_+) = \pi m^{1/2}\rho\varepsilon",
    right=lambda m, area, xp: xp.pi * xp.sqrt(m) * area,
)
def measure_of_the_rectangle(measure: Code) -> Verdict:
    """The measure Λ² of R_ε × S²₊, R_ε being the rectangle of sides ε and ρ.

    2π is the area of the hemisphere, without the factor ⟨w, e₂⟩ of the measure. With dx₁ dα and e₂ there remains
    m^(1/2), which is 1 for m = 1.
    """
    area = sp.Symbol("area", positive=True)
    upward = sp.simplify(sym.inner(sym.G, sym.e2))
    flux = sp.integrate(upward * sp.sin(sym.psi), (sym.theta, 0, sp.pi), (sym.psi, 0, sp.pi))
    return verify(area * flux, measure(sym.m, area, sp))
