"""Knudsen diffusion in a channel whose walls reflect by a law."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ...core.checks import Floats, positive_number
from ...core.errors import InputError
from ...core.estimates import ErrorKind, Estimate
from ...core.rounding import EPS
from ...kernels import Law
from ..essential.edge import grazing_symbol
from ..essential.exact import ideal_spectrum

Arrangement = Literal["mirror", "half-turn"]
ARRANGEMENTS: tuple[Arrangement, ...] = ("mirror", "half-turn")

# Signs of the displacement of rays that leave near theta = 0 and near theta = pi.
DIRECTION = np.array([1.0, -1.0])
# A persistence this close to 1 is not told from it: the particle never turns round.
BALLISTIC = 1e-12


@dataclass(frozen=True)
class Diffusivity(Estimate):
    r"""The diffusivity D of a rarefied gas in a channel with two parallel rough walls.

    The mean time to leave |x| < L is asymptotically L^2 / (D ln(L/r)): the flights have no variance, and their tails
    alone make the diffusivity.

    Attributes
    ----------
    eta : float
        D over that of diffuse walls, D_0 = 4 r s / pi.
    zeta : float
        Persistence of grazing flights, lim E[cot(Theta) / cot(theta)] in Feres' convention; eta = (1 + zeta)/(1 - zeta)
        for mirror-symmetric laws.
    eta_error, zeta_error : float
    arrangement : {"mirror", "half-turn"}
    """

    eta: float
    eta_error: float
    zeta: float
    zeta_error: float
    arrangement: Arrangement


def diffusivity(law: Law, radius: float = 1.0, speed: float = 1.0, arrangement: Arrangement = "mirror") -> Diffusivity:
    r"""D of a channel from the law's action on grazing flights.

    Parameters
    ----------
    law : Law
        In either convention; it is converted to the paper's.
    radius : float
        Half the width r of the channel.
    speed : float
        Speed s of the particles.
    arrangement : {"mirror", "half-turn"}
        How the upper wall is made from the lower one: as its mirror image, or by turning it through pi. For
        mirror-symmetric cells both are the same.

    Returns
    -------
    Diffusivity

    Raises
    ------
    InputError
        If the law keeps the direction of grazing flights for ever, as specular reflection does: D is infinite.

    Notes
    -----
    A flight at the angle theta moves by 2 r cot(theta); the distribution of these has tails of the order -3 under
    sin(theta) d theta, so that the variance grows like ln L. What counts is how much of a long flight the next ones
    keep: with M the matrix of `grazing_symbol` and c = (1, -1),
    eta = c^T (2 (1 - F)^(-1) - 1) c / 2, F = M SWAP for mirror images, F = -M for half-turns.

    Source: T. Chumley, R. Feres and H.-K. Zhang, Multiscale Model. Simul. 11 (2013) 1179, for the mirror-symmetric
    case.

    Examples
    --------
    For Maxwell's walls with a diffuse fraction a, eta = (2 - a)/a:

    >>> from asperity import kernels as ker, spectral as spec
    >>> found = spec.diffusivity(ker.maxwell(0.5))
    >>> round(found.eta, 12), round(found.value * np.pi, 12)
    (3.0, 12.0)
    """
    if not isinstance(law, Law):
        raise InputError(f"law: expected a law such as WallLaw(wall), got {law!r}")
    scale = 4.0 * positive_number("radius", radius) * positive_number("speed", speed) / np.pi
    check_arrangement(arrangement)
    symbol = grazing_symbol(law.in_specular_frame() if law.frame == "specular" else law)
    step = _step(symbol.matrix, arrangement)
    zeta = float(0.5 * DIRECTION @ step @ DIRECTION)
    doubt = 2.0 * symbol.entry_error
    if abs(np.linalg.eigvals(step)).max() >= 1.0 - BALLISTIC and zeta > 1.0 - doubt - BALLISTIC:
        raise InputError(
            f"law: {law!r} keeps the direction of grazing flights (zeta = {zeta:.6g}), so the diffusivity is infinite; "
            "expected a law that turns them round at times, as a mixture with lambertian() does"
        )
    eta = _eta(step)
    # the derivative of (1 + zeta)/(1 - zeta), at the worst end of the interval of zeta
    eta_error = 2.0 * doubt / max(1.0 - zeta - doubt, BALLISTIC) ** 2
    exact = ideal_spectrum(law) is not None
    kind: ErrorKind = "bound" if exact else "estimate"
    if exact:
        eta_error = 8.0 * EPS * (1.0 + eta) / (1.0 - zeta)
    method = f"persistence of grazing flights, upper wall as {arrangement}"
    return Diffusivity(eta * scale, eta_error * scale, kind, method, eta, eta_error, zeta, doubt, arrangement)


def _step(symbol: Floats, arrangement: Arrangement) -> Floats:
    """From the direction of a long flight along the channel to that of the next, in the frame of the channel."""
    return symbol[:, ::-1] if arrangement == "mirror" else -symbol


def _eta(step: Floats) -> float:
    resolvent = np.linalg.inv(np.eye(2) - step)
    return float(0.5 * DIRECTION @ (2.0 * resolvent - np.eye(2)) @ DIRECTION)


def check_arrangement(arrangement: str) -> None:
    """Raise an InputError unless it is one of the two arrangements."""
    if arrangement not in ARRANGEMENTS:
        raise InputError(f"arrangement: expected one of {', '.join(ARRANGEMENTS)}, got {arrangement!r}")
