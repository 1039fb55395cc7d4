"""Level-1 star cameras and clocks: order, flags, clock segments and neighbouring days."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest
from level1files import DATE, columns_of, edit

from geokalman.attitude import experiment as flights
from geokalman.attitude import read as day
from geokalman.attitude import timetags, write
from geokalman.attitude.header import Level1Error, flag_meanings
from geokalman.attitude.level1 import Level1Warning, Table
from geokalman.attitude.model import EPOCH_2019, Scenario, Tuning
from geokalman.physics.quaternion import continuous


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
        recording = flights.flight(Scenario(), 0, str(tmp_path))
    assert len(recording.edge["C"]) > 15 and not len(recording.edge["D"])
    marked = flights.solve(recording, "C", Tuning(), ("mekf",)).edge
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
