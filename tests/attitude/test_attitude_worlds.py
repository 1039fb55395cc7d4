"""Worlds of the readings: the default is the pages' own set-up, and every option can be run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from execbook import ledger, multiverse
from execbook.project import root
from geokalman.attitude import arcs, assess, comparison, effect, experiment, pointing, simulate, tunings, worlds
from geokalman.attitude.model import AXES, Scenario, Tuning

ROOT = root(Path(__file__).parent)
PART = "gracefo-attitude"
CHOICES = multiverse.choices(ROOT, PART)


@pytest.fixture(scope="module")
def default():
    return worlds.metrics(worlds.DEFAULT)


def numbers(result, notebook):
    start = f"{PART}/{notebook}:"
    return {key.removeprefix(start): value for key, value in result.items() if key.startswith(start)}


def test_the_default_is_declared():
    assert multiverse.default(CHOICES) == worlds.DEFAULT


def test_names_are_those_of_claims(default):
    """A third of the claims and more are decided by what a world gives."""
    entries = [entry for entry in ledger.ledger(ROOT, PART) if entry.kind == "claim"]
    decided = [entry for entry in entries if entry.metrics and set(default).issuperset(entry.metrics)]
    assert len(decided) >= len(entries) / 3


def test_the_default_world_has_the_numbers_of_the_cameras_pages(default):
    """The pages' functions, at the scale of the worlds."""
    fit = tunings.fit(tunings.level(tunings.APM), tunings.level(tunings.JPL))
    scenario, tuning = comparison.settings(Scenario(duration_s=worlds.DURATION), Tuning(), fit)
    table = experiment.camera_errors(scenario, tuning, 1, 1, "C")
    found = numbers(default, "01-single-cameras")
    for key in (f"single.{c}.rms.{axis}" for c in (1, 2, 3) for axis in AXES):
        assert found[key] == pytest.approx(table[key][0], rel=1e-9)
    pairs = numbers(default, "02-combination")
    for axis in AXES:
        best = min(table[f"combined.{pair}.rms.{axis}"][0] for pair in ("12", "13", "23"))
        assert pairs[f"best_two_over_three.{axis}"] == pytest.approx(best / table[f"combined.123.rms.{axis}"][0])


def test_the_default_world_has_the_numbers_of_the_rates(default):
    fit = tunings.fit(tunings.level(tunings.APM), tunings.level(tunings.JPL))
    table = comparison.table(Scenario(duration_s=worlds.DURATION), Tuning(), fit, 1, 1, "C")
    found = numbers(default, "05-rates")
    for key, (value, _) in comparison.fitted_numbers(table).items():
        assert found[f"fitted.{key}"] == pytest.approx(value, rel=1e-9)


def test_the_default_world_has_the_spread_of_the_mounting():
    """The flights' own draws: their combinations differ by the noise of the cameras, a microradian."""
    found = worlds.spreads(worlds.DEFAULT, worlds.Seeds(1, (1, 2), (1,)), Tuning())
    scenario = Scenario(duration_s=600.0, mount_err_rad=1.5e-4)
    table = experiment.camera_errors(scenario, Tuning(), 2, 1, "C")
    for axis in AXES:
        assert found[f"spread.{axis}"] == pytest.approx(table[f"spread.{axis}"][0], abs=8e-6)


def test_the_default_world_has_the_accelerations_of_a_flight():
    found = worlds.accelerations(worlds.DEFAULT, worlds.Seeds(2, (2,), (2,)))
    one = simulate.simulate(Scenario(), 2, ("C",))
    q = one.true_attitude("C")
    a = effect.accelerometer(one, "C", q, (1e-6, 0.0, 1e-6))
    change = pointing.acceleration_difference(q, effect.turned(q, 6e-4), a)[assess.inner(len(q))]
    for i, axis in enumerate("xyz"):
        assert found[f"offset_bias.std.{axis}"] == pytest.approx(change[:, i].std(), rel=5e-3)
        assert found[f"offset_bias.mean_size.{axis}"] == pytest.approx(abs(change[:, i].mean()), abs=1e-12)
    assert found["drift_6h.estimated.largest"] == pytest.approx(arcs.departures(4.61e-10, 21600.0).estimated.max())


def test_the_sensors_of_one_satellite_are_those_of_both():
    scenario = Scenario(duration_s=120.0)
    both, one = simulate.simulate(scenario, 5), simulate.simulate(scenario, 5, ("C",))
    np.testing.assert_array_equal(both.raw["C"].gyro, one.raw["C"].gyro)
    np.testing.assert_array_equal(both.truth["D"].q, one.truth["D"].q)
    assert set(one.raw) == {"C"}


def test_every_option_runs_with_the_same_names(default, monkeypatch):
    """Ten minutes of flight; a world of each option beside the defaults."""
    monkeypatch.setattr(worlds, "DURATION", 900.0)
    for choice in CHOICES:
        options = [o.id for o in choice.options if o.id != choice.default] or list(choice.range)
        if choice.id in ("window", "gain", "jpl-output", "anisotropy", "single", "order-of-magnitude"):
            options = options[-1:]  # a flight each
            for option in options:
                assert set(worlds.metrics({**worlds.DEFAULT, choice.id: option})) == set(default)
            continue
        for option in options:
            world = {**worlds.DEFAULT, choice.id: option}
            seeds = worlds.seeds(world | {"world": 3})
            found = (
                worlds.spreads(world, seeds, Tuning())
                | worlds.offsets(world, seeds, Tuning())
                | worlds.accelerations(world, seeds)
            )
            assert all(np.isfinite(value) for value in found.values())


def test_seeds_follow_from_the_place():
    assert worlds.seeds(worlds.DEFAULT | {"world": 7}) == worlds.seeds({**worlds.DEFAULT, "world": 7, "gain": 0.3})
    assert worlds.seeds(worlds.DEFAULT | {"world": 7}) != worlds.seeds(worlds.DEFAULT | {"world": 8})


def test_one_late_camera_is_that_of_the_telemetry(hours):
    from geokalman.attitude import hypotheses

    found = worlds.spreads(
        {**worlds.DEFAULT, "between-combinations": "sca2-late"}, worlds.seeds(worlds.DEFAULT), Tuning()
    )
    expected = hypotheses.spread(hypotheses.late(hours.raw["C"], [2]), Tuning())
    np.testing.assert_allclose([found[f"spread.{axis}"] for axis in AXES], expected, rtol=0.02)
