"""Powers of the law of rectangular teeth in closed form, with exact integrals up to grazing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, angles
from ..bases.angles import clipped_inside, mirrored_angle
from ..bases.assembly import add_products, largest_square_sum
from ..bases.basis import Basis
from ..bases.measure import gauss_on_intervals
from ..laws.crevice import crevice_breakpoints, crevice_retro
from ..laws.law import BranchLaw
from .crevice_tail import crevice_nodes, first_crossing

# A polynomial of this degree in the triangle wave is still cheap to integrate.
MOST_TIMES = 64
# The number of nodes for an isometry on a wide interval.
LEAST_NODES = 20


@dataclass(frozen=True)
class RepeatedTeethLaw(BranchLaw):
    r"""The law ``RectangularTeethLaw(r) ** n``, a mixture of specular reflection and retroreflection.

    The law of rectangular teeth leaves functions with f(pi - theta) = f(theta) unchanged. It multiplies functions with
    f(pi - theta) = -f(theta) by q - 1, where q(theta) is the distance from d = 2 r |cot theta| to the nearest even
    number. Hence its n-th power retroreflects with probability (1 + (q - 1)^n) / 2.

    Parameters
    ----------
    height_to_width : float
        r > 0, depth of the crevices over their width.
    times : int
        n, from 1 to `MOST_TIMES`.

    Examples
    --------
    >>> law = RepeatedTeethLaw(0.5, 2)
    >>> law.branches(np.arctan(2.0))[0].round(12)        # d = 1/2
    array([0.375, 0.625])
    """

    height_to_width: float
    times: int

    mirror_symmetric = True

    def branches(self, theta: ArrayLike) -> tuple[Floats, Floats]:
        theta = angles("theta", theta)
        retro = self.retro(crevice_retro(self.height_to_width, theta))
        return np.stack([1.0 - retro, retro], axis=-1), np.stack([mirrored_angle(theta), theta], axis=-1)

    def breakpoints(self, limit: int) -> tuple[Floats, float]:
        return crevice_breakpoints(self.height_to_width, limit)

    def retro(self, distance: Floats) -> Floats:
        """The probability of retroreflection for the distance q."""
        return np.asarray(0.5 * (1.0 + (distance - 1.0) ** self.times))


def repeated_teeth_matrix(law: RepeatedTeethLaw, basis: Basis, exchanged: bool) -> tuple[Floats, float]:
    """The matrix <e_i, P e_j>, and a bound of its Frobenius error without rounding, as in `table_matrix`.

    Parameters
    ----------
    law : RepeatedTeethLaw
    basis : Basis
    exchanged : bool
        Whether the law is in the specular frame, which exchanges its two outcomes.
    """
    total = np.zeros((basis.size, basis.size))
    r, begin = law.height_to_width, first_crossing(basis)
    steep = np.arctan2(2.0 * r, np.arange(begin, -1.0, -1.0))
    edges = np.unique(np.concatenate((steep, basis.edges, clipped_inside(np.pi - basis.edges))))
    edges = edges[(edges >= steep[0]) & (edges <= steep[-1])]
    nodes = max(LEAST_NODES, basis.nodes_per_interval) + law.times
    near, mass = gauss_on_intervals(edges[:-1], edges[1:], nodes)
    mass = mass * basis.measure.density(near)
    back = law.retro(crevice_retro(r, near))
    far, specular, retro, omitted = crevice_nodes(r, basis, law.times)
    # separate sums: many small terms added to a large sum would lose digits
    for theta, mirrored, same in ((near, mass * (1.0 - back), mass * back), (far, specular, retro)):
        cases = (
            ((mirrored_angle(theta), same), (theta, mirrored))
            if exchanged
            else ((mirrored_angle(theta), mirrored), (theta, same))
        )
        for outgoing, weight in cases:
            add_products(total, basis, theta, outgoing, weight)
            add_products(total, basis, mirrored_angle(theta), mirrored_angle(outgoing), weight)
    return total, 4.0 * omitted * largest_square_sum(basis) if omitted else 0.0
