"""The pair of the primary paper in EGM96: start states and five-day ends found by an independent implementation."""

import numba
import numpy as np
import pytest

from geokalman.constants import GM_EARTH, OMEGA_EARTH
from geokalman.physics.forces import gravity_force, gravity_params, jacobi_constant
from geokalman.physics.harmonics import load_field
from geokalman.physics.kepler import kepler_to_state
from geokalman.physics.orbit import integrate

pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="days of orbit take hours in plain Python")

START_B = np.array(
    [
        5357573.11049891,
        1727695.6056431364,
        3853296.543529178,
        -4160.6944255370345,
        -1171.7122130669584,
        6312.771968798334,
    ]
)
START_A = {
    70: [5234543.65830501, 1692934.0034883546, 4033679.5750024356,
         -4352.703650157481, -1233.7225592931939, 6169.395551641042],
    30: [5234543.65183053, 1692934.004107816, 4033679.574972072,
         -4352.704126082827, -1233.72248352233, 6169.395490839517],
}  # fmt: skip
FIVE_DAYS_A = {70: [4966974.043, 1390338.715, -4472367.364], 30: [4966948.922, 1390340.402, -4472384.448]}
RANGE = {70: (220076.057, 221170.728), 30: (220167.406, 221170.965)}


def start(n_max, a=6834e3):
    field = load_field("EGM96", n_max)
    params = gravity_params(field, OMEGA_EARTH)
    B = kepler_to_state((a, 0.0018, np.radians(89.0), 0.3, 0.5, 0.1), GM_EARTH)
    A = integrate(gravity_force, params, B, (28.9, 1), "dop853").y[-1]
    return field, params, A, B


def ranges(o):
    return np.linalg.norm(o.r[:, 0] - o.r[:, 1], axis=1)


def range_rate(o):
    return np.sum((o.r[:, 0] - o.r[:, 1]) * (o.v[:, 0] - o.v[:, 1]), axis=1) / ranges(o)


@pytest.mark.parametrize("n_max", [30, 70])
def test_five_days_of_the_pair(n_max):
    field, params, A, B = start(n_max)
    np.testing.assert_allclose(B, START_B, rtol=0, atol=1e-8)
    np.testing.assert_allclose(A, START_A[n_max], rtol=0, atol=1e-8)
    o = integrate(gravity_force, params, np.concatenate([A, B]), (30.0, 14400), surface=field.radius)
    np.testing.assert_allclose(o.r[-1, 0], FIVE_DAYS_A[n_max], rtol=0, atol=0.01)
    np.testing.assert_allclose([ranges(o).min(), ranges(o).max()], RANGE[n_max], rtol=0, atol=0.01)
    J = jacobi_constant(o.t, o.r, o.v, field, OMEGA_EARTH)
    assert np.max(np.ptp(J, axis=0) / np.abs(J.mean(axis=0))) < 1e-12
    forward = np.sum((o.r[0, 0] - o.r[0, 1]) * o.v[0, 1])
    assert forward > 0.0, "A leads"


def test_one_day_holds_below_a_micrometre():
    """Gauss-Jackson h = 10 s against 5 s, and against DOP853, for the relative state that the range-rate sees."""
    _, params, A, B = start(70)
    y0 = np.concatenate([A, B])
    o = integrate(gravity_force, params, y0, (30.0, 2880))
    for other, position, rate in (
        (integrate(gravity_force, params, y0, (30.0, 2880), "gj", 5.0), 1e-6, 1e-10),
        (integrate(gravity_force, params, y0, (30.0, 2880), "dop853", 10.0), 5e-6, 3e-10),
    ):
        assert np.abs((o.r[:, 0] - o.r[:, 1]) - (other.r[:, 0] - other.r[:, 1])).max() < position
        assert np.abs(range_rate(o) - range_rate(other)).max() < rate


@pytest.mark.slow
def test_thirty_days():
    field, params, A, B = start(70)
    o = integrate(gravity_force, params, np.concatenate([A, B]), (30.0, 86400))
    np.testing.assert_allclose([ranges(o).min(), ranges(o).max()], [218960.03, 221170.73], rtol=0, atol=0.02)
    height = np.linalg.norm(o.r, axis=2) - 6378137.0
    np.testing.assert_allclose([height.min(), height.max(), height.mean()], [443.6e3, 473.2e3, 457.2e3], atol=60.0)
    rate = range_rate(o)
    np.testing.assert_allclose([np.sqrt(np.mean(rate**2)), np.abs(rate).max()], [0.279, 0.723], atol=6e-4)
    z = o.r[:, 1, 2]
    assert np.count_nonzero((z[:-1] < 0) & (z[1:] >= 0)) == 460
    J = jacobi_constant(o.t, o.r, o.v, field, OMEGA_EARTH)
    assert np.max(np.ptp(J, axis=0) / np.abs(J.mean(axis=0))) < 1e-12


@pytest.mark.slow
def test_papers_runge_kutta_45():
    """Adaptive RK45 for a day at a = 6870 km: usable at rtol 1e-12, useless at the tolerances in common use."""
    _, params, A, B = start(70, 6870e3)
    y0 = np.concatenate([A, B])
    precise = integrate(gravity_force, params, y0, (30.0, 2880))
    tight = integrate(gravity_force, params, y0, (30.0, 2880), "rk45", rtol=1e-12, atol=1e-9)
    loose = integrate(gravity_force, params, y0, (30.0, 2880), "rk45", rtol=1e-6, atol=1e-6)
    error = range_rate(tight) - range_rate(precise)
    np.testing.assert_allclose(np.sqrt(np.mean(error**2)), 6e-10, rtol=0.2)
    np.testing.assert_allclose(np.linalg.norm(tight.r[-1, 0] - precise.r[-1, 0]), 0.015, rtol=0.2)
    stencil = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0, 4 / 5, -1 / 5, 4 / 105, -1 / 280])

    def newton_residual(o):
        derivative = np.convolve(ranges(o), stencil[::-1], "valid") / 30.0
        return np.std((derivative - range_rate(o)[4:-4])[96:-96])

    np.testing.assert_allclose(newton_residual(tight), 1.19e-6, rtol=0.02)
    assert newton_residual(loose) > 1e-5
