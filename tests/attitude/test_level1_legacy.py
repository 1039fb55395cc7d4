"""Level-1 files of the older layout: synthetic, bad, and the real sample."""

from __future__ import annotations

import os
import warnings
from pathlib import Path

import numpy as np
import pytest
from level1files import FIXTURES

from geokalman.attitude.header import Level1Error
from geokalman.attitude.legacy import read_grace
from geokalman.attitude.level1 import Level1Warning

SAMPLES = os.environ.get("GEOKALMAN_SAMPLES", "")
SAMPLE = Path(SAMPLES) / "grace_l1b_2003-09-14" if SAMPLES else Path("none")
if SAMPLES and not SAMPLE.is_dir():
    SAMPLE = Path(SAMPLES)
needs_sample = pytest.mark.skipif(
    not (SAMPLE / "KBR1B_2003-09-14_X_00.asc").is_file(),
    reason="GEOKALMAN_SAMPLES does not name the folder of the GRACE sample of 2003-09-14",
)


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
