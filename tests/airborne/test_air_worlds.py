"""Worlds of the readings: the default one is the pages' own set-up, every option is known, and some options by hand."""

from pathlib import Path

import numpy as np
import pytest

from execbook import multiverse
from execbook.project import root as project_root
from geokalman.airborne import backward, experiment, simulate, worlds
from geokalman.airborne.estimate import run_filter
from geokalman.airborne.model import Tuning, build

ROOT = project_root(Path(__file__).parent)
CHOICES = multiverse.choices(ROOT, "airborne-gravity")
DEFAULT = multiverse.default(CHOICES)
SIX, START, LOW = (f"airborne-gravity/{page}" for page in ("04-six-lines:", "05-backward-start:", "07-model-free:"))


@pytest.fixture(scope="module")
def default():
    return worlds.metrics(DEFAULT)


def test_the_default_world_is_the_set_up_of_the_pages(default):
    scenario, tuning = worlds.settings(DEFAULT)
    assert (scenario, tuning) == (simulate.Scenario(imu_rate=worlds.RATE), Tuning())
    others = (("order1", Tuning(order=1)),)
    run = [experiment.simulated(scenario, tuning, 0, fir=(100.0,), others=others)]
    for method in ("fb", "forward"):
        for what in ("D_raw", "truth"):
            mean = experiment.six_line_means(run, method, what)[0]
            assert default[f"{SIX}{method}.{what}"] == pytest.approx(mean, rel=1e-9)
        correlation = np.mean([line.correlation(method) for line in run[0]])
        assert default[f"{SIX}correlation.{method}"] == pytest.approx(correlation, rel=1e-9)
    assert default[f"{SIX}model.order1.D_raw"] == pytest.approx(experiment.six_line_means(run, "order1")[0], rel=1e-9)
    assert default[f"{LOW}paper_like.lowpass.truth"] == pytest.approx(
        experiment.six_line_means(run, "fircut100", "truth")[0], rel=1e-9
    )
    for name, method in (("sag", "fb"), ("reference", "reference")):
        assert default[f"{SIX}error.{name}"] == pytest.approx(np.mean([x.rms(method) for x in run[0]]), rel=1e-9)
    D = [line.against_reference("fb").D_raw for line in run[0]]
    assert default[f"{SIX}every.fb_below_1"] == float(max(D) < 1)
    assert default[f"{START}reading.error"] == pytest.approx(run[0][0].against_truth("fb"), rel=1e-9)


def test_the_same_place_gives_the_same_numbers_and_another_one_others(default):
    assert worlds.metrics(DEFAULT | {"world": 0}) == default
    assert worlds.metrics(DEFAULT | {"world": 1, "line-length": 20.0})[f"{SIX}fb.D_raw"] != default[f"{SIX}fb.D_raw"]


@pytest.mark.parametrize("choice", CHOICES, ids=lambda choice: choice.id)
def test_every_option_is_known_and_changes_something_or_is_said_to_be_the_same(choice):
    values = [v for v in choice.groups if v != choice.default] if choice.options else list(choice.range)
    for value in values:
        changed = worlds.settings(DEFAULT | {choice.id: value}) != worlds.settings(DEFAULT)
        assert changed or choice.id in ("backward-start", "mean-square", "low-pass")


def test_the_literal_start_ends_in_zero_and_is_lost():
    short = DEFAULT | {"line-length": 20.0}
    lost, right, same = (
        worlds.metrics(short | {"backward-start": start}) for start in ("literal", "inverse", "correction")
    )
    assert lost[f"{START}reading.error"] > 5 > right[f"{START}reading.error"] and same == right
    assert lost[f"{SIX}forward.D_raw"] == right[f"{SIX}forward.D_raw"]
    centred = worlds.metrics(short | {"mean-square": "centred"})
    assert centred[f"{SIX}fb.D_raw"] < right[f"{SIX}fb.D_raw"]


def test_the_literal_start_without_a_backward_filter():
    _, line = simulate.survey_of_seed(simulate.Scenario(n_lines=1, length_km=20.0, imu_rate=10.0), 0)[0]
    model = build(line, Tuning())
    short, long = (
        backward.ended_in_zero(model, run_filter(line, model)),
        backward.forward_backward(line, Tuning(), "literal"),
    )
    np.testing.assert_allclose(short.gravity, long.gravity, atol=1e-7)
    np.testing.assert_allclose(short.sigma(), long.sigma(), rtol=1e-6, atol=1e-9)


def test_heights_from_velocities_wander():
    still = simulate.Scenario(n_lines=1, length_km=20.0, imu_rate=10.0, gnss_white=0.0, gnss_colour=0.0)
    exact = simulate.survey_of_seed(still, 0)[0][1]
    velocity = simulate.survey_of_seed(simulate.replace(still, gnss_up=1e-3), 0)[0][1]
    error = np.diff(velocity.z - exact.z) / 1e5 / 0.5
    assert error.std() == pytest.approx(1e-3, rel=0.1) and abs(np.corrcoef(error[1:], error[:-1])[0, 1]) < 0.1


def test_an_option_that_there_is_not():
    with pytest.raises(KeyError, match="'half'"):
        worlds.metrics(DEFAULT | {"backward-start": "half"})
