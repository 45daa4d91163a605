"""The convergence of the laws of a sequence of walls, and the cost of each step."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...core.checks import Floats
from ...core.errors import InputError
from ..laws.law import Law
from ..matrices.matrix import KernelMatrix
from ..walls.wall_law import WallLaw
from .distances import Distance, Kind, distance

if TYPE_CHECKING:
    from ...geometry import Wall


@dataclass(frozen=True)
class ConvergenceStep:
    """One member of a sequence.

    Attributes
    ----------
    name : str
    distance : Distance
        To the limit, or to the next member.
    seconds : float
        What it took, the law included.
    """

    name: str
    distance: Distance
    seconds: float


@dataclass(frozen=True)
class Convergence:
    """The outcome of `study_convergence`; it prints as a table.

    Attributes
    ----------
    steps : tuple of ConvergenceStep
    target : str
        What the distances are to.
    """

    steps: tuple[ConvergenceStep, ...]
    target: str

    @property
    def distances(self) -> Floats:
        """The values alone."""
        return np.array([float(step.distance) for step in self.steps])

    @property
    def ratios(self) -> Floats:
        """Every distance over the one before; nan where that was 0."""
        values = self.distances
        return np.asarray(
            np.divide(values[1:], values[:-1], out=np.full(values.size - 1, np.nan), where=values[:-1] > 0.0)
        )

    def __str__(self) -> str:
        width = max(len(step.name) for step in self.steps)
        rows = [f"{'':{width}s}  distance to {self.target}"]
        for step in self.steps:
            rows.append(
                f"{step.name:{width}s}  {step.distance.value:.3e} +- {step.distance.error:.1e}  {step.seconds:.2f} s"
            )
        return "\n".join(rows)


def study_convergence(
    members: Sequence[Wall | Law | KernelMatrix],
    limit: Wall | Law | KernelMatrix | None = None,
    *,
    names: Sequence[str] | None = None,
    order: float = 1,
    kind: Kind = "rows",
    tolerance: float = 1e-3,
) -> Convergence:
    """The distance of each member of a sequence to its limit, or to the next member, against run time.

    Weak convergence of the laws of walls is what the limit theorems are about; distances of kind ``"joint"`` and
    ``"pseudometric"`` measure it, ``"rows"`` and ``"sup"`` are stronger: they ask that the law converge for fixed
    incoming angles. A deep rectangular hollow with depth tending to infinity converges in the former only.

    Parameters
    ----------
    members : sequence of Wall, Law or KernelMatrix
        Koch curves by generation, mushrooms with thinner and thinner stems, a profile at growing resolution.
    limit : Wall, Law or KernelMatrix, optional
        By default every member is compared with the next one, and the last with none.
    names : sequence of str, optional
        By default their reprs.
    order, kind, tolerance
        As in `distance`.

    Returns
    -------
    Convergence

    Raises
    ------
    InputError
        If there are too few members, or the names do not fit.

    Examples
    --------
    >>> from asperity import kernels as ker
    >>> sequence = [ker.maxwell(0.5**k) for k in range(3)]
    >>> study_convergence(sequence, ker.specular()).ratios.round(3).tolist()
    [0.5, 0.5]
    """
    least = 2 if limit is None else 1
    if len(members) < least:
        raise InputError(f"members: expected at least {least}, got {len(members)}")
    chosen = [repr(member) for member in members] if names is None else list(names)
    if len(chosen) != len(members):
        raise InputError(f"names: expected one for each of {len(members)} members, got {len(chosen)}")
    others = [*members[1:]] if limit is None else [limit] * len(members)
    steps = []
    for name, member, other in zip(chosen, members, others, strict=False):
        start = time.perf_counter()
        found = distance(_as_law(member), _as_law(other), order, kind, tolerance)
        steps.append(ConvergenceStep(name, found, time.perf_counter() - start))
    return Convergence(tuple(steps), "the next member" if limit is None else repr(limit))


def _as_law(member: Wall | Law | KernelMatrix) -> Law | KernelMatrix:
    return member if isinstance(member, (Law, KernelMatrix)) else WallLaw(member)
