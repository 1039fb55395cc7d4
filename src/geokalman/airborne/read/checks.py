"""The border of real data: what a survey file may get wrong, refused in one sentence or repaired where that is safe."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.ndimage import median_filter

from geokalman.airborne.model import Array
from geokalman.airborne.read.columns import Table
from geokalman.airborne.read.layout import IN_MGAL, Layout
from geokalman.constants import A_EARTH
from geokalman.reading import InputError, counted

DAY = 86400.0
SLOWEST, FASTEST = 20.0, 150.0
"""Speeds [m/s] outside of which positions or times must be wrong."""
ROW, FILE_ROW = "row of the data", "row of the file"
"""Columns that carry each epoch's row for messages: of the data (the first is 1), and of the file where it is text."""
ROWS = (ROW, FILE_ROW)


class Limit(NamedTuple):
    """What a channel can be at all, how far a value may stand from its neighbours, and its unit."""

    least: float
    most: float
    step: float
    unit: str


LIMITS = {
    "t": Limit(-1e10, 1e10, 3600.0, "s"),
    "lat": Limit(-360.0, 360.0, 0.006, "degrees"),  # it may hold the longitude
    "lon": Limit(-360.0, 360.0, 0.06, "degrees"),
    "easting": Limit(-1e8, 1e8, 600.0, "m"),
    "northing": Limit(-1e8, 1e8, 600.0, "m"),
    "height": Limit(-500.0, 2e4, 200.0, "m"),
    "f1": Limit(-2e6, 2e6, np.inf, "mGal"),
    "f2": Limit(-2e6, 2e6, np.inf, "mGal"),
    "f3": Limit(0.0, 2e6, np.inf, "mGal"),
    "a_up": Limit(-1e6, 1e6, np.inf, "mGal"),
    "raw": Limit(9e5, 1.06e6, 1e3, "mGal"),
    "latitude": Limit(-1e7, 1e7, 5.0, "mGal"),
    "eotvos": Limit(-1e7, 1e7, 100.0, "mGal"),
    "free_air": Limit(-1e7, 1e7, 60.0, "mGal"),
    "correction": Limit(-1e7, 1e7, 50.0, "mGal"),
    "reference": Limit(-1e3, 1e3, 6.0, "mGal"),  # 100 mGal/km at 60 m/s: no gradient of gravity is steeper
}
"""Limits of the channels, the kinds of corrections, and the references; steps are for a second or less."""
_ANGLES = {"lat": "latitude", "lon": "longitude"}
_SPIKE = "a spike, or a null that is not marked as one: leave the cell empty"
_COUNTERS = (-999.25, -32768.0, -32767.0, 32767.0, -2147483648.0, -2147483647.0, 2147483647.0)


class SuspiciousData(UserWarning):
    """Something in a survey file looks wrong and was repaired, or is left to the reader."""


def looks_null(values: Array) -> Array:
    """Which values are written as nulls often are: nines alone (-9999, 99999.99, ...), ends of integers, -999.25."""
    with np.errstate(divide="ignore", invalid="ignore"):
        size = np.abs(values)
        gap = 10.0 ** np.ceil(np.log10(size)) - size  # 10^p less 10^-d
        power = np.log10(gap)
        nines = (size > 90.0) & (gap > 0) & (gap <= 1.0) & (np.abs(power - np.round(power)) < 1e-4)
    return nines | np.isin(values, _COUNTERS)


def without_nulls(name: str, c: Table, references: Table, like: Mapping[str, Array], layout: Layout) -> list[str]:
    """NaN, in place, where a value looks like a null and its channel cannot have it there; notes on it.

    It cannot where it is beyond the limits of the channel, far from the values around it, or repeated in a channel
    that is noise. like : channel -> which of its values look like nulls (n,), see `looks_null`.
    """
    notes = []
    for key, mask in like.items():
        if not mask.any():
            continue
        table = c if key in c else references
        x, limit = table[key], _limit(key, layout)
        rest = np.flatnonzero(np.isfinite(x) & ~mask)
        wrong = (x < limit.least) | (x > limit.most)
        if rest.size:
            wrong |= np.abs(x - np.interp(np.arange(len(x)), rest, x[rest])) > limit.step
        else:
            wrong |= np.abs(x) >= 999.0
        if limit.step == np.inf:
            same = mask[1:] & (np.diff(x) == 0)
            wrong |= np.append(same, False) | np.append(False, same)
            if key == "a_up" and "raw" in c:
                wrong |= np.abs(c["raw"] - (c["f3"] - x)) > 1.0
        wrong &= mask
        if wrong.any():
            table[key] = np.where(wrong, np.nan, x)
            k, count = int(np.argmax(wrong)), int(wrong.sum())
            notes.append(
                f"line {name} has {x[k]:.10g} in {key}{at(references, k)}: "
                f"{count} value{'s' * (count > 1)} there {'are' if count > 1 else 'is'} taken as null"
            )
    return notes


def in_order(name: str, c: Table, references: Table) -> tuple[Table, Table, list[str]]:
    """A line with its time unwrapped at midnight and increasing, and notes; exact repeats of a row are dropped.

    Raises InputError where a single time is a spike, where times are not seconds (HHMMSS), where they jump by whole
    seconds against the motion (leap seconds: GPS time mixed with UTC), or where rows are not in the order of time.
    """
    notes = []
    timed = np.isfinite(c["t"])
    if not timed.all():
        c, references = _take(c, timed), _take(references, timed)
        notes.append(f"{counted(int((~timed).sum()), 'row')} of line {name} without a time left out")
    if np.median(np.diff(c["t"])) < 0:
        if (c["t"] < 0).all():
            raise InputError(f"Line {name}: all times are negative and fall from {c['t'][0]:.10g} s; count upward.")
        c, references = _take(c, slice(None, None, -1)), _take(references, slice(None, None, -1))
        notes.append(f"line {name} is in the reverse order of time and is turned")
    t = c["t"].copy()
    dt = float(np.median(np.diff(t)))
    inner = (np.abs(t[2:] - t[:-2] - 2 * dt) < 0.5 * dt) & ((t[1:-1] < t[:-2]) | (t[1:-1] > t[2:]))
    spikes = np.flatnonzero(inner) + 1
    if 0 < len(spikes) < 4 and (np.diff(np.delete(t, spikes)) >= 0).all():
        k = int(spikes[0])
        cure = _SPIKE
        if len(spikes) > 1 and np.allclose(np.sort(t[spikes]), np.sort(t[spikes - 1] + dt), rtol=0, atol=0.25 * dt):
            cure = "rows are not in the order of time, sort them"  # the times that are missed are in other rows
        raise InputError(
            f"Line {name}: the time is {t[k]:.10g} s{at(references, k)} between {t[k - 1]:.10g} and {t[k + 1]:.10g} s; "
            f"{cure}."
        )
    if np.ptp(t) > 100.0 and t.max() < 240000.0 and (t % 100.0 < 60.0).all() and dt < 60.0:
        raise InputError(
            f"Line {name}: the times run from {t[0]:.10g} to {t[-1]:.10g} and none has more than 60 in its last two "
            "digits; they are HHMMSS, and seconds are needed."
        )
    for k in np.flatnonzero(np.diff(t) < -DAY / 2):
        t[k + 1 :] += 7 * DAY if t[k] - t[k + 1] > 3.5 * DAY else DAY
    c = {**c, "t": t}
    same = np.zeros(len(t), bool)
    same[1:] = np.diff(t) == 0
    for values in (*c.values(), *(x for key, x in references.items() if key not in ROWS)):
        same[1:] &= (np.diff(values) == 0) | (np.isnan(values[1:]) & np.isnan(values[:-1]))
    if same.any():
        first = at(references, int(np.argmax(same)))
        count = int(same.sum())
        stand = "rows of line {0} occur twice and are" if count > 1 else "row of line {0} occurs twice and is"
        notes.append(f"{count} {stand.format(name)} taken once (the first{first})")
        c, references, t = _take(c, ~same), _take(references, ~same), t[~same]
    step = np.diff(t)
    if len(step) < 2:
        return c, references, notes
    dt = float(np.median(step))
    moved = np.hypot(np.diff(c["easting"]), np.diff(c["northing"]))
    usual = np.nanmedian(moved)
    even = np.abs(np.pad(step, 1, constant_values=dt) - dt) < 0.1 * dt
    for k in np.flatnonzero((np.abs(step - dt) > 0.9) & (np.abs(step - dt) < 40.0)):
        whole = abs((step[k] - dt) - round(step[k] - dt)) < 0.01
        if whole and even[k] and even[k + 2] and abs(moved[k] - usual) < 0.3 * usual:
            raise InputError(
                f"Line {name}: the time jumps by {step[k] - dt:+.0f} s at {t[k]:.2f} s while "
                f"the aircraft moves for one step; "
                "GPS time and UTC are mixed (leap seconds): use one of them."
            )
    if (step < 0).any():
        k = int(np.argmax(step < 0))
        raise InputError(
            f"Line {name}: rows are not in the order of time, {t[k + 1]:.2f} s follows {t[k]:.2f} s"
            f"{at(references, k + 1)}; sort them."
        )
    return c, references, notes


def unit(name: str, c: Table, factor: float) -> None:
    """The vertical specific force has the size of gravity; `factor` : from the unit it was taken in to mGal.

    Raises InputError with the unit that would fit, or for a force counted downward.
    """
    mean = float(np.nanmedian(c["f3"]))
    if 9.5e5 < mean < 1.01e6:
        return
    said = next((one for one, f in IN_MGAL.items() if np.isclose(f, factor)), f"{factor:g} mGal")
    fits = [one for one, f in IN_MGAL.items() if 9.5e5 < mean / factor * f < 1.01e6]
    hint = f"; it would be gravity in {fits[0]}: set the layout's acceleration, or the unit in the file" if fits else ""
    if 9.5e5 < -mean < 1.01e6:
        hint = "; its sign is the other one, upward is positive"
    raise InputError(
        f"Line {name}: the mean vertical specific force is {mean:.6g} mGal if it is in {said}, not about 980000"
        f"{hint or ': check its column'}."
    )


def wild(name: str, c: Table, references: Table, layout: Layout) -> None:
    """Single values, and runs of them, that no flight can have in any channel. Raises InputError with the row."""
    dt = float(np.median(np.diff(c["t"])))
    held = {key: (x, _limit(key, layout)) for key, x in (*c.items(), *references.items()) if key not in ("t", *ROWS)}
    if "a_up" in c:
        held["f3 - a_up"] = c["f3"] - c["a_up"], LIMITS["raw"]._replace(least=-np.inf, most=np.inf)
    across = max(float(np.cos(np.radians(np.nanmedian(c["lat"])))), 0.1)
    held["lon"] = c["lon"], LIMITS["lon"]._replace(step=LIMITS["lat"].step / across)
    for key, (x, limit) in held.items():
        finite = np.flatnonzero(np.isfinite(x))
        y = x[finite]
        step = np.abs(np.diff(y))
        if key == "lon":
            step = np.minimum(step, np.abs(360.0 - step))
        allowed = limit.step * max(dt, 1.0)
        if limit.unit == "mGal" and step.size:  # by the noise of the channel itself
            allowed = max(allowed, 8.0 * float(np.percentile(step, 95)))
        beyond = (y < limit.least) | (y > limit.most)
        if beyond.any() or (step > allowed).any():
            step[np.diff(c["t"][finite]) > 1.5 * dt] = 0.0  # over a gap anything may change
            _refuse(name, key, y, beyond, step, allowed, limit, [at(references, int(k)) for k in finite])


def _refuse(
    name: str, key: str, y: Array, beyond: Array, step: Array, allowed: float, limit: Limit, rows: list[str]
) -> None:
    """Raise InputError for the worst of a channel's values, if it is one; `step` : between neighbours."""
    gap = np.abs(y - median_filter(y, 7, mode="nearest"))
    if not (gap > allowed).any():  # a run is its own neighbourhood: where it begins
        gap[1:] = np.maximum(gap[1:], np.where(step > allowed, step, 0.0))
    if not (beyond | (gap > allowed)).any():
        return
    k = int(np.argmax(beyond)) if beyond.any() else int(np.argmax(gap))
    why = f"{gap[k]:.3g} {limit.unit} away from its neighbours"
    if gap[k] <= allowed:
        why = f"beyond {limit.least:g} to {limit.most:g}"
    raise InputError(f"Line {name}: {key} is {y[k]:g} {limit.unit}{rows[k]}, {why}; {_SPIKE}.")


def _limit(key: str, layout: Layout) -> Limit:
    kind = layout.kinds.get(key, "correction") if key in layout.corrections else "reference"
    return LIMITS.get(key, LIMITS[kind])


def places(who: str, c: Table) -> tuple[Table, bool]:
    """Latitude and longitude that agree with easting and northing, and whether they had to be swapped for it.

    who : what moves, for the message: a line, or the middles of several. Raises InputError where neither order agrees,
    with the unit that would.
    """
    if _place_misfit(c["lat"], c["lon"], c) < 0.1:
        return c, False
    if _place_misfit(c["lon"], c["lat"], c) < 0.1:
        return {**c, "lat": c["lon"], "lon": c["lat"]}, True
    hint = "check the columns and their units (degrees)"
    if np.nanmax(np.abs(c["easting"])) <= 360.0 and np.nanmax(np.abs(c["northing"])) <= 90.0:
        hint = "easting and northing look like degrees, metres on a map are needed"
    elif _place_misfit(np.degrees(c["lat"]), np.degrees(c["lon"]), c) < 0.1:
        hint = "they are in radians, degrees are needed"
    elif _place_misfit(c["lat"], c["lon"], {"easting": c["northing"], "northing": c["easting"]}) < 0.1:
        hint = "easting and northing are swapped"
    for key, what in _ANGLES.items():
        turned = {**c, key: -c[key]}
        if _place_misfit(turned["lat"], turned["lon"], c) < 0.1:
            hint = f"the sign of the {what} is the other one"
    for what, factor in (("feet", 0.3048), ("kilometres", 1e3)):
        if _place_misfit(c["lat"], c["lon"], {key: factor * c[key] for key in ("easting", "northing")}) < 0.1:
            hint = f"easting and northing are in {what}, metres are needed"
    raise InputError(
        f"{who}: latitude {c['lat'][0]:.4f} and longitude {c['lon'][0]:.4f} "
        f"do not move as easting and northing do, "
        f"in either order; {hint}."
    )


def signs(name: str, c: Table) -> None:
    """Refuse a latitude or longitude of the wrong sign, by how the line wanders about its track.

    The motion of a line to the east hardly shows a wrong sign of the latitude, that of a line to the north none of the
    longitude. What a parabola along the track leaves of the coordinate across it does: it is the same on the map and
    on the sphere. Raises InputError.
    """
    good = np.logical_and.reduce([np.isfinite(c[key]) for key in ("lat", "lon", "easting", "northing")])
    x, y = (c[key][good] - np.mean(c[key][good]) for key in ("easting", "northing"))
    scale = max(np.ptp(x), np.ptp(y), 1.0)
    for key, across, along in (("lat", y, x), ("lon", x, y)):
        if good.sum() < 10 or np.ptp(along) < 2.0 * np.ptp(across):
            continue
        track = np.vander(along / scale, 3)
        turned = np.unwrap(c[key][good], period=360.0)
        left = [v - track @ np.linalg.lstsq(track, v)[0] for v in (across / scale, turned)]
        degrees = np.degrees(scale / A_EARTH) / (1.0 if key == "lat" else np.cos(np.radians(np.mean(c["lat"][good]))))
        wander = float(left[0] @ left[0])
        if wander > 0.0 and -1.2 < left[0] @ left[1] / (wander * degrees) < -0.8:
            raise InputError(
                f"Line {name}: {_ANGLES[key]} {c[key][good][0]:.4f} falls where the map coordinate grows; "
                "its sign is the other one."
            )


def middles(channels: Table, blocks: Sequence[Array], names: Sequence[str]) -> None:
    """From line to line, too, places agree as in `places`: north-south lines alone show no wrong easting.

    names : of the lines in `blocks`. Raises InputError, which names lines that are mirrored at the equator or at
    Greenwich.
    """
    keys = ("lat", "lon", "easting", "northing")
    whole = [k for k, rows in enumerate(blocks) if all(np.isfinite(channels[key][rows]).any() for key in keys)]
    c = {key: np.array([np.nanmedian(channels[key][blocks[k]]) for k in whole]) for key in keys}
    moved = np.hypot(np.diff(c["easting"]), np.diff(c["northing"])).sum()
    allowed = max(0.1, 2e3 / max(moved, 1.0))
    if len(whole) < 2 or _place_misfit(c["lat"], c["lon"], c) < allowed:
        return
    found = []
    for key, what in _ANGLES.items():
        for sign in (1.0, -1.0):
            other = {**c, key: sign * np.abs(c[key])}
            if _place_misfit(other["lat"], other["lon"], c) < allowed:
                found.append((what, c[key], np.flatnonzero(other[key] != c[key])))
    if found:
        what, values, lines = min(found, key=lambda finding: len(finding[2]))
        wrong = ", ".join(names[whole[k]] for k in lines)
        raise InputError(
            f"Line {wrong}: {what} {values[lines[0]]:.4f} is that of the other lines with the other sign; correct it."
        )
    if moved > 2e3:
        places("The middles of the lines", c)


def _place_misfit(lat: np.ndarray, lon: np.ndarray, c: Mapping[str, Array]) -> float:
    if np.nanmax(np.abs(lat)) > 90:
        return np.inf
    turned = (np.diff(lon) + 180.0) % 360.0 - 180.0  # across 180 degrees of longitude
    north, east = np.radians(np.diff(lat)) * A_EARTH, np.radians(turned) * A_EARTH * np.cos(np.radians(lat[:-1]))
    moved = np.nansum(np.hypot(np.diff(c["easting"]), np.diff(c["northing"])))
    return float(np.nansum(np.hypot(north - np.diff(c["northing"]), east - np.diff(c["easting"]))) / max(moved, 1e-9))


def speed(name: str, c: Table) -> None:
    """The aircraft moves at a speed that one has. Raises InputError, with the unit of time that would fit."""
    step = np.diff(c["t"])
    on = step > 0
    if not on.any():
        return
    found = float(np.nanmedian(np.hypot(np.diff(c["easting"]), np.diff(c["northing"]))[on] / step[on]))
    if SLOWEST < found < FASTEST:
        return
    units = {"hours": 3600.0, "days": DAY, "minutes": 60.0, "milliseconds": 1e-3}
    fits = [one for one, factor in units.items() if SLOWEST < found / factor < FASTEST]
    hint = f"the times would be in {fits[0]}, seconds are needed" if fits else "check positions and times"
    raise InputError(
        f"Line {name}: the mean speed is {found:.1f} m/s, not between {SLOWEST:g} and {FASTEST:g}; {hint}."
    )


def complete(c: Table) -> tuple[int, str]:
    """How many rows of a line have all channels, and in words what is missing where there are hardly any."""
    good = np.logical_and.reduce([np.isfinite(values) for values in c.values()])
    empty = [key for key, values in c.items() if not np.isfinite(values).any()]
    count = int(good.sum())
    return count, f"{' and '.join(empty)} null in all of its rows" if empty else f"only {count} complete rows"


def pieces(name: str, c: Table, references: Table) -> tuple[list[slice], list[str]]:
    """Where a line is whole, and in words why it is cut between: at gaps, repeated epochs, nulls in a needed channel.

    Raises InputError where the step is not constant apart from gaps.
    """
    good = np.ones(len(c["t"]), bool)
    for values in c.values():
        good &= np.isfinite(values)
    kept = np.flatnonzero(good)
    t = c["t"][kept]
    step = np.diff(t)
    dt = float(np.median(step[step > 0])) if (step > 0).any() else 0.0
    cut = (step <= 0) | (step > 1.5 * dt) | (np.diff(kept) > 1)
    uneven = ~cut & (np.abs(step - dt) > max(0.02 * dt, 1e-6))
    if uneven.any():
        k = int(np.argmax(uneven))
        raise InputError(
            f"Line {name}: the step is {step[k]:.4g} s at {t[k]:.2f} s and {dt:.4g} s elsewhere; "
            f"resample to a constant step."
        )
    why = []
    for k in np.flatnonzero(cut):
        hole = slice(kept[k] + 1, kept[k + 1])
        null = [key for key, values in c.items() if not np.isfinite(values[hole]).all()]
        what = f"a gap of {step[k]:g} s" if step[k] > 0 else "a repeated epoch"
        if null:
            what = f"{' and '.join(null)} null"
        why.append(f"{what}{at(references, kept[k] + 1)}")
    edges = np.concatenate([[0], np.flatnonzero(cut) + 1, [len(kept)]])
    return [slice(int(kept[a]), int(kept[b - 1]) + 1) for a, b in zip(edges[:-1], edges[1:], strict=True)], why


def at(references: Table, k: int) -> str:
    """Where an epoch stands, for messages."""
    for rows in reversed(ROWS):
        if rows in references:
            return f" at {rows.replace('row', f'row {references[rows][k]:.0f}', 1)}"
    return ""


def _take(table: Table, rows) -> Table:
    return {key: values[rows] for key, values in table.items()}
