"""The scaled unscented Kalman filter: sigma points, transform, update; written in differences so that nothing cancels.

With n + lambda = alpha^2 (n + kappa) = c^2 the textbook weights are Wm0 = lambda / c^2, Wc0 = Wm0 + 1 - alpha^2 + beta
and Wi = 1 / (2 c^2). They add up to one, so with d_i = (gamma_i+ - gamma_i-) / (2 c) and s_i = (gamma_i+ - 2 gamma_0 +
gamma_i-) / (2 c) the weighted sums are, exactly,

    mean  = gamma_0 + mu,   mu = sum_i s_i / c,
    cov   = noise + sum_i (d_i d_i' + s_i s_i') + (beta - alpha^2) mu mu',
    cross = sum_i p_i d_i'  with p_i the i-th column of the root of P.

No large weights of opposite sign remain, whatever alpha; and for beta >= 0, kappa >= 0 the part that does not come from
d is at least `noise`, so that the update below leaves a positive definite covariance by construction.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numba import njit

from geokalman.kalman.checks import NotPositiveDefinite, array, covariance, scalar
from geokalman.kalman.dense import cholesky_upper, solve_lower, solve_upper
from geokalman.kalman.gaussian import Gaussian, Innovation, gaussian
from geokalman.kalman.linear import whiten


@njit(cache=True)
def sigma_points_step(x: np.ndarray, P: np.ndarray, c: float, chi: np.ndarray, U: np.ndarray) -> int:
    """Draw the 2 n + 1 sigma points of N(x, P): chi_0 = x, chi_(2i-1) = x - c p_i, chi_(2i) = x + c p_i, i = 1..n.

    x : (n,); P : (n, n); c = sqrt(n + lambda) from `spread`; outputs chi : (2 n + 1, n) and U : (n, n) upper triangular
    with P = U' U, whose row i - 1 is p_i.
    Returns 0, or k >= 1 when P is not positive definite in row k - 1.
    """
    n = x.shape[0]
    status = cholesky_upper(P, U)
    if status != 0:
        return status
    for j in range(n):
        chi[0, j] = x[j]
    for i in range(n):
        for j in range(n):
            plus = x[j] + c * U[i, j]
            minus = x[j] - (plus - x[j])  # symmetric to the last bit: linear parts leave no second difference
            chi[2 * i + 1, j] = minus
            chi[2 * i + 2, j] = plus
    return 0


@njit(cache=True)
def transform_step(
    gamma: np.ndarray,
    noise: np.ndarray,
    c: float,
    w: float,
    mean: np.ndarray,
    D: np.ndarray,
    remainder: np.ndarray,
    cov: np.ndarray,
) -> None:
    """Mean and covariance of y = h(x) + v, v ~ N(0, noise), from the transformed sigma points (module docstring).

    gamma : (2 n + 1, m) images of the sigma points, in their order; noise : (m, m); c, w from `spread`.
    Outputs mean : (m,); D : (n, m) rows d_i; remainder : (m, m) = cov - D' D; cov : (m, m).
    """
    n, m = D.shape
    for a in range(m):
        mean[a] = 0.0
        for b in range(m):
            remainder[a, b] = 0.5 * (noise[a, b] + noise[b, a])
            cov[a, b] = 0.0
    s = np.empty(m)
    half = 0.5 / c
    for i in range(n):
        for a in range(m):
            up = gamma[2 * i + 2, a] - gamma[0, a]
            down = gamma[2 * i + 1, a] - gamma[0, a]
            D[i, a] = half * (up - down)
            s[a] = half * (up + down)
            mean[a] += s[a]
        for a in range(m):
            for b in range(m):
                remainder[a, b] += s[a] * s[b]
                cov[a, b] += D[i, a] * D[i, b]
    for a in range(m):
        mean[a] /= c
    for a in range(m):
        for b in range(a + 1):
            remainder[a, b] += w * (mean[a] * mean[b])
            cov[a, b] += remainder[a, b]
            remainder[b, a] = remainder[a, b]
            cov[b, a] = cov[a, b]
    for a in range(m):
        mean[a] += gamma[0, a]


@njit(cache=True)
def unscented_update_step(
    x: np.ndarray,
    P: np.ndarray,
    U: np.ndarray,
    gamma: np.ndarray,
    z: np.ndarray,
    R: np.ndarray,
    c: float,
    w: float,
    S: np.ndarray,
    whitened: np.ndarray,
) -> int:
    """Condition N(x, P) on z = h(x) + v, v ~ N(0, R), given gamma = h(chi), in place.

    K = cross S^-1,  x += K (z - mean),  P - K S K' evaluated as (L - K D')(L - K D')' + K (S - D' D) K' with L = U',
    a sum of squares: symmetric and positive definite without help.
    x : (n,); P, U : (n, n), chi and U from `sigma_points_step`; gamma : (2 n + 1, m); z : (m,); R : (m, m); c, w from
    `spread`; outputs S : (m, m) and whitened : (m,) innovation.
    Returns 0, or k >= 1 when S is not positive definite in row k - 1 (x and P are then unchanged).
    """
    n = x.shape[0]
    m = z.shape[0]
    mean = np.empty(m)
    D = np.empty((n, m))
    remainder = np.empty((m, m))
    transform_step(gamma, R, c, w, mean, D, remainder, S)
    root = np.empty((m, m))
    status = cholesky_upper(S, root)
    if status != 0:
        return status
    K = np.zeros((m, n))  # K'
    for i in range(n):
        for a in range(m):
            for j in range(i, n):
                K[a, j] += D[i, a] * U[i, j]
    solve_lower(root, K)
    solve_upper(root, K)
    residual = mean
    for a in range(m):
        residual[a] = z[a] - mean[a]
        for j in range(n):
            x[j] += K[a, j] * residual[a]
    whiten(root, residual, whitened)
    row = np.empty(n)
    for i in range(n):
        for j in range(n):
            P[i, j] = 0.0
    for i in range(n):
        for j in range(n):
            row[j] = U[i, j]
        for a in range(m):
            for j in range(n):
                row[j] -= D[i, a] * K[a, j]
        for k in range(n):
            for j in range(k, n):
                P[k, j] += row[k] * row[j]
    for a in range(m):
        for j in range(n):
            row[j] = 0.0
        for b in range(m):
            for j in range(n):
                row[j] += remainder[a, b] * K[b, j]
        for k in range(n):
            for j in range(k, n):
                P[k, j] += K[a, k] * row[j]
    for i in range(n):
        for j in range(i):
            P[i, j] = P[j, i]
    return 0


def spread(n: int, alpha: float, beta: float, kappa: float) -> tuple[float, float]:
    """Scaling of the sigma points:  c = sqrt(n + lambda) = alpha sqrt(n + kappa)  and  w = beta - alpha^2.

    n : number of states; alpha > 0, beta, kappa > -n : the parameters of the scaled transform (Julier 2002).
    Raises ValueError where n + lambda is not positive.
    """
    alpha, beta, kappa = scalar("alpha", alpha), scalar("beta", beta), scalar("kappa", kappa)
    if not (alpha > 0.0 and n + kappa > 0.0):
        given = f"alpha = {alpha} and kappa = {kappa} with n = {n}"
        raise ValueError(f"{given} give no sigma points: alpha and n + kappa must be positive")
    return alpha * float(np.sqrt(n + kappa)), beta - alpha**2


def weights(n: int, alpha: float, beta: float, kappa: float) -> tuple[np.ndarray, np.ndarray]:
    """The textbook weights of the 2 n + 1 sigma points, for the mean and for the covariance (not used by the kernels).

    Wm0 = lambda / (n + lambda),  Wc0 = Wm0 + 1 - alpha^2 + beta,  Wi = 1 / (2 (n + lambda)),  lambda = alpha^2 (n +
    kappa) - n.
    Returns Wm, Wc : (2 n + 1,). Raises ValueError as `spread`. Source: grace-fusion (32), (35)-(37).

    >>> weights(2, 1.0, 0.0, 2.0)[0].tolist()
    [0.5, 0.125, 0.125, 0.125, 0.125]
    """
    c, _ = spread(n, alpha, beta, kappa)
    Wm = np.full(2 * n + 1, 0.5 / c**2)
    Wc = Wm.copy()
    Wm[0] = (c**2 - n) / c**2
    Wc[0] = Wm[0] + 1.0 - alpha**2 + beta
    return Wm, Wc


def sigma_points(x: Gaussian, alpha: float = 1.0, beta: float = 2.0, kappa: float = 0.0) -> np.ndarray:
    """The sigma points (2 n + 1, n) of a Gaussian: the mean, then for each column p_i of the root mean - c p_i, mean +
    c p_i.

    Raises NotPositiveDefinite where the covariance has no root of full rank. Source: grace-fusion (29)-(31).

    >>> from geokalman.kalman import gaussian
    >>> sigma_points(gaussian([1.0], [4.0])).tolist()
    [[1.0], [-1.0], [3.0]]
    """
    mean, P = gaussian(*x)
    c, _ = spread(len(mean), alpha, beta, kappa)
    return _draw(mean, P, c, "covariance")[0]


def predict(
    posterior: Gaussian,
    f: Callable[[np.ndarray], np.ndarray],
    Q,
    alpha: float = 1.0,
    beta: float = 2.0,
    kappa: float = 0.0,
) -> Gaussian:
    """Propagate a Gaussian through x_next = f(x) + w, w ~ N(0, Q), by the scaled unscented transform.

    f : takes and gives (n,); Q : (n, n), positive semidefinite; alpha, beta, kappa as in `spread`.
    Raises ValueError for wrong input, NotPositiveDefinite where the posterior has no root of full rank.
    Source: grace-fusion (33), (38), (39).

    >>> from geokalman.kalman import gaussian
    >>> predict(gaussian([3.0], [4.0]), lambda x: x**2, [[0.0]]).mean.item()  # mean^2 + variance
    13.0
    """
    x, P = gaussian(*posterior)
    n = len(x)
    c, w = spread(n, alpha, beta, kappa)
    mean, cov, _, _ = _propagate(x, P, f, covariance("Q", Q, n), c, w, "posterior covariance")
    return Gaussian(mean, cov)


def update(
    prior: Gaussian,
    z,
    h: Callable[[np.ndarray], np.ndarray],
    R,
    alpha: float = 1.0,
    beta: float = 2.0,
    kappa: float = 0.0,
) -> tuple[Gaussian, Innovation]:
    """Condition a Gaussian on z = h(x) + v, v ~ N(0, R), by the scaled unscented transform, redrawn from the prior.

    z : (m,) measured, NaN where missing [sensor units]; h : takes (n,), gives (m,); R : (m, m); alpha, beta, kappa as
    in `spread`. Returns the posterior and Innovation(residual, S, whitened), whitened ~ N(0, I) if the model is right.
    Raises ValueError for wrong input, NotPositiveDefinite where the prior or S has no root of full rank.
    Source: grace-fusion (26)-(28), (34)-(43).

    >>> from geokalman.kalman import gaussian
    >>> posterior, innovation = update(gaussian([0.0], [3.0]), [2.0], lambda x: x, [[1.0]])
    >>> round(posterior.mean.item(), 12), round(posterior.cov.item(), 12)
    (1.5, 0.75)
    """
    x, P = gaussian(*prior)
    z = array("z", z, None, missing=True)
    R = covariance("R", R, len(z))
    return _update(x, P, z, h, R, *spread(len(x), alpha, beta, kappa))


def _draw(x, P, c, matrix, epoch=None, t=None) -> tuple[np.ndarray, np.ndarray]:
    n = len(x)
    chi, U = np.empty((2 * n + 1, n)), np.empty((n, n))
    status = sigma_points_step(x, P, c, chi, U)
    if status != 0:
        raise NotPositiveDefinite(matrix, epoch, t, f"its Cholesky pivot {status - 1} is not positive")
    return chi, U


def _propagate(x, P, f, Q, c, w, matrix, epoch=None, t=None):
    n = len(x)
    chi, U = _draw(x, P, c, matrix, epoch, t)
    image = np.array([array("f(x)", f(point), n) for point in chi])
    mean, D, remainder, cov = np.empty(n), np.empty((n, n)), np.empty((n, n)), np.empty((n, n))
    transform_step(image, Q, c, w, mean, D, remainder, cov)
    solve_upper(U, D)  # now D' is the linearisation cross' P^-1
    return mean, cov, D.T, remainder


def _update(x, P, z, h, R, c, w, epoch=None, t=None) -> tuple[Gaussian, Innovation]:
    m = len(z)
    seen = np.flatnonzero(~np.isnan(z))
    residual, S, whitened = np.full(m, np.nan), np.full((m, m), np.nan), np.full(m, np.nan)
    if seen.size == 0:
        return Gaussian(x, P), Innovation(residual, S, whitened)
    chi, U = _draw(x, P, c, "prior covariance", epoch, t)
    image = np.ascontiguousarray(np.array([array("h(x)", h(point), m) for point in chi])[:, seen])
    x, P = x.copy(), P.copy()
    S_seen, w_seen = np.empty((seen.size, seen.size)), np.empty(seen.size)
    status = unscented_update_step(x, P, U, image, z[seen], R[np.ix_(seen, seen)], c, w, S_seen, w_seen)
    if status != 0:
        detail = f"the pivot of observed component {status - 1} is not positive"
        raise NotPositiveDefinite("innovation covariance", epoch, t, detail)
    S[np.ix_(seen, seen)], whitened[seen] = S_seen, w_seen
    root = np.linalg.cholesky(S_seen)
    residual[seen] = root @ w_seen
    return Gaussian(x, P), Innovation(residual, S, whitened)
