"""Checks at the border of the core: shapes, finite numbers, symmetric and positive covariances; one clear error each."""

from __future__ import annotations

import numpy as np

_EPS = float(np.finfo(float).eps)


class NotPositiveDefinite(ValueError):
    """A covariance that must be positive definite is not.

    matrix : its name, e.g. "innovation covariance"; epoch : index of the epoch, None outside a run; t : its time [s] or None.
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
    """A checked covariance (n, n): finite, symmetric and positive semidefinite up to rounding; returned exactly symmetric.

    Both are judged on the correlation matrix, so that the units of the states do not matter.
    Raises ValueError where it is not symmetric, NotPositiveDefinite where an eigenvalue is negative.
    """
    P = array(name, value, n, n)
    variance = np.diag(P)
    if (variance < 0.0).any():
        i = int(np.argmin(variance))
        raise NotPositiveDefinite(name, detail=f"its diagonal element {i} is {variance[i]:g}")
    sigma = np.where(variance > 0.0, np.sqrt(variance), 1.0)
    correlation = P / sigma[:, None] / sigma
    gap = np.abs(correlation - correlation.T)
    if gap.max(initial=0.0) > 1e4 * n * _EPS:  # far above the rounding of any product, far below a forgotten transpose
        i, j = (int(k) for k in np.unravel_index(np.argmax(gap), gap.shape))
        raise ValueError(f"{name} is not symmetric: element ({i}, {j}) is {P[i, j]:g}, element ({j}, {i}) is {P[j, i]:g}")
    smallest = np.linalg.eigvalsh(0.5 * (correlation + correlation.T)).min(initial=0.0)
    if smallest < -10 * n * _EPS:
        raise NotPositiveDefinite(name, detail=f"its correlation matrix has the eigenvalue {smallest:.3g}")
    return 0.5 * (P + P.T)


def covariances(name: str, value, count: int, n: int) -> np.ndarray:
    """Checked covariances (K, n, n) from one (n, n), K = 1, or from one per epoch, K = count."""
    if np.ndim(value) != 3:
        return covariance(name, value, n)[None]
    stack = array(name, value, count, n, n)
    for k in range(count):
        stack[k] = covariance(f"{name}[{k}]", stack[k], n)
    return stack


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
