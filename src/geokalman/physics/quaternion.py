"""Unit quaternions, scalar first, Hamilton product (ij = k): products, exponential, logarithm, matrices, interpolation.

``R(q)`` is the active matrix of v' = q v q*; where q maps frame a to frame b, v_b = R(q) v_a. q and -q are one
rotation.
The functions named ``*_point`` are compiled kernels on one quaternion (4,) or rotation vector (3,), callable by name
from a compiled loop; the others work on arrays (..., 4) and (..., 3) and broadcast.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

Array = NDArray[np.float64]


@njit(cache=True)
def multiply_point(p, q, out):
    """Hamilton product out = p q; out may be neither p nor q."""
    out[0] = p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3]
    out[1] = p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2]
    out[2] = p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1]
    out[3] = p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0]


@njit(cache=True)
def exp_point(v, out):
    """Quaternion out (4,) of the rotation vector v (3,) [rad]: cos(|v|/2), v sin(|v|/2) / |v|."""
    half = 0.5 * np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    scale = 0.5 * (1.0 - half * half / 6.0) if half < 1e-5 else 0.5 * np.sin(half) / half
    out[0] = np.cos(half)
    for i in range(3):
        out[1 + i] = scale * v[i]


@njit(cache=True)
def log_point(q, out):
    """Rotation vector out (3,) [rad] of the quaternion q, the shorter of its two, |out| <= pi; q need not be of unit
    norm."""
    n = np.sqrt(q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    if n < 1e-9 * abs(q[0]):
        scale = 2.0 / q[0]
    elif q[0] < 0.0:
        scale = -2.0 * np.arctan2(n, -q[0]) / n
    else:
        scale = 2.0 * np.arctan2(n, q[0]) / n
    for i in range(3):
        out[i] = scale * q[1 + i]


@njit(cache=True)
def difference_point(p, q, work, out):
    """Rotation vector out = Log(p* q) (3,) [rad], in the axes that p and q map from; work (4,) is overwritten."""
    work[0] = p[0] * q[0] + p[1] * q[1] + p[2] * q[2] + p[3] * q[3]
    work[1] = p[0] * q[1] - p[1] * q[0] - p[2] * q[3] + p[3] * q[2]
    work[2] = p[0] * q[2] + p[1] * q[3] - p[2] * q[0] - p[3] * q[1]
    work[3] = p[0] * q[3] - p[1] * q[2] + p[2] * q[1] - p[3] * q[0]
    log_point(work, out)


@njit(cache=True)
def retract_point(q, v, work, out):
    """out = q Exp(v), renormalised; work (4,) is overwritten, out may be neither q nor work."""
    exp_point(v, work)
    multiply_point(q, work, out)
    norm = np.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2 + out[3] ** 2)
    for i in range(4):
        out[i] /= norm


@njit(cache=True)
def matrix_point(q, R):
    """Active rotation matrix R(q) (3, 3) of a unit quaternion."""
    R[0, 0] = 1.0 - 2.0 * (q[2] * q[2] + q[3] * q[3])
    R[0, 1] = 2.0 * (q[1] * q[2] - q[0] * q[3])
    R[0, 2] = 2.0 * (q[1] * q[3] + q[0] * q[2])
    R[1, 0] = 2.0 * (q[1] * q[2] + q[0] * q[3])
    R[1, 1] = 1.0 - 2.0 * (q[1] * q[1] + q[3] * q[3])
    R[1, 2] = 2.0 * (q[2] * q[3] - q[0] * q[1])
    R[2, 0] = 2.0 * (q[1] * q[3] - q[0] * q[2])
    R[2, 1] = 2.0 * (q[2] * q[3] + q[0] * q[1])
    R[2, 2] = 1.0 - 2.0 * (q[1] * q[1] + q[2] * q[2])


@njit(cache=True)
def from_matrix_point(R, q):
    """Unit quaternion q (4,) of the rotation matrix R (3, 3), by its largest component (Shepperd 1978)."""
    trace = R[0, 0] + R[1, 1] + R[2, 2]
    best, largest = -1, trace
    for i in range(3):
        if R[i, i] > largest:
            best, largest = i, R[i, i]
    if best < 0:
        q[0] = 0.5 * np.sqrt(1.0 + trace)
        s = 0.25 / q[0]
        q[1], q[2], q[3] = s * (R[2, 1] - R[1, 2]), s * (R[0, 2] - R[2, 0]), s * (R[1, 0] - R[0, 1])
    else:
        i, j, k = best, (best + 1) % 3, (best + 2) % 3
        q[1 + i] = 0.5 * np.sqrt(1.0 + 2.0 * R[i, i] - trace)
        s = 0.25 / q[1 + i]
        q[0], q[1 + j], q[1 + k] = s * (R[k, j] - R[j, k]), s * (R[i, j] + R[j, i]), s * (R[i, k] + R[k, i])


def multiply(p: Array, q: Array) -> Array:
    """Hamilton product p q; p, q : (..., 4), broadcast. Appendix A, (A3)."""
    p, q = np.asarray(p, dtype=float), np.asarray(q, dtype=float)
    out = np.empty(np.broadcast_shapes(p.shape, q.shape))
    p, q = (x if x.shape == out.shape else np.broadcast_to(x, out.shape).copy() for x in (p, q))
    _multiply(*(np.ascontiguousarray(x.reshape(-1, 4)) for x in (p, q, out)))
    return out


@njit(cache=True)
def _multiply(p, q, out):
    for k in range(len(p)):
        p0, p1, p2, p3 = p[k, 0], p[k, 1], p[k, 2], p[k, 3]
        q0, q1, q2, q3 = q[k, 0], q[k, 1], q[k, 2], q[k, 3]
        out[k, 0] = p0 * q0 - p1 * q1 - p2 * q2 - p3 * q3
        out[k, 1] = p0 * q1 + p1 * q0 + p2 * q3 - p3 * q2
        out[k, 2] = p0 * q2 - p1 * q3 + p2 * q0 + p3 * q1
        out[k, 3] = p0 * q3 + p1 * q2 - p2 * q1 + p3 * q0


def conjugate(q: Array) -> Array:
    """q* = (q0, -q1, -q2, -q3), the inverse of a unit quaternion. Appendix A, (A4)."""
    return np.asarray(q, dtype=float) * np.array([1.0, -1.0, -1.0, -1.0])


def normalise(q: Array) -> Array:
    """q / |q|; q : (..., 4). Raises ValueError where a quaternion is zero or not finite."""
    q = np.asarray(q, dtype=float)
    norm = np.sqrt(np.einsum("...i,...i", q, q))
    if not (np.isfinite(norm) & (norm > 0.0)).all():
        raise ValueError("a quaternion is zero or not finite; it has no direction to normalise.")
    return q / norm[..., None]


def exp(v: Array) -> Array:
    """Unit quaternions (..., 4) of rotation vectors v (..., 3) [rad]. (A7): the angle there is half the rotation
    angle."""
    v = np.asarray(v, dtype=float)
    half = 0.5 * np.sqrt(np.einsum("...i,...i", v, v))
    return np.concatenate([np.cos(half)[..., None], 0.5 * np.sinc(half / np.pi)[..., None] * v], axis=-1)


def log(q: Array) -> Array:
    """Rotation vectors (..., 3) [rad] of quaternions (..., 4), of length at most pi."""
    q = np.asarray(q, dtype=float)
    q = np.where(q[..., :1] < 0.0, -q, q)
    n = np.sqrt(np.einsum("...i,...i", q[..., 1:], q[..., 1:]))
    small = n < 1e-9
    scale = np.where(small, 2.0, 2.0 * np.arctan2(n, q[..., 0]) / np.where(small, 1.0, n))
    return scale[..., None] * q[..., 1:]


def difference(p: Array, q: Array) -> Array:
    """Rotation vector Log(p* q) (..., 3) [rad] from p to q, in the axes that both map from (SRF for attitudes)."""
    return log(multiply(conjugate(p), q))


def matrix(q: Array) -> Array:
    """Active rotation matrices R(q) (..., 3, 3) of unit quaternions (..., 4): v' = q v q*."""
    q = np.asarray(q, dtype=float)
    out = np.empty((*q.shape[:-1], 3, 3))
    _matrices(np.ascontiguousarray(q.reshape(-1, 4)), out.reshape(-1, 3, 3))
    return out


@njit(cache=True)
def _matrices(q, R):
    for k in range(len(q)):
        q0, q1, q2, q3 = q[k, 0], q[k, 1], q[k, 2], q[k, 3]
        R[k, 0, 0] = 1 - 2 * (q2 * q2 + q3 * q3)
        R[k, 0, 1] = 2 * (q1 * q2 - q0 * q3)
        R[k, 0, 2] = 2 * (q1 * q3 + q0 * q2)
        R[k, 1, 0] = 2 * (q1 * q2 + q0 * q3)
        R[k, 1, 1] = 1 - 2 * (q1 * q1 + q3 * q3)
        R[k, 1, 2] = 2 * (q2 * q3 - q0 * q1)
        R[k, 2, 0] = 2 * (q1 * q3 - q0 * q2)
        R[k, 2, 1] = 2 * (q2 * q3 + q0 * q1)
        R[k, 2, 2] = 1 - 2 * (q1 * q1 + q2 * q2)


def from_matrix(R: Array) -> Array:
    """Unit quaternions (..., 4) of rotation matrices (..., 3, 3)."""
    R = np.ascontiguousarray(R, dtype=float)
    q = np.empty((*R.shape[:-2], 4))
    _from_matrices(R.reshape(-1, 3, 3), q.reshape(-1, 4))
    return q


@njit(cache=True)
def _from_matrices(R, q):
    for k in range(len(R)):
        from_matrix_point(R[k], q[k])


def rotate(q: Array, v: Array) -> Array:
    """R(q) v; q : (..., 4), v : (..., 3), broadcast."""
    return np.einsum("...ij,...j->...i", matrix(q), v)


def continuous(q: Array) -> Array:
    """The series q (n, 4) with signs such that neighbours have a positive dot product of all four components.

    Rows of NaN (gaps) stay; the sign carries over them. A test on the vector part alone would fail near 180 degrees.
    """
    q = np.array(q, dtype=float)
    there = np.isfinite(q).all(axis=1)
    kept = q[there]
    flips = np.einsum("ki,ki->k", kept[1:], kept[:-1]) < 0.0
    sign = np.where(np.cumsum(flips) % 2 == 1, -1.0, 1.0)
    kept[1:] *= sign[:, None]
    q[there] = kept
    return q


def spline(t: Array, q: Array, at: Array) -> Array:
    """Attitudes (m, 4) at times `at` by a cubic spline of each component of the sign-continuous series, then
    normalised.

    t : (n,) increasing; q : (n, 4), n >= 4; at : (m,) inside [t[0], t[-1]]. Twice continuously differentiable.
    Raises ValueError where an epoch lies outside: a spline does not extrapolate.
    """
    at = np.asarray(at, dtype=float)
    if len(at) and (at.min() < t[0] or at.max() > t[-1]):
        raise ValueError(
            f"epochs {at.min():g} to {at.max():g} s reach beyond the attitudes at {t[0]:g} to {t[-1]:g} s."
        )
    out = CubicSpline(t, continuous(q))(at)
    return out / np.sqrt(np.einsum("ki,ki->k", out, out))[:, None]


def slerp(t: Array, q: Array, at: Array) -> Array:
    """Attitudes (m, 4) at times `at` by turning uniformly between neighbours: q_k Exp(u Log(q_k* q_k+1)).

    t : (n,) increasing; q : (n, 4); at : (m,) inside [t[0], t[-1]].
    """
    k = np.clip(np.searchsorted(t, at, side="right") - 1, 0, len(t) - 2)
    u = (at - t[k]) / (t[k + 1] - t[k])
    return multiply(q[k], exp(u[:, None] * difference(q[k], q[k + 1])))
