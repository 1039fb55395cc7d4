"""An EKF with three empirical accelerations: first-order Gauss-Markov processes beside position and velocity.

State [r, v, a] (9,): v' = a_J2(r) + a, a' = -a/tau + w, with w so strong that a has the standard deviation sigma in the
long run; otherwise as `estimate`. How an acceleration and its noise reach velocity and position within a substep is
discretised exactly by van Loan's method; gravity couples them by Markley's matrix.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from geokalman.kalman.adaptive import innovation_step
from geokalman.kalman.discretise import van_loan
from geokalman.kalman.linear import predict_step, update_step
from geokalman.physics.transition import markley_step
from geokalman.pulsar.dynamics import Force, force_point, gradient_point
from geokalman.pulsar.estimate import Diverged, Estimate
from geokalman.pulsar.model import STEP, Array
from geokalman.pulsar.observations import Observations

STEPS = 50
"""Runge-Kutta steps and transition factors in an epoch."""
NOISE = (1.0, 1e-3)
"""Process noise of position [m] and velocity [m/s] in 500 s beside that of the accelerations."""


def run(data: Observations, x0: Array, P0: Array, force: Force, sigma: float, tau: float) -> Estimate:
    """Filter with empirical accelerations of standard deviation sigma [m s^-2] and time constant tau [s], which
    start at zero.

    x0 (6,), P0 (6, 6) and force as for `estimate.run`; every range must be there, epochs STEP apart.
    Raises ValueError for sigma or tau not positive and for gaps, Diverged where a covariance is lost.
    """
    if not (sigma > 0.0 and tau > 0.0):
        raise ValueError(
            f"sigma = {sigma:g} m/s^2 and tau = {tau:g} s of the empirical accelerations must be positive."
        )
    if np.isnan(data.z).any() or not np.allclose(np.diff(data.t, prepend=0.0), STEP):
        raise ValueError(
            f"the filter with empirical accelerations takes epochs {STEP:g} s apart without gaps; "
            "use estimate.run for others."
        )
    n, m = data.z.shape
    x, P, nis = np.zeros((n, 9)), np.zeros((n, 9, 9)), np.zeros(n)
    start, cov = np.zeros(9), np.zeros((9, 9))
    start[:6] = x0
    cov[:6, :6], cov[6:, 6:] = P0, np.diag(np.full(3, sigma**2))
    Q = np.diag(np.repeat([NOISE[0] ** 2, NOISE[1] ** 2, 0.0], 3))
    F, W = np.zeros((9, 9)), np.zeros((9, 9))
    i = np.arange(3)
    F[i, 3 + i] = F[3 + i, 6 + i] = 1.0
    F[6 + i, 6 + i], W[6 + i, 6 + i] = -1.0 / tau, 2.0 * sigma**2 / tau
    drift, Q_sub = van_loan(F, W, STEP / STEPS)
    H = np.zeros((m, 9))
    H[:, :3] = data.H
    failed = _loop(
        data.t,
        data.z,
        H,
        np.diag(data.variance),
        start,
        cov,
        Q,
        drift,
        Q_sub,
        tau,
        force.head,
        force.field,
        force.sun,
        x,
        P,
        nis,
    )
    if failed >= 0:
        raise Diverged(failed + 1, "its covariance lost its root")
    none = np.zeros((0, 6, 6))
    return Estimate(
        data.t, np.ascontiguousarray(x[:, :6]), np.ascontiguousarray(P[:, :6, :6]), np.ones(n), np.ones((n, m)), nis,
        np.full(n, m), np.zeros(n, bool), np.zeros((0, 6)), none, none, none,
    )  # fmt: skip


@njit(cache=True, nogil=True)
def _slope(t, y, tau, head, field, sun, out):
    force_point(t, y[:3], head, field, sun, out[3:6])
    for j in range(3):
        out[j] = y[3 + j]
        out[3 + j] += y[6 + j]
        out[6 + j] = -y[6 + j] / tau


@njit(cache=True, nogil=True)
def _runge_kutta(t, y, h, tau, head, field, sun, k, stage):
    for s in range(4):
        reach = 0.0 if s == 0 else (h if s == 3 else 0.5 * h)
        for j in range(9):
            stage[j] = y[j] + (reach * k[s - 1, j] if s > 0 else 0.0)
        _slope(t + reach, stage, tau, head, field, sun, k[s])
    for j in range(9):
        y[j] += h / 6.0 * (k[0, j] + 2.0 * k[1, j] + 2.0 * k[2, j] + k[3, j])


@njit(cache=True, nogil=True)
def _loop(t, z, H, R, x0, P0, Q, drift, Q_sub, tau, head, field, sun, x, P, nis):
    n, m = z.shape
    G, short, factor = np.empty((2, 3, 3)), np.empty((6, 6)), drift.copy()
    k4, stage, nothing, P_pred = np.empty((4, 9)), np.empty(9), np.empty(9), np.empty((9, 9))
    S, white, V = np.empty((m, m)), np.empty(m), np.empty(m)
    now, y, before = 0.0, x0.copy(), P0.copy()
    for k in range(n):
        h = (t[k] - now) / STEPS
        gradient_point(y[:3], head, G[0])
        for i in range(STEPS):
            _runge_kutta(now + i * h, y, h, tau, head, field, sun, k4, stage)
            gradient_point(y[:3], head, G[(i + 1) % 2])
            markley_step(G[i % 2], G[(i + 1) % 2], h, short)
            factor[:6, :6] = short
            predict_step(y, before, factor, Q_sub, nothing, P_pred)
            before[:] = P_pred
        x[k] = y
        P[k] = before + Q
        for a in range(m):
            V[a] = z[k, a]
            for j in range(3):
                V[a] -= H[a, j] * y[j]
        if innovation_step(P[k], V, H, R, S, white) != 0:
            return k
        nis[k] = (white * white).sum()
        if update_step(x[k], P[k], V, H, R, S, white) != 0:
            return k
        now, y, before = t[k], x[k].copy(), P[k].copy()
    return -1
