"""The reason why a law is not self-adjoint in its convention, and its norm on functions of mean 0."""

from __future__ import annotations

import numpy as np

from ...core.errors import AccuracyError, InputError
from ...kernels import Law
from ...kernels.laws.structure import lists_branches
from .images import suits_panels

# Angles at which the law is compared with its mirror image, and the difference of two means of cos(theta') that exceeds
# their errors.
COMPARED, DIFFERENT = np.array([0.4, 0.8, 1.2]), 1e-6


def self_adjoint_elsewhere(law: Law) -> Law | None:
    """The law in the other convention, if it is self-adjoint there and not known to be so in its own; else None.

    Examples
    --------
    >>> from asperity import geometry as geo, kernels as ker
    >>> wall = ker.WallLaw(geo.Wall.from_vertices([(0, 0), (0.3, -0.4), (1, 0)]))
    >>> self_adjoint_elsewhere(wall.in_specular_frame()) == wall, self_adjoint_elsewhere(wall) is None
    (True, True)
    """
    if law.reversible:
        return None
    other = law.in_specular_frame()
    return other if other.reversible else None


def refuse_unless_self_adjoint(law: Law) -> None:
    """Raise an AccuracyError if a law is not reversible or is reversible in the other frame only.

    Raises
    ------
    AccuracyError
        The message states the bounds that hold nevertheless.
    """
    other = self_adjoint_elsewhere(law)
    if other is not None:
        raise AccuracyError(
            f"{why_not_self_adjoint(other)}. What is true: {what_is_true()}; spectral_gap(law) gives 1 - slem as its "
            f"value. The eigenvalues that exist are those of {other!r}, in the {other.frame} convention",
            np.inf,
        )
    if law.reversible is False:
        raise AccuracyError(
            f"{law!r} is not symmetric with respect to sin(theta) d theta: its spectrum need not be real. "
            "Use law @ law.adjoint() if that is what you mean",
            np.inf,
        )


def why_not_self_adjoint(other: Law) -> str:
    """The reason, in words, why P J is not (or not known to be) self-adjoint for a self-adjoint P."""
    if lists_branches(other) or suits_panels(other):
        try:
            here, there = (other.apply(np.cos, angle) for angle in (COMPARED, np.pi - COMPARED))
        except InputError:
            # too many branches
            return _unknown(other)
        worst = int(np.argmax(np.abs(here + there)))
        if abs(here[worst] + there[worst]) > DIFFERENT:
            return (
                f"P J with P = {other!r} and J f(theta) = f(pi - theta) is not self-adjoint, for P does not commute "
                f"with J: E[cos(theta')] is {here[worst]:.6g} at theta = {COMPARED[worst]:g} and {there[worst]:.6g} at "
                "pi - theta. Its spectrum need not be real"
            )
    return _unknown(other)


def what_is_true() -> str:
    """The statement, in words, on the norm of P J on functions of mean 0."""
    return (
        "J is unitary and keeps the constants, so on functions f of mean 0 the norm of P J is the slem of P: "
        "||P J f|| <= slem ||f||, the best constant for one step, and the spectrum off the constants lies in the disk "
        "of radius slem"
    )


def _unknown(other: Law) -> str:
    return (
        f"P J with P = {other!r} and J f(theta) = f(pi - theta) is not known to be self-adjoint, for the cell has no "
        "mirror axis. Its spectrum need not be real"
    )
