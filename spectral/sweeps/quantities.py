"""The quantities of a sweep: what a law is asked, by name or by the user's own function."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from ...core.checks import instance, shortened
from ...core.errors import InputError
from ...core.estimates import Estimate
from ...kernels import Law, resistance
from ..consequences.diffusion import logarithmic_slope
from ..consequences.mixing import relaxation_time, slem_from_gap
from ..consequences.momentum_accommodation import accommodation
from ..gap.gap import modulus_gap, spectral_gap
from ..gap.verdict import SpectralGap

UserQuantity = Callable[[Law], Estimate]
Numbers = dict[str, Estimate]


@dataclass(frozen=True)
class Quantity:
    """One or several numbers of a law.

    Attributes
    ----------
    names : tuple of str
        What the numbers are called in the table.
    find : callable
        From a law and a tolerance to the numbers and the verdict on the gap behind them, empty where there is none.
    """

    names: tuple[str, ...]
    find: Callable[[Law, float], tuple[Sequence[Estimate], str]]


def _gap(law: Law, tolerance: float) -> tuple[Sequence[Estimate], str]:
    found = spectral_gap(law, tolerance)
    return [found], found.verdict


def _gap_in_the_specular_frame(law: Law, tolerance: float) -> tuple[Sequence[Estimate], str]:
    return _gap(law if law.frame == "specular" else law.in_specular_frame(), tolerance)


def _slem(law: Law, tolerance: float) -> tuple[Sequence[Estimate], str]:
    found = modulus_gap(law, tolerance)
    return [slem_from_gap(found)], found.verdict


def _relaxation_time(law: Law, tolerance: float) -> tuple[Sequence[Estimate], str]:
    found = modulus_gap(law, tolerance)
    return [relaxation_time(found)], found.verdict


def _resistance(law: Law, tolerance: float) -> tuple[Sequence[Estimate], str]:
    return [resistance(law.in_specular_frame() if law.frame == "specular" else law, tolerance)], ""


def _eta(law: Law, tolerance: float) -> tuple[Sequence[Estimate], str]:
    found = logarithmic_slope(law, 1.0, 1.0, "mirror")
    return [Estimate(found.eta, found.eta_error, found.kind, found.method)], ""


def _accommodation(law: Law, tolerance: float) -> tuple[Sequence[Estimate], str]:
    found = accommodation(law, tolerance)
    return [found.tangential, found.normal, found.maxwell_fraction, found.misfit], ""


_ACCOMMODATION = ("tangential_accommodation", "normal_accommodation", "maxwell_fraction", "maxwell_misfit")
QUANTITIES: Mapping[str, Quantity] = MappingProxyType(
    {
        "gap": Quantity(("gap",), _gap),
        "gap_specular": Quantity(("gap_specular",), _gap_in_the_specular_frame),
        "slem": Quantity(("slem",), _slem),
        "relaxation_time": Quantity(("relaxation_time",), _relaxation_time),
        "resistance": Quantity(("resistance",), _resistance),
        "eta": Quantity(("eta",), _eta),
        "accommodation": Quantity(_ACCOMMODATION, _accommodation),
    }
)


def listed_quantities(asked: str | UserQuantity | Sequence[str | UserQuantity]) -> tuple[str | UserQuantity, ...]:
    """One quantity or several as a tuple; an InputError for anything else."""
    if isinstance(asked, str) or callable(asked):
        return (asked,)
    if not isinstance(asked, Sequence):
        raise InputError(f"quantities: expected names or functions such as ['gap', 'eta'], got {shortened(asked)}")
    return tuple(asked)


def quantities_from(asked: str | UserQuantity | Sequence[str | UserQuantity]) -> tuple[Quantity, ...]:
    """The quantities that names and functions mean, each once.

    Raises
    ------
    InputError
        If there is none, a name is unknown, or two quantities have the same.

    Examples
    --------
    >>> [one.names for one in quantities_from(["gap", "eta"])]
    [('gap',), ('eta',)]
    """
    found = [_quantity(one) for one in listed_quantities(asked)]
    names = [name for one in found for name in one.names]
    twice = {name for name in names if names.count(name) > 1}
    if not names or twice:
        what = f"{sorted(twice)[0]!r} twice" if twice else "none"
        raise InputError(f"quantities: expected different ones of {', '.join(QUANTITIES)} or functions, got {what}")
    return tuple(found)


def _quantity(asked: str | UserQuantity) -> Quantity:
    if isinstance(asked, str):
        if asked not in QUANTITIES:
            raise InputError(
                f"quantities: expected one of {', '.join(QUANTITIES)} or a function of a law, got {asked!r}"
                + "; the diffusivity in a channel is eta times 4 radius speed / pi" * (asked == "diffusivity")
            )
        return QUANTITIES[asked]
    if not callable(asked):
        raise InputError(f"quantities: expected a name or a function that takes a law, got {asked!r}")

    def find(law: Law, tolerance: float) -> tuple[Sequence[Estimate], str]:
        value = asked(law)
        instance(name, value, Estimate, 'Estimate(0.5, 0.0, "bound", "closed form")')
        return [value], value.verdict if isinstance(value, SpectralGap) else ""

    name = name_of(asked)
    return Quantity((name.rpartition(".")[2],), find)


def name_of(function: Callable[..., object]) -> str:
    """Module and name of a function; of another callable those of its class, or what it is printed as.

    Examples
    --------
    >>> name_of(name_of)
    'asperity.spectral.sweeps.quantities.name_of'
    """
    # functions have names, the user's other callables may
    name = getattr(function, "__qualname__", None)
    # without addresses, which differ from process to process
    return f"{function.__module__}.{name}" if name else re.sub(r" at 0x[0-9a-fA-F]+", "", repr(function))
