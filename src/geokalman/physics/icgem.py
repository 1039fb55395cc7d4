"""Gravity field models in the ICGEM format (`.gfc`): a complete reader and a writer.

Format: Barthelmes & Foerste (2011), "The ICGEM-format", GFZ Potsdam, and its extension `icgem2.0` with several time
intervals per coefficient.
"""

from __future__ import annotations

import datetime
import gzip
import math
import os
import re
import tempfile
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from geokalman.physics.field import TIDE_SYSTEMS, Array, GravityField

_TIME_COLUMNS = {  # after C, S and errors: key -> columns in icgem1.0, icgem2.0 (t0, t1, period)
    "gfc": (0, 0),
    "gfct": (1, 2),
    "trnd": (0, 2),
    "dot": (0, 2),
    "acos": (1, 3),
    "asin": (1, 3),
}
_ERROR_COLUMNS = {"no": 0, "calibrated": 2, "formal": 2, "calibrated_and_formal": 4}
_NORMS = ("fully_normalized", "unnormalized")
_UNNORMALISED_LIMIT = 150  # above, (2n)! leaves the range of float64
_NO_EXPONENT_LETTER = re.compile(r"([+-]?\d*\.?\d*)([+-]\d{3})$")  # Fortran drops the letter of a 3-digit exponent


class GfcError(ValueError):
    """A `.gfc` file that is not what it claims to be; the message names file, line and what would be right."""


class _Line(NamedTuple):
    path: Path
    number: int

    def error(self, text: str) -> GfcError:
        return GfcError(f"{self.path}, line {self.number}: {text}")


@dataclass(frozen=True)
class _Header:
    name: str
    gm: float
    radius: float
    n_max: int
    errors: int | None  # columns of standard deviations; None where the header does not say
    unnormalised: bool
    tide_system: str
    version: int  # 0: icgem1.0, 1: icgem2.0


class _Term(NamedTuple):
    """One time-dependent data line."""

    key: str
    C: float
    S: float
    sigma: list[float]
    begin: datetime.datetime | None
    end: datetime.datetime | None
    period: float  # years
    where: _Line


def read_gfc(path: str | os.PathLike, epoch: datetime.date | None = None) -> GravityField:
    """Read a gravity field model in ICGEM format, plain or gzipped.

    Time-variable coefficients (`gfct`) are taken at their reference epoch t0, without trend and periodic terms; with
    `epoch` they are C(t) = C(t0) + trnd dt + sum_k [acos_k cos(2 pi dt / T_k) + asin_k sin(2 pi dt / T_k)], dt and T_k
    in years of 365.25 d. A coefficient with several intervals (icgem2.0) needs `epoch`. Absent C_00 is 1, absent
    degree 1 is zero; every other coefficient up to `max_degree` must be there. Unnormalised coefficients are
    normalised (up to degree 150). Of calibrated and formal errors the calibrated ones are kept. S_n0, which multiplies
    sin 0, is read as zero.

    Parameters
    ----------
    path : path of the file (`.gfc` or `.gfc.gz`).
    epoch : date at which a time-variable field is wanted.

    Returns
    -------
    GravityField

    Raises
    ------
    FileNotFoundError
        No such file.
    GfcError
        One sentence with file, line, value and what would be right.
    """
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"No gravity field at {path}; give the path of an ICGEM .gfc file.")
    lines = _lines(path)
    head = _read_header(path, lines)
    size = head.n_max + 1
    C, S = np.zeros((size, size)), np.zeros((size, size))
    sigma = np.zeros((2, size, size))
    has_sigma = False
    seen: dict[tuple[int, int], int] = {}
    terms: dict[tuple[int, int], list[_Term]] = {}
    for where, line in lines:
        words = line.split()
        if not words:
            continue
        key, n, m, numbers, times = _split_row(words, head, where)
        if key == "gfc":
            if (n, m) in seen:
                raise where.error(f"coefficient ({n}, {m}) occurs twice, first in line {seen[n, m]}.")
            seen[n, m] = where.number
            C[n, m], S[n, m] = numbers[0], numbers[1]
            if len(numbers) > 2:
                has_sigma = True
                sigma[:, n, m] = numbers[2:4]
        else:
            terms.setdefault((n, m), []).append(_time_term(key, numbers, times, head, where))
    for (n, m), group in terms.items():
        where = group[0].where
        if (n, m) in seen:
            raise where.error(f"coefficient ({n}, {m}) occurs twice, first in line {seen[n, m]}.")
        seen[n, m] = where.number
        C[n, m], S[n, m], errors = _at_epoch(group, epoch, (n, m))
        if errors:
            has_sigma = True
            sigma[:, n, m] = errors[:2]
    _require_complete(path, head.n_max, seen)
    C[0, 0] = C[0, 0] if (0, 0) in seen else 1.0
    S[:, 0] = 0.0  # it multiplies sin 0; some files carry rounding there
    if head.unnormalised:
        factor = _normalisation(path, head.n_max)
        C, S, sigma = C / factor, S / factor, sigma / factor
    try:
        return GravityField(
            name=head.name,
            gm=head.gm,
            radius=head.radius,
            C=C,
            S=S,
            tide_system=head.tide_system,
            sigma_C=sigma[0] if has_sigma else None,
            sigma_S=sigma[1] if has_sigma else None,
        )
    except ValueError as error:
        raise GfcError(f"{path}: {error}") from None


def write_gfc(field: GravityField, path: str | os.PathLike) -> Path:
    """Write a field in ICGEM format, exactly (17 digits) and atomically; a path ending in `.gz` is gzipped."""
    path = Path(path)
    errors = field.sigma_C is not None
    rows = [
        "product_type                gravity_field",
        f"modelname                   {'_'.join(field.name.split())}",
        f"earth_gravity_constant      {field.gm!r}",
        f"radius                      {field.radius!r}",
        f"max_degree                  {field.n_max}",
        f"errors                      {'formal' if errors else 'no'}",
        "norm                        fully_normalized",
        f"tide_system                 {field.tide_system}",
        "",
        "key    L    M    C    S" + ("    sigma C    sigma S" if errors else ""),
        "end_of_head " + 60 * "=",
    ]
    for n in range(field.n_max + 1):
        for m in range(n + 1):
            columns = [field.C[n, m], field.S[n, m]] + ([field.sigma_C[n, m], field.sigma_S[n, m]] if errors else [])
            rows.append(f"gfc {n:5d}{m:5d} " + " ".join(f"{value: .16e}" for value in columns))
    data = ("\n".join(rows) + "\n").encode()
    if path.suffix == ".gz":
        data = gzip.compress(data, mtime=0)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=path.name, suffix=".part")
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(data)
        os.replace(temporary, path)
    except BaseException:
        os.unlink(temporary)
        raise
    return path


def _lines(path: Path) -> Iterator[tuple[_Line, str]]:
    opened = gzip.open if path.suffix == ".gz" else open
    number = 0
    try:
        with opened(path, "rt", encoding="utf-8", errors="replace") as stream:
            for number, line in enumerate(stream, start=1):
                yield _Line(path, number), line
    except (EOFError, gzip.BadGzipFile, zlib.error) as error:
        raise GfcError(f"{path}, after line {number}: the gzip stream is damaged or truncated ({error}).") from None


def _read_header(path: Path, lines: Iterator[tuple[_Line, str]]) -> _Header:
    found: dict[str, tuple[str, _Line]] = {}
    for where, line in lines:
        words = line.split()
        if not words:
            continue
        if words[0] == "begin_of_head":
            found.clear()
        elif words[0].startswith("end_of_head"):
            break
        elif len(words) > 1:
            key = words[0].lower()
            found.setdefault("gravity_constant" if key == "earth_gravity_constant" else key, (words[1], where))
    else:
        raise GfcError(f"{path}: no line 'end_of_head'; this is no ICGEM file, or it is truncated.")

    def wanted(key: str, meaning: str) -> float:
        if key not in found:
            raise GfcError(f"{path}: the header lacks {meaning}.")
        text, where = found[key]
        value = _number(text, where)
        if value <= 0:
            raise where.error(f"{key} = {text} must be positive.")
        return value

    def choice(key: str, allowed: tuple[str, ...], default: str) -> str:
        text, where = found.get(key, (default, None))
        if text.lower() not in allowed and where is not None:
            raise where.error(f"{key} '{text}' is unknown; known are {', '.join(allowed)}.")
        return text.lower()

    choice("product_type", ("gravity_field",), "gravity_field")
    n_max = wanted("max_degree", "the line 'max_degree'")
    if n_max != int(n_max) or n_max < 2:
        raise found["max_degree"][1].error(f"max_degree = {found['max_degree'][0]} must be an integer of at least 2.")
    errors = choice("errors", tuple(_ERROR_COLUMNS), "unstated")
    return _Header(
        name=found["modelname"][0] if "modelname" in found else path.name.split(".")[0],
        gm=wanted("gravity_constant", "GM (a line 'earth_gravity_constant' or 'gravity_constant')"),
        radius=wanted("radius", "the reference radius (a line 'radius')"),
        n_max=int(n_max),
        errors=_ERROR_COLUMNS.get(errors),
        unnormalised=choice("norm", _NORMS, _NORMS[0]) == "unnormalized",
        tide_system=_tide_system(found["tide_system"][0] if "tide_system" in found else "unknown"),
        version=1 if found.get("format", ("icgem1.0", None))[0].lower().startswith("icgem2") else 0,
    )


def _tide_system(text: str) -> str:
    """The tide system as files in circulation spell it: `tide_free`, `zero`, `Zero-Tide`, ..."""
    spoken = (system for system in TIDE_SYSTEMS[:3] if system.replace("_", "").replace("tide", "") in text.lower())
    return next(spoken, "unknown")


def _split_row(words: list[str], head: _Header, where: _Line) -> tuple[str, int, int, list[float], list[str]]:
    """Key, degree, order, numbers (C, S and errors) and time columns of a data line."""
    key = words[0]
    if key not in _TIME_COLUMNS:
        raise where.error(f"'{key}' begins no data line; they begin with {', '.join(_TIME_COLUMNS)}.")
    n_times = _TIME_COLUMNS[key][head.version]
    errors = head.errors if head.errors is not None else (2 if len(words) - n_times >= 7 else 0)
    needed = 5 + errors + n_times
    if len(words) < needed:
        raise where.error(
            f"{len(words)} columns where {needed} are needed (key, degree, order, C, S, {errors} errors, {n_times} "
            "of time); is the file truncated?"
        )
    try:
        n, m = int(words[1]), int(words[2])
    except ValueError:
        raise where.error(f"degree and order '{words[1]} {words[2]}' must be integers.") from None
    if not 0 <= m <= n:
        raise where.error(f"degree {n} and order {m} must satisfy 0 <= order <= degree.")
    if n > head.n_max:
        raise where.error(f"degree {n} exceeds the header's max_degree {head.n_max}.")
    numbers = [_number(word, where) for word in words[3 : 5 + errors]]
    return key, n, m, numbers, words[needed - n_times : needed]


def _number(text: str, where: _Line) -> float:
    """A float as C or Fortran write it: 1.5e-3, 1.5D-03, 1.5-103."""
    try:
        value = float(text)
    except ValueError:
        letter = text.replace("D", "e").replace("d", "e")
        split = _NO_EXPONENT_LETTER.match(letter)
        try:
            value = float(f"{split[1]}e{split[2]}" if split else letter)
        except ValueError:
            raise where.error(f"'{text}' is not a number.") from None
    if not math.isfinite(value):
        raise where.error(f"'{text}' is not finite.")
    return value


def _time_term(key: str, numbers: list[float], times: list[str], head: _Header, where: _Line) -> _Term:
    dates = [_date(text, where) for text in times[: 1 if key == "gfct" and not head.version else 2 * head.version]]
    period = _number(times[-1], where) if key in ("acos", "asin") else math.inf
    if period <= 0:
        raise where.error(f"period {times[-1]} must be positive (years).")
    begin, end = (dates + [None, None])[:2]
    return _Term("trnd" if key == "dot" else key, numbers[0], numbers[1], numbers[2:], begin, end, period, where)


def _date(text: str, where: _Line) -> datetime.datetime:
    day, _, clock = text.partition(".")
    try:
        return datetime.datetime.strptime(day + clock.ljust(4, "0")[:4], "%Y%m%d%H%M")
    except ValueError:
        raise where.error(f"'{text}' is no date of the form yyyymmdd or yyyymmdd.hhmm.") from None


def _at_epoch(group: list[_Term], epoch: datetime.date | None, nm: tuple[int, int]) -> tuple[float, float, list[float]]:
    """Value and errors of one time-variable coefficient."""
    first = group[0].where
    time = None
    if epoch is not None:
        time = epoch if isinstance(epoch, datetime.datetime) else datetime.datetime(epoch.year, epoch.month, epoch.day)
        time = time.replace(tzinfo=None)
        group = [t for t in group if (t.end is None or t.begin <= time < t.end)]
    base = [t for t in group if t.key == "gfct"]
    if not base:
        asked = f"covers {epoch}" if epoch is not None else "gives its value"
        raise first.error(f"coefficient {nm} is time-variable, but no gfct line {asked}.")
    if len(base) > 1:
        cure = "give one epoch" if time is None and base[0].end is not None else "one is right"
        raise base[1].where.error(f"coefficient {nm} has {len(base)} gfct lines, first in line {first.number}; {cure}.")
    C, S = base[0].C, base[0].S
    if time is not None:
        years = (time - base[0].begin).total_seconds() / (365.25 * 86400.0)
        for term in group:
            if term.key == "gfct":
                continue
            angle = 2.0 * math.pi * years / term.period
            factor = {"trnd": years, "acos": math.cos(angle), "asin": math.sin(angle)}[term.key]
            C, S = C + factor * term.C, S + factor * term.S
    return C, S, base[0].sigma


def _require_complete(path: Path, n_max: int, seen: dict[tuple[int, int], int]) -> None:
    missing = [(n, m) for n in range(2, n_max + 1) for m in range(n + 1) if (n, m) not in seen]
    if missing:
        listed = ", ".join(map(str, missing[:5])) + (", ..." if len(missing) > 5 else "")
        raise GfcError(
            f"{path}: {len(missing)} coefficients up to its max_degree {n_max} are missing, (degree, order) = {listed}"
            "; the file is truncated or its max_degree is wrong."
        )


def _normalisation(path: Path, n_max: int) -> Array:
    """Factor N_nm of P-bar_nm = N_nm P_nm: C-bar = C / N, N_nm^2 = (2 - delta_0m)(2n+1)(n-m)!/(n+m)!."""
    if n_max > _UNNORMALISED_LIMIT:
        raise GfcError(
            f"{path}: unnormalised coefficients to degree {n_max} leave the range of float64; "
            f"at most {_UNNORMALISED_LIMIT} can be normalised."
        )
    factor = np.ones((n_max + 1, n_max + 1))
    for n in range(n_max + 1):
        factor[n, 0] = math.sqrt(2 * n + 1)
        for m in range(1, n + 1):
            step = (2.0 if m == 1 else 1.0) / ((n + m) * (n - m + 1))
            factor[n, m] = factor[n, m - 1] * math.sqrt(step)
    return factor
