"""Functions of arrays and seeds, as users give them: checked."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from inspect import signature
from typing import Any, ParamSpec, TypeVar

import numpy as np

from .checks import Floats, numbers
from .errors import AsperityError, InputError

P = ParamSpec("P")
T = TypeVar("T")


@dataclass(frozen=True)
class Vectorised:
    """A function of arrays, given by the user, whose values are checked: numbers, of the arguments' shape + any.

    One number stands for the same number everywhere.

    Examples
    --------
    >>> import numpy as np
    >>> Vectorised(lambda angle: 1.0)(np.array([0.5, 1.0])).tolist()
    [1.0, 1.0]
    >>> Vectorised(lambda angle: 1.0 if angle > 0.7 else 0.0)(np.array([0.5, 1.0]))    # doctest: +ELLIPSIS
    Traceback (most recent call last):
    asperity.errors.InputError: function: expected a vectorised one, of arrays, but it failed (The truth value of...
    """

    function: Callable[..., Any]
    # whether values have the arguments' shape, without more axes
    scalar: bool = False

    @classmethod
    def of(cls, function: Callable[..., Any]) -> Vectorised:
        """The function itself if its values are checked already."""
        return function if isinstance(function, cls) else cls(function)

    def __call__(self, *at: Floats) -> Floats:
        try:
            value = self.function(*at)
        except AsperityError:
            raise
        except (TypeError, ValueError) as reason:
            raise InputError(
                f"function: expected a vectorised one, of arrays, but it failed ({reason}); of a function of "
                "one number numpy.vectorize(function) makes one"
            ) from reason
        found, shape = numbers("values of the function", value), np.broadcast_shapes(*(one.shape for one in at))
        if found.shape == shape or (found.shape[: len(shape)] == shape and not self.scalar):
            return found
        # one number, or a function that ignores one of several arguments
        if found.shape not in ((), *(one.shape for one in at[: len(at) - 1]), *(one.shape for one in at[1:])):
            more = "" if self.scalar else " or with more axes"
            raise InputError(f"function: expected a vectorised one, values of shape {shape}{more}, got {found.shape}")
        return np.broadcast_to(found, shape)


def seed_by_name(method: Callable[P, T]) -> Callable[P, T]:
    """The method, which takes a whole number as ``rng`` by name only: by position it may be meant as a number of draws.

    Examples
    --------
    >>> @seed_by_name
    ... def sample(theta, rng=None):
    ...     return theta
    >>> sample(0.7, rng=1000)
    0.7
    >>> sample(0.7, 1000)
    Traceback (most recent call last):
    asperity.errors.InputError: rng: got 1000 by position; write rng=1000 for a seed, np.full(1000, 0.7) for 1000 draws
    """
    names = list(signature(method).parameters)
    first = names.index("self") + 1 if "self" in names else 0

    @wraps(method)
    def call(*arguments: P.args, **named: P.kwargs) -> T:
        given: Any = arguments[names.index("rng")] if len(arguments) > names.index("rng") else None
        if isinstance(given, (int, np.integer)):
            one = np.ndim(arguments[first]) == 0  # type: ignore[arg-type]
            draws = f"{given}, {arguments[first]!r}" if one else f"({given}, *np.shape({names[first]})), {names[first]}"
            raise InputError(
                f"rng: got {given} by position; write rng={given} for a seed, np.full({draws}) for {given} draws"
            )
        return method(*arguments, **named)

    return call
