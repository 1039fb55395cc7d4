"""The filters: EKF, two adaptive EKFs, the robust adaptive EKF, innovation weighting, UKF, and RTS smoothing.

One compiled loop over the core's steps. It predicts the state by Runge-Kutta steps and the covariance by a chain of
Markley's transition matrices, (8) and (9), judges the prediction, (17) to (20), and updates, (21).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from geokalman.kalman.adaptive import (
    inflate_step,
    innovation_step,
    norm_ratio,
    predicted_residual,
    ratio_factor,
    state_discrepancy,
    three_part,
    trace_factor,
    two_part,
)  # fmt: skip
from geokalman.kalman.checks import NotPositiveDefinite, array, covariance
from geokalman.kalman.linear import predict_step, update_step
from geokalman.kalman.robust import FLOOR, equivalent_weights_step, innovation_weights_step, thresholds
from geokalman.kalman.smoothing import rts_loop
from geokalman.kalman.unscented import sigma_points_step, spread, transform_step
from geokalman.physics.transition import chain_step, check_step, markley_step
from geokalman.pulsar.dynamics import GM, RADIUS, Force, gradient_point, runge_kutta_step
from geokalman.pulsar.model import STEP, Array, Preset
from geokalman.pulsar.observations import Observations

KINDS = {
    "ekf": 0, "aekf1_prw": 1, "aekf1_pr3": 2, "aekf1_pr2": 3, "aekf2": 4, "raekf": 5, "igg": 6, "ukf": 7,
    "trace": 8, "norm": 9, "literal": 10,
}  # fmt: skip
"""Filters by name: the paper's four (AEKF1 in three variants), `igg` with weighted innovations, `ukf`, and three
unwhitened traps."""
_EKF, _PRW, _PR3, _PR2, _AEKF2, _RAEKF, _IGG, _UKF, _TRACE, _NORM, _LITERAL = range(11)
PASSES = 4
"""Iterations of the equivalent weights of the robust filter."""
DIVERGED = 1e7
"""Position sigma or innovation [m] beyond which a filter has diverged."""


class Diverged(ArithmeticError):
    """A filter that lost its orbit; `epoch` is k, `why` what gave it away."""

    def __init__(self, epoch: int, why: str) -> None:
        self.epoch, self.why = epoch, why
        super().__init__(f"the filter diverged at epoch k = {epoch}: {why}.")

    def __reduce__(self):
        return Diverged, (self.epoch, self.why)


@dataclass(frozen=True)
class Tuning:
    """How a filter computes: thresholds k0, k1 of the factors and weights, floor of the factor, substeps,
    Runge-Kutta step.

    substeps : of the transition matrix in 500 s; rk_step : longest step of the state [s], None for one Runge-Kutta
    step a substep.
    Raises ValueError for thresholds out of order, a floor outside (0, 1], and substeps too long for Markley's
    matrix unless allow_coarse; warns where they are long.
    """

    k0: float = 1.5
    k1: float = 2.5
    floor: float = 1e-3
    substeps: int = 50
    rk_step: float | None = 10.0
    allow_coarse: bool = False

    def __post_init__(self) -> None:
        thresholds(self.k0, self.k1)
        if not 0.0 < self.floor <= 1.0:
            raise ValueError(
                f"floor = {self.floor:g} of the adaptive factor must be above 0 "
                "(velocity is not observed in one epoch) and at most 1."
            )
        if self.substeps < 1:
            raise ValueError(f"substeps = {self.substeps} must be at least 1.")
        if self.rk_step is not None and not 0.0 < self.rk_step <= STEP:
            raise ValueError(f"rk_step = {self.rk_step:g} s must be above 0 and at most {STEP:g} s.")
        check_step(STEP / self.substeps, self.allow_coarse)


@dataclass(frozen=True)
class Estimate:
    """States x (n, 6) [m, m/s] with covariances P (n, 6, 6) at the times t (n,) [s], and what the filter thought of
    them.

    alpha (n,) adaptive factors; weights (n, m) of the observations, NaN where missing; nis (n,) normalised
    innovation squared, with S of the prediction before any adaptation, and observed (n,) how many ranges it counts;
    skipped (n,): the adaptation of this epoch was skipped, fewer than three independent pulsars. predicted_x,
    predicted_P, transition, noise: what a smoother needs.
    """

    t: Array
    x: Array
    P: Array
    alpha: Array
    weights: Array
    nis: Array
    observed: Array
    skipped: Array
    predicted_x: Array
    predicted_P: Array
    transition: Array
    noise: Array


def run(
    kind: str,
    data: Observations,
    x0: Array,
    preset: Preset,
    force: Force,
    tuning: Tuning | None = None,
    P0: Array | None = None,
    R: Array | None = None,
) -> Estimate:
    """Filter the observations from the initial estimate x0 (6,) with the preset's P0 and process noise.

    kind : a name of `KINDS`; force : what the filter believes; P0 (6, 6), R (m, m) diagonal : instead of the
    preset's and the data's.
    Raises ValueError for an unknown kind and an R that is not diagonal, NotPositiveDefinite for a P0 or R that is no
    covariance, Diverged with the epoch where the position comes inside Mars, the orbit opens, or sigma or innovation
    exceed 1e7 m.
    """
    if kind not in KINDS:
        raise ValueError(f"filter {kind!r} is unknown; the filters are {', '.join(KINDS)}.")
    tuning = tuning or Tuning()
    n, m = data.z.shape
    x0 = array("x0", x0, 6)
    P0 = covariance("P0", preset.P0 if P0 is None else P0, 6)
    if R is not None:
        R = covariance("R", R, m)
        if np.count_nonzero(R - np.diag(np.diag(R))):
            raise ValueError("R has elements off its diagonal; the ranges to different pulsars must be uncorrelated.")
    variance = data.variance if R is None else np.diag(R).copy()
    if not (variance > 0.0).all():
        raise ValueError(f"the diagonal of R is {variance.tolist()}; each element must be positive.")
    dt = np.diff(data.t, prepend=0.0)
    _, which = np.unique(dt, return_inverse=True)
    steps = {int(k): preset.process_noise(float(dt[i])) for i, k in enumerate(which)}
    Q = np.array([covariance("Q", steps[int(k)], 6) for k in which])
    x, x_pred, P, P_pred, Phi = (
        np.empty((n, 6)),
        np.empty((n, 6)),
        np.empty((n, 6, 6)),
        np.empty((n, 6, 6)),
        np.zeros((n, 6, 6)),
    )
    alpha, weights, nis = np.ones(n), np.full((n, m), np.nan), np.zeros(n)
    observed, skipped = np.zeros(n, np.int64), np.zeros(n, np.bool_)
    c, w = spread(6, 1.0, 0.0, -3.0)
    substep = STEP / tuning.substeps
    inner = 1 if tuning.rk_step is None else max(1, int(np.ceil(substep / tuning.rk_step - 1e-9)))
    epoch, status = filter_loop(
        KINDS[kind], data.t, data.z, data.H, variance, x0, P0, Q, tuning.k0, tuning.k1, tuning.floor, substep, inner,
        c, w, force.head, force.field, force.sun, x, P, x_pred, P_pred, Phi, alpha, weights, nis, observed, skipped,
    )  # fmt: skip
    if status == 1:
        raise NotPositiveDefinite("innovation covariance", epoch, float(data.t[epoch]))
    if status:
        why = {
            2: f"its position came inside Mars, {np.linalg.norm(x_pred[epoch, :3]) / 1e3:.0f} km from the centre",
            3: "its orbit opened into a hyperbola",
            4: f"a position sigma exceeded {DIVERGED:g} m",
            5: f"an innovation exceeded {DIVERGED:g} m",
            6: "its covariance lost its root",
        }[status]
        raise Diverged(epoch + 1, why)
    return Estimate(data.t, x, P, alpha, weights, nis, observed, skipped, x_pred, P_pred, Phi, Q)


def smooth(forward: Estimate) -> Estimate:
    """Rauch-Tung-Striebel smoother of an EKF run: the honest meaning of "non-real-time".

    Raises NotPositiveDefinite with the epoch. The innovations stay those of the forward filter.
    """
    n = len(forward.t)
    x, P = np.empty_like(forward.x), np.empty_like(forward.P)
    epoch, status = rts_loop(
        forward.x,
        forward.P,
        forward.predicted_x,
        forward.predicted_P,
        forward.transition[1:],
        forward.noise[1:],
        np.arange(n - 1),
        x,
        P,
    )
    if status != 0:
        raise NotPositiveDefinite("predicted covariance", epoch, float(forward.t[epoch]))
    return Estimate(
        forward.t, x, P, forward.alpha, forward.weights, forward.nis, forward.observed, forward.skipped,
        forward.predicted_x, forward.predicted_P, forward.transition, forward.noise,
    )  # fmt: skip


@njit(cache=True, nogil=True)
def propagate_loop(t0, dt, x, substep, inner, head, field, sun, x_out, Phi):
    """State and transition matrix over dt [s]: Markley factors of about `substep` seconds, `inner` Runge-Kutta
    steps in each."""
    count = max(1, int(np.ceil(dt / substep - 1e-9)))
    h = dt / count
    work, factor = np.empty((5, 6)), np.empty((6, 6))
    G = np.empty((2, 3, 3))
    for i in range(6):
        x_out[i] = x[i]
        for j in range(6):
            Phi[i, j] = 1.0 if i == j else 0.0
    gradient_point(x_out[:3], head, G[0])
    for k in range(count):
        for i in range(inner):
            runge_kutta_step(t0 + k * h + i * h / inner, x_out, h / inner, head, field, sun, work)
        gradient_point(x_out[:3], head, G[(k + 1) % 2])
        markley_step(G[k % 2], G[(k + 1) % 2], h, factor)
        chain_step(factor, Phi)


@njit(cache=True, nogil=True)
def coast_loop(t0, dt, x, substep, inner, head, field, sun, x_out):
    """The state alone over dt [s], by the Runge-Kutta steps of `propagate_loop`."""
    count = inner * max(1, int(np.ceil(dt / substep - 1e-9)))
    work = np.empty((5, 6))
    for j in range(6):
        x_out[j] = x[j]
    for i in range(count):
        runge_kutta_step(t0 + i * dt / count, x_out, dt / count, head, field, sun, work)


@njit(cache=True, nogil=True)
def _lost(x, P, head):
    """0, or why an estimate is not that of an orbiter: 2 inside Mars, 3 hyperbolic, 4 sigma."""
    r = np.sqrt(x[0] ** 2 + x[1] ** 2 + x[2] ** 2)
    if not r >= head[RADIUS]:
        return 2
    if not 0.5 * (x[3] ** 2 + x[4] ** 2 + x[5] ** 2) < head[GM] / r:
        return 3
    if not P[0, 0] + P[1, 1] + P[2, 2] <= DIVERGED * DIVERGED:
        return 4
    return 0


@njit(cache=True, nogil=True)
def filter_loop(
    kind, t, z, N, variance, x0, P0, Q, k0, k1, floor, substep, inner, c, w,
    head, field, sun, x, P, x_pred, P_pred, Phi, alpha, weights, nis, observed, skipped,
):  # fmt: skip
    """All epochs forward, arrays as in `Estimate`. Returns (row, status): -1, 0; or 1 S not positive definite, 2 to
    6 diverged."""
    n, m = z.shape
    seen = np.empty(m, np.int64)
    chi, gamma, U6 = np.empty((13, 6)), np.empty((13, 6)), np.empty((6, 6))
    mean, D, remainder = np.empty(6), np.empty((6, 6)), np.empty((6, 6))
    X, U3, d = np.empty(3), np.empty((3, 3)), np.empty(3)
    nothing = np.empty(6)
    for k in range(n):
        before_x, before_P = (x0, P0) if k == 0 else (x[k - 1], P[k - 1])
        t0 = 0.0 if k == 0 else t[k - 1]
        if kind == _UKF:
            if sigma_points_step(before_x, before_P, c, chi, U6) != 0:
                return k, 6
            for i in range(13):
                coast_loop(t0, t[k] - t0, chi[i], substep, inner, head, field, sun, gamma[i])
            transform_step(gamma, Q[k], c, w, mean, D, remainder, P_pred[k])
            x_pred[k] = mean
        else:
            propagate_loop(t0, t[k] - t0, before_x, substep, inner, head, field, sun, x_pred[k], Phi[k])
            predict_step(before_x, before_P, Phi[k], Q[k], nothing, P_pred[k])
        x[k] = x_pred[k]
        P[k] = P_pred[k]
        status = _lost(x[k], P[k], head)
        if status != 0:
            return k, status

        count = 0
        for a in range(m):
            if not np.isnan(z[k, a]):
                seen[count] = a
                count += 1
        observed[k] = count
        if count == 0:
            continue
        H, R, V, Z = np.zeros((count, 6)), np.zeros((count, count)), np.empty(count), np.empty(count)
        r = np.empty(count)
        for b in range(count):
            a = seen[b]
            Z[b] = z[k, a]
            V[b] = Z[b]
            r[b] = variance[a]
            R[b, b] = r[b]
            for j in range(3):
                H[b, j] = N[a, j]
                V[b] -= N[a, j] * x[k, j]
            if not abs(V[b]) <= DIVERGED:
                return k, 5
        S, white = np.empty((count, count)), np.empty(count)
        if innovation_step(P[k], V, H, R, S, white) != 0:
            return k, 1
        for b in range(count):
            nis[k] += white[b] * white[b]

        weight = np.ones(count)
        factor = 1.0
        if kind == _PRW:
            factor = ratio_factor(V, S, R, floor)
        elif kind == _PR3:
            factor = three_part(predicted_residual(white), k0, k1, floor)
        elif kind == _PR2:
            factor = two_part(predicted_residual(white), k0, floor)
        elif kind == _TRACE:
            factor = trace_factor(V, S, R, floor)
        elif kind == _NORM:
            factor = three_part(norm_ratio(V, S), k0, k1, floor)
        elif kind == _IGG:
            innovation_weights_step(V, S, k0, k1, weight)
        elif kind == _AEKF2 or kind == _RAEKF or kind == _LITERAL:
            passes = PASSES if kind == _RAEKF else 1
            found = equivalent_weights_step(np.ascontiguousarray(H[:, :3]), Z, r, k0, k1, passes, X, U3, weight)
            if kind != _RAEKF or found != 0:
                weight[:] = 1.0
            if found != 0:
                skipped[k] = True
            else:
                for j in range(3):
                    d[j] = X[j] - x[k, j]
                if kind == _LITERAL:
                    s = np.sqrt((d * d).sum() / (P[k, 0, 0] + P[k, 1, 1] + P[k, 2, 2]))
                else:
                    s = state_discrepancy(d, np.ascontiguousarray(P[k, :3, :3]), U3)
                if np.isnan(s):
                    return k, 6
                factor = three_part(s, k0, k1, floor)
        alpha[k] = factor
        inflate_step(P[k], factor)
        for b in range(count):
            weights[k, seen[b]] = weight[b]
            R[b, b] = r[b] / max(weight[b], FLOOR)
        if update_step(x[k], P[k], V, H, R, S, white) != 0:
            return k, 1
    return -1, 0
