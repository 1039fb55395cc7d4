"""Partials of the gravity difference of two satellites along their line of sight: the rows of gravity recovery.

The observable (g_A - g_B).e is linear in the coefficients. Rotating e into the local (east, north, up) frames of A
and B, as the paper's equations (48) and (49) do, or leaving it Earth-fixed, as here, gives the same row; here no pole
is special. With the symbols of `geokalman.physics.gravity`, the partial of e.g with respect to C_nm is the real, to
S_nm the imaginary part of

    GM/R^2 sqrt(Q) k_nm { p_nm [Q m (e_x + i e_y) zeta^(m-1) - e.q (n + m + 1) zeta^m]
                          + dp_nm/dZ [Q e_z - e.q Z] zeta^m },

where zeta = X + iY and dp_nm/dZ = (n - m) p_(n,m+1).
"""

from __future__ import annotations

import functools
import math

import numpy as np
from numba import njit

from geokalman.physics.gravity import checked_points, monic_factors
from geokalman.physics.simd import LANES, load, mul, muladd, splat, store


def column_count(n_max: int) -> int:
    """Number of unknowns to degree and order n_max with degrees 0 and 1 held: (n_max + 1)^2 - 4."""
    if n_max < 2:
        raise ValueError(f"n_max = {n_max} leaves nothing to recover: degrees 0 and 1 are held, take at least 2.")
    return (n_max + 1) ** 2 - 4


def column_names(n_max: int) -> list[tuple[str, int, int]]:
    """Columns of the design matrix: ("C", n, m) for n = 2.. and m = 0..n, then ("S", n, m) for n = 2.. and m = 1..n."""
    column_count(n_max)
    degrees = range(2, n_max + 1)
    cosine = [("C", n, m) for n in degrees for m in range(n + 1)]
    return cosine + [("S", n, m) for n in degrees for m in range(1, n + 1)]


def to_vector(C: np.ndarray, S: np.ndarray, n_max: int) -> np.ndarray:
    """Coefficients C, S (N+1, N+1) in the order of the columns: ((n_max+1)^2 - 4,)."""
    (cn, cm), (sn, sm) = _places(n_max)
    return np.concatenate([np.asarray(C)[cn, cm], np.asarray(S)[sn, sm]])


def from_vector(x: np.ndarray, n_max: int) -> tuple[np.ndarray, np.ndarray]:
    """C, S (n_max+1, n_max+1) of a vector in the order of the columns; degrees 0 and 1 are left zero."""
    if np.shape(x) != (column_count(n_max),):
        raise ValueError(f"vector of shape {np.shape(x)}: degree {n_max} has {column_count(n_max)} columns.")
    (cn, cm), (sn, sm) = _places(n_max)
    C, S = np.zeros((2, n_max + 1, n_max + 1))
    C[cn, cm] = x[: cn.size]
    S[sn, sm] = x[cn.size :]
    return C, S


def _places(n_max: int) -> tuple[tuple[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]:
    column_count(n_max)
    n, m = np.tril_indices(n_max + 1)
    c, s = n >= 2, (n >= 2) & (m >= 1)
    return (n[c], m[c]), (n[s], m[s])


def _width(n_max: int) -> int:
    return LANES * ((n_max + LANES) // LANES + 1)  # whole vectors of the orders 0..n_max, and one to read past them


@functools.lru_cache(maxsize=8)
def row_table(n_max: int) -> np.ndarray:
    """Flat table (n_max+2, W) of `design_row`: the orders m as numbers, then the factors k_nm of each degree."""
    table = np.zeros((n_max + 2, _width(n_max)))
    table[0] = np.arange(table.shape[1])
    table[1:, : n_max + 1] = monic_factors(n_max)
    table.flags.writeable = False
    return table.ravel()


@njit(cache=True)
def _prepare(r, e, gm, radius, n_max, width, c, s):
    """Fill c, s (3 W,): factors of p, n p and dp/dZ in the partials at r, order by order; returns Z and Q."""
    f = radius / (r[0] * r[0] + r[1] * r[1] + r[2] * r[2])
    x, y, z, q = f * r[0], f * r[1], f * r[2], radius * f
    g = gm / (radius * radius) * math.sqrt(q)
    up = g * (e[0] * x + e[1] * y + e[2] * z)
    ex, ey, ez = g * q * e[0], g * q * e[1], g * q * e[2] - up * z
    re, im, re_below, im_below = 1.0, 0.0, 0.0, 0.0
    for m in range(n_max + 1):
        c[m] = m * (ex * re_below - ey * im_below) - up * (m + 1) * re
        s[m] = m * (ex * im_below + ey * re_below) - up * (m + 1) * im
        c[width + m], s[width + m] = -up * re, -up * im
        c[2 * width + m], s[2 * width + m] = ez * re, ez * im
        re_below, im_below = re, im
        re, im = x * re_below - y * im_below, x * im_below + y * re_below
    return z, q


@njit(cache=True)
def _next_degree(n, z, q, p, above, here, table):
    """Overwrite the monic functions of degree n-2 at p[here:] by those of degree n; p[above:] holds degree n-1.

    Functions of an order above their degree are zero, which makes the recursion right at its ends too.
    """
    square = (n - 1.0) * (n - 1.0)
    scale = q / (4.0 * square - 1.0)
    zs, top, slope = splat(z), splat(-scale * square), splat(scale)
    for m in range(0, n + 1, LANES):
        order = load(table, m)
        beta = muladd(slope, mul(order, order), top)  # -beta Q
        store(p, here + m, muladd(zs, load(p, above + m), mul(beta, load(p, here + m))))
    p[here + n] = 1.0


@njit(cache=True)
def _add_degree(n, first, p, here, table, width, f, row, at):
    """Add the partials of degree n and orders first..n to row[at:]; f (3 W,) are the factors that `_prepare` found."""
    factor = (n + 1) * width
    degree, minus = splat(float(n)), splat(-1.0)
    m = first
    while m + LANES <= n + 1:
        slope = mul(muladd(minus, load(table, m), degree), load(p, here + m + 1))  # dp/dZ
        flat = muladd(degree, load(f, width + m), load(f, m))
        value = muladd(load(p, here + m), flat, mul(slope, load(f, 2 * width + m)))
        store(row, at, muladd(load(table, factor + m), value, load(row, at)))
        m += LANES
        at += LANES
    while m <= n:
        slope_m = (n - m) * p[here + m + 1]
        row[at] += table[factor + m] * (p[here + m] * (f[m] + n * f[width + m]) + slope_m * f[2 * width + m])
        m += 1
        at += 1


@njit(cache=True)
def design_row(rA, rB, e, gm, radius, n_max, table, out):
    """Partials of e.(g_A - g_B) with respect to the coefficients, one row of the design matrix.

    rA, rB (3,) Earth-fixed positions [m]; e (3,) Earth-fixed unit vector; table from `row_table(n_max)`;
    out ((N+1)^2 - 4,) [m s^-2] in the order of `column_names`.
    """
    width = table.size // (n_max + 2)
    c, s, p = np.empty(3 * width), np.empty(3 * width), np.empty(2 * width)
    out[:] = 0.0
    for satellite in range(2):
        sign = 1.0 - 2.0 * satellite
        z, q = _prepare(rB if satellite else rA, e, sign * gm, radius, n_max, width, c, s)
        p[:] = 0.0
        p[0], p[width], p[width + 1] = 1.0, z, 1.0  # degrees 0 and 1
        at_c, at_s = 0, (n_max + 1) * (n_max + 2) // 2 - 3
        for n in range(2, n_max + 1):
            here = (n % 2) * width
            _next_degree(n, z, q, p, width - here, here, table)
            _add_degree(n, 0, p, here, table, width, c, out, at_c)
            _add_degree(n, 1, p, here, table, width, s, out, at_s)
            at_c += n + 1
            at_s += n


@njit(cache=True)
def _design_rows(rA, rB, e, gm, radius, n_max, table, out):
    for i in range(rA.shape[0]):
        design_row(rA[i], rB[i], e[i], gm, radius, n_max, table, out[i])


def design_block(
    gm: float, radius: float, n_max: int, rA: np.ndarray, rB: np.ndarray, e: np.ndarray, out: np.ndarray | None = None
) -> np.ndarray:
    """Rows d[e.(g_A - g_B)]/d(C_nm, S_nm) of the design matrix of the acceleration approach, equations (48) and (49).

    gm [m^3 s^-2], radius [m] : scale of the coefficients
    n_max : degree and order of the unknowns, at least 2
    rA, rB : (k, 3) Earth-fixed positions [m]
    e : (k, 3) Earth-fixed unit vectors of the line of sight
    out : (k, (n_max+1)^2 - 4) float64, C-contiguous, filled if given
    Returns out [m s^-2], columns as `column_names` lists them. Raises ValueError for shapes that do not fit, vectors e
    that are not of unit length, points below the field.
    """
    rA, rB = checked_points(rA, radius), checked_points(rB, radius)
    e = np.ascontiguousarray(e, dtype=float).reshape(-1, 3)
    if not rA.shape == rB.shape == e.shape:
        raise ValueError(f"positions {rA.shape}, {rB.shape} and lines of sight {e.shape} must be as many.")
    off = np.abs(np.einsum("ij,ij->i", e, e) - 1.0)
    if np.any(~(off < 1e-9)):
        i = int(np.argmax(~(off < 1e-9)))
        raise ValueError(f"line of sight {i}, {e[i].tolist()}, has length {np.linalg.norm(e[i]):.12g}, it must be 1.")
    shape = (rA.shape[0], column_count(n_max))
    if out is None:
        out = np.empty(shape)
    elif out.shape != shape or out.dtype != np.float64 or not out.flags.c_contiguous:
        raise ValueError(f"out is {out.dtype} {out.shape}, it must be C-contiguous float64 {shape}.")
    _design_rows(rA, rB, e, float(gm), float(radius), n_max, row_table(n_max), out)
    return out
