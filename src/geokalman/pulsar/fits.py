"""Read the binary tables of FITS files (event lists, satellite orbits), plain or packed.

Only what photon files need: columns of numbers and logicals, scalar or short vectors, with TSCAL, TZERO and TNULL. No
size that a header names is trusted. Source: FITS Standard 4.0, sections 3, 4 and 7.3.
"""

from __future__ import annotations

import math
import os
import re
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from geokalman import reading
from geokalman.reading import InputError

_BLOCK, _CARD = 2880, 80
_MAX_CARDS = 200_000
"""Cards of the longest header that is read."""
_TYPES = {"L": "u1", "B": "u1", "I": ">i2", "J": ">i4", "K": ">i8", "E": ">f4", "D": ">f8"}
_SKIPPED = {
    "A": (1, "text"), "X": (0, "bits"), "C": (8, "complex numbers"), "M": (16, "complex numbers"),
    "P": (8, "arrays of various length"), "Q": (16, "arrays of various length"),
}  # fmt: skip
_UNSIGNED = {"I": 2**15, "J": 2**31, "K": 2**63}
_FORM = re.compile(r"(\d*)([A-Z])")
_QUOTED = re.compile(r"'((?:[^']|'')*)'?")


class FitsError(InputError):
    """A FITS file that cannot be used; the message names file, table and keyword or row."""


class FitsWarning(UserWarning):
    """A FITS file that was put right or is taken at its word."""


class Header(dict[str, Any]):
    """Values by keyword, in capitals: text, numbers, logicals; None where one is undefined.

    where : file and table, for messages; doubled : keywords that stand there again with another value.
    """

    def __init__(self, where: str) -> None:
        super().__init__()
        self.where = where
        self.doubled: set[str] = set()

    def error(self, text: str) -> FitsError:
        """Make the error to raise, beginning with file and table."""
        return FitsError(f"{self.where}: {text}")

    def warn(self, text: str) -> None:
        """Warn, beginning with file and table."""
        warnings.warn(f"{self.where}: {text}", FitsWarning, stacklevel=2)

    def value(self, key: str) -> Any:
        """Give a value, None where absent or undefined; FitsError where it is given twice."""
        if key in self.doubled:
            raise self.error(f"{key} is given twice with different values; keep the right one.")
        return self.get(key)

    def text(self, key: str) -> str:
        """Give a value as text in capitals, empty where it is absent."""
        value = self.value(key)
        return "" if value is None else str(value).strip().upper()

    def number(self, key: str, default: float | None = None) -> float:
        """Give a value as a finite float, even if written as text; without default it must be."""
        value = self.value(key)
        if value is None and default is not None:
            return default
        if value is None:
            raise self.error(f"the header lacks {key}.")
        try:
            return reading.number(str(value))
        except ValueError as error:
            raise self.error(f"{key} = {error}") from None

    def integer(self, key: str, low: int, high: int, default: int | None = None) -> int:
        """Give a value as a whole number from low to high; without default it must be there."""
        self.number(key, default)
        try:
            value = reading.integer(str(self.get(key) if self.get(key) is not None else default))
        except ValueError as error:
            raise self.error(f"{key} = {error}") from None
        if not low <= value <= high:
            raise self.error(f"{key} = {value}; a number from {low} to {high} is needed.")
        return value


class _Field(NamedTuple):
    """A column: number from 1, first byte in a row, elements, and kind, or why it is refused."""

    number: int
    offset: int
    count: int
    kind: str


class Columns(Mapping[str, np.ndarray]):
    """Columns of a binary table by name, in any case, unpacked when asked for.

    (rows,), or (rows, n) for vectors. Raises KeyError for a name that is not there, and FitsError for a column that
    holds no numbers.
    """

    def __init__(self, header: Header, page: np.ndarray, fields: list[_Field]) -> None:
        self._header, self._page = header, page
        self._fields: dict[str, list[_Field]] = {}
        self._names = {}
        for field in fields:
            name = str(header.get(f"TTYPE{field.number}") or field.number).strip()
            self._names.setdefault(name.upper(), name)
            self._fields.setdefault(name.upper(), []).append(field)

    def __iter__(self) -> Iterator[str]:
        return iter(self._names.values())

    def __len__(self) -> int:
        return len(self._names)

    def __contains__(self, name: object) -> bool:
        return str(name).upper() in self._fields

    def __getitem__(self, name: str) -> np.ndarray:
        return self._unpacked(name, self.field(name))

    def field(self, name: str) -> _Field:
        """Tell where a column stands."""
        field, *others = self._fields[name.upper()]
        if others:
            raise self._header.error(f"the columns {field.number} and {others[0].number} are both called {name}.")
        return field

    def _unpacked(self, name: str, field: _Field) -> np.ndarray:
        header, (k, offset, count, kind) = self._header, field
        if kind not in _TYPES or count == 0:
            what = (_SKIPPED[kind][1] if kind in _SKIPPED else kind) if count else "nothing"
            raise header.error(f"column {name} holds {what}; numbers of a binary table are needed.")
        size = np.dtype(_TYPES[kind]).itemsize * count
        raw = np.ascontiguousarray(self._page[:, offset : offset + size]).view(_TYPES[kind])
        values = raw.astype(raw.dtype.newbyteorder("="))
        if kind == "L":
            values = np.select([values == ord("T"), values == ord("F")], [1.0, 0.0], np.nan)
        else:
            values = self._scaled(values, k, kind)
        return values[:, 0] if count == 1 else values

    def _scaled(self, values: np.ndarray, k: int, kind: str) -> np.ndarray:
        header = self._header
        scale, zero = header.number(f"TSCAL{k}", 1.0), header.number(f"TZERO{k}", 0.0)
        if scale == 0.0:
            raise header.error(f"TSCAL{k} = 0, which makes all rows the same; the scale of the column is needed.")
        null = None
        if values.dtype.kind in "iu" and header.value(f"TNULL{k}") is not None:
            null = values == header.integer(f"TNULL{k}", -(2**63), 2**63 - 1)
        if scale == 1.0 and zero == _UNSIGNED.get(kind):  # exact, where floats would lose digits
            unsigned = np.dtype(f"u{values.itemsize}")
            values = values.view(unsigned) ^ unsigned.type(_UNSIGNED[kind])
        elif (scale, zero) != (1.0, 0.0):
            values = values.astype(float) * scale + zero
        return values if null is None or not null.any() else np.where(null, np.nan, values)


@dataclass(frozen=True, eq=False)
class Table:
    """One table: extension name, header, header of the file, and columns in native numbers."""

    name: str
    header: Header
    columns: Columns
    primary: Header

    def column(self, name: str) -> np.ndarray:
        """Give the numbers of a column; FitsError where there is none."""
        if name not in self.columns:
            there = ", ".join(self.columns) or "none"
            raise self.header.error(f"there is no column {name}; the columns are {there}.")
        return self.columns[name]

    def finite(self, name: str) -> np.ndarray:
        """Give a column; FitsError, with the first row from 1, where one is null or not finite."""
        values = self.column(name)
        bad = np.flatnonzero(~np.isfinite(values.reshape(len(values), math.prod(values.shape[1:]))).all(axis=1))
        if bad.size:
            others = f", as are {bad.size - 1} other rows" if bad.size > 1 else ""
            raise self.header.error(f"column {name} is null or not finite in row {bad[0] + 1}{others}; leave it out.")
        return values

    def unit(self, name: str) -> str:
        """Give TUNIT of a column, empty where it has none."""
        return str(self.header.value(f"TUNIT{self.columns.field(name).number}") or "").strip()


def read_fits(path: str | os.PathLike) -> list[Table]:
    """Read the tables of a FITS file.

    Raises FileNotFoundError, FitsError, and what `reading.open_bytes` does.
    """
    return parse_fits(reading.read_bytes(path, "FITS file", FitsError), str(path))


def parse_fits(content: bytes, name: str) -> list[Table]:
    """Parse the tables in the bytes of a FITS file called `name`. Raises FitsError.

    Tables whose columns cannot be read (ASCII, tile-compressed) are listed too, and refused when a column is asked for.
    """
    if content[:9] != b"SIMPLE  =":
        raise FitsError(f"{name} does not begin with SIMPLE; it is no FITS file.")
    primary, place = _header(content, 0, name)
    place = _end(content, place, primary)
    tables: list[Table] = []
    number = 0
    while content[place : place + 8] == b"XTENSION":
        number += 1
        header, start = _header(content, place, f"{name}, extension {number}")
        place = _end(content, start, header)
        if header.text("XTENSION") in ("BINTABLE", "A3DTABLE", "TABLE"):
            columns = Columns(header, *_fields(content, start, header))
            tables.append(Table(str(header.get("EXTNAME") or "").strip(), header, columns, primary))
    if rest := content[place:].strip(b"\0 \r\n\x1a"):
        warnings.warn(
            f"{name}: the {len(rest)} bytes after the last table begin with no XTENSION; they are left out.",
            FitsWarning,
            stacklevel=3,
        )
    return tables


def _header(content: bytes, start: int, where: str) -> tuple[Header, int]:
    header, last, stop = Header(where), "", min(len(content), start + _MAX_CARDS * _CARD)
    for place in range(start, stop, _CARD):
        card = content[place : place + _CARD].decode("ascii", "replace")
        key = card[:8].strip().upper()
        if card.rstrip() == "END":
            if header.value("EXTNAME"):
                header.where += f" ({header['EXTNAME']})"
            return header, place + _CARD + -(place + _CARD) % _BLOCK
        if key == "CONTINUE" and isinstance(header.get(last), str) and header[last].endswith("&"):
            header[last] = header[last][:-1] + str(_value(card[8:]) or "")
        elif card[8:10] == "= ":
            value, last = _value(card[10:]), key
            if header.setdefault(key, value) != value:
                header.doubled.add(key)
    raise header.error(f"the header has no END in {stop - start} bytes; the file is truncated or damaged.")


def _value(text: str) -> Any:
    text = text.strip()
    if quoted := _QUOTED.match(text):
        return quoted[1].replace("''", "'").rstrip()
    text = text.split("/")[0].strip()
    if text in ("T", "F"):
        return text == "T"
    if re.fullmatch(r"[+-]?\d+", text):
        return int(text)
    try:
        return reading.number(text)
    except ValueError:
        return text or None


def _end(content: bytes, start: int, header: Header) -> int:
    """Tell where data end, filled to a whole block; FitsError where the file ends before."""
    bits = header.integer("BITPIX", -64, 64)
    if bits not in (8, 16, 32, 64, -32, -64):
        raise header.error(f"BITPIX = {bits}; 8, 16, 32, 64, -32 or -64 is needed.")
    axes = [header.integer(f"NAXIS{k}", 0, 2**63) for k in range(1, header.integer("NAXIS", 0, 999) + 1)]
    if header.value("GROUPS") is True and axes[:1] == [0]:
        axes = axes[1:]
    groups, extra = header.integer("GCOUNT", 1, 2**63, 1), header.integer("PCOUNT", 0, 2**63, 0)
    size = abs(bits) // 8 * groups * (extra + math.prod(axes)) if axes else 0
    if start + size > len(content):
        raise header.error(
            f"the data end {start + size - len(content)} bytes beyond the file; it is truncated, or NAXIS1, NAXIS2 or "
            "PCOUNT is wrong."
        )
    return start + size + -size % _BLOCK


def _fields(content: bytes, start: int, header: Header) -> tuple[np.ndarray, list[_Field]]:
    """Give the bytes of the rows of a table (rows, width), and its columns."""
    numbers = range(1, header.integer("TFIELDS", 0, 999) + 1)
    refused = "numbers written as text (XTENSION = TABLE)" if header.text("XTENSION") == "TABLE" else ""
    if header.value("ZTABLE") is True:
        refused = "compressed tiles (ZTABLE = T; unpack the file with funpack)"
    if refused:
        return np.empty((0, 0), np.uint8), [_Field(k, 0, 1, refused) for k in numbers]
    if (header["BITPIX"], header["NAXIS"]) != (8, 2):
        raise header.error("a binary table has BITPIX = 8 and NAXIS = 2.")
    width, rows, offset, fields = header.integer("NAXIS1", 0, 2**63), header.integer("NAXIS2", 0, 2**63), 0, []
    for k in numbers:
        form = _FORM.match(header.text(f"TFORM{k}"))
        if form is None or form[2] not in {**_TYPES, **_SKIPPED}:
            raise header.error(f"TFORM{k} = {header.get(f'TFORM{k}')!r} is missing or an unknown format.")
        count, kind = int(form[1] or 1), form[2]
        fields.append(_Field(k, offset, count, kind))
        size = np.dtype(_TYPES[kind]).itemsize if kind in _TYPES else _SKIPPED[kind][0]
        offset += -(-count // 8) if kind == "X" else count * size
    if offset != width:
        raise header.error(f"NAXIS1 = {width} bytes, but the columns of TFORM1 to TFORM{len(fields)} take {offset}.")
    if width * rows == 0:
        return np.empty((rows if width else 0, width), np.uint8), fields
    return np.frombuffer(content, np.uint8, width * rows, start).reshape(rows, width), fields
