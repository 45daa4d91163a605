"""Bases of functions of several variables: products of bases of angles, and polynomials on the disc of velocities."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, finite_array, sequence, shaped, whole_number
from ...core.errors import InputError
from ...core.given import Vectorised
from .basis import Basis, BasisOfPoints


def _kron(parts: Sequence[Floats]) -> Floats:
    product = parts[0]
    for part in parts[1:]:
        product = np.asarray(np.kron(product, part), dtype=np.float64)
    return product


@dataclass(frozen=True, init=False, eq=False, repr=False)
class TensorBasis(BasisOfPoints):
    """All products e_i(theta) f_k(psi), with the last factor's index running fastest; the basis of ``P.tensor(Q)``.

    Parameters
    ----------
    factors : tuple of Basis
        One basis for each angle, at least two. Factors that are tensor bases are flattened.

    Raises
    ------
    InputError
        If there are fewer than two factors. The properties `measure`, `edges` and `nodes_per_interval` always raise it:
        they exist for each factor, not for the product.

    Examples
    --------
    >>> from asperity.kernels import Bins
    >>> TensorBasis((Bins(2), Bins(3, weight="sin2"))).size
    6
    """

    factors: tuple[Basis, ...]

    def __init__(self, factors: tuple[Basis, ...], *others: Basis) -> None:
        given = () if others else sequence("factors", factors)
        flat = tuple(
            part for factor in given for part in (factor.factors if isinstance(factor, TensorBasis) else (factor,))
        )
        if len(flat) < 2 or not all(isinstance(factor, Basis) for factor in flat):
            raise InputError(
                "factors: expected two bases or more, as in TensorBasis((Bins(16), Bins(8, weight='sin2'))), "
                f"got {factors!r}"
            )
        self._set(factors=flat)

    @property
    def is_partition(self) -> bool:
        """Whether every factor is a partition, so that the products are cells as well."""
        return all(factor.is_partition for factor in self.factors)

    @property
    def size(self) -> int:
        return int(np.prod([factor.size for factor in self.factors]))

    @property
    def constant(self) -> Floats:
        return _kron([factor.constant for factor in self.factors])

    @property
    def weights(self) -> Floats:
        return _kron([factor.weights for factor in self.factors])

    @property
    def normalisation(self) -> Floats:
        return _kron([factor.normalisation for factor in self.factors])

    def key(self) -> tuple[object, ...]:
        return self.factors

    def evaluate(self, angle: ArrayLike) -> Floats:
        """Values of all products, shape ``(..., n)``, at points whose last axis holds one angle per factor."""
        angle = finite_array("angle", angle)
        if angle.ndim == 0 or angle.shape[-1] != len(self.factors):
            raise InputError(f"angle: expected a last axis of length {len(self.factors)}, got shape {angle.shape}")
        values = self.factors[0].evaluate(angle[..., 0])
        for axis, factor in enumerate(self.factors[1:], start=1):
            product = values[..., :, None] * factor.evaluate(angle[..., axis])[..., None, :]
            values = product.reshape((*angle.shape[:-1], -1))
        return values

    def project(self, function: Callable[[Floats], Floats]) -> Floats:
        """Coefficients, shape (n,), of a function of points whose last axis holds one angle per factor."""
        rules = [f.measure.quadrature(f.edges, f.nodes_per_interval) for f in self.factors]
        grid = np.stack(np.meshgrid(*[rule[0] for rule in rules], indexing="ij"), axis=-1)
        # a function of points: its values have the shape of one of their coordinates
        values = Vectorised(lambda *_: function(grid), scalar=True)(grid[..., 0])
        for factor, (angle, weight) in zip(self.factors, rules, strict=True):
            # Contract the first remaining axis. The new axis goes to the end, which preserves the order of factors.
            values = np.tensordot(values, weight[:, None] * factor.evaluate(angle), axes=(0, 0))
        return values.ravel()

    def coarsened(self) -> tuple[TensorBasis, Floats] | None:
        parts = [factor.coarsened() for factor in self.factors]
        if all(part is None for part in parts):
            return None
        coarse = [part or (factor, np.eye(factor.size)) for part, factor in zip(parts, self.factors, strict=True)]
        return TensorBasis(tuple(basis for basis, _ in coarse)), _kron([table for _, table in coarse])

    def _refuse(self, what: str) -> NoReturn:
        raise InputError(f"{what}: a tensor basis has one for every angle; use basis.factors[k].{what}")

    def __repr__(self) -> str:
        return "TensorBasis(" + ", ".join(map(repr, self.factors)) + ")"


# Points of the disc may lie beyond its rim by rounding.
ROUNDED = 1e-12


@dataclass(frozen=True, eq=False, repr=False)
class Zernike(BasisOfPoints):
    r"""The Zernike functions of degree 0, ..., ``degree`` on the unit disc, orthonormal for its uniform measure.

    They are f_{n,0} = sqrt(n + 1) R_n^0(r), and for m > 0 f_{n,m} = sqrt(2 (n + 1)) R_n^m(r) cos(m phi) and f_{n,-m}
    with the sine, in the order f_{0,0}, f_{1,-1}, f_{1,1}, f_{2,-2}, f_{2,0}, ... The disc is that of the tangential
    velocities (v_x, v_y) of particles of speed 1, whose cosine law is the uniform measure: the basis of
    ``discretise(ker.HemisphereLaw(law), basis)``.

    Parameters
    ----------
    degree : int
        The largest degree, at least 0; there are (degree + 1)(degree + 2)/2 functions.

    Attributes
    ----------
    degrees, orders : array of int, shape (size,)
        n and m of each function; m < 0 for sines.

    Raises
    ------
    InputError
        If the degree is not a whole number of at least 0. The properties `measure`, `edges` and `nodes_per_interval`
        always raise it: they belong to functions of one angle.

    Source: F. Zernike, Physica 1 (1934) 689.

    Examples
    --------
    >>> Zernike(1).evaluate([0.5, 0.0]).tolist()
    [1.0, 0.0, 1.0]
    """

    degree: int

    def __post_init__(self) -> None:
        self._set(degree=whole_number("degree", self.degree, 0))

    @cached_property
    def degrees(self) -> NDArray[np.int64]:
        return np.repeat(np.arange(self.degree + 1), np.arange(self.degree + 1) + 1)

    @cached_property
    def orders(self) -> NDArray[np.int64]:
        return np.concatenate([np.arange(-n, n + 1, 2) for n in range(self.degree + 1)])

    @property
    def size(self) -> int:
        return (self.degree + 1) * (self.degree + 2) // 2

    @property
    def constant(self) -> Floats:
        return np.asarray(np.eye(1, self.size)[0])

    def key(self) -> tuple[object, ...]:
        return (self.degree,)

    def evaluate(self, angle: ArrayLike) -> Floats:
        """Values of all functions, shape ``(..., n)``, at points of the disc, whose last axis holds (v_x, v_y)."""
        points = shaped("angle", angle, "...", 2)
        if (farthest := float(np.hypot(points[..., 0], points[..., 1]).max(initial=0.0))) > 1.0 + ROUNDED:
            raise InputError(f"angle: expected points of the unit disc, got one at the distance {farthest:g} from 0")
        return zernike_functions(points, self.degrees, self.orders)

    def project(self, function: Callable[[Floats], Floats]) -> Floats:
        """Coefficients <f_i, g>, shape (n,), of a function of points of the disc, whose last axis holds (v_x, v_y)."""
        number = self.degree + 1
        square, weight = np.polynomial.legendre.leggauss(number)
        phi = np.pi * np.arange(2 * number) / number
        radius = np.sqrt(0.5 + 0.5 * square)[:, None]
        points = np.stack([radius * np.cos(phi), radius * np.sin(phi)], axis=-1)
        values = Vectorised(lambda _: function(points), scalar=True)(points[..., 0])
        return np.asarray(np.einsum("rpi,rp,r->i", self.evaluate(points), values, weight / (4.0 * number)))

    def magnitudes(self) -> tuple[Floats, Floats]:
        # |R_n^m| <= 1 = R_n^m(1), so that the sum of squares is largest on the rim: (n + 1)^2 of each degree
        sizes = np.arange(1.0, self.degree + 2.0)
        return np.array([np.sqrt(np.sum(sizes**2))]), np.array([np.inf])

    def derivative_norm(self) -> float:
        # the mean squared gradient of f_{n,m} is (n + 1)(n (n + 2) - m^2)
        return float(np.sqrt(np.sum((self.degrees + 1.0) * (self.degrees * (self.degrees + 2.0) - self.orders**2))))

    def coarsened(self) -> tuple[Zernike, Floats] | None:
        if not self.degree:
            return None
        coarse = Zernike(self.degree // 2)
        return coarse, np.eye(coarse.size, self.size)

    def __repr__(self) -> str:
        return f"Zernike({self.degree})"

    def _refuse(self, what: str) -> NoReturn:
        raise InputError(
            f"{what}: {self!r} has functions on the disc, not of one angle; use it with ker.HemisphereLaw(law)"
        )


def zernike_functions(points: Floats, degrees: NDArray[np.int64], orders: NDArray[np.int64]) -> Floats:
    """Values f_{n,m}, shape (..., n), of the functions of `Zernike` with these degrees and orders, at (..., 2) points.

    R_n^m(r) = r^m P_k^(0,m)(2 r^2 - 1) with k = (n - m)/2, and r^m e^(i m phi) = (x + i y)^m.
    """
    order = np.abs(orders)
    found = np.empty((*points.shape[:-1], degrees.size))
    z = points[..., 0] + 1j * points[..., 1]
    power, square = np.ones_like(z), points[..., 0] ** 2 + points[..., 1] ** 2
    for m in range(int(order.max(initial=0)) + 1):
        own = np.flatnonzero(order == m)
        index = (degrees[own] - m) // 2
        radial = jacobi_polynomials(square, m, int(index.max(initial=-1)) + 1)
        for k, column in zip(index.tolist(), own.tolist(), strict=True):
            angular = power.imag if orders[column] < 0 else power.real
            found[..., column] = np.sqrt((degrees[column] + 1.0) * (2.0 if m else 1.0)) * radial[k] * angular
        power = power * z
    return found


def jacobi_polynomials(square: Floats, order: int, count: int) -> Floats:
    """Values P_k^(0,m)(2 r^2 - 1), k = 0, ..., count - 1, shape (count, ...), by their recurrence in k."""
    x, m = 2.0 * square - 1.0, float(order)
    found = np.ones((count, *np.shape(square)))
    for k in range(1, count):
        if k == 1:
            found[1] = 0.5 * ((m + 2.0) * x - m)
            continue
        s = 2.0 * k + m
        linear = (s - 1.0) * (s * (s - 2.0) * x - m * m) * found[k - 1]
        found[k] = (linear - 2.0 * (k - 1.0) * (k + m - 1.0) * s * found[k - 2]) / (2.0 * k * (k + m) * (s - 2.0))
    return found
