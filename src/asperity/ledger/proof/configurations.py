"""Section 4.1: the configurations M of disk and wall, the chart F, the gaps, and the unit normals of M."""

from __future__ import annotations

import numpy as np
import sympy as sp

from ...geometry.disk import rolling
from ...geometry.disk import symbolic as sym
from ...geometry.disk.disk import contact_normal
from ...verification import Verdict, agreement, every, holds, no_excess, verify
from ..entry import Code, row
from ..simulated import clearance, generator, is_free, residual, satellites

SATELLITES = 40
SPACING = 2 * np.pi / SATELLITES
EPS = 0.001


def _configurations(count: int = 1500) -> np.ndarray:
    """Configurations (3, n) near the boundary of M."""
    rng = generator()
    heights = rng.uniform(-1.3, 0.2, count) * (EPS + SPACING**2 / 8)
    return np.stack([rng.uniform(-1, 1, count), heights, rng.uniform(-np.pi, np.pi, count)])


def _lowest(x1: np.ndarray, alpha: np.ndarray, eps: float) -> np.ndarray:
    """The least height x2 of the centre at which no satellite is in the solid."""
    return -clearance(np.stack([x1, 0 * x1, alpha]), eps, SATELLITES)


@row(
    id="S4.01",
    section="4.1",
    equation="Prop. 4.1 (i), (ii)",
    kind="numeric",
    printed=r"M + j\varepsilon e_1 + k\rho e_3 = M",
    right=lambda j, k, eps, rho: (j * eps, k * rho),
    wrong=lambda j, k, eps, rho: (j * eps, k * rho / 2),
)
def periods_of_the_configurations(shift: Code) -> Verdict:
    """M has the periods ε e₁ and ρ e₃ and contains the half-space x₂ ≥ 0.

    The wall has period ε and the rim period ρ. All satellites are looked at, without the charts.
    """
    rng = generator()
    c = _configurations()
    j, k = rng.integers(-5, 6, (2, c.shape[1]))
    along, turn = shift(j, k, EPS, SPACING)
    here = clearance(c, EPS, SATELLITES)
    there = clearance(c + np.stack([along, 0 * turn, turn]), EPS, SATELLITES)
    above = is_free(np.stack([c[0], np.abs(c[1]), c[2]]), EPS, SATELLITES)
    return every(agreement(there, here, 1e-12, k=k), holds(above, "configurations with x2 >= 0"))


@row(
    id="S4.02",
    section="4.1",
    equation="4.9, Prop. 4.1 (v)",
    kind="numeric",
    printed=r"-\varepsilon - \rho^2/8 \le x_2 \le 0",
    right=lambda eps, rho: -eps - rho**2 / 8,
    wrong=lambda eps, rho: -eps - rho**2 / 9,
)
def heights_of_the_boundary(bound: Code) -> Verdict:
    """The heights between which the boundary of M lies.

    Halfway between two satellites the rim is 1 - cos(ρ/2) ≤ ρ²/8 above the lowest point, and the bound is attained to
    ρ⁴/384 where both are over bottoms. The -ρ²/2 in the proof of Prop. 4.8 is weaker and also true.
    """
    rng = generator()
    # the two lowest satellites both reach bottoms if their distance is a whole number of periods
    eps = 2 * np.sin(SPACING / 2) / 157
    x1, alpha = rng.uniform(0, 1, 20_000), rng.uniform(0, SPACING, 20_000)
    alpha[:5000] = SPACING / 2
    x1[0] = np.sin(SPACING / 2) - eps / 2
    x2 = _lowest(x1, alpha, eps)
    return every(
        no_excess(bound(eps, SPACING), x2, x1=x1, alpha=alpha),
        no_excess(x2, 0.0, 1e-15, x1=x1, alpha=alpha),
        agreement(bound(eps, SPACING), x2.min(), SPACING**4 / 384),
    )


@row(
    id="S4.03",
    section="4.1",
    equation="Prop. 4.1 (vi)",
    kind="numeric",
    printed=r"-1 + \cos\rho \le -\rho^2/4",
    right=lambda rho: rho**2 / 4,
    wrong=lambda rho: rho**2 / 2,
)
def third_satellite(bound: Code) -> Verdict:
    """A third satellite is more than ρ²/4 above the lowest, so at most two, adjacent ones, touch the wall.

    The third lowest satellite is at least 1 - cos ρ above the lowest, and the contradiction needs a wall of depth below
    that. The bound is half of the truth: the best constant is 1/2 as ρ → 0, 0.437 for 5 satellites.
    """
    count = np.arange(3, 300)
    verdicts = [no_excess(bound(2 * np.pi / count[2:]), 1 - np.cos(2 * np.pi / count[2:]), satellites=count[2:])]
    alpha = np.linspace(-np.pi, np.pi, 2001)
    heights = np.sort(satellites(np.stack([0 * alpha, 0 * alpha, alpha]), SATELLITES)[1], axis=-1)
    verdicts.append(no_excess(bound(SPACING), heights[:, 2] - heights[:, 0], alpha=alpha))
    small = np.array([1e-2, 1e-3])
    return every(*verdicts, agreement(2 * np.sin(small / 2) ** 2 / bound(small), 2.0, 1e-4, rho=small))


@row(
    id="S4.04",
    section="4.1",
    equation="Claim 4.2.1",
    printed=r"2\sin(\rho/2)\sin\delta_0 = \varepsilon",
    right=rolling.gap_radius,
    wrong=lambda depth, spacing, xp: depth / spacing,
)
def gap_radius(radius: Code) -> Verdict:
    """δ₀: at this distance from an odd multiple of ρ/2 adjacent satellites differ in height by the depth ε.

    The heights differ by 2 sin(ρ/2) sin(ρ/2 - |α|). Beyond δ₀ at most one satellite is in a strip of height ε, and the
    bound is sharp.
    """
    rho, eps = sp.symbols("rho epsilon", positive=True)
    bar = rho / 2 - radius(eps, rho, sp)
    first, second = (rolling.satellite(0, 0, angle, 1, sp)[1] for angle in (bar, bar - rho))
    difference = sp.expand_trig(sp.expand(sp.expand((second - first).rewrite(sp.exp)).rewrite(sp.cos)))
    return verify(sp.simplify(difference), eps, [rho < 3, eps < rho / 4])


@row(
    id="S4.05",
    section="4.1",
    kind="numeric",
    printed=r"|[-R, R]\setminus Z| = O(\delta_0)",
    wrong=lambda gap, rho: gap,
    corrected=r"|[-R, R]\setminus Z| = O(\delta_0/\rho) = O(\varepsilon/\rho^2)",
    right=lambda gap, rho: gap / rho,
)
def measure_of_the_gaps(order: Code) -> Verdict:
    """The measure of the angles in [-R, R] at which two satellites may touch.

    There are about 2R/ρ gaps of width 2δ₀, hence the measure tends to 4R δ₀/ρ. It still vanishes as ε does, because ρ²
    is much greater than ε.
    """
    ratios, scales = [], np.array([1e-4, 1e-6, 1e-8])
    for eps in scales:
        rho = 2 * np.pi / np.floor(2 * np.pi / eps**0.4)
        gap = float(rolling.gap_radius(eps, rho))
        middles = (np.arange(-np.ceil(1 / rho) - 1, np.ceil(1 / rho) + 1) + 0.5) * rho
        measure = np.sum(np.clip(np.minimum(1, middles + gap) - np.maximum(-1, middles - gap), 0, None))
        ratios.append(measure / order(gap, rho))
    return agreement(ratios, 4.0, 0.1, eps=scales)


@row(
    id="S4.06",
    section="4.1",
    equation="proof of Prop. 4.2 (ii), (iii)",
    kind="numeric",
    printed=r"x_2 \ge -\varepsilon,\quad S_j\in\mathbb R\times(0,\infty)",
    wrong=lambda eps, rho: (-eps, 0.0),
    corrected=r"x_2 \ge -\varepsilon - \rho^2/8,\quad S_j\in\mathbb R\times(-1,\infty)",
    right=lambda eps, rho: (-eps - rho**2 / 8, -1.0),
)
def heights_while_rolling(bounds: Code) -> Verdict:
    """Lower bounds for the centre and for the other satellites while the disk rolls about one.

    The rolling centre sinks by up to 1 - cos(ρ/2), and the other satellites are just above the tops, which are at -1.
    Both bounds are attained, the first one to ρ⁴/384 as ε → 0.
    """

    def check(eps: float) -> Verdict:
        rng = generator()
        limit = SPACING / 2 - float(rolling.gap_radius(eps, SPACING))
        bar, depth = rng.uniform(-limit, limit, 4000), rng.uniform(-eps, 0, 4000)
        bar[:100], depth[:50] = limit, -eps
        x1, x2 = rolling.roll(0 * bar, depth, bar, 1.0)
        heights = np.sort(satellites(np.stack([x1, x2, bar]), SATELLITES)[1], axis=-1)
        centre, others = bounds(eps, SPACING)
        # 1 - cos at the edge of the gap is rho^2/8 minus rho^4/384 and rho/2 times the gap, about eps/rho
        return every(
            no_excess(centre, x2, alpha=bar),
            no_excess(others, heights[:, 1] - 1.0, 1e-12, alpha=bar),
            agreement(centre, x2.min(), SPACING**4 / 384 + eps),
            # beside a gap, over the deepest wall, the second satellite is level with the tops
            agreement(others, heights[:, 1].min() - 1.0, 1e-9),
        )

    return every(check(EPS), check(1e-8))


@row(
    id="S4.07",
    section="4.1",
    equation="4.4",
    kind="numeric",
    printed=r"F(x_1, x_2, \alpha) = (x_1 - \sin\bar\alpha,\ x_2 + \cos\bar\alpha,\ \alpha)",
    right=lambda s1, s2, alpha, bar: rolling.roll(s1, s2, bar, 1.0),
    wrong=lambda s1, s2, alpha, bar: rolling.roll(s1, s2, alpha, 1.0),
)
def rolling_chart(chart: Code) -> Verdict:
    """F(x₁, x₂, α), with ᾱ the part of α beyond the nearest multiple of ρ, parametrises the configurations where one
    satellite touches.

    The satellite in contact is S₋ₖ modulo N, with k the nearest multiple, not Sₖ. Membership in M is compared with a
    search over all satellites.
    """
    rng = generator()
    s1, s2 = rng.uniform(-1, 1, 3000), rng.uniform(-EPS, 0, 3000)
    alpha = rng.uniform(-np.pi, np.pi, 3000)
    k, bar = residual(alpha, SPACING)
    keep = np.abs(bar) < SPACING / 2 - float(rolling.gap_radius(EPS, SPACING))
    s1, s2, alpha, bar = (a[keep] for a in (s1, s2, alpha, bar))
    x1, x2 = chart(s1, s2, alpha, bar)
    c = np.stack([x1, x2, alpha])
    contact = satellites(c, SATELLITES)[:, np.arange(len(bar)), -k[keep] % SATELLITES]
    above = clearance(c, EPS, SATELLITES)
    alone = clearance(np.stack([s1, s2, 0 * s1]), EPS, 1)
    return every(
        agreement(contact, np.stack([s1, s2]), 1e-13, alpha=alpha), holds((above >= 0) == (alone >= 0), "points")
    )


@row(
    id="S4.08",
    section="4.1",
    equation="remark after Prop. 4.2",
    kind="numeric",
    printed=r"S_k,\quad F(x_1, x_2, \alpha)",
    wrong=lambda x1, x2, k: (k, x2),
    corrected=r"S_{-k},\quad F(x_1, x_2 - 1, \alpha)",
    right=lambda x1, x2, k: (-k, x2 - 1),
)
def rolling_from_rest(claim: Code) -> Verdict:
    """Which satellite a disk at (x₁, x₂, kρ) rolls about, and where it is after turning to α.

    At α = kρ the satellite at the lowest point of the rim is S₋ₖ, at (x₁, x₂ - 1). F takes the satellite's position,
    not the centre's.
    """
    rng = generator()
    k, bar = rng.integers(-15, 16, 500), rng.uniform(-0.5, 0.5, 500) * SPACING
    x1, x2 = rng.uniform(-1, 1, (2, 500))
    number, height = claim(x1, x2, k)
    turn = k * SPACING + number * SPACING
    pivot = x1 + 1j * x2 - 1j * np.exp(1j * turn)
    centre = pivot + np.exp(1j * bar) * (x1 + 1j * x2 - pivot)
    # the paper's F, with heights relative to the centre
    expected = (x1 - np.sin(bar)) + 1j * (height + np.cos(bar))
    return agreement(np.stack([centre.real, centre.imag]), np.stack([expected.real, expected.imag]), 1e-13, k=k)


@row(
    id="S4.09",
    section="4.1",
    equation="1.38, 4.23",
    printed=r"|S_{k+1} - S_k| = 2\sin(\rho/2)",
    right=lambda rho, xp: 2 * xp.sin(rho / 2),
    wrong=lambda rho, xp: rho,
)
def distance_of_satellites(distance: Code) -> Verdict:
    """The distance of adjacent satellites.

    It is the chord of the arc ρ. Where the text says 'any two satellites' it means adjacent ones.
    """
    centres = [rolling.satellite(0, 0, sym.alpha + k * sym.rho, 1, sp) for k in (0, 1)]
    square = sum((a - b) ** 2 for a, b in zip(*centres, strict=True))
    found = distance(sym.rho, sp)
    return every(
        verify(sp.simplify(sp.expand_trig(square - found**2)), 0), verify(sp.limit(found / sym.rho, sym.rho, 0), 1)
    )


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
