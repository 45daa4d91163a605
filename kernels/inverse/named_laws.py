"""Laws by name, as the command line takes them: ``lambertian``, ``maxwell:0.5``, or a matrix file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from os.path import exists
from types import MappingProxyType

from ...core.errors import InputError
from ..laws.ideal import lambertian, maxwell
from ..laws.law import Law, retroreflection, specular
from ..laws.least_resistance import LeastResistanceLaw
from ..laws.phase_function import henyey_greenstein
from ..matrices.matrix import KernelMatrix, load_matrix

PLAIN: Mapping[str, Callable[[], Law]] = MappingProxyType(
    {
        "lambertian": lambertian,
        "specular": specular,
        "retroreflection": retroreflection,
        "least-resistance": LeastResistanceLaw,
    }
)
WITH_NUMBER: Mapping[str, Callable[[float], Law]] = MappingProxyType(
    {"maxwell": maxwell, "henyey-greenstein": henyey_greenstein}
)
NAMES = "lambertian, specular, retroreflection, least-resistance, maxwell:NUMBER, henyey-greenstein:NUMBER"


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
    if name in PLAIN and not colon:
        return PLAIN[name]()
    if name in WITH_NUMBER:
        try:
            return WITH_NUMBER[name](float(number))
        except ValueError as reason:
            if isinstance(reason, InputError):
                raise
            raise InputError(f"law: expected a number after '{name}:', got {number!r}") from reason
    if exists(text):
        return load_matrix(text)
    raise InputError(f"law: expected {NAMES}, or a file that KernelMatrix.save wrote, got {text!r}")
