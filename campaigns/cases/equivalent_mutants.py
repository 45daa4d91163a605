"""Mutants of the ledger's formulas that say the same as the formula: `campaigns.ledger_mutants` finds and names them.

Every other mutant is to be refused. There is no third kind: where a bound is weaker than it could be, its row says by
how much and checks that, so that a weaker bound is refused like a false one.
"""

from __future__ import annotations

_EVEN_MODULUS = "the remainder by -2 is 0 where that by 2 is"
_PERIODS = "j and k run over all whole numbers, and so the set of the periods is the same"
_SQUARED = "the changed sign is squared"
_SIDES = "a condition that two sides are equal, and both change alike: f and g plus a constant are functions too"
_ZERO = "0 times anything"
_NORMAL = "reflection is even in the normal"

# (row, mutant) -> why it is equivalent
EQUIVALENT = {
    ("S1.08", "formula: (u - 0.5) % 1.0"): "the same map, by the periodicity of the remainder",
    ("S1.08", "formula: (u + 1.5) % 1.0"): "the same map, by the periodicity of the remainder",
    ("S1.08", "formula: (u + -0.5) % 1.0"): "the same map, by the periodicity of the remainder",
    ("S2.04", "teeth.outgoing_angles: even = hits % -2 == 0"): _EVEN_MODULUS,
    (
        "S2.09",
        "formula: eps / (2 * xp.tan(xi)) - xp.sqrt((eps / (-2 * xp.sin(xi))) ** 2 - (x - eps / 2) ** 2)",
    ): _SQUARED,
    ("S4.01", "argument 1 moved"): _PERIODS,
    ("S4.01", "argument 2 moved"): _PERIODS,
    ("S4.01", "result negated"): _PERIODS,
    ("S4.01", "result 1 negated"): _PERIODS,
    ("S4.01", "result 2 negated"): _PERIODS,
    ("S4.15", "formula: np.sqrt(m) * (rolling.slip(rho / 2) + rolling.rise(rho / -2))"): "1 - cos is even",
    ("S5.06", "result negated"): "k runs over all whole numbers, and so the set of the translations is the same",
    ("S5.08", "argument 2 moved"): _SIDES,
    ("S5.08", "argument 3 moved"): _SIDES,
    ("S5.08", "result moved"): _SIDES,
    ("S5.08", "result negated"): _SIDES,
    ("S5.12", "argument 1 moved"): _ZERO,
    ("S5.12", "result negated"): _ZERO,
    ("S5.20", "result negated"): "the sine of the angle to a line, which has no sense of direction",
    ("S6.01", "billiard_maps._normal: gradient = q / AXES ** 2"): _NORMAL,
}

_FEWER_DIGITS = "the same number with fewer digits: tests/geometry/disk/test_charts.py looks at the digits"
_SERIES = "angle * square / 6.0 * series, angle - np.sin(angle))"
_GUARD = "a bound that holds by itself in exact arithmetic and guards against rounding"
_UNFOLDED, _CLIPPED = "polygons.TriangularTeethLaw._unfolded: return", "(right, base, np.clip(count, np."

# change of a function of the library -> why no row can notice it
EQUIVALENT_IN_THE_LIBRARY = {
    "rolling.rise: return 2 * xp.sin(angle / -2) ** 2": _SQUARED,
    "rolling.slip: (xp is not np) | True": _FEWER_DIGITS,
    f"rolling.slip: return np.where((np.abs(angle) < SERIES_ANGLE) & False, {_SERIES}": _FEWER_DIGITS,
    f"{_UNFOLDED} {_CLIPPED}minimum(most - 1.0, 1.0), most))": _GUARD,
    f"{_UNFOLDED} {_CLIPPED}maximum(most - 2.0, 1.0), most))": _GUARD,
    f"{_UNFOLDED} {_CLIPPED}maximum(most - 1.0, -1.0), most))": _GUARD,
    "polygons.TriangularTeethLaw._most_hits: return np.maximum(np.ceil(2.0 * theta / self.angle), -1.0)": _GUARD,
    "polygons.TriangularTeethLaw._reflected: return np.where(np.mod(count, -2.0) == 0.0, np.pi + theta - turn, "
    "turn - theta)": _EVEN_MODULUS,
    "circular_arc.CircularArcLaw._rotation: return (right, base, chord, np.maximum(np.ceil((self.half_angle + base "
    "- chord) / (2.0 * chord)), -1.0))": _GUARD,
}
