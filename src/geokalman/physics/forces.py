"""Compiled forces for the orbit integrators, and the constants of motion that check them.

A force is a function ``force(t, y, params, acceleration)`` compiled with the signature `FORCE`: t [s]; y (6 k,) the
states [r, v] of k bodies one after the other [m, m/s]; params a flat float64 array of its own; acceleration (3 k,) is
written [m s^-2].
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from geokalman.physics.dop853 import FORCE
from geokalman.physics.frames import to_ecef
from geokalman.physics.gravity import acceleration_point, pack, potential
from geokalman.physics.harmonics import GravityField


def gravity_params(field: GravityField, omega: float, n_max: int | None = None) -> np.ndarray:
    """Parameters of `gravity_force`: the rotation rate [rad s^-1], then the packed field to degree and order n_max."""
    if not math.isfinite(omega):
        raise ValueError(f"rotation rate omega = {omega} rad/s must be a finite number.")
    return np.concatenate([[omega], pack(field, n_max)])


@njit(FORCE, cache=True)
def gravity_force(t, y, params, acceleration):
    """Gravity of a body turning uniformly about z, in inertial components: a = Rz(omega t)' g(Rz(omega t) r).

    params from `gravity_params`; any number of bodies, which do not attract one another.
    """
    c, s = math.cos(params[0] * t), math.sin(params[0] * t)
    fixed, g = np.empty(3), np.empty(3)
    for b in range(y.size // 6):
        x = y[6 * b : 6 * b + 3]
        fixed[0] = c * x[0] + s * x[1]
        fixed[1] = c * x[1] - s * x[0]
        fixed[2] = x[2]
        acceleration_point(fixed, params[1:], g)
        acceleration[3 * b] = c * g[0] - s * g[1]
        acceleration[3 * b + 1] = c * g[1] + s * g[0]
        acceleration[3 * b + 2] = g[2]


@njit(FORCE, cache=True)
def kepler_force(t, y, params, acceleration):
    """Attraction of a point mass at the origin, a = -GM r / |r|^3; params = [GM]."""
    for b in range(y.size // 6):
        r2 = y[6 * b] ** 2 + y[6 * b + 1] ** 2 + y[6 * b + 2] ** 2
        f = -params[0] / (r2 * math.sqrt(r2))
        for d in range(3):
            acceleration[3 * b + d] = f * y[6 * b + d]


def jacobi_constant(
    t: np.ndarray, r: np.ndarray, v: np.ndarray, field: GravityField, omega: float, n_max: int | None = None
) -> np.ndarray:
    """Jacobi constant of motion in a uniformly turning field, v^2/2 - V(r) - omega (x v_y - y v_x).

    t (n,) [s]; r, v (n, ..., 3) inertial position [m] and velocity [m/s], time first; omega [rad s^-1]
    Returns (n, ...) [m^2 s^-2]: constant along an orbit integrated in `field` to degree n_max.
    """
    V = potential(field, to_ecef(t, r, omega), n_max)
    return 0.5 * np.sum(v * v, axis=-1) - V - omega * (r[..., 0] * v[..., 1] - r[..., 1] * v[..., 0])
