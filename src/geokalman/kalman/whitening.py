"""Whitening, by a Kalman filter, of least squares whose errors are a state-space process.

Where z = A b + e and e is the output of a linear model (prior, Phi, Q, H, R), the filter of that model turns z and
every column of A into its whitened innovations. They have independent errors of unit variance, so that ordinary normal
equations of the whitened rows give the best linear estimate of b, without the covariance of e ever being formed.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from geokalman.kalman.checks import NotPositiveDefinite, array, covariance, covariances, epochs, matrices
from geokalman.kalman.dense import add_product, copy, copy_vector
from geokalman.kalman.linear import Transition, predict_step, scalar_update_step, steps


@njit(cache=True)
def whitening_loop(P0, H, R, Phi, Q, step, columns, out):
    """Whiten many columns by one filter of scalar observations with zero prior mean.

    P0 : (n, n); H : (N or 1, n); R : (N or 1,); Phi, Q : (K, n, n) chosen by step : (N - 1,);
    columns, out : (N, c). Returns -1, or the epoch at which the innovation covariance is not positive.
    """
    N, c = columns.shape
    n = P0.shape[0]
    P, P_next, zero, K = P0.copy(), np.empty((n, n)), np.zeros(n), np.empty(n)
    X, X_next = np.zeros((n, c)), np.empty((n, c))
    for k in range(N):
        if k > 0:
            s = step[k - 1]
            predict_step(zero, P, Phi[s], Q[s], K, P_next)
            copy(P_next, P)
            X_next.fill(0.0)
            add_product(X_next, 1.0, Phi[s], X)
            copy(X_next, X)
        row, own = H[k % H.shape[0]], out[k]
        K.fill(0.0)
        S = scalar_update_step(K, P, 1.0, row, R[k % R.shape[0]])  # K is the gain: the state after z = 1
        if not S > 0.0:
            return k
        copy_vector(columns[k], own)
        add_product(own.reshape((1, c)), -1.0, row.reshape((1, n)), X)
        add_product(X, 1.0, K.reshape((n, 1)), own.reshape((1, c)))
        for q in range(c):
            own[q] /= np.sqrt(S)
    return -1


def whiten_columns(P0, t, H, R, transition: Transition, columns) -> np.ndarray:
    """Whiten columns (N, c) by a linear model with scalar observations and zero prior mean.

    Their whitened innovations are W = C^(-1/2) A with C = cov(z) under the model and C^(-1/2) lower triangular, so that
    W' W = A' C^-1 A.
    P0 : (n, n) prior covariance at t[0]; t : (N,) [s]; H : (1, n) or (N, 1, n); R : (1, 1) or (N, 1, 1); transition :
    (Phi, Q) or a function of the step; columns : (N, c), data and design alike.
    Raises ValueError for wrong shapes, NotPositiveDefinite with the epoch.
    Source: Rosenberg (1973), Ann. Econ. Soc. Meas. 2, 399-428; de Jong (1991), Annals of Statistics 19.

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
