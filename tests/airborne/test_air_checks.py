"""The border checks of a survey: every channel, its nulls, spikes, units and times; each named by row, or repaired."""

import warnings

import numpy as np
import pytest

from geokalman.airborne import experiment, read
from geokalman.airborne.model import Tuning
from geokalman.airborne.read import checks
from geokalman.airborne.read.columns import Table
from geokalman.airborne.read.layout import KAURING, Layout
from geokalman.reading import InputError

CHANNELS = [*KAURING.columns.values(), *KAURING.corrections, *KAURING.references.values()]
NEEDED = [name for name in CHANNELS if name != "LINE" and name not in KAURING.references.values()]


def changed(table, **columns):
    return {**table, **columns}


@pytest.mark.parametrize("column", [name for name in CHANNELS if name not in ("LINE", "UTC")])
@pytest.mark.parametrize("value", [12345678.0, -12345.5, "next"])
def test_a_spike_in_any_channel_is_refused_by_row(table, column, value):
    """Far out of range, or by far more than the channel changes from row to row."""
    size = {"LON": 0.5, "LAT": 0.5, "EASTING": 5e3, "NORTHING": 5e3, "GPSZ": 500.0, "FZ": 9e4, "AZ": 9e4, "GRVRAW": 3e4}
    table[column][300] = table[column][300] + size.get(column, 120.0) if value == "next" else value
    with pytest.raises(InputError, match="row 301 of the data"):
        read.survey(table, KAURING)


@pytest.mark.parametrize("column", [name for name in CHANNELS if name not in ("LINE", "UTC", "FZ", "AZ", "GRVRAW")])
def test_a_run_of_wrong_values_is_refused_by_row(table, column):
    """40 rows of one value, which are their own neighbourhood."""
    table[column][300:340] = table[column][300] + 999.0
    with pytest.raises(InputError, match="row 3(01|40|41) of the data"):
        read.survey(table, KAURING)


@pytest.mark.parametrize("column", NEEDED)
@pytest.mark.parametrize("null", [-9999.0, -99999.999, -999999.0, 9999999.9, -32768.0])
def test_a_null_in_a_needed_channel_makes_a_hole_and_is_told(table, column, null):
    table[column][200:203] = null
    with pytest.warns(
        checks.SuspiciousData, match=r"at row 201 of the data: 3 values there are taken as null|cut into 2"
    ):
        found = read.survey(table, KAURING, 60.0)
    assert [len(f.line.t) for f in found.flights] == [200, 685]


@pytest.mark.parametrize("column", [*KAURING.references.values()])
@pytest.mark.parametrize("null", [-9999.0, -999.99, 99999.9, 0.0])
def test_nulls_in_a_reference_change_no_number(table, column, null):
    """But zero, which is a value of gravity, stays one."""
    table["FZ"] = table["FZ"] + 0.0
    whole = read.survey(table, KAURING)[104000]
    name = next(ours for ours, theirs in KAURING.references.items() if theirs == column)
    table[column] = table[column].copy()
    table[column][300:310] = null
    if null == 0.0:
        assert (read.survey(table, KAURING)[104000].references[name][300:310] == 0.0).all()
        return
    with pytest.warns(
        checks.SuspiciousData, match=f"in {name} at row 301 of the data: 10 values there are taken as null"
    ):
        flight = read.survey(table, KAURING)[104000]
    assert np.isnan(flight.references[name]).sum() == 10
    tuning = Tuning.preset("kauring")
    ours, theirs = (experiment.real([one], tuning) for one in (flight, whole))
    assert ours.sd("fb", name)[0] == pytest.approx(theirs.sd("fb", name)[0], rel=0.02)
    assert experiment.scatter([flight], {"104000": ours.series("fb")[0]}, reference=name)[0] == ours.sd("fb", name)[0]


def test_a_reference_that_is_null_all_along_is_none(whole):
    rows = np.isin(whole["LINE"], [104000, 104100])
    two = {name: values[rows].copy() for name, values in whole.items()}
    two["GND_FA"][two["LINE"] == 104000] = -99999.0
    with pytest.warns(checks.SuspiciousData, match=r"ground is null or one value in all rows of 1 line \(104000\)"):
        found = read.survey(two, KAURING)
    assert "ground" not in found[104000].references and "ground" in found[104100].references
    with pytest.raises(ValueError, match="The lines 104000 have no ground, against which this page judges; leave them"):
        found.require("ground")


@pytest.mark.parametrize(
    ("column", "change", "message"),
    [
        ("UTC", lambda x: x / 3600, "the times would be in hours, seconds are needed"),
        ("UTC", lambda x: x / 86400, "the times would be in days, seconds are needed"),
        ("UTC", lambda x: x / 60, "the times would be in minutes, seconds are needed"),
        ("UTC", lambda x: x * 1000, "the times would be in milliseconds, seconds are needed"),
        ("UTC", lambda x: x // 3600 * 1e4 + x % 3600 // 60 * 100 + x % 60, "they are HHMMSS, and seconds are needed"),
        ("LAT", np.radians, "do not move as easting and northing do, in either order; check"),
        ("NORTHING", lambda x: x / 0.3048, "do not move as easting and northing do"),
        ("GPSZ", lambda x: x / 0.3048, "the height is probably in feet"),
        (
            "GPSZ",
            lambda x: x - 25.0,
            r"belongs to a height \+25.0 m from the one given; the height must be above the ell",
        ),
        ("GPSZ", lambda x: x * 1.2, r"though not everywhere; check its column and that of the height"),
        ("FZ", lambda x: -x, "its sign is the other one, upward is positive"),
        ("FZ", lambda x: x * 0, "not about 980000: check its column"),
        (
            "AZ",
            lambda x: -x,
            r"row \d+ of the data .0.02 is rounding.; it is f3 \+ a_up, so the sign of a_up is the other",
        ),
        ("FACOR", lambda x: x * 10, "that is 10 times as much; it is probably in um/s2"),
        ("LATCOR", lambda x: x * 1e-5, "that is 1e-05 times as much; it is probably in m/s2"),
        ("FACOR", lambda x: x / 0.3048, "it is probably for a height in feet"),
        ("FACOR", lambda x: x * 0 + 50, "though not everywhere; check its column"),
        ("EOTCOR", lambda x: x + 100, "check its column and unit"),
        ("EOTCOR", lambda x: -x, "its sign is the other one"),
        ("FRAL100", lambda x: x * 10, "contractor is .* times the gravity that the accelerations give; check its unit"),
        ("GND_FA", lambda x: x / 10, "ground is .* times the gravity that the accelerations give; check its unit"),
        ("GND_FA", lambda x: -x, "ground is -.* times the gravity .*; its sign is the other one"),
        ("FAL1000", lambda x: x + 979000, r"grid is 97\d+ mGal at row 1 of the data, beyond -1000 to 1000"),
    ],
)
def test_what_is_wrong_is_named_and_nothing_else(table, column, change, message):
    with pytest.raises(InputError, match=message):
        read.survey(changed(table, **{column: change(table[column])}), KAURING)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"LON": np.radians, "LAT": np.radians}, "they are in radians, degrees are needed"),
        ({"EASTING": lambda x: x / 1e3, "NORTHING": lambda x: x / 1e3}, "are in kilometres, metres are needed"),
        ({"EASTING": lambda x: x / 0.3048, "NORTHING": lambda x: x / 0.3048}, "are in feet, metres are needed"),
        ({"EASTING": "NORTHING", "NORTHING": "EASTING"}, "easting and northing are swapped"),
        ({"EASTING": "LON", "NORTHING": "LAT"}, "easting and northing look like degrees, metres on a map are needed"),
    ],
)
def test_places_in_other_units(table, changes, message):
    new = {name: table[how] if isinstance(how, str) else how(table[name]) for name, how in changes.items()}
    with pytest.raises(InputError, match=message):
        read.survey(changed(table, **new), KAURING)


def test_an_easting_in_feet_shows_between_the_lines_where_they_run_north(whole):
    rows = np.isin(whole["LINE"], [101000, 104000, 108000])
    three = {name: values[rows].copy() for name, values in whole.items()}
    three["EASTING"] = three["EASTING"] / 0.3048
    with pytest.raises(InputError, match="The middles of the lines: .* do not move as easting and northing do"):
        read.survey(three, KAURING)


def test_the_sign_of_the_kinematic_acceleration_shows_without_a_raw_column(table):
    bare = {name: values for name, values in table.items() if name != "GRVRAW"}
    ours, theirs = (read.survey(one, KAURING)[104000].line.z for one in (bare, table))
    np.testing.assert_allclose(ours, theirs, rtol=1e-9)
    with pytest.raises(InputError, match="a_up is -.* times the acceleration of the height; its sign is the other one"):
        read.survey(changed(bare, AZ=-bare["AZ"]), KAURING)
    with pytest.raises(
        InputError, match=r"a_up is 0.\d+ times the acceleration of the height; check the units of both"
    ):
        read.survey(changed(bare, AZ=bare["AZ"] / 10), KAURING)


def test_the_kinematic_acceleration_may_be_had_from_the_raw_column(table, kauring):
    bare = {name: values for name, values in table.items() if name != "AZ"}
    np.testing.assert_allclose(read.survey(bare, KAURING)[104000].line.z, kauring[104000].line.z, atol=1e-3)
    del bare["GRVRAW"]
    with pytest.warns(checks.SuspiciousData, match=r"there is no column AZ .a_up.: the height is differenced instead"):
        read.survey(bare, KAURING)


def test_raw_gravity_may_be_rounded_as_the_file_is(table):
    """Milligals without decimals: raw and f3 - a_up differ by up to one and a half."""
    for name in ("FZ", "AZ", "GRVRAW"):
        table[name] = np.round(table[name])
    assert len(read.survey(table, KAURING)[104000].line.t) == 888


@pytest.mark.parametrize("start", [86400.0 - 200.0, 604800.0 - 200.0, 0.0, 1.4e9])
def test_midnight_and_the_end_of_the_week_are_unwrapped(table, start):
    table["UTC"] = start + 0.5 * np.arange(888)
    table["UTC"][table["UTC"] >= (604800 if start > 5e5 else 86400)] -= (
        0 if start > 1e9 else 604800 if start > 5e5 else 86400
    )
    line = read.survey(table, KAURING)[104000].line
    np.testing.assert_allclose(np.diff(line.t), 0.5, atol=1e-6)


def test_a_longitude_that_passes_180_degrees_is_no_spike(table, kauring):
    table["LON"] = (table["LON"] - table["LON"][400] + 180.0 + 180.0) % 360.0 - 180.0
    np.testing.assert_array_equal(read.survey(table, KAURING)[104000].line.z, kauring[104000].line.z)


@pytest.mark.parametrize("value", [99.0, 1e7, -1e7])
def test_a_wild_time_is_named_and_not_taken_for_disorder(table, value):
    table["UTC"][300] = value
    with pytest.raises(
        InputError, match="the time is .* s at row 301 of the data between .* a spike, or a null that is not marked"
    ):
        read.survey(table, KAURING)


@pytest.mark.parametrize("pair", [(300, 301), (300, 302), (300, 340), (10, 800)])
def test_rows_that_are_swapped_are_out_of_order_and_no_spikes(table, pair):
    order = np.arange(888)
    order[list(pair)] = pair[::-1]
    with pytest.raises(
        InputError, match=r"at row \d+ of the data.*sort them|not in the order of time.*sort them"
    ) as said:
        read.survey({name: values[order] for name, values in table.items()}, KAURING)
    assert "spike" not in str(said.value) and "rows are not in the order of time" in str(said.value)


def east(whole, *more):
    """A line of the survey that runs east, with others, to be spoilt."""
    rows = np.isin(whole["LINE"], [10100, *more])
    return {name: values[rows].copy() for name, values in whole.items()}


@pytest.mark.parametrize("more", [[], [10200, 10300], [104000, 104100]])
def test_a_line_to_the_east_with_the_wrong_sign_of_latitude_is_named(whole, more):
    table = east(whole, *more)
    assert len(read.survey(table, KAURING).flights) == 1 + len(more)
    table["LAT"] = np.where(table["LINE"] == 10100, -table["LAT"], table["LAT"])
    said = (
        "that of the other lines with the other sign" if more else "falls where the map coordinate grows; its sign is"
    )
    with pytest.raises(InputError, match=rf"Line 10100: latitude 31.99\d\d (is )?{said}"):
        read.survey(table, KAURING)


def test_a_line_that_is_flown_again_with_the_wrong_sign_is_named(whole):
    """Both middles stand at the same place on the map."""
    table = east(whole)
    again = {name: values.copy() for name, values in table.items()}
    again["LINE"] += 1.0
    again["LAT"] = -again["LAT"]
    both = {name: np.concatenate([values, again[name]]) for name, values in table.items()}
    with pytest.raises(InputError, match="Line 1010[01]: latitude -?31.99.. is that of the other lines with the other"):
        read.survey(both, KAURING)


def test_a_longitude_of_the_wrong_sign_on_lines_to_the_north(table):
    table["LON"] = -table["LON"]
    with pytest.raises(InputError, match=r"Line 104000: longitude -117.0\d\d\d falls where the map coordinate grows"):
        read.survey(table, KAURING)


def test_a_latitude_of_the_wrong_sign_on_a_line_to_the_north(table):
    table["LAT"] = -table["LAT"]
    with pytest.raises(
        InputError, match="do not move as easting and northing do, .* the sign of the latitude is the ot"
    ):
        read.survey(table, KAURING)


def test_a_row_without_a_time_is_left_out_with_a_note(table):
    table["UTC"][300] = np.nan
    with pytest.warns(checks.SuspiciousData, match="1 row of line 104000 without a time left out"):
        assert [len(f.line.t) for f in read.survey(table, KAURING, 60.0).flights] == [300, 587]


def test_a_file_that_is_in_there_twice_is_taken_once(whole):
    rows = np.flatnonzero(np.isin(whole["LINE"], [104000, 104100]))
    twice = {name: values[np.append(rows, rows)] for name, values in whole.items()}
    with pytest.warns(checks.SuspiciousData, match="line 104000 occurs twice in the same rows; they are taken once"):
        found = read.survey(twice, KAURING)
    assert [f.name for f in found.flights] == ["104000", "104100"]


def test_rows_that_stand_twice_with_another_reference_are_no_repeats(table):
    order = np.sort(np.append(np.arange(888), 300))
    twice = {name: values[order] for name, values in table.items()}
    twice["GND_FA"][301] += 1.0
    with pytest.warns(checks.SuspiciousData, match="a repeated epoch at row 302"):
        read.survey(twice, KAURING, 60.0)


def test_interleaved_lines_are_taken_apart(whole):
    rows = np.concatenate([np.flatnonzero(whole["LINE"] == name)[:600] for name in (104000, 104100)])
    order = rows.reshape(2, 600).T.ravel()
    with pytest.warns(checks.SuspiciousData, match="the rows of different lines stand between each other"):
        found = read.survey({name: values[order] for name, values in whole.items()}, KAURING)
    assert [(f.name, len(f.line.t)) for f in found.flights] == [("104000", 600), ("104100", 600)]


def test_messages_name_the_file_and_its_row(table, tmp_path):
    own = Table(table, path=tmp_path / "own.csv", rows=np.arange(888) + 17)
    own["GND_FA"][300] = 500.0
    with pytest.raises(InputError, match=r"own.csv: Line 104000: ground is 500 mGal at row 317 of the file"):
        read.survey(own, KAURING)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"columns": {"line": "LINE"}}, "A layout names columns for line, t, .* this one lacks t, lon"),
        ({"columns": {**KAURING.columns, "speed": "V"}}, "this one does not know speed"),
        ({"corrections": {"FACOR": 2}}, r"added with the sign \+1 or -1, FACOR has 2"),
        (
            {"kinds": {"FACOR": "bouguer"}},
            "gives a correction its kind, latitude, eotvos, free_air; not FACOR 'bouguer'",
        ),
        ({"kinds": {"NONE": "eotvos"}}, "not NONE 'eotvos'"),
        ({"acceleration": "gal"}, "not gal and m"),
        ({"height": "km"}, "not mGal and km"),
    ],
)
def test_a_layout_that_says_nonsense(change, message):
    given = {"columns": KAURING.columns, "corrections": KAURING.corrections, **change}
    with pytest.raises(InputError, match=message):
        Layout(**given)


def test_the_vendored_surveys_pass_without_a_note(kauring):
    assert kauring.notes == () and kauring.refused == ()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert [note for note in read.load("eastvic").notes if "aliased" not in note] == []


def test_what_looks_like_a_null():
    looks = checks.looks_null(
        np.array([-9999, -999.99, 99999.999, -32768, -999.25, 99.0, 9998.0, 989.99, -9.99, 0, np.nan, 999.5])
    )
    assert looks.tolist() == [True] * 6 + [False] * 6
