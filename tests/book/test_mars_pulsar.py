"""The notebooks of the pulsar paper at the quick scale: anchors, references, figures, contract, parameters."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numba
import pytest
from spkfiles import write_spk

from execbook import claims, parameters, reference
from execbook.errors import Misuse
from execbook.project import root as project_root
from geokalman.physics.ephemeris import OutsideEphemeris, load_ephemeris

PAPER = "mars-pulsar"
ROOT = project_root(Path(__file__).parent)
NOTEBOOKS = tuple(sorted(p.stem for p in (ROOT / "book" / PAPER).glob("[0-9]*.md")))
DRAWINGS = ("mp01-schematic",)
FILTERS = ("ekf", "aekf1_prw", "aekf1_pr3", "aekf1_pr2", "aekf2", "raekf", "rts", "ekf_tuned")
pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="ensembles of orbits take hours in plain Python")
NAMES = [pytest.param(name, id=name, marks=pytest.mark.xdist_group(name)) for name in NOTEBOOKS]


@pytest.fixture(scope="session")
def run(run_notebook) -> Callable[..., Path]:
    """The run folder of a notebook at the quick scale."""
    return partial(run_notebook, PAPER)


@pytest.mark.parametrize("name", NAMES)
def test_stored_reference(run, assert_held, name):
    assert_held(reference.differences(ROOT, run(name)))


@pytest.mark.parametrize("name", NAMES)
def test_figures_are_drawn_twice_with_their_data(run, assert_drawn, name):
    assert_drawn(run(name), DRAWINGS)


@pytest.mark.parametrize("name", NAMES)
def test_claims_name_what_is_recorded(run, name):
    named = {
        m.partition(":")[2] for c in claims.ledger(ROOT, PAPER) for m in c.metrics if m.startswith(f"{PAPER}/{name}:")
    }
    assert named <= set(reference.read_run(run(name))[1])


@pytest.mark.xdist_group("05-table3")
def test_the_names_of_the_contract(run):
    metrics = reference.read_run(run("05-table3"))[1]
    for name in FILTERS:
        for axis in ("x", "y", "z", "3d"):
            assert (
                metrics[f"table3.{name}.rms.{axis}"]["unit"] == metrics[f"table3.{name}.rms_sd.{axis}"]["unit"] == "m"
            )
        assert metrics[f"table3.{name}.nees6"]["unit"] == ""
        assert (f"table3.{name}.nis7" in metrics) == (name != "rts")


def test_the_parameters_of_the_contract():
    found = set().union(*(parameters.load(ROOT, f"{PAPER}/{name}").parameters for name in NOTEBOOKS))
    assert {
        "preset", "seed0", "n_seeds", "pulsars", "sigma_scale", "q_pos_m", "q_vel_m_s", "filters", "k0", "k1",
        "raan_deg", "days", "outlier_fraction", "allow_coarse_substeps",
    } <= found  # fmt: skip


@pytest.mark.parametrize("preset", list("ABCD"))
def test_table_3_runs_with_every_preset_and_other_settings(run_here, tmp_path, preset):
    given = {
        "preset": preset,
        "filters": ["ekf", "ukf", "ekf_tuned"],
        "n_seeds": 1,
        "days": 1.0,
        "pulsars": [1, 2, 3, 7],
        "raan_deg": 75.0,
        "q_pos_m": 20.0,
    }
    folder = run_here(PAPER, "05-table3", tmp_path / preset, quick=False, **given)
    metrics = reference.read_run(folder)[1]
    assert ("table3.ekf_tuned.rms.x" in metrics) == (preset == "C")
    assert metrics["table3.ukf.rms.3d"]["value"] > 0


def test_a_filter_that_diverges_is_recorded(run_here, tmp_path):
    given = {
        "preset": "B", "substeps": 1, "allow_coarse_substeps": True, "n_seeds": 1, "filters": ["ekf", "aekf1_pr3"],
    }  # fmt: skip
    folder = run_here(PAPER, "05-table3", tmp_path / "coarse", quick=False, **given)
    assert reference.read_run(folder)[1]["table3.ekf.diverged"]["value"] == 1


def test_a_skipped_adaptation_is_told(run_here, tmp_path, capsys):
    given = {"pulsars": [1, 2], "filters": ["ekf", "aekf2"], "n_seeds": 1, "days": 1.0}
    run_here(PAPER, "05-table3", tmp_path / "two", quick=False, **given)
    assert "AEKF2: the adaptation was skipped in 100 % of the epochs" in capsys.readouterr().out


def test_real_photons_take_an_ephemeris_of_ones_own(run, run_here, tmp_path):
    segments = load_ephemeris().segments
    own = write_spk(tmp_path / "own.bsp", [s for s in segments if s.target in (3, 399)])
    ours, theirs = (reference.read_run(folder)[1] for folder in (
        run_here(PAPER, "12-real-photons", tmp_path / "own", ephemeris=str(own)), run("12-real-photons"),
    ))  # fmt: skip
    assert {key: m["value"] for key, m in ours.items()} == pytest.approx({key: m["value"] for key, m in theirs.items()})
    later = [replace(s, start=s.start + 8000 * 86400.0) for s in segments if s.target in (3, 399)]
    with pytest.raises(OutsideEphemeris, match="outside later.bsp"):
        run_here(PAPER, "12-real-photons", tmp_path / "later", ephemeris=str(write_spk(tmp_path / "later.bsp", later)))


@pytest.mark.parametrize(
    ("given", "match"),
    [
        ({"preset": "F"}, "preset"), ({"filters": ["pf"]}, "filters"), ({"n_seeds": 0}, "n_seeds"),
        ({"days": -1.0}, "days"), ({"pulsars": [8]}, "pulsars"), ({"k0": 0.0}, "k0"),
        ({"outlier_fraction": 2.0}, "outlier_fraction"), ({"q_pos_m": -1.0}, "q_pos_m"),
        ({"sigma_scale": 0.0}, "sigma_scale"),
    ],
)  # fmt: skip
def test_parameters_out_of_range_are_refused_in_one_sentence(given, match):
    with pytest.raises(Misuse, match=match):
        parameters.load(ROOT, f"{PAPER}/05-table3").check(given)
