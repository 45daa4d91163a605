"""Rays from scrambled Sobol sequences that can be continued."""

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

# Replicates of a Sobol sequence whose spread gives the error; eight determine the spread within a quarter. With more
# replicates each would have fewer rays and be less accurate.
PARTS = 8
# Binary digits of the sequences; the time of scrambling grows like their square. The digits beyond are one random shift
# of all points, so that points hit a corner at a dyadic position only by chance.
SOBOL_BITS = 32


class SobolSampler:
    """Sampler of rays of a law driven by one uniform number, with incoming angles from the invariant measure.

    The rays form eight parts of equal size. Each part is the same scrambled Sobol sequence with its own random digital
    shift, so it is a scrambled Sobol sequence. Given the sequence, the parts are independent and identically
    distributed, so their spread gives the error of their mean. Each call continues the same sequence, so the rays of a
    pilot run are reused. If the law and the basis are mirror-symmetric, the rays have theta < pi/2 and every ray counts
    with its mirror image, which makes the sequence twice as dense.

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
        """The matrix from at least ``samples`` rays, rounded up to 8 times a power of two; see `RaySums.array`.

        Raises
        ------
        InputError
            If the sequence has fewer points.
        """
        each = 1 << (max(-(-samples // PARTS), 1) - 1).bit_length()
        if each > 1 << SOBOL_BITS:
            most = PARTS << SOBOL_BITS
            raise InputError(
                f"samples: a Sobol sequence has at most {most} rays, got {samples}; use method 'monte-carlo'"
            )
        with progress_bar(PARTS * max(each - self.sums.each, 0)) as bar:
            while self.sums.each < each:
                # The sequence is balanced in powers of two.
                number = min(max(self.sums.chunk // PARTS, 1), each - self.sums.each, self.sums.each or each)
                self._add(number)
                self.sums.each += number
                bar.update(PARTS * number)
        return self.sums.array(symmetrise=symmetrise, mirrored=self.halved)

    def _add(self, number: int) -> None:
        """Add ``number`` rays to every part."""
        digits = (self.sequence.random(number) * 2.0**SOBOL_BITS).astype(np.uint64)
        points = (digits ^ self.shifts[:, None]) * 2.0**-SOBOL_BITS + self.beyond[:, None]
        x, u = np.moveaxis(points, -1, 0)
        theta: Floats = clipped_inside(SINE.quantile(0.5 * u if self.halved else u))
        outgoing, escaped = self.reflect(entry_inside(x), theta)
        self.sums.count_unresolved(escaped)
        for part in range(PARTS):
            self.sums.add(part, theta[part], outgoing[part])
