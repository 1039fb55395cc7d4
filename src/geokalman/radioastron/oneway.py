"""One-way Doppler (29) and light time (30) of the paper, term by term and each switchable, beside their rigorous forms.

The Doppler is that of the on-board maser received on the ground, V = c (f_received/f_emitted - 1) [m/s]: minus the
range-rate of the one-way link, plus what clocks and gravity add. The state (6,), acceleration (3,) and station are
those at reception.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from geokalman.constants import C_LIGHT, GM_EARTH, R_EARTH
from geokalman.physics.relativity import L_G, shapiro
from geokalman.physics.satellite import GM_BODIES
from geokalman.radioastron.model import Array

J2 = 1.0826266835531513e-3
"""Second zonal harmonic of EGM96."""
GEOMETRIC = ("line-of-sight", "retardation", "station-motion", "second-order", "second-order-missing")
"""Terms of (29) in the geometric Doppler, with the half of v^2/c that the printed sum takes away as time dilation."""


def doppler_terms(state: Array, a: Array, station: Array, station_velocity: Array, moon: Array) -> dict[str, float]:
    """The terms of (29) [m/s], and `second-order-missing`, +v^2/2c, which makes the printed half the geometric whole.

    state (6,) [m, m/s], a (3,) [m s^-2], station and its velocity (3,), geocentric Moon (3,): GCRS at reception.
    """
    r, v = state[:3], state[3:]
    D = r - station
    distance, radius, to_moon = (float(np.linalg.norm(x)) for x in (D, r, moon))
    half, potential = float(v @ v) / (2.0 * C_LIGHT), GM_EARTH / (radius * C_LIGHT)
    tide = 1.0 / to_moon - 1.0 / float(np.linalg.norm(moon - r)) + float(r @ moon) / to_moon**3
    return {
        "line-of-sight": float(D @ (station_velocity - v)) / distance,
        "retardation": float(D @ a) / C_LIGHT,
        "station-motion": -float(station_velocity @ v) / C_LIGHT,
        "second-order": half,
        "second-order-missing": half,
        "clock": L_G * C_LIGHT,
        "earth-potential": -potential,
        "j2": potential * 0.5 * J2 * (R_EARTH / radius) ** 2 * float(3.0 * r[2] ** 2 / radius**2 - 1.0),
        "moon": GM_BODIES["moon"] / C_LIGHT * tide,
    }


def doppler(terms: dict[str, float], switched_on: Collection[str] | None = None) -> float:
    """Sum of terms of (29) [m/s]; by default all that the paper prints. Raises ValueError for an unknown name."""
    printed = [name for name in terms if name != "second-order-missing"]
    return _sum(terms, printed if switched_on is None else switched_on)


def light_time_terms(state: Array, a: Array, station: Array) -> dict[str, float]:
    """The terms of (30) times c [m], and `acceleration-missing`, which the paper leaves out; see `doppler_terms`."""
    r, v = state[:3], state[3:]
    D = r - station
    distance, radius = float(np.linalg.norm(D)), float(np.linalg.norm(r))
    along = float(D @ v)
    return {
        "distance": distance,
        "motion": -along / C_LIGHT,
        "shapiro": C_LIGHT * shapiro(radius, R_EARTH, distance, GM_EARTH),
        "second-order": distance * float(v @ v) / (2.0 * C_LIGHT**2),
        "second-order-along": along**2 / (2.0 * distance * C_LIGHT**2),
        "acceleration-missing": distance * float(D @ a) / (2.0 * C_LIGHT**2),
    }


def light_time(terms: dict[str, float], switched_on: Collection[str] | None = None) -> float:
    """Light time (30) [s]: the sum of terms over c, by default those that the paper prints."""
    printed = [name for name in terms if name != "acceleration-missing"]
    return _sum(terms, printed if switched_on is None else switched_on) / C_LIGHT


def _sum(terms: dict[str, float], names: Collection[str]) -> float:
    for name in names:
        if name not in terms:
            raise ValueError(f"term {name!r} is unknown; the terms are {', '.join(terms)}.")
    return sum(terms[name] for name in names)


def rigorous_light_time(state: Array, a: Array, station: Array, with_shapiro: bool = True) -> float:
    """One-way light time [s] solved by iteration: |r(t3 - tau) - station| = c tau, with r quadratic about reception."""
    tau = 0.0
    for _ in range(8):
        at = state[:3] - state[3:] * tau + 0.5 * a * tau**2
        distance = float(np.linalg.norm(at - station))
        tau = distance / C_LIGHT
        if with_shapiro:
            tau += shapiro(float(np.linalg.norm(at)), float(np.linalg.norm(station)), distance, GM_EARTH)
    return tau


def rigorous_doppler(
    state: Array, a: Array, station: Array, station_velocity: Array, jerk: Array | None = None
) -> float:
    """Geometric one-way Doppler [m/s], minus the exact derivative of the range with respect to reception time.

    rate = n.(v(t2) - v0)/(1 + n.v(t2)/c), n from the station to the point of emission; jerk (3,) [m s^-3] if known.
    """
    tau = rigorous_light_time(state, a, station, with_shapiro=False)
    at, v = state[:3] - state[3:] * tau + 0.5 * a * tau**2, state[3:] - a * tau
    if jerk is not None:
        at, v = at - jerk * tau**3 / 6.0, v + 0.5 * jerk * tau**2
    n = (at - station) / np.linalg.norm(at - station)
    return float(-(n @ (v - station_velocity)) / (1.0 + n @ v / C_LIGHT))
