"""Frame, chart and velocity matrices of a disk, written once for numbers and for symbols.

``xp`` is the arithmetic: ``numpy`` for arrays, ``sympy`` for expressions to prove things about; both know ``sqrt``,
``sin`` and ``cos``. The library computes with these formulas, and the ledger proves them.
"""

from __future__ import annotations

from typing import Any

import numpy as np


def frame_rows(mass: Any, inertia: Any, xp: Any = np) -> list[list[Any]]:
    """The orthonormal frame chi_perp, e2^, chi in the coordinates (v1, v2, omega).

    Source: Rudzis 2022, section 1.3.6, with the sign of chi of the index of notation.
    """
    across = 1 / xp.sqrt(1 / mass + 1 / inertia)
    along = 1 / xp.sqrt(mass + inertia)
    return [[across / mass, 0, across / inertia], [0, 1 / xp.sqrt(mass), 0], [-along, 0, along]]


def direction(theta: Any, psi: Any, xp: Any = np) -> list[Any]:
    """The components of a unit velocity in the frame: (cos theta sin psi, sin theta sin psi, cos psi).

    Source: Rudzis 2022, eq. 1.27'.
    """
    return [xp.cos(theta) * xp.sin(psi), xp.sin(theta) * xp.sin(psi), xp.cos(psi)]


def foreshortening(mass: Any, inertia: Any, xp: Any = np) -> Any:
    """kappa = (1 + m/J)^(-1/2), by which the disk's rotation compresses a wall along x (eq. 1.66)."""
    return 1 / xp.sqrt(1 + mass / inertia)


def branch_block(sign: Any, cosine: Any, sine: Any) -> list[list[Any]]:
    """In the frame, the matrix of theta' = sign theta + offset, psi' = pi - psi, given cos and sin of the offset.

    It takes the true incoming velocity to the outgoing one; the angles are those of *minus* the incoming velocity,
    hence the signs. The chi component is kept.
    """
    return [[-cosine, sign * sine, 0], [-sine, -sign * cosine, 0], [0, 0, 1]]


def contact_normal(mass: Any, inertia: Any, wall_normal: Any, turn: Any, xp: Any = np) -> list[Any]:
    """The inward unit normal n(q), in (v1, v2, omega), where the satellite at the angle ``turn`` touches a wall.

    The satellite is at (x1 + sin turn, x2 - cos turn) with turn = alpha + j rho, and ``wall_normal`` = (k1, k2) is the
    wall's unit normal, into the free side. In the kinetic-energy metric n(q) has length 1.

    Source: Rudzis 2022, remark 4.6 and eq. 3.26, corrected: it is alpha + j rho, and the root is that of
    1/m + (k1 cos turn + k2 sin turn)^2 / J.
    """
    k1, k2 = wall_normal
    torque = k1 * xp.cos(turn) + k2 * xp.sin(turn)
    length = xp.sqrt(1 / mass + torque**2 / inertia)
    return [k1 / (mass * length), k2 / (mass * length), torque / (inertia * length)]
