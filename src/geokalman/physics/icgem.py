"""Gravity field models in the ICGEM format (`.gfc`): a complete reader and a writer.

Format: Barthelmes & Foerste (2011), "The ICGEM-format", GFZ Potsdam, and its extension `icgem2.0` with several time
intervals per coefficient.
"""

from __future__ import annotations

import array
import datetime
import gzip
import math
import os
import re
import tempfile
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from geokalman.physics.field import BODIES, Array, Body, GravityField, misfit
from geokalman.physics.icgem_epoch import TIME_COLUMNS, Term, at_epoch, instant, term
from geokalman.physics.icgem_header import GfcError, Header, read_header
from geokalman.reading import Place, counted, lines

__all__ = ["GfcError", "GfcWarning", "read_gfc", "write_gfc"]

GEOCENTRE = 0.1
"""Largest distance [m] of the centre of mass from the origin that is left out with a warning."""
_UNNORMALISED_LIMIT = 150  # above, (2n)! leaves the range of float64
_DENSITIES = (100.0, 50e3)  # kg/m^3; Saturn has 687, the Earth 5514, and a reference radius need not be the mean one
_PLANETS = (*(b.gm for b in BODIES), 2.2032e13, 3.24859e14, 1.26687e17, 3.7931e16, 5.794e15, 6.8365e15)  # m^3/s^2
_BROKEN_EXPONENT = re.compile(r"[\d.][eEdD]?[+-]$|[\d.][eEdD]$")
_COLUMNS = 7  # of the table of coefficients: line, degree, order, C, S and their standard deviations


class GfcWarning(UserWarning):
    """Something in a `.gfc` file is left out; the message says what."""


def read_gfc(path: str | os.PathLike, epoch: datetime.date | None = None, body: Body | None = None) -> GravityField:
    """Read a gravity field model in ICGEM format, plain or compressed.

    Time-variable coefficients (`gfct`) are taken at their reference epoch t0, without trend and periodic terms; with
    `epoch` they are C(t) = C(t0) + trnd dt + sum_k [acos_k cos(2 pi dt / T_k) + asin_k sin(2 pi dt / T_k)], dt and T_k
    in years of 365.25 d. A coefficient with several intervals (icgem2.0) needs `epoch`. Absent C_00 is 1, absent
    degree 1 is zero; every other coefficient up to `max_degree` must be there. A degree 1 that puts the centre of mass
    within `GEOCENTRE` of the origin is left out with a GfcWarning. Unnormalised coefficients are normalised (up to
    degree 150). Of calibrated and formal errors the calibrated ones are kept. S_n0, which multiplies sin 0, is read as
    zero. GM and radius are in m^3 s^-2 and m unless the header says km.

    Parameters
    ----------
    path : path of the file (`.gfc`; gzip, xz and bzip2 are recognised by the first bytes).
    epoch : date at which a time-variable field is wanted; without a time zone in UTC.
    body : whose field it must be; None for that of any planet or moon.

    Returns
    -------
    GravityField

    Raises
    ------
    FileNotFoundError
        No such file.
    GfcError
        One sentence with file, line, value and what would be right: a damaged file, a keyword that is unknown, a
        coefficient that is missing or doubled, values that no planet or moon has, or those of another than `body`.
    """
    path, time = Path(path), instant(epoch)
    stream = lines(path, "gravity field", GfcError, keep_ends=True)
    head = read_header(path, stream)
    rows, terms = _read_rows(head, stream)
    for nm, group in terms.items():
        _append(rows, group[0].place, nm, at_epoch(group, time, nm))
    table = np.array(rows).reshape(-1, _COLUMNS)
    line, n, m = table[:, :3].astype(np.int64).T
    _require_complete(path, head.n_max, n, m, line)
    C, S = np.zeros((2, head.n_max + 1, head.n_max + 1))
    C[0, 0] = 1.0  # absent C_00 is 1, absent degree 1 is zero
    C[n, m], S[n, m] = table[:, 3], np.where(m == 0, 0.0, table[:, 4])  # S_n0 multiplies sin 0; some carry rounding
    sigma = None
    if not np.isnan(table[:, 5]).all():
        sigma = np.zeros((2, *C.shape))
        sigma[:, n, m] = np.nan_to_num(table[:, 5:]).T
    if head.unnormalised:
        factor = _normalisation(path, head.n_max)
        C, S, sigma = C / factor, S / factor, None if sigma is None else sigma / factor

    def place(n_: int, m_: int) -> Place:
        return Place(path, int(line[(n == n_) & (m == m_)][0]), GfcError)

    _require_physical(head, C, S, place)
    if body is not None and (found := misfit(head.gm, head.radius, C[2, 0], body)):
        raise head.places.get(found.what, place(2, 0)).error(found.sentence)
    _leave_out_degree_one(path, head.radius, C, S)
    try:
        return GravityField(
            head.name, head.gm, head.radius, C, S, head.tide_system, *(sigma if sigma is not None else ())
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


def _read_rows(
    head: Header, stream: Iterator[tuple[Place, str]]
) -> tuple[array.array, dict[tuple[int, int], list[Term]]]:
    """The static coefficients as rows of a table, and the terms of the time-variable ones."""
    rows = array.array("d")
    terms: dict[tuple[int, int], list[Term]] = {}
    shortest, fewest = 0, 0
    for place, line in stream:
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        length = len(line.rstrip())
        if not line.endswith("\n") and (length < shortest or len(words) < fewest or _BROKEN_EXPONENT.search(words[-1])):
            raise place.error(f"the file ends within this line, after '{words[-1]}': it is truncated; fetch it again.")
        shortest, fewest = min(shortest or length, length), min(fewest or len(words), len(words))
        key, n, m, numbers, times = _split_row(words, head, place)
        if key == "gfc":
            _append(rows, place, (n, m), (numbers[0], numbers[1], numbers[2:]))
        else:
            terms.setdefault((n, m), []).append(term(key, numbers, times, head.version, place))
    return rows, terms


def _append(rows: array.array, place: Place, nm: tuple[int, int], value: tuple[float, float, list[float]]) -> None:
    sigma = value[2][:2] or (math.nan, math.nan)  # calibrated errors stand before formal ones
    if sigma[0] < 0 or sigma[1] < 0:
        raise place.error(f"standard deviations {sigma[0]} and {sigma[1]} of coefficient {nm} must not be negative.")
    rows.extend((place.line, *nm, *value[:2], *sigma))


def _split_row(words: list[str], head: Header, place: Place) -> tuple[str, int, int, list[float], list[str]]:
    """Key, degree, order, numbers (C, S and errors) and time columns of a data line."""
    key = words[0].lower()
    if key not in TIME_COLUMNS:
        raise place.error(f"'{words[0]}' begins no data line; they begin with {', '.join(TIME_COLUMNS)}.")
    n_times = TIME_COLUMNS[key][head.version]
    errors = head.errors if head.errors is not None else (2 if len(words) - n_times >= 7 else 0)
    if len(words) == 5 + n_times and key not in ("gfc", "gfct"):
        errors = 0  # those of a rate are not needed
    needed = 5 + errors + n_times
    columns = f"(key, degree, order, C, S, {errors} errors, {n_times} of time)"
    if len(words) < needed:
        found = counted(len(words), "column")
        raise place.error(f"{found} where {needed} are needed {columns}; is the file truncated?")
    if key != "gfc" and len(words) > needed and words[needed][0].isdigit():
        cure = "" if head.version else "; with two dates the header says 'format icgem2.0'"
        raise place.error(f"{counted(len(words), 'column')} where {needed} are right {columns}{cure}.")
    try:
        n, m = int(words[1]), int(words[2])
    except ValueError:
        raise place.error(f"degree and order '{words[1]} {words[2]}' must be integers.") from None
    if not 0 <= m <= n:
        raise place.error(f"degree {n} and order {m} must satisfy 0 <= order <= degree.")
    if n > head.n_max:
        raise place.error(f"degree {n} exceeds the header's max_degree {head.n_max}.")
    return key, n, m, [place.number(word) for word in words[3 : 5 + errors]], words[needed - n_times : needed]


def _require_complete(path: Path, n_max: int, n: Array, m: Array, line: Array) -> None:
    """Raise GfcError for a coefficient given twice, and for those up to the max_degree that are missing."""
    index = n * (n + 1) // 2 + m
    order = np.argsort(index, kind="stable")
    index = index[order]
    if (twice := np.flatnonzero(index[1:] == index[:-1])).size:
        first, second = np.sort(line[order[twice[0] : twice[0] + 2]])
        nm = tuple(int(column[order[twice[0]]]) for column in (n, m))
        raise Place(path, int(second), GfcError).error(f"coefficient {nm} occurs twice, first in line {first}.")
    known = index[index >= 3]
    missing = (n_max + 1) * (n_max + 2) // 2 - 3 - known.size
    if missing:
        gaps = [int(k) for k in np.setdiff1d(np.arange(3, known.size + 8), known)[: min(missing, 5)]]
        degrees = [(math.isqrt(8 * k + 1) - 1) // 2 for k in gaps]
        listed = ", ".join(str((n, k - n * (n + 1) // 2)) for n, k in zip(degrees, gaps, strict=True))
        raise GfcError(
            f"{path}: up to its max_degree {n_max} the file lacks {counted(missing, 'coefficient')}, "
            f"(degree, order) = {listed}{', ...' if missing > 5 else ''}; it is truncated or its max_degree is wrong."
        )


def _require_physical(head: Header, C: Array, S: Array, place: Callable[[int, int], Place]) -> None:
    """Raise GfcError for GM, radius and coefficients that no planet or moon has; `place` is that of a coefficient."""
    density = 3.0 / (4.0 * math.pi * 6.6743e-11) * head.gm / head.radius / head.radius / head.radius
    given = f"GM = {head.gm:.10g} m^3/s^2 and radius = {head.radius:.10g} m"
    if not _DENSITIES[0] < density < _DENSITIES[1]:
        lengths = {"radius": 1e9, "gravity_constant": 1e-9}  # what the density would be divided by, were one in km
        key = next((k for k, f in lengths.items() if _DENSITIES[0] < density / f < _DENSITIES[1]), "radius")
        raise head.places[key].error(
            f"{given} give the density {density:.3g} kg/m^3, which no body has; a value in km needs its unit."
        )
    if any(abs(1e9 * head.gm / gm - 1.0) < 0.01 for gm in _PLANETS):
        raise head.places["gravity_constant"].error(
            f"{given} are those of a planet in km^3/s^2 and km; give metres, or the unit behind each value."
        )
    if C[0, 0] == 0.0:
        raise place(0, 0).error(
            "C_00 is 0: this is a difference of fields or a correction, and a field is needed (C_00 = 1)."
        )
    body = next((body for body in BODIES if abs(head.gm / body.gm - 1.0) < 0.01), None)
    size = np.maximum(np.abs(C), np.abs(S))
    size[:2] = 0.0
    n, m = (int(i) for i in np.unravel_index(np.argmax(size), size.shape))
    if body is None:
        if size[n, m] >= 1.0:
            raise place(n, m).error(f"coefficient ({n}, {m}) = {C[n, m]:g}, {S[n, m]:g} is that of no body.")
        return
    rule = f"of {body.name} none exceeds its C20, {body.C20:g} fully normalised"
    if not head.unnormalised and abs(C[2, 0] / body.C20 / math.sqrt(5.0) - 1.0) < 0.02:
        rule += f"; {C[2, 0]:g} is unnormalised, of which the header says 'norm unnormalized'"
    if size[n, m] > 1.05 * abs(body.C20):
        raise place(n, m).error(f"coefficient ({n}, {m}) = {C[n, m]:g}, {S[n, m]:g}: {rule}.")
    if C[2, 0] / body.C20 < -0.05:
        raise place(2, 0).error(f"C20 = {C[2, 0]:g} has the wrong sign: that of {body.name} is {body.C20:g}.")


def _leave_out_degree_one(path: Path, radius: float, C: Array, S: Array) -> None:
    """Zero degree 1: the centre of mass is at sqrt(3) R (C11, S11, C10), and fields refer to it."""
    terms = f"degree 1 (C10 = {C[1, 0]:g}, C11 = {C[1, 1]:g}, S11 = {S[1, 1]:g}) puts the centre of mass"
    offset = math.sqrt(3.0) * radius * math.hypot(C[1, 0], C[1, 1], S[1, 1])
    if offset > GEOCENTRE:
        raise GfcError(f"{path}: {terms} {offset:.3g} m from the origin; at most {GEOCENTRE} m is left out.")
    if offset:
        C[1], S[1] = 0.0, 0.0
        warnings.warn(
            f"{path}: {terms} {1e3 * offset:.2g} mm from the origin; it is left out.", GfcWarning, stacklevel=3
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
