"""Small dense kernels in explicit loops, which beat BLAS below n = 20.

Every factor is upper triangular, A = U' U: its rows are contiguous, and row i is the i-th column of the usual lower
root. A Cholesky factor without pivoting does not depend on the scaling of the rows and columns of A beyond rounding,
so metres beside micrometres per second need no scaling before it.
"""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def copy_vector(x, out):
    """Copy a vector."""
    for i in range(x.shape[0]):
        out[i] = x[i]


@njit(cache=True)
def copy(A, out):
    """Copy a matrix; a slice assignment would compile for seconds (numba's error message)."""
    for i in range(A.shape[0]):
        for j in range(A.shape[1]):
            out[i, j] = A[i, j]


@njit(cache=True)
def copy_state(x, P, x_out, P_out):
    """Copy a mean (nx,) and a covariance (n, n), nx = n but on a manifold."""
    copy_vector(x, x_out)
    copy(P, P_out)


@njit(cache=True)
def identity(n):
    """Make the unit matrix (n, n); np.eye would compile for seconds."""
    out = np.zeros((n, n))
    for i in range(n):
        out[i, i] = 1.0
    return out


@njit(cache=True)
def transposed(A):
    """Copy A' into an array of its own, so that every product has contiguous rows."""
    out = np.empty((A.shape[1], A.shape[0]))
    for i in range(A.shape[0]):
        for j in range(A.shape[1]):
            out[j, i] = A[i, j]
    return out


@njit(cache=True)
def add_product(out, scale, A, B):
    """Add scale A B to a matrix, in place; zeros of A cost nothing.

    out : (p, r); A : (p, q); B : (q, r). The output must not overlap the inputs.
    """
    for i in range(A.shape[0]):
        for k in range(A.shape[1]):
            factor = scale * A[i, k]
            if factor != 0.0:
                for j in range(B.shape[1]):
                    out[i, j] += factor * B[k, j]


@njit(cache=True)
def add_vector_product(out, scale, x, A):
    """Add scale x' A to a vector, in place.  out : (r,); x : (q,); A : (q, r)."""
    for k in range(x.shape[0]):
        factor = scale * x[k]
        for j in range(A.shape[1]):
            out[j] += factor * A[k, j]


@njit(cache=True)
def mirror(A):
    """Copy the upper triangle of a square matrix to the lower one, in place."""
    for i in range(A.shape[0]):
        for j in range(i):
            A[i, j] = A[j, i]


@njit(cache=True)
def symmetrise(A):
    """Replace a square matrix A by (A + A') / 2, in place."""
    for i in range(A.shape[0]):
        for j in range(i):
            mean = 0.5 * (A[i, j] + A[j, i])
            A[i, j] = mean
            A[j, i] = mean


@njit(cache=True)
def cholesky_upper(A, U):
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
def root_semidefinite(A, G):
    """Factor a positive semidefinite A = G' G, by `cholesky_upper` or else with pivoting.

    With pivoting G is not triangular. The pivot is the largest relative to its A[k, k]; the factor ends, with rows of
    zeros, where all of them are below 10 n eps (eps the spacing of doubles), the rounding of the subtractions before.
    A : (n, n) symmetric; G : (n, n) output, not A itself.
    Returns 0, or k >= 1 when the pivot of row k - 1 is negative beyond rounding.
    """
    if cholesky_upper(A, G) == 0:
        return 0
    n = A.shape[0]
    tolerance = 10.0 * n * 2.220446049250313e-16
    left = np.empty(n)  # what the rows so far leave of the diagonal; zero marks a row that was a pivot
    for j in range(n):
        left[j] = A[j, j]
    for r in range(n):
        best, p = tolerance, -1
        for k in range(n):
            if left[k] > best * A[k, k]:
                best, p = left[k] / A[k, k], k
        if p < 0:
            for i in range(r, n):
                for j in range(n):
                    G[i, j] = 0.0
            break
        pivot = np.sqrt(left[p])
        for j in range(n):
            G[r, j] = 0.0
            if left[j] != 0.0:
                total = A[p, j]
                for i in range(r):
                    total -= G[i, p] * G[i, j]
                G[r, j] = total / pivot
                left[j] -= G[r, j] * G[r, j]
        G[r, p] = pivot
        left[p] = 0.0
    for k in range(n):
        if not left[k] >= -tolerance * A[k, k]:
            return k + 1
    return 0


@njit(cache=True)
def solve_lower(U, B):
    """Solve U' X = B in place of B: the forward half of a Cholesky solve.

    U : (n, n) upper triangular; B : (n, r).
    """
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
def solve_upper(U, B):
    """Solve U X = B in place of B: the backward half of a Cholesky solve.

    U : (n, n) upper triangular; B : (n, r).
    """
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
