"""Filtering on a manifold: on a vector space it is the linear filter and RTS, on rotations it is honest."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from geokalman.kalman import NotPositiveDefinite, filter_linear, smooth
from geokalman.kalman.manifold import (
    Manifold,
    error_predict_step,
    error_rts_step,
    error_update_step,
    filter_manifold,
    smooth_manifold,
)

VECTORS = Manifold(lambda x, d: x + d, lambda x, y: y - x)
ROTATIONS = Manifold(lambda x, d: x * Rotation.from_rotvec(d), lambda x, y: (x.inv() * y).as_rotvec())


def test_on_a_vector_space_it_is_the_linear_filter_and_smoother():
    rng = np.random.default_rng(3)
    Phi, Q = np.array([[1.0, 1.0], [0.0, 1.0]]), np.diag([0.01, 0.1])
    H, R = np.array([[1.0, 0.0]]), np.array([[0.5]])
    z = rng.standard_normal((30, 1))
    z[[4, 11, 12]] = np.nan
    prior = (np.array([0.3, -0.2]), np.array([[2.0, 0.1], [0.1, 1.0]]))
    course = filter_manifold(
        VECTORS,
        prior[0],
        prior[1],
        30,
        lambda k, x: (Phi @ x, Phi, Q),
        lambda k, x: None if np.isnan(z[k, 0]) else (z[k] - H @ x, H, R),
    )
    linear = filter_linear(prior, np.arange(30.0), z, H, R, (Phi, Q))
    np.testing.assert_allclose(np.array(course.state), linear.mean, atol=1e-12)
    np.testing.assert_allclose(course.cov, linear.cov, atol=1e-12)
    whitened = np.array([np.nan if w is None else w[0] for w in course.whitened])
    np.testing.assert_allclose(whitened, linear.whitened[:, 0], atol=1e-12)
    states, covs = smooth_manifold(VECTORS, course)
    smoothed = smooth(linear)
    np.testing.assert_allclose(np.array(states), smoothed.mean, atol=1e-11)
    np.testing.assert_allclose(covs, smoothed.cov, atol=1e-11)


@pytest.mark.parametrize("start_deg", [0.0, 100.0])
def test_rotations_are_estimated_honestly(start_deg):
    """A turning body seen with noise: normalised errors of filter and smoother average one per degree of freedom."""
    rng = np.random.default_rng(11)
    N, q, r = 400, 1e-3, 2e-2
    step = Rotation.from_rotvec([0.0, 0.05, 0.01])
    true = [Rotation.random(random_state=5)]
    for _ in range(N - 1):
        true.append(true[-1] * step * Rotation.from_rotvec(q * rng.standard_normal(3)))
    seen = [x * Rotation.from_rotvec(r * rng.standard_normal(3)) for x in true]
    start = true[0] * Rotation.from_rotvec(np.radians(start_deg) * np.array([0.6, 0.0, 0.8]))
    course = filter_manifold(
        ROTATIONS, start, (10.0 if start_deg else 0.01) * np.eye(3), N, lambda k, x: (x * step, step.as_matrix().T, q**2 * np.eye(3)),
        lambda k, x: ((x.inv() * seen[k]).as_rotvec(), np.eye(3), r**2 * np.eye(3)),
    )  # fmt: skip
    states, covs = smooth_manifold(ROTATIONS, course)
    for estimate, P in ((course.state, course.cov), (states, covs)):
        e = np.array([(x.inv() * y).as_rotvec() for x, y in zip(estimate, true, strict=True)])[20:]
        nees = np.einsum("ki,kij,kj->k", e, np.linalg.inv(P[20:]), e) / 3
        assert 0.75 < nees.mean() < 1.25
    assert np.trace(covs[200]) < np.trace(course.cov[200])


def test_steps_agree_uncompiled():
    P, A, Q = np.diag([1.0, 2.0]), np.array([[1.0, 0.5], [0.0, 1.0]]), 0.1 * np.eye(2)
    one, two = np.empty((2, 2)), np.empty((2, 2))
    error_predict_step(P, A, Q, one)
    getattr(error_predict_step, "py_func", error_predict_step)(P, A, Q, two)
    np.testing.assert_array_equal(one, two)
    np.testing.assert_allclose(one, A @ P @ A.T + Q)
    d, S, w = np.ones(2), np.empty((1, 1)), np.empty(1)
    assert error_update_step(one, np.array([0.3]), np.array([[1.0, 0.0]]), np.array([[0.2]]), d, S, w) == 0
    np.testing.assert_allclose(d, two[:, 0] * 0.3 / (two[0, 0] + 0.2))
    out, back = np.empty((2, 2)), np.empty(2)
    assert error_rts_step(P, two, A, Q, np.array([0.1, 0.2]), 0.5 * two, back, out) == 0
    C = P @ A.T @ np.linalg.inv(two)
    np.testing.assert_allclose(back, C @ [0.1, 0.2])
    np.testing.assert_allclose(out, P - 0.5 * C @ two @ C.T, atol=1e-12)


def test_bad_covariances_are_named():
    with pytest.raises(NotPositiveDefinite, match="innovation covariance is not positive definite at epoch 0"):
        filter_manifold(
            VECTORS,
            np.zeros(1),
            np.zeros((1, 1)),
            1,
            None,
            lambda k, x: (np.zeros(1), np.ones((1, 1)), np.zeros((1, 1))),
        )
    course = filter_manifold(
        VECTORS, np.zeros(1), np.zeros((1, 1)), 2, lambda k, x: (x, np.eye(1), np.zeros((1, 1))), lambda k, x: None
    )
    with pytest.raises(NotPositiveDefinite, match="predicted covariance is not positive definite at epoch 1"):
        smooth_manifold(VECTORS, course)
