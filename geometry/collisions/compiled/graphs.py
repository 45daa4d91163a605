"""The first contact of a satellite with a part of a Bezier piece, a graph eta = h(xi) over its chord: compiled.

On the path of a satellite F = eta - h(xi). On a time interval F'' is bounded below by the acceleration of the satellite
and the bounds on h''. So F lies above a parabola with this second derivative, whose first root is a safe step, as in
`contact`. The steps converge quadratically, because F and F' are exact at the start of each step. Loads numba.
"""

from __future__ import annotations

import math

import numpy as np

from ...scene.columns import START_X, START_Y
from ...tracing.compiled.options import compiled, inlined
from ...tracing.compiled.pieces import near_end
from ...tracing.compiled.rays import BOUNCE_LIMIT, CORNER, GRAZING
from ...tracing.compiled.records import BEZIER, NO_PIECE
from .contact import CLEAR, WIDEST_SLACK, Span, graph_after, is_in_front, next_root, satellite_after, turning
from .graph_table import FIRST_S, LEAST_SIGMA, MOST_SIGMA, PIECE, STEEPNESS, WIDTH, XI1, XI2, XI3
from .shapes import Start, in_frame, parameter_at


@inlined
def start_on(number, own, path, ground):
    """-> (Start, is_own): the start of a path in the frame of a graph, and whether it lies on the graph's formula."""
    graph = ground.graphs[number]
    if own.kind == BEZIER and ground.graphs[own.piece, PIECE] == graph[PIECE]:
        left = ground.graphs[own.piece]
        along, _ = in_frame(left, path.x - left[START_X], path.y - left[START_Y])
        sigma = parameter_at(left, along) + (left[FIRST_S] - graph[FIRST_S])
        if graph[LEAST_SIGMA] <= sigma <= graph[MOST_SIGMA]:
            abscissa = sigma * (graph[XI1] + sigma * (graph[XI2] + sigma * graph[XI3]))
            return Start(abscissa, 0.0, 0.0, sigma), True
    xi, eta = in_frame(graph, path.x - graph[START_X], path.y - graph[START_Y])
    return Start(xi, xi, eta, 0.0), False


@compiled
def first_on_graph(number, own, path, span, size, ground):
    """-> (t, state, code): first contact in the span of one satellite with the front of one graph, inf if none.

    ``own`` is the piece on which the path starts, if any.
    """
    t, end, rotation = span
    graph, motion, slack = ground.graphs[number], path.motion, path.slack
    begin, is_own = start_on(number, own, path, ground)
    form = graph, begin
    here, rate, _, _, _ = graph_after(form, t, rotation, path)
    patience = 2.0 * size / motion.fastest
    reach = slack * graph[STEEPNESS]
    leaving = is_own and t == 0.0
    if t == 0.0 and own.kind != NO_PIECE and not is_own and abs(here) <= reach:
        leaving = not is_in_front(BEZIER, number, own, path.x, path.y, reach, ground)
    sign = 1.0 if here >= 0.0 or (here >= -slack and rate < 0.0) else -1.0
    if leaving:
        sign = 1.0 if is_own or rate > 0.0 else -1.0
    while True:
        t, rotation, code = next_root(sign, leaving, None, None, form, Span(t, end, rotation), path, patience)
        state, inward = satellite_after(t, rotation, path.turn, motion), 0.0
        if t >= end:
            return np.inf, state, CLEAR
        if code == BOUNCE_LIMIT:
            return t, state, code
        if sign > 0.0:
            _, inward, _, along, _ = graph_after(form, t, rotation, path)
            wide = slack * max(1.0, min(motion.fastest / abs(inward), WIDEST_SLACK))
            if -wide <= along <= graph[WIDTH] + wide:
                return t, state, CORNER if near_end(graph, path.x + state.dx, path.y + state.dy, wide) else code
        if code == GRAZING:
            # a tangency beside the part: the search goes on where F is four slacks from 0
            _, _, bent, _, _ = graph_after(form, t, rotation, path)
            if sign * bent <= 0.0:
                return t, state, GRAZING
            t += math.sqrt(8.0 * slack / (sign * bent))
            if t >= end:
                return np.inf, state, CLEAR
            rotation, leaving = turning(motion.spin * t), False
            continue
        if code == CLEAR or inward < 0.0:
            sign = -sign
        leaving = True
