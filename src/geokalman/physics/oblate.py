"""A point mass with J2: acceleration and gravity gradient at a point, as compiled kernels on plain arrays.

Source: mars-pulsar (3) and (10); any textbook, e.g. Montenbruck & Gill (2000), section 3.2.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from geokalman.physics.dop853 import FORCE


@njit(cache=True)
def j2_point(r: np.ndarray, gm: float, radius: float, j2: float, out: np.ndarray) -> None:
    """Acceleration of an oblate body, written to out (3,) [m s^-2].

    a_xy = -(GM/r^3) (1 + k (1 - s)) r_xy,  a_z = -(GM/r^3) (1 + k (3 - s)) z,  k = 3/2 J2 (R/r)^2,  s = 5 z^2/r^2.
    r : (3,) in axes of the body's equator [m]; gm [m^3 s^-2]; radius R [m].
    """
    r2 = r[0] * r[0] + r[1] * r[1] + r[2] * r[2]
    k = 1.5 * j2 * radius * radius / r2
    s = 5.0 * r[2] * r[2] / r2
    f = -gm / (r2 * math.sqrt(r2))
    out[0] = f * (1.0 + k * (1.0 - s)) * r[0]
    out[1] = f * (1.0 + k * (1.0 - s)) * r[1]
    out[2] = f * (1.0 + k * (3.0 - s)) * r[2]


@njit(cache=True)
def j2_gradient_point(r: np.ndarray, gm: float, radius: float, j2: float, out: np.ndarray) -> None:
    """Gradient d(acceleration)/dr of `j2_point`, written to out (3, 3) [s^-2]; symmetric and without a trace.

    r : (3,) [m]; gm [m^3 s^-2]; radius [m].
    """
    x, y, z = r[0], r[1], r[2]
    u = 1.0 / (x * x + y * y + z * z)
    u3 = gm * u * math.sqrt(u)  # GM / r^3
    K = 1.5 * j2 * radius * radius * u
    s = z * z * u
    f = -u3 * (1.0 + K - 5.0 * K * s)
    g = -u3 * (1.0 + 3.0 * K - 5.0 * K * s)
    c1 = u3 * u * (3.0 + 5.0 * K - 35.0 * K * s)
    c2 = u3 * u * (3.0 + 15.0 * K - 35.0 * K * s)
    d = 10.0 * u3 * u * K * z
    out[0, 0] = f + c1 * x * x
    out[0, 1] = c1 * x * y
    out[0, 2] = x * (c1 * z + d)
    out[1, 0] = out[0, 1]
    out[1, 1] = f + c1 * y * y
    out[1, 2] = y * (c1 * z + d)
    out[2, 0] = out[0, 2]
    out[2, 1] = out[1, 2]
    out[2, 2] = g + z * (c2 * z + d)


@njit(FORCE, cache=True)
def oblate_force(t, y, params, acceleration):
    """The same acceleration as a force for `orbit.integrate`, inertial axes of the equator; params = [gm, radius,
    j2]."""
    for b in range(y.size // 6):
        j2_point(y[6 * b : 6 * b + 3], params[0], params[1], params[2], acceleration[3 * b : 3 * b + 3])
