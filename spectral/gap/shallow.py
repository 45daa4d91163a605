"""The gap of shallow walls, without cancellation, from the quadratic form of 1 - P."""

from __future__ import annotations

from dataclasses import dataclass
from functools import singledispatch

import numpy as np

from ...core.checks import Floats
from ...geometry import Wall, focusing_arcs
from ...geometry.curves.curve import Curve
from ...kernels import CircularArcLaw, Law, PolygonLaw, WallLaw
from ...kernels.bases.measure import gauss_on_intervals, gauss_rule
from ...kernels.laws.law import Combination, SpecularFrame
from ..essential.edge import EssentialEdge
from .verdict import SpectralGap

# Largest slope, in radians, and limit on the curved pieces.
STEEPEST, MOST_CURVED = 0.1, 64
# A ray steeper than ONCE times the steepest slope s meets the wall once, because it leaves steeper than s. Less steep
# rays leave within WITHIN times s of grazing.
ONCE, WITHIN = 3.0, 5.0
# Panels and nodes per curved piece, and number of Legendre polynomials.
PANELS, NODES, DEGREES = 32, 12, 12
# Panels in the incoming angle, with enough nodes for products of two polynomials.
ANGLE_PANELS, ANGLE_NODES = 4, 24
# Damping is computed at frequencies in steps of STEP over the steepest slope, up to TURNS over the least turn of a
# piece. Walls whose least turn is below LEAST_TURN times the steepest slope are refused.
STEP, TURNS, LEAST_TURN = 0.2, 30.0, 0.01
# Least damping of fast oscillations as a multiple of the gap; their frequencies exceed the degree of its eigenfunction
# by FASTER.
APART, FASTER = 1.25, 1.5
# Largest relative error of an accepted gap.
LARGEST_ERROR = 0.01
# Relative rounding of sums of squares with weights of one sign.
ROUNDING = 1e-12


@dataclass(frozen=True)
class Slopes:
    """The slope of a shallow wall at a uniform point of its period, as a quadrature.

    Attributes
    ----------
    angle, weight : arrays of shape (k,)
        Angles to the horizontal, radians, and their probabilities.
    steepest : float
        The largest modulus of the angle.
    least_turn : float
        The least turn of the tangent along a curved piece; infinite without curved pieces.
    """

    angle: Floats
    weight: Floats
    steepest: float
    least_turn: float

    @property
    def mean_square(self) -> float:
        """The mean of sin(angle)^2; to leading order the gap is 4 times this mean."""
        return float(self.weight @ np.sin(self.angle) ** 2)

    @property
    def once(self) -> float:
        """Rays at this angle to the horizontal and steeper ones meet the wall once."""
        return ONCE * self.steepest

    def changes(self, theta: Floats) -> tuple[Floats, Floats]:
        """E[cos(theta') + cos(theta)] and E[sin(theta) - sin(theta')] of rays that hit once, and errors, (angles, 2).

        They are the means of 2 sin(theta - s) sin(s) and 2 cos(theta - s) sin(s) with the weight 1 - tan(s) cot(theta)
        of the slope s, in which E tan(s) = 0.
        """
        square, cube = self.mean_square, float(self.weight @ (np.tan(self.angle) * np.sin(self.angle) ** 2))
        sine, cosine = np.sin(2.0 * theta), np.cos(2.0 * theta)
        terms = np.stack([sine * square, -cosine * cube, -cosine * square, -sine * cube]).reshape(2, 2, -1)
        terms *= 2.0 / np.sin(theta)
        rounding = np.abs(terms[:, 0]) + self.steepest * square * np.abs(2.0 / np.sin(theta))
        return terms.sum(axis=1).T, ROUNDING * rounding.T

    def squared_changes(self) -> Floats:
        """Means of the squares of these changes over the flux, of rays that hit once; shape (2,)."""
        theta, weight = gauss_rule(np.linspace(self.once, np.pi - self.once, ANGLE_PANELS + 1), ANGLE_NODES)
        onward = theta[:, None] - self.angle
        flux = 0.5 * np.sin(onward) * (self.weight * 4.0 * np.sin(self.angle) ** 2 / np.cos(self.angle))
        return np.array([weight @ (flux * function(onward) ** 2).sum(axis=1) for function in (np.sin, np.cos)])

    def shrinkage(self, frequency: Floats) -> Floats:
        """The damping 1 - |E exp(2 i t angle)| of cos(t theta + phase) for large t, without cancellation."""
        centred = self.angle - float(self.weight @ self.angle) / float(self.weight.sum())
        decay = np.array([self.weight @ (2.0 * np.sin(t * centred) ** 2) for t in frequency.tolist()])
        odd_part = np.array([self.weight @ np.sin(2.0 * t * centred) for t in frequency.tolist()])
        square = decay * (2.0 - decay) - odd_part**2
        return np.asarray(square / (1.0 + np.sqrt(np.maximum(1.0 - square, 0.0))))


def shallow_gap(law: Law, edge: EssentialEdge) -> SpectralGap | None:
    r"""The gap of a law of shallow walls with a small relative error; None for other laws or if the method fails.

    Parameters
    ----------
    law : Law
        A reversible law of walls that are graphs with slopes below 0.1, of circular arcs, specular reflection, or sums
        of these, in the paper's convention or, if mirror-symmetric, in the specular one.
    edge : EssentialEdge
        The essential edge of the same law.

    Notes
    -----
    A ray steeper than three times the steepest slope s meets the wall once. If the slope is phi there, theta'_F =
    pi - theta' = theta - 2 phi; the flux weighs slopes with 1 - tan(phi) cot(theta). So

        <f, (1 - P_F) f> = 1/2 E (f(theta'_F) - f(theta))^2,  cos(theta'_F) - cos(theta) = 2 sin(theta - phi) sin(phi),

    is a sum of squares of small numbers with full relative accuracy: the difference of two values of a polynomial is
    its divided difference times the difference of the cosines. Less steep rays, a fraction of 9 s^2/2, stay within 5 s
    of grazing. Their part of the form is at most 1/2 |f'|^2 (25 s^2/2)^2 times this fraction. In the paper's convention
    P~ f = P_F f for even f, and the eigenvalues of odd functions are near -1.

    The smallest value mu of the form on Legendre polynomials is an upper bound of the gap. Its excess over the gap is
    estimated from the residual R = (1 - P) f - mu f by <R, (1 - P - mu)^(-1) R>. The part of steep rays uses the
    distance to the next eigenvalue; the part of grazing rays, which is localised, uses the damping of oscillations of
    its scale. Fast oscillations cos(t theta) are multiplied by E exp(2 i t phi); that their quotients are larger than
    the gap is an estimate, not a proof.

    If sin(phi) is uniform, as on arcs of circles, the gap is 4 E sin^2 + 2 E sin^4 with a relative error of order
    s^4 ln s.

    Source: R. Feres and H.-K. Zhang, *The spectrum of the billiard Laplacian of a family of random billiards* (2010),
    for the leading order.
    """
    if not law.reversible:
        return None
    slopes = slopes_of(law)
    if slopes is None or not 0.0 < slopes.steepest <= STEEPEST or slopes.least_turn < LEAST_TURN * slopes.steepest:
        return None
    parities = (1, 0) if law.frame == "specular" else (0,)
    found = min((_Form(slopes, parity, bool(law.mirror_symmetric)) for parity in parities), key=lambda form: form.value)
    slowest = found.first_degree + FASTER
    shrunk = float(slopes.shrinkage(_frequencies(slopes, slowest)).min())
    error = found.error
    beyond = 1.0 - edge.high > found.value + error
    if error > LARGEST_ERROR * found.value or not beyond or shrunk < APART * found.value:
        return None
    evidence = (
        *edge.reasons,
        f"rays steeper than {ONCE * slopes.steepest:.3g} meet the wall once, its slopes have a mean square of "
        f"{slopes.mean_square:.6g}; what the others can change: {found.grazing_error:.2g}",
        f"polynomials of degree {DEGREES} may miss {found.missed:.2g}",
        f"cos(t theta) with t above {slowest:g} shrinks by {shrunk:.3g} or more, {shrunk / found.value:.3g} of the gap",
    )
    method = f"1 - lambda from E (f(theta') - f(theta))^2, Legendre polynomials up to degree {DEGREES}"
    return SpectralGap(found.value, error, "estimate", method, "isolated", evidence, law.frame)


class _Form:
    """The smallest value of the quadratic form on polynomials of one parity, and its error as the gap."""

    def __init__(self, slopes: Slopes, parity: int, mirrored: bool) -> None:
        from scipy.linalg import eigh

        steep = slopes.steepest
        degrees = np.arange(1, DEGREES + 1)
        own = degrees % 2 == parity
        self.first_degree = int(degrees[own][0])
        theta, weight = gauss_rule(np.linspace(ONCE * steep, np.pi - ONCE * steep, ANGLE_PANELS + 1), ANGLE_NODES)
        size = (theta.size, DEGREES)
        form, drift = np.zeros((DEGREES, DEGREES)), np.zeros(size)
        for k, angle in enumerate(theta.tolist()):
            change = _changes(angle, slopes.angle)
            # 1 - tan(phi) cot(theta), and with the measure sin(theta)/2
            flux = slopes.weight * np.sin(angle - slopes.angle) / (np.cos(slopes.angle) * np.sin(angle))
            form += 0.25 * weight[k] * np.sin(angle) * (change * flux[:, None]).T @ change
            drift[k] = flux @ change
        values, vectors = eigh(form[np.ix_(own, own)])
        self.value = float(values[0])
        vector = np.zeros(DEGREES)
        vector[own] = vectors[:, 0]
        here = _polynomials(theta) @ vector
        residual = -(drift @ vector) - self.value * here
        mass = 0.5 * weight * np.sin(theta)
        alike = 0.5 * (residual + (-1.0) ** parity * residual[::-1])
        other = residual - alike
        norms = np.sqrt(2.0 * degrees + 1.0)
        height, steepness = (
            float(np.abs(vector) @ norms),
            float(np.abs(vector) @ (norms * degrees * (degrees + 1) / 2.0)),
        )
        # grazing rays: their fraction of the flux, and the change of their cosine
        fraction, moved = 2.0 * np.sin(0.5 * ONCE * steep) ** 2, 2.0 * np.sin(0.5 * WITHIN * steep) ** 2
        self.grazing_error = 0.5 * fraction * (steepness * moved) ** 2
        local = float(slopes.shrinkage(_frequencies(slopes, 1.0 / (ONCE * steep))).min())
        # the residual of grazing rays, on oscillations of their scale and on slow functions
        spread = 1.0 / local + 1.5 * fraction * np.log(1.0 / (ONCE * steep)) / slopes.mean_square
        grazing = fraction * (steepness * moved + self.value * height) ** 2
        steeper = float(mass @ alike**2) / float(values[1] - values[0]) + (0.0 if mirrored else float(mass @ other**2))
        self.missed = 2.0 * (grazing * spread + steeper)

    @property
    def error(self) -> float:
        """Error of the value as the gap."""
        return float(self.grazing_error + self.missed + ROUNDING * self.value)


def _changes(angle: float, slope: Floats) -> Floats:
    """e_l(theta'_F) - e_l(theta) for l = 1, ..., DEGREES, shape (slopes, degrees)."""
    here, there = np.cos(angle), np.cos(angle - 2.0 * slope)
    found = np.empty((slope.size, DEGREES))
    before, value = 1.0, here
    # divided differences by the recurrence of Legendre polynomials
    previous, divided = np.zeros(slope.size), np.ones(slope.size)
    for degree in range(1, DEGREES + 1):
        found[:, degree - 1] = np.sqrt(2.0 * degree + 1.0) * divided
        step = (2 * degree + 1) * (there * divided + value) - degree * previous
        previous, divided = divided, step / (degree + 1)
        before, value = value, ((2 * degree + 1) * here * value - degree * before) / (degree + 1)
    return found * (2.0 * np.sin(angle - slope) * np.sin(slope))[:, None]


def _polynomials(angle: Floats) -> Floats:
    from numpy.polynomial.legendre import legvander

    return np.asarray((legvander(np.cos(angle), DEGREES) * np.sqrt(2.0 * np.arange(DEGREES + 1) + 1.0))[:, 1:])


def _frequencies(slopes: Slopes, slowest: float) -> Floats:
    fastest = TURNS / min(slopes.least_turn, 2.0 * slopes.steepest)
    if fastest <= slowest:
        return np.array([slowest])
    # low frequencies in equal ratios, high ones in equal steps
    step = STEP / slopes.steepest
    return np.concatenate([np.geomspace(slowest, fastest, 200), np.arange(slowest, fastest, step)])


@singledispatch
def slopes_of(law: Law) -> Slopes | None:
    """The slopes of a law of shallow walls, whose rays meet them once unless they graze; None for other laws."""
    return Slopes(np.zeros(1), np.ones(1), 0.0, np.inf) if law.retro is False else None


@slopes_of.register(SpecularFrame)
def _(law: SpecularFrame) -> Slopes | None:
    return slopes_of(law.law)


@slopes_of.register(Combination)
def _(law: Combination) -> Slopes | None:
    parts = [(weight, slopes_of(term)) for weight, term in law.parts]
    known = [(weight, part) for weight, part in parts if part is not None]
    if len(known) < len(parts):
        return None
    return Slopes(
        np.concatenate([part.angle for _, part in known]),
        np.concatenate([weight * part.weight for weight, part in known]),
        max(part.steepest for _, part in known),
        min(part.least_turn for _, part in known),
    )


@slopes_of.register(CircularArcLaw)
def _(law: CircularArcLaw) -> Slopes | None:
    return _slopes_of_wall(focusing_arcs(law.half_angle)) if law.half_angle <= STEEPEST else None


@slopes_of.register(WallLaw)
@slopes_of.register(PolygonLaw)
def _(law: WallLaw | PolygonLaw) -> Slopes | None:
    return _slopes_of_wall(law.wall)


def _slopes_of_wall(wall: Wall) -> Slopes | None:
    """The slopes of a wall, or None unless it is a graph with small slopes."""
    if not wall.closes or sum(not piece.is_straight for piece in wall.cell.pieces) > MOST_CURVED:
        return None
    angles, weights, turns = [], [], [np.inf]
    for piece in wall.cell.pieces:
        if piece.is_straight:
            angle, weight = _angles(piece, np.zeros(1)), np.array([piece.end[0] - piece.start[0]])
        else:
            angle, weight = _slopes_of_curve(piece)
            turns.append(float(np.ptp(angle)))
        if np.any(np.abs(angle) > STEEPEST) or np.any(weight < 0.0):
            return None
        angles.append(angle)
        weights.append(weight / wall.period)
    angle, weight = np.concatenate(angles), np.concatenate(weights)
    return Slopes(angle, weight, float(np.abs(angle).max()), min(turns))


def _slopes_of_curve(piece: Curve) -> tuple[Floats, Floats]:
    """Slopes, with dx as weight, at the nodes of Gauss rules in the parameter, and with weight 0 at panel ends."""
    edges = np.linspace(0.0, 1.0, PANELS + 1)
    parameter, width = gauss_on_intervals(edges[:-1], edges[1:], NODES)
    x = piece.point(parameter)[:, 0].reshape(PANELS, NODES)
    ends = piece.point(edges)[:, 0]
    # dx/ds of the interpolating polynomials of the panels
    nodes = np.polynomial.legendre.leggauss(NODES)[0]
    through = np.linalg.inv(np.polynomial.legendre.legvander(nodes, NODES - 1))
    rise = np.polynomial.legendre.legvander(nodes, NODES - 2) @ np.polynomial.legendre.legder(through)
    speed = (x - ends[:-1, None]) @ rise.T * (2.0 * PANELS)
    weight = speed * width.reshape(PANELS, NODES)
    weight *= (np.diff(ends) / weight.sum(axis=1))[:, None]
    return np.append(_angles(piece, parameter), _angles(piece, edges)), np.append(weight.ravel(), np.zeros(edges.size))


def _angles(piece: Curve, parameter: Floats) -> Floats:
    tangent = piece.tangent(parameter)
    return np.asarray(np.arctan2(tangent[..., 1], tangent[..., 0]))
