"""Real photons of pulsars: event files, the way of the light to the barycentre, folding, and times of arrival."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import minimize_scalar

from geokalman.constants import C_LIGHT
from geokalman.physics.ephemeris import Ephemeris, load_ephemeris
from geokalman.pulsar.fits import FitsError, Table, read_fits
from geokalman.pulsar.model import Array

MJD = 2400000.5


@dataclass(frozen=True, eq=False)
class Events:
    """Photons: t (n,) [s] since the Julian date jd of the file (its time system, TT or TDB), and where the time was
    taken.

    local : times at the satellite (TIMEREF LOCAL), not at the barycentre; exposure : sum of the good-time intervals
    [s], or nan;
    phase : (n,) pulse phases [cycles] where the file has them, else None.
    """

    name: str
    t: Array
    jd: float
    local: bool
    exposure: float
    phase: Array | None


@dataclass(frozen=True, eq=False)
class SatelliteOrbit:
    """Positions r (n, 3) [m] and velocities v (n, 3) [m/s] of a satellite about the Earth at t (n,) [s] since jd,
    ICRF axes."""

    t: Array
    jd: float
    r: Array
    v: Array

    def position(self, seconds: Array, jd: float) -> Array:
        """Positions (n, 3) [m] at times [s] since jd, by cubic Hermite interpolation.

        Raises ValueError where the orbit does not cover them.
        """
        at = seconds + (jd - self.jd) * 86400.0
        if at.min() < self.t[0] or at.max() > self.t[-1]:
            raise ValueError(
                f"the orbit covers {self.t[0]:.0f} to {self.t[-1]:.0f} s, "
                f"the events {at.min():.0f} to {at.max():.0f} s; give the orbit file of their day."
            )
        return CubicHermiteSpline(self.t, self.r, self.v)(at)


class Timing(NamedTuple):
    """Times of arrival of pieces: middle [s], residual after a linear fit [s], formal sigma [s]; rms over n - 2;
    Z_1^2 and frequency [Hz] of all."""

    t: Array
    residual: Array
    sigma: Array
    rms: float
    formal: float
    z2: float
    frequency: float


def read_events(path: str | os.PathLike) -> Events:
    """Photons of a FITS event file. Raises FitsError where it has no events, or does not say what its times refer
    to."""
    tables = read_fits(path)
    events = next((t for t in tables if "TIME" in {c.upper() for c in t.columns} and t.name != "GTI"), None)
    if events is None:
        raise FitsError(f"{path} has no table with a column TIME; give an event file.")
    gti = next((t for t in tables if t.name.upper().startswith(("GTI", "STDGTI"))), None)
    exposure = float("nan")
    if gti is not None:
        start, stop = (next(v for k, v in gti.columns.items() if k.upper() == word) for word in ("START", "STOP"))
        exposure = float((stop - start).sum())
    jd, zero = _reference(events, path)
    reference = str(events.header.get("TIMEREF", "")).upper()
    if reference not in ("LOCAL", "SOLARSYSTEM"):
        raise FitsError(
            f"{path}: TIMEREF = {reference or 'missing'}; "
            "LOCAL (at the satellite) or SOLARSYSTEM (at the barycentre) is needed."
        )
    time = next(v for k, v in events.columns.items() if k.upper() == "TIME")
    phase = events.columns.get("PULSE_PHASE")
    return Events(str(events.header.get("OBJECT", "")), time + zero, jd, reference == "LOCAL", exposure, phase)


def read_orbit(path: str | os.PathLike) -> SatelliteOrbit:
    """A satellite's orbit from a FITS file with columns Time, X, Y, Z, Vx, Vy, Vz (RXTE's FPorbit). Raises
    FitsError."""
    for table in read_fits(path):
        columns = {k.upper(): v for k, v in table.columns.items()}
        if {"TIME", "X", "Y", "Z", "VX", "VY", "VZ"} <= set(columns):
            jd, zero = _reference(table, path)
            r, v = (
                np.column_stack([columns[k] for k in names]).astype(float)
                for names in (("X", "Y", "Z"), ("VX", "VY", "VZ"))
            )
            return SatelliteOrbit(columns["TIME"] + zero, jd, r, v)
    raise FitsError(f"{path} has no table with Time, X, Y, Z, Vx, Vy, Vz; give an orbit file.")


def _reference(table: Table, path: str | os.PathLike) -> tuple[float, float]:
    """Julian date that the times count from, and the offset to add [s]."""
    h = table.header
    if "TIMEZERO" not in h:
        raise FitsError(f"{path}: the header lacks TIMEZERO, the clock correction to add to every time.")
    if "MJDREFI" in h and "MJDREFF" in h:
        return MJD + float(h["MJDREFI"]) + float(h["MJDREFF"]), float(h["TIMEZERO"])
    if "MJDREF" not in h:
        raise FitsError(
            f"{path}: the header lacks MJDREF (or MJDREFI and MJDREFF), the date that its times count from."
        )
    return MJD + float(h["MJDREF"]), float(h["TIMEZERO"])


def barycentred(events: Events, direction: Array, orbit: SatelliteOrbit | None, earth: bool = True, scale: float = 1.0,
                ephemeris: Ephemeris | None = None) -> Array:  # fmt: skip
    """Times at the solar-system barycentre by the Roemer delays, t + (n . r_Earth + scale n . r_satellite) / c,
    (n,) [s].

    direction : unit vector n to the pulsar (3,); orbit : None leaves the satellite's part out, earth = False the
    Earth's;
    scale : of the satellite's orbit. The difference between TT and TDB, below 2 ms and constant over an hour, is
    left out.
    Raises ValueError for events that are at the barycentre already.
    """
    if not events.local:
        raise ValueError(
            f"the events of {events.name} refer to the barycentre already (TIMEREF SOLARSYSTEM); "
            "correcting them twice moves them by minutes."
        )
    t = events.t.copy()
    if earth:
        t += (ephemeris or load_ephemeris()).position("earth", events.jd, events.t) @ direction / C_LIGHT
    if orbit is not None:
        t += scale * (orbit.position(events.t, events.jd) @ direction) / C_LIGHT
    return t


def z_squared(phase: Array, harmonics: int = 1) -> Array:
    """Z_m^2 = (2/N) sum_k |sum_j exp(2 pi i k phi_j)|^2 for m = 1 to `harmonics`; phase (n,) [cycles]; returns
    (harmonics,).

    Source: Buccheri et al. (1983), Astron. Astrophys. 128, 245.
    """
    k = np.arange(1, harmonics + 1)
    power = np.abs(np.exp(2j * np.pi * k[:, None] * np.asarray(phase, dtype=float)).sum(axis=1)) ** 2
    return np.cumsum(2.0 * power / len(phase))


def h_test(phase: Array) -> float:
    """H = max over m of 1 to 20 of Z_m^2 - 4 m + 4. Source: de Jager, Raubenheimer & Swanepoel (1989), Astron.
    Astrophys. 221, 180."""
    return float((z_squared(phase, 20) - 4.0 * np.arange(20)).max())


def best_frequency(t: Array, near: float, half_width: float = 2e-3) -> tuple[float, float]:
    """Frequency [Hz] within half_width of `near` where Z_1^2 of the times t (n,) [s] is largest, and that Z_1^2.

    Raises ValueError where the maximum stands at an end of the interval, and where chance alone would give it in more
    than one of a thousand searches: exp(-Z_1^2 / 2) for each of the independent frequencies, 1/T apart.
    """
    t = t - t[0]
    step = 0.1 / (t[-1] - t[0])
    grid = near + np.arange(-np.ceil(half_width / step), np.ceil(half_width / step) + 1) * step
    power = np.array([z_squared(f * t)[0] for f in grid])
    k = int(power.argmax())
    if k in (0, len(grid) - 1):
        raise ValueError(
            f"no pulsation within {half_width:g} Hz of {near:g} Hz: Z^2 is largest at the end of the interval."
        )
    chance = min(1.0, max(1.0, 2.0 * half_width * t[-1]) * np.exp(-0.5 * power[k]))
    if chance > 1e-3:
        raise ValueError(
            f"no pulsation within {half_width:g} Hz of {near:g} Hz: the largest Z^2, {power[k]:.1f} at {grid[k]:.5f} "
            f"Hz, comes by chance in {chance:.1%} of such searches."
        )
    found = minimize_scalar(
        lambda f: -z_squared(f * t)[0], bounds=(grid[k - 1], grid[k + 1]), method="bounded", options={"xatol": 1e-10}
    )
    return float(found.x), float(-found.fun)


def arrival_times(t: Array, near: float, piece: float = 500.0, pieces: int = 7) -> Timing:
    """Times of arrival of consecutive pieces from the phase of the fundamental at the best frequency of all photons.

    t (n,) [s]; pieces of `piece` seconds are counted from the first photon, later photons dropped. Residuals are
    those of a linear fit.
    Raises ValueError for fewer than three pieces and for a piece without photons.
    """
    if pieces < 3:
        raise ValueError(f"pieces = {pieces}: a linear fit leaves residuals only from three pieces on.")
    frequency, power = best_frequency(t, near)
    since = t - t[0]
    angle, sigma = np.empty(pieces), np.empty(pieces)
    for k in range(pieces):
        inside = since[(since >= k * piece) & (since < (k + 1) * piece)]
        if inside.size == 0:
            raise ValueError(f"piece {k + 1} of {piece:g} s has no photon; the events last {since[-1]:.0f} s.")
        angle[k] = np.angle(np.exp(2j * np.pi * frequency * inside).sum())
        sigma[k] = 1.0 / (2.0 * np.pi * frequency * np.sqrt(z_squared(frequency * inside)[0]))
    middle = (np.arange(pieces) + 0.5) * piece
    toa = np.unwrap(angle) / (2.0 * np.pi * frequency)
    residual = toa - np.polyval(np.polyfit(middle, toa, 1), middle)
    rms = float(np.sqrt((residual**2).sum() / (pieces - 2)))
    return Timing(middle, residual, sigma, rms, float(np.sqrt((sigma**2).mean())), power, frequency)


def orbit_scale(events: Events, direction: Array, orbit: SatelliteOrbit, near: float, scales: Array) -> Array:
    """Z_1^2 at the best frequency with the satellite's Roemer delay times each scale: (len(scales),)."""
    return np.array([best_frequency(barycentred(events, direction, orbit, scale=s), near, 1e-3)[1] for s in scales])


def within_one(scales: Array, power: Array) -> tuple[float, float]:
    """Where a curve of Z^2 falls one below its maximum on either side, a standard deviation; linearly interpolated.

    scales, power (n,), ascending in scales. Raises ValueError where the curve does not fall so far on a side.
    """
    top, level = int(power.argmax()), power.max() - 1.0
    if power[: top + 1].min() > level or power[top:].min() > level:
        raise ValueError(f"Z^2 does not fall by one on both sides of scale {scales[top]:g}; try more scales.")
    low = int(np.flatnonzero(power[:top] <= level)[-1])
    high = top + int(np.flatnonzero(power[top:] <= level)[0])
    left = np.interp(level, power[low : low + 2], scales[low : low + 2])
    right = np.interp(-level, -power[high - 1 : high + 1], scales[high - 1 : high + 1])
    return float(left), float(right)


def read_par(path: str | os.PathLike) -> dict[str, str]:
    """Name and first value of each line of a pulsar's .par file."""
    with open(path, encoding="utf-8") as stream:
        return {words[0]: words[1] for words in (line.split() for line in stream) if len(words) > 1}


def par_direction(par: dict[str, str]) -> Array:
    """Unit vector (3,) to the pulsar of a .par file, from RAJ (hours) and DECJ (degrees)."""

    def sexagesimal(text: str) -> float:
        sign = -1.0 if text.strip().startswith("-") else 1.0
        whole, minutes, seconds = (abs(float(w)) for w in text.split(":"))
        return sign * (whole + minutes / 60.0 + seconds / 3600.0)

    ra, dec = np.radians(15.0 * sexagesimal(par["RAJ"])), np.radians(sexagesimal(par["DECJ"]))
    return np.array([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)])
