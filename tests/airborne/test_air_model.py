"""The vertical-channel model against closed forms, quadrature and the printed table of steady states."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.linalg import expm

from geokalman.airborne import model
from geokalman.airborne.estimate import estimate, settled

STEADY = [
    (20, 10, 0.010, 1, 65, 1.0391, 0.1650, 0.5000, 1.965529e-8),
    (10, 20, 0.030, 8, 65, 4.9325, 1.2273, 32.00, 2.480607e-6),
    (28, 12, 0.016, 1.5, 65, 1.0247, 0.1878, 1.1250, 5.283910e-9),
    (6, 15, 0.020, 5, 45, 3.9203, 0.8822, 12.50, 2.841419e-6),
    (15, 25, 0.005, 3, 80, 2.3735, 0.5140, None, None),
]


@pytest.mark.parametrize(("L", "sigma", "R", "q", "V", "forward", "smoother", "q_dv", "q_dg"), STEADY)
def test_steady_states_and_driving_noise(L, sigma, R, q, V, forward, smoother, q_dv, q_dg):
    tuning = model.Tuning(L_km=L, sigma_mgal=sigma, q_f=q, R_m=R, sd_tau3=0.0, sd_k12=0.0, sd_k3=0.0)
    result = settled(tuning, V)
    assert result.forward.sigma()[800] == pytest.approx(forward, rel=1e-3)
    assert result.smoothed.sigma()[800] == pytest.approx(smoother, rel=1e-3)
    assert result.smoothed.sigma()[-1] == pytest.approx(result.forward.sigma()[-1], rel=1e-9)
    Phi, Q = model.block(0.5, tuning.beta(V), sigma, q)
    assert Phi[1, 2] == pytest.approx(0.125, rel=1e-3)
    if q_dv:
        assert Q[0, 0] == pytest.approx(q_dv, rel=1e-3)
        assert Q[4, 4] == pytest.approx(q_dg, rel=1e-3)


def test_gravity_model_at_its_correlation_length_and_the_integral_of_its_density():
    beta = model.Tuning(L_km=12.0).beta(65.0)
    assert beta == pytest.approx(0.015725, rel=1e-4)
    assert model.autocovariance(12e3 / 65, beta, 1.0) == pytest.approx(0.3682, abs=1e-4)
    integral = 2 * quad(lambda w: float(model.power_density(w, beta, 20.0)), 0, 100 * beta)[0] / (2 * np.pi)
    assert integral == pytest.approx(400.0, rel=1e-3)


def test_stationary_covariance_does_not_change_under_the_transition():
    beta = 0.02
    Phi, Q = model.block(0.5, beta, 10.0, 0.0)
    P = model.gravity_covariance(beta, 10.0)
    np.testing.assert_allclose(Phi[2:, 2:] @ P @ Phi[2:, 2:].T + Q[2:, 2:], P, rtol=1e-9, atol=1e-12)


def test_autocovariance_is_that_of_the_state_space_model():
    beta, t = 0.02, 35.0
    A = np.array([[0, 1, 0], [0, 0, 1], [-(beta**3), -3 * beta**2, -3 * beta]])
    assert (expm(A * t) @ model.gravity_covariance(beta, 7.0))[0, 0] == pytest.approx(
        model.autocovariance(t, beta, 7.0), rel=1e-10
    )


def test_double_integral_is_exact_for_piecewise_linear_acceleration():
    t = np.arange(0, 10.01, 0.5)
    v, h = model.double_integral(6.0 * t, 0.5, 2.0)
    np.testing.assert_allclose(v, 2 + 3 * t**2, atol=1e-12)
    np.testing.assert_allclose(h, 2 * t + t**3, atol=1e-11)


def test_step_integrals_of_the_derivative_use_differences_and_sum_over_fast_samples():
    dt, every = 0.01, 50
    t = dt * np.arange(201)
    f = np.column_stack([np.sin(t), np.cos(t), np.sin(3 * t)])
    first, second = model.step_integrals(f, dt, every)
    k = 2  # the third step, from 1.0 to 1.5 s
    a, b = 1.0, 1.5
    np.testing.assert_allclose(
        first[k],
        [
            np.sin(3 * b) - np.sin(3 * a),
            np.cos(a) - np.cos(b),
            np.sin(b) - np.sin(a),
            (np.cos(3 * a) - np.cos(3 * b)) / 3,
        ],
        atol=1e-4,
    )
    assert second[k, 1] == pytest.approx(quad(lambda s: (b - s) * np.sin(s), a, b)[0], abs=1e-5)
    assert second[k, 0] == pytest.approx(quad(lambda s: (b - s) * 3 * np.cos(3 * s), a, b)[0], abs=1e-4)


def line(n=1201, V=65.0):
    z = np.zeros(n)
    return model.Line("one", 0.5 * np.arange(n), z, z, np.zeros((n - 1, 4)), np.zeros((n - 1, 4)), V)


def test_states_without_prior_variance_are_left_out():
    assert model.build(line(), model.Tuning()).names == ("dv", "dh", "tau3", "k1", "k2", "k3", "dg", "dg1", "dg2")
    assert model.build(line(), model.Tuning().coloured(0.003, 0.004, 80.0)).names[-1] == "colour"
    assert model.build(line(), model.Tuning.preset("joint")).names == ("dv", "dh", "tau3", "k1", "k2", "k3", "bias")


def test_the_prior_in_scaled_states_is_a_correlation_matrix():
    built = model.build(line(), model.Tuning())
    np.testing.assert_allclose(np.diag(built.prior.cov), 1.0, rtol=1e-12)


def test_lag_and_part_of_a_line():
    one = line(600)
    bent = model.replace(one, f3=np.arange(600.0))
    np.testing.assert_allclose(bent.lagged(0.5).z, 0.5 * np.arange(600.0))
    assert len(bent.part(slice(100, 300)).t) == 200 and bent.part(slice(100, 300)).first.shape == (199, 4)
    with pytest.raises(ValueError, match="give at least two consecutive epochs"):
        bent.part(slice(3, 4))


def test_a_short_line_is_refused():
    with pytest.raises(ValueError, match=r"Line one lasts 149.5 s; at least 240 s are needed"):
        estimate(line(300), model.Tuning())


@pytest.mark.parametrize(("name", "value"), [("R_m", 0.0), ("L_km", -1.0), ("q_f", -1.0), ("sigma_mgal", np.nan)])
def test_settings_that_cannot_be_are_refused(name, value):
    with pytest.raises(ValueError, match=f"{name} = .*: it must be finite and"):
        model.Tuning(**{name: value})


def test_an_unknown_preset_is_refused():
    with pytest.raises(ValueError, match="preset 'x' is unknown; the presets are paper_like"):
        model.Tuning.preset("x")
