"""A question about a wall and a disk, and its answers, coarse ones first: kernel, spectrum, gap and collision."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np

from ..core.checks import Floats
from ..core.errors import AsperityError
from ..core.estimates import LEVEL, NORMAL_95, Estimate
from ..core.rounding import EPS
from ..geometry import Disk, Wall
from ..kernels import Bins, CollisionLaw, KernelMatrix, Law, discretise, maxwell, no_slip_matrix, smooth_matrix
from ..kernels.bases.basis import Frame
from ..spectral import SpectralGap, accommodation, spectral_gap, spectrum
from ..spectral.consequences.momentum_accommodation import Accommodation
from ..study.pictures import INCOMING, allowed_velocities
from ..study.study import law_of

Points: TypeAlias = Sequence[tuple[float, float]]
# Of a wall with more vertices none can be dragged.
MOST_HANDLES = 30


@dataclass(frozen=True)
class Question:
    """A wall with a disk, and how they are regarded.

    Attributes
    ----------
    wall : Wall
    name : str
        What the wall is called in titles and files.
    disk : Disk
    convention : {"paper", "specular"}
        Of kernel, spectrum and gap.
    foreshortened : bool
        Whether they are those of the wall that the disk feels, instead of the wall itself.
    of_catalogue : bool
        Whether the wall is a named one.
    diffuse_fraction : float
        Of the hits of the facets, which are mirrors else.

    Examples
    --------
    >>> wall = Wall.from_vertices([(0, 0), (0.5, -0.25), (1, 0)])
    >>> Question(wall, "teeth", Disk(1.0, 1 / 3), foreshortened=True).seen.depth
    0.5
    """

    wall: Wall
    name: str
    disk: Disk = field(default_factory=Disk)
    convention: Frame = "paper"
    foreshortened: bool = False
    of_catalogue: bool = False
    diffuse_fraction: float = 0.0

    @cached_property
    def seen(self) -> Wall:
        """The wall whose law is shown."""
        return self.wall.foreshorten(self.disk) if self.foreshortened else self.wall

    @property
    def facets(self) -> Law | None:
        """The law of the facets; None for mirrors."""
        return maxwell(self.diffuse_fraction) if self.diffuse_fraction > 0.0 else None

    @property
    def law(self) -> Law:
        """The law in the chosen convention."""
        law = law_of(self.seen, self.facets)
        return law.in_specular_frame() if self.convention == "specular" else law

    @property
    def handles(self) -> list[tuple[float, float]]:
        """The vertices that can be dragged, none of a foreshortened wall."""
        return [] if self.foreshortened else draggable_vertices(self.wall)

    @property
    def collision(self) -> CollisionLaw:
        """The collision law of the disk with the wall itself."""
        return CollisionLaw(law_of(self.wall.foreshorten(self.disk), self.facets), self.disk)


def draggable_vertices(wall: Wall) -> list[tuple[float, float]]:
    """The vertices that can be dragged: those of a polygon without islands that begins at a highest point.

    Examples
    --------
    >>> from asperity.geometry import focusing_arcs, triangular_teeth
    >>> len(draggable_vertices(triangular_teeth(1.0))), draggable_vertices(focusing_arcs(1.0))
    (3, [])
    """
    if not wall.is_polygonal or wall.islands or wall.vertices[0, 1] != 0.0 or len(wall.vertices) > MOST_HANDLES:
        return []
    return [(x, y) for x, y in wall.vertices.tolist()]


def pinned(points: Points | Floats, period: float) -> list[tuple[float, float]]:
    """The vertices with both ends at y = 0, one period apart, and no vertex above y = 0.

    Examples
    --------
    >>> pinned([(0.1, -0.1), (0.5, 0.2), (0.9, 0)], 1.0)
    [(0.0, 0.0), (0.5, 0.0), (1.0, 0.0)]
    """
    # 0.0 and not -0.0, which the vertices of a wall do not have
    inner = [(float(x), min(float(y), 0.0) + 0.0) for x, y in list(points)[1:-1]]
    return [(0.0, 0.0), *inner, (period, 0.0)]


def with_new_vertex(points: Points | Floats) -> list[tuple[float, float]]:
    """The vertices with the last one, which was added to the others, moved into the side of the wall next to it.

    Examples
    --------
    >>> with_new_vertex([(0, 0), (0.5, -1), (1, 0), (0.8, -0.3)])
    [(0.0, 0.0), (0.5, -1.0), (0.8, -0.3), (1.0, 0.0)]
    """
    *old, new = np.asarray(points, dtype=np.float64) @ [1.0, 1.0j]
    starts, sides = np.array(old[:-1]), np.diff(old)
    length = np.maximum(np.abs(sides) ** 2, np.finfo(float).tiny)
    fraction = np.clip(((new - starts) * sides.conj()).real / length, 0.0, 1.0)
    where = int(np.argmin(np.abs(starts + fraction * sides - new))) + 1
    *old, new = points
    return [(float(x), float(y)) for x, y in (*old[:where], new, *old[where:])]


# The first matrix: polygons of few pieces are exact, other walls have so many rays at most.
FIRST_BINS, FIRST_TOLERANCE, FIRST_RAYS = 48, 0.1, 2**15
# Errors asked of the gap, one after the other.
GAP_TOLERANCES = (0.1, 1e-3, 1e-6)
# First and last error asked of the accommodation, and the one angle at which it is computed besides the averages.
FIRST_MOMENTUM, MOMENTUM, ONE_ANGLE = 1e-2, 1e-3, 1.0
# The last matrix, and the error asked of the image of each of its bins.
BINS, BIN_TOLERANCE, RAYS = 96, 1e-3, 2**22
EIGENVALUES, EIGENVALUE_TOLERANCE = 10, 1e-4
# Collisions of the first and of the last histogram.
FIRST_COLLISIONS, COLLISIONS, VELOCITY_BINS = 2**13, 2**18, 40
# Rounding of a mean relative to the range of the velocities, of some products in the disk's frame.
MEAN_ROUNDING = 16.0 * EPS


@dataclass(frozen=True)
class Eigenvalues:
    """Eigenvalues with errors, shape (k,) each, of the law or of its matrix in one basis.

    Attributes
    ----------
    values, errors : ndarray, shape (k,)
        Sorted descending; half widths, inf if unknown.
    of : {"the law", "the matrix"}
    """

    values: Floats
    errors: Floats
    of: str


@dataclass(frozen=True)
class Histogram:
    """Outgoing velocities v1 of a disk that comes in with v = (1, -1) and no spin.

    Attributes
    ----------
    edges : ndarray, shape (n + 1,)
    fractions, low, high : ndarray, shape (n,)
        Fraction of collisions in each bin, and the 95 % interval of Clopper and Pearson for its probability.
    mean : Estimate
        Mean of v1.
    smooth, no_slip : float
        v1 of a smooth disk and of one that does not slip, on a flat wall.
    """

    edges: Floats
    fractions: Floats
    low: Floats
    high: Floats
    mean: Estimate
    smooth: float
    no_slip: float


# The attributes of an answer that may be refused.
QUANTITIES = ("gap", "accommodation", "kernel", "spectrum", "collision")


@dataclass(frozen=True)
class Answer:
    """What is known of a question so far; None where nothing is known yet, or where ``refusals`` says why not."""

    stage: str
    kernel: KernelMatrix | None = None
    gap: SpectralGap | None = None
    spectrum: Eigenvalues | None = None
    accommodation: Accommodation | None = None
    collision: Histogram | None = None
    refusals: Mapping[str, str] = field(default_factory=dict)
    finished: bool = False

    def missing(self, quantity: str) -> str:
        """Why a quantity is None, in a word."""
        return "refused" if quantity in self.refusals else "computing"

    def refused(self, reason: object, *quantities: str) -> Answer:
        """The same with a reason why quantities are missing."""
        return replace(self, refusals={**self.refusals, **dict.fromkeys(quantities, str(reason))})

    def ended(self, reason: object) -> Answer:
        """The same with a reason for all that is still missing."""
        missing = (name for name in QUANTITIES if getattr(self, name) is None and name not in self.refusals)
        return self.refused(reason, *missing)

    def improved(self, quantity: str, compute: Callable[[], Any]) -> Answer:
        """The same with a quantity computed anew; if that fails, with the old one or the reason why there is none."""
        try:
            found = compute()
        except AsperityError as reason:
            return self if getattr(self, quantity) is not None else self.refused(reason, quantity)
        others = {name: reason for name, reason in self.refusals.items() if name != quantity}
        return replace(self, refusals=others, **{quantity: found})


def answers_to(question: Question) -> Iterator[Answer]:
    """The first answer within a fraction of a second, then better ones until the last tolerance is met.

    A quantity that cannot be computed is refused with a reason, and the others go on.

    Examples
    --------
    >>> from asperity.geometry import triangular_teeth
    >>> first, *_, last = answers_to(Question(triangular_teeth(0.7), "teeth"))
    >>> first.kernel.method, first.gap.verdict, last.finished
    ('exact', 'no gap', True)
    """
    answer = first_answer(question)
    yield answer
    answer = replace(_with_accommodation(answer, question, FIRST_MOMENTUM), stage="accommodation")
    yield answer
    decided = answer.gap is not None and answer.gap.verdict == "no gap"
    for tolerance in () if decided else GAP_TOLERANCES[:-1]:
        if not _reached(answer, tolerance):
            answer = replace(_with_gap(answer, question, tolerance), stage=f"gap to {tolerance:g}")
            yield answer
    answer = replace(_with_collision(answer, question, COLLISIONS), stage="collision")
    yield answer
    answer = _with_accommodation(answer, question, MOMENTUM)
    answer = replace(_with_matrix(answer, question, BINS, BIN_TOLERANCE * BINS**0.5, RAYS), stage="kernel")
    yield answer
    answer = _with_eigenvalues_of_matrix(answer)
    if not (decided or _reached(answer, GAP_TOLERANCES[-1])):
        answer = _with_gap(answer, question, GAP_TOLERANCES[-1])
    if answer.gap is not None and answer.gap.verdict == "isolated" and answer.gap.self_adjoint:
        yield replace(answer, stage="spectrum")
        answer = _with_eigenvalues_of_law(answer, question)
    yield replace(answer, stage="done", finished=True)


def _reached(answer: Answer, tolerance: float) -> bool:
    """Whether the gap is known to the tolerance, with a verdict."""
    return answer.gap is not None and answer.gap.verdict != "undecided" and answer.gap.error <= tolerance


def first_answer(question: Question) -> Answer:
    """A coarse answer: a small matrix, its eigenvalues, an upper limit of the gap, a small sample of collisions."""
    answer = _with_matrix(Answer("coarse"), question, FIRST_BINS, FIRST_TOLERANCE, FIRST_RAYS)
    for reason in answer.refusals.values():
        answer = answer.refused(reason, "gap", "spectrum")
    answer = _with_eigenvalues_of_matrix(answer)
    if question.seen.is_polygonal and not question.seen.islands and question.facets is None:
        # a theorem decides
        answer = _with_gap(answer, question, GAP_TOLERANCES[0])
    elif answer.spectrum is not None and answer.kernel is not None:
        answer = replace(answer, gap=largest_gap(answer.kernel))
    return _with_collision(answer, question, FIRST_COLLISIONS)


def largest_gap(matrix: KernelMatrix) -> SpectralGap:
    """The interval from 0 to an upper limit that holds the gap of the law of a matrix.

    Its largest eigenvalue off the constants is at most the supremum of the law's spectrum there, so 1 minus it, with
    the errors of the matrix, limits the gap from above. No discretisation error is estimated, because that from two
    grids is too small if the gap ends at the essential spectrum.
    """
    found = spectrum(matrix, EIGENVALUES)
    parts = found.gap_errors
    error = float(parts.algebraic[0] + parts.quantile * parts.sampling[0])
    error += 0.0 if matrix.samples else float(matrix.error)
    half = 0.5 * min(max(found.gap + error, 0.0), 2.0)
    kind = "estimate" if matrix.samples else matrix.error.kind
    evidence = (f"the gap of a law is at most that of its matrix in {matrix.basis!r}",)
    return SpectralGap(half, half, kind, "from 0 to the gap of a coarse matrix", "undecided", evidence, matrix.frame)


def _with_eigenvalues_of_matrix(answer: Answer) -> Answer:
    matrix = answer.kernel
    if matrix is None:
        return answer

    def compute() -> Eigenvalues:
        found = spectrum(matrix, EIGENVALUES)
        parts = found.errors
        errors = parts.algebraic + parts.quantile * parts.sampling + (0.0 if matrix.samples else float(matrix.error))
        return Eigenvalues(found.values, errors, "the matrix")

    return answer.improved("spectrum", compute)


def _with_eigenvalues_of_law(answer: Answer, question: Question) -> Answer:
    def compute() -> Eigenvalues:
        found = spectrum(question.law, EIGENVALUES, tolerance=EIGENVALUE_TOLERANCE, rng=0)
        return Eigenvalues(found.values, found.errors.total(), "the law")

    return answer.improved("spectrum", compute)


def _with_gap(answer: Answer, question: Question, tolerance: float) -> Answer:
    return answer.improved("gap", lambda: spectral_gap(question.law, tolerance, 0))


def _with_accommodation(answer: Answer, question: Question, tolerance: float) -> Answer:
    return answer.improved("accommodation", lambda: accommodation(question.law, tolerance, ONE_ANGLE, rng=0))


def _with_matrix(answer: Answer, question: Question, bins: int, tolerance: float, rays: int) -> Answer:
    return answer.improved(
        "kernel", lambda: discretise(question.law, Bins(bins), tolerance=tolerance, samples=rays, rng=0)
    )


def _with_collision(answer: Answer, question: Question, number: int) -> Answer:
    def compute() -> Histogram:
        outgoing = question.collision.sample(np.tile(INCOMING, (number, 1)), np.random.default_rng(0))[:, 0]
        return histogram(outgoing, question.disk)

    return answer.improved("collision", compute)


def histogram(outgoing: Floats, disk: Disk) -> Histogram:
    """Outgoing velocities in bins, with the intervals of their probabilities."""
    from scipy.special import betaincinv

    allowed = allowed_velocities(disk)[:, 0]
    reach = float(allowed.min()), float(allowed.max())
    edges = np.linspace(*reach, VELOCITY_BINS + 1)
    number = len(outgoing)
    counts = np.histogram(np.clip(outgoing, *reach), edges)[0]
    tail = 0.5 * (1.0 - LEVEL)
    # Beta(k, n - k + 1) and Beta(k + 1, n - k); a parameter 0 stands for the end of the interval
    low = np.where(counts > 0, betaincinv(np.maximum(counts, 1), number - counts + 1, tail), 0.0)
    high = np.where(counts < number, betaincinv(counts + 1, np.maximum(number - counts, 1), 1.0 - tail), 1.0)
    half = NORMAL_95 * float(np.std(outgoing, ddof=1)) / np.sqrt(number)
    # a smooth disk has no spread, and its mean the rounding of the frame
    half += MEAN_ROUNDING * (reach[1] - reach[0])
    mean = Estimate(float(np.mean(outgoing)), half, "estimate", f"{number} collisions")
    incoming = np.array(INCOMING)
    smooth, no_slip = (float((matrix(disk) @ incoming)[0]) for matrix in (smooth_matrix, no_slip_matrix))
    return Histogram(edges, counts / number, low, high, mean, smooth, no_slip)
