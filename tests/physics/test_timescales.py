"""Time scales against the tables of ERFA and the calendar."""

import erfa
import pytest

from geokalman.physics import timescales
from geokalman.physics.timescales import iso_utc, mjd_of_date, parse_utc, seconds_of_day, tai_minus_utc, tt_minus_utc


@pytest.mark.parametrize(
    "date", [(1972, 1, 1), (1999, 6, 30), (2012, 6, 30), (2012, 7, 1), (2013, 5, 7), (2016, 12, 31), (2017, 1, 1)]
)
def test_leap_seconds_are_those_of_erfa(date):
    assert tai_minus_utc(mjd_of_date(*date)) == erfa.dat(*date, 0.0)


@pytest.mark.parametrize("date", [(1858, 11, 17), (2000, 1, 1), (2012, 2, 29), (2013, 12, 31)])
def test_modified_julian_dates_are_those_of_erfa(date):
    assert mjd_of_date(*date) == erfa.cal2jd(*date)[1]


def test_the_sessions_have_67_184_seconds():
    for text in ("2012-07-21", "2013-03-12", "2013-05-07"):
        assert tt_minus_utc(parse_utc(text)[0]) == pytest.approx(67.184, abs=1e-12)
    assert tt_minus_utc(mjd_of_date(2012, 6, 30)) == pytest.approx(66.184, abs=1e-12)


def test_a_leap_second_is_an_epoch_of_its_own():
    day, seconds = parse_utc("2012-06-30T23:59:60.5Z")
    assert (day, seconds) == (mjd_of_date(2012, 6, 30), 86400.5)
    assert seconds_of_day(day) == 86401 and seconds_of_day(day + 1) == 86400
    with pytest.raises(ValueError, match="time of day does not exist"):
        parse_utc("2013-06-30 23:59:60")


@pytest.mark.parametrize("text", ["2013-02-30", "2013-05-07 25:00", "7.5.2013", "2013-05-07 10:61:00", ""])
def test_what_is_no_epoch_is_refused(text):
    with pytest.raises(ValueError, match="is no UTC epoch"):
        parse_utc(text)


def test_epochs_are_written_as_they_are_read():
    assert iso_utc(*parse_utc("2013-03-12 06:12:40.50")) == "2013-03-12 06:12:40.50"
    assert iso_utc(mjd_of_date(2013, 5, 7), 86400.0 + 3661.0) == "2013-05-08 01:01:01.00"


@pytest.mark.parametrize("mjd", [41316, timescales._KNOWN_UNTIL + 1])
def test_outside_the_known_leap_seconds_there_is_no_answer(mjd):
    with pytest.raises(ValueError, match="where leap seconds are known"):
        tai_minus_utc(mjd)
