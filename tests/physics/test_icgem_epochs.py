"""The ICGEM reader on fields that vary with time: terms, intervals and epochs."""

import datetime
import math
import warnings

import numpy as np
import pytest
from gfcfiles import ROWS, gfc

from geokalman.physics.icgem import GfcError, read_gfc

VARIABLE = [*ROWS[:1], "gfct 2 0 -4.8e-4 0.0 20050101", "trnd 2 0 1.1e-11 0.0", "acos 2 0 4e-11 0.0 1.0",
            "asin 2 0 5e-11 0.0 0.5", *ROWS[2:]]  # fmt: skip


def test_time_variable_coefficient_at_its_reference_epoch(tmp_path):
    assert read_gfc(gfc(tmp_path, VARIABLE)).C[2, 0] == -4.8e-4


def test_time_variable_coefficient_at_an_epoch(tmp_path):
    field = read_gfc(gfc(tmp_path, VARIABLE), epoch=datetime.date(2007, 4, 2))
    years = (datetime.date(2007, 4, 2) - datetime.date(2005, 1, 1)).days / 365.25
    wanted = -4.8e-4 + 1.1e-11 * years + 4e-11 * math.cos(2 * math.pi * years) + 5e-11 * math.sin(4 * math.pi * years)
    assert field.C[2, 0] == pytest.approx(wanted, rel=2e-15)
    assert field.C[2, 0] != -4.8e-4


def test_errors_of_a_time_variable_coefficient(tmp_path):
    rows = ["gfct 2 0 -4.8e-4 0.0 1e-12 0.0 20050101", *(row + " 2e-12 3e-12" for row in ROWS[2:])]
    field = read_gfc(gfc(tmp_path, rows, errors="formal"))
    assert field.sigma_C[2, 0] == 1e-12 and field.sigma_C[2, 1] == 2e-12


INTERVALS = ["gfct 2 0 -4.8e-4 0.0 20000101.0000 20100101.1200", "trnd 2 0 1e-11 0.0 20000101 20100101.1200",
             "gfct 2 0 -4.9e-4 0.0 20100101.1200 20200101", "asin 2 0 1e-11 0.0 20100101.1200 20200101 1.0",
             *ROWS[2:]]  # fmt: skip


@pytest.mark.parametrize(
    ("epoch", "base", "slope"),
    [(datetime.date(2001, 1, 1), -4.8e-4, 1e-11 * 366 / 365.25), (datetime.datetime(2010, 1, 1, 12), -4.9e-4, 0.0)],
)
def test_second_format_takes_the_interval_of_the_epoch(tmp_path, epoch, base, slope):
    path = gfc(tmp_path, INTERVALS, format="icgem2.0")
    assert read_gfc(path, epoch).C[2, 0] == pytest.approx(base + slope, rel=2e-15)


def test_second_format_without_an_epoch_asks_for_one(tmp_path):
    path = gfc(tmp_path, INTERVALS, format="icgem2.0")
    with pytest.raises(
        GfcError, match=r"line 14: coefficient \(2, 0\) has 2 gfct lines, first in line 12; give one epoch"
    ):
        read_gfc(path)
    with pytest.raises(GfcError, match="no gfct line covers 2030-01-01"):
        read_gfc(path, datetime.date(2030, 1, 1))


def test_a_term_may_stand_before_its_value_and_without_errors(tmp_path):
    rows = ["trnd 2 0 1e-11 0", "acos 2 0 4e-11 0 1.0", "gfct 2 0 -4.8e-4 0 1e-12 0 20050101.0000",
            *(row + " 1e-12 1e-12" for row in ROWS[2:])]  # fmt: skip
    field = read_gfc(gfc(tmp_path, rows, errors="formal"), datetime.date(2006, 1, 1))
    years = 365 / 365.25
    assert field.C[2, 0] == pytest.approx(-4.8e-4 + 1e-11 * years + 4e-11 * math.cos(2 * math.pi * years), rel=1e-15)


def test_a_term_counts_from_its_own_epoch(tmp_path):
    """EIGEN-6S4: one annual term from 1950 to 2003 beside values that hold for a year each."""
    rows = ["gfct 2 0 -4.8e-4 0 20020815.0817 20030101", "acos 2 0 4e-11 0 19500101 20030101 1.0", *ROWS[2:]]
    field = read_gfc(gfc(tmp_path, rows, format="icgem2.0"), datetime.date(2002, 9, 1))
    years = (datetime.date(2002, 9, 1) - datetime.date(1950, 1, 1)).days / 365.25
    assert field.C[2, 0] == pytest.approx(-4.8e-4 + 4e-11 * math.cos(2 * math.pi * years), rel=1e-15)


@pytest.mark.parametrize(
    ("epoch", "hours"),
    [
        (datetime.datetime(2007, 4, 2, 12), 12),
        (datetime.datetime(2007, 4, 2, 12, tzinfo=datetime.timezone(datetime.timedelta(hours=-10))), 22),
        (np.datetime64("2007-04-02T06:00"), 6),
    ],
)
def test_epochs_with_and_without_a_zone(tmp_path, epoch, hours):
    rows = ["gfct 2 0 -4.8e-4 0.0 20050101", "trnd 2 0 1e-6 0.0", *ROWS[2:]]
    years = ((datetime.date(2007, 4, 2) - datetime.date(2005, 1, 1)).days + hours / 24) / 365.25
    assert read_gfc(gfc(tmp_path, rows), epoch).C[2, 0] == pytest.approx(-4.8e-4 + 1e-6 * years, rel=1e-14)


@pytest.mark.parametrize("epoch", ["2007-04-02", 2007.25, np.datetime64("NaT")])
def test_what_is_no_epoch_is_refused(tmp_path, epoch):
    with pytest.raises(ValueError, match="is no date; give a datetime.date"):
        read_gfc(gfc(tmp_path), epoch)


V2 = {"format": "icgem2.0"}
YEARS = "20000101 20100101"


@pytest.mark.parametrize(
    ("rows", "header", "says"),
    [
        ([*ROWS, "dot 2 0 1e-11 0"], {}, r"line 15: coefficient \(2, 0\) has a trend .* no gfct line"),
        ([*ROWS, "GFC 2 1 -1.8e-10 1.2e-9"], {}, r"line 15: coefficient \(2, 1\) occurs twice, first in line 13"),
        ([ROWS[2], ROWS[2], *ROWS[2:]], {}, r"line 12: coefficient \(2, 1\) occurs twice, first in line 11"),
        (
            [*VARIABLE, "trnd 2 0 1.1e-11 0.0"],
            {},
            r"line 18: this term of coefficient \(2, 0\) is given already, in line 13",
        ),
        ([f"gfct 2 0 -4.8e-4 0 {YEARS}", *ROWS[2:]], {}, "line 11: 7 columns where 6 are right .* 'format icgem2.0'"),
        (
            ["gfct 2 0 -4.8e-4 0 20100101 20000101", *ROWS[2:]],
            V2,
            "line 12: the interval 20100101 to 20000101 is empty",
        ),
        (["gfct 2 0 -4.8e-4 0 20000101", *ROWS[2:]], V2, "line 12: 6 columns where 7 are needed"),
        (
            [f"gfct 2 0 -4.8e-4 0 {YEARS}"] * 2 + ROWS[2:],
            V2,
            "line 13: coefficient .* 2 gfct lines, first in line 12; one is right",
        ),
        (["gfct 2 0 -4.8e-4 0 2005111", *ROWS[2:]], {}, "'2005111' is no date"),
        (["gfct 2 0 -4.8e-4 0 20050101.5", *ROWS[2:]], {}, "'20050101.5' is no date"),
        (["gfct 2 0 -4.8e-4 0 2005.0", *ROWS[2:]], {}, "'2005.0' is no date"),
        ([*ROWS, "\x01"], {}, "begins no data line; they begin with gfc, gfct"),
        (["gfc 2 0 -0.48E-03-0.1E-09"], {}, "4 columns where 5 are needed"),
        (["gfc 2 0 **** 0"], {}, r"line 11: '\*\*\*\*' is not a number"),
        (["gfc 2 -1 0 0"], {}, "degree 2 and order -1 must satisfy"),
    ],
)
def test_rows_are_refused_by_line(tmp_path, rows, header, says):
    with pytest.raises(GfcError, match=says), warnings.catch_warnings():
        warnings.simplefilter("error")
        read_gfc(gfc(tmp_path, rows, **header), datetime.date(2005, 6, 1))


def test_a_date_between_intervals_names_them(tmp_path):
    with pytest.raises(
        GfcError, match="no gfct line covers 2030-01-01, only 2000-01-01 to 2010-01-01, 2010-01-01 to 2020-"
    ):
        read_gfc(gfc(tmp_path, INTERVALS, format="icgem2.0"), datetime.date(2030, 1, 1))
