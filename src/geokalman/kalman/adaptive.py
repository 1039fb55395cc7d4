"""Adaptive factors: how far a prediction is to be trusted, judged by the observations; the predicted P becomes P /
alpha.

predicted residual     s^2 = V' S^-1 V / m (whitened), or sums of squares weighted by R (Yang & Gao 2006)
state discrepancy      s^2 = d' (P + A^-1)^-1 d / n with d = least squares of the epoch minus prediction (Yang, He & Xu
2001)
factor                 three-part (IGG-III of s), two-part (k0 / s), or the ratio that makes the sums agree

Cost on clean data: a factor with k0 = 1.5 throws away part of a good prediction in 8.0 % of epochs (3 degrees of
freedom; 2.8 % with 7), and each time the filter must converge again. What it wins: with a process noise that is far
too small the error stays that of the observations instead of diverging. It cannot tell an outlier from a wrong
prediction: outliers make an adaptive filter worse.
The unwhitened forms, kept below as `trace_factor` and `norm_ratio`, are ruled by the least accurate observation.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
from numba import njit, types

from geokalman.kalman.checks import scalar, whole
from geokalman.kalman.dense import cholesky_upper, solve_lower, solve_upper
from geokalman.kalman.linear import whiten
from geokalman.kalman.model import matrix, vector
from geokalman.kalman.robust import FLOOR, equivalent_weights_step, igg3, innovation_weights_step, thresholds

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
"""Signature of `adapt_step` and `no_judgement`."""


@njit(cache=True)
def innovation_step(
    P: np.ndarray, residual: np.ndarray, H: np.ndarray, R: np.ndarray, S: np.ndarray, whitened: np.ndarray
) -> int:
    """Covariance S = H P H' + R of an innovation and the whitened innovation, nothing updated.

    P : (n, n); residual : (m,); H : (m, n); R : (m, m); outputs S : (m, m), whitened : (m,).
    Returns 0, or k >= 1 when S is not positive definite in row k - 1.
    """
    m, n = H.shape
    g = np.empty(n)
    for a in range(m):
        for j in range(n):
            g[j] = 0.0
        for k in range(n):
            if H[a, k] != 0.0:
                for j in range(n):
                    g[j] += H[a, k] * P[k, j]
        for b in range(m):
            total = 0.5 * (R[a, b] + R[b, a])
            for k in range(n):
                if H[b, k] != 0.0:
                    total += H[b, k] * g[k]
            S[a, b] = total
    U = np.empty((m, m))
    status = cholesky_upper(S, U)
    if status == 0:
        whiten(U, residual, whitened)
    return status


@njit(cache=True)
def predicted_residual(whitened: np.ndarray) -> float:
    """Statistic s = sqrt(V' S^-1 V / m) of a whitened innovation (m,); about 1 where the model is right."""
    total = 0.0
    for a in range(whitened.shape[0]):
        total += whitened[a] * whitened[a]
    return np.sqrt(total / whitened.shape[0])


@njit(cache=True)
def ratio_factor(residual: np.ndarray, S: np.ndarray, R: np.ndarray, floor: float) -> float:
    """Optimal factor of predicted residuals: 1 where to <= tp + m, else tp / (to - m), not below floor.

    to = sum V_a^2 / R_aa,  tp = sum (H P H')_aa / R_aa = sum S_aa / R_aa - m, so that each observation counts by
    its weight.
    residual : (m,); S, R : (m, m). Source: Yang & Gao (2006), J. Geodesy 80, 177-183, whitened by R; mars-pulsar (17).
    """
    m = residual.shape[0]
    observed, predicted = 0.0, 0.0
    for a in range(m):
        observed += residual[a] * residual[a] / R[a, a]
        predicted += S[a, a] / R[a, a] - 1.0
    if observed <= predicted + m:
        return 1.0
    return max(predicted / (observed - m), floor)


@njit(cache=True)
def trace_factor(residual: np.ndarray, S: np.ndarray, R: np.ndarray, floor: float) -> float:
    """The unweighted form of `ratio_factor`: 1 where V' V <= tr S, else tr(H P H') / (V' V - tr R), not below floor.

    A caution: with observations of very different accuracy it hears the worst of them alone.
    """
    observed, total, noise = 0.0, 0.0, 0.0
    for a in range(residual.shape[0]):
        observed += residual[a] * residual[a]
        total += S[a, a]
        noise += R[a, a]
    if observed <= total:
        return 1.0
    return max((total - noise) / (observed - noise), floor)


@njit(cache=True)
def norm_ratio(residual: np.ndarray, S: np.ndarray) -> float:
    """Unwhitened statistic s = sqrt(V' V / tr S); the caution of `trace_factor` holds."""
    observed, total = 0.0, 0.0
    for a in range(residual.shape[0]):
        observed += residual[a] * residual[a]
        total += S[a, a]
    return np.sqrt(observed / total)


@njit(cache=True)
def state_discrepancy(d: np.ndarray, P: np.ndarray, U: np.ndarray) -> float:
    """Statistic s = sqrt(d' (P + A^-1)^-1 d / n) of the difference d between a least-squares state and its prediction.

    d : (n,); P : (n, n) predicted covariance of these states; U : (n, n) upper root of the normal matrix A = U' U.
    Returns s, or nan where P + A^-1 is not positive definite. Source: Yang, He & Xu (2001), whitened; mars-pulsar (18).
    """
    n = d.shape[0]
    C, inverse = np.empty((n, n)), np.zeros((n, n))
    for i in range(n):
        inverse[i, i] = 1.0
    solve_lower(U, inverse)
    solve_upper(U, inverse)
    for i in range(n):
        for j in range(n):
            C[i, j] = P[i, j] + 0.5 * (inverse[i, j] + inverse[j, i])
    root, white = np.empty((n, n)), np.empty(n)
    if cholesky_upper(C, root) != 0:
        return np.nan
    whiten(root, d, white)
    return predicted_residual(white)


@njit(cache=True)
def three_part(s: float, k0: float, k1: float, floor: float) -> float:
    """Three-part factor: IGG-III of s, not below floor."""
    return max(igg3(s, k0, k1), floor)


@njit(cache=True)
def two_part(s: float, k0: float, floor: float) -> float:
    """Two-part factor: 1 for |s| <= k0, else k0 / |s|, not below floor."""
    return 1.0 if abs(s) <= k0 else max(k0 / abs(s), floor)


@njit(cache=True)
def inflate_step(P: np.ndarray, alpha: float) -> None:
    """Replace a predicted covariance by P / alpha, in place; 0 < alpha <= 1."""
    if alpha != 1.0:
        for i in range(P.shape[0]):
            for j in range(P.shape[1]):
                P[i, j] /= alpha


@dataclass(frozen=True, kw_only=True)
class Adaptive:
    """A hook of `run`: judge each prediction, or each observation, by the innovation, before the update.

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
            raise ValueError(f"the hook {self.by!r} is unknown: the hooks are {', '.join(HOOKS)}")
        thresholds(self.k0, self.k1)
        if not 0.0 < scalar("floor", self.floor) <= 1.0:
            raise ValueError(f"floor = {self.floor:g} of the adaptive factor: it must be above 0 and at most 1")
        if whole("states", self.states) < 1:
            raise ValueError(f"states = {self.states}: at least one state must be determined")


@functools.cache
def judgement():
    """The hooks as machine code, which only a run with a hook has to wait for."""
    return njit([JUDGE], cache=True)(adapt_step)


@njit(JUDGE, cache=True)
def no_judgement(by, P, residual, H, R, k0, k1, floor, states, whitened, weights):
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
        N, variance, leading = np.empty((m, states)), np.empty(m), np.empty((states, states))
        for j in range(states):
            for a in range(m):
                N[a, j] = H[a, j]
            for i in range(states):
                leading[i, j] = P[i, j]
        for a in range(m):
            variance[a] = R[a, a]
        d, U = np.empty(states), np.empty((states, states))
        found = equivalent_weights_step(N, residual, variance, k0, k1, PASSES if by == _ROBUST else 1, d, U, weights)
        if found != 0 or by != _ROBUST:
            for a in range(m):
                weights[a] = 1.0
        if found != 0:
            return 0, np.nan
        s = norm_ratio(d, leading) if by == _LITERAL else state_discrepancy(d, leading, U)
        if np.isnan(s):
            return 1, 1.0
        alpha = three_part(s, k0, k1, floor)
    inflate_step(P, alpha)
    for a in range(m):
        for b in range(m):
            if R[a, b] != 0.0:
                w, v = max(weights[a], FLOOR), max(weights[b], FLOOR)
                R[a, b] /= w if a == b else np.sqrt(w * v)
    return 0, alpha
