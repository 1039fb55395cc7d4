"""Read orbits of satellites from FITS files, checked against the Earth's gravity."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from geokalman.constants import GM_EARTH
from geokalman.pulsar import clock
from geokalman.pulsar.fits import FitsError, Header, Table, read_fits
from geokalman.pulsar.model import Array
from geokalman.reading import counted

_TOLERANCE = 1e3  # [m]: 3.3 microseconds of light, what X-ray timing can see
_LOWEST, _HIGHEST = 6.4e6, 2e9  # [m] from the Earth's centre: below the air, beyond L2
_FASTEST = 1.2e4  # [m/s]: more than it takes to escape
_BOUND = 3e8  # [m]: farther out Moon and Sun matter, and the Earth's gravity is no check
_LAYOUTS = (  # columns of time, position, velocity: RXTE, NICER, IXPE; NuSTAR, Swift; Fermi
    ("TIME", ("X", "Y", "Z"), ("VX", "VY", "VZ")),
    ("TIME", ("POSITION",), ("VELOCITY",)),
    ("START", ("SC_POSITION",), ("SC_VELOCITY",)),
)
_LENGTH = re.compile(r"(m|meters?|metres?|km|kilometers?|kilometres?)")
_SPEED = re.compile(r"(m|meters?|metres?|km|kilometers?|kilometres?)(?:/s|/sec|\.?s\^?(?:\*\*)?-1)")
_INERTIAL = ("ICRS", "ICRF", "GCRS", "GCRF", "FK5", "J2000", "J2000.0", "EME2000", "ECI", "2000", "2000.0")


@dataclass(frozen=True, eq=False)
class SatelliteOrbit:
    """The orbit of a satellite about the Earth in ICRF axes.

    r (n, 3) [m], v (n, 3) [m/s] at t (n,) [s] since the Julian date jd; name : where they come from, for messages.
    """

    t: Array
    jd: float
    r: Array
    v: Array
    name: str = "the orbit"

    def position(self, seconds: Array, jd: float) -> Array:
        """Give positions (n, 3) [m] at times [s] since jd, by cubic Hermite interpolation.

        Raises ValueError where the orbit does not cover them, and where they fall into a hole of it: more than three
        steps and 60 s from the next record, or where the interpolation errs by more than a kilometre, by
        h^4/384 GM^2/r^5 over an interval h.
        """
        at = seconds + (jd - self.jd) * 86400.0
        if at.min() < self.t[0] or at.max() > self.t[-1]:
            orbit, events = (
                " to ".join(f"{self.jd - clock.MJD_ZERO + x / 86400.0:.5f}" for x in ends)
                for ends in ((self.t[0], self.t[-1]), (at.min(), at.max()))
            )
            covered = f"{self.name}: the records cover MJD {orbit}"
            raise ValueError(f"{covered}, the events MJD {events}; give the orbit file of their day.")
        step = np.diff(self.t)
        radius = _norm(self.r)
        error = step**4 / 384.0 * GM_EARTH**2 / np.minimum(radius[1:], radius[:-1]) ** 5
        hole = (step > max(6.0 * np.median(step), 120.0)) | (error > _TOLERANCE)
        k = np.clip(np.searchsorted(self.t, at, "right") - 1, 0, len(step) - 1)
        lost = hole[k] & (at > self.t[k]) & (at < self.t[k + 1])
        if lost.any():
            k = k[lost.argmax()]
            raise ValueError(
                f"{self.name}: no record for {step[k]:.0f} s, from {self.t[k]:.0f} to {self.t[k + 1]:.0f} s, where "
                f"{lost.sum()} of {len(at)} events stand; give an orbit without the hole, or events outside it."
            )
        return CubicHermiteSpline(self.t, self.r, self.v)(at)


def read_orbit(path: str | os.PathLike) -> SatelliteOrbit:
    """Read a satellite's orbit from a FITS file.

    Columns Time, X, Y, Z, Vx, Vy, Vz (RXTE's FPorbit, NICER), vectors POSITION and VELOCITY (NuSTAR), or START and
    SC_POSITION (Fermi's FT2); units m or km, and s. Records are sorted and doubled ones taken once, with a FitsWarning;
    velocities that are not there follow from the positions and the Earth's gravity.
    Raises FitsError, with the row, for positions and velocities that are null, not finite, inside the Earth, beyond 2
    million km, or against their neighbours; for other units and axes; and where velocities or accelerations as a whole
    are not those of an orbit.
    """
    for table in read_fits(path):
        for time, positions, speeds in _LAYOUTS:
            if time in table.columns and all(name in table.columns for name in positions):
                return _orbit(table, time, positions, speeds)
    columns = "Time, X, Y, Z, Vx, Vy, Vz (or POSITION and VELOCITY, or SC_POSITION)"
    raise FitsError(f"{path} has no table with {columns}; give an orbit file.")


def _orbit(table: Table, time: str, positions: tuple[str, ...], speeds: tuple[str, ...]) -> SatelliteOrbit:
    header = table.header
    _require_inertial(header)
    if clock.place(table) == "SOLARSYSTEM":
        raise header.error("the times are those at the barycentre; an orbit has its times at the satellite (LOCAL).")
    t, zero, jd = clock.times(table, time)
    r = _vectors(table, positions, _LENGTH)
    given = all(name in table.columns for name in speeds)
    v = _vectors(table, speeds, _SPEED) if given else None
    rows = np.argsort(t, kind="stable")
    if len(t):
        clock.refuse_strays(table, time, t[rows], rows)
    if (np.diff(rows) < 0).any():
        header.warn("the records are not in the order of time; they were sorted.")
    radius = _norm(r)
    if (wrong := np.flatnonzero((radius < _LOWEST) | (radius > _HIGHEST))).size:
        raise header.error(
            f"the position in row {wrong[0] + 1} is {radius[wrong[0]] / 1e3:.6g} km from the Earth's centre, not "
            f"between {_LOWEST / 1e3:.0f} and {_HIGHEST / 1e3:.0f} km; check {', '.join(positions)} and their units."
        )
    if v is not None and (wrong := np.flatnonzero(_norm(v) > _FASTEST)).size:
        raise header.error(
            f"the velocity in row {wrong[0] + 1} is {_norm(v)[wrong[0]]:.6g} m/s, above {_FASTEST:.0f} m/s; check "
            f"{', '.join(speeds)} and their units."
        )
    again = np.flatnonzero(np.diff(t[rows]) == 0.0)
    apart = _norm(r[rows[again + 1]] - r[rows[again]])
    if (apart > _TOLERANCE).any():
        a, b = rows[again[apart.argmax()] + np.arange(2)] + 1
        raise header.error(f"rows {a} and {b} have the same time, but positions {apart.max() / 1e3:.6g} km apart.")
    if again.size:
        header.warn(f"{again.size} of {len(t)} records have the time of another; they are left out.")
        rows = np.delete(rows, again + 1)
    if len(rows) < 2:
        raise header.error(f"the orbit has {counted(len(rows), 'record')}; two are needed at least.")
    t, r, v = t[rows], r[rows], None if v is None else v[rows]
    _check_motion(header, t, r, v, rows + 1)
    return SatelliteOrbit(t + zero, jd, r, _velocities(t, r) if v is None else v, header.where)


def _require_inertial(header: Header) -> None:
    for key in ("RADESYS", "RADECSYS", "EQUINOX", "COORDSYS", "FRAME"):
        if (axes := header.text(key)) and axes not in _INERTIAL:
            raise header.error(f"{key} = {axes}; axes of the ICRF or J2000 (ICRS, GCRS, FK5, 2000) are needed.")


def _vectors(table: Table, names: tuple[str, ...], units: re.Pattern[str]) -> Array:
    """Give vectors (n, 3) in m or m/s from three columns, or one of three elements."""
    parts = []
    for name in names:
        unit = table.unit(name).replace(" ", "").lower()
        if unit and not units.fullmatch(unit):
            raise table.header.error(f"column {name} is in {table.unit(name)!r}; m or km (m/s or km/s) is needed.")
        parts.append(table.finite(name).astype(float) * (1e3 if unit.startswith("k") else 1.0))
    vectors = np.column_stack(parts)
    if vectors.shape[1] != 3:
        raise table.header.error(f"{', '.join(names)} have {vectors.shape[1]} elements in a row; 3 are needed.")
    return vectors


def _norm(vectors: Array) -> Array:
    with np.errstate(over="ignore"):
        return np.sqrt((vectors**2).sum(axis=1))


def _velocities(t: Array, r: Array) -> Array:
    """Give velocities (n, 3) [m/s] of positions, by the shorter interval beside and gravity a.

    v_0 = (r_1 - r_0)/h - h (2 a_0 + a_1)/6, v_1 = (r_1 - r_0)/h + h (a_0 + 2 a_1)/6, to the third order in h.
    """
    h, a = np.diff(t)[:, None], -GM_EARTH * r / _norm(r)[:, None] ** 3
    chord = np.diff(r, axis=0) / h
    ahead = np.vstack([chord - h * (2.0 * a[:-1] + a[1:]) / 6.0, chord[:1]])
    behind = np.vstack([chord[:1], chord + h * (a[:-1] + 2.0 * a[1:]) / 6.0])
    return np.where(np.vstack([[[np.inf]], h]) < np.vstack([h, [[np.inf]]]), behind, ahead)


def _misfit(t: Array, r: Array, v: Array | None) -> tuple[Array, Array, Array]:
    """Tell how far records (n) are from an orbit, over each interval (n - 1,) short enough.

    Returns the misfit of position and velocity to one another relative to the way, that of velocity to gravity relative
    to its change, and the larger of both as a part of what is allowed: `_TOLERANCE` and ten times the error of the
    trapezoidal rule, (n h)^4 r / 24 with the mean motion n.
    """
    v = _velocities(t, r) if v is None else v
    h, a = np.diff(t)[:, None], -GM_EARTH * r / _norm(r)[:, None] ** 3
    moved = _norm(np.diff(r, axis=0) - h * (v[1:] + v[:-1]) / 2.0 + h**2 * np.diff(a, axis=0) / 12.0)
    turned = _norm(np.diff(v, axis=0) - h * (a[1:] + a[:-1]) / 2.0)
    h, radius = h[:, 0], np.minimum(_norm(r)[1:], _norm(r)[:-1])
    angle = h * np.sqrt(GM_EARTH / radius**3)
    worst = np.maximum(moved, h * turned / 2.0) / (_TOLERANCE + 10.0 * angle**4 * radius / 24.0)
    tells = (angle < 0.5) & (radius < _BOUND)
    return (
        (moved / (_norm(np.diff(r, axis=0)) + 1.0))[tells],
        (turned / (h * GM_EARTH / radius**2))[tells],
        np.where(tells, worst, 0.0),
    )


def _check_motion(header: Header, t: Array, r: Array, v: Array | None, rows: Array) -> None:
    """Refuse records (n), of these rows, that are not of an orbit about the Earth (FitsError)."""
    moved, turned, worst = _misfit(t, r, v)
    if moved.size and np.median(moved) > 0.05:
        speed, chord = np.median(_norm(v)), np.median(_norm(np.diff(r, axis=0)) / np.diff(t))
        moving = f"the positions move otherwise, by {chord:.4g} m/s"
        raise header.error(f"the velocities are {speed:.4g} m/s, but {moving}; check units.")
    if turned.size and np.median(turned) > 0.05:
        differs = f"the acceleration differs by {np.median(turned):.0%} from the Earth's gravity"
        raise header.error(f"{differs}; are the axes Earth-fixed, or the times in another unit?")
    k = int(worst.argmax())
    if worst[k] <= 1.0:
        return
    near = np.arange(max(0, k - 3), min(len(t), k + 5))
    guilty = []
    for row in (k, k + 1):
        others = near[near != row]
        if len(others) > 2 and _misfit(t[others], r[others], None if v is None else v[others])[2].max() <= 1.0:
            guilty.append(rows[row])
    if len(guilty) == 1:
        raise header.error(f"the record in row {guilty[0]} is off the orbit of its neighbours; leave it out.")
    raise header.error(f"the records in rows {rows[k]} and {rows[k + 1]} do not belong to one orbit; leave one out.")
