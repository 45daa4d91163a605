"""The function `discretise`, which computes the matrix of a law in a basis."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from typing import Unpack, get_args

import numpy as np

from ...core.checks import DOUBLE, Rng, check_memory, choice, generator, instance
from ...core.errors import InputError
from ...core.estimates import Estimate
from ...core.long_runs import Engine, reported
from ..bases.assembly import reflection_matrix
from ..bases.basis import Basis, checked_basis
from ..bases.measure import SINE
from ..bases.partitions import Bins
from ..bases.spaces import TensorBasis
from ..laws.law import Law
from ..laws.matrix_law import MatrixLaw, finite_matrix
from ..laws.structure import Rules, SpatialLaw, fold, holds_of_all
from ..matrices.matrix import KernelMatrix
from .method import SEED_WITHOUT_RNG, Method, MethodName, checked_budget
from .methods import METHODS, SAMPLED, matrix_by

# Memory in which a matrix is computed, in matrices, and least time of an entry.
MATRICES, SECONDS = 6, 4e-7


def discretise(
    law: Law | SpatialLaw,
    basis: Basis,
    method: MethodName | str = "auto",
    tolerance: float = 1e-8,
    samples: int | None = None,
    rng: Rng = None,
    *,
    symmetrise: bool = False,
    **engine: Unpack[Engine],
) -> KernelMatrix:
    r"""The Galerkin matrix <e_i, P e_j> of a law P in a basis of L^2(sin theta d theta).

    A law of angles (theta, psi), such as a `CollisionLaw`, takes a `TensorBasis` of a basis in theta and one in psi
    with ``weight="sin2"``. A `HemisphereLaw` and a `SurfaceLaw` take `Zernike`. A law made of specular reflection and
    retroreflection also takes a basis in psi alone, because both preserve sin(psi)^2 d psi as well.

    Parameters
    ----------
    law : Law, CollisionLaw, HemisphereLaw or SurfaceLaw
        Any law; for a combination each term is computed by its best method.
    basis : Basis
        Bins, Legendre or Panels for theta; Zernike for tangential velocities.
    method : {"auto", "exact", "quadrature", "qmc", "monte-carlo"} or str
        A kind of methods, or the name of one of the notes, as ``"by_sobol_rays"``.

        ``"exact"``: laws of isometries, to rounding; the error includes a bound for unresolved beams of a polygonal
        wall, or for breakpoints of a composition left out near grazing. ``"quadrature"``: Gauss rules, refined until
        their error meets the tolerance or the work exceeds some seconds; ``error.method`` tells how the error is
        estimated. ``"qmc"``: rays from 8 scrambled Sobol sequences, independent random shifts of one sequence, whose
        spread gives the error; if law and basis are mirror-symmetric, each ray counts with its mirror image.
        ``"monte-carlo"``: independent rays; the variance of the counts gives the error. The error of sampled matrices
        is a 95 % quantile. ``"auto"``: the first method of the table in the notes that accepts the law;
        ``KernelMatrix.method`` tells its kind.
    tolerance : float
        Wanted Frobenius error of ``symmetric``. The ``error`` and the repr of the matrix show if it was not met.
    samples : int, optional
        Number of sampled rays, for ``"auto"`` the largest number; 2**20 by default. ``"qmc"`` rounds it up to 8 times
        a power of two. For the quadrature of other driven laws it is the number of nodes.
    rng : None, int or numpy.random.Generator
        Source of randomness. The default has a fixed seed, so that results are reproducible.
    symmetrise : bool
        Whether each ray counts in both directions, for sampled matrices of reversible laws. The flux is then symmetric,
        and rows of ``array`` sum to 1 only within the sampling error.
    checkpoint : path, optional
        A file in which the sums are stored every few seconds, for ``"monte-carlo"``, and for ``"qmc"`` of a law driven
        by one uniform number or of a `SurfaceLaw`. The same call with the same file continues the run; the file of
        other rays is refused, and the message names the difference.
    key : str, optional
        A name of one's own for the computation, for a law whose content a checkpoint cannot compare; as of
        `asperity.spectral.sweep`.
    client : int, str or distributed.Client, optional
        For the same: a number of workers on this machine, the address of a scheduler, or a client of dask.distributed.
        The matrix is the same to the last bit without checkpoint and workers, for any number of workers and any number
        of restarts: a chunk of rays depends only on its number, which for ``"qmc"`` is its place in the sequence,
        counts are integers, and in bases without cells sums are added in the order of the chunks.

    Returns
    -------
    KernelMatrix

    Raises
    ------
    InputError
        If the law does not have the method (the message lists its methods), or an argument is not as described.
    AccuracyError
        If a bin received no ray, or more than 1e-4 of the rays did not escape from a wall.

    Notes
    -----
    ``"auto"`` tries the methods in this order; a kind tries the methods of its kind, and a name this method alone.

    {methods}

    A wall without further parts takes the first of these that meets the tolerance, or the most exact: isometries, if
    the beams of a polygonal wall resolve; 2^17 rays; conditional distributions, of walls that close and have at most 16
    pieces; all rays. The error does not grow if the tolerance falls. The same for a wall in the other frame.

    Methods 1 to 11 are tried for the whole law, then for its parts: a sum is computed from its terms, a law in the
    other frame from its inner law, a composition from its factors if none of them needs rays. Methods 12 to 14 come
    last. A wall is the sum of its `parts`.

    A law of matrices, with Lambertian reflection and isometries, in `Bins` that refine the matrices' is exact (auto).

    For a composition the result is the Galerkin matrix of the product, not the product of Galerkin matrices, which
    differs unless the basis is invariant. Mixtures in compositions are multiplied out first. Compositions are then
    computed by isometries, else through adapted panels.

    Examples
    --------
    >>> from asperity.kernels.bases.partitions import Bins
    >>> from asperity.kernels import maxwell
    >>> P = discretise(maxwell(0.5), Bins(2))
    >>> P.array.round(12).tolist(), P.method
    ([[0.25, 0.75], [0.75, 0.25]], 'quadrature + exact')

    The law of a smooth disk, on functions of both angles; the flip of psi alone; and their tensor product:

    >>> from asperity import geometry as geo, kernels as ker
    >>> angles = ker.Bins(2), ker.Bins(2, weight="sin2")
    >>> K = discretise(ker.CollisionLaw(ker.specular(), geo.Disk()), ker.TensorBasis(angles))
    >>> K.array[0].round(12).tolist()
    [0.0, 0.0, 0.0, 1.0]
    >>> flip = discretise(ker.specular(), angles[1])
    >>> bool((discretise(ker.specular(), angles[0]).tensor(flip).array == K.array).all())
    True
    """
    if isinstance(law, SpatialLaw):
        return law.matrix_on(
            basis,
            partial(
                discretise,
                method=method,
                tolerance=tolerance,
                samples=samples,
                rng=rng,
                symmetrise=symmetrise,
                **engine,
            ),
        )
    source = generator(rng, SEED_WITHOUT_RNG)
    instance("law", law, Law, "ker.WallLaw(wall)")
    checked_basis(basis)
    if isinstance(basis, TensorBasis):
        raise InputError(f"basis: expected a basis of one angle for {law!r}, got {basis!r}; use P.tensor(Q)")
    if basis.measure != SINE:
        return _on_roll_angles(law, basis)
    check_memory("basis", f"computing the matrix in {basis!r}", MATRICES * basis.size**2)
    choice("method", method, (*get_args(MethodName), *(each.matrix.__name__ for each in (*METHODS, *SAMPLED))))
    budget = checked_budget(law, method, tolerance, samples, source, symmetrise=symmetrise, engine=engine)
    exact = finite_matrix(law, edges=basis.edges) if isinstance(basis, Bins) else None
    has_bins = method == "auto" and not holds_of_all(law, lambda part: not isinstance(part, MatrixLaw))
    entries = basis.size**2
    with reported(f"matrix in {basis!r}", SECONDS * entries, DOUBLE * MATRICES * entries):
        found = replace(exact, basis=basis) if exact is not None and has_bins else matrix_by(law, method, basis, budget)
    return replace(
        found,
        beyond=None if exact is None or found.samples else exact.beyond,
        law=repr(law),
        reversible=law.reversible,
        mirror_symmetric=law.mirror_symmetric,
        frame=law.frame,
        requested_tolerance=float(tolerance),
        metadata={"numpy": np.__version__},
    )


def _rows_of(methods: Iterable[Method]) -> str:
    """The table of the docstring: number, name, kind, and the first line of each method."""
    return "\n    ".join(
        f"{number}. ``{each.matrix.__name__}`` ({each.name}): {(each.matrix.__doc__ or '').partition(chr(10))[0]}"
        for number, each in enumerate(methods, start=1)
    )


discretise.__doc__ = (discretise.__doc__ or "").replace("{methods}", _rows_of((*METHODS, *SAMPLED)))


def _on_roll_angles(law: Law, basis: Basis) -> KernelMatrix:
    """The matrix on functions of psi of a law made of specular reflection and retroreflection.

    It is (1 + r)/2 + (1 - r)/2 J, where r is the eigenvalue of odd functions.
    """
    odd = fold(law, Rules(_on_odd_functions, lambda terms: sum(w * r for w, r in terms), math.prod, lambda r: -r))
    symmetric = 0.5 * (1.0 + odd) * np.eye(basis.size) + 0.5 * (1.0 - odd) * reflection_matrix(basis)
    exact = Estimate(0.0, 0.0, "bound", "closed form")
    return KernelMatrix(
        symmetric, basis, exact, method="exact", law=repr(law), reversible=True, mirror_symmetric=True, frame=law.frame
    )


def _on_odd_functions(law: Law) -> float:
    """The eigenvalue -1 of specular reflection, 1 of retroreflection; raises InputError for other laws."""
    if law.retro is not None:
        return 1.0 if law.retro else -1.0
    raise InputError(
        f"basis: {law!r} preserves sin(theta) d theta, not sin(psi)^2 d psi; give a basis with weight 'sin', or "
        "compose the law from specular() and retroreflection()"
    )
