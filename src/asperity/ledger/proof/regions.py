"""Section 5.3.5: the regions that tile the zoomed plane, and the sizes that the iteration preserves."""

from __future__ import annotations

import numpy as np
import sympy as sp

from ...geometry.disk import rolling
from ...geometry.disk import symbolic as sym
from ...verification import Verdict, agreement, every, holds, no_excess, verify
from ..entry import Code, by_reading, row
from ..simulated import generator, kinetic_norm, random_disks, residual, unit_velocities

good_states = by_reading(
    id="S5.31",
    section="5.3.5",
    statement="The set Ω* of good states.",
    printed=r"\Omega^* = (F \cup \Xi) \cup (A_3^*\times\mathbb S)",
    corrected=r"\Omega^* = (F \cap \Xi) \cup (A_3^*\times\mathbb S^2_+)",
    reason="Part (ii) bounds the complements of F and Ξ one by one, and part (iii) uses both properties. Hence the "
    "intersection.",
)


@row(
    id="S5.32",
    section="5.3.5",
    kind="numeric",
    printed=r"-\rho/\varepsilon \le \alpha < \rho/(2\varepsilon)",
    wrong=lambda height: -height,
    corrected=r"-\rho/(2\varepsilon) \le \alpha < \rho/(2\varepsilon)",
    right=lambda height: -height / 2,
)
def height_of_the_region(low: Code) -> Verdict:
    """The lower end of the angles of R̂*_ε, which tiles the plane in steps of ρ/ε.

    The height must be the step. As printed it is one and a half steps, and half of the plane is covered twice.
    """
    rng = generator()
    height = rng.uniform(5, 50, 400)
    alpha = rng.uniform(-3, 3, 400) * height
    alpha[:200] = (np.rint(alpha[:200] / height[:200]) + 0.5) * height[:200] + np.where(np.arange(200) % 2, 1e-6, -1e-6)
    above = alpha - np.arange(-9, 10)[:, np.newaxis] * height
    times = np.sum((above >= low(height)) & (above < height / 2), axis=0)
    return holds(times == 1, "angles are covered once", alpha=alpha, height=height)


@row(
    id="S5.33",
    section="5.3.5",
    kind="numeric",
    printed=r"(1 + m/J)^{-1/2}\,\frac{\rho j}{\varepsilon k}\,\chi",
    wrong=lambda m, J, band: 2 * band / np.sqrt(1 + m / J),
    corrected=r"(m + J)^{1/2}\,\frac{\rho j}{2\varepsilon k}\,\chi",
    right=lambda m, J, band: np.sqrt(m + J) * band,
)
def shift_of_the_bands(shift: Code) -> Verdict:
    """The shift from one of the 2k bands of R*_ε to the next, R*⁰ being {0 ≤ x₁ + α ≤ 1, -ρ/(2εk) ≤ α ≤ 0}.

    The bands have height ρ/(2εk), and χ turns by (m + J)^(-1/2). The text has x₁ and x₁ + α interchanged, too.
    """
    rng, m, J = random_disks(400)
    bands = 12
    band = 1 / (2 * bands)  # for rho/eps = 1
    alpha = rng.uniform(-0.5, 0.5, 400)
    # half of the angles are next to the edges of the bands
    alpha[::2] = (np.rint(alpha[::2] / band * 0.9) + np.where(np.arange(200) % 2, 1e-9, -1e-9)) * band
    j = np.arange(-bands + 1, bands + 1)[:, np.newaxis]
    above = alpha - j * shift(m, J, band) / np.sqrt(m + J)
    times = np.sum((above > -band) & (above <= 0), axis=0)
    return holds(times == 1, "angles are covered once", m=m, J=J)


@row(
    id="S5.34",
    section="5.3.5",
    kind="numeric",
    printed=r"\varepsilon^{-1}\Bigl(\frac\rho2 - \frac{12(L + 1)}{5\log^2(1/\rho)}\Bigr)",
    wrong=lambda rho, eps, L: (rho / 2 - 12 * (L + 1) / (5 * np.log(1 / rho) ** 2)) / eps,
    corrected=r"\varepsilon^{-1}(\rho/2 - \delta_0) - (L\log(1/\rho) + 1) - \frac{L\log(1/\rho)^2}{4\log\log(1/\rho)}",
    right=lambda rho, eps, L: rolling.good_half_width(eps, eps, rho, L),
)
def width_of_the_good_angles(width: Code) -> Verdict:
    """The half-width of the angles in Ξ, which must be nearly all of ρ/(2ε).

    As printed it is negative for every ρ < 1 and L ≥ 1, so Ξ is empty. From the corrected edge, a fraction that tends
    to 1, the flights of the iteration end at the gap; R'_ε is to be changed likewise.
    """
    rho = np.array([1e-2, 1e-3, 1e-4, 1e-6, 1e-8])
    eps = rho**2.5  # the gaps are a fraction of 2 rho^(1/2)

    def check(L: float) -> Verdict:
        found = width(rho, eps, L)
        nearly_all = no_excess(1 - 4 * np.sqrt(rho), found / (rho / (2 * eps)), rho=rho)
        # a segment of L log + 1 and log/(4 loglog) segments of L log end where a second satellite comes within eps
        ell = np.log(1 / rho)
        end = eps * (found + (L * ell + 1) + ell / (4 * np.log(ell)) * (L * ell))
        higher = 2 * np.sin(rho / 2) * np.sin(rho / 2 - end)
        # in units of rho this is the distance in the zoomed plane
        return every(nearly_all, agreement((higher / eps - 1) / rho, 0.0, 1e-3, rho=rho))

    return every(check(1.0), check(2.0))


@row(
    id="S5.35",
    section="5.3.5",
    equation="3.96",
    kind="numeric",
    printed=r"\log(1/\rho)^{-5N}",
    wrong=lambda N: 5 * N,
    corrected=r"\log(1/\rho)^{-(3N+4)}",
    right=lambda N: 3 * N + 4,
)
def exponent_of_the_lower_bound(exponent: Code) -> Verdict:
    """The exponent of the lower bound log(1/ρ)^(-e) for log(1/ρ)^(-(3N+4)).

    As printed it fails for N = 1. The product log^(-(3N+4)) C^(-N) is at least ρ for N ≤ log/(4 loglog) and small ρ,
    and the conclusions hold.
    """
    N = np.arange(1, 200)
    ell = np.array([1e8, 1e10, 1e12])  # log(1/rho)
    last = ell / (4 * np.log(ell))
    product = exponent(last) * np.log(ell) + last * np.log(2.0)  # minus its logarithm, with C = 2
    # 3 N + 4 is the least exponent, and it suffices
    return every(agreement(exponent(N), 3 * N + 4, 0.0, N=N), no_excess(product, ell))


@row(
    id="S5.36",
    section="5.3.5",
    equation="Claim 5.3.1",
    kind="numeric",
    printed=r"|\varepsilon\tilde\alpha_0| \le \varepsilon\rho/2",
    wrong=lambda eps, rho: eps * rho / 2,
    corrected=r"|\varepsilon\tilde\alpha_0| \le \rho/2",
    right=lambda eps, rho: rho / 2,
)
def bound_of_the_zoomed_angle(bound: Code) -> Verdict:
    """The bound of ε times the zoomed angle.

    The zoomed angle is at most ρ/(2ε). The final bound by sin ρ still holds, because sin ν cos θ₀ is at least a
    multiple of 1/log².
    """
    eps, rho = 1e-3, 2 * np.pi / 100
    alpha = generator().uniform(-3, 3, 4000) / eps
    alpha[0] = (0.5 + 1e-9) * rho / eps
    _, bar = residual(alpha, rho / eps)
    size = np.abs(eps * bar)
    return every(
        no_excess(size, bound(eps, rho) * (1 + 1e-12), alpha=alpha), agreement(bound(eps, rho) / size.max(), 1.0, 1e-6)
    )


@row(
    id="S5.37",
    section="5.3.5",
    equation="3.107",
    kind="numeric",
    printed=r"\|y\| \le |G_0(y)| + |\Delta\alpha|",
    wrong=lambda g, turn, m, J: g + turn,
    corrected=r"\|y\| \le m^{1/2}|G_0(y)| + (m + J)^{1/2}|\Delta\alpha|",
    right=lambda g, turn, m, J: np.sqrt(m) * g + np.sqrt(m + J) * turn,
)
def size_of_a_displacement(bound: Code) -> Verdict:
    """The size of a displacement y in terms of its contact G₀(y) and its turn Δα.

    The displacement (-1, 0, 1) has G₀ = 0 and the norm (m + J)^(1/2). The final bound is O(1/log(1/ρ)) and not
    80/log(1/ρ)³, which still vanishes.
    """
    rng, m, J = random_disks()
    y = rng.normal(size=(3, m.size))
    y[:2, ::4] = np.stack([-y[2], 0 * y[2]])[:, ::4]
    y[2, 1::4] = 0
    g = np.hypot(*rolling.straight_contact(*y))
    size, found = kinetic_norm(y, m, J), bound(g, np.abs(y[2]), m, J)
    # each term alone is attained
    alone = (np.arange(m.size) % 4) < 2
    return every(
        no_excess(size, found, 1e-12, m=m, J=J), agreement(found[alone], size[alone], 1e-12, m=m[alone], J=J[alone])
    )


@row(
    id="S5.38",
    section="5.3.5",
    printed=r"\varepsilon\rho^{-1}|R^*_\varepsilon| = 1",
    right=lambda eps, rho: eps / rho,
    wrong=lambda eps, rho: eps**2 / rho,
)
def area_of_the_zoomed_rectangle(factor: Code) -> Verdict:
    """The zoomed rectangle R*_ε has the area ρ/ε, so ερ⁻¹ makes measures of parts of it fractions.

    R_ε has the sides ε and ρ, and both are divided by ε. Where the text has P × S² minus Ω* it means R*_ε × S²₊.
    """
    eps, x1, alpha = sp.Symbol("epsilon", positive=True), sp.Symbol("x1"), sp.Symbol("alpha")
    half = sym.rho / (2 * eps)
    return verify(factor(eps, sym.rho) * sp.integrate(1, (x1, -alpha, 1 - alpha), (alpha, -half, half)), 1)


@row(
    id="S5.39",
    section="5.2",
    equation="Claim 5.2.1",
    kind="numeric",
    printed=r"\frac{(2a + 1)(2b + 1)}{\varepsilon\rho}",
    right=lambda a, b, eps, rho: (2 * a + 1) * (2 * b + 1) / (eps * rho),
    wrong=lambda a, b, eps, rho: 4 * a * b / (eps * rho),
)
def number_of_rectangles(bound: Code) -> Verdict:
    """How many translates of the ε × ρ rectangle meet a rectangle of sides 2a and 2b, for ε, ρ ≤ 1/2.

    At most 2a/ε + 2 and 2b/ρ + 2 translates meet it in either direction, counted for random positions. For ε = ρ = 1/2
    the bound is attained.
    """
    rng = generator()
    a, b = rng.uniform(0.01, 5, (2, 4000))
    eps, rho = np.exp(rng.uniform(np.log(1e-3), np.log(0.5), (2, 4000)))
    sides, start = (a, b, eps, rho), rng.uniform(0, 1, (2, 4000))
    along = np.floor(a / eps - start[0]) - np.floor(-a / eps - start[0]) + 1
    across = np.floor(b / rho - start[1]) - np.floor(-b / rho - start[1]) + 1
    # for eps = rho = 1/2, rectangles slightly larger than whole cells meet one more cell on either side
    cells = np.arange(1, 40)
    a, b = cells / 4 + 1e-9, cells[::-1] / 4 + 1e-9
    most = (cells + 2) * (cells[::-1] + 2)
    return every(
        no_excess(along * across, bound(*sides), eps=sides[2], rho=sides[3]),
        agreement(bound(a, b, 0.5, 0.5), most, 1e-6),
    )


@row(
    id="S5.40",
    status="convention",
    section="5.2, 5.3",
    equation="3.95, 3.113, 5.143",
    kind="numeric",
    printed=r"|\omega| \le \|w\| = 1",
    wrong=lambda J: np.ones_like(J),
    corrected=r"|\omega| \le J^{-1/2}",
    right=lambda J: J**-0.5,
)
def bound_of_the_spin(bound: Code) -> Verdict:
    """The bound of the angular velocity of a unit velocity.

    As printed it needs J ≥ 1, but a unit disk has J ≤ m. In general constants change by J^(-1/2), and v₂ is ⟨w, e₂⟩/m
    in Claim 5.2.2.
    """
    rng, m, J = random_disks()
    w = unit_velocities(rng, m, J)
    # for J > 1 the printed bound also holds; only its claim for light rims is tested
    spin = np.stack([0 * J, 0 * J, bound(J)])
    return every(
        no_excess(np.abs(w[2]), bound(J), 1e-12, m=m, J=J),
        agreement(kinetic_norm(w, m, J), 1.0, 1e-12),
        # attained by pure spin
        agreement(kinetic_norm(spin, m, J), 1.0, 1e-12, J=J),
    )
