"""Sections 2.3, 3 and 5: the impact of two rigid bodies, collision laws on velocities, and the foreshortened wall."""

from __future__ import annotations

from typing import Any

import numpy as np
import sympy as sp

from ...geometry import Disk, Wall, mushrooms, rectangular_teeth, trace, triangular_teeth
from ...geometry.disk import rolling
from ...geometry.disk import symbolic as sym
from ...geometry.disk.disk import contact_normal, foreshortening
from ...verification import Verdict, agreement, every, holds, no_excess, verify
from ..entry import Code, by_reading, row
from ..simulated import generator, outgoing_velocity


@row(
    id="S3.01",
    section="3",
    equation="3.2",
    printed=r"\tau = \lambda\sin\beta",
    right=lambda beta, xp: xp.sin(beta),
    wrong=lambda beta, xp: xp.cos(beta),
)
def impulsive_torque(torque: Code) -> Verdict:
    """The impulsive torque of the impulse λk at the contact σ, with β from k to x - σ.

    It is the vector product of σ - x with λk. β is counted counterclockwise.
    """
    direction, beta = sp.symbols("direction beta", real=True)
    k = sp.cos(direction), sp.sin(direction)
    arm = -sp.cos(direction + beta), -sp.sin(direction + beta)
    return verify(arm[0] * k[1] - arm[1] * k[0], torque(beta, sp))


@row(
    id="S3.02",
    section="3",
    kind="numeric",
    printed=r"\beta\in(-\pi/2, \pi/2)",
    wrong=lambda: (-np.pi / 2, np.pi / 2),
    corrected=r"\beta\in(-\pi, \pi]",
    right=lambda: (-np.pi, np.pi),
)
def range_of_the_arm(interval: Code) -> Verdict:
    """The range of the angle β between the wall's normal and the arm of the contact.

    A vertical side of a tooth has β = π/2 + α, and the lower side of a cap comes as close to -π and π as one likes. No
    formula uses the range.
    """
    low, high = interval()
    normals = []
    for piece in mushrooms(0.3, 0.4).pieces:
        tangent = piece.tangent(np.linspace(0.01, 0.99, 50))
        normals.append(tangent[:, 1] * -1 + 1j * tangent[:, 0])
    k = np.concatenate(normals)[:, np.newaxis]
    alpha = np.append(np.linspace(-0.1, 0.1, 21), [-1e-4, 1e-4])
    beta = np.angle(1j * np.exp(1j * alpha) / k)
    beta = np.where(beta == -np.pi, np.pi, beta)
    return every(
        holds((low < beta) & (beta <= high), "contacts on mushrooms", beta=beta),
        agreement([beta.min(), beta.max()], [low, high], 2e-4),
    )


@row(
    id="S3.03",
    status="convention",
    section="3",
    printed=r"\sin\beta = k_1\cos\alpha + k_2\sin\alpha",
    wrong=lambda k, alpha, turn, xp: k[0] * xp.cos(alpha) + k[1] * xp.sin(alpha),
    corrected=r"\sin\beta = k_1\cos(\alpha + j\rho) + k_2\sin(\alpha + j\rho)\quad\text{at } S_j",
    right=lambda k, alpha, turn, xp: k[0] * xp.cos(alpha + turn) + k[1] * xp.sin(alpha + turn),
)
def arm_of_a_satellite(sine: Code) -> Verdict:
    """The sine of β in the coordinates of a configuration.

    As printed it is that of the satellite S_0. At S_j the arm is turned by jρ more.
    """
    direction, x1, x2, turn = sp.symbols("direction x1 x2 turn", real=True)
    k = sp.cos(direction), sp.sin(direction)
    s1, s2 = rolling.satellite(x1, x2, sym.alpha + turn, 1, sp)
    arm = x1 - s1, x2 - (s2 - 1)
    return verify(k[0] * arm[1] - k[1] * arm[0], sine(k, sym.alpha, turn, sp))


@row(
    id="S3.04",
    section="3, 6",
    equation="3.2, 6.9, 6.19 (Prop. 3.2)",
    printed=r"w' = w - 2\langle w, n(q)\rangle\,n(q)",
    right=lambda w, n, product: [a - 2 * product * b for a, b in zip(w, n, strict=True)],
    wrong=lambda w, n, product: [a - product * b for a, b in zip(w, n, strict=True)],
)
def impulse_is_reflection(reflected: Code) -> Verdict:
    """The impulse law with conserved energy is specular reflection in the kinetic-energy metric.

    The change of velocity (λk/m, λ sin β/J) is a multiple of n(q). The energy is kept by λ = 0 and by this λ only.
    """
    direction, v1, v2, omega = sp.symbols("direction v1 v2 omega", real=True)
    k, w = (sp.cos(direction), sp.sin(direction)), (v1, v2, omega)
    n = contact_normal(sym.m, sym.J, k, sym.alpha, sp)
    after = reflected(w, n, sym.inner(w, n))
    torque = k[0] * sp.cos(sym.alpha) + k[1] * sp.sin(sym.alpha)
    impulse = -2 * (v1 * k[0] + v2 * k[1] + omega * torque) / (1 / sym.m + torque**2 / sym.J)
    given = [v1 + impulse * k[0] / sym.m, v2 + impulse * k[1] / sym.m, omega + impulse * torque / sym.J]
    return verify(after, given)


def _cross(a: Any, b: Any) -> Any:
    return a[0] * b[1] - a[1] * b[0]


@row(
    id="S3.05",
    section="3",
    equation="Prop. 3.3",
    printed=r"J_1\omega_1 + J_2\omega_2",
    wrong=lambda bodies: sum(J * omega for _, J, _, _, omega in bodies),
    corrected=r"\sum_i (J_i\omega_i + M_i\,x_i\times v_i)",
    right=lambda bodies: sum(J * omega + M * _cross(x, v) for M, J, x, v, omega in bodies),
)
def angular_momentum(momentum: Code) -> Verdict:
    """The angular momentum that an impact of two bodies conserves.

    An impulse at a contact away from a centre changes the spins by different amounts, and the orbital parts make up for
    it. The limit of eq. 3.15 still follows while positions stay bounded.
    """
    m1, m2, j1, j2 = sp.symbols("M1 M2 J1 J2", positive=True)
    x, y, v, u, c, p = (sp.symbols(f"{name}1 {name}2", real=True) for name in "xyvucp")
    w1, w2 = sp.symbols("omega1 omega2", real=True)
    before = [(m1, j1, x, v, w1), (m2, j2, y, u, w2)]
    after = [_struck(body, c, (s * p[0], s * p[1])) for body, s in zip(before, (1, -1), strict=True)]
    # the momentum of bodies that only rotate is the sum of their spins
    resting = [(M, J, x, (0, 0), omega) for M, J, x, _, omega in before]
    return every(verify(momentum(after), momentum(before)), verify(momentum(resting), j1 * w1 + j2 * w2))


def _struck(body: Any, contact: Any, impulse: Any) -> Any:
    """The body (M, J, x, v, omega) after an impulse at the contact."""
    M, J, x, v, omega = body
    arm = contact[0] - x[0], contact[1] - x[1]
    return M, J, x, (v[0] + impulse[0] / M, v[1] + impulse[1] / M), omega + _cross(arm, impulse) / J


@row(
    id="S3.06",
    section="6",
    equation="6.4, 6.6",
    kind="numeric",
    printed=r"M_2|v_2'|^2 + J_2|\omega_2'|^2 \le 4\max\{M_1/M_2, J_1/J_2\}\,E",
    right=lambda mass, inertia: 4 * np.maximum(mass, inertia),
    wrong=lambda mass, inertia: 3.9 * np.maximum(mass, inertia),
)
def energy_of_the_heavy_body(bound: Code) -> Verdict:
    """A heavy body at rest takes up little energy, given that momentum and spin are exchanged and energy is kept.

    v₂' = (M₁/M₂)(v₁ - v₁'), and each of the two has at most the whole energy. Head-on impacts come as close to the
    constant 4 as one likes.
    """
    rng = generator()
    count = 20_000
    own = np.exp(rng.uniform(-2, 2, (3, count)))
    own[1] = own[0]
    ratio = np.exp(rng.uniform(-9, 1, (2, count)))
    other = own / np.stack([ratio[0], ratio[0], ratio[1]])
    w = rng.normal(size=(3, count))
    change = np.where(rng.random(count) < 0.5, w, rng.normal(size=(3, count)))
    # w' = w - s change, with s from own w'^2 + own^2/other (w - w')^2 = own w^2
    s = 2 * np.sum(own * w * change, axis=0) / np.sum((own + own**2 / other) * change**2, axis=0)
    taken = s**2 * np.sum(own**2 / other * change**2, axis=0)
    whole = np.sum(own * w**2, axis=0)
    # head-on, w' = (own - other)/(own + other) w: the transferred fraction is 4 ratio/(1 + ratio)^2
    light = np.array([1e-7, 1e-6])
    head_on = 4 * light / (1 + light) ** 2
    return every(
        no_excess(taken / whole, bound(ratio[0], ratio[1]), 1e-12, mass_ratio=ratio[0], inertia_ratio=ratio[1]),
        agreement(head_on / bound(light, 1e-3 * light), 1.0, 1e-5, mass_ratio=light),
        agreement(head_on / bound(1e-3 * light, light), 1.0, 1e-5, inertia_ratio=light),
    )


@row(
    id="S3.07",
    section="3",
    equation="3.15",
    kind="numeric",
    printed=r"m|v'|^2 + J\omega'^2 = m|v|^2 + J\omega^2",
    right=lambda energy, heavy: energy,
    wrong=lambda energy, heavy: energy * (1 - 10 / heavy**0.5),
)
def energy_of_the_light_body(limit: Code) -> Verdict:
    """As the second body becomes infinitely heavy, the first keeps its energy.

    The defect is of the order of 1/M₂ for bounded positions. It is measured at M₂ = J₂ = 10⁸ and 10¹⁰.
    """
    rng = generator()
    verdicts = []
    for heavy in (1e8, 1e10):
        energies = []
        for _ in range(50):
            x, v, c = rng.uniform(-1, 1, (3, 2))
            omega, direction = rng.uniform(-1, 1), rng.uniform(0, 2 * np.pi)
            k = np.array([np.cos(direction), np.sin(direction)])
            bodies = [(1.0, 0.5, x, v, omega), (heavy, heavy, np.zeros(2), np.zeros(2), 0.0)]
            give = [_cross(c - body[2], k) for body in bodies]
            closing = v @ k + omega * give[0]
            impulse = -2 * closing / (1.0 + give[0] ** 2 / 0.5 + 1 / heavy + give[1] ** 2 / heavy)
            _, _, _, after, spin = _struck(bodies[0], c, impulse * k)
            energies.append((limit(v @ v + 0.5 * omega**2, heavy), np.dot(after, after) + 0.5 * spin**2))
        told, found = np.array(energies).T
        verdicts.append(agreement(found, told, 100 / heavy))
    return every(*verdicts)


typography = by_reading(
    id="S3.08",
    section="3",
    statement="Velocities after and before an impact as limits in time.",
    printed=r"w^+ = (v^-, \omega^-),\quad v^\pm(t) := \lim v(t),\quad t_1 < t < \delta",
    corrected=r"w^+ = (v^+, \omega^+),\quad v^\pm(t) := \lim_{s\to t\pm} v(s),\quad t_1 < t < t_1 + \delta",
    reason="w⁺ is given the velocities before, the limit lacks its variable, and the interval its t₁. No formula is "
    "affected.",
)
# Rounding error of a dozen reflections.
TRACED = 1e-10
# Scale and rays of the disk near the limit, and the depth of its teeth in units of the scale.
EPS, RAYS, DEPTH = 1e-6, 40, 0.7


def explicit_matrices(m: Any, J: Any) -> list[list[list[Any]]]:
    """A_smooth and A_no-slip, entry by entry."""
    total = m + J
    no_slip = [[(m - J) / total, 0, -2 * J / total], [0, -1, 0], [-2 * m / total, 0, (J - m) / total]]
    return [[[1, 0, 0], [0, -1, 0], [0, 0, 1]], no_slip]


@row(
    id="S2.19",
    section="2.3.1",
    equation="2.25",
    printed=r"A_{\text{smooth}} = \mathrm{diag}(1, -1, 1), \quad A_{\text{no-slip}} = \frac1{m + J} \begin{pmatrix}"
    r" m - J & 0 & -2J \\ 0 & -m - J & 0 \\ -2m & 0 & J - m \end{pmatrix}",
    right=explicit_matrices,
    wrong=lambda m, J: explicit_matrices(J, m),
)
def matrices_of_the_two_laws(matrices: Code) -> Verdict:
    """The matrices of smooth and no-slip collisions are those of specular reflection and retroreflection.

    They take −w(θ, ψ) to w(θ′, π − ψ) with θ′ = π − θ and θ′ = θ. The library's matrices, made from the branches of the
    law, are the same.
    """
    smooth, no_slip = (sp.Matrix(rows) for rows in matrices(sym.m, sym.J))

    def outgoing(theta: Any) -> Any:
        return sym.G.subs({sym.theta: theta, sym.psi: sp.pi - sym.psi}, simultaneous=True)

    return every(
        verify(smooth * -sym.G, outgoing(sp.pi - sym.theta)),
        verify(no_slip * -sym.G, outgoing(sym.theta)),
        verify([smooth, no_slip], [sym.smooth, sym.no_slip]),
    )


@row(
    id="S2.20",
    section="2.3.1",
    printed=r"A^2 = I, \quad A^{\mathsf T} M A = M, \quad \langle Aw, \tilde\chi\rangle = \langle w, \tilde\chi\rangle",
    right=explicit_matrices,
    wrong=lambda m, J: explicit_matrices(2 * m, J),
)
def properties_of_the_two_matrices(matrices: Code) -> Verdict:
    """Both matrices are involutions and isometries that conserve the rolling momentum and reverse v₂.

    Each is checked for all m and J. The no-slip matrix also reverses the slip v₁ + ω.
    """
    both = [sp.Matrix(rows) for rows in matrices(sym.m, sym.J)]
    slip = sp.Matrix([[1, 0, 1]])
    rolling = sp.Matrix([[-1, 0, 1]]) * sym.metric
    return every(
        *(verify(A * A, sp.eye(3)) for A in both),
        *(verify(A.T * sym.metric * A, sym.metric) for A in both),
        *(verify(rolling * A, rolling) for A in both),
        *(verify(A.row(1), sp.Matrix([[0, -1, 0]])) for A in both),
        verify(slip * both[1], -slip),
    )


@row(
    id="S2.24",
    section="2.3.4",
    printed=r"\hat W = \{(x_1, x_2) : (x_1, (1 + m/J)^{-1/2} x_2) \in W\}",
    wrong=lambda x1, x2, factor: (x1, factor * x2),
    corrected=r"\hat W = \{(x_1, x_2) : ((1 + m/J)^{-1/2} x_1, x_2) \in W\}, \text{ or up to scale }"
    r" (x_1, (1 + m/J)^{1/2} x_2) \in W",
    right=lambda x1, x2, factor: (x1, x2 / factor),
)
def wall_that_is_felt_as_given(point: Code) -> Verdict:
    """The wall Ŵ for which the disk feels the wall W: which way it is stretched.

    The disk sees the wall compressed along x, so it must be stretched along x, or flattened. The printed one is
    deepened, and the disk feels it deeper still.
    """
    x1, x2 = sp.symbols("x1 x2", real=True)
    factor = foreshortening(sym.m, sym.J, sp)
    felt1, felt2 = factor * x1, x2
    given1, given2 = point(x1, x2, factor)
    # up to scale: a point of the foreshortened wall is the given point times the factor
    return verify([factor * given1, factor * given2], [felt1, felt2])


@row(
    id="S2.25",
    section="2.3.4",
    printed=r"(\theta, \psi) \mapsto (\pi - \theta, \pi - \psi), \quad (\theta, \psi) \mapsto (\theta, \pi - \psi)",
    right=lambda theta, psi, xp: [(xp.pi - theta, xp.pi - psi), (theta, xp.pi - psi)],
    wrong=lambda theta, psi, xp: [(xp.pi / 2 - theta, xp.pi - psi), (theta, xp.pi - psi)],
)
def symmetry_of_the_two_laws(maps: Code) -> Verdict:
    """The smooth and the no-slip law are symmetric with respect to Λ² and keep the rolling component.

    Both maps are involutions under which the density sin θ sin²ψ is invariant. cos ψ changes its sign because the
    velocity is reversed.
    """

    def check(index: int) -> Verdict:
        theta, psi = maps(sym.theta, sym.psi, sp)[index]
        again = maps(theta, psi, sp)[index]
        density = sym.lambda2.subs({sym.theta: theta, sym.psi: psi}, simultaneous=True)
        return every(
            verify(again, (sym.theta, sym.psi)), verify(density, sym.lambda2), verify(sp.cos(psi), -sp.cos(sym.psi))
        )

    return every(check(0), check(1))


@row(
    id="S2.28",
    section="5.1, 1.3.7",
    equation="3.10 and the law of rough collisions",
    kind="numeric",
    printed=r"K_{\mathrm{cyl}}(\theta, \psi) = (P^{\tilde\Sigma}(\theta), \pi - \psi)",
    right=lambda wall, disk: wall.foreshorten(disk),
    wrong=lambda wall, disk: wall.unforeshorten(disk),
)
def decoupling_on_the_cylinder(felt: Code) -> Verdict:
    """On the cylinder a collision is reflection by the foreshortened wall, and free along χ.

    Simulated in three dimensions by the impulse law, the disk leaves as the particle of the foreshortened
    wall does. With the inverse exponent the angles differ.
    """
    rng = np.random.default_rng(5)
    found, expected = [], []
    for _ in range(60):
        disk = Disk(*np.exp(rng.uniform(-1.0, 1.0, 2)))
        wall = triangular_teeth(rng.uniform(0.6, 2.5)) if rng.random() < 0.5 else rectangular_teeth(rng.uniform(0.3, 2))
        x, theta, psi = rng.random(), rng.uniform(0.3, np.pi - 0.3), rng.uniform(0.3, np.pi - 0.3)
        alpha = rng.uniform(-1.0, 1.0)
        velocity = outgoing_velocity(disk, wall, (x - alpha, 0.0, alpha), -disk.from_angles(theta, psi))
        found.append([float(angle) for angle in disk.to_angles(velocity)])
        expected.append([float(trace(felt(wall, disk), x, theta).theta), np.pi - psi])
    return agreement(found, expected, TRACED)


@row(
    id="S4.23",
    section="3, 5",
    kind="numeric",
    printed=r"\theta' = P^{\widetilde W}(x, \theta),\quad \widetilde W = \{((1 + m/J)^{-1/2}x_1, x_2) : x\in W\}",
    right=lambda m, J: (1 + m / J) ** -0.5,
    wrong=lambda m, J: (1 + m / J) ** -0.25,
)
def limit_of_the_disk(factor: Code) -> Verdict:
    """As ε → 0 a disk whose one satellite meets the wall by the impulse law leaves as a ray does that is reflected in
    the foreshortened wall.

    The satellite's path is followed exactly, as a point of the turning rim, and reflected by eq. 3.2. The angles agree
    to the order of ε, all but those of rays that pass next to a corner.
    """
    rng = generator()
    verdicts = []
    for disk in (Disk(2.0, 0.5), Disk(0.5, 4.0)):
        kappa = factor(disk.mass, disk.rim_mass)
        wall, felt = (Wall.from_vertices([(0, 0), (0.5 * k, -DEPTH), (k, 0)]) for k in (1.0, kappa))
        theta, psi = rng.uniform(0.3, np.pi - 0.3, RAYS), rng.uniform(0.6, np.pi - 0.6, RAYS)
        x = rng.uniform(0, 1, RAYS)
        expected = trace(felt, kappa * x, theta).theta
        incoming = (-disk.from_angles(*angles) for angles in zip(theta, psi, strict=True))
        outgoing = [outgoing_velocity(disk, wall, (at, 0, 0), w, EPS) for at, w in zip(x, incoming, strict=True)]
        found = np.array([float(disk.to_angles(w)[0]) for w in outgoing])
        # near a corner a ray may be reflected by another side: at most one ray in twenty
        verdicts.append(agreement(np.sort(np.abs(found - expected))[: RAYS - RAYS // 20], 0.0, 100 * EPS))
    return every(*verdicts)
