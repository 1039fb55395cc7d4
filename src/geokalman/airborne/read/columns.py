"""Columns of a survey file: their names and units, the words that mark a missing value, and words as numbers."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from geokalman import reading
from geokalman.airborne.model import Array
from geokalman.reading import InputError, Place, lines, number

WHAT = "survey file"
LABELS = "a line is labelled by its number, with letters before it at most"
NULLS = frozenset(
    [
        "*",
        "?",
        "-",
        "--",
        ".",
        "na",
        "n/a",
        "#n/a",
        "nan",
        "-nan",
        "none",
        "null",
        "nil",
        "nodata",
        "dummy",
        "empty",
        "missing",
        "inf",
        "+inf",
        "-inf",
        "infinity",
        "-infinity",
        "1.#inf",
        "-1.#inf",
        "1.#qnan",
        "-1.#ind",
        "#value!",
        "#div/0!",
    ]
) | {""}
"""Words, in lower case, that mark a missing value in any column; so does a field of asterisks alone."""
DUMMIES = (-999999.99, -9999999.9)
"""Numbers that mark a missing value in any column; so does whatever is beyond HUGE (Geosoft -1e32, netCDF 9.97e36)."""
HUGE = 1e20
_LABEL = re.compile(r"[a-z]*[ _#]*(\d+(?:\.\d+)?)(?::\d+)?(?:\s.*)?", re.I)
_RULER = re.compile(r"[-=_~*+.|]+")
_UNIT = re.compile(r"(.*?)\s*[(\[]([^()\[\]]*)[)\]]")


class Table(dict[str, Array]):
    """Columns of a survey by name, each (n,) with NaN for a null, and what else their file says of them.

    path : the file, None for a table made otherwise; rows : (n,) row of the file on which each row stands, or None;
    units : column -> its unit as the file writes it; texts : column -> its words, where not all are numbers (its array
    is NaN); starts : rows at which a line header stands, so that a line flown twice in a row stays two.
    """

    def __init__(
        self,
        columns: Mapping[str, Array] | Iterable[tuple[str, Array]] = (),
        path: Path | str | None = None,
        rows: Sequence[int] | None = None,
    ) -> None:
        super().__init__(columns)
        self.path = path
        self.rows = None if rows is None else np.array(rows, dtype=float)
        self.units: dict[str, str] = {}
        self.texts: dict[str, list[str]] = {}
        self.starts: list[int] = []

    def error(self, text: str, row: int | None = None) -> InputError:
        """The error to raise about a row, or about the whole table."""
        if row is not None and self.rows is None:
            text = f"row {row + 1} of the data: {text}"
        if self.path is None:
            return InputError(text[0].upper() + text[1:])
        line = int(self.rows[row]) if row is not None and self.rows is not None else 0
        return Place(Path(self.path), line).error(text)

    def channel(self, name: str) -> Array:
        """A column of numbers. Raises InputError where one of its words is none, or two columns have the name."""
        if name in self.texts:
            words = self.texts[name]
            if not words:
                raise self.error(f"two columns have the name {name} and differ; keep one of them.")
            row = int(np.argmax([_value(text) is None for text in words]))
            raise self.error(f"{name} is {words[row][:40]!r}, which is no number{_cure(words[row])}.", row)
        return self[name]

    def labels(self, name: str) -> Array:
        """Numbers of the flight lines: a column of numbers, or of labels like L10100 and 10100:0."""
        words = self.texts.get(name)
        if not words:
            return self.channel(name)
        known = {text: line_number(text) for text in set(words)}
        values = np.array([known[text] for text in words])
        if np.isnan(values).any():
            row = int(np.argmax(np.isnan(values)))
            raise self.error(f"{name} is {words[row][:40]!r}; {LABELS}.", row)
        return values

    def add(self, name: str, words: Sequence[str], comma: bool = False) -> None:
        """Add a column by its words; `comma`: the decimal mark may be a comma."""
        values, good = as_numbers(words, comma)
        self.put(name, values, [] if good else [text.strip() for text in words])

    def put(self, name: str, values: Array, words: Sequence[str] = ()) -> None:
        """Add a column of numbers, or of words that are none; a name that comes again with others is marked."""
        known = self.texts.get(name, [])
        if name in self and (known != list(words) or not np.array_equal(self[name], values, equal_nan=True)):
            self.texts[name] = []
        elif words:
            self.texts[name] = list(words)
        self[name] = values


def full_rows(path: Path) -> Iterator[tuple[Place, str]]:
    """Rows of a text file that are not blank, as `reading.lines`. Raises InputError for more than memory may hold."""
    size = 0
    for place, text in lines(path, WHAT):
        size += len(text) + 64  # what a row takes in memory
        if size > reading.MAX_BYTES:
            raise Place(path).error(f"this holds more than {reading.MAX_BYTES >> 30} GiB; split it.")
        if text.strip():
            yield place, text


def as_numbers(words: Sequence[str], comma: bool = False) -> tuple[Array, bool]:
    """Words as numbers (n,), NaN for nulls, and whether all are numbers or nulls; else all are NaN."""
    try:
        if "_" in "".join(words):  # float() would take 10100_1 for 101001
            raise ValueError
        return blanked(np.fromiter(map(float, words), float, len(words))), True
    except ValueError:
        values = np.empty(len(words))
    for k, text in enumerate(words):
        value = _value(text.replace(",", ".") if comma else text)
        if value is None:
            return np.full(len(words), np.nan), False
        values[k] = value
    return blanked(values), True


def blanked(values: Array) -> Array:
    """The same array, NaN in place of what no column can hold."""
    with np.errstate(invalid="ignore"):
        values[(np.abs(values) >= HUGE) | np.isin(values, DUMMIES)] = np.nan
    return values


def is_number(text: str) -> bool:
    """Whether a word is a number and no null."""
    value = _value(text)
    return value is not None and not math.isnan(value)


def is_value(text: str) -> bool:
    """Whether a word is a number or a null, so that it may be in a column of numbers."""
    return _value(text) is not None


def line_number(label: str) -> float:
    """The number of a flight line by its label (10100, L10100, 10100:0, 7001.16), NaN where it has none."""
    found = _LABEL.fullmatch(label.strip())
    return float(found[1]) if found else np.nan


def column_name(text: str) -> tuple[str, str]:
    """Name and unit of a column as a header writes them: 'Height (ft)' is HEIGHT in ft, MGA-X is MGA_X."""
    text = text.strip().strip("\"'/").strip()
    split = _UNIT.fullmatch(text)
    name, unit = (split[1], split[2]) if split and split[1] else (text, "")
    return re.sub(r"[\s-]+", "_", name.strip().upper()), unit.strip()


def is_ruler(words: Sequence[str]) -> bool:
    """Whether words only rule off a header: === ----- ===."""
    return all(_RULER.fullmatch(text.strip()) for text in words)


def _value(text: str) -> float | None:
    plain = text.strip()
    if plain.lower() in NULLS or not plain.strip("*"):
        return np.nan
    try:
        return number(plain)
    except ValueError:
        return None


def _cure(text: str) -> str:
    if re.fullmatch(r"\d+:\d+(:\d+(\.\d*)?)?|\d{4}-\d\d-\d\d.*", text):
        return "; write times as seconds"
    if re.fullmatch(r"[+-]?\d+,\d+", text):
        return "; the decimal mark is a point where commas separate the columns"
    return ""
