"""The results of a study of a wall, as plain fields, and what its gap implies: relaxation, diffusion, flatness."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ..core.errors import AsperityError
from ..core.estimates import NORMAL_95, Estimate, Summary, estimate_as_dict, finite
from ..core.rounding import EPS
from ..geometry import Disk, Wall
from ..kernels import CollisionLaw, KernelMatrix, Law
from ..spectral import SpectralGap, Spectrum, mean_squared_slope
from ..spectral.bounds.enclosure import Enclosures
from ..spectral.consequences.diffusion import Diffusivity, logarithmic_slope
from ..spectral.consequences.mixing import relaxation_time, slem_from_gap
from ..spectral.consequences.momentum_accommodation import WEIGHTS, Accommodation


@dataclass(frozen=True, repr=False)
class TracerCheck(Summary):
    """What a sample of rays says of the tracer on this wall.

    Attributes
    ----------
    counts : dict
        Rays by status.
    mean_collisions : Estimate
        Mean number of collisions of the rays that enter a hollow.
    expected_collisions : float
        |boundary of the hollows| / |openings|: Kac's formula for hollows all of whose boundary can be reached from the
        opening. Where a part cannot, as in the caps of mushrooms, the mean is smaller, by that part's fraction.
    """

    counts: Mapping[str, int]
    mean_collisions: Estimate
    expected_collisions: float

    @property
    def z_score(self) -> float:
        """Deviation of the mean from Kac's formula in standard errors; 0 where every ray has the same number."""
        deviation = self.mean_collisions.value - self.expected_collisions
        return deviation / self.mean_collisions.error * NORMAL_95 if self.mean_collisions.error > 0.0 else 0.0


@dataclass(frozen=True, repr=False)
class StudyResult(Summary):
    """Everything that `study_wall` found: the fields of a `Study`.

    Attributes
    ----------
    name : str
    wall : Wall
    disk : Disk
    disk_given : bool
        Whether somebody asked for this disk; the summary begins with it then.
    tolerance : float
        What was asked of the gaps, and of the image of every bin: times the root of their number in the Frobenius norm
        of the matrices.
    tracer : TracerCheck or None
        None for walls without hollows, and for open walls, whose rays pass from cell to cell.
    matrix : KernelMatrix
        P~ of the wall in bins.
    gap, specular_gap : SpectralGap or None
        Of P~ in the paper's and in Feres' convention; where the law is not known to be self-adjoint there, for want of
        a mirror axis, ``specular_gap.self_adjoint`` is False, and it is 1 - the contraction factor of functions of mean
        0. None where ``refusals`` says why.
    spectrum : Spectrum or None
        The ten eigenvalues of P~ of largest modulus; of the matrix in bins where the law has no gap.
    enclosures : Enclosures or None
        Intervals that hold eigenvalues of P~ itself; None where ``refusals`` says why.
    collision : CollisionLaw
    collision_matrix : KernelMatrix
        P~ of the foreshortened wall, in bins.
    collision_gap : SpectralGap or None
    conservation : dict
        Largest relative change of the kinetic energy and of the rolling momentum in sampled collisions.
    refusals : dict
        By the name of the attribute, why a spectral quantity is missing.
    consequences : Consequences
        Relaxation time, diffusivity of a channel, mean squared slope.
    accommodation : Accommodation or None
        Of momentum, at 32 angles or those asked for.
    """

    name: str
    wall: Wall
    disk: Disk
    disk_given: bool
    tolerance: float
    tracer: TracerCheck | None
    matrix: KernelMatrix
    gap: SpectralGap | None
    specular_gap: SpectralGap | None
    spectrum: Spectrum | None
    enclosures: Enclosures | None
    collision: CollisionLaw
    collision_matrix: KernelMatrix
    collision_gap: SpectralGap | None
    conservation: Mapping[str, float]
    refusals: Mapping[str, str]
    consequences: Consequences
    accommodation: Accommodation | None

    @property
    def resistance(self) -> Estimate | None:
        """That of a tumbling body with this wall, where a smooth one has 1; None where accommodation is."""
        return None if self.accommodation is None else resistance_from(self.accommodation)


def resistance_from(found: Accommodation) -> Estimate:
    """The resistance of a tumbling body, where a smooth one has 1.

    With c = cos(theta) and s = sin(theta), R = (3/4)(1 + <c, P c> + <s, P s>), and accommodation has both entries.
    """
    across, along = found.normal, found.tangential
    value = 1.0 + 0.75 * (WEIGHTS[0] * along.value - WEIGHTS[1] * across.value)
    error = 0.75 * (WEIGHTS[0] * along.error + WEIGHTS[1] * across.error) + EPS
    return Estimate(value, error, along.kind, along.method)


@dataclass(frozen=True, repr=False)
class Consequences(Summary):
    """What a study derives from the law and its gaps.

    Attributes
    ----------
    slem : Estimate or None
        The largest modulus in the spectrum off the constants; None where the gaps in both conventions are not known.
    relaxation_time : Estimate or None
        -1/ln(slem) in steps; its error is ``inf`` where slem may be 1.
    diffusion : Diffusivity or None
        The slope of L^2/tau against ln L for a long channel of half-width 1 and speed 1, tau the mean time to leave
        |x| < L, the upper wall the mirror image of the lower.
    flatness : float
        The mean squared slope h; ``inf`` for walls with vertical pieces or overhangs.
    refusal : str
        Why there is no diffusivity, or empty.
    """

    slem: Estimate | None
    relaxation_time: Estimate | None
    diffusion: Diffusivity | None
    flatness: float
    refusal: str = ""

    @property
    def without_gap(self) -> bool:
        """Whether it is certain that slem is 1."""
        return self.slem is not None and self.slem.value - self.slem.error >= 1.0

    def as_dict(self) -> dict[str, Any]:
        """Plain values; what is not known or infinite is None."""
        found = self.diffusion
        return {
            "slem": self.slem and estimate_as_dict(self.slem),
            "relaxation_time": self.relaxation_time and estimate_as_dict(self.relaxation_time),
            "diffusivity": found and {
                **estimate_as_dict(found), "eta": found.eta, "eta_error": finite(found.eta_error), "zeta": found.zeta,
                "zeta_error": finite(found.zeta_error), "arrangement": found.arrangement,
                "onset": finite(found.onset),
            },
            "mean_squared_slope": finite(self.flatness),
        }  # fmt: skip


def consequences_of(
    wall: Wall, law: Law, gap: SpectralGap | None, specular_gap: SpectralGap | None, found: Spectrum | None
) -> Consequences:
    """Derive what follows; a diffusivity that is infinite or out of reach is None, with the reason."""
    modulus_gap, diffusion, refusal = _modulus_gap(gap, specular_gap, found), None, ""
    slem, time = (modulus_gap and derived(modulus_gap) for derived in (slem_from_gap, relaxation_time))
    try:
        diffusion = logarithmic_slope(law, 1.0, 1.0, "mirror")
    except AsperityError as reason:
        refusal = str(reason)
    return Consequences(slem, time, diffusion, mean_squared_slope(wall), refusal)


def _modulus_gap(gap: SpectralGap | None, specular_gap: SpectralGap | None, found: Spectrum | None) -> Estimate | None:
    """1 - slem. The gaps see the upper end of the spectrum, and in the other convention minus the odd functions' lower
    end; the lower end on even functions is that of the spectrum that was computed.
    """
    if gap is None or specular_gap is None or found is None:
        return None
    if not specular_gap.self_adjoint:
        return specular_gap
    nearer = min(gap, specular_gap, key=float)
    lowest = int(found.values.argmin())
    if -found.values[lowest] > 1.0 - nearer.value + nearer.error:
        error = float(found.errors.total()[lowest])
        return Estimate(1.0 + float(found.values[lowest]), error, "estimate", f"least eigenvalue in {found.basis!r}")
    return Estimate(nearer.value, nearer.error, nearer.kind, f"gap in the {nearer.convention} convention")
