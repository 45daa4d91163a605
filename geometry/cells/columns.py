"""Two columns of numbers in a text, the header that names them, and the options for which a text is readable."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from ...core.checks import Floats, choice, whole_number
from ...core.errors import InputError
from ...core.long_runs import counted
from .measured import is_slope, metres

BRACKETED = re.compile(r"[\[({<]\s*([^\])}>]*?)\s*[\])}>]")
# A sign # of a comment, but not that of an undefined number as in 1.#QNAN and #N/A.
COMMENT = re.compile(r"(?:^|(?<=[\s,;]))#(?!N/?A\b|\w+!|#+\s*$)(.*)")
# Words of instruments and tables for a height that is not known.
UNDEFINED = re.compile(
    r"[+-]?(nan|inf|infinity|n/?a|bad|null|none|void|invalid|missing|undef(ined)?|masked|[*?.-]+|\d\.#\w+|#\S*|)",
    re.IGNORECASE,
)
# Thousands set off by a sign, in texts with a decimal point and with a decimal comma, and by a blank or an apostrophe.
GROUPED = {
    ".": re.compile(r"[+−-]?[1-9]\d{0,2}(,\d{3})+(\.\d*)?"),
    ",": re.compile(r"[+−-]?[1-9]\d{0,2}(\.\d{3})+(,\d*)?"),
}
GROUPED_BY_BLANK = re.compile(r"(?<=\d)['’\u00a0\u2009\u202f](?=\d{3}(?!\d))")
# Lines that name the unit of one column each.
UNIT_OF_ONE = re.compile(r"^\W*[xyz]\w*[ _]units?\s*[:=]\s*(\S+)", re.IGNORECASE)
# Characters between the names of columns, from the surest to the least sure.
BETWEEN = (r"[;\t|]+", r",", r"\s{2,}", r"(?<=[\])}>])\s+", r"\s+")
# A header may have this fraction of rows that look like data.
STRAY = 0.1


class NotPairs(InputError):
    """A text that holds something else than one pair of numbers a line."""


class Header(NamedTuple):
    """A line that names two columns: their units, empty where there is none, and whether it speaks of slopes."""

    line: str
    units: tuple[str, str]
    slopes: bool


@dataclass(frozen=True)
class Columns:
    """How the columns of a text are written; see `read_profile`."""

    delimiter: str | None = None
    decimal: str = "."
    usecols: Sequence[int] | None = None
    skiprows: int = 0

    def __post_init__(self) -> None:
        if self.delimiter is not None and (not isinstance(self.delimiter, str) or not self.delimiter):
            raise InputError(f"delimiter: expected a character such as ';', got {self.delimiter!r}")
        choice("decimal", self.decimal, (".", ","))
        if self.delimiter == self.decimal:
            raise InputError(f"delimiter: expected another character than the decimal sign, got {self.delimiter!r}")
        whole_number("skiprows", self.skiprows, 0)
        if self.usecols is not None:
            try:
                _, _ = (whole_number("usecols", column, 0) for column in self.usecols)
            except (TypeError, ValueError) as reason:
                raise InputError(f"usecols: expected two numbers such as (0, 2), got {self.usecols!r}") from reason

    def parsed(self, text: str, *, is_map: bool = False) -> tuple[Floats, Floats, Header | None]:
        """Positions, heights and the header, if it says something; of a map only NotPairs is raised.

        Raises
        ------
        NotPairs
            If fewer than half of the lines are pairs, and no other options make them pairs.
        InputError
            If a line is not a pair; the message has the options that make it one.
        """
        rows: list[tuple[float, float]] = []
        head: list[str] = []
        names_allowed, count = True, 2
        for number, line in enumerate(counted(text.splitlines(), "line", "profile"), start=1):
            if number <= self.skiprows:
                head.append(line)
                continue
            words = self._words(line)
            if not words:
                head += [line] if not rows else []
                continue
            try:
                rows.append(self._pair(words))
            except ValueError:
                names = not any(_is_number(word) for word in words)
                if names and (names_allowed or (not rows and all(_is_unit(word.strip("[]()")) for word in words))):
                    names_allowed = False
                    head.append(line)
                    continue
                words_of = "expected two numbers, x and height,"
                raise self._failure(text, f"line {number}: {words_of} got {line.strip()[:80]!r}", is_map) from None
            names_allowed, count = False, len(words)
        if len(rows) < 2:
            raise InputError(f"all lines: expected at least two rows of x and height, got {len(rows)}")
        table = np.array(rows)
        return table[:, 0], table[:, 1], self._header(head, count)

    def _words(self, line: str) -> list[str]:
        data = GROUPED_BY_BLANK.sub("", COMMENT.sub("", line) if "#" in line else line)
        if '"' in data:
            bare = re.sub(r'"[^"]*"', "", data)
            between = self.delimiter or next((sign for sign in ";\t," if sign in bare), " ")
            words = [word.strip() for word in next(csv.reader([data.strip()], delimiter=between))]
        elif self.delimiter is not None and self.delimiter != " ":
            words = [word.strip() for word in data.split(self.delimiter)] if data.strip() else []
        elif self.decimal == "." and (parts := _surely_grouped(data)):
            words = parts
        else:
            separators = ";" if self.decimal == "," else ",;"
            words = data.translate(dict.fromkeys(map(ord, separators), " ")).split()
        other = "," if self.decimal == "." else "."
        words = [word.replace(other, "") if GROUPED[self.decimal].fullmatch(word) else word for word in words]
        return [word.replace(",", ".") for word in words] if self.decimal == "," else words

    def _pair(self, words: list[str]) -> tuple[float, float]:
        if self.usecols is None:
            x, height = words
        else:
            if max(self.usecols) >= len(words):
                raise ValueError
            x, height = (words[column] for column in self.usecols)
        position = word_number(x)
        if math.isnan(position):
            raise ValueError
        return position, word_number(height)

    def _failure(self, text: str, words: str, is_map: bool) -> InputError:
        """A fault in a file of pairs, or a file of another kind."""
        lines = text.splitlines()
        counts = [len(found) for found in map(self._words, lines[self.skiprows :]) if found]
        comma = replace(self, decimal=",", delimiter=None if self.delimiter == "," else self.delimiter)
        for columns in () if is_map else (comma, self):
            found = columns._readable(lines)
            if (
                found is not None
                and found != self
                and (columns is self or any("," in line for line in lines[found.skiprows :]))
            ):
                pairs = ((name, getattr(found, name)) for name in ("decimal", "skiprows", "usecols"))
                options = {name: value for name, value in pairs if value != getattr(self, name)}
                choice = " the columns of x and height, for example" if "usecols" in options else ""
                return InputError(f"{words};{choice} {remedy(options)}")
        pairs_there = counts.count(2) if self.usecols is None else len(counts)
        return InputError(words) if 2 * pairs_there >= len(counts) else NotPairs(words)

    def _readable(self, lines: list[str]) -> Columns | None:
        """These columns after lines of a header, and two of them where there are more; None if that is no remedy."""
        rows = [self._numbers(line) for line in lines]
        sizes = [-1 if row is None else len(row) for row in rows]
        count = next((size for size in reversed(sizes) if size), -1)
        first = max((k + 1 for k, size in enumerate(sizes) if size not in (0, count)), default=0)
        stray = sizes[self.skiprows : first].count(count)
        table = np.array([row for row in rows[max(first, self.skiprows) :] if row])
        if count < 2 or len(table) < 2 or stray > STRAY * len(table):
            return None
        found = replace(
            self,
            skiprows=first if any(sizes[self.skiprows : first]) else self.skiprows,
            usecols=_two_columns(table) if count > 2 else None,
        )
        return None if np.isnan(table[:, (found.usecols or (0, 1))[0]]).any() else found

    def _numbers(self, line: str) -> list[float] | None:
        """The numbers in a line, if it has no other words; undefined ones are NaN."""
        if self.decimal == "," and re.search(r",(?!\d)", line):
            return None
        try:
            return [word_number(word) for word in self._words(line)]
        except ValueError:
            return None

    def _header(self, head: list[str], count: int) -> Header | None:
        """The last line of the header that names two columns with a unit, or one that speaks of slopes."""
        chosen = (0, 1) if self.usecols is None else tuple(self.usecols)
        for line in reversed([line for line in head if not UNIT_OF_ONE.match(line)]):
            for fields in _fields(line, count):
                names = [fields[column] for column in chosen]
                units = [_unit(name) for name in names]
                if any(map(_is_unit, units)) or (units[0] != units[1] and all(map(_like_a_unit, units))):
                    return Header(line.strip(), (units[0], units[1]), "slope" in names[1].lower())
        alone = [line for line in head if UNIT_OF_ONE.match(line)]
        slopes = [line for line in head if "slope" in line.lower()]
        if len(alone) == 2:
            first, second = (UNIT_OF_ONE.sub(r"\1", line).strip() for line in alone)
            return Header(f"{alone[0]}; {alone[1]}", (first, second), bool(slopes))
        return Header(slopes[-1].strip(), ("", ""), True) if slopes else None


def _surely_grouped(line: str) -> list[str]:
    """The words between semicolons or tabs, if all their commas surely set off thousands, as beside a point."""
    words = [word.strip() for word in re.split(r"[;\t]", line)]
    grouped = [word for word in words if "," in word]
    sure = len(words) > 1 and any("." in word for word in grouped)
    return words if sure and all(map(GROUPED["."].fullmatch, grouped)) else []


def remedy(options: dict[str, Any]) -> str:
    """Options as in Python and on the command line.

    Examples
    --------
    >>> remedy({"decimal": ",", "usecols": (0, 2)})
    "pass decimal=',', usecols=(0, 2) (on the command line decimal=comma,usecols=0/2)"
    """
    texts = {name: "/".join(map(str, v)) if isinstance(v, tuple) else str(v) for name, v in options.items()}
    line = ",".join(f"{name}={'comma' if text == ',' else text}" for name, text in texts.items())
    return f"pass {', '.join(f'{name}={value!r}' for name, value in options.items())} (on the command line {line})"


def _fields(line: str, count: int) -> Iterator[list[str]]:
    """The names of so many columns."""
    bare = line.strip().lstrip("#;%*! \t")
    for between in BETWEEN:
        fields = [field.strip() for field in re.split(between, bare) if field.strip()]
        if len(fields) == count and not any(
            (field[0].isdigit() and not _is_unit(field)) or sum(map(_is_unit, BRACKETED.findall(field))) > 1
            for field in fields
        ):
            yield fields
    words = bare.split()
    pairs = [" ".join(pair) for pair in zip(words[::2], words[1::2], strict=False)]
    if len(words) == 2 * count and all(map(_unit, pairs)):
        yield pairs


def _is_unit(text: str) -> bool:
    return metres(text) is not None or is_slope(text)


def _like_a_unit(text: str) -> bool:
    """Whether a text is no unit that is known, but no word for something else either."""
    return bool(re.fullmatch(r"\S{1,5}|.*(meter|metre|inch|zoll|mikr|nano|10|\d[eE]).*", text, re.IGNORECASE))


def _unit(name: str) -> str:
    """The unit in a name of a column: in brackets, the last of them that is one, or its last word if that is one."""
    if _is_unit(name):
        # a line of units below the names
        return name
    found = BRACKETED.findall(name)
    if found:
        return str(next((text for text in reversed(found) if _is_unit(text)), found[-1]))
    last = re.split(r"[\s_/:]+", name)[-1]
    return last if _is_unit(last) else ""


def _two_columns(table: Floats) -> tuple[int, int]:
    """The likeliest columns of x and of height: not the first if it counts lines beside positions."""
    steps = np.diff(table, axis=0)
    rising = np.asarray((steps > 0.0).all(axis=0) | (steps < 0.0).all(axis=0))
    counts = (steps[:, 0] == 1.0).all() and table[0, 0] in (0.0, 1.0) and bool(rising[1])
    x = 1 if counts else int(np.argmax(rising[:-1]))
    return x, table.shape[1] - 1 if table.shape[1] == 3 else x + 1


def word_number(word: str) -> float:
    """A finite number, or NaN for a word that stands for none."""
    # the minus of typesetting, and the exponent of Fortran
    word = re.sub(r"(?<=[\d.])[dD](?=[+-]?\d+$)", "e", word.replace("−", "-"))
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if math.isfinite(value) and "_" not in word and word.isascii():
        return value
    if not UNDEFINED.fullmatch(word):
        raise ValueError(word)
    return math.nan


def _is_number(word: str) -> bool:
    try:
        return not math.isnan(word_number(word))
    except ValueError:
        return False
