"""The rough collision law of a disk and a wall, K = delta (x) P~ (x) delta_{pi - psi}."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, Rng, angles, finite_array, generator, instance
from ...core.errors import InputError
from ...core.kinds import explained, explained_class
from ...geometry import Disk, Wall
from ..bases.basis import Basis
from ..bases.legendre import Legendre
from ..laws.law import Combination, Law, retroreflection, specular
from ..walls.isometry_branches import isometries
from .velocity_matrices import isometry_matrix

if TYPE_CHECKING:
    from ..matrices.defects import SymmetryDefect
    from .operator import CollisionOperator

# Pairs of angles are evaluated as a grid if the grid of their distinct values has at most this many points per pair.
GRID_EXCESS = 4
DEFECT_SIZES = (32, 8)

VelocityFunction = Callable[[Floats, Floats], Floats]


@explained_class
@dataclass(frozen=True)
class CollisionLaw:
    r"""The collision law K of a rough disk with a rough wall, in the limit of small roughness.

    K maps *minus* the incoming velocity, w = cos theta sin psi chi_perp + sin theta sin psi e2^ + cos psi chi, to the
    outgoing velocity. It maps theta by P~ and psi to pi - psi, and leaves the position unchanged. It conserves the
    kinetic energy and the rolling momentum -m v1 + J omega, and is symmetric with respect to
    Lambda^2 = sin(theta) sin(psi)^2 d theta d psi. Because of the minus sign, K composed with itself is not the law of
    the next collision.

    Parameters
    ----------
    law : Law
        P~, the law of the *foreshortened* wall; `from_wall` foreshortens.
    disk : Disk

    Source: Rudzis 2022, Theorem 1.2 and eq. 1.27', 1.28' (sign of chi corrected).

    Examples
    --------
    >>> import numpy as np
    >>> from asperity import geometry as geo, kernels as ker
    >>> K = ker.CollisionLaw(ker.retroreflection(), geo.Disk(mass=1.0, inertia=0.5))
    >>> K.sample([[1.0, -1.0, 0.0]], np.random.default_rng(0)).round(12).tolist()
    [[0.333333333333, 1.0, -1.333333333333]]
    """

    law: Law
    disk: Disk

    def __post_init__(self) -> None:
        if not isinstance(self.law, Law):
            raise InputError(f"law: expected a Law such as ker.WallLaw(wall.foreshorten(disk)), got {self.law!r}")
        if isinstance(self.law, Combination):
            self.law.terms_checked()
        instance("disk", self.disk, Disk, "geo.Disk(mass=1.0, inertia=0.5)")
        if self.law.frame != "paper":
            raise InputError("law: expected a law in the paper's convention, got one in the specular frame")

    @classmethod
    @explained
    def from_wall(cls, wall: Wall, disk: Disk) -> CollisionLaw:
        """The collision law of a disk with a wall: P~ is the law of ``wall.foreshorten(disk)``.

        Source: Rudzis 2022, section 1.3.7 and Theorem 5.1.
        """
        from ..walls.wall_law import WallLaw

        instance("wall", wall, Wall, "geo.triangular_teeth(0.7)")
        return cls(WallLaw(wall.foreshorten(disk)), disk)

    @explained
    def sample(self, velocity: ArrayLike, rng: Rng = None) -> Floats:
        """Draw an outgoing velocity for every incoming one.

        Parameters
        ----------
        velocity : array_like of shape (..., 3)
            Incoming (v1, v2, omega) with v2 < 0.
        rng : None, int or numpy.random.Generator

        Returns
        -------
        array of shape (..., 3)
            Outgoing (v1, v2, omega) with v2 > 0, of the same kinetic energy and rolling momentum.

        Raises
        ------
        InputError
            If the shape is wrong or some v2 is not negative.
        """
        incoming = finite_array("velocity", velocity)
        if incoming.ndim == 0 or incoming.shape[-1] != 3:
            raise InputError(f"velocity: expected shape (..., 3) for (v1, v2, omega), got {incoming.shape}")
        if not np.all(incoming[..., 1] < 0.0):
            worst = np.argwhere(~(incoming[..., 1] < 0.0))[0].tolist()
            raise InputError(f"velocity: expected incoming velocities with v2 < 0, got v2 >= 0 at row {worst}")
        rng = generator(rng)
        frame = np.asarray(self.disk.frame)
        along, up, roll = (self.disk.inner(incoming, np.broadcast_to(direction, incoming.shape)) for direction in frame)
        # angle and length of minus the incoming velocity in the plane of chi_perp and e2^; K leaves ``roll`` unchanged
        theta = np.arctan2(-up, -along)
        outgoing = self.law.sample(theta, rng)
        size = np.hypot(along, up)
        parts = (size * np.cos(outgoing), size * np.sin(outgoing), roll)
        return np.asarray(sum(part[..., None] * direction for part, direction in zip(parts, frame, strict=True)))

    def apply(self, function: VelocityFunction, theta: ArrayLike, psi: ArrayLike) -> Floats:
        """The expectation E[f(Theta', pi - psi) | theta, psi] for a vectorised function f(theta, psi) that broadcasts.

        ``theta`` and ``psi`` in (0, pi) are the angles of minus the incoming velocity; they broadcast.
        """
        theta_all, psi_all = np.broadcast_arrays(angles("theta", theta), angles("psi", psi))
        theta_values, theta_index = np.unique(theta_all, return_inverse=True)
        psi_values, psi_index = np.unique(psi_all, return_inverse=True)
        rolled = np.pi - psi_values
        if theta_values.size * psi_values.size <= GRID_EXCESS * theta_all.size:
            # one call for the grid, with psi as an additional axis of the function's values
            grid = self.law.apply(lambda outgoing: function(outgoing[..., None], rolled), theta_values)
            return np.asarray(grid[theta_index, psi_index].reshape(theta_all.shape))
        value = np.empty(theta_all.shape)
        for k, angle in enumerate(rolled):
            here = psi_index.reshape(psi_all.shape) == k
            value[here] = self.law.apply(partial(_with_psi, function, angle), theta_all[here])
        return value

    def branches(self, theta: ArrayLike) -> list[tuple[Floats, Floats]]:
        """Probabilities and 3x3 velocity matrices of the branches of a law made of isometries.

        Parameters
        ----------
        theta : array_like
            Angle of minus the incoming velocity, in (0, pi), radians.

        Returns
        -------
        list of (probability, matrix)
            Probability of shape ``theta.shape``, matrix of shape ``theta.shape + (3, 3)``. Each matrix maps the
            incoming (v1, v2, omega) to the outgoing one. Branches with probability 0 everywhere are omitted.

        Raises
        ------
        InputError
            If the law is not made of isometries.
        """
        probability, sign, offset = isometries(self.law, theta)
        matrices = isometry_matrix(self.disk, sign, offset)
        return [
            (probability[..., slot], matrices[..., slot, :, :])
            for slot in range(probability.shape[-1])
            if np.any(probability[..., slot] > 0.0)
        ]

    @explained
    def operator(self, theta_basis: Basis, psi_basis: Basis, **discretisation: object) -> CollisionOperator:
        """The matrix of K on a product of two bases, as a linear operator that never forms the product.

        ``theta_basis`` is for the weight sin(theta), ``psi_basis`` for sin(psi)^2 (``weight="sin2"``). Further keywords
        are passed to `discretise`.
        """
        from ..discretisation.discretisation import discretise
        from .operator import CollisionOperator

        return CollisionOperator(discretise(self.law, theta_basis, **discretisation), psi_basis)  # type: ignore[arg-type]

    def symmetry_defect(
        self, theta_basis: Basis | None = None, psi_basis: Basis | None = None, **discretisation: object
    ) -> SymmetryDefect:
        """The asymmetry of K with respect to Lambda^2, measured on two bases.

        The default bases are polynomials of degree below 32 in cos theta and below 8 in cos psi.
        """
        theta_basis = Legendre(DEFECT_SIZES[0]) if theta_basis is None else theta_basis
        psi_basis = Legendre(DEFECT_SIZES[1], weight="sin2") if psi_basis is None else psi_basis
        return self.operator(theta_basis, psi_basis, **discretisation).symmetry_defect()

    def __repr__(self) -> str:
        return f"CollisionLaw(law={self.law!r}, disk={self.disk!r})"


def _with_psi(function: VelocityFunction, psi: Floats, theta: Floats) -> Floats:
    return function(theta, psi)


@explained
def no_slip(disk: Disk) -> CollisionLaw:
    """The no-slip collision law, K of retroreflection: it reverses v2 and the slip v1 + omega.

    Source: Rudzis 2022, eq. 2.25; its velocity matrix is `no_slip_matrix`.

    Examples
    --------
    >>> from asperity import geometry as geo, kernels as ker
    >>> (ker.no_slip(geo.Disk(1.0, 1.0)).sample([1.0, -1.0, 0.0]).round(12) + 0.0).tolist()
    [0.0, 1.0, -1.0]
    """
    return CollisionLaw(retroreflection(), disk)


@explained
def smooth(disk: Disk) -> CollisionLaw:
    """The smooth collision law, K of specular reflection: it reverses v2, and leaves v1 and omega unchanged.

    Source: Rudzis 2022, eq. 2.25; its velocity matrix is `smooth_matrix`.

    Examples
    --------
    >>> from asperity import geometry as geo, kernels as ker
    >>> (ker.smooth(geo.Disk(1.0, 1.0)).sample([1.0, -1.0, 3.0]).round(12) + 0.0).tolist()
    [1.0, 1.0, 3.0]
    """
    return CollisionLaw(specular(), disk)
