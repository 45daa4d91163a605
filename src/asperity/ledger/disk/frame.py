"""Section 1.3.6: the frame of the disk, and the sphere of its velocities with its measure."""

from __future__ import annotations

from typing import Any

from ...geometry.disk.disk import direction, foreshortening, frame_rows
from ...verification import Verdict, every, verify
from ..entry import Code, Formula, convention, erratum, verified
from ..symbols import sp, sym


@verified(
    id="S1.17",
    section="1.3.3",
    equation="1.42, 1.1'",
    statement="What every collision conserves is the inner product with the rolling direction.",
    printed=Formula(
        r"\tilde\chi = (-1, 0, 1), \quad \langle w, \tilde\chi\rangle = -m v_1 + J\omega",
        lambda m, J, v1, omega: -m * v1 + J * omega,
    ),
    perturbed=lambda m, J, v1, omega: m * v1 + J * omega,
    reason="The kinetic-energy inner product with (-1, 0, 1) is this. It is the angular momentum about the contact.",
)
def rolling_momentum(momentum: Code) -> Verdict:
    v1, v2, omega = sp.symbols("v1 v2 omega", real=True)
    return verify(momentum(sym.m, sym.J, v1, omega), sym.inner([v1, v2, omega], [-1, 0, 1]))


@erratum(
    id="S1.18",
    section="1.3.6, 4.2",
    statement="The unit rolling direction χ, which completes χ⊥ and ê₂ to a frame that is turned, not mirrored.",
    printed=Formula(r"\chi = (m + J)^{-1/2} (1, 0, -1)", lambda m, J, xp: [1 / xp.sqrt(m + J), 0, -1 / xp.sqrt(m + J)]),
    corrected=Formula(r"\chi = (m + J)^{-1/2} (-1, 0, 1)", lambda m, J, xp: frame_rows(m, J, xp)[2]),
    reason="With the printed sign the frame is left-handed, while the index of notation, eq. 1.42 and section 5.3.4 "
    "have the other sign. All laws of velocities are even in χ and keep their form.",
)
def sign_of_the_rolling_direction(chi: Code) -> Verdict:
    frame = sp.Matrix([*frame_rows(sym.m, sym.J, sp)[:2], chi(sym.m, sym.J, sp)])
    orientation = verify((frame * sym.metric.applyfunc(sp.sqrt)).det(), 1)
    return every(orientation, verify(frame * sym.metric * frame.T, sp.eye(3)))


@verified(
    id="S1.19",
    section="1.3.6",
    statement="(χ⊥, ê₂, χ) is orthonormal for the kinetic-energy inner product.",
    printed=Formula(
        r"\chi_\perp = \Bigl(\frac1m + \frac1J\Bigr)^{-1/2} \Bigl(\frac1m, 0, \frac1J\Bigr),\quad"
        r"\hat e_2 = m^{-1/2}(0, 1, 0)",
        frame_rows,
    ),
    perturbed=lambda m, J, xp: [frame_rows(m, m, xp)[0], *frame_rows(m, J, xp)[1:]],
    reason="The Gram matrix is the identity for all m and J, which either sign of χ would do. The signs are those in "
    "which the contact's velocity, the vertical one and the rolling momentum are multiples of the components.",
)
def the_frame_is_orthonormal(frame_of: Code) -> Verdict:
    frame = sp.Matrix(frame_of(sym.m, sym.J, sp))
    w = sp.Matrix([sym.v1, sym.v2, sym.omega])
    m, J = sym.m, sym.J
    contact, momentum = sym.v1 + sym.omega, J * sym.omega - m * sym.v1
    shown = sp.Matrix([contact / sp.sqrt(1 / m + 1 / J), sp.sqrt(m) * sym.v2, momentum / sp.sqrt(m + J)])
    return every(verify(frame * sym.metric * frame.T, sp.eye(3)), verify(frame * sym.metric * w, shown))


@verified(
    id="S1.20",
    section="1.3.6",
    equation="1.27'",
    statement="The chart G takes the angles to the upper unit half sphere, with spherical area sin ψ dθ dψ.",
    printed=Formula(
        r"G(\theta, \psi) = \cos\theta\sin\psi\,\chi_\perp + \sin\theta\sin\psi\,\hat e_2 + \cos\psi\,\chi", direction
    ),
    perturbed=lambda theta, psi, xp: [xp.sin(psi), xp.cos(psi) * xp.sin(theta), xp.cos(psi) * xp.cos(theta)],
    reason="Its image has length 1, its Gram determinant is sin²ψ, and it takes (0, π/2), (π/2, π/2), (0, 0) to χ⊥, "
    "ê₂, χ. The perturbed chart takes the equator for the pole, and has the density of latitude.",
)
def chart_of_the_half_sphere(components: Code) -> Verdict:
    chart = sym.frame.T * sp.Matrix(components(sym.theta, sym.psi, sp))
    area = sym.volume_density(chart, [sym.theta, sym.psi])
    quarter = sp.pi / 2
    axes = [components(*angles, sp) for angles in ((0, quarter), (quarter, quarter), (0, 0))]
    return every(
        verify(sym.inner(chart, chart), 1),
        verify(area, sp.sin(sym.psi), sym.ANGLES),
        verify(sp.Matrix(axes), sp.eye(3)),
    )


@convention(
    id="S1.21",
    section="1.3.6",
    statement="The vertical component of a unit velocity.",
    printed=Formula(
        r"\langle w, e_2\rangle = \sin\theta \sin\psi", lambda m, theta, psi, xp: xp.sin(theta) * xp.sin(psi)
    ),
    corrected=Formula(
        r"\langle w, e_2\rangle = m^{1/2} \sin\theta \sin\psi, \quad"
        r"\langle w, \hat e_2\rangle = \sin\theta \sin\psi",
        lambda m, theta, psi, xp: xp.sqrt(m) * xp.sin(theta) * xp.sin(psi),
    ),
    reason="e₂ has length √m in the kinetic-energy metric. The formula is right as printed for m = 1, or with ê₂.",
)
def vertical_component(component: Code) -> Verdict:
    return verify(sym.inner(sym.G, sym.e2), component(sym.m, sym.theta, sym.psi, sp))


@convention(
    id="S1.22",
    section="1.3.6",
    equation="1.28'",
    statement="The invariant measure Λ² in the coordinates y₁, y₃ along χ⊥ and χ, and the angles.",
    printed=Formula(
        r"\Lambda^2 = \sin\theta \sin^2\psi\, dy_1\,dy_3\,d\theta\,d\psi",
        lambda J, theta, psi, xp: xp.sin(theta) * xp.sin(psi) ** 2,
    ),
    corrected=Formula(
        r"\Lambda^2 = J^{-1/2} \sin\theta \sin^2\psi\, dy_1\,dy_3\,d\theta\,d\psi",
        lambda J, theta, psi, xp: xp.sin(theta) * xp.sin(psi) ** 2 / xp.sqrt(J),
    ),
    reason="With dy = dx₁ dα and ⟨w, e₂⟩ the constant is (mJ)^(-1/2) m^(1/2). It is 1 for J = 1, or with the "
    "kinetic-energy area and ê₂, and no symmetry depends on it.",
)
def invariant_measure(density: Code) -> Verdict:
    y1, y3 = sp.symbols("y1 y3", real=True)
    position = y1 * sym.chi_perp + y3 * sym.chi
    area = sp.Matrix([position[0], position[2]]).jacobian([y1, y3]).det()
    sphere = sym.volume_density(sym.G, [sym.theta, sym.psi])
    return verify(area * sym.inner(sym.G, sym.e2) * sphere, density(sym.J, sym.theta, sym.psi, sp), sym.ANGLES)


@verified(
    id="S1.23",
    section="1.3.6",
    statement="Incoming −w(θ, ψ) and outgoing w(θ′, π − ψ) have the same component along χ, whatever θ′ is.",
    printed=Formula(r"\delta_{\pi - \psi}(d\psi')", lambda psi, xp: xp.pi - psi),
    perturbed=lambda psi, xp: psi,
    reason="The component is cos ψ, and the velocity is reversed in between. So ψ turns into π − ψ and not into ψ, and "
    "the outgoing velocity points up.",
)
def flip_of_the_polar_angle(flip: Code) -> Verdict:
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


@verified(
    id="S1.24",
    section="1.3.7",
    equation="1.66",
    statement="Projected along χ, the wall that the disk feels is the given one, compressed along x₁.",
    printed=Formula(
        r"\tilde\Sigma = \{((1 + m/J)^{-1/2} x_1, x_2) : (x_1, x_2) \in \Sigma\}, \quad"
        r"\tilde\epsilon = (1 + m/J)^{-1/2} \epsilon",
        lambda x1, x2, m, J, xp: [foreshortening(m, J, xp) * x1, x2],
    ),
    perturbed=lambda x1, x2, m, J, xp: [x1 / foreshortening(m, J, xp), x2],
    reason="The kinetic-energy projection of a configuration (x₁ − a, x₂, a) onto the plane of χ⊥ and ê₂ is √m times "
    "this, for every a. The scale does not change angles; the compressed cell may be deeper than B3 allows.",
)
def foreshortened_wall(image: Code) -> Verdict:
    x1, x2, a = sp.symbols("x1 x2 a", real=True)
    position = [x1 - a, x2, a]
    projected = [sym.inner(position, sym.chi_perp), sym.inner(position, sym.e2_hat)]
    return verify(projected, [sp.sqrt(sym.m) * x for x in image(x1, x2, sym.m, sym.J, sp)])


@erratum(
    id="S1.14",
    section="1.3.1",
    statement="Which masses may be assumed without loss of generality.",
    printed=Formula(r"m = J = 1", lambda m, J: (1, 1)),
    corrected=Formula(r"m = 1, \quad J/m \in (0, 1] \text{ for a disk of radius } 1", lambda m, J: (1, J / m)),
    reason="Units make m = 1, but J/m has no unit once the radius is 1. Foreshortening and the no-slip matrix depend "
    "on it.",
)
def masses_without_loss(normalised: Code) -> Verdict:
    mass, inertia = normalised(sym.m, sym.J)
    same_law = verify(sym.no_slip, sym.no_slip.subs({sym.m: mass, sym.J: inertia}, simultaneous=True))
    return every(same_law, verify(mass, 1))
