"""The main job in one call: from a wall to its law, its symmetry, its spectral gap and a disk's collision law."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from .errors import FileExistsRefusal, InputError
from .estimates import Estimate
from .geometry import Disk, Wall, draw_wall, trace
from .kernels import Bins, CollisionLaw, KernelMatrix, WallLaw, discretise
from .kernels.measure import SINE
from .spectral import SpectralGap, Spectrum, spectral_gap, spectrum

BINS = 128
CHECK_RAYS = 2**16
PICTURE_RAYS = 6
PICTURE_BOUNCES = 40
PICTURES = ("wall.png", "kernel.png", "spectrum.png", "collision.png")
DATA = ("kernel.npz", "study.json")


@dataclass(frozen=True)
class TracerCheck:
    """What a sample of rays says of the tracer on this wall.

    Attributes
    ----------
    counts : dict
        Rays by status.
    mean_collisions : Estimate
        Mean number of collisions of the rays that enter a hollow.
    expected_collisions : float
        |boundary of the hollows| / |openings| (Kac's formula); they agree where no part is unreachable.
    """

    counts: dict[str, int]
    mean_collisions: Estimate
    expected_collisions: float

    @property
    def z_score(self) -> float:
        """Deviation of the mean from Kac's formula in standard errors."""
        return (self.mean_collisions.value - self.expected_collisions) / self.mean_collisions.error


@dataclass(frozen=True)
class Study:
    """Everything that `study_wall` found; ``summary()`` is text, ``to_json()`` a string, ``save`` writes files."""

    name: str
    wall: Wall
    disk: Disk
    tracer: TracerCheck | None
    matrix: KernelMatrix
    gap: SpectralGap
    specular_gap: SpectralGap | None
    spectrum: Spectrum
    collision: CollisionLaw
    collision_matrix: KernelMatrix
    collision_gap: SpectralGap
    conservation: dict[str, float] = field(default_factory=dict)

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers and strings, ready for JSON."""
        wall = self.wall
        return {
            "wall": {
                "name": self.name, "period": wall.period, "depth": wall.depth, "arc_length": wall.arc_length,
                "pieces": len(wall.pieces), "hollows": len(wall.hollows), "closes": wall.closes,
                "polygonal": wall.is_polygonal, "mirror_symmetric": wall.is_mirror_symmetric,
            },
            "tracer": None if self.tracer is None else {
                "rays": self.tracer.counts, "mean_collisions": _estimate(self.tracer.mean_collisions),
                "kac": self.tracer.expected_collisions, "z_score": self.tracer.z_score,
            },
            "law": _matrix(self.matrix),
            "gap": {"paper": gap_as_dict(self.gap), "specular": None if self.specular_gap is None else gap_as_dict(self.specular_gap)},
            "eigenvalues": {
                "convention": self.spectrum.convention, "method": self.spectrum.method,
                "values": self.spectrum.values.tolist(),
                **{part: _finite(getattr(self.spectrum.errors, part)) for part in
                   ("algebraic", "discretisation", "sampling")},
            },
            "collision": {
                "mass": self.disk.mass, "inertia": self.disk.inertia, "foreshortening": self.disk.foreshortening,
                "law": _matrix(self.collision_matrix), "gap": gap_as_dict(self.collision_gap), **self.conservation,
            },
        }  # fmt: skip

    def to_json(self) -> str:
        """The study as JSON."""
        return json.dumps(self.as_dict(), indent=2, allow_nan=False)

    def summary(self) -> str:
        """The study as text, one fact a line."""
        wall, disk = self.wall, self.disk
        lines = [
            f"wall       {self.name}: period {wall.period:g}, depth {wall.depth:.6g}, length {wall.arc_length:.6g}, "
            f"{len(wall.pieces)} pieces, {len(wall.hollows)} hollows"
            + ("" if wall.closes else ", open (rays may pass from cell to cell)"),
        ]
        if self.tracer is not None:
            flagged = {k: n for k, n in self.tracer.counts.items() if n and k != "escaped"}
            lines.append(
                f"rays       {sum(self.tracer.counts.values())} traced, not escaped: {flagged or 'none'}; mean collisions "
                f"{self.tracer.mean_collisions.value:.5f} +- {self.tracer.mean_collisions.error:.1g} "
                f"(Kac: {self.tracer.expected_collisions:.5f}, z = {self.tracer.z_score:+.2f})"
            )
        lines += [
            f"law P~     {self.matrix!r}",
            f"symmetry   {self.matrix.symmetry_defect()}",
            f"rows       {self.matrix.stochastic_defect()}",
            f"gap        {self.gap}",
        ]
        if self.specular_gap is not None:
            lines.append(f"           {self.specular_gap}")
        values = ", ".join(f"{v:.6g}" for v in self.spectrum.values[:6])
        lines += [
            f"spectrum   {values}, ... ({self.spectrum.convention} convention, {self.spectrum.method})",
            f"disk       mass {disk.mass:g}, inertia {disk.inertia:g}: foreshortening {disk.foreshortening:.6g}",
            f"collision  K = delta x P~ x delta(pi - psi), P~ of the foreshortened wall: {self.collision_matrix!r}",
            f"           gap of that P~: {self.collision_gap}",
            f"           energy kept to {self.conservation['energy_defect']:.1e}, "
            f"-m v1 + J omega to {self.conservation['rolling_momentum_defect']:.1e} (relative)",
        ]
        return "\n".join(lines)

    def save(self, folder: str | Path, *, overwrite: bool = False) -> list[Path]:
        """Write the pictures, the matrix with its metadata, and the study as JSON; returns the paths.

        Raises
        ------
        FileExistsRefusal
            If one of the files exists and ``overwrite`` is False; nothing is written then.
        InputError
            If the folder cannot be made or written.
        """
        target = prepare_folder(folder, overwrite=overwrite)
        paths = [target / name for name in (*PICTURES, *DATA)]
        for path, draw in zip(paths, (self._draw_wall, self._draw_kernel, self._draw_spectrum, self._draw_collision),
                              strict=False):  # fmt: skip
            _save_picture(path, draw)
        self.matrix.save(target / "kernel.npz", overwrite=True)
        (target / "study.json").write_text(self.to_json() + "\n", encoding="utf-8")
        return paths

    def _draw_wall(self, ax: Any) -> None:
        # spread the rays over the largest hollow, at angles that show single and multiple bounces
        low, high = (0.0, self.wall.period)
        if self.wall.hollows:
            widest = max(self.wall.hollows, key=lambda hollow: hollow.right - hollow.left)
            low, high = widest.left, widest.right
        x = low + (high - low) * (np.arange(PICTURE_RAYS) + 0.5) / PICTURE_RAYS
        theta = np.linspace(2.4, 0.8, PICTURE_RAYS)
        ray = trace(self.wall, x, theta)
        shown = ray.escaped & (ray.collisions <= PICTURE_BOUNCES)
        draw_wall(self.wall, x[shown], theta[shown], ax=ax)
        ax.set_title(f"{self.name} and {int(shown.sum())} rays")

    def _draw_kernel(self, ax: Any) -> None:
        self.matrix.plot(ax)
        ax.set_title(f"Reflection law of {self.name}")

    def _draw_spectrum(self, ax: Any) -> None:
        self.spectrum.plot(ax)

    def _draw_collision(self, ax: Any) -> None:
        from .study_picture import draw_outgoing_velocities

        draw_outgoing_velocities(self.collision, ax)


def study_wall(
    wall: Wall,
    name: str = "wall",
    disk: Disk | None = None,
    *,
    tolerance: float = 1e-4,
    bins: int = BINS,
    rng: np.random.Generator | None = None,
) -> Study:
    """Study a wall: trace it, make its law and matrix, test the symmetry, find the gap, collide a disk with it.

    Parameters
    ----------
    wall : Wall
    name : str
        What the wall is called in summaries and titles.
    disk : Disk, optional
        By default the uniform disk, mass 1 and inertia 1/2.
    tolerance : float
        Error asked of the gaps; what was reached is reported.
    bins : int
        Size of the matrix.
    rng : numpy.random.Generator, optional
        ``np.random.default_rng(0)`` by default, so that a study repeats.

    Returns
    -------
    Study
    """
    from tqdm import tqdm

    rng = rng or np.random.default_rng(0)
    disk = disk or Disk()
    # silent where standard error is not a terminal, and in the first two seconds
    with tqdm(total=6, desc=name, delay=2, disable=None, leave=False) as progress:
        tracer = _check_tracer(wall, rng) if wall.hollows else None
        progress.update()
        law = WallLaw(wall)
        matrix = discretise(law, Bins(bins), rng=rng)
        progress.update()
        gap = spectral_gap(law, tolerance, rng)
        progress.update()
        specular_gap = spectral_gap(law.in_specular_frame(), tolerance, rng) if wall.is_mirror_symmetric else None
        progress.update()
        found = gap.spectrum if gap.spectrum is not None else spectrum(matrix, k=10)
        collision = CollisionLaw.from_wall(wall, disk)
        collision_matrix = discretise(collision.law, Bins(bins), rng=rng)
        progress.update()
        collision_gap = spectral_gap(collision.law, tolerance, rng)
        progress.update()
    return Study(
        name, wall, disk, tracer, matrix, gap, specular_gap, found, collision, collision_matrix, collision_gap,
        _conservation(collision, rng),
    )  # fmt: skip


def prepare_folder(folder: str | Path, *, overwrite: bool) -> Path:
    """Make the output folder, and refuse it where a file of an earlier study would be lost."""
    target = Path(folder)
    existing = [name for name in (*PICTURES, *DATA) if (target / name).exists()]
    if existing and not overwrite:
        raise FileExistsRefusal(f"{target}: {', '.join(existing)} exist; use another folder or --force to replace them")
    try:
        target.mkdir(parents=True, exist_ok=True)
        probe = target / ".asperity-probe"
        probe.touch()
        probe.unlink()
    except OSError as reason:
        raise InputError(f"{target}: cannot write there ({reason.strerror}); choose another folder") from reason
    return target


def _check_tracer(wall: Wall, rng: np.random.Generator) -> TracerCheck:
    """Trace rays that enter the hollows with the invariant measure."""
    widths = np.array([hollow.right - hollow.left for hollow in wall.hollows])
    lefts = np.array([hollow.left for hollow in wall.hollows])
    which = rng.choice(len(widths), CHECK_RAYS, p=widths / widths.sum())
    ray = trace(wall, lefts[which] + widths[which] * rng.random(CHECK_RAYS), SINE.sample(CHECK_RAYS, rng))
    boundary = wall.arc_length - wall.flat_top
    mean = Estimate(
        float(np.mean(ray.collisions)), float(np.std(ray.collisions, ddof=1) / np.sqrt(CHECK_RAYS)), "estimate",
        f"one standard error of {CHECK_RAYS} rays",
    )  # fmt: skip
    return TracerCheck(ray.counts(), mean, float(boundary / widths.sum()))


def _conservation(collision: CollisionLaw, rng: np.random.Generator) -> dict[str, float]:
    """Largest relative change of energy and of rolling momentum over sampled collisions."""
    velocity = rng.normal(size=(4096, 3))
    velocity[:, 1] = -np.abs(velocity[:, 1])
    disk = collision.disk
    outgoing = collision.sample(velocity, rng)
    energy = disk.inner(velocity, velocity)
    scale = np.sqrt((disk.mass + disk.inertia) * energy)
    return {
        "energy_defect": float(np.max(np.abs(disk.inner(outgoing, outgoing) / energy - 1.0))),
        "rolling_momentum_defect": float(
            np.max(np.abs(disk.rolling_momentum(outgoing) - disk.rolling_momentum(velocity)) / scale)
        ),
    }


def _save_picture(path: Path, draw: Any) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 5.0), layout="constrained")
    draw(figure.subplots())
    figure.savefig(path, dpi=150)


def _estimate(number: Estimate) -> dict[str, Any]:
    return {"value": number.value, "error": _finite(number.error), "kind": number.kind, "method": number.method}


def gap_as_dict(gap: SpectralGap) -> dict[str, Any]:
    """A gap as plain numbers and strings, ready for JSON."""
    return {**_estimate(gap), "verdict": gap.verdict, "convention": gap.convention, "evidence": list(gap.evidence)}


def _matrix(matrix: KernelMatrix) -> dict[str, Any]:
    symmetry, rows = matrix.symmetry_defect(), matrix.stochastic_defect()
    return {
        "basis": repr(matrix.basis), "method": matrix.method, "samples": matrix.samples,
        "frobenius_error": _estimate(matrix.error),
        "symmetry_defect": {"value": float(symmetry), "norm": symmetry.norm, "z_score": _finite(symmetry.z_score)},
        "stochastic_defect": {"value": float(rows), "norm": rows.norm},
    }  # fmt: skip


def _finite(value: Any) -> Any:
    """JSON has no infinity: an unknown error is null."""
    if value is None:
        return None
    if np.ndim(value):
        return [_finite(entry) for entry in value]
    return float(value) if np.isfinite(value) else None
