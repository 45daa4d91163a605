"""Rows of the law of circular arcs against functions on panels: each piece of a row, cut at the panels' edges."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...checks import Floats
from ..bases.intervals import cell_among
from ..bases.measure import SINE, gauss_on_intervals
from ..bases.panels import Panels
from ..bases.polynomial_moments import legendre_moments
from ..bases.ragged_lists import ragged
from .arcs import outgoing_lines

if TYPE_CHECKING:
    from ..walls.circular_arc import CircularArcLaw

# theta' moves by less than half a panel on pieces of this share of it or less: with half the nodes what Gauss's rule
# misses of a polynomial falls by the share to the power of its degree.
SHORT_SHARE = 0.1
# sin(delta) on a piece, whose length is at most half of the widest panel, asks for this many nodes more than p/2 + 1.
SINE_NODES = 2
# Pieces held at a time.
CHUNK = 2**17


def arc_images(law: CircularArcLaw, panels: Panels, theta: Floats, most_hits: int) -> tuple[Floats, Floats]:
    r"""E[e_j(Theta') | theta] for all functions e_j on panels, shape (rows, functions), and the rows' errors.

    The outgoing angle is linear in the angle delta of the chord, of density sin(delta): on each piece between two
    edges the functions are polynomials in delta, and a Gauss rule is exact but for the sine.
    """
    lines = outgoing_lines(law, theta, most_hits)
    ray, slope, offset, lower, upper = lines[:5]
    single = lines.single
    ends = np.sort(np.stack([offset + slope * lower, offset + slope * upper]), axis=0)
    first = cell_among(panels.edges, ends[0])
    last = np.clip(np.searchsorted(panels.edges, ends[1], side="left") - 1, first, len(panels.edges) - 2)
    gathered = np.zeros((panels.degree + 1, theta.size * (len(panels.edges) - 1)))
    owner, place = ragged(np.where(single, 0, last - first + 1))
    for start in range(0, owner.size, CHUNK):
        own, panel = owner[start : start + CHUNK], (first[owner] + place)[start : start + CHUNK]
        low, high = panels.edges[panel], panels.edges[panel + 1]
        cuts = np.sort((np.stack([low, high]) - offset[own]) / slope[own], axis=0)
        near, far = np.clip(cuts, lower[own], upper[own])
        scale, shift = 2.0 * slope[own] / (high - low), (2.0 * offset[own] - low - high) / (high - low)
        _add_moments(gathered, near, far, scale, shift, ray[own] * (len(panels.edges) - 1) + panel, panels.degree)
    angle = lines.angle[single]
    panel = cell_among(panels.edges, angle)
    cell = ray[single] * (len(panels.edges) - 1) + panel
    for column, values in zip(gathered, panels.legendre(angle, panel).T, strict=True):
        column += np.bincount(cell, weights=lines.mass[single] * values, minlength=column.size)
    total = lines.of_rows(lines.mass, theta.size)
    moments = gathered.reshape(panels.degree + 1, theta.size, -1) / total[:, None]
    left = lines.of_rows(np.where(lines.rest, lines.mass, 0.0), theta.size)
    # two angles of a function of sup norm 1
    return panels.of_legendre(moments.transpose(1, 2, 0)), 2.0 * left / total


def _add_moments(
    gathered: Floats, near: Floats, far: Floats, scale: Floats, shift: Floats, cell: Floats, degree: int
) -> None:
    """Add the integrals of L_k(scale delta + shift) over (near, far), k = 0 ... degree, to the columns ``cell``."""
    full = degree // 2 + 1 + SINE_NODES
    short = np.abs(scale) * (far - near) <= 2.0 * SHORT_SHARE
    for chosen, nodes in ((short, full // 2 + 1), (~short, full)):
        if not chosen.any():
            continue
        delta, weight = (part.reshape(-1, nodes) for part in gauss_on_intervals(near[chosen], far[chosen], nodes))
        weight = weight * SINE.density(delta)
        local = scale[chosen, None] * delta + shift[chosen, None]
        for column, moment in zip(gathered, legendre_moments(local, weight, degree), strict=True):
            column += np.bincount(cell[chosen], weights=moment, minlength=column.size)
