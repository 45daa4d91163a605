"""Whether the collision laws of a sequence of cells converge: the dichotomy of Rudzis 2022, theorem 1.20, measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ...core.checks import Floats, Rng, finite_array, frozen, generator, positive_number, sequence
from ...core.errors import InputError
from ...core.estimates import NORMAL_95, Summary
from ...geometry import Disk, Wall
from ..collisions.small_scale_limit import limit_study
from ..distances.distances import distance
from ..walls.wall_law import WallLaw

FEWEST_CELLS = 4
# Scales at which the true disk is compared with its limit law, and the samples of each comparison.
SCALES, SAMPLES = (1e-3, 1e-4, 1e-5), (12, 16, 16)
# The diameter of the last laws has fallen to this fraction of that of all where they converge, and has kept this one
# where they do not.
FALLEN, STANDING = 0.25, 0.5
Verdict = Literal["converges", "does not converge", "undecided"]


@dataclass(frozen=True, eq=False, repr=False)
class Dichotomy(Summary):
    """The outcome of `dichotomy`.

    Attributes
    ----------
    verdict : {"converges", "does not converge", "undecided"}
        What the members that were given show; of a sequence that goes on it is evidence and no proof.
    scales : ndarray, shape (cells,)
        b_i: at scales eps <= b_i the true disk's collision law is within 1/(i + 1) of that of the i-th cell, i = 0, 1,
        ..., in the distance of `limit_study`, by the order that it shows; nan where it shows none.
    distances : ndarray, shape (cells, cells)
        Pseudometric distances of the laws P~ of the foreshortened cells.
    errors : ndarray, shape (cells, cells)
        Those of the distances.
    diameters : ndarray, shape (cells - 1,)
        The largest distance among the laws from the k-th on.
    """

    verdict: Verdict
    scales: Floats
    distances: Floats
    errors: Floats
    diameters: Floats


def dichotomy(
    cells: Sequence[Wall],
    disk: Disk | None = None,
    tolerance: float = 1e-3,
    *,
    scales: Sequence[float] = SCALES,
    rng: Rng = None,
) -> Dichotomy:
    r"""Whether the collision laws of a disk with a sequence of cells converge, as the scale tends to 0 fast enough.

    Parameters
    ----------
    cells : sequence of Wall
        At least 4, each of segments and arcs.
    disk : Disk, optional
        By default the uniform disk.
    tolerance : float
        Laws closer than this count as one.
    scales : sequence of float
        At least 3, at which each cell is compared with its limit law.
    rng : None, int or numpy.random.Generator
        For the true disk's place; ``np.random.default_rng(0)`` by default.

    Returns
    -------
    Dichotomy

    Raises
    ------
    InputError
        If there are too few cells or scales.

    Notes
    -----
    There are b_i > 0 such that for every sequence of scales eps_i <= b_i the laws K^{Sigma_i, eps_i} converge weakly if
    and only if the laws P~ of the foreshortened cells do; the limit is then a rough collision law. The laws P~ converge
    if the diameters of the tails of their sequence tend to 0.

    Examples
    --------
    >>> from asperity import geometry as geo
    >>> dichotomy([geo.triangular_teeth(1.0), geo.flat()] * 3).verdict
    'does not converge'
    """

    rng = generator(rng, 0)
    cells = sequence("cells", cells, Wall, "geo.flat()")
    if len(cells) < FEWEST_CELLS:
        raise InputError(f"cells: expected at least {FEWEST_CELLS} walls, got {cells!r}")
    positive_number("tolerance", tolerance)
    eps = np.sort(finite_array("scales", scales))[::-1]
    if eps.size < 3 or eps[-1] <= 0.0:
        raise InputError(f"scales: expected at least 3 numbers greater than 0, got {scales!r}")
    disk = disk or Disk()
    laws = [WallLaw(cell.foreshorten(disk)) for cell in cells]
    count = len(laws)
    values, errors = np.zeros((count, count)), np.zeros((count, count))
    for i in range(count):
        for j in range(i):
            if cells[i] == cells[j]:
                continue
            found = distance(laws[i], laws[j], kind="pseudometric", tolerance=0.1 * tolerance)
            values[i, j] = values[j, i] = float(found)
            errors[i, j] = errors[j, i] = found.error
    diameters = np.array([values[k:, k:].max() for k in range(count - 1)])
    widths = np.array([errors[k:, k:].max() for k in range(count - 1)])
    return Dichotomy(
        _verdict(diameters, widths, tolerance),
        frozen([_scale(disk, cell, eps, 1.0 / (i + 1), rng) for i, cell in enumerate(cells)]),
        frozen(values), frozen(errors), frozen(diameters),
    )  # fmt: skip


def _verdict(diameters: Floats, widths: Floats, tolerance: float) -> Verdict:
    first, last, middle = diameters[0], diameters[-1], diameters[len(diameters) // 2]
    if last + widths[-1] <= tolerance or (last + widths[-1] <= FALLEN * middle and middle <= STANDING * first):
        return "converges"
    if last - widths[-1] >= STANDING * first and last - widths[-1] > tolerance:
        return "does not converge"
    return "undecided"


def _scale(disk: Disk, cell: Wall, scales: Floats, wanted: float, rng: np.random.Generator) -> float:
    """The scale below which the true disk is within a distance of its limit, by a power law with its error."""
    study = limit_study(disk, cell, scales, rng, samples=SAMPLES)
    above = study.distance + NORMAL_95 * study.errors["distance"]
    if np.all(above <= wanted):
        return float(scales[0])
    order = study.order("distance")
    slowest = order.value - order.error
    if slowest <= 0.0:
        return float("nan")
    return float(min(scales[-1] * (wanted / above[-1]) ** (1.0 / slowest), scales[0]))
