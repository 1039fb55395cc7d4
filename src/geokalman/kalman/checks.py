"""Checks at the border of the core: shapes, finite numbers, covariances; one error each."""

from __future__ import annotations

import datetime
from collections.abc import Callable
from numbers import Real

import numpy as np

_EPS = float(np.finfo(float).eps)
_WHOLE = 2**53  # up to here float64 holds every whole number
_NO_NUMBERS = {"c": "complex numbers", "b": "truth values", "U": "text", "S": "text"}


class NotPositiveDefinite(ValueError):
    """A covariance that must be positive definite is not.

    matrix : its name, e.g. "innovation covariance"; epoch : index of the epoch, None outside a run; t : its time [s] or
    None; course : the Trajectory of a run until then, else None.

    >>> print(NotPositiveDefinite("innovation covariance", epoch=3, t=30.0))
    the innovation covariance is not positive definite at epoch 3 (t = 30 s).
    """

    def __init__(self, matrix: str, epoch: int | None = None, t: float | None = None, detail: str = "") -> None:
        self.matrix, self.epoch, self.t, self.course = matrix, epoch, t, None
        where = "" if epoch is None else f" at epoch {epoch}" + ("" if t is None else f" (t = {t:g} s)")
        super().__init__(f"the {matrix} is not positive definite{where}{': ' + detail if detail else ''}.")

    def __reduce__(self):  # keeps the fields when a worker process hands the error back
        return _rebuild, (str(self), self.matrix, self.epoch, self.t)


def _rebuild(message: str, matrix: str, epoch: int | None, t: float | None) -> NotPositiveDefinite:
    error = NotPositiveDefinite(matrix, epoch, t)
    error.args = (message,)
    return error


def plain(name: str, value, missing: bool = False) -> np.ndarray:
    """Give the value as float64 array; what carries more than numbers is refused.

    An array of float64 is given as it is. An element that is masked, None, NA or NaT becomes NaN where `missing` admits
    it. Units, times, text, truth values, complex numbers, sparse matrices and whole numbers beyond 2^53 raise
    ValueError, because their meaning would be lost. The packages that bring them are recognised by their attributes,
    none is imported.

    >>> plain("z", [1, None], missing=True).tolist()
    [1.0, nan]
    """
    if type(value) is np.ndarray and value.dtype == np.float64:
        return value
    if isinstance(value, (list, tuple)):
        if not all(type(item) in (float, np.float64) for item in value):
            value = [plain(name, item, missing) for item in value]
        try:
            return np.array(value, dtype=float)
        except ValueError:
            raise ValueError(f"{name} is ragged: its rows have different lengths.") from None
    if value is None or type(value).__name__ in ("NAType", "NaTType"):
        value = np.ma.masked
    if hasattr(value, "toarray"):
        raise ValueError(f"{name} is a sparse matrix: give its toarray().")
    kind = _kind(value)
    if kind not in ("m", "M"):
        for unit in (getattr(value, key, None) for key in ("unit", "units")):
            if unit is not None and not np.ndim(unit) and str(unit) not in ("", "dimensionless"):
                raise ValueError(f"{name} carries the unit {unit}: give plain numbers in the units of the model.")
        raw = _raw(name, value)
        kind = raw.dtype.kind
    if kind == "m":
        raise ValueError(f"{name} holds time spans: give seconds as float.")
    if kind == "M":
        raise ValueError(f"{name} holds dates: give seconds as float.")
    if raw.dtype.kind == "O" and (raw.ndim or isinstance(value, np.ndarray)):
        return plain(name, value.tolist() if isinstance(value, np.ma.MaskedArray) else raw.tolist(), missing)
    if raw.dtype.kind not in "fiu" and not (raw.dtype.kind == "O" and isinstance(value, Real)):
        what = _NO_NUMBERS.get(raw.dtype.kind, f"no numbers but a {type(value).__name__}")
        raise ValueError(f"{name} holds {what}: give real numbers.")
    mask = getattr(value, "mask", None)  # of numpy, or of a package like it
    mask = np.broadcast_to(mask, raw.shape) if isinstance(mask, (np.ndarray, np.bool_)) else np.zeros(raw.shape, bool)
    if mask.any() and not missing:
        place = [int(i) for i in np.argwhere(mask)[0]]
        raise ValueError(f"{name}{place or ''} is masked or missing: there must be a number.")
    if raw.dtype.kind != "f" and (~mask & ((raw > _WHOLE) | (raw < -_WHOLE))).any():
        raise ValueError(
            f"{name} holds whole numbers beyond 2^53, which float64 does not hold: count from a nearer zero."
        )
    with np.errstate(over="ignore"):  # what is larger than float64 is infinite, and refused as that
        return np.where(mask, np.nan, raw.astype(float))


def _kind(value) -> str:
    """Name the kind of its numbers as numpy does; m and M also for other spans and dates."""
    if isinstance(value, datetime.timedelta):
        return "m"
    if isinstance(value, (datetime.date, datetime.time)):
        return "M"
    if hasattr(value, "jd1"):  # of astropy
        return "m" if "Delta" in type(value).__name__ else "M"
    return getattr(getattr(value, "dtype", None), "kind", "")


def _raw(name: str, value) -> np.ndarray:
    """Give the value as an array of numpy, without its mask."""
    if isinstance(value, bytearray):
        value = bytes(value)
    try:
        return np.asarray(value.data if isinstance(value, np.ma.MaskedArray) else value)
    except (TypeError, ValueError, RuntimeError) as error:
        raise ValueError(f"{name} is a {type(value).__name__}, of which numpy makes no array ({error}).") from None


def scalar(name: str, value) -> float:
    """Give one number, from what `plain` admits.

    >>> scalar("h", np.float32(2.0))
    2.0
    """
    out = plain(name, value)
    if out.ndim:
        raise ValueError(f"{name} has the shape {out.shape}: it must be one number.")
    return float(out)


def whole(name: str, value) -> int:
    """Give one whole number, from what `plain` admits.

    >>> whole("order", 3.0)
    3
    """
    out = scalar(name, value)
    if not (out == np.floor(out) and abs(out) <= _WHOLE):
        raise ValueError(f"{name} = {out:g}: it must be a whole number.")
    return int(out)


def array(name: str, value, *shape: int | None, missing: bool = False) -> np.ndarray:
    """Give a fresh contiguous float64 array of the given shape.

    None in `shape` admits any length, `missing` admits NaN.
    Raises ValueError for another shape, and for the first value that is not finite with its place.

    >>> array("z", [[1, None]], None, 2, missing=True).tolist()
    [[1.0, nan]]
    """
    out = np.array(plain(name, value, missing), order="C")
    if out.ndim != len(shape) or any(want not in (None, have) for want, have in zip(shape, out.shape, strict=True)):
        wanted = "(" + ", ".join("any" if s is None else str(s) for s in shape) + ("," if len(shape) == 1 else "") + ")"
        raise ValueError(f"{name} has the shape {out.shape}, it must be {wanted}.")
    bad = np.isinf(out) if missing else ~np.isfinite(out)
    if bad.any():
        place = tuple(int(i) for i in np.argwhere(bad)[0])
        rule = "values must be finite, or NaN where missing" if missing else "values must be finite"
        raise ValueError(f"{name}{list(place) or ''} is {out[place]}: {rule}.")
    return out


def covariance(name: str, value, n: int | None = None) -> np.ndarray:
    """Check a covariance (n, n): finite, symmetric, positive semidefinite up to rounding.

    Any n is admitted where that is None. Symmetry and eigenvalues are judged on the correlation matrix, so that the
    units of the states do not matter. Returns it exactly symmetric.
    Raises ValueError where it is not symmetric, NotPositiveDefinite where an eigenvalue is negative.

    >>> covariance("Q", [[4, 1], [1, 9]]).tolist()
    [[4.0, 1.0], [1.0, 9.0]]
    """
    value = plain(name, value)
    n = len(value) if n is None and value.ndim else n
    return _judge(array(name, value, n, n)[None], lambda k: name)[0]


def covariances(name: str, value, count: int, n: int) -> np.ndarray:
    """Check covariances (K, n, n): one (n, n), K = 1, or one per epoch, K = count.

    >>> covariances("R", np.eye(2), 5, 2).shape
    (1, 2, 2)
    """
    value = plain(name, value)
    if value.ndim != 3:
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
        raise ValueError(f"{name(k)} is not symmetric: {pair}.")
    smallest = np.linalg.eigvalsh(0.5 * (correlation + mirror)).min(axis=1, initial=0.0)
    if (smallest < -10 * n * _EPS).any():
        k = int(np.argmax(smallest < -10 * n * _EPS))
        raise NotPositiveDefinite(name(k), detail=f"its correlation matrix has the eigenvalue {smallest[k]:.3g}")
    return 0.5 * (P + P.transpose(0, 2, 1))


def matrices(name: str, value, count: int, rows: int, columns: int) -> np.ndarray:
    """Check matrices (K, rows, columns): one matrix, K = 1, or one per epoch, K = count.

    >>> matrices("H", np.ones((5, 1, 3)), 5, 1, 3).shape
    (5, 1, 3)
    """
    value = plain(name, value)
    if value.ndim != 3:
        return array(name, value, rows, columns)[None]
    return array(name, value, count, rows, columns)


def epochs(t, repeated: bool = False) -> np.ndarray:
    """Check epochs (N,) [s]: finite, at least one, increasing.

    `repeated` admits equal neighbours.

    >>> epochs([0, 10, 20]).tolist()
    [0.0, 10.0, 20.0]
    """
    times = array("t", t, None)
    if times.size == 0:
        raise ValueError("t is empty, there must be at least one epoch.")
    back = np.diff(times) < 0.0 if repeated else np.diff(times) <= 0.0
    if back.any():
        k = int(np.argmax(back))
        raise ValueError(f"t[{k + 1}] = {times[k + 1]} does not come after t[{k}] = {times[k]}: epochs must increase.")
    return times
