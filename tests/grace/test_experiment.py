"""Other settings, consistency and tuning: against closed forms and scaling laws."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from geokalman.grace import assess, estimate, experiment, observables, simulate
from geokalman.grace.differentiate import noise_gain
from geokalman.grace.model import Tuning


def test_white_noise_adds_by_the_gain_of_the_formula(quick):
    """The variance of Newton's residual is that of truncation plus that of the noise, sqrt(2) sigma gain / h."""
    sigma = 5e-6
    clean = experiment.setting(quick.scenario, quick.gravity, Tuning())["newton"].std
    noisy = experiment.setting(quick.scenario, quick.gravity, Tuning(), sigma, 7)["newton"].std
    added = np.sqrt(2) * sigma * noise_gain(9, 1) / quick.scenario.dt
    assert noisy == pytest.approx(np.hypot(clean, added), rel=0.02)


def test_a_higher_orbit_leaves_less(quick):
    """By upward continuation: the highest degree loses (1 + dh / a)^(n + 2) over the rise dh."""
    risen = replace(quick.scenario, a=quick.scenario.a + 22.8e3)
    low = experiment.setting(quick.scenario, quick.gravity, Tuning())["newton"].std
    high = experiment.setting(risen, quick.gravity, Tuning())["newton"].std
    damping = (1 + 22.8e3 / quick.scenario.a) ** -(quick.gravity.n_max + 2)
    assert damping * 0.9 < high / low < 1.0


def test_consistency_scales_with_the_covariances(quick):
    """With Q and R a hundred times larger the states stay, and every mean square is a hundred times smaller."""
    orbit = quick.orbit.first(0.5)
    data = simulate.observe(orbit, quick.gravity)
    data = replace(data, prior_cov=data.prior_cov * 1e2)
    one = experiment.consistency(orbit, quick.gravity, data, Tuning(sigma_r=1e-3))
    ten = experiment.consistency(orbit, quick.gravity, data, Tuning(sigma_r=1e-2))
    for name in ("ekf", "ukf"):
        np.testing.assert_allclose(np.array(ten[name]) * 1e2, np.array(one[name]), rtol=1e-3)


def test_consistency_is_of_the_filter(quick):
    """The NIS of positions alone, from the covariances of the predictions."""
    orbit = quick.orbit.first(0.5)
    data = simulate.observe(orbit, quick.gravity)
    innovations = estimate.ekf(data, Tuning()).innovations[100:-100, :3]
    found = experiment.consistency(orbit, quick.gravity, data, Tuning())["ekf"]
    assert found.nis == pytest.approx((innovations**2).mean(), rel=1e-12)
    assert found.nees > 100 and found.smoothed < 1e-3


def test_tuned_takes_the_smallest_error_of_the_grid(quick):
    orbit = quick.orbit.first(0.5)
    data, exact = simulate.observe(orbit, quick.gravity), observables.exact(orbit, quick.gravity)
    found = experiment.tuned(data, exact, (1500.0, 1e5), (1.0, 9.0))
    errors = {
        (weight, mu): assess.statistics(
            estimate.ukf(data, Tuning(lambda_q=weight, mu=mu)).smoothed.los - exact, 100
        ).std
        for weight in (1500.0, 1e5)
        for mu in (1.0, 9.0)
    }
    assert (found["ukf"].lambda_q, found["ukf"].mu) == min(errors, key=errors.get)
    assert found["ukf"].los_std == pytest.approx(min(errors.values()))
    assert found["ekf"].lambda_q == 1500.0  # best for accelerations, not for range-rates
