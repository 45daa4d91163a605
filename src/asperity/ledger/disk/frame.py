"""Sections 1.3 and 1.3.6: the disk with satellites and its cylinder, its frame, and the sphere of its velocities."""

from __future__ import annotations

from typing import Any

import numpy as np
import sympy as sp

from ...geometry.disk import rolling
from ...geometry.disk import symbolic as sym
from ...geometry.disk.disk import direction, foreshortening, frame_rows
from ...verification import Verdict, every, no_excess, verify
from ..entry import Code, by_reading, row


@row(
    id="S1.17",
    section="1.3.3",
    equation="1.42, 1.1'",
    printed=r"\tilde\chi = (-1, 0, 1), \quad \langle w, \tilde\chi\rangle = -m v_1 + J\omega",
    right=lambda m, J, v1, omega: -m * v1 + J * omega,
    wrong=lambda m, J, v1, omega: m * v1 + J * omega,
)
def rolling_momentum(momentum: Code) -> Verdict:
    """What every collision conserves is the inner product with the rolling direction.

    The kinetic-energy inner product with (-1, 0, 1) is this. It is the angular momentum about the contact.
    """
    v1, v2, omega = sp.symbols("v1 v2 omega", real=True)
    return verify(momentum(sym.m, sym.J, v1, omega), sym.inner([v1, v2, omega], [-1, 0, 1]))


@row(
    id="S1.18",
    section="1.3.6, 4.2",
    printed=r"\chi = (m + J)^{-1/2} (1, 0, -1)",
    wrong=lambda m, J, xp: [1 / xp.sqrt(m + J), 0, -1 / xp.sqrt(m + J)],
    corrected=r"\chi = (m + J)^{-1/2} (-1, 0, 1)",
    right=lambda m, J, xp: frame_rows(m, J, xp)[2],
)
def sign_of_the_rolling_direction(chi: Code) -> Verdict:
    """The unit rolling direction χ, which completes χ⊥ and ê₂ to a frame that is turned, not mirrored.

    With the printed sign the frame is left-handed, while the index of notation, eq. 1.42 and section 5.3.4 have the
    other sign. All laws of velocities are even in χ and keep their form.
    """
    frame = sp.Matrix([*frame_rows(sym.m, sym.J, sp)[:2], chi(sym.m, sym.J, sp)])
    orientation = verify((frame * sym.metric.applyfunc(sp.sqrt)).det(), 1)
    return every(orientation, verify(frame * sym.metric * frame.T, sp.eye(3)))


@row(
    id="S1.19",
    section="1.3.6",
    printed=r"\chi_\perp = \Bigl(\frac1m + \frac1J\Bigr)^{-1/2} \Bigl(\frac1m, 0, \frac1J\Bigr),\quad"
    r"\hat e_2 = m^{-1/2}(0, 1, 0)",
    right=frame_rows,
    wrong=lambda m, J, xp: [frame_rows(m, m, xp)[0], *frame_rows(m, J, xp)[1:]],
)
def the_frame_is_orthonormal(frame_of: Code) -> Verdict:
    """(χ⊥, ê₂, χ) is orthonormal for the kinetic-energy inner product.

    The Gram matrix is the identity for all m and J, which either sign of χ would do. The signs are those in which the
    contact's velocity, the vertical one and the rolling momentum are multiples of the components.
    """
    frame = sp.Matrix(frame_of(sym.m, sym.J, sp))
    w = sp.Matrix([sym.v1, sym.v2, sym.omega])
    m, J = sym.m, sym.J
    contact, momentum = sym.v1 + sym.omega, J * sym.omega - m * sym.v1
    shown = sp.Matrix([contact / sp.sqrt(1 / m + 1 / J), sp.sqrt(m) * sym.v2, momentum / sp.sqrt(m + J)])
    return every(verify(frame * sym.metric * frame.T, sp.eye(3)), verify(frame * sym.metric * w, shown))


@row(
    id="S1.20",
    section="1.3.6",
    equation="1.27'",
    printed=r"G(\theta, \psi) = \cos\theta\sin\psi\,\chi_\perp + \sin\theta\sin\psi\,\hat e_2 + \cos\psi\,\chi",
    right=direction,
    wrong=lambda theta, psi, xp: [xp.sin(psi), xp.cos(psi) * xp.sin(theta), xp.cos(psi) * xp.cos(theta)],
)
def chart_of_the_half_sphere(components: Code) -> Verdict:
    """The chart G takes the angles to the upper unit half sphere, with spherical area sin ψ dθ dψ.

    Its image has length 1, its Gram determinant is sin²ψ, and it takes (0, π/2), (π/2, π/2), (0, 0) to χ⊥, ê₂, χ. The
    perturbed chart takes the equator for the pole, and has the density of latitude.
    """
    chart = sym.frame.T * sp.Matrix(components(sym.theta, sym.psi, sp))
    area = sym.volume_density(chart, [sym.theta, sym.psi])
    quarter = sp.pi / 2
    axes = [components(*angles, sp) for angles in ((0, quarter), (quarter, quarter), (0, 0))]
    return every(
        verify(sym.inner(chart, chart), 1),
        verify(area, sp.sin(sym.psi), sym.ANGLES),
        verify(sp.Matrix(axes), sp.eye(3)),
    )


@row(
    id="S1.21",
    status="convention",
    section="1.3.6",
    printed=r"\langle w, e_2\rangle = \sin\theta \sin\psi",
    wrong=lambda m, theta, psi, xp: xp.sin(theta) * xp.sin(psi),
    corrected=r"\langle w, e_2\rangle = m^{1/2} \sin\theta \sin\psi, \quad"
    r"\langle w, \hat e_2\rangle = \sin\theta \sin\psi",
    right=lambda m, theta, psi, xp: xp.sqrt(m) * xp.sin(theta) * xp.sin(psi),
)
def vertical_component(component: Code) -> Verdict:
    """The vertical component of a unit velocity.

    e₂ has length √m in the kinetic-energy metric. The formula is right as printed for m = 1, or with ê₂.
    """
    return verify(sym.inner(sym.G, sym.e2), component(sym.m, sym.theta, sym.psi, sp))


@row(
    id="S1.22",
    status="convention",
    section="1.3.6",
    equation="1.28'",
    printed=r"\Lambda^2 = \sin\theta \sin^2\psi\, dy_1\,dy_3\,d\theta\,d\psi",
    wrong=lambda J, theta, psi, xp: xp.sin(theta) * xp.sin(psi) ** 2,
    corrected=r"\Lambda^2 = J^{-1/2} \sin\theta \sin^2\psi\, dy_1\,dy_3\,d\theta\,d\psi",
    right=lambda J, theta, psi, xp: xp.sin(theta) * xp.sin(psi) ** 2 / xp.sqrt(J),
)
def invariant_measure(density: Code) -> Verdict:
    """The invariant measure Λ² in the coordinates y₁, y₃ along χ⊥ and χ, and the angles.

    With dy = dx₁ dα and ⟨w, e₂⟩ the constant is (mJ)^(-1/2) m^(1/2). It is 1 for J = 1, or with the kinetic-energy area
    and ê₂, and no symmetry depends on it.
    """
    y1, y3 = sp.symbols("y1 y3", real=True)
    position = y1 * sym.chi_perp + y3 * sym.chi
    area = sp.Matrix([position[0], position[2]]).jacobian([y1, y3]).det()
    sphere = sym.volume_density(sym.G, [sym.theta, sym.psi])
    return verify(area * sym.inner(sym.G, sym.e2) * sphere, density(sym.J, sym.theta, sym.psi, sp), sym.ANGLES)


@row(
    id="S1.23",
    section="1.3.6",
    printed=r"\delta_{\pi - \psi}(d\psi')",
    right=lambda psi, xp: xp.pi - psi,
    wrong=lambda psi, xp: psi,
)
def flip_of_the_polar_angle(flip: Code) -> Verdict:
    """Incoming −w(θ, ψ) and outgoing w(θ′, π − ψ) have the same component along χ, whatever θ′ is.

    The component is cos ψ, and the velocity is reversed in between. So ψ turns into π − ψ and not into ψ, and the
    outgoing velocity points up.
    """
    theta_out, offset = sp.symbols("theta' offset", real=True)

    def outgoing(angle: Any) -> Any:
        return sym.G.subs({sym.theta: angle, sym.psi: flip(sym.psi, sp)}, simultaneous=True)

    # if the angle follows an isometry, the velocity follows the library's branch matrix
    isometries = [
        verify(sym.branch_matrix(sign, offset) * -sym.G, outgoing(sign * sym.theta + offset)) for sign in (1, -1)
    ]
    return every(
        verify(sym.inner(-sym.G, sym.chi), sym.inner(outgoing(theta_out), sym.chi)),
        verify(sym.inner(outgoing(theta_out), sym.e2_hat), sp.sin(theta_out) * sp.sin(sym.psi)),
        *isometries,
    )


@row(
    id="S1.24",
    section="1.3.7",
    equation="1.66",
    printed=r"\tilde\Sigma = \{((1 + m/J)^{-1/2} x_1, x_2) : (x_1, x_2) \in \Sigma\}, \quad"
    r"\tilde\epsilon = (1 + m/J)^{-1/2} \epsilon",
    right=lambda x1, x2, m, J, xp: [foreshortening(m, J, xp) * x1, x2],
    wrong=lambda x1, x2, m, J, xp: [x1 / foreshortening(m, J, xp), x2],
)
def foreshortened_wall(image: Code) -> Verdict:
    """Projected along χ, the wall that the disk feels is the given one, compressed along x₁.

    The kinetic-energy projection of a configuration (x₁ − a, x₂, a) onto the plane of χ⊥ and ê₂ is √m times this, for
    every a. The scale does not change angles; the compressed cell may be deeper than B3 allows.
    """
    x1, x2, a = sp.symbols("x1 x2 a", real=True)
    position = [x1 - a, x2, a]
    projected = [sym.inner(position, sym.chi_perp), sym.inner(position, sym.e2_hat)]
    return verify(projected, [sp.sqrt(sym.m) * x for x in image(x1, x2, sym.m, sym.J, sp)])


@row(
    id="S1.14",
    section="1.3.1",
    printed=r"m = J = 1",
    wrong=lambda m, J: (1, 1),
    corrected=r"m = 1, \quad J/m \in (0, 1] \text{ for a disk of radius } 1",
    right=lambda m, J: (1, J / m),
)
def masses_without_loss(normalised: Code) -> Verdict:
    """Which masses may be assumed without loss of generality.

    Units make m = 1, but J/m has no unit once the radius is 1. Foreshortening and the no-slip matrix depend on it.
    """
    mass, inertia = normalised(sym.m, sym.J)
    same_law = verify(sym.no_slip, sym.no_slip.subs({sym.m: mass, sym.J: inertia}, simultaneous=True))
    return every(same_law, verify(mass, 1))


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
