"""The matrix of a law in a basis, by the method that suits the law."""

from __future__ import annotations

from dataclasses import replace
from typing import Unpack, get_args

import numpy as np

from ...core.checks import finite_number, generator, whole_number
from ...core.errors import InputError
from ..bases.basis import Basis
from ..bases.measure import SINE
from ..laws.law import Law
from ..matrices.matrix import KernelMatrix
from ..sampling.chunks import Engine
from ..sampling.monte_carlo import DEFAULT_SAMPLES
from ..sampling.sobol import PARTS
from .method import MOST_SEGMENTS, QUICK_SEGMENTS, SEED_WITHOUT_RNG, Budget, MethodName
from .methods import recipe


def discretise(
    law: Law,
    basis: Basis,
    method: MethodName = "auto",
    tolerance: float = 1e-8,
    samples: int | None = None,
    rng: np.random.Generator | None = None,
    *,
    symmetrise: bool = False,
    **engine: Unpack[Engine],
) -> KernelMatrix:
    r"""The Galerkin matrix <e_i, P e_j> of a law P in a basis of L^2(sin theta d theta).

    Parameters
    ----------
    law : Law
        Any law; of a combination each term is done by its best method.
    basis : Basis
        Bins, Legendre or Panels for theta.
    method : {"auto", "exact", "quadrature", "qmc", "monte-carlo"}
        ``"exact"``: laws of isometries, to rounding, plus a bound for beams of a polygonal wall that were not
        resolved, or for kinks of a composition left out near grazing. ``"quadrature"``:
        Gauss rules, refined until their error meets the tolerance or the work exceeds some seconds; what the error is
        estimated from stands in its ``method``. ``"qmc"``: rays from 8 scrambled Sobol sequences, independent random
        shifts of one; the error is from their spread; in a basis that is mirror-symmetric, as the law is, each ray
        counts with its mirror image. ``"monte-carlo"``: independent rays; the error is from the variance of the
        counts. The error of sampled matrices is a 95 % quantile. ``"auto"`` takes the first method of the table in
        the notes that accepts the law; ``KernelMatrix.method`` says which kind it was.
    tolerance : float
        Wanted Frobenius error of ``symmetric``. If it is not met the matrix says so: in its ``error`` and its repr.
    samples : int, optional
        Number of rays where rays are sampled, of ``"auto"`` the largest; 2**20 by default. ``"qmc"`` rounds up to 8
        times a power of two, for the quadrature of other driven laws it is the number of nodes.
    rng : numpy.random.Generator, optional
        Source of randomness; by default a fixed one, so that results are reproducible.
    symmetrise : bool
        For sampled matrices of reversible laws: count each ray both ways. The flux is then symmetric, and rows of
        ``array`` sum to 1 within the sampling error only.
    checkpoint : path, optional
        For ``"monte-carlo"`` in a basis of cells: a file in which the counts are stored every few seconds. The same
        call with the same file goes on where it was; the file of other rays is refused with the difference.
    client : int, str or distributed.Client, optional
        For the same: so many workers on this machine, the address of a scheduler, or a client of dask.distributed.
        The matrix is the same to the last bit without checkpoint and workers, for any number of workers, and however
        often it was stopped: counts are whole numbers, and a chunk of rays depends on its number alone.

    Returns
    -------
    KernelMatrix

    Raises
    ------
    InputError
        If the law does not have the method, the message says which it has; if an argument is not as described.
    AccuracyError
        If a bin received no ray, or more than 1e-4 of the rays did not escape from a wall.

    Notes
    -----
    The methods in the order in which ``"auto"`` asks them; each of the others asks those that bear its name.

    1. ``AutoWall`` (auto): a wall without closed form, by what predicts the tolerance soonest. Isometries of few
       pieces; as many rays as the tolerance needs, where that is less than ``samples``; isometries of many pieces;
       adaptive quadrature, unless a pilot run speaks against it; all rays; and of the last two the more exact matrix.
    2. ``IsometryTables`` (exact): isometries on pieces of the angle, with probabilities; so are polygonal walls.
    3. ``Isometries`` (exact): any other law that lists its isometries and is no composition.
    4. ``Diagonal`` (exact): Henyey-Greenstein scattering, in `Legendre`.
    5. ``Arcs`` (quadrature): circular arcs.
    6. ``Densities`` (quadrature): laws with a density.
    7. ``LeastResistance`` (quadrature): `LeastResistanceLaw`, in `Bins`.
    8. ``Maps`` (quadrature): deterministic laws.
    9. ``Actions`` (quadrature): any other law that does not average over entry points; an own ``_apply`` of one that
       does, in `Legendre`.
    10. ``Traced`` (quadrature): walls of few pieces, for laws that they are a part of.
    11. ``Sobol`` (qmc): laws driven by one uniform number.
    12. ``Traced`` (quadrature): any wall.
    13. ``EntryPoints`` (quadrature): any other law that averages over entry points; ``samples`` nodes.
    14. ``MonteCarlo`` (monte-carlo): any law.

    Methods 1 to 9 are asked for a law as a whole, then for its parts: a sum from its terms, a law in the other frame
    from the law in this one, a composition from its factors, if none of them needs rays. Methods 10 to 14 are the last.

    A composition is discretised as the operator that it is: the result is the Galerkin matrix of the product, not
    the product of Galerkin matrices, which differs unless the basis is invariant. Compositions are simplified by the
    algebra first: isometries are moved through mirror-symmetric laws, scatterings joined, mixtures multiplied out.
    They are then done by isometries, else by scatterings between isometries, else through adapted panels.

    Examples
    --------
    >>> from asperity.kernels.bases.bins import Bins
    >>> from asperity.kernels import maxwell
    >>> P = discretise(maxwell(0.5), Bins(2))
    >>> P.array.round(12).tolist(), P.method
    ([[0.25, 0.75], [0.75, 0.25]], 'quadrature + exact')
    """
    if not isinstance(law, Law):
        raise InputError(f"law: expected a law such as WallLaw(wall), got {law!r}")
    if not isinstance(basis, Basis):
        raise InputError(f"basis: expected a basis such as Bins(64), got {basis!r}")
    if basis.measure != SINE:
        raise InputError(f"basis: expected one for theta, with weight 'sin', got {basis!r}")
    if method not in get_args(MethodName):
        raise InputError(f"method: expected one of {', '.join(get_args(MethodName))}, got {method!r}")
    if finite_number("tolerance", tolerance) < 0.0:
        raise InputError(f"tolerance: expected a number of at least 0, got {tolerance!r}")
    number = DEFAULT_SAMPLES if samples is None else whole_number("samples", samples, 2 * PARTS)
    source = np.random.default_rng(SEED_WITHOUT_RNG) if rng is None else generator(rng)
    if symmetrise and not law.reversible:
        raise InputError(f"symmetrise: {law!r} is not known to be reversible, so its rays must not be turned round")
    if engine and method != "monte-carlo":
        raise InputError(f"method: checkpoint and client need 'monte-carlo', got {method!r}")
    # asked for by name, quadrature may take some seconds
    segments = MOST_SEGMENTS if method == "quadrature" else QUICK_SEGMENTS
    budget = Budget(tolerance, number, segments, rng=source, symmetrise=symmetrise, engine=engine or None)
    return replace(
        recipe(law, method)(basis, budget),
        law=repr(law),
        reversible=law.reversible,
        mirror_symmetric=law.mirror_symmetric,
        frame=law.frame,
        requested_tolerance=float(tolerance),
        metadata={"numpy": np.__version__},
    )
