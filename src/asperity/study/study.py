"""A study of a wall in one call: its law, its symmetry, its spectral gap and a disk's collision law."""

from __future__ import annotations

import json
import math
import os
from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType
from typing import Any, ClassVar, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from ..core.checks import Rng, choice, generator, instance, positive_number
from ..core.errors import AccuracyError, AsperityError, FileExistsRefusal, InputError
from ..core.estimates import NORMAL_95, Estimate, Summary
from ..core.files import moved_when_complete
from ..core.long_runs import progress_bar
from ..geometry import Disk, Wall, trace
from ..geometry.cells.output import wall_miniature
from ..geometry.tracing.tracing import StatusCounts
from ..kernels import Bins, CollisionLaw, FacetedLaw, KernelMatrix, Law, WallLaw, discretise
from ..kernels.bases.measure import SINE
from ..spectral import SpectralGap, Spectrum, accommodation, enclosures, spectral_gap, spectrum
from ..spectral.bounds.enclosure import Enclosures
from ..spectral.consequences.momentum_accommodation import from_degrees
from ..spectral.gap.law_spectrum import with_gap
from ..spectral.gap.methods import law_eigenvalues
from .pictures import RESOLUTION, Drawings, drawings_of, save_pictures
from .result import StudyResult, TracerCheck, consequences_of, report_of, study_as_dict

BINS = 128
TOLERANCE = 1e-3
CHECK_RAYS = 2**16
EIGENVALUES = 10
# Fraction of the tolerance that eigenvalues may spend.
MATRIX_FRACTION = 0.1
# Eigenvalues that are enclosed, the constants' included: some seconds on a traced wall.
ENCLOSED = 3
# Rays of a sampled matrix: enough to see how many more it takes, and as many as a few seconds allow.
FIRST_SAMPLES, MOST_SAMPLES = 2**20, 2**24
PICTURES = ("wall.png", "kernel.png", "spectrum.png", "collision.png")
FORMATS = ("png", "svg", "pdf")
# Of a disk whose collisions are not computed yet.
UNKNOWN = {"energy_defect": math.nan, "rolling_momentum_defect": math.nan}
DATA = ("kernel.npz", "study.json")


T = TypeVar("T")


class SavedStudy(Summary):
    """A study that is shown as text and written as JSON, with a matrix and pictures."""

    pictures: ClassVar[tuple[str, ...]]
    matrix: KernelMatrix

    @abstractmethod
    def as_dict(self) -> dict[str, Any]:
        """Plain numbers and strings, ready for JSON."""

    @abstractmethod
    def summary(self, *, verbose: bool = False, by_angle: bool = False) -> str:
        """The study as some lines of text."""

    @abstractmethod
    def _drawings(self) -> Drawings:
        """What draws the pictures, and their sizes."""

    _more = ".summary(verbose=True), .to_json(), .save(folder)"

    def _headline(self) -> str:
        return f"of {self.name}"  # type: ignore[attr-defined]

    def _facts(self) -> dict[str, object]:
        return {line[:11].strip() or "gap, specular": line[11:] for line in self.summary().splitlines()}

    def to_json(self) -> str:
        """The study as JSON."""
        return json.dumps(self.as_dict(), indent=2, allow_nan=False)

    def _drawn(self, paths: Sequence[Path], dpi: float) -> list[Path]:
        """Write the pictures of these names."""
        stems = [Path(name).stem for name in self.pictures]
        chosen = [
            drawing for stem, drawing in zip(stems, self._drawings(), strict=True) if stem in {p.stem for p in paths}
        ]
        return save_pictures(chosen, paths, dpi)

    def save(
        self, folder: str | Path, *, overwrite: bool = False, picture_format: str = "png", dpi: float = RESOLUTION,
        drawn: Sequence[Path] = (),
    ) -> list[Path]:  # fmt: skip
        """Write the matrix with its metadata, the study as JSON, and the pictures; returns the paths.

        A picture that cannot be drawn is missing, with a warning.

        Parameters
        ----------
        folder : path
            Made if missing.
        overwrite : bool
            Whether files of an earlier study are replaced.
        picture_format : {"png", "svg", "pdf"}
        dpi : float
            Dots per inch of pictures in pixels.
        drawn : sequence of Path
            Pictures in the folder that stay as they are.

        Raises
        ------
        FileExistsRefusal
            If one of the files exists and ``overwrite`` is False; nothing is written then.
        InputError
            If the folder cannot be made or written.
        """
        positive_number("dpi", dpi)
        names = picture_names(picture_format, self.pictures)
        target = prepare_folder(
            folder, [name for name in names if Path(folder, name) not in drawn], overwrite=overwrite
        )
        try:
            with moved_when_complete(target) as beside:
                self.matrix.save(beside / DATA[0])
                (beside / DATA[1]).write_text(self.to_json() + "\n", encoding="utf-8")
        except OSError as reason:
            raise InputError(f"{target}: cannot write there ({reason}); choose another folder") from reason
        return [
            *self._drawn([target / name for name in names if target / name not in drawn], dpi),
            *(target / name for name in DATA),
        ]


@dataclass(frozen=True, repr=False)
class Study(StudyResult, SavedStudy):
    """Everything that `study_wall` found; ``summary()`` is text, ``to_json()`` a string, ``save`` writes files.

    The attributes are those of `StudyResult`.
    """

    pictures = PICTURES
    _more = ".summary(verbose=True), .refusals, .to_json(), .save(folder)"

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers and strings, ready for JSON; ``docs/command-line.md`` lists the keys."""
        return study_as_dict(self)

    def summary(self, *, verbose: bool = False, by_angle: bool = False) -> str:
        """The study as some ten short lines; with ``verbose`` also methods, spectrum, enclosures and evidence.

        With ``by_angle`` also the accommodation of momentum at each angle.
        """
        return report_of(self, by_angle, verbose)

    def _picture(self) -> str:
        return wall_miniature(self.wall)

    def _drawings(self) -> Drawings:
        return drawings_of(self)


def study_wall(
    wall: Wall,
    name: str = "wall",
    disk: Disk | None = None,
    *,
    facets: Law | None = None,
    tolerance: float = TOLERANCE,
    bins: int = BINS,
    rng: Rng = None,
    progress: bool = True,
    incidence_deg: ArrayLike | None = None,
    first: Callable[[Study], object] | None = None,
) -> Study:
    """Study a wall: trace it, make its law and matrix, test the symmetry, find the gap, collide a disk with it.

    Parameters
    ----------
    wall : Wall
    name : str
        What the wall is called in summaries and titles.
    disk : Disk, optional
        By default the uniform disk. The summary begins with a disk that is given.
    facets : Law, optional
        The law of the facets, of `FacetedLaw`; mirrors by default. Those of the wall that the disk feels have it too.
    tolerance : float
        Error asked of the gaps and of the matrices; what was reached is reported.
    bins : int
        Size of the matrix.
    rng : None, int or numpy.random.Generator
        ``np.random.default_rng(0)`` by default, so that a study repeats.
    progress : bool
        Whether a bar is shown on a terminal after two seconds.
    incidence_deg : array_like, optional
        Angles of the accommodation of momentum, in degrees from the normal: see `accommodation`.
    first : callable, optional
        Called with the study of the wall alone, before the collision of the disk, for which a first study compiles
        more.

    Returns
    -------
    Study
        A quantity that a check forbids to quote (as a spectrum, where the sampled law looks irreversible) is None, and
        ``refusals`` says why; the rest of the study stands.

    Raises
    ------
    InputError
        If the facets' law, the tolerance, the number of bins or an angle is unsuitable.
    AccuracyError
        If more than 1e-4 of the rays do not escape.

    Examples
    --------
    >>> from asperity import geometry as geo
    >>> report = study_wall(geo.rectangular_teeth(2.0), bins=16)
    >>> report.gap.verdict, report.matrix.method
    ('no gap', 'exact')
    """
    instance("wall", wall, Wall, "geo.triangular_teeth(0.7)")
    positive_number("tolerance", tolerance)
    basis, law = Bins(bins), law_of(wall, facets)
    rng = generator(rng, 0)
    if incidence_deg is not None:
        # refused before the work
        from_degrees(incidence_deg)
    given, disk = disk is not None, disk or Disk()
    refusals: dict[str, str] = {}
    with progress_bar(8, "part", name, shown=progress) as bar:
        tracer = check_tracer(wall, rng) if wall.hollows else None
        bar.update()
        matrix = _matrix(law, basis, tolerance, rng)
        bar.update()
        gap, specular_gap = _gaps(law, tolerance, rng, refusals)
        bar.update(2)
        found = _or_refusal(lambda: _spectrum(law, matrix, gap, tolerance, rng), refusals, "spectrum")
        bar.update()
        enclosed = _or_refusal(lambda: _enclosures(law, gap, tolerance), refusals, "enclosures", reason=AsperityError)
        bar.update()
        consequences = consequences_of(wall, law, gap, specular_gap, found)
        momentum = _or_refusal(
            lambda: accommodation(law, tolerance, rng=rng, incidence_deg=incidence_deg), refusals, "accommodation"
        )
        collision = CollisionLaw(law_of(wall.foreshorten(disk), facets), disk)
        of_wall = Study(
            name, wall, facets, disk, given, float(tolerance), tracer, matrix, gap, specular_gap, found, enclosed,
            collision, None, MappingProxyType(UNKNOWN),
            MappingProxyType(refusals | {"collision_gap": "not computed yet"}), consequences, momentum,
        )  # fmt: skip
        if first is not None:
            first(of_wall)
        collision_gap = _or_refusal(lambda: spectral_gap(collision.law, tolerance, rng), refusals, "collision_gap")
        bar.update()
        conservation = _conservation(collision, rng)
        bar.update()
    return replace(
        of_wall, collision_gap=collision_gap, conservation=MappingProxyType(conservation),
        refusals=MappingProxyType(refusals),
    )  # fmt: skip


def law_of(wall: Wall, facets: Law | None) -> Law:
    """The law of a wall with facets of this law, or mirrors; raises InputError for a law that no facet can have."""
    return WallLaw(wall) if facets is None else FacetedLaw(wall, facets)


def picture_names(picture_format: str, pictures: Sequence[str] = PICTURES) -> list[str]:
    """The names of the pictures of a study in a format, which is checked."""
    choice("picture_format", picture_format, FORMATS)
    return [f"{Path(name).stem}.{picture_format}" for name in pictures]


def prepare_folder(folder: str | Path, pictures: Sequence[str], *, overwrite: bool) -> Path:
    """Make the output folder, and refuse it where a file of an earlier study would be lost."""
    target, names = Path(folder), (*pictures, *DATA)
    try:
        existing = [name for name in names if os.path.exists(target / name)]
        if overwrite or not existing:
            target.mkdir(parents=True, exist_ok=True)
            TemporaryDirectory(dir=target, prefix=".asperity-").cleanup()
            return target
    except OSError as reason:
        raise InputError(f"{target}: cannot write there ({reason.strerror}); choose another folder") from reason
    raise FileExistsRefusal(f"{target}: {', '.join(existing)} exist; use another folder or --force to replace them")


def _or_refusal(
    job: Callable[[], T], refusals: dict[str, str], *names: str, reason: type[AsperityError] = AccuracyError
) -> T | None:
    """What the job returns; None if it raises this error, which is noted under the names."""
    try:
        return job()
    except reason as raised:
        refusals |= dict.fromkeys(names, str(raised))
        return None


def _gaps(
    law: Law, tolerance: float, rng: np.random.Generator, refusals: dict[str, str]
) -> tuple[SpectralGap | None, SpectralGap | None]:
    """In the paper's convention and in Feres'."""
    gap = _or_refusal(lambda: spectral_gap(law, tolerance, rng), refusals, "gap")
    specular = law.in_specular_frame()
    return gap, _or_refusal(lambda: spectral_gap(specular, tolerance, rng), refusals, "specular_gap")


def _spectrum(
    law: Law, matrix: KernelMatrix, gap: SpectralGap | None, tolerance: float, rng: np.random.Generator
) -> Spectrum:
    if gap is not None and gap.verdict == "no gap":
        # whatever the basis, these are numbers of the grid; those of the matrix that is shown and saved
        return with_gap(spectrum(matrix, k=EIGENVALUES), gap)
    if gap is None:
        return spectrum(law, EIGENVALUES, tolerance=MATRIX_FRACTION * tolerance, rng=rng)
    return with_gap(law_eigenvalues(law, EIGENVALUES, MATRIX_FRACTION * tolerance, rng), gap)


def _enclosures(law: Law, gap: SpectralGap | None, tolerance: float) -> Enclosures:
    if gap is not None and gap.verdict == "no gap":
        raise AccuracyError("1 belongs to the essential spectrum, and no eigenvalue next to it is isolated", 0.0)
    return enclosures(law, ENCLOSED, tolerance=MATRIX_FRACTION * tolerance)


def _matrix(law: Law, basis: Bins, tolerance: float, rng: np.random.Generator) -> KernelMatrix:
    """In bins; where rays are needed, as many as the error of a first sample asks for, and at most `MOST_SAMPLES`."""
    wanted = tolerance * float(np.sqrt(basis.size))
    found = discretise(law, basis, tolerance=wanted, samples=FIRST_SAMPLES, rng=rng)
    if not found.samples or found.tolerance_met:
        return found
    # the error falls at least like the root of their number
    more = 2 ** math.ceil(2.0 * math.log2(float(found.error) / wanted))
    return discretise(law, basis, tolerance=wanted, samples=min(FIRST_SAMPLES * more, MOST_SAMPLES), rng=rng)


def check_tracer(wall: Wall, rng: np.random.Generator) -> TracerCheck:
    """Trace rays that enter the hollows with the invariant measure."""
    wall = wall.cell
    lefts, widths = np.array([(hollow.left, hollow.width) for hollow in wall.hollows]).T
    which = rng.choice(len(widths), CHECK_RAYS, p=widths / widths.sum())
    ray = trace(wall, lefts[which] + widths[which] * rng.random(CHECK_RAYS), SINE.sample(CHECK_RAYS, rng))
    return tracer_check(ray, float((wall.arc_length - wall.flat_top) / widths.sum()))


def tracer_check(ray: StatusCounts, expected: float) -> TracerCheck:
    """The counts of rays of the invariant measure, beside the mean number of collisions that Kac's formula expects."""
    number = ray.collisions  # type: ignore[attr-defined]
    mean = Estimate(
        float(np.mean(number)), NORMAL_95 * float(np.std(number, ddof=1) / np.sqrt(number.size)), "estimate",
        f"spread of {number.size} rays",
    )  # fmt: skip
    return TracerCheck(MappingProxyType(ray.counts()), mean, expected)


def _conservation(collision: CollisionLaw, rng: np.random.Generator) -> dict[str, float]:
    """Largest relative change of energy and of rolling momentum over sampled collisions."""
    velocity = rng.normal(size=(4096, 3))
    velocity[:, 1] = -np.abs(velocity[:, 1])
    disk = collision.disk
    outgoing = collision.sample(velocity, rng)
    energy = disk.inner(velocity, velocity)
    scale = np.sqrt((disk.mass + disk.rim_mass) * energy)
    return {
        "energy_defect": float(np.max(np.abs(disk.inner(outgoing, outgoing) / energy - 1.0))),
        "rolling_momentum_defect": float(
            np.max(np.abs(disk.rolling_momentum(outgoing) - disk.rolling_momentum(velocity)) / scale)
        ),
    }
