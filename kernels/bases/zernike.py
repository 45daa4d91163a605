"""Orthonormal polynomials on the disc of tangential velocities, for the uniform measure."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, shaped, whole_number
from ...core.errors import InputError
from .basis import BasisOfPoints
from .given import Vectorised


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
        object.__setattr__(self, "degree", whole_number("degree", self.degree, 0))

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
        return zernike_functions(shaped("angle", angle, "...", 2), self.degrees, self.orders)

    def project(self, function: Callable[[Floats], Floats]) -> Floats:
        """Coefficients <f_i, g>, shape (n,), of a function of points of the disc, whose last axis holds (v_x, v_y)."""
        number = self.degree + 1
        square, weight = np.polynomial.legendre.leggauss(number)
        phi = np.pi * np.arange(2 * number) / number
        radius = np.sqrt(0.5 + 0.5 * square)[:, None]
        points = np.stack([radius * np.cos(phi), radius * np.sin(phi)], axis=-1)
        values = Vectorised(lambda _: function(points), scalar=True)(points[..., 0])
        return np.asarray(np.einsum("rpi,rp,r->i", self.evaluate(points), values, weight / (4.0 * number)))

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
    from scipy.special import eval_jacobi

    order = np.abs(orders)
    z = (points[..., 0] + 1j * points[..., 1])[..., None]
    factors = np.broadcast_to(z, (*z.shape[:-1], int(order.max(initial=0)) + 1)).copy()
    factors[..., 0] = 1.0
    powers = np.cumprod(factors, axis=-1)
    angular = np.where(orders < 0, powers.imag[..., order], powers.real[..., order])
    radial = eval_jacobi((degrees - order) // 2, 0.0, order, 2.0 * np.abs(z) ** 2 - 1.0)
    return np.asarray(np.sqrt((degrees + 1.0) * np.where(orders, 2.0, 1.0)) * radial * angular)
