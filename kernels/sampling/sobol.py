"""Rays of scrambled Sobol sequences, to which rays can be added."""

from __future__ import annotations

import numpy as np

from ...core.checks import Floats
from ...core.errors import InputError
from ..bases.angles import clipped_inside
from ..bases.basis import Basis
from ..bases.measure import SINE
from ..bases.mirror import is_mirror_symmetric
from ..laws.law import Law, entry_inside
from .counts import SampledArray
from .rays import RaySums, progress_bar

# Replicates of a Sobol sequence whose spread gives its error: eight tell it within a quarter. More would be less exact
# replicates each.
PARTS = 8
# Digits of the sequences: scrambling them takes a time like their number squared. What lies beyond is one random shift
# of all points, so that none falls on a corner at a dyadic position but by chance.
SOBOL_BITS = 32


class SobolSampler:
    """Rays of a law that is driven by a uniform number, with incoming angles from the invariant measure.

    They are eight parts of the same number of rays. Each part is the same scrambled Sobol sequence after a random
    digital shift of its own, which makes it a scrambled Sobol sequence itself; given the sequence the parts are
    independent and have the same distribution, so that their spread is that of their mean. The sequence goes on where
    it was: fewer rays are a part of more, so a pilot run costs nothing. Of a mirror-symmetric law they have
    theta < pi/2, in a basis with that symmetry: every ray counts with its mirror image, and the sequence is twice as
    dense.

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

        reflect = law.random_map()
        if reflect is None:
            raise InputError(
                f"method: {law!r} is not driven by a uniform number, so it has no 'qmc'; use 'monte-carlo'"
            )
        self.reflect = reflect
        self.sums = RaySums(law, basis, PARTS)
        self.halved = law.mirror_symmetric is True and is_mirror_symmetric(basis)
        source = np.random.default_rng(rng.integers(0, 2**63, size=2))
        self.sequence = Sobol(2, scramble=True, bits=SOBOL_BITS, rng=source)
        self.shifts = source.integers(0, 2**SOBOL_BITS, size=(PARTS, 2), dtype=np.uint64)
        self.beyond = source.random((PARTS, 2)) * 2.0**-SOBOL_BITS

    def sampled(self, samples: int, *, symmetrise: bool) -> tuple[SampledArray, int, float]:
        """The matrix from at least so many rays, 8 times a power of two; see `RaySums.array`.

        Raises
        ------
        InputError
            If these are more than the sequence has points.
        """
        each = 1 << (max(-(-samples // PARTS), 1) - 1).bit_length()
        if each > 1 << SOBOL_BITS:
            most = PARTS << SOBOL_BITS
            raise InputError(
                f"samples: a Sobol sequence has at most {most} rays, got {samples}; use method 'monte-carlo'"
            )
        with progress_bar(PARTS * max(each - self.sums.each, 0)) as bar:
            while self.sums.each < each:
                # powers of two, which the sequence is balanced in
                number = min(max(self.sums.chunk // PARTS, 1), each - self.sums.each, self.sums.each or each)
                self._add(number)
                self.sums.each += number
                bar.update(PARTS * number)
        return self.sums.array(symmetrise=symmetrise, mirrored=self.halved)

    def _add(self, number: int) -> None:
        """Add so many rays to every part."""
        digits = (self.sequence.random(number) * 2.0**SOBOL_BITS).astype(np.uint64)
        points = (digits ^ self.shifts[:, None]) * 2.0**-SOBOL_BITS + self.beyond[:, None]
        x, u = np.moveaxis(points, -1, 0)
        theta: Floats = clipped_inside(SINE.quantile(0.5 * u if self.halved else u))
        outgoing, escaped = self.reflect(entry_inside(x), theta)
        self.sums.count_unresolved(escaped)
        for part in range(PARTS):
            self.sums.add(part, theta[part], outgoing[part])
