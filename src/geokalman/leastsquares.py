"""Normal equations: accumulated by blocks, for many right-hand sides; scaled and solved.

Observations A x = y + e with weights W give N x = b, N = A^T W A, b = A^T W y. Only the lower triangle of N is kept, in
Fortran order, and BLAS adds to it in place: memory is N and one block of rows. Rows with correlated errors are whitened
by the caller (divide them by the Cholesky factor of their covariance) before they are added.

Arcs are independent: partial normal equations add up, in one process or in many (`sum_normals`). One process with a
threaded BLAS is the faster way on one machine, because no matrix has to travel.
"""

from __future__ import annotations

import itertools
import os
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import blas, lapack
from scipy.sparse.linalg import LinearOperator, eigsh

from geokalman.kalman.checks import plain

Array = NDArray[np.float64]
Arc = TypeVar("Arc")

_ROWS_WEIGHTED = 512  # rows of a weighted block that are scaled at a time: their copy stays small
_TILE = 512  # tile of the transposition that fills the other triangle
_NAMED = 8  # undetermined unknowns that an error lists by name
_DENSE = 64  # up to here all eigenvalues are cheaper than a Lanczos iteration


class SingularNormalMatrix(ValueError):
    """The observations leave unknowns open, which the message names.

    >>> normals = NormalEquations(2)
    >>> normals.add([[1.0, 0.0], [2.0, 0.0]], [1.0, 2.0])
    >>> normals.factor()
    Traceback (most recent call last):
    geokalman.leastsquares.SingularNormalMatrix: No observation depends on 1 of 2 unknowns: x[1].
    """


class NormalEquations:
    """Normal equations of n unknowns and q right-hand sides, added up block by block.

    n, q : numbers of unknowns and right-hand sides; names : (n,) of the unknowns for error messages, None for x[0], ...
    Attributes: matrix : (n, n), Fortran order, N in the lower triangle, zeros above it; rhs : (n, q), b = A^T W y;
    squares : (q,), y^T W y; observations : number of rows of non-zero weight so far.
    Raises ValueError for n or q below 1, or another number of names.

    >>> normals = NormalEquations(2)
    >>> normals.add([[1.0, 0.0], [1.0, 1.0], [1.0, 2.0]], [1.0, 3.0, 5.0])  # a line
    >>> normals.factor().estimate[:, 0].round(12).tolist()
    [1.0, 2.0]
    """

    def __init__(self, n: int, q: int = 1, names: Sequence[str] | None = None) -> None:
        if n < 1 or q < 1:
            raise ValueError(f"Normal equations need at least 1 unknown and 1 right-hand side, not {n} and {q}.")
        if names is not None and len(names) != n:
            raise ValueError(f"{len(names)} names for {n} unknowns.")
        self.n, self.q = n, q
        self.names = None if names is None else tuple(names)
        self.matrix: Array = np.zeros((n, n), order="F")
        self.rhs: Array = np.zeros((n, q), order="F")
        self.squares: Array = np.zeros(q)
        self.observations = 0

    def add(self, block: ArrayLike, rhs: ArrayLike, weights: ArrayLike | None = None) -> None:
        """Add observations: N += A^T W A, b += A^T W y.

        block : (k, n) rows A of the design matrix, C or Fortran order, used where it is; rhs : (k, q), or (k,) where q
        is 1, observed minus computed values y; weights : scalar or (k,), one over the variance of each row, None for 1.
        Raises ValueError for shapes that do not fit, values that are not finite (naming the row), a negative weight.

        >>> normals = NormalEquations(1)
        >>> normals.add([[1.0], [1.0]], [1.0, 6.0], weights=[4.0, 1.0])
        >>> normals.matrix.item(), normals.rhs.item(), normals.observations
        (5.0, 10.0, 2)
        """
        A, y, w = self._checked(block, rhs, weights)
        if w is None:
            self._accumulate(A, y)
            self.observations += A.shape[0]
            return
        root = np.sqrt(w)[:, None]
        for start in range(0, A.shape[0], _ROWS_WEIGHTED):
            rows = slice(start, start + _ROWS_WEIGHTED)
            self._accumulate(root[rows] * A[rows], root[rows] * y[rows])
        self.observations += int(np.count_nonzero(w))

    def regularise(self, weights: ArrayLike, prior: ArrayLike = 0.0) -> None:
        """Observe the unknowns themselves: x = prior with `weights`, N += diag(w), b += w prior.

        weights : scalar or (n,), where an unknown of weight 0 is not observed; prior : scalar, (n,) or (n, q) values.
        Raises ValueError for shapes that do not fit, a weight or prior that is not finite, a negative weight.

        >>> normals = NormalEquations(1)
        >>> normals.add([[1.0]], [8.0])
        >>> normals.regularise(3.0)  # towards zero, with three times the weight
        >>> normals.factor().estimate.item()
        2.0
        """
        w = _weights(weights, self.n, "one per unknown")
        prior = plain("prior", prior)
        prior = np.broadcast_to(prior[:, None] if prior.ndim == 1 else prior, (self.n, self.q))
        if not np.all(np.isfinite(prior)):
            raise ValueError(f"The prior of {self._name(int(np.argwhere(~np.isfinite(prior))[0][0]))} is not finite.")
        self.matrix.ravel(order="K")[:: self.n + 1] += w
        self.rhs += w[:, None] * prior
        self.squares += np.einsum("n,nq,nq->q", w, prior, prior)
        self.observations += int(np.count_nonzero(w))

    def __iadd__(self, other: NormalEquations) -> NormalEquations:
        if (self.n, self.q, self.names) != (other.n, other.q, other.names):
            raise ValueError(
                f"Normal equations of {self.n} unknowns and {self.q} right-hand sides do not add to those of {other.n} "
                f"and {other.q}, or their unknowns have other names."
            )
        self.matrix += other.matrix
        self.rhs += other.rhs
        self.squares += other.squares
        self.observations += other.observations
        return self

    def __add__(self, other: NormalEquations) -> NormalEquations:
        total = NormalEquations(self.n, self.q, self.names)
        total += self
        total += other
        return total

    def full_matrix(self) -> Array:
        """Copy N (n, n), with both triangles.

        >>> normals = NormalEquations(2)
        >>> normals.add([[1.0, 2.0]], [0.0])
        >>> normals.full_matrix().tolist()
        [[1.0, 2.0], [2.0, 4.0]]
        """
        return self.matrix + np.tril(self.matrix, -1).T

    def factor(self, overwrite: bool = False) -> Solution:
        """Scale N to unit diagonal, factor it by Cholesky and solve for all right-hand sides.

        overwrite : let the factor take the memory of N; this object is then of no further use. Returns the Solution.
        Raises ValueError where there are fewer observations than unknowns; SingularNormalMatrix, naming the unknowns,
        where the observations do not determine all: a pivot of the scaled matrix, which is the part of an unknown's
        information that no other unknown explains, is below n eps.

        >>> normals = NormalEquations(2)
        >>> normals.add(np.diag([1e-8, 1e8]), [2e-8, 3e8])  # of very different size
        >>> normals.factor().estimate.round(12).tolist()
        [[2.0], [3.0]]
        """
        if self.observations < self.n:
            raise ValueError(
                f"{self.n} unknowns need at least {self.n} observations; only {self.observations} were added."
            )
        diagonal = self.matrix.diagonal().copy()
        if not np.all(diagonal > 0.0):
            unseen = self._list(np.flatnonzero(~(diagonal > 0.0)))
            raise SingularNormalMatrix(f"No observation depends on {unseen}.")
        matrix = self.matrix if overwrite else self.matrix.copy(order="F")
        if overwrite:
            del self.matrix
        scale = 1.0 / np.sqrt(diagonal)
        matrix *= scale
        matrix *= scale[:, None]
        np.fill_diagonal(matrix, 1.0)
        _mirror(matrix)
        matrix, info = lapack.dpotrf(matrix, lower=1, clean=0, overwrite_a=1)
        if info > 0 or matrix.diagonal().min() ** 2 < self.n * np.finfo(float).eps:
            np.fill_diagonal(matrix, 1.0)  # the strict upper triangle still holds the scaled matrix
            open_ = self._list(_undetermined(matrix))
            raise SingularNormalMatrix(
                f"The observations leave undetermined, or cannot tell from one another, {open_}."
            )
        return Solution(matrix, scale, self.rhs, self.squares, self.observations)

    def _accumulate(self, A: Array, y: Array) -> None:
        if A.flags.f_contiguous:
            blas.dsyrk(1.0, A, beta=1.0, c=self.matrix, trans=1, lower=1, overwrite_c=1)
            blas.dgemm(1.0, A, y, beta=1.0, c=self.rhs, trans_a=1, overwrite_c=1)
        else:
            A = np.ascontiguousarray(A)  # its transpose is Fortran-ordered: BLAS takes it as it is
            blas.dsyrk(1.0, A.T, beta=1.0, c=self.matrix, trans=0, lower=1, overwrite_c=1)
            blas.dgemm(1.0, A.T, y, beta=1.0, c=self.rhs, overwrite_c=1)
        self.squares += np.einsum("kq,kq->q", y, y)

    def _checked(
        self, block: ArrayLike, rhs: ArrayLike, weights: ArrayLike | None
    ) -> tuple[Array, Array, Array | None]:
        A, y = plain("a block of observations", block), plain("the right-hand side of a block", rhs)
        y = y[:, None] if y.ndim == 1 else y
        if A.ndim != 2 or A.shape[1] != self.n:
            raise ValueError(f"A block of observations has shape {A.shape}; (k, {self.n}) is right.")
        if y.shape != (A.shape[0], self.q):
            raise ValueError(f"Right-hand sides have shape {y.shape}; ({A.shape[0]}, {self.q}) is right.")
        for values, what in ((A, "design matrix"), (y, "right-hand side")):
            if not np.isfinite(values.sum()):
                row = int(np.argmin(np.isfinite(values).all(axis=1)))
                raise ValueError(f"Row {row} of the {what} of a block is not finite.")
        return A, y, None if weights is None else _weights(weights, A.shape[0], "one per row")

    def _name(self, index: int) -> str:
        return f"x[{index}]" if self.names is None else self.names[index]

    def _list(self, indices: NDArray[np.int64]) -> str:
        listed = ", ".join(self._name(int(i)) for i in indices[:_NAMED])
        more = f" and {indices.size - _NAMED} more" if indices.size > _NAMED else ""
        return f"{indices.size} of {self.n} unknowns: {listed}{more}"


@dataclass(frozen=True, eq=False)
class Solution:
    """Solved normal equations: the estimates, and what the factor tells of their accuracy.

    The scaled matrix D N D = L L^T, D = diag(N)^(-1/2), has L in the lower triangle of `factor` and itself in the
    strict upper one. `estimate` (n, q) is the solution of N x = b.

    >>> normals = NormalEquations(1)
    >>> normals.add(np.ones((4, 1)), [0.0, 3.0, 3.0, 6.0])  # a mean
    >>> solution = normals.factor()
    >>> solution.estimate.item(), solution.covariance().item(), solution.variances().item()
    (3.0, 0.25, 0.25)
    >>> solution.residual_sum_of_squares.item(), solution.variance_factor.item(), solution.unknowns
    (18.0, 6.0, 1)
    >>> round(solution.log_determinant, 3), solution.condition(), solution.solve([8.0]).item()
    (1.386, 1.0, 2.0)
    """

    factor: Array = field(repr=False)
    scale: Array = field(repr=False)
    rhs: Array = field(repr=False)
    squares: Array = field(repr=False)
    observations: int
    estimate: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "estimate", self.solve(self.rhs))

    @property
    def unknowns(self) -> int:
        """Count the unknowns n."""
        return self.scale.size

    def solve(self, rhs: ArrayLike) -> Array:
        """Solve N x = rhs, (n,) or (n, q)."""
        rhs = plain("rhs", rhs)
        scale = self.scale if rhs.ndim == 1 else self.scale[:, None]
        x, _ = lapack.dpotrs(self.factor, scale * rhs, lower=1)
        return scale * x

    @property
    def residual_sum_of_squares(self) -> Array:
        """Compute v^T W v = y^T W y - x^T b of each right-hand side (q,), at least 0.

        Below 1e-13 y^T W y it is rounding.
        """
        return np.maximum(self.squares - np.einsum("nq,nq->q", self.estimate, self.rhs), 0.0)

    @property
    def variance_factor(self) -> Array:
        """Compute the a-posteriori variance of unit weight (q,).

        v^T W v / (observations - unknowns). Raises ValueError where there is no redundancy.
        """
        if self.observations == self.unknowns:
            raise ValueError(
                f"{self.observations} observations of as many unknowns leave no redundancy for a variance."
            )
        return self.residual_sum_of_squares / (self.observations - self.unknowns)

    @property
    def log_determinant(self) -> float:
        """Compute log det N, for likelihoods."""
        return float(2.0 * (np.log(self.factor.diagonal()).sum() - np.log(self.scale).sum()))

    def covariance(self) -> Array:
        """Compute N^-1 (n, n), the covariance of the unknowns for variance factor 1."""
        inverse, _ = lapack.dpotri(self.factor, lower=1)
        _mirror(inverse)
        inverse *= self.scale
        inverse *= self.scale[:, None]
        return inverse

    def variances(self) -> Array:
        """Compute the diagonal of N^-1 (n,), without the rest of it."""
        inverse, _ = lapack.dtrtri(self.factor, lower=1)
        return np.square(self.scale) * np.array([inverse[k:, k] @ inverse[k:, k] for k in range(self.unknowns)])

    def condition(self) -> float:
        """Compute the ratio of the extreme eigenvalues of the scaled matrix (Lanczos, 1e-6)."""
        n = self.unknowns
        if n <= _DENSE:
            full = np.triu(self.factor, 1)
            values = np.linalg.eigvalsh(full + full.T + np.eye(n))
            return float(values[-1] / values[0])
        excess = 1.0 - self.factor.diagonal()  # the diagonal belongs to L, that of the scaled matrix is 1
        product = LinearOperator((n, n), lambda x: blas.dsymv(1.0, self.factor, x, lower=0) + excess * x.ravel())
        inverse = LinearOperator((n, n), lambda x: lapack.dpotrs(self.factor, x, lower=1)[0])
        start = np.random.default_rng(0).standard_normal(n)  # a fixed start: the same number every time
        largest, reciprocal = (
            eigsh(operator, k=1, which="LA", v0=start, tol=1e-6, return_eigenvectors=False)[0]
            for operator in (product, inverse)
        )
        return float(largest * reciprocal)


def sum_normals(
    build: Callable[[Arc], NormalEquations],
    arcs: Iterable[Arc],
    executor: Executor | None = None,
    at_once: int | None = None,
) -> NormalEquations:
    """Add up the normal equations of arcs, always in their order.

    build : function of one arc, for a process pool at the top level of a module; arcs : what it is called with;
    executor : any `concurrent.futures.Executor`, e.g. a process pool or `dask.distributed.Client(...).get_executor()`,
    None builds here; at_once : arcs under way at a time, which bounds memory, None for the number of processors.
    Raises ValueError where there is no arc, and whatever `build` raises.

    >>> def build(value):
    ...     arc = NormalEquations(1)
    ...     arc.add([[1.0]], [value])
    ...     return arc
    >>> sum_normals(build, [1.0, 2.0, 6.0]).factor().estimate.round(12).tolist()
    [[3.0]]
    """
    total: NormalEquations | None = None
    for part in (
        map(build, arcs) if executor is None else _in_order(build, arcs, executor, at_once or os.cpu_count() or 1)
    ):
        if total is None:
            total = part
        else:
            total += part
    if total is None:
        raise ValueError("There is no arc to sum normal equations of.")
    return total


def _in_order(
    build: Callable[[Arc], NormalEquations], arcs: Iterable[Arc], executor: Executor, at_once: int
) -> Iterable[NormalEquations]:
    todo = iter(arcs)
    waiting: deque[Future] = deque(executor.submit(build, arc) for arc in itertools.islice(todo, at_once))
    try:
        while waiting:
            part = waiting.popleft().result()
            waiting.extend(executor.submit(build, arc) for arc in itertools.islice(todo, 1))
            yield part
    finally:
        for future in waiting:
            future.cancel()


def _weights(weights: ArrayLike, size: int, right: str) -> Array:
    w = plain("weights", weights)
    if w.ndim > 1 or (w.ndim == 1 and w.size != size):
        raise ValueError(f"weights has shape {w.shape}; a scalar or ({size},), {right}, is right.")
    w = np.broadcast_to(w, size)
    bad = ~(np.isfinite(w) & (w >= 0.0))
    if bad.any():
        raise ValueError(f"weights[{int(np.argmax(bad))}] = {w[bad][0]} must be finite and not negative.")
    return w


def _mirror(matrix: Array) -> None:
    """Copy the strict lower triangle to the upper one, tile by tile."""
    n = matrix.shape[0]
    for i in range(0, n, _TILE):
        rows = slice(i, i + _TILE)
        corner = np.tril(matrix[rows, rows], -1)
        matrix[rows, rows] = np.tril(matrix[rows, rows]) + corner.T
        for j in range(i + _TILE, n, _TILE):
            matrix[rows, j : j + _TILE] = matrix[j : j + _TILE, rows].T


def _undetermined(matrix: Array) -> NDArray[np.int64]:
    """Find the unknowns in the null space of a scaled normal matrix (upper, destroyed)."""
    n = matrix.shape[0]
    factor, pivots, rank, _ = lapack.dpstrf(matrix, tol=n * np.finfo(float).eps, lower=0, overwrite_a=1)
    rank = min(rank, n - 1)
    dependent, _ = lapack.dtrtrs(factor[:rank, :rank], factor[:rank, rank:], lower=0)
    null = np.vstack([-dependent, np.eye(n - rank)])
    share = np.max(np.abs(null) / np.max(np.abs(null), axis=0), axis=1)
    return np.sort(pivots[share > 0.1] - 1)
