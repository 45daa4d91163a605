"""The laws whose gaps are proved, as numbers for a certificate."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...core.checks import instance
from ...core.errors import InputError
from ...geometry import Arc, dispersing_arcs
from ...kernels import CircularArcLaw, Law, WallLaw, lambertian, specular
from ...kernels.laws.phase_function import HenyeyGreensteinLaw
from ...kernels.laws.structure import words_of

# The weights and the curvature of a theorem have this relative radius, so that it holds of 1/3 as of the double beside.
RADIUS = 2.0**-52
# Relative difference of the arcs of a wall from those of bumps, at most.
ROUNDED = 1e-14


def described(law: Law) -> tuple[Law, dict[str, Any]]:
    """The law without ideal ones beside it, and what a certificate says; InputError if there is no theorem."""
    instance("law", law, Law, "ker.henyey_greenstein(0.5)")
    specular_frame = law.frame == "specular"
    # the kernel that keeps angles, and the one that turns them
    ideal = ("specular", "retroreflection") if specular_frame else ("retroreflection", "specular")
    weights, base = dict.fromkeys(("law", "specular", "retroreflection", "lambertian"), 0.0), None
    for word, weight in (words_of(law) or {(law, law, law): 1.0}).items():
        if all(one == specular() for one in word):
            weights[ideal[len(word) % 2]] += weight
        elif word[0] == lambertian():
            weights["lambertian"] += weight
        elif word[1:] == ((specular(),) if specular_frame else ()) and base in (None, word[0]):
            weights["law"], base = weights["law"] + weight, word[0]
        else:
            raise InputError(_expected(law))
    base = lambertian() if base is None else base
    texts = {name: _with_radius(weight) for name, weight in weights.items()}
    return base, {"law": _family(base, law), "weights": texts, "frame": law.frame}


def in_words(content: dict[str, Any]) -> str:
    """The law of a certificate."""

    def number(given: str | list[str]) -> str:
        return given if isinstance(given, str) else " +/- ".join(given)

    name = {
        "dispersing arcs": "dispersing arcs of curvature {curvature}",
        "focusing arcs": "focusing arcs of half angle {half_angle}",
        "powers": "Henyey-Greenstein of mean cosine {mean_cosine}",
    }
    text = name[content["law"]["family"]].format_map({key: number(given) for key, given in content["law"].items()})
    terms = [
        f"({number(given)}) {text if key == 'law' else key}"
        for key, given in content["weights"].items()
        if given not in (_with_radius(0.0), "0")
    ]
    return " + ".join(terms)


def _family(law: Law, whole: Law) -> dict[str, Any]:
    if law == lambertian():
        return {"family": "powers", "mean_cosine": _with_radius(0.0)}
    if isinstance(law, HenyeyGreensteinLaw):
        return {"family": "powers", "mean_cosine": _with_radius(law.g)}
    if isinstance(law, CircularArcLaw):
        return {"family": "focusing arcs", "half_angle": _with_radius(law.half_angle)}
    if isinstance(law, WallLaw) and (curvature := _curvature(law)) is not None:
        return {"family": "dispersing arcs", "curvature": _with_radius(curvature)}
    raise InputError(_expected(whole))


def _curvature(law: WallLaw) -> float | None:
    """K of a wall of bumps of radius period/K; None of another wall."""
    pieces = [piece for piece in law.wall.cell.pieces if isinstance(piece, Arc)]
    if len(pieces) != 2 or len(law.wall.cell.pieces) != 2:
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
        "law: expected the law of ker.WallLaw(wall) of geo.dispersing_arcs(K) or geo.focusing_arcs(xi), or "
        "ker.henyey_greenstein(g), in either convention, or its mixture with specular(), retroreflection() and "
        f"lambertian(), got {law!r}"
    )
