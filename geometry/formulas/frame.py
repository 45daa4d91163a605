"""Section 1.3.6: the frame of the disk, the sphere of velocities and its measures."""

from __future__ import annotations

from ...verification import Formula, Verdict, erratum, verified, verify
from ...verification.entry import Code
from ..kinetics import frame_rows


@erratum(
    id="S1.18",
    section="1.3.6, 4.2",
    statement="The unit rolling direction χ, which completes χ⊥ and ê₂ to a frame that is turned, not mirrored.",
    printed=Formula(r"\chi = (m + J)^{-1/2} (1, 0, -1)", lambda m, J, xp: [1 / xp.sqrt(m + J), 0, -1 / xp.sqrt(m + J)]),
    corrected=Formula(r"\chi = (m + J)^{-1/2} (-1, 0, 1)", lambda m, J, xp: frame_rows(m, J, xp)[2]),
    reason="With the printed sign the frame is left-handed, while the index of notation, eq. 1.42 and section 5.3.4 "
    "have the other sign. All laws of velocities are even in χ and keep their form.",
)
def sign_of_the_rolling_direction(chi: Code) -> Verdict:
    import sympy as sp

    from .. import symbolic as sym

    frame = sp.Matrix([*frame_rows(sym.m, sym.J, sp)[:2], chi(sym.m, sym.J, sp)])
    return verify((frame * sym.metric.applyfunc(sp.sqrt)).det(), 1)


@verified(
    id="S1.19",
    section="1.3.6",
    statement="(χ⊥, ê₂, χ) is orthonormal for the kinetic-energy inner product.",
    printed=Formula(
        r"\chi_\perp = \Bigl(\frac1m + \frac1J\Bigr)^{-1/2} \Bigl(\frac1m, 0, \frac1J\Bigr),\quad"
        r"\hat e_2 = m^{-1/2}(0, 1, 0)",
        frame_rows,
    ),
    perturbed=lambda m, J, xp: [[m * e for e in row] for row in frame_rows(m, J, xp)],
    reason="The Gram matrix is the identity for all m and J. Either sign of χ will do.",
)
def the_frame_is_orthonormal(frame_of: Code) -> Verdict:
    import sympy as sp

    from .. import symbolic as sym

    frame = sp.Matrix(frame_of(sym.m, sym.J, sp))
    return verify(frame * sym.metric * frame.T, sp.eye(3))
