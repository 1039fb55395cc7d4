"""Event lists: what their time keywords mean, their order, photons that stand there twice, good-time intervals."""

import warnings

import numpy as np
import pytest

from geokalman.data import data_path
from geokalman.pulsar import photons
from geokalman.pulsar.events import read_events
from geokalman.pulsar.fits import FitsError, FitsWarning, read_fits

GOOD = {"EXTNAME": "EVENTS", "MJDREFI": 49353, "MJDREFF": 0.000696574074, "TIMEZERO": 3.5, "TIMEREF": "LOCAL",
        "TIMESYS": "TT", "TIMEUNIT": "s", "OBJECT": "X"}  # fmt: skip
RAW = np.array([100.0, 101.5, 104.0])
JD = 5e-10  # rounding of a Julian date in a float
FIRST = 49353.000696574074 + 103.5 / 86400.0  # MJD of the first event, by hand


def times(values=RAW, form="D", kind=">f8", unit="s"):
    return [("TIME", form, np.asarray(values).astype(kind), *([unit] if unit else []))]


def gti(*intervals, header=None, names=("START", "STOP"), unit="s"):
    cards = {k: v for k, v in GOOD.items() if k != "OBJECT"} | {"EXTNAME": "GTI"} | (header or {})
    columns = np.array(intervals, dtype=">f8").reshape(-1, 2).T
    return cards, [(name, "D", values, unit) for name, values in zip(names, columns, strict=True)]


@pytest.mark.parametrize(
    ("header", "unit", "factor", "first"),
    [
        ({}, "s", 1.0, FIRST), ({"TIMEUNIT": None}, "s", 1.0, FIRST), ({"TIMEUNIT": None}, "", 1.0, FIRST),
        ({"TIMEUNIT": "sec"}, "Seconds", 1.0, FIRST), ({}, "", 1.0, FIRST),
        ({"MJDREFF": "6.96574074D-4"}, "s", 1.0, FIRST), ({"MJDREFF": b"6.96574074D-4 / as Fortran"}, "s", 1.0, FIRST),
        ({"MJDREFI": b"49353."}, "s", 1.0, FIRST), ({"TIMEZERO": b""}, "s", 1.0, FIRST - 3.5 / 86400),
        ({"TIMEZERO": None}, "s", 1.0, FIRST - 3.5 / 86400), ({"TIMEZERO": "3.5"}, "s", 1.0, FIRST),
        ({"TIMEZERO": None, "TIMEZERI": 3, "TIMEZERF": 0.5}, "s", 1.0, FIRST),
        ({"TIMEZERI": 3, "TIMEZERF": 0.5}, "s", 1.0, FIRST), ({"TIMEZERO": None, "TIMEOFFS": 3.5}, "s", 1.0, FIRST),
        ({"TIMEZERO": 3.5 / 86400, "TIMEUNIT": "d"}, "d", 86400.0, FIRST), ({"TIMEUNIT": None}, "ms", 1e-3, FIRST),
        ({"TIMEUNIT": "h", "TIMEZERO": 3.5 / 3600}, "", 3600.0, FIRST), ({"TIMEUNIT": None}, "us", 1e-6, FIRST),
        ({"MJDREFI": None, "MJDREFF": None, "MJDREF": 50000.25}, "s", 1.0, 50000.25 + 103.5 / 86400),
        ({"MJDREF": 49353.0007}, "s", 1.0, FIRST),
        ({"MJDREFI": None, "MJDREF": 49353.5}, "s", 1.0, 49353.5 + 103.5 / 86400),
        ({"MJDREFI": None, "MJDREFF": None, "JDREF": 2450000.75}, "s", 1.0, 50000.25 + 103.5 / 86400),
        ({"MJDREFI": None, "MJDREFF": None, "JDREFI": 2450000, "JDREFF": 0.75}, "s", 1.0, 50000.25 + 103.5 / 86400),
        ({"TIMESYS": "TDB"}, "s", 1.0, FIRST), ({"TIMESYS": "TT(TAI)"}, "s", 1.0, FIRST),
        ({"TIMESYS": "tt"}, "s", 1.0, FIRST),
        ({"TIMESYS": "TAI"}, "s", 1.0, FIRST + 32.184 / 86400), ({"TIMESYS": "GPS"}, "s", 1.0, FIRST + 51.184 / 86400),
        ({"TIMEDEL": 3.2, "TIMEPIXR": 0.0}, "s", 1.0, FIRST + 1.6 / 86400),
        ({"TIMEDEL": 1e-6, "TIMEPIXR": 0.0}, "s", 1.0, FIRST),
        ({"TSTART": 99 / 86400, "TSTOP": 105 / 86400, "TIMEUNIT": "d", "TIMEZERO": 1.0}, "d", 86400.0,
         FIRST + 1 - 3.5 / 86400),
        ({"TIMEDEL": 1 / 1440, "TIMEPIXR": 0, "TIMEUNIT": "d", "TIMEZERO": 0}, "d", 86400.0, FIRST + 26.5 / 86400),
        ({"TIMEDEL": 3.2}, "s", 1.0, FIRST), ({"TIMEDEL": 0.5, "TIMEPIXR": 1.0}, "s", 1.0, FIRST - 0.25 / 86400),
    ],
)  # fmt: skip
def test_keywords_of_time_are_honoured(fits_file, header, unit, factor, first):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        events = read_events(fits_file((GOOD | header, times(RAW / factor, unit=unit))))
    assert events.mjd == pytest.approx(first, abs=JD)
    assert events.t - events.t[0] == pytest.approx(RAW - RAW[0], abs=1e-9)
    assert (events.name, events.local, len(events.t)) == ("X", True, 3) and np.isnan(events.exposure)


@pytest.mark.parametrize(
    ("header", "unit", "match"),
    [
        ({"TIMEUNIT": "d"}, "s", "TUNIT1 = s contradicts TIMEUNIT = d"),
        ({}, "d", "TUNIT1 = d contradicts TIMEUNIT = s"),
        ({}, "km", "TUNIT1 = km; a unit of time"), ({"TIMEUNIT": "yr"}, "", "TIMEUNIT = yr"),
        ({"TIMEUNIT": 1}, "s", "TIMEUNIT = 1"),
        ({"MJDREFI": None}, "s", "lacks MJDREF"), ({"MJDREFF": None}, "s", "lacks MJDREF"),
        ({"MJDREFF": b""}, "s", "lacks MJDREF"),
        ({"MJDREFF": "zero"}, "s", "MJDREFF = 'zero' is not a number"), ({"MJDREFF": True}, "s", "MJDREFF = 'True'"),
        ({"MJDREF": 49350.0}, "s", "MJDREF = 49350.0 contradicts MJDREFI"),
        ({"mjdrefi": 49354}, "s", "MJDREFI is given twice"),
        ({"MJDREFI": 0}, "s", "row 1, which is MJD 0.00.* not between 1960"),
        ({"MJDREFI": 2449353}, "s", "not between 1960 and 2100"),
        ({"TIMEZERO": 1e300}, "s", "TIME has 100 in row 1"), ({"TIMEZERO": "none"}, "s", "TIMEZERO = 'none'"),
        ({"TIMEZERI": 3, "TIMEZERF": 0.0}, "s", "TIMEZERO = 3.5 contradicts TIMEZERI . TIMEZERF = 3"),
        ({"TIMEZERO": None, "TIMEZERI": 3}, "s", "lacks TIMEZERF"), ({"TIMEOFFS": 1.0}, "s", "contradicts TIMEOFFS"),
        ({"TIMESYS": "UTC"}, "s", "TIMESYS = UTC; TT, .* convert"), ({"TIMESYS": "MJD"}, "s", "TIMESYS = MJD"),
        ({"TIMESYS": "TCB"}, "s", "TIMESYS = TCB"), ({"TIMESYS": "1993.0"}, "s", "TIMESYS = 1993.0"),
        ({"TIMEREF": None}, "s", "TIMEREF = missing"), ({"TIMEREF": "GEOCENTRIC"}, "s", "TIMEREF = GEOCENTRIC"),
        ({"TIMEREF": "HELIOCENTRIC"}, "s", "TIMEREF = HELIOCENTRIC"),
        ({"TREFPOS": "BARYCENTER"}, "s", "TIMEREF = LOCAL contradicts TREFPOS"),
        ({"TSTART": 500.0, "TSTOP": 600.0}, "s", "all 3 events stand outside TSTART to TSTOP"),
    ],
)  # fmt: skip
def test_keywords_of_time_that_are_refused(fits_file, header, unit, match):
    path = fits_file((GOOD | header, times(unit=unit)))
    with pytest.raises(FitsError, match=match) as caught:
        read_events(path)
    assert str(caught.value).startswith(f"{path}, extension 1 (EVENTS): ") and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("header", "local"),
    [
        ({"TIMEREF": "SOLARSYSTEM"}, False), ({"TIMEREF": "local"}, True),
        ({"TIMEREF": None, "TREFPOS": "TOPOCENTER"}, True),
        ({"TIMEREF": "SOLARSYSTEM", "TREFPOS": "BARYCENTER"}, False), ({"TIMEREF": "BARYCENTRIC"}, False),
        ({"TIMEREF": None, "TREFPOS": "BARYCENT"}, False),
    ],
)  # fmt: skip
def test_where_the_times_were_taken(fits_file, header, local):
    assert read_events(fits_file((GOOD | header, times()))).local is local


def test_keywords_may_stand_in_the_first_header_and_a_missing_time_scale_is_told(fits_file):
    lacking = {k: v for k, v in GOOD.items() if k in ("EXTNAME", "TIMEREF")}
    first = {k: v for k, v in GOOD.items() if k not in lacking}
    assert read_events(fits_file((lacking, times()), primary=first)).mjd == pytest.approx(FIRST, abs=JD)
    with pytest.warns(FitsWarning, match="lacks TIMESYS, the time scale; TT is taken"):
        assert read_events(fits_file((GOOD | {"TIMESYS": None}, times()))).mjd == pytest.approx(FIRST, abs=JD)


@pytest.mark.parametrize(
    ("columns", "match"),
    [
        (times([1.0, np.nan, np.nan]), "column TIME is null or not finite in row 2, as are 1 other"),
        (times([1.0, 2.0, np.inf]), "column TIME is null or not finite in row 3;"),
        (times([1.0, 1e30]), "TIME has 1e.30 in row 2"),
        (times([]), r"there are no events \(NAXIS2 = 0\)"),
        (times(RAW + 5e8, "E", ">f4"), "single precision, in steps of 32 s"),
        (times(np.ones((2, 2)), "2D"), "TIME holds 2 numbers in a row"),
        (times(np.ones((3, 8)), "8A", "u1"), "TIME holds text"),
        (times([*range(500000000, 500000010), *[0.0] * 5]), "column TIME has 0 s in row 11, a null value"),
        (times([*range(500000000, 500000010), -999.0]), "column TIME has -999 s in row 11, a null value"),
        (times([1.0, *range(500000000, 500000010)]), "TIME is 5.79e.03 d away from all others in row 1;"),
        (times([*range(9), 8e8]), r"TIME is 9.26e.03 d away from all others in row 10;"),
        (times() * 2, "the columns 1 and 2 are both called TIME"),
    ],
)  # fmt: skip
def test_times_that_cannot_be_right_are_refused_by_row(fits_file, columns, match):
    with pytest.raises(FitsError, match=match):
        read_events(fits_file((GOOD, columns)))


def test_null_integers_of_a_time_column(fits_file):
    path = fits_file((GOOD | {"TNULL1": -1, "TSCAL1": 1e-6}, times([5, -1, 7], "K", ">i8")))
    with pytest.raises(FitsError, match="column TIME is null or not finite in row 2"):
        read_events(path)


@pytest.mark.parametrize(
    "order",
    [np.arange(3000)[::-1], np.r_[1500:3000, 0:1500], np.r_[0:3000:2, 1:3000:2], np.r_[9:3000, 0:9]],
    ids=["reversed", "late half first", "two detectors", "first nine last"],
)  # fmt: skip
def test_the_order_of_photons_carries_no_information(fits_file, order):
    t = np.sort(np.random.default_rng(0).uniform(0.0, 500.0, 3000))
    phase = np.linspace(0.0, 1.0, 3000)
    columns = [*times(t[order]), ("PULSE_PHASE", "D", phase[order].astype(">f8"))]
    events = read_events(fits_file((GOOD, columns)))
    np.testing.assert_array_equal(events.t, t + 3.5)
    np.testing.assert_array_equal(events.phase, phase)


@pytest.mark.parametrize("parts", [lambda t: [t[0::2], t[1::2]], lambda t: [t[len(t) // 2 :], t[: len(t) // 2]]])
def test_merged_lists_of_rxte_are_timed_as_the_whole(fits_file, parts):
    rxte = read_events(data_path("photons/b1509_rxte.fits.gz"))
    raw = read_fits(data_path("photons/b1509_rxte.fits.gz"))[0].columns["TIME"]
    path = fits_file((GOOD | {"TIMEZERO": 3.37842846}, times(np.concatenate(parts(raw)))))
    merged = read_events(path)
    np.testing.assert_array_equal(merged.t, rxte.t)
    shuffled = photons.arrival_times(np.concatenate(parts(rxte.t)), 6.5957, pieces=5)
    wanted = photons.arrival_times(rxte.t, 6.5957, pieces=5)
    assert (shuffled.rms, shuffled.frequency) == (wanted.rms, wanted.frequency)


@pytest.mark.parametrize(
    ("merge", "doubled"),
    [
        (lambda t: np.concatenate([t, t]), 1000), (lambda t: np.repeat(t, 2), 1000),
        (lambda t: np.concatenate([t[:600], t[400:]]), 200), (lambda t: np.concatenate([t, t, t, t]), 2000),
    ],
)  # fmt: skip
def test_photons_of_a_list_merged_with_itself_count_once(fits_file, merge, doubled):
    t = np.sort(np.random.default_rng(2).uniform(0.0, 500.0, 1000))
    path = fits_file((GOOD, times(merge(t))))
    with pytest.warns(FitsWarning, match=f"{doubled} of {len(merge(t))} events stand there twice"):
        events = read_events(path)
    np.testing.assert_array_equal(np.unique(events.t), t + 3.5)


def test_photons_may_share_a_time_by_chance(fits_file, recwarn):
    for step in (0.01, 0.1, 1.0):  # 0.04 to 4 photons a step
        t = np.floor(np.random.default_rng(3).uniform(0.0, 500.0, 2000) / step) * step
        assert len(read_events(fits_file((GOOD, times(t)))).t) == 2000
    assert not recwarn


@pytest.mark.parametrize(
    ("tables", "exposure"),
    [
        ([gti((99, 110))], 11.0), ([gti((103, 110), (99, 102))], 10.0), ([gti((99, 105), (99, 110))], 11.0),
        ([gti((99, 104), (103, 110), (101, 102))], 11.0), ([gti((99, 110)), gti((90, 120))], 11.0), ([gti()], np.nan),
        ([gti((99 / 86400, 110 / 86400), header={"TIMEUNIT": "d", "TIMEZERO": 0}, unit="d")], 11.0),
        ([gti((99, 110), header={"EXTNAME": "STDGTI"})], 11.0), ([gti((99, 110), names=("Start", "Stop"))], 11.0),
        ([gti((99, 110), header={"EXTNAME": "GOOD", "HDUCLAS1": "GTI"})], 11.0),
        ([gti((99, 110), header={"EXTNAME": "GTI05"})], 11.0),
        ([gti((99 + 8.64e4, 110 + 8.64e4), header={"MJDREFI": 49352})], 11.0),
        ([gti((99, 110), header={"MJDREFI": None, "MJDREFF": None})], 11.0),
    ],
)  # fmt: skip
@pytest.mark.filterwarnings("ignore:.*overlap.*:geokalman.pulsar.fits.FitsWarning")
def test_good_time_intervals(fits_file, tables, exposure):
    with warnings.catch_warnings():
        warnings.filterwarnings("error", message=".*stand outside.*")
        events = read_events(fits_file(*tables, (GOOD, times()), primary={"MJDREFI": 49353, "MJDREFF": 0.000696574074}))
    assert events.exposure == pytest.approx(exposure, nan_ok=True)


@pytest.mark.parametrize(
    ("table", "match"),
    [
        (gti((99, 110), names=("TSTART", "STOP")), "GTI.: there is no column START; the columns are TSTART, STOP"),
        (gti((99, 110), names=("START", "END")), "there is no column STOP"),
        (gti((99, 100), (110, 105)), "row 2 ends .STOP. before"),
        (gti((np.nan, 110)), "column START is null or not finite in row 1"),
        (gti((500, 600)), "all 3 events stand outside the good"),
        (gti((99, 110), unit="m"), "TUNIT1 = m; a unit of time"),
        (gti((99, 110), unit="d"), "TUNIT1 = d contradicts TIMEUNIT"),
    ],
)  # fmt: skip
def test_good_time_intervals_that_are_refused(fits_file, table, match):
    with pytest.raises(FitsError, match=match):
        read_events(fits_file((GOOD, times()), table))


def test_photons_outside_and_intervals_that_overlap_are_told(fits_file):
    path = fits_file((GOOD, times([*range(100, 200)])), gti((100, 150), (140, 189)))
    with pytest.warns(FitsWarning) as told:
        assert len(read_events(path).t) == 100
    text = "\n".join(str(w.message) for w in told)
    assert "9 of 100 events stand outside the good-time intervals; they are kept" in text and "overlap" in text


def test_the_table_of_events_is_found_among_others(fits_file):
    other = {"EXTNAME": "HK", "HDUCLAS1": "TEMPORALDATA"}
    assert read_events(fits_file((GOOD | other, times([7.0])), (GOOD, times()))).t[0] == 103.5
    assert len(read_events(fits_file((GOOD | {"EXTNAME": "XTE_SE", "HDUCLAS1": "EVENT"}, times()))).t) == 3
    assert len(read_events(fits_file((GOOD | {"EXTNAME": "XTE_SE"}, times()))).t) == 3
    with pytest.warns(FitsWarning, match="the first of 2 tables of events; the others are left out"):
        assert len(read_events(fits_file((GOOD, times()), (GOOD, times([7.0])))).t) == 3
    assert read_events(fits_file((GOOD | {"OBJECT": None}, times()))).name == "given.fits"
    for header, columns, match in (
        (GOOD | {"EXTNAME": "RATE", "HDUCLAS1": "LIGHTCURVE"}, times(), "HDUCLAS1 = LIGHTCURVE; a table of events"),
        (GOOD, [("PHA", "D", RAW.astype(">f8"))], r"no table with a column TIME \(its tables: EVENTS\)"),
        (GOOD | {"XTENSION": "TABLE"}, times(), "numbers written as text"),
        (GOOD | {"ZTABLE": True}, times(), "funpack"),
    ):
        with pytest.raises(FitsError, match=match):
            read_events(fits_file((header, columns)))
    with pytest.raises(FitsError, match=r"its tables: none"):
        read_events(fits_file())


@pytest.mark.parametrize(
    ("header", "words"),
    [
        ({"MJDREFF": 60.184}, "MJDREFF = 60.184; a part of a day"),
        ({"MJDREFF": -0.5}, "MJDREFF = -0.5; a part of a day"),
        ({"TSCAL1": 0.0}, "TSCAL1 = 0, which makes all rows the same"),
        ({"TIMEDEL": 1.0, "TIMEPIXR": 7.0}, "TIMEPIXR = 7; a positive step, a part of 0 to 1"),
        ({"TIMEDEL": -1.0}, "TIMEDEL = -1 s"),
        ({"MJDREFI": None, "MJDREFF": None, "DATEREF": "1994"}, "DATEREF = 1994; a date as"),
    ],
)
def test_keywords_of_time_that_cannot_be_are_refused(fits_file, header, words):
    with pytest.raises(FitsError, match=words):
        read_events(fits_file((GOOD | header, times())))


@pytest.mark.parametrize(
    ("header", "first"),
    [
        ({"MJDREFI": None, "MJDREFF": None, "DATEREF": "1994-01-01T00:00:00"}, 49353.0 + 103.5 / 86400),
        ({"MJDREFF": None, "MJDREF": 49353.25}, 49353.25 + 103.5 / 86400),
    ],
)
def test_an_absent_keyword_has_its_default(fits_file, header, first):
    assert read_events(fits_file((GOOD | header, times()))).mjd == pytest.approx(first, abs=JD)


def test_intervals_without_a_reference_have_that_of_the_events(fits_file):
    bare = dict.fromkeys(("MJDREFI", "MJDREFF", "TIMEZERO", "TIMESYS", "TIMEUNIT"))
    assert read_events(fits_file((GOOD, times()), gti((99.0, 105.0), header=bare))).exposure == 6.0


@pytest.mark.parametrize("copies", [2, 3])
def test_a_list_merged_with_itself_is_taken_once(fits_file, copies):
    t = np.tile(np.arange(40.0) + 100.0, copies)
    with pytest.warns(FitsWarning, match="twice|several times"):
        assert len(read_events(fits_file((GOOD, times(t)))).t) == 40


@pytest.mark.parametrize(("phase", "words"), [(np.nan, "null or not finite in row 2"), (-999.0, "-999 in row 2")])
def test_phases_that_are_null_are_refused_by_row(fits_file, phase, words):
    columns = [*times(), ("PULSE_PHASE", "D", np.array([0.1, phase, 0.3]).astype(">f8"))]
    with pytest.raises(FitsError, match=f"PULSE_PHASE (is|has) {words}"):
        read_events(fits_file((GOOD, columns)))


def test_one_time_for_all_photons_is_refused(fits_file):
    with pytest.raises(FitsError, match="column TIME has 0 in all 3 rows"):
        read_events(fits_file((GOOD, times([0.0, 0.0, 0.0]))))
