"""The scaled unscented Kalman filter, written in differences so that nothing cancels.

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
from geokalman.kalman.dense import (
    add_product, add_vector_product, cholesky_upper, mirror, solve_lower, solve_upper, transposed,
)  # fmt: skip
from geokalman.kalman.gaussian import Gaussian, Innovation, gaussian
from geokalman.kalman.linear import refuse, rows_seen, whiten


@njit(cache=True)
def sigma_points_step(x, P, c, chi, U):
    """Draw the sigma points of N(x, P).

    chi_0 = x,  chi_(2i-1) = x - c p_i,  chi_(2i) = x + c p_i.
    x : (n,); P : (n, n); c = sqrt(n + lambda) from `spread`; outputs chi : (2 n + 1, n) and U : (n, n) upper triangular
    with P = U' U, whose row i - 1 is p_i, i = 1..n.
    Returns 0, or k >= 1 when P is not positive definite in row k - 1.
    """
    n = x.size
    status = cholesky_upper(P, U)
    if status != 0:
        return status
    for j in range(n):
        chi[0, j] = x[j]
        for i in range(n):
            plus = x[j] + c * U[i, j]
            chi[2 * i + 1, j] = x[j] - (plus - x[j])  # symmetric to the last bit: linear parts leave no s_i
            chi[2 * i + 2, j] = plus
    return 0


@njit(cache=True)
def transform_step(gamma, noise, c, w, mean, D, remainder, cov):
    """Compute mean and covariance of y = h(x) + v from the images of the sigma points.

    They are the sums of the module docstring.
    gamma : (2 n + 1, m) images, in the order of the points; noise : (m, m), of v ~ N(0, noise); c, w from
    `spread`. Outputs mean : (m,); D : (n, m) rows d_i; remainder : (m, m) = cov - D' D; cov : (m, m).
    """
    n, m = D.shape
    half, s = 0.5 / c, np.empty((n, m))
    for a in range(m):
        mean[a] = 0.0
        for i in range(n):
            up, down = gamma[2 * i + 2, a] - gamma[0, a], gamma[2 * i + 1, a] - gamma[0, a]
            D[i, a], s[i, a] = half * (up - down), half * (up + down)
            mean[a] += s[i, a]
        mean[a] /= c
    for a in range(m):
        for b in range(m):
            remainder[a, b] = 0.5 * (noise[a, b] + noise[b, a])
            cov[a, b] = 0.0
    add_product(remainder, 1.0, transposed(s), s)
    add_product(cov, 1.0, transposed(D), D)
    for a in range(m):
        for b in range(m):
            remainder[a, b] += w * (mean[a] * mean[b])
            cov[a, b] += remainder[a, b]
    for a in range(m):
        mean[a] += gamma[0, a]


@njit(cache=True)
def unscented_update_step(x, P, U, gamma, z, R, c, w, S, whitened):
    """Condition N(x, P) on z = h(x) + v, v ~ N(0, R), given gamma = h(chi), in place.

    K = cross S^-1,  x += K (z - mean),  P - K S K' evaluated as (L - K D')(L - K D')' + K (S - D' D) K' with L = U',
    a sum of squares: symmetric and positive definite without help.
    x : (n,); P, U : (n, n), chi and U from `sigma_points_step`, U is overwritten; gamma : (2 n + 1, m); z : (m,);
    R : (m, m); c, w from `spread`; outputs S : (m, m) and whitened : (m,) innovation.
    Returns 0, or k >= 1 when S is not positive definite in row k - 1 (x and P are then unchanged).
    """
    n, m = x.size, z.size
    residual, D, remainder, root = np.empty(m), np.empty((n, m)), np.empty((m, m)), np.empty((m, m))
    transform_step(gamma, R, c, w, residual, D, remainder, S)
    status = cholesky_upper(S, root)
    if status != 0:
        return status
    for a in range(m):
        residual[a] = z[a] - residual[a]
    whiten(root, residual, whitened)
    K, rest = np.zeros((m, n)), np.zeros((m, n))
    add_product(K, 1.0, transposed(D), U)  # K' = S^-1 cross'
    solve_lower(root, K)
    solve_upper(root, K)
    add_vector_product(x, 1.0, residual, K)
    add_product(U, -1.0, D, K)  # (L - K D')'
    add_product(rest, 1.0, remainder, K)
    for i in range(n):
        for j in range(n):
            P[i, j] = 0.0
    add_product(P, 1.0, transposed(U), U)
    add_product(P, 1.0, transposed(K), rest)
    mirror(P)
    return 0


@njit(cache=True)
def seen_update_step(x, P, U, gamma, z, R, c, w, whitened):
    """Condition N(x, P) on the components of z that are not NaN, given gamma, in place.

    Arguments as in `unscented_update_step`; whitened stays as it is where z is NaN.
    Returns 0, or k >= 1 when the innovation covariance is not positive definite in component k - 1.
    """
    seen, z, columns, R = rows_seen(z, transposed(gamma), R)
    white = np.empty(seen.size)
    status = unscented_update_step(x, P, U, transposed(columns), z, R, c, w, np.empty(R.shape), white)
    if status != 0:
        return seen[status - 1] + 1
    for b in range(seen.size):
        whitened[seen[b]] = white[b]
    return 0


def spread(n: int, alpha: float, beta: float, kappa: float) -> tuple[float, float]:
    """Scale the sigma points.

    c = sqrt(n + lambda) = alpha sqrt(n + kappa),  w = beta - alpha^2.
    n : number of states; alpha > 0, beta, kappa > -n : the parameters of the scaled transform (Julier 2002).
    Raises ValueError where n + lambda is not positive.

    >>> spread(4, 0.5, 2.0, 0.0)
    (1.0, 1.75)
    """
    alpha, beta, kappa = scalar("alpha", alpha), scalar("beta", beta), scalar("kappa", kappa)
    if not (alpha > 0.0 and n + kappa > 0.0):
        given = f"alpha = {alpha} and kappa = {kappa} with n = {n}"
        raise ValueError(f"{given} give no sigma points: alpha and n + kappa must be positive.")
    return alpha * float(np.sqrt(n + kappa)), beta - alpha**2


def weights(n: int, alpha: float, beta: float, kappa: float) -> tuple[np.ndarray, np.ndarray]:
    """Give the textbook weights of the 2 n + 1 sigma points, which the kernels do not use.

    Wm0 = lambda / (n + lambda),  Wc0 = Wm0 + 1 - alpha^2 + beta,  Wi = 1 / (2 (n + lambda)),
    lambda = alpha^2 (n + kappa) - n.
    Returns Wm, Wc : (2 n + 1,), for the mean and for the covariance. Raises ValueError as `spread`.
    Source: grace-fusion (32), (35)-(37).

    >>> weights(2, 1.0, 0.0, 2.0)[0].tolist()
    [0.5, 0.125, 0.125, 0.125, 0.125]
    """
    c, w = spread(n, alpha, beta, kappa)
    Wm = np.r_[1.0 - n / c**2, np.full(2 * n, 0.5 / c**2)]
    Wc = Wm.copy()
    Wc[0] += 1.0 + w
    return Wm, Wc


def sigma_points(x: Gaussian, alpha: float = 1.0, beta: float = 2.0, kappa: float = 0.0) -> np.ndarray:
    """Draw the sigma points (2 n + 1, n) of a Gaussian.

    They are the mean, then mean - c p_i and mean + c p_i for each column p_i of the root.
    Raises NotPositiveDefinite where the covariance has no root of full rank. Source: grace-fusion (29)-(31).

    >>> from geokalman.kalman import gaussian
    >>> sigma_points(gaussian([1.0], [4.0])).tolist()
    [[1.0], [-1.0], [3.0]]
    """
    mean, P = gaussian(*x)
    return _draw(mean, P, spread(len(mean), alpha, beta, kappa)[0], "covariance")[0]


def predict(posterior: Gaussian, f: Callable, Q, alpha: float = 1.0, beta: float = 2.0, kappa: float = 0.0) -> Gaussian:
    """Propagate a Gaussian through x_next = f(x) + w, w ~ N(0, Q), by the unscented transform.

    f : takes and gives (n,); Q : (n, n), positive semidefinite; alpha, beta, kappa as in `spread`.
    Raises ValueError for wrong input, NotPositiveDefinite where the posterior has no root of full rank.
    Source: grace-fusion (33), (38), (39).

    >>> from geokalman.kalman import gaussian
    >>> predict(gaussian([3.0], [4.0]), lambda x: x**2, [[0.0]]).mean.item()  # mean^2 + variance
    13.0
    """
    x, P = gaussian(*posterior)
    n, Q = len(x), covariance("Q", Q, len(x))
    c, w = spread(n, alpha, beta, kappa)
    chi, _ = _draw(x, P, c, "posterior covariance")
    mean, cov = np.empty(n), np.empty((n, n))
    transform_step(_images("f(x)", f, chi, n), Q, c, w, mean, np.empty((n, n)), np.empty((n, n)), cov)
    return Gaussian(mean, cov)


def update(
    prior: Gaussian, z, h: Callable, R, alpha: float = 1.0, beta: float = 2.0, kappa: float = 0.0
) -> tuple[Gaussian, Innovation]:
    """Condition a Gaussian on z = h(x) + v, v ~ N(0, R), by the unscented transform of it.

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
    m, R = len(z), covariance("R", R, len(z))
    c, w = spread(len(x), alpha, beta, kappa)
    residual, S, whitened = np.full(m, np.nan), np.full((m, m), np.nan), np.full(m, np.nan)
    seen = np.flatnonzero(~np.isnan(z))
    if seen.size:
        chi, U = _draw(x, P, c, "prior covariance")
        gamma = np.ascontiguousarray(_images("h(x)", h, chi, m)[:, seen])
        S_seen, white = np.empty((seen.size, seen.size)), np.empty(seen.size)
        status = unscented_update_step(x, P, U, gamma, z[seen], R[np.ix_(seen, seen)], c, w, S_seen, white)
        refuse(seen[status - 1] + 1 if status else 0)
        S[np.ix_(seen, seen)], whitened[seen], residual[seen] = S_seen, white, np.linalg.cholesky(S_seen) @ white
    return Gaussian(x, P), Innovation(residual, S, whitened)


def _draw(x, P, c, matrix) -> tuple[np.ndarray, np.ndarray]:
    n = len(x)
    chi, U = np.empty((2 * n + 1, n)), np.empty((n, n))
    status = sigma_points_step(x, P, c, chi, U)
    if status != 0:
        raise NotPositiveDefinite(matrix, detail=f"its Cholesky pivot {status - 1} is not positive")
    return chi, U


def _images(name: str, function: Callable, chi: np.ndarray, m: int) -> np.ndarray:
    return np.array([array(name, function(point), m) for point in chi])
