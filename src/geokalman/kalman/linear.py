"""The linear Kalman filter: predict; update in Joseph form, joint or by component.

The functions named ``*_step`` are compiled kernels on plain float64 arrays, callable from Python and by name from a
compiled loop; they trust their arguments. Above them stand the same operations on Gaussians, checked at the border.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numba import njit

from geokalman.kalman.checks import NotPositiveDefinite, array, covariance, covariances, matrices
from geokalman.kalman.dense import (
    add_product, add_vector_product, cholesky_upper, identity, mirror, solve_lower, solve_upper, symmetrise,
    transposed,
)  # fmt: skip
from geokalman.kalman.gaussian import Gaussian, Innovation, gaussian

Transition = tuple[np.ndarray, np.ndarray] | Callable[[float], tuple[np.ndarray, np.ndarray]]


@njit(cache=True)
def predict_step(x, P, Phi, Q, x_out, P_out):
    """Propagate N(x, P) through x_out = Phi x + w, w ~ N(0, Q).

    P_out = Phi P Phi' + Q, exactly symmetric.
    x, x_out : (n,); P, Phi, Q, P_out : (n, n).
    """
    n = x.size
    Phi_P = np.zeros((n, n))
    for i in range(n):
        x_out[i] = 0.0
        for j in range(n):
            P_out[i, j] = 0.5 * (Q[i, j] + Q[j, i])
    add_vector_product(x_out, 1.0, x, transposed(Phi))
    add_product(Phi_P, 1.0, Phi, P)
    add_product(P_out, 1.0, Phi, transposed(Phi_P))
    mirror(P_out)


@njit(cache=True)
def scalar_update_step(x, P, residual, H, r):
    """Condition N(x, P) on one observation, in place (Joseph form).

    S = H P H' + r,  K = P H' / S,  x += K residual,  P = (I - K H) P (I - K H)' + K r K'.
    x : (n,); P : (n, n); residual = z - h(x); H : (n,), the row dh/dx; r : its variance. Zeros of H cost little.
    Returns S; where S is not positive nothing was changed. The whitened innovation is residual / sqrt(S).
    """
    n = x.shape[0]
    work = np.empty((3, n))
    g, K, u = work[0], work[1], work[2]
    for j in range(n):
        g[j] = 0.0
    for k in range(n):
        if H[k] != 0.0:
            for j in range(n):
                g[j] += H[k] * P[k, j]
    S = r
    for k in range(n):
        S += H[k] * g[k]
    if not S > 0.0:
        return S
    for j in range(n):
        K[j] = g[j] / S
        x[j] += K[j] * residual
        u[j] = -r * K[j]
    # P (I - K H)' first; then u = H P (I - K H)' - r K', zero but for rounding, carries the rest of the Joseph form.
    for i in range(n):
        for j in range(n):
            P[i, j] -= g[i] * K[j]
        if H[i] != 0.0:
            for j in range(n):
                u[j] += H[i] * P[i, j]
    for i in range(n):
        for j in range(n):
            P[i, j] -= K[i] * u[j]
    symmetrise(P)
    return S


@njit(cache=True)
def innovation_covariance(P, H, R, S):
    """Write the covariance S = H P H' + R of an innovation; returns H P.

    S is symmetric but for rounding.  P : (n, n); H : (m, n); R, S : (m, m).

    >>> S = np.empty((1, 1))
    >>> innovation_covariance(np.diag(np.array([4.0, 9.0])), np.ones((1, 2)), np.eye(1), S).tolist(), S.item()
    ([[4.0, 9.0]], 14.0)
    """
    G = np.zeros(H.shape)
    add_product(G, 1.0, H, P)
    for a in range(R.shape[0]):
        for b in range(R.shape[0]):
            S[a, b] = 0.5 * (R[a, b] + R[b, a])
    add_product(S, 1.0, G, transposed(H))
    return G


@njit(cache=True)
def update_step(x, P, residual, H, R, S, whitened):
    """Condition N(x, P) on m observations at once, in place (Joseph form).

    S = H P H' + R = L L',  K = P H' S^-1,  x += K residual,  P = (I - K H) P (I - K H)' + K R K',
    whitened = L^-1 residual.
    x : (n,); P : (n, n); residual = z - h(x) : (m,); H = dh/dx : (m, n); R : (m, m); outputs S : (m, m),
    whitened : (m,).
    Returns 0, or k >= 1 when S is not positive definite in row k - 1 (x and P are then unchanged).
    """
    G, U, u = innovation_covariance(P, H, R, S), np.empty(S.shape), np.zeros(H.shape)
    for a in range(S.shape[0]):
        for b in range(a):
            S[b, a] = S[a, b]
    status = cholesky_upper(S, U)
    if status != 0:
        return status
    whiten(U, residual, whitened)
    K = G.copy()  # K' = S^-1 H P
    solve_lower(U, K)
    solve_upper(U, K)
    add_vector_product(x, 1.0, residual, K)
    add_product(P, -1.0, transposed(G), K)  # P (I - K H)', then what H leaves of it against R K', as above
    add_product(u, -1.0, R, K)
    add_product(u, 1.0, H, P)
    add_product(P, -1.0, transposed(K), u)
    symmetrise(P)
    return 0


@njit(cache=True)
def whiten(U, residual, whitened):
    """Whiten a residual with S = U' U:  whitened = U'^-1 residual.

    residual, whitened : (m,); U : (m, m), upper triangular.

    >>> white = np.empty(1)
    >>> whiten(2.0 * np.eye(1), np.array([3.0]), white)
    >>> white.tolist()
    [1.5]
    """
    for a in range(residual.size):
        whitened[a] = residual[a]
        for b in range(a):
            whitened[a] -= U[b, a] * whitened[b]
        whitened[a] /= U[a, a]


@njit(cache=True)
def joint_update_step(x, P, residual, H, R, whitened):
    """Condition N(x, P) at once on the components of a residual that are not NaN, in place.

    Arguments as in `update_step`; whitened stays as it is where the residual is NaN.
    Returns 0, or k >= 1 when the innovation covariance is not positive definite in component k - 1.
    """
    if residual.size == 1 and not np.isnan(residual[0]):
        variance = scalar_update_step(x, P, residual[0], H[0], R[0, 0])
        if not variance > 0.0:
            return 1
        whitened[0] = residual[0] / np.sqrt(variance)
        return 0
    seen, residual, H, R = rows_seen(residual, H, R)
    white = np.empty(seen.size)
    status = update_step(x, P, residual, H, R, np.empty(R.shape), white)
    if status != 0:
        return seen[status - 1] + 1
    for b in range(seen.size):
        whitened[seen[b]] = white[b]
    return 0


@njit(cache=True)
def observed_update_step(x, P, z, H, R, sequential, whitened):
    """Condition N(x, P) on the seen components of z = H x + v, v ~ N(0, R), in place.

    x : (n,); P : (n, n); z : (m,); H : (m, n); R : (m, m); output whitened : (m,), NaN where z is.
    sequential : one scalar update per component, after H and z were decorrelated by the Cholesky factor of R where R is
    not diagonal; else jointly. Both give the same posterior and the same whitened innovation.
    Returns 0; k >= 1 where the innovation covariance, -k where R is not positive definite in component k - 1.
    """
    for a in range(z.size):
        whitened[a] = np.nan
    if not sequential:
        residual = z.copy()
        add_vector_product(residual, -1.0, x, transposed(H))
        return joint_update_step(x, P, residual, H, R, whitened)
    seen, z, H, R = rows_seen(z, H, R)
    if not _diagonal(R):
        status = cholesky_upper(R, R)
        if status != 0:
            return -seen[status - 1] - 1
        solve_lower(R, H)
        solve_lower(R, z.reshape((-1, 1)))
        R = identity(seen.size)
    for b in range(seen.size):
        residual = z[b]
        for j in range(x.size):
            residual -= H[b, j] * x[j]
        S = scalar_update_step(x, P, residual, H[b], R[b, b])
        if not S > 0.0:
            return seen[b] + 1
        whitened[seen[b]] = residual / np.sqrt(S)
    return 0


@njit(cache=True)
def _diagonal(A):
    for i in range(A.shape[0]):
        for j in range(A.shape[0]):
            if i != j and A[i, j] != 0.0:
                return False
    return True


@njit(cache=True)
def rows_seen(z, H, R):
    """Select what is not NaN: the places in z, and copies of z, rows of H and R there.

    >>> rows_seen(np.array([np.nan, 5.0]), np.eye(2), np.eye(2))[1].tolist()
    [5.0]
    """
    m, n = H.shape
    seen = np.empty(m, np.int64)
    count = 0
    for a in range(m):
        if not np.isnan(z[a]):
            seen[count] = a
            count += 1
    seen = seen[:count]
    z_seen, H_seen, R_seen = np.empty(count), np.empty((count, n)), np.empty((count, count))
    for b in range(count):
        z_seen[b] = z[seen[b]]
        for j in range(n):
            H_seen[b, j] = H[seen[b], j]
        for d in range(count):
            R_seen[b, d] = 0.5 * (R[seen[b], seen[d]] + R[seen[d], seen[b]])
    return seen, z_seen, H_seen, R_seen


def predict(posterior: Gaussian, Phi, Q) -> Gaussian:
    """Propagate a Gaussian through x_next = Phi x + w, w ~ N(0, Q).

    mean = Phi mean,   cov = Phi cov Phi' + Q.
    Phi, Q : (n, n), Q positive semidefinite. Returns the prior of the next epoch.
    Raises ValueError for wrong shapes, values that are not finite, a Q that is no covariance.
    Source: grace-fusion (16), (17).

    >>> from geokalman.kalman import gaussian
    >>> predict(gaussian([1.0, 2.0], [1.0, 1.0]), [[1.0, 3.0], [0.0, 1.0]], np.zeros((2, 2))).mean.tolist()
    [7.0, 2.0]
    """
    x, P = gaussian(*posterior)
    n = len(x)
    x_out, P_out = np.empty(n), np.empty((n, n))
    predict_step(x, P, array("Phi", Phi, n, n), covariance("Q", Q, n), x_out, P_out)
    return Gaussian(x_out, P_out)


def update(prior: Gaussian, z, H, R, sequential: bool = False) -> tuple[Gaussian, Innovation]:
    """Condition a Gaussian on z = H x + v, v ~ N(0, R), in Joseph form.

    z : (m,) measured, NaN where a component is missing [sensor units]; H : (m, n); R : (m, m); sequential : one
    component after the other, else jointly.
    Returns the posterior and Innovation(residual, S, whitened), whitened ~ N(0, I) if the model is right.
    Raises ValueError for wrong shapes and infinite values, NotPositiveDefinite for S or R.
    Source: grace-fusion (18)-(20).

    >>> from geokalman.kalman import gaussian
    >>> posterior, innovation = update(gaussian([0.0], [3.0]), [2.0], [[1.0]], [[1.0]])
    >>> posterior.mean.item(), posterior.cov.item(), innovation.whitened.item()
    (1.5, 0.75, 1.0)
    """
    x, P = gaussian(*prior)
    z = array("z", z, None, missing=True)
    m = len(z)
    H, R = array("H", H, m, len(x)), covariance("R", R, m)
    residual, S = z - H @ x, H @ P @ H.T + R
    whitened = np.empty(m)
    refuse(observed_update_step(x, P, z, H, R, sequential, whitened))
    return Gaussian(x, P), Innovation(residual, 0.5 * (S + S.T), whitened)


def steps(transition: Transition, t: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Check a transition and give its different steps between the epochs.

    transition : (Phi, Q) with matrices (n, n) for all steps or (N - 1, n, n), or a function of the step h [s] giving
    (Phi, Q), called once for each different step; t : (N,) checked epochs.
    Returns Phi, Q : (K, n, n), and step : (N - 1,), the index into them. Raises ValueError for wrong shapes.

    >>> steps(lambda h: ([[1.0]], [[h]]), np.array([0.0, 1.0, 3.0, 4.0]), 1)[2].tolist()
    [0, 1, 0]
    """
    count = len(t) - 1
    if callable(transition):
        lengths, step = np.unique(np.diff(t), return_inverse=True)
        pairs = [transition(float(h)) for h in lengths]
        Phi = np.array([array("Phi", pair[0], n, n) for pair in pairs]).reshape(-1, n, n)
        Q = np.array([covariance("Q", pair[1], n) for pair in pairs]).reshape(-1, n, n)
        return Phi, Q, step.astype(np.int64)
    if not isinstance(transition, (tuple, list)) or len(transition) != 2:
        kind = type(transition).__name__
        raise ValueError(f"transition is a {kind}: give a pair (Phi, Q), or a function of the step that returns one.")
    Phi, Q = transition
    Phi, Q = matrices("Phi", Phi, count, n, n), covariances("Q", Q, count, n)
    if len(Phi) == len(Q) == 1:
        return Phi, Q, np.zeros(count, np.int64)
    Phi, Q = (np.array(np.broadcast_to(stack, (count, n, n)), order="C") for stack in (Phi, Q))  # writable
    return Phi, Q, np.arange(count)


def refuse(status: int) -> None:
    """Raise NotPositiveDefinite for a status of `observed_update_step` that is not 0.

    >>> refuse(0)
    """
    if status != 0:
        matrix = "innovation covariance" if status > 0 else "observation noise covariance"
        raise NotPositiveDefinite(matrix, detail=f"the pivot of observed component {abs(status) - 1} is not positive")
