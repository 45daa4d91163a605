"""The small-scale limit of a disk with one satellite and the impulse law: the foreshortened wall."""

from __future__ import annotations

import math

import numpy as np

from ...verification import Verdict, agreement, every
from ..entry import Code, row
from ..samples import generator

EPS = 1e-6
RAYS = 40
# Teeth with vertices (0, 0), (1/2, -DEPTH), (1, 0), in units of eps.
DEPTH = 0.7


@row(
    id="S4.23",
    section="3, 5",
    kind="numeric",
    printed=r"\theta' = P^{\widetilde W}(x, \theta),\quad \widetilde W = \{((1 + m/J)^{-1/2}x_1, x_2) : x\in W\}",
    right=lambda m, J: (1 + m / J) ** -0.5,
    wrong=lambda m, J: (1 + m / J) ** -0.25,
)
def limit_of_the_disk(factor: Code) -> Verdict:
    """As ε → 0 a disk whose one satellite meets the wall by the impulse law leaves as a ray does that is reflected in
    the foreshortened wall.

    The satellite's path is followed exactly, as a point of the turning rim, and reflected by eq. 3.2. The angles agree
    to the order of ε, all but those of rays that pass next to a corner.
    """
    from ...geometry import Wall
    from ...geometry.tracing.tracing import trace

    rng = generator()
    verdicts = []
    for m, J in ((2.0, 1.0), (0.5, 2.0)):
        kappa = factor(m, J)
        wall = Wall.from_vertices([(0, 0), (0.5 * kappa, -DEPTH), (kappa, 0)])
        theta, psi = rng.uniform(0.3, math.pi - 0.3, RAYS), rng.uniform(0.6, math.pi - 0.6, RAYS)
        x = rng.uniform(0, 1, RAYS)
        expected = trace(wall, kappa * x, theta).theta
        found = np.array([_angle_after(*ray, m, J) for ray in zip(x, theta, psi, strict=True)])
        # near a corner a ray may be reflected by another side: at most one ray in twenty
        verdicts.append(agreement(np.sort(np.abs(found - expected))[: RAYS - RAYS // 20], 0.0, 100 * EPS))
    return every(*verdicts)


def _angle_after(x: float, theta: float, psi: float, m: float, J: float) -> float:
    """The angle of the outgoing velocity of a disk traced through the wall, in units of eps."""
    from ...geometry.disk.disk import Disk

    disk = Disk(m, J)
    w = -disk.from_angles(theta, psi)
    position = np.array([x, 0.0, 0.0])
    for _ in range(1000):
        time, k = _next_contact(position, w)
        if k is None:
            break
        position = position + time * w
        arm = k[0] * math.cos(EPS * position[2]) + k[1] * math.sin(EPS * position[2])
        impulse = -2.0 * (w[0] * k[0] + w[1] * k[1] + w[2] * arm) / (1 / m + arm * arm / J)
        w = w + impulse * np.array([k[0] / m, k[1] / m, arm / J])
    return float(disk.to_angles(w)[0])


def _next_contact(position: np.ndarray, w: np.ndarray) -> tuple[float, tuple[float, float] | None]:
    """The time to the satellite's next contact with a side, and the side's unit normal; None if it escapes."""

    def satellite(t: float) -> tuple[float, float, float, float]:
        turn = EPS * (position[2] + t * w[2])
        x = position[0] + t * w[0] + math.sin(turn) / EPS
        y = position[1] + t * w[1] + 2.0 * math.sin(0.5 * turn) ** 2 / EPS
        return x, y, w[0] + w[2] * math.cos(turn), w[1] + w[2] * math.sin(turn)

    x0, _, _, _ = satellite(0.0)
    best, normal = math.inf, None
    size = math.hypot(0.5, DEPTH)
    for cell in range(math.floor(x0) - 1, math.floor(x0) + 2):
        for k, foot in (((DEPTH / size, 0.5 / size), cell), ((-DEPTH / size, 0.5 / size), cell + 1)):
            _, _, vx, vy = satellite(0.0)
            approach = vx * k[0] + vy * k[1]
            if approach >= 0.0:
                continue
            t = 0.0
            for _ in range(6):  # Newton: the path is straight up to order eps
                x, y, vx, vy = satellite(t)
                t -= ((x - foot) * k[0] + y * k[1]) / (vx * k[0] + vy * k[1])
            x, y, _, _ = satellite(t)
            if -1e-9 < t < best and -DEPTH - 1e-9 <= y <= 1e-9 and abs(x - foot) <= 0.5 + 1e-9:
                best, normal = t, k
    return best, normal
