"""The filters: the paper's seven states [q; b] (AKF7), the multiplicative six (MEKF), its RTS smoother, and the
JPL-like stand-in.

All see increments of the gyros and combined camera quaternions with their covariances, nothing else.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from geokalman.attitude.model import Array, Tuning
from geokalman.kalman.checks import NotPositiveDefinite
from geokalman.kalman.linear import predict_step, update_step
from geokalman.kalman.manifold import error_predict_step, error_rts_step, error_update_step
from geokalman.physics.quaternion import difference_point, exp_point, multiply_point, retract_point

FILTERS = ("akf7", "mekf", "rts", "jpl_like")
LOST_RATE = 5e-6  # rad/s: how far the rate may wander while the gyros are silent; the pointing rates are 2 to 4e-6


class Measured(NamedTuple):
    """What a filter of one satellite sees, every dt [s].

    d : (n - 1, 3) gyro increments [rad], NaN where lost; z : (n, 4) combined quaternions, NaN where none; R : (n, 3, 3)
    [rad^2]; rate_cov [rad^2/s], bias_cov [(rad/s)^2/s] : (3, 3) densities of the gyro noise and of the bias walk.
    """

    dt: float
    d: Array
    z: Array
    R: Array
    rate_cov: Array
    bias_cov: Array


@dataclass(frozen=True)
class Solution:
    """Attitudes q (n, 4) with covariances cov (n, 3, 3) of their errors in SRF axes [rad^2], gyro biases bias (n, 3)
    [rad/s].

    full : (n, 6, 6) covariances of attitude and bias of the multiplicative filter, None for the paper's. nis : (n,)
    normalised innovations squared, 3 degrees of freedom, NaN without an update; rejected : (n,) updates that the gate
    refused. Epochs before the first camera are NaN.
    """

    q: Array
    bias: Array
    cov: Array
    nis: Array
    rejected: Array
    full: Array | None = None

    def flagged(self, limit_rad: float) -> Array:
        """Epochs (n,) whose standard deviation about some axis exceeds the limit [rad], or that have no estimate."""
        sigma = np.sqrt(np.einsum("kii->ki", self.cov)).max(axis=1)
        return ~(sigma <= limit_rad)


@dataclass(frozen=True)
class _Course:
    """What the smoother needs of a forward run; first : the epoch at which it started."""

    first: int
    q_pred: Array
    b_pred: Array
    P_pred: Array
    q: Array
    b: Array
    P: Array
    A: Array
    Q: Array
    Q_lost: Array
    lost: Array


def _begin(data: Measured, start: Array | None) -> tuple[int, Array]:
    seen = np.isfinite(data.z[:, 0])
    if not seen.any():
        raise ValueError("no epoch has a camera: the filter has nothing to start from.")
    first = int(np.argmax(seen))
    return first, np.array(data.z[first] if start is None else start, dtype=float)


def _fill(data: Measured) -> tuple[Array, Array]:
    """Increments with the last sound one in the place of lost ones, and which were lost."""
    d = np.ascontiguousarray(data.d, dtype=float)
    lost = np.isnan(d).any(axis=1)
    if lost.all():
        raise ValueError("no gyro increment is there at all: the filter cannot predict.")
    last = np.maximum.accumulate(np.where(lost, -1, np.arange(len(d))))
    last[last < 0] = np.argmax(~lost)
    return d[last], lost


def mekf(data: Measured, tuning: Tuning, scale: float = 1.0, start: Array | None = None, smooth: bool = False):
    """Multiplicative filter on pre-integrated increments: q_true = q Exp(delta), states [delta; b], section 3.6.

    scale : factor on the gyro noise (kappa for the JPL-like stand-in); start : first attitude in the place of the first
    camera's; smooth : give the pair (forward, RTS). tuning.gate : largest NIS admitted, 0 admits all.
    Returns a Solution, or two. Raises ValueError without data, NotPositiveDefinite with the epoch.
    """
    first, q0 = _begin(data, start)
    d, lost = _fill(data)
    n, h = len(data.z), data.dt
    S, B = scale**2 * data.rate_cov, data.bias_cov
    Q = np.block([[S * h + B * h**3 / 3, -B * h**2 / 2], [-B * h**2 / 2, B * h]])
    Q_lost = Q.copy()
    Q_lost[:3, :3] += (LOST_RATE * h) ** 2 * np.eye(3)
    P0 = np.diag(np.repeat([tuning.p0_attitude, tuning.p0_bias], 3))
    keep = n if smooth else 1
    c = _Course(
        first, np.empty((n, 4)), np.empty((n, 3)), np.empty((keep, 6, 6)), np.full((n, 4), np.nan), np.full((n, 3),
        np.nan),
        np.full((n, 6, 6), np.nan), np.empty((max(keep - 1, 1), 6, 6)), Q, Q_lost, lost,
    )  # fmt: skip
    nis, rejected = np.full(n, np.nan), np.zeros(n, bool)
    failed = _mekf(
        first, q0, P0, h, d, lost, np.ascontiguousarray(data.z), np.ascontiguousarray(data.R), Q, Q_lost, tuning.gate,
        start is None, smooth, c.q_pred, c.b_pred, c.P_pred, c.q, c.b, c.P, c.A, nis, rejected,
    )  # fmt: skip
    if failed >= 0:
        raise NotPositiveDefinite("innovation covariance", failed)
    forward = Solution(c.q, c.b, c.P[:, :3, :3].copy(), nis, rejected, c.P)
    return (forward, _smooth(c, nis, rejected)) if smooth else forward


@njit(cache=True)
def transition(v, h, A):
    """A = [R(Exp v)', -J h; 0, I] with J = I - [v x] / 2 and the rotation by Rodrigues' formula."""
    angle = np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    s = 1.0 - angle**2 / 6.0 if angle < 1e-4 else np.sin(angle) / angle
    c = 0.5 - angle**2 / 24.0 if angle < 1e-4 else (1.0 - np.cos(angle)) / angle**2
    for i in range(6):
        for j in range(6):
            A[i, j] = 1.0 if i == j else 0.0
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        A[i, i] = 1.0 - c * (v[j] * v[j] + v[k] * v[k])
        A[i, j] = c * v[i] * v[j] + s * v[k]
        A[i, k] = c * v[i] * v[k] - s * v[j]
        A[i, 3 + i] = -h
        A[i, 3 + j] = -0.5 * h * v[k]
        A[i, 3 + k] = 0.5 * h * v[j]


@njit(cache=True)
def _mekf(
    first, q0, P0, h, d, lost, z, R, Q, Q_lost, gate, skip_first, keep, q_pred, b_pred, P_pred, q, b, P, A_all, nis,
    rejected
):  # fmt: skip
    """All epochs forward from the first camera; returns -1 or the epoch whose innovation covariance is not positive."""
    n = len(z)
    work, v, y, white, step = np.empty(4), np.empty(3), np.empty(3), np.empty(3), np.empty(6)
    A, P_k, P_before, S, H = np.empty((6, 6)), np.empty((6, 6)), np.empty((6, 6)), np.empty((3, 3)), np.zeros((3, 6))
    for i in range(3):
        H[i, i] = 1.0
    for k in range(first, n):
        if k == first:
            q_pred[k] = q0
            b_pred[k] = 0.0
            P_k[:] = P0
        else:
            for i in range(3):
                v[i] = d[k - 1, i] - b[k - 1, i] * h
            retract_point(q[k - 1], v, work, q_pred[k])
            b_pred[k] = b[k - 1]
            transition(v, h, A)
            error_predict_step(P[k - 1], A, Q_lost if lost[k - 1] else Q, P_k)
            if keep:
                A_all[k - 1] = A
        if keep:
            P_pred[k] = P_k
        q[k] = q_pred[k]
        b[k] = b_pred[k]
        P[k] = P_k
        if np.isnan(z[k, 0]) or (k == first and skip_first):
            continue
        difference_point(q[k], z[k], work, y)
        P_before[:] = P_k
        if error_update_step(P_k, y, H, R[k], step, S, white) != 0:
            return k
        nis[k] = white[0] ** 2 + white[1] ** 2 + white[2] ** 2
        if gate > 0.0 and nis[k] > gate:
            rejected[k] = True
            continue
        P[k] = P_k
        retract_point(q_pred[k], step[:3], work, q[k])
        for i in range(3):
            b[k, i] += step[3 + i]
    return -1


def _smooth(c: _Course, nis: Array, rejected: Array) -> Solution:
    q, b, P = c.q.copy(), c.b.copy(), c.P.copy()
    failed = _rts(c.first, c.q_pred, c.b_pred, c.P_pred, c.q, c.b, c.P, c.A, c.Q, c.Q_lost, c.lost, q, b, P)
    if failed >= 0:
        raise NotPositiveDefinite("predicted covariance", failed)
    return Solution(q, b, P[:, :3, :3].copy(), nis, rejected, P)


@njit(cache=True)
def _rts(first, q_pred, b_pred, P_pred, q, b, P, A, Q, Q_lost, lost, q_s, b_s, P_s):
    """All epochs backward; returns -1 or the epoch whose predicted covariance is not positive definite."""
    work, d_next, step = np.empty(4), np.empty(6), np.empty(6)
    for k in range(len(q) - 2, first - 1, -1):
        difference_point(q_pred[k + 1], q_s[k + 1], work, d_next)
        for i in range(3):
            d_next[3 + i] = b_s[k + 1, i] - b_pred[k + 1, i]
        status = error_rts_step(P[k], P_pred[k + 1], A[k], Q_lost if lost[k] else Q, d_next, P_s[k + 1], step, P_s[k])
        if status != 0:
            return k + 1
        retract_point(q[k], step[:3], work, q_s[k])
        for i in range(3):
            b_s[k, i] = b[k, i] + step[3 + i]
    return -1


def akf7(
    data: Measured,
    tuning: Tuning,
    scale: float = 1.0,
    stride: int = 1,
    isotropic: float = 0.0,
    start: Array | None = None,
) -> Solution:
    """The paper's filter: seven states [q; b], transition (4), (5), (21), update (24) to (26), then q normalised.

    data.d holds `stride` increments, each of data.dt / stride seconds, per epoch of data.z (8 for 8 Hz prediction).
    R = Xi R_theta Xi' / 4 + 1e-14 I; isotropic > 0 : R = isotropic^2 I instead. The attitude covariance given is 4 Xi'
    P_qq Xi. Raises ValueError without data, NotPositiveDefinite with the epoch.
    """
    first, q0 = _begin(data, start)
    d, lost = _fill(data)
    n, h = len(data.z), data.dt / stride
    if len(d) != (n - 1) * stride:
        raise ValueError(
            f"{len(d)} increments do not belong to {n} epochs of {stride} increments each; give {(n - 1) * stride}."
        )
    P0 = np.zeros((7, 7))
    P0[:4, :4], P0[4:, 4:] = 0.25 * tuning.p0_attitude * np.eye(4), tuning.p0_bias * np.eye(3)
    q, b, cov = np.full((n, 4), np.nan), np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan)
    nis = np.full(n, np.nan)
    failed = _akf7(
        first, q0, P0, h, stride, d, lost, np.ascontiguousarray(data.z), np.ascontiguousarray(data.R),
        scale**2 * data.rate_cov * h, data.bias_cov * h, isotropic, start is None, q, b, cov, nis,
    )  # fmt: skip
    if failed >= 0:
        raise NotPositiveDefinite("innovation covariance", failed)
    return Solution(q, b, cov, nis, np.zeros(n, bool))


@njit(cache=True)
def _xi(q, X):
    """Xi(q) (4, 3): q (0, v) = Xi v. Equation (18)."""
    X[0, 0], X[0, 1], X[0, 2] = -q[1], -q[2], -q[3]
    X[1, 0], X[1, 1], X[1, 2] = q[0], -q[3], q[2]
    X[2, 0], X[2, 1], X[2, 2] = q[3], q[0], -q[1]
    X[3, 0], X[3, 1], X[3, 2] = -q[2], q[1], q[0]


@njit(cache=True)
def _akf7(first, q0, P0, h, stride, d, lost, z, R, rate, walk, isotropic, skip_first, q, b, cov, nis):
    """All epochs forward; returns -1 or the epoch whose innovation covariance is not positive."""
    n = len(z)
    x, x_new, P, P_new = np.zeros(7), np.empty(7), P0.copy(), np.empty((7, 7))
    F, Q, X, M, N = np.zeros((7, 7)), np.zeros((7, 7)), np.empty((4, 3)), np.empty((4, 3)), np.empty((3, 3))
    e, v, turned, y, white = np.empty(4), np.empty(3), np.empty(4), np.empty(4), np.empty(4)
    H, S, R4 = np.zeros((4, 7)), np.empty((4, 4)), np.empty((4, 4))
    for i in range(4):
        H[i, i] = 1.0
    x[:4] = q0
    for i in range(3):
        F[4 + i, 4 + i] = 1.0
    for k in range(first, n):
        if k > first:
            for s in range((k - 1) * stride, k * stride):
                for i in range(3):
                    v[i] = d[s, i] - x[4 + i] * h
                exp_point(v, e)
                F[0, 0], F[0, 1], F[0, 2], F[0, 3] = e[0], -e[1], -e[2], -e[3]  # Phi: q e = Phi q, equation (5)
                F[1, 0], F[1, 1], F[1, 2], F[1, 3] = e[1], e[0], e[3], -e[2]
                F[2, 0], F[2, 1], F[2, 2], F[2, 3] = e[2], -e[3], e[0], e[1]
                F[3, 0], F[3, 1], F[3, 2], F[3, 3] = e[3], e[2], -e[1], e[0]
                _xi(x[:4], X)
                for i in range(4):
                    for j in range(3):
                        M[i, j] = 0.0
                        for a in range(4):
                            M[i, j] += 0.5 * F[i, a] * X[a, j]
                        F[i, 4 + j] = -h * M[i, j]
                for i in range(3):
                    for j in range(3):
                        N[i, j] = rate[i, j]
                        Q[4 + i, 4 + j] = walk[i, j]
                    if lost[s]:
                        N[i, i] += (LOST_RATE * h) ** 2
                for i in range(4):
                    for j in range(4):
                        Q[i, j] = 0.0
                        for a in range(3):
                            for c in range(3):
                                Q[i, j] += M[i, a] * N[a, c] * M[j, c]
                predict_step(x, P, F, Q, x_new, P_new)
                multiply_point(x[:4], e, turned)  # the mean goes by (16), not by its linearisation
                x[:4] = turned
                P[:] = P_new
        if not np.isnan(z[k, 0]) and not (k == first and skip_first):
            sign = 0.0
            for i in range(4):
                sign += z[k, i] * x[i]
            sign = 1.0 if sign >= 0.0 else -1.0
            for i in range(4):
                y[i] = sign * z[k, i] - x[i]
            _xi(x[:4], X)
            for i in range(4):
                for j in range(4):
                    R4[i, j] = 0.0
                    if isotropic > 0.0:
                        R4[i, j] = isotropic**2 if i == j else 0.0
                    else:
                        for a in range(3):
                            for c in range(3):
                                R4[i, j] += 0.25 * X[i, a] * R[k, a, c] * X[j, c]
                        if i == j:
                            R4[i, j] += 1e-14
            if update_step(x, P, y, H, R4, S, white) != 0:
                return k
            nis[k] = white[0] ** 2 + white[1] ** 2 + white[2] ** 2 + white[3] ** 2
            norm = np.sqrt(x[0] ** 2 + x[1] ** 2 + x[2] ** 2 + x[3] ** 2)
            for i in range(4):
                x[i] /= norm
        q[k] = x[:4]
        b[k] = x[4:]
        _xi(x[:4], X)
        for i in range(3):
            for j in range(3):
                total = 0.0
                for a in range(4):
                    for c in range(4):
                        total += 4.0 * X[a, i] * P[a, c] * X[c, j]
                cov[k, i, j] = total
    return -1
