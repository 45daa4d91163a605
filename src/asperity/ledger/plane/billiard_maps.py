"""Section 6: the billiard map, its time reversal and its invariant measure, on an ellipse and on walls."""

from __future__ import annotations

import numpy as np
import sympy as sp

from ...core.checks import Floats
from ...geometry import focusing_arcs, trace
from ...verification import Verdict, agreement, every, holds, verify
from ..entry import Code, by_reading, row
from ..simulated import generator

# Semi-axes of the elliptical table.
AXES = np.array([[1.6], [1.0]])
STATES = 600


def _states() -> tuple[Floats, Floats]:
    """Random points (2, n) of the table and inward unit directions."""
    rng = generator()
    t, angle = rng.uniform(0, 2 * np.pi, STATES), rng.uniform(0.05, np.pi - 0.05, STATES)
    return _from_coordinates(t, angle)


def _from_coordinates(t: Floats, angle: Floats) -> tuple[Floats, Floats]:
    """Points of the ellipse's parameter and directions of the angle from the tangent (n2, -n1)."""
    q = AXES * np.stack([np.cos(t), np.sin(t)])
    n = _normal(q)
    return q, np.sin(angle) * n + np.cos(angle) * np.stack([n[1], -n[0]])


def _normal(q: Floats) -> Floats:
    """The unit normals into the table."""
    gradient = -q / AXES**2
    return np.asarray(gradient / np.linalg.norm(gradient, axis=0))


def reflection(q: Floats, p: Floats) -> tuple[Floats, Floats]:
    """R: (q, p) -> (q, p - 2<p, n>n)."""
    n = _normal(q)
    return q, p - 2 * np.sum(p * n, axis=0) * n


def billiard_map(q: Floats, p: Floats) -> tuple[Floats, Floats]:
    """Phi: move to the other end of the chord, then reflect."""
    time = -2 * np.sum(q * p / AXES**2, axis=0) / np.sum(p**2 / AXES**2, axis=0)
    # forward in time only
    return reflection(q + np.maximum(time, 0.0) * p, p)


def reversal(q: Floats, p: Floats) -> tuple[Floats, Floats]:
    """-R: the reflection, then the opposite direction."""
    q, p = reflection(q, p)
    return q, -p


@row(
    id="S6.01",
    section="6.1.2",
    equation="Lemma 6.1 (i)",
    kind="numeric",
    printed=r"(-R)\circ\Phi\circ(-R)\circ\Phi = \mathrm{id}",
    right=lambda q, p: reversal(*billiard_map(*reversal(q, p))),
    wrong=lambda q, p: reflection(*billiard_map(*reversal(q, p))),
)
def inverse_of_the_billiard_map(inverse: Code) -> Verdict:
    """A left inverse of the billiard map Φ, by the reversal -R.

    -R turns the path round. In the proof (q', p') = Gᵗ(q, p) lies in U⁻, not in U⁺.
    """
    q, p = _states()
    back = inverse(*billiard_map(q, p))
    return agreement(np.stack(back), np.stack([q, p]), 1e-12)


@row(
    id="S6.02",
    section="6.2.1",
    equation="6.24, 6.29'",
    kind="numeric",
    printed=r"(-R)\circ\Phi^n\circ(-R)\circ\Phi^m = \Phi^{m-n}",
    right=lambda m, n: m - n,
    wrong=lambda m, n: m + n,
)
def iterates_of_the_billiard_map(power: Code) -> Verdict:
    """Iterates of the billiard map between two reversals, and hence the reflection law of a wall is an involution.

    It is row S6.01 n times. In the definition of M, U⁺ is to be V⁻.
    """
    state = _states()
    verdicts = []
    for m, n in ((3, 1), (5, 2), (4, 4)):
        there = state
        for _ in range(m):
            there = billiard_map(*there)
        back = reversal(*there)
        for _ in range(n):
            back = billiard_map(*back)
        expected = state
        for _ in range(power(m, n)):
            expected = billiard_map(*expected)
        verdicts.append(agreement(np.stack(reversal(*back)), np.stack(expected), 1e-9))
    rng = generator()
    x, theta = rng.uniform(0, 1, 2000), rng.uniform(0.1, np.pi - 0.1, 2000)
    once = trace(focusing_arcs(1.0), x, theta)
    twice = trace(focusing_arcs(1.0), once.x, once.theta)
    return every(*verdicts, agreement(twice.theta, theta, 1e-9, x=x, theta=theta))


@row(
    id="S6.03",
    section="6.1.3",
    equation="Lemma 6.2",
    kind="numeric",
    printed=r"\langle p, n\rangle\,d\sigma\,d\tau_1",
    right=np.sin,
    wrong=lambda angle: np.ones_like(angle),
)
def invariant_measure(density: Code) -> Verdict:
    """The measure that Φ preserves: sin(angle) times arc length times angle.

    The Jacobian in arc length and angle is taken by central differences. It is the ratio of the sines.
    """
    rng = generator()
    t, angle = rng.uniform(0, 2 * np.pi, STATES), rng.uniform(0.3, np.pi - 0.3, STATES)
    step = 1e-5
    columns = []
    for i in (0, 1):
        ends = [_in_coordinates(t + s * step * (i == 0), angle + s * step * (i == 1)) for s in (1, -1)]
        columns.append((np.angle(np.exp(1j * (ends[0] - ends[1])))) / (2 * step))
    after = _in_coordinates(t, angle)
    jacobian = np.abs(columns[0][0] * columns[1][1] - columns[1][0] * columns[0][1])
    before = density(angle) * _speed(t)
    return every(
        agreement(density(after[1]) * _speed(after[0]) * jacobian / before, 1.0, 1e-5, t=t, angle=angle),
        holds(density(angle) > 0, "densities are positive", angle=angle),
    )


def _speed(t: Floats) -> Floats:
    """The speed of the ellipse's parametrisation."""
    a, b = AXES[:, 0]
    return np.asarray(np.hypot(a * np.sin(t), b * np.cos(t)))


def _in_coordinates(t: Floats, angle: Floats) -> Floats:
    """The billiard map in the coordinates of `_from_coordinates`."""
    q, p = billiard_map(*_from_coordinates(t, angle))
    n = _normal(q)
    along = np.sum(p * np.stack([n[1], -n[0]]), axis=0)
    return np.stack([np.arctan2(q[1] / AXES[1], q[0] / AXES[0]), np.arctan2(np.sum(p * n, axis=0), along)])


flux_measure = by_reading(
    id="S6.04",
    section="6.1.3",
    status="convention",
    statement="The measure μ₁ on the states of the boundary.",
    printed=r"\mu_1(dp\,dq) = \langle q, n(p)\rangle_p\,\sigma_p(dq)\,\tau_1(dp)",
    corrected=r"\mu_1(dq\,dp) = \langle p, n(q)\rangle_q\,\sigma_q(dp)\,\tau_1(dq)",
    reason="The letters are interchanged; what is meant is the measure of row S6.03. The flux integral over A in U⁺₁ "
    "is against σ_q(dp) τ₁(dq), not against μ.",
)
singular_set = by_reading(
    id="S6.05",
    section="6.1.3",
    equation="Lemma 6.3",
    statement="Why the states that run into the singular set S are negligible.",
    printed=r"\dim S < d - 1\text{ by assumption}",
    corrected=r"\mathcal H^{d-1}(S) = 0 \Rightarrow \mathcal H^{2d-2}(\text{projected preimage}) = 0",
    reason="C1 gives H^(d-1)(S) = 0 only, which allows dim S = d - 1. The projected preimage is the Lipschitz image "
    "of a null set.",
)


@row(
    id="S6.06",
    section="6.2.1",
    printed=r"p \mapsto -p + 2\langle p, k\rangle k",
    right=lambda p, k, product: [-a + 2 * product * b for a, b in zip(p, k, strict=True)],
    wrong=lambda p, k, product: [a - 2 * product * b for a, b in zip(p, k, strict=True)],
)
def reflection_of_the_plane(image: Code) -> Verdict:
    """The reflection on A₃ turns the angle θ into π - θ and is an isometric involution.

    Its value is the pair of q and this vector, with k = -n, the normal into M₀. 'Outward' is outward from N.
    """
    theta, direction = sp.symbols("theta direction", real=True)
    k = -sp.sin(direction), sp.cos(direction)

    def at(angle: object) -> list[object]:
        return [sp.cos(direction + angle), sp.sin(direction + angle)]

    def reflect(p: list[object]) -> list[object]:
        return list(image(p, k, p[0] * k[0] + p[1] * k[1]))

    reflected = reflect(at(theta))
    return every(verify(reflected, at(sp.pi - theta)), verify(reflect(reflected), at(theta)))


@row(
    id="S6.07",
    section="6.2.3",
    kind="numeric",
    printed=r"\int f\,d(G\nu) = \iint f(x, y)\,G(y, dx)\,\nu(dy)",
    wrong=lambda G, nu: (G * nu[:, np.newaxis]).T,
    corrected=r"\int f\,d(G\nu) = \iint f(y, x)\,G(y, dx)\,\nu(dy)",
    right=lambda G, nu: G * nu[:, np.newaxis],
)
def marginal_of_the_joint_measure(joint: Code) -> Verdict:
    """The joint measure G ν of a kernel and its first marginal G ν(K × X) = ν(K).

    The first slot is to be the state before. With the printed order it is the second marginal that is ν.
    """
    rng = generator()
    G, nu = rng.random((7, 7)), rng.random(7)
    G, nu = G / G.sum(axis=1, keepdims=True), nu / nu.sum()
    return agreement(joint(G, nu).sum(axis=1), nu, 1e-14)


misprints = by_reading(
    id="S6.08",
    section="6",
    equation="6.30",
    statement="The geodesic equation and other misprints of section 6.",
    printed=r"\ddot q_i + \sum_{i,k}\Gamma^i_{jk}\dot q_j\dot q_k = 0,\quad h(q, p; dq'dp')",
    corrected=r"\ddot q_i + \sum_{j,k}\Gamma^i_{jk}\dot q_j\dot q_k = 0,\quad h(q, p, q', p')",
    reason="The sum is over j and k. Conditions 1' and 2-5 are D3' and D1-D5, and R^d without W is to be closed.",
)
