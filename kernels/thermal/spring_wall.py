"""A flat wall on a spring at temperature T: a random reflection that exchanges energy with the particle."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, Rng, generator, number_between, positive_number, shaped, whole_number
from ...core.errors import AccuracyError, InputError
from ...core.estimates import NORMAL_95, Estimate
from ...core.given import seed_by_name
from ...core.rounding import EPS
from ..matrices.defects import SymmetryDefect, defect_of_pairs

# A contact is found when the distance of plate and particle is this many roundings of the size of the motion.
CONTACT = 16.0 * EPS
# Steps of the search for contacts at most; a collision takes a few dozen unless the plate is much lighter.
MOST_STEPS = 100_000
# Cells of equal measure, in the test of detailed balance.
CELLS = 12
# Draws of a Gaussian position above the level y = 0 that are repeated at most; depth 0 rejects one in two.
MOST_DRAWS = 200
OVERFLOW = "choose units in which they are moderate"


@dataclass(frozen=True)
class SpringWall:
    r"""A plate of mass M on a spring, which moves along y below the level y = 0 and is in equilibrium at temperature T.

    A particle of mass m enters at y = 0 with velocity (v1, v2), v2 < 0. The plate, at z < 0, swings about y = -depth
    with the given frequency. Particle and plate collide elastically, as often as they meet, until the particle leaves
    through y = 0; v1 is unchanged. The state of the plate at the entry is drawn from its Gibbs measure on z < 0. Then
    the law of the outgoing velocity satisfies detailed balance with the flux of Maxwell's distribution, of density
    v2 exp(-m <v, v>/(2T)), exactly.

    Parameters
    ----------
    mass_ratio : float
        m/M, greater than 0.
    temperature : float
        T, with Boltzmann's constant 1, at least 0; the mass of the particle is 1.
    frequency : float
        Angular frequency of the spring, greater than 0.
    depth : float
        Distance of the plate's rest position below y = 0, at least 0; greater than 0 if T = 0.

    Raises
    ------
    InputError
        If a number is out of range, or the motion of the plate overflows.

    Notes
    -----
    Detailed balance: the flow of plate and particle in y < 0 preserves the Liouville measure and is reversible. Its
    return map to y = 0 preserves abs(v2) dv dz dw exp(-H/T), and reversing velocities inverts it. Source: S. Cook and
    R. Feres, "Random billiards with wall temperature and associated Markov chains", Nonlinearity 25 (2012); cited in
    Rudzis 2022, section 1.2.6.

    Examples
    --------
    A plate at rest, of the mass of the particle, takes over its velocity, swings for half a period and gives it back:

    >>> wall = SpringWall(mass_ratio=1.0, temperature=0.0)
    >>> wall.sample([[3.0, -2.0]], rng=0).round(12).tolist()
    [[3.0, 2.0]]
    """

    mass_ratio: float
    temperature: float
    frequency: float = 1.0
    depth: float = 1.0

    def __post_init__(self) -> None:
        for name, closed in (("mass_ratio", ""), ("frequency", ""), ("temperature", "low"), ("depth", "low")):
            value = number_between(name, getattr(self, name), 0.0, math.inf, closed=closed)
            object.__setattr__(self, name, value)
        if self.temperature == 0.0 and self.depth == 0.0:
            raise InputError("depth: expected a number greater than 0 for a plate at rest, got 0")
        swing = self.depth + math.sqrt(self.temperature * self.mass_ratio) / self.frequency
        if not math.isfinite(self.frequency * self.frequency * swing):
            raise InputError(f"expected numbers for which the plate's acceleration is finite, got {self}; {OVERFLOW}")

    # ---- sampling --------------------------------------------------------------------------------------------
    @seed_by_name
    def sample(self, velocity: ArrayLike, rng: Rng = None) -> Floats:
        """Draw an outgoing velocity (n, 2) with v2 > 0 for every incoming one with v2 < 0.

        Raises
        ------
        InputError
            If the shape is wrong, some v2 is not negative, or the motion overflows.
        AccuracyError
            If a particle has not left after 10^5 steps.
        """
        incoming = shaped("velocity", velocity, "n", 2)
        if not np.all(incoming[:, 1] < 0.0):
            raise InputError(f"velocity: expected v2 < 0, got {float(incoming[:, 1].max())!r}")
        outgoing = incoming.copy()
        try:
            with np.errstate(over="raise", invalid="raise"):
                position, pace = self._plate(len(incoming), generator(rng))
                outgoing[:, 1] = self._return(incoming[:, 1].copy(), position, pace)
        except FloatingPointError as reason:
            fastest = float(np.abs(incoming[:, 1]).max())
            raise InputError(f"velocity: {reason} for a speed of {fastest:g} against {self}; {OVERFLOW}") from reason
        return outgoing

    def equilibrium(self, n: int, rng: Rng = None, temperature: float | None = None) -> Floats:
        """Draw incoming velocities (n, 2) from the flux of Maxwell's distribution, by default at the wall's T."""
        whole_number("n", n, 1)
        hot = self.temperature if temperature is None else temperature
        width = math.sqrt(positive_number("temperature", hot))
        source = generator(rng)
        return np.stack([width * source.standard_normal(n), -width * source.rayleigh(1.0, n)], axis=1)

    def _plate(self, n: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
        """Displacement from rest and velocity of the plate at the entry: Gibbs, with the plate below y = 0."""
        spread = math.sqrt(self.temperature * self.mass_ratio)
        pace, width = spread * rng.standard_normal(n), spread / self.frequency
        position = width * rng.standard_normal(n)
        for _ in range(MOST_DRAWS):
            above = np.flatnonzero(position >= self.depth)
            if not above.size:
                return position, pace
            position[above] = width * rng.standard_normal(above.size)
        raise AccuracyError("the plate is above y = 0 in all draws", above.size / n)

    def _return(self, v: Floats, position: Floats, pace: Floats) -> Floats:
        """Outgoing v2; positions are measured from the plate's rest position.

        The gap g between particle and plate satisfies g(t + h) >= g + g' h - K h^2/2, with K the largest acceleration
        of the plate. A step to the first zero of the right side passes no contact. The steps converge quadratically.
        """
        y = np.full(v.shape, self.depth)
        ratio = self.mass_ratio
        out, going = np.empty(v.shape), np.arange(v.size)
        for _ in range(MOST_STEPS):
            gap, closing = y - position, v - pace
            size = np.hypot(position, pace / self.frequency)
            touch = (gap <= CONTACT * (np.abs(y) + size + self.depth)) & (closing < 0.0)
            v, pace = (
                np.where(touch, ((ratio - 1.0) * v + 2.0 * pace) / (1.0 + ratio), v),
                np.where(touch, ((1.0 - ratio) * pace + 2.0 * ratio * v) / (1.0 + ratio), pace),
            )
            closing = v - pace
            strongest = self.frequency * self.frequency * np.hypot(position, pace / self.frequency)
            step = _safe_step(np.maximum(gap, 0.0), closing, strongest)
            with np.errstate(divide="ignore"):
                exit_time = np.where(v > 0.0, (self.depth - y) / v, np.inf)
            leaves = exit_time <= step
            out[going[leaves]] = v[leaves]
            stays = ~leaves
            if not stays.any():
                return out
            going, step = going[stays], step[stays]
            y = y[stays] + v[stays] * step
            turn = self.frequency * step
            position, pace = (
                position[stays] * np.cos(turn) + pace[stays] / self.frequency * np.sin(turn),
                pace[stays] * np.cos(turn) - self.frequency * position[stays] * np.sin(turn),
            )
            v = v[stays]
        raise AccuracyError(f"{going.size} particles have not left after {MOST_STEPS} steps", going.size / out.size)

    # ---- measured properties ---------------------------------------------------------------------------------
    def symmetry_defect(self, n: int = 100_000, rng: Rng = None) -> SymmetryDefect:
        """How far the law is from detailed balance with Maxwell's distribution, from ``n`` reflections.

        Pairs (incoming v2, outgoing v2) are counted in cells of equal measure under the flux of Maxwell's distribution.
        The z-score compares the asymmetry of the counts with chance.
        """
        before = self.equilibrium(whole_number("n", n, CELLS**2), rng := generator(rng))
        after = self.sample(before, rng)
        first, second = (np.exp(-0.5 * v * v / self.temperature) * CELLS for v in (before[:, 1], after[:, 1]))
        return defect_of_pairs(first, second, CELLS)

    def energy_accommodation(self, gas_temperature: float, n: int = 100_000, rng: Rng = None) -> Estimate:
        """The coefficient (E_in - E_out)/(E_in - T) of the energy of motion along y, for a gas at another temperature.

        It is 0 if no energy is exchanged and 1 if the particles leave with the temperature of the wall.
        """
        hot = positive_number("gas_temperature", gas_temperature)
        if hot == self.temperature:
            raise InputError("gas_temperature: expected one that differs from the wall's temperature")
        whole_number("n", n, 100)
        source = generator(rng)
        before = self.equilibrium(n, source, hot)
        after = self.sample(before, source)
        energy = 0.5 * (before[:, 1] ** 2 - after[:, 1] ** 2) / (hot - self.temperature)
        error = NORMAL_95 * float(energy.std(ddof=1)) / math.sqrt(n)
        return Estimate(float(energy.mean()), error, "estimate", f"{n} reflections")


def _safe_step(gap: Floats, closing: Floats, strongest: Floats) -> Floats:
    """The first zero h > 0 of gap + closing h - strongest h^2/2, without cancellation; inf if there is none."""
    root = np.sqrt(closing * closing + 2.0 * strongest * gap)
    with np.errstate(divide="ignore", invalid="ignore"):
        away = np.where(strongest > 0.0, (closing + root) / strongest, np.inf)
        near = 2.0 * gap / (root - closing)
    return np.where(closing < 0.0, near, away)
