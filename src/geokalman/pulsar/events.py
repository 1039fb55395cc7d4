"""Read lists of photons: times in order, each photon once, with good-time intervals."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from geokalman.pulsar import clock
from geokalman.pulsar.fits import FitsError, Table, read_fits
from geokalman.pulsar.model import Array

_RUN = 32
"""Neighbouring times that all stand an even number of times show that a list was merged with itself."""
_SLACK = 1.0  # [s] beyond a good-time interval, where rounding is no matter


@dataclass(frozen=True, eq=False)
class Events:
    """Photons in the order of time.

    name : the object, else the file; t (n,) [s] since the Julian date jd of the file (its time system, TT or TDB);
    local : times at the satellite (TIMEREF LOCAL), not at the barycentre; exposure : sum of the good-time intervals
    [s], or nan; phase : (n,) pulse phases [cycles] where the file has them, else None.
    """

    name: str
    t: Array
    jd: float
    local: bool
    exposure: float
    phase: Array | None

    @property
    def mjd(self) -> float:
        """Modified Julian date of the first photon."""
        return self.jd - clock.MJD_ZERO + float(self.t[0]) / 86400.0


def read_events(path: str | os.PathLike) -> Events:
    """Read photons of a FITS event file, sorted by time.

    Photons that stand there twice because a list was merged with itself are taken once, with a FitsWarning; photons
    outside the good-time intervals are kept, with one too. Raises FitsError where the file has no events, does not say
    what its times refer to, or has times that cannot be right (see `clock.times`).
    """
    tables = read_fits(path)
    table = _event_table(tables, path)
    t, zero, jd = clock.times(table, "TIME")
    place = clock.place(table)
    if not place:
        raise table.header.error(
            "TIMEREF = missing; LOCAL (at the satellite) or SOLARSYSTEM (at the barycentre) is needed."
        )
    if t.size == 0:
        raise table.header.error("there are no events (NAXIS2 = 0).")
    order = np.argsort(t, kind="stable")
    if len(t) > 1 and t[order[0]] == t[order[-1]]:
        raise table.header.error(f"column TIME has {t[0]:.9g} in all {len(t)} rows; times of photons are needed.")
    clock.refuse_strays(table, "TIME", t[order], order)
    t = t[order] + zero + clock.middle(table)
    exposure = _exposure(tables, table, t, jd)
    kept = _once(t)
    if len(kept) < len(t):
        often = "twice" if 2 * len(kept) >= len(t) else "several times"
        table.header.warn(f"{len(t) - len(kept)} of {len(t)} events stand there {often} and are taken once.")
    phase = _phases(table)[order][kept] if "PULSE_PHASE" in table.columns else None
    name = str(table.header.value("OBJECT") or "") or Path(path).name
    return Events(name, t[kept], jd, place == "LOCAL", exposure, phase)


def _event_table(tables: list[Table], path: str | os.PathLike) -> Table:
    """Find the table called events, else the first with TIME that is called nothing else."""
    timed = [t for t in tables if "TIME" in t.columns and not _is_gti(t)]
    called = [t for t in timed if t.header.text("HDUCLAS1").startswith("EVENT") or t.name.upper().startswith("EVENT")]
    if len(called) > 1:
        called[0].header.warn(f"this is the first of {len(called)} tables of events; the others are left out.")
    if called:
        return called[0]
    if not timed:
        there = ", ".join(t.name or "no name" for t in tables) or "none"
        raise FitsError(f"{path} has no table with a column TIME (its tables: {there}); give an event file.")
    if other := timed[0].header.text("HDUCLAS1"):
        raise timed[0].header.error(f"HDUCLAS1 = {other}; a table of events (HDUCLAS1 = EVENTS) is needed.")
    return timed[0]


def _phases(table: Table) -> Array:
    """Read PULSE_PHASE; FitsError where a value is null, not finite, or far from all others."""
    phase = table.finite("PULSE_PHASE").astype(float)
    away = np.abs(phase - np.median(phase)) > 10.0
    if away.any() and away.sum() <= 0.5 * len(phase):
        k = int(away.argmax())
        raise table.header.error(f"column PULSE_PHASE has {phase[k]:g} in row {k + 1}, a null value; leave it out.")
    return phase


def _is_gti(table: Table) -> bool:
    return table.name.upper().startswith(("GTI", "STDGTI")) or table.header.text("HDUCLAS1") == "GTI"


def _once(t: Array) -> Array:
    """Give indices (m,) of the events to keep of ascending times t (n,).

    Photons may share a time by chance, but not a run of `_RUN` neighbouring times an even number of times each, or a
    multiple of three.
    """
    first, counts = np.unique(t, return_index=True, return_counts=True)[1:]
    copies = np.ones_like(counts)
    for times in (3, 2):
        whole = counts // copies % times == 0
        edges = np.flatnonzero(np.diff(np.concatenate([[False], whole, [False]])))
        for start, stop in edges.reshape(-1, 2):
            if stop - start >= max(2, min(_RUN, len(counts))):
                copies[start:stop] *= times
    keep = np.ones(len(t), dtype=bool)
    for k in np.flatnonzero(copies > 1):
        keep[first[k] + counts[k] // copies[k] : first[k] + counts[k]] = False
    return np.flatnonzero(keep)


def _exposure(tables: list[Table], events: Table, t: Array, jd: float) -> float:
    """Sum the good-time intervals of their first table [s], each second once; nan without one.

    Raises FitsError for an interval that ends before it starts, and where all events t (n,) [s] since jd stand outside
    the intervals, or outside TSTART to TSTOP where there are none.
    """
    lengths, spans = [], []
    for table in filter(_is_gti, tables):
        if not clock.has_reference(table.header) and not clock.has_reference(table.primary):
            table = replace(table, primary=events.header)
        start, stop = clock.times(table, "START"), clock.times(table, "STOP")
        if (wrong := np.flatnonzero(stop.t < start.t)).size:
            raise table.header.error(f"the interval in row {wrong[0] + 1} ends (STOP) before it starts (START).")
        if start.t.size:
            first, last = start.t[order := np.argsort(start.t, kind="stable")], stop.t[order]
            before = np.maximum.accumulate(np.concatenate([[-np.inf], last[:-1]]))
            if (first < before).any():
                table.header.warn("good-time intervals overlap; every second counts once.")
            lengths.append(float(np.maximum(last - np.maximum(first, before), 0.0).sum()))
            spans.append(np.array([first, last]) + (start.zero + (start.jd - jd) * 86400.0))
    header = events.header
    if not spans and None not in (header.value("TSTART"), header.value("TSTOP")):
        spans = [clock.moments(events, "TSTART", "TSTOP")[:, None]]
    if spans:
        first, last = np.hstack(spans)
        at = np.searchsorted(np.sort(first), t + _SLACK, "right")
        outside = at - np.searchsorted(np.sort(last), t - _SLACK, "left") <= 0  # as many ended as began
        what = "the good-time intervals" if lengths else "TSTART to TSTOP"
        if outside.all():
            raise header.error(f"all {len(t)} events stand outside {what}; their units or references differ.")
        if outside.any():
            header.warn(f"{outside.sum()} of {len(t)} events stand outside {what}; they are kept.")
    return lengths[0] if lengths else float("nan")
