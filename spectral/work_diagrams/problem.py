"""A quantity whose error is to be measured against run time, and the methods that compute it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np

from ...checks import Floats
from ...errors import InputError
from .reference_value import ReferenceValue

ErrorNorm = Callable[[Floats], float]


def absolute(difference: Floats) -> float:
    """The largest modulus of an entry."""
    return float(np.max(np.abs(difference), initial=0.0))


def frobenius(difference: Floats) -> float:
    """The root of the sum of squares."""
    return float(np.linalg.norm(difference))


def operator_norm(difference: Floats) -> float:
    """The largest singular value of a matrix."""
    return float(np.linalg.norm(difference, 2))


NUMBER_NORMS: Mapping[str, ErrorNorm] = MappingProxyType({"absolute": absolute})
ARRAY_NORMS: Mapping[str, ErrorNorm] = MappingProxyType({"Frobenius": frobenius, "largest entry": absolute})
MATRIX_NORMS: Mapping[str, ErrorNorm] = MappingProxyType({**ARRAY_NORMS, "operator": operator_norm})


@dataclass(frozen=True, eq=False)
class WorkProblem:
    """A quantity with its references.

    Parameters
    ----------
    name : str
    references : ReferenceValue or tuple of ReferenceValue
        A method is measured against the first of them that it did not make.
    norms : mapping of str to callable, optional
        What is measured of the difference of a value and its reference; the first one decides on orders and fronts. By
        default ``absolute`` for a number; ``Frobenius``, ``largest entry`` and, for matrices, ``operator`` for arrays.
    auto : str
        Name of the method in which the library chooses for itself.

    Raises
    ------
    InputError
        If there is no reference, or their shapes differ.

    Examples
    --------
    >>> problem = WorkProblem("one third", ReferenceValue(1 / 3, 0.0, "by hand"))
    >>> list(problem.norms), problem.errors(0.5, "any method")
    (['absolute'], {'absolute': 0.16666666666666669})
    """

    name: str
    references: tuple[ReferenceValue, ...]
    norms: Mapping[str, ErrorNorm] = field(default_factory=dict)
    auto: str = "auto"

    def __post_init__(self) -> None:
        given = (self.references,) if isinstance(self.references, ReferenceValue) else tuple(self.references)
        if not given or not all(isinstance(reference, ReferenceValue) for reference in given):
            raise InputError(f"references: expected at least one ReferenceValue, got {self.references!r}")
        shapes = {reference.value.shape for reference in given}
        if len(shapes) > 1:
            raise InputError(f"references: expected values of one shape, got {sorted(shapes)}")
        dimension = given[0].value.ndim
        usual = (NUMBER_NORMS, ARRAY_NORMS, MATRIX_NORMS)[min(dimension, 2)]
        object.__setattr__(self, "references", given)
        object.__setattr__(self, "norms", MappingProxyType(dict(self.norms or usual)))

    def reference_for(self, method: str) -> ReferenceValue:
        """The first reference that ``method`` did not make; an InputError if it made them all."""
        for reference in self.references:
            if method not in reference.made_by:
                return reference
        raise InputError(f"{self.name}: method {method!r} made every reference; add one that is independent of it")

    def errors(self, value: Any, method: str) -> dict[str, float]:
        """The norms of ``value`` minus the reference for ``method``."""
        reference = self.reference_for(method).value
        found = np.asarray(value, dtype=np.float64)
        if found.shape != reference.shape:
            raise InputError(f"{method}: expected a value of shape {reference.shape}, got {found.shape}")
        return {name: norm(found - reference) for name, norm in self.norms.items()}


@dataclass(frozen=True, eq=False)
class WorkMethod:
    """One way to compute the quantity of a problem.

    Parameters
    ----------
    name : str
    solve : callable
        ``solve(budget)``, or ``solve(budget, rng)`` if ``is_random``; returns a number, an array, an `Estimate` or a
        `KernelMatrix`. A budget is whatever makes the method work harder as it grows: rays, nodes, 1/tolerance.
    is_random : bool
        Every repeat then has a generator of its own, and the error is the root mean square over the repeats.
    order : float, optional
        Declared order p: error ~ budget^-p. It is compared with the fitted one.

    Examples
    --------
    >>> WorkMethod("midpoint", lambda n: sum(((i + 0.5) / n) ** 2 for i in range(n)) / n, order=2.0).solve(1)
    0.25
    """

    name: str
    solve: Callable[..., Any]
    is_random: bool = False
    order: float | None = None
