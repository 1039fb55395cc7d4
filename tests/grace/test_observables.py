"""Line-of-sight gravity differences: the exact one against the potential, every route against its definition and
numbers."""

from __future__ import annotations

import numpy as np
import pytest

from geokalman.constants import OMEGA_EARTH
from geokalman.grace import assess, estimate, observables
from geokalman.grace.differentiate import derivative, spline_derivative
from geokalman.grace.model import Observations, Tuning, distance, los_gravity, range_rate
from geokalman.physics.frames import to_ecef
from geokalman.physics.gravity import potential

LITERAL = Tuning(lambda_q=1500.0)


@pytest.fixture(scope="module")
def tiny_los(tiny):
    return observables.observables(tiny.orbit, tiny.gravity, tiny.data, Tuning(), LITERAL)


def test_exact_is_the_slope_of_the_potential(tiny):
    """X against central differences of V at both satellites along e: steps of 100 m leave 1e-9 of 9 m/s^2."""
    orbit, e, step = tiny.orbit, tiny.orbit.dr / distance(tiny.orbit.dr)[:, None], 100.0
    slope = []
    for state in (orbit.A, orbit.B):
        ends = [
            potential(tiny.gravity, to_ecef(orbit.t, state[:, :3] + sign * step * e, OMEGA_EARTH)) for sign in (1, -1)
        ]
        slope.append((ends[0] - ends[1]) / (2 * step))
    np.testing.assert_allclose(observables.exact(orbit, tiny.gravity), slope[0] - slope[1], rtol=0, atol=3e-9)


def test_every_route_by_its_definition(tiny, tiny_los):
    """The table of the module, written out."""
    orbit, data, dt = tiny.orbit, tiny.data, tiny.orbit.dt
    rho, rate = distance(orbit.dr), range_rate(orbit.dr, orbit.dv)
    dv, first = derivative(orbit.dr, dt), derivative(rho, dt)
    ekf, ukf, literal = estimate.ekf(data, Tuning()), estimate.ukf(data, Tuning()).smoothed, estimate.ekf(data, LITERAL)
    wanted = {
        "X": observables.exact(orbit, tiny.gravity),
        "N1": los_gravity(rho, first, derivative(first, dt), dv),
        "N2": los_gravity(rho, first, derivative(rho, dt, 9, 2), dv),
        "E0": np.einsum("ij,ij->i", literal.filtered.dr, literal.filtered.x[:, 6:]) / literal.filtered.rho,
        "E1": los_gravity(ekf.smoothed.rho, ekf.smoothed.rate, derivative(ekf.smoothed.rate, dt), ekf.smoothed.dv),
        "E2": np.einsum("ij,ij->i", ekf.smoothed.dr, ekf.smoothed.x[:, 6:]) / ekf.smoothed.rho,
        "U1": los_gravity(ukf.rho, ukf.rate, derivative(ukf.rate, dt), ukf.dv),
        "U2": np.einsum("ij,ij->i", ukf.dr, ukf.x[:, 6:]) / ukf.rho,
        "K0": los_gravity(rho, rate, derivative(rate, dt), orbit.dv),
        "B11": los_gravity(rho, rate, spline_derivative(rate, dt, 11), spline_derivative(orbit.dr, dt, 11)),
        "P2": np.einsum("ij,ij->i", literal.smoothed.dr, literal.smoothed.x[:, 6:]) / literal.smoothed.rho,
    }
    assert tuple(tiny_los) == observables.IDS == tuple(wanted)
    for name, series in wanted.items():
        np.testing.assert_allclose(tiny_los[name], series, rtol=0, atol=1e-15, equal_nan=True, err_msg=name)


def test_every_route_comes_near_the_truth(tiny, tiny_los):
    """At degree 4 there is no truncation to speak of: all within 1e-7 m/s^2 but the filter without a smoother."""
    inside = slice(60, -60)
    for name in observables.IDS:
        error = np.abs(tiny_los[name] - tiny_los["X"])[inside].max()
        assert error < (1e-2 if name == "E0" else 1e-8), name
    assert np.abs(tiny_los["E0"] - tiny_los["X"])[inside].max() > 1e-5


def test_what_is_asked_for_comes_in_its_order(tiny, tiny_los):
    some = observables.observables(tiny.orbit, tiny.gravity, tiny.data, Tuning(), LITERAL, ["U2", "N2", "K0"])
    assert list(some) == ["U2", "N2", "K0"]
    for name, series in some.items():
        np.testing.assert_array_equal(series, tiny_los[name])


def test_methods_see_the_data_and_not_the_truth(tiny):
    """Halved baselines change every method, and no control."""
    data = tiny.data
    halved = Observations(data.dt, 0.5 * data.baseline, 0.5 * data.rate, 0.5 * data.prior_mean, data.prior_cov)
    found = observables.observables(tiny.orbit, tiny.gravity, halved, Tuning(), LITERAL)
    for name in observables.IDS:
        ratio = np.nanmedian(found[name][60:-60] / observables.exact(tiny.orbit, tiny.gravity)[60:-60])
        assert ratio == pytest.approx(1.0 if name in ("X", "K0", "B11") else 0.5, abs=1e-3), name


def test_an_unknown_observable():
    with pytest.raises(ValueError, match="observable 'N3' is unknown; the observables are X, N1, N2, E0"):
        observables.observables(None, None, None, None, None, ["N1", "N3"])


def test_errors_at_degree_70(mid, mid_ekf, mid_ukf):
    """Order of table 6.5, which holds on 5 days too: N1 > E1 > U1 > K0 > N2 > E2 > U2 > B11."""
    los = observables.observables(mid.orbit, mid.gravity, mid.data, Tuning(), LITERAL)
    std = {name: assess.statistics(series - los["X"]).std for name, series in los.items()}
    order = ["E0", "N1", "E1", "U1", "K0", "N2", "E2", "U2", "P2", "B11", "X"]
    assert sorted(std, key=std.get, reverse=True) == order
    assert std["P2"] == pytest.approx(0.86e-8, rel=0.01)  # 6.2, lambda_q = 1500
    assert std["B11"] == pytest.approx(7.479e-10, rel=0.1)  # 6.5, 30 d
