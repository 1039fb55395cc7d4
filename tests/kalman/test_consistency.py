"""The judges of a filter, judged: honest on a right model, accusing on a wrong one, equal on one and two workers."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor

import numpy as np
import pytest
from scipy.stats import chi2

from geokalman.kalman import (
    Model,
    NotPositiveDefinite,
    Sensor,
    chi_square_bounds,
    gaussian,
    monte_carlo,
    nees,
    nis,
    run,
    smooth,
    white_jerk,
    whiteness,
)

EPOCHS, Q_TRUE = 80, 1e-6


def simulate_and_filter(rng: np.random.Generator, q: float = Q_TRUE):
    """One run of a two-axis white-jerk motion with gaps: NEES of filter and smoother, whitened innovations."""
    t, n = 10.0 * np.arange(EPOCHS), 6
    Phi, Q = white_jerk(10.0, Q_TRUE, 2)
    prior = gaussian(np.zeros(n), np.repeat([25.0, 1.0, 1e-2], 2))
    R = np.array([[1.0, 0.3], [0.3, 0.5]])
    truth = np.empty((EPOCHS, n))
    truth[0] = np.sqrt(np.diag(prior.cov)) * rng.standard_normal(n)
    for k in range(1, EPOCHS):
        truth[k] = Phi @ truth[k - 1] + np.linalg.cholesky(Q) @ rng.standard_normal(n)
    z = truth[:, :2] + rng.standard_normal((EPOCHS, 2)) @ np.linalg.cholesky(R).T
    z[rng.random((EPOCHS, 2)) < 0.1] = np.nan
    F, Q = white_jerk(10.0, q, 2)
    course = run(prior, t, Model(F=F, Q=Q), [Sensor(z, R, H=np.eye(2, n))])
    smoothed = smooth(course)
    return nees(course.mean - truth, course.cov), nees(smoothed.mean - truth, smoothed.cov), course.whitened


def too_quiet(rng: np.random.Generator):
    return simulate_and_filter(rng, q=Q_TRUE / 10)


@pytest.fixture(scope="module")
def ensemble():
    return monte_carlo(simulate_and_filter, range(100, 140))


def test_right_model_is_found_honest(ensemble):
    """Runs are independent, so the mean over 40 runs at one epoch is chi-square; and so is NIS over all epochs of all
    runs."""
    filtered, smoothed, whitened = (np.array(part) for part in zip(*ensemble, strict=True))
    for values in (filtered, smoothed):
        for epoch in (0, 20, 79):
            low, high = chi_square_bounds(np.full(40, 6), 0.999)
            assert low < values[:, epoch].mean() < high
    values, dof = nis(whitened)
    low, high = chi_square_bounds(dof.ravel(), 0.999)
    assert low < values.sum() / (dof > 0).sum() < high
    p_values = [whiteness(w, 10).p_value for w in whitened]
    assert 0.2 < np.mean(p_values) < 0.8 and min(p_values) > 1e-4


def test_wrong_process_noise_is_found_out():
    filtered, _, whitened = (np.array(part) for part in zip(*monte_carlo(too_quiet, range(100, 120)), strict=True))
    _, high = chi_square_bounds(np.full(20, 6), 0.999)
    assert filtered[:, 40].mean() > high
    values, dof = nis(whitened)
    _, high = chi_square_bounds(dof.ravel(), 0.999)
    assert values.sum() / (dof > 0).sum() > high
    assert np.median([whiteness(w, 10).p_value for w in whitened]) < 1e-3


def test_workers_do_not_change_results(ensemble):
    with ProcessPoolExecutor(2) as two:
        parallel = monte_carlo(simulate_and_filter, range(100, 104), two)
    with ThreadPoolExecutor(1) as one:
        serial = monte_carlo(simulate_and_filter, iter([100, 101, 102, 103]), one)
    for i in range(4):
        for a, b, c in zip(ensemble[i], parallel[i], serial[i], strict=True):
            assert np.array_equal(a, b, equal_nan=True) and np.array_equal(a, c, equal_nan=True)


def failing(rng):
    raise NotPositiveDefinite("innovation covariance", 7)


def test_an_error_in_a_worker_arrives_whole():
    with ProcessPoolExecutor(1) as pool, pytest.raises(NotPositiveDefinite, match="epoch 7") as error:
        monte_carlo(failing, [1], pool)
    assert error.value.epoch == 7


def test_run_i_uses_seed_i():
    draws = monte_carlo(lambda rng: rng.standard_normal(), range(5, 8))
    assert draws == [np.random.default_rng(seed).standard_normal() for seed in (5, 6, 7)]


def test_nees_is_the_quadratic_form():
    rng = np.random.default_rng(3)
    e, A = rng.standard_normal((2, 5, 3)), rng.standard_normal((2, 5, 3, 3))
    P = A @ A.transpose(0, 1, 3, 2) + np.eye(3)
    scale = np.array([1e-9, 1.0, 1e9])
    expected = np.einsum("abi,abij,abj->ab", e, np.linalg.inv(P), e)
    np.testing.assert_allclose(nees(e * scale, P * scale[:, None] * scale), expected, rtol=1e-12)
    assert nees([3.0, 4.0], np.diag([9.0, 4.0])) == pytest.approx(5.0)


def test_nis_counts_what_is_there():
    values, dof = nis([[1.0, 2.0], [np.nan, 3.0], [np.nan, np.nan]])
    assert np.array_equal(values, [5.0, 9.0, 0.0]) and np.array_equal(dof, [2, 1, 0])


def test_bounds_are_the_quantiles():
    assert chi_square_bounds(3) == pytest.approx(tuple(chi2.ppf([0.025, 0.975], 3)))
    dof = [2, 0, 1, 2]
    assert chi_square_bounds(dof, 0.99) == pytest.approx(tuple(chi2.ppf([0.005, 0.995], 5) / 3))


def test_whiteness_is_ljung_box():
    from statsmodels.stats.diagnostic import acorr_ljungbox
    from statsmodels.tsa.stattools import acf

    rng = np.random.default_rng(4)
    w = np.convolve(rng.standard_normal(400), [1.0, 0.15], "valid")
    w -= w.mean()  # statsmodels takes the mean off, which we know to be zero
    theirs = acorr_ljungbox(w, lags=[8])
    ours = whiteness(w[:, None], 8)
    np.testing.assert_allclose(
        ours.autocorrelation[:, 0] * (1 - np.arange(1, 9) / len(w)), acf(w, nlags=8)[1:], atol=1e-13
    )
    assert ours.statistic == pytest.approx(theirs["lb_stat"].iloc[0], rel=1e-12)
    assert ours.dof == 8
    assert ours.p_value == pytest.approx(chi2.sf(ours.statistic, 8), rel=1e-10)
    both = whiteness(np.column_stack([w, w]), 8)
    assert both.dof == 16 and both.statistic == pytest.approx(2 * ours.statistic, rel=1e-12)


def test_whiteness_with_gaps_keeps_its_size():
    """Under whiteness p-values are uniform, with every third value missing too."""
    p_values = []
    for seed in range(200):
        w = np.random.default_rng(seed).standard_normal((120, 1))
        w[2::3] = np.nan
        p_values.append(whiteness(w, 4).p_value)
    assert 0.40 < np.mean(p_values) < 0.60  # 4.9 standard errors
    assert 0.01 <= np.mean(np.array(p_values) < 0.05) < 0.12


def test_wrong_input_is_named():
    for call, message in [
        (lambda: nees(np.ones((4, 2)), np.ones((4, 3, 3))), r"cov has the shape \(4, 3, 3\), for errors \(4, 2\)"),
        (lambda: nees([np.nan], [[1.0]]), r"error\[0, 0\] is nan"),
        (lambda: nees(np.ones((2, 1)), [[[1.0]], [[-1.0]]]), "covariance is not positive definite at epoch 1"),
        (lambda: chi_square_bounds([0, 0]), "no degree of freedom"),
        (lambda: chi_square_bounds(3, 1.0), "probability = 1.0: it must lie between 0 and 1"),
        (lambda: whiteness(np.ones((5, 1)), 5), "lags = 5 with 5 epochs"),
        (lambda: whiteness([[1.0], [np.nan], [1.0], [np.nan]], 1), "component 0 has no pair of values at lag 1"),
    ]:
        with pytest.raises(ValueError, match=message):
            call()
