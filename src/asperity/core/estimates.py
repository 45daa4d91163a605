"""Numbers with their errors, and results as summaries: what they are, their numbers, and where there is more."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from decimal import Decimal
from html import escape
from inspect import getattr_static
from textwrap import shorten
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike

from .checks import Value, choice, numbers, one_number
from .errors import InputError

ErrorKind = Literal["bound", "estimate"]

# The fraction of intervals of estimated width that hold the true value.
LEVEL = 0.95
# Of how many standard deviations such an interval of a normal variable has on each side.
NORMAL_95 = 1.959963984540054
# If none of n trials shows an effect, its probability is below this number over n with a confidence of 95 %.
RULE_OF_THREE = 3.0
# A number without error is printed to this many decimals.
DECIMALS = 12
# A printed error has two digits if the first is smaller than this, of a double's significant digits at most so many;
# powers of ten between these are written without exponent.
TWO_DIGITS, SIGNIFICANT, PLAIN = 3, 17, (-4, 8)
# Entries of a sequence and facts that a summary shows; characters of a fact or a line; attributes that its hint names.
FEW, MOST_FACTS, LONGEST, HINTS = 6, 14, 120, 6
# Methods and evidence are shown to those who ask for them.
ON_REQUEST = {
    "method", "evidence", "reasons", "reason", "completeness", "statement", "lemmas", "certificate", "spectrum",
}  # fmt: skip


class Summary(Value):
    """A result that is shown as its class, its value with its error, and one fact a line, as text and as HTML.

    Facts are the fields of a dataclass, which has ``repr=False``, but those that say why, and those at their defaults.
    """

    # names of other facts, fields or properties; the unit of the numbers; what to call for more, in place of the rest
    _show: ClassVar[str] = ""
    _unit: ClassVar[str] = ""
    _more: ClassVar[str] = ""

    def _headline(self) -> str:
        """What follows the name of the class."""
        return self._fact("value") if hasattr(self, "value") else ""

    def _fact(self, name: str) -> str:
        """A field or property in a few words, with the error that stands beside it."""
        value, beside = getattr(self, name), {"value": "error", "values": "errors"}.get(name, f"{name}_error")
        return shown(value) if value is None or not hasattr(self, beside) else with_errors(value, getattr(self, beside))

    def _fields(self) -> list[str]:
        found: Any = self
        kept = [one.name for one in fields(found) if one.repr and getattr(self, one.name) is not one.default]
        number = {"value", "error"} if hasattr(self, "value") else set()
        return [name for name in kept if name not in number and not name.endswith("_error")]

    def _facts(self) -> Mapping[str, object]:
        """The facts by name; None and empty texts are left out."""
        names = self._show.split() or [name for name in self._fields() if name not in ON_REQUEST]
        return {name: self._fact(name) for name in names}

    def _picture(self) -> str:
        """HTML between title and facts."""
        return ""

    def _shown(self) -> tuple[str, dict[str, str]]:
        found = {name: value for name, value in self._facts().items() if value is not None}
        facts = {name: shown(found[name]) for name in list(found)[:MOST_FACTS]}
        rest = f"{len(found) - len(facts)} more" if len(found) > len(facts) else ""
        last = {"...": rest, "unit": self._unit or facts.get("unit", ""), "more": self._hint(found)}
        return f"{type(self).__name__} {self._headline()}".strip(), {**facts, **last}

    def _hint(self, facts: Mapping[str, object]) -> str:
        """What else there is: fields, methods and properties, those of the class itself first."""
        kind = type(self)
        names = [name for name in dict.fromkeys([*vars(kind), *dir(kind)]) if name[0] != "_"]
        members = {name: getattr_static(kind, name, None) for name in [*self._fields(), *names] if name not in facts}
        calls = [
            f".{name}{'()' * callable(one)}"
            for name, one in members.items()
            if not isinstance(one, classmethod | staticmethod)
        ]
        return self._more or ", ".join(calls[:HINTS])

    def __repr__(self) -> str:
        return text_of(*self._shown())

    def _repr_html_(self) -> str:
        return html_table(*self._shown(), self._picture())


@dataclass(frozen=True, repr=False)
class Estimate(Summary):
    """A quantity that carries its error.

    Parameters
    ----------
    value : float
        The quantity.
    error : float
        Half width of the interval around ``value``; ``inf`` where nothing is known.
    kind : {"bound", "estimate"}
        ``"bound"``: the true value is within ``error``, to rounding. ``"estimate"``: ``error`` is the half width of an
        interval that holds the true value in 95 of 100 cases. Where sampling is the only error it does so in 95 % of
        repetitions; where it comes from two resolutions, in at least 95 % of problems.
    method : str
        How value and error were found, in words.

    Notes
    -----
    Where a quantity has errors from several sources their half widths are added as they are. That is right if they are
    not independent, and on the safe side if they are: the sum of a bound and a half width of 95 % is one of 95 %, that
    of two half widths one of 95 % or more for errors of normal distribution.

    Examples
    --------
    >>> gap = Estimate(0.25, 0.0, "bound", "closed form")
    >>> gap, float(gap)
    (Estimate 0.25 (kind bound; more .method), 0.25)
    >>> print(gap, Estimate(0.0373214, 0.00004, "estimate", "two resolutions"))
    0.25 0.03732(5)
    >>> f"{gap:.3f}"
    '0.250'

    It has no arithmetic: how errors add depends on what the numbers have in common. Where they are independent, the
    package uncertainties does it::

        from uncertainties import ufloat
        half = ufloat(gap.value, gap.error / 1.96) / 2
    """

    value: float
    error: float
    kind: ErrorKind
    method: str

    def __post_init__(self) -> None:
        object.__setattr__(self, "value", one_number("value", numbers("value", self.value)))
        object.__setattr__(self, "error", one_number("error", numbers("error", self.error)))
        if not self.error >= 0.0:
            raise InputError(f"error: expected a half width of at least 0, got {self.error!r}; inf if it is not known")
        choice("kind", self.kind, ("bound", "estimate"))
        if not isinstance(self.method, str):
            raise InputError(f"method: expected words, got {self.method!r}")

    def __float__(self) -> float:
        return float(self.value)

    def _facts(self) -> Mapping[str, object]:
        # the method says why nothing is known
        return {**super()._facts(), **({"method": self.method} if math.isinf(self.error) else {})}

    def _headline(self) -> str:
        # the method says why
        missing = math.isnan(self.value)
        return f"not known: {self.method.removeprefix('not known: ')}" if missing else super()._headline()

    def __str__(self) -> str:
        return with_error(self.value, self.error)

    def __format__(self, spec: str) -> str:
        return format(self.value, spec) if spec else str(self)


def with_error(value: float, error: float) -> str:
    """A value with its error in units of the last digit; both roundings are inside the error that is printed.

    Examples
    --------
    >>> with_error(0.63297743, 0.00022), with_error(1.5e-9, 4e-11), with_error(123456, 400.0), with_error(0.5, math.inf)
    ('0.63298(23)', '1.50(4)e-09', '123500(500)', '0.5(inf)')
    """
    if math.isnan(value):
        return "not known"
    # numpy's numbers have another repr
    value, error = float(value), float(error)
    if error == 0.0 or not (math.isfinite(value) and math.isfinite(error)):
        return f"{value:.{DECIMALS}g}" + (f"({error:g})" if error else "")
    size = math.floor(math.log10(max(abs(value), error)))
    first = math.floor(math.log10(error))
    decimals = -first + (error < TWO_DIGITS * 10.0**first)
    # beyond the last digit of a double there is none
    decimals = min(decimals, SIGNIFICANT - 1 - size)
    # the shortest decimals that are these doubles
    exact, width = Decimal(repr(value)), Decimal(repr(error))
    rounded = round(exact, decimals) + 0
    units = math.ceil((width + abs(exact - rounded)).scaleb(decimals)) * 10 ** max(-decimals, 0)
    if PLAIN[0] <= size <= PLAIN[1]:
        return f"{rounded:f}({units})"
    return f"{rounded.scaleb(-size):f}({units})e{size:+03d}"


def with_errors(values: ArrayLike, errors: ArrayLike) -> str:
    """Values with their errors, up to six of them.

    Examples
    --------
    >>> with_errors([1.0, 2.0], [0.25, 0.5]), with_errors(0.5, 0.0)
    ('1.00(25), 2.0(5)', '0.5')
    """
    return shown([with_error(value, error) for value, error in np.broadcast(values, errors)])


def shown(value: Any) -> str:
    """A value in a few words; of arrays of more than six numbers the size and the range.

    Examples
    --------
    >>> import numpy as np
    >>> shown(0.1 + 0.2), shown((1.5, 2.5)), shown(np.arange(10.0).reshape(2, 5)), shown(np.arange(9) > 3)
    ('0.3', '1.5, 2.5', '2 x 5 numbers from 0 to 9', '5 of 9')
    """
    if value is None:
        return ""
    if isinstance(value, Summary):
        return value._headline() or type(value).__name__
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {shown(one)}" for name, one in value.items())
    if isinstance(value, tuple | list):
        rest = f", ... ({len(value)})" if len(value) > FEW else ""
        return ", ".join(map(shown, value[:FEW])) + rest
    if getattr(value, "shape", ()):
        return _array(value)
    if isinstance(value, str):
        return " ".join(value.split())
    return shorten(getattr(value, "__name__", str(value)), LONGEST, placeholder=" ...")


def _array(value: Any) -> str:
    size = " x ".join(map(str, value.shape))
    if value.dtype == bool:
        return f"{int(value.sum())} of {size}"
    if value.size <= FEW:
        return shown(value.ravel().tolist())
    # entries that are not known are nan
    known = value[value == value]
    return f"{size} numbers" + (f" from {known.min():.6g} to {known.max():.6g}" if known.size else ", none known")


def text_of(title: str, facts: Mapping[str, str]) -> str:
    """A title with its facts in brackets, if that is no long line, else below it.

    Examples
    --------
    >>> text_of("Gap 0.5", {"kind": "bound", "more": ".method"}), text_of("Gap 0.5", {"kind": 120 * "*"})[:21]
    ('Gap 0.5 (kind bound; more .method)', 'Gap 0.5\\nkind      ***')
    """
    known = {name: value for name, value in facts.items() if value}
    line = f"{title} ({'; '.join(f'{name} {value}' for name, value in known.items())})"
    if len(line) <= LONGEST:
        return line
    width = max(9, *map(len, known)) + 1
    return "\n".join([title, *(f"{name:{width}s}{value}" for name, value in known.items())])


def html_table(title: str, facts: Mapping[str, object], picture: str = "") -> str:
    """A title, a picture and one row a fact; facts that are None or empty are left out.

    Parameters
    ----------
    picture : str
        HTML, as it stands; all other text is escaped.

    Examples
    --------
    >>> html_table("a < b", {"error": 0.5, "method": None})
    '<div><b>a &lt; b</b><table><tr><th>error</th><td>0.5</td></tr></table></div>'
    """
    known = {name: str(value) for name, value in facts.items() if value is not None}
    rows = "".join(f"<tr><th>{escape(name)}</th><td>{escape(one)}</td></tr>" for name, one in known.items() if one)
    return f"<div><b>{escape(title)}</b>{picture}<table>{rows}</table></div>"


def student_95(parts: int) -> float:
    """Of how many standard errors, from the spread of so many parts, an interval of 95 % has on each side.

    Examples
    --------
    >>> round(student_95(8), 3), round(student_95(10**6), 3)
    (2.365, 1.96)
    """
    from scipy.special import stdtrit

    return float(stdtrit(parts - 1, 0.5 * (1.0 + LEVEL)))


def fraction_estimate(fraction: float, number: int, method: str) -> Estimate:
    """The probability of what happened in a fraction of independent trials, with Wilson's interval of 95 %.

    Examples
    --------
    >>> fraction_estimate(0.0, 100, "100 trials").error < 0.04
    True
    """
    z = NORMAL_95**2 / number
    middle = (fraction + 0.5 * z) / (1.0 + z)
    half = math.sqrt(z * fraction * (1.0 - fraction) + 0.25 * z * z) / (1.0 + z)
    # the interval about the observed frequency that contains Wilson's
    return Estimate(fraction, abs(fraction - middle) + half, "estimate", method)


def mean_of_strata(values: Any, largest: float, method: str) -> Estimate:
    """The mean over equal strata with one random point each, in their order.

    The error is 1.96 standard deviations from the differences of neighbours, which contain the spread within their
    strata and a little more, plus 3 ``largest``/n: a value that none of n points shows, at most ``largest`` in size, is
    rarer than 3/n with a confidence of 95 %.

    Examples
    --------
    >>> mean_of_strata([1.0, 1.0, 1.0], 2.0, "3 points")
    Estimate 1.0(20) (kind estimate; more .method)
    """
    import numpy as np

    number = len(values)
    spread = math.sqrt(float(np.mean(np.diff(values) ** 2)) / (2.0 * number))
    return Estimate(float(np.mean(values)), NORMAL_95 * spread + RULE_OF_THREE / number * largest, "estimate", method)


def estimate_as_dict(number: Estimate) -> dict[str, Any]:
    """A number with its error as plain values; an unknown error is None."""
    return {"value": number.value, "error": finite(number.error), "kind": number.kind, "method": number.method}


def finite(value: Any) -> Any:
    """JSON has no infinity: an unknown number is None."""
    # not at the head: ``import asperity`` does without
    import numpy as np

    if value is None:
        return None
    if np.ndim(value):
        return [finite(entry) for entry in value]
    return float(value) if np.isfinite(value) else None
