"""The reflection of rays by hollows of two lines or of one circular arc, in closed form: compiled.

``form`` are the numbers of `scene/closed_forms`. The loops over rays have no branches and work in place, so the
compiler vectorises them. They use sums, products, quotients, roots and selections only, so a ray's result does not
depend on its block.
"""

from __future__ import annotations

import math

from ...curves import columns as c
from .pieces.options import inner
from .trigonometry import PI, PI_REST, arcsine, sine_cosine

# Adding and then subtracting this number rounds a number below 2^51 to an integer.
ROUNDER = 1.5 * 2.0**52


@inner
def cross_arc(form, entry, angle, hits, moment, incidence):
    """Reflect rays by a circular hollow: entry and angle become those of the exit, hits their number (0 if uncertain).

    With d the angle of incidence from the arc, X the fraction of the opening to the left of the ray,

        sin^2(d/2) = (1 - X) sin^2((theta + xi)/2) + X sin^2((theta - xi)/2),

    all terms positive, and the same with cosines. A chord advances by 2 d to the left if d is acute, else by
    2 (pi - d) to the right, which gives the number of hits. The angular momentum about the centre gives the exit.
    """
    left, right, uncertainty = form[c.FORM_LEFT], form[c.FORM_RIGHT], form[c.UNCERTAINTY]
    middle, height, radius, half = form[c.CIRCLE_X], form[c.CIRCLE_Y], form[c.RADIUS], form[c.HALF_ANGLE]
    width = right - left
    for i in range(entry.shape[0]):
        theta = angle[i]
        east, west = (entry[i] - left) / width, (right - entry[i]) / width
        s0, c0 = sine_cosine(0.5 * (theta + half))
        inner = 0.5 * (theta - half)
        s1, c1 = sine_cosine(-inner if inner < 0.0 else inner)
        sine2, cosine2 = west * (s0 * s0) + east * (s1 * s1), west * (c0 * c0) + east * (c1 * c1)
        moment[i] = sine2 - cosine2
        incidence[i] = sine2 if sine2 < cosine2 else cosine2
    for i in range(entry.shape[0]):
        incidence[i] = 2.0 * arcsine(math.sqrt(incidence[i]))
    for i in range(entry.shape[0]):
        acute = moment[i] < 0.0
        # for obtuse d the mirror image, pi - theta
        seen = angle[i] if acute else (PI - angle[i]) + PI_REST
        step = 2.0 * incidence[i]
        ratio = ((half + seen) - incidence[i]) / step
        count = (ratio + ROUNDER) - ROUNDER
        # angle from the last hit to the end of the arc, or from the end to the first point beyond it
        off = (ratio - count) * step
        count = count + 1.0 if off > 0.0 else count
        off = -off if off < 0.0 else off
        start = (half - seen) + incidence[i]
        gone = ((seen - count * step) + PI) + PI_REST
        angle[i] = gone if acute else (PI - gone) + PI_REST
        # the first and last segments pass the joints at 2 r sin(a/2) sin((step - a)/2) with a = start and a = off
        passing = start * (step - start)
        passing = passing if passing < off * (step - off) else off * (step - off)
        hits[i] = count if passing > uncertainty else 0.0
    for i in range(entry.shape[0]):
        sine, cosine = sine_cosine(angle[i])
        entry[i] = middle + (radius * moment[i] - height * cosine) / sine


@inner
def cross_wedge(form, entry, angle, hits, vx, vy, turn):
    """Reflect rays by a wedge, with results as in `cross_arc`; the last three arrays are work space.

    The sign of ``turn``, the moment of the apex about the ray, selects the line that is met first. The number of hits
    is the number of consecutive unfolded ends of the opening on the side of the ray opposite to the apex.
    """
    left, right, uncertainty = form[c.FORM_LEFT], form[c.FORM_RIGHT], form[c.UNCERTAINTY]
    apex_x, apex_y, copies = form[c.WEDGE_X], form[c.WEDGE_Y], int(form[c.COPIES])
    mirrored = c.LINK_COLUMNS * (copies + 2)
    for i in range(entry.shape[0]):
        sine, cosine = sine_cosine(angle[i])
        vx[i], vy[i] = -cosine, -sine
    for i in range(entry.shape[0]):
        turn[i] = (apex_x - entry[i]) * vy[i] - apex_y * vx[i]
    for i in range(entry.shape[0]):
        hits[i] = 1.0
    for k in range(2, copies + 1):
        first = c.CHAIN + c.LINK_COLUMNS * k
        x0, y0 = form[first + c.LINK_X], form[first + c.LINK_Y]
        x1, y1 = form[first + mirrored + c.LINK_X], form[first + mirrored + c.LINK_Y]
        before, now = k - 1.0, float(k)
        for i in range(entry.shape[0]):
            x, y = (x0, y0) if turn[i] > 0.0 else (x1, y1)
            beyond = ((x - entry[i]) * vy[i] - y * vx[i]) * turn[i] < 0.0
            hits[i] = now if beyond and hits[i] == before else hits[i]
    for i in range(entry.shape[0]):
        count = int(hits[i])
        last = c.CHAIN + c.LINK_COLUMNS * count + (0 if turn[i] > 0.0 else mirrored)
        following = last + c.LINK_COLUMNS
        inside = (form[last + c.LINK_X] - entry[i]) * vy[i] - form[last + c.LINK_Y] * vx[i]
        outside = (form[following + c.LINK_X] - entry[i]) * vy[i] - form[following + c.LINK_Y] * vx[i]
        odd = count % 2 == 1
        goes_right = odd == (turn[i] > 0.0)
        fraction = inside / (inside - outside)
        near, far = (right, left) if goes_right else (left, right)
        exit = near + fraction * (far - near)
        incoming = angle[i]
        angle[i] = form[last + c.LINK_CONSTANT] + (-incoming if odd else incoming)
        # distances of the ray's line from the apex, from the ends of the opening, and from its ends at the exit
        west, east = (left - entry[i]) * vy[i], (entry[i] - right) * vy[i]
        closest = min(min(abs(turn[i]), min(west, east)), min(abs(inside), abs(outside)))
        hits[i] = hits[i] if closest > uncertainty and fraction > 0.0 else 0.0
        entry[i] = exit
