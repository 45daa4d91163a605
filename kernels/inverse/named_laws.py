"""Laws by name, as the command line takes them: ``lambertian``, ``maxwell:0.5``, or a matrix file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from os.path import exists
from types import MappingProxyType

from ...core.errors import InputError
from ..laws.density import lambertian, maxwell
from ..laws.deterministic import LeastResistanceLaw
from ..laws.law import Law, retroreflection, specular
from ..laws.phase_function import henyey_greenstein
from ..matrices.matrix import KernelMatrix, load_matrix

LAWS: Mapping[str, Callable[..., Law]] = MappingProxyType({
    "lambertian": lambertian, "specular": specular, "retroreflection": retroreflection,
    "least-resistance": LeastResistanceLaw, "maxwell:NUMBER": maxwell, "henyey-greenstein:NUMBER": henyey_greenstein,
})  # fmt: skip


def law_from_text(text: str) -> Law | KernelMatrix:
    """The law of a name, or the kernel matrix of a file.

    Raises
    ------
    InputError
        If it is neither.

    Examples
    --------
    >>> law_from_text("maxwell:0.25")
    0.25*lambertian() + 0.75*specular()
    """
    name, colon, number = text.partition(":")
    if name in LAWS and not colon:
        return LAWS[name]()
    if f"{name}:NUMBER" in LAWS:
        try:
            given = float(number)
        except ValueError as reason:
            raise InputError(f"law: expected a number after '{name}:', got {number!r}") from reason
        return LAWS[f"{name}:NUMBER"](given)
    if exists(text):
        return load_matrix(text)
    raise InputError(f"law: expected {', '.join(LAWS)}, or a file that KernelMatrix.save wrote, got {text!r}")
