"""From continuous dynamics to one discrete step: van Loan's method, and closed forms."""

from __future__ import annotations

from math import comb, exp, expm1, factorial

import numpy as np

from geokalman.kalman.checks import array, covariance, plain, scalar, whole


def van_loan(F, W, h: float) -> tuple[np.ndarray, np.ndarray]:
    """Compute transition matrix and process noise of x' = F x + w, w white, over a step.

    Phi = exp(F h),   Q = int_0^h exp(F s) W exp(F s)' ds.
    F : (n, n) [1/s, per state units]; W : (n, n), power density of w, symmetric positive semidefinite
    [state units^2 / s] (= B Qc B'); h : step [s], positive. Returns Phi, Q : (n, n), Q exactly symmetric.
    A step that is long against the dynamics is halved until the exponential is tame, then doubled by
    Q(2 h) = Phi Q Phi' + Q: exp(-F h), which van Loan's block holds, would swamp Q.
    Raises ValueError for wrong shapes and for h not positive.
    Source: van Loan (1978), IEEE Trans. Autom. Control 23, 395-404; grace-fusion (14), (15).

    >>> Phi, Q = van_loan([[0.0, 1.0], [0.0, 0.0]], [[0.0, 0.0], [0.0, 3.0]], 2.0)  # white acceleration
    >>> Phi.round(12).tolist(), Q.round(12).tolist()
    ([[1.0, 2.0], [0.0, 1.0]], [[8.0, 6.0], [6.0, 6.0]])
    """
    from scipy.linalg import expm  # a third of a second

    h, F = _positive("h", h), plain("F", F)
    n = len(F) if F.ndim else 1
    F = array("F", F, n, n)
    W = covariance("W", W, n)
    halvings = max(0, int(np.ceil(np.log2(max(np.linalg.norm(F, 1) * h, 1.0)))))
    short = h / 2**halvings
    block = np.zeros((2 * n, 2 * n))
    size = np.abs(W).max(initial=0.0) or 1.0  # Q is linear in W, whose units must not steer the exponential
    block[:n, :n], block[:n, n:], block[n:, n:] = -F, W / size, F.T
    exponential = expm(block * short)
    Phi = exponential[n:, n:].T
    Q = Phi @ exponential[:n, n:]
    for _ in range(halvings):
        Q = Phi @ Q @ Phi.T + Q
        Phi = Phi @ Phi
    return np.ascontiguousarray(Phi), 0.5 * size * (Q + Q.T)


def integrated_white_noise(order: int, h: float, q: float, axes: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Make the kinematic model whose derivative of an order is white noise.

    Order 2 is white acceleration, 3 white jerk.

    Phi_ij = h^(j-i) / (j-i)!,   Q_ij = q h^(2p-1-i-j) / ((2p-1-i-j) (p-1-i)! (p-1-j)!),  i, j = 0..p-1, p = order.
    h : step [s]; q : power density of that derivative [m^2 s^(1 - 2 p)], the same on each axis; axes : 1 to 3.
    Returns Phi, Q : (order axes, order axes) for the state [position; velocity; ...], each part with all its axes.
    Raises ValueError for an order or a number of axes below 1, for h not positive, for q negative.

    >>> Phi, Q = integrated_white_noise(2, 2.0, 3.0)
    >>> Q.tolist()
    [[8.0, 6.0], [6.0, 6.0]]
    """
    h, q = _positive("h", h), scalar("q", q)
    order, axes = whole("order", order), whole("axes", axes)
    if order < 1 or axes < 1:
        raise ValueError(f"order = {order} and axes = {axes}: both must be at least 1.")
    if not 0.0 <= q < np.inf:
        raise ValueError(f"q = {q} is no power density: it must be finite and not negative.")
    p = order
    Phi = np.array([[h ** (j - i) / factorial(j - i) if j >= i else 0.0 for j in range(p)] for i in range(p)])
    Q = np.empty((p, p))
    for i in range(p):
        for j in range(p):
            power = 2 * p - 1 - i - j
            Q[i, j] = q * h**power / (power * factorial(p - 1 - i) * factorial(p - 1 - j))
    return np.kron(Phi, np.eye(axes)), np.kron(Q, np.eye(axes))


def white_jerk(h: float, q: float, axes: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """Make the kinematic model [position; velocity; acceleration] driven by white jerk.

    Q = q [[h^5/20, h^4/8, h^3/6], [h^4/8, h^3/3, h^2/2], [h^3/6, h^2/2, h]] (x) I_axes.
    h : step [s]; q : power density per axis [m^2 s^-5].
    Returns Phi, Q : (3 axes, 3 axes). Raises ValueError as `integrated_white_noise`.
    Source: grace-fusion (50), (51).

    >>> Phi, Q = white_jerk(10.0, 1.0, axes=1)
    >>> Phi.tolist()
    [[1.0, 10.0, 50.0], [0.0, 1.0, 10.0], [0.0, 0.0, 1.0]]
    """
    return integrated_white_noise(3, h, q, axes)


def gauss_markov(h: float, tau: float, sigma: float, order: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Make the stationary Gauss-Markov process (d/dt + 1/tau)^order x = white noise.

    Order 1:  Phi = exp(-h/tau),  Q = sigma^2 (1 - exp(-2 h/tau)).  Higher orders by `van_loan` on the companion form,
    with the power density sigma^2 beta^(2p-1) 2^(2p-1) / binom(2p-2, p-1), beta = 1/tau, p = order.
    h : step [s]; tau : time constant [s]; sigma : standard deviation of x [its unit]; order >= 1.
    Returns Phi, Q : (order, order) for the state [x; x'; ...]. Raises ValueError where h, tau or order is not positive.
    Source: Gelb (1974), Applied Optimal Estimation, section 2.2.

    >>> Phi, Q = gauss_markov(60.0, tau=600.0, sigma=2.0)
    >>> round(float(Phi[0, 0] ** 2 * 4.0 + Q[0, 0]), 12)  # it is stationary
    4.0
    """
    h, tau, sigma = _positive("h", h), _positive("tau", tau), scalar("sigma", sigma)
    order = whole("order", order)
    if order < 1 or not 0.0 <= sigma < np.inf:
        raise ValueError(f"order = {order}, sigma = {sigma}: order must be at least 1, sigma finite and not negative.")
    if order == 1:
        return np.array([[exp(-h / tau)]]), np.array([[-(sigma**2) * expm1(-2.0 * h / tau)]])
    # In units of tau the companion matrix is free of large and small numbers; the derivatives are scaled back after.
    p = order
    F = np.diag(np.ones(p - 1), 1)
    F[-1] = [-comb(p, i) for i in range(p)]
    W = np.zeros((p, p))
    W[-1, -1] = sigma**2 * 2 ** (2 * p - 1) / comb(2 * p - 2, p - 1)
    Phi, Q = van_loan(F, W, h / tau)
    rate = tau ** -np.arange(p, dtype=float)
    return Phi * rate[:, None] / rate, Q * rate[:, None] * rate


def _positive(name: str, value: float) -> float:
    value = scalar(name, value)
    if not 0.0 < value < np.inf:
        raise ValueError(f"{name} = {value} s: it must be positive and finite.")
    return value
