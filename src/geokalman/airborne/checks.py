"""The border of real data: what a survey file may get wrong, refused in one sentence or repaired where that is safe."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import median_filter

from geokalman.airborne import corrections
from geokalman.airborne.tables import Table
from geokalman.constants import A_EARTH

if TYPE_CHECKING:
    from geokalman.airborne.read import Layout

DAY = 86400.0
IN_MGAL = {"mGal": 1.0, "um/s2": 0.1, "m/s2": 1e5}
"""Units of acceleration in mGal."""
IN_METRES = {"m": 1.0, "ft": 0.3048}
SLOWEST, FASTEST = 20.0, 150.0
"""Speeds [m/s] outside of which positions or times must be wrong."""
ALIASED = 0.95
"""Below this correlation of f3' with the second difference of the height, f3' is aliased at this rate."""
WILD = {"height": (200.0, "m"), "easting": (2e3, "m"), "northing": (2e3, "m"), "f3": (2e6, "mGal")}
"""How far one value may stand from the median of its seven neighbours."""
ROW = "row of the data"
"""Column that carries each epoch's row in the file (the first under the header is 1), for messages."""


class SuspiciousData(UserWarning):
    """Something in a survey file looks wrong and was repaired, or is left to the reader."""


def in_order(name: str, c: Table, references: Table) -> tuple[Table, Table]:
    """A line with its time unwrapped at midnight and increasing; exact repeats of a row are dropped.

    Raises ValueError where times jump by whole seconds against the motion (leap seconds: GPS time mixed with UTC), or
    where rows are not in the order of time.
    """
    t = c["t"].copy()
    if np.nanmedian(np.diff(t)) < 0:  # reversed rows
        c, references, t = _take(c, slice(None, None, -1)), _take(references, slice(None, None, -1)), t[::-1].copy()
    for k in np.flatnonzero(np.diff(t) < -DAY / 2):
        t[k + 1 :] += DAY
    c = {**c, "t": t}
    same = np.zeros(len(t), bool)
    same[1:] = np.diff(t) == 0
    for values in c.values():
        same[1:] &= np.diff(values) == 0
    if same.any():
        c, references, t = _take(c, ~same), _take(references, ~same), t[~same]
    step = np.diff(t)
    if len(step) < 2:
        return c, references
    dt = float(np.nanmedian(step))
    moved = np.hypot(np.diff(c["easting"]), np.diff(c["northing"]))
    usual = np.nanmedian(moved)
    even = np.abs(np.pad(step, 1, constant_values=dt) - dt) < 0.1 * dt
    for k in np.flatnonzero(np.abs(step - dt) > 0.9):
        whole = abs((step[k] - dt) - round(step[k] - dt)) < 0.01
        if whole and even[k] and even[k + 2] and abs(moved[k] - usual) < 0.3 * usual:
            raise ValueError(
                f"Line {name}: the time jumps by {step[k] - dt:+.0f} s at {t[k]:.2f} s while "
                f"the aircraft moves for one step; "
                "GPS time and UTC are mixed (leap seconds): use one of them."
            )
    if (step < 0).any():
        k = int(np.argmax(step < 0))
        raise ValueError(
            f"Line {name}: rows are not in the order of time, {t[k + 1]:.2f} s follows {t[k]:.2f} s"
            f"{_at(references, k + 1)}; sort them."
        )
    return c, references


def wild(name: str, c: Table, references: Table) -> None:
    """Single values that no aircraft can have: a spike, or a null written in another way. Raises ValueError."""
    for key, (limit, unit) in WILD.items():
        if key not in c:
            continue
        x = c[key]
        finite = np.flatnonzero(np.isfinite(x))
        gap = np.abs(x[finite] - median_filter(x[finite], 7, mode="nearest"))
        if key == "height":  # a run of them is its own neighbourhood
            gap = np.maximum(gap, np.where(np.abs(x[finite]) > 1e5, np.abs(x[finite]), 0.0))
        if gap.size and gap.max() > limit:
            k = int(finite[np.argmax(gap)])
            raise ValueError(
                f"Line {name}: {key} is {x[k]:g} {unit}{_at(references, k)}, "
                f"{gap.max():.3g} {unit} away from its neighbours; "
                "a spike, or a null in other words: leave the cell empty."
            )


def units(name: str, c: Table, layout: Layout) -> None:
    """Bring accelerations to mGal and heights to metres, in place. Raises ValueError where f3 cannot be in its unit."""
    if layout.acceleration not in IN_MGAL or layout.height not in IN_METRES:
        raise ValueError(
            f"A layout has acceleration in {', '.join(IN_MGAL)} and height in {', '.join(IN_METRES)}, "
            f"not {layout.acceleration} and {layout.height}."
        )
    factor = IN_MGAL[layout.acceleration]
    mean = float(np.nanmean(c["f3"])) * factor
    if not 9.5e5 < mean < 1.01e6:
        fits = [unit for unit, f in IN_MGAL.items() if 9.5e5 < mean / factor * f < 1.01e6]
        hint = f"; it would be gravity in {fits[0]}" if fits else ""
        raise ValueError(
            f"Line {name}: the mean vertical specific force is {mean:.6g} mGal if it is in {layout.acceleration}, "
            f"not about 980000{hint}: set the layout's acceleration."
        )
    for key in ("f1", "f2", "f3", "a_up", "raw", *layout.corrections):
        if key in c:
            c[key] = c[key] * factor
    c["height"] = c["height"] * IN_METRES[layout.height]


def places(name: str, c: Table) -> tuple[Table, bool]:
    """Latitude and longitude that agree with easting and northing, and whether they had to be swapped for it.

    Raises ValueError where neither order agrees.
    """
    if _place_misfit(c["lat"], c["lon"], c) < 0.1:
        return c, False
    if _place_misfit(c["lon"], c["lat"], c) < 0.1:
        return {**c, "lat": c["lon"], "lon": c["lat"]}, True
    raise ValueError(
        f"Line {name}: latitude {c['lat'][0]:.4f} and longitude {c['lon'][0]:.4f} "
        f"do not move as easting and northing do, "
        "in either order; check the columns and their units (degrees)."
    )


def _place_misfit(lat: np.ndarray, lon: np.ndarray, c: Table) -> float:
    if np.nanmax(np.abs(lat)) > 90:
        return np.inf
    north, east = np.radians(np.diff(lat)) * A_EARTH, np.radians(np.diff(lon)) * A_EARTH * np.cos(np.radians(lat[:-1]))
    moved = np.nansum(np.hypot(np.diff(c["easting"]), np.diff(c["northing"])))
    return float(np.nansum(np.hypot(north - np.diff(c["northing"]), east - np.diff(c["easting"]))) / max(moved, 1e-9))


def complete(c: Table) -> tuple[int, str]:
    """How many rows of a line have all channels, and in words what is missing where there are hardly any."""
    good = np.logical_and.reduce([np.isfinite(values) for values in c.values()])
    empty = [key for key, values in c.items() if not np.isfinite(values).any()]
    count = int(good.sum())
    return count, f"{' and '.join(empty)} null in all of its rows" if empty else f"only {count} complete rows"


def pieces(name: str, c: Table, references: Table) -> tuple[list[slice], list[str]]:
    """Where a line is whole, and in words why it is cut between: at gaps, repeated epochs, nulls in a needed channel.

    Raises ValueError where the step is not constant apart from gaps.
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
        raise ValueError(
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
        why.append(f"{what}{_at(references, kept[k] + 1)}")
    edges = np.concatenate([[0], np.flatnonzero(cut) + 1, [len(kept)]])
    return [slice(int(kept[a]), int(kept[b - 1]) + 1) for a, b in zip(edges[:-1], edges[1:], strict=True)], why


def quality(name: str, c: Table, layout: Layout) -> None:
    """Speed, the raw column, signs and sizes of the corrections, the datum of the height. Raises ValueError."""
    speed = np.hypot(np.diff(c["easting"]), np.diff(c["northing"])).sum() / (c["t"][-1] - c["t"][0])
    if not SLOWEST < speed < FASTEST:
        raise ValueError(
            f"Line {name}: the mean speed is {speed:.1f} m/s, not between {SLOWEST:g} and {FASTEST:g}; "
            f"check positions and times."
        )
    if "raw" in c and "a_up" in c:
        gap = np.abs(c["raw"] - (c["f3"] - c["a_up"]))
        if gap.max() > 0.0201:
            k = int(np.argmax(gap))
            raise ValueError(
                f"Line {name}: raw gravity differs from f3 - a_up by {gap[k]:.2f} mGal "
                f"at {c['t'][k]:.2f} s (0.02 is rounding)."
            )
    _signs(name, c, layout)


def height_correlation(f3: np.ndarray, height: np.ndarray) -> float:
    """Correlation of the vertical specific force with the second difference of the height: near 1 unless aliased."""
    return float(np.corrcoef(np.diff(height, 2), f3[1:-1])[0, 1])


def _signs(name: str, c: Table, layout: Layout) -> None:
    lat = np.radians(c["lat"])
    t = c["t"]
    v_e, v_n = np.gradient(c["easting"], t), np.gradient(c["northing"], t)
    ours = {
        "latitude": (-corrections.latitude_correction(lat), 1.0),
        "eotvos": (corrections.eotvos(lat, c["height"], v_e, v_n), 20.0),
        "free_air": (corrections.free_air(lat, c["height"]), 0.5),
    }
    for column, kind in layout.kinds.items():
        expected, allowed = ours[kind]
        given = layout.corrections[column] * c[column]
        if kind == "free_air":
            metres = float(np.mean(given - expected)) / 0.3086
            ratio = float(np.mean(given) / np.mean(expected))
            if abs(metres) < 2.0:
                continue
            if ratio < 0:
                raise ValueError(_wrong_sign(name, column, given, expected))
            for what, factor in (
                ("the height is probably in feet", 0.3048),
                ("the correction is probably for a height in feet", 1 / 0.3048),
            ):
                if abs(ratio - factor) < 0.02 * factor:
                    raise ValueError(f"Line {name}: {column} is {ratio:.3f} times what the height asks for; {what}.")
            raise ValueError(
                f"Line {name}: {column} belongs to a height {metres:+.1f} m from the one given; "
                "the height must be above the ellipsoid, not above the geoid."
            )
        if abs(np.mean(given - expected)) > allowed:
            raise ValueError(_wrong_sign(name, column, given, expected))


def _wrong_sign(name: str, column: str, given: np.ndarray, expected: np.ndarray) -> str:
    opposite = abs(np.mean(given + expected)) < abs(np.mean(given - expected))
    advice = "its sign is the other one" if opposite else "check its column and unit"
    return (
        f"Line {name}: {column} adds {np.mean(given):.2f} mGal on average where the positions ask for "
        f"{np.mean(expected):.2f}; {advice}."
    )


def _at(references: Table, k: int) -> str:
    return f" at row {references[ROW][k]:.0f} of the data" if ROW in references else ""


def _take(table: Table, rows) -> Table:
    return {key: values[rows] for key, values in table.items()}
