"""Matrices of collision laws that are linear in the velocity (v1, v2, omega): smooth, no-slip, any isometry."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, instance
from ...geometry.disk.disk import Disk, branch_block


def smooth_matrix(disk: Disk) -> Floats:
    """The 3x3 matrix A_smooth of a smooth collision, which reverses v2 and leaves v1 and omega unchanged.

    It is the law K of specular reflection. Source: Rudzis 2022, eq. 2.25.

    Examples
    --------
    >>> from asperity import geometry as geo
    >>> (smooth_matrix(geo.Disk()).round(12) + 0.0).tolist()
    [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]]
    """
    return isometry_matrix(disk, -1.0, np.pi)


def no_slip_matrix(disk: Disk) -> Floats:
    """The 3x3 matrix A_no-slip = 2 chi chi^T - I (kinetic-energy metric), which reverses v2 and the slip v1 + omega.

    It is the law K of retroreflection. Source: Rudzis 2022, eq. 2.25.

    Examples
    --------
    >>> from asperity import geometry as geo
    >>> (3 * no_slip_matrix(geo.Disk(mass=1.0, inertia=0.5))).round(12).tolist()
    [[1.0, 0.0, -2.0], [0.0, -3.0, 0.0], [-4.0, 0.0, -1.0]]
    """
    return isometry_matrix(disk, 1.0, 0.0)


def isometry_matrix(disk: Disk, sign: ArrayLike, offset: ArrayLike, flip: bool = True) -> Floats:
    """The velocity matrix of theta' = sign theta + offset, psi' = pi - psi; shape ``sign.shape + (3, 3)``.

    It maps the true incoming velocity (v2 < 0) to the outgoing one and preserves the kinetic energy and the rolling
    momentum -m v1 + J omega. Without ``flip``, psi' = psi, and the rolling momentum is reversed. Rudzis 2022, section
    2.3.2, omits the matrix for triangular teeth.
    """
    sign, offset = np.broadcast_arrays(np.asarray(sign, dtype=np.float64), np.asarray(offset, dtype=np.float64))
    inner = np.zeros((*sign.shape, 3, 3))
    for row, entries in enumerate(branch_block(sign, np.cos(offset), np.sin(offset))):
        for column, entry in enumerate(entries):
            inner[..., row, column] = entry
    inner[..., 2, 2] *= 1.0 if flip else -1.0
    instance("disk", disk, Disk, "geo.Disk()")
    frame = np.asarray(disk.frame)
    metric = np.array([disk.mass, disk.mass, disk.inertia])
    return np.asarray(frame.T @ inner @ (frame * metric))
