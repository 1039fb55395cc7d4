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
_UTC = re.compile(r"(\d{4})-(\d\d)-(\d\d)(?:[T ](\d\d):(\d\d)(?::(\d\d(?:\.\d+)?))?)?\s*(?:Z|UTC)?")


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
            f"MJD {mjd} is outside {_LEAP[0][0]} to {_KNOWN_UNTIL} (1972-01-01 to 2027-06-28), where leap seconds are known"
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

    Second 60 is taken where a leap second stands. Raises ValueError for another form, a date or a time that does not
    exist.
    """
    match = _UTC.fullmatch(text.strip())
    if match is None:
        raise ValueError(f"{text!r} is no UTC epoch; write it as 2013-05-07 13:15:22")
    year, month, day, hour, minute = (int(part or 0) for part in match.groups()[:5])
    second = float(match[6] or 0.0)
    try:
        mjd = mjd_of_date(year, month, day)
    except ValueError as error:
        raise ValueError(f"{text!r} is no UTC epoch: {error}") from error
    total = 3600.0 * hour + 60.0 * minute + second
    longest = 60.0 if (hour, minute) != (23, 59) else 60.0 + seconds_of_day(mjd) - 86400
    if hour > 23 or minute > 59 or second >= longest:
        raise ValueError(
            f"{text!r} is no UTC epoch: its time of day does not exist (MJD {mjd} has {seconds_of_day(mjd)} s)"
        )
    return mjd, total


def iso_utc(mjd: int, seconds: float) -> str:
    """The epoch as `2013-05-07 13:15:22.00`, seconds counted from 0h of the UTC day `mjd` without further leap
    seconds."""
    date = datetime.date.fromordinal(mjd + 678576 + int(seconds // 86400))
    minutes, second = divmod(seconds % 86400, 60)
    return f"{date.isoformat()} {int(minutes // 60):02d}:{int(minutes % 60):02d}:{second:05.2f}"
