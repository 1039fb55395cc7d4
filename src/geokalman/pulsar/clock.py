"""Read what the times of a FITS table mean: unit, scale, reference, offset, and place.

Sources: OGIP/93-003, sections 4.2 to 4.4; FITS Standard 4.0, section 9.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from geokalman.physics.timescales import MJD_ZERO, TT_MINUS_TAI, parse_utc
from geokalman.pulsar.fits import Header, Table
from geokalman.pulsar.model import Array

_UNITS = {
    unit: seconds
    for seconds, units in {
        1.0: "s sec secs second seconds", 86400.0: "d day days", 3600.0: "h hr hour hours", 60.0: "min minute minutes",
        1e-3: "ms", 1e-6: "us", 1e-9: "ns",
    }.items() for unit in units.split()
}  # fmt: skip
_SCALES = {
    "TT": 0.0, "TDT": 0.0, "ET": 0.0, "TDB": 0.0, "TAI": TT_MINUS_TAI, "IAT": TT_MINUS_TAI, "GPS": TT_MINUS_TAI + 19.0,
}  # fmt: skip
_PLACES = {"LOCAL": "LOCAL", "TOPOCENT": "LOCAL", "SOLARSYS": "SOLARSYSTEM", "BARYCENT": "SOLARSYSTEM"}
_REFERENCES = ("MJDREF", "MJDREFI", "JDREF", "JDREFI", "DATEREF")
_FIRST_MJD, _LAST_MJD = 36934.0, 88069.0  # 1960 to 2100
_COARSE = 1e-3  # [s]: steps of time that matter to a pulsar


class Times(NamedTuple):
    """Times t + zero [s] since the Julian date jd (TT or TDB); t as the column has them."""

    t: Array
    zero: float
    jd: float


def times(table: Table, column: str) -> Times:
    """Read times of a column, in its unit, time scale and reference.

    TUNIT (else TIMEUNIT, else s) is the unit, TIMEUNIT that of TIMEZERO; MJDREF, MJDREFI + MJDREFF or their
    counterparts in Julian dates, or DATEREF the reference; TIMEZERO or TIMEZERI + TIMEZERF (else 0) is added; TAI and
    GPS are turned into TT. A keyword that the table lacks may be in the first header of the file.
    Raises FitsError where these contradict one another, for another time scale or unit, and for a time that is null,
    not finite, too coarse, or not between 1960 and 2100.
    """
    header = table.header
    t = table.finite(column)
    if t.ndim != 1:
        raise header.error(f"column {column} holds {t.shape[1]} numbers in a row; one time is needed.")
    unit = _unit(table, f"TUNIT{table.columns.field(column).number}", "TIMEUNIT")
    if t.dtype == np.float32 and t.size and (step := unit * float(np.spacing(np.abs(t).max()))) > _COARSE:
        raise header.error(f"column {column} is of single precision, in steps of {step:g} s; TFORM D is needed.")
    jd, zero = _reference(table), _offset(table) + _scale(table)
    t = t * unit
    mjd = jd - MJD_ZERO + (t + zero) / 86400.0
    if (wrong := np.flatnonzero((mjd < _FIRST_MJD) | (mjd > _LAST_MJD))).size:
        raise header.error(
            f"column {column} has {t[wrong[0]] / unit:.9g} in row {wrong[0] + 1}, which is MJD {mjd[wrong[0]]:.6g}, "
            "not between 1960 and 2100; check MJDREF, TIMEUNIT and TUNIT."
        )
    return Times(t, zero, jd)


def refuse_strays(table: Table, column: str, t: Array, order: Array) -> None:
    """Refuse times that mean none, and a few that stand years away from all others.

    t (n,) [s] as in the column, ascending; order : its rows. Raises FitsError for the latter, and for zero or negative
    times where half are a day or more.
    """
    if t[0] <= 0.0 and t[len(t) // 2] > 86400.0:
        raise table.header.error(f"column {column} has {t[0]:g} s in row {order[0] + 1}, a null value; leave it out.")
    edge = max(1, len(t) // 100)
    if len(t) < 5:
        return
    low, high = t[edge], t[-1 - edge]
    for k, away in ((0, low - t[0]), (-1, t[-1] - high)):
        if away > 3e7 + 100.0 * (high - low):
            raise table.header.error(
                f"column {column} is {away / 86400.0:.3g} d away from all others in row {order[k] + 1}; leave it out."
            )


def moments(table: Table, *keys: str) -> Array:
    """Read times of keywords (n,), as TSTART, in seconds since the date of `times` + offset."""
    t = np.array([table.header.number(key) for key in keys]) * _unit(table, "TIMEUNIT")
    return t + (_offset(table) + _scale(table))


def middle(table: Table) -> float:
    """Give the seconds from the time of an event to the middle of its step, else 0.

    (1/2 - TIMEPIXR) TIMEDEL where steps are longer than a millisecond (frames of a camera).
    """
    header = table.header
    step, part = header.number("TIMEDEL", 0.0) * _unit(table, "TIMEUNIT"), header.number("TIMEPIXR", 0.5)
    if step < 0.0 or not 0.0 <= part <= 1.0:
        raise header.error(f"TIMEDEL = {step:g} s, TIMEPIXR = {part:g}; a positive step, a part of 0 to 1 are right.")
    return (0.5 - part) * step if step > _COARSE else 0.0


def place(table: Table) -> str:
    """Tell where times were taken: LOCAL (the satellite), SOLARSYSTEM (the barycentre), or "".

    Raises FitsError for another place in TIMEREF or TREFPOS, and where the two differ.
    """
    found = {}
    for key in ("TIMEREF", "TREFPOS"):
        if name := _home(table, key).text(key):
            if name[:8] not in _PLACES and name != "LOCAL":
                raise table.header.error(
                    f"{key} = {name}; LOCAL (at the satellite) or SOLARSYSTEM (at the barycentre) is needed."
                )
            found[_PLACES[name[:8]]] = f"{key} = {name}"
    if len(found) > 1:
        raise table.header.error(f"{' contradicts '.join(found.values())}.")
    return next(iter(found), "")


def _home(table: Table, *keys: str) -> Header:
    """Find the header with one of the keywords: the table's own, else the first of the file."""
    own = any(table.header.value(key) is not None for key in keys)
    return table.header if own or not any(key in table.primary for key in keys) else table.primary


def _unit(table: Table, *keys: str) -> float:
    """Give seconds in the unit of the keywords, s where none names one; FitsError on dispute."""
    units = {key: unit for key in keys if (unit := _home(table, key).text(key).lower())}
    for key, unit in units.items():
        if unit not in _UNITS:
            raise table.header.error(f"{key} = {unit}; a unit of time (s, d, h, min, ms, us, ns) is needed.")
    seconds = {_UNITS[unit] for unit in units.values()}
    if len(seconds) > 1:
        raise table.header.error(f"{' contradicts '.join(f'{k} = {v}' for k, v in units.items())}; correct one.")
    return seconds.pop() if seconds else 1.0


def _scale(table: Table) -> float:
    """Give TT (or TDB) minus the time scale of a table [s]."""
    name = _home(table, "TIMESYS").text("TIMESYS")
    if not name:
        table.header.warn("the header lacks TIMESYS, the time scale; TT is taken.")
    scale = name.partition("(")[0].strip() or "TT"
    if scale not in _SCALES:
        raise table.header.error(f"TIMESYS = {name}; {', '.join(_SCALES)} are known, convert the times to TT.")
    return _SCALES[scale]


def has_reference(header: Header) -> bool:
    """Tell whether a header says what its times count from."""
    return any(header.value(key) is not None for key in _REFERENCES)


def _reference(table: Table) -> float:
    """Give the Julian date that the times count from."""
    for name, zero in (("MJDREF", MJD_ZERO), ("JDREF", 0.0)):
        pair = (f"{name}I", f"{name}F")
        header = _home(table, name, *pair)
        parts = [header.number(key) for key in pair if header.value(key) is not None]
        if len(parts) == 2:
            whole = sum(parts)
            if not 0.0 <= parts[1] < 1.0:
                raise header.error(f"{pair[1]} = {parts[1]:.9g}; a part of a day, from 0 to 1, is needed.")
            if abs(header.number(name, whole) - whole) > 1.0 / 86400.0:
                raise header.error(f"{name} = {header[name]} contradicts {pair[0]} + {pair[1]} = {whole:.9g}.")
            return zero + parts[0] + parts[1]
        if header.value(name) is not None:
            return zero + header.number(name)
    header = _home(table, "DATEREF")
    if date := header.text("DATEREF"):
        try:
            day, seconds = parse_utc(date)
        except ValueError:
            raise header.error(f"DATEREF = {date}; a date as 1994-01-01T00:00:00 is needed.") from None
        return MJD_ZERO + day + seconds / 86400.0
    raise table.header.error("the header lacks MJDREF (or MJDREFI and MJDREFF), the date that its times count from.")


def _offset(table: Table) -> float:
    """Give the clock correction to add to every time [s]; 0 where the header has none."""
    forms = (("TIMEZERO",), ("TIMEZERI", "TIMEZERF"), ("TIMEOFFS",))
    header = _home(table, *(key for keys in forms for key in keys))
    given = {
        " + ".join(keys): sum(header.number(key) for key in keys)
        for keys in forms
        if any(header.value(key) is not None for key in keys)
    }
    if given and max(given.values()) - min(given.values()) > 1e-6:
        raise header.error(f"{' contradicts '.join(f'{k} = {v:.9g}' for k, v in given.items())}; leave one out.")
    return next(iter(given.values()), 0.0) * _unit(table, "TIMEUNIT")
