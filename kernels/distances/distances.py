"""Distances between laws: conditional or joint Wasserstein distances, the paper's pseudometric, and the distance from
retroreflection by rays.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from math import ceil, log2
from typing import Literal, cast, get_args

import numpy as np

from ...core.checks import Floats, Rng, choice, generator, positive_number, whole_number
from ...core.errors import InputError
from ...core.estimates import Estimate, mean_of_strata
from ...geometry import Wall, trace
from ..bases.basis import Basis
from ..bases.measure import SINE
from ..bases.polynomials import Legendre
from ..discretisation.discretisation import discretise
from ..laws.law import Law
from ..laws.matrix_law import check_law
from ..laws.structure import TensorLaw, Term
from ..matrices.matrix import KernelMatrix, joint_kind
from .conditional import law_distance, matrix_distance
from .joint import joint_law_distance, joint_matrix_distance
from .transport import check_comparable, noise_floor, wasserstein_order

Kind = Literal["rows", "sup", "joint", "pseudometric"]


@dataclass(frozen=True, repr=False)
class Distance(Estimate):
    """A distance between two laws, with its error.

    Attributes
    ----------
    noise_floor : float or None
        For empirical matrices: the mean distance between samples of this size from one law. A distance near the noise
        floor is not significant; use `difference_test` to decide. For joint distances the noise floor of kind
        ``"rows"`` is given, which is not smaller. None if neither matrix has counts.
    tolerance : float or None
        Of laws: the error that was asked for.

    Examples
    --------
    A distance that its error does not tell from 0 says which tolerance would, if it is about right:

    >>> print(Distance(0.007, 0.008, "estimate", "", tolerance=0.01))
    0.007(8), not told from 0: ask for tolerance=4e-03
    """

    noise_floor: float | None = None
    tolerance: float | None = None

    def _headline(self) -> str:
        return str(self)

    def __str__(self) -> str:
        return f"{super().__str__()}{self._doubt()}"

    def _doubt(self) -> str:
        """Whether the interval contains 0, and what would tell."""
        if self.error < self.value or self.error == 0.0:
            return ""
        if self.noise_floor is not None:
            how = "difference_test decides between samples"
        elif self.tolerance is None:
            how = "matrices with smaller errors would tell"
        elif self.error > self.tolerance:
            how = f"the tolerance {self.tolerance:g} was not reached"
        else:
            # with half of the value as its error the distance would be told from 0
            how = f"ask for tolerance={0.5 * self.value or 0.1 * self.error:.0e}"
        return f", not told from 0: {how}"


def distance(
    first: Law | KernelMatrix | TensorLaw,
    second: Law | KernelMatrix | TensorLaw,
    order: float = 1,
    kind: Kind = "rows",
    tolerance: float = 1e-4,
) -> Distance:
    r"""The distance of two laws, of two kernel matrices, or of two collision laws.

    Parameters
    ----------
    first, second : Law, KernelMatrix or collision law
        If one is a law and the other a matrix, the law is discretised on the bins of the matrix. A collision law, such
        as `no_slip`, is compared with a collision law only.
    order : float
        p of the Wasserstein distance W_p, a finite number of at least 1. Angles are in radians.
    kind : {"rows", "sup", "joint", "pseudometric"}
        ``"rows"``: the p-mean of W_p(P(theta, .), Q(theta, .)) over sin(theta)/2 d theta.
        ``"sup"``: the supremum of W_p(P(theta, .), Q(theta, .)) over theta.
        ``"joint"``: W_p between the measures sin(theta)/2 d theta P(theta, d theta') on the square, which is at most
        the value of ``"rows"``. ``"pseudometric"``: the paper's pseudometric, see the notes; it does not depend on p.
    tolerance : float
        Wanted error between laws. If it is not reached, ``error`` is larger; see the notes for ``"joint"``.

    Returns
    -------
    Distance
        An Estimate with a ``noise_floor``.

    Raises
    ------
    InputError
        If the laws are in different frames, the matrices on different bins, one collision law turns psi and the other
        does not, or an argument is not as described.

    Notes
    -----
    *Laws.* Conditional distributions that consist of atoms are exact. Densities are resolved on cells of the outgoing
    angle, on which their distribution functions count as quadratic for p = 1, else as linear; the error is estimated
    from two numbers of cells. Errors E of the conditional distributions themselves, in total variation, count as
    pi (E/2)^(1/p): for p > 1 they can be most of the error. Panels in the incoming angle are halved where the rules of
    Gauss and Kronrod disagree, and the sum of their differences is part of the error. A supremum is that over nodes,
    refined until two levels agree.

    *Matrices* are treated as kernels between the middle angles of their cells. By the triangle inequality the error is
    at most the sum of the errors of both matrices; for empirical matrices these are found by resampling. The interval
    has about 95 % coverage for a sample against its own law. Its coverage is higher for two samples or for different
    laws, because noise partly cancels. The distance of matrices can be far below the distance of their laws if these
    vary within cells: two involutions may have the same matrix.

    *Joint* distances are the middle of two bounds, for which the square is divided into cells: the cost of a plan, with
    the spread within cells, and a potential that is affine on each cell. ``kind`` is "bound" if the masses of the cells
    have bounds and, for order 1, no mass of both laws in one cell was taken as common. Within the limits, some seconds
    and at most 2 million pairs of cells, the error reaches 1e-5 to 1e-4 if both laws consist of atoms, 2e-4 to 4e-3 at
    order 1 if one has a density. At higher orders it can be a fifth of the value between two densities. Curves of atoms
    that nearly coincide are told apart at the width of a cell, 1/250 to 1/100. Matrices are exact up to 4 million pairs
    of occupied cells (160 MB); for more, cells are merged and bounded likewise. At orders above a few dozen, rounding
    removes the p-th powers of all but the longest distances.

    *The pseudometric* is the sum over k, l >= 0 of 2^(-k-l-2) times the absolute difference of the means of
    cos(k theta) cos(l theta') under the flux measures, whose weak convergence it metrises. The error includes the
    remainder of the sum. Source: Rudzis 2022, section 6.2.3, corrected: f(y, x) G(y, dx) nu(dy).

    *Collision laws* are compared on the angles (theta, psi) of their disks' own frames, with the Euclidean distance of
    pairs of angles and the measure sin(theta) sin(psi)^2 d theta d psi. So disks of other masses are compared at equal
    angles, not at equal velocities, and a disk has no part in the value. Laws that both turn psi into pi - psi, or both
    keep it, have the distance of their laws of theta: psi stays, and the projection to theta shortens no distance. The
    pseudometric is not defined.

    Examples
    --------
    >>> from asperity import kernels as ker
    >>> import numpy as np
    >>> round(float(distance(ker.specular(), ker.retroreflection())) - (np.pi - 2), 12)
    0.0
    >>> round(float(distance(ker.maxwell(0.75), ker.maxwell(0.25), tolerance=1e-3)), 3)    # pi/8
    0.393
    """
    choice("kind", kind, get_args(Kind))
    power = wasserstein_order(order)
    positive_number("tolerance", tolerance)
    tensors = [law.parts_checked() for law in (first, second) if isinstance(law, TensorLaw)]
    if len(tensors) == 2:
        return _between_collisions(tensors[0], tensors[1], power, kind, tolerance)
    for law in (first, second):
        check_law("distance", law, "two laws or kernel matrices, or two collision laws", KernelMatrix)
    one, other = cast("tuple[Law | KernelMatrix, Law | KernelMatrix]", (first, second))
    if one.frame != other.frame:
        raise InputError(
            f"distance: expected laws in the same frame, got {one.frame!r} and {other.frame!r}; use "
            "in_specular_frame() on one"
        )
    laws = [law for law in (one, other) if isinstance(law, Law)]
    if kind == "pseudometric":
        return _labelled(moment_distance(one, other, tolerance), asked=tolerance if len(laws) == 2 else None)
    if len(laws) < 2:
        return _between_matrices(*_on_same_bins(one, other, tolerance), power, kind)
    if kind == "joint":
        return _labelled(joint_law_distance(laws[0], laws[1], power, tolerance), asked=tolerance)
    return _labelled(law_distance(laws[0], laws[1], power, kind == "sup", tolerance), asked=tolerance)


def _between_collisions(
    first: tuple[Term, ...], second: tuple[Term, ...], order: float, kind: Kind, tolerance: float
) -> Distance:
    if kind == "pseudometric":
        raise InputError("kind: expected 'rows', 'sup' or 'joint' for collision laws, got 'pseudometric'")
    if len(first) != 1 or len(second) != 1 or first[0][2] != second[0][2]:
        raise InputError("distance: expected collision laws that both turn psi into pi - psi, or both keep it")
    return distance(first[0][1], second[0][1], order, kind, tolerance)


def _on_same_bins(
    first: Law | KernelMatrix, second: Law | KernelMatrix, tolerance: float
) -> tuple[KernelMatrix, KernelMatrix]:
    basis = next(one.basis for one in (first, second) if isinstance(one, KernelMatrix))
    one, other = (
        one if isinstance(one, KernelMatrix) else discretise(one, basis, tolerance=0.1 * tolerance)
        for one in (first, second)
    )
    check_comparable(one, other)
    return one, other


def _between_matrices(first: KernelMatrix, second: KernelMatrix, order: float, kind: Kind) -> Distance:
    sup = kind == "sup"
    joint = kind == "joint"
    found = joint_matrix_distance(first, second, order) if joint else matrix_distance(first, second, order, sup)
    return _labelled(found, noise_floor(first, second, order, sup))


def _labelled(found: Estimate, floor: float | None = None, asked: float | None = None) -> Distance:
    return Distance(found.value, found.error, found.kind, found.method, floor, asked)


# Weights of 2^-60 and less are below the rounding of the sum.
LARGEST_ORDER = 58


def moment_distance(first: Law | KernelMatrix, second: Law | KernelMatrix, tolerance: float) -> Estimate:
    r"""Sum over k, l >= 0 of 2^(-k - l - 2) times the absolute difference of the means of cos(k theta) cos(l theta').

    The means are taken under the flux measure, int int f(theta, theta') P(theta, d theta') nu(d theta) with
    nu = sin(theta)/2 d theta. The products of cosines span a dense subspace of the continuous functions on the square,
    so the distance tends to 0 exactly if the flux measures converge weakly.

    The sum is taken over k, l <= K. The remainder is at most 2 (1 - (1 - 2^(-K - 1))^2) < 2^(1 - K), because a
    difference of means is at most 2. In u = cos(theta) the functions are Chebyshev polynomials: K + 1 Legendre
    polynomials give their means exactly, and an error E of the matrix changes each mean by at most E.

    Source: Rudzis 2022, section 6.2.3, with the order of the arguments of f corrected: f(y, x) G(y, dx) nu(dy).
    """
    last = min(max(ceil(log2(2.0 / tolerance)), 1), LARGEST_ORDER)
    matrices = [
        law if isinstance(law, KernelMatrix) else discretise(law, Legendre(last + 1), tolerance=0.1 * tolerance)
        for law in (first, second)
    ]
    for matrix in matrices:
        if isinstance(matrix.basis, Legendre):
            last = min(last, matrix.size - 1)
    weight = 0.5 ** (np.arange(last + 1) + 1.0)
    difference = np.abs(flux_means(matrices[0], last) - flux_means(matrices[1], last))
    rest = 2.0 * (2.0 - 0.5 ** (last + 1)) * 0.5 ** (last + 1)
    error = float(matrices[0].error) + float(matrices[1].error) + rest
    how = f"cosines up to order {last}: errors of both matrices, and 2^{1 - last} for the rest of the sum"
    return Estimate(float(weight @ difference @ weight), error, joint_kind(matrices[0], matrices[1]), how)


def flux_means(matrix: KernelMatrix, last: int) -> Floats:
    """Means of cos(k theta) cos(l theta') under the flux measure, k, l = 0, ..., last."""
    cosines = _cosines(matrix.basis, last)
    return np.asarray(cosines @ matrix.symmetric @ cosines.T)


def _cosines(basis: Basis, last: int) -> Floats:
    """Coefficients of cos(k theta) in the basis, one row per k."""
    order = basis.nodes_per_interval + last
    angle, weight = basis.measure.quadrature(basis.edges, order)
    return np.asarray((weight * np.cos(np.arange(last + 1)[:, None] * angle)) @ basis.evaluate(angle))


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
        found = trace(reflector, reflector.period * source.random(number), theta)
        outgoing, lost = np.where(found.escaped, found.theta, theta), 1.0 - float(np.mean(found.escaped))
    elif isinstance(reflector, Law) and reflector.frame == "paper":
        outgoing, lost = reflector.sample(theta, source), 0.0
    else:
        raise InputError(f"reflector: expected a Wall, or a law in the paper's convention, got {reflector!r}")
    turned = np.abs(outgoing - theta)
    mean = mean_of_strata(turned, math.pi, f"{number} stratified rays")
    return replace(mean, error=mean.error + math.pi * lost)
