"""Scores and ensembles: what they measure, the same on one and on two workers, and what they refuse."""

from concurrent.futures import ThreadPoolExecutor

import numba
import numpy as np
import pytest

from geokalman.kalman import monte_carlo
from geokalman.physics import mars
from geokalman.pulsar import assess, estimate, experiment, simulate
from geokalman.pulsar.experiment import Experiment, Method
from geokalman.pulsar.model import CENTURIES, Mission, preset


@pytest.fixture(scope="module")
def trial(day):
    methods = {
        "ekf": Method("ekf"), "rts": Method("ekf", smoothed=True), "two": Method("ekf", pulsars=(1, 2)),
        "cycle": Method("aekf2", order=(1, 2, 3)), "wide": Method("ekf", r_factor=100.0),
        "empirical": Method("ekf", empirical=(1e-3, 1000.0)),
    }  # fmt: skip
    return Experiment(day.mission, preset("E"), day.rich, day.force, methods, first=10)


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="ensembles take minutes in plain Python")
def test_the_same_numbers_for_one_and_two_workers(trial):
    one, two = (experiment.ensemble(trial, 3, 4, workers) for workers in (1, 2))
    assert one == two
    with ThreadPoolExecutor(2) as pool:
        assert monte_carlo(trial, range(3, 7), pool)[2] == {label: scores[2] for label, scores in one.items()}


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="ensembles take minutes in plain Python")
def test_methods_differ_as_they_say(trial):
    scores = {label: assess.mean(s) for label, s in experiment.ensemble(trial, 0, 2).items()}
    assert scores["wide"].nis < scores["ekf"].nis and scores["wide"].nees6 < scores["ekf"].nees6
    assert scores["empirical"].d3 < scores["ekf"].d3
    assert scores["cycle"].skipped == 1.0 and scores["ekf"].skipped == 0.0
    data = simulate.observe(trial.flight, trial.mission, trial.preset.world, np.random.default_rng(0))
    run = {label: trial.estimate(method, data) for label, method in trial.methods.items()}
    assert (run["two"].observed == 2).all() and (run["cycle"].observed == 1).all() and (run["ekf"].observed == 7).all()
    np.testing.assert_array_equal(run["rts"].x, estimate.smooth(run["ekf"]).x)


def test_a_score_from_its_definitions(trial, day):
    data = simulate.observe(day.rich, day.mission, preset("E").world, np.random.default_rng(0))
    run = trial.estimate(Method("aekf1_pr3"), data)
    score = assess.score(run, day.rich, 10)
    error = (run.x - day.rich.x)[10:]
    turned = error[:, :3] @ mars.smci_from_icrf(CENTURIES)
    assert (score.x, score.y, score.z) == pytest.approx(np.sqrt((turned**2).mean(axis=0)))
    assert score.d3 == pytest.approx(np.sqrt((error[:, :3] ** 2).sum(axis=1).mean()))
    assert score.d3**2 == pytest.approx(score.x**2 + score.y**2 + score.z**2)
    assert (score.vx, score.vy, score.vz) == pytest.approx(np.sqrt((error[:, 3:] ** 2).mean(axis=0)))
    expected = np.mean([e @ np.linalg.solve(P, e) for e, P in zip(error, run.P[10:], strict=True)]) / 6
    assert score.nees6 == pytest.approx(expected, rel=1e-6)
    assert score.nis == pytest.approx(run.nis[10:].mean() / 7)
    assert score.fired == pytest.approx((run.alpha < 1).mean())
    position, velocity = assess.sigmas(run)
    R = mars.icrf_from_smci(CENTURIES)
    assert position[5] ** 2 == pytest.approx(np.diag(R @ run.P[5, :3, :3] @ R.T))
    assert velocity[5] ** 2 == pytest.approx(np.diag(run.P[5])[3:])
    with pytest.raises(ValueError, match="leaves no epoch"):
        assess.score(run, day.rich, 60)


def test_the_last_epoch_beyond_a_kilometre(day):
    run = estimate.run("ekf", day.data, day.flight.x0 + np.array([5e3, 0, 0, 0, 0, 0]), preset("B").belief, day.force)
    distance = np.linalg.norm((run.x - day.flight.x)[:, :3], axis=1)
    last = assess.score(run, day.flight, 0).last
    assert (distance[last:] <= 1000.0).all() and (last == 0 or distance[last - 1] > 1000.0)


def test_statistics_of_an_ensemble():
    scores = [assess.Score(*(np.full(len(assess.Score._fields), v))) for v in (1.0, 2.0, 6.0)]
    assert assess.mean(scores).d3 == 3.0 and assess.spread(scores).d3 == pytest.approx(np.std([1, 2, 6], ddof=1))
    assert assess.spread(scores[:1]).d3 == 0.0
    difference, error = assess.paired(scores, scores[::-1])
    assert difference == 0.0 and error == pytest.approx(np.std([-5, 0, 5], ddof=1) / np.sqrt(3))
    assert assess.paired(scores[:1], scores[1:2]) == (-1.0, 0.0)
    assert assess.ordered({"a": scores[:1], "b": scores[1:2]}, ["a", "b"]) and not assess.ordered(
        {"a": scores, "b": scores}, ["a", "b"]
    )


def test_a_filter_that_diverges_says_where_and_why_and_is_no_number(day):
    lost = Experiment(day.mission, preset("A", p0=(1e9, 1.0)), day.flight, day.force, {"ekf": Method("ekf")}, first=10)
    runs = experiment.ensemble(lost, 0, 2)["ekf"]
    assert [(r.epoch, "sigma" in r.why) for r in runs] == [(1, True), (1, True)]
    assert assess.kept(runs) == [] and np.isnan(assess.distance(runs))
    good = assess.Score(*(np.full(len(assess.Score._fields), 1.0)))
    assert assess.distance([good, runs[0]]) == 1.0
    for statistic in (assess.mean, assess.spread):
        with pytest.raises(ValueError, match="run 2 of 2 has no score: the filter diverged at epoch k = 1: a position"):
            statistic([good, runs[0]])
        with pytest.raises(ValueError, match="at least one seed"):
            statistic([])


def test_the_chance_of_a_false_alarm():
    """Against normal deviates drawn and counted."""
    rng = np.random.default_rng(5)
    for dof in (3, 7):
        s = np.sqrt((rng.standard_normal((400_000, dof)) ** 2).mean(axis=1))
        assert assess.false_alarm(1.5, dof) == pytest.approx((s > 1.5).mean(), abs=2e-3)


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="times of plain Python say nothing")
def test_a_cost_is_a_positive_time(trial):
    assert experiment.microseconds(trial, Method("ekf"), repeat=1) > 0.0


def test_what_an_ensemble_refuses(trial):
    with pytest.raises(ValueError, match="seed 4 is repeated"):
        experiment.over_seeds(trial, [3, 4, 4])
    for seeds, workers in ((0, 1), (1, 0)):
        with pytest.raises(ValueError, match="must be at least 1"):
            experiment.ensemble(trial, 0, seeds, workers)
    with pytest.raises(ValueError, match="filter 'pf' is unknown"):
        experiment.table3_methods(preset("E"), ["ekf", "pf"])
    with pytest.raises(ValueError, match="defines no tuned"):
        experiment.table3_methods(preset("B"), ["ekf_tuned"])


def test_methods_of_table_3(day):
    methods = experiment.table3_methods(preset("C"), ["ekf", "rts", "ekf_tuned", "ukf"])
    assert methods["rts"].smoothed and methods["ekf_tuned"].belief.q_pos == 150.0 and methods["ukf"].kind == "ukf"
    trial = experiment.prepare(Mission(days=0.5), preset("C"), day.gravity, methods, first=20)
    assert len(trial.flight.t) == 86 and trial.start().tolist() == trial.flight.x0.tolist()
