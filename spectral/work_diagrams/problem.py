"""The problems of diagrams of error against run time: reference values, methods, orders of convergence, the machine."""

from __future__ import annotations

import os
import platform
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, finite_array, finite_number, frozen, number_between, sequence
from ...core.errors import InputError
from ...core.estimates import Summary, with_error
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
        self._set(value=frozen(finite_array("value", value)), error=finite_number("error", error), source=str(source))
        self._set(made_by=sequence("made_by", made_by, str, "'panels'"))
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
        self._set(references=given)

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


# Least number of points of a fit with a confidence interval.
FEWEST_POINTS = 3
CONFIDENCE = 0.95
# Largest difference of orders that agree.
ALLOWANCE = 0.15
OrderVerdict = Literal["agrees", "differs", "not resolved"]


@dataclass(frozen=True, repr=False)
class FittedOrder(Summary):
    """The order p of error ~ size^-p, fitted in the logarithms.

    Attributes
    ----------
    order : float
    low, high : float
        Ends of its 95 % confidence interval; see `fit_order`.
    points : int
        Number of measurements.
    """

    order: float
    low: float
    high: float
    points: int

    def agrees_with(self, declared: float) -> bool:
        """Whether the declared order is within 0.15 of the fitted one."""
        return abs(self.order - declared) <= ALLOWANCE

    def verdict(self, declared: float) -> OrderVerdict:
        """The verdict: "agrees" within 0.15, "differs" if the interval excludes ``declared``, else "not resolved".

        Examples
        --------
        >>> FittedOrder(1.5, 1.2, 1.8, 4).verdict(1.75), FittedOrder(1.5, 1.4, 1.6, 4).verdict(1.75)
        ('not resolved', 'differs')
        """
        if self.agrees_with(declared):
            return "agrees"
        return "not resolved" if self.low <= declared <= self.high else "differs"

    def __str__(self) -> str:
        return with_error(self.order, max(self.high - self.order, self.order - self.low))

    def _headline(self) -> str:
        return str(self)


def fit_order(size: ArrayLike, error: ArrayLike, repeats: ArrayLike | None = None) -> FittedOrder | None:
    """Fit the order by least squares of log(error) on log(size); None for fewer than three different sizes.

    Parameters
    ----------
    size, error : array_like, shape (points,)
        Positive numbers.
    repeats : array_like, shape (points,), optional
        For random methods, the number of independent repeats whose root mean square is the error.

    Returns
    -------
    FittedOrder or None
        Without ``repeats`` the interval is Student's, from the scatter about the line. With ``repeats`` errors are
        treated as random: for Gaussian errors, n times the squared error is proportional to a chi-square with n degrees
        of freedom, and the variance of its logarithm is trigamma(n/2)/4. The points are weighted accordingly, and the
        interval is Gaussian; a scatter larger than these variances widens it by Birge's ratio. Errors of arrays scatter
        less, so their interval is conservative.

    Raises
    ------
    InputError
        If the shapes differ, a size or an error is not above 0, or a number of repeats is below 1.

    Examples
    --------
    >>> fit = fit_order([1, 2, 4, 8], [1, 1 / 4, 1 / 16, 1 / 64])
    >>> round(fit.order, 12), fit.points
    (2.0, 4)
    >>> few = fit_order([1, 4, 16], [1, 0.5, 0.25], repeats=[5, 5, 5])
    >>> round(few.order, 12), round(few.high - few.low, 2)
    (0.5, 0.7)
    """
    from scipy.special import polygamma
    from scipy.stats import norm, t

    sizes, errors = finite_array("size", size), finite_array("error", error)
    if sizes.shape != errors.shape or np.any(sizes <= 0.0) or np.any(errors <= 0.0):
        raise InputError(f"size, error: expected positive numbers of one shape, got {size!r}, {error!r}")
    number = None if repeats is None else finite_array("repeats", repeats)
    if number is not None and (number.shape != sizes.shape or np.any(number < 1.0)):
        raise InputError(f"repeats: expected a number of at least 1 for each of {sizes.size} sizes, got {repeats!r}")
    if len(np.unique(sizes)) < FEWEST_POINTS:
        return None
    x, y = np.log(sizes), np.log(errors) - np.log(errors[0])
    weight = np.ones(x.size) if number is None else 4.0 / polygamma(1, 0.5 * number)
    (slope, level), ((variance, _), _) = np.polyfit(x, y, 1, w=np.sqrt(weight), cov="unscaled")
    spread = float(np.sqrt(weight @ (y - slope * x - level) ** 2 / (x.size - 2)))
    if number is None:
        half = float(t.ppf(0.5 + 0.5 * CONFIDENCE, x.size - 2) * spread * variance**0.5)
    else:
        half = float(norm.ppf(0.5 + 0.5 * CONFIDENCE) * max(spread, 1.0) * variance**0.5)
    order = -float(slope)
    return FittedOrder(order, order - half, order + half, len(sizes))


PACKAGES = ("asperity", "numpy", "scipy", "numba")


@dataclass(frozen=True, repr=False)
class Machine(Summary):
    """The machine and the software on which times were measured.

    Attributes
    ----------
    hardware : str
        Processor and number of cores; times on others are not comparable.
    software : str
        Pinning, system, and the versions of Python, asperity, numpy, scipy, numba and the BLAS library behind numpy.
    """

    hardware: str
    software: str

    @classmethod
    def here(cls) -> Machine:
        """This machine."""
        from threadpoolctl import threadpool_info

        core = _last_core()
        pools = {
            f"{pool['internal_api']} {pool['version']}" for pool in threadpool_info() if pool["user_api"] == "blas"
        }
        software = (
            "1 thread", "not pinned" if core is None else f"pinned to core {core}", platform.platform(),
            f"Python {platform.python_version()}", *(f"{name} {_version(name)}" for name in PACKAGES), *sorted(pools),
        )  # fmt: skip
        return cls(f"{_processor()}, {os.cpu_count() or 1} cores", ", ".join(software))

    def __str__(self) -> str:
        return f"{self.hardware}; {self.software}"


@contextmanager
def on_one_core() -> Iterator[None]:
    """Pin this thread and the threads it starts to one core, and the linear algebra to one thread."""
    from threadpoolctl import threadpool_limits

    core = _last_core()
    before = set() if core is None else os.sched_getaffinity(0)
    try:
        if core is not None:
            os.sched_setaffinity(0, {core})
        with threadpool_limits(limits=1):
            yield
    finally:
        if core is not None:
            os.sched_setaffinity(0, before)


def _last_core() -> int | None:
    """The last of the allowed cores, because the first one handles interrupts; None if the system cannot pin."""
    return max(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else None


def _processor() -> str:
    information = Path("/proc/cpuinfo")
    if information.exists():
        for line in information.read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
