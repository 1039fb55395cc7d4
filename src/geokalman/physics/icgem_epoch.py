"""Time-variable coefficients of an ICGEM file: a value at a reference epoch, a trend, and periodic terms.

    C(t) = C(t0) + trnd (t - t0) + sum_k [acos_k cos(2 pi (t - t0) / T_k) + asin_k sin(2 pi (t - t0) / T_k)]

with times and periods in years of 365.25 d. In `icgem2.0` every line carries the interval [t0, t1) in which it holds.
Source: Barthelmes & Foerste (2011), "The ICGEM-format", GFZ Potsdam.
"""

from __future__ import annotations

import datetime
import math
from typing import NamedTuple

import numpy as np

from geokalman.reading import Place

TIME_COLUMNS = {  # after C, S and errors: key -> columns in icgem1.0, icgem2.0 (t0, t1, period)
    "gfc": (0, 0),
    "gfct": (1, 2),
    "trnd": (0, 2),
    "dot": (0, 2),
    "acos": (1, 3),
    "asin": (1, 3),
}


class Term(NamedTuple):
    """One time-dependent data line; begin is its reference epoch, None where it has that of its `gfct` line."""

    key: str
    C: float
    S: float
    sigma: list[float]
    begin: datetime.datetime | None
    end: datetime.datetime | None
    period: float  # years
    place: Place


def term(key: str, numbers: list[float], times: list[str], version: int, place: Place) -> Term:
    """The term of a data line, from its numbers (C, S and errors) and its columns of time."""
    dates = [_date(text, place) for text in times[: 1 if key == "gfct" and not version else 2 * version]]
    period = place.number(times[-1], "period") if key in ("acos", "asin") else math.inf
    if period <= 0:
        raise place.error(f"period {times[-1]} must be positive (years).")
    begin, end = (dates + [None, None])[:2]
    if end is not None and not begin < end:
        raise place.error(f"the interval {times[0]} to {times[1]} is empty; its second date comes after the first.")
    return Term("trnd" if key == "dot" else key, numbers[0], numbers[1], numbers[2:], begin, end, period, place)


def instant(epoch: object) -> datetime.datetime | None:
    """The date that a caller asked for, in UTC, as files mean it; raises ValueError for anything but a date."""
    if epoch is None:
        return None
    if isinstance(epoch, np.datetime64) and not np.isnat(epoch):
        epoch = epoch.astype("datetime64[us]").item()
    if not isinstance(epoch, datetime.date) or epoch != epoch:  # NaT of pandas is a datetime
        raise ValueError(f"epoch = {epoch!r} is no date; give a datetime.date or a datetime.datetime.")
    if not isinstance(epoch, datetime.datetime):
        return datetime.datetime(epoch.year, epoch.month, epoch.day)
    return epoch if epoch.tzinfo is None else epoch.astimezone(datetime.UTC).replace(tzinfo=None)


def at_epoch(
    group: list[Term], time: datetime.datetime | None, nm: tuple[int, int]
) -> tuple[float, float, list[float]]:
    """C, S and errors of one coefficient at a time, or at its reference epoch; raises GfcError by line."""
    first, base = group[0].place, [t for t in group if t.key == "gfct"]
    if not base:
        raise first.error(
            f"coefficient {nm} has a trend or periodic term, but no gfct line gives its value and reference epoch."
        )
    if time is not None:
        spans = ", ".join(f"{t.begin:%Y-%m-%d} to {t.end:%Y-%m-%d}" for t in base if t.end is not None)
        group = [t for t in group if t.end is None or t.begin <= time < t.end]
        base = [t for t in group if t.key == "gfct"]
        if not base:
            raise first.error(
                f"coefficient {nm} is time-variable, but no gfct line covers {time:%Y-%m-%d}, only {spans}."
            )
    if len(base) > 1:
        cure = "one is right"
        if time is None and base[0].end is not None:
            cure = "give one epoch: read_gfc(path, epoch), then write_gfc for a notebook"
        lines = f"{len(base)} gfct lines, first in line {base[0].place.line}"
        raise base[1].place.error(f"coefficient {nm} has {lines}; {cure}.")
    C, S = base[0].C, base[0].S
    if time is not None:
        seen: dict[tuple[str, float], int] = {}
        for t in group:
            if t.key == "gfct":
                continue
            line = seen.setdefault((t.key, t.period), t.place.line)
            if line != t.place.line:
                raise t.place.error(f"this term of coefficient {nm} is given already, in line {line}.")
            years = (time - (t.begin or base[0].begin)).total_seconds() / (365.25 * 86400.0)
            angle = 2.0 * math.pi * years / t.period
            factor = {"trnd": years, "acos": math.cos(angle), "asin": math.sin(angle)}[t.key]
            C, S = C + factor * t.C, S + factor * t.S
    return C, S, base[0].sigma


def _date(text: str, place: Place) -> datetime.datetime:
    day, _, clock = text.partition(".")
    try:
        return datetime.datetime.strptime(f"{int(day):08d}{clock:0<4.4}", "%Y%m%d%H%M")
    except ValueError:
        raise place.error(f"'{text}' is no date of the form yyyymmdd or yyyymmdd.hhmm.") from None
