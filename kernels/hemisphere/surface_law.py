"""The law of velocities of a wall that is rough in two directions, by rays of scrambled Sobol sequences."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats, choice, generator, instance
from ...core.rounding import EPS
from ...geometry.surfaces.surface import Surface
from ..bases.basis import Basis
from ..bases.spaces import Zernike, jacobi_polynomials, zernike_functions
from ..discretisation.method import SEED_WITHOUT_RNG, checked_budget, sobol_matrix
from ..laws.structure import Discretiser
from ..matrices.matrix import KernelMatrix
from ..sampling.chunks import RaySums
from ..sampling.sobol import SobolRays, SobolSampler
from .hemisphere_law import DirectionFactor, OnDisc, Orientation, checked_orientation

# Rays of a pilot run, which predicts how many meet the tolerance. The error falls with their root at least.
PILOT_RAYS = 2**15
# Methods of `discretise` that are rays.
METHODS = ("auto", "qmc", "by_sobol_rays")


@dataclass(frozen=True, repr=False)
class SurfaceLaw(DirectionFactor):
    r"""The law of velocities in space of a wall that is rough in two directions.

    A particle meets the surface at a random point of its periods, and leaves it with the velocity after the last of its
    collisions; the speed is kept. The law keeps the cosine law, which is the uniform measure on the disc of the
    tangential velocities (v_x, v_y), and a smooth wall is the identity of this disc.

    Parameters
    ----------
    surface : Surface
    orientation : float or "random"
        The angle from the wall's x axis to that of the surface, in radians. ``"random"``: a direction that each
        particle finds at random, uniformly: an isotropic wall of patches of the surface.

    Raises
    ------
    InputError
        If the surface is none, or the orientation is neither an angle up to 2 pi nor "random".

    Notes
    -----
    ``discretise(law, ker.Zernike(8))`` traces rays of eight scrambled Sobol sequences in four dimensions, the entry
    point and the incoming velocity; the law is averaged over random orientations exactly. Each ray counts in both
    directions: the reversal of a collision takes -v_t' to -v_t. So at a fixed orientation the operator P J is
    symmetric, where J turns by half a turn, but not P. With a random one P is symmetric, because half a turn is one of
    the orientations. The error, from the spread of the sequences, falls like the number of rays to the power -.8.

    Rays that do not escape count as retroreflected; more than 1e-4 of them are an AccuracyError.

    ``0.3 * S + 0.7 * H`` is a mixture and ``S @ H`` the product, also with a `HemisphereLaw`; see `DirectionLaw`.

    Source: R. Feres and G. Yablonsky, Chemical Engineering Science 59 (2004) 1541, for laws of microscopic surfaces.

    Examples
    --------
    >>> from asperity import geometry as geo, kernels as ker
    >>> S = SurfaceLaw(geo.Surface([[0.0]]), orientation=0.5)
    >>> S.sample([3.0, 4.0, -1.0], rng=0).round(12).tolist()
    [3.0, 4.0, 1.0]
    >>> ker.discretise(S, ker.Zernike(1), samples=256).symmetric[0].tolist()
    [1.0, 0.0, 0.0]
    """

    surface: Surface
    orientation: Orientation = "random"
    # of the sampler: no ray counts with its mirror image
    mirror_symmetric: ClassVar[bool | None] = None

    def __post_init__(self) -> None:
        instance("surface", self.surface, Surface, "geo.Surface([[0.0, 1.0]])")
        self._set(orientation=checked_orientation(self.orientation))

    @property
    def symmetric(self) -> bool | None:
        return True if self.orientation == "random" else None

    def random_map(self) -> Callable[[Floats], tuple[Floats, Floats, NDArray[np.bool_]]]:
        """From uniform numbers, shape (n, 4), to incoming and outgoing velocities and which rays escaped.

        The velocities are in the surface's axes, and the incoming ones have the cosine law.
        """

        def reflect(points: Floats) -> tuple[Floats, Floats, NDArray[np.bool_]]:
            radius, angle = np.sqrt(points[:, 2]), 2.0 * np.pi * points[:, 3]
            down = -np.sqrt(1.0 - points[:, 2])
            incoming = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), down])
            return incoming, *self.exit_velocities(points[:, :2], incoming)

        return reflect

    def exit_velocities(self, entry: Floats, incoming: Floats) -> tuple[Floats, NDArray[np.bool_]]:
        """Outgoing velocities of rays that enter at these fractions of the periods, and which escaped."""
        found = self.surface.trace(entry * self.surface.periods, incoming)
        return np.where(found.escaped[:, None], found.velocities, -incoming), found.escaped

    def reflected(self, incoming: Floats, rng: np.random.Generator) -> Floats:
        angle: Any = self.orientation
        if isinstance(self.orientation, str):
            angle = rng.uniform(0.0, 2.0 * np.pi, len(incoming))
        outgoing, _ = self.exit_velocities(rng.random((len(incoming), 2)), turned(incoming, -angle))
        return turned(outgoing, angle)

    def on_zernike(
        self, degree: int, degrees: NDArray[np.int64], orders: NDArray[np.int64], discretise: Discretiser
    ) -> OnDisc:
        found: Any = discretise(self, Zernike(degree))
        # n (n + 1)/2 functions have lower degrees, (n + m)/2 of the same degree lower orders
        own = degrees * (degrees + 1) // 2 + (degrees + orders) // 2
        error = float(found.error)
        return OnDisc(found.symmetric[np.ix_(own, own)], error, error, found.error.kind)

    def matrix_on(self, basis: Basis, discretise: partial[KernelMatrix]) -> KernelMatrix:
        """The matrix in Zernike functions, from as many rays as should meet the tolerance, or all."""
        instance("basis", basis, Zernike, "ker.Zernike(8) for a law of directions")
        asked = dict(discretise.keywords)
        method, tolerance, symmetrise = (asked.pop(name) for name in ("method", "tolerance", "symmetrise"))
        choice("method", method, METHODS)
        samples, source = asked.pop("samples"), generator(asked.pop("rng"), SEED_WITHOUT_RNG)
        budget = checked_budget(self, method, tolerance, samples, source, symmetrise=symmetrise, engine=asked)  # type: ignore[arg-type]
        sampler = SobolSampler(self, basis, budget.rng, SurfaceRays)
        found = sobol_matrix(sampler, replace(budget, rays=min(PILOT_RAYS, budget.rays), engine=None))
        excess = float(found.error) / max(budget.tolerance, EPS)
        if excess > 1.0:
            found = sobol_matrix(sampler, replace(budget, rays=math.ceil(min(PILOT_RAYS * excess**2, budget.rays))))
        return replace(
            found, law=repr(self), reversible=self.reversible, frame="specular", requested_tolerance=float(tolerance),
            raw_defect=None,
        )  # fmt: skip

    def __repr__(self) -> str:
        angle = "" if isinstance(self.orientation, str) else f", orientation={self.orientation:.12g}"
        return f"SurfaceLaw({self.surface!r}{angle})"


@dataclass(frozen=True, eq=False)
class SurfaceRays(SobolRays):
    """Rays of a surface, of which each is added in both directions to the sums in Zernike functions."""

    dimension: ClassVar[int] = 4

    def add_points(self, sums: RaySums, first: int, points: Floats) -> None:
        law: Any = self.law
        incoming, outgoing, escaped = law.random_map()(points.reshape(-1, self.dimension))
        sums.count_unresolved(escaped)
        for part, rays in enumerate(np.arange(len(incoming)).reshape(len(points), -1)):
            table, before, after = sums.tables[first + part], incoming[rays, :2], outgoing[rays, :2]
            if law.orientation == "random":
                add_average(table, self.basis, before, after)
            else:
                add_both_ways(table, self.basis, turned(before, law.orientation), turned(after, law.orientation))


def add_both_ways(table: Floats, basis: Any, before: Floats, after: Floats) -> None:
    """Add the sums of f_i(v) f_j(v') over rays (v, v') and their reversals (-v', -v); f(-v) = (-1)^n f(v)."""
    values, images = (zernike_functions(v, basis.degrees, basis.orders) for v in (before, after))
    sums = values.T @ images
    sign = (-1.0) ** np.add.outer(basis.degrees, basis.degrees)
    _add_with_constants(table, 0.5 * (sums + sign * sums.T), len(before))


def add_average(table: Floats, basis: Any, before: Floats, after: Floats) -> None:
    """Add the means of `add_both_ways` over all orientations.

    Turning the surface multiplies f_{n,m}(v) conj(f_{n',m'}(v')) by e^(i (m - m') angle), so that different orders do
    not mix. With B = E f_n(r) f_n'(r') e^(i m (phi' - phi)), P has the matrix Re B between cosines and between sines,
    Im B from cosines to sines and -Im B back.
    """
    z, image = before[:, 0] + 1j * before[:, 1], after[:, 0] + 1j * after[:, 1]
    # f_n f_n' e^(i m (phi' - phi)) has the factor (r r')^m e^(i m (phi' - phi))
    product, power = image * z.conj(), np.ones_like(z)
    squares, sums = (np.abs(z) ** 2, np.abs(image) ** 2), np.zeros_like(table)
    for m in range(basis.degree + 1):
        cosines, sines = (np.flatnonzero(basis.orders == sign * m) for sign in (1, -1))
        size = np.sqrt(np.arange(m, basis.degree + 1, 2) + 1.0)[:, None]
        values, images = (size * jacobi_polynomials(square, m, cosines.size) for square in squares)
        real, turning = ((values * part) @ images.T for part in (power.real, power.imag))
        real, turning = 0.5 * (real + real.T), 0.5 * (turning - turning.T)
        sums[np.ix_(cosines, cosines)] = real
        if m:
            sums[np.ix_(sines, sines)] = real
            sums[np.ix_(cosines, sines)], sums[np.ix_(sines, cosines)] = turning, -turning
        power = power * product
    _add_with_constants(table, sums, len(before))


def _add_with_constants(table: Floats, sums: Floats, rays: int) -> None:
    """Add sums, of which those with the constant function are known."""
    sums[0], sums[:, 0] = 0.0, 0.0
    sums[0, 0] = rays
    table += sums


def turned(vectors: Floats, angle: float | Floats) -> Floats:
    """Vectors of shape (n, 2) or (n, 3) turned about the normal."""
    cosine, sine = np.cos(angle), np.sin(angle)
    x, y, *rest = vectors.T
    return np.column_stack([cosine * x - sine * y, sine * x + cosine * y, *rest])
