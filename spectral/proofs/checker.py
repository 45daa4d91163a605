"""Check the certificate of a proved spectral gap: python checker.py < gap.json. It needs python-flint alone.

Every inequality is decided in balls, and nothing of asperity is imported. The theorem and the lemmas that the
docstrings name are proved in docs/theory/proved-gaps.md.
"""

import json
import re
import sys
from itertools import pairwise

from flint import acb, acb_poly, arb, arb_poly, ctx

DECIMAL = re.compile(r"-?[0-9]+(\.[0-9]+)?(e[+-]?[0-9]{1,4})?", re.ASCII)
WORDS = "family", "frame", "format", "written by"
UNIT, ZERO, ONE = acb(0, 1), arb(0), arb(1)
with ctx.workprec(512):
    PI = arb.pi()


class Refused(Exception):
    """An inequality of the certificate that does not hold."""


def demand(true, what):
    if not true:
        raise Refused(what)


def ball(low, high):
    return arb(low).union(arb(high))


def up_to(most):
    """From 0 to the upper end of a ball."""
    return ball(0, most.upper())


def spread(values):
    """From the least to the greatest number of some balls; of what is not finite nothing is known."""
    finite = all(x.is_finite() for x in values)
    return ball(min(x.lower() for x in values), max(x.upper() for x in values)) if finite else ZERO / 0


def clipped(t, a, b):
    """The point of [a, b] that is nearest to t."""
    ends = zip((t.lower(), t.upper()), (a.lower(), a.upper()), (b.lower(), b.upper()), strict=True)
    return ball(*(min(max(x, low), high) for x, low, high in ends))


def top(lines, t):
    """The greatest of some linear functions at t, and the slopes that it may have."""
    values = [slope * t + offset for slope, offset in lines]
    most = ball(max(x.lower() for x in values), max(x.upper() for x in values))
    return most, spread([slope for (slope, _), x in zip(lines, values, strict=True) if not x < most])


def increasing(numbers):
    return all(x < y for x, y in pairwise(numbers))


def plain(given):
    """Whether all texts but words are finite decimals: python-flint reads fractions, balls and infinities too."""
    if isinstance(given, dict):
        return all(key in WORDS or plain(value) for key, value in given.items())
    if isinstance(given, list):
        return all(map(plain, given))
    return not isinstance(given, str) or DECIMAL.fullmatch(given) is not None


def exact(number):
    """The ball of a text, or of a middle and a radius."""
    texts = [number] if isinstance(number, str) else number
    listed = isinstance(texts, list) and len(texts) in (1, 2) and all(isinstance(x, str) for x in texts)
    demand(listed and plain(texts), "numbers as decimal texts, or as lists of middle and radius")
    return arb(*texts)


def unit(angle):
    return (UNIT * angle).exp()


def root(z, analytic):
    """Square root, of balls in the right half plane tighter than the library's."""
    if not z.real > 0:
        return z.sqrt(analytic=analytic)
    real = (((z.real * z.real + z.imag * z.imag).sqrt() + z.real) / 2).sqrt()
    return acb(real, z.imag / (2 * real))


def integral(f, low, high, bits):
    return acb.integral(f, low, high, rel_tol=ONE / 2**bits, abs_tol=ONE / 2**bits)


def at(waves, u):
    """The sum of waves[m] u^m."""
    total, up, down, back = waves.get(0, ZERO), acb(1), acb(1), 1 / u
    for m in range(1, max(waves) + 1):
        up, down = up * u, down * back
        total += waves[m] * up + waves[-m] * down
    return total


def negative_pivots(matrix):
    """How many eigenvalues of a symmetric matrix are negative, by LDL^T; its lower half is overwritten (lemma 1)."""
    negative, n = 0, len(matrix)
    for k in range(n):
        pivot = matrix[k][k]
        demand(pivot > 0 or pivot < 0, "pivots of known sign")
        negative += pivot < 0
        # a ball that contains 0 and more is neither 0 nor not 0
        column = [(i, matrix[i][k], matrix[i][k] / pivot) for i in range(k + 1, n) if not matrix[i][k].is_zero()]
        for number, (i, _, factor) in enumerate(column):
            for j, x, _ in column[: number + 1]:
                matrix[i][j] -= factor * x
    return negative


def primitive(p, n):
    """The polynomial q for which q(t) e^(i t/n) has the derivative p(t) e^(i t/n)."""
    return UNIT * n * (primitive(p.derivative(), n) - p) if len(p) else acb_poly()


class Trial:
    """v = c0 cos(m theta) + c1 sin((m + 1) theta) + c2 cos((m + 2) theta) + ..., m = 1 if odd, or 0, less its mean."""

    def __init__(self, coefficients, odd):
        self.odd, self.waves = odd, {}
        demand(all(arb(c).is_finite() for c in coefficients), "finite coefficients")
        for m, c in enumerate(coefficients, int(odd)):
            for sign in (1, -1):
                factor = -sign * UNIT / 2 if (m + odd) % 2 else acb(0.5)
                self.waves[sign * m] = self.waves.get(sign * m, ZERO) + arb(c) * factor
        if not odd:
            self.waves[0] -= integral(lambda t, _: self(t) * t.sin(), 0, PI / 2, 60).real
        self.norm = integral(lambda t, _: self(t) * self(t) * t.sin(), 0, PI / 2, 60).real
        # by the mean value theorem, because the coefficients may be far larger than v
        slopes, step = {m: UNIT * m * c for m, c in self.waves.items()}, PI / 2048
        parts = [(step * (2 * i + 1) / 2, ball(step * i, step * (i + 1))) for i in range(1024)]
        self.largest = max(abs(self(t) + at(slopes, unit(part)) * (part - t)).upper() for t, part in parts)

    def __call__(self, t):
        return at(self.waves, unit(t))

    def swept(self, u, glance):
        """An antiderivative of v(2 s - theta) sin(s) in s, at u = e^(i (2 s - theta)) and glance = e^(i s)."""
        up, down = ({m: c / (2 * m + k) for m, c in self.waves.items()} for k in (1, -1))
        return (at(down, u) / glance - at(up, u) * glance) / 2


class Pieces:
    """v, a polynomial of t - c between edges up to pi/2, c their middle, less its mean; even or odd about pi/2."""

    def __init__(self, edges, coefficients, odd):
        ends, self.odd, self.waves = [ZERO, *map(arb, edges), PI / 2], odd, {}
        demand(increasing(ends) and len(coefficients) == len(ends) - 1, "increasing edges with a polynomial between")
        pieces = zip(pairwise(ends), coefficients, strict=True)
        self.half = [(a, b, arb(((a + b) / 2).mid()), arb_poly([arb(x) for x in p])) for (a, b), p in pieces]
        if not odd:
            mean = self.integral(lambda p: p)
            self.half = [(a, b, c, p - mean) for a, b, c, p in self.half]
        self.norm = self.integral(lambda p: p * p)
        mirror = arb_poly([0, -1])
        self.all = self.half + [(PI - b, PI - a, PI - c, (-1 if odd else 1) * p(mirror)) for a, b, c, p in self.half]
        self.largest = max(abs(self(ball(a, b))).upper() for a, b, *_ in self.half)

    def integral(self, function):
        """Integral of a function of v times sin(theta) up to pi/2."""
        waves = [(a, b, c, primitive(function(p), 1)) for a, b, c, p in self.half]
        return sum((unit(b) * q(b - c) - unit(a) * q(a - c) for a, b, c, q in waves), acb(0)).imag

    def wave(self, n, low, high):
        """Integral of v(x) e^(i x/n) from low to high, nothing if these are in the wrong order."""
        if n not in self.waves:
            self.waves[n] = [primitive(p, n) for *_, p in self.all]
        # between the middles of the ends, because errors would grow with the powers of n
        first, last = arb(low.mid()), arb(high.mid())
        rest = (low - first + high - last) * self.largest
        total, last = acb(rest, rest), max(first, last)
        for (a, b, c, _), q in zip(self.all, self.waves[n], strict=True):
            if not (b < first or a > last):
                x, y = clipped(first, a, b), clipped(last, a, b)
                total += unit(y / n) * q(y - c) - unit(x / n) * q(x - c)
        return total

    def __call__(self, t):
        """Value by the mean value theorem."""
        found = []
        for a, b, c, p in self.all:
            if not (t < a or t > b):
                x = clipped(t, a, b)
                middle = arb(x.mid())
                found.append(p(middle - c) + p.derivative()(x - c) * (x - middle))
        return spread(found)


class Wall:
    """A law whose eigenvalues are counted by the least density and the grazing angles that subclasses give."""

    def count(self, angles, odd, sign, threshold):
        """At most how many eigenvalues of 1 - sign P lie below the threshold (lemmas 1 and 4)."""
        half = [arb(t) for t in angles]
        demand(increasing([ZERO, *half, PI / 2]), "increasing angles of bins")
        edges, n, fold = [*half, PI / 2, *(PI - t for t in reversed(half))], len(half), -1 if odd else 1
        bins = [ball(x, y) for x, y in pairwise(edges)]
        weight = [(x.cos() - y.cos()) / 2 for x, y in pairwise(edges)]
        # densities between bins on one side and on both sides, symmetric; exact, as the factorisation needs
        sides = (bins, bins[::-1])
        near, far = ([[arb(self.least(bins[i], b).lower()) for b in side[: i + 1]] for i in range(n)] for side in sides)
        once, block, entering = self.grazing(half[0])
        share, matrix = once - block - threshold, []
        demand(share > 0 and share <= 1, "a positive threshold below the chance to leave grazing angles")
        for i in range(n):
            row = sum((weight[j] * (near[max(i, j)][min(i, j)] + far[max(i, j)][min(i, j)]) for j in range(n)), ZERO)
            row -= arb(((1 / share - 1) * entering(bins[i])).upper()) + threshold
            demand(row > 0, "a threshold below the chance to leave each bin")
            folded = [near[i][j] + fold * far[i][j] for j in range(i + 1)]
            matrix.append([-sign * (weight[i] * weight[j]).sqrt() * x for j, x in enumerate(folded)])
            matrix[i][i] += row
        return negative_pivots(matrix)


class Bumps(Wall):
    """Dispersing arcs of curvature K and period 1, in the specular frame.

    A ray of direction theta that meets the point of slope -psi leaves in the direction a = theta - 2 psi, at the angle
    s = theta - psi with the arc.
    """

    def __init__(self, curvature, effort):
        self.K, self.R, self.steepest, self.effort = curvature, 1 / curvature, (curvature / 2).asin(), effort
        demand(self.K > 0 and self.K * self.K < 2, "a curvature between 0 and sqrt(2)")

    def hits(self, s, a):
        """Whether a ray that leaves an arc hits the next one on the right (lemma 2); None: undecided."""
        ahead, near = self.K * a.cos() - s.sin(), 2 * (s / 2).sin() ** 2 - self.K * a.sin()
        return False if ahead <= 0 or near <= 0 else (ahead > 0 and near > 0) or None

    def sees(self, s, a):
        """Whether a ray that leaves an arc leaves the wall; None: undecided."""
        found = self.hits(s, a), self.hits(PI - s, PI - a)
        return False if True in found else None if None in found else True

    def tangent(self, theta):
        """The direction in which the ray from theta leaves that then touches the next arc (lemma 3)."""

        def excess(a, t):
            return self.K * a.sin() - 2 * ((t + a) / 4).sin() * ((t + a) / 4).sin()

        def slope(a, t):
            return self.K * a.cos() - ((t + a) / 2).sin() / 2

        t, a = theta.real.mid(), ZERO
        for _ in range(10):
            a = (a - excess(a, t) / slope(a, t)).mid()
        r = 2 * abs(excess(a, theta) / slope(a, theta)).upper()
        if not (r < 1 and a > 0 and a < self.steepest):
            return acb(ZERO / 0)
        around = a + acb(ball(-r, r), ball(-r, r))
        steep, found = slope(around, theta), a - excess(a, theta) / slope(around, theta)
        return found if steep.real > 0 and around.contains_interior(found) else acb(ZERO / 0)

    def twice(self, v, theta, steep, last, bits):
        """Integral of v sin(s) over the rays that are reflected twice, to the right; a = last - q (lemma 5)."""
        low, corner = (theta - 2 * self.steepest, (3 * self.steepest - theta) / 2) if steep else (-theta, ZERO)
        deepest, quarter = corner.sin() * corner.sin() if steep else self.K * theta.sin() / 2, (last - low) / 4

        def rise(a, quarter):
            return 2 * self.K * ((a + last) / 2).cos() * quarter.cos() - ((2 * theta + a + last) / 4).sin()

        length = 4 * deepest / (rise(low, quarter) * quarter.sinc())

        def integrand(t, analytic):
            q = length * t * t
            a, ratio = last - q, length / 4 * (q / 4).sinc()
            square = ratio * rise(a, q / 4)
            half = root(1 - t * t * square, analytic) + UNIT * t * root(square, analytic)
            return at(v.waves, unit(a) * half**4) * ((theta + a) / 2).sin() * t

        if bits:
            return length * integral(integrand, 0, 1, bits)
        parts = [acb(ball(ONE * i / 16, ONE * (i + 1) / 16)) for i in range(16)]
        return length * sum((integrand(part, True) for part in parts), ZERO) / 16

    def reflected(self, v, theta, sides, analytic, bits):
        """P v (lemma 5); the sides of the kinks say which of its formulas holds."""
        steep, above, left = sides
        bits, turn = 0 if analytic or theta.rad() > ONE / 2**49 else bits, unit(self.steepest)
        size, total = self.K * theta.sin(), ZERO
        first = unit(theta) / turn if steep else acb(1)
        half = root(1 - size / 2, analytic) + UNIT * root(size / 2, analytic)
        last = unit(theta) * turn if steep else half * half
        if not above:
            a = self.tangent(theta)
            total, first = total + self.twice(v, theta, steep, a, bits), unit((theta + a) / 2)
        if left:
            a = self.tangent(PI - theta)
            total += (-1 if v.odd else 1) * self.twice(v, PI - theta, True, a, bits)
            last = unit((PI + theta - a) / 2)
        return (total + v.swept(last * last / unit(theta), last) - v.swept(first * first / unit(theta), first)) / size

    def form_and_residual(self, v, sign, guess):
        """<v, (1 - sign P) v> and a bound of |(1 - sign P - guess) v|^2 (lemma 6)."""
        first, bits = arb(self.effort["first"]), self.effort["bits"]
        demand(first > 0 and first < self.steepest, "a first angle below the steepest slope")
        kinks, off = (self.steepest, 3 * self.steepest, PI - 3 * self.steepest), ONE / 2**46
        cuts = sorted((x for x in (first, *kinks, PI / 2) if not x > PI / 2), key=lambda x: float(x.mid()))
        total, missed = acb(0), PI / 2 - first
        for low, high in ((x + off, y - off) for x, y in pairwise(cuts)):
            if not low < high:
                continue
            demand(all(high < x or low > x for x in kinks), "pieces between the kinks")

            def integrand(theta, analytic, sides=tuple(low > x for x in kinks)):
                own = v(theta)
                rest = (1 - guess) * own - sign * self.reflected(v, theta, sides, analytic, bits + 4)
                return (rest + UNIT * own) * rest * theta.sin()

            total, missed = total + integral(integrand, low, high, bits), missed - (high - low)
        # where nothing is known but the size of v
        most = (first * first / 2 + missed) * (2 + abs(guess)) * v.largest * v.largest
        form = guess * v.norm + total.imag + ball(-most.upper(), most.upper())
        return form, total.real + up_to(most * (2 + abs(guess)))

    def least(self, theta, eta):
        """The least density, from bin to bin, of rays that are certainly reflected once."""
        s, psi = (theta + eta) / 2, (theta - eta) / 2
        sure = abs(psi) < self.steepest and self.sees(s, eta) and self.sees(s, theta)
        most = arb(theta.sin().upper()) * arb(eta.sin().upper())
        return self.R * arb(s.sin().lower()) / most if sure else ZERO

    def grazing(self, eps):
        """The least chance of one reflection, the norm of the grazing block, the chance to enter it (lemma 4)."""
        ratio, width, reach = eps.sin() / eps, 8 * self.K / (eps / 2).sinc() ** 2, 2 * self.steepest + eps
        small = eps < self.steepest and (self.steepest + eps).sin() < self.K * eps.cos()
        small = small and self.K * eps.sin() < 1 - (PI / 4).cos()
        demand(small, "a first bin nearer to 0")
        block = self.R * eps / (2 * ratio) * ((width / eps).log() + ONE / 2).sqrt()
        entering = self.R * eps / 2 * (1 if reach < PI / 2 else 2 / reach.sin())
        return 1 - self.R * (eps / 2).tan(), block, lambda _: entering


class FocusingArcs(Wall):
    """Arcs of half angle alpha and period 1, in the specular frame.

    A ray of direction theta makes the same angle s with the arc at each reflection, and after k of them it leaves in
    the direction 2 k s - theta (lemma 10).
    """

    def __init__(self, half_angle, effort):
        self.alpha, self.R, self.effort = half_angle, 1 / (2 * half_angle.sin()), effort
        demand(half_angle > 0 and half_angle < PI / 2, "a half angle between 0 and pi/2")

    def form_and_residual(self, v, sign, guess):
        """<v, (1 - sign P) v>, and a bound of |(1 - sign P - guess) v|^2, by intervals of theta (lemma 11)."""
        parts, most, alpha = self.effort["parts"], self.effort["reflections"], self.alpha
        demand(parts > 0 and most > 0, "at least one interval and one reflection")
        self.strips = []
        for n in (arb(2 * k) for k in range(1, most + 1)):
            lower = (n - 1, -n * alpha), (-n - 1, n * alpha), (-1 / (n + 1), n * alpha / (n + 1))
            self.strips.append((n, lower, ((-1 / (n - 1), -n * alpha / (n - 1)), (ONE, -n * PI / 2))))
        scale, fold, paired, square = sign * self.R, -1 if v.odd else 1, ZERO, ZERO
        for a, b, c, p in v.half:
            h, derivative = (b - a) / parts, p.derivative()
            for low, high in ((a + i * h, a + (i + 1) * h) for i in range(parts)):
                theta, t = ball(low, high), (low + high) / 2
                one, two = self.one_side(v, theta, t), self.one_side(v, PI - theta, PI - t)
                after, by_theta, rest = (x + y * fold for x, y in zip(one, (two[0], -two[1], two[2]), strict=True))
                off, own, slope = theta - t, p(t - c), derivative(theta - c)
                wide = own + slope * off
                bend = slope * (after + by_theta * off) + wide * by_theta
                # to the second order, because the interval is symmetric about its middle
                paired += h * (own * after + wide * rest) + (bend - arb(bend.mid())) * h * h / 4
                missed = (1 - guess) * own * t.sin() - scale * (after + rest)
                change = (1 - guess) * (slope * theta.sin() + wide * theta.cos()) - scale * by_theta
                demand(
                    low > 0 or (low.is_zero() and rest == 0),
                    "a first interval out of reach of rays with many reflections",
                )
                missed = (missed + change * off) / theta.sin() if low > 0 else change / theta.sinc()
                square += missed * missed * (low.cos() - high.cos())
        return v.norm - scale * paired, square

    def one_side(self, v, theta, t):
        """Integral of v(x) sin(s) ds over the rays with s < pi/2: at t, its slope, and that of many reflections."""
        value, slope, off = ZERO, ZERO, theta - t
        for n, lower, upper in self.strips:
            # the ends of the outgoing angles x = n s - theta
            (low, falls), (high, rises) = top(lower, theta), (-x for x in top(upper, theta))
            if high < low:
                break
            if not high > low:
                high, rises = spread([high, low]), spread([rises, falls])
            wave = unit(t / n) / n * v.wave(n, top(lower, t)[0], -top(upper, t)[0])
            value += wave.imag
            slope += wave.real / n + off * v.largest * (abs(rises) + abs(falls) + (high - low) / n) / (n * n)
            slope += sum(rate * v(x) * ((x + theta) / n).sin() / n for x, rate in ((high, rises), (low, -falls)))
        s = (self.alpha + theta) / (2 * len(self.strips) + 1)
        mass = clipped((theta - self.alpha).cos() - s.cos(), ZERO, ONE)
        return value, slope, v(self.alpha + ball(-s.upper(), s.upper())) * mass

    def least(self, theta, eta):
        """The least density from bin to bin (lemma 10)."""
        views, density = ((theta, eta), (PI - theta, PI - eta)), ZERO
        for side, view in enumerate(views):
            for k in range(1 + side, 99):
                # the rays of one reflection are those of both sides
                if not all(
                    self.returns(k, *one) and self.returns(k, *one[::-1]) for one in (views if k == 1 else (view,))
                ):
                    break
                density += arb((sum(view) / (2 * k)).sin().lower()) / k
        return self.R * density / (arb(theta.sin().upper()) * arb(eta.sin().upper()))

    def returns(self, k, x, y):
        """Whether surely |x - alpha| < s = (x + y)/(2 k)."""
        return y - (2 * k - 1) * x + 2 * k * self.alpha > 0 and y + (2 * k + 1) * x - 2 * k * self.alpha > 0

    def grazing(self, eps):
        """As of bumps: all rays count, and none leads from grazing angles to grazing angles (lemma 4)."""
        demand(2 * eps < self.alpha and 2 * eps < PI - 2 * self.alpha, "a first bin nearer to 0")

        def entering(theta):
            seen = [x for x in (theta, PI - theta) if not (x > 2 * self.alpha + eps or x < 2 * self.alpha - 3 * eps)]
            # divided by a ball, so that nothing is known where it contains 0
            return arb((len(seen) * self.R * eps / (2 * theta.sin())).upper())

        return ONE, ZERO, entering


def of_bumps(curvature, certificate, signs):
    """Bounds of the least eigenvalues of 1 - sign P on odd functions, and on even ones of mean 0 (lemma 9)."""
    law, odd = Bumps(exact(curvature), certificate["effort"]), certificate["odd"]
    above, other = exact(certificate["threshold"]), exact(certificate["other"])
    found = law.count(certificate["bins"], not odd, signs[not odd], other)
    demand(found <= (1 if odd else 0), "no eigenvalue of the other parity below its threshold")
    v, guess = Trial(certificate["trial"], odd), arb(certificate["guess"])
    return {odd: temple(law, v, signs[odd], guess, certificate["bins"], above), not odd: (other, arb(2))}


def of_focusing_arcs(half_angle, certificate, signs):
    """As of bumps, with a trial function of each parity."""
    law, values = FocusingArcs(exact(half_angle), certificate["effort"]), {}
    for odd, one in zip((False, True), certificate["parities"], strict=True):
        v, above = Pieces(certificate["edges"], one["trial"], odd), exact(one["threshold"])
        values[odd] = temple(law, v, signs[odd], arb(one["guess"]), certificate["bins"], above)
    return values


def temple(law, v, sign, guess, bins, above):
    """Bounds of the least eigenvalue of 1 - sign P on functions of the parity of v, of mean 0 (lemma 9)."""
    found = law.count(bins, v.odd, sign, above)
    demand(found <= (1 if v.odd else 2), "one eigenvalue of the trial function's parity below the threshold")
    demand(v.norm > 0 and guess.is_finite(), "a trial function with a norm, and a finite guess")
    form, square = law.form_and_residual(v, sign, guess)
    ends, square = [arb(x) for x in ((form / v.norm).lower(), (form / v.norm).upper())], arb((square / v.norm).upper())
    finite = all(x.is_finite() for x in (*ends, square))
    demand(finite and above > ends[1], "a finite quotient below the next eigenvalue, and a finite residual")
    # concave in the quotient, so least at an end
    return min((x - square / (above - x)).lower() for x in ends), ends[1]


def enclose(certificate):
    """The interval of the gap that the certificate proves."""
    demand(plain(certificate), "finite decimals")
    ctx.prec, frame, law = certificate["precision"], certificate["frame"], certificate["law"]
    demand(ctx.prec >= 53 and frame in ("specular", "paper"), "53 bits or more, and a known convention")
    weights = {name: exact(number) for name, number in certificate["weights"].items()}
    names = ["lambertian", "law", "retroreflection", "specular"]
    demand(
        sorted(weights) == names and all(w >= 0 for w in weights.values()) and sum(weights.values()).contains(1),
        "weights that sum to 1",
    )
    numbers = {"powers": "mean_cosine", "dispersing arcs": "curvature", "focusing arcs": "half_angle"}
    number = numbers.get(law["family"])
    demand(sorted(law) == sorted(["family", str(number)]), "a known family and its number")
    signs = {True: 1 if frame == "specular" else -1, False: 1}
    if law["family"] == "powers":
        # the eigenvalue g^l on the Legendre polynomial of degree l in the paper's convention (lemma 8)
        g = exact(law[number])
        demand(abs(g) < 1, "a mean cosine between -1 and 1")
        tops = {odd: -signs[odd] * g if odd else g * g for odd in signs}
        values = {odd: [1 - max(x, ZERO) for x in (top.upper(), top.lower())] for odd, top in tops.items()}
    else:
        bounds = of_bumps if number == "curvature" else of_focusing_arcs
        values = bounds(law[number], certificate, signs)
    # a mixture (lemma 7)
    plane = {odd: weights["specular"] + (-1 if odd else 1) * weights["retroreflection"] for odd in signs}
    mixed = [[1 - signs[odd] * plane[odd] - weights["law"] * (1 - x) for x in values[odd]] for odd in signs]
    demand(all(x.is_finite() for ends in mixed for x in ends), "finite bounds")
    return min(arb(low.lower()) for low, _ in mixed), min(arb(high.upper()) for _, high in mixed)


def check(certificate):
    """Raise Refused unless the certificate proves its interval."""
    demand(certificate["format"] == "asperity proved gap 1", "a certificate of a proved gap")
    demand(isinstance(certificate["interval"], list), "an interval of two numbers")
    (low, high), (first, last) = enclose(certificate), map(exact, certificate["interval"])
    demand(first <= low and high <= last, f"the interval from {low.str(12)} to {high.str(12)}")


if __name__ == "__main__":
    given = json.load(sys.stdin)
    check(given)
    print("Proved:", {name: given[name] for name in ("law", "weights", "frame", "interval")})
