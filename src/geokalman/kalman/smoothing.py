"""Fixed-interval smoothing by Rauch, Tung and Striebel (1965).

On a manifold the error lives in a tangent space, R^n: the smoother estimates it again from the next epoch, and a
retraction puts it into the state (Lefferts, Markley & Shuster 1982, J. Guidance 5(5), 417-429).
"""

from __future__ import annotations

import functools

import numpy as np
from numba import njit, types

from geokalman.kalman.checks import NotPositiveDefinite
from geokalman.kalman.dense import (
    add_product, add_vector_product, cholesky_upper, copy, copy_state, copy_vector, identity, mirror, solve_lower,
    solve_upper, transposed,
)  # fmt: skip
from geokalman.kalman.gaussian import Smoothed, Trajectory
from geokalman.kalman.model import DIFFERENCE, RETRACT


@njit(cache=True)
def rts_mean_step(x, P, x_predicted, P_predicted, Phi, x_next, x_out):
    """Smooth the mean of one epoch:  x_out = x + P Phi' P_predicted^-1 (x_next - x_predicted).

    x, P : filtered at this epoch; x_predicted, P_predicted : predicted for the next one through Phi; x_next : smoothed
    there; vectors (n,), matrices (n, n). x_out may be x.
    Returns 0, or k >= 1 when P_predicted is not positive definite in row k - 1.
    """
    U, d, back = np.empty(P.shape), x_next - x_predicted, np.zeros(x.size)
    status = cholesky_upper(P_predicted, U)
    if status != 0:
        return status
    solve_lower(U, d.reshape((d.size, 1)))
    solve_upper(U, d.reshape((d.size, 1)))
    add_vector_product(back, 1.0, d, Phi)
    copy_vector(x, x_out)
    add_vector_product(x_out, 1.0, back, P)
    return 0


@njit(cache=True)
def rts_step(x, P, x_predicted, P_predicted, Phi, Q, x_next, P_next, x_out, P_out):
    """Smooth one epoch; its covariance is a sum of squares, symmetric and positive.

    C = P Phi' P_predicted^-1,  x_out = x + C (x_next - x_predicted),
    P_out = (I - C Phi) P (I - C Phi)' + C (Q + P_next) C',  which equals P + C (P_next - P_predicted) C'.
    Q, P_next : (n, n), the noise of the step and the smoothed covariance of the next epoch; else as `rts_mean_step`.
    The covariance P_out must not overlap the inputs.
    """
    U, C, A = np.empty(P.shape), np.zeros(P.shape), identity(x.size)
    status = cholesky_upper(P_predicted, U)
    if status != 0:
        return status
    add_product(C, 1.0, Phi, P)  # C' = P_predicted^-1 Phi P
    solve_lower(U, C)
    solve_upper(U, C)
    add_product(A, -1.0, transposed(Phi), C)  # (I - C Phi)'
    d = x_next - x_predicted
    copy_vector(x, x_out)
    add_vector_product(x_out, 1.0, d, C)
    W, V = np.zeros(P.shape), np.zeros(P.shape)
    add_product(W, 1.0, P, A)
    add_product(V, 1.0, Q + P_next, C)
    P_out.fill(0.0)
    add_product(P_out, 1.0, transposed(A), W)
    add_product(P_out, 1.0, transposed(C), V)
    mirror(P_out)
    return 0


@njit(cache=True)
def rts_loop(mean, cov, predicted_mean, predicted_cov, Phi, Q, step, x_out, P_out):
    """Smooth N epochs backward.

    Arrays as in a `Trajectory`, Phi, Q : (K, n, n) chosen by step : (N - 1,).
    Outputs x_out : (N, n) and P_out : (N, n, n), or (0, n, n) where no covariances are wanted. Returns (epoch, status)
    of the first predicted covariance that is not positive definite, or (-1, 0).
    """
    last = mean.shape[0] - 1
    copy_vector(mean[last], x_out[last])
    if P_out.shape[0] > 0:
        copy(cov[last], P_out[last])
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
    """Smooth N epochs on a manifold backward.

    d = C (x_next [-] predicted),  C = P Phi' P_predicted^-1,  x_out = mean [+] d.
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
    """Compile the loop, once."""
    table, stack = types.float64[:, ::1], types.float64[:, :, ::1]
    signature = types.UniTuple(types.int64, 2)(
        types.FunctionType(RETRACT), types.FunctionType(DIFFERENCE), table, stack, table, stack, stack, stack,
        types.int64[::1], table, stack,
    )  # fmt: skip
    return njit([signature], cache=True, nogil=True)(error_rts_loop)


def smooth(course: Trajectory, covariances: bool = True) -> Smoothed:
    """Smooth a filtered trajectory by Rauch, Tung and Striebel.

    C = P Phi' (P_predicted)^-1,  mean = x + C (mean_next - x_predicted),
    cov = (I - C Phi) P (I - C Phi)' + C (Q + cov_next) C'.
    course : the Trajectory of `run`; covariances : smooth them too (a quarter of the time without).
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
        epoch, status = loop(*course.manifold.kernels(mean.shape[1]), *arrays)
    if status != 0:
        detail = f"its Cholesky pivot {status - 1} is not positive"
        raise NotPositiveDefinite("predicted covariance", epoch, float(course.t[epoch]), detail)
    return Smoothed(course.t, mean, cov if covariances else None)
