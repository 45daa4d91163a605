"""Objects as users write them, a third of them broken: what the library says of them against quadrature of our own.

A good object gets numbers that are right within their errors, or a refusal with a reason, which counts as useless. A
broken one is refused, by its constructor or by the call that sees its fault. Numbers without an error are held to 1e-8.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.errors import AsperityError
from campaigns.cases import written_laws as laws
from campaigns.cases import written_objects as others
from campaigns.cases.written_laws import Drawn
from campaigns.engine import Campaign, Judged
from campaigns.judges.plain_quadrature import Array, Known, Truth

Rng = np.random.Generator
# Refusals; of a good object an answer is useless if its error exceeds this fraction of its scale.
REFUSALS, USELESS = (AsperityError, TypeError), 0.3
# Calls of an object; standard errors of a sampled mean; relative error of numbers that carry none; a call takes at most
# these seconds of processor time.
CALLS, SIGMAS, PLAIN, SECONDS = 3, 6.0, 1e-8, 60.0
NOTHING = Known(0.0, 0.0)


@dataclass(frozen=True)
class Answer:
    """What a call gave, with its error, the truth, and the scale below which an error is of use."""

    value: Any
    error: float
    truth: Known
    scale: float = 1.0


# ---- calls of laws; without a truth they are those of a broken one -------------------------------------------------
def sampled(law: ker.Law, truth: Truth | None, rng: Rng) -> Answer:
    """The mean of cos(theta') over samples, which lie in (0, pi) and leave the given angles as they are."""
    theta = np.full(4000, rng.uniform(0.1, 3.0))
    given = theta.copy()
    found = law.sample(given, rng=int(rng.integers(2**32)))
    assert np.array_equal(given, theta), "sample changed the given angles"
    assert found.shape == theta.shape and found.min() > 0.0 and found.max() < np.pi, "samples outside of (0, pi)"
    out = np.cos(found)
    error = SIGMAS * float(out.std()) / np.sqrt(theta.size) + 1e-6
    return Answer([out.mean()], error, truth.mean(np.cos, theta[:1]) if truth else NOTHING)


def applied(law: ker.Law, truth: Truth | None, rng: Rng) -> Answer:
    """The conditional mean of a function of the user's."""
    function, breaks = random_function(rng)
    theta = rng.uniform(0.05, 3.1, 3)
    found = law.apply(function, theta, **({"edges": breaks} if breaks and rng.random() < 0.5 else {}))
    known = truth.mean(function, theta, breaks) if truth else NOTHING
    scale = max(1.0, float(np.abs(known.value).max()))
    # of a composition the means under the later laws are known to 1e-4
    return Answer(found, (2.0 * PLAIN if len(getattr(law, "factors", tuple)()) < 2 else 1e-4) * scale, known, scale)


def averaged(given: tuple[ker.Law, Callable[[Array], Any]], _: object, rng: Rng) -> Answer:
    """The conditional mean of a function that has none."""
    law, function = given
    return Answer(law.apply(function, rng.uniform(0.05, 3.1, 3)), 0.0, NOTHING)


def in_bins(law: ker.Law, truth: Truth | None, rng: Rng) -> Answer:
    """A matrix in bins, of a law with a density."""
    basis = ker.Bins(int(rng.integers(2, 9)))
    edges = basis.edges

    def indicators(angle: Array) -> Array:
        inside = (angle[:, None] > edges[:-1]) & (angle[:, None] < edges[1:])
        return np.asarray(inside / np.sqrt(0.5 * (np.cos(edges[:-1]) - np.cos(edges[1:]))))

    return matrix_in(law, truth, basis, indicators, edges)


def in_polynomials(law: ker.Law, truth: Truth | None, rng: Rng) -> Answer:
    """A matrix in Legendre polynomials of the cosine."""
    size = int(rng.integers(2, 8))
    scale = np.sqrt(2.0 * np.arange(size) + 1.0)
    return matrix_in(
        law, truth, ker.Legendre(size), lambda x: np.polynomial.legendre.legvander(np.cos(x), size - 1) * scale
    )


def in_basis(given: tuple[ker.Law, ker.Basis], truth: Truth | None, _: Rng) -> Answer:
    """A matrix in a basis of the user's."""
    law, basis = given
    return matrix_in(law, truth, basis, basis.evaluate, basis.edges)


def matrix_in(
    law: ker.Law, truth: Truth | None, basis: ker.Basis, functions: Callable[[Array], Array], edges: Any = ()
) -> Answer:
    found = ker.discretise(law, basis, tolerance=1e-6)
    return Answer(found.symmetric, float(found.error), truth.matrix(functions, edges) if truth else NOTHING)


def gap(law: ker.Law, truth: Truth | None, _: Rng) -> Answer:
    """The gap, where products of functions make it known."""
    found = spec.spectral_gap(law, tolerance=1e-3, time_limit=10.0)
    return Answer(found.value, found.error, Known(truth.gap, 1e-11) if truth else NOTHING)


def mixing(law: ker.Law, truth: Truth | None, _: Rng) -> Answer:
    """The steps to a distance in L^2: not before ``earliest``, not after ``steps``."""
    found = spec.mixing_time(law, 1e-3, "L2")
    middle, width = 0.5 * (found.steps + found.earliest), 0.5 * (found.steps - found.earliest)
    if truth is None or truth.slem is None:
        return Answer(middle, width, NOTHING)
    steps = float(np.ceil(np.log(1e-3) / np.log(truth.slem) - 1e-9)) if truth.slem > 1e-12 else 1.0
    return Answer(middle, width, Known(steps, 0.0), 4.0 * steps + 10.0)


def drag(law: ker.Law, truth: Truth | None, _: Rng) -> Answer:
    """The resistance."""
    found = ker.resistance(law, 1e-7)
    return Answer(found.value, found.error, truth.resistance() if truth else NOTHING)


def far(law: ker.Law, truth: Truth | None, _: Rng) -> Answer:
    """The mean distance of the conditional distributions from Lambert's."""
    found = ker.distance(law, ker.lambertian(), kind="rows", tolerance=1e-3)
    return Answer(found.value, found.error, truth.distance_from_lambertian() if truth else NOTHING)


def diffusive(law: ker.Law, truth: Truth | None, _: Rng) -> Answer:
    """The slope of the diffusivity of a channel."""
    found = spec.diffusivity(law)
    return Answer(found.value, found.error, Known(4.0 / np.pi * truth.eta, 1e-12) if truth and truth.eta else NOTHING)


def random_function(rng: Rng) -> tuple[Callable[[Array], Array], tuple[float, ...]]:
    """A function to be averaged: smooth, fast, with a kink, a jump or a pole that can be integrated."""
    at, k = float(rng.uniform(0.4, 2.7)), float(rng.choice([1.0, 3.0, 40.0, 1000.0]))
    power = float(rng.uniform(-1.4, -0.2))
    functions: tuple[tuple[Callable[[Array], Array], tuple[float, ...]], ...] = (
        (lambda x: np.cos(k * x), ()), (lambda x: (x < at) * 1.0, (at,)), (lambda x: np.abs(x - at), (at,)),
        (lambda x: np.sqrt(np.abs(x - at)), (at,)), (lambda x: x**power, ()), (lambda x: np.exp(np.sin(3.0 * x)), ()),
    )  # fmt: skip
    return functions[rng.integers(len(functions))]


# ---- calls of other objects ----------------------------------------------------------------------------------------
def body_drag(body: ker.RoughBody, truth: float | None, _: Rng) -> Answer:
    """The resistance of a body."""
    found = body.resistance()
    return Answer(found.value, found.error, Known(truth or 0.0, 1e-12 * (truth or 0.0)), abs(found.value))


def pushed(body: ker.RoughBody, truth: Known | None, _: Rng) -> Answer:
    """The force along a stream."""
    found = body.force(0.0).along
    return Answer(found.value, found.error, truth or NOTHING, abs(found.value))


def enclosed(container: geo.Container, truth: Array | None, _: Rng) -> Answer:
    """Area and perimeter."""
    return Answer([container.area, container.perimeter], PLAIN, NOTHING if truth is None else Known(truth, 1e-10))


def played(reflector: Any, truth: Array | None, _: Rng) -> Answer:
    """Where a disk is after four collisions with floor and ceiling of a strip."""
    across, up = (1.0, 1.0) if truth is None else truth
    found = ker.play(geo.Container.strip(), reflector, [0.0, 0.25], [across, up, 0.0], 4).position[-1, 0]
    return Answer(found, PLAIN, NOTHING if truth is None else Known([3.75 * across / up, 0.0], 1e-14))


def designed(family: Callable[[float], Any], truth: Callable[[float], float] | None, rng: Rng) -> Answer:
    """The member with a given resistance, and that the resistance is that of the member."""
    wanted = float(rng.choice([1.25, 1.3, 1.45]))
    found = ker.design_wall(ker.resistance, family, [(0.0, 1.0)], wanted, tolerance=1e-6)
    if truth is None:
        return Answer(found.value, 0.0, NOTHING)
    fraction = (truth(0.0) - wanted) / (truth(0.0) - truth(1.0))
    try:
        family(fraction)
    except ValueError:
        # the wanted member refuses
        wanted = truth(float(found.parameters[0]))
    return Answer([float(found.value), truth(float(found.parameters[0]))], 1.5e-6, Known([wanted] * 2, 1e-12))


def swept(family: Callable[[float], Any], truth: Callable[[float], float] | None, rng: Rng) -> Answer:
    """Resistances of members; those that refuse have none."""
    table = spec.sweep(family, {"a": rng.uniform(0.0, 1.0, 3).tolist()}, ["resistance"], progress=False)
    rows = [row for row in table.rows if row.value is not None]
    known = [truth(row.point["a"]) for row in rows] if truth else 0.0
    return Answer([row.value for row in rows], sum(row.error for row in rows), Known(known, 1e-14))


TOOLS: dict[str, Callable[[Any, Any, Rng], Answer]] = {
    each.__name__: each
    for each in (
        sampled, applied, averaged, in_bins, in_polynomials, in_basis, gap, mixing, drag, far, diffusive, body_drag,
        pushed, enclosed, played, designed, swept,
    )
}  # fmt: skip


# ---- the campaign --------------------------------------------------------------------------------------------------
GOOD, BROKEN = {**laws.GOOD, **others.GOOD}, {**laws.BROKEN, **others.BROKEN}


@dataclass(frozen=True)
class Case:
    number: int
    drawn: Drawn
    good: bool


def draw(number: int) -> Case:
    """Every third object is broken."""
    rng, good = np.random.default_rng([number, 55]), number % 3 > 0
    kinds = GOOD if good else BROKEN
    shares = np.array(list(kinds.values()), dtype=float)
    return Case(number, list(kinds)[rng.choice(len(kinds), p=shares / shares.sum())](rng), good)


def judge(case: Case) -> Iterator[Judged]:
    """Two or three calls."""
    rng, tools = np.random.default_rng([case.number, 56]), case.drawn.tools
    kind = case.drawn.kind if case.good else f"broken {case.drawn.kind}"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            made = case.drawn.make()
        except Exception as reason:
            if case.drawn.told is None or "breakpoints" not in str(reason):
                yield refused(case, kind, "constructor", reason)
                return
            made = case.drawn.told()
            yield Judged("constructor", outcome="asked for breakpoints")
        for name in rng.choice(tools, min(CALLS, len(tools)), replace=False).tolist():
            begun = time.process_time()
            try:
                answer = TOOLS[name](made, case.drawn.truth, rng)
            except Exception as reason:
                yield refused(case, kind, name, reason)
                continue
            seconds = time.process_time() - begun
            if not case.good:
                yield Judged("broken", fault=f"{kind}, {name}: took it and gave {answer.value} +- {answer.error:.2g}")
            elif seconds > SECONDS:
                yield Judged(name, fault=f"{kind}, {name}: {seconds:.0f} s")
            else:
                miss = float(np.linalg.norm(np.subtract(answer.value, answer.truth.value)))
                useless = not answer.error <= USELESS * answer.scale
                fault = f"{kind}: off by {miss:.3g}, reported {answer.error:.3g}"
                wrong = not miss <= answer.error + answer.truth.error
                yield Judged(
                    name, answer.error, miss, answer.truth.error, fault if wrong else "",
                    "useless" if useless else "number",
                )  # fmt: skip


def refused(case: Case, kind: str, name: str, reason: Exception) -> Judged:
    """A refusal with a reason: right of a broken object, useless of a good one; another exception is a fault."""
    text = f"{kind}, {name}: {type(reason).__name__}: {reason}"
    if case.drawn.careless and (isinstance(reason, REFUSALS) or "read-only" in str(reason)):
        return Judged(name, outcome="refused")
    # the exception of a user's own function passes as it is, so that they see their own line
    own = not case.good and isinstance(reason, KeyError) and "raises" in case.drawn.kind
    if not isinstance(reason, REFUSALS) and not own:
        return Judged(name if case.good else "broken", fault=text)
    return Judged(name, outcome="useless") if case.good else Judged("broken", outcome="refused")


QUESTION = "Do errors hold of what users write, and is what is broken refused?"
# Quick ones, of most kinds.
SMALL = (0, 1, 2, 3, 6, 7, 8, 9, 12, 15, 17, 19, 21, 25, 27, 28, 29, 30, 33, 36, 39)
CAMPAIGNS = (Campaign("users-objects", QUESTION, draw, judge, 2000, SMALL, seconds=400.0),)
