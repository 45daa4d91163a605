"""The distribution of the outgoing angle at each incoming angle, for every kind of law."""

from __future__ import annotations

from functools import singledispatch

import numpy as np

from ...core.checks import Floats
from ...core.errors import InputError
from ..bases.angles import kept_inside
from ..bases.bins import Bins
from ..bases.intervals import cell_among
from ..bases.measure import gauss_on_intervals, gauss_rule
from ..discretisation.densities import row_intervals
from ..laws.density import DensityLaw
from ..laws.interval_exchange import IntervalExchangeLaw
from ..laws.involution import InvolutionLaw
from ..laws.law import BranchLaw, Combination, Composition, DrivenLaw, Law, Power, SpecularFrame
from ..laws.least_resistance import LeastResistanceLaw
from ..walls.circular_arc import CircularArcLaw
from ..walls.conditionals import WallRows, is_few
from ..walls.wall_law import WallLaw
from .transport import Distributions

# Error of a row's distribution function at the edges.
ROW_TOLERANCE = 1e-9
# Gauss nodes of a density on a cell of the grid, and on a panel of its own where those are narrower.
NODES = 6
# Entry points of a driven law of which nothing else is known.
ENTRY_POINTS = 4096
# Rows and edges held at a time.
CHUNK = 2**20

Parts = tuple[Floats, Floats, Floats]


def outgoing_distributions(law: Law, theta: Floats, edges: Floats) -> Distributions:
    """P(theta_k, .) for every theta_k: exact for laws of isometries, else linear between ``edges``, from 0 to pi."""
    return Distributions.of_parts(edges, *parts_of(law, theta, edges))


@singledispatch
def parts_of(law: Law, theta: Floats, edges: Floats) -> Parts:
    """The masses below each edge of what has no atoms, shape (rows, edges); places and masses of the atoms.

    Laws of a kind that is not known are asked for the means of indicator functions.
    """
    below = law.apply(lambda angle: (angle[..., None] < edges).astype(np.float64), theta)
    return np.maximum.accumulate(below, axis=1), *_no_atoms(theta)


@parts_of.register
def _(law: BranchLaw, theta: Floats, edges: Floats) -> Parts:
    probability, outgoing = law.branches(theta)
    return np.zeros((theta.size, edges.size)), outgoing, probability


@parts_of.register
def _(law: InvolutionLaw, theta: Floats, edges: Floats) -> Parts:
    image = np.asarray(law.map(theta), dtype=np.float64)
    return np.zeros((theta.size, edges.size)), kept_inside(image)[:, None], np.ones((theta.size, 1))


@parts_of.register
def _(law: IntervalExchangeLaw, theta: Floats, edges: Floats) -> Parts:
    return np.zeros((theta.size, edges.size)), law.image(theta)[:, None], np.ones((theta.size, 1))


@parts_of.register
def _(law: LeastResistanceLaw, theta: Floats, edges: Floats) -> Parts:
    probability, outgoing = law.images(theta)
    return np.zeros((theta.size, edges.size)), outgoing, probability


@parts_of.register
def _(law: Combination, theta: Floats, edges: Floats) -> Parts:
    terms = [(weight, parts_of(term, theta, edges)) for weight, term in law.terms_checked()]
    below = sum((weight * parts[0] for weight, parts in terms), start=np.zeros((theta.size, edges.size)))
    place = np.concatenate([parts[1] for _, parts in terms], axis=1)
    return below, place, np.concatenate([weight * parts[2] for weight, parts in terms], axis=1)


@parts_of.register
def _(law: SpecularFrame, theta: Floats, edges: Floats) -> Parts:
    below, place, mass = parts_of(law.law, theta, (np.pi - edges)[::-1])
    return (below[:, -1:] - below)[:, ::-1], kept_inside(np.pi - place), mass


@parts_of.register
def _(law: DensityLaw, theta: Floats, edges: Floats) -> Parts:
    step = max(1, CHUNK // (NODES * edges.size))
    rows = [_density_rows(law, theta[start : start + step], edges) for start in range(0, theta.size, step)]
    return np.concatenate(rows), *_no_atoms(theta)


@parts_of.register
def _(law: CircularArcLaw, theta: Floats, edges: Floats) -> Parts:
    return _summed(law.row_masses(theta, edges)), *_no_atoms(theta)


@parts_of.register
def _(law: WallLaw, theta: Floats, edges: Floats) -> Parts:
    if law.exact_law is not None:
        return parts_of(law.exact_law, theta, edges)
    return _traced_rows(law.wall, theta, edges) if is_few(law.wall) else _sampled_rows(law, theta, edges)


@parts_of.register
def _(law: DrivenLaw, theta: Floats, edges: Floats) -> Parts:
    return _sampled_rows(law, theta, edges)


@parts_of.register(Composition)
@parts_of.register(Power)
def _(law: Composition | Power, theta: Floats, edges: Floats) -> Parts:
    """The first factor exactly; of the others the matrix of their product on the cells between the edges."""
    from ..discretisation.discretisation import discretise

    try:
        probability, outgoing = law.branches(theta)
    except InputError:
        factors = law.laws if isinstance(law, Composition) else (law.law,) * law.exponent
    else:
        return np.zeros((theta.size, edges.size)), outgoing, probability
    first = _below_edges(factors[0], theta, edges)
    rest = factors[1] if len(factors) == 2 else Composition(tuple(factors[1:]))
    masses = np.diff(first, axis=1) @ discretise(rest, Bins(edges)).array
    return _summed(masses), *_no_atoms(theta)


def _below_edges(law: Law, theta: Floats, edges: Floats) -> Floats:
    """The whole distribution function at the edges, atoms included."""
    below, place, mass = parts_of(law, theta, edges)
    return np.asarray(below + np.sum(mass[:, :, None] * (place[:, :, None] < edges), axis=1))


def _no_atoms(theta: Floats) -> tuple[Floats, Floats]:
    return np.empty((theta.size, 0)), np.empty((theta.size, 0))


def _summed(masses: Floats) -> Floats:
    """Masses below every edge, from those of the cells."""
    return np.concatenate((np.zeros((len(masses), 1)), np.cumsum(masses, axis=1)), axis=1)


def _density_rows(law: DensityLaw, theta: Floats, edges: Floats) -> Floats:
    """Gauss rules between the edges, cut by those of the law's own panels where these are narrower."""
    cells = edges.size - 1
    if law.resolution >= float(np.diff(edges).max()):
        angle, weight = gauss_rule(edges, NODES)
        masses = (law.density(theta[:, None], angle) * weight).reshape(theta.size, cells, NODES).sum(axis=2)
    else:
        row, low, high, _ = row_intervals(law, edges, theta)
        angle, weight = (part.reshape(-1, NODES) for part in gauss_on_intervals(low, high, NODES))
        mass = (law.density(theta[row, None], angle) * weight).sum(axis=1)
        cell = cell_among(edges, 0.5 * (low + high))
        masses = np.bincount(row * cells + cell, weights=mass, minlength=theta.size * cells).reshape(-1, cells)
    below = _summed(masses)
    return np.asarray(below / below[:, -1:])


def _traced_rows(wall: object, theta: Floats, edges: Floats) -> Parts:
    """Masses of the cells by adaptive quadrature in the entry point; flat tops are atoms."""
    rows = WallRows(wall, 0, edges[1:-1])(theta, ROW_TOLERANCE)  # type: ignore[arg-type]
    owner = np.repeat(np.arange(theta.size), np.diff(rows.starts))
    level = rows.nodes == (np.pi - theta)[owner]
    cell = cell_among(edges, rows.nodes)
    count = edges.size - 1
    scattered = np.where(level, 0.0, rows.weights)
    masses = np.bincount(owner * count + cell, weights=scattered, minlength=theta.size * count).astype(np.float64)
    below = _summed(masses.reshape(-1, count))
    flat = np.bincount(owner, weights=np.where(level, rows.weights, 0.0), minlength=theta.size).astype(np.float64)
    return below, (np.pi - theta)[:, None], flat[:, None]


def _sampled_rows(law: DrivenLaw, theta: Floats, edges: Floats) -> Parts:
    """Equally spaced entry points, each an atom."""
    x = (np.arange(ENTRY_POINTS) + 0.5) / ENTRY_POINTS
    outgoing = law.respond(x, theta[:, None])
    return np.zeros((theta.size, edges.size)), outgoing, np.full(outgoing.shape, 1.0 / ENTRY_POINTS)
