"""Adaptive factors: their definitions, that they do nothing to a right prediction, what they save of a wrong one."""

import numpy as np
import pytest
from scipy.stats import chi2

from geokalman.kalman import adaptive, gaussian, robust
from geokalman.kalman.linear import predict, update


def three(V, S, R, w):
    return adaptive.three_part(adaptive.predicted_residual(w), 1.5, 2.5, 1e-3)


@pytest.fixture
def epoch():
    rng = np.random.default_rng(5)
    root = rng.standard_normal((4, 4))
    prior = gaussian(rng.standard_normal(4), root @ root.T + np.eye(4))
    H, R = rng.standard_normal((5, 4)), np.diag(rng.uniform(0.5, 4.0, 5))
    return prior, H, R, H @ prior.mean + rng.standard_normal(5)


def test_innovation_and_its_covariance(epoch):
    prior, H, R, z = epoch
    V, S, white = z - H @ prior.mean, np.empty((5, 5)), np.empty(5)
    assert adaptive.innovation_step(prior.cov, V, H, R, S, white) == 0
    np.testing.assert_allclose(S, H @ prior.cov @ H.T + R, rtol=1e-13)
    assert white @ white == pytest.approx(V @ np.linalg.solve(S, V), rel=1e-12)
    assert adaptive.predicted_residual(white) == pytest.approx(np.sqrt(V @ np.linalg.solve(S, V) / 5))
    assert adaptive.innovation_step(-10 * prior.cov, V, H, R, S, white) > 0


@pytest.mark.parametrize(
    ("s", "factor"), [(0.0, 1.0), (1.5, 1.0), (-1.5, 1.0), (2.0, 0.75 * 0.25), (2.5, 1e-3), (9.0, 1e-3)]
)
def test_three_part_factor(s, factor):
    assert adaptive.three_part(s, 1.5, 2.5, 1e-3) == pytest.approx(factor)


def test_two_part_factor():
    assert adaptive.two_part(1.5, 1.5, 1e-3) == 1.0
    assert adaptive.two_part(3.0, 1.5, 1e-3) == pytest.approx(0.5)
    assert adaptive.two_part(1e9, 1.5, 1e-3) == 1e-3


def test_ratio_factor_makes_the_sums_agree(epoch):
    prior, H, R, _ = epoch
    S = H @ prior.cov @ H.T + R
    r = np.diag(R)
    V = 5.0 * np.sqrt(np.diag(S))
    alpha = adaptive.ratio_factor(V, S, R, 1e-3)
    predicted = np.diag(H @ (prior.cov / alpha) @ H.T + R) / r
    assert (V**2 / r).sum() == pytest.approx(predicted.sum())
    assert adaptive.ratio_factor(0.1 * V, S, R, 1e-3) == 1.0
    assert adaptive.ratio_factor(1e9 * V, S, R, 1e-3) == 1e-3


def test_unweighted_forms_hear_the_worst_observation_alone():
    """Two ranges, one good to 1 m and 50 sigmas off, one good to 10 km: only the weighted factor notices."""
    R, S = np.diag([1.0, 1e8]), np.diag([2.0, 1e8 + 1.0])
    V = np.array([70.0, 0.0])
    assert adaptive.ratio_factor(V, S, R, 1e-3) < 1e-2
    assert adaptive.trace_factor(V, S, R, 1e-3) == 1.0
    assert adaptive.norm_ratio(V, S) < 0.01
    assert adaptive.trace_factor(np.array([0.0, 3e4]), S, R, 1e-3) == 1e-3


def test_state_discrepancy_is_the_whitened_difference(epoch):
    prior, H, R, z = epoch
    x, U = np.empty(4), np.empty((4, 4))
    assert robust.normal_step(H, z, 1.0 / np.diag(R), x, U) == 0
    A = H.T @ np.linalg.inv(R) @ H
    np.testing.assert_allclose(x, np.linalg.solve(A, H.T @ np.linalg.solve(R, z)), rtol=1e-10)
    d = x - prior.mean
    expected = d @ np.linalg.solve(prior.cov + np.linalg.inv(A), d) / 4
    assert adaptive.state_discrepancy(d, prior.cov, U) == pytest.approx(np.sqrt(expected), rel=1e-10)
    assert np.isnan(adaptive.state_discrepancy(d, -100 * prior.cov, U))


def test_adaptive_update_is_the_update_where_the_prediction_is_right(epoch):
    prior, H, R, z = epoch
    posterior, innovation, alpha = adaptive.adaptive_update(prior, z, H, R, three)
    plain, expected = update(prior, z, H, R)
    assert alpha == 1.0
    np.testing.assert_allclose(posterior.mean, plain.mean, rtol=1e-12)
    np.testing.assert_allclose(posterior.cov, plain.cov, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(innovation.S, expected.S, rtol=1e-12)


def test_adaptive_update_divides_the_prior_by_alpha(epoch):
    prior, H, R, z = epoch
    posterior, innovation, alpha = adaptive.adaptive_update(prior, z, H, R, lambda V, S, R, w: 0.25)
    wide, _ = update(gaussian(prior.mean, prior.cov / 0.25), z, H, R)
    assert alpha == 0.25
    np.testing.assert_allclose(posterior.mean, wide.mean, rtol=1e-11)
    np.testing.assert_allclose(posterior.cov, wide.cov, rtol=1e-11, atol=1e-14)
    np.testing.assert_allclose(innovation.S, H @ prior.cov @ H.T + R, rtol=1e-12)  # before the division


def test_a_gap_leaves_the_prior(epoch):
    prior, H, R, z = epoch
    posterior, innovation, alpha = adaptive.adaptive_update(prior, np.full(5, np.nan), H, R, three)
    assert alpha == 1.0 and np.isnan(innovation.whitened).all()
    np.testing.assert_array_equal(posterior.mean, prior.mean)
    partly = z.copy()
    partly[[0, 3]] = np.nan
    keep = [1, 2, 4]
    one, _, _ = adaptive.adaptive_update(prior, partly, H, R, three)
    other, _, _ = adaptive.adaptive_update(prior, z[keep], H[keep], R[np.ix_(keep, keep)], three)
    np.testing.assert_allclose(one.mean, other.mean, rtol=1e-12)


@pytest.mark.parametrize("alpha", [0.0, -1.0, 1.5, np.nan])
def test_a_factor_outside_its_range_is_refused(epoch, alpha):
    prior, H, R, z = epoch
    with pytest.raises(ValueError, match="above 0 and at most 1"):
        adaptive.adaptive_update(prior, z, H, R, lambda V, S, R, w: alpha)


@pytest.mark.parametrize(("dof", "rate"), [(7, 0.028), (3, 0.080)])
def test_false_alarms_on_clean_data(dof, rate):
    """What the module says about 1.5: the share of good epochs on which its factor falls below one, drawn and exact."""
    white = np.random.default_rng(11).standard_normal((60_000, dof))
    fired = np.mean([adaptive.three_part(adaptive.predicted_residual(w), 1.5, 2.5, 1e-3) < 1.0 for w in white])
    assert fired == pytest.approx(chi2.sf(1.5**2 * dof, dof), abs=0.0035)  # three binomial standard deviations
    assert fired == pytest.approx(rate, abs=0.0035)


def drift(adapt: bool, process: float) -> float:
    """RMS error of a scalar random walk of step 1 observed with noise 1 by a filter that believes `process`."""
    rng = np.random.default_rng(3)
    state, truth, errors = gaussian([0.0], [[1.0]]), 0.0, []
    for _ in range(1500):
        truth += rng.standard_normal()
        state = predict(state, [[1.0]], [[process**2]])
        z = [truth + rng.standard_normal()]
        if adapt:
            state, _, _ = adaptive.adaptive_update(state, z, [[1.0]], [[1.0]], three)
        else:
            state, _ = update(state, z, [[1.0]], [[1.0]])
        errors.append(state.mean[0] - truth)
    return float(np.sqrt(np.mean(np.square(errors))))


def test_what_adaptation_costs_and_saves():
    assert drift(True, 0.01) < 0.5 * drift(False, 0.01)  # a process noise far too small
    assert drift(False, 1.0) <= drift(True, 1.0) < 1.15 * drift(False, 1.0)  # the right one: a little is lost
    assert drift(False, 1.0) < drift(True, 0.01)  # and the right noise beats adaptation


def test_factors_by_hand():
    """Residuals 3 and 1, variances S 4 and 2, R 1 and 1/2: weighted sums 11 and 6, plain sums 10, 6 and 1.5."""
    V, S, R = np.array([3.0, 1.0]), np.diag([4.0, 2.0]), np.diag([1.0, 0.5])
    assert adaptive.ratio_factor(V, S, R, 0.1) == pytest.approx(6.0 / 9.0)
    assert adaptive.trace_factor(V, S, R, 0.1) == pytest.approx(4.5 / 8.5)
    assert adaptive.ratio_factor(V, S, R, 0.7) == adaptive.trace_factor(V, S, R, 0.7) == 0.7
    assert adaptive.norm_ratio(V, S) == pytest.approx(np.sqrt(10.0 / 6.0))
    assert adaptive.predicted_residual(V) == pytest.approx(np.sqrt(5.0))
    assert adaptive.two_part(-3.0, 1.5, 0.1) == 0.5 and adaptive.two_part(3.0, 1.5, 0.6) == 0.6
