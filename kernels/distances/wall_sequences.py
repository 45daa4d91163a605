"""Distances of the laws of a sequence of walls to their limit, and the run time of each step."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.checks import Floats
from ...core.errors import InputError
from ...core.frames import data_frame
from ..laws.law import Law
from ..matrices.matrix import KernelMatrix
from ..walls.wall_law import WallLaw
from .distances import Distance, Kind, distance

if TYPE_CHECKING:
    from ...geometry import Wall


@dataclass(frozen=True)
class ConvergenceStep:
    """Distance and run time for one member of a sequence.

    Attributes
    ----------
    name : str
    distance : Distance
        Distance to the limit, or to the next member.
    seconds : float
        Run time in seconds, including the computation of the law.
    """

    name: str
    distance: Distance
    seconds: float


@dataclass(frozen=True)
class Convergence:
    """The distances found by `study_convergence`; printed as a table.

    Attributes
    ----------
    steps : tuple of ConvergenceStep
    target : str
        The law that distances refer to, in words.
    """

    steps: tuple[ConvergenceStep, ...]
    target: str

    @property
    def distances(self) -> Floats:
        """The values of the distances."""
        return np.array([float(step.distance) for step in self.steps])

    @property
    def ratios(self) -> Floats:
        """Every distance divided by the one before; nan if the one before is 0."""
        values = self.distances
        return np.asarray(
            np.divide(values[1:], values[:-1], out=np.full(values.size - 1, np.nan), where=values[:-1] > 0.0)
        )

    def to_frame(self) -> Any:
        """One row a member, with distance, error and seconds, as a pandas.DataFrame (extra ``studies``)."""
        steps = self.steps
        columns = {"name": [step.name for step in steps], "distance": self.distances}
        more = {"error": [step.distance.error for step in steps], "seconds": [step.seconds for step in steps]}
        return data_frame({**columns, **more})

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
    """The distance of each member of a sequence to its limit, or to the next member, with run times.

    The limit theorems state weak convergence of the laws of walls. Distances of kind ``"joint"`` and ``"pseudometric"``
    measure weak convergence. ``"rows"`` and ``"sup"`` are stronger: they measure convergence of the law at fixed
    incoming angles. For example, rectangular hollows with depth tending to infinity converge weakly only.

    Parameters
    ----------
    members : sequence of Wall, Law or KernelMatrix
        For example Koch curves by generation, mushrooms with thinner stems, a profile at growing resolution.
    limit : Wall, Law or KernelMatrix, optional
        The limit; by default every member but the last is compared with the next one.
    names : sequence of str, optional
        Names of the members; by default their reprs.
    order, kind, tolerance
        As in `distance`.

    Returns
    -------
    Convergence

    Raises
    ------
    InputError
        If there are fewer than one member (two without a limit), or the number of names differs.

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
