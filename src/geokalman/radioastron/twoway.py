"""Two-way range and range-rate with light time, and their partial derivatives, as compiled kernels.

The time tag is that of reception, t3; the filter's state is that at t3. The signal left the station at t1 and was
turned round at the spacecraft at t2 = t3 - tau; the spacecraft there is r - v tau + a tau^2 / 2. Range is
c (t3 - t1)/2.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from geokalman.constants import C_LIGHT, GM_EARTH
from geokalman.physics.satellite import gcrs_from_itrs_step

_ITERATIONS = 4


@njit(cache=True)
def station_step(t, itrs, params, out):
    """GCRS position of a station itrs (3,) at t [s], written to out (3,) [m]; params of `satellite.dynamics`."""
    R = np.empty((3, 3))
    gcrs_from_itrs_step(t, params, R)
    for i in range(3):
        out[i] = R[i, 0] * itrs[0] + R[i, 1] * itrs[1] + R[i, 2] * itrs[2]


@njit(cache=True)
def _spacecraft(dt, y, a, out):
    for i in range(3):
        out[i] = y[i] + y[3 + i] * dt + 0.5 * a[i] * dt * dt


@njit(cache=True)
def _light_time(x, station, shapiro):
    """One leg [s] between two points, with the delay of light in the field of the Earth if `shapiro`."""
    d2, r2, s2 = 0.0, 0.0, 0.0
    for i in range(3):
        d2 += (x[i] - station[i]) ** 2
        r2 += x[i] * x[i]
        s2 += station[i] * station[i]
    D = math.sqrt(d2)
    tau = D / C_LIGHT
    if shapiro:
        r = math.sqrt(r2) + math.sqrt(s2)
        tau += 2.0 * GM_EARTH / C_LIGHT**3 * math.log((r + D) / (r - D))
    return tau


@njit(cache=True)
def two_way_step(t3, offset, y, a, itrs, params, shapiro, bounce, receive, send):
    """Half of the two-way range [m] of a signal received at t3 + offset, y (6,) and a (3,) the spacecraft at t3.

    Outputs: bounce (3,) the spacecraft at t2; receive, send (3,) the station at t3 and t1 [m]. Returns the range; the
    down-leg light time is |bounce - receive| / c.
    """
    station_step(t3 + offset, itrs, params, receive)
    tau = 0.0
    for _ in range(_ITERATIONS):
        _spacecraft(offset - tau, y, a, bounce)
        tau = _light_time(bounce, receive, shapiro)
    _spacecraft(offset - tau, y, a, bounce)
    up = tau
    for _ in range(_ITERATIONS):
        station_step(t3 + offset - tau - up, itrs, params, send)
        up = _light_time(bounce, send, shapiro)
    return 0.5 * C_LIGHT * (tau + up)


@njit(cache=True)
def observe_step(t3, y, a, itrs, params, shapiro, z):
    """Range [m] and range-rate [m/s] at t3, the rate by a difference over one second, written to z (2,)."""
    bounce, receive, send = np.empty(3), np.empty(3), np.empty(3)
    z[0] = two_way_step(t3, 0.0, y, a, itrs, params, shapiro, bounce, receive, send)
    late = two_way_step(t3, 0.5, y, a, itrs, params, shapiro, bounce, receive, send)
    z[1] = late - two_way_step(t3, -0.5, y, a, itrs, params, shapiro, bounce, receive, send)


@njit(cache=True)
def partials_step(t3, y, a, itrs, params, H):
    """Partial derivatives of range and range-rate with respect to the state at t3, written to H (2, 6).

    Range: u, the mean of the unit vectors of both legs, and -tau u. Range-rate: [w - n (n.w)]/D with w the velocity
    relative to the station, n and D at t2, and u. The station's velocity is differenced in the GCRS: with the pole
    0.07 degrees off the formal rate sigma changes by 13 %.
    """
    bounce, receive, send = np.empty(3), np.empty(3), np.empty(3)
    two_way_step(t3, 0.0, y, a, itrs, params, True, bounce, receive, send)
    before, after = np.empty(3), np.empty(3)
    station_step(t3 - 0.5, itrs, params, before)
    station_step(t3 + 0.5, itrs, params, after)
    down, up, nw = 0.0, 0.0, 0.0
    for i in range(3):
        down += (bounce[i] - receive[i]) ** 2
        up += (bounce[i] - send[i]) ** 2
    down, up = math.sqrt(down), math.sqrt(up)
    tau = down / C_LIGHT
    for i in range(3):
        nw += (bounce[i] - receive[i]) / down * (y[3 + i] - a[i] * tau - (after[i] - before[i]))
    for i in range(3):
        n = (bounce[i] - receive[i]) / down
        u = 0.5 * (n + (bounce[i] - send[i]) / up)
        w = y[3 + i] - a[i] * tau - (after[i] - before[i])
        H[0, i] = u
        H[0, 3 + i] = -tau * u
        H[1, i] = (w - n * nw) / down
        H[1, 3 + i] = u
