"""Whitening by a Kalman filter: rows of a least-squares problem whose errors are a state-space process.

Where z = A b + e and e is the output of a linear model (prior, Phi, Q, H, R), the filter of that model turns z and
every
column of A into its whitened innovations. They have independent errors of unit variance, so that ordinary normal
equations
of the whitened rows give the best linear estimate of b, without the covariance of e ever being formed.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from geokalman.kalman.checks import NotPositiveDefinite, array, covariance, covariances, epochs, matrices
from geokalman.kalman.linear import Transition, predict_step, scalar_update_step, steps


@njit(cache=True)
def whitening_loop(
    P0: np.ndarray,
    H: np.ndarray,
    R: np.ndarray,
    Phi: np.ndarray,
    Q: np.ndarray,
    step: np.ndarray,
    columns: np.ndarray,
    out: np.ndarray,
) -> int:
    """Whitened innovations of many columns behind one filter of scalar observations with zero prior mean.

    P0 : (n, n); H : (N or 1, n); R : (N or 1,); Phi, Q : (K, n, n) chosen by step : (N - 1,); columns, out : (N, c).
    Returns -1, or the epoch at which the innovation covariance is not positive.
    """
    N, c = columns.shape
    n = P0.shape[0]
    P, P_next, x, unused = P0.copy(), np.empty((n, n)), np.zeros(n), np.zeros(n)
    X, moved, K = np.zeros((n, c)), np.empty((n, c)), np.empty(n)
    for k in range(N):
        if k > 0:
            s = step[k - 1]
            predict_step(x, P, Phi[s], Q[s], unused, P_next)
            P[:] = P_next
            moved[:] = 0.0
            for i in range(n):
                for j in range(n):
                    phi = Phi[s, i, j]
                    if phi != 0.0:
                        for q in range(c):
                            moved[i, q] += phi * X[j, q]
            X[:] = moved
        row = H[k] if H.shape[0] > 1 else H[0]
        K[:] = 0.0
        S = scalar_update_step(K, P, 1.0, row, R[k] if R.shape[0] > 1 else R[0])  # K is the gain: the state after z = 1
        if not S > 0.0:
            return k
        root = np.sqrt(S)
        for q in range(c):
            out[k, q] = columns[k, q]
        for j in range(n):
            if row[j] != 0.0:
                for q in range(c):
                    out[k, q] -= row[j] * X[j, q]
        for i in range(n):
            for q in range(c):
                X[i, q] += K[i] * out[k, q]
        for q in range(c):
            out[k, q] /= root
    return -1


def whiten_columns(P0, t, H, R, transition: Transition, columns) -> np.ndarray:
    """Whitened innovations (N, c) of columns (N, c) under a linear model with scalar observations and zero prior mean.

    W = C^(-1/2) A with C = cov(z) under the model and C^(-1/2) lower triangular, so W' W = A' C^-1 A.
    P0 : (n, n) prior covariance at t[0]; t : (N,) [s]; H : (1, n) or (N, 1, n); R : (1, 1) or (N, 1, 1); transition :
    (Phi, Q) or a function of the step; columns : (N, c), data and design alike.
    Raises ValueError for wrong shapes, NotPositiveDefinite with the epoch.
    Source: Rosenberg (1973), Annals of Economic and Social Measurement 2, 399-428; de Jong (1991), Annals of
    Statistics 19.

    >>> still = np.eye(1), np.zeros((1, 1))  # one unknown constant beside the noise
    >>> whiten_columns([[3.0]], [0.0, 1.0], [[1.0]], [[1.0]], still, [[2.0], [2.0]])[0].tolist()
    [1.0]
    """
    t = epochs(t)
    P = covariance("P0", P0)
    n = len(P)
    H, R = matrices("H", H, len(t), 1, n)[:, 0], covariances("R", R, len(t), 1)[:, 0, 0]
    Phi, Q, step = steps(transition, t, n)
    A = array("columns", columns, len(t), None)
    out = np.empty_like(A)
    epoch = whitening_loop(P, np.ascontiguousarray(H), np.ascontiguousarray(R), Phi, Q, step, A, out)
    if epoch >= 0:
        raise NotPositiveDefinite("innovation covariance", epoch, float(t[epoch]))
    return out
