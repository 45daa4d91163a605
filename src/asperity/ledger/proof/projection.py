"""Section 5.1: the cylinder as a plane billiard with the foreshortened wall, times a free motion."""

from __future__ import annotations

from typing import Any

import numpy as np
import sympy as sp

from ...geometry.disk import rolling
from ...geometry.disk import symbolic as sym
from ...geometry.disk.disk import frame_rows
from ...verification import Verdict, every, holds, verify
from ..entry import Code, by_reading, row
from ..simulated import generator, random_disks


def _orthonormal(s1: Any, s2: Any) -> Any:
    """The components along chi_perp and e2^ of a configuration above the point (s1, s2) of the plane."""
    configuration = rolling.roll_linear(s1, s2, sym.alpha)
    return [sp.simplify(sym.inner(row, configuration)) for row in frame_rows(sym.m, sym.J, sp)[:2]]


@row(
    id="S5.01",
    section="5.1",
    equation="1.66, Thm. 5.1 (ii)",
    printed=r"\widetilde W = \{((1 + m/J)^{-1/2} x_1, x_2)\}",
    right=lambda m, J, xp: (1 + m / J) ** xp.Rational(-1, 2),
    wrong=lambda m, J, xp: (1 + m / J) ** xp.Rational(1, 2),
)
def compression_of_the_wall(factor: Code) -> Verdict:
    """The cross section of M_cyl, in orthonormal coordinates, is the wall compressed along x₁.

    χ⊥ and ê₂ are orthonormal, and x₁ + α and x₂ are what a point of M_cyl shows of itself along them. The common factor
    m^(1/2) changes no angle.
    """
    s1, s2 = sp.symbols("s1 s2", positive=True)
    across, up = _orthonormal(s1, s2)
    return verify(across / up, factor(sym.m, sym.J, sp) * s1 / s2)


@row(
    id="S5.02",
    status="convention",
    section="5.1",
    equation="step 1b",
    printed=r"\gamma = \arccos\langle e_3, \chi\rangle",
    wrong=lambda J, xp: (0, 0, 1),
    corrected=r"\gamma = \arccos\langle J^{-1/2}e_3, \chi\rangle",
    right=lambda J, xp: (0, 0, 1 / xp.sqrt(J)),
)
def angle_of_the_axis(axis: Code) -> Verdict:
    """The angle γ between χ and the axis of the disk's angle.

    The value arccos((1 + m/J)^(-1/2)) is right. It needs the unit vector J^(-1/2) e₃, or J = 1.
    """
    direction = axis(sym.J, sp)
    return every(
        verify(sym.inner(direction, sym.chi), 1 / sp.sqrt(1 + sym.m / sym.J)),
        verify(sym.inner(direction, direction), 1),
    )


@row(
    id="S5.03",
    status="convention",
    section="5.1",
    equation="3.3",
    printed=r"\pi_0(x_1, x_2) = ((1 + m/J)^{-1/2}x_1,\ x_2)",
    wrong=lambda s1, s2, m, J, xp: (s1 / xp.sqrt(1 + m / J), s2),
    corrected=r"\pi_0(x_1, x_2) = m^{1/2}((1 + m/J)^{-1/2}x_1,\ x_2)",
    right=lambda s1, s2, m, J, xp: (xp.sqrt(m) * s1 / xp.sqrt(1 + m / J), xp.sqrt(m) * s2),
)
def projection_of_the_cylinder(image: Code) -> Verdict:
    """The projection π₀ of Q₁ onto the plane billiard, as an isometry.

    As printed it is an isometry for m = 1. In general the period of the projected wall is (1/m + 1/J)^(-1/2) ε, and
    angles are the same.
    """
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


@row(
    id="S5.05",
    section="5.1",
    kind="numeric",
    printed=r"\{0\le x_1\le\varepsilon,\ 0\le x_1 + \alpha\le\varepsilon\}",
    wrong=lambda x1, alpha, eps: (x1 >= 0) & (x1 <= eps) & (x1 + alpha >= 0) & (x1 + alpha <= eps),
    corrected=r"\{0\le x_1 + \alpha\le\varepsilon,\ 0\le\alpha\le\varepsilon\}",
    right=lambda x1, alpha, eps: (x1 + alpha >= 0) & (x1 + alpha <= eps) & (alpha >= 0) & (alpha <= eps),
)
def scaled_region(region: Code) -> Verdict:
    """The region R_{ε×ε} as ε times R_{1×1} = {0 ≤ x₁ + α ≤ 1, 0 ≤ α ≤ 1}.

    Both have the area ε², but only one is the scaled region. The slip is an exchange of coordinates.
    """
    rng = generator()
    x1, alpha = rng.uniform(-1.5, 1.5, (2, 4000))
    in_unit = (x1 + alpha >= 0) & (x1 + alpha <= 1) & (alpha >= 0) & (alpha <= 1)
    return holds(region(x1 / 64, alpha / 64, 1 / 64) == in_unit, "points", x1=x1, alpha=alpha)


@row(
    id="S5.06",
    status="convention",
    section="5.1",
    equation="Claim 5.1.1",
    kind="numeric",
    printed=r"\tau_{jk}(y) = y + j\varepsilon e_1 + (1 + m/J)^{1/2}k\varepsilon\chi",
    wrong=lambda m, J: np.sqrt(1 + m / J),
    corrected=r"\tau_{jk}(y) = y + j\varepsilon e_1 + (m + J)^{1/2}k\varepsilon\chi",
    right=lambda m, J: np.sqrt(m + J),
)
def covering_by_squares(factor: Code) -> Verdict:
    """The translations τ_jk by which R_{ε×ε} covers the plane once.

    A step has to turn the disk by ε, and χ turns by (m + J)^(-1/2). As printed it does so if and only if J = 1.
    """
    rng, m, J = random_disks()
    step = factor(m, J) / np.sqrt(m + J)  # of alpha, in units of eps; x1 changes by the opposite amount
    x1, alpha = rng.uniform(-40, 40, (2, m.size))
    # half of the points are next to the edges
    alpha[::2] = np.rint(alpha[::2]) + np.where(np.arange(m.size // 2) % 2, 1e-9, -1e-9)
    number = np.arange(-120, 121)[:, np.newaxis]
    over, above = x1 + alpha - number, alpha - number * step
    times = np.sum((over >= 0) & (over < 1), axis=0) * np.sum((above >= 0) & (above < 1), axis=0)
    return holds(times == 1, "points are covered once", m=m, J=J)


@row(
    id="S5.07",
    section="5.1",
    equation="step 3",
    printed=r"\tilde\varepsilon_i = (1 + m/J)^{1/2}\varepsilon_i",
    wrong=lambda m, J, xp: xp.sqrt(1 + m / J),
    corrected=r"\tilde\varepsilon_i = (1 + m/J)^{-1/2}\varepsilon_i",
    right=lambda m, J, xp: 1 / xp.sqrt(1 + m / J),
)
def scale_of_the_foreshortened_wall(factor: Code) -> Verdict:
    """The scale of the foreshortened wall, whose cell Σ̃ᵢ is Σᵢ stretched in x₂ by (1 + m/J)^(1/2).

    Compressing x₁ is stretching x₂ and scaling down. As printed the period would grow.
    """
    s1, s2 = sp.symbols("s1 s2", real=True)
    stretch = sp.sqrt(1 + sym.m / sym.J)
    scale = factor(sym.m, sym.J, sp)
    return verify([scale * s1, scale * stretch * s2], [s1 / stretch, s2])


@row(
    id="S5.08",
    section="5.1",
    equation="converse of Thm. 5.1",
    kind="numeric",
    printed=r"\sin\theta\,d\theta\text{ is invariant}",
    wrong=lambda law, f, g: (np.mean(f[law]), np.mean(f)),
    corrected=r"\text{the law is symmetric for }\sin\theta\,d\theta",
    right=lambda law, f, g: (np.mean(f[law] * g), np.mean(f * g[law])),
)
def condition_for_a_limit(sides: Code) -> Verdict:
    """What a deterministic law must satisfy to be a limit of reflection laws, all of which are involutions.

    A rotation of -cos θ keeps the measure but is no involution. A limit of symmetric laws is symmetric.
    """
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
