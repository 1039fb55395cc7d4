"""Gravity gradient tensor of a spherical-harmonic field at points.

A Cartesian derivative of an exterior harmonic of degree n is one of degree n + 1, so each component of the tensor is
a series like the potential itself, with coefficients that are found once (Cunningham 1970, Celest. Mech. 2, 207-216;
unnormalised in Montenbruck & Gill 2000, Satellite Orbits, eqs 3.33). All of them share one monic Legendre recursion.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from geokalman.physics.gravity import MAX_DEGREE, checked_degree, checked_points, monic_factors, monic_recursion
from geokalman.physics.harmonics import GravityField

HEADER = 3
"""Numbers before the tables in packed parameters: GM [m^3 s^-2], R [m], maximum degree of the series."""
SERIES = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2))
"""Components summed; zz follows from Laplace's equation."""


def derivative(C: np.ndarray, S: np.ndarray, axis: int) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients of dV/dx_axis as a series of V's own kind, one degree longer and with GM/R^2 in the place of GM/R.

    C, S (N+1, N+1) fully normalised; axis 0, 1, 2 for x, y, z. Returns two arrays (N+2, N+2).
    """
    top = C.shape[0]
    dC, dS = np.zeros((2, top + 1, top + 1))
    for n in range(top):
        m = np.arange(n + 1)
        ratio = (2 * n + 1) / (2 * n + 3)
        c, s = C[n, : n + 1], S[n, : n + 1]
        if axis == 2:
            k = -np.sqrt(ratio * (n + 1 - m) * (n + 1 + m))
            dC[n + 1, : n + 1], dS[n + 1, : n + 1] = k * c, k * s
            continue
        # d/dx -+ i d/dy lower or raise the order by one; order 0 has no partner below
        up = 0.5 * np.sqrt(ratio * (n + m + 1) * (n + m + 2) * np.where(m == 0, 2.0, 1.0))
        down = 0.5 * np.sqrt(ratio * (n - m + 1) * (n - m + 2) * np.where(m == 1, 2.0, 1.0))[1:]
        if axis == 0:
            dC[n + 1, 1 : n + 2] -= up * c
            dS[n + 1, 1 : n + 2] -= up * s
            dC[n + 1, :n] += down * c[1:]
            dS[n + 1, :n] += down * s[1:]
        else:
            dC[n + 1, 1 : n + 2] += up * s
            dS[n + 1, 1 : n + 2] -= up * c
            dC[n + 1, :n] += down * s[1:]
            dS[n + 1, :n] -= down * c[1:]
    dS[:, 0] = 0.0
    return dC, dS


def pack_gradient(field: GravityField, n_max: int | None = None) -> np.ndarray:
    """Flat parameters of `gradient_point`: header, then beta and the five pairs of folded coefficients, order by order.

    Raises ValueError for a degree that the field lacks, or above 998.
    """
    n_max = checked_degree(field, n_max)
    if n_max + 2 > MAX_DEGREE:
        raise ValueError(f"n_max = {n_max} is above {MAX_DEGREE - 2}: the series of the gradient leave float64 there.")
    C, S = field.C[: n_max + 1, : n_max + 1], field.S[: n_max + 1, : n_max + 1]
    first = [derivative(C, S, axis) for axis in range(3)]
    m, n = np.triu_indices(n_max + 3)
    k = monic_factors(n_max + 2)[n, m]
    columns = []
    for i, j in SERIES:
        columns += [k * part[n, m] for part in derivative(*first[i], j)]
    header = [field.gm, field.radius, n_max + 2]
    beta = [monic_recursion(n_max + 2, order) for order in range(n_max + 3)]
    return np.concatenate([header, *beta, np.stack(columns, axis=1).ravel()])


@njit(cache=True)
def gradient_point(r, params, out):
    """Gradient tensor of a packed field at one Earth-fixed point r (3,) [m], written to out (3, 3) [s^-2]."""
    gm, radius, n_max = params[0], params[1], int(params[2])
    terms = (n_max + 1) * (n_max + 2) // 2
    beta = params[HEADER : HEADER + terms]
    table = params[HEADER + terms :]
    f = radius / (r[0] * r[0] + r[1] * r[1] + r[2] * r[2])
    x, y, z, q = f * r[0], f * r[1], f * r[2], radius * f
    sums, total = np.empty(10), np.zeros(5)
    re, im = 1.0, 0.0
    k = 0
    for m in range(n_max + 1):
        p, older = 1.0, 0.0
        sums[:] = 0.0
        for _ in range(m, n_max + 1):
            for j in range(10):
                sums[j] += table[10 * k + j] * p
            k += 1
            if k < terms:
                p, older = z * p - beta[k] * q * older, p
        for j in range(5):
            total[j] += re * sums[2 * j] + im * sums[2 * j + 1]
        re, im = x * re - y * im, x * im + y * re
    g = gm / (radius * radius * radius) * math.sqrt(q)
    out[0, 0] = g * total[0]
    out[0, 1] = out[1, 0] = g * total[1]
    out[0, 2] = out[2, 0] = g * total[2]
    out[1, 1] = g * total[3]
    out[1, 2] = out[2, 1] = g * total[4]
    out[2, 2] = -(out[0, 0] + out[1, 1])


@njit(cache=True)
def _gradients(points, params, out):
    for i in range(points.shape[0]):
        gradient_point(points[i], params, out[i])


def gradient_tensor(field: GravityField, r_ecef: np.ndarray, n_max: int | None = None) -> np.ndarray:
    """Second derivatives d^2 V / dx_i dx_j of the potential at Earth-fixed points; symmetric, without trace.

    r_ecef : (..., 3) positions [m]
    n_max : degree and order at which the sum stops (default: all of the field)
    Returns (..., 3, 3) [s^-2]. Raises ValueError for a point below 0.9 of the field's radius or a degree it lacks.
    """
    points = checked_points(r_ecef, field.radius)
    out = np.empty((points.shape[0], 3, 3))
    _gradients(points, pack_gradient(field, n_max), out)
    return out.reshape(*np.shape(r_ecef), 3)
