"""Time scales against the tables of ERFA and the calendar."""

import datetime

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


@pytest.mark.parametrize(
    ("seconds", "written"),
    [
        (3 * 60 - 0.001, "2012-06-30 00:03:00.00"),
        (3599.996, "2012-06-30 01:00:00.00"),
        (59.994, "2012-06-30 00:00:59.99"),
        (-0.004, "2012-06-30 00:00:00.00"),
        (-0.006, "2012-06-29 23:59:59.99"),
        (86399.996, "2012-06-30 23:59:60.00"),
        (86400.5, "2012-06-30 23:59:60.50"),
        (86400.996, "2012-07-01 00:00:00.00"),
        (86401.0 + 3661.0, "2012-07-01 01:01:01.00"),
        (-86400.0, "2012-06-29 00:00:00.00"),
    ],
)
def test_what_is_written_is_rounded_before_it_is_split(seconds, written):
    """The day ends in a leap second; what is written can be read back, and never has a second 60.00 elsewhere."""
    day = mjd_of_date(2012, 6, 30)
    assert iso_utc(day, seconds) == written
    mjd, second = parse_utc(written)
    assert (mjd - day) * 86400 + (mjd > day) + second == pytest.approx(seconds, abs=0.005001)


@pytest.mark.parametrize(
    ("text", "same"),
    [
        ("2013-05-07T13:15:22Z", "2013-05-07 13:15:22"),
        ("2013-05-07t13:15:22z", "2013-05-07 13:15:22"),
        ("2013-05-07 13:15:22 UTC", "2013-05-07 13:15:22"),
        ("2013-05-07T13:15:22,50", "2013-05-07 13:15:22.5"),
        ("2013-05-07T15:15:22+02:00", "2013-05-07 13:15:22"),
        ("2013-05-07T00:30:00+0200", "2013-05-06 22:30:00"),
        ("2013-12-31T21:00-05", "2014-01-01 02:00"),
        ("2012-07-01T01:59:60+02:00", "2012-06-30 23:59:60"),
        ("2012-02-29 UTC", "2012-02-29"),
        ("1965-12-31 23:59:59", "1965-12-31T23:59:59"),
        ("2035-12-31 23:59:59", "2035-12-31T23:59:59"),
    ],
)
def test_zones_and_marks_are_honoured(text, same):
    assert parse_utc(text) == parse_utc(same)


@pytest.mark.parametrize(
    "text",
    [
        "2013-06-30 23:59:60",
        "2012-06-30 23:59:61",
        "2012-06-30 22:59:60",
        "2012-06-30T23:59:60+02:00",
        "2035-06-30 23:59:60",
        "1971-12-31 23:59:60",
        "2013-02-29",
        "0000-01-01",
        "2013-13-01",
        "2013-05-07 24:00:01",
        "2013-05-07 13:15:22 TDB",
        "2013-05-07 13:15:22 GPS",
        "2013-05-07+02:00",
        "2013-05-07 13:15:22+25:00",
        "2013-05-07 13:15:22.-5",
        "\u0662\u0660\u0661\u0663-05-07",
        "2013-05-07 13:15:nan",
    ],
)
def test_what_does_not_exist_or_is_another_scale_is_refused(text):
    with pytest.raises(ValueError, match="is no UTC epoch") as caught:
        parse_utc(text)
    assert repr(text) in str(caught.value)


@pytest.mark.parametrize("mjd", [41316, timescales._KNOWN_UNTIL + 1])
def test_outside_the_known_leap_seconds_there_is_no_answer(mjd):
    with pytest.raises(ValueError, match="where leap seconds are known"):
        tai_minus_utc(mjd)


@pytest.mark.parametrize(
    "epoch", [(56419, float("nan")), (56419, float("inf")), (56419, 1e15), (56419.5, 0.0), (10**9, 0.0), (-(10**9), 0)]
)
def test_what_is_no_epoch_is_not_written_as_one(epoch):
    with pytest.raises(ValueError, match=r"no epoch|years 1 to 9999"):
        timescales.iso_utc(*epoch)


@pytest.mark.parametrize("value", [None, datetime.datetime(2013, 5, 7)])
def test_an_epoch_is_text(value):
    with pytest.raises(ValueError, match="write it as text"):
        timescales.parse_utc(value)
