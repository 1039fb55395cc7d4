"""Folders of Level-1 files: the way through them, and what they may lack."""

from __future__ import annotations

import shutil
from dataclasses import replace

import numpy as np
import pytest
from level1files import DATE, edit

from geokalman.attitude import cameras, write
from geokalman.attitude import experiment as flights
from geokalman.attitude import read as day
from geokalman.attitude.gyro import GyroWarning
from geokalman.attitude.header import Level1Error
from geokalman.attitude.level1 import Level1Warning, read
from geokalman.attitude.model import Scenario
from geokalman.physics.quaternion import difference


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
        recording = flights.flight(Scenario(), 0, str(copied))
    assert np.isnan(recording.raw["C"].gyro[3]).all() and np.isfinite(recording.raw["C"].gyro[:3]).all()
    with pytest.warns(GyroWarning, match="GRACE-C: gyro axis 4 gave no samples"):
        result = flights.solve(recording, "C", tuning, ("mekf",))
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
