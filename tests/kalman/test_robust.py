"""Robust weights: their definitions, their cost on clean data, what they save on dirty data, and where they cannot."""

import numpy as np
import pytest

from geokalman.kalman import Adaptive, Model, Sensor, gaussian, robust, run
from geokalman.kalman.gaussian import Innovation
from geokalman.kalman.linear import update


def weighted(prior, z, H, R, k0=3.0, k1=8.0):
    """One epoch by `run` with IGG-III weights of the innovations: the course."""
    n = len(prior.mean)
    hook = Adaptive(by="innovations", k0=k0, k1=k1)
    return run(prior, [0.0], Model(F=np.eye(n), Q=np.eye(n)), [Sensor(z[None], R, H=H)], adaptive=hook)


@pytest.mark.parametrize(("s", "weight"), [(0.0, 1.0), (1.5, 1.0), (-2.0, 0.75 * 0.25), (2.5, 0.0), (99.0, 0.0)])
def test_igg3(s, weight):
    assert robust.igg3(s, 1.5, 2.5) == pytest.approx(weight)


def test_igg3_is_continuous_at_both_thresholds():
    for edge in (1.5, 2.5):
        assert robust.igg3(edge - 1e-9, 1.5, 2.5) == pytest.approx(robust.igg3(edge + 1e-9, 1.5, 2.5), abs=1e-8)


def test_huber():
    assert robust.huber(-1.0, 1.5) == 1.0
    assert robust.huber(3.0, 1.5) == 0.5


@pytest.fixture
def epoch():
    rng = np.random.default_rng(8)
    root = rng.standard_normal((3, 3))
    prior = gaussian(rng.standard_normal(3), root @ root.T + np.eye(3))
    H, R = rng.standard_normal((6, 3)), np.diag(rng.uniform(0.5, 2.0, 6))
    return prior, H, R, H @ prior.mean + 0.3 * rng.standard_normal(6)


def test_clean_data_are_not_touched(epoch):
    prior, H, R, z = epoch
    course, (plain, _) = weighted(prior, z, H, R), update(prior, z, H, R)
    np.testing.assert_array_equal(course.weights, 1.0)
    np.testing.assert_allclose(course.mean[0], plain.mean, rtol=1e-12)
    np.testing.assert_allclose(course.cov[0], plain.cov, rtol=1e-12, atol=1e-14)


def test_an_outlier_is_left_out(epoch):
    prior, H, R, z = epoch
    bad = z.copy()
    bad[2] += 1e3
    course = weighted(prior, bad, H, R)
    missing = z.copy()
    missing[2] = np.nan
    without, _ = update(prior, missing, H, R)
    assert course.weights[0, 2] == robust.FLOOR
    np.testing.assert_allclose(course.mean[0], without.mean, atol=1e-4)
    gaps = weighted(prior, missing, H, R).weights[0]
    assert np.isnan(gaps[2]) and (gaps[[0, 1, 3, 4, 5]] == 1.0).all()


def test_hubers_weights_where_k1_is_infinite(epoch):
    prior, H, R, z = epoch
    bad = z.copy()
    bad[0] += 40.0
    s = (bad[0] - H[0] @ prior.mean) / np.sqrt(H[0] @ prior.cov @ H[0] + R[0, 0])
    assert weighted(prior, bad, H, R, 1.5, np.inf).weights[0, 0] == pytest.approx(1.5 / abs(s))


@pytest.mark.parametrize(("k0", "k1"), [(2.5, 1.5), (1.5, 1.5), (0.0, 1.0), (-1.0, 2.0), (np.nan, 2.0)])
def test_thresholds_out_of_order_are_refused(epoch, k0, k1):
    prior, H, R, z = epoch
    with pytest.raises(ValueError, match="k0 below k1"):
        weighted(prior, z, H, R, k0, k1)


def test_equivalent_weights_find_an_outlier_that_redundancy_shows():
    rng = np.random.default_rng(2)
    N = rng.standard_normal((12, 3))
    z = N @ [1.0, -2.0, 3.0] + 0.01 * rng.standard_normal(12)
    z[4] += 0.1
    x, U, w = np.empty(3), np.empty((3, 3)), np.empty(12)
    assert robust.equivalent_weights_step(N, z, np.full(12, 1e-4), 1.5, 2.5, 8, x, U, w) == 0
    assert w[4] == robust.FLOOR
    assert np.abs(x - [1.0, -2.0, 3.0]).max() < 0.02


def test_no_redundancy_leaves_all_weights_at_one():
    N, z = np.array([[1.0, 0, 0], [1.0, 1.0, 0], [0, 1.0, 1.0]]), np.array([1.0, 2.0, 1e6])
    x, U, w = np.empty(3), np.empty((3, 3)), np.empty(3)
    assert robust.equivalent_weights_step(N, z, np.ones(3), 1.5, 2.5, 4, x, U, w) == 0
    np.testing.assert_array_equal(w, 1.0)
    np.testing.assert_allclose(N @ x, z, atol=1e-9)


@pytest.mark.parametrize(
    "rows", [[[1.0, 0, 0]], [[1.0, 0, 0], [0, 1.0, 0]], [[1.0, 1e-9, 0], [1.0, 0, 0], [1.0, 2e-9, 0]]]
)
def test_a_singular_design_is_told_not_inverted(rows):
    N = np.array(rows)
    x, U = np.empty(3), np.empty((3, 3))
    assert robust.normal_step(N, np.ones(len(N)), np.ones(len(N)), x, U) > 0
    with pytest.raises(ValueError, match="undetermined"):
        robust.redundancy_numbers(N, np.ones(len(N)))


def test_redundancy_numbers_are_the_diagonal_of_the_residual_projector():
    rng = np.random.default_rng(4)
    N, variance = rng.standard_normal((7, 3)), rng.uniform(0.1, 5.0, 7)
    W = np.diag(1.0 / variance)
    expected = 1.0 - np.diag(N @ np.linalg.inv(N.T @ W @ N) @ N.T @ W)
    found = robust.redundancy_numbers(N, variance)
    np.testing.assert_allclose(found, expected, rtol=1e-10)
    assert found.sum() == pytest.approx(4.0)


def test_variances_must_be_positive():
    with pytest.raises(ValueError, match=r"variance\[1\]"):
        robust.redundancy_numbers(np.eye(3), np.array([1.0, 0.0, 1.0]))


def test_gate():
    good = Innovation(np.zeros(3), np.eye(3), np.array([1.0, -1.0, np.nan]))
    assert robust.gate(good)
    assert not robust.gate(good._replace(whitened=np.array([4.0, -3.0, np.nan])))
    assert robust.gate(good._replace(whitened=np.full(3, np.nan)))
    with pytest.raises(ValueError, match="between 0 and 1"):
        robust.gate(good, 1.0)


def test_the_cost_on_clean_data_is_what_the_module_says():
    """Variance of a weighted mean of Gaussian data over that of the plain mean."""
    x = np.random.default_rng(1).standard_normal(1_000_000)
    for k0, k1, cost in ((1.5, np.inf, 1.04), (1.5, 2.5, 1.44), (3.0, 8.0, 1.01)):
        w = np.minimum(1.0, k0 / np.maximum(np.abs(x), 1e-12))
        if np.isfinite(k1):
            t = np.clip((k1 - np.abs(x)) / (k1 - k0), 0.0, 1.0)
            w = np.where(np.abs(x) <= k0, 1.0, w * t**2)
        influence = w * x
        slope = (x * influence).mean()  # Stein: mean derivative of the influence function
        assert (influence**2).mean() / slope**2 == pytest.approx(cost, abs=0.01)
