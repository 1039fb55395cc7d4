"""Adaptive factors: how far a prediction is to be trusted, judged by the observations.

The predicted P becomes P / alpha.
predicted residual     s^2 = V' S^-1 V / m (whitened), or sums of squares weighted by R (Yang & Gao 2006)
state discrepancy      s^2 = d' (P + A^-1)^-1 d / n, d = least squares minus prediction (Yang, He & Xu 2001)
factor                 three-part (IGG-III of s), two-part (k0 / s), or the ratio that makes the sums agree

Cost on clean data: a factor with k0 = 1.5 throws away part of a good prediction in 8.0 % of epochs (3 degrees of
freedom; 2.8 % with 7), and each time the filter must converge again. What it wins: with a process noise that is far
too small the error stays that of the observations instead of diverging. It cannot tell an outlier from a wrong
prediction: outliers make an adaptive filter worse.
The unwhitened `trace_factor` and `norm_ratio` are ruled by the least accurate observation.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
from numba import njit, types

from geokalman.kalman.checks import scalar, whole
from geokalman.kalman.dense import cholesky_upper, identity, solve_lower, solve_upper
from geokalman.kalman.linear import innovation_covariance, whiten
from geokalman.kalman.model import matrix, vector
from geokalman.kalman.robust import FLOOR, equivalent_weights_step, huber, igg3, innovation_weights_step, thresholds

HOOKS = {
    "ratio": 1, "three_part": 2, "two_part": 3, "trace": 4, "norm": 5, "innovations": 6, "discrepancy": 7, "robust": 8,
    "literal": 9,
}  # fmt: skip
"""Hooks of `run` by name. Of the innovation: `ratio` (17), `three_part` and `two_part` factors of the predicted
residual, unwhitened `trace` and `norm`, and `innovations`, IGG-III weights without a factor. Of the states that one
epoch determines: the three-part factor of `discrepancy` (18), with equivalent weights as well `robust` (19)-(21), and
unwhitened `literal`."""
_RATIO, _THREE_PART, _TWO_PART, _TRACE, _NORM, _INNOVATIONS, _DISCREPANCY, _ROBUST, _LITERAL = range(1, 10)
PASSES = 4
"""Iterations of the equivalent weights."""
_real, _whole = types.float64, types.int64
JUDGE = types.Tuple((_whole, _real))(
    _whole, matrix, vector, matrix, matrix, _real, _real, _real, _whole, vector, vector
)  # fmt: skip
"""Signature of `adapt_step` and `_no_judgement`."""


@njit(cache=True)
def innovation_step(P, residual, H, R, S, whitened):
    """Whiten an innovation by its covariance S = H P H' + R, with nothing updated.

    P : (n, n); residual : (m,); H : (m, n); R : (m, m); outputs S : (m, m), whitened : (m,).
    Returns 0, or k >= 1 when S is not positive definite in row k - 1.
    """
    innovation_covariance(P, H, R, S)
    U = np.empty(S.shape)
    status = cholesky_upper(S, U)
    if status == 0:
        whiten(U, residual, whitened)
    return status


@njit(cache=True)
def _squares(v):
    total = 0.0
    for a in range(v.size):
        total += v[a] * v[a]
    return total


@njit(cache=True)
def predicted_residual(whitened):
    """Compute s = sqrt(V' S^-1 V / m) of a whitened innovation (m,).

    It is about 1 where the model is right.

    >>> predicted_residual(np.array([3.0, 4.0, 0.0, 0.0]))
    2.5
    """
    return np.sqrt(_squares(whitened) / whitened.size)


@njit(cache=True)
def ratio_factor(residual, S, R, floor):
    """Compute the optimal factor of predicted residuals.

    It is 1 where to <= tp + m, else tp / (to - m), not below floor, with to = sum V_a^2 / R_aa and
    tp = sum (H P H')_aa / R_aa = sum S_aa / R_aa - m, so that each observation counts by its weight.
    residual : (m,); S, R : (m, m). Source: Yang & Gao (2006), J. Geodesy 80, 177-183, whitened by R; mars-pulsar (17).

    >>> ratio_factor(np.array([3.0]), np.array([[5.0]]), np.eye(1), 0.001)
    0.5
    """
    m = residual.size
    observed, predicted = 0.0, 0.0
    for a in range(m):
        observed += residual[a] * residual[a] / R[a, a]
        predicted += S[a, a] / R[a, a] - 1.0
    return 1.0 if observed <= predicted + m else max(predicted / (observed - m), floor)


@njit(cache=True)
def trace_factor(residual, S, R, floor):
    """Compute the unweighted form of `ratio_factor`.

    It is 1 where V' V <= tr S, else tr(H P H') / (V' V - tr R), not below floor.
    A caution: with observations of very different accuracy it hears the worst of them alone.

    >>> trace_factor(np.array([3.0]), np.array([[5.0]]), np.eye(1), 0.001)
    0.5
    """
    observed, noise = _squares(residual), np.trace(R)
    return 1.0 if observed <= np.trace(S) else max((np.trace(S) - noise) / (observed - noise), floor)


@njit(cache=True)
def norm_ratio(residual, S):
    """Compute the unwhitened s = sqrt(V' V / tr S); the caution of `trace_factor` holds.

    >>> norm_ratio(np.array([3.0, 4.0]), np.diag(np.array([2.0, 2.0])))
    2.5
    """
    return np.sqrt(_squares(residual) / np.trace(S))


@njit(cache=True)
def state_discrepancy(d, P, U):
    """Compute s = sqrt(d' (P + A^-1)^-1 d / n) of a least-squares state minus its prediction.

    d : (n,); P : (n, n) predicted covariance of these states; U : (n, n) upper root of the normal matrix A = U' U.
    Returns s, or nan where P + A^-1 is not positive definite. Source: Yang, He & Xu (2001), whitened; mars-pulsar (18).

    >>> state_discrepancy(np.array([4.0]), np.array([[3.0]]), np.eye(1))
    2.0
    """
    inverse, white = identity(d.size), np.empty(d.size)
    solve_lower(U, inverse)
    solve_upper(U, inverse)
    C = P + 0.5 * (inverse + inverse.T)
    if cholesky_upper(C, C) != 0:
        return np.nan
    whiten(C, d, white)
    return predicted_residual(white)


@njit(cache=True)
def three_part(s, k0, k1, floor):
    """Compute the three-part factor: IGG-III of s, not below floor.

    >>> three_part(2.0, 1.5, 2.5, 0.001), three_part(9.0, 1.5, 2.5, 0.001)
    (0.1875, 0.001)
    """
    return max(igg3(s, k0, k1), floor)


@njit(cache=True)
def two_part(s, k0, floor):
    """Compute the two-part factor: 1 for |s| <= k0, else k0 / |s|, not below floor.

    >>> two_part(3.0, 1.5, 0.001)
    0.5
    """
    return max(huber(s, k0), floor)


@dataclass(frozen=True, kw_only=True)
class Adaptive:
    """Hook of `run` that judges each prediction or observation before the update.

    by : a name of `HOOKS`; k0, k1 : thresholds of factor and weights; floor : smallest factor; states : number of
    leading states that the observations of one epoch determine, for the hooks that solve for them (others ignore it).
    Raises ValueError for an unknown name, thresholds out of order and a floor outside (0, 1].

    >>> Adaptive(by="two_part", k0=2.0).floor
    0.001
    """

    by: str
    k0: float = 1.5
    k1: float = 2.5
    floor: float = 1e-3
    states: int = 3

    def __post_init__(self) -> None:
        if self.by not in HOOKS:
            raise ValueError(f"the hook {self.by!r} is unknown: the hooks are {', '.join(HOOKS)}.")
        thresholds(self.k0, self.k1)
        if not 0.0 < scalar("floor", self.floor) <= 1.0:
            raise ValueError(f"floor = {self.floor:g} of the adaptive factor: it must be above 0 and at most 1.")
        if whole("states", self.states) < 1:
            raise ValueError(f"states = {self.states}: at least one state must be determined.")


@functools.cache
def judging_step(hook):
    """Compile `adapt_step`, which only a run with a hook has to wait for, or its stand-in."""
    return njit([JUDGE], cache=True)(adapt_step if hook else _no_judgement)


def _no_judgement(by, P, residual, H, R, k0, k1, floor, states, whitened, weights):
    """Stand in for `adapt_step` in a run without a hook."""
    return 1, 1.0


def adapt_step(by, P, residual, H, R, k0, k1, floor, states, whitened, weights):
    """Judge one epoch: P becomes P / alpha, R_ab becomes R_ab / sqrt(w_a w_b), both in place.

    by : a code of `HOOKS`; P : (n, n) predicted; residual : (m,); H : (m, n); R : (m, m) [sensor units]; outputs
    whitened : (m,), the innovation before any change, and weights : (m,), which come in as ones.
    Returns (status, alpha): status as in `innovation_step`, or 1 where a statistic has no root; alpha is NaN where the
    observations do not determine the states, and nothing was changed.
    Source: mars-pulsar (17)-(21).
    """
    m = residual.size
    S = np.empty((m, m))
    status = innovation_step(P, residual, H, R, S, whitened)
    if status != 0:
        return status, 1.0
    alpha = 1.0
    if by == _RATIO:
        alpha = ratio_factor(residual, S, R, floor)
    elif by == _THREE_PART:
        alpha = three_part(predicted_residual(whitened), k0, k1, floor)
    elif by == _TWO_PART:
        alpha = two_part(predicted_residual(whitened), k0, floor)
    elif by == _TRACE:
        alpha = trace_factor(residual, S, R, floor)
    elif by == _NORM:
        alpha = three_part(norm_ratio(residual, S), k0, k1, floor)
    elif by == _INNOVATIONS:
        innovation_weights_step(residual, S, k0, k1, weights)
    else:
        N, variance, leading = H[:, :states].copy(), np.diag(R).copy(), P[:states, :states].copy()
        d, U = np.empty(states), np.empty((states, states))
        found = equivalent_weights_step(N, residual, variance, k0, k1, PASSES if by == _ROBUST else 1, d, U, weights)
        if found != 0 or by != _ROBUST:
            weights.fill(1.0)
        if found != 0:
            return 0, np.nan
        s = norm_ratio(d, leading) if by == _LITERAL else state_discrepancy(d, leading, U)
        if np.isnan(s):
            return 1, 1.0
        alpha = three_part(s, k0, k1, floor)
    for i in range(P.shape[0]):
        for j in range(P.shape[0]):
            P[i, j] /= alpha
    for a in range(m):
        for b in range(m):
            if R[a, b] != 0.0:
                w, v = max(weights[a], FLOOR), max(weights[b], FLOOR)
                R[a, b] /= w if a == b else np.sqrt(w * v)
    return 0, alpha
