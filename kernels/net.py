"""Rays of a randomised net: a scrambled Sobol sequence, to which rays can be added."""

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

# Parts of a net whose spread gives its error: eight tell it within a quarter.
PARTS = 8
# Digits of the nets: scrambling them takes a time like their number squared. What lies beyond is one random shift of
# all points, so that none falls on a corner at a dyadic place but by chance.
SOBOL_BITS = 32


class Net:
    """Rays of a law that is driven by a uniform number, with incoming angles from the invariant measure.

    The sequence goes on where it was: fewer rays are a part of more, and a look at a few costs nothing. Of a
    mirror-symmetric law they have theta < pi/2, in a basis with that symmetry: every ray counts with its mirror image,
    and the net is twice as dense.

    Each of eight consecutive parts of the sequence is a randomised net by itself. Together they fill the square more
    evenly than eight that know nothing of each other, and their mean is the more exact for it. The spread of the parts,
    which takes them for independent, is then too large: by 8^(1/4) where the error falls like the number to the 3/4.

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
        self.sums = RaySums(law, basis, PARTS)
        self.halved = law.mirror_symmetric is True and is_mirror_symmetric(basis)
        source = np.random.default_rng(rng.integers(0, 2**63, size=2))
        self.sequence = Sobol(2, scramble=True, bits=SOBOL_BITS, rng=source)
        self.beyond = source.random(2) * 2.0**-SOBOL_BITS

    def sampled(self, samples: int, *, symmetrise: bool) -> tuple[SampledArray, int, float]:
        """The matrix from at least so many rays, 8 times a power of two; see `RaySums.array`.

        Raises
        ------
        InputError
            If these are more than the sequence has points.
        """
        each = 1 << (max(-(-samples // PARTS), 1) - 1).bit_length()
        if PARTS * each > 1 << SOBOL_BITS:
            raise InputError(f"samples: a net has at most 2^{SOBOL_BITS} rays, got {samples}; use method 'monte-carlo'")
        done = PARTS * self.sums.each
        if each > self.sums.each:
            self.sums.enlarge(each)
        with progress_bar(max(PARTS * each - done, 0)) as bar:
            while done < PARTS * each:
                # powers of two, as the parts are: a chunk has several of them, or is in one
                number = min(self.sums.chunk, PARTS * each - done, done or PARTS * each)
                self._add(done, number)
                done += number
                bar.update(number)
        return self.sums.array(symmetrise=symmetrise, mirrored=self.halved)

    def _add(self, done: int, number: int) -> None:
        """Add so many rays to the parts that they belong to."""
        x, u = (self.sequence.random(number) + self.beyond).T
        theta: Floats = kept_inside(SINE.quantile(0.5 * u if self.halved else u))
        outgoing, escaped = self.respond(entry_inside(x), theta)
        self.sums.count_lost(escaped)
        for first in range(0, number, self.sums.each):
            own = slice(first, first + self.sums.each)
            self.sums.add((done + first) // self.sums.each, theta[own], outgoing[own])
