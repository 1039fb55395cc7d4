"""Pointing angles, antenna correction, accelerations, what becomes of them in range-rates, and the time tag
experiment.
"""

from __future__ import annotations

import numpy as np
import pytest

from geokalman.attitude import effect, experiment, pointing
from geokalman.attitude.model import PHASE_CENTRE, SATELLITES, SUN, Scenario, los_frame
from geokalman.physics.quaternion import exp, from_matrix, multiply


def test_angles_of_a_turned_satellite(short):
    base = from_matrix(los_frame(short.r["C"], short.r["D"]))
    for i, axis in enumerate(np.eye(3)):
        turned = multiply(base, exp(1e-3 * axis))
        expected = np.zeros(3)
        expected[i] = 1e-3
        np.testing.assert_allclose(
            pointing.angles(turned, short.r["C"], short.r["D"]).mean(axis=0), expected, atol=1e-12
        )


def test_rates_of_a_steady_turn():
    t = np.arange(20.0)
    q = exp(np.outer(t, [0.0, 1.1e-3, 0.0]))
    np.testing.assert_allclose(pointing.rates(q), np.tile([0, 1.1e-3, 0], (18, 1)), atol=1e-15)


def test_antenna_correction(hours, solved):
    """E8: about 2.8889 m, std 1e-7 m, rate 1.7e-9 m/s; for ideal pointing it is the sum of the x components."""
    true = {s: hours.true_attitude(s) for s in SATELLITES}
    series = pointing.antenna_correction(true["C"], true["D"], hours.r["C"], hours.r["D"])
    assert series.mean() == pytest.approx(2.888856, abs=2e-6)
    assert pointing.central_rate(series).std() == pytest.approx(1.71e-9, abs=0.35e-9)
    ideal = {s: from_matrix(los_frame(hours.r[s], hours.r[o])) for s, o in (("C", "D"), ("D", "C"))}
    np.testing.assert_allclose(
        pointing.antenna_correction(ideal["C"], ideal["D"], hours.r["C"], hours.r["D"]),
        PHASE_CENTRE["C"][0] + PHASE_CENTRE["D"][0],
        atol=1e-9,
    )


def test_errors_of_the_antenna_rate_follow_the_filter(hours, tuning):
    table = experiment.filters(Scenario(duration_s=7200.0), tuning, 1, 1, names=("mekf", "rts", "jpl_like"))
    assert table["kbr_rate_error.mekf"][0] == pytest.approx(1.29e-10, abs=0.05e-10)
    assert table["kbr_rate_error.rts"][0] == pytest.approx(0.90e-10, abs=0.04e-10)
    assert table["kbr_rate_error.jpl_like"][0] == pytest.approx(2.83e-10, abs=0.1e-10)
    assert (
        table["kbr_rate_difference.both"][0]
        > table["kbr_rate_difference.one"][0]
        > 5 * table["kbr_rate_difference.none"][0]
    )


def test_nongravitational_accelerations():
    r, v = 6.87e6 * SUN[None], 7.6e3 * np.array([[0.0, 0.391, -0.902]]) / np.hypot(0.391, 0.902)
    a = effect.nongravitational(r, v)[0]
    assert a @ SUN == pytest.approx(-2e-8 + 8e-9 * 1.3, rel=1e-2)
    dark = effect.nongravitational(-r, v)[0]
    assert dark @ SUN == pytest.approx(-8e-9 * 0.3, rel=0.1)  # up is away from the Sun there, and the Sun is hidden


def test_acceleration_differences(short):
    """E7: no offset, no difference; an offset of 0.6 mrad makes 0.6e-3 of the acceleration across the pitch axis."""
    q = short.true_attitude("C")
    a = effect.accelerometer(short, "C", q)
    assert np.abs(pointing.acceleration_difference(q, q, a)).max() == 0.0
    change = pointing.acceleration_difference(q, effect.turned(q, 6e-4), a)
    np.testing.assert_allclose(np.linalg.norm(change, axis=1), 6e-4 * np.hypot(a[:, 0], a[:, 2]), rtol=1e-3)
    with pytest.raises(ValueError, match="acc_bias = .* must have three components"):
        effect.accelerometer(short, "C", q, (1e-6, 0.0))
    biased = effect.accelerometer(short, "C", q, (1e-6, 0.0, 1e-6))
    np.testing.assert_allclose(biased - a, np.tile([1e-6, 0, 1e-6], (len(a), 1)), atol=1e-20)


def test_a_constant_force_moves_a_satellite_less_on_its_orbit_than_in_free_space():
    """I5: 2.8 cm in six hours, against 10.8 cm."""
    assert effect.constant_force_departure(4.61e-10, 21600.0) == pytest.approx(0.028, abs=0.001)


def test_a_spectrum_that_is_drawn_has_the_power_of_the_measured_one():
    rng = np.random.default_rng(1)
    t = np.arange(4000)
    measured = rng.standard_normal(4000) + 3 * np.sin(2 * np.pi * 40 * t / 4000)
    np.testing.assert_array_equal(effect.span(measured, 1000, rng), measured[:1000])
    drawn = effect.span(measured, 40000, rng)
    f, density = pointing.asd(drawn, 1.0, 4000.0)
    assert np.median(density[f > 0.02] ** 2) == pytest.approx(2 * np.log(2) * 1.0, rel=0.3)
    assert density[np.argmin(abs(f - 0.01))] > 5 * np.median(density)


def test_range_rate_differences_of_a_flight(hours, solved):
    q = {n: {s: solved[s].solutions[n].q for s in SATELLITES} for n in ("mekf", "jpl_like")}
    true = {s: hours.true_attitude(s) for s in SATELLITES}
    same = effect.range_rate_difference(hours, q["mekf"], q["mekf"], true)
    assert np.abs(same).max() == 0.0 and len(same) == 240
    apart = effect.range_rate_difference(hours, q["mekf"], q["jpl_like"], true)
    assert 5e-12 < apart[5:].std() < 5e-10


def test_half_a_second_is_half_a_milliradian_of_pitch(hours, tuning):
    """E10: -0.554 mrad on C, which flies backwards, +0.554 on D; nothing in roll and yaw."""
    change = experiment.shifted(Scenario(duration_s=7200.0), tuning, 0.5, 1, 1)
    assert change["C.pitch"][0] == pytest.approx(-0.554e-3, abs=0.005e-3)
    assert change["D.pitch"][0] == pytest.approx(0.554e-3, abs=0.005e-3)
    for name in ("C.roll", "C.yaw", "D.roll", "D.yaw"):
        assert abs(change[name][0]) < 1e-7


def test_bands_need_frequencies():
    with pytest.raises(ValueError, match="holds no frequency"):
        pointing.band(np.zeros((10, 3)), 1.0, 0.6, 0.7)
