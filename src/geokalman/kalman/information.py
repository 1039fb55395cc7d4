"""Smoothing by two filters in information form, of past and future; equal to RTS.

The information form needs no prior: zeros say that nothing is known (a diffuse prior). `smooth_two_filter` joins the
covariance filter forward with an information filter backward, `smooth_information` runs both in information form.

The information vector is cov^-1 mean: with coordinates of 1e5 m known to a millimetre its rounding alone moves the mean
by thousandths of a sigma. The loops therefore work on deviations from a nominal trajectory x*, for which
dx_(k+1) = Phi dx_k + u_k + w with the known u_k = Phi x*_k - x*_(k+1), and z - H x* for z.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from geokalman.kalman.checks import NotPositiveDefinite, array, covariance, covariances, epochs, matrices, plain
from geokalman.kalman.dense import (
    cholesky_upper, copy, copy_state, copy_vector, identity, root_semidefinite, solve_lower, solve_upper, symmetrise,
)  # fmt: skip
from geokalman.kalman.gaussian import Information, Smoothed, Trajectory
from geokalman.kalman.linear import Transition, rows_seen, steps


@njit(cache=True)
def information_update_step(y, Y, z, H, R):
    """Add the information of the seen components of z = H x + v, v ~ N(0, R), in place.

    Y += H' R^-1 H,   y += H' R^-1 z.
    y : (n,); Y : (n, n); z : (m,); H : (m, n); R : (m, m).
    Returns 0, or k >= 1 where R is not positive definite in observed component k - 1.
    """
    seen, values, rows, U = rows_seen(z, H, R)
    if seen.size == 0:
        return 0
    status = cholesky_upper(U, U)
    if status != 0:
        return status
    solve_lower(U, rows)
    solve_lower(U, values.reshape((seen.size, 1)))
    copy_state(y + values @ rows, Y + rows.T @ rows, y, Y)
    return 0


@njit(cache=True)
def information_noise_step(y, Y, G):
    """Take the information on x to that on x + w, w ~ N(0, G' G), in place.

    J = Y G' (I + G Y G')^-1,   Y = (I - J G) Y (I - J G)' + J J',   y = y - J G y: a sum of squares, and no inverse of
    Y or Q.  y : (n,); Y : (n, n) positive semidefinite; G : (n, n).
    """
    unit, W = identity(y.size), G @ Y
    A = unit + W @ G.T
    cholesky_upper(A, A)  # its eigenvalues are at least one
    solve_lower(A, W)
    solve_upper(A, W)  # W is J' now
    B = unit - G.T @ W
    copy_state(y @ B, B.T @ Y @ B + W.T @ W, y, Y)
    symmetrise(Y)


@njit(cache=True)
def information_back_step(y, Y, Phi, G):
    """Carry the information on x_next = Phi x + w, w ~ N(0, G' G), back to x, in place.

    Y = Phi' (Y^-1 + Q)^-1 Phi, with no inverse of Y.  y : (n,); Y, Phi, G : (n, n).
    """
    information_noise_step(y, Y, G)
    copy_state(y @ Phi, Phi.T @ Y @ Phi, y, Y)
    symmetrise(Y)


@njit(cache=True)
def information_predict_step(y, Y, Psi, G):
    """Carry the information on x to x_next = Phi x + w, w ~ N(0, G' G), in place.

    Y = (Phi Y^-1 Phi' + Q)^-1, Psi = Phi^-1, with no inverse of Y.  y : (n,); Y, Psi, G : (n, n).
    """
    copy_state(y @ Psi, Psi.T @ Y @ Psi, y, Y)
    symmetrise(Y)
    information_noise_step(y, Y, G)


@njit(cache=True)
def combine_step(x, P, y, Y, x_out, P_out):
    """Combine N(x, P) with independent information (y, Y) on the deviation from x.

    P_out = (P^-1 + Y)^-1,  x_out = x + P_out y, evaluated as U' (I + U Y U')^-1 U with P = U' U: no inverse of P or Y,
    and positive by construction.  x, y, x_out : (n,); P, Y, P_out : (n, n).
    Returns 0, or k >= 1 where P has a negative pivot in row k - 1.
    """
    U = np.empty(P.shape)
    status = root_semidefinite(P, U)
    if status != 0:
        return status
    A = identity(x.size) + U @ Y @ U.T
    cholesky_upper(A, A)  # its eigenvalues are at least one
    solve_lower(A, U)
    copy(U.T @ U, P_out)
    symmetrise(P_out)
    copy_vector(x + P_out @ y, x_out)
    return 0


@njit(cache=True)
def information_state_step(y, Y, x_out, P_out):
    """Turn information into a Gaussian:  P_out = Y^-1,  x_out = P_out y.

    y, x_out : (n,); Y, P_out : (n, n). Returns 0, or k >= 1 where Y leaves state k - 1 undetermined.
    """
    U, W = np.empty(Y.shape), identity(y.size)
    status = cholesky_upper(Y, U)
    if status != 0:
        return status
    solve_lower(U, W)
    copy(W.T @ W, P_out)
    symmetrise(P_out)
    copy_vector(P_out @ y, x_out)
    return 0


@njit(cache=True)
def backward_loop(z, H, R, Phi, G, step, u, y, Y):
    """Collect for all k the information on x_k in the observations after epoch k.

    z, H, R, Phi, step as in `smoothing.rts_loop` and `Sensor`; G : (K, n, n) with Q = G' G; u : (N - 1, n) known input
    of each step; outputs y : (N, n), Y : (N, n, n), zero at the end.
    Returns (epoch, status) of an R without full rank, or (-1, 0).
    """
    y[-1].fill(0.0)
    Y[-1].fill(0.0)
    for k in range(z.shape[0] - 1, 0, -1):
        before, Y_before = y[k - 1], Y[k - 1]
        copy_state(y[k], Y[k], before, Y_before)
        status = information_update_step(before, Y_before, z[k], H[k % H.shape[0]], R[k % R.shape[0]])
        if status != 0:
            return k, status
        copy_vector(before - Y_before @ u[k - 1], before)
        information_back_step(before, Y_before, Phi[step[k - 1]], G[step[k - 1]])
    return -1, 0


@njit(cache=True)
def forward_loop(z, H, R, Psi, G, step, u, y, Y):
    """Collect for all k the information on x_k in prior and observations up to epoch k.

    Arguments as in `backward_loop`; Psi : (K, n, n) the inverse transitions; y[0], Y[0] come in as the prior.
    Returns as there.
    """
    for k in range(z.shape[0]):
        if k > 0:
            copy_state(y[k - 1], Y[k - 1], y[k], Y[k])
            information_predict_step(y[k], Y[k], Psi[step[k - 1]], G[step[k - 1]])
            copy_vector(y[k] + Y[k] @ u[k - 1], y[k])
        status = information_update_step(y[k], Y[k], z[k], H[k % H.shape[0]], R[k % R.shape[0]])
        if status != 0:
            return k, status
    return -1, 0


def smooth_two_filter(course: Trajectory, z, H, R) -> Smoothed:
    """Smooth a linear filter's trajectory by an information filter that runs backward.

    P_s = (P^-1 + Y)^-1,   x_s = x + P_s y,   (y, Y) the information on x_k - x in the observations after k.
    course : the Trajectory of `run`; z, H, R : of its one linear sensor, R positive definite.
    Returns the Smoothed states, equal to those of `smoothing.smooth`; no predicted covariance is inverted.
    Raises ValueError for wrong input, NotPositiveDefinite with the epoch.
    Source: Fraser and Potter (1969), IEEE Trans. Autom. Control 14, 387-390.

    >>> from geokalman.kalman import Model, Sensor, gaussian, run
    >>> z, walk = [[1.0], [np.nan], [3.0]], Model(F=[[1.0]], Q=[[1.0]])
    >>> course = run(gaussian([0.0], [1e6]), [0.0, 1.0, 2.0], walk, [Sensor(z, [[1.0]], H=[[1.0]])])
    >>> smooth_two_filter(course, z, [[1.0]], [[1.0]]).mean[1].round(3).tolist()
    [2.0]
    """
    N, n = course.mean.shape
    z, H, R = _observations(z, H, R, N, n)
    y, Y = np.empty((N, n)), np.empty((N, n, n))
    G = _roots(course.process_noise)
    dz, u = _about(course.mean, z, H, course.transition, course.step)
    _raise(*backward_loop(dz, H, R, course.transition, G, course.step, u, y, Y), course.t)
    mean, cov = np.empty((N, n)), np.empty((N, n, n))
    for k in range(N):
        status = combine_step(course.mean[k], course.cov[k], y[k], Y[k], mean[k], cov[k])
        if status != 0:
            raise NotPositiveDefinite("filtered covariance", k, float(course.t[k]))
    return Smoothed(course.t, mean, cov)


def smooth_information(t, z, H, R, transition: Transition, prior: Information | None = None) -> Smoothed:
    """Smooth a linear model by two information filters, with a prior or without.

    P_s = (Y_f + Y_b)^-1,   x_s = P_s (y_f + y_b); a second pass, about the first solution, removes its rounding.
    t : (N,); z, H, R : as of a linear `Sensor`, R positive definite; transition : (Phi, Q) or a function of the step,
    Phi invertible; prior : Information at t[0] before its observation, None for a diffuse one.
    Returns the Smoothed states. Raises ValueError for wrong input, NotPositiveDefinite with the first epoch whose state
    the observations leave undetermined.
    Source: Fraser and Potter (1969), IEEE Trans. Autom. Control 14, 387-390.

    >>> z = [[1.0], [np.nan], [3.0]]  # nothing is known before
    >>> smooth_information([0.0, 1.0, 2.0], z, [[1.0]], [[1.0]], ([[1.0]], [[1.0]])).mean[1].round(12).tolist()
    [2.0]
    """
    t = epochs(t)
    H = plain("H", H)
    N, n = len(t), H.shape[-1] if H.ndim else 0
    z, H, R = _observations(z, H, R, N, n)
    Phi, Q, step = steps(transition, t, n)
    G = _roots(Q)
    Psi = np.linalg.solve(Phi, np.eye(n))
    y0, Y0 = np.zeros(n), np.zeros((n, n))
    if prior is not None:
        y0, Y0 = array("information vector", prior.vector, n), covariance("information matrix", prior.matrix, n)
    (y, y_back), (Y, Y_back) = np.empty((2, N, n)), np.empty((2, N, n, n))
    mean, cov, correction = np.zeros((N, n)), np.empty((N, n, n)), np.empty(n)
    for _ in range(2):
        dz, u = _about(mean, z, H, Phi, step)
        y[0], Y[0] = y0 - Y0 @ mean[0], Y0
        _raise(*forward_loop(dz, H, R, Psi, G, step, u, y, Y), t)
        _raise(*backward_loop(dz, H, R, Phi, G, step, u, y_back, Y_back), t)
        for k in range(N):
            status = information_state_step(y[k] + y_back[k], Y[k] + Y_back[k], correction, cov[k])
            if status != 0:
                detail = f"the observations do not determine state {status - 1}"
                raise NotPositiveDefinite("information matrix", k, float(t[k]), detail)
            mean[k] += correction
    return Smoothed(t, mean, cov)


def _about(nominal, z, H, Phi, step) -> tuple[np.ndarray, np.ndarray]:
    """Give observations and inputs of the deviations from a nominal trajectory (N, n)."""
    u = (Phi[step] @ nominal[:-1, :, None])[:, :, 0] - nominal[1:]
    return z - (H @ nominal[:, :, None])[:, :, 0], u


def _observations(z, H, R, N: int, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    z = array("z", z, N, None, missing=True)
    m = z.shape[1]
    return z, matrices("H", H, N, m, n), covariances("R", R, N, m)


def _roots(Q: np.ndarray) -> np.ndarray:
    G = np.empty_like(Q)
    for noise, root in zip(Q, G, strict=True):
        if root_semidefinite(noise, root) != 0:
            raise NotPositiveDefinite("process noise covariance")
    return G


def _raise(epoch: int, status: int, t: np.ndarray) -> None:
    if status != 0:
        detail = f"the pivot of observed component {status - 1} is not positive"
        raise NotPositiveDefinite("observation noise covariance", epoch, float(t[epoch]), detail)
