"""The three methods against the numbers of the specification, at the scales of the paper and of a quick run."""

from __future__ import annotations

import numpy as np
import pytest

from geokalman.grace import assess, estimate, observables
from geokalman.grace.model import Tuning, distance

TIGHT = Tuning.from_densities(30.0, 1e-6, 1e-3, 1e-6)


def residual(rate, flight):
    return assess.statistics(assess.range_rate_residual(rate, flight.orbit))


def test_ekf_row_at_degree_70(mid, mid_ekf):
    """Section 8, g03 MID; what is rounded in 6.1 and 6.2 to its tolerance."""
    smoothed, filtered = residual(mid_ekf.smoothed.rate, mid), residual(mid_ekf.filtered.rate, mid)
    assert smoothed.std == pytest.approx(7.469e-7, rel=0.01)
    assert smoothed.min == pytest.approx(-7.39e-6, rel=0.03)
    assert smoothed.max == pytest.approx(7.61e-6, rel=0.03)
    assert abs(smoothed.mean) < 1e-9
    assert filtered.mean == pytest.approx(5.883e-4, rel=0.02)
    assert filtered.std == pytest.approx(6.74e-4, rel=0.02)


def test_ekf_row_at_degree_30(quick):
    assert residual(estimate.ekf(quick.data, Tuning()).smoothed.rate, quick).std == pytest.approx(3.195e-8, rel=0.01)


@pytest.mark.parametrize(
    ("lambda_q", "rate", "los"),
    [
        (1500, 11.36, 0.86),
        (3000, 8.37, 2.40),
        (4000, 7.60, 2.93),
        (4500, 7.35, 3.11),
        (5000, 7.14, 3.25),
        (6000, 6.83, 3.47),
        (8000, 6.45, 3.75),
        (1e5, 5.37, 4.53),
    ],
)
def test_curve_of_weights(mid, lambda_q, rate, los):
    """Table of section 6.2, 1e-7 m/s within 1 %, 1e-8 m/s^2 within its last digit."""
    smoothed = estimate.ekf(mid.data, Tuning(lambda_q=float(lambda_q))).smoothed
    assert residual(smoothed.rate, mid).std == pytest.approx(1e-7 * rate, rel=0.01)
    exact = observables.exact(mid.orbit, mid.gravity)
    assert assess.statistics(smoothed.los - exact).std == pytest.approx(1e-8 * los, abs=0.006e-8)


def test_bias_of_the_smoothed_acceleration(mid, mid_ekf):
    """Section 6.5: -4.8e-10 m/s^2, the quintic spline's error of the once-per-revolution motion."""
    exact = observables.exact(mid.orbit, mid.gravity)
    assert assess.statistics(mid_ekf.smoothed.los - exact).mean == pytest.approx(-4.8e-10, rel=0.05)


def test_ukf_row_at_degree_70(mid, mid_ukf):
    smoothed, filtered = residual(mid_ukf.smoothed.rate, mid), residual(mid_ukf.filtered.rate, mid)
    assert smoothed.std == pytest.approx(5.368e-7, rel=0.01)
    assert smoothed.min == pytest.approx(-5.582e-6, rel=0.03)
    assert smoothed.max == pytest.approx(5.489e-6, rel=0.03)
    assert filtered.mean == pytest.approx(2.190e-4, rel=0.02)


def test_ukf_row_at_degree_30(quick):
    assert residual(estimate.ukf(quick.data, Tuning()).smoothed.rate, quick).std == pytest.approx(2.862e-8, rel=0.01)


def test_extended_and_unscented_filter_agree_on_the_same_data(mid, mid_ukf):
    """max |UKF - EKF| < 1e-9 m/s: the gain is the observation's, not the transform's."""
    fused = estimate.fused_ekf(mid.data, Tuning())
    assert np.abs(fused.smoothed.rate - mid_ukf.smoothed.rate)[100:-100].max() < 1e-9


@pytest.mark.parametrize(
    ("sigma", "rate", "los"),
    [
        (1e-5, 2.2e-9, 1.10),
        (3e-5, 2.0e-8, 1.02),
        (5e-5, 5.1e-8, 0.89),
        (7e-5, 9.3e-8, 0.75),
        (1e-4, 1.66e-7, 0.67),
        (2e-4, 3.86e-7, 1.42),
        (3e-4, 5.20e-7, 2.07),
    ],
)
def test_residual_can_be_dialled(mid, sigma, rate, los):
    """Table of section 6.3, to its last digit."""
    tuning = Tuning.from_densities(30.0, Tuning(lambda_q=4500.0).q(30.0), 1e-3, sigma)
    smoothed = estimate.ukf(mid.data, tuning).smoothed
    assert residual(smoothed.rate, mid).std == pytest.approx(rate, rel=0.03)
    exact = observables.exact(mid.orbit, mid.gravity)
    assert assess.statistics(smoothed.los - exact).std == pytest.approx(1e-8 * los, abs=0.006e-8)


def test_tight_weights_reproduce_the_datum(mid):
    """Section 8: residual below 1e-10 m/s with q = 1e-6, 1e-6 m/s; 6.4: extended and unscented agree to 1e-12."""
    series = {name: getattr(estimate, name)(mid.data, TIGHT).smoothed for name in ("ukf", "fused_ekf")}
    for smoothed in series.values():
        assert np.abs(assess.range_rate_residual(smoothed.rate, mid.orbit))[100:-100].max() < 1e-10
    assert np.abs(series["ukf"].rate - series["fused_ekf"].rate)[100:-100].max() < 1e-11


@pytest.mark.parametrize(("name", "mean", "std"), [("fused_ekf", 9.26e-6, 2.7e-7), ("ukf", 3.57e-6, 2.7e-7)])
def test_simultaneous_update_is_biased(mid, name, mean, std):
    """Section 6.4, 5 d, tight weights: the datum is linearised at a predicted state that is a metre off."""
    found = residual(getattr(estimate, name)(mid.data, TIGHT, "simultaneous").smoothed.rate, mid)
    assert found.mean == pytest.approx(mean, rel=0.03)
    assert found.std == pytest.approx(std, rel=0.03)


def test_simultaneous_update_at_the_default_weights(mid):
    """Section 8: mean 6.42e-7 (3 %); extended and unscented equal to 1e-10."""
    both = [getattr(estimate, name)(mid.data, Tuning(), "simultaneous").smoothed.rate for name in ("ukf", "fused_ekf")]
    assert residual(both[0], mid).mean == pytest.approx(6.42e-7, rel=0.03)
    assert residual(both[0], mid).std == pytest.approx(5.38e-7, rel=0.01)
    assert np.abs(both[0] - both[1])[100:-100].max() < 1e-9


def test_only_the_ratios_matter_without_noise(mid, mid_ukf):
    """sigma_r scales every covariance and no state, but for the prior and the second-order term."""
    scaled = estimate.ukf(mid.data, Tuning(sigma_r=1e-2))
    assert residual(scaled.smoothed.rate, mid).std == pytest.approx(residual(mid_ukf.smoothed.rate, mid).std, rel=1e-4)


def test_estimates_lie_near_the_truth(mid, mid_ukf):
    """Section 7: smoothed positions differ from the true ones by 4 to 6e-6 m."""
    error = distance(mid_ukf.smoothed.dr - mid.orbit.dr)[100:-100]
    assert 1e-6 < np.sqrt(np.mean(error**2)) < 1e-5
