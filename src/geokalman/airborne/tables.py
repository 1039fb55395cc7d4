"""Files of airborne surveys as tables of columns: CSV, fixed width with a DFN, Geosoft XYZ, and the packed vendored
file.

A table is a dict of column name -> (n,) float array (NaN where the file has a null); names are upper case with
underscores,
however the file writes them. Plain, gzip and xz files are told apart by their first bytes.
"""

from __future__ import annotations

import gzip
import io
import json
import lzma
import re
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import IO

import numpy as np

from geokalman.airborne.model import Array

Table = dict[str, Array]
NULLS = ("*", "", "-999999.99", "-9999999.9")
"""Words that mark a missing value."""
_PACKED = b'{"packed": 1'


def open_binary(path: Path | str) -> IO[bytes]:
    """Open a file that may be compressed by gzip or xz."""
    with open(path, "rb") as stream:
        head = stream.read(6)
    if head[:2] == b"\x1f\x8b":
        return gzip.open(path, "rb")
    return lzma.open(path, "rb") if head == b"\xfd7zXZ\x00" else open(path, "rb")


def read_table(path: Path | str, definition: Path | str | None = None) -> Table:
    """Read a survey file of any known format; `definition` is the .DFN of a fixed-width .DAT (default: the one beside
    it).

    Raises ValueError, naming the row, for what cannot be read.
    """
    path = Path(path)
    if path.suffix.lower() == ".dat":
        return read_fixed_width(path, definition or _beside(path))
    try:
        with open_binary(path) as stream:
            head = stream.readline()
        if not head.strip() and not path.stat().st_size:
            raise ValueError(f"{path} is empty.")
        if head.startswith(_PACKED):
            return read_packed(path)
        if b";" in head and b"," not in head:
            raise ValueError(f"{path} is separated by semicolons; separate its columns by commas.")
        return read_csv(path) if b"," in head else read_xyz(path)
    except UnicodeDecodeError as error:
        raise ValueError(
            f"{path} holds byte {error.object[error.start]:#04x} at {error.start}, which is no text; "
            f"give a CSV, XYZ or DAT file, "
            "plain or compressed by gzip or xz."
        ) from None
    except (EOFError, OSError, lzma.LZMAError, zlib.error) as error:
        if isinstance(error, OSError) and error.errno is not None:  # not there, not readable: as the system says it
            raise
        raise ValueError(f"{path} is cut short or damaged ({str(error).rstrip('.')}); fetch it again.") from None


def read_csv(path: Path | str) -> Table:
    """Read comma separated columns under one header line. Raises ValueError for a row of another length or no
    header.
    """
    with open_binary(path) as stream:
        rows = io.TextIOWrapper(stream, encoding="utf-8-sig").read().splitlines()
    header = [_column(word) for word in rows[0].split(",")] if rows else []
    if not header or any(_is_number(word) for word in header):
        raise ValueError(f"{path} has no header line; the first line must name the columns.")
    if not any(row.strip() for row in rows[1:]):
        raise ValueError(f"{path} has a header line and no data under it.")
    try:
        values = np.loadtxt(rows[1:], delimiter=",", ndmin=2)
    except ValueError:
        values = _numbers([row.split(",") for row in rows[1:] if row.strip()], len(header), str(path), 2)
    if values.shape[1] != len(header):
        raise ValueError(f"{path} names {len(header)} columns and has {values.shape[1]}.")
    values[np.isin(values, [float(word) for word in NULLS if _is_number(word)])] = np.nan
    return dict(zip(header, values.T.copy(), strict=True))


def read_xyz(path: Path | str) -> Table:
    """Read a Geosoft XYZ file: `Line 10` or `Tie 20` before each line, column names in the last comment before the
    data.

    Where there is no column LINE it is made from the headers. Raises ValueError where no comment names the columns.
    """
    header: list[str] = []
    rows: list[list[str]] = []
    current: list[str] = []
    label, first = "nan", 0
    with open_binary(path) as stream:
        for number, text in enumerate(io.TextIOWrapper(stream, encoding="utf-8"), 1):
            words = text.split()
            if not words:
                continue
            if words[0].startswith("/"):
                names = " ".join(words).lstrip("/ ").split()
                if len(names) > 1 and not any(_is_number(name) for name in names) and not rows:
                    header = [_column(name) for name in names]
            elif words[0].lower() in ("line", "tie"):
                label = words[1] if len(words) > 1 else "nan"
            else:
                first = first or number
                rows.append(words)
                current.append(label)
    if not header:
        raise ValueError(
            f"{path} names no columns: a CSV has commas in its header line, "
            f"an XYZ a comment line (/ LINE X Y ...) before the data."
        )
    if not rows:
        raise ValueError(f"{path} names its columns and has no data.")
    values = _numbers(rows, len(header), str(path), first)
    table = dict(zip(header, values.T.copy(), strict=True))
    if "LINE" not in table:
        table["LINE"] = np.array(current, dtype=float)
    return table


def read_fixed_width(path: Path | str, definition: Path | str) -> Table:
    """Read a fixed-width file by its DFN (ASEG-GDF2). Raises ValueError where the widths of the two do not agree."""
    fields = [
        (_column(name), int(width))
        for name, width in re.findall(r"RT=DATA;\s*([^:\n]+):\s*[A-Z](\d+)", Path(definition).read_text())
    ]
    if not fields:
        raise ValueError(f"{definition} defines no column (no RT=DATA).")
    ends = np.cumsum([width for _, width in fields])
    with open_binary(path) as stream:
        rows = stream.read().splitlines()
    lengths = np.array([len(row.rstrip()) for row in rows])
    if len(set(lengths.tolist())) != 1 or lengths[0] != ends[-1]:
        k = int(np.argmax(lengths != ends[-1]))
        raise ValueError(f"Row {k + 1} of {path} is {lengths[k]} characters wide, {definition} defines {ends[-1]}.")
    block = np.frombuffer(b"".join(row[: ends[-1]] for row in rows), "S1").reshape(len(rows), -1)
    table: Table = {}
    for (name, width), end in zip(fields, ends, strict=True):
        text = np.ascontiguousarray(block[:, end - width : end]).view(f"S{width}")[:, 0]
        try:
            values = text.astype(float)
        except ValueError:
            values = _numbers([[word.decode().strip()] for word in text], 1, f"column {name} of {path}", 1)[:, 0]
        values[np.isin(values, [float(word) for word in NULLS if _is_number(word)])] = np.nan
        table[name] = values
    return table


def pack(table: Mapping[str, Array], decimals: Mapping[str, int], predicted: Mapping[str, tuple[str, str]]) -> bytes:
    """Pack columns without loss: integers of 10^-decimals, second differences, byte planes, xz.

    predicted : column -> (a, b) where a - b nearly gives it, so that only the rest is kept. Raises ValueError for a
    null.
    """
    whole: dict[str, np.ndarray] = {}
    for name, places in decimals.items():
        values = np.asarray(table[name], dtype=float)
        if not np.isfinite(values).all():
            raise ValueError(f"Column {name} has a null; the packed file has none.")
        whole[name] = np.round(values * 10**places).astype(np.int64)
    head = json.dumps({"packed": 1, "rows": len(values), "decimals": dict(decimals), "predicted": dict(predicted)})
    parts = [head.encode() + b"\n"]
    for name, values in whole.items():
        if name in predicted:
            a, b = predicted[name]
            values = values - (whole[a] - whole[b])
        rest = np.diff(values, 2, prepend=[0, 0])
        parts.append(np.ascontiguousarray(rest.astype("<i8").view(np.uint8).reshape(-1, 8).T).tobytes())
    return lzma.compress(b"".join(parts), preset=9 | lzma.PRESET_EXTREME)


def read_packed(path: Path | str) -> Table:
    """Read a file made by `pack`."""
    with open_binary(path) as stream:
        head = json.loads(stream.readline())
        body = stream.read()
    rows, whole = head["rows"], {}
    for k, name in enumerate(head["decimals"]):
        plane = np.frombuffer(body, np.uint8, 8 * rows, 8 * rows * k).reshape(8, rows)
        rest = np.ascontiguousarray(plane.T).view("<i8")[:, 0]
        whole[name] = np.cumsum(np.cumsum(rest))
    for name, (a, b) in head["predicted"].items():
        whole[name] = whole[name] + whole[a] - whole[b]
    return {name: whole[name] / 10.0**places for name, places in head["decimals"].items()}


def _beside(path: Path) -> Path:
    for suffix in (".DFN", ".dfn"):
        if path.with_suffix(suffix).is_file():
            return path.with_suffix(suffix)
    raise ValueError(f"{path} needs the file {path.stem}.DFN beside it, which says where its columns are.")


def _column(name: str) -> str:
    return name.strip().strip("/").strip().upper().replace("-", "_")


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _numbers(rows: list[list[str]], columns: int, where: str, first: int) -> Array:
    out = np.empty((len(rows), columns))
    for k, words in enumerate(rows):
        if len(words) != columns:
            raise ValueError(f"Row {first + k} of {where} has {len(words)} values; {columns} are named.")
        for j, word in enumerate(words):
            stripped = word.strip()
            if stripped in NULLS:
                out[k, j] = np.nan
                continue
            try:
                out[k, j] = float(stripped)
            except ValueError:
                raise ValueError(f"Row {first + k} of {where} holds {stripped!r}, which is no number.") from None
    return out
