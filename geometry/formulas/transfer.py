"""Section 5.2: the map phi_w between the entry planes of cylinder and disk, and the tiling of the plane."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...verification import Formula, Verdict, erratum, every, holds, verify
from ...verification.entry import Code
from .. import rolling
from .trials import generator, masses


def _mirrored(x1: Any, alpha: Any, bar: Any, velocity: Any, scale: Any, xp: Any) -> Any:
    """phi_w as printed: all corrections have the other sign."""
    right = rolling.transfer(x1, alpha, bar, velocity, scale, xp)
    return 2 * x1 - right[0], 2 * alpha - right[1]


def _mirrored_differential(bar: Any, velocity: Any, xp: Any) -> Any:
    right = rolling.transfer_differential(bar, velocity, 1, xp)
    return [[2 * (i == j) - right[i][j] for j in (0, 1)] for i in (0, 1)]


def _velocity(sp: Any) -> Any:
    return sp.Symbol("v1", real=True), sp.Symbol("v2", positive=True), sp.Symbol("omega", real=True)


@erratum(
    id="S5.09",
    section="5.2",
    statement="φ_w: where the free flight with velocity w, started on the bent plane H₁(x₁, 0, α), meets x₂ = 0.",
    printed=Formula(
        r"\phi_w = \Bigl(x_1 - \bar\alpha + \sin\bar\alpha - (1 - \cos\bar\alpha)\frac{v_1}{v_2},\ "
        r"\alpha - (1 - \cos\bar\alpha)\frac{\omega}{v_2}\Bigr)",
        _mirrored,
    ),
    corrected=Formula(
        r"\phi_w = \Bigl(x_1 + \bar\alpha - \sin\bar\alpha + (1 - \cos\bar\alpha)\frac{v_1}{v_2},\ "
        r"\alpha + (1 - \cos\bar\alpha)\frac{\omega}{v_2}\Bigr)",
        rolling.transfer,
    ),
    reason="The printed map is built from H₁⁻¹. It is recomputed from F, f_lin and the time of flight.",
)
def transfer_of_the_entry(transfer: Code) -> Verdict:
    import sympy as sp

    from .. import symbolic as sym

    x1, w = sp.Symbol("x1", real=True), _velocity(sp)
    s1, s2 = rolling.straight_contact(x1, 0, sym.alpha)
    c1, c2 = s1 - sp.sin(sym.alpha), s2 + sp.cos(sym.alpha) - 1
    time = -c2 / w[1]
    landed = c1 + time * w[0], sym.alpha + time * w[2]
    return verify(transfer(x1, sym.alpha, sym.alpha, w, 1, sp), landed)


@erratum(
    id="S5.10",
    section="5.2",
    statement="The differential of φ_w and its determinant U.",
    printed=Formula(
        r"d\phi_w = \begin{pmatrix}1 & -(1 - \cos\bar\alpha) - \sin\bar\alpha\,v_1/v_2\\"
        r" 0 & 1 - \sin\bar\alpha\,\omega/v_2\end{pmatrix},\quad U = |1 - \sin\bar\alpha\,\omega/v_2|",
        _mirrored_differential,
    ),
    corrected=Formula(
        r"d\phi_w = \begin{pmatrix}1 & 1 - \cos\bar\alpha + \sin\bar\alpha\,v_1/v_2\\"
        r" 0 & 1 + \sin\bar\alpha\,\omega/v_2\end{pmatrix},\quad U = |1 + \sin\bar\alpha\,\omega/v_2|",
        lambda bar, velocity, xp: [row[:2] for row in rolling.transfer_differential(bar, velocity, 1, xp)],
    ),
    reason="As printed it is the differential of the printed map. Claim 5.2.2 is not affected.",
)
def differential_of_the_transfer(differential: Code) -> Verdict:
    import sympy as sp

    from .. import symbolic as sym

    x1, w = sp.Symbol("x1", real=True), _velocity(sp)
    image = sp.Matrix(rolling.transfer(x1, sym.alpha, sym.alpha, w, 1, sp))
    jacobian = sp.Matrix(differential(sym.alpha, w, sp))
    return every(
        verify(image.jacobian([x1, sym.alpha]), jacobian),
        verify(jacobian.det(), 1 + sp.sin(sym.alpha) * w[2] / w[1]),
    )


@erratum(
    id="S5.11",
    section="5.2",
    equation="step 3",
    statement="τ′_jk, a translation along the rolling direction that turns the disk by kρ and is a whole number of "
    "periods and a remainder in [0, ε) along the wall.",
    kind="numeric",
    printed=Formula(
        r"\tau'_{jk}(y) = y + (j + \lceil(1 + m/J)^{1/2}j\rho/\varepsilon\rceil)\varepsilon e_1 + (1 + "
        r"m/J)^{1/2}k\rho\chi",
        lambda j, k, m, J, ratio: (j + np.ceil(np.sqrt(1 + m / J) * j * ratio), np.sqrt(1 + m / J) * k * ratio),
    ),
    corrected=Formula(
        r"\tau'_{jk}(y) = y + (j + \lceil k\rho/\varepsilon\rceil)\varepsilon e_1 + (m + J)^{1/2}k\rho\chi",
        lambda j, k, m, J, ratio: (j + np.ceil(k * ratio), np.sqrt(m + J) * k * ratio),
    ),
    reason="Three corrections: k for j, no factor in the ceiling, and the factor of χ. What is printed turns the "
    "disk by kρ only if J = 1.",
)
def translation_along_the_rolling(shift: Code) -> Verdict:
    rng = generator()
    m, J = masses(rng)
    j, k = rng.integers(-20, 21, (2, m.size))
    ratio = rng.uniform(1, 50, m.size)  # rho / eps
    periods, along = shift(j, k, m, J, ratio)
    turned = along / np.sqrt(m + J)  # in units of eps; the centre goes back as much
    remainder = periods - turned - j
    inside = (remainder > -1e-9) & (remainder < 1 + 1e-9)
    return every(
        holds(np.abs(turned - k * ratio) < 1e-9, "turns by k rho", m=m, J=J), holds(inside, "remainders", j=j, k=k)
    )


@erratum(
    id="S5.12",
    section="5.2",
    equation="step 3",
    statement="ϑ(y, w) = (y - ε(⌈kρ/ε⌉ - kρ/ε)e₁, w) on P_k takes the remainder off: ϑ ∘ τ′_jk is the symmetry y + "
    "jεe₁ + kρe₃.",
    kind="numeric",
    printed=Formula(r"\vartheta\circ\tau'_{jk} = \tau_{jk}\text{ on }P_k", lambda k: k),
    corrected=Formula(r"\vartheta\circ\tau'_{jk} = \tau_{jk}\text{ on }P_0", lambda k: 0 * k),
    reason="τ′_jk takes P₀ to P_k, where ϑ takes off what τ′_jk added. From P_k it goes to P_2k, whose remainder is "
    "another.",
)
def remainder_of_the_translation(start: Code) -> Verdict:
    rng = generator()
    j, k = rng.integers(-20, 21, (2, 4000))
    ratio = rng.uniform(1, 50, 4000)
    arrived = start(k) + k
    taken_off = np.ceil(arrived * ratio) - arrived * ratio
    shift = j + np.ceil(k * ratio) - k * ratio - taken_off
    return holds(np.abs(shift - j) < 1e-9, "compositions", j=j, k=k, ratio=ratio)


@erratum(
    id="S5.13",
    section="5.2",
    statement="The measure Λ² of R_ε × S²₊, R_ε being the rectangle of sides ε and ρ.",
    printed=Formula(
        r"\Lambda^2(R_\varepsilon\times\mathbb S^2_+) = 2\pi\rho\varepsilon", lambda m, area, xp: 2 * xp.pi * area
    ),
    corrected=Formula(
        r"\Lambda^2(R_\varepsilon\times\mathbb S^2_+) = \pi m^{1/2}\rho\varepsilon",
        lambda m, area, xp: xp.pi * xp.sqrt(m) * area,
    ),
    reason="2π is the area of the hemisphere, without the factor ⟨w, e₂⟩ of the measure. With dx₁ dα and e₂ there "
    "remains m^(1/2), which is 1 for m = 1.",
)
def measure_of_the_rectangle(measure: Code) -> Verdict:
    import sympy as sp

    from .. import symbolic as sym

    area = sp.Symbol("area", positive=True)
    upward = sp.simplify(sym.inner(sym.G, sym.e2))
    flux = sp.integrate(upward * sp.sin(sym.psi), (sym.theta, 0, sp.pi), (sym.psi, 0, sp.pi))
    return verify(area * flux, measure(sym.m, area, sp))
