"""The way of a pulse through the solar system: Roemer delay, parallax, the Sun's Shapiro delay, and their differences.

t_SSB = t + n.b/c + ((n.b)^2 - b^2)/(2 c D) + (2 GM_Sun/c^3) ln|n.b_S + |b_S||, with b from the barycentre and b_S from
the Sun.
The differences between the orbiter and the centre of Mars are formed without cancellation. Source: Sheikh (2005).
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
    """Roemer delay n.b/c [s]; n (3,) to the pulsar, b (..., 3) from the barycentre [m]."""
    return b @ n / C_LIGHT


def parallax(n: Array, b: Array, distance: float) -> Array:
    """Parallax ((n.b)^2 - b^2)/(2 c D) [s]; b (..., 3) [m], distance D [m]."""
    return ((b @ n) ** 2 - np.einsum("...i,...i", b, b)) / (2.0 * C_LIGHT * distance)


def shapiro(n: Array, b_sun: Array) -> Array:
    """Shapiro delay (2 GM/c^3) ln|n.b_S + |b_S|| [s], up to a constant; b_S (..., 3) from the Sun [m]."""
    return SHAPIRO * np.log(np.abs(b_sun @ n + np.sqrt(np.einsum("...i,...i", b_sun, b_sun))))


def differential_parallax(n: Array, b: Array, r: Array, distance: float) -> Array:
    """Parallax at b + r minus that at b [m]: ((n.r)(2 n.b + n.r) - r.(2 b + r))/(2 D); b, r (..., 3) [m]."""
    nr = r @ n
    return (nr * (2.0 * (b @ n) + nr) - np.einsum("...i,...i", r, 2.0 * b + r)) / (2.0 * distance)


def differential_shapiro(n: Array, b_sun: Array, r: Array) -> Array:
    """Shapiro delay at b_S + r minus that at b_S [m]: c (2 GM/c^3) ln(1 + change / (n.b_S + |b_S|)); b_S, r (...,
    3) [m]."""
    norm = np.sqrt(np.einsum("...i,...i", b_sun, b_sun))
    moved = np.sqrt(np.einsum("...i,...i", b_sun + r, b_sun + r))
    change = r @ n + np.einsum("...i,...i", r, 2.0 * b_sun + r) / (moved + norm)
    return C_LIGHT * SHAPIRO * np.log1p(change / (b_sun @ n + norm))


def largest_parallax(n: Array, b: Array, height: float, distance: float) -> Array:
    """Largest differential parallax [m] over all directions of an orbiter `height` [m] from the centre: |(n.b) n -
    b| r/D."""
    across = (b @ n)[..., None] * n - b
    return np.sqrt(np.einsum("...i,...i", across, across)) * height / distance


def largest_shapiro(n: Array, b_sun: Array, height: float) -> Array:
    """Largest differential Shapiro delay [m] over all directions, to first order: c (2 GM/c^3) |n + b_S/|b_S||
    r/(n.b_S + |b_S|)."""
    norm = np.sqrt(np.einsum("...i,...i", b_sun, b_sun))
    gradient = n + b_sun / norm[..., None]
    return C_LIGHT * SHAPIRO * np.sqrt(np.einsum("...i,...i", gradient, gradient)) * height / (b_sun @ n + norm)


def sun_angle(n: Array, b_sun: Array) -> Array:
    """Angle [rad] between pulsar and Sun as seen from Mars; b_S (..., 3) from the Sun to Mars [m]."""
    cosine = -(b_sun @ n) / np.sqrt(np.einsum("...i,...i", b_sun, b_sun))
    return np.arccos(np.clip(cosine, -1.0, 1.0))


def near_sun(directions: Array, b_sun: Array, limit: float = CONJUNCTION) -> NDArray[np.bool_]:
    """Which ranges to mask: pulsars (m, 3) closer to the Sun than `limit` [rad], Mars at b_S (n, 3) from the Sun
    [m]; (n, m).

    Directions and b_S in the same axes.
    """
    return np.column_stack([sun_angle(n, b_sun) for n in directions]) < limit
