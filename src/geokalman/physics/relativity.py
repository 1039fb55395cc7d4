"""Relativity at the post-Newtonian level near the Earth: the Schwarzschild acceleration and the delay of light
(Shapiro).

Source: IERS Conventions (2010), Technical Note 36, equations 10.12 (first term) and 11.17.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from geokalman.constants import C_LIGHT

L_G = 6.969290134e-10
"""Defining constant of TT, 1 - dTT/dTCG (IAU 2000 resolution B1.9)."""


@njit(cache=True)
def schwarzschild_point(r: np.ndarray, v: np.ndarray, gm: float, out: np.ndarray) -> None:
    """Add the Schwarzschild term a = GM/(c^2 r^3) [(4 GM/r - v^2) r + 4 (r.v) v], to out (3,) [m s^-2].

    r, v : (3,) position and velocity relative to the central body [m, m/s]; gm [m^3 s^-2].
    """
    distance = math.sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2])
    v2 = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
    rv = r[0] * v[0] + r[1] * v[1] + r[2] * v[2]
    f = gm / (C_LIGHT * C_LIGHT * distance * distance * distance)
    for j in range(3):
        out[j] += f * ((4.0 * gm / distance - v2) * r[j] + 4.0 * rv * v[j])


@njit(cache=True)
def shapiro(r1: float, r2: float, distance: float, gm: float) -> float:
    """Extra light time 2 GM/c^3 ln[(r1 + r2 + D)/(r1 + r2 - D)] between two points [s].

    r1, r2 : distances from the body [m]; distance D between the points [m]; gm [m^3 s^-2].
    """
    return 2.0 * gm / C_LIGHT**3 * math.log((r1 + r2 + distance) / (r1 + r2 - distance))
