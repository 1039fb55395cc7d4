"""Readers: the thirteen kinds of bad input, the older layout, the way through files, and fuzzing: no crash, no silent
wrong number.
"""

from __future__ import annotations

import os
import re
import shutil
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from geokalman.attitude import cameras, timetags, write
from geokalman.attitude import experiment as flights
from geokalman.attitude import read as day
from geokalman.attitude.gyro import GyroWarning
from geokalman.attitude.legacy import read_grace
from geokalman.attitude.header import END, Level1Error, flag_meanings
from geokalman.attitude.level1 import Level1Warning, Table, read
from geokalman.attitude.model import EPOCH_2019, Scenario, Tuning
from geokalman.attitude.products import GRACE_FO, KEYS
from geokalman.physics.quaternion import continuous, difference

DATE = "2019-01-01"
FIXTURES = Path(__file__).parent / "fixtures"
SAMPLES = os.environ.get("GEOKALMAN_SAMPLES", "")
SAMPLE = Path(SAMPLES) / "grace_l1b_2003-09-14" if SAMPLES else Path("none")
if SAMPLES and not SAMPLE.is_dir():
    SAMPLE = Path(SAMPLES)
needs_sample = pytest.mark.skipif(
    not (SAMPLE / "KBR1B_2003-09-14_X_00.asc").is_file(),
    reason="GEOKALMAN_SAMPLES does not name the folder of the GRACE sample of 2003-09-14",
)


def columns_of(product, n=200, seed=0):
    """Sound columns of any product, times increasing by a second."""
    rng = np.random.default_rng(seed)
    out = {}
    for column in GRACE_FO[product]:
        if column.name in (KEYS.get(product) or ("",))[:1]:
            out[column.name] = EPOCH_2019 + np.arange(n)
        elif column.name == "GRACEFO_id":
            out[column.name] = np.full(n, "C")
        elif column.name == "coord_ref":
            out[column.name] = np.full(n, "I")
        elif column.name in ("gyro_id", "sca_id"):
            out[column.name] = 1 + np.arange(n) % 3
        elif column.kind == "float" and np.isfinite(column.high):
            out[column.name] = rng.uniform(column.low, column.high, n)
        elif column.kind == "int":
            out[column.name] = rng.integers(0, 1000, n)
        elif column.kind == "float":
            out[column.name] = rng.standard_normal(n) * 10.0 ** rng.integers(-12, 6, n)
        elif column.kind == "flags":
            out[column.name] = np.full(n, "00000000")
        else:
            out[column.name] = np.full(n, "S")
    if "quatangle" in out:
        q = rng.standard_normal((n, 4))
        q /= np.linalg.norm(q, axis=1, keepdims=True)
        for name, values in zip(("quatangle", "quaticoeff", "quatjcoeff", "quatkcoeff"), q.T, strict=True):
            out[name] = values
    return out


def written(folder, product="SCA1B", n=200, satellite="C"):
    return write.write(folder, product, satellite, DATE, columns_of(product, n))


def edit(path, change):
    """Apply change(lines) to the lines after the header and write them back."""
    text = path.read_text().splitlines(keepends=True)
    k = next(i for i, line in enumerate(text) if line.strip() == END) + 1
    body = change(text[k:])
    path.write_text("".join(text[:k] + (text[k:] if body is None else body)))
    return k


@pytest.mark.parametrize("product", sorted(GRACE_FO))
def test_reading_gives_back_what_was_written(tmp_path, product):
    columns = columns_of(product)
    table = read(write.write(tmp_path, product, "Y" if product == "KBR1B" else "C", DATE, columns), product)
    for name, values in columns.items():
        np.testing.assert_array_equal(table[name], values)
    assert table.notes == () and len(table) == 200 and table.product == product


# --- 1: header ---


def test_headers_that_are_none_are_refused(tmp_path):
    path = written(tmp_path)
    whole = path.read_text()
    path.write_text(whole.replace(END, "#"))
    with pytest.raises(Level1Error, match=r"SCA1B_2019.*no line '# End of YAML header'"):
        read(path)
    path.write_text(whole.replace("header:", "header: [", 1))
    with pytest.raises(Level1Error, match=r"SCA1B_.*line \d+: the header is not YAML"):
        read(path)
    path.write_text("- 1\n" + END + "\n")
    with pytest.raises(Level1Error, match="line 1: the YAML header has no mapping"):
        read(path)
    path.write_text("")
    with pytest.raises(Level1Error, match="no line"):
        read(path)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("id: SCA1B_simulated", "id: IMU1B_simulated", "the header's title|the header's id"),
        ("platform: GRACE-C", "platform: GRACE-D", "platform is GRACE-D, the file name says C"),
        ("time_coverage_start: 2019-01-01", "time_coverage_start: 2019-01-03", "the header covers 2019-01-03"),
        ("num_records: 200", "num_records: many", "num_records is 'many'"),
        ("- name: quatangle", "- name: angle", "variables lack quatangle"),
        ("- name: qual_rss", "- name: quatangle", "lack qual_rss|twice"),
    ],
)
def test_headers_of_another_file_are_refused(tmp_path, old, new, message):
    path = written(tmp_path)
    text = path.read_text()
    if "IMU1B" in new:
        text = text.replace("title: GRACE-FO Level-1 SCA1B", "title: GRACE-FO")
        message = "the header's id says IMU1B|id says"
        new = "id: IMU1B simulated"
    assert old in text
    path.write_text(text.replace(old, new))
    with pytest.raises(Level1Error, match=message):
        read(path)


def test_names_and_expectations(tmp_path):
    path = written(tmp_path)
    for expected, message in (
        ({"product": "ACT1B"}, "product SCA1B in the file name, ACT1B"),
        ({"satellite": "D"}, "satellite C"),
        ({"date": "2019-01-02"}, "date 2019-01-01"),
    ):
        with pytest.raises(Level1Error, match=message):
            read(path, **expected)
    with pytest.raises(Level1Error, match="the name is not"):
        read(path.rename(tmp_path / "attitude.txt"))
    with pytest.raises(Level1Error, match="product XYZ1B is unknown"):
        read(tmp_path / f"XYZ1B_{DATE}_C_04.txt")
    with pytest.raises(FileNotFoundError):
        read(tmp_path / f"SCA1B_{DATE}_C_04.txt")


def test_records_of_another_satellite_are_refused(tmp_path):
    path = written(tmp_path)
    k = edit(path, lambda body: [line.replace(" C ", " D ", 1) for line in body])
    with pytest.raises(Level1Error, match=f"line {k + 1}: a record says satellite D, the file name C"):
        read(path)


def test_columns_follow_the_header(tmp_path):
    """Section 4: where the header lists its variables, another order and unknown columns are read by it."""
    path = written(tmp_path)
    lines = path.read_text().splitlines()
    k = lines.index(END)
    first = lines.index("  - name: gps_time")
    blocks = "\n".join(lines[first:k]).split("  - name: ")[1:]
    blocks = [*blocks[1:], blocks[0].rstrip("\n") + "\n", 'novelty\n    comment: "10th column"\n']
    header = [*lines[:first], *"".join("  - name: " + b.rstrip("\n") + "\n" for b in blocks).splitlines(), END]
    body = [" ".join([*line.split()[1:], line.split()[0], "hello"]) for line in lines[k + 1 :]]
    path.write_text("\n".join([*header, *body, ""]))
    table = read(path)
    np.testing.assert_array_equal(table["gps_time"], columns_of("SCA1B")["gps_time"])
    np.testing.assert_array_equal(table["quatkcoeff"], columns_of("SCA1B")["quatkcoeff"])
    assert "novelty" not in table.columns


# --- 2: counts, cut lines ---


def test_a_cut_last_line_and_a_wrong_count_are_mended_and_said(tmp_path):
    path = written(tmp_path)
    edit(path, lambda body: [*body[:-1], body[-1][:20]])
    with pytest.warns(Level1Warning) as seen:
        table = read(path)
    text = " ".join(str(w.message) for w in seen)
    assert (
        len(table) == 199
        and "is cut short" in text
        and "199 records, the header promises 200" in text
        and path.name in text
    )


def test_half_of_the_records_is_too_few(tmp_path):
    path = written(tmp_path)
    edit(path, lambda body: body[:90])
    with pytest.raises(Level1Error, match="90 records of the 200"):
        read(path)
    edit(path, lambda body: [])
    with pytest.raises(Level1Error, match="0 records of the 200|no records"):
        read(path)


# --- 3, 4, 6: bad records ---


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda f: f[:-1], "8 columns, 9 are expected"),
        (lambda f: [*f, "1"], "10 columns, 9 are expected"),
        (lambda f: [*f[:4], "0.1x", *f[5:]], "column 5 .quaticoeff. is '0.1x', not a number"),
        (lambda f: [*f[:4], "1_0", *f[5:]], "column 5 .quaticoeff. is '1_0', not a number"),
        (lambda f: [*f[:4], "nan", *f[5:]], "column 5 .quaticoeff. is nan"),
        (lambda f: [*f[:7], "inf", *f[8:]], "column 8 .qual_rss. is inf"),
        (lambda f: [f[0] + ".5", *f[1:]], "column 1 .gps_time. is .* not an integer"),
        (lambda f: ["9" * 25, *f[1:]], "no 64-bit integer"),
        (lambda f: [*f[:3], "0", "0", "0", "0", *f[7:]], "the quaternion has the norm 0"),
        (lambda f: [*f[:3], "1.01", "0", "0", "0", *f[7:]], "the quaternion has the norm 1.01"),
        (lambda f: [*f[:8], "0000x000"], "not a string of 0 and 1"),
        (lambda f: [*f[:2], "7" * 60, *f[3:]], "60 characters long"),
    ],
)
def test_a_bad_record_is_left_out_with_its_line(tmp_path, change, reason):
    path = written(tmp_path)
    k = edit(path, lambda body: [*body[:50], " ".join(change(body[50].split())) + "\n", *body[51:]])
    with pytest.warns(Level1Warning, match=f"1 bad record left out .line {k + 51}: .*{reason}"):
        table = read(path)
    assert len(table) == 199 and EPOCH_2019 + 50 not in table["gps_time"]


def test_more_than_a_percent_of_bad_records_is_refused(tmp_path):
    path = written(tmp_path)
    k = edit(path, lambda body: ["x\n"] * 3 + body[3:])
    with pytest.raises(Level1Error, match=rf"line {k + 1}: 1 columns.*3 of 200 records are bad"):
        read(path)


def test_microseconds_out_of_range_are_bad(tmp_path):
    path = written(tmp_path, "IMU1A")
    edit(path, lambda body: [" ".join([body[0].split()[0], "1000000", *body[0].split()[2:]]) + "\n", *body[1:]])
    with pytest.warns(Level1Warning, match=r"column 2 \(time_frac\) is 1000000, outside 0 to 999999"):
        assert len(read(path)) == 199


def test_gyro_angles_beyond_their_range_are_bad(tmp_path):
    path = written(tmp_path, "IMU1A")
    k = edit(
        path, lambda body: [*body[:3], " ".join([*body[3].split()[:5], "9999.0", body[3].split()[6]]) + "\n", *body[4:]]
    )
    with pytest.warns(Level1Warning, match=rf"line {k + 4}: column 6 \(FiltAng\) is 9999.0, outside -5759 to 5759"):
        assert len(read(path)) == 199


def test_duplicates_and_backward_time_are_mended_and_said(tmp_path):
    path = written(tmp_path)
    edit(path, lambda body: [*body[:10], body[4], *body[20:30], *body[10:20], *body[30:]])
    with pytest.warns(Level1Warning) as seen:
        table = read(path)
    text = " ".join(str(w.message) for w in seen)
    assert "sorted" in text and "1 duplicate time tag" in text
    np.testing.assert_array_equal(table["gps_time"], EPOCH_2019 + np.arange(200))
    np.testing.assert_array_equal(table["quatangle"], columns_of("SCA1B")["quatangle"])


def test_norms_a_little_off_are_mended_and_counted(tmp_path):
    columns = columns_of("SCA1B")
    columns["quatangle"][7] *= 1 + 1e-4
    path = write.write(tmp_path, "SCA1B", "C", DATE, columns)
    with pytest.warns(Level1Warning, match="1 quaternion with a norm off by up to"):
        table = read(path)
    q = table.stacked("quatangle", "quaticoeff", "quatjcoeff", "quatkcoeff")
    np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1.0, atol=1e-9)


# --- 7, 10: flips, flags, interleaved cameras ---


def test_interleaved_cameras_in_any_order_with_flips_and_bad_confidence(tmp_path, short):
    raw = short.raw["C"]
    write.write_raw(tmp_path, raw)
    path = next(tmp_path.glob("SCA1A*"))

    def spoil(body):
        rows = [line.split() for line in body]
        rows[30][11] = "7"  # sca_confid
        return [" ".join(row) + "\n" for row in rows]

    k = edit(path, spoil)
    lost = path.read_text().splitlines()[k + 30].split()
    back, edge = day.raw(tmp_path, "C", DATE)
    assert not edge.any()
    n = len(back.t_camera)
    assert n == len(raw.t_camera) and np.abs(back.t_camera - raw.t_camera).max() < 1e-6
    gone = np.isnan(back.q_camera[..., 0]) & np.isfinite(raw.q_camera[..., 0])
    assert gone.sum() == 1 and gone[int(lost[3]) - 1].any()
    same = np.isfinite(back.q_camera[..., 0])
    np.testing.assert_array_equal(back.q_camera[same], raw.q_camera[same])
    smooth = continuous(back.q_camera[1])
    good = smooth[np.isfinite(smooth[:, 0])]
    assert (np.einsum("ki,ki->k", good[1:], good[:-1]) > 0).all()


@pytest.mark.parametrize(
    ("meaning", "flags", "left"),
    [
        ("bit 3 = Sun in the field of view", "00001000", 0),
        ("bit 3 = Moon in the field of view", "00001000", 0),
        ("bit 0 = Valid flag (0=valid,1=invalid)", "00000001", 0),
        ("bit 0 = Valid flag (1=valid,0=invalid)", "00000001", 1),
        ("bit 6 = Orbit correction (used/not used)", "01000000", 1),
    ],
)
@pytest.mark.parametrize("name", ["qualflg", "sca_mode"])
def test_cameras_are_refused_by_flags_as_the_header_explains_them(tmp_path, short, name, meaning, flags, left):
    """Bad input 10: Sun, Moon and validity, in the words of the file's own header."""
    write.write_raw(tmp_path, short.raw["C"])
    path = next(tmp_path.glob("SCA1A*"))
    text = path.read_text()
    path.write_text(
        text.replace(f"    long_name: {name}\n", f"    long_name: {name}\n    flag_meanings:\n      - {meaning}\n")
    )
    column = {"sca_mode": 14, "qualflg": 15}[name]
    others = "00000001" if "1=valid" in meaning else "00000000"

    def spoil(body):
        rows = [line.split() for line in body]
        for k, row in enumerate(rows):
            row[column] = flags if k < 40 else others
        return [" ".join(row) + "\n" for row in rows]

    edit(path, spoil)
    whole = np.isfinite(short.raw["C"].q_camera[..., 0]).sum()
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        back, _ = day.raw(tmp_path, "C", DATE)
    assert np.isfinite(back.q_camera[..., 0]).sum() == whole - (0 if left else 40)
    said = " ".join(str(w.message) for w in seen)
    assert (f"{path}: 40 of {whole} records left out by their flags" in said) == (not left)


def test_flags_that_nothing_explains_are_warned_of(tmp_path, short):
    write.write_raw(tmp_path, short.raw["C"])
    path = next(tmp_path.glob("SCA1A*"))
    edit(path, lambda body: [" ".join([*body[0].split()[:15], "00000100"]) + "\n", *body[1:]])
    with pytest.warns(
        Level1Warning,
        match=r"SCA1A_.*: qualflg of 1 of \d+ records has bits set that the header does not explain, as 00000100",
    ):
        day.raw(tmp_path, "C", DATE)
    edit(path, lambda body: [" ".join([*line.split()[:14], "7", line.split()[15]]) + "\n" for line in body])
    with pytest.warns(Level1Warning, match="sca_mode is '7', not a string of 0 and 1"):
        day.raw(tmp_path, "C", DATE)
    text = path.read_text()
    path.write_text(
        text.replace(
            "    long_name: qualflg\n", "    long_name: qualflg\n    flag_meanings: bit 2 = invalid, bit 3 = Sun\n"
        )
    )
    edit(path, lambda body: [" ".join([*line.split()[:15], "00000100"]) + "\n" for line in body])
    with pytest.warns(Level1Warning), pytest.raises(Level1Error, match="the flags sca_mode and qualflg refuse all"):
        day.raw(tmp_path, "C", DATE)


def test_meanings_of_flags_in_both_forms_of_the_header():
    listed = {
        "variables": [{"qualflg": {"flag_meanings": ["bit 0 = Phase break", "bit 2: Sun"]}}, {"name": "mode"}, "x", 3]
    }
    assert flag_meanings(listed, "qualflg") == {0: "Phase break", 2: "Sun"}
    plain = {"variables": [{"name": "qualflg", "flag_meanings": "bit 0 = Phase break, bit 1 = Moon"}]}
    assert flag_meanings(plain, "qualflg") == {0: "Phase break", 1: "Moon"}
    assert flag_meanings(plain, "mode") == flag_meanings({}, "mode") == {}


def test_no_usable_camera_is_said(tmp_path, short):
    write.write_raw(tmp_path, short.raw["C"])
    edit(
        next(tmp_path.glob("SCA1A*")),
        lambda body: [" ".join([*line.split()[:11], "7", *line.split()[12:]]) + "\n" for line in body],
    )
    with pytest.raises(Level1Error, match="no record with sca_confid <= 5"):
        day.raw(tmp_path, "C", DATE)


# --- 11, 13: clocks ---


def table(product, **columns):
    n = len(next(iter(columns.values())))
    return Table(Path(f"{product}_{DATE}_C_04.txt"), product, "C", DATE, {"qualflg": np.full(n, "00000000")} | columns)


def test_undefined_and_flagged_pairs_do_not_enter_the_clock():
    t = EPOCH_2019 + np.arange(10)
    whole = t.copy()
    whole[3] = 0
    flags = np.full(10, "00000000")
    flags[5] = "00001000"
    flags[6] = "00000100"
    nano = np.full(10, 500_000_000)
    nano[[5, 6]] = 900_000_000
    tim = table("TIM1B", obdh_time=t, gpstime_intg=whole, gpstime_frac=nano, qualflg=flags)
    clk = table("CLK1B", rcv_time=EPOCH_2019 + np.array([0, 20]), eps_time=np.array([0.25, 0.25]))
    clock = timetags.clock([tim], [clk], EPOCH_2019)
    np.testing.assert_array_equal(clock.obc, [0, 1, 2, 4, 6, 7, 8, 9])  # bits below 3 are no reason to refuse
    gps, edge = clock.gps(np.array([3.0, 5.0, 9.5, -1.0]))
    np.testing.assert_allclose(gps, [3.75, 5.95, 10.25, -0.25])
    assert edge.tolist() == [False, False, True, True]
    with pytest.raises(Level1Error, match="no usable pair"):
        timetags.clock([table("TIM1B", obdh_time=t, gpstime_intg=0 * t, gpstime_frac=nano)], [clk], EPOCH_2019)


def test_clock_segments_are_not_bridged():
    t = EPOCH_2019 + np.arange(0, 100)
    tim = table("TIM1B", obdh_time=t, gpstime_intg=t, gpstime_frac=0 * t)
    clk = table(
        "CLK1B",
        rcv_time=EPOCH_2019 + np.array([0, 30, 60, 99]),
        eps_time=np.array([0.0, 0.0, 1.0, 1.0]),
        qualflg=np.array(["00000000", "00000001", "00000010", "00000000"]),
    )
    _, edge = timetags.clock([tim], [clk], EPOCH_2019).gps(np.array([15.0, 45.0, 80.0]))
    assert edge.tolist() == [False, True, False]


def test_neighbouring_days_mend_the_edges(tmp_path, short):
    """Bad input 11: without TIM1B of the day before the first epochs are marked, with it they are not."""
    raw = short.raw["C"]
    write.write_raw(tmp_path, raw)
    path = next(tmp_path.glob("TIM1B*"))
    rows = {}

    def late(body):
        rows["all"] = body
        return [line for line in body if int(line.split()[0]) >= EPOCH_2019 + 20]

    edit(path, late)
    with pytest.warns(Level1Warning, match="header promises"):
        _, edge = day.raw(tmp_path, "C", DATE)
    assert edge[:30].all() and not edge[60:].any()
    write.write_raw(tmp_path, short.raw["D"])
    for s in ("C", "D"):
        write.write_orbit(tmp_path, s, short.t, short.r[s], short.v[s])
    with pytest.warns(Level1Warning, match=r"2\d seconds of GRACE-C from \d+ s on stand at an edge of its clock"):
        trip = flights.flight(Scenario(), 0, str(tmp_path))
    assert len(trip.edge["C"]) > 15 and not len(trip.edge["D"])
    marked = flights.solve(trip, "C", Tuning(), ("mekf",)).edge
    assert marked[:15].all() and not marked[30:].any()
    before = tmp_path / path.name.replace(DATE, "2018-12-31")
    before.write_text(path.read_text().replace(DATE, "2018-12-31"))
    edit(before, lambda body: [line for line in rows["all"] if int(line.split()[0]) < EPOCH_2019 + 20])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", Level1Warning)
        edit(before, lambda body: body)
        text = before.read_text()
        before.write_text(text.replace("num_records: ", "num_records: 2  # was "))
        _, edge = day.raw(tmp_path, "C", DATE)
    assert not edge.any()


def test_time_keeps_its_digits():
    """Bad input 13: float32 would turn 599572800.125 s into a multiple of 64 s; whole seconds stay integers until the
    origin is off.
    """
    t = timetags.seconds(np.array([599572800]), np.array([125_001]), 10**6, 599572800 - 86400)
    assert t.dtype == np.float64
    assert t[0] == pytest.approx(86400.125001, abs=1e-10)
    assert float(np.float32(599572800.125)) != 599572800.125


# --- 12: Earth-fixed states ---


def test_earth_fixed_states_are_refused(tmp_path):
    columns = columns_of("GNI1B")
    columns["coord_ref"][:] = "E"
    write.write(tmp_path, "GNI1B", "C", DATE, columns)
    with pytest.raises(Level1Error, match="coord_ref is E at 599572800 s, inertial states"):
        day.orbit(tmp_path, "C", DATE)


# --- whole days ---


@pytest.fixture(scope="module")
def folder(short, tmp_path_factory):
    path = tmp_path_factory.mktemp("day")
    for s in ("C", "D"):
        write.write_raw(path, short.raw[s])
        write.write_orbit(path, s, short.t, short.r[s], short.v[s])
        write.write_accelerations(path, s, short.t, np.full((len(short.t), 3), 1e-8))
        write.write_attitude(
            path, s, short.t, short.true_attitude(s), np.full(len(short.t), 7), np.full(len(short.t), 1e-5)
        )
    return path


def test_the_whole_way_through_files(short, folder, tuning):
    back = flights.flight(Scenario(), 0, str(folder))
    np.testing.assert_allclose(back.t, short.t, atol=1e-9)
    for s in ("C", "D"):
        np.testing.assert_array_equal(back.r[s], short.r[s])
        np.testing.assert_array_equal(back.raw[s].gyro, short.raw[s].gyro)
        assert np.abs(back.raw[s].t_gyro - short.raw[s].t_gyro).max() < 6e-7  # tags are printed to a microsecond
        same = np.isfinite(short.raw[s].q_camera)
        np.testing.assert_array_equal(back.raw[s].q_camera[same], short.raw[s].q_camera[same])
        np.testing.assert_allclose(back.raw[s].q_qsa, short.raw[s].q_qsa, atol=2e-15)
        one, two = flights.solve(short, s, tuning, ("mekf",)), flights.solve(back, s, tuning, ("mekf",))
        assert np.nanmax(np.abs(difference(one.solutions["mekf"].q, two.solutions["mekf"].q))) < 2e-9
        np.testing.assert_allclose(back.accelerations[s], 1e-8)
        sca = read(next(folder.glob(f"SCA1B*_{s}_04.txt")))
        np.testing.assert_array_equal(sca["sca_id"], 23)
    assert back.true_attitude("C") is None
    assert flights.reference(back, "C", flights.solve(back, "C", tuning)).shape == (len(back.t), 4)


def test_what_a_folder_lacks_is_said(folder, tmp_path, short):
    with pytest.raises(Level1Error, match="no SCA1A_YYYY"):
        flights.flight(Scenario(), 0, str(tmp_path))
    write.write_raw(tmp_path, short.raw["C"])
    with pytest.raises(Level1Error, match="no file SCA1A_2019-01-01_D.*the files of both satellites are needed"):
        flights.flight(Scenario(), 0, str(tmp_path))
    (tmp_path / "SCA1A_2019-01-01_D_04.txt.zip").write_bytes(b"")
    with pytest.raises(Level1Error, match="unpack SCA1A_2019-01-01_D_04.txt.zip"):
        flights.flight(Scenario(), 0, str(tmp_path))
    next(tmp_path.glob("QSA1B*")).unlink()
    with pytest.warns(Level1Warning, match="The mounting of GRACE-C that the book holds is used"):
        day.qsa(tmp_path, "C", DATE)


def test_a_gyro_axis_without_rows_is_left_out(folder, tmp_path, short, tuning):
    """Bad input 9 through files, with the default four axes."""
    copied = shutil.copytree(folder, tmp_path / "day")
    edit(next(copied.glob("IMU1A*_C_04.txt")), lambda body: [line for line in body if line.split()[4] != "4"])
    with pytest.warns(Level1Warning, match="header promises"):
        trip = flights.flight(Scenario(), 0, str(copied))
    assert np.isnan(trip.raw["C"].gyro[3]).all() and np.isfinite(trip.raw["C"].gyro[:3]).all()
    with pytest.warns(GyroWarning, match="GRACE-C: gyro axis 4 gave no samples"):
        result = flights.solve(trip, "C", tuning, ("mekf",))
    expected = flights.solve(short, "C", replace(tuning, axes=(1, 2, 3)), ("mekf",))
    assert np.nanmax(np.abs(difference(result.solutions["mekf"].q, expected.solutions["mekf"].q))) < 2e-9
    edit(next(copied.glob("IMU1A*_D_04.txt")), lambda body: [line for line in body if line.split()[4] in "12"])
    with (
        pytest.warns(Level1Warning),
        pytest.raises(Level1Error, match=r"IMU1A_.*_D_04.txt: records of gyro axes \[1, 2\] only"),
    ):
        flights.flight(Scenario(), 0, str(copied))


def test_axes_of_unequal_counts_are_written_and_read(tmp_path, short):
    """A lost sample of one axis: arrays = read(write(arrays)) all the same."""
    raw = short.raw["C"]
    t, angle = raw.t_gyro.copy(), raw.gyro.copy()
    t[1, 7:-1], angle[1, 7:-1] = t[1, 8:], angle[1, 8:]
    t[1, -1] = angle[1, -1] = np.nan
    write.write_raw(tmp_path, replace(raw, t_gyro=t, gyro=angle))
    back, _ = day.raw(tmp_path, "C", DATE)
    np.testing.assert_array_equal(back.gyro, angle)
    np.testing.assert_array_equal(np.isnan(back.t_gyro), np.isnan(t))
    assert np.nanmax(np.abs(back.t_gyro - t)) < 6e-7


@pytest.mark.parametrize("offset", [0.0, 0.13])
def test_files_are_filtered_at_2_hz(tmp_path, short, tuning, offset):
    """The cameras' tags may stand off the half seconds; then splines give the attitude there."""
    raw = short.raw["C"]
    moved = replace(raw, t_camera=raw.t_camera + offset, q_camera=raw.q_camera)
    whole = cameras.at_seconds(cameras.combination(raw, tuning), 2)
    combined = cameras.at_seconds(cameras.combination(moved, tuning), 2)
    assert (np.diff(combined.t) == 0.5).all() and np.abs(combined.t * 2 - np.round(combined.t * 2)).max() == 0
    np.testing.assert_array_equal(whole.q, cameras.combination(raw, tuning).q)
    inside = np.isfinite(combined.q[:, 0])
    assert inside.mean() > 0.9 and (np.isfinite(combined.cov[inside]).all())
    for s in ("C", "D"):
        write.write_raw(tmp_path, short.raw[s] if s == "D" else moved)
        write.write_orbit(tmp_path, s, short.t, short.r[s], short.v[s])
    back = flights.flight(Scenario(), 0, str(tmp_path))
    fast = flights.solve(back, "C", replace(tuning, update_hz=2), ("mekf", "rts"))
    truth = flights.flight(Scenario(duration_s=120.0), 1).true_attitude("C", 2)
    if offset == 0.0:
        error = difference(fast.solutions["rts"].q, truth[np.isin(np.arange(len(truth)) / 2, np.round(fast.t * 2) / 2)])
        assert np.sqrt(np.nanmean(error**2)) < 1e-5
    assert fast.measured.dt == 0.5 and np.isfinite(fast.solutions["mekf"].q[2:]).all()


# --- the older layout ---


def test_the_synthetic_fixture_of_the_older_layout():
    sca = read_grace(FIXTURES / "SCA1B_2003-09-14_A_00.asc")
    np.testing.assert_array_equal(sca["gps_time"], 116769600 + 5 * np.arange(6))
    np.testing.assert_allclose(sca["quatangle"], np.cos(0.01 * np.arange(6)), atol=2e-15)
    assert sca.header["SATELLITE NAME"] == "GRACE A"
    kbr = read_grace(FIXTURES / "KBR1B_2003-09-14_X_00.asc", "KBR1B")
    np.testing.assert_array_equal(kbr["biased_range"], 1000.0 - 0.5 * np.arange(4))


def test_bad_files_of_the_older_layout(tmp_path):
    whole = (FIXTURES / "SCA1B_2003-09-14_A_00.asc").read_text()
    path = tmp_path / "SCA1B_2003-09-14_A_00.asc"
    for old, new, message in (
        ("END OF HEADER", "THE END", r"line 12: 'THE END' is no header line|line 12"),
        ("PROCESS LEVEL (1A OR 1B)      : 1B", "nonsense", "line 11: 'nonsense' is no header line"),
        ("SCA1B_2003-09-14_A_00.asc    ", "SCA1B_2003-09-15_A_00.asc    ", "the header belongs to SCA1B_2003-09-15"),
        ("RECORDS        : 6", "RECORDS        : six", "NUMBER OF DATA RECORDS is 'six"),
        ("RECORDS        : 6", "RECORDS        : 60", "6 records of the 60"),
        (" A 4 1.0", " B 4 1.0", "a record says satellite B"),
    ):
        assert old in whole
        path.write_text(whole.replace(old, new))
        with pytest.raises(Level1Error, match=message):
            read_grace(path)
    path.write_text(whole[:200])
    with pytest.raises(Level1Error, match="no line 'END OF HEADER'|no header line"):
        read_grace(path)
    with pytest.raises(Level1Error, match="KBR1B was expected"):
        read_grace(path, "KBR1B")
    with pytest.raises(Level1Error, match="product IMU1A is unknown"):
        read_grace(tmp_path / "IMU1A_2003-09-14_A_00.asc")


@needs_sample
def test_the_real_sample_parses():
    files = sorted(SAMPLE.glob("*.asc"))
    assert len(files) == 19
    for path in files:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Level1Warning)
            table = read_grace(path)
        assert len(table) >= 2
    with pytest.warns(Level1Warning, match="1 duplicate time tag"):
        assert len(read_grace(SAMPLE / "CLK1B_2003-09-14_A_00.asc")) == 59


@needs_sample
def test_range_of_gnv1b_minus_corrected_kbr_is_constant():
    kbr = read_grace(SAMPLE / "KBR1B_2003-09-14_X_00.asc")
    a, b = (read_grace(SAMPLE / f"GNV1B_2003-09-14_{s}_00.asc") for s in "AB")
    common = np.intersect1d(np.intersect1d(a["gps_time"], b["gps_time"]), kbr["gps_time"])
    assert len(common) == 5
    pick = [t.where(np.isin(t["gps_time"], common)) for t in (a, b, kbr)]
    apart = pick[0].stacked("xpos", "ypos", "zpos") - pick[1].stacked("xpos", "ypos", "zpos")
    corrected = pick[2].stacked("biased_range", "lighttime_corr", "ant_centr_corr").sum(axis=1)
    assert np.ptp(np.linalg.norm(apart, axis=1) - corrected) < 3e-3


# --- fuzzing ---

_TEXT = st.text(
    alphabet=st.characters(codec="utf-8", exclude_characters="\r\x0b\x0c\x1c\x1d\x1e\x85\u2028\u2029"), max_size=40
)
_FIELD = st.one_of(
    st.sampled_from(
        [
            "nan",
            "inf",
            "-inf",
            "1e999",
            "-0",
            "1_0",
            "٣",
            "0x1p3",
            "1d0",
            "",
            "1.0.0",
            "9" * 30,
            "00000000",
            "1",
            "C",
            "+5",
            "1e-320",
        ]
    ),
    st.floats(allow_nan=False).map(repr),
    st.integers(-(10**20), 10**20).map(str),
    _TEXT,
)
OF_THE_WHOLE = re.compile(
    (
        r"no line '|the header|variables lack|num_records is|NUMBER OF DATA RECORDS is|records of the \d+ that|no "
        r"records after|cut short or damaged|unpack it|a web page|not a Level-1 "
        r"file|compressed twice|no UTF-16|times count from"
    )
)
"""Reasons that concern a file as a whole, not one of its lines."""
_SLOW = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def sane(table):
    """Whatever came through is finite, in range and of unit norm."""
    for column in GRACE_FO.get(table.product, ()):
        if column.kind in ("int", "float"):
            assert np.isfinite(table[column.name].astype(float)).all()
    if "quatangle" in table.columns:
        q = table.stacked("quatangle", "quaticoeff", "quatjcoeff", "quatkcoeff")
        np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1.0, atol=2e-9)
    key = KEYS.get(table.product)
    if key:
        assert (np.diff(table[key[0]]) >= 0).all()


@pytest.mark.parametrize("product", sorted(GRACE_FO))
@_SLOW
@given(data=st.data())
def test_fuzzed_fields_never_crash_nor_lie(tmp_path, product, data):
    """One field of one record replaced by anything: the record is left out with its line, or the number that is there
    is read.
    """
    path = written(tmp_path, product, 120, "Y" if product == "KBR1B" else "C")
    row, position, text = (
        data.draw(st.integers(0, 119)),
        data.draw(st.integers(0, len(GRACE_FO[product]) - 1)),
        data.draw(_FIELD),
    )
    k = edit(
        path,
        lambda body: [
            *body[:row],
            " ".join([*body[row].split()[:position], text, *body[row].split()[position + 1 :]]) + "\n",
            *body[row + 1 :],
        ],
    )
    first = k + row + 1  # a line break within the text makes two lines of one
    where = rf"line ({'|'.join(str(first + n) for n in range(text.count(chr(10)) + 1))})\b"
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always", Level1Warning)
        try:
            table = read(path)
        except Level1Error as error:
            assert path.name in str(error) and re.search(where, str(error))
            return
    said = " ".join(str(w.message) for w in seen)
    sane(table)
    assert 118 <= len(table) <= 121
    if len(table) < 120:
        assert path.name in said and (re.search(where, said) or "duplicate time tag" in said)
    column = GRACE_FO[product][position]
    if len(table) == 120 and column.kind in ("int", "float") and len(text.split()) == 1 and "quat" not in column.name:
        number = int(text) if column.kind == "int" else float(text.upper().replace("D", "E"))  # 1D0 as Fortran has it
        assert number in table[column.name]


@pytest.mark.parametrize("product", sorted(GRACE_FO))
@_SLOW
@given(data=st.data())
def test_fuzzed_bytes_never_crash(tmp_path, product, data):
    """Bytes cut out of, put into, or changed in the file: one sentence that names it, or a table that is sane."""
    path = written(tmp_path, product, 60, "Y" if product == "KBR1B" else "C")
    content = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        k = data.draw(st.integers(0, len(content)))
        length = data.draw(st.integers(0, 30))
        content[k : k + length] = data.draw(st.binary(max_size=30))
    path.write_bytes(bytes(content))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", Level1Warning)
        try:
            sane(read(path))
        except Level1Error as error:
            assert path.name in str(error) and (re.search(r", line \d+", str(error)) or OF_THE_WHOLE.search(str(error)))


@pytest.mark.parametrize("name", ["SCA1B_2003-09-14_A_00.asc", "KBR1B_2003-09-14_X_00.asc"])
@_SLOW
@given(data=st.data())
def test_fuzzed_files_of_the_older_layout(tmp_path, name, data):
    content = bytearray((FIXTURES / name).read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        k = data.draw(st.integers(0, len(content)))
        length = data.draw(st.integers(0, 30))
        content[k : k + length] = data.draw(st.binary(max_size=30))
    (tmp_path / name).write_bytes(bytes(content))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", Level1Warning)
        try:
            sane(read_grace(tmp_path / name))
        except Level1Error as error:
            assert name in str(error) and (re.search(r", line \d+", str(error)) or OF_THE_WHOLE.search(str(error)))
