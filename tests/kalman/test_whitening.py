"""Whitening of many columns against the filter itself and against the dense covariance of the observations."""

import numpy as np
import pytest

from geokalman.kalman.whitening import whiten_columns, whitening_loop


def model(rng, N=40, n=3):
    t = np.cumsum(rng.uniform(0.5, 1.5, N))
    Phi = np.eye(n) + 0.1 * rng.standard_normal((N - 1, n, n))
    G = rng.standard_normal((n, n))
    return t, np.diag([1.0, 2.0, 0.5]), rng.standard_normal((1, n)), np.array([[0.3]]), (Phi, 0.1 * G @ G.T)


def dense_covariance(P0, t, H, R, transition):
    Phi, Q = transition
    N, n = len(t), len(P0)
    states = np.zeros((N, n, N, n))
    P = P0
    for k in range(N):
        if k:
            P = Phi[k - 1] @ P @ Phi[k - 1].T + Q
        states[k, :, k] = P
        cross = P
        for j in range(k + 1, N):
            cross = Phi[j - 1] @ cross
            states[j, :, k] = cross
            states[k, :, j] = cross.T
    return np.einsum("a,iajb,b->ij", H[0], states, H[0]) + R[0, 0] * np.eye(N)


def test_columns_are_whitened_by_the_root_of_the_dense_covariance():
    rng = np.random.default_rng(3)
    t, P0, H, R, transition = model(rng)
    A = rng.standard_normal((len(t), 5))
    W = whiten_columns(P0, t, H, R, transition, A)
    C = dense_covariance(P0, t, H, R, transition)
    np.testing.assert_allclose(W, np.linalg.solve(np.linalg.cholesky(C), A), rtol=0, atol=1e-9)


def test_a_column_of_data_gives_the_whitened_innovations_of_the_filter(filter_linear):
    rng = np.random.default_rng(4)
    t, P0, H, R, transition = model(rng)
    z = rng.standard_normal(len(t))
    course = filter_linear((np.zeros(3), P0), t, z[:, None], H, R, transition)
    np.testing.assert_allclose(whiten_columns(P0, t, H, R, transition, z[:, None]), course.whitened, rtol=0, atol=1e-11)


def test_compiled_and_plain_loops_agree():
    rng = np.random.default_rng(5)
    t, P0, H, R, (Phi, Q) = model(rng, 8)
    A, out = rng.standard_normal((8, 2)), np.empty((8, 2))
    Qs = np.repeat(Q[None], 7, axis=0)
    plain = getattr(whitening_loop, "py_func", whitening_loop)
    assert plain(P0, H, R[0], Phi, Qs, np.arange(7), A, out) == -1
    np.testing.assert_allclose(out, whiten_columns(P0, t, H, R, (Phi, Q), A), rtol=0, atol=1e-13)


def test_a_model_without_noise_is_refused_with_its_epoch():
    t = np.arange(3.0)
    with pytest.raises(ValueError, match="innovation covariance is not positive definite at epoch 1"):
        whiten_columns([[1.0]], t, [[1.0]], [[0.0]], (np.eye(1), np.zeros((1, 1))), np.ones((3, 1)))
