"""Reader of Level-1 files in ASCII; every refusal names file and line."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from geokalman import reading
from geokalman.attitude import header as headers
from geokalman.attitude.header import Level1Error
from geokalman.attitude.products import GRACE_FO, KEYS, QUATERNION, Column

MOST_BAD = 0.01
FEWEST = 0.5
NORM_REFUSED, NORM_EXACT = 1e-3, 1e-9
CHUNK = 50_000  # lines that are converted at a time
LONGEST = 40  # characters of a field
FORMS = {
    "int": re.compile(r"[+-]?[0-9]+\Z"),
    "float": re.compile(
        r"[+-]?(?:(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?|nan|inf(?:inity)?)\Z", re.IGNORECASE
    ),
}


class Level1Warning(UserWarning):
    """Something in a Level-1 file that was mended or left out."""


@dataclass(frozen=True)
class Table:
    """Records of one file: columns name -> (n,) int64, float64 or str; notes on what was mended."""

    path: Path
    product: str
    satellite: str
    date: str
    columns: dict[str, np.ndarray]
    notes: tuple[str, ...] = ()
    header: dict[str, Any] = field(default_factory=dict)

    def __getitem__(self, name: str) -> np.ndarray:
        return self.columns[name]

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    def stacked(self, *names: str) -> np.ndarray:
        """Several columns beside one another (n, len(names)) in float64."""
        return np.stack([self.columns[name].astype(float) for name in names], axis=1)

    def where(self, keep: np.ndarray) -> Table:
        """The records at which `keep` (n,) is true."""
        return replace(self, columns={k: v[keep] for k, v in self.columns.items()})


def read(path: Path | str, product: str | None = None, satellite: str | None = None, date: str | None = None) -> Table:
    """Read one GRACE-FO file, `PPPPP_YYYY-MM-DD_S_VV.txt`.

    product, satellite, date : what is expected; another one is refused. Columns follow the header's `variables` where
    they name those that are needed; unknown columns are left out. Bad records are left out, counted and warned of.
    Raises Level1Error: no or broken header, wrong product, satellite or date, missing columns, more than 1 % bad
    records, fewer than half of the records that the header promises; FileNotFoundError.
    """
    path = Path(path)
    parts = headers.parts_of(path, GRACE_FO, product, satellite, date)
    stream = reading.lines(path, "Level-1 file", Level1Error, keep_ends=True)
    header, first, notes = headers.read_header(path, stream)
    headers.agree(path, parts, header)
    schema = headers.schema(path, parts, header, notes)
    return records(path, parts, stream, first, schema, headers.promised(path, header), header, notes)


def records(
    path: Path, parts: dict[str, str], stream: Iterator[tuple[reading.Place, str]], first: int,
    schema: Sequence[Column | None], promised: int | None, header: dict, notes: Sequence[str] = (),
) -> Table:  # fmt: skip
    """Parse, check and order the records after a header; first : line of the first, notes : so far."""
    pieces: list[dict[str, np.ndarray]] = []
    numbers: list[int] = []
    bad: list[tuple[int, str]] = []
    lines: list[tuple[int, str]] = []
    total, unfinished, notes = 0, False, list(notes)

    def flush() -> None:
        if lines:
            piece, sound = _parse(lines, schema, bad)
            pieces.append(piece)
            numbers.extend(sound)
            lines.clear()

    for place, line in stream:
        if line.strip():
            if len(lines) >= CHUNK:
                flush()
            lines.append((place.line, line))
            total += 1
            unfinished = not line.endswith("\n")
    if unfinished and lines and _fault(lines[-1][1].split(), schema):
        number, _ = lines.pop()
        total -= 1
        notes.append(f"line {number} is cut short and was left out")
    flush()
    columns = {
        c.name: np.concatenate([p[c.name] for p in pieces]) if pieces else _empty(c) for c in schema if c is not None
    }
    if bad:
        where = "; ".join(f"line {n}: {why}" for n, why in bad[:5])
        if len(bad) > MOST_BAD * total:
            raise Level1Error(f"{path}, {where}: {len(bad)} of {total} records are bad, more than {MOST_BAD:.0%}.")
        notes.append(f"{len(bad)} bad record{'s' * (len(bad) > 1)} left out ({where})")
    if promised is not None and total != promised:
        if total < FEWEST * promised:
            raise Level1Error(
                f"{path}: {total} records of the {promised} that the header promises, fewer than {FEWEST:.0%}."
            )
        notes.append(f"{total} records, the header promises {promised}")
    if not total:
        raise Level1Error(f"{path}: no records after the header (line {first}).")
    letters = columns.get("GRACEFO_id", columns.get("GRACE_id"))
    foreign = np.zeros(0, bool) if letters is None or parts["satellite"] in "XY" else letters != parts["satellite"]
    if foreign.any():
        k = int(np.argmax(foreign))
        raise Level1Error(
            f"{path}, line {numbers[k]}: a record says satellite {letters[k]}, the file name {parts['satellite']}."
        )
    columns = _quaternions(_in_order(parts["product"], columns, notes), notes)
    for note in notes:
        warnings.warn(f"{path}: {note}.", Level1Warning, stacklevel=3)
    return Table(path, parts["product"], parts["satellite"], parts["date"], columns, tuple(notes), header)


def _empty(column: Column) -> np.ndarray:
    return np.empty(0, {"int": np.int64, "float": float}.get(column.kind, str))


def _parse(
    lines: list[tuple[int, str]], schema: Sequence[Column | None], bad: list[tuple[int, str]]
) -> tuple[dict[str, np.ndarray], list[int]]:
    """Columns and line numbers of a chunk: converted whole, or without the bad records."""
    try:
        return _convert([line for _, line in lines], schema), [number for number, _ in lines]
    except ValueError:
        pass
    good = {}
    for number, line in lines:
        line = _with_e(line, schema)
        fault = _fault(line.split(), schema) or ("" if line.isascii() else "it has a space that is not ASCII")
        if fault:
            bad.append((number, fault))
        else:
            good[number] = line
    return _convert(list(good.values()), schema), list(good)


def _with_e(line: str, schema: Sequence[Column | None]) -> str:
    """The line with 1.5D-03, as Fortran writes it, as 1.5E-03 in its columns of floats."""
    words = line.split()
    if len(words) != len(schema) or not line.isascii():
        return line
    for k, column in enumerate(schema):
        if column is not None and column.kind == "float" and reading.FORTRAN.fullmatch(words[k]):
            words[k] = words[k].upper().replace("D", "E")
    return " ".join(words)


def _convert(lines: list[str], schema: Sequence[Column | None]) -> dict[str, np.ndarray]:
    """Columns of sound records. Raises ValueError, without saying which, where one is not; `_fault` says why."""
    if not lines:
        return {c.name: _empty(c) for c in schema if c is not None}
    if not all(map(str.isascii, lines)):  # numpy takes some letters of other scripts for digits
        raise ValueError
    kinds = {"int": "i8", "float": "f8"}
    dtype = [(f"{k}", kinds.get(c.kind, f"U{LONGEST + 1}") if c else f"U{LONGEST + 1}") for k, c in enumerate(schema)]
    table = np.loadtxt(lines, dtype=dtype, comments=None, ndmin=1)
    if len(table) != len(lines):
        raise ValueError
    out = {}
    for k, column in enumerate(schema):
        if column is None:
            continue
        values = np.ascontiguousarray(table[f"{k}"])
        if column.fill and np.isin(values, column.fill).any():
            raise ValueError
        if column.factor != 1.0:
            values = values * column.factor
        if column.kind == "float" and not np.isfinite(values).all():
            raise ValueError
        if column.kind in ("text", "flags"):
            distinct = np.unique(values)
            if any(len(text) > LONGEST or (column.kind == "flags" and text.strip("01")) for text in distinct):
                raise ValueError
            values = values.astype(f"U{max(len(text) for text in distinct)}")
        elif ((values < column.low) | (values > column.high)).any():
            raise ValueError
        out[column.name] = values
    if "quatangle" in out and not (np.abs(_norm(out) - 1.0) <= NORM_REFUSED).all():
        raise ValueError
    return out


def _norm(columns: dict[str, np.ndarray]) -> np.ndarray:
    with np.errstate(over="ignore"):
        return np.sqrt(sum(columns[name] ** 2 for name in QUATERNION))


def _fault(row: list[str], schema: Sequence[Column | None]) -> str:
    """Why a record is bad, or an empty string."""
    if len(row) != len(schema):
        return f"{reading.counted(len(row), 'column')}, {len(schema)} are expected"
    for k, (column, text) in enumerate(zip(schema, row, strict=True), 1):
        if len(text) > LONGEST:
            return f"column {k} is {len(text)} characters long, {text[:30]!r}..."
        if not text.isascii():
            return f"column {k} is {text[:30]!r}, not ASCII"
        if column is None:
            continue
        form = FORMS.get(column.kind)
        found, shown = f"column {k} ({column.name}) is", text[:30]
        if form and not form.match(text):
            return f"{found} {shown!r}, not {'an integer' if column.kind == 'int' else 'a number'}"
        if column.kind == "flags" and text.strip("01"):
            return f"{found} {shown!r}, not a string of 0 and 1"
        if form is None:
            continue
        value = int(text) if column.kind == "int" else float(text)
        if column.kind == "int" and not -(2**63) <= value < 2**63:
            return f"{found} {shown}, no 64-bit integer"
        if not np.isfinite(value * column.factor):
            return f"{found} {shown}"
        if value in column.fill:
            return f"{found} {shown}, which marks a missing value"
        if not column.low <= value * column.factor <= column.high:
            return f"{found} {shown}, outside {column.low:.10g} to {column.high:.10g}"
    if not any(c is not None and c.name == "quatangle" for c in schema):
        return ""
    named = {c.name: np.float64(text) for c, text in zip(schema, row, strict=True) if c and c.name in QUATERNION}
    norm = float(_norm(named))
    return "" if abs(norm - 1.0) <= NORM_REFUSED else f"the quaternion has the norm {norm:g}"


def _in_order(product: str, columns: dict[str, np.ndarray], notes: list[str]) -> dict[str, np.ndarray]:
    """Records by increasing time; of records with the same keys the first stays."""
    keys = KEYS.get(product)
    if keys is None or len(columns[keys[0]]) < 2:
        return columns
    series = [columns[key] for key in keys]
    order = np.lexsort(series[::-1])
    if (order != np.arange(len(order))).any():
        back = int((np.diff(series[0]) < 0).sum())
        if back:
            notes.append(f"time runs backwards at {back} place{'s' * (back > 1)}; the records were sorted")
    columns = {name: values[order] for name, values in columns.items()}
    same = np.ones(len(order) - 1, bool)
    for key in keys:
        same &= columns[key][1:] == columns[key][:-1]
    if same.any():
        count = int(same.sum())
        notes.append(f"{count} duplicate time tag{'s' * (count > 1)}; the first record of each was kept")
        keep = np.concatenate([[True], ~same])
        columns = {name: values[keep] for name, values in columns.items()}
    return columns


def _quaternions(columns: dict[str, np.ndarray], notes: list[str]) -> dict[str, np.ndarray]:
    """Normalise quaternions whose norm is off by 1e-9 to 1e-3."""
    if "quatangle" not in columns or not len(columns["quatangle"]):
        return columns
    norm = _norm(columns)
    off = np.abs(norm - 1.0) > NORM_EXACT
    if off.any():
        count, most = int(off.sum()), np.abs(norm - 1).max()
        notes.append(f"{count} quaternion{'s' * (count > 1)} with a norm off by up to {most:.1e} normalised")
        for name in QUATERNION:
            columns[name] = np.where(off, columns[name] / norm, columns[name])
    return columns
