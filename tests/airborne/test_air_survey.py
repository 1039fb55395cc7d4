"""Faults of a survey itself, whatever its file: refused in one sentence, or repaired."""

import re
import warnings
from dataclasses import replace

import numpy as np
import pytest
from surveyfiles import cut

from geokalman.airborne import experiment, read
from geokalman.airborne.estimate import estimate
from geokalman.airborne.model import Tuning
from geokalman.airborne.read import EASTVIC, KAURING, KAURING_DAT, checks, quality, survey
from geokalman.reading import InputError


def test_swapped_latitude_and_longitude_are_put_right(table, kauring):
    table["LON"], table["LAT"] = table["LAT"], table["LON"]
    with pytest.warns(checks.SuspiciousData, match=r"longitude are swapped on 1 line .104000.; put right"):
        flight = survey(table, KAURING)[104000]
    np.testing.assert_array_equal(flight.lat, kauring[104000].lat)
    table["LON"] = table["LAT"] * 0 + 3.0
    with pytest.raises(ValueError, match="do not move as easting and northing do, in either order"):
        survey(table, KAURING)


def test_swap_below_ninety_degrees_is_seen_in_the_motion(table):
    table["LON"] = table["LON"] - 100.0  # both could be latitudes now
    table["LON"], table["LAT"] = table["LAT"], table["LON"]
    with pytest.warns(checks.SuspiciousData, match="swapped"):
        survey(table, KAURING)


def test_the_contractors_definition_has_them_swapped(table):
    renamed = {
        "UTCSECOND": table["UTC"],
        "LATITUDE": table["LON"],
        "LONGITUD": table["LAT"],
        "GRVFRAL100S": table["FRAL100"],
    }
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # a known fault of the definition is no news
        flight = survey({**table, **renamed}, KAURING_DAT)[104000]
    assert -32.2 < flight.lat[0] < -31.8
    renamed["LATITUDE"], renamed["LONGITUD"] = renamed["LONGITUD"], renamed["LATITUDE"]
    with pytest.warns(checks.SuspiciousData, match="swapped on 1 line"):  # should a later edition name them rightly
        again = survey({**table, **renamed}, KAURING_DAT)[104000]
    np.testing.assert_array_equal(again.lat, flight.lat)


def test_midnight_is_unwrapped(table, kauring):
    table["UTC"] = (table["UTC"] + 86400 - 1000) % 86400
    line = survey(table, KAURING)[104000].line
    assert np.allclose(np.diff(line.t), 0.5) and len(line.t) == 888
    np.testing.assert_allclose(line.z, kauring[104000].line.z)


def test_a_gap_splits_the_line_and_is_not_integrated_across(whole, table):
    long = {name: np.concatenate([v, v]) for name, v in table.items()}  # 888 s in two flights over the same ground
    long["UTC"][888:] += 600.0
    with pytest.warns(checks.SuspiciousData, match=r"line 104000 is cut into 2 pieces: a gap of 156.5 s at row 889"):
        pieces = survey(long, KAURING).flights
    assert [f.name for f in pieces] == ["104000a", "104000b"] and {f.number for f in pieces} == {104000.0}
    np.testing.assert_array_equal(pieces[0].line.z, pieces[1].line.z)
    assert pieces[1].line.z[0] == 0.0


def test_a_null_in_one_channel_splits_too(table):
    long = {name: np.concatenate([v, v]) for name, v in table.items()}
    long["UTC"][888:] += 600.0
    long["FZ"][600] = np.nan
    with pytest.warns(checks.SuspiciousData, match="3 pieces: f3 null at row 601 of the data, a gap of"):
        found = survey(long, KAURING)
    assert [f.name for f in found.select([104000])] == ["104000a", "104000c"]
    assert found["104000c"].line.t[0] > found["104000a"].line.t[-1]
    with pytest.raises(read.UnknownLine, match="is not whole, its pieces are 104000a, 104000c: line 104000b lasts"):
        found[104000]
    assert [(f.name, len(f.line.t)) for f in found.flights] == [("104000a", 600), ("104000c", 888)]
    assert found.refused == ("line 104000b lasts 143.0 s, at least 240 s are needed",)


def test_a_null_in_a_reference_is_left_to_the_assessment(table):
    table["GND_FA"][100] = np.nan
    flight = survey(table, KAURING)[104000]
    assert len(flight.line.t) == 888 and np.isnan(flight.references["ground"][100])


def test_a_repeated_row_is_dropped_and_a_repeated_epoch_splits(table, kauring):
    twice = cut(table, np.sort(np.append(np.arange(888), 300)))
    with pytest.warns(checks.SuspiciousData, match="1 row of line 104000 occurs twice and is taken once .*row 302"):
        found = survey(twice, KAURING)
    np.testing.assert_array_equal(found[104000].line.z, kauring[104000].line.z)
    table["UTC"][500:] -= 0.5
    with pytest.warns(checks.SuspiciousData, match="a repeated epoch at row 501"):
        assert len(survey(table, KAURING, 150.0).flights) == 2


def test_a_step_that_varies(table):
    table["UTC"][::2] += 0.1
    with pytest.raises(ValueError, match="the step is .* elsewhere; resample to a constant step"):
        survey(table, KAURING)


def test_a_reversed_line_is_turned(table, kauring):
    with pytest.warns(checks.SuspiciousData, match="line 104000 is in the reverse order of time and is turned"):
        found = survey(cut(table, slice(None, None, -1)), KAURING)
    np.testing.assert_array_equal(found[104000].line.z, kauring[104000].line.z)


@pytest.mark.parametrize("leap", [18.0, -16.0])
def test_gps_time_mixed_with_utc(table, leap):
    table["UTC"][400:] += leap
    with pytest.raises(ValueError, match=rf"the time jumps by [+-]{abs(leap):.0f} s at .* GPS time and UTC are mixed"):
        survey(table, KAURING)


@pytest.mark.parametrize(("factor", "unit"), [(10.0, "um/s2"), (1e-5, "m/s2")])
def test_units_of_acceleration(table, factor, unit):
    for name in ("FZ", "AZ", "GRVRAW"):
        table[name] *= factor
    with pytest.raises(ValueError, match=f"not about 980000; it would be gravity in {unit}"):
        survey(table, KAURING)


@pytest.mark.parametrize("column", ["LATCOR", "EOTCOR", "FACOR"])
def test_sign_of_the_corrections(table, column):
    table[column] = -table[column]
    with pytest.raises(
        ValueError, match=rf"{column} adds .* where the positions ask for .*; its sign is the other one"
    ):
        survey(table, KAURING)


def test_a_correction_that_is_another_column(table):
    table["LATCOR"] = table["LATCOR"] * 0.5
    with pytest.raises(ValueError, match="LATCOR adds .*; check its column and unit"):
        survey(table, KAURING)


def test_both_conventions_of_the_two_files_are_known():
    assert KAURING.corrections["LATCOR"] == -1 and EASTVIC.corrections["LATCOR"] == 1


def test_raw_gravity_that_is_not_the_difference(table):
    table["GRVRAW"][7] += 0.05
    with pytest.raises(ValueError, match="raw gravity differs from f3 - a_up by 0.05 mGal"):
        survey(table, KAURING)


def test_height_in_feet(table):
    table["GPSZ"] = table["GPSZ"] / 0.3048
    with pytest.raises(ValueError, match="the height is probably in feet"):
        survey(table, KAURING)
    feet = read.Layout(KAURING.columns, KAURING.corrections, KAURING.kinds, height="ft")
    assert survey(table, feet)[104000].height.mean() < 400


def test_height_above_the_geoid(table):
    table["GPSZ"] += 27.0
    with pytest.raises(
        ValueError, match=r"belongs to a height -27.0 m from the one given; the height must be above the ellipsoid"
    ):
        survey(table, KAURING)


def test_speeds_that_cannot_be(table):
    for factor in (0.2, 5.0):
        scaled = {name: v.copy() for name, v in table.items()}
        for name in ("EASTING", "NORTHING", "LON", "LAT"):
            scaled[name] = scaled[name][0] + factor * (scaled[name] - scaled[name][0])
        with pytest.raises(ValueError, match="the mean speed is .* m/s, not between 20 and 150"):
            survey(scaled, KAURING)


def test_a_short_line_is_refused_with_a_reason(table):
    short = cut(table, slice(0, 400))
    with pytest.raises(ValueError, match="No line can be used: line 104000 lasts 199.5 s, at least 240 s are needed"):
        survey(short, KAURING)
    line = survey(short, KAURING, 60.0)[104000].line
    with pytest.raises(ValueError, match="Line 104000 lasts 199.5 s"):
        estimate(line, Tuning.preset("kauring"))


def test_a_line_that_is_not_there(kauring):
    with pytest.raises(KeyError, match="There is no line 5; there are 10100"):
        kauring[5]
    with pytest.raises(KeyError, match="There is no line 200100; line 200100 lasts 140.0 s, at least 240 s are needed"):
        read.load("kauring")[200100]


def test_a_line_that_is_flown_twice_keeps_both_flights(table):
    other = {name: values.copy() for name, values in table.items()}
    other["LINE"] += 100.0
    thrice = {name: np.concatenate([table[name], other[name], table[name]]) for name in table}
    thrice["UTC"][-888:] += 3600.0
    with pytest.warns(checks.SuspiciousData, match="line 104000 was flown 2 times, its flights carry letters"):
        found = survey(thrice, KAURING)
    assert [f.name for f in found.flights] == ["104000a", "104100", "104000b"]
    assert [f.name for f in found.select([104000])] == ["104000a", "104000b"]


def test_more_pieces_than_letters_keep_apart(table):
    for k in range(30, 888, 30):
        table["FZ"][k] = np.nan
    with pytest.warns(checks.SuspiciousData, match="cut into 30 pieces"):
        found = survey(table, KAURING, 5.0)
    names = [f.name for f in found.flights]
    assert len(names) == 30 == len(set(names)) and names[24:29] == [f"104000{x}" for x in ("y", "z", "aa", "ab", "ac")]
    assert {f.number for f in found.flights} == {104000.0}


def test_an_empty_line_is_refused_and_the_rest_of_the_file_read(whole, table):
    rows = np.isin(whole["LINE"], [104000, 104100])
    two = {name: values[rows].copy() for name, values in whole.items()}
    two["FZ"][:888] = np.nan
    found = survey(two, KAURING)
    assert [f.name for f in found.flights] == ["104100"]
    assert found.refused == ("line 104000 cannot be used: f3 null in all of its rows",)
    two["FZ"][:2] = 979_000.0
    assert survey(two, KAURING).refused == ("line 104000 cannot be used: only 2 complete rows",)
    with pytest.raises(ValueError, match="No line can be used: line 104000 cannot be used: only 2 complete rows"):
        survey(cut(two, slice(0, 888)), KAURING)


def test_aliased_specific_force_beside_a_kinematic_acceleration(table):
    slow = 4.0e4 * np.sin(0.7 * np.arange(888))  # a motion that the height does not have
    table["FZ"], table["GRVRAW"] = table["FZ"] + slow, table["GRVRAW"] + slow
    with pytest.warns(checks.SuspiciousData, match=r"on 1 of 1 lines .104000. the specific force .* aliased"):
        found = survey(table, KAURING)
    assert found.aliased == ("104000",)
    plain, trusted = Tuning.preset("kauring"), Tuning.preset("kauring", R_m=0.15)
    loose, stiff = experiment.real(found.flights, plain, aliased=found.aliased), experiment.real(found.flights, trusted)
    np.testing.assert_array_equal(loose.series("fb")[0], stiff.series("fb")[0])
    assert np.abs(loose.series("fb")[0] - experiment.real(found.flights, plain).series("fb")[0]).max() > 1.0
    stiff = [experiment.real(found.flights, replace(plain, R_m=0.3), aliased=names) for names in ((), found.aliased)]
    np.testing.assert_array_equal(stiff[0].series("fb")[0], stiff[1].series("fb")[0])  # what is larger stays


@pytest.mark.parametrize("noise", [0.03, 0.1])
def test_a_noisy_height_is_not_taken_for_an_aliased_specific_force(table, noise):
    table["GPSZ"] = table["GPSZ"] + noise * np.random.default_rng(3).standard_normal(888)
    with pytest.warns(checks.SuspiciousData, match=r"on 1 of 1 lines .104000. the height has white noise") as said:
        found = survey(table, KAURING)
    assert quality.height_correlation(found[104000].line.f3, found[104000].height) < quality.FOLLOWS
    assert found.aliased == ()
    told = float(re.search(r"noise of up to ([\d.]+) m", str(said[0].message))[1])
    assert told == pytest.approx(noise, rel=0.15)


@pytest.mark.parametrize("noise", [0.0, 0.03])
def test_vibration_that_is_sampled_too_slowly_is_aliased_under_a_noisy_height_too(table, noise):
    """A vibration of 20 000 mGal at 8.25 Hz, seen twice a second: eight samples are a turn."""
    rng = np.random.default_rng(4)
    shaken = 2.0e4 * np.sin(2 * np.pi * 8.25 * 0.5 * np.arange(888))
    table["FZ"], table["GRVRAW"] = table["FZ"] + shaken, table["GRVRAW"] + shaken
    table["GPSZ"] = table["GPSZ"] + noise * rng.standard_normal(888)
    with pytest.warns(checks.SuspiciousData, match="probably aliased"):
        assert survey(table, KAURING).aliased == ("104000",)


@pytest.mark.parametrize(
    ("column", "value", "message"),
    [
        ("GPSZ", 98765.0, r"height is 98765 m at row 301 of the data, 9.84e\+04 m away from its neighbours"),
        (
            "GPSZ",
            -12345678.0,
            "height is -1.23457e.07 m at row 301 of the data, .* a spike, or a null that is not marked",
        ),
        ("FZ", 9.8e6, "f3 is 9.8e.06 mGal at row 301"),
        ("EASTING", 0.0, "easting is 0 m at row 301"),
    ],
)
def test_one_wild_value_is_named(table, column, value, message):
    table[column][300] = value
    with pytest.raises(ValueError, match=message):
        survey(table, KAURING)


def test_a_run_of_unknown_nulls_is_named(table):
    table["GPSZ"][300:340] = -12345678.0
    with pytest.raises(ValueError, match="a null that is not marked as one"):
        survey(table, KAURING)


def test_rows_out_of_order(table):
    order = np.r_[0:400, 409:399:-1, 410:888]
    with pytest.raises(ValueError, match="rows are not in the order of time, .* at row 402 of the data; sort them"):
        survey(cut(table, order), KAURING)


def test_selecting_a_line_twice_or_none(kauring):
    with pytest.raises(ValueError, match="lines has line 104000 twice"):
        kauring.select([104000, 104100, 104000])
    with pytest.raises(ValueError, match="lines is empty; there are 10100"):
        kauring.select([])


def test_samples_of_lines(kauring):
    assert [f.name for f in experiment.sample(kauring.flights, "test", [104000, 104200])] == [
        "104000",
        "104100",
        "104200",
    ]
    with pytest.raises(
        ValueError, match=r"test = \[1, 2\]: no line of at least 800 points lies between; they run from"
    ):
        experiment.sample(kauring.flights, "test", [1, 2])
    with pytest.raises(ValueError, match=r"train = \[5\]: two numbers are wanted, the first and the last line"):
        experiment.sample(kauring.flights, "train", [5])
    tested = experiment.sample(kauring.flights, "test", [105000, 110900])
    assert len(tested) == 60 and experiment.unseen(tested).sum() == 48


def test_a_survey_without_ground_truth_says_so(table):
    found = survey({k: v for k, v in table.items() if k not in ("GND_FA", "FRA100")}, KAURING)
    found.require("contractor")
    with pytest.raises(ValueError, match=r"no column GND_FA, GNDGRV_FA_UPWARD \(ground\), .* it has contractor, grid"):
        found.require("contractor", "ground")


def test_an_unknown_unit_and_a_row_without_a_line(table):
    with pytest.raises(ValueError, match="not knots and m"):
        survey(table, read.Layout(KAURING.columns, KAURING.corrections, acceleration="knots"))
    table["LINE"][:] = np.nan
    with pytest.raises(ValueError, match="Row 1 of the data: this row carries no line number"):
        survey(table, KAURING)


@pytest.mark.parametrize(("column", "value"), [("GPSZ", np.nan), ("GPSZ", -9999.0), ("FACOR", np.nan)])
def test_where_no_piece_is_long_enough_the_null_that_cut_it_is_named(table, column, value):
    short = cut(table, slice(0, 600))
    short[column] = np.where(np.arange(600) == 300, value, short[column])
    with pytest.raises(InputError, match=r"No line can be used: .* (height|FACOR) null at row 301 of the data"):
        survey(short, KAURING)


def test_a_negative_line_number_is_refused_by_row(table):
    wrong = {**table, "LINE": np.where(np.arange(len(table["LINE"])) == 7, -9999.0, table["LINE"])}
    with pytest.raises(InputError, match="[Rr]ow 8 of the data: the line number is -9999, and none is negative"):
        survey(wrong, KAURING)
