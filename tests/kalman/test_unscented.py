"""The unscented filter: equal to the textbook sums and to the linear filter; no cancellation, positive by
construction."""

from __future__ import annotations

import numpy as np
import pytest

from geokalman.kalman import Model, NotPositiveDefinite, Sensor, gaussian, run, smooth, unscented
from geokalman.kalman.unscented import (
    sigma_points,
    sigma_points_step,
    spread,
    transform_step,
    unscented_update_step,
    weights,
)

SCALINGS = [(1.0, 0.0, 2.0), (1e-3, 2.0, 0.0), (0.5, 2.0, 1.0), (1.0, 2.0, -3.0)]


def textbook_update(x, P, z, h, R, alpha, beta, kappa):
    """grace-fusion (26)-(43), written as printed."""
    n = len(x)
    lam = alpha**2 * (n + kappa) - n
    root = np.linalg.cholesky((n + lam) * P)
    chi = np.array([x] + [x + sign * root[:, i] for i in range(n) for sign in (-1, 1)])
    Wm = np.r_[lam / (lam + n), np.full(2 * n, 0.5 / (lam + n))]
    Wc = Wm + np.r_[1 - alpha**2 + beta, np.zeros(2 * n)]
    gamma = np.array([h(c) for c in chi])
    y = Wm @ gamma
    S = (Wc[:, None] * (gamma - y)).T @ (gamma - y) + R
    cross = (Wc[:, None] * (chi - x)).T @ (gamma - y)
    K = cross @ np.linalg.inv(S)
    return x + K @ (z - y), P - K @ S @ K.T, S


@pytest.fixture
def state():
    rng = np.random.default_rng(6)
    A = rng.standard_normal((4, 4))
    return gaussian([3.0, -1.0, 2.0, 0.5], 0.02 * (A @ A.T + np.eye(4)))


def ranges(x):
    return np.array([np.hypot(x[0], x[1]), x[2] * x[3], np.sin(x[0]) + x[3] ** 2])


@pytest.mark.parametrize("scaling", SCALINGS)
def test_update_is_the_textbook_one(state, scaling):
    z, R = np.array([3.2, 1.1, 0.3]), np.diag([0.01, 0.04, 0.02]) + 0.005
    ours, innovation = unscented.update(state, z, ranges, R, *scaling)
    mean, cov, S = textbook_update(*state, z, ranges, R, *scaling)
    rel = 1e-12 if scaling[0] > 0.1 else 1e-8  # the textbook sums lose 1 / alpha^2 of the digits, ours only 1 / alpha
    np.testing.assert_allclose(ours.mean, mean, rtol=rel)
    np.testing.assert_allclose(ours.cov, cov, rtol=10 * rel, atol=rel)
    np.testing.assert_allclose(innovation.S, S, rtol=10 * rel, atol=rel)
    root = np.linalg.cholesky(S)
    np.testing.assert_allclose(innovation.whitened, np.linalg.solve(root, innovation.residual), rtol=1e-6)


@pytest.mark.parametrize("scaling", SCALINGS)
def test_weights_and_points_have_the_moments_of_the_state(state, scaling):
    Wm, Wc = weights(4, *scaling)
    chi = sigma_points(state, *scaling)
    assert Wm.sum() == pytest.approx(1.0, abs=1e-9)
    np.testing.assert_allclose(Wm @ (chi - chi[0]), 0.0, atol=1e-9)
    np.testing.assert_allclose((Wc[:, None] * (chi - chi[0])).T @ (chi - chi[0]), state.cov, rtol=1e-9)


def test_paper_scaling():
    """grace-fusion section 2: alpha = 1, beta = 0, kappa = 2, n = 9 give 2/11 and 1/22."""
    Wm, Wc = weights(9, 1.0, 0.0, 2.0)
    np.testing.assert_allclose(Wm, np.r_[2 / 11, np.full(18, 1 / 22)], rtol=2e-15)
    np.testing.assert_allclose(Wc, Wm, rtol=2e-15)
    assert spread(9, 1.0, 0.0, 2.0) == (np.sqrt(11.0), -1.0)


def test_points_come_in_the_papers_order(state):
    chi = sigma_points(state, 1.0, 0.0, 2.0)
    root = np.sqrt(6.0) * np.linalg.cholesky(state.cov)
    for i in range(4):
        np.testing.assert_allclose(chi[2 * i + 1], state.mean - root[:, i], rtol=1e-14)
        np.testing.assert_allclose(chi[2 * i + 2], state.mean + root[:, i], rtol=1e-14)


def index(t, now):
    return int(np.flatnonzero(t == now)[0])


@pytest.mark.parametrize("scaling", [(1.0, 0.0, 2.0), (1.0, 2.0, 0.0), (0.3, 2.0, 0.0)])
def test_is_the_linear_filter_and_smoother_on_a_linear_problem(problem, close, scaling):
    p = problem
    model = Model(f=lambda x, t0, t1: p.transition(t1 - t0)[0] @ x, Q=lambda t0, t1: p.transition(t1 - t0)[1])
    sensor = Sensor(p.z, p.R, lambda x, t: p.H[index(p.t, t)] @ x)
    alpha, beta, kappa = scaling
    ours = run(p.prior, p.t, model, [sensor], "unscented", alpha=alpha, beta=beta, kappa=kappa)
    ref = p.filter()
    close(ours.mean, ours.cov, ref.mean, ref.cov, 1e-10)
    close(ours.predicted_mean, ours.predicted_cov, ref.predicted_mean, ref.predicted_cov, 1e-10)
    np.testing.assert_allclose(ours.whitened, ref.whitened, atol=1e-10)
    np.testing.assert_allclose(ours.transition, p.Phi, rtol=1e-9, atol=1e-9 * np.abs(p.Phi).max())
    one, other = smooth(ours), smooth(ref)
    close(one.mean, one.cov, other.mean, other.cov, 1e-9)


def test_tiny_alpha_beside_a_large_offset_does_not_cancel():
    """Coordinates of 1e7 m, sigma 1 m, alpha = 1e-3: the points themselves are rounded to 1e-9 m, 3e-7 of their
    distance.

    The textbook sum W_0 y_0 + sum W_i y_i has weights of 1e6 and loses a millimetre to ten metres.
    """
    n, alpha = 6, 1e-3
    rng = np.random.default_rng(9)
    A = rng.standard_normal((n, n))
    P = A @ A.T + np.eye(n)
    x = 1e7 * rng.standard_normal(n)
    H = np.eye(3, n)
    z = H @ x + np.array([1.0, -2.0, 0.5])
    ours, innovation = unscented.update(gaussian(x, P), z, lambda s: H @ s, np.eye(3), alpha, 2.0, 0.0)
    S = H @ P @ H.T + np.eye(3)
    K = P @ H.T @ np.linalg.inv(S)
    np.testing.assert_allclose(ours.mean - x, K @ (z - H @ x), rtol=3e-6, atol=1e-8)
    np.testing.assert_allclose(ours.cov, P - K @ S @ K.T, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(innovation.residual, z - H @ x, atol=1e-8)
    Wm, _ = weights(n, alpha, 2.0, 0.0)
    naive = Wm @ sigma_points(gaussian(x, P), alpha, 2.0, 0.0)
    assert np.abs(naive - x).max() > 1e-4  # what the differences avoid


def test_mean_of_a_square_is_exact_at_any_alpha():
    """y = x^2 has the mean m^2 + P and, for beta = 2, the covariance 4 m^2 P + 2 P^2 (n = 1, kappa = 2 or alpha ->
    0)."""
    m, P = 1e3, 4.0
    for alpha, beta, kappa in [(1.0, 0.0, 2.0), (1e-2, 2.0, 0.0), (1e-3, 2.0, 0.0)]:
        out = unscented.predict(gaussian([m], [P]), lambda x: x**2, [[0.0]], alpha, beta, kappa)
        assert out.mean[0] == pytest.approx(m**2 + P, rel=8 * np.finfo(float).eps / alpha**2)
        assert out.cov[0, 0] == pytest.approx(4 * m**2 * P + 2 * P**2, rel=1e-8)


def test_update_stays_positive_where_the_textbook_form_does_not():
    """A micrometre observation of a coordinate known to 10 km: P - K S K' leaves the rounding of 1e8, ours 1e-12."""
    rng = np.random.default_rng(12)
    A = rng.standard_normal((3, 3))
    P = 1e8 * (A @ A.T + 0.1 * np.eye(3))
    x, first = np.array([2e5, -1e5, 5e4]), lambda s: s[:1]
    ours, _ = unscented.update(gaussian(x, P), first(x), first, [[1e-12]], 1.0, 0.0, 2.0)
    assert ours.cov[0, 0] == pytest.approx(1e-12, rel=1e-6)
    assert np.linalg.eigvalsh(ours.cov).min() > 0.0
    textbook = textbook_update(x, P, first(x), first, np.array([[1e-12]]), 1.0, 0.0, 2.0)[1]
    assert abs(textbook[0, 0] - 1e-12) > 1e-9


def test_missing_components_and_gaps(state):
    z, R = np.array([3.2, np.nan, 0.3]), np.diag([0.01, 0.04, 0.02]) + 0.005
    keep = [0, 2]
    ours, innovation = unscented.update(state, z, ranges, R)
    short, _ = unscented.update(state, z[keep], lambda x: ranges(x)[keep], R[np.ix_(keep, keep)])
    np.testing.assert_allclose(ours.mean, short.mean, rtol=1e-14)
    np.testing.assert_allclose(ours.cov, short.cov, rtol=1e-12)
    assert np.isnan(innovation.whitened[1]) and np.isfinite(innovation.whitened[keep]).all()
    gap, _ = unscented.update(state, np.full(3, np.nan), ranges, R)
    assert np.array_equal(gap.mean, state.mean)


def test_compiled_kernels_equal_plain_python(state, monkeypatch):
    z, R = np.array([3.2, 1.1, 0.3]), np.diag([0.01, 0.04, 0.02]) + 0.005
    c, w = spread(4, 1.0, 0.0, 2.0)

    def run():
        x, P = state.mean.copy(), state.cov.copy()
        chi, U, S, white = np.empty((9, 4)), np.empty((4, 4)), np.empty((3, 3)), np.empty(3)
        assert unscented.sigma_points_step(x, P, c, chi, U) == 0
        gamma = np.array([ranges(point) for point in chi])
        assert unscented.unscented_update_step(x, P, U, gamma, z, R, c, w, S, white) == 0
        return x, P, S, white

    compiled = run()
    names = ("sigma_points_step", "unscented_update_step", "transform_step", "whiten")
    for name in names + ("cholesky_upper", "solve_lower", "solve_upper"):
        monkeypatch.setattr(unscented, name, getattr(getattr(unscented, name), "py_func", getattr(unscented, name)))
    for a, b in zip(compiled, run(), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-15)


def test_failing_updates_leave_the_state_alone():
    x, P, c, w = np.zeros(2), np.eye(2), 1.5, -1.0
    chi, U = np.empty((5, 2)), np.empty((2, 2))
    assert sigma_points_step(x, np.diag([1.0, -1.0]), c, chi, U) == 2
    assert sigma_points_step(x, P, c, chi, U) == 0
    gamma, S, white = np.zeros((5, 1)), np.empty((1, 1)), np.empty(1)
    assert unscented_update_step(x, P, U, gamma, np.ones(1), np.zeros((1, 1)), c, w, S, white) == 1
    assert np.array_equal(x, [0, 0]) and np.array_equal(P, np.eye(2))
    mean, D, rest, cov = np.empty(1), np.empty((2, 1)), np.empty((1, 1)), np.empty((1, 1))
    transform_step(chi[:, :1].copy(), np.zeros((1, 1)), c, w, mean, D, rest, cov)
    assert cov[0, 0] == pytest.approx(1.0, rel=2e-15) and rest[0, 0] == 0.0 and mean[0] == 0.0


def test_wrong_input_is_named():
    prior, Q = gaussian([1.0], [1.0]), np.eye(1)
    one = Sensor([[1.0], [1.0]], Q, lambda x, t: x)

    def filtered(prior=prior, f=lambda x, t0, t1: x, Q=Q, sensors=(one,), **scaling):
        return run(prior, [0.0, 1.0], Model(f=f, Q=Q), sensors, "unscented", **scaling)

    assert len(filtered()) == 2
    for change, message in [
        ({"alpha": 0.0}, "alpha = 0.0 and kappa = 0.0 with n = 1 give no sigma points"),
        ({"kappa": -1.0}, "kappa = -1.0 with n = 1"),
        ({"f": lambda x, t0, t1: x / np.zeros(2).size * np.nan}, r"f\(x\)\[0\] is nan"),
        ({"sensors": [Sensor([[1.0], [1.0]], Q, lambda x, t: np.ones(2))]}, r"h\(x\) has the shape \(2,\)"),
        ({"Q": np.eye(2)}, r"Q has the shape \(2, 2\)"),
    ]:
        with pytest.raises(ValueError, match=message):
            filtered(**change)
    still = {"prior": gaussian([1.0], [0.0])}
    with pytest.raises(NotPositiveDefinite, match="covariance of the state .* at epoch 0"):
        filtered(**still)
    gap = [Sensor([[np.nan], [np.nan]], Q, lambda x, t: x)]
    with pytest.raises(NotPositiveDefinite, match="filtered covariance .* at epoch 0"):
        filtered(**still, sensors=gap)
    with pytest.raises(NotPositiveDefinite, match=r"innovation covariance .* at epoch 1 \(t = 1 s\)"):
        filtered(sensors=[Sensor([[np.nan], [1.0]], [[0.0]], lambda x, t: np.zeros(1))])


@pytest.mark.parametrize("scaling", [(1.0, 0.0, 2.0), (0.5, 2.0, 1.0)])
def test_smoother_of_a_pendulum_is_sarkkas(scaling):
    """Sarkka (2008), eqs. 22-25, transcribed: C = sum Wc (chi - x)(f(chi) - x_predicted)', G = C (P_predicted)^-1."""
    rng = np.random.default_rng(21)
    t = np.cumsum(rng.uniform(0.05, 0.2, 30))

    def swing(x, t0, t1):
        return np.array([x[0] + (t1 - t0) * x[1], x[1] - 9.81 * (t1 - t0) * np.sin(x[0])])

    z = np.sin(1.5 * np.cos(3.0 * t))[:, None] + 0.1 * rng.standard_normal((30, 1))
    z[10:14] = np.nan
    model = Model(f=swing, Q=lambda t0, t1: 0.01 * (t1 - t0) * np.eye(2))
    sensor = Sensor(z, [[0.01]], lambda x, now: np.sin(x[:1]))
    alpha, beta, kappa = scaling
    prior = gaussian([1.6, 0.0], [0.1, 0.1])
    course = run(prior, t, model, [sensor], "unscented", alpha=alpha, beta=beta, kappa=kappa)
    ours = smooth(course)
    Wm, Wc = weights(2, *scaling)
    mean, cov = course.mean[-1], course.cov[-1]
    for k in range(28, -1, -1):
        chi = sigma_points(course[k], *scaling)
        image = np.array([swing(point, t[k], t[k + 1]) for point in chi])
        predicted = Wm @ image
        P = (Wc[:, None] * (image - predicted)).T @ (image - predicted) + 0.01 * (t[k + 1] - t[k]) * np.eye(2)
        np.testing.assert_allclose(course.predicted_cov[k + 1], P, rtol=1e-9)
        G = (Wc[:, None] * (chi - course.mean[k])).T @ (image - predicted) @ np.linalg.inv(P)
        mean = course.mean[k] + G @ (mean - predicted)
        cov = course.cov[k] + G @ (cov - P) @ G.T
        np.testing.assert_allclose(ours.mean[k], mean, rtol=1e-9, atol=1e-10)
        np.testing.assert_allclose(ours.cov[k], cov, rtol=1e-8, atol=1e-11)


def test_range_rate_update_is_that_of_the_extended_filter_where_the_state_is_known_well():
    """With sigmas of a millimetre at 200 km, second derivatives matter less than rounding."""
    from geokalman.kalman import extended

    x = np.array([2.0e5, -4.0e4, 6.0e4, 10.0, 200.0, -35.0])
    A = np.random.default_rng(3).standard_normal((6, 6))
    scale = np.repeat([1e-3, 1e-4], 3)
    prior = gaussian(x, (A @ A.T + np.eye(6)) * scale[:, None] * scale)

    def rate(s):
        return np.array([s[:3] @ s[3:] / np.linalg.norm(s[:3])])

    rho = np.linalg.norm(x[:3])
    e = x[:3] / rho
    H = np.r_[(x[3:] - rate(x) * e) / rho, e][None]
    z = rate(x) + 1e-4
    ukf, w1 = unscented.update(prior, z, rate, [[9e-8]], 1.0, 0.0, 2.0)
    ekf, w2 = extended.update(prior, z, rate(x), H, [[9e-8]])
    sigma = np.sqrt(np.diag(ekf.cov))
    np.testing.assert_allclose((ukf.mean - ekf.mean) / sigma, 0.0, atol=1e-6)
    np.testing.assert_allclose((ukf.cov - ekf.cov) / sigma[:, None] / sigma, 0.0, atol=1e-6)
    np.testing.assert_allclose(w1.whitened, w2.whitened, atol=1e-6)
