"""Orientation of the Earth in space: IAU 2006/2000A with the vendored series EOP 20 C04 of the IERS, 2011 to 2019.

    R_gcrs_itrs = Q(X, Y, s) Rz(-ERA(UT1)) W(xp, yp),   W = Rz(-s') Ry(xp) Rx(yp).

Daily values are interpolated linearly (UT1 through UT1 - TAI, which has no steps); corrections dX, dY (below 0.3 mas in
these years, 0.01 m on the ground) and sub-daily terms are left out. Source: IERS Conventions (2010), section 5.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import erfa
import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from geokalman.data import data_path
from geokalman.physics.timescales import MJD_ZERO, tai_minus_utc, tt_minus_utc

Array = NDArray[np.float64]
DAY = 86400.0
COLUMNS = 6
"""Columns of a table row: X, Y, s - s' [rad], UT1 - UTC [s], xp, yp [rad]."""
ERA_RATE = 2.0 * math.pi * 1.00273781191135448 / DAY
"""Rate of the Earth rotation angle [rad per second of UT1]."""
_VENDORED = "eop_c04.npz"


class OutsideOrientation(ValueError):
    """A time that the vendored Earth orientation does not cover."""


@dataclass(frozen=True, eq=False)
class EarthOrientation:
    """Daily Earth orientation: modified Julian dates (n,), pole xp, yp (n,) [rad], UT1 - TAI (n,) [s]."""

    mjd: Array
    xp: Array
    yp: Array
    ut1_tai: Array

    def table(self, day: int, t: ArrayLike) -> Array:
        """Rows of `COLUMNS` at t (n,) [s since 0h UTC of the day, uniform]: what `gcrs_from_itrs_step` interpolates in.

        Raises OutsideOrientation where a time is not covered.
        """
        t = np.asarray(t, dtype=float)
        date = day + t / DAY
        bad = ~((date >= self.mjd[0]) & (date <= self.mjd[-1]))
        if bad.any():
            raise OutsideOrientation(
                f"MJD {date[bad.argmax()]:.2f} is outside the Earth orientation, which covers MJD {self.mjd[0]:.0f} to"
                f" {self.mjd[-1]:.0f} (2011-01-01 to 2020-01-01)."
            )
        tt = day + (t + tt_minus_utc(day)) / DAY
        x, y, s = erfa.xys06a(MJD_ZERO, tt)
        ut1_utc = np.interp(date, self.mjd, self.ut1_tai) + tai_minus_utc(day)
        pole = [np.interp(date, self.mjd, column) for column in (self.xp, self.yp)]
        return np.column_stack([x, y, s - erfa.sp00(MJD_ZERO, tt), ut1_utc, *pole])

    def gcrs_from_itrs(self, day: int, t: ArrayLike) -> Array:
        """R_gcrs_itrs at t (n,) [s since 0h UTC of the day]: (n, 3, 3). Raises OutsideOrientation."""
        t = np.atleast_1d(np.asarray(t, dtype=float))
        rows, out = self.table(day, t), np.empty((len(t), 3, 3))
        start = era_at_midnight(day)
        for k, row in enumerate(rows):
            orientation_point(row, start + ERA_RATE * (t[k] + row[3]), out[k])
        return out


def era_at_midnight(day: int) -> float:
    """Earth rotation angle at 0h UT1 of the day [rad]."""
    return float(erfa.era00(MJD_ZERO, float(day)))


@njit(cache=True)
def orientation_point(row: np.ndarray, era: float, out: np.ndarray) -> None:
    """R_gcrs_itrs of one table row (6,) at the Earth rotation angle era [rad], written to out (3, 3)."""
    X, Y = row[0], row[1]
    a = 1.0 / (1.0 + math.sqrt(1.0 - X * X - Y * Y))
    turn = era - row[2]  # Rz(s) Rz(-ERA) Rz(-s')
    c, s = math.cos(turn), math.sin(turn)
    cx, sx, cy, sy = math.cos(row[4]), math.sin(row[4]), math.cos(row[5]), math.sin(row[5])
    # W = Ry(xp) Rx(yp) with Ry = [[c, 0, -s], [0, 1, 0], [s, 0, c]], Rx = [[1, 0, 0], [0, c, s], [0, -s, c]]
    w00, w01, w02 = cx, sx * sy, -sx * cy
    w11, w12 = cy, sy
    w20, w21, w22 = sx, -cx * sy, cx * cy
    # Rz(-turn) W
    b00, b01, b02 = c * w00, c * w01 - s * w11, c * w02 - s * w12
    b10, b11, b12 = s * w00, s * w01 + c * w11, s * w02 + c * w12
    q00, q01, q11 = 1.0 - a * X * X, -a * X * Y, 1.0 - a * Y * Y
    q22 = 1.0 - a * (X * X + Y * Y)
    out[0, 0], out[0, 1], out[0, 2] = (
        q00 * b00 + q01 * b10 + X * w20,
        q00 * b01 + q01 * b11 + X * w21,
        q00 * b02 + q01 * b12 + X * w22,
    )
    out[1, 0], out[1, 1], out[1, 2] = (
        q01 * b00 + q11 * b10 + Y * w20,
        q01 * b01 + q11 * b11 + Y * w21,
        q01 * b02 + q11 * b12 + Y * w22,
    )
    out[2, 0], out[2, 1], out[2, 2] = (
        q22 * w20 - X * b00 - Y * b10,
        q22 * w21 - X * b01 - Y * b11,
        q22 * w22 - X * b02 - Y * b12,
    )


@functools.cache
def load_orientation() -> EarthOrientation:
    """The vendored series; raises data.CorruptedData where it fails its checksum."""
    with np.load(data_path(_VENDORED)) as data:
        mjd, leap = data["mjd"], data["mjd"].astype(int)
        ut1_tai = data["ut1_utc"] - np.array([tai_minus_utc(int(day)) for day in leap])
        radians = np.pi / 648000.0
        return EarthOrientation(mjd, data["x"] * radians, data["y"] * radians, ut1_tai)
