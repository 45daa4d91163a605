"""The distance of walls and laws from retroreflection, by rays."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ...core.checks import Rng, generator, whole_number
from ...core.errors import InputError
from ...core.estimates import Estimate, mean_of_strata
from ...geometry import Wall
from ..bases.measure import SINE
from ..laws.law import Law

FEWEST_RAYS = 100


def retroreflection_distance(reflector: Wall | Law, rays: int = 2**14, rng: Rng = None) -> Estimate:
    r"""Return the mean of abs(theta' - theta), radians, over rays that enter with density sin(theta)/2.

    It is the distance ``kind="rows"`` of order 1 from `retroreflection`, because the transport of a distribution to a
    single point has no choice. Rays cost the same for walls of thousands of pieces, for which `distance` is slow.

    Parameters
    ----------
    reflector : Wall or Law
        A law in the paper's convention.
    rays : int
        Stratified in the angle, at least 100.
    rng : None, int or numpy.random.Generator

    Returns
    -------
    Estimate
        The error is a 95 % half width from neighbouring strata, with pi times 3/rays for deflections that are too rare
        to be seen, and pi times the fraction of rays that do not escape.

    Raises
    ------
    InputError
        If an argument is not as described.

    Source: A. Plakhov, "Mathematical retroreflectors", Discrete Contin. Dyn. Syst. 30 (2011) 1211; Rudzis 2022,
    section 1.2.7.

    Examples
    --------
    A flat wall sends theta to pi - theta, at a mean distance of pi - 2; the helmet is much nearer to retroreflection:

    >>> from asperity import geometry as geo
    >>> flat = retroreflection_distance(geo.flat(), 10_000, rng=0)
    >>> abs(float(flat) - (math.pi - 2.0)) < flat.error < 0.01
    True
    >>> float(retroreflection_distance(geo.double_parabola(), rng=0)) < 0.1
    True
    """
    number = whole_number("rays", rays, FEWEST_RAYS)
    source = generator(rng)
    theta = SINE.quantile((np.arange(number) + source.random(number)) / number)
    if isinstance(reflector, Wall):
        from ...geometry import trace

        found = trace(reflector, reflector.period * source.random(number), theta)
        outgoing, lost = np.where(found.escaped, found.theta, theta), 1.0 - float(np.mean(found.escaped))
    elif isinstance(reflector, Law) and reflector.frame == "paper":
        outgoing, lost = reflector.sample(theta, source), 0.0
    else:
        raise InputError(f"reflector: expected a Wall, or a law in the paper's convention, got {reflector!r}")
    turned = np.abs(outgoing - theta)
    mean = mean_of_strata(turned, math.pi, f"{number} stratified rays")
    return replace(mean, error=mean.error + math.pi * lost)
