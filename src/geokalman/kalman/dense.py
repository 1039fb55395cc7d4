"""Small dense kernels: Cholesky factor, triangular solves, symmetrisation; explicit loops, which beat BLAS below n = 20.

Every factor is upper triangular, A = U' U: its rows are contiguous and row i is the i-th column of the usual lower root.
A Cholesky factor without pivoting does not depend on the scaling of the rows and columns of A beyond rounding, so metres
beside micrometres per second need no scaling before it.
"""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def symmetrise(A: np.ndarray) -> None:
    """Replace the square matrix A by (A + A') / 2, in place."""
    n = A.shape[0]
    for i in range(n):
        for j in range(i):
            mean = 0.5 * (A[i, j] + A[j, i])
            A[i, j] = mean
            A[j, i] = mean


@njit(cache=True)
def cholesky_upper(A: np.ndarray, U: np.ndarray) -> int:
    """Factor A = U' U with U upper triangular.

    A : (n, n) symmetric, only its upper triangle is read; U : (n, n) output, may be A itself.
    Returns 0, or k >= 1 when the pivot of row k - 1 is not positive (A is then not positive definite).
    """
    n = A.shape[0]
    for i in range(n):
        for j in range(i):
            U[i, j] = 0.0
        for j in range(i, n):
            U[i, j] = A[i, j]
    for k in range(n):
        pivot = U[k, k]
        if not pivot > 0.0:
            return k + 1
        root = np.sqrt(pivot)
        U[k, k] = root
        scale = 1.0 / root
        for j in range(k + 1, n):
            U[k, j] *= scale
        for i in range(k + 1, n):
            factor = U[k, i]
            if factor != 0.0:
                for j in range(i, n):
                    U[i, j] -= factor * U[k, j]
    return 0


@njit(cache=True)
def cholesky_semidefinite(A: np.ndarray, U: np.ndarray) -> int:
    """Factor a positive semidefinite A = U' U; a row whose pivot is zero to rounding becomes zero.

    A pivot counts as zero within n eps A[k, k] (eps the spacing of doubles), the rounding of the subtractions before it.
    A, U : (n, n) as in `cholesky_upper`. Returns 0, or k >= 1 when the pivot of row k - 1 is negative beyond that.
    """
    n = A.shape[0]
    tolerance = n * 2.220446049250313e-16
    for i in range(n):
        for j in range(i):
            U[i, j] = 0.0
        for j in range(i, n):
            U[i, j] = A[i, j]
    for k in range(n):
        pivot = U[k, k]
        if not pivot >= -tolerance * A[k, k]:
            return k + 1
        if pivot <= tolerance * A[k, k]:
            for j in range(k, n):
                U[k, j] = 0.0
            continue
        root = np.sqrt(pivot)
        U[k, k] = root
        for j in range(k + 1, n):
            U[k, j] /= root
        for i in range(k + 1, n):
            for j in range(i, n):
                U[i, j] -= U[k, i] * U[k, j]
    return 0


@njit(cache=True)
def solve_lower(U: np.ndarray, B: np.ndarray) -> None:
    """Solve U' X = B in place of B (n, r), U (n, n) upper triangular: the forward half of a Cholesky solve."""
    n, r = B.shape
    for k in range(n):
        scale = 1.0 / U[k, k]
        for j in range(r):
            B[k, j] *= scale
        for i in range(k + 1, n):
            factor = U[k, i]
            if factor != 0.0:
                for j in range(r):
                    B[i, j] -= factor * B[k, j]


@njit(cache=True)
def solve_upper(U: np.ndarray, B: np.ndarray) -> None:
    """Solve U X = B in place of B (n, r), U (n, n) upper triangular: the backward half of a Cholesky solve."""
    n, r = B.shape
    for k in range(n - 1, -1, -1):
        for i in range(k + 1, n):
            factor = U[k, i]
            if factor != 0.0:
                for j in range(r):
                    B[k, j] -= factor * B[i, j]
        scale = 1.0 / U[k, k]
        for j in range(r):
            B[k, j] *= scale
