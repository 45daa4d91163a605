"""A whole study of a surface that is rough in two directions: its law, its accommodation and its gap."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..core.checks import Rng, generator, instance, positive_number
from ..core.estimates import Estimate, estimate_as_dict
from ..core.long_runs import progress_bar
from ..core.tables import verbatim
from ..core.version import __version__
from ..geometry.surfaces.surface import FEWEST
from ..kernels import KernelMatrix, SurfaceLaw, Zernike, discretise
from ..spectral import SpectralGap, accommodation, spectral_gap
from ..spectral.consequences.surface_accommodation import SurfaceAccommodation
from .pictures import Drawings
from .result import (
    TracerCheck,
    blocks_as_text,
    gap_as_dict,
    gap_lines,
    matrix_as_dict,
    matrix_lines,
    ray_lines,
    rows_of,
    title_of,
)
from .study import CHECK_RAYS, TOLERANCE, SavedStudy, tracer_check

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Degree of the saved matrix; incidence in degrees of the coefficients, not near the pole of the normal one at 48, and
# of the drawn directions.
DEGREE, INCIDENCE, DRAWN = 8, (5, 15, 25, 35, 60, 70, 80, 85), 60.0
NAMES = ("tangential", "normal", "sideways")


@dataclass(frozen=True, repr=False)
class SurfaceStudy(SavedStudy):
    """Everything that `study_surface` found; ``summary()`` is text, ``to_json()`` a string, ``save`` writes files.

    Attributes
    ----------
    name : str
    law : SurfaceLaw
    tolerance : float
        What was asked of the accommodation and of the gap.
    tracer : TracerCheck
        With Kac's formula: area of the surface over that of the plane below it.
    matrix : KernelMatrix
        Of the law in Zernike functions of degree 8.
    gap : SpectralGap
    accommodation : SurfaceAccommodation
    quarters : tuple of Estimate
        The tangential coefficients of the quarters of the map; none if it is too small.
    """

    name: str
    law: SurfaceLaw
    tolerance: float
    tracer: TracerCheck
    matrix: KernelMatrix
    gap: SpectralGap
    accommodation: SurfaceAccommodation
    quarters: tuple[Estimate, ...]
    pictures = ("surface.png", "directions.png", "accommodation.png")

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers and strings, ready for JSON; ``docs/command-line.md`` lists the keys."""
        surface, found = self.law.surface, self.accommodation
        columns = {"incidence_deg": found.incidence_deg, "azimuth_deg": found.azimuth_deg}
        for name in NAMES:
            columns |= {name: getattr(found, f"{name}_at"), f"{name}_error": getattr(found, f"{name}_errors")}
        return {
            "asperity": __version__,
            "tolerance": self.tolerance,
            "surface": {
                "name": self.name, "points": list(surface.heights.shape), "periods": list(surface.periods),
                "unit": surface.unit, "rms_height": surface.rms_height, "rms_slope": surface.rms_slope,
                "area": surface.area, "orientation": self.law.orientation,
            },
            "tracer": self.tracer.as_dict(),
            "law": matrix_as_dict(self.matrix),
            "gap": gap_as_dict(self.gap),
            "accommodation": {
                **{name: estimate_as_dict(getattr(found, name)) for name in (*NAMES[:2], "maxwell_fraction")},
                "tensor": found.tensor.tolist(), "tensor_errors": found.tensor_errors.tolist(),
                "at": rows_of(columns),
            },
            "quarters": [estimate_as_dict(one) for one in self.quarters],
        }  # fmt: skip

    def summary(self, *, verbose: bool = False, by_angle: bool = False) -> str:
        """The study as some seven short lines; with ``verbose`` also methods and evidence, ``by_angle`` at angles."""
        surface, found = self.law.surface, self.accommodation
        (n, m), (width, length), unit = surface.heights.shape, surface.periods, f" {surface.unit}".rstrip()
        turn = "random orientation" if self.law.orientation == "random" else f"orientation {self.law.orientation:g}"
        blocks = {
            "surface": [
                f"{self.name}: {n} x {m} heights, periods {width:g} x {length:g}{unit}, {turn}",
                *(["followed by its mirror images in both directions, to be periodic"] if surface.is_mirrored else []),
                f"rms height {surface.rms_height:.6g}{unit}, rms slope {surface.rms_slope:.6g}",
            ],
            "rays": ray_lines(self.tracer),
            "momentum": [
                f"accommodation tangential {found.tangential}, normal {found.normal}",
                f"{found.tangential.kind}: {found.tangential.method}",
            ],
            "Maxwell": [f"fraction {found.maxwell_fraction} has the nearest mean velocities"],
        }
        if self.quarters:
            blocks["quarters"] = [f"of the map alone: tangential {', '.join(map(str, self.quarters))}"]
        blocks |= {"law": matrix_lines(self.matrix), "gap": gap_lines(self, "gap")}
        return blocks_as_text(blocks, verbose, found if by_angle else None)

    def _drawings(self) -> Drawings:
        return ((self._draw_surface, (7.0, 5.6)), (self._draw_directions, (6.4, 5.0)), (self._draw_angles, (6.4, 4.6)))

    def _draw_surface(self, ax: Axes) -> None:
        """The map with rays that come from three sides."""
        surface, rays = self.law.surface, [[0.96, 0.3, -1.0], [-0.74, 0.68, -1.0], [-0.21, -0.98, -1.0]]
        surface.plot(np.outer([0.25, 0.45, 0.7], surface.periods), rays, ax)
        ax.set_title(verbatim(f"{title_of(self.name)}\ndot: a ray enters, ring: it leaves"), fontsize=11)

    def _draw_directions(self, ax: Axes) -> None:
        self.law.plot([np.sin(np.radians(DRAWN)), 0.0, -np.cos(np.radians(DRAWN))], ax)
        ax.set_title(f"Outgoing velocities at {DRAWN:g} degrees of incidence", fontsize=11)

    def _draw_angles(self, ax: Axes) -> None:
        found = self.accommodation
        ax.errorbar(found.incidence_deg, found.tangential_at, found.tangential_errors, marker="o", label="tangential")
        # no line through the pole of the normal coefficient, at cos(incidence) = 2/3
        beyond = np.cos(np.radians(found.incidence_deg)) < 2.0 / 3.0
        for side, label in ((~beyond, "normal"), (beyond, None)):
            degrees, error = np.asarray(found.incidence_deg)[side], found.normal_errors[side]
            ax.errorbar(degrees, found.normal_at[side], error, marker="s", color="C1", label=label)
        ax.set(xlabel="incidence (degrees from the normal)", ylabel="accommodation of momentum")
        ax.legend()


def study_surface(
    law: SurfaceLaw, name: str = "surface", *, tolerance: float = TOLERANCE, rng: Rng = None, progress: bool = True,
    incidence_deg: ArrayLike | None = None,
) -> SurfaceStudy:  # fmt: skip
    """Study a surface: trace it, find accommodation, of its quarters too, and the gap of its law.

    Parameters
    ----------
    law : SurfaceLaw
        Of the surface at an orientation.
    name : str
        What the surface is called in summaries and titles.
    tolerance : float
        Error asked of the accommodation and of the gap; what was reached is reported.
    rng : None, int or numpy.random.Generator
        ``np.random.default_rng(0)`` by default, so that a study repeats.
    progress : bool
        Whether a bar is shown on a terminal after two seconds.
    incidence_deg : array_like, optional
        Angles of the accommodation of momentum, in degrees from the normal; nine by default.

    Returns
    -------
    SurfaceStudy

    Raises
    ------
    InputError
        If the tolerance or an angle is unsuitable.
    AccuracyError
        If more than 1e-4 of the rays do not escape.

    Examples
    --------
    >>> from asperity import geometry as geo, kernels as ker
    >>> report = study_surface(ker.SurfaceLaw(geo.Surface([[0.0], [1.0]])), tolerance=0.1, incidence_deg=[30.0])
    >>> round(report.tracer.expected_collisions**2, 12), report.gap.verdict
    (2.0, 'no gap')
    """
    instance("law", law, SurfaceLaw, "ker.SurfaceLaw(geo.Surface([[0.0, 1.0]]))")
    wanted, source, surface = positive_number("tolerance", tolerance), generator(rng, 0), law.surface
    degrees = INCIDENCE if incidence_deg is None else incidence_deg
    with progress_bar(4, "part", name, shown=progress) as bar:
        momentum = accommodation(law, wanted, rng=source, incidence_deg=degrees)
        bar.update()
        parts = surface.quarters() if min(surface.heights.shape) > 2 * FEWEST else ()
        quarters = tuple(accommodation(SurfaceLaw(one), max(wanted, 1e-2), rng=source).tangential for one in parts)
        bar.update()
        points = source.random((CHECK_RAYS, 4))
        incoming = law.random_map()(points)[0]
        kac = surface.area / float(np.prod(surface.periods))
        tracer = tracer_check(surface.trace(points[:, :2] * surface.periods, incoming), kac)
        matrix = discretise(law, Zernike(DEGREE), tolerance=10.0 * wanted, rng=source)
        bar.update()
        gap = spectral_gap(law, wanted, source)
        bar.update()
    return SurfaceStudy(name, law, wanted, tracer, matrix, gap, momentum, quarters)
