"""Section 4.1: the unit normals of M where a satellite touches the wall."""

from __future__ import annotations

import sympy as sp

from ...geometry.disk import rolling
from ...geometry.disk import symbolic as sym
from ...geometry.disk.disk import contact_normal
from ...verification import Verdict, every, verify
from ..entry import Code, row


@row(
    id="S4.10",
    section="4.1",
    equation="remark 4.6",
    printed=r"n = R^{-1}\bigl(k_1/m,\ k_2/m,\ J^{-1}(k_1\cos\alpha + k_2\sin\alpha)\bigr)",
    right=lambda m, J, k, alpha, turn, xp: contact_normal(m, J, k, alpha, xp),
    wrong=lambda m, J, k, alpha, turn, xp: contact_normal(m, J, k, -alpha, xp),
)
def normal_of_the_boundary(normal: Code) -> Verdict:
    """The unit normal n(q) of M where S₀ touches: of norm 1, orthogonal to rolling and to sliding, inward.

    Rolling about S₀ is (-cos α, -sin α, 1), sliding along the wall (k₂, -k₁, 0). The kinetic-energy metric raises the
    gradient of the satellite's distance.
    """
    return _is_unit_normal(normal, rotated=False)


@row(
    id="S4.11",
    section="4.1",
    equation="3.26",
    printed=r"n = R^{-1}\bigl(k_1/m,\ k_2/m,\ J^{-1}(k_1\cos(\alpha - j\rho) + k_2\sin(\alpha - j\rho))\bigr)",
    wrong=lambda m, J, k, alpha, turn, xp: contact_normal(m, J, k, alpha - turn, xp),
    corrected=r"n = R^{-1}\bigl(k_1/m,\ k_2/m,\ J^{-1}(k_1\cos(\alpha + j\rho) + k_2\sin(\alpha + j\rho))\bigr),\quad "
    r"R = \bigl(m^{-1} + J^{-1}(k_1\cos(\alpha + j\rho) + k_2\sin(\alpha + j\rho))^2\bigr)^{1/2}",
    right=lambda m, J, k, alpha, turn, xp: contact_normal(m, J, k, alpha + turn, xp),
)
def normal_at_a_satellite(normal: Code) -> Verdict:
    """The unit normal n(q) of M where the satellite S_j touches.

    S_j is at the angle α + jρ of the rim. In R a parenthesis is misplaced too, and n(q) would not have norm 1.
    """
    return _is_unit_normal(normal, rotated=True)


def _is_unit_normal(normal: Code, rotated: bool) -> Verdict:
    """Whether a normal has norm 1 and the direction of the kinetic gradient of a satellite's wall distance."""
    direction, x1, x2, angle = sp.symbols("direction x1 x2 angle", real=True)
    turn = sp.Symbol("turn", real=True) if rotated else sp.Integer(0)
    k = sp.cos(direction), sp.sin(direction)
    centre = rolling.satellite(x1, x2, angle, 1, sp)
    gradient = [sp.diff(k[0] * centre[0] + k[1] * centre[1], q) for q in (x1, x2, angle)]
    raised = [g / weight for g, weight in zip(gradient, (sym.m, sym.m, sym.J), strict=True)]
    n = normal(sym.m, sym.J, k, angle - turn, turn, sp)
    parallel = [verify(n[i] * raised[0], n[0] * raised[i]) for i in (1, 2)]
    # n is never 0, so it is inward everywhere if it is inward at one position: over level ground it points up
    level = sp.Matrix(n).subs({direction: sp.pi / 2, angle: 0})
    return every(*parallel, verify(sym.inner(n, n), 1), verify(level, sp.Matrix([0, 1 / sp.sqrt(sym.m), 0])))
