r"""The coordinates of the disk as sympy objects, to verify your own formulas with `verify`.

Attributes
----------
m, J : Symbol
    Mass and moment of inertia, positive.
theta, psi : Symbol
    The angles of a velocity, real; `ANGLES` is the condition that both are in (0, pi).
alpha, rho, k1, k2 : Symbol
    Angle of the disk, spacing of its satellites, and the components of the wall's unit normal.
metric : Matrix
    The kinetic-energy metric, diag(m, m, J).
chi_perp, e2_hat, chi : Matrix
    The orthonormal frame, column vectors in the coordinates (v1, v2, omega).
G, G_jacobian : Matrix
    The chart (theta, psi) -> w of the upper half of the unit sphere, and its Jacobian, 3 by 2.
lambda2 : Expr
    The density sin(theta) sin(psi)^2 of the invariant measure Lambda^2 in the angles.
smooth, no_slip : Matrix
    The velocity matrices of smooth and no-slip collisions, incoming to outgoing.
x1, x2, v1, v2, omega, epsilon : Symbol
    Centre of the disk, its velocity (v2 positive), and the scale of the charts.
roll, roll_linear, bend, straighten : Matrix
    The charts f*, f_lin, H_eps and its inverse at (x1, x2, alpha) on Z^0*, with heights relative to the tops as in
    `RollingCharts`. For epsilon = 1 they are F, f_lin, H_1 and its inverse.
contact, plane_crossing, transfer : Matrix
    G_eps, the position of Psi and the position phi_w of eta, also on Z^0*.

Examples
--------
>>> import sympy
>>> from asperity import verify
>>> from asperity.geometry import symbolic as sym
>>> verify(sym.inner(sym.G, sym.G), 1).answer
'proved'
>>> verify(sym.inner(sym.G, sym.e2), sympy.sin(sym.theta) * sympy.sin(sym.psi), sym.ANGLES).answer
'refuted'
>>> dphi = sym.transfer.jacobian([sym.x1, sym.alpha])
>>> verify(dphi.det(), 1 + sympy.sin(sym.epsilon * sym.alpha) * sym.omega / sym.v2).answer
'proved'
"""

from __future__ import annotations

from typing import Any

import sympy as sp
from sympy import cos, sin

from . import rolling
from .disk import branch_block, contact_normal, direction, frame_rows

__all__ = [
    "ANGLES", "G", "G_jacobian", "J", "alpha", "bend", "branch_matrix", "chi", "chi_perp", "contact", "e2", "e2_hat",
    "epsilon", "frame", "inner", "k1", "k2", "lambda2", "m", "metric", "no_slip", "omega", "plane_crossing", "psi",
    "rho", "roll", "roll_linear", "satellite_normal", "smooth", "straighten", "theta", "transfer", "v1", "v2",
    "volume_density", "x1", "x2",
]  # fmt: skip

m, J = sp.symbols("m J", positive=True)
theta, psi, alpha = sp.symbols("theta psi alpha", real=True)
rho = sp.Symbol("rho", positive=True)
k1, k2 = sp.symbols("k1 k2", real=True)
x1, x2, v1, omega = sp.symbols("x1 x2 v1 omega", real=True)
v2, epsilon = sp.symbols("v2 epsilon", positive=True)

ANGLES = (theta > 0, theta < sp.pi, psi > 0, psi < sp.pi)

metric = sp.diag(m, m, J)
frame = sp.Matrix(frame_rows(m, J, sp))
chi_perp, e2_hat, chi = (frame.row(i).T for i in range(3))
e2 = sp.Matrix([0, 1, 0])
G = frame.T * sp.Matrix(direction(theta, psi, sp))
G_jacobian = G.jacobian([theta, psi])


def inner(w: Any, w2: Any) -> Any:
    """Return the kinetic-energy inner product of two velocities."""
    return (sp.Matrix(w).T * metric * sp.Matrix(w2))[0, 0]


def volume_density(chart: Any, parameters: Any) -> Any:
    """Return the kinetic-energy area density of a parametrised surface or curve, the root of its Gram determinant."""
    jacobian = sp.Matrix(chart).jacobian(sp.Matrix(parameters))
    return sp.sqrt(sp.simplify((jacobian.T * metric * jacobian).det()))


def branch_matrix(sign: Any, offset: Any) -> Any:
    """Return the velocity matrix of theta' = sign theta + offset, psi' = pi - psi, incoming to outgoing."""
    block = sp.Matrix(branch_block(sign, cos(offset), sin(offset)))
    return (frame.T * block * frame * metric).applyfunc(sp.cancel)


def satellite_normal(number: Any) -> Any:
    """Return the inward unit normal n(q) for contact of satellite ``number`` with a wall of unit normal k.

    Source: Rudzis 2022, remark 4.6 and eq. 3.26, corrected; see `contact_normal` in `disk/disk`.
    """
    return sp.Matrix(contact_normal(m, J, (k1, k2), alpha + number * rho, sp))


smooth = branch_matrix(-1, sp.pi)
no_slip = branch_matrix(1, 0)
lambda2 = sin(theta) * sin(psi) ** 2

roll = sp.Matrix([*rolling.roll(x1, x2, alpha, epsilon, sp), alpha])
roll_linear = sp.Matrix(rolling.roll_linear(x1, x2, alpha))
bend = sp.Matrix([*rolling.bend(x1, x2, alpha, epsilon, sp), alpha])
straighten = sp.Matrix([*rolling.straighten(x1, x2, alpha, epsilon, sp), alpha])
contact = sp.Matrix(rolling.satellite(x1, x2, alpha, epsilon, sp))
plane_crossing = sp.Matrix(rolling.project(x1, x2, alpha, v1, v2, omega))
transfer = sp.Matrix(rolling.transfer(x1, alpha, alpha, (v1, v2, omega), epsilon, sp))
