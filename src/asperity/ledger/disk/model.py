"""Section 1.3: the disk with satellites, its rolling, and the cylinder that replaces its configuration space."""

from __future__ import annotations

import numpy as np
import sympy as sp

from ...geometry.disk import rolling
from ...verification import Verdict, every, no_excess, verify
from ..entry import Code, by_reading, row


@row(
    id="S1.12",
    section="1.3.1",
    equation="1.38",
    printed=r"S_k = (x_1 + \sin(\alpha + k\rho),\ x_2 - \cos(\alpha + k\rho))",
    # heights in the library are greater by 1
    right=lambda x1, x2, alpha, turn, xp: rolling.satellite(x1, x2 - 1, alpha + turn, 1, xp),
    wrong=lambda x1, x2, alpha, turn, xp: rolling.satellite(x1, x2 - 1, alpha - turn, 1, xp),
)
def satellites_of_the_rotated_disk(satellite: Code) -> Verdict:
    """The k-th satellite after the disk has turned by α, counter-clockwise.

    It is the satellite of the unturned disk, turned by the matrix of the rotation. Signs of angles that are half wrong
    still agree for k = 0.
    """
    x1, x2, alpha, turn = sp.symbols("x1 x2 alpha krho", real=True)
    rotation = sp.Matrix([[sp.cos(alpha), -sp.sin(alpha)], [sp.sin(alpha), sp.cos(alpha)]])
    rotated = sp.Matrix([x1, x2]) + rotation * sp.Matrix([sp.sin(turn), -sp.cos(turn)])
    return verify(satellite(x1, x2, alpha, turn, sp), list(rotated))


@row(
    id="S1.13",
    section="1.3.1",
    equation="1.34",
    kind="numeric",
    printed=r"D_0 = \{|y - x| \le 1 - 2\rho^2\}, \quad D_0 \cap W = \emptyset",
    right=lambda spacing: 1 - 2 * spacing**2,
    wrong=lambda spacing: 1 - spacing**2,
)
def inner_disk_is_clear_of_the_wall(radius: Code) -> Verdict:
    """The inner disk D₀ never touches the wall: satellites do.

    The lowest satellite is within ρ/2 of the vertical, so the disk sinks at most ε + 1 − cos(ρ/2). That is less than
    2ρ² if ε ≤ 15/8 ρ², for which 2 is the best constant; for ε of smaller order than ρ² it is 1/8.
    """
    rng = np.random.default_rng(3)
    spacing = 2 * np.pi / rng.integers(12, 2000, 500)
    depth = 15 / 8 * spacing**2
    bar = rng.uniform(-0.5, 0.5, (500, 400)) * spacing[:, None]
    bar[:, 0] = 0.5 * spacing
    # tops at height -1, bottoms at -1 - depth: the height of a centre whose lowest satellite is at a bottom
    centre = -1 - depth + np.min(np.cos(bar), axis=1)
    left = centre - radius(spacing) + 1
    # 1 - cos(rho/2) = rho^2/8 - rho^4/384 + ...
    return every(
        no_excess(0.0, left, 1e-15, spacing=spacing), no_excess(left, spacing**4 / 384, 1e-15, spacing=spacing)
    )


@row(
    id="S1.15",
    section="1.3.3",
    equation="1.40",
    printed=r"(x_1 - \sin\alpha,\ x_2 - 1 + \cos\alpha,\ \alpha)",
    right=lambda x1, x2, alpha, xp: rolling.roll(x1, x2, alpha, 1, xp),
    wrong=lambda x1, x2, alpha, xp: rolling.bend(x1, x2, alpha, 1, xp),
)
def rolling_about_the_lowest_satellite(centre: Code) -> Verdict:
    """Rolling about S₀: the disk turns and its contact satellite stays.

    The satellite of the moved disk is where it was. To first order the centre moves by (−α, 0), which is the direction
    of χ.
    """
    x1, x2, alpha = sp.symbols("x1 x2 alpha", real=True)
    moved1, moved2 = centre(x1, x2, alpha, sp)
    linear = [sp.diff(coordinate, alpha).subs(alpha, 0) for coordinate in (moved1, moved2)]
    return every(verify(rolling.satellite(moved1, moved2, alpha, 1, sp), (x1, x2)), verify(linear, (-1, 0)))


@row(
    id="S1.16",
    section="1.3.3",
    printed=r"\mathcal M_{\mathrm{cyl}} = \{(x_1, x_2, \alpha) : (x_1 + \alpha, \alpha) \in W^c + e_2\}",
    wrong=lambda x1, x2, alpha: (x1 + alpha, alpha),
    corrected=r"\mathcal M_{\mathrm{cyl}} = \{(x_1, x_2, \alpha) : (x_1 + \alpha, x_2) \in \overline{W^c} + e_2\}",
    right=lambda x1, x2, alpha: (x1 + alpha, x2),
)
def cylinder_over_the_wall(base_point: Code) -> Verdict:
    """The cylinder: configurations whose straightened satellite is outside the wall.

    The cylinder is invariant along (−1, 0, 1), and at α = 0 the satellite is at the height of x₂. Section 4.2 has it
    right.
    """
    x1, x2, alpha, step = sp.symbols("x1 x2 alpha s", real=True)
    return every(
        verify(base_point(x1 - step, x2, alpha + step), base_point(x1, x2, alpha)),
        verify(base_point(x1, x2, 0), rolling.satellite(x1, x2, 0, 1, sp)),
    )


cell_of_the_positions = by_reading(
    id="S1.25",
    section="1.3.8",
    statement="The rectangle R_ε of positions.",
    printed=r"-\rho/2 \le x_2 \le \rho/2",
    corrected=r"-\rho/2 \le \alpha \le \rho/2",
    reason="On the plane of positions x₂ = 0, and the bounded coordinate is the angle. Eq. 5.26 has it right.",
)

measure_of_the_flux = by_reading(
    id="S1.26",
    section="1.3.8",
    equation="1.72",
    statement="The measure in the symmetry of the limit law.",
    printed=r"\Lambda^2(dy'\, dw')",
    corrected=r"\Lambda^2(dy\, dw)",
    reason="The integral is over incoming states with the outgoing ones as values. Both sides carry the primes.",
)

where_the_particle_moves = by_reading(
    id="S1.27",
    section="1.3.8",
    equation="Step 1",
    statement="Where the foreshortened particle moves.",
    printed=r"Q_1 \setminus \mathcal M_{\mathrm{cyl}}",
    corrected=r"Q_1 \cap \mathcal M_{\mathrm{cyl}}",
    reason="The cylinder is the free part of the configuration space. The set difference is the wall.",
)

smoothness_of_collisions = by_reading(
    id="S1.28",
    section="1.3.5",
    equation="Proposition on dualities (i)",
    statement="How smooth the collision map is.",
    printed=r"K \text{ is a } C^2 \text{ diffeomorphism}",
    corrected=r"K \text{ is a } C^1 \text{ diffeomorphism}",
    reason="A reflection is as smooth as the unit normal, which is C¹ on a C² wall. Section 6 has it right.",
)
