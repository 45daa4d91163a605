"""The laws whose gaps are proved, as numbers for a certificate."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...core.checks import instance
from ...core.errors import InputError
from ...geometry import Arc, dispersing_arcs
from ...kernels import Law, WallLaw, lambertian, specular
from ...kernels.laws.phase_function import HenyeyGreensteinLaw
from ...kernels.laws.structure import Word, words_of

# The weights and the curvature of a theorem have this relative radius, so that it holds of 1/3 as of the double beside.
RADIUS = 2.0**-52
# Relative difference of the arcs of a wall from those of bumps, at most.
ROUNDED = 1e-14


@dataclass(frozen=True)
class Description:
    """A mixture of one law with specular reflection, retroreflection and Lambert's law.

    Attributes
    ----------
    law : Law
        In the paper's convention.
    content : dict
        What a certificate says of it.
    text : str
        In words.
    """

    law: Law
    content: dict[str, Any]
    text: str

    @classmethod
    def of(cls, law: Law) -> Description:
        """The description of a law; raises InputError if there is no theorem on it."""
        instance("law", law, Law, "ker.henyey_greenstein(0.5)")
        frame, base, weights = law.frame, None, dict.fromkeys(("law", "specular", "retroreflection", "lambertian"), 0.0)
        for word, weight in (words_of(law) or {}).items():
            name, one, mirrored = _kind(word)
            if name is None or (one is not None and base not in (None, one)):
                raise InputError(_expected(law))
            weights[
                name
                if frame == "paper"
                else {"specular": "retroreflection", "retroreflection": "specular"}.get(name, name)
            ] += weight
            base = one or base
            if one is not None and mirrored != (frame == "specular"):
                raise InputError(_expected(law))
        base = lambertian() if base is None else base
        family, text = _family(base, law)
        ends = {name: _with_radius(weight) for name, weight in weights.items()}
        mixture = " + ".join(
            f"{weight:g} {text if name == 'law' else name}" for name, weight in weights.items() if weight > 0.0
        )
        return cls(base, {"law": family, "weights": ends, "frame": frame}, mixture)


def _kind(word: Word) -> tuple[str | None, Law | None, bool]:
    """The name of a word's weight, in the paper's convention, the law, and whether specular reflection follows."""
    if not word or word == (specular(),):
        return ("specular" if word else "retroreflection"), None, False
    if word[0] == lambertian():
        return "lambertian", None, False
    mirrored = len(word) == 2 and word[1] == specular()
    return ("law", word[0], mirrored) if mirrored or len(word) == 1 else (None, None, False)


def _family(law: Law, whole: Law) -> tuple[dict[str, Any], str]:
    if law == lambertian():
        return {"family": "powers", "mean_cosine": "0"}, "the Lambertian law"
    if isinstance(law, HenyeyGreensteinLaw):
        return {
            "family": "powers",
            "mean_cosine": _with_radius(law.g),
        }, f"the Henyey-Greenstein law of mean cosine {law.g!r}"
    if isinstance(law, WallLaw) and (curvature := _curvature(law)) is not None:
        return {
            "family": "dispersing arcs",
            "curvature": _with_radius(curvature),
        }, f"dispersing arcs of curvature {curvature!r}"
    raise InputError(_expected(whole))


def _curvature(law: WallLaw) -> float | None:
    """K of a wall of bumps of radius period/K; None of another wall."""
    pieces = [piece for piece in law.wall.pieces if isinstance(piece, Arc)]
    if len(pieces) != 2 or len(law.wall.pieces) != 2:
        return None
    size = float(law.wall.period)
    curvature = size / float(pieces[0].semi_axes[0])
    if not 0.0 < curvature < 2.0:
        return None
    for mine, other in zip(pieces, dispersing_arcs(curvature).pieces, strict=True):
        for name in ("center", "semi_axes", "start_angle", "end_angle"):
            unit = 1.0 if name.endswith("angle") else size
            found = np.asarray(getattr(mine, name)) / unit
            if np.abs(found - getattr(other, name)).max() > ROUNDED * max(1.0, 1.0 / curvature):
                return None
    return curvature


def _with_radius(number: float) -> list[str]:
    return [repr(number), repr(abs(number) * RADIUS)]


def _expected(law: Law) -> str:
    return (
        "law: expected the law of ker.WallLaw(geo.dispersing_arcs(K)) or ker.henyey_greenstein(g), in either "
        f"convention, or its mixture with specular(), retroreflection() and lambertian(), got {law!r}"
    )
