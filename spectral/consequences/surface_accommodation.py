"""Momentum accommodation of surfaces rough in two directions: averages, the tensor, and by incidence and azimuth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import islice

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, finite_array, frozen, new_seed
from ...core.errors import AccuracyError, InputError
from ...core.estimates import FEW, Estimate, student_95, with_error
from ...kernels import SurfaceLaw
from ...kernels.hemisphere.surface_law import turned
from ...kernels.sampling.sobol import PARTS, random_shifts, shifted_points, sobol_sequence
from ...kernels.walls.conditionals import UNRESOLVED_TOLERANCE
from .grooves_accommodation import SpaceAccommodation, nearest_maxwell

# Rays of each sequence of a pilot run, at most for averages, at most for one incoming velocity, and in a chunk.
PILOT, MOST, MOST_AT, CHUNK = 2**12, 2**17, 2**14, 2**15
# Mean normal velocity of the cosine law; its distance from that of a ray divides the normal coefficient.
MEAN_NORMAL, POLE = 2.0 / 3.0, 1e-9
# Of a mean of 10^6 numbers of at most 1, as `numpy.sum` adds them.
ROUNDING = 1e-12
HOW = f"spread of {PARTS} scrambled Sobol sequences of rays"


@dataclass(frozen=True, repr=False)
class SurfaceAccommodation(SpaceAccommodation):
    r"""How far particles that a surface reflects forget the momentum with which they came.

    Attributes
    ----------
    tangential, normal, maxwell_fraction : Estimate
        As of `SpaceAccommodation`: averages over incoming velocities of the cosine law.
    tensor : array of shape (2, 2)
        delta_ab - E v_a v_b'/E v_a^2 in the axes of the wall, symmetric; its mean diagonal is ``tangential``. With a
        random orientation it is a multiple of 1.
    tensor_errors : array of shape (2, 2)
        Half widths of intervals of 95 %, as are all errors here.
    incidence_deg, azimuth_deg : array of shape (n,)
        Directions at which coefficients were asked for, in degrees: the angle from the normal, and that of the
        incoming tangential velocity from the wall's x axis.
    tangential_at, normal_at, sideways_at : array of shape (n,)
        1 - E v_t'.t/v_t.t with the direction t of the incoming tangential velocity, nan at normal incidence;
        (v_n - E v_n')/(v_n - 2/3) with v_n > 0; and the mean outgoing velocity to the left of t, in units of the speed,
        which vanishes for surfaces with a mirror image among their turns only.
    tangential_errors, normal_errors, sideways_errors : array of shape (n,)
    """

    tensor: Floats
    tensor_errors: Floats
    incidence_deg: Floats
    azimuth_deg: Floats
    tangential_at: Floats
    tangential_errors: Floats
    normal_at: Floats
    normal_errors: Floats
    sideways_at: Floats
    sideways_errors: Floats
    _show = "tangential normal maxwell_fraction"
    _unit = "coefficients are ratios; sideways momentum in units of the speed"
    _more = ".tensor, .tensor_errors, .tangential_at, .normal_at, .sideways_at"

    def _facts(self) -> dict[str, object]:
        return {**super()._facts(), **dict(islice(self.by_angle().items(), FEW))}

    def by_angle(self) -> dict[str, str]:
        """The coefficients in words, by the angle from the normal and the azimuth."""
        names, found = ("tangential", "normal", "sideways"), {}
        for zenith, azimuth, *pairs in zip(
            self.incidence_deg, self.azimuth_deg, *(
                zip(getattr(self, f"{name}_at"), getattr(self, f"{name}_errors"), strict=True) for name in names
            ), strict=True,
        ):  # fmt: skip
            words = [with_error(*map(float, one)) if np.isfinite(one[1]) else "not defined" for one in pairs]
            found[f"at {zenith:.6g}, {azimuth:.6g} degrees"] = ", ".join(map(" ".join, zip(names, words, strict=True)))
        return found


def of_surface(
    law: SurfaceLaw, tolerance: float, incidence: ArrayLike | None, azimuth: ArrayLike | None, rng: np.random.Generator
) -> SurfaceAccommodation:
    """The coefficients of one surface, at incoming directions in degrees too."""
    directions = _directions(incidence, azimuth)
    means, errors = _to_tolerance(4, lambda points: _products(law, points), tolerance, MOST, rng)
    (xx, yy, xy, along), wide = 4.0 * means[:4], 4.0 * errors[:4]
    tangential = Estimate(1.0 - along, wide[3], "estimate", HOW)
    normal = Estimate(1.0 - 18.0 * means[4], 18.0 * errors[4], "estimate", HOW)
    each = [_at(law, float(zenith), float(turn), tolerance, rng) for zenith, turn in np.radians(directions)]
    at, wrong_at = (np.array([[pair[k] for pair in one] for one in each]).reshape(-1, 3).T for k in (0, 1))
    return SurfaceAccommodation(
        tangential, normal, nearest_maxwell(tangential, normal), frozen([[1.0 - xx, -xy], [-xy, 1.0 - yy]]),
        frozen([[wide[0], wide[2]], [wide[2], wide[1]]]), frozen(directions[:, 0]), frozen(directions[:, 1]),
        frozen(at[0]), frozen(wrong_at[0]), frozen(at[1]), frozen(wrong_at[1]), frozen(at[2]), frozen(wrong_at[2]),
    )  # fmt: skip


def _directions(incidence: ArrayLike | None, azimuth: ArrayLike | None) -> Floats:
    """Pairs of degrees from the normal and from the x axis, shape (n, 2)."""
    if incidence is None:
        if azimuth is not None:
            raise InputError("azimuth_deg: expected incidence_deg beside it, got none")
        return np.empty((0, 2))
    zenith, turn = (
        finite_array("incidence_deg", incidence),
        finite_array("azimuth_deg", 0.0 if azimuth is None else azimuth),
    )
    bad = (zenith < 0.0) | (zenith >= 90.0)
    if bad.any():
        raise InputError(f"incidence_deg: expected degrees from the normal, in [0, 90), got {float(zenith[bad][0])!r}")
    pole = np.abs(np.cos(np.radians(zenith)) - MEAN_NORMAL) < POLE
    if pole.any():
        raise InputError(
            "incidence_deg: expected angles other than 48.19 degrees, where the normal momentum is the accommodated "
            f"one by any law, got {float(zenith[pole][0])!r}; take one beside it"
        )
    try:
        return np.stack([one.ravel() for one in np.broadcast_arrays(zenith, turn)], axis=-1)
    except ValueError as reason:
        raise InputError(
            f"azimuth_deg: expected a shape that broadcasts with {zenith.shape} of incidence_deg, got {turn.shape}"
        ) from reason


def _products(law: SurfaceLaw, points: Floats) -> Floats:
    """Products of incoming and outgoing components of rays of the cosine law, each in both directions."""
    incoming, outgoing, escaped = law.random_map()(points)
    if law.orientation == "random":
        along = 0.5 * np.sum(incoming[:, :2] * outgoing[:, :2], axis=1)
        xx, yy, xy = along, along, np.zeros_like(along)
    else:
        (x, y), (u, v) = (turned(one[:, :2], float(law.orientation)).T for one in (incoming, outgoing))
        xx, yy, xy = x * u, y * v, 0.5 * (x * v + y * u)
    # about the known means, whose error is then left out
    normal = (-incoming[:, 2] - MEAN_NORMAL) * (outgoing[:, 2] - MEAN_NORMAL)
    return np.column_stack([xx, yy, xy, 0.5 * (xx + yy), normal, ~escaped])


def _at(
    law: SurfaceLaw, zenith: float, azimuth: float, tolerance: float, rng: np.random.Generator
) -> list[tuple[float, float]]:
    """Tangential and normal coefficient and sideways velocity, each with its error, of one incoming velocity."""
    along = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    velocity = np.sin(zenith) * along - [0.0, 0.0, np.cos(zenith)]
    is_random = law.orientation == "random"

    def momenta(points: Floats) -> Floats:
        angle = 2.0 * np.pi * points[:, -1] if is_random else np.full(len(points), float(law.orientation))
        own = turned(np.broadcast_to(velocity, (len(points), 3)), -angle)
        outgoing, escaped = law.exit_velocities(points[:, :2], own)
        out = turned(outgoing, angle)
        left = np.array([-along[1], along[0], 0.0])
        return np.column_stack([out @ along, out[:, 2], out @ left, ~escaped])

    means, errors = _to_tolerance(3 if is_random else 2, momenta, tolerance, MOST_AT, rng)
    down, size = np.cos(zenith), np.sin(zenith)
    tangential = (1.0 - means[0] / size, errors[0] / size) if size > POLE else (np.nan, np.inf)
    normal = (down - means[1]) / (down - MEAN_NORMAL), errors[1] / abs(down - MEAN_NORMAL)
    return [tangential, normal, (means[2], errors[2])]


def _to_tolerance(
    dimension: int, values: Callable[[Floats], Floats], tolerance: float, most: int, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """Means of functions of uniform numbers and their errors, from as many points as should meet the tolerance.

    The last function marks rays that did not escape.
    """
    means, errors = _means(dimension, values, PILOT, rng)
    excess = float(errors.max()) / tolerance
    # a pilot run that meets the tolerance by chance would not be believed as often as it claims
    if excess > 0.5:
        each = min(2.0 * PILOT * max(excess, 1.0) ** 2, float(most))
        means, errors = _means(dimension, values, 1 << int(np.ceil(np.log2(each))), rng)
    if means[-1] > UNRESOLVED_TOLERANCE:
        raise AccuracyError(
            f"surface: {means[-1]:.2g} of the rays did not escape, more than {UNRESOLVED_TOLERANCE:g}; "
            "surface.trace(points, velocities).counts() says how they ended",
            float(means[-1]),
        )
    # a ray that did not escape may be wrong by 2
    return means[:-1], errors[:-1] + 2.0 * means[-1] + ROUNDING


def _means(
    dimension: int, values: Callable[[Floats], Floats], each: int, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """Means over eight shifted Sobol sequences, with half widths of 95 % by Student's distribution."""
    seed = new_seed(rng)
    sequence, shifts = sobol_sequence(seed, 0, dimension), random_shifts(seed, dimension)
    sums: list[Floats] = []
    for start in range(0, each, CHUNK):
        points = shifted_points(sequence, min(CHUNK, each - start), *shifts)
        sums.append(np.array([values(part).sum(axis=0) for part in points]))
    parts = np.sum(sums, axis=0) / each
    return parts.mean(axis=0), student_95(PARTS) * parts.std(axis=0, ddof=1) / np.sqrt(PARTS)
