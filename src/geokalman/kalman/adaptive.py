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

from collections.abc import Callable

import numpy as np
from numba import njit

from geokalman.kalman.checks import NotPositiveDefinite, array, covariance
from geokalman.kalman.dense import cholesky_upper, solve_lower, solve_upper
from geokalman.kalman.gaussian import Gaussian, Innovation, gaussian
from geokalman.kalman.linear import update_step, whiten
from geokalman.kalman.robust import igg3


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


def adaptive_update(
    prior: Gaussian, z, H, R, factor: Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray], float]
) -> tuple[Gaussian, Innovation, float]:
    """Condition a Gaussian on z = H x + v after its covariance was divided by an adaptive factor alpha.

    factor(residual, S, R, whitened) gives alpha in (0, 1], e.g. ``lambda V, S, R, w:
    three_part(predicted_residual(w), 1.5, 2.5, 1e-3)``;
    z : (m,), NaN where missing (left out before); H : (m, n); R : (m, m). A gap leaves the prior as it is, alpha = 1.
    Returns the posterior, the innovation with S of the prior before the division, and alpha.
    Raises ValueError for wrong input and a factor outside (0, 1], NotPositiveDefinite for S. Source: mars-pulsar (21).
    """
    x, P = gaussian(*prior)
    z = array("z", z, None, missing=True)
    H, R = array("H", H, len(z), len(x)), covariance("R", R, len(z))
    seen = np.flatnonzero(~np.isnan(z))
    residual, S, whitened = z - H @ x, np.full((len(z), len(z)), np.nan), np.full(len(z), np.nan)
    if seen.size == 0:
        return Gaussian(x, P), Innovation(residual, S, whitened), 1.0
    inner = np.ix_(seen, seen)
    Hs, Rs, rs = np.ascontiguousarray(H[seen]), np.ascontiguousarray(R[inner]), residual[seen]
    S_seen, white = np.empty_like(Rs), np.empty(seen.size)
    status = innovation_step(P, rs, Hs, Rs, S_seen, white)
    if status == 0:
        alpha = float(factor(rs, S_seen, Rs, white))
        if not 0.0 < alpha <= 1.0:
            raise ValueError(f"the adaptive factor is {alpha}: it must be above 0 and at most 1")
        inflate_step(P, alpha)
        S[inner], whitened[seen] = S_seen, white
        status = update_step(x, P, rs, Hs, Rs, np.empty_like(Rs), np.empty(seen.size))
    if status != 0:
        raise NotPositiveDefinite(
            "innovation covariance", detail=f"the pivot of observed component {status - 1} is not positive"
        )
    return Gaussian(x, P), Innovation(residual, S, whitened), alpha
