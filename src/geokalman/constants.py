"""Physical constants: value, unit, source. One place, so that a number is never typed twice."""

from typing import Final

# Earth, as used with EGM96 (Lemoine et al. 1998, NASA/TP-1998-206861)
GM_EARTH: Final = 3.986004415e14
"""Geocentric gravitational constant of EGM96 and JGM-3 [m^3 s^-2]."""
R_EARTH: Final = 6378136.3
"""Reference radius of EGM96 and JGM-3 [m]."""
A_EARTH: Final = 6378137.0
"""Semi-major axis of the GRS80 and WGS84 ellipsoids [m]; heights above it are for orientation only."""
OMEGA_EARTH: Final = 7.292115e-5
"""Mean angular velocity of the Earth's rotation [rad s^-1] (GRS80, Moritz 2000)."""
R_MEAN_EARTH: Final = 6371000.0
"""Mean radius of the Earth used for Gaussian smoothing radii [m] (Wahr, Molenaar & Bryan 1998)."""

# Solar system
C_LIGHT: Final = 299792458.0
"""Speed of light in vacuum [m s^-1], exact (BIPM 2019)."""
AU: Final = 1.49597870700e11
"""Astronomical unit [m], exact (IAU 2012 resolution B2)."""
PARSEC: Final = 3.0856775814913673e16
"""Parsec [m], 648000/pi astronomical units (IAU 2015 resolution B2)."""
GM_SUN: Final = 1.32712440018e20
"""Heliocentric gravitational constant [m^3 s^-2] (IERS Conventions 2010 round to 1.32712442099e20 in TCB; this is TDB,
DE405)."""
J2000: Final = 2451545.0
"""Julian date (TDB) of the epoch J2000.0 [d]."""
