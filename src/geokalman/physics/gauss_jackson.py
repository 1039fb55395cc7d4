"""Gauss-Jackson integration: the summed multistep method for r'' = a(t, r, v), one evaluation of the force a step.

With first and second sums of the accelerations on the grid, s_(k+1/2) = s_(k-1/2) + a_k and S_(k+1) = S_k + s_(k+1/2),

    r_k = h^2 (S_k + sum_j u_j a_(k+j)),    v_k = h (s_(k-1/2) + sum_j w_j a_(k+j)),

where the weights follow from the symbols 1/theta^2 - e^theta/(e^theta - 1)^2 and 1/theta - 1/(e^theta - 1), theta =
h d/dt. Offsets j = -1, ..., -P predict a new point; j = -8, ..., 8 are central weights. Output is formed with central
weights, eight steps late, and the sums are started with them in the middle of a Runge-Kutta start arc: an error of the
sums at the start grows all along the orbit, and one-sided weights there would cap its accuracy.

With one evaluation a step the predictor alone decides on stability: an angular rate w needs w h below about 0.05 (45 s
in low Earth orbit), a damping of the velocity |da/dv| h below 8e-4 (drag in low orbit: 1e-6). `disagreement` tells.

Source: Berry & Healy 2004, J. Astronaut. Sci. 52, 331-357 (summed form); Jackson 1924, MNRAS 84, 602-606.
"""

from __future__ import annotations

import functools
import math
from fractions import Fraction

import numpy as np
from numba import njit, types

from geokalman.physics.dop853 import FORCE, body_below, matrix, vector

HALF = 8
"""Half width of the central stencil of the output [steps]."""
PREDICTOR = 12
"""Accelerations that predict a new point: local order 11 in the polynomial through them."""


def _bernoulli(count: int) -> list[Fraction]:
    numbers = [Fraction(1)]
    for n in range(1, count):
        numbers.append(-sum(math.comb(n + 1, k) * numbers[k] for k in range(n)) / (n + 1))
    return numbers


def _lagrange(nodes: tuple[int, ...], i: int) -> list[Fraction]:
    coefficients = [Fraction(1)]  # of the polynomial that is 1 at node i and 0 at the others, lowest power first
    for k, node in enumerate(nodes):
        if k != i:
            scale = Fraction(1, nodes[i] - node)
            shifted = [Fraction(0), *coefficients]
            coefficients = [
                scale * (up - node * here) for up, here in zip(shifted, [*coefficients, Fraction(0)], strict=True)
            ]
    return coefficients


@functools.cache
def weights(nodes: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Weights (u, w) of accelerations at offsets `nodes` [steps] for position and velocity, from exact fractions."""
    bernoulli = _bernoulli(len(nodes) + 2)
    u_moment = [bernoulli[i + 2] / (i + 2) for i in range(len(nodes))]  # i! times the symbol's coefficients
    w_moment = [-bernoulli[i + 1] / (i + 1) for i in range(len(nodes))]
    u, w = [], []
    for i in range(len(nodes)):
        basis = _lagrange(nodes, i)
        u.append(float(sum(c * g for c, g in zip(basis, u_moment, strict=True))))
        w.append(float(sum(c * g for c, g in zip(basis, w_moment, strict=True))))
    return np.array(u), np.array(w)


def predictor() -> tuple[np.ndarray, np.ndarray]:
    """Weights (u, w) of the last accelerations, newest first, for the next point."""
    return weights(tuple(-j for j in range(1, PREDICTOR + 1)))


def central() -> tuple[np.ndarray, np.ndarray]:
    """Weights (u, w) of the accelerations at offsets -HALF..HALF."""
    return weights(tuple(range(-HALF, HALF + 1)))


def disagreement(h: float, a: np.ndarray, s2: np.ndarray) -> tuple[float, float]:
    """Largest difference of predicted and central position at the last row that has both, and the position's size [m].

    a, s2 (rows, 3 k) accelerations and second sums of a window of at least 21 rows. A step within stability keeps the
    difference far below a micrometre; beyond, it grows exponentially.
    """
    k = a.shape[0] - 1 - HALF
    ahead, here = predictor()[0], central()[0]
    predicted = s2[k] + ahead @ a[k - PREDICTOR : k][::-1]
    exact = s2[k] + here @ a[k - HALF : k + HALF + 1]
    return h * h * float(np.abs(predicted - exact).max()), h * h * float(np.abs(exact).max())


@njit(types.UniTuple(types.float64, 2)(types.float64, types.float64, types.float64), cache=True)
def add(total, term, lost):
    """total + lost + term as the nearest number and the rest that does not fit it (two-sum of Knuth)."""
    rough = total + term
    part = rough - total
    lost += (total - (rough - part)) + (term - part)
    exact = rough + lost
    return exact, lost - (exact - rough)


@njit(
    types.int64(
        types.FunctionType(FORCE),
        vector,
        types.float64,
        types.float64,
        types.int64,
        types.int64,
        vector,
        vector,
        types.float64,
        matrix,
        matrix,
        matrix,
        matrix,
    ),
    cache=True,
)
def gauss_jackson_steps(force, params, t0, h, first, begin, u, w, surface, a, s1, s2, lost):
    """Extend the accelerations and their sums over a window of the grid, one evaluation of the force a step.

    Row i of the window is step first + i of the grid t0 + h k. Rows below `begin` are filled; the rest is written.
    u, w (P,) predictor weights; a, s1, s2 (rows, 3 k) accelerations, first sums s_(i-1/2) and second sums S_i;
    lost (2, 3 k) what rounding took from s1 and s2, updated in place.
    Returns -1, or the row at which a body came below `surface`.
    """
    rows, size = a.shape
    y = np.empty(2 * size)
    for i in range(begin, rows):
        for d in range(size):
            s1[i, d], rest = add(s1[i - 1, d], a[i - 1, d], lost[0, d])
            lost[0, d] = rest
            s2[i, d], lost[1, d] = add(s2[i - 1, d], s1[i, d], lost[1, d] + rest)
            r, v = 0.0, 0.0
            for j in range(u.size - 1, -1, -1):
                r += u[j] * a[i - 1 - j, d]
                v += w[j] * a[i - 1 - j, d]
            b = d // 3
            y[3 * b + d] = h * h * (s2[i, d] + r)
            y[3 * b + 3 + d] = h * (s1[i, d] + v)
        if body_below(y, surface) >= 0:
            return i
        force(t0 + (first + i) * h, y, params, a[i])
    return -1


@njit(types.void(types.float64, types.int64[::1], vector, vector, matrix, matrix, matrix, matrix), cache=True)
def central_states(h, rows, u, w, a, s1, s2, out):
    """States (len(rows), 6 k) at rows of a window by the central weights u, w (2 HALF + 1,)."""
    half = u.size // 2
    for i in range(rows.size):
        k = rows[i]
        for d in range(a.shape[1]):
            r, v = 0.0, 0.0
            for j in range(u.size):
                r += u[j] * a[k - half + j, d]
                v += w[j] * a[k - half + j, d]
            b = d // 3
            out[i, 3 * b + d] = h * h * (s2[k, d] + r)
            out[i, 3 * b + 3 + d] = h * (s1[k, d] + v)
