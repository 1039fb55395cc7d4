"""Delays of a pulse in the solar system, and what they differ by at the orbiter.

Roemer delay, parallax and the Sun's Shapiro delay: t_SSB = t + n.b/c + ((n.b)^2 - b^2)/(2 c D)
+ (2 GM_Sun/c^3) ln|n.b_S + |b_S||, with b (..., 3) [m] from the barycentre, b_S (..., 3) [m] from the Sun, n (3,) to
the pulsar, D [m] its distance. Differences between the orbiter, r (..., 3) [m] from the centre of Mars, and that centre
are formed without cancellation. A clock that moves runs slow by its speed and its depth in the field of gravity: the
Einstein delay. Source: Sheikh (2005); Moyer (1981), Celestial Mechanics 23, 33-56.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geokalman.constants import C_LIGHT, GM_SUN

Array = NDArray[np.float64]
SHAPIRO = 2.0 * GM_SUN / C_LIGHT**3
"""Time scale of the Sun's Shapiro delay [s]."""
CONJUNCTION = np.radians(5.0)
"""Angle to the Sun [rad] below which the linear observation (13) misses more than a metre: such ranges are to be
masked."""


def roemer(n: Array, b: Array) -> Array:
    """Give the Roemer delay n.b/c [s]."""
    return b @ n / C_LIGHT


def parallax(n: Array, b: Array, distance: float) -> Array:
    """Give the parallax ((n.b)^2 - b^2)/(2 c D) [s]."""
    return ((b @ n) ** 2 - np.einsum("...i,...i", b, b)) / (2.0 * C_LIGHT * distance)


def shapiro(n: Array, b_sun: Array) -> Array:
    """Give the Shapiro delay (2 GM/c^3) ln|n.b_S + |b_S|| [s], up to a constant."""
    return SHAPIRO * np.log(np.abs(b_sun @ n + np.sqrt(np.einsum("...i,...i", b_sun, b_sun))))


def differential_parallax(n: Array, b: Array, r: Array, distance: float) -> Array:
    """Difference the parallax [m]: ((n.r)(2 n.b + n.r) - r.(2 b + r))/(2 D)."""
    nr = r @ n
    return (nr * (2.0 * (b @ n) + nr) - np.einsum("...i,...i", r, 2.0 * b + r)) / (2.0 * distance)


def differential_shapiro(n: Array, b_sun: Array, r: Array) -> Array:
    """Difference the Shapiro delay [m]: c (2 GM/c^3) ln(1 + change / (n.b_S + |b_S|))."""
    norm = np.sqrt(np.einsum("...i,...i", b_sun, b_sun))
    moved = np.sqrt(np.einsum("...i,...i", b_sun + r, b_sun + r))
    change = r @ n + np.einsum("...i,...i", r, 2.0 * b_sun + r) / (moved + norm)
    return C_LIGHT * SHAPIRO * np.log1p(change / (b_sun @ n + norm))


def largest_parallax(n: Array, b: Array, height: float, distance: float) -> Array:
    """Give the largest difference [m] `height` [m] from the centre: |(n.b) n - b| r/D."""
    across = (b @ n)[..., None] * n - b
    return np.sqrt(np.einsum("...i,...i", across, across)) * height / distance


def largest_shapiro(n: Array, b_sun: Array, height: float) -> Array:
    """Give the largest difference [m] to first order, `height` [m] from the centre.

    c (2 GM/c^3) |n + b_S/|b_S|| r/(n.b_S + |b_S|).
    """
    norm = np.sqrt(np.einsum("...i,...i", b_sun, b_sun))
    gradient = n + b_sun / norm[..., None]
    return C_LIGHT * SHAPIRO * np.sqrt(np.einsum("...i,...i", gradient, gradient)) * height / (b_sun @ n + norm)


def sun_angle(n: Array, b_sun: Array) -> Array:
    """Give the angle [rad] between pulsar and Sun as seen from Mars."""
    cosine = -(b_sun @ n) / np.sqrt(np.einsum("...i,...i", b_sun, b_sun))
    return np.arccos(np.clip(cosine, -1.0, 1.0))


def near_sun(directions: Array, b_sun: Array, limit: float = CONJUNCTION) -> NDArray[np.bool_]:
    """Tell which ranges to mask: pulsars (m, 3) closer to the Sun than `limit` [rad]; (n, m).

    b_sun : (n, 3), in the axes of the directions.
    """
    return np.column_stack([sun_angle(n, b_sun) for n in directions]) < limit


def clock_drift(gm: float, a: float) -> float:
    """Give the mean rate by which a clock on an ellipse about a body runs slow: (3/2) GM/(a c^2), without unit."""
    return 1.5 * gm / (a * C_LIGHT**2)


def clock_swing(gm: float, a: float, e: float) -> float:
    """Give the amplitude [s] of the periodic part, 2 sqrt(GM a) e/c^2 sin E, with the eccentric anomaly E."""
    return 2.0 * np.sqrt(gm * a) * e / C_LIGHT**2


def clock_offset(t: Array, r: Array, v: Array, gm: float) -> Array:
    """Integrate how much a clock runs slow [s]: (1/c^2) int (v^2/2 + GM/r) dt, by the trapezoidal rule.

    t (n,) [s]; r, v (n, 3) [m, m/s] about the body of gm [m^3 s^-2].
    """
    rate = (0.5 * np.einsum("...i,...i", v, v) + gm / np.sqrt(np.einsum("...i,...i", r, r))) / C_LIGHT**2
    return np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(t))])


def clock_place(v: Array, height: float) -> float:
    """Give the largest v.r/c^2 [s] of a place r, `height` [m] from the centre of a body with velocities v (n, 3)."""
    return float(np.sqrt(np.einsum("...i,...i", v, v)).max() * height / C_LIGHT**2)
