"""Sections 2.3, 3 and 5: collision laws on velocities, and the foreshortened wall that determines them."""

from __future__ import annotations

from typing import Any

import numpy as np
import sympy as sp

from ...geometry import Disk, Wall, rectangular_teeth, trace, triangular_teeth
from ...geometry.disk import symbolic as sym
from ...geometry.disk.disk import foreshortening
from ...verification import Verdict, agreement, every, verify
from ..entry import Code, row
from ..simulated import generator, outgoing_velocity

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
    for disk in (Disk(2.0, 1.0), Disk(0.5, 2.0)):
        kappa = factor(disk.mass, disk.inertia)
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
