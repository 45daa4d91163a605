"""Results as summaries, in a terminal and in a notebook: what they are, their numbers, and where there is more."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from html import escape
from textwrap import shorten
from typing import Any, ClassVar

# Entries of a sequence and facts that are shown; characters of a value; attributes that the hint names.
FEW, MOST_FACTS, LONGEST, HINTS = 6, 12, 100, 6


class Summary:
    """A result that is shown as its class, a headline and one fact a line; dataclasses of it have ``repr=False``.

    Without methods of its own the facts of a dataclass are its fields, and the hint names what else it has.
    """

    # what to call for more; whether all stands in one line, as of results that come in sequences
    _more: ClassVar[str] = ""
    _in_one_line: ClassVar[bool] = False

    def _headline(self) -> str:
        """What follows the name of the class: the result itself, where it is one number or a few words."""
        return ""

    def _facts(self) -> Mapping[str, object]:
        """The rest by name; None and empty texts are left out."""
        found: Any = self
        return {one.name: getattr(self, one.name) for one in fields(found) if one.repr}

    def _picture(self) -> str:
        """HTML between title and facts in a notebook."""
        return ""

    def _shown(self) -> tuple[str, dict[str, str]]:
        found = {name: value for name, value in self._facts().items() if value is not None}
        facts = {name: shown(found[name]) for name in list(found)[:MOST_FACTS]}
        rest = f"{len(found) - len(facts)} more" if len(found) > len(facts) else ""
        title = f"{type(self).__name__} {self._headline()}".strip()
        more = self._more or ("" if self._in_one_line else _members(self, found))
        return title, {**facts, "...": rest, "more": more}

    def __repr__(self) -> str:
        return text_of(*self._shown(), in_one_line=self._in_one_line)

    def _repr_html_(self) -> str:
        return html_table(*self._shown(), self._picture())


def shown(value: Any) -> str:
    """A value in a few words; of arrays of more than six numbers the size and the range.

    Examples
    --------
    >>> import numpy as np
    >>> shown(0.1 + 0.2), shown((1.5, 2.5)), shown(np.arange(10.0).reshape(2, 5)), shown(np.arange(9) > 3)
    ('0.3', '1.5, 2.5', '2 x 5 numbers from 0 to 9', '5 of 9')
    """
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


def _members(found: object, facts: Mapping[str, object]) -> str:
    """Some public methods and properties of an object that are none of its facts."""
    kind = type(found)
    names = [name for name in dict.fromkeys([*vars(kind), *dir(kind)]) if not (name.startswith("_") or name in facts)]
    return ", ".join(f".{name}{'()' * callable(getattr(kind, name))}" for name in names[:HINTS])


def text_of(title: str, facts: Mapping[str, str], *, in_one_line: bool = False) -> str:
    """A title with one line a fact below, or with the facts in brackets behind.

    Examples
    --------
    >>> print(text_of("Sweep", {"points": "3", "": "of them 1 refused", "more": ".rows"}))
    Sweep
    points    3
              of them 1 refused
    more      .rows
    >>> text_of("Gap 0.5", {"error": "bound"}, in_one_line=True)
    'Gap 0.5 (error bound)'
    """
    known = {name: value for name, value in facts.items() if value}
    if in_one_line:
        return f"{title} ({'; '.join(f'{name} {value}' for name, value in known.items())})" if known else title
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
