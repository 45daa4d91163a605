"""Two columns of numbers in a text, with the units that its header names."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ...core.checks import Floats, whole_number
from ...core.errors import InputError
from ...core.long_runs import counted
from .measured import METRES

UNIT = re.compile(r"[\[(]\s*([^\])]*?)\s*[\])]")


class NotPairs(InputError):
    """A text that holds something else than one pair of numbers a line."""


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
        if self.decimal not in (".", ","):
            raise InputError(f"decimal: expected '.' or ',', got {self.decimal!r}")
        if self.delimiter == self.decimal:
            raise InputError(f"delimiter: expected another character than the decimal sign, got {self.delimiter!r}")
        whole_number("skiprows", self.skiprows, 0)
        if self.usecols is not None:
            try:
                first, second = self.usecols
            except (TypeError, ValueError) as reason:
                raise InputError(f"usecols: expected two numbers such as (0, 2), got {self.usecols!r}") from reason
            whole_number("usecols", first, 0)
            whole_number("usecols", second, 0)

    def parsed(self, text: str) -> tuple[Floats, Floats, tuple[str, str] | None]:
        """Positions, heights and the units of the header, if it has any.

        Raises
        ------
        NotPairs
            If fewer than half of the lines are pairs.
        InputError
            If a line is not a pair.
        """
        rows: list[tuple[float, float]] = []
        head: list[str] = []
        names_allowed = True
        for number, line in enumerate(counted(text.splitlines(), "line", "profile"), start=1):
            if number <= self.skiprows:
                continue
            data, _, comment = line.partition("#")
            words = self._words(data)
            if not words:
                head += [comment] if not rows else []
                continue
            try:
                rows.append(self._pair(words))
            except ValueError:
                if names_allowed and not any(_is_number(word) for word in words):
                    names_allowed = False
                    head.append(line)
                    continue
                words_of = "expected two numbers, x and height,"
                raise self._failure(text, f"line {number}: {words_of} got {line.strip()[:80]!r}") from None
            names_allowed = False
        if len(rows) < 2:
            raise InputError(f"all lines: expected at least two rows of x and height, got {len(rows)}")
        table = np.array(rows)
        return table[:, 0], table[:, 1], self._units(head)

    def _words(self, data: str) -> list[str]:
        if self.delimiter is not None and self.delimiter != " ":
            words = [word.strip() for word in data.split(self.delimiter)] if data.strip() else []
        else:
            separators = ";" if self.decimal == "," else ",;"
            words = data.translate(dict.fromkeys(map(ord, separators), " ")).split()
        return [word.replace(",", ".") for word in words] if self.decimal == "," else words

    def _pair(self, words: list[str]) -> tuple[float, float]:
        if self.usecols is None:
            x, height = words
        else:
            if max(self.usecols) >= len(words):
                raise ValueError
            x, height = (words[column] for column in self.usecols)
        return float(x), float(height or "nan")

    def _failure(self, text: str, words: str) -> InputError:
        """A fault in a file of pairs, or a file of another kind."""
        total, pairs = 0, 0
        for data in self._lines(text):
            total += 1
            try:
                self._pair(data)
            except ValueError:
                continue
            pairs += 1
        return InputError(words) if 2 * pairs >= total else NotPairs(words)

    def _lines(self, text: str) -> Iterator[list[str]]:
        for line in text.splitlines()[self.skiprows :]:
            words = self._words(line.partition("#")[0])
            if words:
                yield words

    def _units(self, head: list[str]) -> tuple[str, str] | None:
        """The units of the last line of the header that names any."""
        for line in reversed(head):
            found = UNIT.findall(line)
            if any(unit in METRES for unit in found):
                if self.usecols is not None and max(self.usecols) < len(found):
                    found = [found[column] for column in self.usecols]
                if len(found) == 2 and all(unit in METRES for unit in found):
                    return found[0], found[1]
                raise InputError(
                    f"header: expected two units of length as in 'x [um], height [nm]', got {line.strip()!r}; "
                    "give units=('um', 'nm')"
                )
        return None


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
