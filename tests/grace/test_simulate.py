"""The simulated pair against the specification's states, other integrators, and the conservation of the Jacobi
constant."""

from __future__ import annotations

from dataclasses import replace

import numba
import numpy as np
import pytest

from geokalman import progress
from geokalman.constants import OMEGA_EARTH
from geokalman.grace import assess, estimate, simulate
from geokalman.grace.differentiate import derivative
from geokalman.grace.model import Scenario, distance, range_rate
from geokalman.physics.forces import jacobi_constant

START_B = (
    5357573.11049891,
    1727695.6056431364,
    3853296.543529178,
    -4160.6944255370345,
    -1171.7122130669584,
    6312.771968798334,
)
START_A = {
    70: (
        5234543.65830501,
        1692934.0034883546,
        4033679.5750024356,
        -4352.703650157481,
        -1233.7225592931939,
        6169.395551641042,
    ),
    30: (
        5234543.65183053,
        1692934.004107816,
        4033679.574972072,
        -4352.704126082827,
        -1233.72248352233,
        6169.395490839517,
    ),
}
END_A = {70: (4966974.043, 1390338.715, -4472367.364), 30: (4966948.922, 1390340.402, -4472384.448)}
RANGE = {70: (220076.057, 221170.728), 30: (220167.406, 221170.965)}


compiled = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="a day of orbit takes minutes in plain Python")


@pytest.fixture(params=[70, 30])
def flight(request):
    """MID and QUICK."""
    return request.getfixturevalue({70: "mid", 30: "quick"}[request.param])


@pytest.mark.parametrize("n_max", [70, 30])
def test_start_states(n_max):
    """Section 3 of the specification, to the rounding of a 29 s integration (1e-9 m, 1e-12 m/s)."""
    scenario = Scenario(n_max=n_max)
    A, B = simulate.start_states(scenario, scenario.gravity())
    np.testing.assert_allclose(A[:3], START_A[n_max][:3], rtol=0, atol=2e-8)
    np.testing.assert_allclose(A[3:], START_A[n_max][3:], rtol=0, atol=2e-11)
    np.testing.assert_allclose(B[:3], START_B[:3], rtol=0, atol=2e-8)
    np.testing.assert_allclose(B[3:], START_B[3:], rtol=0, atol=2e-11)


def test_state_after_five_days_and_range(flight):
    n_max = flight.scenario.n_max
    np.testing.assert_allclose(flight.orbit.A[-1, :3], END_A[n_max], rtol=0, atol=0.01)
    rho = distance(flight.orbit.dr)
    np.testing.assert_allclose([rho.min(), rho.max()], RANGE[n_max], rtol=0, atol=0.01)
    assert len(flight.orbit.t) == 14401  # both ends


def test_jacobi_constant_is_conserved(flight):
    for state in (flight.orbit.A, flight.orbit.B):
        jacobi = jacobi_constant(flight.orbit.t, state[:, :3], state[:, 3:], flight.gravity, OMEGA_EARTH)
        assert np.ptp(jacobi) / abs(jacobi.mean()) < 1e-12


def test_integrators_agree_over_a_day(mid):
    """The specification's bounds, 1e-9 m/s and 1e-5 m; Gauss-Jackson at half its step within a micrometre."""
    pairs = {
        (method, h): simulate.orbit_pair(Scenario(days=1.0, integrator=method, h=h), mid.gravity)
        for method, h in (("dop853", 15.0), ("dop853", 10.0), ("gj", 5.0))
    }
    pairs["gj", 10.0] = mid.orbit.first(1.0)
    for one, other in (
        (("dop853", 15.0), ("dop853", 10.0)),
        (("gj", 10.0), ("dop853", 10.0)),
        (("gj", 10.0), ("gj", 5.0)),
    ):
        rate, position = assess.pair_difference(pairs[one], pairs[other])
        assert rate < 1e-9
        assert position < 1e-5
    absolute = distance(pairs["gj", 10.0].B[:, :3] - pairs["gj", 5.0].B[:, :3])
    assert absolute.max() < 1e-5


@compiled
def test_runge_kutta_of_the_paper():
    """Section 8, g07: at rtol 1e-12 the Newton row is truncation error, at 1e-6 it is the integrator's."""
    std = {}
    for rtol, atol in ((1e-12, 1e-9), (1e-6, 1e-6)):
        scenario = Scenario(days=1.0, a=6870e3, integrator="rk45", rtol=rtol, atol=atol)
        gravity = scenario.gravity()
        orbit = simulate.orbit_pair(scenario, gravity)
        newton = estimate.newton(simulate.observe(orbit, gravity))
        std[rtol] = assess.statistics(assess.range_rate_residual(newton.rate, orbit)).std
    assert std[1e-12] == pytest.approx(1.19e-6, rel=0.02)
    assert std[1e-6] > 1e-5


def test_leading_satellite_is_where_the_trailing_one_arrives(tiny):
    """In a field that turns, B's state at tau is A's at 0 only because tau is integrated from t = 0."""
    scenario, gravity = tiny.scenario, tiny.gravity
    later = simulate.orbit_pair(Scenario(days=28.9 / 86400, dt=28.9, n_max=4, h=28.9 / 4, integrator="dop853"), gravity)
    np.testing.assert_allclose(simulate.start_states(scenario, gravity)[0], later.B[-1], rtol=1e-13)


def test_same_elements_drift_apart(tiny):
    """The pitfall of section 3: kilometres per revolution, against metres with the shift in time."""
    naive = simulate.orbit_pair(Scenario(days=4 / 24, n_max=4, start="same-elements"), tiny.gravity)
    shifted = simulate.orbit_pair(Scenario(days=4 / 24, n_max=4), tiny.gravity)
    revolution = 2 * np.pi * np.sqrt(6834e3**3 / tiny.gravity.gm)
    assert abs(assess.drift_per_revolution(naive, revolution)) > 1e3
    assert abs(assess.drift_per_revolution(shifted, revolution)) < 100.0


def test_accelerations_are_the_derivative_of_the_velocity(tiny):
    """Central differences of the integrated velocities, 9 points at 30 s: truncation below 1e-9 of 9 m/s^2 at degree
    4."""
    for state, acceleration in zip(
        (tiny.orbit.A, tiny.orbit.B), simulate.accelerations(tiny.orbit, tiny.gravity), strict=True
    ):
        numerical = derivative(state[:, 3:], tiny.orbit.dt)
        np.testing.assert_allclose(acceleration[4:-4], numerical[4:-4], rtol=0, atol=1e-7)


def test_observations_without_noise_are_the_truth(tiny):
    np.testing.assert_array_equal(tiny.data.baseline, tiny.orbit.dr)
    np.testing.assert_array_equal(tiny.data.rate, range_rate(tiny.orbit.dr, tiny.orbit.dv))
    np.testing.assert_array_equal(tiny.data.prior_mean[:6], np.concatenate([tiny.orbit.dr[0], tiny.orbit.dv[0]]))
    np.testing.assert_array_equal(np.diag(tiny.data.prior_cov), np.repeat([1e-4, 1e-6, 1e-8], 3))


def test_noise_is_drawn_in_the_order_of_the_specification(tiny):
    """A (n, 3), B (n, 3), range-rate (n,), from default_rng(20190424)."""
    noisy = simulate.observe(tiny.orbit, tiny.gravity, np.random.default_rng(20190424), 0.02, 3e-7)
    rng, n = np.random.default_rng(20190424), len(tiny.orbit.t)
    A = tiny.orbit.A[:, :3] + 0.02 * rng.standard_normal((n, 3))
    B = tiny.orbit.B[:, :3] + 0.02 * rng.standard_normal((n, 3))
    np.testing.assert_allclose(noisy.baseline, A - B, rtol=0, atol=1e-8)
    np.testing.assert_allclose(noisy.rate, tiny.data.rate + 3e-7 * rng.standard_normal(n), rtol=0, atol=1e-15)
    np.testing.assert_array_equal(noisy.prior_mean, tiny.data.prior_mean)


@pytest.mark.parametrize("sigmas", [(-0.02, 3e-7), (0.02, -3e-7)])
def test_negative_noise_is_refused(tiny, sigmas):
    with pytest.raises(
        ValueError, match=r"sigma_pos = .* m and sigma_rr = .* m/s: a standard deviation is not negative"
    ):
        simulate.observe(tiny.orbit, tiny.gravity, np.random.default_rng(1), *sigmas)


def test_noise_without_a_generator_is_refused(tiny):
    with pytest.raises(ValueError, match="noise needs a random generator"):
        simulate.observe(tiny.orbit, tiny.gravity, sigma_pos=0.02)


def test_parts_of_a_pair(tiny):
    first = tiny.orbit.first(1 / 24)
    assert first.t[-1] == 3600.0 and len(first.A) == 121
    thin = tiny.orbit.every(4)
    assert thin.dt == 120.0
    np.testing.assert_array_equal(thin.B, tiny.orbit.B[::4])


def test_a_satellite_that_comes_down_is_reported(tiny):
    """A body so large that the orbit's perigee lies below its surface; the sentence says when."""
    gravity = replace(tiny.gravity, radius=6.83e6)
    with pytest.raises(ArithmeticError, match=r"within 6830000 m of the centre.* about t = \d+ s"):
        simulate.orbit_pair(Scenario(days=0.1, n_max=4, m0=np.pi), gravity)


def test_progress_ends_at_one(tiny):
    seen: list[tuple[str, float]] = []
    progress.listen(lambda *told: seen.append(told))
    simulate.orbit_pair(Scenario(days=0.05, n_max=2), tiny.gravity.truncate(2))
    progress.listen(None)
    assert seen and seen[-1] == ("orbits", 1.0)


def test_the_time_of_an_orbit_is_foreseen():
    """Gauss-Jackson takes one evaluation in 10 s, DOP853 twelve in 15 s; the time goes with the span."""
    short = Scenario(days=1.0, n_max=20)
    gravity = short.gravity()
    simulate.outlook(short, gravity)  # loads what is compiled
    one = simulate.outlook(short, gravity)
    assert 0 < one < simulate.outlook(replace(short, integrator="dop853", h=15.0), gravity)
    assert one < simulate.outlook(replace(short, days=100.0), gravity)
    assert simulate.outlook(replace(short, integrator="rk45"), gravity) == 0.0
