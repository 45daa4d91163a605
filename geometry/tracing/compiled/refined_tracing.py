"""The compiled tracer in double-double arithmetic, for the few rays that double precision does not resolve.

Loads numba. The formulas of the pieces are those of `rays`, see `pieces`. The wall is exact: its joints are the doubles
of the tables, and segments join them. A circular arc goes through both of its joints and subtends the double in its
table (elliptic arcs in stretched coordinates). A Bezier piece has the coefficients of its table, except the highest,
which is adjusted so that the piece ends at its joint. The ray starts from exact doubles.

Three quantities are computed along a ray.

* The Jacobi fields: displacement and rotation of the ray for a unit displacement, and for a unit rotation, of the
  incoming ray.
* A bound on the rounding error. To first order the error after n bounces is the sum of M(n <- i) e_i over the local
  errors e_i, at most sqrt((n + 1) trace C) max |e_i| with C the sum of M(n <- i) M(n <- i)^T (Cauchy and Schwarz). A
  bounce changes C to M C M^T + 1.
* The width, from half an ulp of the incoming angle. An angle represents all angles that round to it, and a ray meets a
  corner exactly if one of these angles does. (Strictly, a ray of rational data meets no corner unless it is vertical,
  because the tangent of an algebraic angle is transcendental.)

Long runs between two facing vertical sides and along circular arcs are computed in one step, see `runs`, and so are the
cells that a ray passes in bands of heights without pieces. All other hits are computed one by one.
"""

from __future__ import annotations

import math

import numpy as np

from ...curves import columns as c
from ...scene.compiled.compiling import compiled, linked
from ..double_double.numbers import (
    LOCAL_ERROR,
    cross,
    direction_angle,
    dot,
    extended,
    sine_cosine,
    two_product,
    two_sum,
    where,
)
from .pieces import arcs
from .pieces.formulas import TOP_CORNER, bounds_of, exit_time, mirror, opening_at, with_length_one
from .pieces.kinds import Arrival, in_front_at, line_in_front_of_line, refined_face, refined_hit, refined_surface
from .pieces.lines import line_ends, orientation
from .pieces.records import ARC, BEZIER, FIRST_CURVE, LINE, NO_PIECE, OPENING, SIDE, Hit, RefinedScope, Sizes
from .runs import LAST_REFINED_HITS, refined_crossings, skip_refined_chords

ESCAPED, CORNER, GRAZING, BOUNCE_LIMIT, UNRESOLVED, UNSETTLED = 0, 1, 2, 3, 4, 5
# pi - math.pi
PI_REST = 1.2246467991473532e-16
# Factor for the error of the first-order estimate of the width.
WIDTH_MARGIN = 1.0 + 2.0**-20
# Accumulated rounding error, as a fraction of the scale, above which a ray remains unresolved.
LARGEST_ERROR = 2.0**-50


@linked
def free_cells(bands, py, vx, vy, cell, width, spread):
    """-> (cells, step): the number of cells that a ray passes without coming near a piece, and the step in y per cell.

    ``bands`` are the heights (low, high) without pieces. The ray's width is at most ``width`` plus ``spread`` times
    the distance. The last cells before the end of a band are not counted.
    """
    if vx.high == 0.0 or vy.high == 0.0:
        return 0.0, extended(0.0)
    for row in range(bands.shape[0]):
        low, high = bands[row, c.BAND_LOW], bands[row, c.BAND_HIGH]
        if low < py.high < high:
            behind, room = py.high - low, min(high, 0.0) - py.high
            if vy.high < 0.0:
                behind, room = high - py.high, py.high - low
            margin = width + spread * room / abs(vy.high)
            cells = math.floor((room - margin) * abs(vx.high / vy.high) / cell - LAST_REFINED_HITS)
            # beyond 2^53 not all integers are doubles
            if behind > margin and 0.0 < cells < 2.0**53:
                return cells, cell * (vy / (vx if vx > 0.0 else -vx))
    return 0.0, extended(0.0)


@linked
def meets(tables, hit, own, px, py, vx, vy, clearance):
    """-> bool: whether a computed hit counts, that is, whether the ray starts in front of the piece.

    ``clearance`` is the height of the start in front of the piece, the slack of double precision, and the error of the
    ray. Within the slack the exact positions of the pieces decide, so that both tracers agree.
    """
    height, slack, error = clearance
    if height > slack or own.kind in (OPENING, SIDE):
        return height >= -error
    if height < -slack:
        return False
    arrival = Arrival(own.time.high, slack, error)
    if hit.kind == LINE and own.kind == LINE:
        return line_in_front_of_line(tables.joints, hit.number, own.number, px, py, vx.high, vy.high, arrival)
    piece, start = refined_face(tables, hit), refined_face(tables, own)
    return in_front_at(tables.joints, piece, start, px, py, vx.high, vy.high, arrival)


@linked
def local_error(sizes):
    """-> float: bound on the rounding error of the ray, as a fraction of the scale."""
    return LOCAL_ERROR * math.sqrt(sizes.errors * (sizes.c_jj + sizes.c_aa))


@linked
def error_of(scope, sizes):
    """-> float: bound on the transversal error of the ray on its segment, at a distance of up to one scale."""
    return 2.0 * scope.scale * local_error(sizes)


@linked
def amplification_of(sizes):
    """-> float: norm of the derivative of the map."""
    return math.sqrt(sizes.j1 * sizes.j1 + sizes.a1 * sizes.a1 + sizes.j2 * sizes.j2 + sizes.a2 * sizes.a2)


@linked
def after_flight(sizes, flight):
    """-> Sizes: the sizes after a ray segment, whose length is in units of the scale."""
    j1, a1, j2, a2, c_jj, c_ja, c_aa, errors, half_ulp = sizes
    c_jj += flight * (2.0 * c_ja + flight * c_aa)
    return Sizes(j1 + flight * a1, a1, j2 + flight * a2, a2, c_jj, c_ja + flight * c_aa, c_aa, errors, half_ulp)


@linked
def after_reflection(sizes, power):
    """-> Sizes: the sizes after a reflection; the power of a straight piece is 0."""
    j1, a1, j2, a2, c_jj, c_ja, c_aa, errors, half_ulp = sizes
    c_aa += power * (power * c_jj - 2.0 * c_ja)
    return Sizes(j1, a1 - power * j1, j2, a2 - power * j2, c_jj, c_ja - power * c_jj, c_aa, errors, half_ulp)


@linked
def with_new_error(sizes):
    """-> Sizes: the sizes with one more local error."""
    j1, a1, j2, a2, c_jj, c_ja, c_aa, errors, half_ulp = sizes
    return Sizes(j1, a1, j2, a2, c_jj + 1.0, c_ja, c_aa + 1.0, errors + 1.0, half_ulp)


@linked
def after_chords(sizes, chords, length):
    """-> Sizes: the sizes after a run of equal chords on a circle, whose length is in units of the scale.

    A chord and the reflection after it are the matrix M = -(1 + N) with N = ((-2, -length), (4 / length, 2)), whose
    square is 0. So the power of M is 1 + chords N up to its sign, on which nothing depends.
    """
    j1, a1, j2, a2, c_jj, c_ja, c_aa, errors, half_ulp = sizes
    jj, ja, aj, aa = 1.0 - 2.0 * chords, -chords * length, 4.0 * chords / length, 1.0 + 2.0 * chords
    j1, a1, j2, a2 = jj * j1 + ja * a1, aj * j1 + aa * a1, jj * j2 + ja * a2, aj * j2 + aa * a2
    after_jj = jj * jj * c_jj + 2.0 * jj * ja * c_ja + ja * ja * c_aa
    after_ja = jj * aj * c_jj + (jj * aa + ja * aj) * c_ja + ja * aa * c_aa
    after_aa = aj * aj * c_jj + 2.0 * aj * aa * c_ja + aa * aa * c_aa
    return Sizes(j1, a1, j2, a2, after_jj, after_ja, after_aa, errors, half_ulp)


@linked
def width_at(scope, sizes, ahead, error):
    """-> float: width of the ray plus its error, at the distance ``ahead``."""
    tilt = sizes.half_ulp * abs(scope.scale * sizes.j2 + ahead * sizes.a2)
    return WIDTH_MARGIN * tilt + (1.0 + ahead / scope.scale) * error


@linked
def nearest_line(scope, own, sizes, px, py, vx, vy):
    """-> (Hit, corner): the first hit on a line, and the time to the first corner in the ray's width, or inf."""
    tables, error = scope.tables, error_of(scope, sizes)
    joints = tables.joints
    first, end = scope.joints
    nearest, corner = Hit(extended(np.inf), NO_PIECE, -1, extended(0.0), 0), np.inf
    before = extended(0.0)
    for j in range(first, end):
        dx, dy = joints[j, c.JOINT_X] - px, joints[j, c.JOINT_Y] - py
        after = cross(dx, dy, vx, vy)
        if joints[j, c.IS_CORNER] > 0.0:
            ahead = dot(dx, dy, vx, vy).high
            if abs(after.high) <= width_at(scope, sizes, ahead, error) and 0.0 < ahead < corner:
                corner = ahead
        starts_here = j > first and joints[j - 1, c.STARTS_LINE] > 0.0
        is_own = own.kind == LINE and own.number == j - 1
        if starts_here and not is_own and before >= 0.0 and after <= 0.0 and before > after:
            fraction = before / (before - after)
            x0, y0, x1, y1 = line_ends(joints, j - 1)
            dx = x0 + fraction * two_sum(x1, -x0) - px
            dy = y0 + fraction * two_sum(y1, -y0) - py
            t = dot(dx, dy, vx, vy)
            height = t.high * (before.high - after.high) / tables.lines[j - 1, c.LENGTH]
            hit = Hit(t, LINE, j - 1, fraction, 0)
            if t < nearest.time and meets(tables, hit, own, px, py, vx, vy, (height, scope.slack, error)):
                nearest = hit
        before = after
    return nearest, corner


@linked
def nearest_curve(scope, own, nearest, px, py, vx, vy, error):
    """-> (Hit, graze): the first hit on a curve before ``nearest``, or ``nearest``; time of undecided contact."""
    graze = np.inf
    for table, (first, end) in enumerate(scope.curves):
        for k in range(first, end):
            kind = np.int64(FIRST_CURVE + table)
            is_own = own.kind == kind and own.number == k
            arguments = scope, k, own, is_own, px, py, vx, vy, error
            t, s, undecided, clearance, near_s = refined_hit(kind, arguments)
            graze = min(graze, undecided)
            hit = Hit(t, kind, k, s, 0)
            if t < nearest.time and meets(scope.tables, hit, own, px, py, vx, vy, clearance):
                nearest = hit
            hit = Hit(extended(0.0), kind, k, near_s, 0)
            if near_s >= 0.0 and meets(scope.tables, hit, own, px, py, vx, vy, (0.0, scope.slack, error)):
                nearest = hit
    return nearest, graze


@linked
def meets_corner(scope, hit, sizes, px, py, vx, vy, incidence):
    """-> bool: whether a corner in the ray's width is met before the hit or together with it.

    A corner at the end of the piece is further away than the hit by at most the width over the sine of incidence.
    """
    joints, error = scope.tables.joints, error_of(scope, sizes)
    for j in range(scope.joints[0], scope.joints[1]):
        if joints[j, c.IS_CORNER] > 0.0:
            dx, dy = joints[j, c.JOINT_X] - px, joints[j, c.JOINT_Y] - py
            ahead = dot(dx, dy, vx, vy).high
            width = width_at(scope, sizes, ahead, error)
            met = ahead > 0.0 and (ahead - hit.time.high) * incidence <= 2.0 * width
            met = met and abs(cross(dx, dy, vx, vy).high) <= width
            if met and hit.kind == LINE:
                # a ray that hits a line meets no corner behind the line
                x0, y0, x1, y1 = line_ends(joints, hit.number)
                met = orientation(x0, y0, x1, y1, joints[j, c.JOINT_X], joints[j, c.JOINT_Y]) >= 0.0
            if met:
                return True
    return False


@linked
def pass_cells(scope, sizes, py, vx, vy, error):
    """-> (py, cells, Sizes): the ray after it has passed a side and all cells in which it comes near no piece.

    ``error`` bounds the error of the ray on the segment up to the side.
    """
    cell, scale = scope.tables.cell, scope.scale
    # the two ends of the wall are the same point, and a ray passes a side above this point
    end = scope.tables.joints[scope.joints[0], c.JOINT_Y]
    py = extended(end) if py < end else py
    spread = WIDTH_MARGIN * sizes.half_ulp * abs(sizes.a2) + error / scale
    width = WIDTH_MARGIN * sizes.half_ulp * scale * abs(sizes.j2) + error
    cells, step = free_cells(scope.bands, py, vx, vy, cell, width, spread)
    return py + cells * step, cells, after_flight(sizes, cells * cell / abs(vx.high) / scale)


@linked
def nearest_end(scope, own, sizes, px, py, vx, vy, error):
    """-> (Hit, corner, graze): the end of a segment on a piece, at the opening or on a side.

    For the times see `nearest_line` and `nearest_curve`.
    """
    hit, corner = nearest_line(scope, own, sizes, px, py, vx, vy)
    hit, graze = nearest_curve(scope, own, hit, px, py, vx, vy, error)
    time, kind = exit_time(scope, own, px, py, vx, vy, hit.time)
    kind = kind if kind != NO_PIECE else hit.kind
    return Hit(where(time > 0.0, time, 0.0), kind, hit.number, hit.s, 0), corner, graze


@linked
def refined_ray(scope, entry, theta, limit, most_segments):
    """-> (x, angle, bounces, status, amplification, rounding): trace one ray; x and angle are double-doubles.

    ``entry`` is a double-double in the hollow. The amplification is the norm of the map's derivative in the units
    (scale, radian).
    """
    tables, scale, left, right = scope.tables, scope.scale, scope.left, scope.right
    px, py = entry, extended(0.0)
    sine, cosine = sine_cosine(theta)
    vx, vy = -cosine, -sine
    _, exponent = math.frexp(theta)
    sizes = Sizes(1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 1.0, 1.0, math.ldexp(1.0, exponent - 54))
    norm, nowhere = 1.0, extended(0.0)
    wraps, bounces, steps = 0, 0, 0
    own = Hit(extended(0.0), OPENING, -1, extended(-1.0), 0)
    while True:
        local = local_error(sizes)
        if not local <= LARGEST_ERROR:
            return px, nowhere, bounces, UNSETTLED, norm, local
        error = error_of(scope, sizes)
        hit, corner, graze = nearest_end(scope, own, sizes, px, py, vx, vy, error)
        steps += 1
        if graze < np.inf and graze <= hit.time.high + error:
            return px, nowhere, bounces, GRAZING, norm, local
        if hit.kind == NO_PIECE:
            return px, nowhere, bounces, CORNER if corner < np.inf else UNRESOLVED, norm, local
        qx, qy, nx, ny, bent = refined_surface(hit.kind, (tables, hit, px, py, vx, vy))
        incidence = abs(dot(vx, vy, nx, ny).high)
        if corner < np.inf and meets_corner(scope, hit, sizes, px, py, vx, vy, incidence):
            return px, nowhere, bounces, CORNER, norm, local
        sizes = after_flight(sizes, hit.time.high / scale)
        if hit.kind == OPENING:
            x = qx + two_product(float(wraps), right - left)
            return x, direction_angle(vx, vy), bounces, ESCAPED, amplification_of(sizes), local
        if (bounces >= limit and hit.kind != SIDE) or steps >= most_segments:
            return px, nowhere, bounces, BOUNCE_LIMIT, norm, local
        flown = own.time
        if hit.kind == SIDE:
            px = extended(left if vx > 0.0 else right)
            py, cells, sizes = pass_cells(scope, sizes, qy, vx, vy, error)
            wraps += (1 if vx > 0.0 else -1) * (1 + np.int64(cells))
        else:
            flown = hit.time
            px, py = qx, qy
            vx, vy = mirror(vx, vy, nx, ny)
            vx, vy = with_length_one(vx, vy)
            if incidence == 0.0:
                return px, nowhere, bounces, GRAZING, norm, local
            sizes = after_reflection(sizes, 2.0 * bent * scale / incidence)
            bounces += 1
            if hit.kind == LINE and own.kind == LINE:
                hits, travel, flight = refined_crossings(tables, hit.number, own.number, py, vx, vy, limit - bounces)
                bounces += hits
                py = py + travel
                sizes = after_flight(sizes, flight / scale)
            if hit.kind == ARC:
                arc = tables.curves[arcs.TABLE][hit.number]
                hits, px, py, vx, vy = skip_refined_chords(arc, px, py, vx, vy, limit - bounces)
                if hits > 0:
                    bounces += hits
                    sizes = after_chords(with_new_error(sizes), float(hits), 2.0 * incidence / (bent * scale))
        norm = amplification_of(sizes)
        sizes = with_new_error(sizes)
        own = Hit(flown, hit.kind, hit.number, hit.s if hit.kind == BEZIER else extended(-1.0), 0)


@linked
def scope_of(tables, bands, h):
    """-> RefinedScope: hollow number h."""
    hollow = tables.hollows[h]
    left, right, slack, joints, curves = bounds_of(hollow)
    return RefinedScope(tables, bands, tables.cell + hollow[c.SIZE], left, right, slack, joints, curves)


@compiled
def refined_rays(x, theta, tables, bands, limit, most_segments, results):
    """Trace rays into ``results``, as double-doubles."""
    out_x, out_theta, bounces, status, amplification, rounding = results
    cell = tables.cell
    for i in range(x.shape[0]):
        turns = math.floor(x[i] / cell)
        if x[i] < two_product(turns, cell):
            turns -= 1.0
        base = two_product(turns, cell)
        entry = x[i] - base
        h = opening_at(entry, tables.hollows, tables.hollows.shape[0])
        if h < 0:
            angle = two_sum(math.pi, -theta[i]) + PI_REST
            amplification[i], rounding[i], bounces[i], status[i] = 1.0, LOCAL_ERROR, 1, ESCAPED
            out_x[i, c.HIGH], out_x[i, c.LOW] = x[i], 0.0
        else:
            end, angle, bounces[i], status[i], amplification[i], rounding[i] = refined_ray(
                scope_of(tables, bands, h), entry, theta[i], limit, most_segments
            )
            end = base + end
            out_x[i, c.HIGH], out_x[i, c.LOW] = end.high, end.low
        out_theta[i, c.HIGH], out_theta[i, c.LOW] = angle.high, angle.low
        if h == TOP_CORNER:
            out_theta[i, c.HIGH], bounces[i], status[i] = theta[i] - math.pi, 0, CORNER
