"""The pair: motion against Hill's closed forms, statistics of what is drawn, and filters that are honest on it."""

from __future__ import annotations

import numpy as np
import pytest

from geokalman.kalman import chi_square_bounds, nees, nis, run, smooth, van_loan, whiteness
from geokalman.pair import estimate, simulate
from geokalman.pair.model import Scenario, Tuning, along_the_line, in_the_plane

QUIET = Scenario(sigma_a=0.0)


def rng(seed: int = 1) -> np.random.Generator:
    return np.random.default_rng(seed)


def test_the_undisturbed_pair_breathes():
    truth = simulate.on_the_line(QUIET, rng())
    swing = QUIET.n * truth.t + QUIET.phase
    np.testing.assert_allclose(truth.range, 400.0 * np.cos(swing), atol=1e-9)
    np.testing.assert_allclose(truth.rate, -400.0 * QUIET.n * np.sin(swing), atol=1e-12)


def test_the_undisturbed_plane_is_hills_ellipse():
    truth = simulate.in_plane(QUIET, rng())
    swing = QUIET.n * truth.t + QUIET.phase
    np.testing.assert_allclose(truth.x[:, 0], 200.0 * np.sin(swing), atol=1e-6)
    np.testing.assert_allclose(truth.x[:, 1], 220e3 + 400.0 * np.cos(swing), atol=1e-6)
    np.testing.assert_allclose(truth.rate, np.gradient(truth.range, truth.t, edge_order=2), atol=1e-3)


def test_the_acceleration_is_stationary():
    scenario = Scenario(duration=3e6)
    a = simulate.on_the_line(scenario, rng()).x[:, 2]
    assert np.std(a) == pytest.approx(scenario.sigma_a, rel=0.05)
    lag = round(scenario.tau / scenario.step)
    assert np.mean(a[lag:] * a[:-lag]) / np.var(a) == pytest.approx(np.exp(-1.0), abs=0.05)


@pytest.mark.parametrize(
    "dynamics", [along_the_line(1e-3, 1e-6, 600.0), in_the_plane(1e-3, 1e-9)], ids=["line", "plane"]
)
def test_steps_have_the_covariance_of_their_model(dynamics):
    Phi, Q = van_loan(*dynamics, 30.0)
    walk = simulate._walk(np.zeros(len(Q)), np.arange(40001.0), Phi, Q, rng())
    w = walk.x[1:] - walk.x[:-1] @ Phi.T
    scale = np.sqrt(np.diag(Q))
    np.testing.assert_allclose(np.cov((w / scale).T), Q / scale[:, None] / scale, atol=0.03)


def test_observations_have_the_noise_that_is_stated():
    scenario = Scenario(duration=3e5, range_bias=5.0, rate_bias=1e-3, gnss_step=60.0)
    truth = simulate.on_the_line(scenario, rng())
    data = simulate.observe(truth, scenario, rng(2))
    assert np.isnan(data.gnss[1::2]).all() and np.isfinite(data.gnss[::2]).all()
    assert np.nanstd(data.gnss[:, 0] - truth.range) == pytest.approx(0.02, rel=0.05)
    assert np.std(data.rate[:, 0] - truth.rate) == pytest.approx(1e-6, rel=0.05)
    assert np.std(data.range[:, 0] - truth.range) == pytest.approx(1e-4, rel=0.05)
    assert np.mean(data.range[:, 0] - truth.range) == pytest.approx(5.0, abs=1e-5)
    assert np.mean(data.rate[:, 0] - truth.rate) == pytest.approx(1e-3, abs=1e-7)


def test_outliers_are_as_many_and_as_loud_as_stated():
    scenario = Scenario(duration=3e5, outliers=0.1)
    truth = simulate.on_the_line(scenario, rng())
    loud, quiet = (simulate.observe(truth, s, rng(2)).gnss - truth.x[:, :1] for s in (scenario, Scenario(duration=3e5)))
    ratio = np.round(loud / quiet)
    assert set(np.unique(ratio)) == {1.0, 20.0}
    assert np.mean(ratio == 20.0) == pytest.approx(0.1, abs=0.01)


def test_what_is_observed_in_the_plane():
    scenario = Scenario(separation=1000.0)
    truth = simulate.in_plane(scenario, rng())
    data = simulate.observe(truth, scenario, rng(2))
    assert data.gnss.shape == (len(truth.t), 2) and len(data.prior.mean) == 4
    np.testing.assert_allclose(data.range[:, 0], np.linalg.norm(truth.x[:, :2], axis=1), atol=6e-4)
    np.testing.assert_allclose(data.rate[:, 0], truth.rate, atol=6e-6)


@pytest.mark.parametrize("which", [("gnss",), ("gnss", "rate"), ("gnss", "rate", "range")])
def test_the_filter_that_assumes_what_is_true_is_honest(which):
    scenario, values, dofs, squares = Scenario(duration=3600.0), [], [], []
    for seed in range(40):
        stream = rng(seed)
        truth = simulate.on_the_line(scenario, stream)
        data = simulate.observe(truth, scenario, stream)
        course = run(data.prior, data.t, estimate.dynamic(Tuning()), estimate.sensors(data, Tuning(), which))
        squares.append(nees(course.mean[-1] - truth.x[-1], course.cov[-1]))
        smoothed = smooth(course)
        squares.append(nees(smoothed.mean[60] - truth.x[60], smoothed.cov[60]))
        value, dof = nis(course.whitened)
        values.append(value)
        dofs.append(dof)
    low, high = chi_square_bounds(np.concatenate(dofs), 0.999)
    assert low < np.concatenate(values).mean() < high
    low, high = chi_square_bounds([3] * len(squares), 0.999)
    assert low < np.mean(squares) < high
    assert whiteness(course.whitened, 10).p_value > 1e-3


def test_the_kinematic_filter_follows_the_breathing():
    scenario, stream = Scenario(), rng(3)
    truth = simulate.on_the_line(scenario, stream)
    data = simulate.observe(truth, scenario, stream)
    course = run(data.prior, data.t, estimate.kinematic(Tuning()), estimate.sensors(data, Tuning()))
    assert np.abs(course.mean[20:, 1] - truth.rate[20:]).max() < 1e-5


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"step": 0.0}, "step = 0: it must be positive"),
        ({"tau": float("nan")}, "tau = nan is not finite"),
        ({"outliers": 2.0}, "outliers = 2: the first"),
        ({"duration": 10.0}, "duration = 10 s is shorter than one step"),
        ({"gnss_step": 45.0}, "step = 30 s does not divide gnss_step = 45 s"),
    ],
)
def test_a_scenario_that_is_none_says_so(given, message):
    with pytest.raises(ValueError, match=message):
        Scenario(**given)


def test_an_unknown_instrument_is_named():
    data = simulate.observe(simulate.on_the_line(QUIET, rng()), QUIET, rng())
    with pytest.raises(ValueError, match="'laser' is no instrument"):
        estimate.sensors(data, Tuning(), ["laser"])
