"""The distance of the collision law of the true disk, K^{Sigma, eps}, from its limit K as a function of eps."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike

from ...core.checkpoints import Stored
from ...core.checks import (
    Floats,
    Rng,
    angles,
    check_memory,
    choice,
    finite_array,
    frozen,
    generator,
    instance,
    new_seed,
    shaped,
    whole_number,
)
from ...core.errors import InputError
from ...core.estimates import NORMAL_95, Estimate, Summary, student_95, with_errors
from ...core.long_runs import Engine, all_parts, identity_of, reported
from ...core.rounding import EPS
from ...core.tables import data_frame
from ...geometry import Disk, Wall, collide, collide_cylinder, collide_modified, trace
from ...geometry.collisions.configuration_space import ConfigurationSpace
from ...geometry.collisions.rigid import in_radii

# A slope with an error needs three points.
FEWEST_SCALES = 3
COLUMNS = ("distance", "state_distance", "floor", "psi_defect", "two_satellites", "outliers", "drift", "shift")


@dataclass(frozen=True, repr=False)
class LimitStudy(Summary):
    """Measured distances between the true disk and its limit law; each array has one entry per scale.

    Attributes
    ----------
    scales, spacings : array
        eps and rho.
    gap_fraction : array
        2 delta_0/rho, the fraction of angles alpha at which two satellites can be below the tops (section 4.1). The
        paper's good set Z excludes these angles.
    distance : array
        Wasserstein distance of the law of (theta', psi') from its limit under K, averaged over the incoming theta, for
        the sum metric of both angles. It equals the distance in theta' plus ``psi_defect``.
    floor : array
        Distance in theta' of the cylinder law for the same samples, a measure of the sampling error of ``distance``.
    psi_defect : array
        Mean absolute difference of psi' from pi - psi.
    two_satellites : array
        Fraction of collisions in which two satellites touch the wall.
    outliers : array
        Fraction of collisions in which the modified law K~ (the true collision in the coordinates of the cylinder)
        differs from the cylinder law by more than 0.1 in a unit velocity.
    drift : array
        Mean of the larger displacement of x1 and alpha between the two times at height 0.
    shift : array
        E[u u']/E[u^2] with u = -cos theta, minus the same ratio for the limit at the same incoming angles. The true
        disk's correlation is <u, P~ u>/<u, u> plus ``shift``.
    errors : mapping to arrays
        Standard errors of the eight columns above, from independent repetitions.
    collisions : int
        Number of collisions at each scale.
    psi : array, shape (k,)
        The incoming psi, radians. With several, every column above is the mean over them.
    by_psi : mapping to arrays
        The eight columns for every psi, each of shape (scales, k).
    """

    scales: Floats
    spacings: Floats
    gap_fraction: Floats
    distance: Floats
    state_distance: Floats
    floor: Floats
    psi_defect: Floats
    two_satellites: Floats
    outliers: Floats
    drift: Floats
    shift: Floats
    errors: Mapping[str, Floats]
    collisions: int
    psi: Floats
    by_psi: Mapping[str, Floats]
    _more = ".errors, .order(column), .by_psi, .to_frame()"

    def _facts(self) -> dict[str, object]:
        """The columns with their half widths of 95 %."""
        measured = {name: with_errors(getattr(self, name), NORMAL_95 * self.errors[name]) for name in COLUMNS}
        return {"scales": self.scales, **measured}

    def to_frame(self) -> Any:
        """One row a scale; every measured column is followed by its standard error (extra ``studies``)."""
        columns = {"scale": self.scales, "spacing": self.spacings, "gap_fraction": self.gap_fraction}
        for name in COLUMNS:
            # names of fields of this class
            columns |= {name: getattr(self, name), f"{name}_error": self.errors[name]}
        return data_frame(columns)

    def order(self, column: str, against: str = "scales") -> Estimate:
        """The exponent p of column ~ against^p, by weighted least squares.

        The error is the half width of a 95 % interval. It comes from the sampling errors, or, if the points scatter
        about the line by more, from this scatter with Student's quantile.

        Parameters
        ----------
        column : str
            One of the measured columns.
        against : {"scales", "spacings"}

        Raises
        ------
        InputError
            If a name is unknown, there are fewer than three scales, or an entry is not positive.
        """
        choice("column", column, COLUMNS)
        bases = {"scales": self.scales, "spacings": self.spacings}
        choice("against", against, bases)
        values = getattr(self, column)
        if len(values) < FEWEST_SCALES or not np.all(values > 0.0):
            raise InputError(
                f"{column}: expected at least {FEWEST_SCALES} positive entries for a slope, got {values.tolist()}"
            )
        spread = np.maximum(self.errors[column] / values, EPS)
        x, y = np.log(bases[against]), np.log(values)
        (slope, offset), covariance = np.polyfit(x, y, 1, w=1.0 / spread, cov="unscaled")
        # scatter about the line, in units of the sampling errors
        excess = np.sum(((y - slope * x - offset) / spread) ** 2) / (len(x) - 2)
        standard_error = math.sqrt(float(covariance[0, 0]))
        by_scatter = student_95(len(x) - 1) * math.sqrt(float(excess)) if excess > 1.0 else 0.0
        error = standard_error * max(NORMAL_95, by_scatter)
        return Estimate(float(slope), error, "estimate", f"slope of {len(x)} scales")


@reported("limit study")
def limit_study(
    disk: Disk,
    wall: Wall,
    scales: ArrayLike,
    rng: Rng = None,
    *,
    psi: ArrayLike = 1.2,
    spacing: Callable[[float], float] | None = None,
    limit: Wall | None = None,
    samples: tuple[int, int, int] = (16, 32, 32),
    repetitions: int = 4,
    **engine: Unpack[Engine],
) -> LimitStudy:
    """Collide true disks of random position and angle at several scales, and compare them with the limit law K.

    Parameters
    ----------
    disk : Disk
    wall : Wall
    scales : array_like, shape (n,)
        Values of eps > 0.
    rng : None, int or numpy.random.Generator
    psi : float or array_like, shape (k,)
        One or several incoming psi in (0, pi), radians.
    spacing : callable, optional
        rho as a function of eps; by default as in `geometry.collide`.
    limit : Wall, optional
        The wall whose foreshortened law is the limit; by default ``wall``.
    samples : (int, int, int)
        Numbers of incoming angles theta, of disk angles alpha per theta, and of positions x1 per alpha. All are
        stratified: theta with respect to sin(theta), alpha in one spacing, x1 in one cell. For every psi.
    repetitions : int
        Independent repetitions for the standard errors, at least 2.
    checkpoint : path, optional
        A file to which every repetition at a scale is added; the same call goes on with it.
    client : int, str or distributed.Client, optional
        As of `asperity.spectral.sweep`. The study is the same to the last bit without checkpoint and workers.
    key : str, optional
        As of `asperity.spectral.sweep`.

    Returns
    -------
    LimitStudy

    Raises
    ------
    InputError
        As in `geometry.collide`, and if a number is out of range; if the checkpoint is of another study.

    Source: Rudzis 2022, Theorem 5.1.

    Examples
    --------
    >>> import numpy as np
    >>> from asperity import geometry as geo, kernels as ker
    >>> study = ker.limit_study(geo.Disk(1.0, 1.0), geo.triangular_teeth(1.2), [1e-3, 1e-4, 1e-5],
    ...                         np.random.default_rng(0), samples=(8, 16, 16))
    >>> bool(np.all(np.diff(study.psi_defect) < 0)), abs(float(study.order("psi_defect", "spacings")) - 1.0) < 0.2
    (True, True)
    >>> bool(np.all(np.diff(study.state_distance) < 0))
    True
    """

    root = new_seed(generator(rng))
    eps = shaped("scales", np.atleast_1d(finite_array("scales", scales)), "n")
    rolls = shaped("psi", np.atleast_1d(angles("psi", psi)), "n")
    if not rolls.size:
        raise InputError("psi: expected one angle or a list of angles, got none")
    for name, number in zip(("angles", "rotations", "positions"), samples, strict=True):
        whole_number(f"samples ({name})", number, 1)
    whole_number("repetitions", repetitions, 2)
    # a part takes a thousand bytes, packed
    check_memory("repetitions", "all repetitions", 128 * len(eps) * repetitions)
    disk = in_radii(disk)
    spaces = [ConfigurationSpace(wall, disk, float(e), None if spacing is None else spacing(float(e))) for e in eps]
    if limit is not None:
        instance("limit", limit, Wall, "geo.triangular_teeth(0.7)")
    target = (limit or wall).foreshorten(disk)
    sizes = tuple((space.scale, space.spacing) for space in spaces)
    job = _Repetitions(disk, wall, target, sizes, tuple(map(float, rolls)), samples, repetitions, root)
    parts = all_parts(
        job.measured, len(eps) * repetitions, identity_of("limit of small scales", job), engine, job.stored
    )
    each = np.reshape([part["columns"] for part in parts], (len(eps), repetitions, len(rolls), len(COLUMNS)))
    runs = each.mean(axis=2)
    means, errors = runs.mean(axis=1), runs.std(axis=1, ddof=1) / math.sqrt(repetitions)
    columns = {name: frozen(means[:, j]) for j, name in enumerate(COLUMNS)}
    return LimitStudy(
        scales=frozen(eps),
        spacings=frozen([space.spacing for space in spaces]),
        gap_fraction=frozen([2.0 * space.gap_radius / space.spacing for space in spaces]),
        errors=MappingProxyType({name: frozen(errors[:, j]) for j, name in enumerate(COLUMNS)}),
        collisions=repetitions * len(rolls) * math.prod(samples),
        psi=frozen(rolls),
        by_psi=MappingProxyType({name: frozen(each.mean(axis=1)[:, :, j]) for j, name in enumerate(COLUMNS)}),
        **columns,
    )


@dataclass(frozen=True)
class _Repetitions:
    """All repetitions at all scales; what a worker is sent."""

    disk: Disk
    wall: Wall
    limit: Wall
    sizes: tuple[tuple[float, float], ...]
    psi: tuple[float, ...]
    samples: tuple[int, int, int]
    repetitions: int
    seed: tuple[int, ...]

    def stored(self, _: int) -> dict[str, Stored]:
        """What the arrays of a part must be."""
        return {"columns": Stored("f", (len(self.psi), len(COLUMNS)))}

    def measured(self, part: int) -> dict[str, Any]:
        """The columns of one repetition, whose random numbers depend on its number alone."""
        rng = np.random.default_rng([*self.seed, part])
        scale, spacing = self.sizes[part // self.repetitions]
        return {"columns": [self._measured(scale, spacing, psi, rng) for psi in self.psi]}

    def _measured(self, scale: float, spacing: float, psi: float, rng: np.random.Generator) -> list[float]:
        """The columns of one repetition in the order of COLUMNS."""

        disk, wall, target = self.disk, self.wall, self.limit
        directions, turns, starts = self.samples
        per_angle = turns * starts
        u = -1.0 + 2.0 * _strata(directions, rng)
        theta = np.arccos(-u)
        alpha = spacing * (_strata(turns, rng, (directions,)) - 0.5)
        x1 = scale * wall.period * _strata(starts, rng, (directions, turns))
        position = np.stack([x1, np.broadcast_to(alpha[..., None], x1.shape)], axis=-1).reshape(-1, 2)
        velocity = -np.repeat(disk.from_angles(theta, psi), per_angle, axis=0)
        true = collide(disk, wall, scale, position, velocity, spacing)
        outgoing, rolled = disk.to_angles(true.velocity)
        limit_wall = target.unforeshorten(disk)
        straight, _ = disk.to_angles(collide_cylinder(disk, limit_wall, scale, position, velocity).velocity)
        # the same samples in the coordinates of the cylinder
        modified = collide_modified(disk, wall, scale, position, velocity, spacing)
        cylinder = collide_cylinder(disk, wall, scale, position, velocity)
        # midpoints of equal parts of the cell give quantiles of the limit, with an error of order 1/per_angle
        entry = target.period * (np.arange(per_angle) + 0.5) / per_angle
        limit = np.sort(trace(target, entry, theta[:, None]).theta, axis=1)
        shape = (directions, per_angle)
        psi_defect = float(np.mean(np.abs(rolled - (math.pi - psi))))
        away = float(np.mean(np.abs(np.sort(outgoing.reshape(shape), axis=1) - limit)))
        moved = np.abs(true.position - position)
        differ = np.abs(modified.velocity - cylinder.velocity).max(axis=1) > 0.1
        # E[u^2] = 1/3 under sin(theta)/2 d theta
        shift = 3.0 * float(np.mean(u[:, None] * (np.cos(limit) - np.cos(outgoing.reshape(shape)))))
        return [
            away + psi_defect,
            away + psi_defect + float(moved.sum(axis=1).mean()),
            float(np.mean(np.abs(np.sort(straight.reshape(shape), axis=1) - limit))),
            psi_defect,
            float(true.two_satellites.mean()),
            float(differ.mean()),
            float(moved.max(axis=1).mean()),
            shift,
        ]


def _strata(n: int, rng: np.random.Generator, shape: tuple[int, ...] = ()) -> Floats:
    """Stratified random numbers, shape ``shape + (n,)``: one in each of n equal parts of (0, 1)."""
    return np.asarray((np.arange(n) + rng.random((*shape, n))) / n)
