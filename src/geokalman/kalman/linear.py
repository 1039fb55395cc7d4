"""The linear Kalman filter: predict, update (Joseph form; joint or component by component), and a run over epochs.

The functions named ``*_step`` are compiled kernels on plain float64 arrays, callable from Python and by name from a
compiled loop; they trust their arguments. Above them stand the same operations on Gaussians, checked at the border.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from geokalman.kalman.dense import cholesky_upper, solve_lower, solve_upper, symmetrise


@njit(cache=True)
def predict_step(
    x: np.ndarray, P: np.ndarray, Phi: np.ndarray, Q: np.ndarray, x_out: np.ndarray, P_out: np.ndarray
) -> None:
    """Propagate N(x, P) through x_out = Phi x + w, w ~ N(0, Q):  P_out = Phi P Phi' + Q, exactly symmetric.

    x, x_out : (n,); P, Phi, Q, P_out : (n, n). The outputs must not overlap the inputs. Zeros of Phi cost nothing.
    """
    n = x.shape[0]
    row = np.empty(n)
    P_Phi_t = np.empty((n, n))
    for i in range(n):
        mean = 0.0
        for j in range(n):
            row[j] = 0.0
        for k in range(n):
            phi = Phi[i, k]
            if phi != 0.0:
                mean += phi * x[k]
                for j in range(n):
                    row[j] += phi * P[k, j]
        x_out[i] = mean
        for j in range(n):
            P_Phi_t[j, i] = row[j]
    for i in range(n):
        for j in range(i, n):
            P_out[i, j] = 0.5 * (Q[i, j] + Q[j, i])
        for k in range(n):
            phi = Phi[i, k]
            if phi != 0.0:
                for j in range(i, n):
                    P_out[i, j] += phi * P_Phi_t[k, j]
        for j in range(i + 1, n):
            P_out[j, i] = P_out[i, j]


@njit(cache=True)
def scalar_update_step(x: np.ndarray, P: np.ndarray, residual: float, H: np.ndarray, r: float) -> float:
    """Condition N(x, P) on one observation with residual = z - h(x), row H = dh/dx and variance r, in place (Joseph form).

    S = H P H' + r,  K = P H' / S,  x += K residual,  P = (I - K H) P (I - K H)' + K r K'.
    x, H : (n,); P : (n, n). Zeros of H cost little. Returns S; where S is not positive nothing was changed.
    The whitened innovation is residual / sqrt(S).
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
    # P (I - K H)' first; then u = H P (I - K H)' - r K', which is zero but for rounding, carries the rest of the Joseph form.
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
def update_step(
    x: np.ndarray,
    P: np.ndarray,
    residual: np.ndarray,
    H: np.ndarray,
    R: np.ndarray,
    S: np.ndarray,
    whitened: np.ndarray,
) -> int:
    """Condition N(x, P) on m observations at once with residual = z - h(x), H = dh/dx, in place (Joseph form).

    S = H P H' + R = L L',  K = P H' S^-1,  x += K residual,  P = (I - K H) P (I - K H)' + K R K',
    whitened = L^-1 residual.
    x : (n,); P : (n, n); residual, whitened : (m,); H : (m, n); R, S : (m, m); S and whitened are outputs.
    Returns 0, or k >= 1 when S is not positive definite in row k - 1 (x and P are then unchanged).
    """
    m, n = H.shape
    G = np.zeros((m, n))  # H P
    for a in range(m):
        for k in range(n):
            if H[a, k] != 0.0:
                for j in range(n):
                    G[a, j] += H[a, k] * P[k, j]
    for a in range(m):
        for b in range(a, m):
            total = 0.5 * (R[a, b] + R[b, a])
            for k in range(n):
                if H[a, k] != 0.0:
                    total += H[a, k] * G[b, k]
            S[a, b] = total
            S[b, a] = total
    U = np.empty((m, m))
    status = cholesky_upper(S, U)
    if status != 0:
        return status
    whiten(U, residual, whitened)
    K = G.copy()  # holds K' = S^-1 H P
    solve_lower(U, K)
    solve_upper(U, K)
    for a in range(m):
        for j in range(n):
            x[j] += K[a, j] * residual[a]
    # P (I - K H)', then what H leaves of it against R K', as in the scalar update.
    for i in range(n):
        for a in range(m):
            for j in range(n):
                P[i, j] -= G[a, i] * K[a, j]
    u = np.zeros((m, n))
    for a in range(m):
        for b in range(m):
            for j in range(n):
                u[a, j] -= R[a, b] * K[b, j]
        for k in range(n):
            if H[a, k] != 0.0:
                for j in range(n):
                    u[a, j] += H[a, k] * P[k, j]
    for i in range(n):
        for a in range(m):
            for j in range(n):
                P[i, j] -= K[a, i] * u[a, j]
    symmetrise(P)
    return 0


@njit(cache=True)
def whiten(U: np.ndarray, residual: np.ndarray, whitened: np.ndarray) -> None:
    """Whiten a residual with S = U' U:  whitened = U'^-1 residual.  residual, whitened : (m,); U : (m, m) upper."""
    m = residual.shape[0]
    for a in range(m):
        total = residual[a]
        for b in range(a):
            total -= U[b, a] * whitened[b]
        whitened[a] = total / U[a, a]
