"""The notebooks of the airborne paper at quick scale, held against the specification's anchors; foreign files; its
ledger.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numba
import numpy as np
import pytest
from surveyfiles import HEADER

from execbook import ledger, reference
from execbook.project import root as project_root
from geokalman.airborne import backward, corrections, experiment, read, simulate
from geokalman.airborne.model import Tuning, build
from geokalman.airborne.read import checks, tables
from geokalman.data import data_path

PAPER = "airborne-gravity"
ROOT = project_root(Path(__file__).parent)
QUICK = tuple(sorted(p.stem for p in (ROOT / "book" / PAPER).glob("[0-9]*.md")))
ANCHORED = tuple(name for name in QUICK if name not in ("11-throughput", "12-joint", "13-search"))
DRAWINGS = ("a01-schematic", "a01-system", "a01-chain")
pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="ten thousands of epochs take hours in plain Python")


@pytest.fixture(scope="session")
def run(run_notebook) -> Callable[..., Path]:
    """The quick run folder of a notebook."""
    return partial(run_notebook, PAPER)


@pytest.mark.parametrize("name", QUICK)
def test_stored_reference(run, assert_held, name):
    mode = reference.read_run(run(name))[0]["mode"]  # "paper" where the quick values are the paper's own
    assert reference.path_of(ROOT, f"{PAPER}/{name}", mode).is_file(), f"{name} has no reference: make reference"
    assert_held(reference.differences(ROOT, run(name), mode))


@pytest.mark.parametrize("name", [name for name in QUICK if name != "13-search"])  # draws the whole survey only
def test_figures_are_drawn_twice_with_their_data(run, assert_drawn, name):
    assert_drawn(run(name), DRAWINGS)


def test_the_joint_quick_run_beats_the_line_product_with_a_coarse_field(run):
    metrics = reference.read_run(run("12-joint"))[1]
    assert metrics["test.joint"]["value"] < metrics["test.contractor"]["value"]
    assert metrics["test.contractor"]["value"] == pytest.approx(0.696, abs=0.001)
    assert metrics["test.grid"]["value"] == pytest.approx(0.455, abs=0.001)


def test_a_file_of_ones_own_gives_the_same_numbers(run, run_here, tmp_path):
    table = tables.read_table(data_path("kauring_2012.xz"))
    rows = np.isin(table["LINE"], [104000, 104100])
    lines = [",".join(HEADER)] + [
        ",".join(f"{v:.7f}" for v in row) for row in zip(*(table[n][rows] for n in HEADER), strict=True)
    ]
    (tmp_path / "own.csv").write_text("\n".join(lines) + "\n")
    given = {"data": str(tmp_path / "own.csv"), "lines": [104100]}
    run_here(PAPER, "08-kauring", tmp_path / "out", quick=False, **given)
    ours, vendored = reference.read_run(tmp_path / "out")[1], reference.read_run(run("08-kauring"))[1]
    for key in ("vs_ground.fb.line104100", "vs_contractor.forward.line104100", "offset.fb.line104100"):
        assert ours[key]["value"] == pytest.approx(vendored[key]["value"], abs=1e-6)


def test_an_aliased_line_gets_a_larger_R_and_the_page_says_so(run_here, tmp_path, capsys):
    table = tables.read_table(data_path("kauring_2012.xz"))
    rows = np.isin(table["LINE"], [104000, 104100])
    own = {n: table[n][rows].copy() for n in HEADER}
    slow = np.where(own["LINE"] == 104000, 4.0e4 * np.sin(0.7 * np.arange(rows.sum())), 0.0)
    own["FZ"], own["GRVRAW"] = own["FZ"] + slow, own["GRVRAW"] + slow
    lines = [",".join(HEADER)] + [
        ",".join(f"{v:.7f}" for v in row) for row in zip(*(own[n] for n in HEADER), strict=True)
    ]
    (tmp_path / "own.csv").write_text("\n".join(lines) + "\n")
    given = {"data": str(tmp_path / "own.csv"), "lines": [104000, 104100]}
    run_here(PAPER, "08-kauring", tmp_path / "out", quick=False, **given)
    with pytest.warns(checks.SuspiciousData, match="aliased"):
        flights = read.read_survey(tmp_path / "own.csv").select([104000, 104100])
    ours = reference.read_run(tmp_path / "out")[1]
    for flight, R in zip(flights, (0.15, 0.02), strict=True):
        sd = experiment.real([flight], Tuning.preset("kauring", R_m=R)).sd("fb", "ground")[0]
        assert ours[f"vs_ground.fb.line{flight.name}"]["value"] == pytest.approx(sd, rel=1e-9)
    told = "R is 0.15 m on the lines whose specific force is aliased (1 in the file), 0.02 m on all others."
    assert told in capsys.readouterr().out


def test_a_file_without_truth_is_estimated_and_not_judged(run_here, tmp_path):
    table = tables.read_table(data_path("kauring_2012.xz"))
    rows, bare = table["LINE"] == 104100, [name for name in HEADER if name not in ("GND_FA", "FRA100", "FRAL100")]
    lines = [",".join(bare)] + [
        ",".join(f"{v:.7f}" for v in row) for row in zip(*(table[n][rows] for n in bare), strict=True)
    ]
    (tmp_path / "own.csv").write_text("\n".join(lines) + "\n")
    given = {"data": str(tmp_path / "own.csv"), "lines": [104100]}
    run_here(PAPER, "08-kauring", tmp_path / "out", quick=False, **given)
    told, metrics, _ = reference.read_run(tmp_path / "out")
    assert metrics["all.lines"]["value"] == 1 and not any(key.startswith("vs_") for key in metrics)
    assert told["figures"] == ["a08-lines"]
    given = {"data": str(tmp_path / "own.csv")}
    with pytest.raises(ValueError, match="The survey has no column GND_FA"):
        run_here(PAPER, "12-joint", tmp_path / "joint", quick=False, **given)


def test_the_likelihood_finds_looser_tilts_on_a_few_lines_already(run):
    metrics = reference.read_run(run("13-search"))[1]
    assert metrics["train.sd_k12_0.0001.log_likelihood"]["value"] > 0.0
    assert metrics["train.sd_tau3_0.002.log_likelihood"]["value"] > 0.0


def test_errata_that_are_about_numbers(run):
    """k3 of 1e-6 is 0.98 mGal; the start as the text has it ends in zero, with its inverse it does not; both D."""
    assert 1e-6 * corrections.normal_gravity(np.radians(40.0), 1500.0) == pytest.approx(0.98, abs=0.005)
    start = reference.read_run(run("05-backward-start"))[1]
    assert abs(start["literal.last_point"]["value"]) < 1e-9 and start["literal.error"]["value"] > 10
    for key in ("reading.error", "forward_certain.error"):
        assert start[key]["value"] < start["forward.filter_error"]["value"]
    six = reference.read_run(run("04-six-lines"))[1]
    for line in range(1, 7):
        A, raw, centred = (six[f"first.line{line}.fb.{what}"]["value"] for what in ("A", "D_raw", "D_centred"))
        assert raw**2 == pytest.approx(A**2 + centred**2, rel=1e-9)


def test_errata_by_the_formulas_of_the_text():
    errata = {c.id: c for c in ledger.ledger(ROOT, PAPER) if c.kind == "erratum"}
    assert (
        errata["erratum-backward-start"].text == "P_f(n/n-1)=0"
        and "P_f^{-1}" in errata["erratum-backward-start"].should
    )
    _, line = simulate.survey_of_seed(simulate.Scenario(n_lines=1, length_km=16.0, imu_rate=10.0), 0)[0]
    model = build(line, Tuning())
    first = backward._start("literal", np.ones(9), np.eye(9), np.eye(9))
    assert not first.mean.any() and not first.cov.any()  # as the text has it: state and covariance zero
    x_a, x_g = np.zeros((6, 1)), np.zeros((3, 1))
    assert errata["erratum-state"].text.startswith("x=[x_a x_g]^T")
    with pytest.raises(ValueError, match="must match exactly"):
        np.hstack([x_a, x_g])  # the text puts two columns of different height side by side
    assert np.hstack([x_a.T, x_g.T]).T.shape == (9, 1) and len(model.names) == 9


def test_the_steady_states_are_callable(run_here, tmp_path):
    given = {"L_km": 15.0, "sigma_mgal": 25.0, "R_m": 0.005, "q_f": 3.0, "V": 80.0, "dt": 0.5}
    run_here(PAPER, "03-gm3", tmp_path / "out", quick=False, **given)
    metrics = reference.read_run(tmp_path / "out")[1]
    assert metrics["steady.forward_sd"]["value"] == pytest.approx(2.3735, rel=1e-3)
    assert metrics["steady.smoother_sd"]["value"] == pytest.approx(0.5140, rel=1e-3)


def test_a_line_that_the_file_does_not_hold(run_here, tmp_path):
    with pytest.raises(
        read.UnknownLine,
        match=r"There is no line 7; there are 10100.*; choose lines of the file, as in lines=\[10100, 10200\]",
    ):
        run_here(PAPER, "08-kauring", tmp_path / "out", quick=False, lines=[7])


def test_the_ledger_has_both_printed_means_and_keeps_ours_apart():
    entries = {c.id: c for c in ledger.ledger(ROOT, PAPER)}
    assert entries["table1-fb-mean"].printed == 0.9073 and entries["table1-forward-mean"].printed == 1.1273
    assert entries["table1-fb-mean"].calibrated and entries["backward-start-literal"].holds is False
    for name in (
        "table1-ratio",
        "combination-optimal",
        "better-than-practice",
        "lowpass-well-chosen",
        "future-gravity-model",
    ):
        assert entries[name].kind == "control"
    texts = [c.text for c in entries.values() if c.kind == "erratum"]
    assert all(texts) and len(texts) == len(set(texts))
