"""Rays of randomised nets: scrambled Sobol sequences, to which rays can be added."""

from __future__ import annotations

import numpy as np

from ..checks import Floats
from ..errors import InputError
from .basis import Basis
from .counting import SampledArray
from .law import Law
from .measure import SINE
from .ray_sums import RaySums, progress_bar
from .reflection import is_mirror_symmetric
from .responses import entry_inside, responder
from .stable_angles import kept_inside

# Independent randomisations: the spread of eight gives an error within a quarter.
RANDOMISATIONS = 8
# Digits of the nets: scrambling them takes a time like their number squared. What lies beyond is one random shift of
# all points, so that none falls on a corner at a dyadic place but by chance.
SOBOL_BITS = 32


class Nets:
    """Rays of a law that is driven by a uniform number, with incoming angles from the invariant measure.

    A sequence goes on where it was: fewer rays are a part of more, and a look at a few costs nothing. Of a
    mirror-symmetric law they have theta < pi/2, in a basis with that symmetry: every ray counts with its mirror image,
    and the net is twice as dense.

    Parameters
    ----------
    law : Law
    basis : Basis
    rng : numpy.random.Generator

    Raises
    ------
    InputError
        If the law needs more randomness than one number.
    """

    def __init__(self, law: Law, basis: Basis, rng: np.random.Generator) -> None:
        from scipy.stats.qmc import Sobol

        respond = responder(law)
        if respond is None:
            raise InputError(
                f"method: {law!r} is not driven by a uniform number, so it has no 'qmc'; use 'monte-carlo'"
            )
        self.respond = respond
        self.sums = RaySums(law, basis, RANDOMISATIONS)
        self.halved = law.mirror_symmetric is True and is_mirror_symmetric(basis)
        root = [int(word) for word in rng.integers(0, 2**63, size=2)]
        sources = [np.random.default_rng([*root, number]) for number in range(RANDOMISATIONS)]
        self.engines = [Sobol(2, scramble=True, bits=SOBOL_BITS, rng=source) for source in sources]
        self.beyond = [source.random(2) * 2.0**-SOBOL_BITS for source in sources]

    def sampled(self, samples: int, *, symmetrise: bool) -> tuple[SampledArray, int, float]:
        """The matrix from at least so many rays, 8 times a power of two; see `RaySums.array`."""
        each = 1 << (max(-(-samples // RANDOMISATIONS), 1) - 1).bit_length()
        # all sequences together, so that a few rays of each are one call
        most = self.sums.chunk(RANDOMISATIONS)
        with progress_bar(RANDOMISATIONS * max(each - self.sums.each, 0)) as bar:
            while self.sums.each < each:
                number = min(most, each - self.sums.each)
                self._add(number)
                bar.update(RANDOMISATIONS * number)
        return self.sums.array(symmetrise=symmetrise, mirrored=self.halved)

    def _add(self, number: int) -> None:
        """Add so many rays to every sequence."""
        points = [engine.random(number) + beyond for engine, beyond in zip(self.engines, self.beyond, strict=True)]
        x, u = np.concatenate(points).T
        theta: Floats = kept_inside(SINE.quantile(0.5 * u if self.halved else u))
        outgoing, escaped = self.respond(entry_inside(x), theta)
        self.sums.count_lost(escaped)
        for table in range(RANDOMISATIONS):
            part = slice(table * number, (table + 1) * number)
            self.sums.add(table, theta[part], outgoing[part])
        self.sums.each += number
