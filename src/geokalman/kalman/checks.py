"""Checks at the border of the core: shapes, finite numbers, symmetric and positive covariances; one clear error
each."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

_EPS = float(np.finfo(float).eps)


class NotPositiveDefinite(ValueError):
    """A covariance that must be positive definite is not.

    matrix : its name, e.g. "innovation covariance"; epoch : index of the epoch, None outside a run; t : its time [s] or
    None.
    """

    def __init__(self, matrix: str, epoch: int | None = None, t: float | None = None, detail: str = "") -> None:
        self.matrix, self.epoch, self.t = matrix, epoch, t
        where = "" if epoch is None else f" at epoch {epoch}" + ("" if t is None else f" (t = {t:g} s)")
        super().__init__(f"the {matrix} is not positive definite{where}{': ' + detail if detail else ''}")

    def __reduce__(self):  # keeps the fields when a worker process hands the error back
        return _rebuild, (str(self), self.matrix, self.epoch, self.t)


def _rebuild(message: str, matrix: str, epoch: int | None, t: float | None) -> NotPositiveDefinite:
    error = NotPositiveDefinite(matrix, epoch, t)
    error.args = (message,)
    return error


def array(name: str, value, *shape: int | None, missing: bool = False) -> np.ndarray:
    """A fresh contiguous float64 array of the given shape; None in `shape` admits any length, `missing` admits NaN.

    Raises ValueError for another shape, and for the first value that is not finite with its place.
    """
    out = np.array(value, dtype=float, order="C")
    if out.ndim != len(shape) or any(want not in (None, have) for want, have in zip(shape, out.shape, strict=True)):
        wanted = "(" + ", ".join("any" if s is None else str(s) for s in shape) + ("," if len(shape) == 1 else "") + ")"
        raise ValueError(f"{name} has the shape {out.shape}, it must be {wanted}")
    bad = np.isinf(out) if missing else ~np.isfinite(out)
    if bad.any():
        place = tuple(int(i) for i in np.argwhere(bad)[0])
        rule = "values must be finite, or NaN where missing" if missing else "values must be finite"
        raise ValueError(f"{name}[{', '.join(map(str, place))}] is {out[place]}: {rule}")
    return out


def covariance(name: str, value, n: int) -> np.ndarray:
    """A checked covariance (n, n): finite, symmetric and positive semidefinite up to rounding; returned exactly
    symmetric.

    Both are judged on the correlation matrix, so that the units of the states do not matter.
    Raises ValueError where it is not symmetric, NotPositiveDefinite where an eigenvalue is negative.
    """
    return _judge(array(name, value, n, n)[None], lambda k: name)[0]


def covariances(name: str, value, count: int, n: int) -> np.ndarray:
    """Checked covariances (K, n, n) from one (n, n), K = 1, or from one per epoch, K = count."""
    if np.ndim(value) != 3:
        return covariance(name, value, n)[None]
    return _judge(array(name, value, count, n, n), lambda k: f"{name}[{k}]")


def _judge(P: np.ndarray, name: Callable[[int], str]) -> np.ndarray:
    n = P.shape[-1]
    variance = np.diagonal(P, axis1=1, axis2=2)
    if (variance < 0.0).any():
        k, i = (int(index) for index in np.argwhere(variance < 0.0)[0])
        raise NotPositiveDefinite(name(k), detail=f"its diagonal element {i} is {variance[k, i]:g}")
    sigma = np.where(variance > 0.0, np.sqrt(variance), 1.0)
    correlation = P / sigma[:, :, None] / sigma[:, None, :]
    mirror = correlation.transpose(0, 2, 1)
    apart = np.abs(correlation - mirror) > 1e4 * n * _EPS  # far above the rounding of products, far below an omission
    if apart.any():
        k, i, j = (int(index) for index in np.argwhere(apart)[0])
        pair = f"element ({i}, {j}) is {P[k, i, j]:g}, element ({j}, {i}) is {P[k, j, i]:g}"
        raise ValueError(f"{name(k)} is not symmetric: {pair}")
    smallest = np.linalg.eigvalsh(0.5 * (correlation + mirror)).min(axis=1, initial=0.0)
    if (smallest < -10 * n * _EPS).any():
        k = int(np.argmax(smallest < -10 * n * _EPS))
        raise NotPositiveDefinite(name(k), detail=f"its correlation matrix has the eigenvalue {smallest[k]:.3g}")
    return 0.5 * (P + P.transpose(0, 2, 1))


def matrices(name: str, value, count: int, rows: int, columns: int) -> np.ndarray:
    """Checked matrices (K, rows, columns) from one matrix, K = 1, or from one per epoch, K = count."""
    if np.ndim(value) != 3:
        return array(name, value, rows, columns)[None]
    return array(name, value, count, rows, columns)


def epochs(t) -> np.ndarray:
    """Checked epochs (N,) [s]: finite, strictly increasing, at least one."""
    times = array("t", t, None)
    if times.size == 0:
        raise ValueError("t is empty, there must be at least one epoch")
    if not (np.diff(times) > 0.0).all():
        k = int(np.argmax(np.diff(times) <= 0.0))
        raise ValueError(f"t[{k + 1}] = {times[k + 1]} does not come after t[{k}] = {times[k]}: epochs must increase")
    return times
