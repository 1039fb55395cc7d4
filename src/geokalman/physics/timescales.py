"""Time scales: UTC with its leap seconds, TAI and TT; civil dates and modified Julian dates.

An epoch of UTC is a modified Julian date of its day (whole) and the seconds since 0h of that day, so that a leap second
neither repeats nor vanishes. TT = TAI + 32.184 s; TDB differs from TT by less than 2 ms.
"""

from __future__ import annotations

import datetime
import re

TT_MINUS_TAI = 32.184
"""TT - TAI [s], exact (IAU 1991)."""
MJD_ZERO = 2400000.5
"""Julian date of MJD 0."""
_LEAP = (
    (41317, 10), (41499, 11), (41683, 12), (42048, 13), (42413, 14), (42778, 15), (43144, 16), (43509, 17), (43874, 18),
    (44239, 19), (44786, 20), (45151, 21), (45516, 22), (46247, 23), (47161, 24), (47892, 25), (48257, 26), (48804, 27),
    (49169, 28), (49534, 29), (50083, 30), (50630, 31), (51179, 32), (53736, 33), (54832, 34), (56109, 35), (57204, 36),
    (57754, 37),
)  # fmt: skip
_KNOWN_UNTIL = 61584  # 2027-06-28, when IERS Bulletin C 72 expires
_UTC = re.compile(
    r"(\d{4})-(\d\d)-(\d\d)(?:[T ](\d\d):(\d\d)(?::(\d\d(?:[.,]\d+)?))?)?\s*(Z|UTC|[+-]\d\d(?::?[0-5]\d)?)?",
    re.ASCII | re.I,
)


def mjd_of_date(year: int, month: int, day: int) -> int:
    """Modified Julian date of 0h of a day of the Gregorian calendar; raises ValueError for a day that does not
    exist."""
    return datetime.date(year, month, day).toordinal() - 678576


def tai_minus_utc(mjd: int) -> int:
    """TAI - UTC [s] on the UTC day `mjd`.

    Raises ValueError before 1972, when UTC had no whole leap seconds, and after the last announcement known here.
    Source: IERS Bulletin C 72 (July 2026).
    """
    if not _LEAP[0][0] <= mjd <= _KNOWN_UNTIL:
        raise ValueError(
            f"MJD {mjd} is outside {_LEAP[0][0]} to {_KNOWN_UNTIL} (1972-01-01 to 2027-06-28), where leap seconds are"
            " known."
        )
    return next(seconds for first, seconds in reversed(_LEAP) if mjd >= first)


def tt_minus_utc(mjd: int) -> float:
    """TT - UTC [s] on the UTC day `mjd`: 67.184 from 2012-07-01 to 2015-06-30. Raises ValueError as `tai_minus_utc`."""
    return tai_minus_utc(mjd) + TT_MINUS_TAI


def seconds_of_day(mjd: int) -> int:
    """Length of the UTC day `mjd` [s]: 86400, or 86401 where it ends in a leap second."""
    return 86400 + (tai_minus_utc(mjd + 1) - tai_minus_utc(mjd) if mjd < _KNOWN_UNTIL else 0)


def parse_utc(text: str) -> tuple[int, float]:
    """(modified Julian date of the day, seconds since its 0h) of an epoch as `2013-05-07 13:15:22`, with T or blank.

    A zone (Z, UTC, +02:00) is honoured, none means UTC; second 60 is taken where a leap second stands. Raises
    ValueError for another form, a date or a time that does not exist. Source: ISO 8601-1:2019.
    """
    if not isinstance(text, str):
        raise ValueError(f"{text!r} is no UTC epoch; write it as text, '2013-05-07 13:15:22'.")
    match = _UTC.fullmatch(text.strip())
    if match is None or (match[4] is None and (match[7] or "Z")[0] in "+-"):  # a zone goes with a time of day
        raise ValueError(f"{text!r} is no UTC epoch; write it as 2013-05-07 13:15:22.")
    year, month, day, hour, minute = (int(part or 0) for part in match.groups()[:5])
    second, zone = float((match[6] or "0").replace(",", ".")), (match[7] or "Z").replace(":", "")
    east = 0 if zone[0] not in "+-" else int(zone[0] + "1") * (60 * int(zone[1:3]) + int(zone[3:] or 0))  # minutes
    try:
        mjd = mjd_of_date(year, month, day)
    except ValueError as error:
        raise ValueError(f"{text!r} is no UTC epoch: {error}") from error
    if hour > 23 or minute > 59 or abs(east) >= 24 * 60:
        raise ValueError(f"{text!r} is no UTC epoch: its time of day or its zone does not exist.")
    days, minutes = divmod(60 * hour + minute - east, 24 * 60)
    mjd += days
    if second >= 60.0 and not (minutes == 1439 and second < 61.0 and _length(mjd) == 86401):
        raise ValueError(
            f"{text!r} is no UTC epoch: its time of day does not exist (no leap second is known to end that minute)."
        )
    return mjd, 60.0 * minutes + second


def iso_utc(mjd: int, seconds: float) -> str:
    """The epoch as `2013-05-07 13:15:22.00`, seconds counted from 0h of the UTC day `mjd`, leap seconds among them.

    Raises ValueError for a day that is not whole, seconds that are not finite, and outside of the years 1 to 9999.
    """
    if mjd != int(mjd) or not abs(seconds) < 1e12:  # 1e12 s are 30 000 years
        raise ValueError(f"MJD {mjd} and {seconds} s are no epoch; give a whole day and finite seconds of it.")
    hundredths, mjd = round(100.0 * seconds), int(mjd)  # first, so that 59.999 s become a new minute
    while hundredths < 0:
        mjd -= 1
        hundredths += 100 * _length(mjd)
    while hundredths >= 100 * _length(mjd):
        hundredths -= 100 * _length(mjd)
        mjd += 1
    minutes = min(hundredths // 6000, 1439)  # 23:59:60 belongs to the last minute
    hundredths -= 6000 * minutes
    try:
        date = datetime.date.fromordinal(mjd + 678576).isoformat()
    except (ValueError, OverflowError):
        raise ValueError(f"MJD {mjd} is not in the years 1 to 9999.") from None
    return f"{date} {minutes // 60:02d}:{minutes % 60:02d}:{hundredths // 100:02d}.{hundredths % 100:02d}"


def _length(mjd: int) -> int:
    """Length of a UTC day [s], 86400 outside the years whose leap seconds are known."""
    return seconds_of_day(mjd) if _LEAP[0][0] <= mjd <= _KNOWN_UNTIL else 86400
