"""The notebooks of the attitude part at their quick scale, held against the specification; and each of them on a folder
of files.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numba
import pytest

from execbook import claims, multiverse, parameters, reference
from execbook.project import root as project_root
from geokalman.attitude import experiment, write
from geokalman.attitude.header import Level1Error
from geokalman.attitude.model import SATELLITES, Scenario

PAPER = "gracefo-attitude"
ROOT = project_root(Path(__file__).parent)
NOTEBOOKS = tuple(sorted(p.stem for p in (ROOT / "book" / PAPER).glob("[0-9]*.md")))
DRAWINGS = ("att01-chain",)
FROM_FILES = tuple(name for name in NOTEBOOKS if name != multiverse.READINGS)  # worlds are simulated
pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="hours of flight take minutes in plain Python")


@pytest.fixture(scope="session")
def run(run_notebook) -> Callable[..., Path]:
    """The run folder of a notebook at its quick scale."""
    return partial(run_notebook, PAPER)


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_stored_reference(run, assert_held, name):
    mode = reference.read_run(run(name))[0]["mode"]
    stored = reference.path_of(ROOT, f"{PAPER}/{name}", mode)
    assert stored.is_file(), f"{stored.name} is missing; make it with: make reference"
    assert_held(reference.differences(ROOT, run(name), mode))


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_claims_name_what_is_recorded(run, name):
    named = {
        m.partition(":")[2] for c in claims.ledger(ROOT, PAPER) for m in c.metrics if m.startswith(f"{PAPER}/{name}:")
    }
    assert named <= set(reference.read_run(run(name))[1])


def test_the_parameters_of_the_contract():
    found = set().union(*(parameters.load(ROOT, f"{PAPER}/{name}").parameters for name in NOTEBOOKS))
    assert {
        "duration_s", "n_seeds", "seed0", "arw_deg_sqrt_h", "sca_sigma_arcsec", "k_aniso", "kappa", "mount",
        "mount_err_rad", "satellite", "cameras_off", "gap_s", "axes", "data_dir",
    } <= found  # fmt: skip


@pytest.mark.parametrize("name", ["07-acceleration", "11-gaps"])
def test_both_satellites_count(run, run_here, tmp_path, name):
    given = {"satellite": "both"} | ({"gaps_s": [60.0]} if name == "11-gaps" else {})
    folder = run_here(PAPER, name, tmp_path / "both", **given)
    one, both = (reference.read_run(x)[1] for x in (run(name), folder))
    key = "offset.std.x" if name == "07-acceleration" else "gap.60.error_rms"
    assert one[key]["value"] != both[key]["value"]
    assert both[key]["value"] == pytest.approx(one[key]["value"], rel=0.8)


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_figures_are_drawn_twice_with_their_data(run, assert_drawn, name):
    assert_drawn(run(name), DRAWINGS)


@pytest.mark.parametrize(
    ("name", "keys"),
    [
        (
            "04-pointing",
            [f"attitude_rms.{f}.{a}" for f in ("akf7", "mekf", "rts", "jpl_like") for a in ("roll", "pitch", "yaw")],
        ),
        (
            "05-rates",
            [f"rate_minus_imu.{f}.{a}" for f in ("akf7", "mekf", "rts", "jpl_like") for a in ("roll", "pitch", "yaw")],
        ),
        (
            "06-consistency",
            ["nis3.akf7", "nis3.mekf", "nis3.jpl_like", "nees3.akf7", "nees3.mekf", "nees3.rts", "nees3.jpl_like"],
        ),
        ("08-antenna", [f"kbr_rate_error.{f}" for f in ("akf7", "mekf", "rts", "jpl_like")]),
    ],
)
def test_recorded_names(run, name, keys):
    metrics = reference.read_run(run(name))[1]
    assert not [key for key in keys if key not in metrics]


@pytest.fixture(scope="session")
def day(tmp_path_factory):
    """Level-1 files of 25 minutes, written by the simulation; one record of a gyro axis is lost."""
    folder = tmp_path_factory.mktemp("day")
    recording = experiment.flight(Scenario(duration_s=1500.0), 5)
    for s in SATELLITES:
        write.write_raw(folder, recording.raw[s])
        write.write_orbit(folder, s, recording.t, recording.r[s], recording.v[s])
    lossy = next(folder.glob("IMU1A*_C_04.txt"))
    lines = lossy.read_text(encoding="utf-8").splitlines(keepends=True)
    lossy.write_text("".join(lines[:20000] + lines[20001:]), encoding="utf-8")
    return folder


@pytest.mark.parametrize("name", FROM_FILES)
def test_every_notebook_takes_files(run_here, day, tmp_path, name):
    folder = run_here(PAPER, name, tmp_path / "out", data_dir=str(day))
    assert reference.read_run(folder)[1]


def test_a_folder_without_files_says_so(run_here, tmp_path):
    with pytest.raises(Level1Error, match="no SCA1A_YYYY"):
        run_here(PAPER, "01-single-cameras", tmp_path / "out", data_dir=str(tmp_path))
