"""The notebooks of radioastron-orbit at quick scale: anchors of the specification, stored references, figures."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numba
import pytest

from execbook import reference
from execbook.errors import Fault
from execbook.project import root as project_root

PAPER = "radioastron-orbit"
ROOT = project_root(Path(__file__).parent)
NOTEBOOKS = tuple(sorted(p.stem for p in (ROOT / "book" / PAPER).glob("[0-9]*.md")))
pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="hours of orbit take minutes in plain Python")


@pytest.fixture(scope="session")
def run(run_notebook) -> Callable[..., Path]:
    """The run folder of a notebook at quick scale, or with other parameters under a label."""
    return partial(run_notebook, PAPER)


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_stored_reference(run, assert_held, name):
    """The run says of which scale it is: one whose quick values are the defaults (01, 02, 03, 10) is the paper's."""
    folder = run(name)
    mode = reference.read_run(folder)[0]["mode"]
    assert reference.path_of(ROOT, f"{PAPER}/{name}", mode).is_file(), f"{name} has no reference at {mode} scale"
    assert_held(reference.differences(ROOT, folder, mode))


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_figures_are_drawn_twice_with_their_data(run, assert_drawn, name):
    assert_drawn(run(name), without_data=["r01-schematic"])


@pytest.mark.parametrize(("label", "name", "given", "key", "value", "rel"), [
    ("oe", "01-orbit", {"session": "RAES03OE"}, "state.z", 71711182.302, 1e-9),
    ("bb", "02-measurements", {"session": "BB"}, "range_m", 124855108.64, 1e-9),
    ("later", "02-measurements", {"after_s": 600.0}, "range_m", 86713802.99, 1e-8),
    ("pass", "03-observability", {"bias": "per-pass", "filter_sigma_range_m": 10.0, "filter_sigma_rate_m_s": 1e-3},
     "sigma.delay_us.post", 10.998, 0.03),
    ("two", "03-observability", {"stations": ["Bear Lakes", "Ussuriysk"], "estimate_bias": True},
     "sigma.rate.post", 1.51e-11, 0.03),
    ("east", "03-observability", {"mean_anomaly_deg": 90.0, "source": "east 15"}, "sigma.delay_us.post", 1.88, 0.03),
    ("smear", "05-correlator", {"rate": 0.0, "acceleration": 3e-15, "band": "C", "n_seeds": 1, "search_channels": 64},
     "coherence", 0.525, 0.02),
    ("vacuum", "02-measurements", {"shapiro": False}, "range_m", 86058023.32 - 0.0263, 1e-9),
    ("clock", "02-measurements", {"terms": ["clock"]}, "doppler.sum", 6.969290134e-10 * 299792458.0, 1e-9),
    ("elsewhere", "11-real-orbits", {"orbit": "assumed", "draws": 100, "correlated": 10}, "st.distance.first_m",
     89080600.0, 1e-5),
    ("ray", "02-measurements", {"light_time_terms": ["distance"]},
     "light_time.seconds", 86058340.0 / 299792458.0, 1e-7),
])  # fmt: skip
def test_parameters_of_the_contract(run, label, name, given, key, value, rel):
    assert reference.read_run(run(name, label, **given))[1][key]["value"] == pytest.approx(value, rel=rel)


def test_the_other_session_of_july_runs_too(run):
    """BB ends before the printed times of Figure 5 (BC's); its own window is taken, and BC is then the other one."""
    folder = run("07-sessions-2012", "bb", session="BB", n_seeds=2, snr_seeds=4)  # as many as there are
    metrics = reference.read_run(folder)[1]
    assert 1.0 < metrics["prior.delay_us.rms"]["value"] < 20.0
    assert metrics["bc.snr.l.ekf.median"]["value"] > 20.0
    rows = [line.split(",") for line in (folder / "figures" / "r07-corrections.csv").read_text().splitlines()[1:]]
    assert float(rows[0][0]) == 12.5 * 3600 - 660 and float(rows[-1][0]) == 13.5 * 3600 + 900


def test_stations_and_source_act_on_every_study(run):
    """Two stations make the P(0) study and the correction others than one does; a source to the east another delay."""
    few = {"n_seeds": 2, "snr_seeds": 1}
    one = reference.read_run(run("07-sessions-2012", "few", **few))[1]
    two = reference.read_run(
        run("07-sessions-2012", "pair", stations=["Ussuriysk", "Bear Lakes"], source="east 15", **few)
    )[1]
    for key in ("correction.dx_rms_m", "correction.along_m", "ekf.delay_us.rms", "printed.delay_dz_plus_us"):
        assert one[key]["value"] != pytest.approx(two[key]["value"], rel=1e-3), key
    short = {"n_seeds": 3, "scales": [5.0, 5.0]}
    one = reference.read_run(run("08-estimators", "few", **short))[1]
    two = reference.read_run(
        run("08-estimators", "pair", stations=["Bear Lakes", "Ussuriysk"], source="east 10", **short)
    )[1]
    assert two["scale.5.delay_us.rms"]["value"] < 0.5 * one["scale.5.delay_us.rms"]["value"]


def test_every_station_is_observed(run):
    folder = run("02-measurements", "three", stations=["Bear Lakes", "Ussuriysk", "Pushchino"])
    rows = (folder / "tables" / "r02-observed.csv").read_text(encoding="utf-8").splitlines()
    assert [row.split(",")[0] for row in rows[1:]] == ["Bear Lakes", "Ussuriysk", "Pushchino"]


@pytest.mark.parametrize(("name", "given", "words"), [
    ("01-orbit", {"session": "XX"}, "session 'XX' is unknown"),
    ("03-observability", {"stations": ["Arecibo"]}, "station 'Arecibo' is unknown"),
    ("04-session-l", {"source": "12:30, 10"}, "in hours"),
    ("03-observability", {"mean_anomaly_deg": 340.0}, "above the horizon of Bear Lakes"),
    ("02-measurements", {"terms": ["wind"]}, "term 'wind' is unknown"),
    ("04-session-l", {"pair": ["Bear Lakes"]}, "fewer than two stations"),
    ("10-literal", {"step_s": 0.001, "after_s": 86400.0}, "at most 1e5 steps"),
    ("10-literal", {"step_s": 3600.0}, "at least one"),
])  # fmt: skip
def test_a_wrong_parameter_is_said_in_a_sentence(run_here, tmp_path, name, given, words):
    with pytest.raises((Fault, ValueError), match=words):
        run_here(PAPER, name, tmp_path / "run", **given)
