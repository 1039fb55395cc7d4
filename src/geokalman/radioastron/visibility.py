"""Who sees the spacecraft: elevations at the stations, and the refusal of links through the ground."""

from __future__ import annotations

import math

import erfa
import numpy as np
from numpy.typing import NDArray

from geokalman.physics.satellite import Dynamics
from geokalman.radioastron.model import STATIONS, Array

LOWEST = math.radians(5.0)
"""Lowest elevation of a link [rad]."""


def elevations(world: Dynamics, t: Array, states: Array, station: str) -> Array:
    """Elevation (n,) [rad] above the plane normal to the ellipsoid's vertical at a station."""
    itrs = np.array(STATIONS[station])
    lon, lat, _ = erfa.gc2gd(1, itrs)
    up = np.array([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])
    out = np.empty(len(t))
    for k, time in enumerate(t):
        D = world.gcrs_from_itrs(time).T @ states[k, :3] - itrs
        out[k] = np.arcsin(D @ up / np.linalg.norm(D))
    return out


def check_visible(world: Dynamics, t: Array, states: Array, stations: tuple[str, ...]) -> None:
    """Raise ValueError where the spacecraft stands lower than 5 degrees above the horizon of a station, naming both."""
    for name in stations:
        height = elevations(world, t, states, name)
        if (height < LOWEST).any():
            k = int(height.argmin())
            raise ValueError(
                f"the spacecraft stands {np.degrees(height[k]):.1f} deg above the horizon of {name} at {t[k]:g} s; "
                "no link below 5 deg: choose another station, pass or mean anomaly."
            )


def check_passes(
    world: Dynamics, t: Array, station: NDArray[np.int64], state: Array, stations: tuple[str, ...], gap: float = 600.0
) -> None:
    """`check_visible` at both ends of every pass of every station, along the orbit of a state (6,) at t[0].

    t (n,) sorted times [s], station (n,) index into stations; a pause longer than `gap` [s] ends a pass.
    """
    for k, name in enumerate(stations):
        times = np.unique(t[station == k])
        if len(times) == 0:
            continue
        pause = np.diff(times) > gap
        ends = times[np.r_[True, pause] | np.r_[pause, True]]
        along = np.unique(np.append(t[0], ends))
        states = world.propagate(state, along).y if len(along) > 1 else np.asarray(state, dtype=float)[None]
        check_visible(world, ends, states[np.searchsorted(along, ends)], (name,))
