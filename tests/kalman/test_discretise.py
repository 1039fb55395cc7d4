"""Discretisation against numerical quadrature of the integral and against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad_vec
from scipy.linalg import expm, solve_continuous_lyapunov

from geokalman.kalman import gauss_markov, integrated_white_noise, van_loan, white_jerk


def quadrature(F, W, h):
    """Q_d of grace-fusion (15) by adaptive quadrature, each element to 1e-12 of its own size."""
    F, W = np.asarray(F, dtype=float), np.asarray(W, dtype=float)
    integrand = lambda s: expm(F * s) @ W @ expm(F * s).T
    scale = np.abs(quad_vec(integrand, 0.0, h)[0])
    scale[scale == 0.0] = 1.0
    return quad_vec(lambda s: integrand(s) / scale, 0.0, h, epsabs=1e-13, epsrel=1e-13)[0] * scale


def companion(order):
    return np.diag(np.ones(order - 1), 1), np.diag(np.r_[np.zeros(order - 1), 1.0])


@pytest.mark.parametrize("order", [1, 2, 3, 4])
@pytest.mark.parametrize("h", [0.1, 5.0, 30.0])
def test_kinematic_models_are_the_integral(order, h):
    F, W = companion(order)
    Phi, Q = integrated_white_noise(order, h, 2.5e-9)
    np.testing.assert_allclose(Phi, expm(F * h), rtol=1e-13)  # the rounding of expm at |F h| = 30
    np.testing.assert_allclose(Q, quadrature(F, 2.5e-9 * W, h), rtol=1e-11)
    for ours, closed in zip(van_loan(F, 2.5e-9 * W, h), (Phi, Q), strict=True):
        np.testing.assert_allclose(ours, closed, rtol=1e-13, atol=0.0)


def test_white_jerk_is_the_printed_matrix():
    """grace-fusion (50), (51)."""
    h, q = 30.0, 1.74897e-10
    Phi, Q = white_jerk(h, q)
    I = np.eye(3)
    np.testing.assert_allclose(Phi, np.block([[I, h * I, h**2 / 2 * I], [0 * I, I, h * I], [0 * I, 0 * I, I]]))
    printed = [[h**5 / 20, h**4 / 8, h**3 / 6], [h**4 / 8, h**3 / 3, h**2 / 2], [h**3 / 6, h**2 / 2, h]]
    np.testing.assert_allclose(Q, q * np.kron(printed, I), rtol=1e-14)


def test_van_loan_of_a_coupled_system_is_the_integral():
    rng = np.random.default_rng(4)
    F, B = rng.standard_normal((4, 4)), rng.standard_normal((4, 2))
    Phi, Q = van_loan(F, B @ B.T, 0.7)
    np.testing.assert_allclose(Phi, expm(0.7 * F), rtol=1e-12)
    np.testing.assert_allclose(Q, quadrature(F, B @ B.T, 0.7), rtol=1e-11, atol=1e-13)
    assert np.array_equal(Q, Q.T)


@pytest.mark.parametrize("ratio", [1e-9, 1e-3, 1.0, 40.0, 2000.0])
def test_van_loan_of_a_gauss_markov_process_over_any_step(ratio):
    """exp(-F h) in van Loan's block would overflow near ratio 700 and lose Q long before."""
    tau, sigma = 300.0, 2.0
    _, Q = gauss_markov(ratio * tau, tau, sigma)
    ours = van_loan([[-1.0 / tau]], [[2.0 * sigma**2 / tau]], ratio * tau)
    assert ours[0][0, 0] == pytest.approx(np.exp(-ratio), rel=1e-11, abs=1e-300)
    assert ours[1][0, 0] == pytest.approx(Q[0, 0], rel=1e-12)
    assert Q[0, 0] == pytest.approx(-(sigma**2) * np.expm1(-2 * ratio), rel=2e-15)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_gauss_markov_is_stationary_with_the_asked_sigma(order):
    """The stationary covariance solves P = Phi P Phi' + Q and starts with sigma^2, whatever the step."""
    tau, sigma, beta = 250.0, 3.0, 1.0 / 250.0
    F = {
        1: [[-beta]],
        2: [[0, 1], [-(beta**2), -2 * beta]],
        3: [[0, 1, 0], [0, 0, 1], [-(beta**3), -3 * beta**2, -3 * beta]],
    }
    density = {1: 2 * beta, 2: 4 * beta**3, 3: 16 / 3 * beta**5}[order] * sigma**2  # Gelb (1974), table 2.2-1
    W = np.diag(np.r_[np.zeros(order - 1), density])
    F = np.array(F[order], dtype=float)
    P = solve_continuous_lyapunov(F, -W)
    assert P[0, 0] == pytest.approx(sigma**2, rel=1e-12)
    for h in (1.0, 60.0, 1000.0):
        Phi, Q = gauss_markov(h, tau, sigma, order)
        units = beta ** np.arange(order)
        np.testing.assert_allclose(Phi / units[:, None] * units, expm(F * h) / units[:, None] * units, atol=1e-13)
        scaled = (Phi @ P @ Phi.T + Q - P) / units[:, None] / units
        assert np.abs(scaled).max() < 1e-12 * sigma**2


def test_two_half_steps_are_one_step():
    F = np.array([[0.0, 1.0], [-4.0, -0.1]])
    W = np.diag([0.3, 1.0])
    Phi, Q = van_loan(F, W, 3.0)
    half, Q_half = van_loan(F, W, 1.5)
    np.testing.assert_allclose(half @ half, Phi, atol=1e-14)
    np.testing.assert_allclose(half @ Q_half @ half.T + Q_half, Q, rtol=1e-12)


def test_no_noise_gives_no_noise():
    assert van_loan([[0.0]], [[0.0]], 10.0)[1][0, 0] == 0.0
    assert gauss_markov(1.0, 10.0, 0.0)[1][0, 0] == 0.0


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: white_jerk(0.0, 1.0), "h = 0.0 s: it must be positive"),
        (lambda: white_jerk(np.inf, 1.0), "h = inf s"),
        (lambda: white_jerk(1.0, -1.0), "q = -1.0 is no power density"),
        (lambda: integrated_white_noise(0, 1.0, 1.0), "order = 0 and axes = 1: both must be at least 1"),
        (lambda: gauss_markov(1.0, 0.0, 1.0), "tau = 0.0 s: it must be positive"),
        (lambda: gauss_markov(1.0, 1.0, -1.0), "sigma = -1.0"),
        (lambda: gauss_markov(1.0, 1.0, 1.0, 0), "order = 0"),
        (lambda: van_loan(np.eye(2), np.eye(3), 1.0), r"W has the shape \(3, 3\), it must be \(2, 2\)"),
        (lambda: van_loan(np.ones((2, 3)), np.eye(2), 1.0), r"F has the shape \(2, 3\)"),
        (lambda: van_loan(np.eye(2), -np.eye(2), 1.0), "W is not positive definite"),
    ],
)
def test_wrong_input_is_named(call, message):
    with pytest.raises(ValueError, match=message):
        call()
