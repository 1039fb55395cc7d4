"""Real photons of pulsars: barycentring, folding, and times of arrival."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar

from geokalman.constants import C_LIGHT
from geokalman.physics.ephemeris import Ephemeris, load_ephemeris
from geokalman.pulsar.events import Events, read_events
from geokalman.pulsar.model import Array
from geokalman.pulsar.orbits import SatelliteOrbit, read_orbit
from geokalman.pulsar.par import par_direction, par_frequency, read_par

__all__ = [
    "Events", "SatelliteOrbit", "Timing", "arrival_times", "barycentred", "best_frequency", "h_test", "orbit_scale",
    "par_direction", "par_frequency", "read_events", "read_orbit", "read_par", "within_one", "z_squared",
]  # fmt: skip


DOPPLER = 1.2e-4
"""Largest shift of a frequency by the motion of the Earth and of a satellite about it, relative."""
MAX_TURNS = 3e9
"""Photons times frequencies of the longest search: some minutes."""


class Timing(NamedTuple):
    """Times of arrival of pieces.

    t : middle [s]; residual : after a linear fit [s]; sigma, formal [s]; rms over n - 2; z2, frequency [Hz] of all.
    """

    t: Array
    residual: Array
    sigma: Array
    rms: float
    formal: float
    z2: float
    frequency: float


def barycentred(
    events: Events, direction: Array, orbit: SatelliteOrbit | None, earth: bool = True, scale: float = 1.0,
    ephemeris: Ephemeris | None = None,
) -> Array:  # fmt: skip
    """Move times to the barycentre: t + n . (r_Earth + scale r_satellite) / c (Roemer delays).

    direction : unit vector n to the pulsar (3,); orbit : None leaves the satellite's part out, earth = False the
    Earth's; scale : of the satellite's orbit; ephemeris : None is the vendored DE421. The difference between TT and
    TDB, below 2 ms and constant over an hour, is left out. Returns (n,) [s].
    Raises ValueError for events that are at the barycentre already.
    """
    if not events.local:
        already = f"the events of {events.name} refer to the barycentre already (TIMEREF SOLARSYSTEM)"
        raise ValueError(f"{already}; correcting them twice moves them by minutes.")
    t = events.t.copy()
    if earth:
        t += (ephemeris or load_ephemeris()).position("earth", events.jd, events.t) @ direction / C_LIGHT
    if orbit is not None:
        t += scale * (orbit.position(events.t, events.jd) @ direction) / C_LIGHT
    return t


def z_squared(phase: Array, harmonics: int = 1) -> Array:
    """Give Z_m^2 = (2/N) sum_k |sum_j exp(2 pi i k phi_j)|^2 for m = 1 to `harmonics`.

    phase (n,) [cycles]; returns (harmonics,). Raises ValueError for no phase, or one that is not finite.
    Source: Buccheri et al. (1983), Astron. Astrophys. 128, 245.
    """
    k = np.arange(1, harmonics + 1)
    if not len(phase) or not np.isfinite(np.sum(phase)):
        raise ValueError(f"there are {len(phase)} phases, {np.isfinite(phase).sum()} of them finite; all must be.")
    power = np.abs(np.exp(2j * np.pi * k[:, None] * np.asarray(phase, dtype=float)).sum(axis=1)) ** 2
    return np.cumsum(2.0 * power / len(phase))


def h_test(phase: Array) -> float:
    """Give H = max over m of 1 to 20 of Z_m^2 - 4 m + 4 (de Jager et al. 1989, A&A 221, 180)."""
    return float((z_squared(phase, 20) - 4.0 * np.arange(20)).max())


def best_frequency(t: Array, near: float, half_width: float = 2e-3) -> tuple[float, float]:
    """Find the frequency [Hz] near another where Z_1^2 of times t (n,) [s] is largest; both.

    The interval reaches half_width [Hz], but at least DOPPLER of the frequency, to either side.
    Raises ValueError where the maximum stands at an end of the interval, and where chance alone would give it in more
    than one of a thousand searches: exp(-Z_1^2 / 2) for each of the independent frequencies, 1/T apart; and, before
    the work, for events of one time and for more than `MAX_TURNS` turns of phase.
    """
    t, half_width = np.sort(t), max(half_width, DOPPLER * near)
    t = t - t[0]
    if not t[-1] > 0.0:
        raise ValueError(f"the {len(t)} events all have the same time; they last no time to see a frequency in.")
    step = 0.1 / t[-1]
    if (count := 2.0 * half_width / step) * len(t) > MAX_TURNS:
        days = t[-1] / 86400.0
        raise ValueError(f"{len(t)} events over {days:.3g} d would take {count:.3g} frequencies to search; give fewer.")
    grid = near + np.arange(-np.ceil(half_width / step), np.ceil(half_width / step) + 1) * step
    power = np.array([z_squared(f * t)[0] for f in grid])
    k, none = int(power.argmax()), f"no pulsation within {half_width:g} Hz of {near:g} Hz"
    if k in (0, len(grid) - 1):
        raise ValueError(f"{none}: Z^2 is largest at the end of the interval.")
    chance = min(1.0, max(1.0, 2.0 * half_width * t[-1]) * np.exp(-0.5 * power[k]))
    if chance > 1e-3:
        largest = f"the largest Z^2, {power[k]:.1f} at {grid[k]:.5f} Hz"
        raise ValueError(f"{none}: {largest}, comes by chance in {chance:.1%} of such searches.")
    where = {"bounds": (grid[k - 1], grid[k + 1]), "method": "bounded", "options": {"xatol": 1e-10}}
    found = minimize_scalar(lambda f: -z_squared(f * t)[0], **where)
    return float(found.x), float(-found.fun)


def arrival_times(t: Array, near: float, piece: float = 500.0, pieces: int = 7) -> Timing:
    """Time consecutive pieces by the phase of the fundamental at the best frequency of all.

    t (n,) [s], in any order; pieces of `piece` seconds are counted from the first photon, later photons dropped.
    Raises ValueError for fewer than three pieces and for a piece without photons.
    """
    if pieces < 3:
        raise ValueError(f"pieces = {pieces}: a linear fit leaves residuals only from three pieces on.")
    since = np.sort(t)
    since = since - since[0]
    parts = np.split(since, np.searchsorted(since, piece * np.arange(1, pieces + 1)))[:pieces]
    if empty := [k + 1 for k, inside in enumerate(parts) if not inside.size]:
        lasting = f"the events last {since[-1]:.0f} s. Give shorter pieces, or fewer."
        raise ValueError(f"piece {empty[0]} of {piece:g} s has no photon; {lasting}.")
    frequency, power = best_frequency(t, near)
    angle, sigma = np.empty(pieces), np.empty(pieces)
    for k, inside in enumerate(parts):
        angle[k] = np.angle(np.exp(2j * np.pi * frequency * inside).sum())
        sigma[k] = 1.0 / (2.0 * np.pi * frequency * np.sqrt(z_squared(frequency * inside)[0]))
    middle = (np.arange(pieces) + 0.5) * piece
    toa = np.unwrap(angle) / (2.0 * np.pi * frequency)
    residual = toa - np.polyval(np.polyfit(middle, toa, 1), middle)
    rms = float(np.sqrt((residual**2).sum() / (pieces - 2)))
    return Timing(middle, residual, sigma, rms, float(np.sqrt((sigma**2).mean())), power, frequency)


def orbit_scale(
    events: Events, direction: Array, orbit: SatelliteOrbit, near: float, scales: Array,
    ephemeris: Ephemeris | None = None,
) -> Array:  # fmt: skip
    """Give Z_1^2 at the best frequency for each scale of the satellite's Roemer delay.

    near [Hz]; scales (n,); the other arguments and errors are those of `barycentred` and `best_frequency`.
    """
    times = (barycentred(events, direction, orbit, scale=s, ephemeris=ephemeris) for s in scales)
    return np.array([best_frequency(t, near, 1e-3)[1] for t in times])


def within_one(scales: Array, power: Array) -> tuple[float, float]:
    """Find where Z^2 falls one below its maximum on either side, a standard deviation.

    scales, power (n,), ascending in scales. Raises ValueError where the curve does not fall so far on a side.
    """
    top, level = int(power.argmax()), power.max() - 1.0
    if power[: top + 1].min() > level or power[top:].min() > level:
        within = f"of scale {scales[top]:g} between {scales[0]:g} and {scales[-1]:g}"
        raise ValueError(f"Z^2 does not fall by one on both sides {within}: too few photons, or too short an orbit.")
    low = int(np.flatnonzero(power[:top] <= level)[-1])
    high = top + int(np.flatnonzero(power[top:] <= level)[0])
    left = np.interp(level, power[low : low + 2], scales[low : low + 2])
    right = np.interp(-level, -power[high - 1 : high + 1], scales[high - 1 : high + 1])
    return float(left), float(right)
