"""The results of a study of a wall as plain fields, what its gap implies, and its report as text and as JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from textwrap import shorten
from typing import Any

import numpy as np

from ..core.checks import Floats
from ..core.errors import AsperityError
from ..core.estimates import NORMAL_95, Estimate, Summary, estimate_as_dict, finite, with_error
from ..core.rounding import EPS
from ..core.version import __version__
from ..geometry import WALLS, Disk, Wall
from ..kernels import CollisionLaw, KernelMatrix, Law
from ..spectral import SpectralGap, Spectrum, mean_squared_slope
from ..spectral.bounds.enclosure import Enclosures
from ..spectral.consequences.diffusion import Diffusivity, logarithmic_slope
from ..spectral.consequences.mixing import relaxation_time, slem_from_gap
from ..spectral.consequences.momentum_accommodation import WEIGHTS, Accommodation
from ..spectral.eigenvalues.spectra import CONVENTIONS


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

    def as_dict(self) -> dict[str, Any]:
        """Plain values."""
        return {
            "rays": dict(self.counts), "mean_collisions": estimate_as_dict(self.mean_collisions),
            "kac": self.expected_collisions, "z_score": self.z_score,
        }  # fmt: skip

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
    facets : Law or None
        The law of the facets; None for mirrors.
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
    facets: Law | None
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
    collision_gap: SpectralGap | None
    conservation: Mapping[str, float]
    refusals: Mapping[str, str]
    consequences: Consequences
    accommodation: Accommodation | None

    @property
    def title(self) -> str:
        """The name of the wall with its parameters, and the law of facets that are no mirrors."""
        name = title_of(self.name)
        return name if self.facets is None else f"{name}, facets {self.facets!r}"

    @property
    def resistance(self) -> Estimate | None:
        """That of a tumbling body with this wall, where a smooth one has 1; None where accommodation is."""
        return None if self.accommodation is None else resistance_from(self.accommodation)


def title_of(name: str) -> str:
    """What pictures call a wall: of a named one its parameters too, of a file none of the options of its reader.

    Examples
    --------
    >>> title_of("focusing-arcs:half_angle=0.9"), title_of("line.txt:seam=step,units=um/nm"), title_of("a: b")
    ('focusing-arcs, half_angle = 0.9', 'line.txt', 'a: b')
    """
    file, _, options = name.partition(":")
    parts = [part.partition("=") for part in options.split(",")]
    if not all(equals for _, equals, _ in parts):
        return name
    return ", ".join([file, *(f"{key} = {value}" for key, _, value in parts if file in WALLS)])


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


AVERAGES = ("tangential", "normal", "maxwell_fraction", "misfit")
# Rays of one wall: 4.5 standard errors are exceeded once in 150,000 walls whose every part is reachable.
KAC_Z = 4.5
# Characters; with ``verbose`` the whole reason is shown.
LONGEST_REFUSAL = 110
# Pieces of a curved wall, above which it is a profile: the named curved walls have at most five.
MOST_PIECES = 8


def report_of(study: StudyResult, by_angle: bool, verbose: bool) -> str:
    """What was found, one fact a line; an error in brackets belongs to the last digits.

    With ``verbose`` the lines below a fact say how it was found. A disk that was given comes first. Of a profile the
    momentum that it takes on comes before its gap.
    """
    wall, disk, found = study.wall, study.disk, study.consequences
    unit = f" {wall.unit}" if wall.unit else ""
    cells = counted(len(wall.hollows), "hollow") if wall.closes else "open: rays may pass from cell to cell"
    islands = f", {counted(len(wall.islands), 'island')}" if wall.islands else ""
    symmetry = "mirror-symmetric" if wall.is_mirror_symmetric else "not mirror-symmetric"
    # of every block the first line is the fact
    blocks = {
        "wall": [
            f"{study.name}: period {wall.period:g}{unit}, depth {wall.depth:.6g}{unit}, "
            f"{counted(len(wall.pieces), 'piece')}, {symmetry}",
            f"length {wall.arc_length:.6g}{unit}, {cells}{islands}",
        ],
    }
    if study.facets is not None:
        blocks["facets"] = [f"{study.facets!r}, at each hit"]
    of_disk = {
        "disk": [
            f"mass {disk.mass:g}, inertia ratio {disk.inertia_ratio:g}, radius {disk.radius:g}: feels the wall "
            f"{1.0 / disk.foreshortening:.4g} times as deep"
        ],
        "collision": gap_lines(study, "collision_gap", "gap of that wall "),
        "conserved": [
            f"energy to {study.conservation['energy_defect']:.0e}, rolling momentum to "
            f"{study.conservation['rolling_momentum_defect']:.0e}"
        ],
    }
    of_profile = wall.is_polygonal or len(wall.pieces) > MOST_PIECES
    blocks |= of_disk if study.disk_given else {}
    blocks |= _momentum_lines(study) if of_profile or by_angle or verbose else {}
    blocks |= {
        "rays": ray_lines(study.tracer),
        "law": matrix_lines(study.matrix),
        "gap": gap_lines(study, "gap"),
        "": gap_lines(study, "specular_gap"),
    }
    blocks |= {"spectrum": _spectrum_lines(study), "enclosed": _enclosed_lines(study)} if verbose else {}
    blocks |= {"relaxation": _relaxation_lines(found), "diffusion": _diffusion_lines(found)}
    blocks |= of_disk if verbose or not (study.disk_given or of_profile) else {}
    return blocks_as_text(blocks, verbose, study.accommodation if by_angle else None)


def blocks_as_text(blocks: Mapping[str, list[str]], verbose: bool, by_angle: Any) -> str:
    """Facts with their titles, with ``verbose`` the lines below each too, and accommodation at angles if given."""
    shown = {title: lines if verbose else [_short(lines[0])] for title, lines in blocks.items()}
    shown |= {"by angle": [f"{angle}: {words}" for angle, words in by_angle.by_angle().items()]} if by_angle else {}
    return "\n".join(
        f"{'' if number else title:11s}{line}" for title, lines in shown.items() for number, line in enumerate(lines)
    )


def _short(line: str) -> str:
    return shorten(line, LONGEST_REFUSAL, placeholder=" ...") if line.startswith("refused: ") else line


def _momentum_lines(study: StudyResult) -> dict[str, list[str]]:
    """The momentum of a gas that the wall takes on, and the resistance of a body with it."""
    found, flatness = study.accommodation, study.consequences.flatness
    if found is None:
        return {"momentum": [f"refused: {study.refusals['accommodation']}"]}
    best = "has" if 0.0 < found.maxwell_fraction.value < 1.0 else "has, of those from 0 to 1,"
    slope = f"; mean squared slope {flatness:.6g}" if math.isfinite(flatness) else ""
    return {
        "momentum": [
            f"accommodation tangential {found.tangential}, normal {found.normal}",
            f"{found.tangential.kind}: {found.tangential.method}",
        ],
        "resistance": [f"{study.resistance} times that of a smooth tumbling body{slope}"],
        "Maxwell": [f"fraction {found.maxwell_fraction} {best} the nearest mean velocities, misfit {found.misfit}"],
    }


def ray_lines(tracer: TracerCheck | None) -> list[str]:
    """How the rays of a sample ended, beside Kac's formula."""
    if tracer is None:
        return ["not tested: the wall is flat or open"]
    total, escaped = sum(tracer.counts.values()), tracer.counts.get("escaped", 0)
    count = f"all {total}" if escaped == total else f"{escaped} of {total}"
    found, expected = tracer.mean_collisions, tracer.expected_collisions
    flagged = [f", {n} {status.replace('_', ' ')}" for status, n in tracer.counts.items() if n and status != "escaped"]
    lines = [
        f"{count} left the wall after {found} collisions on average, Kac's formula {expected:.6g}",
        f"length of boundary over opening (Kac): z = {tracer.z_score:+.2f}{''.join(flagged)}",
    ]
    if tracer.z_score < -KAC_Z:
        lines.append(
            "Kac's formula presumes that every ray inside can come from the opening; "
            f"{100.0 * (1.0 - found.value / expected):.3g} % of the boundary's rays cannot if the tracer is right, as "
            "those that stay in a mushroom's cap for ever"
        )
    elif tracer.z_score > KAC_Z:
        lines.append("more collisions than Kac's formula allows: do not trust this wall's numbers")
    return lines


def matrix_lines(matrix: KernelMatrix) -> list[str]:
    """A matrix with its error and its symmetry."""
    symmetry, rows = matrix.symmetry_defect(), matrix.stochastic_defect()
    missed = f", tolerance {matrix.requested_tolerance:g} NOT met" if matrix.tolerance_met is False else ""
    rays = f", {matrix.samples} rays" if matrix.samples else ""
    noise = "" if symmetry.z_score is None else f" (z = {symmetry.z_score:+.2f} against the sampling noise)"
    return [
        f"{matrix.basis!r} by {matrix.method}, Frobenius error {float(matrix.error):.2g}{missed}",
        f"{matrix.error.kind}{rays}; asymmetry {float(symmetry):.2g}{noise}, rows sum to 1 within {float(rows):.2g}",
    ]


def gap_lines(study: Any, which: str, name: str = "") -> list[str]:
    """A gap of a study, or why it is missing."""
    gap: SpectralGap | None = getattr(study, which)
    if gap is None:
        return [f"refused: {study.refusals[which]}"]
    words = CONVENTIONS[gap.convention]
    if gap.self_adjoint:
        fact = f"{'0' if gap.verdict == 'no gap' else gap} {gap.verdict} ({words})"
    else:
        norm = Estimate(1.0 - gap.value, gap.error, gap.kind, gap.method)
        fact = f"norm {norm} on functions of mean 0, not self-adjoint ({words})"
    met = "met" if gap.error <= study.tolerance else "NOT met"
    # in brackets an error as large as the gap leaves none of its digits
    how = f"{gap.value:.4g} with error {gap.error:.2g}, tolerance {study.tolerance:g} {met}; {gap.kind}: {gap.method}"
    return [f"{name}{fact}", how, *gap.evidence]


def _relaxation_lines(found: Consequences) -> list[str]:
    slem, time = found.slem, found.relaxation_time
    if slem is None or time is None:
        return ["refused with the gap"]
    fact = f"{time} steps"
    if not math.isfinite(time.error):
        fact = "infinite: a modulus in the spectrum is 1" if found.without_gap else "not known: slem may be 1"
    return [fact, f"slem {slem} ({slem.kind}: {slem.method})"]


def _diffusion_lines(consequences: Consequences) -> list[str]:
    found = consequences.diffusion
    if found is None:
        return [f"refused: {consequences.refusal}"]
    return [
        f"D = {found}; r = 1, speed 1, tau the exit time",
        f"eta = {with_error(found.eta, found.eta_error)}, zeta = {with_error(found.zeta, found.zeta_error)} "
        f"({found.kind}: {found.method})",
    ]


def _spectrum_lines(study: StudyResult) -> list[str]:
    """Eigenvalues with their errors; then how they were found."""
    found = study.spectrum
    if found is None:
        return [f"refused: {study.refusals['spectrum']}"]
    numbers = found.estimates()
    # the second largest modulus may be that of the most negative
    order = sorted(range(len(numbers)), key=lambda i: (i > 0, -abs(numbers[i].value)))
    shown = [str(numbers[i]) + ("" if found.parity[i] == "none" else f" {found.parity[i]}") for i in order]
    of_grid = study.gap is not None and study.gap.verdict == "no gap"
    caution = "; they belong to the grid, for the law has no gap" if of_grid else ""
    return [
        f"the {len(shown)} of largest modulus: {', '.join(shown)} ({found.convention} convention, estimate: "
        f"{numbers[0].method}{caution})",
        f"completeness: {found.completeness}",
    ]


def _enclosed_lines(study: StudyResult) -> list[str]:
    found = study.enclosures
    return [f"refused: {study.refusals['enclosures']}"] if found is None else enclosures_as_text(found)


def enclosures_as_text(found: Enclosures) -> list[str]:
    """One line an enclosure, to paste into a paper, and one line of what they have in common."""
    return [f"{found.convention} convention; {found.method}", *map(str, found)]


def counted(number: int, word: str) -> str:
    """A number of things."""
    return f"{number} {word}{'' if number == 1 else 's'}"


def _accommodation(found: Accommodation) -> dict[str, Any]:
    """Plain values; a coefficient that is not defined is None."""
    averages = {name: estimate_as_dict(getattr(found, name)) for name in AVERAGES}
    columns = {
        "incidence_deg": found.incidence_deg, "tangential": found.tangential_at,
        "tangential_error": found.tangential_errors, "normal": found.normal_at, "normal_error": found.normal_errors,
    }  # fmt: skip
    return {**averages, "at": rows_of(columns), "kind_at": found.kind_at}


def rows_of(columns: Mapping[str, Floats]) -> list[dict[str, Any]]:
    """Arrays by name as rows of plain values; what is infinite or not defined is None."""
    return [dict(zip(columns, map(finite, row), strict=True)) for row in np.transpose(list(columns.values())).tolist()]


def study_as_dict(study: StudyResult) -> dict[str, Any]:
    """Plain numbers and strings, ready for JSON; ``docs/command-line.md`` lists the keys."""
    wall, disk, found = study.wall, study.disk, study.spectrum
    gaps = [None if gap is None else gap_as_dict(gap) for gap in (study.gap, study.specular_gap, study.collision_gap)]
    return {
        "asperity": __version__,
        "tolerance": study.tolerance,
        "wall": {
            "name": study.name, "period": wall.period, "depth": wall.depth, "arc_length": wall.arc_length,
            "pieces": len(wall.pieces), "hollows": len(wall.hollows), "islands": len(wall.islands),
            "closes": wall.closes, "polygonal": wall.is_polygonal, "mirror_symmetric": wall.is_mirror_symmetric,
            "facets": None if study.facets is None else repr(study.facets),
        },
        "tracer": study.tracer and study.tracer.as_dict(),
        "law": matrix_as_dict(study.matrix),
        "gap": {"paper": gaps[0], "specular": gaps[1]},
        "eigenvalues": None if found is None else {
            "convention": found.convention, "basis": repr(found.basis), "method": found.estimates()[0].method,
            "values": found.values.tolist(), "errors": finite(found.errors.total()), "kind": "estimate",
            "parity": list(found.parity), "completeness": found.completeness,
            **{part: finite(getattr(found.errors, part)) for part in ("algebraic", "discretisation", "sampling")},
        },
        "enclosures": study.enclosures and enclosures_as_list(study.enclosures),
        "collision": {
            "mass": disk.mass, "inertia_ratio": disk.inertia_ratio, "radius": disk.radius,
            "foreshortening": disk.foreshortening, "gap": gaps[2], **study.conservation,
        },
        "consequences": study.consequences.as_dict(),
        "accommodation": study.accommodation and _accommodation(study.accommodation),
        "resistance": study.resistance and estimate_as_dict(study.resistance),
        "refusals": dict(study.refusals),
    }  # fmt: skip


def gap_as_dict(gap: SpectralGap) -> dict[str, Any]:
    """A gap as plain values, ready for JSON."""
    return {
        **estimate_as_dict(gap), "verdict": gap.verdict, "convention": gap.convention, "evidence": list(gap.evidence),
        "self_adjoint": gap.self_adjoint,
    }  # fmt: skip


def quotation(gap: SpectralGap) -> str:
    """One line to paste into a paper: value, error, kind, verdict, convention, version."""
    number = "0" if gap.verdict == "no gap" else gap
    what = "spectral gap" if gap.self_adjoint else "not known to be self-adjoint, 1 - norm on functions of mean 0:"
    return f"{what} {number} ({gap.kind}), {gap.verdict}, {gap.convention} convention; asperity {__version__}"


def enclosures_as_list(found: Enclosures) -> list[dict[str, Any]]:
    """Enclosures as plain values, ready for JSON."""
    return [{**asdict(item), "method": found.method, "convention": found.convention} for item in found]


def matrix_as_dict(matrix: KernelMatrix) -> dict[str, Any]:
    """What is known of a matrix as plain values, ready for JSON."""
    symmetry, rows = matrix.symmetry_defect(), matrix.stochastic_defect()
    return {
        "basis": repr(matrix.basis), "method": matrix.method, "samples": matrix.samples,
        "frobenius_error": estimate_as_dict(matrix.error), "tolerance_met": matrix.tolerance_met,
        "symmetry_defect": {"value": float(symmetry), "norm": symmetry.norm, "z_score": finite(symmetry.z_score)},
        "stochastic_defect": {"value": float(rows), "norm": rows.norm},
    }  # fmt: skip
