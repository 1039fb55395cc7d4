"""Mars: orientation of its pole and prime meridian, equatorial and body-fixed frames, and its gravity field.

Pole and prime meridian are those of the IAU (Seidelmann et al. 2002, as in NAIF's pck00010); an ephemeris such as DE421
holds no orientation of Mars. ``R_ab`` takes components from frame b to frame a: icrf, smci (Mars equator of date,
inertial,
x axis at the node of the Mars equator on the Earth's), fixed (turning with Mars).
"""

from __future__ import annotations

import math
import os

import numpy as np
from numpy.typing import NDArray

from geokalman.constants import J2000
from geokalman.physics.field import MARS
from geokalman.physics.frames import rotation_z
from geokalman.physics.harmonics import GravityField, load_field

POLE_RA = (317.68143, -0.1061)
"""Right ascension of the pole [deg] and its rate [deg per Julian century]."""
POLE_DEC = (52.88650, -0.0609)
"""Declination of the pole [deg] and its rate [deg per Julian century]."""
MERIDIAN = (176.630, 350.89198226)
"""Angle W of the prime meridian [deg] at J2000 and its rate [deg per day]."""
RADIUS = 3397.0e3
"""Reference radius of GMM-2B [m]; below it an orbiter has hit Mars."""
OMEGA = math.radians(MERIDIAN[1]) / 86400.0
"""Rotation rate of Mars [rad/s]."""


def rotation_x(angle: float) -> NDArray[np.float64]:
    """Rotation of the axes about x, Rx(angle) = [[1, 0, 0], [0, cos, sin], [0, -sin, cos]]; angle [rad]."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]])


def icrf_from_smci(centuries: float) -> NDArray[np.float64]:
    """R_icrf_smci = Rz(-F) Rx(-I) Rz(-E) with F = alpha_0 + 90 deg, I = 90 deg - delta_0, E = 0.

    centuries : Julian centuries TDB since J2000. Returns (3, 3). Source: mars-pulsar (1), IAU pole.
    """
    F = math.radians(POLE_RA[0] + POLE_RA[1] * centuries + 90.0)
    inclination = math.radians(90.0 - POLE_DEC[0] - POLE_DEC[1] * centuries)
    return rotation_z(-F) @ rotation_x(-inclination)


def smci_from_icrf(centuries: float) -> NDArray[np.float64]:
    """R_smci_icrf, the transpose of `icrf_from_smci`: (3, 3)."""
    return np.ascontiguousarray(icrf_from_smci(centuries).T)


def prime_meridian(jd: float) -> float:
    """Angle W of the prime meridian [rad] at a Julian date TDB: fixed = Rz(W) smci."""
    return math.radians((MERIDIAN[0] + MERIDIAN[1] * (jd - J2000)) % 360.0)


def gravity(n_max: int | None = None, path: str | os.PathLike = "") -> GravityField:
    """The vendored GMM-2B (degree 20), or the ICGEM file of another model of Mars at a path, to degree n_max.

    Raises ValueError for a degree that the field lacks, and for a field that cannot be that of Mars: GM or radius in
    kilometres, unnormalised coefficients, another body. Source: Lemoine et al. (2001), J. Geophys. Res. 106(E10).
    """
    return load_field(os.fspath(path) or "GMM2B", n_max, MARS)


def j2(field: GravityField) -> float:
    """Second zonal harmonic J2 = -sqrt(5) C20 of a fully normalised field."""
    return -math.sqrt(5.0) * float(field.C[2, 0])
