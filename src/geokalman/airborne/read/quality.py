"""Whether the channels of a flight line agree: accelerations, heights, corrections and references."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import uniform_filter1d

from geokalman.airborne import corrections
from geokalman.airborne.model import METRE, Array
from geokalman.airborne.read.checks import ROWS, at
from geokalman.airborne.read.columns import Table
from geokalman.airborne.read.layout import Layout
from geokalman.reading import InputError

ALLOWED = {"latitude": 1.0, "eotvos": 10.0, "free_air": 0.62}
"""How far a correction may be from ours [mGal], and at a single epoch by SCATTER times its usual scatter more."""
SCATTER = 15.0
WINDOW = 100.0
"""Seconds over which apparent gravity is averaged before it is judged."""
STRONGEST = 500.0
"""No gravity disturbance, with the bias of an accelerometer on it, is larger [mGal]."""
FOLLOWS = 0.95
"""From this correlation of f3' with the second difference of the height on, the two agree at the rate of the file."""
ENOUGH = 64
"""Epochs of a line from which on it shows periods of up to 32 steps."""
EXCESS = 3.0
"""White noise of the height has one level at all periods (a ratio of 1); aliasing of f3' is larger at the long ones."""


def agree(name: str, c: Table, references: Table, layout: Layout) -> None:
    """Raw column, kinematic acceleration, corrections and references agree with each other. Raises InputError."""
    if "raw" in c and "a_up" in c:
        _raw(name, c, references)
    _corrections(name, c, references, layout)
    if "a_up" in c:
        _motion(name, c, references)
        _gravity(name, c, references, layout)


def height_correlation(f3: Array, height: Array) -> float:
    """Correlation of the vertical specific force with the second difference of the height: near 1 unless aliased."""
    return float(np.corrcoef(np.diff(height, 2), f3[1:-1])[0, 1])


def height_noise(f3: Array, height: Array, dt: float) -> tuple[float, float]:
    """Give the white noise of the height that would explain its misfit to f3', in two bands.

    Its square is the spectrum of d2h/dt2 - f3' over that of a second difference, (2 sin(w/2))^4 / dt^4: flat where the
    height is noisy, but falling as w^-4 where f3' is (aliased vibration, say), which the filter integrates twice.

    f3 : (n,) [mGal]; height : (n,) [m]; dt [s]. Returns standard deviations [m] at periods of 2 to 4 and of 4 to 32
    steps. At least `ENOUGH` epochs are needed.
    """
    misfit = np.diff(height, 2) - f3[1:-1] * dt**2 / METRE
    window = np.hanning(len(misfit))
    w = 2.0 * np.pi * np.arange(1, len(misfit) // 2 + 1) / len(misfit)
    power = np.abs(np.fft.rfft((misfit - misfit.mean()) * window)[1:]) ** 2 / (2.0 * np.sin(0.5 * w)) ** 4
    short = w > np.pi / 2
    long = (w > np.pi / 16) & ~short
    return tuple(float(np.sqrt(power[band].mean() / (window @ window))) for band in (short, long))


def _raw(name: str, c: Table, references: Table) -> None:
    gap = np.abs(c["raw"] - (c["f3"] - c["a_up"]))
    rounding = max(2.01 * max(_decimal(c[key]) for key in ("raw", "f3", "a_up")), 0.0201)
    if gap.max() <= rounding:
        return
    k = int(np.argmax(gap))
    hint = ""
    if np.abs(c["raw"] - (c["f3"] + c["a_up"])).max() <= rounding:
        hint = "; it is f3 + a_up, so the sign of a_up is the other one"
    raise InputError(
        f"Line {name}: raw gravity differs from f3 - a_up by {gap[k]:.2f} mGal at {c['t'][k]:.2f} s"
        f"{at(references, k)} ({rounding:.2g} is rounding){hint}."
    )


def _decimal(x: Array) -> float:
    """The unit [mGal] in which values are written, at most 1 and at least 0.01."""
    return next((unit for unit in (1.0, 0.1) if np.allclose(x / unit, np.round(x / unit), rtol=0, atol=1e-5)), 0.01)


def _motion(name: str, c: Table, references: Table) -> None:
    """The kinematic acceleration is that of the height, where the rate of the data shows it, and no channel sticks."""
    t = c["t"]
    stuck = {key: np.convolve(np.diff(c[key]) == 0, np.ones(3), "valid") == 3 for key in ("f3", "a_up")}
    for key, other in (("f3", "a_up"), ("a_up", "f3")):
        if (alone := stuck[key] & ~stuck[other]).any():
            k = int(np.argmax(alone))
            raise InputError(
                f"Line {name}: {key} stays {c[key][k]:.10g} mGal for four rows and more{at(references, k)} while "
                f"{other} varies; leave cells without a measurement empty."
            )
    rise = np.diff(c["height"], 2) / ((t[-1] - t[0]) / (len(t) - 1)) ** 2 * 1e5
    slope, related = _slope(rise, c["a_up"][1:-1])
    least = 0.8 if related > 0.95 else 0.5
    if related < 0.8 or least < slope < 1 / least:
        return
    why = "its sign is the other one" if -2.0 < slope < -0.5 else "check the units of both"
    raise InputError(f"Line {name}: a_up is {slope:.3g} times the acceleration of the height; {why}.")


def _gravity(name: str, c: Table, references: Table, layout: Layout) -> None:
    """Averaged apparent gravity is one, and references vary as it does, where that shows above its noise."""
    dt = (c["t"][-1] - c["t"][0]) / (len(c["t"]) - 1)
    window = max(round(WINDOW / dt), 1)
    if len(c["t"]) < 4 * window:
        return
    inner = slice(window, -window)
    apparent = c["f3"] - c["a_up"] + sum(sign * c[column] for column, sign in layout.corrections.items())
    apparent = uniform_filter1d(uniform_filter1d(apparent, window), window)
    k = window + int(np.argmax(np.abs(apparent[inner])))
    if abs(apparent[k]) > STRONGEST:
        raise InputError(
            f"Line {name}: over {WINDOW:g} s the accelerations and corrections leave {apparent[k]:.0f} mGal"
            f"{at(references, k)}, which is no gravity disturbance; check f3, a_up and the corrections there."
        )
    for key, values in references.items():
        if key in ROWS or not np.isfinite(values).all():
            continue
        slope, related = _slope(apparent[inner], uniform_filter1d(uniform_filter1d(values, window), window)[inner])
        if related < 0.85 or 0.25 < slope < 4.0:
            continue
        why = "its sign is the other one" if -4.0 < slope < -0.25 else "check its unit (mGal)"
        raise InputError(f"Line {name}: {key} is {slope:.3g} times the gravity that the accelerations give; {why}.")


def _slope(x: Array, y: Array) -> tuple[float, float]:
    """Slope of y on x, and the size of their correlation (0 where one is constant)."""
    x, y = x - x.mean(), y - y.mean()
    xx, yy, xy = x @ x, y @ y, x @ y
    return (xy / xx, abs(xy) / np.sqrt(xx * yy)) if xx > 0 and yy > 0 else (1.0, 0.0)


def _corrections(name: str, c: Table, references: Table, layout: Layout) -> None:
    lat, t = np.radians(c["lat"]), c["t"]
    v_e, v_n = np.gradient(c["easting"], t), np.gradient(c["northing"], t)
    ours = {
        "latitude": -corrections.latitude_correction(lat),
        "eotvos": corrections.eotvos(lat, c["height"], v_e, v_n),
        "free_air": corrections.free_air(lat, c["height"]),
    }
    for column, kind in layout.kinds.items():
        given, expected = layout.corrections[column] * c[column], ours[kind]
        gap, allowed = given - expected, ALLOWED[kind]
        middle = np.median(gap)
        if abs(middle) > allowed:
            raise InputError(
                f"Line {name}: {column} adds {np.median(given):.2f} mGal in the middle of its values where the "
                f"positions ask for {np.median(expected):.2f}; {_cause(kind, given, expected, allowed)}."
            )
        if np.abs(gap).max() > allowed + SCATTER * np.median(np.abs(gap - middle)):
            k = int(np.argmax(np.abs(gap)))
            raise InputError(
                f"Line {name}: {column} adds {given[k]:.2f} mGal{at(references, k)}, "
                f"where the position asks for {expected[k]:.2f}; one of them is wrong there."
            )


def _cause(kind: str, given: Array, expected: Array, allowed: float) -> str:
    """Why a correction is another than ours, as far as its values prove it."""
    if abs(np.median(given + expected)) <= allowed:
        return "its sign is the other one"
    scales = {"it is probably in um/s2": 10.0, "it is probably in m/s2": 1e-5, "check its unit": 0.1}
    if kind == "free_air":
        scales |= {"the height is probably in feet": 0.3048, "it is probably for a height in feet": 1 / 0.3048}
    for what, factor in scales.items():
        if abs(np.median(given - factor * expected)) < 0.02 * factor * abs(np.median(expected)):
            return f"that is {factor:.4g} times as much; {what}"
    if kind == "free_air":
        metres = (given - expected) / 0.3086
        said = f"it belongs to a height {np.median(metres):+.1f} m from the one given"
        if abs(np.median(metres)) < 110.0 and np.ptp(metres) < 5.0:  # the geoid is no further away, and that smooth
            return f"{said}; the height must be above the ellipsoid, not above the geoid"
        return f"{said}, though not everywhere; check its column and that of the height"
    return "check its column and unit"
