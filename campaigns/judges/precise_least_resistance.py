"""The least resistance with 30 digits, from the primal and from the dual side.

``python -m campaigns.judges.precise_least_resistance`` prints it.

With x = theta - pi/2 the law is specular below pi/6, split up to b, and sends rays elsewhere beyond; b solves
2 cos(2 b) = int_b^(pi - 3 b) sin(x - T(x)) dx with sin(T(x)) = sin(x) - sin(b) - sin(3 b).
"""

from mpmath import asin, cos, findroot, mp, mpf, pi, quad, sin

mp.dps = 40


def turned(x, b):
    """T(x) for b < x < pi - 3 b."""
    return asin(sin(x) - sin(b) - sin(3 * b))


def graded(b):
    """From b to pi - 3 b; T has a branch point just left of b."""
    return [b] + [b + (pi - 4 * b) / 2**k for k in range(12, -1, -1)]


def condition(b):
    """Whose root is the end of the range of splitting."""
    return 2 * cos(2 * b) - quad(lambda x: sin(x - turned(x, b)), graded(b))


def primal(b):
    """3/4 E[1 + cos(theta' - theta)] of the law itself."""
    specular = quad(lambda x: cos(2 * x) * cos(x), [0, pi / 6]) / 2
    split = quad(lambda x: (cos(x) + 3 * cos(3 * x)) * cos(2 * x), [pi / 6, b]) / 2
    away = quad(lambda x: -3 * cos(3 * x) * cos(pi - 2 * x), [pi / 6, b]) / 2
    middle = quad(lambda x: cos(x - turned(x, b)) * cos(x), graded(b)) / 2
    outer = quad(lambda x: cos((2 * x + pi) / 3) * cos(x), [pi - 3 * b, pi / 2]) / 2
    return mpf(3) / 4 * (1 + 2 * (specular + split + away + middle + outer))


def dual(b):
    """3/4 (1 + 2 E phi), phi the potential, by parts: its derivative against 1 - sin(x)."""
    last = pi - 3 * b
    inner = quad(lambda x: -sin(2 * x) * (1 - sin(x)), [0, b])
    middle = quad(lambda x: -sin(x - turned(x, b)) * (1 - sin(x)), graded(b))
    outer = quad(lambda x: -sin((2 * x + pi) / 3) * (1 - sin(x)), [last, pi / 2])
    return mpf(3) / 4 * (1 + 2 * (mpf(1) / 2 + inner + middle + outer))


if __name__ == "__main__":
    end = findroot(condition, (mpf("0.5537"), mpf("0.5538")), solver="anderson", tol=1e-30)
    mp.dps = 30
    print("b     ", end)
    print("primal", primal(end))
    print("dual  ", dual(end))
