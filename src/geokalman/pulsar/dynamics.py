"""The force on the orbiter, J2 alone or with the whole field; a Runge-Kutta step in it.

One compiled force serves truth and filters: a = a_J2 + lambda (a_rich - a_J2), equations (2) and (3).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from geokalman.constants import GM_SUN
from geokalman.physics import mars
from geokalman.physics.ephemeris import Ephemeris, load_ephemeris
from geokalman.physics.field import GravityField
from geokalman.physics.gravity import acceleration_point, pack
from geokalman.physics.oblate import j2_gradient_point, j2_point
from geokalman.physics.perturbations import SOLAR_PRESSURE, solar_pressure_point, third_body_point
from geokalman.pulsar.model import CENTURIES, DAY, Array, Mission

SUN_STEP = 3600.0
"""Interval of the tabulated positions of the Sun [s], between which they are interpolated linearly."""
REFLECTION = 1.3 * 12.0 / 700.0
"""Radiation pressure coefficient times area over mass of the orbiter [m^2/kg]."""
GM, RADIUS, J2, LAMBDA, W0, OMEGA, SUN_GM, SUNLIGHT = range(8)


@dataclass(frozen=True)
class Force:
    """The force as arrays: head, field and sun.

    head : constants by the names above; field : for `acceleration_point`; sun : (n, 3) [m].
    """

    head: Array
    field: Array
    sun: Array

    @property
    def packed(self) -> Array:
        """All of it in one vector, as `unpack` takes it."""
        return np.concatenate([[float(len(self.field))], self.head, self.field, self.sun.ravel()])


def j2_force(gravity: GravityField) -> Force:
    """Give point mass and J2 of a field: what the paper's filters carry."""
    head = np.array([gravity.gm, gravity.radius, mars.j2(gravity), 0.0, 0.0, 0.0, 0.0, 0.0])
    return Force(head, np.zeros(1), np.zeros((2, 3)))


def rich_force(
    gravity: GravityField, mission: Mission, mismatch: float = 1.0, ephemeris: Ephemeris | None = None
) -> Force:
    """Give the whole field turning with Mars, the Sun as third body, and sunlight.

    mismatch : lambda; ephemeris : None is the vendored DE421. Raises ValueError for a mismatch that is negative or not
    finite, and OutsideEphemeris.
    """
    if not 0.0 <= mismatch < np.inf:
        raise ValueError(f"mismatch lambda = {mismatch:g} must be finite and not negative.")
    if mismatch == 0.0:
        return j2_force(gravity)
    seconds = SUN_STEP * np.arange(int(np.ceil(mission.days * DAY / SUN_STEP)) + 2)
    sun = (ephemeris or load_ephemeris()).position("sun", mission.orbit.epoch, seconds, centre="mars")
    head = np.array([
        gravity.gm, gravity.radius, mars.j2(gravity), mismatch, mars.prime_meridian(mission.orbit.epoch), mars.OMEGA,
        GM_SUN, SOLAR_PRESSURE * REFLECTION,
    ])  # fmt: skip
    return Force(head, pack(gravity), np.ascontiguousarray(sun @ mars.icrf_from_smci(CENTURIES)))


@njit(cache=True)
def unpack(p):
    """View head, field and sun of a packed force."""
    first, last = 1 + SUNLIGHT + 1, 1 + SUNLIGHT + 1 + int(p[0])
    return p[1:first], p[first:last], p[last:].reshape((p.size - last) // 3, 3)


@njit(cache=True, nogil=True)
def force_point(t, r, head, field, sun, out):
    """Write the acceleration at t [s] and r (3,) [m], inertial Mars frame, to out [m s^-2]."""
    j2_point(r, head[GM], head[RADIUS], head[J2], out)
    share = head[LAMBDA]
    if share == 0.0:
        return
    c, s = np.cos(head[W0] + head[OMEGA] * t), np.sin(head[W0] + head[OMEGA] * t)
    fixed, g, rich, place = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    fixed[0] = c * r[0] + s * r[1]
    fixed[1] = c * r[1] - s * r[0]
    fixed[2] = r[2]
    acceleration_point(fixed, field, g)
    rich[0] = c * g[0] - s * g[1]
    rich[1] = c * g[1] + s * g[0]
    rich[2] = g[2]
    k = min(int(t / SUN_STEP), sun.shape[0] - 2)
    part = t / SUN_STEP - k
    for j in range(3):
        place[j] = (1.0 - part) * sun[k, j] + part * sun[k + 1, j]
    third_body_point(r, place, head[SUN_GM], rich)
    solar_pressure_point(r, place, head[SUNLIGHT], head[RADIUS], rich)
    for j in range(3):
        out[j] += share * (rich[j] - out[j])


@njit(cache=True, nogil=True)
def runge_kutta_step(t, y, h, head, field, sun, work, tau=np.inf):
    """Step y = [r, v] (6,), or [r, v, a] (9,), by the classical Runge-Kutta method, in place.

    a : an acceleration beside the force that decays with tau [s]; work : (3, y.size), scratch.
    """
    stage, total, k = work[0], work[1], work[2]
    for j in range(y.size):
        stage[j] = y[j]
        total[j] = 0.0
    for s in range(4):
        force_point(t + (0.0 if s == 0 else (h if s == 3 else 0.5 * h)), stage[:3], head, field, sun, k[3:6])
        for j in range(3):
            k[j] = stage[3 + j]
        for j in range(6, y.size):
            k[j - 3] += stage[j]
            k[j] = -stage[j] / tau
        weight = 1.0 if s == 0 or s == 3 else 2.0
        reach = h if s == 2 else 0.5 * h
        for j in range(y.size):
            total[j] += weight * k[j]
            stage[j] = y[j] + reach * k[j]
    for j in range(y.size):
        y[j] += h / 6.0 * total[j]


@njit(cache=True, nogil=True)
def gradient_point(r, head, out):
    """Write the gravity gradient (10) of the J2 field, which all filters use, to out [s^-2]."""
    j2_gradient_point(r, head[GM], head[RADIUS], head[J2], out)


@njit(cache=True, nogil=True)
def orbit_loop(y0, t, steps, head, field, sun, out):
    """Fill out (n, 6) with states at t (n,) from y0 at t = 0, `steps` Runge-Kutta steps each.

    Returns -1, or the row where the orbit met Mars or stopped being finite.
    """
    y, work = y0.copy(), np.empty((3, 6))
    now = 0.0
    for i in range(t.size):
        h = (t[i] - now) / steps
        for j in range(steps):
            runge_kutta_step(now + j * h, y, h, head, field, sun, work)
        now = t[i]
        out[i] = y
        if not y[0] ** 2 + y[1] ** 2 + y[2] ** 2 >= head[RADIUS] ** 2:
            return i
    return -1
