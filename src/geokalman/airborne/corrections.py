"""What is taken from a vertical accelerometer before gravity is left: normal gravity, its change with height,
Eotvos.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from geokalman.constants import A_EARTH, OMEGA_EARTH
from geokalman.physics.ellipsoid import GRS80

MGAL = 1e-5
"""One milligal [m/s^2]."""


def latitude_correction(lat: ArrayLike) -> np.ndarray:
    """Normal gravity on the GRS80 ellipsoid [mGal] at geodetic latitudes [rad] (Somigliana)."""
    return GRS80.gravity(lat) / MGAL


def free_air(lat: ArrayLike, height: ArrayLike) -> np.ndarray:
    """What normal gravity loses from the ellipsoid up to a height, to second order [mGal].

    (0.3087691 - 0.0004398 sin^2 phi) h - 7.2125e-8 h^2.
    lat : geodetic latitude [rad]; height : above the ellipsoid [m].
    Source: Heiskanen & Moritz (1967), section 2-10, with GRS80 numbers.
    """
    h = np.asarray(height, dtype=float)
    return (0.3087691 - 0.0004398 * np.sin(lat) ** 2) * h - 7.2125e-8 * h**2


def normal_gravity(lat: ArrayLike, height: ArrayLike) -> np.ndarray:
    """Normal gravity at flight height, g0 of equation (8) [mGal].  lat [rad]; height above the ellipsoid [m]."""
    return latitude_correction(lat) - free_air(lat, height)


def eotvos(lat: ArrayLike, height: ArrayLike, v_east: ArrayLike, v_north: ArrayLike) -> np.ndarray:
    """Eotvos term of equation (8): 2 Omega v_E cos phi + v_E^2/(N + h) + v_N^2/(M + h) [mGal].

    lat [rad]; height [m]; v_east, v_north [m/s]; N and M the radii of curvature of GRS80.
    """
    s2 = np.sin(lat) ** 2
    n = A_EARTH / np.sqrt(1.0 - GRS80.e2 * s2)
    m = n * (1.0 - GRS80.e2) / (1.0 - GRS80.e2 * s2)
    v_e, v_n = np.asarray(v_east, dtype=float), np.asarray(v_north, dtype=float)
    return (2.0 * OMEGA_EARTH * v_e * np.cos(lat) + v_e**2 / (n + height) + v_n**2 / (m + height)) / MGAL
