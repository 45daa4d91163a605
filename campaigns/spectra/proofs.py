"""Whether proved intervals contain the gap, against estimates by enclosures and matrices of the library."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.errors import ProofError
from asperity.kernels.laws.law import sum_of
from campaigns.engine import Campaign, Judged

# The kind of a law, the law, and the relative width that is asked for.
Case = tuple[str, ker.Law, float]


def draw(number: int) -> Case:
    """Bumps or focusing arcs in either convention, every other one mixed with laws that keep or forget the angle."""
    rng = np.random.default_rng([43, number])
    bumps, turned, mixed = (number >> bit & 1 == 1 for bit in range(3))
    wall = geo.dispersing_arcs(rng.uniform(0.1, 1.4)) if bumps else geo.focusing_arcs(rng.uniform(0.2, 1.5))
    law: ker.Law = ker.WallLaw(wall)
    if mixed:
        laws = law, ker.specular(), ker.retroreflection(), ker.lambertian()
        law = sum_of(tuple(zip(rng.dirichlet(np.ones(4)).tolist(), laws, strict=True)))
    words = "bumps" if bumps else "focusing arcs", "specular" if turned else "paper", "mixed" if mixed else "pure"
    return ", ".join(words), law.in_specular_frame() if turned else law, float(10.0 ** rng.uniform(-4.0, -2.0))


def judge(case: Case) -> Iterator[Judged]:
    """The middle of the interval and the estimated gap; what is not proved says so."""
    kind, law, width = case
    try:
        low, high = map(float, spec.prove_gap(law, width).interval)
    except ProofError:
        yield Judged(kind, outcome="not proved")
        return
    gap = spec.spectral_gap(law, tolerance=0.05 * (high - low))
    yield Judged(kind, 0.5 * (high - low), abs(0.5 * (low + high) - float(gap)), gap.error, outcome="proved")


CAMPAIGNS = (Campaign("proofs", "Do proved intervals contain the gap?", draw, judge, 24, [3], seconds=900.0),)
