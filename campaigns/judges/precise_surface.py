"""Rays on a triangulated height map in 50 digits: each facet on the way is met by Cramer's rule, in barycentric terms.

The map, the point and the velocity are exact numbers. The ray goes from square to square, and of the two facets of a
square those count whose three barycentric coordinates are positive.
"""

from __future__ import annotations

from mpmath import mp, mpf

DIGITS = 50


def cross(u, v):
    """The cross product."""
    return (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])


def dot(u, v):
    """The scalar product."""
    return sum(one * other for one, other in zip(u, v, strict=True))


def minus(u, v):
    """The difference."""
    return tuple(one - other for one, other in zip(u, v, strict=True))


def corners_of(heights, spacing, i, j):
    """The two facets of a square, each as three corners, counterclockwise from above."""
    n, m = len(heights), len(heights[0])

    def corner(a, b):
        return (a * mpf(spacing[0]), b * mpf(spacing[1]), mpf(float(heights[a % n][b % m])))

    here, right, above, far = corner(i, j), corner(i + 1, j), corner(i, j + 1), corner(i + 1, j + 1)
    return (here, right, far), (here, far, above)


def meeting(facet, at, along):
    """The time at which a line meets the inside of a facet, or None."""
    first, second = minus(facet[1], facet[0]), minus(facet[2], facet[0])
    normal, start = cross(first, second), minus(at, facet[0])
    steepness = dot(normal, along)
    if steepness >= 0:
        return None
    beside = cross(start, along)
    share_second, share_third = -dot(second, beside) / steepness, dot(first, beside) / steepness
    if min(share_second, share_third, 1 - share_second - share_third) < 0:
        return None
    return -dot(normal, start) / steepness


def mirrored(along, facet):
    """A velocity reflected by a facet."""
    normal = cross(minus(facet[1], facet[0]), minus(facet[2], facet[0]))
    factor = 2 * dot(normal, along) / dot(normal, normal)
    return tuple(one - factor * other for one, other in zip(along, normal, strict=True))


@mp.workdps(DIGITS)
def follow(heights, spacing, point, velocity, most=10_000):
    """(exit x, exit y, velocity, number of hits) of a ray from the plane of the highest point."""
    top = mpf(float(max(map(max, heights))))
    at, along = (mpf(float(point[0])), mpf(float(point[1])), top), tuple(mpf(float(one)) for one in velocity)
    square, last, hits = [int(mp.floor(at[k] / mpf(spacing[k]))) for k in (0, 1)], None, 0
    while hits < most:
        times = []
        for k in (0, 1):
            end = mpf(spacing[k]) * (square[k] + (along[k] > 0))
            times.append((end - at[k]) / along[k] if along[k] else mp.inf)
        facets = [(one, (*square, index)) for index, one in enumerate(corners_of(heights, spacing, *square))]
        found = [(meeting(one, at, along), one, name) for one, name in facets if name != last]
        found = [one for one in found if one[0] is not None and one[0] >= 0]
        if found:
            time, facet, last = min(found)
            at = tuple(one + time * speed for one, speed in zip(at, along, strict=True))
            along, hits = mirrored(along, facet), hits + 1
            continue
        out = (top - at[2]) / along[2] if along[2] > 0 else mp.inf
        if out <= min(times):
            return at[0] + out * along[0], at[1] + out * along[1], along, hits
        k = 0 if times[0] < times[1] else 1
        at = tuple(one + times[k] * speed for one, speed in zip(at, along, strict=True))
        square[k] += 1 if along[k] > 0 else -1
    raise ArithmeticError(f"more than {most} hits")
