"""The compiled steps on matrices of -1, 0 and 1, where a skipped product shows, against their formulas in NumPy; and on
an accurate observation of what is hardly known, against the posterior in 60 digits.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from geokalman.kalman import dense, gaussian
from geokalman.kalman.adaptive import innovation_step
from geokalman.kalman.information import (
    combine_step,
    information_back_step,
    information_noise_step,
    information_predict_step,
    information_state_step,
    information_update_step,
)
from geokalman.kalman.linear import observed_update_step, predict_step, scalar_update_step, update_step
from geokalman.kalman.robust import normal_step
from geokalman.kalman.smoothing import rts_mean_step, rts_step
from geokalman.kalman.whitening import whiten_columns

N, M = 4, 3
inverse = np.linalg.inv


@pytest.fixture(params=range(4))
def m(request) -> SimpleNamespace:
    """Small whole matrices: root of P (unit diagonal, so that P is positive definite), Phi, Q = G'G, H, R, x, z."""
    rng = np.random.default_rng(request.param)

    def whole(*shape: int) -> np.ndarray:
        return rng.integers(-1, 2, shape).astype(float)

    def root(n: int) -> np.ndarray:
        return np.eye(n) + np.triu(whole(n, n), 1)

    U, V, G, L = root(N), root(N), whole(N, N), root(M)
    return SimpleNamespace(
        U=U, P=U.T @ U, Y=V.T @ V, Phi=root(N)[::-1].copy(), G=G, Q=G.T @ G, H=whole(M, N), R=L.T @ L, L=L,
        x=whole(N), y=whole(N), z=2.0 * whole(M),
    )  # fmt: skip


def near(ours, wanted) -> None:
    """Equal to 1000 spacings of the largest number; the matrices are as harmless as that."""
    wanted = np.asarray(wanted, dtype=float)
    np.testing.assert_allclose(ours, wanted, rtol=0, atol=1000 * np.spacing(np.abs(wanted).max(initial=1.0)))


def posterior_of(m, seen=slice(None)):
    """Mean and covariance after z = H x + v, in information form; and the residual's covariance."""
    H, R, z = m.H[seen], m.R[seen][:, seen], m.z[seen]
    P = inverse(inverse(m.P) + H.T @ inverse(R) @ H)
    return P @ (inverse(m.P) @ m.x + H.T @ inverse(R) @ z), P, H @ m.P @ H.T + R


def test_triangular_kernels_are_exact_on_whole_numbers(m):
    U = np.full((N, N), np.nan)
    assert dense.cholesky_upper(m.P, U) == 0
    np.testing.assert_array_equal(U, m.U)
    wanted = np.column_stack([m.x, m.y])
    lower, upper = m.U.T @ wanted, m.U @ wanted
    dense.solve_lower(m.U, lower)
    dense.solve_upper(m.U, upper)
    np.testing.assert_array_equal(lower, wanted)
    np.testing.assert_array_equal(upper, wanted)


def test_a_semidefinite_matrix_has_its_root(m):
    """A rank below n takes the way with pivoting."""
    A = np.zeros((N + 1, N + 1))
    A[:-1, :-1] = m.Q
    G = np.full((N + 1, N + 1), np.nan)
    assert dense.root_semidefinite(A, G) == 0
    near(G.T @ G, A)


def test_prediction(m):
    x, P = np.empty(N), np.empty((N, N))
    predict_step(m.x, m.P, m.Phi, m.Q, x, P)
    np.testing.assert_array_equal(x, m.Phi @ m.x)
    np.testing.assert_array_equal(P, m.Phi @ m.P @ m.Phi.T + m.Q)


def test_joint_update(m):
    mean, cov, S_wanted = posterior_of(m)
    x, P, S, w = m.x.copy(), m.P.copy(), np.empty((M, M)), np.empty(M)
    assert update_step(x, P, m.z - m.H @ m.x, m.H, m.R, S, w) == 0
    near(x, mean), near(P, cov), near(S, S_wanted)
    whitened = np.linalg.solve(np.linalg.cholesky(S_wanted), m.z - m.H @ m.x)
    near(w, whitened)
    assert innovation_step(m.P, m.z - m.H @ m.x, m.H, m.R, S, w) == 0
    near(S, S_wanted), near(w, whitened)


@pytest.mark.parametrize("sequential", [True, False])
@pytest.mark.parametrize("seen", [[0, 1, 2], [0, 2], [1], []])
def test_update_with_components_missing(m, sequential, seen):
    z, x, P, w = np.full(M, np.nan), m.x.copy(), m.P.copy(), np.zeros(M)
    z[seen] = m.z[seen]
    assert observed_update_step(x, P, z, m.H, m.R, sequential, w) == 0
    mean, cov, S = posterior_of(m, seen)
    near(x, mean), near(P, cov)
    near(w[seen], np.linalg.solve(np.linalg.cholesky(S), m.z[seen] - m.H[seen] @ m.x))
    assert np.isnan(np.delete(w, seen)).all()


def test_least_squares(m):
    A, p = np.vstack([m.Phi, m.H]), np.array([1.0, 2.0, 0.5, 1.0, 4.0, 1.0, 0.25])
    z, x, U = np.r_[m.x, m.z], np.empty(N), np.empty((N, N))
    assert normal_step(A, z, p, x, U) == 0
    near(x, np.linalg.solve(A.T @ (p[:, None] * A), A.T @ (p * z)))
    near(U.T @ U, A.T @ (p[:, None] * A))


def test_information(m):
    """Each step against the same in covariances."""
    y, Y = m.y.copy(), m.Y.copy()
    assert information_update_step(y, Y, m.z, m.H, m.R) == 0
    near(Y, m.Y + m.H.T @ inverse(m.R) @ m.H), near(y, m.y + m.H.T @ inverse(m.R) @ m.z)
    noisy = inverse(inverse(m.Y) + m.Q)
    y, Y = m.y.copy(), m.Y.copy()
    information_noise_step(y, Y, m.G)
    near(Y, noisy), near(y, noisy @ inverse(m.Y) @ m.y)
    y, Y = m.y.copy(), m.Y.copy()
    information_back_step(y, Y, m.Phi, m.G)
    near(Y, m.Phi.T @ noisy @ m.Phi), near(y, m.Phi.T @ noisy @ inverse(m.Y) @ m.y)
    y, Y = m.y.copy(), m.Y.copy()
    information_predict_step(y, Y, inverse(m.Phi), m.G)
    ahead = inverse(m.Phi @ inverse(m.Y) @ m.Phi.T + m.Q)
    near(Y, ahead), near(y, ahead @ m.Phi @ inverse(m.Y) @ m.y)
    x, P = np.empty(N), np.empty((N, N))
    assert combine_step(m.x, m.P, m.y, m.Y, x, P) == 0
    near(P, inverse(inverse(m.P) + m.Y)), near(x, m.x + P @ m.y)
    assert information_state_step(m.y, m.Y, x, P) == 0
    near(P, inverse(m.Y)), near(x, P @ m.y)


def test_smoother_step(m):
    ahead = m.Phi @ m.P @ m.Phi.T + m.Q
    C = m.P @ m.Phi.T @ inverse(ahead)
    later, P_later = m.Phi @ m.x + m.y, m.Y
    x, P = np.empty(N), np.empty((N, N))
    assert rts_step(m.x, m.P, m.Phi @ m.x, ahead, m.Phi, m.Q, later, P_later, x, P) == 0
    near(x, m.x + C @ m.y), near(P, m.P + C @ (P_later - ahead) @ C.T)
    assert rts_mean_step(m.x, m.P, m.Phi @ m.x, ahead, m.Phi, later, x) == 0
    near(x, m.x + C @ m.y)


def test_whitened_columns(m):
    """W'W = A' C^-1 A, C the covariance of the three observations."""
    h, r = m.H, 2.0
    ahead = [np.eye(N), m.Phi, m.Phi @ m.Phi]
    states = [m.P, m.Phi @ m.P @ m.Phi.T + m.Q]
    states.append(m.Phi @ states[1] @ m.Phi.T + m.Q)
    C = np.array(
        [
            [h[i] @ (ahead[i - j] @ states[j] if i >= j else states[i] @ ahead[j - i].T) @ h[j] for j in range(3)]
            for i in range(3)
        ]
    )
    A = np.column_stack([m.z, np.ones(3)])
    W = whiten_columns(m.P, np.arange(3.0), h[:, None], np.array([[r]]), (m.Phi, m.Q), A)
    near(W.T @ W, A.T @ inverse(C + r * np.eye(3)) @ A)


@pytest.mark.parametrize("H", [[[1, 0]], [[0, -1]], [[1, 0], [0, 1]], [[1, 0], [1, 1]], [[1, 1], [1, -1]]])
def test_an_accurate_observation_of_what_is_hardly_known(posterior, close, H):
    """Standard deviations of 1e5 and 1e4 before, 1e-5 after: P - K H P leaves no digit, the Joseph form nine."""
    H, prior = np.array(H, dtype=float), gaussian([1.0, 2.0], [1e10, 1e8])
    k, none = len(H), np.empty((0, 2, 2))
    z, R = H @ [3.0, -4.0], 1e-10 * np.eye(len(H))
    mean, cov = posterior(z[None], H[None], R[None], none, none, prior)
    x, P = prior.mean.copy(), prior.cov.copy()
    assert update_step(x, P, z - H @ x, H, R, np.empty((k, k)), np.empty(k)) == 0
    close(x, P, mean[0], cov[0], 1e-6)
    if k == 1:
        x, P = prior.mean.copy(), prior.cov.copy()
        assert scalar_update_step(x, P, (z - H @ x)[0], H[0], 1e-10) > 1e7
        close(x, P, mean[0], cov[0], 1e-6)
