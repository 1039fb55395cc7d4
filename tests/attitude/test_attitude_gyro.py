"""Gyros: unwrapping is exact, faults and gaps are seen, four axes give three and a parity."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from geokalman.attitude import gyro
from geokalman.attitude.model import GYRO_HZ, WRAP_DEG, Tuning, gyro_matrix
from geokalman.attitude.truth import increments
from geokalman.physics.quaternion import difference, exp, multiply


def wrapped(angle):
    return (angle + WRAP_DEG) % (2 * WRAP_DEG) - WRAP_DEG


@pytest.mark.parametrize("rate", [0.052, -0.052])
@pytest.mark.parametrize("start", [WRAP_DEG - 1.0, -WRAP_DEG + 1.0, 0.0])
def test_unwrapping_is_exact_across_the_limit(rate, start):
    """Bad input 8; E3: rates with and without the wrap are the same to 1e-12 rad."""
    angle = start + rate * np.arange(4000) / GYRO_HZ
    steps = np.radians(np.diff(gyro.unwrap(wrapped(angle))))
    np.testing.assert_allclose(steps, np.radians(np.diff(angle)), atol=2e-14 * WRAP_DEG)


def test_spikes_and_infinities_are_dropped_not_the_motion():
    t = np.arange(400) / GYRO_HZ
    angle = WRAP_DEG - 10 + 0.052 * t * 8
    spoiled = wrapped(angle)
    spoiled[100] += 3.0
    spoiled[200] = np.nan
    spoiled[399] += 1.0
    times, clean, lost = gyro.clean(t, spoiled)
    assert lost == 3 and len(times) == 397
    np.testing.assert_allclose(clean - clean[0], angle[np.isin(t, times)] - angle[0], atol=1e-9)


def test_common_epochs_leave_gaps_open():
    """Bad input 5: no angle is interpolated over more than 1 s, nor across a jump that lasts."""
    t = np.arange(0, 60, 0.125) + 0.03
    angle = np.sin(0.1 * t)
    there = (t < 20) | (t > 22)
    jumped = np.where(t > 40, angle + 5.0, angle)
    epochs = np.arange(0, 60, 0.125)
    out = gyro.common(t[there], jumped[there], epochs)
    assert np.isnan(out[(epochs > 20.1) & (epochs < 21.9)]).all() and np.isnan(out[0])
    good = np.isfinite(out)
    expected = np.where(epochs > 40, np.sin(0.1 * epochs) + 5.0, np.sin(0.1 * epochs))
    np.testing.assert_allclose(out[good], expected[good], atol=1e-8)
    assert np.isnan(gyro.common(t[:3], angle[:3], epochs)).all()


def test_reduction_against_the_truth(hours, tuning):
    for s in ("C", "D"):
        out = gyro.reduced(hours.raw[s], tuning)
        motion = hours.truth[s]
        first = round((out.t[0] - motion.t[0]) * GYRO_HZ)
        true = increments(motion.q[first : first + len(out.t)])
        error = out.d - true
        # neighbouring samples share noise after the interpolation to common epochs, so an increment has a little less
        assert error.std(axis=0).mean() == pytest.approx(1.763e-7 / np.sqrt(GYRO_HZ), rel=0.08)
        parity = out.parity - out.parity.mean(axis=0)
        assert parity.std() == pytest.approx(3.4e-8, rel=0.05)


def test_rates_of_one_second_and_a_lost_axis(hours, tuning):
    """E3: 1.76e-7 rad/s with four axes; without axis 4 yaw doubles, roll and pitch stay."""
    motion = hours.truth["C"]
    for axes, expected in (((1, 2, 3, 4), (1.76, 1.76, 1.76)), ((1, 2, 3), (1.76, 1.76, 3.52))):
        t, rates = gyro.mean_rates(gyro.reduced(hours.raw["C"], replace(tuning, axes=axes)))
        k = np.round((t - motion.t[0]) * GYRO_HZ).astype(int)
        true = difference(motion.q[k - 4], motion.q[k + 4])
        np.testing.assert_allclose(1e7 * (rates - true).std(axis=0), expected, rtol=0.04)
    assert np.isnan(gyro.reduced(hours.raw["C"], replace(tuning, axes=(1, 2, 3))).parity).all()


def test_too_few_axes_stop():
    """Bad input 9: two axes missing."""
    with pytest.raises(ValueError, match="leaves the rate undetermined"):
        Tuning(axes=(1, 2))


def test_a_fault_is_detected_by_parity_and_named_by_the_cameras(hours, tuning):
    """Bad input 9: parity above 6 sigma for 1 s; one number cannot name the axis, a reference attitude can."""
    raw = hours.raw["C"]
    spoiled = raw.gyro.copy()
    ramp = np.clip(np.arange(raw.gyro.shape[1]) - 40000, 0, None) * 1e-4
    spoiled[1] = (spoiled[1] + ramp + WRAP_DEG) % (2 * WRAP_DEG) - WRAP_DEG
    out = gyro.reduced(replace(raw, gyro=spoiled), tuning)
    sound = gyro.reduced(raw, tuning)
    assert gyro.parity_fault(sound.parity, 3.4e-8, "C") is None
    found = gyro.parity_fault(out.parity, 3.4e-8, "C")
    assert found is not None and abs(found - (40000 - 8)) < 20
    motion = hours.truth["C"]
    first = round((out.t[0] - motion.t[0]) * GYRO_HZ)
    true = increments(motion.q[first : first + len(out.t)])
    assert gyro.isolate(out.d @ gyro_matrix("C").T + out.parity, true, "C") == 2


def test_preintegration_composes_rotations():
    rng = np.random.default_rng(1)
    d = 1e-2 * rng.standard_normal((16, 3))
    out = gyro.preintegrate(gyro.Increments(np.arange(17) / 8, d, np.zeros((16, 4))), 1)
    q = np.array([1.0, 0, 0, 0])
    for step in d[:8]:
        q = multiply(q, exp(step))
    np.testing.assert_allclose(exp(out.d[0]), q, atol=2e-15)
    assert out.t.tolist() == [0.0, 1.0, 2.0]


def test_five_point_derivative_is_exact_for_quartics():
    t = np.arange(20) * 0.125
    np.testing.assert_allclose(gyro.five_point_rates(t**4, 0.125), 4 * t[2:-2] ** 3, atol=1e-10)


def test_increments_outside_the_data_are_refused():
    out = gyro.Increments(np.arange(17) / 8, np.zeros((16, 3)), np.zeros((16, 4)))
    with pytest.raises(ValueError, match="the gyros span 0 to 2 s, not 0 to 3 s"):
        gyro.between(out, 0.0, 3.0)
