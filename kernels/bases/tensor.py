"""Bases of products of functions of several angles."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NoReturn

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, finite_array, sequence
from ...core.errors import InputError
from .basis import Basis, BasisOfPoints
from .given import Vectorised


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
        object.__setattr__(self, "factors", flat)

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
