"""The three methods under noise: consistency of the covariances, and the spline that a free jerk makes."""

from __future__ import annotations

import numba
import numpy as np
import pytest
from scipy.interpolate import make_interp_spline
from scipy.stats import chi2

from geokalman import kalman
from geokalman.grace import estimate
from geokalman.grace.model import Observations, Tuning, kinematic, range_rate


def white_jerk_truth(seed: int, n: int = 40):
    """A truth that moves as the filter thinks: white jerk, a prior drawn from N(mean, P0), positions and rates with
    noise."""
    rng, tuning = np.random.default_rng(seed), Tuning.from_densities(30.0, 1e-11, 0.02, 3e-6)
    Phi, Q = kinematic(30.0, tuning.q(30.0))
    mean = np.r_[1.2e5, -1.5e5, 9e4, 30.0, 40.0, -20.0, 0.02, 0.03, -0.01]
    P0 = np.diag(np.repeat([1e-4, 1e-6, 1e-8], 3))
    scale = np.sqrt(np.diag(Q))
    root = scale[:, None] * np.linalg.cholesky(Q / np.outer(scale, scale))
    x = np.empty((n, 9))
    x[0] = mean + np.sqrt(np.diag(P0)) * rng.standard_normal(9)
    for k in range(1, n):
        x[k] = Phi @ x[k - 1] + root @ rng.standard_normal(9)
    baseline = x[:, :3] + 0.02 * rng.standard_normal((n, 3))
    rate = range_rate(x[:, :3], x[:, 3:6]) + 3e-6 * rng.standard_normal(n)
    return x, Observations(30.0, baseline, rate, mean, P0), tuning


@pytest.mark.parametrize("name", ["ekf", "ukf", "fused_ekf"])
def test_covariances_are_honest(name):
    """NEES of filter and smoother and NIS of the innovations inside the 99.9 % chi-square bounds; innovations are
    white."""
    runs = 12 if numba.config.DISABLE_JIT else 60
    filtered, smoothed, innovations = [], [], []
    for seed in range(runs):
        x, data, tuning = white_jerk_truth(seed)
        found = getattr(estimate, name)(data, tuning, covariances=True)
        filtered.append(kalman.nees(found.filtered.x[-1] - x[-1], found.filtered.P[-1]))
        smoothed.append(kalman.nees(found.smoothed.x[20] - x[20], found.smoothed.P[20]))
        innovations.append(found.innovations)
    low, high = kalman.chi_square_bounds(np.full(runs, 9), 0.999)
    assert low < np.mean(filtered) < high
    assert low < np.mean(smoothed) < high
    values, dof = kalman.nis(np.concatenate(innovations))
    assert dof.max() == (3 if name == "ekf" else 4)
    low, high = kalman.chi_square_bounds(dof, 0.999)
    assert low < values.mean() < high
    columns = slice(0, 3) if name == "ekf" else slice(0, 4)
    p = [kalman.whiteness(one[:, columns], 5).p_value for one in innovations]
    assert chi2.sf(-2 * np.sum(np.log(p)), 2 * runs) > 1e-3  # Fisher's combination of the runs


def test_filters_on_a_wrong_noise_are_found_out():
    """The same test must fail where the filter believes half the noise."""
    values = []
    for seed in range(10):
        _, data, tuning = white_jerk_truth(seed)
        wrong = Tuning.from_densities(30.0, tuning.q(30.0), 0.01, 3e-6)
        values.append(estimate.ukf(data, wrong).innovations)
    found, dof = kalman.nis(np.concatenate(values))
    assert found.mean() > kalman.chi_square_bounds(dof, 0.999)[1]


# --- smoother and spline ---------------------------------------------------------------------------------------------


def test_smoother_with_a_free_jerk_is_the_quintic_spline():
    """Section 8: lambda_q = 1e8 on one axis; interior rates agree within 2 % of the spline's own error."""
    n, dt = 400, 30.0
    t = dt * np.arange(n)
    series = 2.2e5 + 800 * np.sin(2 * np.pi * t / 5626) + 0.05 * np.sin(2 * np.pi * 40 * t / 5626 + 1.0)
    slope = 2 * np.pi / 5626 * (800 * np.cos(2 * np.pi * t / 5626) + 2.0 * np.cos(2 * np.pi * 40 * t / 5626 + 1.0))
    baseline = np.column_stack([series, np.zeros(n), np.zeros(n)])
    prior = np.r_[series[0], 0, 0, slope[0], np.zeros(5)]
    data = Observations(dt, baseline, np.full(n, np.nan), prior, np.diag(np.repeat([1.0, 1.0, 1.0], 3)))
    ours = estimate.ekf(data, Tuning(lambda_q=1e8)).smoothed.x[:, 3]
    spline = make_interp_spline(t, series, k=5).derivative()(t)
    inside = slice(60, -60)
    assert np.abs(ours - spline)[inside].max() < 0.02 * np.abs(spline - slope)[inside].max()
