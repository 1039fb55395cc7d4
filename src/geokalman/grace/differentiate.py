"""Numerical derivatives of equally spaced series: Newton's central formulas and interpolating splines.

The central (2k+1)-point formula is the derivative, at the middle, of the polynomial of degree 2k through the points.
Its transfer function, not noise, is the whole content of the paper's "Newton" row.
"""

from __future__ import annotations

from fractions import Fraction
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

Array = NDArray[np.float64]


@cache
def _exact_weights(points: int, order: int) -> tuple[Fraction, ...]:
    """Weights for unit spacing by Fornberg's recursion (1988, Math. Comp. 51, 699-706) in exact arithmetic."""
    k = points // 2
    nodes = [Fraction(j) for j in range(-k, k + 1)]
    delta = [[Fraction(0)] * points for _ in range(order + 1)]
    delta[0][0] = Fraction(1)
    c1 = Fraction(1)
    for n in range(1, points):
        c2 = Fraction(1)
        new = [row[:] for row in delta]
        for v in range(n):
            c3 = nodes[n] - nodes[v]
            c2 *= c3
            for m in range(min(n, order) + 1):
                lower = delta[m - 1][v] if m else Fraction(0)
                new[m][v] = (nodes[n] * delta[m][v] - m * lower) / c3
        for m in range(min(n, order) + 1):
            lower = delta[m - 1][n - 1] if m else Fraction(0)
            new[m][n] = c1 / c2 * (m * lower - nodes[n - 1] * delta[m][n - 1])
        c1, delta = c2, new
    return tuple(delta[order])


def central_weights(points: int = 9, order: int = 1) -> Array:
    """Weights of the central formula for the derivative of the given order at unit spacing, (points,).

    For 9 points: D9 = [1/280, -4/105, 1/5, -4/5, 0, 4/5, ...] and D2_9 = [-1/560, 8/315, -1/5, 8/5, -205/72, ...].
    Raises ValueError for an even number of points, fewer than order + 1, or an order below 1.
    """
    if points % 2 == 0 or points < 3:
        raise ValueError(f"a central stencil of {points} points has no middle; give an odd number, 3 or more.")
    if not 1 <= order < points:
        raise ValueError(f"a {points}-point stencil has no derivative of order {order}; give 1 to {points - 1}.")
    return np.array([float(w) for w in _exact_weights(points, order)])


def derivative(series: Array, dt: float, points: int = 9, order: int = 1) -> Array:
    """Derivative of a series at each epoch by the central formula; NaN at the points//2 epochs of either edge.

    series: (n,) or (n, k), equally spaced by dt [s]; returns the same shape, in the series' unit per s^order.
    One-sided formulas at the edges are thirty times worse, so there are none.
    Raises ValueError where the series is shorter than the stencil.
    """
    series = np.asarray(series, dtype=float)
    if len(series) < points:
        raise ValueError(f"{len(series)} epochs are too few for a {points}-point stencil; give at least {points}.")
    weights = central_weights(points, order)
    half = points // 2
    out = np.full_like(series, np.nan)
    inner = slice(half, len(series) - half)
    # Differences from the middle value first: a range of 2e5 m must not swamp a derivative of 1e-8 m/s.
    total = np.zeros_like(series[inner])
    for offset, weight in zip(range(-half, half + 1), weights, strict=True):
        if offset:
            total += weight * (series[half + offset : len(series) - half + offset] - series[inner])
    out[inner] = total / dt**order
    return out


def spline_derivative(series: Array, dt: float, degree: int = 11, order: int = 1) -> Array:
    """Derivative of the interpolating spline of the given odd degree (not-a-knot ends); series (n,) or (n, k).

    Raises ValueError for an even degree or a series that is too short.
    """
    series = np.asarray(series, dtype=float)
    if degree % 2 == 0 or degree < 1:
        raise ValueError(f"an interpolating spline of degree {degree} is not centred on its knots; give an odd degree.")
    if len(series) < degree + 1:
        raise ValueError(
            f"{len(series)} epochs are too few for a spline of degree {degree}; give at least {degree + 1}."
        )
    t = np.arange(len(series), dtype=float)  # unit spacing: the collocation matrix is then scaled as well as it can be
    middle = series.mean(axis=0)
    return make_interp_spline(t, series - middle, k=degree, axis=0).derivative(order)(t) / dt**order


def transfer(frequency: Array, dt: float, points: int = 9, order: int = 1) -> Array:
    """Gain of the central formula relative to the true derivative at the given frequencies [Hz]; 1 is perfect.

    order 1: (2 / theta) sum_j w_j sin(j theta), order 2: -(1 / theta^2) (w_0 + 2 sum_j w_j cos(j theta)), theta = 2 pi
    f dt.
    """
    theta = 2 * np.pi * np.asarray(frequency, dtype=float) * dt
    weights, half = central_weights(points, order), points // 2
    j = np.arange(1, half + 1)
    if order == 1:
        sums = 2 * np.sin(np.multiply.outer(theta, j)) @ weights[half + 1 :]
        return np.divide(sums, theta, out=np.ones_like(theta), where=theta != 0)
    if order == 2:
        sums = -(weights[half] + 2 * np.cos(np.multiply.outer(theta, j)) @ weights[half + 1 :])
        return np.divide(sums, theta**2, out=np.ones_like(theta), where=theta != 0)
    raise ValueError(f"the transfer function is given for order 1 and 2, not for {order}.")


def noise_gain(points: int = 9, order: int = 1) -> float:
    """Standard deviation of the derivative of unit white noise at unit spacing: the 2-norm of the weights (9 points:
    1.167, 3.648)."""
    return float(np.linalg.norm(central_weights(points, order)))
