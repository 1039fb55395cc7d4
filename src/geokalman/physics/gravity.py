"""Gravity of a spherical-harmonic field at points: potential and acceleration (the tensor is in `gradient`).

The potential of fully normalised coefficients is

    V(r) = GM/r sum_n sum_m (R/r)^n P_nm(sin phi) (C_nm cos m lambda + S_nm sin m lambda).

With X = R x/r^2, Y = R y/r^2, Z = R z/r^2 and Q = R^2/r^2 a term of it is ``k_nm p_nm(Z, Q) Re (X + iY)^m`` (``Im``
for S), where p_nm is the monic solid Legendre polynomial

    p_n = Z p_(n-1) - beta_nm Q p_(n-2),   beta_nm = ((n-1)^2 - m^2) / (4 (n-1)^2 - 1),   p_mm = 1,

and the normalisation k_nm (about 2^n) is folded into the coefficients once. The factor (X + iY)^m carries all of the
longitude and of cos^m phi, so a pole is a point like any other.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from geokalman.physics.harmonics import GravityField
from geokalman.physics.simd import LANES, load, mul, muladd, splat, store

MAX_DEGREE = 1000
"""Highest degree of the kernels: beyond it the folded normalisation, about 2^n, leaves the range of float64."""
MIN_RADIUS_RATIO = 0.9
"""Smallest |r|/R accepted: further down the series means nothing (it converges outside the masses)."""
HEADER = 4
"""Numbers before the table in packed parameters: GM [m^3 s^-2], R [m], maximum degree, C_00."""
STRIDE = 3 * LANES
"""Numbers of one step n - m of a block of eight orders in the table: -beta, C and S of each order."""


def monic_factors(n_max: int) -> np.ndarray:
    """Factors k_nm from monic to fully normalised Legendre functions, P_nm(t) = k_nm (1 - t^2)^(m/2) (t^(n-m) + ...).

    n_max : maximum degree, 0..1000
    Returns (n_max+1, n_max+1), lower triangle. Raises ValueError for a degree outside the range of float64.
    """
    if not 0 <= n_max <= MAX_DEGREE:
        raise ValueError(f"degree {n_max} is outside 0..{MAX_DEGREE}, where the monic Legendre recursion fits float64.")
    k = np.zeros((n_max + 1, n_max + 1))
    k[0, 0] = 1.0
    for n in range(1, n_max + 1):
        m = np.arange(n)
        k[n, :n] = k[n - 1, :n] * np.sqrt((2 * n + 1) * (2 * n - 1) / ((n - m) * (n + m)))
        k[n, n] = k[n - 1, n - 1] * math.sqrt((2 * n + 1) / (2 * n) * (2 if n == 1 else 1))
    return k


def pack(field: GravityField, n_max: int | None = None) -> np.ndarray:
    """Flat parameters of a field for the kernels: header, then a table with the normalisation folded in.

    The table goes by blocks of eight orders m and in a block by n - m, so that eight recursions run in step:
    (-beta, C, S) x 8 orders for n - m = 0, 1, ... of the block's first order. C_00 is in the header alone.

    field : gravity field
    n_max : degree and order at which the sum stops (default: all of the field)
    Returns a vector. Raises ValueError for a degree that the field or float64 does not reach.
    """
    n_max = checked_degree(field, n_max)
    k = monic_factors(n_max)
    folded = [k * x[: n_max + 1, : n_max + 1] for x in (field.C, field.S)]
    folded[0][0, 0] = 0.0
    parts = [np.array([field.gm, field.radius, n_max, field.C[0, 0]])]
    for first in range(0, n_max + 1, LANES):
        block = np.zeros((n_max + 1 - first, 3, LANES))
        for m in range(first, min(first + LANES, n_max + 1)):
            steps = n_max + 1 - m
            block[:steps, 0, m - first] = -monic_recursion(n_max, m)
            for row, x in enumerate(folded, start=1):
                block[:steps, row, m - first] = x[m:, m]
        parts.append(block.ravel())
    return np.concatenate(parts)


def monic_recursion(n_max: int, m: int) -> np.ndarray:
    """Coefficients beta_nm of the recursion for one order, n = m..n_max: (n_max + 1 - m,); that of n = m is 0."""
    n = np.arange(m, n_max + 1.0)
    beta = ((n - 1.0) ** 2 - m * m) / (4.0 * (n - 1.0) ** 2 - 1.0)
    beta[0] = 0.0
    return beta


def checked_degree(field: GravityField, n_max: int | None) -> int:
    """The degree at which a sum stops: n_max, or all of the field for None; ValueError where there is none."""
    top = field.C.shape[0] - 1
    if n_max is None:
        n_max = top
    if not 0 <= n_max <= top:
        raise ValueError(f"n_max = {n_max} is outside 0..{top}, the degrees of the field {field.name}.")
    if n_max > MAX_DEGREE:
        raise ValueError(f"n_max = {n_max} is above {MAX_DEGREE}, the recursion leaves float64: truncate the field.")
    return int(n_max)


def checked_points(r: np.ndarray, radius: float) -> np.ndarray:
    """Positions (..., 3) as a contiguous (k, 3) array; ValueError where one is below the field of that radius."""
    r = np.asarray(r, dtype=float)
    if r.ndim == 0 or r.shape[-1] != 3:
        raise ValueError(f"positions have shape {r.shape}, their last axis must be x, y, z.")
    points = np.ascontiguousarray(r.reshape(-1, 3))
    distance = np.sqrt(np.einsum("ij,ij->i", points, points))
    bad = np.flatnonzero(~(distance >= MIN_RADIUS_RATIO * radius))
    if bad.size:
        i = bad[0]
        raise ValueError(
            f"position {i} is {distance[i]:.6g} m from the centre, the exterior field needs at least "
            f"{MIN_RADIUS_RATIO:g} of its radius {radius:.10g} m."
        )
    return points


@njit(cache=True)
def acceleration_point(r, params, out):
    """Acceleration of a packed field at one Earth-fixed point r (3,) [m], written to out (3,) [m s^-2].

    With g = GM/R^2 sqrt(Q), q = (X, Y, Z) and H the sum of all terms above degree 0,
    dV/dx_i = g (Q dH/dq_i - q_i sum (n + m + 1 + Z d/dZ) H_nm - q_i C_00); derivatives at constant Q.
    Eight orders run side by side; `potential_point` is the same walk through the table one order at a time.
    """
    gm, radius, n_max, c00 = params[0], params[1], int(params[2]), params[3]
    f = radius / (r[0] * r[0] + r[1] * r[1] + r[2] * r[2])
    x, y, z, q = f * r[0], f * r[1], f * r[2], radius * f
    zs, qs, zero, one = splat(z), splat(q), splat(0.0), splat(1.0)
    sums = np.empty(6 * LANES)
    re, im = 1.0, 0.0  # (X + iY)^m
    re_below, im_below = 0.0, 0.0  # (X + iY)^(m-1)
    hx, hy, hz, hw = 0.0, 0.0, 0.0, 0.0
    at = HEADER
    for first in range(0, n_max + 1, LANES):
        p1, p2, d1, d2 = one, zero, zero, zero  # p and dp/dZ of the last two degrees
        a, b = load(params, at + LANES), load(params, at + 2 * LANES)  # sums of C p and S p,
        aw, bw, az, bz = zero, zero, zero, zero  # of (n - m) C p and (n - m) S p, of C dp/dZ and S dp/dZ
        at += STRIDE
        step = 0.0
        for _ in range(first, n_max):
            step += 1.0
            bq = mul(load(params, at), qs)
            c, s = load(params, at + LANES), load(params, at + 2 * LANES)
            at += STRIDE
            p = muladd(zs, p1, mul(bq, p2))
            d = muladd(zs, d1, muladd(bq, d2, p1))
            weight = splat(step)
            a, b = muladd(c, p, a), muladd(s, p, b)
            aw, bw = muladd(weight, mul(c, p), aw), muladd(weight, mul(s, p), bw)
            az, bz = muladd(c, d, az), muladd(s, d, bz)
            p2, p1, d2, d1 = p1, p, d1, d
        store(sums, 0, a)
        store(sums, LANES, b)
        store(sums, 2 * LANES, aw)
        store(sums, 3 * LANES, bw)
        store(sums, 4 * LANES, az)
        store(sums, 5 * LANES, bz)
        for j in range(min(LANES, n_max + 1 - first)):
            m = first + j
            cos, sin = sums[j], sums[LANES + j]
            hx += m * (re_below * cos + im_below * sin)
            hy += m * (re_below * sin - im_below * cos)
            dz = re * sums[4 * LANES + j] + im * sums[5 * LANES + j]
            hz += dz
            weight_m = 2.0 * m + 1.0
            hw += re * (sums[2 * LANES + j] + weight_m * cos) + im * (sums[3 * LANES + j] + weight_m * sin) + z * dz
            re_below, im_below = re, im
            re, im = x * re_below - y * im_below, x * im_below + y * re_below
    g = gm / (radius * radius) * math.sqrt(q)  # the central term last: it would cost the small ones their digits
    out[0] = g * (q * hx - x * hw - x * c00)
    out[1] = g * (q * hy - y * hw - y * c00)
    out[2] = g * (q * hz - z * hw - z * c00)


@njit(cache=True)
def potential_point(r, params):
    """Potential of a packed field at one Earth-fixed point r (3,) [m], in m^2 s^-2."""
    gm, radius, n_max, c00 = params[0], params[1], int(params[2]), params[3]
    f = radius / (r[0] * r[0] + r[1] * r[1] + r[2] * r[2])
    x, y, z, q = f * r[0], f * r[1], f * r[2], radius * f
    re, im = 1.0, 0.0
    h = 0.0
    block = HEADER
    for m in range(n_max + 1):
        lane = m % LANES
        if lane == 0 and m > 0:
            block += STRIDE * (n_max + 1 - (m - LANES))
        k = block + lane
        p1, p2 = 1.0, 0.0
        a, b = params[k + LANES], params[k + 2 * LANES]
        for _ in range(m, n_max):
            k += STRIDE
            p = z * p1 + params[k] * q * p2
            a += params[k + LANES] * p
            b += params[k + 2 * LANES] * p
            p2, p1 = p1, p
        h += re * a + im * b
        re, im = x * re - y * im, x * im + y * re
    return gm / radius * math.sqrt(q) * (c00 + h)


@njit(cache=True)
def _accelerations(points, params, out):
    for i in range(points.shape[0]):
        acceleration_point(points[i], params, out[i])


@njit(cache=True)
def _potentials(points, params, out):
    for i in range(points.shape[0]):
        out[i] = potential_point(points[i], params)


def acceleration(field: GravityField, r_ecef: np.ndarray, n_max: int | None = None) -> np.ndarray:
    """Gravitational acceleration g = grad V of a field at Earth-fixed points.

    r_ecef : (..., 3) positions [m]
    n_max : degree and order at which the sum stops (default: all of the field)
    Returns (..., 3) [m s^-2]. Raises ValueError for a point below 0.9 of the field's radius or a degree it lacks.
    """
    points = checked_points(r_ecef, field.radius)
    out = np.empty_like(points)
    _accelerations(points, pack(field, n_max), out)
    return out.reshape(np.shape(r_ecef))


def potential(field: GravityField, r_ecef: np.ndarray, n_max: int | None = None) -> np.ndarray:
    """Gravitational potential V of a field at Earth-fixed points.

    r_ecef : (..., 3) positions [m]
    n_max : degree and order at which the sum stops (default: all of the field)
    Returns (...) [m^2 s^-2]. Raises ValueError as `acceleration` does.
    """
    points = checked_points(r_ecef, field.radius)
    out = np.empty(points.shape[0])
    _potentials(points, pack(field, n_max), out)
    return out.reshape(np.shape(r_ecef)[:-1])
