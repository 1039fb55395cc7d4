"""Level-1 files of strangers: headers, units, epochs, packing and orbits as others write or damage them."""

from __future__ import annotations

import bz2
import gzip
import lzma
import warnings
from pathlib import Path

import numpy as np
import pytest

from geokalman.attitude import experiment as flights
from geokalman.attitude import read as day
from geokalman.attitude import write
from geokalman.attitude.header import END, Level1Error, flag_meanings
from geokalman.attitude.legacy import read_grace
from geokalman.attitude.level1 import Level1Warning, read
from geokalman.attitude.model import EPOCH_2019, SATELLITES, Scenario

DATE = "2019-01-01"
FIXTURES = Path(__file__).parent / "fixtures"


def attitude(folder, n=200):
    q = np.tile([0.5, 0.5, 0.5, 0.5], (n, 1))
    return write.write_attitude(folder, "C", np.arange(n), q, np.full(n, 7), np.zeros(n))


def circle(n=300, radius=6.87e6):
    t = np.arange(float(n))
    rate = np.sqrt(3.986004418e14 / radius**3)
    e, u = (
        np.stack([np.cos(rate * t), np.sin(rate * t), 0 * t], 1),
        np.stack([-np.sin(rate * t), np.cos(rate * t), 0 * t], 1),
    )
    return t, radius * e, radius * rate * u


def changed(path, old, new):
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    return path


# --- keywords that give the numbers their meaning ---


@pytest.mark.parametrize(
    ("unit", "factor"), [("kilometers", 1e3), ("km", 1e3), ("mm", 1e-3), ("metres", 1.0), ("Meter", 1.0), ("m", 1.0)]
)
def test_units_of_the_header_are_honoured(tmp_path, unit, factor):
    t, r, v = circle()
    path = write.write_orbit(tmp_path, "C", t, r / factor, v)
    text = path.read_text()
    for axis in "xyz":
        text = text.replace(f"long_name: {axis}pos\n    units: m\n", f"long_name: {axis}pos\n    units: {unit}\n")
    path.write_text(text)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", Level1Warning)
        _, found, _ = day.orbit(tmp_path, "C", DATE)
    np.testing.assert_allclose(found, r, rtol=1e-14)


@pytest.mark.parametrize("unit", ["m/s", "meters/second", "m s-1", "metres per second", "m/sec", "N/A", "unitless"])
def test_spellings_of_a_unit_are_one(tmp_path, unit):
    t, r, v = circle()
    path = changed(
        write.write_orbit(tmp_path, "C", t, r, v),
        "long_name: xvel\n    units: m/s\n",
        f"long_name: xvel\n    units: {unit}\n",
    )
    assert read(path).notes == ()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "long_name: gps_time\n    units: s",
            "long_name: gps_time\n    units: days",
            "gives gps_time in 'days'; s is needed",
        ),
        (
            "long_name: gps_time\n",
            "long_name: gps_time\n    scale_factor: 0.1\n",
            "gps_time the scale_factor 0.1; 1 is",
        ),
        ("long_name: qual_rss\n", "long_name: qual_rss\n    add_offset: 2\n", "qual_rss the add_offset 2; 0 is needed"),
        ("long_name: qual_rss\n", "long_name: qual_rss\n    scale_factor: many\n", "scale_factor of qual_rss: 'many'"),
        (
            "epoch_time: 2000-01-01T12:00:00.00",
            "epoch_time: 1980-01-06T00:00:00.00",
            "count from 1980-01-06T00:00:00.00",
        ),
        (
            "epoch_time: 2000-01-01T12:00:00.00",
            "epoch_time: 2000-01-01 11:58:55.816",
            "seconds past 2000-01-01 12:00:00",
        ),
    ],
)
def test_a_header_with_another_meaning_is_refused(tmp_path, old, new, message):
    with pytest.raises(Level1Error, match=message):
        read(changed(attitude(tmp_path), old, new))


def test_fill_values_mark_missing_records(tmp_path):
    path = changed(attitude(tmp_path), "long_name: qual_rss\n", "long_name: qual_rss\n    _FillValue: -999.0\n")
    lines = path.read_text().splitlines()
    lines[-1] = lines[-1].replace(" 0.0 0000", " -999.0 0000")
    path.write_text("\n".join([*lines, ""]))
    with pytest.warns(
        Level1Warning, match=rf"line {len(lines)}: column 8 \(qual_rss\) is -999.0, which marks a missing"
    ):
        assert len(read(path)) == 199


def test_the_older_headers_epoch_and_satellite(tmp_path):
    text = (FIXTURES / "SCA1B_2003-09-14_A_00.asc").read_text()
    path = tmp_path / "SCA1B_2003-09-14_A_00.asc"
    path.write_text("TIME EPOCH (GPS TIME)         : 1980-01-06 00:00:00\n" + text)
    with pytest.raises(Level1Error, match="count from 1980-01-06 00:00:00; seconds past 2000-01-01 12:00:00"):
        read_grace(path)
    path.write_text("SATELLITE NAME                : GRACE B\n" + text)
    with pytest.raises(Level1Error, match="the header's satellite is GRACE B, the file name says A"):
        read_grace(path)


# --- metadata that nothing needs ---


@pytest.mark.parametrize(
    "line",
    [
        "    date_issued: 0000-00-00T00:00:00",
        "    date_issued: 2019-02-30",
        "    comment: see Dahle et al. (2019): a paper",
        "    comment: 'it isn't closed",
        "    comment: @home",
        "    comment: [1, 2",
        "    comment: {a",
        "    comment: %percent",
        "    keywords: GRACE-FO > ORBIT, *star",
        "    size: 99999999999999999999999999999999",
        "    value: 1e999",
        "    creator: J\u00fcrgen",
        "    flag: yes",
        "    sexagesimal: 12:30:45",
    ],
)
def test_a_line_of_metadata_refuses_no_file(tmp_path, line):
    path = changed(attitude(tmp_path), "    platform: GRACE-C\n", f"{line}\n    platform: GRACE-C\n")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", Level1Warning)
        table = read(path)
    assert len(table) == 200 and len(table.notes) <= 1


def test_a_line_that_was_passed_over_is_said(tmp_path):
    path = changed(attitude(tmp_path), "    platform", "    comment: a: b\n    platform")
    assert path.read_text().splitlines()[7] == "    comment: a: b"
    with pytest.warns(Level1Warning, match="line 8 of the header is not YAML and was passed over: 'comment: a: b'"):
        read(path)


def test_a_broken_line_that_is_needed_is_refused(tmp_path):
    with pytest.raises(Level1Error, match=r"line 3: the header is not YAML"):
        read(changed(attitude(tmp_path), "num_records: 200", "num_records: 2: 00"))


def test_an_empty_header_takes_the_known_columns(tmp_path):
    path = attitude(tmp_path)
    text = path.read_text()
    path.write_text(text[text.index(END) :])
    with pytest.warns(Level1Warning, match="the header is empty; the columns were taken in the order of the product"):
        table = read(path)
    np.testing.assert_array_equal(table["gps_time"], EPOCH_2019 + np.arange(200))


def test_meanings_of_flags_that_yaml_takes_for_mappings():
    assert flag_meanings({"variables": [{"name": "q", "flag_meanings": [{"bit 2": "Sun"}]}]}, "q") == {2: "Sun"}


# --- one opener ---


@pytest.mark.parametrize("pack", [gzip.compress, lzma.compress, bz2.compress])
def test_packed_files_are_told_by_their_first_bytes(tmp_path, pack):
    path = attitude(tmp_path)
    whole = path.read_bytes()
    path.write_bytes(pack(whole))
    assert len(read(path)) == 200
    for suffix in (".gz", ".xz"):
        other = path.with_name(path.name + suffix)
        other.write_bytes(pack(whole))
        assert len(read(other)) == 200


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "no line '# End of YAML header'"),
        (b"\x00" * 4000, "line 1: it has a zero byte"),
        (b"x" * (1 << 21), "line 1: the line is longer than"),
        (b"PK\x03\x04", "zip archive; unpack it"),
        (b"<html><title>Earthdata Login</title>", "a web page"),
        (b"header:\n" * 6000, "no line '# End of YAML header' among the first 5000"),
        ((END + "\n").encode(), "no records after the header .line 2."),
        (b"header:\n  a: &a [*a]\n" + END.encode() + b"\n", "no mapping `header`"),
        (b"[" * 5000 + b"\n" + END.encode() + b"\n", "line 1|not YAML"),
    ],
)
def test_what_is_no_level_1_file_is_one_sentence(tmp_path, content, message):
    path = tmp_path / f"SCA1B_{DATE}_C_04.txt"
    path.write_bytes(content)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", Level1Warning)
        with pytest.raises(Level1Error, match=message) as caught:
            read(path)
    assert path.name in str(caught.value) and len(str(caught.value).splitlines()) == 1


def test_line_ends_and_marks_of_other_systems(tmp_path):
    path = attitude(tmp_path)
    text = path.read_text()
    path.write_bytes(b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode())
    assert len(read(path)) == 200 and read(path).notes == ()


def test_a_date_that_is_none(tmp_path):
    with pytest.raises(Level1Error, match="the date 2019-13-01 in the name is no date"):
        read(tmp_path / "SCA1B_2019-13-01_C_04.txt")


# --- unphysical input ---


@pytest.mark.parametrize("shift", [-630763200, 86400 * 400, 315964800])
def test_times_of_another_day_are_refused(tmp_path, shift):
    path = attitude(tmp_path)
    text = path.read_text()
    path.write_text(text.replace(f"\n{EPOCH_2019 // 1000}", f"\n{(EPOCH_2019 + shift) // 1000}"))
    with pytest.raises(
        Level1Error, match=r"column 1 \(gps_time\) is -?\d+, outside 599486400 to 599745600.*200 of 200"
    ):
        read(path)


def test_one_time_of_another_day_is_left_out(tmp_path):
    path = changed(attitude(tmp_path), f"\n{EPOCH_2019 + 7} ", "\n7 ")
    with pytest.warns(Level1Warning, match=r"1 bad record left out .line \d+: column 1 \(gps_time\) is 7, outside"):
        assert len(read(path)) == 199


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda r, v: r.__imul__(1e-3), "is 6.87 km from the Earth's centre, as are 300 of 300; positions in metres"),
        (lambda r, v: r.__imul__(0.9), "6183 km from the Earth's centre"),
        (lambda r, v: r[40].__iadd__(500.0), "gps_time 599572840 disagrees with its neighbours by .* m .2 such steps"),
        (lambda r, v: v.__imul__(1.01), "disagrees with its neighbours"),
        (lambda r, v: r[0].__imul__(0.0), "gps_time 599572800 is 0 km from"),
        (lambda r, v: v[100:110].__imul__(-1.0), "gps_time 5995729(00|01) disagrees"),
    ],
)
def test_what_is_no_orbit_is_refused(tmp_path, spoil, message):
    t, r, v = circle()
    spoil(r, v)
    write.write_orbit(tmp_path, "C", t, r, v)
    with pytest.raises(Level1Error, match=message):
        day.orbit(tmp_path, "C", DATE)


def test_an_eccentric_orbit_in_coarse_steps_is_one(tmp_path):
    """The limit of the check lies above the trapezoid's own error, at 60 s as well."""
    t, r, v = circle(6000, 6.5e6)
    write.write_orbit(tmp_path, "C", t[::60], r[::60], v[::60])
    found, _, _ = day.orbit(tmp_path, "C", DATE)
    np.testing.assert_array_equal(found, t[::60])


@pytest.fixture
def folder(tmp_path, short):
    for s in SATELLITES:
        write.write_raw(tmp_path, short.raw[s])
        write.write_orbit(tmp_path, s, short.t, short.r[s], short.v[s])
    return tmp_path


def test_holes_in_accelerations_are_not_bridged(folder, short):
    keep = (short.t < 40) | (short.t > 70)
    write.write_accelerations(folder, "C", short.t[keep], np.full((keep.sum(), 3), 1e-6))
    with pytest.warns(Level1Warning, match="ACT1B of C has a hole of 3. s; the accelerations are left out"):
        recording = flights.flight(Scenario(), 0, str(folder))
    assert recording.accelerations == {}


def test_a_damaged_file_of_accelerations_is_not_passed_over(folder, short):
    path = write.write_accelerations(folder, "C", short.t, np.full((len(short.t), 3), 1e-6))
    changed(path, "- name: lin_accl_x", "- name: x")
    with pytest.raises(Level1Error, match="variables lack lin_accl_x"):
        flights.flight(Scenario(), 0, str(folder))


def test_a_folder_of_gzipped_files(folder, short):
    for path in folder.glob("*.txt"):
        path.with_name(path.name + ".gz").write_bytes(gzip.compress(path.read_bytes()))
        path.unlink()
    recording = flights.flight(Scenario(), 0, str(folder))
    np.testing.assert_array_equal(
        recording.r["C"], short.r["C"][[k for k, t in enumerate(short.t) if t in recording.t]]
    )


# --- what is written otherwise, and means the same ---


def test_exponents_of_fortran(tmp_path):
    path = attitude(tmp_path)
    text = path.read_text()
    path.write_text(text.replace(" 0.5", " 5.0D-01", 40))
    np.testing.assert_array_equal(read(path)["quatangle"], 0.5)


@pytest.mark.parametrize("end", ["# END OF YAML HEADER", "#End of YAML header"])
def test_the_end_of_a_header_in_other_letters(tmp_path, end):
    assert len(read(changed(attitude(tmp_path), END, end))) == 200


def test_a_control_character_in_the_metadata(tmp_path):
    assert len(read(changed(attitude(tmp_path), "title: ", "title: \x07"))) == 200


@pytest.mark.parametrize("epoch", ["1980/01/06 00:00:00", "1980-01-06  00:00:00", "6 Jan 1980"])
def test_an_epoch_in_another_form_is_no_licence(tmp_path, epoch):
    path = changed(attitude(tmp_path), "2000-01-01T12:00:00.00", epoch)
    with pytest.raises(Level1Error, match="times count from .*1980"):
        read(path)


def test_the_older_layout_in_utc_is_refused(tmp_path):
    text = (FIXTURES / "SCA1B_2003-09-14_A_00.asc").read_text()
    path = tmp_path / "SCA1B_2003-09-14_A_00.asc"
    path.write_text(text.replace("TIME EPOCH (GPS TIME)", "TIME EPOCH (UTC)"))
    with pytest.raises(Level1Error, match="line 8: TIME EPOCH .UTC.: times in GPS are needed"):
        read_grace(path)
    path.write_text(text.replace("END OF HEADER", "End of header"))
    assert len(read_grace(path)) == 6
