"""Scenario, tuning, observations and range relations: against finite differences and closed forms; what is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad_vec
from scipy.linalg import expm

from geokalman import memory
from geokalman.grace import model
from geokalman.grace.differentiate import derivative
from geokalman.grace.model import Observations, Scenario, Tuning, distance, kinematic, range_acceleration, range_rate
from geokalman.grace.simulate import accelerations

# --- range relations (44) to (47) ------------------------------------------------------------------------------------


@pytest.fixture
def states():
    """Relative states of the size of a GRACE pair's, (200, 3) each."""
    rng = np.random.default_rng(3)
    return (rng.standard_normal((200, 3)) * s for s in (2e5, 200.0, 0.2))


def test_range_rate_is_the_derivative_of_the_range(states):
    """(45) by the complex step, which has no cancellation."""
    dr, dv, _ = states
    moved = dr + 1e-20j * dv
    rho = np.sqrt(np.einsum("ij,ij->i", moved, moved))
    np.testing.assert_allclose(distance(dr), rho.real, rtol=2e-15)
    np.testing.assert_allclose(range_rate(dr, dv), rho.imag / 1e-20, rtol=1e-12, atol=1e-10)


def test_range_acceleration_is_the_derivative_of_the_range_rate(states):
    """(46) by the complex step of (45) along (dv, da)."""
    dr, dv, da = states
    r, v = dr + 1e-20j * dv, dv + 1e-20j * da
    rate = np.einsum("ij,ij->i", r, v) / np.sqrt(np.einsum("ij,ij->i", r, r))
    np.testing.assert_allclose(range_acceleration(dr, dv, da), rate.imag / 1e-20, rtol=1e-11, atol=1e-12)


def test_range_relation_1(states):
    """(1): <da, dr> = rate^2 + rho acceleration - <dv, dv>."""
    dr, dv, da = states
    left = np.einsum("ij,ij->i", da, dr)
    right = range_rate(dr, dv) ** 2 + distance(dr) * range_acceleration(dr, dv, da) - np.einsum("ij,ij->i", dv, dv)
    np.testing.assert_allclose(left, right, rtol=1e-10, atol=1e-10)


def test_line_of_sight_gravity_of_a_state_is_e_da(states):
    """(47) with (46) is identically e . da."""
    dr, dv, da = states
    los = model.los_gravity(distance(dr), range_rate(dr, dv), range_acceleration(dr, dv, da), dv)
    np.testing.assert_allclose(los, model.los_acceleration(dr, da), rtol=1e-11, atol=1e-13)
    np.testing.assert_allclose(los, np.einsum("ij,ij->i", da, dr / distance(dr)[:, None]), rtol=1e-11, atol=1e-13)


def test_range_relations_along_an_orbit(tiny):
    """(44) to (46) against 9-point differences in time: degree 4 is far inside their band (1e-9 m/s, 1e-11 m/s^2)."""
    orbit = tiny.orbit
    a_A, a_B = accelerations(orbit, tiny.gravity)
    rho, rate = distance(orbit.dr), range_rate(orbit.dr, orbit.dv)
    inside = slice(4, -4)
    np.testing.assert_allclose(rate[inside], derivative(rho, orbit.dt)[inside], rtol=0, atol=1e-9)
    acceleration = range_acceleration(orbit.dr, orbit.dv, a_A - a_B)
    np.testing.assert_allclose(acceleration[inside], derivative(rate, orbit.dt)[inside], rtol=0, atol=1e-11)


# --- errata of the range relations -----------------------------------------------------------------------------------


def test_erratum_46_the_square_lacks_a_division_by_rho(states):
    """In the text we have, <dv, dr>^2 is divided by rho once: that is no derivative of (45)."""
    dr, dv, da = states
    rho = distance(dr)
    square = np.einsum("ij,ij->i", dv, dr) ** 2
    text = (np.einsum("ij,ij->i", dv, dv) + np.einsum("ij,ij->i", dr, da) - square / rho) / rho
    right = range_acceleration(dr, dv, da)
    assert np.abs(text - right).max() > 0.1 * np.abs(right).max()


def test_erratum_47_is_dv_dv_not_dv_dr(states):
    dr, dv, da = states
    rho, rate = distance(dr), range_rate(dr, dv)
    acceleration, true = range_acceleration(dr, dv, da), model.los_acceleration(dr, da)
    printed = acceleration - (np.einsum("ij,ij->i", dv, dr) - rate**2) / rho
    assert np.abs(printed - true).max() > 10 * np.abs(true).max()


def test_erratum_53_range_rate_has_velocities(states):
    """The text we have puts the relative acceleration for all three vectors of (53)."""
    dr, dv, da = states
    text = np.einsum("ij,ij->i", da, da) / distance(da)
    assert np.abs(text - range_rate(dr, dv)).max() > 0.5 * np.abs(range_rate(dr, dv)).max()


# --- kinematic model (50), (51) --------------------------------------------------------------------------------------


def test_transition_is_the_exponential_and_a_semigroup():
    """(14), and Phi(a) Phi(b) = Phi(a + b)."""
    A = np.kron(np.diag([1.0, 1.0], 1), np.eye(3))
    Phi, _ = kinematic(30.0, 1.0)
    assert Phi.shape == (9, 9)
    np.testing.assert_allclose(Phi, expm(30.0 * A), rtol=1e-13)
    np.testing.assert_allclose(kinematic(12.5, 1.0)[0] @ kinematic(17.5, 1.0)[0], Phi, rtol=2e-15)


def test_process_noise_is_the_integral_15():
    q, h = 1.74897e-10, 30.0
    A, B = np.kron(np.diag([1.0, 1.0], 1), np.eye(3)), np.kron([[0.0], [0.0], [1.0]], np.eye(3))
    Q = quad_vec(lambda tau: expm(A * (h - tau)) @ B @ B.T @ expm(A * (h - tau)).T, 0.0, h, epsrel=1e-13)[0]
    np.testing.assert_allclose(kinematic(h, q)[1], q * Q, rtol=1e-11)


def test_process_noise_composes():
    """Q(a + b) = Phi(b) Q(a) Phi(b)' + Q(b)."""
    (_, Qa), (Phi, Qb), (_, Q) = kinematic(11.0, 2.0), kinematic(19.0, 2.0), kinematic(30.0, 2.0)
    np.testing.assert_allclose(Phi @ Qa @ Phi.T + Qb, Q, rtol=1e-14)


def test_erratum_50_a_row_too_many_and_a_misplaced_term():
    """The ten rows of the text we have; without the first, h^2/2 of the first axis stands in the second one's column."""

    def text(h):
        rows = np.zeros((10, 9))
        rows[0, 0] = h**2 / 2
        rows[1:] = np.eye(9)
        rows[[1, 2, 3, 4, 5, 6], [3, 4, 5, 6, 7, 8]] = h
        rows[[1, 2, 3], [7, 7, 8]] = h**2 / 2
        return rows

    h = 15.0
    Phi, square = kinematic(h, 1.0)[0], text(h)[1:]
    assert np.argwhere(square != Phi).tolist() == [[0, 6], [0, 7]]
    assert not np.allclose(square @ square, text(2 * h)[1:], rtol=1e-3)


# --- scenario --------------------------------------------------------------------------------------------------------


def test_defaults_are_config_book():
    s = Scenario()
    assert (s.days, s.dt, s.n_max, s.a, s.e, s.tau) == (30.0, 30.0, 70, 6834e3, 0.0018, 28.9)
    assert (s.inc, s.raan, s.argp, s.m0) == (math.radians(89), 0.3, 0.5, 0.1)
    assert s.epochs == 86401 and s.t[-1] == 30 * 86400.0
    assert Scenario(days=5).epochs == 14401
    gravity = s.gravity()
    assert (gravity.gm, gravity.radius, gravity.n_max) == (3.986004415e14, 6378136.3, 70)


def test_parameters_of_a_notebook_carry_their_units():
    p = {
        "days": 2.0,
        "dt": 20.0,
        "n_max": 10,
        "a_km": 6870.0,
        "inc_deg": 87.0,
        "tau_s": 30.0,
        "h_int": None,
        "edge": 100,
        "e": 0.001,
    }
    s = Scenario.from_parameters(p)
    assert (s.days, s.dt, s.n_max, s.a, s.inc, s.tau, s.e) == (2.0, 20.0, 10, 6870e3, math.radians(87), 30.0, 0.001)
    assert s.h == 10.0
    assert Scenario.from_parameters(p, days=1.0, integrator="dop853").days == 1.0
    assert Scenario.from_parameters(p, h_int=5.0).h == 5.0


@pytest.mark.parametrize(
    ("integrator", "dt", "step"),
    [
        ("gj", 30.0, 10.0),
        ("gj", 5.0, 5.0),
        ("gj", 25.0, 25 / 3),
        ("dop853", 30.0, 15.0),
        ("dop853", 20.0, 10.0),
        ("rk45", 30.0, 30.0),
    ],
)
def test_default_step_divides_the_sampling_interval(integrator, dt, step):
    assert model.default_step(integrator, dt) == pytest.approx(step, rel=2e-15)
    Scenario(dt=dt, integrator=integrator, h=model.default_step(integrator, dt), n_max=2)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"days": 0.0}, r"days = 0 leaves nothing to integrate; give a positive number of days"),
        ({"days": -3.0}, r"days = -3 leaves nothing"),
        ({"days": math.nan}, r"days = nan is not finite"),
        ({"a": math.inf}, r"a = inf is not finite"),
        ({"dt": 0.0}, r"dt = 0 s is not a sampling interval"),
        ({"dt": -30.0}, r"dt = -30 s is not a sampling interval"),
        ({"days": 2e-4}, r"days = 0.0002 is shorter than one sampling interval of dt = 30 s"),
        ({"n_max": 1}, r"n_max = 1 is below 2"),
        ({"n_max": 361}, r"n_max = 361 is out of range: EGM96 has degrees 2 to 360"),
        ({"e": 1.0}, r"e = 1 is not the eccentricity of an ellipse; give 0 <= e < 1"),
        ({"e": 1.7}, r"e = 1.7 is not the eccentricity"),
        ({"e": -0.1}, r"e = -0.1 is not the eccentricity"),
        (
            {"e": 0.1},
            (
                r"a_km = 6834 with e = 0.1: the orbit meets the Earth, its perigee is 227.5 km below the reference"
                r" radius 6378"
            ),
        ),
        ({"a": 6300e3}, r"a_km = 6300 with e = 0.0018: the orbit meets the Earth, its perigee is 89.5 km below"),
        (
            {"a": 6480e3, "e": 0.0},
            r"the orbit meets the atmosphere, its perigee is 101.9 km above .* give one at least 150 km above it",
        ),
        ({"a": -6834e3}, r"meets the Earth"),
        ({"tau": 0.0}, r"tau_s = 0 s does not separate the satellites"),
        ({"tau": -5.0}, r"tau_s = -5 s does not separate"),
        ({"h": 7.0}, r"h_int = 7 s does not divide dt = 30 s"),
        ({"h": 60.0}, r"h_int = 60 s does not divide dt = 30 s"),
        ({"h": 0.0}, r"h_int = 0 s does not divide dt"),
        ({"h": -10.0}, r"h_int = -10 s does not divide dt"),
        ({"integrator": "dop853", "h": 20.0}, r"h_int = 20 s does not divide dt = 30 s"),
        ({"integrator": "euler"}, r"integrator = 'euler' is unknown; give gj, dop853 or rk45"),
        ({"start": "anywhere"}, r"start = 'anywhere' is unknown"),
    ],
)
def test_scenarios_that_cannot_be_flown(changes, message):
    with pytest.raises(ValueError, match=message):
        Scenario(**changes)


def test_runge_kutta_chooses_its_own_step():
    assert Scenario(integrator="rk45", h=7.0).h == 7.0


def test_a_field_that_is_not_there():
    with pytest.raises(FileNotFoundError, match="No gravity field 'nowhere.gfc'"):
        Scenario(field="nowhere.gfc")


def test_a_field_of_another_body():
    with pytest.raises(ValueError, match="GM = 4.28.* is not that of the Earth, .*; it is that of another body"):
        Scenario(field="GMM2B", n_max=10)


# --- tuning ----------------------------------------------------------------------------------------------------------


def test_tuning_in_numbers():
    """Section 3: lambda_q = 4250 and mu = 9 are q = 1.74897e-10 and 3e-4 m/s."""
    t = Tuning()
    assert t.q(30.0) == pytest.approx(1.74897e-10, rel=1e-5)
    assert t.sigma_rr(30.0) == pytest.approx(3.0e-4, rel=2e-15)
    back = Tuning.from_densities(30.0, t.q(30.0), 1e-3, 3e-4, kappa=1.0)
    assert (back.lambda_q, back.mu, back.kappa) == (pytest.approx(4250.0), pytest.approx(9.0), 1.0)


def test_sigmas_of_the_filter_override_the_numbers():
    p = {
        "lambda_q": 4500.0,
        "mu": 9.0,
        "sigma_r": 1e-3,
        "alpha": 1.0,
        "beta": 0.0,
        "kappa": 2.0,
        "filter_sigma_rr": None,
        "days": 3,
    }
    assert Tuning.from_parameters(p, 30.0) == Tuning(lambda_q=4500.0)
    t = Tuning.from_parameters(p, 30.0, filter_sigma_r=0.028, filter_sigma_rr=3e-7)
    assert t.sigma_r == 0.028 and t.sigma_rr(30.0) == pytest.approx(3e-7, rel=1e-14)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"lambda_q": 0.0}, r"lambda_q = 0 is not a positive number"),
        ({"lambda_q": -1.0}, r"lambda_q = -1 is not a positive number"),
        ({"mu": 0.0}, r"mu = 0 is not a positive number"),
        ({"mu": math.nan}, r"mu = nan is not a positive number"),
        ({"sigma_r": 0.0}, r"sigma_r = 0 is not a positive number"),
        ({"sigma_r": -1e-3}, r"sigma_r = -0.001 is not a positive number"),
        ({"sigma_r": math.inf}, r"sigma_r = inf is not a positive number"),
        ({"alpha": 0.0}, r"alpha = 0 is not a positive number"),
        ({"beta": math.nan}, r"beta = nan is not finite"),
        (
            {"kappa": -9.0},
            r"kappa = -9 does not make n \+ kappa positive and finite for the n = 9 states; give kappa > -9",
        ),
        ({"kappa": math.nan}, r"kappa = nan"),
    ],
)
def test_weights_that_no_filter_can_use(changes, message):
    with pytest.raises(ValueError, match=message):
        Tuning(**changes)


@pytest.mark.parametrize("given", [{"filter_sigma_rr": 0.0}, {"filter_sigma_rr": -1e-6}, {"filter_sigma_r": 0.0}])
def test_sigmas_of_the_filter_must_be_positive(given):
    with pytest.raises(ValueError, match="is not a positive number"):
        Tuning.from_parameters(given, 30.0)


# --- observations ----------------------------------------------------------------------------------------------------


def series(n=20, **changes):
    given = {
        "dt": 30.0,
        "baseline": np.ones((n, 3)),
        "rate": np.zeros(n),
        "prior_mean": np.zeros(9),
        "prior_cov": np.eye(9),
    }
    return given | changes


def test_a_missing_observation_is_allowed():
    given = series()
    given["baseline"][3, 1] = np.nan
    given["rate"][7] = np.nan
    Observations(**given)


def test_shapes_that_do_not_belong_together():
    with pytest.raises(ValueError, match=r"shape \(20, 3\) and range-rates of shape \(19,\) do not belong together"):
        Observations(**series(rate=np.zeros(19)))
    with pytest.raises(ValueError, match=r"shape \(20, 2\)"):
        Observations(**series(baseline=np.ones((20, 2))))


@pytest.mark.parametrize(("name", "words"), [("baseline", "relative position"), ("rate", "range-rate")])
def test_an_infinite_observation_is_refused_with_its_epoch(name, words):
    given = series()
    given[name][13] = np.inf
    with pytest.raises(ValueError, match=f"the {words} at epoch 13 is infinite; a missing observation is NaN"):
        Observations(**given)


@pytest.mark.parametrize("dt", [0.0, -30.0, math.nan])
def test_a_sampling_interval_is_positive(dt):
    with pytest.raises(ValueError, match=r"dt = .* s is not a sampling interval"):
        Observations(**series(dt=dt))


def test_a_prior_is_finite_symmetric_and_positive_definite():
    tilted = np.eye(9)
    tilted[2, 5] = 0.1
    with pytest.raises(ValueError, match=r"prior_cov is not symmetric: element \(2, 5\) is 0.1, element \(5, 2\) is 0"):
        Observations(**series(prior_cov=tilted))
    with pytest.raises(ValueError, match=r"the prior_cov is not positive definite: its diagonal element 4 is -1"):
        Observations(**series(prior_cov=np.diag([1.0] * 4 + [-1.0] + [1.0] * 4)))
    with pytest.raises(
        ValueError, match=r"the prior_cov is not positive definite: its correlation matrix has the eigenvalue"
    ):
        Observations(
            **series(prior_cov=np.eye(9) + np.kron(np.diag([0.0, 0.0, 1.0]), 2.0 * (np.ones((3, 3)) - np.eye(3))))
        )
    with pytest.raises(ValueError, match=r"prior_mean\[8\] is nan: values must be finite"):
        Observations(**series(prior_mean=np.r_[np.zeros(8), np.nan]))
    with pytest.raises(ValueError, match=r"prior_cov has the shape \(3, 3\), it must be \(9, 9\)"):
        Observations(**series(prior_cov=np.eye(3)))


def test_more_epochs_than_memory_holds_are_refused(monkeypatch):
    monkeypatch.setattr(memory, "available", lambda: 8e9)
    sentence = (
        "^A pair of orbits of 34560000001 epochs, with its filters, needs 104 TB of memory, and 8 GB are available; "
        r"give fewer days or a longer dt\.$"
    )
    with pytest.raises(memory.TooLarge, match=sentence):
        Scenario(days=400.0, dt=1e-3, h=1e-3)
    assert Scenario(days=400.0).epochs == 1152001  # 3.5 GB
