"""Central formulas and splines: exact on polynomials, against closed forms, and on the specification's orbits."""

from __future__ import annotations

from fractions import Fraction
from math import factorial

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from geokalman.grace import assess, estimate, observables
from geokalman.grace.differentiate import (
    _exact_weights,
    central_weights,
    derivative,
    noise_gain,
    spline_derivative,
    transfer,
)
from geokalman.grace.model import distance, range_rate

REVOLUTION = 5626.0  # s: section 2 of the specification


def test_nine_points_as_printed():
    np.testing.assert_allclose(
        central_weights(9), [1 / 280, -4 / 105, 1 / 5, -4 / 5, 0, 4 / 5, -1 / 5, 4 / 105, -1 / 280], rtol=2e-15
    )
    second = [-1 / 560, 8 / 315, -1 / 5, 8 / 5, -205 / 72, 8 / 5, -1 / 5, 8 / 315, -1 / 560]
    np.testing.assert_allclose(central_weights(9, 2), second, rtol=2e-15)


@pytest.mark.parametrize("points", [3, 5, 7, 9, 11, 13, 17])
@pytest.mark.parametrize("order", [1, 2])
def test_weights_satisfy_their_moments_exactly(points, order):
    """sum_j w_j j^p = p! delta(p, order) for p < points: exact on polynomials up to degree points - 1, no rounding."""
    weights, half = _exact_weights(points, order), points // 2
    for power in range(points):
        moment = sum(w * Fraction(j) ** power for j, w in zip(range(-half, half + 1), weights, strict=True))
        assert moment == (factorial(order) if power == order else 0)
    beyond = sum(w * Fraction(j) ** (points + order - 1) for j, w in zip(range(-half, half + 1), weights, strict=True))
    assert beyond != 0  # the first power that is not: the formula is not better than it says


@pytest.mark.parametrize("degree", range(9))
@pytest.mark.parametrize("order", [1, 2])
def test_nine_points_are_exact_on_polynomials_up_to_degree_8(degree, order):
    t = 30.0 * np.arange(40)
    p = Polynomial(np.random.default_rng(degree).standard_normal(degree + 1), domain=[0, t[-1]])
    values, exact = p(t), p.deriv(order)(t)
    ours = derivative(values, 30.0, order=order)
    assert np.isnan(ours[:4]).all() and np.isnan(ours[-4:]).all()
    rounding = 1e-14 * np.abs(values).max() / 30.0**order
    np.testing.assert_allclose(ours[4:-4], exact[4:-4], rtol=0, atol=10 * rounding)


def test_nine_points_are_not_exact_on_degree_9():
    """The interpolation error of x^9 is x (x^2 - 1)(x^2 - 4)(x^2 - 9)(x^2 - 16): its slope at 0, 4!^2, is what is
    missed."""
    x = np.arange(-4.0, 5.0)
    assert derivative(x**9, 1.0)[4] == pytest.approx(-(24.0**2), rel=1e-12)


def test_derivative_of_a_range_keeps_its_small_digits():
    """A constant of 2e5 m under the signal costs nothing beyond the rounding of the data themselves (3e-11 m)."""
    t = 30.0 * np.arange(300)
    signal = 1e-3 * np.sin(2 * np.pi * t / REVOLUTION)
    quantised = (2.2e5 + signal) - 2.2e5
    np.testing.assert_allclose(
        derivative(2.2e5 + signal, 30.0)[4:-4], derivative(quantised, 30.0)[4:-4], rtol=0, atol=1e-15
    )


def test_vectors_are_differentiated_by_component():
    rng = np.random.default_rng(0)
    series = rng.standard_normal((30, 3))
    np.testing.assert_array_equal(derivative(series, 5.0), np.column_stack([derivative(c, 5.0) for c in series.T]))
    np.testing.assert_allclose(
        spline_derivative(series, 5.0, 7), np.column_stack([spline_derivative(c, 5.0, 7) for c in series.T]), rtol=1e-9
    )


@pytest.mark.parametrize(
    ("cycles", "gain", "digits"),
    [(10, 1.0, 4), (30, 0.9987, 4), (40, 0.990, 3), (50, 0.954, 3), (60, 0.861, 3), (70, 0.680, 3)],
)
def test_transfer_of_nine_points(cycles, gain, digits):
    """Section 2's table, to its last digit."""
    assert float(transfer(np.array(cycles / REVOLUTION), 30.0)) == pytest.approx(gain, abs=0.5 * 10**-digits)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("points", [5, 9, 13])
def test_transfer_is_what_happens_to_a_wave(points, order):
    f, dt = 50 / REVOLUTION, 30.0
    t = dt * np.arange(200)
    wave = np.sin(2 * np.pi * f * t)
    exact = {1: 2 * np.pi * f * np.cos(2 * np.pi * f * t), 2: -((2 * np.pi * f) ** 2) * wave}[order]
    inside = slice(points // 2, -(points // 2))
    ours = derivative(wave, dt, points, order)[inside]
    np.testing.assert_allclose(
        ours,
        float(transfer(np.array(f), dt, points, order)) * exact[inside],
        rtol=0,
        atol=1e-13 * np.abs(exact).max() * 10,
    )


def test_transfer_of_a_constant_is_one():
    for order in (1, 2):
        np.testing.assert_array_equal(transfer(np.zeros(3), 30.0, 9, order), 1.0)


def test_noise_gain():
    """1.1674/h = 0.03892 1/s and 3.648/h^2 = 4.05e-3 1/s^2 at 30 s, and what white noise really does."""
    assert noise_gain(9, 1) == pytest.approx(1.1674, abs=5e-5)
    assert noise_gain(9, 2) == pytest.approx(3.648, abs=5e-4)
    noise = np.random.default_rng(1).standard_normal(200_000)
    assert np.nanstd(derivative(noise, 30.0)) == pytest.approx(noise_gain() / 30.0, rel=0.01)


@pytest.mark.parametrize("degree", [3, 5, 7, 11])
@pytest.mark.parametrize("order", [1, 2])
def test_splines_are_exact_on_polynomials_of_their_degree(degree, order):
    t = 30.0 * np.arange(60)
    p = Polynomial(np.random.default_rng(degree).standard_normal(degree + 1), domain=[0, t[-1]])
    scale = np.abs(p.deriv(order)(t)).max()
    np.testing.assert_allclose(
        spline_derivative(p(t), 30.0, degree, order), p.deriv(order)(t), rtol=0, atol=1e-8 * scale
    )


def test_spline_error_falls_with_its_degree():
    """A wave of 8 epochs: its alias has 7 / 8, and the error goes with (1/7)^degree: four degrees more are worth
    4.2e-4."""
    t = np.arange(400.0)
    wave, slope = np.sin(2 * np.pi * t / 8), 2 * np.pi / 8 * np.cos(2 * np.pi * t / 8)
    inside = slice(100, 300)
    errors = {k: np.abs(spline_derivative(wave, 1.0, k) - slope)[inside].max() for k in (3, 7, 11)}
    assert errors[11] / errors[7] == pytest.approx(7.0**-4, rel=0.3)
    assert errors[7] / errors[3] == pytest.approx(7.0**-4, rel=0.3)


# --- the specification's numbers -------------------------------------------------------------------------------------


def test_newton_row_at_degree_70(mid):
    """Section 8, g02 MID: std 1 %, extremes 2 %, mean below 1e-9."""
    newton = estimate.newton(mid.data)
    stats = assess.statistics(assess.range_rate_residual(newton.rate, mid.orbit))
    assert stats.std == pytest.approx(1.865e-6, rel=0.01)
    assert stats.min == pytest.approx(-1.955e-5, rel=0.02)
    assert stats.max == pytest.approx(1.902e-5, rel=0.02)
    assert abs(stats.mean) < 1e-9
    exact = observables.exact(mid.orbit, mid.gravity)
    for twice, std in ((True, 2.297e-7), (False, 3.463e-8)):
        assert assess.statistics(observables.from_newton(newton, twice) - exact).std == pytest.approx(std, rel=0.02)


def test_newton_row_at_degree_30(quick):
    stats = assess.statistics(assess.range_rate_residual(estimate.newton(quick.data).rate, quick.orbit))
    assert stats.std == pytest.approx(5.372e-8, rel=0.01)


def test_degree_11_spline_is_190_times_better(mid):
    """Section 9.3: 9.6e-9 m/s against 1.83e-6 of nine points (30 d); the factor on 5 d within a quarter."""
    rho, rate = distance(mid.orbit.dr), range_rate(mid.orbit.dr, mid.orbit.dv)
    spline = assess.statistics(spline_derivative(rho, mid.orbit.dt, 11) - rate).std
    nine = assess.statistics(derivative(rho, mid.orbit.dt) - rate).std
    assert spline == pytest.approx(9.6e-9, rel=0.1)
    assert nine / spline == pytest.approx(190, rel=0.25)


# --- what is refused -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("points", [8, 2, 1, 0])
def test_stencils_without_a_middle(points):
    with pytest.raises(
        ValueError, match=f"a central stencil of {points} points has no middle; give an odd number, 3 or more"
    ):
        central_weights(points)


@pytest.mark.parametrize("order", [0, 5])
def test_orders_that_a_stencil_has_not(order):
    with pytest.raises(ValueError, match=f"a 5-point stencil has no derivative of order {order}; give 1 to 4"):
        central_weights(5, order)


def test_too_few_epochs_for_a_stencil():
    with pytest.raises(ValueError, match="8 epochs are too few for a 9-point stencil; give at least 9"):
        derivative(np.zeros(8), 30.0)
    assert np.isfinite(derivative(np.zeros(9), 30.0)).sum() == 1


def test_splines_that_are_not():
    with pytest.raises(ValueError, match="spline of degree 4 is not centred on its knots; give an odd degree"):
        spline_derivative(np.zeros(20), 30.0, 4)
    with pytest.raises(ValueError, match="spline of degree -1 is not centred"):
        spline_derivative(np.zeros(20), 30.0, -1)
    with pytest.raises(ValueError, match="11 epochs are too few for a spline of degree 11; give at least 12"):
        spline_derivative(np.zeros(11), 30.0)


def test_transfer_of_a_third_derivative():
    with pytest.raises(ValueError, match="given for order 1 and 2, not for 3"):
        transfer(np.array([1e-3]), 30.0, 9, 3)
