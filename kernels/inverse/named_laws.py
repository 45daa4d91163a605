"""Laws by name, as the command line takes them: ``lambertian``, ``maxwell:0.5``, or a matrix file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from os.path import exists
from types import MappingProxyType

from ...core.errors import InputError
from ...geometry import wall_from_text
from ..laws.density import henyey_greenstein, lambertian, maxwell
from ..laws.deterministic import LeastResistanceLaw
from ..laws.law import Law, retroreflection, specular
from ..laws.matrix_law import MatrixLaw
from ..matrices.matrix import KernelMatrix, load_matrix
from ..walls.wall_law import WallLaw

LAWS: Mapping[str, Callable[..., Law]] = MappingProxyType({
    "lambertian": lambertian, "specular": specular, "retroreflection": retroreflection,
    "least-resistance": LeastResistanceLaw, "maxwell:NUMBER": maxwell, "henyey-greenstein:NUMBER": henyey_greenstein,
})  # fmt: skip
# The parameter of a law with a number, by which it may be called.
PARAMETERS = MappingProxyType({"maxwell": "diffuse_fraction", "henyey-greenstein": "g"})


def law_from_text(text: str) -> Law | KernelMatrix:
    """The law of a name, or the kernel matrix of a file.

    Raises
    ------
    InputError
        If it is neither.

    Examples
    --------
    >>> law_from_text("maxwell:0.25"), law_from_text("maxwell:diffuse_fraction=0.25") == law_from_text("maxwell:0.25")
    (0.25*lambertian() + 0.75*specular(), True)
    """
    name, colon, number = text.partition(":")
    number = number.removeprefix(f"{PARAMETERS.get(name)}=")
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


def facets_from_text(text: str) -> Law:
    """The law of facets: of a name or a matrix file as `law_from_text`, or of a finer wall as `wall_from_text`.

    Raises
    ------
    InputError
        If it is none of these.

    Examples
    --------
    >>> facets_from_text("maxwell:diffuse_fraction=0.2"), facets_from_text("triangular-teeth:angle=1").parts[0][1]
    (0.2*lambertian() + 0.8*specular(), TriangularTeethLaw(angle=1.0))
    """
    names = {name.partition(":")[0] for name in LAWS}
    try:
        if text.partition(":")[0] not in names and not text.endswith(".npz"):
            return WallLaw(wall_from_text(text))
        found = law_from_text(text)
        return MatrixLaw(found) if isinstance(found, KernelMatrix) else found
    except InputError as reason:
        laws = "maxwell:NUMBER or another law of `asperity realise`"
        raise InputError(
            f"facets: expected {laws}, its matrix file, or a finer wall, got {text!r}: {reason}"
        ) from reason
