"""Reading the binary tables of FITS files (event lists, satellite orbits), plain or gzipped.

Only what photon files need: scalar columns of numbers and logicals, with TSCAL and TZERO. Source: FITS Standard 4.0,
section 7.3.
"""

from __future__ import annotations

import gzip
import os
import re
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

_BLOCK = 2880
_TYPES = {
    "L": ("i1", 1),
    "B": ("u1", 1),
    "I": (">i2", 2),
    "J": (">i4", 4),
    "K": (">i8", 8),
    "E": (">f4", 4),
    "D": (">f8", 8),
}
_BYTES = {"X": 1, "A": 1, "C": 8, "M": 16, "P": 8, "Q": 16}  # kinds that are skipped
_FORM = re.compile(r"(\d*)([A-Z])")


class FitsError(ValueError):
    """A file that is no FITS file with binary tables; the message names file and place."""


@dataclass(frozen=True, eq=False)
class Table:
    """One binary table: its extension name, its header, and its scalar columns in native floats or integers."""

    name: str
    header: dict[str, Any]
    columns: dict[str, np.ndarray]


def read_fits(path: str | os.PathLike) -> list[Table]:
    """The binary tables of a FITS file. Raises FileNotFoundError and FitsError."""
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"No FITS file at {path}; give the path of an event list or an orbit file.")
    content = path.read_bytes()
    if content[:2] == b"\x1f\x8b":
        try:
            content = gzip.decompress(content)
        except (EOFError, gzip.BadGzipFile, zlib.error) as error:
            raise FitsError(f"{path}: the gzip stream is damaged or truncated ({error}).") from None
    return parse_fits(content, str(path))


def parse_fits(content: bytes, name: str) -> list[Table]:
    """The binary tables in the bytes of a FITS file called `name`. Raises FitsError."""
    if content[:9] != b"SIMPLE  =":
        raise FitsError(f"{name} does not begin with SIMPLE; it is no FITS file.")
    tables, place = [], 0
    while place < len(content) and content[place : place + 8].strip():
        header, place = _header(content, place, name)
        size = abs(header.get("BITPIX", 8)) // 8 if header.get("NAXIS", 0) else 0
        for k in range(1, header.get("NAXIS", 0) + 1):
            size *= header[f"NAXIS{k}"]
        size += header.get("PCOUNT", 0)
        if place + size > len(content):
            raise FitsError(f"{name} is truncated: a table ends {place + size - len(content)} bytes beyond the file.")
        if header.get("XTENSION") == "BINTABLE":
            tables.append(Table(header.get("EXTNAME", ""), header, _columns(content, place, header, name)))
        place += -(-size // _BLOCK) * _BLOCK
    return tables


def _header(content: bytes, place: int, name: str) -> tuple[dict[str, Any], int]:
    header: dict[str, Any] = {}
    while True:
        card = content[place : place + 80].decode("ascii", "replace")
        if len(card) < 80:
            raise FitsError(f"{name} is truncated: a header has no END.")
        place += 80
        if card.rstrip() == "END":
            return header, -(-place // _BLOCK) * _BLOCK
        if card[8:10] == "= ":
            header.setdefault(card[:8].strip(), _value(card[10:]))


def _value(text: str) -> Any:
    text = text.strip()
    if text.startswith("'"):
        return text[1:].split("'")[0].strip()
    text = text.split("/")[0].strip()
    if text in ("T", "F"):
        return text == "T"
    try:
        return int(text)
    except ValueError:
        pass
    try:
        return float(text.replace("D", "E"))
    except ValueError:
        return text


def _columns(content: bytes, place: int, header: dict[str, Any], name: str) -> dict[str, np.ndarray]:
    width, rows, offset = header["NAXIS1"], header["NAXIS2"], 0
    page = np.frombuffer(content, np.uint8, width * rows, place).reshape(rows, width)
    columns = {}
    for k in range(1, header["TFIELDS"] + 1):
        form = _FORM.match(str(header[f"TFORM{k}"]))
        if form is None or form[2] not in {**_TYPES, **_BYTES}:
            raise FitsError(f"{name}: column {k} has the unknown format {header[f'TFORM{k}']!r}.")
        count = int(form[1] or 1)
        if form[2] == "X":
            offset += -(-count // 8)
            continue
        size = _TYPES[form[2]][1] if form[2] in _TYPES else _BYTES[form[2]]
        if form[2] in _TYPES and count == 1:
            raw = np.ascontiguousarray(page[:, offset : offset + size]).view(_TYPES[form[2]][0])[:, 0]
            scale, zero = header.get(f"TSCAL{k}", 1), header.get(f"TZERO{k}", 0)
            values = raw.astype(raw.dtype.newbyteorder("="))
            columns[str(header.get(f"TTYPE{k}", k)).strip()] = (
                values if (scale, zero) == (1, 0) else values * scale + zero
            )
        offset += count * size
    return columns
