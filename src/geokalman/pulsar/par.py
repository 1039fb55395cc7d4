"""Read ephemerides of pulsars, .par files of TEMPO, TEMPO2 and PINT: direction, frequency."""

from __future__ import annotations

import os
import re
import warnings

import numpy as np

from geokalman import reading
from geokalman.physics.timescales import MJD_ZERO
from geokalman.pulsar.model import Array
from geokalman.reading import InputError, Place

_ALIASES = {
    "RA": "RAJ", "DEC": "DECJ", "LAMBDA": "ELONG", "BETA": "ELAT", "PMLAMBDA": "PMELONG", "PMBETA": "PMELAT",
    "F": "F0", "P": "P0",
}  # fmt: skip
_ONCE = {"RAJ", "DECJ", "ELONG", "ELAT", "ECL", "F0", "F1", "P0", "P1", "PEPOCH", "POSEPOCH", "UNITS",
         "PMRA", "PMDEC", "PMELONG", "PMELAT"}  # fmt: skip
_OBLIQUITY = {
    "": 84381.406, "IERS2010": 84381.406, "IAU2005": 84381.406, "DEFAULT": 84381.406, "IERS2003": 84381.4059,
    "IERS1992": 84381.412, "DE403": 84381.412, "IAU1976": 84381.448,
}  # fmt: skip
"""Obliquity of the ecliptic [arcsec] by the keyword ECL. Source: PINT, ecliptic.dat (Luo et al. 2021)."""
_SEXAGESIMAL = re.compile(r"([+-]?)(\d+)[:hd](\d+(?:\.\d*)?)(?:[:m'](\d+(?:\.\d*)?))?[ms'\"]?", re.IGNORECASE)
_TCB = ("TCB", "SI", "5", "TEMPO2")
_TCB_RATE = 1.0 / (1.0 - 1.550519768e-8)
"""Seconds of TCB in one of TDB. Source: IAU 2006 Resolution B3."""
_TCB_EPOCH = 43144.0003725
_FIRST_MJD, _LAST_MJD = 36934.0, 88069.0  # 1960 to 2100
_WANTED = {
    "RAJ": "hours, minutes and seconds, as in RAJ 15:13:55.6", "ELONG": "degrees, as in ELONG 301.97",
    "DECJ": "degrees, minutes and seconds, as in DECJ -59:08:09", "ELAT": "degrees, as in ELAT 42.30",
    "F0": "the frequency in Hz, as in F0 6.5957, or P0, the period in s",
    "PEPOCH": "the epoch of F0 as an MJD, as in PEPOCH 55308", "POSEPOCH": "an MJD, as in POSEPOCH 55308",
}  # fmt: skip
"""What the line of a parameter would be, for messages."""
_F2_LIMIT = 1e-6
_MAS = np.pi / 180.0 / 3.6e6


class ParError(InputError):
    """A .par file that cannot be used as it is; the message names file, line and parameter."""


class ParWarning(UserWarning):
    """A part of a .par file that is converted or left out."""


class Par(dict[str, str]):
    """First values of a .par file by name, in capitals and under the usual name (RAJ for RA)."""

    def __init__(self, path: str | os.PathLike) -> None:
        super().__init__()
        self.file = Place(path, 0, ParError)
        self.places: dict[str, Place] = {}

    def enter(self, place: Place, name: str, value: str) -> None:
        """Add a line; ParError where it contradicts one before."""
        usual = _ALIASES.get(name, name)
        if usual in _ONCE and not _same(self.get(usual, value), value):
            raise place.error(f"{name} = {value} contradicts {self[usual]} on line {self.places[usual].line}.")
        for key in {name, usual}:
            self.setdefault(key, value)
            self.places.setdefault(key, place)

    def number(self, name: str, low: float, high: float, default: float | None = None) -> float:
        """Give a parameter from low to high; ParError outside, and where it must be there."""
        if name not in self:
            if default is None:
                raise self.missing(name)
            return default
        value = self.places[name].number(self[name], name)
        if not low <= value <= high:
            raise self.places[name].error(f"{name} = {self[name]} is not between {low:g} and {high:g}.")
        return value

    def missing(self, name: str) -> ParError:
        """Give the error of a parameter that is not there: what would be right, and what the file has."""
        names = [name for name in self.places if name not in _ALIASES]
        has = ", ".join(names[:8]) + ", ..." * (len(names) > 8)
        return self.file.error(f"the parameter {name} is missing ({_WANTED[name]}); the file has {has}.")

    def _sexagesimal(self, name: str) -> str:
        """Give, for messages, what a number of degrees would be."""
        try:
            degrees = reading.number(self[name])
        except ValueError:
            return ""
        if not abs(degrees) <= 360.0:
            return ""
        hundredths = round(abs(degrees) * 360000.0 / (15.0 if name == "RAJ" else 1.0))
        minutes, rest = divmod(hundredths, 6000)
        text = f"{'-' * (degrees < 0)}{minutes // 60:02d}:{minutes % 60:02d}:{rest / 100:05.2f}"
        return f"; {_WANTED[name].partition(', as')[0]} are needed, and if these are degrees, {name} {text} is right"

    def angle(self, name: str, low: float, high: float) -> float:
        """Give degrees, or hours, written as 12:34:56.7 from low to high."""
        if name not in self:
            raise self.missing(name)
        match, place = _SEXAGESIMAL.fullmatch(self[name]), self.places[name]
        if match is None or (match[4] and "." in match[3]):
            raise place.error(f"{name} = {self[name]} is not written as 12:34:56.7{self._sexagesimal(name)}.")
        sign, (whole, minutes, seconds) = match[1], (float(part or 0.0) for part in match.groups()[1:])
        if minutes >= 60.0 or seconds >= 60.0:
            raise place.error(f"{name} = {self[name]} has minutes or seconds of 60 or more.")
        value = (-1.0 if sign == "-" else 1.0) * (whole + minutes / 60.0 + seconds / 3600.0)
        if not low <= value <= high:
            raise place.error(f"{name} = {self[name]} is not between {low:g} and {high:g}.")
        return value

    def degrees(self, name: str, low: float, high: float) -> float:
        """Give degrees, written as 301.97 or as 301:58:23."""
        return self.angle(name, low, high) if ":" in self.get(name, ":") else self.number(name, low, high)


def read_par(path: str | os.PathLike) -> Par:
    """Read a .par file; comments (#, and C at the start of a line) are left out.

    Warns, with a ParWarning, where UNITS is TCB. Raises ParError, with the line, for a position or a spin that cannot
    be right and for what contradicts itself, and what `reading.open_bytes` does.
    """
    par = Par(path)
    for place, line in reading.lines(path, "pulsar's .par file", ParError):
        words = line.partition("#")[0].split()
        if not words or words[0] in ("C", "c"):
            continue
        name = words[0].upper()
        if len(words) > 1:
            par.enter(place, name, words[1])
        elif _ALIASES.get(name, name) in _ONCE:
            raise place.error(f"{name} has no value.")
    if not par.keys() & _ONCE:
        raise par.file.error("no line gives a position or a spin (RAJ, DECJ, F0, ...); this is no .par file.")
    if par.keys() & {"RAJ", "DECJ", "ELONG", "ELAT"}:
        par_direction(par)
    if par.keys() & {"F0", "P0"}:
        _spin(par)
    key, units = _units(par)
    if units in _TCB:
        text = f"{key} {units}: F0, F1 and PEPOCH are turned from TCB into TDB, F0 by 1.55e-8 of itself."
        warnings.warn(str(par.places[key].error(text)), ParWarning, stacklevel=2)
    elif key == "UNITS" and units != "TDB":
        raise par.places["UNITS"].error(f"UNITS {units} is unknown; TDB, or TCB (SI), is needed.")
    return par


def _units(par: Par) -> tuple[str, str]:
    """Give the keyword of the scale of time, and its value; EPHVER 5 alone means TCB."""
    key = "UNITS" if "UNITS" in par or "EPHVER" not in par else "EPHVER"
    return key, par.get(key, "TDB").upper()


def _same(first: str, second: str) -> bool:
    """Tell whether two values are the same text or the same number."""
    try:
        return first == second or reading.number(first) == reading.number(second)
    except ValueError:
        return False


def par_direction(par: Par, mjd: float | None = None) -> Array:
    """Give the unit vector (3,) to the pulsar in ICRF axes.

    From RAJ (hours) and DECJ (degrees), or ELONG and ELAT [deg] with the obliquity that ECL names; with its proper
    motion [mas/yr] since POSEPOCH where an mjd is given.
    Raises ParError for a position that is missing, or on no sphere, for two that differ by more than 20 arcsec, and for
    another equinox than J2000.
    """
    if par.get("EQUINOX", "J2000").upper().lstrip("J") not in ("2000", "2000.0"):
        raise par.places["EQUINOX"].error(f"EQUINOX {par['EQUINOX']}: a position of J2000 is needed.")
    ecl = par.get("ECL", "").upper()
    if ecl not in _OBLIQUITY:
        raise par.places["ECL"].error(f"ECL {ecl} is unknown; it must be one of {', '.join(filter(None, _OBLIQUITY))}.")
    tilt = np.radians(_OBLIQUITY[ecl] / 3600.0)
    poles = {"RAJ": np.array([0.0, 0.0, 1.0]), "ELONG": np.array([0.0, -np.sin(tilt), np.cos(tilt)])}
    found = []
    if "RAJ" in par or "DECJ" in par:
        ra = np.radians(15.0 * par.angle("RAJ", 0.0, np.nextafter(24.0, 0.0)))
        found.append(_unit_vector(ra, np.radians(par.angle("DECJ", -90.0, 90.0))))
    if "ELONG" in par or "ELAT" in par:
        x, y, z = _unit_vector(
            np.radians(par.degrees("ELONG", -180.0, 360.0)), np.radians(par.degrees("ELAT", -90.0, 90.0))
        )
        found.append(np.array([x, y * np.cos(tilt) - z * np.sin(tilt), y * np.sin(tilt) + z * np.cos(tilt)]))
    if not found:
        raise par.file.error("the pulsar's position is missing: RAJ and DECJ, or ELONG and ELAT.")
    n = found[0]
    if np.abs(found[-1] - n).max() > 1e-4:
        raise par.places["ELONG"].error(f"ELONG and ELAT contradict RAJ and DECJ on line {par.places['RAJ'].line}.")
    moved = n
    for (east, north), pole in zip((("PMRA", "PMDEC"), ("PMELONG", "PMELAT")), poles.values(), strict=True):
        rates = par.number(east, -1e5, 1e5, 0.0), par.number(north, -1e5, 1e5, 0.0)
        if mjd is None or rates == (0.0, 0.0):
            continue
        epoch = "POSEPOCH" if "POSEPOCH" in par else "PEPOCH"
        years = (mjd - par.number(epoch, _FIRST_MJD, _LAST_MJD)) / 365.25
        along = np.cross(pole, n) / np.linalg.norm(np.cross(pole, n))
        moved = moved + years * _MAS * (rates[0] * along + rates[1] * np.cross(n, along))
    return moved if moved is n else moved / np.linalg.norm(moved)


def par_frequency(par: Par, seconds: float, jd: float) -> float:
    """Give the frequency F0 + F1 (t - PEPOCH) [Hz], t at the pulsar, seconds since jd (TDB).

    F0 and F1 may stand as P0 and P1. The term F2 (t - PEPOCH)^2 / 2 is left out: of B1509-58 it is 5.3e-7 Hz on
    15 January 2011, a twelfth of the standard deviation of the frequency from that hour of RXTE (6.5e-6 Hz). Warns,
    with a ParWarning, where it is more than 1e-6 of the frequency, and of a binary orbit and of glitches, which are
    left out too. Raises ParError for a spin that is missing, or no pulsar's.
    """
    if left := [key for key in par if key == "BINARY" or key.startswith("GLEP")]:
        text = f"{', '.join(left)}: the pulsar's own orbit and glitches are left out of its frequency."
        warnings.warn(f"{par.file.path}: {text}", ParWarning, stacklevel=2)
    f0, f1, epoch = _spin(par)
    since = seconds + (jd - MJD_ZERO - epoch) * 86400.0
    second = 0.5 * par.number("F2", -1e-10, 1e-10, 0.0) * since**2 if "PEPOCH" in par else 0.0
    if abs(second) > _F2_LIMIT * f0:
        text = f"F2 = {par['F2']} is left out of the frequency, of which it would be {second:.2g} Hz."
        warnings.warn(str(par.places["F2"].error(text)), ParWarning, stacklevel=2)
    return f0 + f1 * since


def _spin(par: Par) -> tuple[float, float, float]:
    """Give F0 [Hz], F1 [Hz/s] and PEPOCH [MJD] in TDB."""
    period = par.number("P0", 5e-4, 1e5, 0.0)
    f0 = 1.0 / period if period and "F0" not in par else par.number("F0", 1e-5, 2000.0)
    if period and abs(f0 * period - 1.0) > 1e-6:
        raise par.places["P0"].error(f"P0 = {par['P0']} contradicts F0 = {par['F0']}.")
    f1 = par.number("F1", -1e-7, 1e-7, -par.number("P1", -1e-5, 1e-5, 0.0) * f0**2)
    epoch = par.number("PEPOCH", _FIRST_MJD, _LAST_MJD, None if f1 else 0.0)
    if _units(par)[1] in _TCB:
        return f0 * _TCB_RATE, f1 * _TCB_RATE**2, _TCB_EPOCH + (epoch - _TCB_EPOCH) / _TCB_RATE
    return f0, f1, epoch


def _unit_vector(longitude: float, latitude: float) -> Array:
    return np.array([np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)])
