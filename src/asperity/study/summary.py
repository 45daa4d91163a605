"""A study as ten short lines."""

from __future__ import annotations

from textwrap import shorten
from typing import TYPE_CHECKING

from ..core.estimates import Estimate, compact
from .report import counted

if TYPE_CHECKING:
    from ..kernels import KernelMatrix
    from ..spectral import SpectralGap
    from .result import StudyResult, TracerCheck

# Characters; the detailed report has the whole reason.
LONGEST_REFUSAL = 110
CONVENTIONS = {"paper": "retroreflection is the identity", "specular": "specular reflection is the identity"}


def summary_of(study: StudyResult) -> str:
    """What was found, one fact a line; an error in brackets belongs to the last digits."""
    wall, disk, found = study.wall, study.disk, study.consequences
    symmetry = "mirror-symmetric" if wall.is_mirror_symmetric else "not mirror-symmetric"
    refused, unit = study.refusals.get, f" {wall.unit}" if wall.unit else ""
    lines = {
        "wall": f"{study.name}: period {wall.period:g}{unit}, depth {wall.depth:.6g}{unit}, "
        f"{counted(len(wall.pieces), 'piece')}, {symmetry}",
        "rays": _rays(study.tracer),
        "law": _law(study.matrix),
        "gap": _gap(study.gap, refused("gap", "not asked for")),
        "": _gap(study.specular_gap, refused("specular_gap", "not asked for")),
        "relaxation": _relaxation(found.relaxation_time, found.without_gap),
        "diffusion": _refused(found.refusal)
        if found.diffusion is None
        else f"D = {found.diffusion}; half-width 1, speed 1, tau the exit time",
        "disk": f"mass {disk.mass:g}, inertia {disk.inertia:g}: feels the wall {1.0 / disk.foreshortening:.4g} times "
        "as deep",
        "collision": f"gap of that wall {_gap(study.collision_gap, refused('collision_gap', 'not asked for'))}",
        "conserved": f"energy to {study.conservation['energy_defect']:.0e}, rolling momentum to "
        f"{study.conservation['rolling_momentum_defect']:.0e}",
    }
    return "\n".join(f"{title:11s}{line}" for title, line in lines.items())


def _refused(reason: str) -> str:
    return shorten(f"refused: {reason}", LONGEST_REFUSAL, placeholder=" ...")


def _rays(tracer: TracerCheck | None) -> str:
    if tracer is None:
        return "not tested: the wall is flat or open"
    total, escaped = sum(tracer.counts.values()), tracer.counts.get("escaped", 0)
    count = f"all {total}" if escaped == total else f"{escaped} of {total}"
    return (
        f"{count} left the wall after {compact(tracer.mean_collisions)} collisions on average, "
        f"Kac's formula {tracer.expected_collisions:.6g}"
    )


def _law(matrix: KernelMatrix) -> str:
    met = "" if matrix.tolerance_met is not False else f", tolerance {matrix.requested_tolerance:g} NOT met"
    return f"{matrix.basis!r} by {matrix.method}, Frobenius error {float(matrix.error):.2g}{met}"


def _gap(gap: SpectralGap | None, refusal: str) -> str:
    if gap is None:
        return _refused(refusal)
    words = CONVENTIONS[gap.convention]
    if not gap.self_adjoint:
        norm = compact(Estimate(1.0 - gap.value, gap.error, gap.kind, gap.method))
        return f"norm {norm} on functions of mean 0, not self-adjoint ({words})"
    number = "0" if gap.verdict == "no gap" else compact(gap)
    return f"{number} {gap.verdict} ({words})"


def _relaxation(time: Estimate | None, without_gap: bool) -> str:
    if time is None:
        return "refused with the gap"
    if time.error == float("inf"):
        return f"none: a modulus in the spectrum {'is' if without_gap else 'may be'} 1"
    return f"{compact(time)} steps"
