"""Fractions of the particles by their number of bounces, and of those that are reflected exactly specularly."""

from __future__ import annotations

from functools import partial
from typing import overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, Rng, generator, instance, whole_number
from ...core.errors import InputError
from ...core.estimates import ErrorKind, Estimate, fraction_estimate, mean_of_strata
from ...core.rounding import EPS
from ...geometry import Wall, trace
from ...geometry.cells.hollow_shape import distinct_hollows
from ...geometry.polygons.beams import Beams, beams_of
from ...kernels import SINE, Bins, CircularArcLaw, Law, WallLaw
from ...kernels.laws.isometry_table import SAME_OFFSET, IsometryTable
from ...kernels.laws.law import Composition, RandomMap, specular
from ...kernels.laws.structure import law_of, words_of
from ...kernels.walls.rectangular import FIRST_CROSSING, crevice_nodes, crevice_pieces
from .channel import in_paper_frame
from .momentum_accommodation import incoming_angles

# Rays at each angle, or of all angles for an average.
RAYS = 2**16
# Traced rays this close to specular reflection hit straight pieces only; by curved pieces so many are there by chance.
CLOSE = 1e-9
# Rays at normal incidence, where retroreflection is specular, come so much beside it, radians.
BESIDE = 1e-6


def bounce_shares(
    wall: Wall, incidence_deg: ArrayLike, most: int = 4, rng: Rng = None
) -> tuple[tuple[Estimate, ...], ...]:
    r"""The fractions of the particles that a wall reflects with 1, 2, ... bounces, by angle of incidence.

    Parameters
    ----------
    wall : Wall
    incidence_deg : array_like
        Degrees from the normal, in (-90, 90); positive ones come from the right, theta = 90 degrees less this angle.
    most : int
        The largest number of bounces that has a fraction of its own.
    rng : None, int or numpy.random.Generator
        For walls that are traced; ``np.random.default_rng(0)`` by default, so that results repeat.

    Returns
    -------
    tuple of tuples of Estimate
        One tuple for each angle: the fractions with 1, 2, ..., ``most`` bounces, and with more. A flat top counts as
        one bounce.

    Raises
    ------
    InputError
        If an angle is not in (-90, 90) or ``most`` is no whole number of at least 1.

    Notes
    -----
    Of walls of straight pieces without islands the fractions are sums over beams of equal itinerary, and errors are
    bounds: rounding, and beams that are not resolved. Of other walls, and where these bounds are larger, 65,536 rays in
    equal strata are traced at each angle. A number of bounces that none of them has is not excluded: its fraction is
    below 3/65,536 with a confidence of 95 %.

    Of symmetric V-grooves the single bounces are Torrance and Sparrow's geometric attenuation; see the test.

    Source: K. Torrance and E. Sparrow, Journal of the Optical Society of America 57 (1967) 1105, in two dimensions.

    Examples
    --------
    In right-angled grooves a particle bounces once or twice, and once where it comes more obliquely than the sides:

    >>> from asperity import geometry as geo, spectral as spec
    >>> for row in spec.bounce_shares(geo.triangular_teeth(1.5707963267948966), [0, 30, 60], most=2):
    ...     print(*(f"{fraction:.6f}" for fraction in row))
    0.000000 1.000000 0.000000
    0.577350 0.422650 0.000000
    1.000000 0.000000 0.000000
    """
    instance("wall", wall, Wall, "geo.triangular_teeth(0.7)")
    most, source, theta = whole_number("most", most, 1), generator(rng, 0), incoming_angles(incidence_deg)
    exact = _of_beams(wall.cell, theta, most) if wall.is_polygonal and wall.closes else [()] * theta.size
    return tuple(
        row if row and max(one.error for one in row) <= 1.0 / RAYS else _of_rays(wall, angle, most, source, row)
        for row, angle in zip(exact, theta.tolist(), strict=True)
    )


def _of_beams(cell: Wall, theta: Floats, most: int) -> list[tuple[Estimate, ...]]:
    """The fractions of a wall of straight pieces that is its own cell."""
    fractions, errors = np.zeros((theta.size, most + 1)), np.zeros((theta.size, most + 1))
    fractions[:, 0] = cell.flat_top / cell.period
    for shape, hollows in distinct_hollows(cell):
        width = sum(hollow.width for hollow in hollows) / cell.period
        ratio = shape.height_to_width
        of_hollow = partial(_in_hollow, beams_of(shape.vertices)) if ratio is None else partial(_in_rectangle, ratio)
        for k, angle in enumerate(theta.tolist()):
            own, wrong = of_hollow(angle, most, shape.rounding)
            fractions[k] += width * own
            errors[k] += width * wrong
    errors += 4.0 * EPS
    rows = np.stack([fractions, errors], axis=-1).tolist()
    return [tuple(Estimate(one, wrong, "bound", "beams of equal itinerary") for one, wrong in row) for row in rows]


def _in_rectangle(height_to_width: float, angle: float, most: int, rounding: float) -> tuple[Floats, Floats]:
    """Of a rectangle: a ray that crosses d widths hits floor(d) sides, or with probability d - floor(d) one more."""
    found, crossed = np.zeros(most + 1), 2.0 * height_to_width / abs(np.tan(angle))
    if crossed >= most:
        found[most] = 1.0
        return found, np.zeros(most + 1)
    sides = int(crossed)
    found[sides : sides + 2] = sides + 1 - crossed, crossed - sides
    return found, np.full(most + 1, rounding * (1.0 + crossed))


def _in_hollow(beams: Beams, angle: float, most: int, rounding: float) -> tuple[Floats, Floats]:
    """Of a hollow with an opening of width 1 and coordinates with this error, and errors, at one angle."""
    inside = (beams.low <= angle) & (angle < beams.high)
    column, cot = np.minimum(beams.bounces[inside] - 1, most), 1.0 / np.tan(angle)
    sine, cosine = beams.sine[inside], beams.cosine[inside] * cot
    found = np.maximum(np.bincount(column, weights=sine + cosine, minlength=most + 1), 0.0) + 0.0
    # both ends of a beam are images of corners, each of which is wrong by twice the rounding more for each bounce
    moved = 4.0 * rounding * (beams.bounces[inside] + 1) / np.sin(angle)
    wrong = np.bincount(column, weights=moved + 4.0 * EPS * (np.abs(sine) + np.abs(cosine)), minlength=most + 1)
    unresolved = (beams.unresolved_low <= angle) & (angle <= beams.unresolved_high)
    missing = float(np.sum(beams.unresolved_sine[unresolved] + beams.unresolved_cosine[unresolved] * cot))
    return np.asarray(found), np.asarray(wrong + missing + abs(1.0 - missing - found.sum()))


def _of_rays(
    wall: Wall, angle: float, most: int, rng: np.random.Generator, exact: tuple[Estimate, ...]
) -> tuple[Estimate, ...]:
    """The fractions of traced rays, where their errors are smaller than those of the exact ones."""
    ray = trace(wall, (np.arange(RAYS) + rng.random(RAYS)) / RAYS * wall.period, angle)
    unknown = ~ray.escaped & (ray.collisions <= most)
    column = np.where(unknown, -1, np.clip(ray.collisions - 1, 0, most))
    method, lost = f"{RAYS} rays in strata", float(unknown.mean())
    each = (mean_of_strata((column == k).astype(np.float64), 1.0, method) for k in range(most + 1))
    rays = tuple(Estimate(one.value, one.error + lost, one.kind, method) for one in each)
    return tuple(min(pair, key=lambda one: one.error) for pair in zip(rays, exact or rays, strict=True))


@overload
def specular_share(law: Law, incidence_deg: None = None, rng: Rng = None) -> Estimate: ...
@overload
def specular_share(law: Law, incidence_deg: ArrayLike, rng: Rng = None) -> tuple[Estimate, ...]: ...
def specular_share(
    law: Law, incidence_deg: ArrayLike | None = None, rng: Rng = None
) -> Estimate | tuple[Estimate, ...]:
    r"""The fraction of the particles that a law reflects exactly specularly, as a smooth wall does.

    Parameters
    ----------
    law : Law
        In either convention.
    incidence_deg : array_like, optional
        Degrees from the normal, in (-90, 90): theta is 90 degrees less this angle. By default the average over the
        cosine law, sin(theta)/2 d theta, is given.
    rng : None, int or numpy.random.Generator
        For laws that are sampled; ``np.random.default_rng(0)`` by default, so that results repeat.

    Returns
    -------
    Estimate, or a tuple with one for each angle

    Raises
    ------
    InputError
        If an angle is not in (-90, 90), or the fraction is not known: of products with factors that are neither
        specular nor have a density, and of laws that are given by a map of angles.

    Notes
    -----
    Counted are the isometry theta' = pi - theta of walls of straight pieces, to rounding of its offset, and flat tops.
    Densities and, at almost every angle, curved hollows add nothing. If a hollow has straight and curved pieces, 65,536
    rays are traced, and those within 1e-9 of specular reflection count. Another isometry that agrees with specular
    reflection at one angle, as retroreflection does at normal incidence, is not counted there. A product has an exactly
    known fraction if all factors are specular, or one has a density.

    Errors are bounds, but for traced rays, and at angles for walls whose beams leave a fraction u of the flux
    unresolved: a fraction of at most u^(1/2) of all angles has more than u^(1/2) unresolved.

    Examples
    --------
    >>> from asperity import geometry as geo, kernels as ker, spectral as spec
    >>> print(spec.specular_share(ker.maxwell(0.25)), float(spec.specular_share(ker.lambertian())))
    0.75000000000000(4) 0.0
    >>> crevices = ker.WallLaw(geo.rectangular_teeth(0.5))
    >>> [round(float(one), 12) for one in spec.specular_share(crevices, [0, 45, 63.43494882292201])]
    [1.0, 0.5, 1.0]
    """
    paper, source = in_paper_frame(law), generator(rng, 0)
    theta = None if incidence_deg is None else incoming_angles(incidence_deg)
    words = words_of(paper)
    if words is None:
        raise InputError(f"law: expected products of fewer laws, got {law!r}, of which the fraction is not known")
    found = [(weight, _specular_part(law_of(word), theta, source)) for word, weight in words.items()]
    values = np.asarray(sum(weight * part[0] for weight, part in found))
    errors = np.asarray(sum(weight * part[1] for weight, part in found))
    kind: ErrorKind = "bound" if all(part[2] == "bound" for _, part in found) else "estimate"
    how = "; ".join(dict.fromkeys(part[3] for _, part in found))
    pairs = zip(values.tolist(), errors.tolist(), strict=True)
    every = tuple(Estimate(value, error + 4.0 * EPS * value, kind, how) for value, error in pairs)
    return every[0] if theta is None else every


def _specular_part(law: Law, theta: Floats | None, rng: np.random.Generator) -> tuple[Floats, Floats, ErrorKind, str]:
    """The fractions of a law that is no sum, their errors and kind, and the method."""
    zero = np.zeros(1 if theta is None else theta.size)
    table = law.isometry_table()
    if table is not None:
        value, error = _specular_mass(table) if theta is None else _specular_at(table, theta)
        missed = table.unresolved if theta is None else np.sqrt(table.unresolved)
        kind: ErrorKind = "bound" if theta is None or not missed else "estimate"
        return value, error + missed, kind, "isometries of the law"
    inner = in_paper_frame(law)
    factors = inner.laws if isinstance(inner, Composition) else (inner,)
    if any(one.has_density or isinstance(one, CircularArcLaw) for one in factors):
        return zero, zero, "bound", "densities have none"
    if all(one == specular() for one in factors):
        return zero + (len(factors) % 2 == 1), zero, "bound", "specular factors"
    if isinstance(inner, WallLaw) and _has_curved_hollows(inner.wall.cell):
        flat = inner.wall.cell.flat_top / inner.wall.period
        return zero + (flat if inner is law else 0.0), zero, "bound", "flat tops"
    reflect = inner.random_map() if inner.is_driven else None
    if reflect is None:
        raise InputError(f"law: expected one of which the specular fraction is known, got {law!r}")
    if theta is None:
        near, lost = _near_specular(law, reflect, rng.random(RAYS), SINE.sample(RAYS, rng))
        each = [(fraction_estimate(float(near.mean()), RAYS, ""), lost)]
    else:
        strata = [(np.arange(RAYS) + rng.random(RAYS)) / RAYS for _ in theta]
        found = (_near_specular(law, reflect, x, np.full(RAYS, angle)) for x, angle in zip(strata, theta, strict=True))
        each = [(mean_of_strata(near.astype(np.float64), 1.0, ""), lost) for near, lost in found]
    values, errors = np.array([(one.value, one.error + lost) for one, lost in each]).T
    return values, errors, "estimate", f"{RAYS} rays"


def _near_specular(law: Law, reflect: RandomMap, x: Floats, theta: Floats) -> tuple[NDArray[np.bool_], float]:
    """Which rays are reflected specularly, of a law in the other frame retroreflected, and the unresolved fraction."""
    theta = np.where(np.abs(theta - 0.5 * np.pi) < BESIDE, 0.5 * np.pi + BESIDE, theta)
    outgoing, escaped = reflect(np.maximum(x, EPS), theta)
    target = np.pi - theta if law.frame == "paper" else theta
    return np.abs(outgoing - target) < CLOSE, 0.0 if escaped is None else 1.0 - float(np.mean(escaped))


def _has_curved_hollows(cell: Wall) -> bool:
    """Whether no hollow of a wall that is its own cell has a straight piece."""
    straight = {index for index, piece in enumerate(cell.pieces) if piece.is_straight}
    return cell.closes and not any(straight & set(range(one.first, one.last)) for one in cell.hollows)


def _are_specular(table: IsometryTable, sign: Floats, offset: Floats) -> NDArray[np.bool_]:
    """Which isometries are specular reflection, to the rounding of offsets."""
    return np.asarray((sign < 0.0) & (np.abs(offset - np.pi) <= SAME_OFFSET + table.offset_error))


def _specular_at(table: IsometryTable, theta: Floats) -> tuple[Floats, Floats]:
    """The probability of specular reflection at angles, and its rounding."""
    probability, sign, offset = table.conditionals(theta)
    found = np.where(_are_specular(table, sign, offset), probability, 0.0).sum(axis=-1)
    return np.asarray(found), SAME_OFFSET / np.sin(theta)


def _specular_mass(table: IsometryTable) -> tuple[Floats, Floats]:
    """The average of the probability of specular reflection, and a bound on its error."""
    mass, error = float(table.masses()[_are_specular(table, table.sign, table.offset)].sum()), SAME_OFFSET
    for crevice in table.crevices:
        listed = crevice_pieces(crevice.height_to_width, FIRST_CROSSING)
        _, *others, omitted = crevice_nodes(crevice.height_to_width, Bins(1))
        kept = int(crevice.exchanged)
        own = float(listed.masses()[listed.sign == (-1.0, 1.0)[kept]].sum()) + 2.0 * float(others[kept].sum())
        mass, error = mass + crevice.fraction * own, error + 4.0 * crevice.fraction * omitted
    return np.array([mass]), np.array([error])
