"""Hardware numbers of the specification, the simulated truth, and what a scenario refuses."""

from __future__ import annotations

import numpy as np
import pytest

from geokalman import memory
from geokalman.attitude import model, truth
from geokalman.attitude.model import QSA, Scenario, Tuning
from geokalman.attitude.pointing import angles
from geokalman.physics.quaternion import matrix


def test_boresights_and_tilts():
    boresight = matrix(QSA)[:, 2]
    expected = [(0.508, 0.000, -0.861), (-0.460, 0.763, -0.454), (-0.444, -0.769, -0.459)]
    np.testing.assert_allclose(boresight, expected, atol=6e-4)
    np.testing.assert_allclose(np.degrees(np.arccos(-boresight[:, 2])), [30.5, 63.0, 62.7], atol=0.05)


def test_noise_factors_of_single_cameras_and_of_all_three():
    information = model.camera_information(QSA, 1.0, 9.0)
    factors = np.sqrt([np.diag(np.linalg.inv(L)) for L in information])
    np.testing.assert_allclose(factors, [(4.65, 1.00, 7.77), (4.23, 6.90, 4.18), (4.10, 6.95, 4.23)], atol=0.006)
    np.testing.assert_allclose(
        np.sqrt(np.diag(np.linalg.inv(information.sum(axis=0)))), (0.654, 0.737, 0.734), atol=6e-4
    )


@pytest.mark.parametrize(("satellite", "condition"), [("C", 1.0006), ("D", 1.0005)])
def test_gyro_matrix(satellite, condition):
    H = model.gyro_matrix(satellite)
    assert np.linalg.cond(H) == pytest.approx(condition, abs=1e-4)
    np.testing.assert_allclose(np.linalg.inv(H.T @ H), 0.75 * np.eye(3), atol=1e-3)


def test_a_lost_axis_makes_the_gyro_noise_anisotropic():
    whole, lost = Tuning().rate_covariance("C"), Tuning(axes=(1, 2, 3)).rate_covariance("C")
    assert np.sqrt(whole[2, 2]) == pytest.approx(1.763e-7, rel=2e-3)
    assert np.sqrt(lost[2, 2] / whole[2, 2]) == pytest.approx(2.0, abs=0.01)
    assert np.sqrt(lost[0, 0] / whole[0, 0]) == pytest.approx(1.0, abs=0.01)


def test_zenith_mount_looks_along_minus_z():
    np.testing.assert_allclose(matrix(model.mounting("zenith"))[0, 2], [0, 0, -1], atol=2e-15)


@pytest.fixture(scope="module")
def flown():
    return truth.fly(Scenario(duration_s=600.0), np.random.default_rng(2))


def test_velocity_is_the_derivative_of_the_position(flown):
    motion = flown["C"]
    numeric = (motion.r[2:] - motion.r[:-2]) / (motion.t[2:] - motion.t[:-2])[:, None]
    np.testing.assert_allclose(motion.v[1:-1], numeric, atol=1e-4)
    assert np.linalg.norm(motion.v[0]) == pytest.approx(7617, abs=20)


def test_mean_rate_along_the_orbit_and_separation():
    t = np.array([0.0, 5000.0])
    r, _ = truth.orbit(t, Scenario(eccentricity=0.0), 0.0)
    rate = (
        np.arccos(
            np.clip(
                r[0] @ truth.orbit(t + 10, Scenario(eccentricity=0.0), 0.0)[0][0] / np.linalg.norm(r[0]) ** 2, -1, 1
            )
        )
        / 10
    )
    assert rate == pytest.approx(1.1077e-3, rel=1e-3)


def test_satellites_fly_220_km_apart_with_c_ahead(flown):
    apart = flown["C"].r - flown["D"].r
    assert np.linalg.norm(apart, axis=1).mean() == pytest.approx(220e3, rel=0.01)
    assert (np.einsum("ki,ki->k", apart, flown["D"].v) > 0).all()


def test_pointing_angles_are_those_that_were_simulated(flown):
    for one, other in (("C", "D"), ("D", "C")):
        found = angles(flown[one].q, flown[one].r, flown[other].r)
        again = truth.attitude(flown[one].r, flown[other].r, found)
        np.testing.assert_allclose(np.abs(np.einsum("ki,ki->k", again, flown[one].q)), 1.0, atol=1e-13)
        assert np.abs(found).max() < 2e-3


def test_leading_satellite_flies_backwards(flown):
    x_axis = matrix(flown["C"].q)[:, :, 0]
    assert (np.einsum("ki,ki->k", x_axis, flown["C"].v) < 0).all()
    rate = truth.increments(flown["C"].q)[:, 1] * 8, truth.increments(flown["D"].q)[:, 1] * 8
    assert rate[0].mean() == pytest.approx(1.108e-3, rel=0.02) and rate[1].mean() == pytest.approx(-1.108e-3, rel=0.02)


def test_angles_and_rates_have_the_sizes_of_the_specification():
    t = np.arange(0, 43200, 1 / 8)
    runs = [truth.pointing_angles(t, np.random.default_rng(seed)) for seed in range(3)]
    rms = np.sqrt(np.mean([np.mean(a**2, axis=0) for a in runs], axis=0))
    np.testing.assert_allclose(rms, (2.9e-4, 1.4e-4, 1.9e-4), rtol=0.15)
    rates = np.mean([np.std(np.diff(a, axis=0) * 8, axis=0) for a in runs], axis=0)
    np.testing.assert_allclose(rates, (4.4e-6, 2.4e-6, 2.8e-6), rtol=0.2)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"duration_s": 10.0}, "duration_s = 10 must be a whole number"),
        ({"duration_s": float("nan")}, "duration_s = nan is not finite"),
        ({"arw_deg_sqrt_h": 0.0}, "arw_deg_sqrt_h = 0 must be positive"),
        ({"mount": "nadir"}, "mount = 'nadir' is unknown"),
        ({"cameras_off": (1, 2, 3)}, "must name some of cameras"),
    ],
)
def test_impossible_scenarios_are_refused(change, message):
    with pytest.raises(ValueError, match=message):
        Scenario(**change)


def test_what_is_named_twice_is_refused():
    with pytest.raises(ValueError, match=r"axes = \[1, 1, 2, 3\] names 1 twice"):
        Tuning.from_parameters({"axes": [1, 2, 1, 3]})
    with pytest.raises(ValueError, match=r"cameras_off = \[1, 1\] names 1 twice"):
        Scenario.from_parameters({"cameras_off": [1, 1]})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"axes": (1, 2)}, "leaves the rate undetermined"),
        ({"kappa": -1.0}, "kappa = -1 must be positive"),
        ({"update_hz": 4}, "update_hz = 4 is not offered"),
    ],
)
def test_impossible_tunings_are_refused(change, message):
    with pytest.raises(ValueError, match=message):
        Tuning(**change)


def test_a_flight_that_memory_does_not_hold_is_refused(monkeypatch):
    monkeypatch.setattr(memory, "available", lambda: 8e9)
    sentence = "^A flight of 864000 s needs 13 GB of memory, and 8 GB are available; give a shorter duration_s"
    with pytest.raises(memory.TooLarge, match=sentence):
        Scenario(duration_s=864000.0)
