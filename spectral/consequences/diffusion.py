"""The slope by which diffusion in a channel with rough walls grows with its length (Knudsen diffusion)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import get_args

import numpy as np

from ...core.checks import choice, positive_number
from ...core.errors import AccuracyError, InputError
from ...core.estimates import ErrorKind, Estimate
from ...core.rounding import EPS
from ...kernels import Law, PolygonLaw, RectangularTeethLaw, WallLaw
from ...kernels.laws.law import IsometryLaw
from ...kernels.laws.structure import holds_of_all
from ..essential.edge import grazing_symbol
from .channel import Arrangement, in_paper_frame

# Sign of the displacement of rays that leave near theta = 0 and near theta = pi.
DIRECTION = np.array([1.0, -1.0])
# A persistence within this distance of 1 counts as 1: the particle never reverses its direction.
BALLISTIC = 1e-12
# With a larger error of the persistence it is not known whether the particle reverses its direction.
LARGEST_UNCERTAINTY = 1e-3

# Incoming angles, and rays at each, for the length from which on the limit holds within this distance of zeta.
ONSET_ANGLES, ONSET_RAYS, NEAR_LIMIT = 10.0 ** -np.arange(0.25, 3.1, 0.25), 2000, 0.1


@dataclass(frozen=True, repr=False)
class Diffusivity(Estimate):
    r"""The slope D of L^2/tau(L) against ln(L/r) in a channel with two parallel rough walls, for long channels.

    tau(L) is the mean time to leave -L < x < L. The displacements between collisions have infinite variance, and the
    tails of their distribution determine D, the limit of the slope. D is not L^2/tau of a channel: to D ln(L/r) this
    adds a constant, which for shallow or nearly smooth walls is many times larger at any length of use. `exit_times`
    gives L^2/tau at a length. The unit is that of radius x speed.

    Attributes
    ----------
    onset : float
        The length from which on flights are turned as in the limit, in the unit of ``radius``; D is the slope for
        L well above it. At incoming angles theta with 2 r cot(theta) above it, the persistence is within 0.1 of zeta,
        by 2000 rays at each of some angles down to 1e-3. ``inf`` if it is not reached there, at 2000 r.
    eta : float
        D / D_0, where D_0 = 4 r s / pi is the diffusivity for diffuse walls.
    zeta : float
        Persistence of grazing ray segments, lim E[cot(Theta) / cot(theta)] in Feres' convention.
        eta = (1 + zeta)/(1 - zeta) for mirror-symmetric laws.
    eta_error, zeta_error : float
        Errors of ``eta`` and ``zeta``.
    arrangement : {"mirror", "half-turn"}
    """

    eta: float
    eta_error: float
    zeta: float
    zeta_error: float
    arrangement: Arrangement
    onset: float

    def __str__(self) -> str:
        digits = f"{self.value:.4g}" if self.error <= 1e-4 * abs(self.value) else super().__str__()
        return f"{digits}, the slope of L^2/tau against ln(L/r) for L well above {self.onset:.2g}"

    def __repr__(self) -> str:
        return f"Diffusivity({self}; eta={self.eta:.6g}, zeta={self.zeta:.6g}, kind={self.kind!r})"


def diffusivity(law: Law, radius: float = 1.0, speed: float = 1.0, arrangement: Arrangement = "mirror") -> Diffusivity:
    r"""The slope D of L^2/tau(L) against ln(L/r) for the mean exit time tau of a long channel: see `Diffusivity`.

    Parameters
    ----------
    law : Law
        The law of the walls, in either convention.
    radius : float
        Half the width r of the channel.
    speed : float
        Speed s of the particles.
    arrangement : {"mirror", "half-turn"}
        The upper wall is the mirror image of the lower one, or is rotated by pi. For mirror-symmetric cells both are
        the same.

    Returns
    -------
    Diffusivity

    Raises
    ------
    InputError
        If the law preserves the direction of grazing rays, like specular reflection: D is infinite. If every ray leaves
        at its own or at the mirrored angle, as at rectangular teeth: the length of all flights of a particle is then
        the same, so that the particles do not share one diffusivity.
    AccuracyError
        If the limit at grazing is not known well enough to bound D; ``defect`` is the error of zeta.

    Notes
    -----
    A ray segment at the angle theta has the displacement 2 r cot(theta). Under sin(theta) d theta displacements have
    a density with tails of order -3, so their variance grows like ln L. D depends on the correlation of successive long
    displacements. With the matrix M of `grazing_symbol` and c = (1, -1), eta = c^T (2 (1 - F)^(-1) - 1) c / 2, where
    F = M SWAP for mirror images and F = -M for half-turns.

    Source: T. Chumley, R. Feres and H.-K. Zhang, Multiscale Model. Simul. 11 (2013) 1179, for the mirror-symmetric
    case.

    Examples
    --------
    Maxwell's law with a diffuse fraction a has eta = (2 - a)/a:

    >>> from asperity import kernels as ker, spectral as spec
    >>> found = spec.diffusivity(ker.maxwell(0.5))
    >>> round(found.eta, 12), round(found.value * np.pi, 12)
    (3.0, 12.0)
    """
    paper = in_paper_frame(law)
    scale = 4.0 * positive_number("radius", radius) * positive_number("speed", speed) / np.pi
    choice("arrangement", arrangement, get_args(Arrangement))
    symbol = grazing_symbol(paper)
    # F, from one long displacement to the next, in the frame of the channel
    step = symbol.matrix[:, ::-1] if arrangement == "mirror" else -symbol.matrix
    zeta = float(0.5 * DIRECTION @ step @ DIRECTION)
    uncertainty = 2.0 * symbol.entry_error
    known = uncertainty <= LARGEST_UNCERTAINTY
    if known and abs(np.linalg.eigvals(step)).max() >= 1.0 - BALLISTIC and zeta > 1.0 - uncertainty - BALLISTIC:
        raise InputError(
            f"law: {law!r} keeps the direction of grazing flights (zeta = {zeta:.6g}), so the diffusivity is infinite; "
            "expected a law that turns them round at times, as a mixture with lambertian() does"
        )
    if holds_of_all(law, _keeps_sines):
        raise InputError(
            "law: every ray keeps its angle to the wall, so all flights of a particle are equally long and the "
            f"particles have no common diffusivity; got {law!r}, expected a law that changes angles, as a mixture with "
            "lambertian() does"
        )
    # the limit follows from the structure of the law, or from the shape of the wall at y = 0
    exact = symbol.entry_error == 0.0
    if not exact and zeta + uncertainty >= 1.0 - BALLISTIC:
        raise AccuracyError(
            f"law: the limit of grazing rays under {law!r} is known to {uncertainty:.2g} only (zeta = {zeta:.3g}), "
            "which does not bound the diffusivity; deep hollows with vertical sides turn these rays round or not with "
            "every change of the angle. exit_times(law, ...) simulates the times to leave a channel",
            uncertainty,
        )
    eta = float(0.5 * DIRECTION @ (2.0 * np.linalg.inv(np.eye(2) - step) - np.eye(2)) @ DIRECTION)
    # from the derivative of (1 + zeta)/(1 - zeta) at the worst end of the interval of zeta
    eta_error = 2.0 * uncertainty / max(1.0 - zeta - uncertainty, BALLISTIC) ** 2
    kind: ErrorKind = "bound" if exact else "estimate"
    if exact:
        eta_error = 8.0 * EPS * (1.0 + eta) / (1.0 - zeta)
        uncertainty = 4.0 * EPS
    method = f"limit of the persistence of grazing flights, upper wall as {arrangement}"
    method += ", by the law's structure or the shape of the wall at y = 0" if exact else ", at decreasing angles"
    onset = 2.0 * radius * _onset(paper, zeta)
    return Diffusivity(
        eta * scale, eta_error * scale, kind, method, eta, eta_error, zeta, uncertainty, arrangement, onset
    )


def _onset(law: Law, zeta: float) -> float:
    """The cotangent of the largest of some angles below which the persistence is near its limit zeta."""
    angle = np.concatenate((ONSET_ANGLES, np.pi - ONSET_ANGLES))
    outgoing = law.sample(np.broadcast_to(angle, (ONSET_RAYS, angle.size)), np.random.default_rng(0))
    means = (np.tan(angle) / np.tan(outgoing)).mean(axis=0).reshape(2, -1).mean(axis=0)
    far = np.abs(means + zeta) > NEAR_LIMIT
    first = int(np.flatnonzero(far)[-1]) + 1 if far.any() else 0
    return float(1.0 / np.tan(ONSET_ANGLES[first])) if first < ONSET_ANGLES.size else np.inf


def _keeps_sines(law: Law) -> bool:
    """Whether a law is known to consist of theta' = theta and theta' = pi - theta."""
    if isinstance(law, (WallLaw, PolygonLaw)):
        wall = law.wall
        steps = [np.subtract(piece.end, piece.start) for loop in (wall.pieces, *wall.islands) for piece in loop]
        return wall.is_polygonal and all(np.count_nonzero(step) == 1 for step in steps)
    return isinstance(law, (IsometryLaw, RectangularTeethLaw))
