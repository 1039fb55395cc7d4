"""Robust estimation: weights of IGG-III and Huber, a chi-square gate, weighted updates, iterated equivalent weights.

Where the weight acts decides everything. On innovations V / sqrt(S) an outlier is judged against what the filter
predicts; on residuals of a single-epoch least squares it is judged against the observations of the same epoch, and an
observation that carries all the information pulls the solution to itself and shows no residual (see
`redundancy_numbers`).

Cost on clean data: k0 = 1.5 touches 13 % of good observations, k0 = 3 one in 370. The variance of a mean of Gaussian
data grows by 4 % (Huber 1.5), 44 % (IGG-III 1.5/2.5, which throws away) and 0.5 % (IGG-III 3/8).
Where the dynamics are wrong, a large innovation is no outlier: never combine these weights with too small a process
noise.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from scipy.special import gammaincinv

from geokalman.kalman.checks import array, plain, scalar
from geokalman.kalman.dense import cholesky_upper, solve_lower, solve_upper
from geokalman.kalman.gaussian import Innovation

FLOOR = 1e-8
"""Smallest weight: an observation that is refused keeps a finite variance, 1e8 times its own."""
SINGULAR = 1e-12
"""Pivot of a normal matrix, relative to its diagonal, below which the observations leave a direction undetermined."""


@njit(cache=True)
def igg3(s: float, k0: float, k1: float) -> float:
    """Weight of IGG-III: 1 for |s| <= k0, (k0/|s|) ((k1 - |s|)/(k1 - k0))^2 up to k1, 0 beyond.

    s : standardised residual; 0 < k0 < k1. Source: Yang (1994); Yang, He & Xu (2001), J. Geodesy 75, 109-116.
    """
    a = abs(s)
    if a <= k0:
        return 1.0
    if a <= k1:
        t = (k1 - a) / (k1 - k0)
        return k0 / a * t * t
    return 0.0


@njit(cache=True)
def huber(s: float, k0: float) -> float:
    """Weight of Huber: 1 for |s| <= k0, k0/|s| beyond.  s : standardised residual; k0 > 0. Source: Huber (1964)."""
    a = abs(s)
    return 1.0 if a <= k0 else k0 / a


@njit(cache=True)
def innovation_weights_step(residual: np.ndarray, S: np.ndarray, k0: float, k1: float, weights: np.ndarray) -> None:
    """IGG-III weights of innovations, each against its own S_aa, not below FLOOR; k1 = inf gives Huber's weights.

    residual : (m,); S : (m, m); output weights : (m,) in (0, 1].
    """
    for a in range(residual.shape[0]):
        s = residual[a] / np.sqrt(S[a, a])
        w = huber(s, k0) if np.isinf(k1) else igg3(s, k0, k1)
        weights[a] = max(w, FLOOR)


@njit(cache=True)
def normal_step(N: np.ndarray, z: np.ndarray, p: np.ndarray, x: np.ndarray, U: np.ndarray) -> int:
    """Weighted least squares x = (N' P N)^-1 N' P z with P = diag(p), and the root U of its normal matrix U' U = N'
    P N.

    N : (m, n); z, p : (m,); outputs x : (n,) and U : (n, n).
    Returns 0, or k >= 1 when direction k - 1 is not determined (a pivot below SINGULAR of its diagonal element).
    """
    m, n = N.shape
    A, b = np.zeros((n, n)), np.zeros((n, 1))
    for a in range(m):
        for i in range(n):
            b[i, 0] += p[a] * N[a, i] * z[a]
            for j in range(n):
                A[i, j] += p[a] * N[a, i] * N[a, j]
    status = cholesky_upper(A, U)
    if status != 0:
        return status
    for k in range(n):
        if not U[k, k] * U[k, k] > SINGULAR * A[k, k]:
            return k + 1
    solve_lower(U, b)
    solve_upper(U, b)
    for i in range(n):
        x[i] = b[i, 0]
    return 0


@njit(cache=True)
def equivalent_weights_step(
    N: np.ndarray,
    z: np.ndarray,
    variance: np.ndarray,
    k0: float,
    k1: float,
    passes: int,
    x: np.ndarray,
    U: np.ndarray,
    weights: np.ndarray,
) -> int:
    """Iterated least squares with IGG-III equivalent weights of its own residuals (res / sigma), as many passes as
    asked for.

    Each pass: x and U with the weights so far, then weights = igg3((z - N x) / sigma), not below FLOOR. So x and U
    belong
    to the weights of the pass before the last one.
    N : (m, n); z, variance : (m,); outputs x : (n,), U : (n, n) root of the normal matrix, weights : (m,).
    Returns the status of `normal_step`. Source: Yang, He & Xu (2001); mars-pulsar (19), (20).
    """
    m, n = N.shape
    p = np.empty(m)
    for a in range(m):
        weights[a] = 1.0
    for _ in range(passes):
        for a in range(m):
            p[a] = weights[a] / variance[a]
        status = normal_step(N, z, p, x, U)
        if status != 0:
            return status
        if m == n:
            continue  # no redundancy: residuals are rounding, weights stay 1
        for a in range(m):
            residual = z[a]
            for j in range(n):
                residual -= N[a, j] * x[j]
            weights[a] = max(igg3(residual / np.sqrt(variance[a]), k0, k1), FLOOR)
    return 0


def redundancy_numbers(N, variance) -> np.ndarray:
    """Redundancy numbers r_a = 1 - [N (N' R^-1 N)^-1 N' R^-1]_aa of a least-squares fit: the share of an error that
    its residual shows.

    N : (m, n); variance : (m,), positive. Returns (m,), between 0 (never seen) and 1; their sum is m - n.
    Raises ValueError for a design that leaves a direction undetermined.

    >>> redundancy_numbers([[1.0], [1.0], [1.0], [1.0]], [1.0, 1.0, 1.0, 1.0]).tolist()  # a mean of four
    [0.75, 0.75, 0.75, 0.75]
    """
    N = array("N", N, None, None)
    variance = positive("variance", array("variance", variance, len(N)))
    x, U = np.empty(N.shape[1]), np.empty((N.shape[1], N.shape[1]))
    status = normal_step(N, np.zeros(len(N)), 1.0 / variance, x, U)
    if status != 0:
        raise ValueError(
            f"the {len(N)} observations leave direction {status - 1} undetermined; redundancy numbers need full rank"
        )
    B = np.ascontiguousarray(N.T)
    solve_lower(U, B)
    return 1.0 - (B * B).sum(0) / variance


def gate(innovation: Innovation, probability: float = 0.999) -> bool:
    """Chi-square gate: does V' S^-1 V lie below the quantile of its degrees of freedom?

    innovation : of an update; missing components do not count. Raises ValueError for a probability outside (0, 1).

    >>> gate(Innovation(np.zeros(2), np.eye(2), np.array([1.0, -2.0])))
    True
    """
    if not 0.0 < probability < 1.0:
        raise ValueError(f"probability = {probability}: it must lie between 0 and 1")
    w = plain("whitened", innovation.whitened, missing=True)
    w = w[~np.isnan(w)]
    return bool(w.size == 0 or (w**2).sum() <= 2.0 * gammaincinv(0.5 * w.size, probability))


def thresholds(k0: float, k1: float) -> None:
    """Raise ValueError unless 0 < k0 < k1."""
    if not 0.0 < scalar("k0", k0) < scalar("k1", k1):
        raise ValueError(f"thresholds k0 = {k0}, k1 = {k1}: they must be positive and k0 below k1")


def positive(name: str, values: np.ndarray) -> np.ndarray:
    """The values, unless one is not positive: then ValueError with its place."""
    if not (values > 0.0).all():
        a = int(np.argmin(values > 0.0))
        raise ValueError(f"{name}[{a}] = {values[a]:g}: it must be positive")
    return values
