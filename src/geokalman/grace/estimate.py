"""The three ways to a range-rate: Newton differentiation, the linear ("extended") filter, the unscented fusion filter.

The filters share one compiled loop over the core's steps. Dynamics (50), (51) and position observation (52) are linear,
so the paper's EKF is a plain Kalman filter; the range-rate (53) is the only non-linear part.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numba import njit

from geokalman.grace.differentiate import derivative
from geokalman.grace.model import (
    ACCELERATION,
    POSITION,
    VELOCITY,
    Array,
    Observations,
    Tuning,
    distance,
    kinematic,
    los_acceleration,
    range_rate,
)
from geokalman.kalman.checks import NotPositiveDefinite
from geokalman.kalman.dense import copy_state
from geokalman.kalman.linear import predict_step, scalar_update_step, update_step
from geokalman.kalman.smoothing import rts_mean_step, rts_step
from geokalman.kalman.unscented import sigma_points_step, spread, unscented_update_step

N = 9
SIGMA_POINTS = 2 * N + 1
Update = Literal["sequential", "simultaneous"]
_POSITION_ONLY, _EKF, _UKF, _EKF_JOINT, _UKF_JOINT = range(5)


@dataclass(frozen=True)
class Differentiated:
    """Range (n,) [m], range-rate (n,) [m/s] and relative velocity (n, 3) [m/s] by differentiation; NaN at the edges."""

    dt: float
    rho: Array
    rate: Array
    dv: Array


@dataclass(frozen=True)
class Trajectory:
    """States [dr, dv, da] (n, 9) every dt [s], with covariances (n, 9, 9) where they were asked for."""

    dt: float
    x: Array
    P: Array | None = None

    @property
    def dr(self) -> Array:
        """Relative position (n, 3) [m]."""
        return self.x[:, POSITION]

    @property
    def dv(self) -> Array:
        """Relative velocity (n, 3) [m/s]."""
        return self.x[:, VELOCITY]

    @property
    def rho(self) -> Array:
        """Range (44) of the state (n,) [m]."""
        return distance(self.dr)

    @property
    def rate(self) -> Array:
        """Range-rate (45) of the state (n,) [m/s]."""
        return range_rate(self.dr, self.dv)

    @property
    def los(self) -> Array:
        """Line-of-sight acceleration e . da of the state (n,) [m/s^2]: equations (46) and (47) together."""
        return los_acceleration(self.dr, self.x[:, ACCELERATION])

    def rate_sigma(self, epochs: slice = slice(None)) -> Array:
        """Standard deviation of the range-rate [m/s] at the epochs, linearised at the state. Needs the covariances."""
        x = self.x[epochs]
        H = np.zeros_like(x)
        for k, state in enumerate(x):
            _range_rate_row(state, H[k])
        return np.sqrt(np.einsum("ki,kij,kj->k", H, self.P[epochs], H))


@dataclass(frozen=True)
class Estimate:
    """A filter's states, their fixed-interval smoothed twins, and the whitened innovations (n, 4): position,
    range-rate."""

    filtered: Trajectory
    smoothed: Trajectory
    innovations: Array


def newton(data: Observations, points: int = 9) -> Differentiated:
    """The paper's first method: rho from the positions, its rate and the relative velocity by the central formula.

    Raises ValueError where there are fewer epochs than points.
    """
    rho = distance(data.baseline)
    return Differentiated(data.dt, rho, derivative(rho, data.dt, points), derivative(data.baseline, data.dt, points))


def ekf(data: Observations, tuning: Tuning, covariances: bool = False) -> Estimate:
    """The paper's "EKF": the kinematic filter on relative positions alone, equations (16) to (20), then RTS smoothing.

    covariances: smooth them too (without them the smoother is four times as fast).
    Raises NotPositiveDefinite, naming the epoch.
    """
    return _run(data, tuning, _POSITION_ONLY, covariances)


def ukf(data: Observations, tuning: Tuning, update: Update = "sequential", covariances: bool = False) -> Estimate:
    """The paper's UKF: positions and range-rate, equations (26) to (43), then RTS smoothing (the dynamics are linear).

    update: `sequential` takes the position first and draws the sigma points from the updated state; `simultaneous` puts
    both into one vector and linearises (53) at a predicted state that is a metre off, which biases the range-rate.
    Raises NotPositiveDefinite, naming the epoch.
    """
    return _run(data, tuning, {"sequential": _UKF, "simultaneous": _UKF_JOINT}[update], covariances)


def fused_ekf(data: Observations, tuning: Tuning, update: Update = "sequential", covariances: bool = False) -> Estimate:
    """The same data as `ukf`, with the range-rate linearised (18) instead of unscented: the control that the paper
    lacks."""
    return _run(data, tuning, {"sequential": _EKF, "simultaneous": _EKF_JOINT}[update], covariances)


def _run(data: Observations, tuning: Tuning, kind: int, covariances: bool) -> Estimate:
    n = len(data.baseline)
    Phi, Q = kinematic(data.dt, tuning.q(data.dt))
    c, w = spread(N, tuning.alpha, tuning.beta, tuning.kappa)
    x_pred, P_pred, x, P = np.empty((n, N)), np.empty((n, N, N)), np.empty((n, N)), np.empty((n, N, N))
    innovations = np.full((n, 4), np.nan)
    failed = _filter(
        kind, np.ascontiguousarray(data.baseline), np.ascontiguousarray(data.rate), data.prior_mean, data.prior_cov, Phi, Q,
        tuning.sigma_r**2, tuning.sigma_rr(data.dt) ** 2, c, w, x_pred, P_pred, x, P, innovations,
    )  # fmt: skip
    if failed >= 0:
        raise NotPositiveDefinite("covariance of the state or of the innovation", failed)
    x_s, P_s = np.empty((n, N)), np.empty((n if covariances else 1, N, N))
    failed = _smooth(x_pred, P_pred, x, P, Phi, Q, covariances, x_s, P_s)
    if failed >= 0:
        raise NotPositiveDefinite("predicted covariance", failed)
    return Estimate(Trajectory(data.dt, x, P), Trajectory(data.dt, x_s, P_s if covariances else None), innovations)


@njit(cache=True)
def _range_rate_row(x, H):
    """Range-rate (45) of the state and its gradient H (9,): d/d(dr) = (dv - rate e) / rho, d/d(dv) = e."""
    rho = np.sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2])
    rate = (x[0] * x[3] + x[1] * x[4] + x[2] * x[5]) / rho
    for j in range(3):
        e = x[j] / rho
        H[j] = (x[3 + j] - rate * e) / rho
        H[3 + j] = e
        H[6 + j] = 0.0
    return rate


@njit(cache=True)
def _position_update(x, P, z, r, H, innovation):
    """Condition on the components of the relative position that are there; returns False where S is not positive."""
    for j in range(3):
        if np.isnan(z[j]):
            continue
        H[:] = 0.0
        H[j] = 1.0
        residual = z[j] - x[j]
        S = scalar_update_step(x, P, residual, H, r)
        if not S > 0.0:
            return False
        innovation[j] = residual / np.sqrt(S)
    return True


@njit(cache=True)
def _filter(kind, baseline, rates, x0, P0, Phi, Q, r, s, c, w, x_pred, P_pred, x, P, innovations):
    """All epochs forward; returns -1, or the epoch at which a covariance is not positive definite."""
    n = len(rates)
    H, chi, U = np.zeros(N), np.empty((SIGMA_POINTS, N)), np.empty((N, N))
    gamma1, z1, R1, S1, white1 = (
        np.empty((SIGMA_POINTS, 1)),
        np.empty(1),
        np.full((1, 1), s),
        np.empty((1, 1)),
        np.empty(1),
    )
    gamma4, z4, S4, white4 = np.empty((SIGMA_POINTS, 4)), np.empty(4), np.empty((4, 4)), np.empty(4)
    R4, H4 = np.diag(np.array([r, r, r, s])), np.zeros((4, N))
    for k in range(n):
        if k == 0:
            copy_state(x0, P0, x_pred[0], P_pred[0])
        else:
            predict_step(x[k - 1], P[k - 1], Phi, Q, x_pred[k], P_pred[k])
        copy_state(x_pred[k], P_pred[k], x[k], P[k])
        missing = np.isnan(rates[k])
        joint = (kind == _EKF_JOINT or kind == _UKF_JOINT) and not missing and not np.isnan(baseline[k]).any()
        if joint:
            for j in range(3):
                z4[j] = baseline[k, j]
            z4[3] = rates[k]
            if kind == _UKF_JOINT:
                if sigma_points_step(x[k], P[k], c, chi, U) != 0:
                    return k
                for i in range(SIGMA_POINTS):
                    for j in range(3):
                        gamma4[i, j] = chi[i, j]
                    gamma4[i, 3] = _range_rate_row(chi[i], H)
                status = unscented_update_step(x[k], P[k], U, gamma4, z4, R4, c, w, S4, white4)
            else:
                H4[:] = 0.0
                H4[0, 0] = H4[1, 1] = H4[2, 2] = 1.0
                z4[3] -= _range_rate_row(x[k], H4[3])
                for j in range(3):
                    z4[j] -= x[k, j]
                status = update_step(x[k], P[k], z4, H4, R4, S4, white4)
            if status != 0:
                return k
            for j in range(4):
                innovations[k, j] = white4[j]
            continue
        if not _position_update(x[k], P[k], baseline[k], r, H, innovations[k]):
            return k
        if kind == _POSITION_ONLY or missing:
            continue
        if kind == _UKF or kind == _UKF_JOINT:
            if sigma_points_step(x[k], P[k], c, chi, U) != 0:
                return k
            for i in range(SIGMA_POINTS):
                gamma1[i, 0] = _range_rate_row(chi[i], H)
            z1[0] = rates[k]
            if unscented_update_step(x[k], P[k], U, gamma1, z1, R1, c, w, S1, white1) != 0:
                return k
            innovations[k, 3] = white1[0]
        else:
            residual = rates[k] - _range_rate_row(x[k], H)
            S = scalar_update_step(x[k], P[k], residual, H, s)
            if not S > 0.0:
                return k
            innovations[k, 3] = residual / np.sqrt(S)
    return -1


@njit(cache=True)
def _smooth(x_pred, P_pred, x, P, Phi, Q, covariances, x_s, P_s):
    """All epochs backward; returns -1, or the epoch whose predicted covariance is not positive definite."""
    n = len(x)
    for j in range(N):
        x_s[n - 1, j] = x[n - 1, j]
    if covariances:
        copy_state(x[n - 1], P[n - 1], x_s[n - 1], P_s[n - 1])
    for k in range(n - 2, -1, -1):
        if covariances:
            status = rts_step(x[k], P[k], x_pred[k + 1], P_pred[k + 1], Phi, Q, x_s[k + 1], P_s[k + 1], x_s[k], P_s[k])
        else:
            status = rts_mean_step(x[k], P[k], x_pred[k + 1], P_pred[k + 1], Phi, x_s[k + 1], x_s[k])
        if status != 0:
            return k + 1
    return -1
