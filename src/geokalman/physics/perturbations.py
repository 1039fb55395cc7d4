"""Accelerations of an orbiter by a third body and by sunlight, as compiled kernels on plain arrays.

Source: Montenbruck & Gill (2000), Satellite Orbits, sections 3.3 and 3.4.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from geokalman.constants import AU

SOLAR_PRESSURE = 4.56e-6
"""Pressure of sunlight on an absorbing surface at 1 AU [N/m^2] (Montenbruck & Gill 2000, equation 3.69)."""


@njit(cache=True)
def third_body_point(r: np.ndarray, s: np.ndarray, gm: float, out: np.ndarray) -> None:
    """Add the tide of a third body: a = GM ((s - r)/|s - r|^3 - s/|s|^3), to out (3,) [m s^-2].

    r, s : (3,) orbiter and third body from the central one [m]; gm of the third body [m^3 s^-2].
    """
    d2 = (s[0] - r[0]) ** 2 + (s[1] - r[1]) ** 2 + (s[2] - r[2]) ** 2
    s2 = s[0] ** 2 + s[1] ** 2 + s[2] ** 2
    near, far = gm / (d2 * math.sqrt(d2)), gm / (s2 * math.sqrt(s2))
    for j in range(3):
        out[j] += near * (s[j] - r[j]) - far * s[j]


@njit(cache=True)
def solar_pressure_point(r: np.ndarray, s: np.ndarray, at_one_au: float, radius: float, out: np.ndarray) -> None:
    """Add the pressure of sunlight, away from the Sun, zero in a cylindrical shadow, to out (3,) [m s^-2].

    r, s : (3,) orbiter and Sun from the central body [m]; at_one_au : C_R P A/m [m s^-2]; radius of the shadow [m].
    """
    s2 = s[0] ** 2 + s[1] ** 2 + s[2] ** 2
    along = (r[0] * s[0] + r[1] * s[1] + r[2] * s[2]) / s2
    if along < 0.0:
        across = (r[0] - along * s[0]) ** 2 + (r[1] - along * s[1]) ** 2 + (r[2] - along * s[2]) ** 2
        if across < radius * radius:
            return
    d2 = (s[0] - r[0]) ** 2 + (s[1] - r[1]) ** 2 + (s[2] - r[2]) ** 2
    scale = at_one_au * AU * AU / (d2 * math.sqrt(d2))
    for j in range(3):
        out[j] -= scale * (s[j] - r[j])
