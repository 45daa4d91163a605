"""The reference values of a quantity, and the methods that compute it, for diagrams of error against run time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, finite_array, finite_number, frozen, number_between, sequence
from ...core.errors import InputError
from ...core.estimates import Summary
from ...core.rounding import EPS

# Relative error of a value that counts as exact: rounding of a few thousand operations.
ROUNDED = 4096.0 * EPS


@dataclass(frozen=True, eq=False, repr=False)
class ReferenceValue(Summary):
    """A reference value of a quantity.

    Parameters
    ----------
    value : array_like
        A number or an array of any shape.
    error : float
        Error of ``value`` in the problem's norm; 0 if ``value`` is exact to rounding.
    source : str
        Origin in words, such as "closed form", "beams", "2^24 rays of independent Sobol sequences".
    made_by : tuple of str
        Names of methods that share code with the reference; they are compared with another reference.

    Raises
    ------
    InputError
        If a number is not finite, the error negative, or the source empty.

    Examples
    --------
    >>> ReferenceValue(0.25, 0.0, "closed form").is_exact
    True
    """

    value: Floats
    error: float
    source: str
    made_by: tuple[str, ...] = ()

    def __init__(self, value: ArrayLike, error: float, source: str, made_by: tuple[str, ...] = ()) -> None:
        object.__setattr__(self, "value", frozen(finite_array("value", value)))
        object.__setattr__(self, "error", finite_number("error", error))
        object.__setattr__(self, "source", str(source))
        object.__setattr__(self, "made_by", sequence("made_by", made_by, str, "'panels'"))
        if self.error < 0.0:
            raise InputError(f"error: expected a number of at least 0, got {error!r}")
        if not self.source:
            raise InputError("source: expected words that say where the reference comes from, got none")

    @property
    def is_exact(self) -> bool:
        """Whether the error is not larger than rounding."""
        return self.error <= ROUNDED * max(1.0, float(np.max(np.abs(self.value), initial=0.0)))


@dataclass(frozen=True, eq=False, repr=False)
class WorkProblem(Summary):
    """A quantity with its reference values and the norm of errors.

    Parameters
    ----------
    name : str
    references : ReferenceValue or tuple of ReferenceValue
        A method is compared with the first reference that does not share its code.
    norm : callable, optional
        Norm of the difference of a value from its reference, by default the root of the sum of squares.
    auto : str
        Name of the method by which the library chooses a method itself.

    Raises
    ------
    InputError
        If there is no reference, or their shapes differ.

    Examples
    --------
    >>> problem = WorkProblem("one third", ReferenceValue(1 / 3, 0.0, "by hand"))
    >>> round(problem.error(0.5, "any method"), 12)
    0.166666666667
    """

    name: str
    references: tuple[ReferenceValue, ...]
    norm: Callable[[Floats], Any] = np.linalg.norm
    auto: str = "auto"

    def __post_init__(self) -> None:
        given = (self.references,) if isinstance(self.references, ReferenceValue) else self.references
        given = sequence("references", given, ReferenceValue, "spec.ReferenceValue(0.5, 0.0, 'by hand')")
        if not given:
            raise InputError("references: expected at least one ReferenceValue, got none")
        shapes = {reference.value.shape for reference in given}
        if len(shapes) > 1:
            raise InputError(f"references: expected values of one shape, got {sorted(shapes)}")
        object.__setattr__(self, "references", given)

    def reference_for(self, method: str) -> ReferenceValue:
        """The first reference that does not share its code with ``method``; an InputError if there is none."""
        for reference in self.references:
            if method not in reference.made_by:
                return reference
        raise InputError(f"{self.name}: method {method!r} made every reference; add one that is independent of it")

    def error(self, value: Any, method: str) -> float:
        """The norm of ``value`` minus the reference for ``method``; an InputError if a number is not finite."""
        reference = self.reference_for(method).value
        found = finite_array(method, value)
        if found.shape != reference.shape:
            raise InputError(f"{method}: expected a value of shape {reference.shape}, got {found.shape}")
        return number_between("norm", self.norm(found - reference), 0.0, np.inf, closed="low")


@dataclass(frozen=True, eq=False, repr=False)
class WorkMethod(Summary):
    """A method that computes the quantity of a problem.

    Parameters
    ----------
    name : str
    solve : callable
        ``solve(budget)``, or ``solve(budget, rng)`` if ``is_random``; returns a number, an array, an `Estimate` or a
        `KernelMatrix`. The work increases with the budget, such as the number of rays or nodes, or 1/tolerance.
    is_random : bool
        If True, every repeat has its own generator, and the error is the root mean square over the repeats.
    order : float, optional
        Declared order p of error ~ budget^-p, which is compared with the fitted order.

    Examples
    --------
    >>> WorkMethod("midpoint", lambda n: sum(((i + 0.5) / n) ** 2 for i in range(n)) / n, order=2.0).solve(1)
    0.25
    """

    name: str
    solve: Callable[..., Any]
    is_random: bool = False
    order: float | None = None
