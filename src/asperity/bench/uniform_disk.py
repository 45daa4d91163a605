"""The disk of uniform mass whose collisions are measured, and the correlation of its velocity along the wall."""

from __future__ import annotations

import numpy as np

from .. import geometry as geo
from ..checks import Floats

DISK = geo.Disk(1.0, 0.5)
# Means over Lambda^2 of sin(psi)^2 and cos(psi)^2.
SINE_MEAN, COSINE_MEAN = 0.75, 0.25


def velocity_share() -> tuple[float, float]:
    """Factors a, b of v1 = a cos(theta) sin(psi) + b cos(psi) at speed 1."""
    frame = np.asarray(DISK.frame)
    return float(frame[0, 0]), float(frame[2, 0])


def square_of_v1() -> float:
    """<v1, v1> in Lambda^2."""
    along, roll = velocity_share()
    return along**2 * SINE_MEAN / 3.0 + roll**2 * COSINE_MEAN


def correlation_of(moment: float) -> float:
    r"""<v1, K v1>/<v1, v1> in Lambda^2 from <u, P~ u>/<u, u>.

    v1 = a cos theta sin psi + b cos psi, and K keeps sin psi and turns the sign of cos psi.
    """
    along, roll = (share**2 for share in velocity_share())
    return (along * SINE_MEAN / 3.0 * moment - roll * COSINE_MEAN) / square_of_v1()


def sampled_velocities(number: int, rng: np.random.Generator) -> Floats:
    """Outgoing velocities of speed 1 from Lambda^2, shape (number, 3)."""
    cos_theta = 1.0 - 2.0 * rng.random(number)
    # sin(psi)^2 d psi is the law of the polar angle of a uniform point on the three-dimensional sphere
    gauss = rng.standard_normal((number, 4))
    psi = np.arccos(gauss[:, 0] / np.linalg.norm(gauss, axis=1))
    return np.asarray(DISK.from_angles(np.arccos(cos_theta), psi))
