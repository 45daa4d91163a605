"""Section 5.1: the cylinder as a plane billiard with the foreshortened wall, times a free motion."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...geometry.disk import rolling
from ...geometry.disk.disk import frame_rows
from ...verification import Verdict, every, holds, verify
from ..entry import Code, Formula, by_reading, convention, erratum, verified
from ..samples import generator, masses
from ..symbols import sp, sym


def _orthonormal(s1: Any, s2: Any) -> Any:
    """The components along chi_perp and e2^ of a configuration above the point (s1, s2) of the plane."""
    configuration = rolling.roll_linear(s1, s2, sym.alpha)
    return [sp.simplify(sym.inner(row, configuration)) for row in frame_rows(sym.m, sym.J, sp)[:2]]


@verified(
    id="S5.01",
    section="5.1",
    equation="1.66, Thm. 5.1 (ii)",
    statement="The cross section of M_cyl, in orthonormal coordinates, is the wall compressed along x₁ by (1 + "
    "m/J)^(-1/2).",
    printed=Formula(
        r"\widetilde W = \{((1 + m/J)^{-1/2} x_1, x_2)\}", lambda m, J, xp: (1 + m / J) ** xp.Rational(-1, 2)
    ),
    perturbed=lambda m, J, xp: (1 + m / J) ** xp.Rational(1, 2),
    reason="χ⊥ and ê₂ are orthonormal, and x₁ + α and x₂ are what a point of M_cyl shows of itself along them. The "
    "common factor m^(1/2) changes no angle.",
)
def compression_of_the_wall(factor: Code) -> Verdict:
    s1, s2 = sp.symbols("s1 s2", positive=True)
    across, up = _orthonormal(s1, s2)
    return verify(across / up, factor(sym.m, sym.J, sp) * s1 / s2)


@convention(
    id="S5.02",
    section="5.1",
    equation="step 1b",
    statement="The angle γ between χ and the axis of the disk's angle.",
    printed=Formula(r"\gamma = \arccos\langle e_3, \chi\rangle", lambda J, xp: (0, 0, 1)),
    corrected=Formula(r"\gamma = \arccos\langle J^{-1/2}e_3, \chi\rangle", lambda J, xp: (0, 0, 1 / xp.sqrt(J))),
    reason="The value arccos((1 + m/J)^(-1/2)) is right. It needs the unit vector J^(-1/2) e₃, or J = 1.",
)
def angle_of_the_axis(axis: Code) -> Verdict:
    direction = axis(sym.J, sp)
    return every(
        verify(sym.inner(direction, sym.chi), 1 / sp.sqrt(1 + sym.m / sym.J)),
        verify(sym.inner(direction, direction), 1),
    )


@convention(
    id="S5.03",
    section="5.1",
    equation="3.3",
    statement="The projection π₀ of Q₁ onto the plane billiard, as an isometry.",
    printed=Formula(
        r"\pi_0(x_1, x_2) = ((1 + m/J)^{-1/2}x_1,\ x_2)", lambda s1, s2, m, J, xp: (s1 / xp.sqrt(1 + m / J), s2)
    ),
    corrected=Formula(
        r"\pi_0(x_1, x_2) = m^{1/2}((1 + m/J)^{-1/2}x_1,\ x_2)",
        lambda s1, s2, m, J, xp: (xp.sqrt(m) * s1 / xp.sqrt(1 + m / J), xp.sqrt(m) * s2),
    ),
    reason="As printed it is an isometry for m = 1. In general the period of the projected wall is (1/m + "
    "1/J)^(-1/2) ε, and angles are the same.",
)
def projection_of_the_cylinder(image: Code) -> Verdict:
    s1, s2 = sp.symbols("s1 s2", real=True)
    return verify(image(s1, s2, sym.m, sym.J, sp), _orthonormal(s1, s2))


projection_of_the_state = by_reading(
    id="S5.04",
    section="5.1",
    equation="3.7, 3.10",
    statement="The projection π₁,₃ of a state, and the coordinates of the plane y₂ = 0.",
    printed=r"\pi_{1,3}(y_1, y_3, \theta, \psi) = (y_1, \psi),\quad (y_1, y_2)",
    corrected=r"\pi_{1,3}(y_1, y_3, \theta, \psi) = (y_1, \theta),\quad (y_1, y_3)",
    reason="The plane billiard has the angle θ. The identity itself is row S2.28.",
)


@erratum(
    id="S5.05",
    section="5.1",
    statement="The region R_{ε×ε} as ε times R_{1×1} = {0 ≤ x₁ + α ≤ 1, 0 ≤ α ≤ 1}.",
    kind="numeric",
    printed=Formula(
        r"\{0\le x_1\le\varepsilon,\ 0\le x_1 + \alpha\le\varepsilon\}",
        lambda x1, alpha, eps: (x1 >= 0) & (x1 <= eps) & (x1 + alpha >= 0) & (x1 + alpha <= eps),
    ),
    corrected=Formula(
        r"\{0\le x_1 + \alpha\le\varepsilon,\ 0\le\alpha\le\varepsilon\}",
        lambda x1, alpha, eps: (x1 + alpha >= 0) & (x1 + alpha <= eps) & (alpha >= 0) & (alpha <= eps),
    ),
    reason="Both have the area ε², but only one is the scaled region. The slip is an exchange of coordinates.",
)
def scaled_region(region: Code) -> Verdict:
    rng = generator()
    x1, alpha = rng.uniform(-1.5, 1.5, (2, 4000))
    in_unit = (x1 + alpha >= 0) & (x1 + alpha <= 1) & (alpha >= 0) & (alpha <= 1)
    return holds(region(x1 / 64, alpha / 64, 1 / 64) == in_unit, "points", x1=x1, alpha=alpha)


@convention(
    id="S5.06",
    section="5.1",
    equation="Claim 5.1.1",
    statement="The translations τ_jk by which R_{ε×ε} covers the plane once.",
    kind="numeric",
    printed=Formula(
        r"\tau_{jk}(y) = y + j\varepsilon e_1 + (1 + m/J)^{1/2}k\varepsilon\chi", lambda m, J: np.sqrt(1 + m / J)
    ),
    corrected=Formula(
        r"\tau_{jk}(y) = y + j\varepsilon e_1 + (m + J)^{1/2}k\varepsilon\chi", lambda m, J: np.sqrt(m + J)
    ),
    reason="A step has to turn the disk by ε, and χ turns by (m + J)^(-1/2). As printed it does so if and only if J "
    "= 1.",
)
def covering_by_squares(factor: Code) -> Verdict:
    rng = generator()
    m, J = masses(rng)
    step = factor(m, J) / np.sqrt(m + J)  # of alpha, in units of eps; x1 changes by the opposite amount
    x1, alpha = rng.uniform(-40, 40, (2, m.size))
    # half of the points are next to the edges
    alpha[::2] = np.rint(alpha[::2]) + np.where(np.arange(m.size // 2) % 2, 1e-9, -1e-9)
    number = np.arange(-120, 121)[:, np.newaxis]
    over, above = x1 + alpha - number, alpha - number * step
    times = np.sum((over >= 0) & (over < 1), axis=0) * np.sum((above >= 0) & (above < 1), axis=0)
    return holds(times == 1, "points are covered once", m=m, J=J)


@erratum(
    id="S5.07",
    section="5.1",
    equation="step 3",
    statement="The scale of the foreshortened wall, whose cell Σ̃ᵢ is Σᵢ stretched in x₂ by (1 + m/J)^(1/2).",
    printed=Formula(r"\tilde\varepsilon_i = (1 + m/J)^{1/2}\varepsilon_i", lambda m, J, xp: xp.sqrt(1 + m / J)),
    corrected=Formula(r"\tilde\varepsilon_i = (1 + m/J)^{-1/2}\varepsilon_i", lambda m, J, xp: 1 / xp.sqrt(1 + m / J)),
    reason="Compressing x₁ is stretching x₂ and scaling down. As printed the period would grow.",
)
def scale_of_the_foreshortened_wall(factor: Code) -> Verdict:
    s1, s2 = sp.symbols("s1 s2", real=True)
    stretch = sp.sqrt(1 + sym.m / sym.J)
    scale = factor(sym.m, sym.J, sp)
    return verify([scale * s1, scale * stretch * s2], [s1 / stretch, s2])


@erratum(
    id="S5.08",
    section="5.1",
    equation="converse of Thm. 5.1",
    statement="What a deterministic law must satisfy to be a limit of reflection laws, all of which are involutions.",
    kind="numeric",
    printed=Formula(r"\sin\theta\,d\theta\text{ is invariant}", lambda law, f, g: (np.mean(f[law]), np.mean(f))),
    corrected=Formula(
        r"\text{the law is symmetric for }\sin\theta\,d\theta",
        lambda law, f, g: (np.mean(f[law] * g), np.mean(f * g[law])),
    ),
    reason="A rotation of -cos θ keeps the measure but is no involution. A limit of symmetric laws is symmetric.",
)
def condition_for_a_limit(sides: Code) -> Verdict:
    rng = generator()
    cells = np.arange(100)  # of equal length in -cos(theta)
    pairs = rng.permutation(100).reshape(2, 50)
    matching = np.empty(100, dtype=np.int64)
    matching[pairs] = pairs[::-1]
    laws = [cells, cells[::-1], matching, np.roll(cells, 50), np.roll(cells, 15), rng.permutation(100)]
    f, g = rng.normal(size=(2, 100))
    admitted = [law for law in laws if abs(np.subtract(*sides(law, f, g))) < 1e-12]
    involutions = [bool(np.all(law[law] == cells)) for law in admitted]
    return every(holds(len(admitted) >= 4, "searches admit the involutions"), holds(involutions, "admitted laws"))
