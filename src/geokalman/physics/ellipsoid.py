"""Level ellipsoids: their normal gravity field in closed form, and the geoid over them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from geokalman.constants import A_EARTH, OMEGA_EARTH
from geokalman.physics.field import Array, GravityField
from geokalman.physics.sphere import synthesis, synthesis_points

_DEGREES = range(2, 21, 2)  # even zonals beyond degree 20 are below 1e-25


@dataclass(frozen=True)
class Ellipsoid:
    """A rotating ellipsoid of revolution that is a level surface of its own gravity (Somigliana-Pizzetti).

    Parameters
    ----------
    name : str
    a : semi-major axis [m]
    f : flattening
    gm : gravitational constant times mass [m^3 s^-2]
    omega : rotation rate [rad s^-1]

    Source of all equations: Heiskanen & Moritz (1967), Physical Geodesy, sections 2-7 to 2-9; Moritz (2000), GRS80.
    """

    name: str
    a: float
    f: float
    gm: float
    omega: float

    @property
    def b(self) -> float:
        """Semi-minor axis a (1 - f) [m]."""
        return self.a * (1.0 - self.f)

    @property
    def e2(self) -> float:
        """First eccentricity squared, f (2 - f)."""
        return self.f * (2.0 - self.f)

    @property
    def _m(self) -> float:
        return self.omega**2 * self.a**2 * self.b / self.gm

    @property
    def _second(self) -> tuple[float, float, float]:
        """Second eccentricity e', q_0 and q_0'."""
        e = math.sqrt(self.e2) / (1.0 - self.f)
        # series, because 1/2 [(1 + 3/e'^2) atan e' - 3/e'] and 3 (1 + 1/e'^2)(1 - atan(e')/e') - 1 cancel
        terms = range(1, 25)
        q0 = sum(2 * (-1) ** (k + 1) * k * e ** (2 * k + 1) / ((2 * k + 1) * (2 * k + 3)) for k in terms)
        q1 = sum(6 * (-1) ** (k + 1) * e ** (2 * k) / ((2 * k + 1) * (2 * k + 3)) for k in terms)
        return e, q0, q1

    @property
    def j2(self) -> float:
        """Dynamic form factor J_2 = e^2/3 (1 - 2/15 m e'/q_0), equation 2-90."""
        e, q0, _ = self._second
        return self.e2 / 3.0 * (1.0 - 2.0 / 15.0 * self._m * e / q0)

    def even_zonals(self, n_max: int) -> Array:
        """Fully normalised C_n0 (n_max+1,) of the normal potential, referred to a; zero but for even degrees up to 20.

        J_2k = (-1)^(k+1) 3 e^2k / ((2k+1)(2k+3)) (1 - k + 5 k J_2/e^2), C_2k,0 = -J_2k / sqrt(4k+1), equation 2-92.
        """
        zonals = np.zeros(n_max + 1)
        zonals[0] = 1.0
        for n in (n for n in _DEGREES if n <= n_max):
            k = n // 2
            j = (-1) ** (k + 1) * 3 * self.e2**k / ((2 * k + 1) * (2 * k + 3)) * (1 - k + 5 * k * self.j2 / self.e2)
            zonals[n] = -j / math.sqrt(4 * k + 1)
        return zonals

    @property
    def gravity_equator(self) -> float:
        """Normal gravity at the equator [m s^-2], equation 2-73."""
        e, q0, q1 = self._second
        return self.gm / (self.a * self.b) * (1.0 - self._m - self._m / 6.0 * e * q1 / q0)

    @property
    def gravity_pole(self) -> float:
        """Normal gravity at the poles [m s^-2], equation 2-74."""
        e, q0, q1 = self._second
        return self.gm / self.a**2 * (1.0 + self._m / 3.0 * e * q1 / q0)

    def gravity(self, lat: ArrayLike) -> Array:
        """Normal gravity on the ellipsoid [m s^-2] at geodetic latitudes [rad] (Somigliana), equation 2-76."""
        c2, s2 = np.cos(lat) ** 2, np.sin(lat) ** 2
        top = self.a * self.gravity_equator * c2 + self.b * self.gravity_pole * s2
        return top / np.sqrt(self.a**2 * c2 + self.b**2 * s2)

    def geocentric(self, lat: ArrayLike) -> tuple[Array, Array]:
        """Geocentric latitude [rad] and radius [m] of the points of the ellipsoid at geodetic latitudes [rad]."""
        c, s = np.cos(lat), np.sin(lat)
        n = self.a / np.sqrt(1.0 - self.e2 * s**2)
        x, z = n * c, n * (1.0 - self.e2) * s
        return np.arctan2(z, x), np.hypot(x, z)


WGS84 = Ellipsoid("WGS84", A_EARTH, 1.0 / 298.257223563, 3.986004418e14, OMEGA_EARTH)
GRS80 = Ellipsoid("GRS80", A_EARTH, 1.0 / 298.257222101, 3.986005e14, OMEGA_EARTH)


def geoid_height(
    field: GravityField,
    lat: ArrayLike,
    lon: ArrayLike,
    ellipsoid: Ellipsoid = WGS84,
    zero_degree: float = 0.0,
    grid: bool = False,
) -> Array:
    """Height of the geoid above the ellipsoid by Bruns' equation on the ellipsoid's surface.

    N = N_0 + GM/(r gamma) sum_(n>=2) (R/r)^n sum_m (dC_nm cos m lambda + S_nm sin m lambda) P_nm(sin phi'), where dC
    are the coefficients less the ellipsoid's even zonals, r and phi' radius and geocentric latitude of the point.
    The difference of height anomaly and geoid under mountains (1 to 2 m at most) is not in it.

    Parameters
    ----------
    field : gravity field
    lat, lon : geodetic latitude and longitude [rad], (k,) each; with `grid` (n_lat,) and (n_lon,)
    ellipsoid : the level ellipsoid
    zero_degree : N_0 [m]; -0.53 for EGM96 over WGS84 (Lemoine et al. 1998)
    grid : whether lat and lon are the axes of a grid rather than the points' coordinates

    Returns
    -------
    (k,) or (n_lat, n_lon) float64 [m]
    """
    lat = np.atleast_1d(np.asarray(lat, dtype=float))
    C, S = field.C.copy(), field.S
    scale = ellipsoid.gm / field.gm * (ellipsoid.a / field.radius) ** np.arange(field.n_max + 1.0)
    C[:, 0] -= ellipsoid.even_zonals(field.n_max) * scale
    C[0, 0] = 0.0
    geocentric, r = ellipsoid.geocentric(lat)
    factor = field.gm / (r * ellipsoid.gravity(lat))
    if grid:
        return zero_degree + factor[:, None] * synthesis(C, S, geocentric, lon, q=field.radius / r)
    return zero_degree + factor * synthesis_points(C, S, geocentric, lon, q=field.radius / r)
