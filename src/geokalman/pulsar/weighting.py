"""Filter with equivalent weights (19), (20) of a choice of residuals, and thresholds of their own for the factor (18).

The text prints k0 and k1 with the equivalent weights of RAEKF; it says neither of which residuals these are, nor which
thresholds the adaptive factor has. The core's hook weighs the residuals of a least-squares position and takes the same
thresholds for both. Here the residuals may be those of that position, v = z - N X~, the innovations, v = z - H x^-, or,
as in the robust estimate (21), those that the updated state leaves,

    v = z - H x,  x = x^- + K (z - H x^-),  K = P H' (H P H' + R W^-1)^-1 (P over alpha where there is a factor),

for which weights and update are iterated, after the factor has judged the unweighted position of the epoch.
Source: Yang, He & Xu (2001), J. Geodesy 75, 109-116.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from geokalman.kalman.adaptive import PASSES, innovation_step, state_discrepancy, three_part
from geokalman.kalman.checks import NotPositiveDefinite
from geokalman.kalman.dense import add_vector_product, transposed
from geokalman.kalman.gaussian import Trajectory
from geokalman.kalman.linear import predict_step, rows_seen, update_step
from geokalman.kalman.robust import FLOOR, equivalent_weights_step, igg3, thresholds
from geokalman.pulsar.dynamics import Force
from geokalman.pulsar.estimate import Estimate, Tuning, propagate_loop, require_orbit
from geokalman.pulsar.model import STEP, Array, Belief
from geokalman.pulsar.observations import Observations

RESIDUALS = {"least-squares": 0, "innovations": 1, "posterior": 2}
"""Which residuals the weights judge, each over the sigma of its range (innovations over the root of S)."""
_LEAST_SQUARES, _INNOVATIONS, _POSTERIOR = range(3)
UPDATES = 10
"""Iterations of weights and update, at most."""
SETTLED = 1e-3
"""Largest change of a weight between iterations with which they end."""


@dataclass(frozen=True)
class Weighting:
    """How RAEKF is read: residuals, thresholds of the weights, thresholds of the factor (None: no factor).

    Raises ValueError for unknown residuals and thresholds out of order.
    """

    residuals: str = "posterior"
    weights: tuple[float, float] = (1.5, 2.5)
    factor: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        if self.residuals not in RESIDUALS:
            raise ValueError(f"residuals {self.residuals!r} are unknown; give one of {', '.join(RESIDUALS)}.")
        for pair in (self.weights, self.factor):
            if pair is not None:
                thresholds(*pair)


def run(
    data: Observations, x0: Array, belief: Belief, force: Force, weighting: Weighting, tuning: Tuning | None = None
) -> Estimate:
    """Filter the observations from the initial estimate x0 (6,) [m, m/s]; of the tuning, floor and steps count.

    Raises NotPositiveDefinite, and Diverged as `estimate.filtered`. Without three independent pulsars in an epoch, or
    without redundancy, the weights of least-squares residuals are 1; the factor is skipped without three.
    """
    tuning, n, m = tuning or Tuning(), *data.z.shape
    substep = STEP / tuning.substeps
    inner = 1 if tuning.rk_step is None else max(1, int(np.ceil(substep / tuning.rk_step - 1e-9)))
    Q = np.array([belief.process_noise(float(dt)) for dt in np.diff(data.t, prepend=0.0)])
    mean, cov = np.empty((2, n + 1, 6)), np.empty((2, n + 1, 6, 6))
    mean[:, 0], cov[:, 0] = x0, belief.P0
    Phi, alpha, weights, whitened = np.empty((n, 6, 6)), np.ones(n), np.full((n, m), np.nan), np.full((n, m), np.nan)
    judged = RESIDUALS[weighting.residuals], *weighting.weights, *(weighting.factor or (0.0, 0.0)), tuning.floor
    failed = _filter_loop(
        np.r_[0.0, data.t], data.z, np.pad(data.H, ((0, 0), (0, 3))), data.variance, Q, (substep, inner), judged,
        force.head, force.field, force.sun, mean, cov, Phi, alpha, weights, whitened,
    )  # fmt: skip
    done = n + 1 if failed < 0 else failed
    start = np.full((1, m), np.nan)
    course = Trajectory(
        np.r_[0.0, data.t][:done], mean[0, :done], cov[0, :done], mean[1, :done], cov[1, :done],
        np.vstack([start, whitened])[:done], Phi, Q, np.arange(done - 1),
    )  # fmt: skip
    require_orbit(course, data, force)
    if failed >= 0:
        raise NotPositiveDefinite(
            "innovation covariance", failed, float(data.t[failed - 1]), "it lost its root", course
        )
    skipped = np.isnan(alpha)
    return Estimate(
        data.t, mean[1, 1:], cov[1, 1:], np.where(skipped, 1.0, alpha), weights, np.nansum(whitened**2, axis=1),
        np.isfinite(data.z).sum(axis=1), skipped, course,
    )  # fmt: skip


@njit(cache=True, nogil=True)
def _filter_loop(
    t, z, H, variance, Q, steps, judged, head, field, sun, mean, cov, Phi, alpha, weights, whitened
):  # fmt: skip
    """Filter all epochs. Returns -1, or the epoch k whose covariance has no root or whose state is not finite."""
    R_all, zero, spare = np.diag(variance), np.zeros(6), np.empty(6)
    for k in range(1, t.size):
        x, P = mean[0, k], cov[0, k]
        propagate_loop(t[k - 1], t[k] - t[k - 1], mean[1, k - 1], steps[0], steps[1], head, field, sun, x, Phi[k - 1])
        predict_step(zero, cov[1, k - 1], Phi[k - 1], Q[k - 1], spare, P)
        mean[1, k], cov[1, k] = x, P
        seen, V, H_k, R = rows_seen(z[k - 1], H, R_all)
        if seen.size == 0:
            continue
        if not np.isfinite(x.sum()):
            return k
        add_vector_product(V, -1.0, x, transposed(H_k))
        white, weight = np.empty(seen.size), np.ones(seen.size)
        status, alpha[k - 1] = weighted_update_step(judged, mean[1, k], cov[1, k], V, H_k, R, weight, white)
        if status != 0:
            return k
        for b in range(seen.size):
            whitened[k - 1, seen[b]], weights[k - 1, seen[b]] = white[b], weight[b]
    return -1


@njit(cache=True, nogil=True)
def weighted_update_step(judged, x, P, V, H, R, weight, white):
    """Update N(x, P) by innovations V (m,) with equivalent weights, in place.

    judged : residuals, thresholds of the weights, those of the factor (zeros: none), its floor; H (m, 6); R (m, m)
    diagonal; outputs weight (m,), white (m,): the innovation whitened by the unweighted S.
    Returns (status, alpha), alpha NaN where the epoch does not determine a position.
    """
    kind, k0, k1, c0, c1, floor = judged
    m = V.size
    S, variance, N = np.empty((m, m)), np.diag(R).copy(), H[:, :3].copy()
    status = innovation_step(P, V, H, R, S, white)
    if status != 0:
        return status, 1.0
    alpha, d, U = 1.0, np.empty(3), np.empty((3, 3))
    if kind == _LEAST_SQUARES or c0 > 0.0:
        fitted = np.ones(m)
        if equivalent_weights_step(N, V, variance, k0, k1, PASSES if kind == _LEAST_SQUARES else 1, d, U, fitted) != 0:
            alpha = np.nan
        elif kind == _LEAST_SQUARES:
            weight[:] = fitted
        if c0 > 0.0 and not np.isnan(alpha):
            s = state_discrepancy(d, P[:3, :3].copy(), U)
            if np.isnan(s):
                return 1, 1.0
            alpha = three_part(s, c0, c1, floor)
            P /= alpha
    if kind == _INNOVATIONS:
        for a in range(m):
            weight[a] = max(igg3(V[a] / np.sqrt(S[a, a]), k0, k1), FLOOR)
    x_prior, P_prior, scratch, spare = x.copy(), P.copy(), np.empty((m, m)), np.empty(m)
    for _ in range(UPDATES if kind == _POSTERIOR else 0):
        if update_step(x, P, V, H, np.diag(variance / weight), scratch, spare) != 0:
            break
        change = 0.0
        for a in range(m):
            left = V[a]
            for j in range(x.size):
                left -= H[a, j] * (x[j] - x_prior[j])
            w = max(igg3(left / np.sqrt(variance[a]), k0, k1), FLOOR)
            change = max(change, abs(w - weight[a]))
            weight[a] = w
        x[:], P[:] = x_prior, P_prior
        if change < SETTLED:
            break
    return update_step(x, P, V, H, np.diag(variance / weight), scratch, spare), alpha
