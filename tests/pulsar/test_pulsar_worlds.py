"""Worlds of readings: the default is what the pages compute, options change what they say, names are recorded ones."""

from pathlib import Path

import numba
import numpy as np
import pytest

from execbook import ledger, multiverse
from execbook.project import root as project_root
from geokalman.pulsar import assess, experiment, simulate, weighting, worlds
from geokalman.pulsar.estimate import Tuning
from geokalman.pulsar.experiment import Method
from geokalman.pulsar.model import PRESETS, Mission, preset
from geokalman.pulsar.weighting import Weighting

ROOT = project_root(Path(__file__).parent)
CHOICES = multiverse.choices(ROOT, "mars-pulsar")
DEFAULT = multiverse.default(CHOICES)
DAYS = 0.8
pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="ensembles of orbits take hours in plain Python")


@pytest.fixture(scope="module")
def ours():
    return worlds.metrics(DEFAULT, DAYS)


def test_every_option_is_known():
    options = {choice.id: set(choice.groups) for choice in CHOICES}
    assert options["ranges"] == set(worlds.RANGES) and options["noise"] == set(worlds.NOISE)
    assert options["aekf1-table3"] == options["aekf1-start"] == set(worlds.AEKF1)
    assert options["factor"] == set(worlds.FACTOR) and options["start"] == set(worlds.START)
    assert options["weights"] == set(weighting.RESIDUALS)


def test_the_default_is_what_the_pages_fly(ours, day):
    """Presets E, A and B with the seed of the world, by the functions that the pages call."""
    import zlib

    seed, mission = zlib.crc32(repr(sorted(DEFAULT.items())).encode()), Mission(days=DAYS)
    assert PRESETS["E"].world.sigma_scale == worlds.RANGES["calibrated"]
    cycle = {f"{k} cycle": Method(k, order=(1, 2, 3)) for k in ("aekf1_prw", "aekf2", "raekf")}
    kinds = {k: Method(k) for k in ("ekf", "aekf1_prw", "aekf2", "raekf", "aekf1_pr3")}
    wide = {"wide": Method("raekf", weighting=Weighting("least-squares", (1.5, 2.5), (1.75, 2.9)))}
    scores = {}
    for name in ("E", "A", "B"):
        trial = experiment.prepare(mission, preset(name), day.gravity, kinds | cycle | wide)
        scores |= {(name, k): s[0] for k, s in experiment.ensemble(trial, seed, 1).items()}
    for k in ("ekf", "aekf1_prw", "aekf2", "raekf"):
        for axis, field in (("x", "x"), ("y", "y"), ("z", "z"), ("3d", "d3")):
            key = f"mars-pulsar/05-table3:table3.{k}.rms.{axis}"
            assert ours[key] == pytest.approx(getattr(scores["E", k], field), rel=1e-6)
    assert ours["mars-pulsar/10-sequential:e.aekf2.cycle.123.3d"] == pytest.approx(scores["E", "aekf2 cycle"].d3)
    assert ours["mars-pulsar/10-sequential:e.aekf1_prw.all.3d"] == pytest.approx(scores["E", "aekf1_prw"].d3)
    assert ours["mars-pulsar/09-robustness:sweep.e.best.3d"] <= scores["E", "wide"].d3 * (1.0 + 1e-6)
    start = "mars-pulsar/07-initial-error:"
    for k, key in (("ekf", "ekf"), ("aekf1_pr3", "aekf1_pr3"), ("aekf2", "aekf2_15_25"), ("raekf", "raekf_15_25")):
        assert ours[f"{start}a.{key}.rms.3d"] == pytest.approx(scores["A", k].d3, rel=1e-6)
    assert ours[f"{start}a.aekf1_pr3.last.max"] == scores["A", "aekf1_pr3"].last
    assert ours[f"{start}b.aekf1_pr3.rms.3d"] == pytest.approx(scores["B", "aekf1_pr3"].d3, rel=1e-6)
    four = [scores["A", k].d3 for k in ("ekf", "aekf1_pr3", "aekf2", "raekf")]
    assert ours[f"{start}similar.ratio"] == pytest.approx(max(four) / min(four), rel=1e-6)


def test_a_world_gives_names_that_claims_use(ours):
    used = {m for c in ledger.ledger(ROOT, "mars-pulsar") for m in c.metrics}
    shared = [c.id for c in ledger.ledger(ROOT, "mars-pulsar") if c.kind == "claim" and c.metrics and set(c.metrics) <= set(ours)]  # fmt: skip
    assert len(set(ours) & used) > 25 and len(shared) > 20


@pytest.mark.parametrize(
    "changes",
    [
        {"axes": "mars"}, {"pulsars": "polar"}, {"occultation": "hidden"}, {"field": "j2"}, {"noise": "tuned"},
        {"transfer": "constant"}, {"weights": "posterior"}, {"second-experiment": "same", "similar": "table3"},
    ],
)  # fmt: skip
def test_a_choice_changes_the_numbers(ours, changes):
    """With the same noise, so that the choice alone differs; and twice the same."""
    once, again = (worlds.metrics(DEFAULT | changes, DAYS) for _ in range(2))
    assert once == again and set(once) == set(ours) and once != ours
    assert all(np.isfinite(v) for v in once.values())


def test_a_sharpened_pulsar_has_the_variance_that_is_stated():
    mission = Mission(days=2.0)
    flight, _ = worlds._flight("n30", 0.0, 2.0)
    for chosen in (preset("B"), preset("E", transfer_scale=1.0)):
        data = simulate.observe(flight, mission, chosen.world, np.random.default_rng(3))
        sharp = worlds.sharpened(data, flight, chosen.world, 3, 300.0)
        noise = sharp.z[:, 3] - flight.x[:, :3] @ data.H[3]
        assert np.sqrt(sharp.variance[3]) == pytest.approx(
            np.hypot(300.0 * chosen.world.sigma_scale, 29.98 * chosen.world.transfer), rel=1e-4
        )
        assert np.sqrt((noise**2).mean()) == pytest.approx(np.sqrt(sharp.variance[3]), rel=0.1)
        np.testing.assert_array_equal(np.delete(sharp.z, 3, 1), np.delete(data.z, 3, 1))


def test_a_filter_that_loses_its_orbit_has_a_large_error(day):
    trial = experiment.Experiment(
        day.mission, preset("A", p0=(1e9, 1.0)), day.flight, day.force, {"ekf": Method("ekf", Tuning())}, first=10
    )
    score = worlds._score(trial, trial.methods["ekf"], day.data, DEFAULT)
    assert isinstance(score, assess.Score) and score.d3 == 1e7 and score.last == len(day.data.t)
