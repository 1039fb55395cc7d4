"""Fixed-interval smoothing by Rauch, Tung and Striebel (1965); `information` has the two-filter form of the same.

On a manifold the error lives in a tangent space, R^n: the smoother estimates it again from the next epoch, and a
retraction puts it into the state (Lefferts, Markley & Shuster 1982, J. Guidance 5(5), 417-429).
"""

from __future__ import annotations

import functools

import numpy as np
from numba import njit, types

from geokalman.kalman.checks import NotPositiveDefinite
from geokalman.kalman.dense import cholesky_upper, copy_state, solve_lower, solve_upper
from geokalman.kalman.gaussian import Smoothed, Trajectory
from geokalman.kalman.model import DIFFERENCE, RETRACT


@njit(cache=True)
def rts_mean_step(
    x: np.ndarray,
    P: np.ndarray,
    x_predicted: np.ndarray,
    P_predicted: np.ndarray,
    Phi: np.ndarray,
    x_next: np.ndarray,
    x_out: np.ndarray,
) -> int:
    """One backward step of the RTS smoother, mean only:  x_out = x + P Phi' P_predicted^-1 (x_next - x_predicted).

    x, P : filtered at this epoch; x_predicted, P_predicted : predicted for the next one through Phi; x_next : smoothed
    there; vectors (n,), matrices (n, n). x_out may be x.
    Returns 0, or k >= 1 when P_predicted is not positive definite in row k - 1.
    """
    n = x.shape[0]
    U = np.empty((n, n))
    status = cholesky_upper(P_predicted, U)
    if status != 0:
        return status
    b = np.empty((n, 1))
    for j in range(n):
        b[j, 0] = x_next[j] - x_predicted[j]
    solve_lower(U, b)
    solve_upper(U, b)
    back = np.zeros(n)
    for i in range(n):
        for j in range(n):
            back[j] += Phi[i, j] * b[i, 0]
    for j in range(n):
        x_out[j] = x[j]
    for i in range(n):
        for j in range(n):
            x_out[j] += P[i, j] * back[i]
    return 0


@njit(cache=True)
def rts_step(
    x: np.ndarray,
    P: np.ndarray,
    x_predicted: np.ndarray,
    P_predicted: np.ndarray,
    Phi: np.ndarray,
    Q: np.ndarray,
    x_next: np.ndarray,
    P_next: np.ndarray,
    x_out: np.ndarray,
    P_out: np.ndarray,
) -> int:
    """One backward step of the RTS smoother; its covariance is a sum of squares, so it stays symmetric and positive.

    C = P Phi' P_predicted^-1,  x_out = x + C (x_next - x_predicted),
    P_out = (I - C Phi) P (I - C Phi)' + C (Q + P_next) C',  which equals P + C (P_next - P_predicted) C'.
    x, P : filtered at this epoch; x_predicted, P_predicted : predicted for the next one through Phi, Q; x_next, P_next
    :
    smoothed there; vectors (n,), matrices (n, n). The outputs must not overlap P, Phi, Q, P_next; x_out may be x.
    Returns 0, or k >= 1 when P_predicted is not positive definite in row k - 1.
    """
    n = x.shape[0]
    U = np.empty((n, n))
    status = cholesky_upper(P_predicted, U)
    if status != 0:
        return status
    C = np.zeros((n, n))  # C' = P_predicted^-1 Phi P
    for i in range(n):
        for k in range(n):
            phi = Phi[i, k]
            if phi != 0.0:
                for j in range(n):
                    C[i, j] += phi * P[k, j]
    solve_lower(U, C)
    solve_upper(U, C)
    for j in range(n):
        x_out[j] = x[j]
    for i in range(n):
        step = x_next[i] - x_predicted[i]
        for j in range(n):
            x_out[j] += C[i, j] * step
    A = np.zeros((n, n))  # (I - C Phi)'
    for i in range(n):
        A[i, i] = 1.0
        for k in range(n):
            phi = Phi[k, i]
            if phi != 0.0:
                for j in range(n):
                    A[i, j] -= phi * C[k, j]
    for i in range(n):
        for j in range(n):
            P_out[i, j] = 0.0
            U[i, j] = Q[i, j] + P_next[i, j]
    _add_congruence(P, A, P_out)
    _add_congruence(U, C, P_out)
    for i in range(n):
        for j in range(i):
            P_out[i, j] = P_out[j, i]
    return 0


@njit(cache=True)
def _add_congruence(M: np.ndarray, B: np.ndarray, out: np.ndarray) -> None:
    """Add B' M B to the upper triangle of out; all (n, n), M symmetric."""
    n = M.shape[0]
    row = np.empty(n)
    for i in range(n):
        for j in range(n):
            row[j] = 0.0
        for k in range(n):
            for j in range(n):
                row[j] += M[i, k] * B[k, j]
        for k in range(n):
            for j in range(k, n):
                out[k, j] += B[i, k] * row[j]


@njit(cache=True)
def rts_loop(
    mean: np.ndarray,
    cov: np.ndarray,
    predicted_mean: np.ndarray,
    predicted_cov: np.ndarray,
    Phi: np.ndarray,
    Q: np.ndarray,
    step: np.ndarray,
    x_out: np.ndarray,
    P_out: np.ndarray,
) -> tuple[int, int]:
    """Smooth N epochs backward: arrays as in a `Trajectory`, Phi, Q : (K, n, n) chosen by step : (N - 1,).

    Outputs x_out : (N, n) and P_out : (N, n, n), or (0, n, n) where no covariances are wanted. Returns (epoch, status)
    of the first predicted covariance that is not positive definite, or (-1, 0).
    """
    last = mean.shape[0] - 1
    for j in range(mean.shape[1]):
        x_out[last, j] = mean[last, j]
    if P_out.shape[0] > 0:
        copy_state(mean[last], cov[last], x_out[last], P_out[last])
    for k in range(last - 1, -1, -1):
        x, P, s = mean[k], cov[k], step[k]
        x_next, P_next = predicted_mean[k + 1], predicted_cov[k + 1]
        if P_out.shape[0] > 0:
            status = rts_step(x, P, x_next, P_next, Phi[s], Q[s], x_out[k + 1], P_out[k + 1], x_out[k], P_out[k])
        else:
            status = rts_mean_step(x, P, x_next, P_next, Phi[s], x_out[k + 1], x_out[k])
        if status != 0:
            return k + 1, status
    return -1, 0


def error_rts_loop(retract, difference, mean, cov, predicted_mean, predicted_cov, Phi, Q, step, x_out, P_out):
    """Smooth N epochs backward: d = C (x_next [-] predicted), C = P Phi' P_predicted^-1, x_out = mean [+] d.

    Arrays as in `rts_loop`, with states (N, nx) and errors of n components; outputs x_out : (N, nx) and
    P_out : (N, n, n). Returns (epoch, status) of the first predicted covariance without a root, or (-1, 0).
    """
    last, n = mean.shape[0] - 1, cov.shape[1]
    copy_state(mean[last], cov[last], x_out[last], P_out[last])
    zero, d_next, d = np.zeros(n), np.empty(n), np.empty(n)
    for k in range(last - 1, -1, -1):
        s = step[k]
        difference(predicted_mean[k + 1], x_out[k + 1], d_next)
        status = rts_step(zero, cov[k], zero, predicted_cov[k + 1], Phi[s], Q[s], d_next, P_out[k + 1], d, P_out[k])
        if status != 0:
            return k + 1, status
        retract(mean[k], d, x_out[k])
    return -1, 0


@functools.cache
def compiled_error_rts_loop():
    """The loop as machine code."""
    table, stack = types.float64[:, ::1], types.float64[:, :, ::1]
    signature = types.UniTuple(types.int64, 2)(
        types.FunctionType(RETRACT), types.FunctionType(DIFFERENCE), table, stack, table, stack, stack, stack,
        types.int64[::1], table, stack,
    )  # fmt: skip
    return njit([signature], cache=True, nogil=True)(error_rts_loop)


def smooth(course: Trajectory, covariances: bool = True) -> Smoothed:
    """Rauch-Tung-Striebel smoother of a filtered trajectory, linear, extended or unscented.

    C = P Phi' (P_predicted)^-1,  mean = x + C (mean_next - x_predicted),
    cov = (I - C Phi) P (I - C Phi)' + C (Q + cov_next) C'.
    course : the Trajectory of `run`; covariances : smooth them too (without them, None in the result,
    it takes a quarter of the time).
    Returns the Smoothed states. Raises NotPositiveDefinite with the epoch of a predicted covariance without full rank.
    Source: Rauch, Tung and Striebel (1965), AIAA J. 3, 1445-1450; for sigma points Sarkka (2008).

    >>> from geokalman.kalman import Model, Sensor, gaussian, run
    >>> walk, sensor = Model(F=[[1.0]], Q=[[1.0]]), Sensor([[1.0], [np.nan], [3.0]], [[1.0]], H=[[1.0]])
    >>> smooth(run(gaussian([0.0], [1e6]), [0.0, 1.0, 2.0], walk, [sensor])).mean[1].round(3).tolist()
    [2.0]
    """
    flat = course.manifold is None
    mean, cov = np.empty_like(course.mean), np.empty_like(course.cov[: None if covariances or not flat else 0])
    arrays = (
        course.mean, course.cov, course.predicted_mean, course.predicted_cov, course.transition, course.process_noise,
        course.step, mean, cov,
    )  # fmt: skip
    if flat:
        epoch, status = rts_loop(*arrays)
    else:
        loop = compiled_error_rts_loop() if course.manifold.compiled else error_rts_loop
        epoch, status = loop(*course.manifold.kernels(), *arrays)
    if status != 0:
        detail = f"its Cholesky pivot {status - 1} is not positive"
        raise NotPositiveDefinite("predicted covariance", epoch, float(course.t[epoch]), detail)
    return Smoothed(course.t, mean, cov if covariances else None)
