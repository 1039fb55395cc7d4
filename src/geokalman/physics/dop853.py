"""Fixed-step DOP853: the eighth-order Runge-Kutta method of Dormand and Prince, with compensated summation.

Source: Hairer, Norsett & Wanner 1993, Solving ODEs I, section II.10; the coefficients are those of scipy.
"""

from __future__ import annotations

import numpy as np
from numba import njit, types
from scipy.integrate._ivp import dop853_coefficients as _table

STAGES = _table.N_STAGES
NODES = np.ascontiguousarray(_table.C[:STAGES])
WEIGHTS = np.ascontiguousarray(_table.B)
COUPLING = np.ascontiguousarray(_table.A[:STAGES, :STAGES])

vector = types.float64[::1]
matrix = types.float64[:, ::1]
FORCE = types.void(types.float64, vector, vector, vector)
"""Numba signature of a force: force(t, y, params, acceleration)."""


@njit(types.int64(vector, types.float64), cache=True)
def body_below(y, surface):
    """Number of the first body of y whose distance from the origin is below `surface` or not a number, else -1."""
    for b in range(y.size // 6):
        r2 = y[6 * b] ** 2 + y[6 * b + 1] ** 2 + y[6 * b + 2] ** 2
        if not r2 >= surface * surface:
            return b
    return -1


@njit(
    types.int64(types.FunctionType(FORCE), vector, vector, vector, vector, types.int64[::1], types.float64, matrix),
    cache=True,
)
def dop853_steps(force, params, t, y, lost, substeps, surface, out):
    """Take the state from time to time with equal Runge-Kutta steps in between.

    t (n,) times [s]; y (6 k,) state at t[0], and lost (6 k,) what compensated summation owes it, both updated in place;
    substeps (n-1,) steps of each interval; surface: smallest distance from the origin allowed [m]; out (n, 6 k) states.
    Returns -1, or the number of the interval in which a body came below the surface.
    """
    size = y.size
    slope = np.empty((STAGES, size))
    stage = np.empty(size)
    acceleration = np.empty(size // 2)
    out[0] = y
    for i in range(t.size - 1):
        h = (t[i + 1] - t[i]) / substeps[i]
        for j in range(substeps[i]):
            start = t[i] + j * h
            for s in range(STAGES):
                for d in range(size):
                    increment = 0.0
                    for e in range(s):
                        increment += COUPLING[s, e] * slope[e, d]
                    stage[d] = y[d] + h * increment
                force(start + NODES[s] * h, stage, params, acceleration)
                for b in range(size // 6):
                    for d in range(3):
                        slope[s, 6 * b + d] = stage[6 * b + 3 + d]
                        slope[s, 6 * b + 3 + d] = acceleration[3 * b + d]
            for d in range(size):
                increment = 0.0
                for s in range(STAGES):
                    increment += WEIGHTS[s] * slope[s, d]
                increment = h * increment - lost[d]
                total = y[d] + increment
                lost[d] = (total - y[d]) - increment
                y[d] = total
            if body_below(y, surface) >= 0:
                return i
        out[i + 1] = y
    return -1
