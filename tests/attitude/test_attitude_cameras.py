"""Star cameras: errors of singles and combinations as the mounting predicts, covariance, sign flips, gaps,
calibration.
"""

from __future__ import annotations

import numpy as np
import pytest

from geokalman.attitude import cameras, experiment, simulate, truth
from geokalman.attitude.cameras import in_satellite_axes
from geokalman.attitude.experiment import camera_angles
from geokalman.attitude.model import AXES, QSA, Scenario, Tuning
from geokalman.physics.quaternion import difference, exp, multiply

SIGMA = Scenario().sigma


def test_single_cameras_and_combinations(hours, tuning):
    """E1 and E2, on one two-hour flight."""
    table = experiment.camera_errors(Scenario(duration_s=7200.0), tuning, 1, 1)
    rms = {name: value for name, (value, _) in table.items()}
    assert rms["single.2.rms.pitch"] / rms["single.1.rms.pitch"] == pytest.approx(6.9, abs=0.2)
    assert rms["single.2.rms.roll"] / rms["single.1.rms.roll"] == pytest.approx(0.91, abs=0.02)
    assert rms["single.1.rms.pitch"] == pytest.approx(24.3e-6, abs=0.6e-6)
    for axis, value in zip(AXES, (15.9e-6, 17.9e-6, 17.8e-6), strict=True):
        assert rms[f"combined.123.rms.{axis}"] == pytest.approx(value, abs=0.4e-6)
    for axis, value in zip(AXES, (1.25, 1.21, 1.12), strict=True):
        best = min(rms[f"combined.{use}.rms.{axis}"] for use in ("12", "13", "23"))
        assert best / rms[f"combined.123.rms.{axis}"] == pytest.approx(value, abs=0.03)


def test_a_zenith_camera_has_a_clean_roll(tuning):
    table = experiment.camera_errors(Scenario(duration_s=3600.0, mount="zenith"), tuning, 1, 1, "C")
    for axis in ("roll", "pitch"):
        assert table[f"single.1.rms.{axis}"][0] == pytest.approx(24.2e-6, abs=0.6e-6)


def test_weights_matter_only_where_they_are_ignored(tuning):
    """E2b."""
    errors = experiment.weights(Scenario(duration_s=3600.0), tuning, [1.0, 3.0, 6.0, 9.0, 12.0, 30.0], 1, 1, "C")
    np.testing.assert_allclose(errors[1.0], (61e-6, 80e-6, 79e-6), atol=3e-6)
    np.testing.assert_allclose(errors[3.0], (17.5e-6, 21.6e-6, 21.4e-6), atol=0.5e-6)
    for k in (6.0, 12.0, 30.0):
        np.testing.assert_allclose(errors[k], errors[9.0], rtol=0.015)


def one_epoch(rng, n=4000):
    """Attitudes of the three cameras about one true attitude, (3, n, 4)."""
    q = multiply(exp(np.array([0.3, -1.0, 2.0])), exp(np.zeros((n, 3))))
    noise = rng.standard_normal((3, n, 3)) * SIGMA * np.array([1, 1, 9.0])
    return q, np.stack(
        [multiply(multiply(multiply(q, quat_inverse(m)), exp(e)), m) for m, e in zip(QSA, noise, strict=True)]
    )


def quat_inverse(q):
    return q * np.array([1.0, -1, -1, -1])


@pytest.mark.parametrize("missing", [(), (0,), (1,), (0, 2)])
def test_covariance_of_the_combination_is_honest(missing):
    q, seen = one_epoch(np.random.default_rng(4))
    seen[list(missing)] = np.nan
    out = cameras.combine(np.arange(len(q)), seen, QSA, SIGMA, 9.0)
    e = difference(out.q, q)
    chi = np.einsum("ki,kij,kj->k", e, np.linalg.inv(out.cov), e)
    assert chi.mean() / 3 == pytest.approx(1.0, abs=0.05)
    assert (out.used == sum(1 << i for i in range(3) if i not in missing)).all()


def test_no_camera_leaves_a_gap_and_flips_do_not_matter():
    _q, seen = one_epoch(np.random.default_rng(5), 50)
    plain = cameras.combine(np.arange(50.0), seen, QSA, SIGMA, 9.0)
    flipped = seen.copy()
    flipped[1, 10:20] *= -1
    flipped[:, 30] = np.nan
    out = cameras.combine(np.arange(50.0), flipped, QSA, SIGMA, 9.0)
    assert np.isnan(out.q[30]).all() and np.isnan(out.cov[30]).all() and out.used[30] == 0
    keep = np.arange(50) != 30
    np.testing.assert_allclose(difference(out.q[keep], plain.q[keep]), 0, atol=2e-15)


def test_compiled_combination_equals_plain_python():
    _q, seen = one_epoch(np.random.default_rng(6), 5)
    seen[0, 2] = np.nan
    seen[:, 3] = np.nan
    run = getattr(cameras._combine, "py_func", cameras._combine)
    out = cameras.combine(np.arange(5.0), seen, QSA, SIGMA, 9.0)
    inverses = np.full((8, 3, 3), np.nan)
    information = cameras.camera_information(QSA, SIGMA, 9.0)
    for mask in range(1, 8):
        inverses[mask] = np.linalg.inv(sum(information[i] for i in range(3) if mask >> i & 1))
    plain, cov, used = np.empty((5, 4)), np.empty((5, 3, 3)), np.empty(5, int)
    run(seen, information, inverses, np.ones(3, bool), plain, cov, used)
    np.testing.assert_allclose(difference(plain, out.q)[[0, 1, 2, 4]], 0, atol=2e-15)
    np.testing.assert_array_equal(used, out.used)


def turning(t):
    return multiply(exp(np.array([0.1, 0.2, 0.3])), exp(np.stack([0 * t, 1.1e-3 * t, 0 * t], axis=1)))


def test_whole_seconds_by_samples_or_spline_but_not_over_long_gaps():
    """Bad input 5: no quaternion is interpolated over more than 5 s."""
    cov = np.tile(np.eye(3) * 1e-10, (200, 1, 1))
    t = np.arange(200) / 2
    exact = cameras.at_seconds(cameras.Combined(t, turning(t), cov, np.full(200, 7)))
    np.testing.assert_array_equal(exact.q, turning(t)[::2])
    t = t + 0.2
    q = turning(t)
    q[40:48] = np.nan  # 4 s
    q[100:130] = np.nan  # 15 s
    out = cameras.at_seconds(cameras.Combined(t, q, cov, np.full(200, 7)))
    lost = out.t[np.isnan(out.q[:, 0])]
    assert lost.min() > 49.5 and lost.max() < 65.5 and len(lost) == 16
    good = np.isfinite(out.q[:, 0])
    assert np.abs(difference(out.q[good], turning(out.t[good]))).max() < 1e-8
    assert (out.used[~good] == 0).all()


def test_mounting_errors_are_found_but_for_what_all_share():
    rng = np.random.default_rng(8)
    scenario = Scenario(duration_s=1200.0)
    motion = truth.fly(scenario, np.random.default_rng(1))["C"]
    t, q_camera = simulate.cameras(motion, scenario, np.random.default_rng(2))
    raw = simulate.Telemetry("C", 0, t, q_camera, QSA, None, None)
    clean = in_satellite_axes(raw)
    wrong = 1.5e-4 * rng.standard_normal((3, 3))
    off = np.stack([multiply(q, exp(e)) for q, e in zip(clean, wrong, strict=True)])
    _, none = cameras.calibrate_mounting(t, clean, QSA, SIGMA, 9.0)
    _, taken = cameras.calibrate_mounting(t, off, QSA, SIGMA, 9.0)
    relative = taken - none - wrong
    together = np.isfinite(clean).all(axis=(0, 2)).sum()
    assert np.abs(relative - relative.mean(axis=0)).max() < 5e-7 + 9 * SIGMA / np.sqrt(together)
    with pytest.raises(ValueError, match="never see together"):
        off[0] = np.nan
        cameras.calibrate_mounting(t, off, QSA, SIGMA, 9.0)


def test_calibration_repairs_the_filter(tuning):
    """E12 on two short flights: the innovations come back to one."""
    table = experiment.mounting(Scenario(duration_s=5400.0, mount_err_rad=1.5e-4), tuning, 2, 3)
    assert table["before.nis3"][0] > 1.2
    assert table["after.nis3"][0] == pytest.approx(1.0, abs=0.03)
    for axis, value in zip(AXES, (1.7e-6, 1.8e-6, 1.8e-6), strict=True):
        assert table[f"after.std.{axis}"][0] == pytest.approx(value, abs=0.25e-6)


def test_dropouts_flips_and_the_sun_blind_cameras(hours):
    q = hours.raw["C"].q_camera
    valid = np.isfinite(q[..., 0]).mean(axis=1)
    assert 0.7 < valid[0] < 1.0 and valid[1] > 0.9 and valid[2] > 0.9
    dots = np.einsum("cki,cki->ck", q[:, 1:], q[:, :-1])
    assert (dots[np.isfinite(dots)] < -0.9).any()


def test_cameras_that_are_off_see_nothing_and_a_gap_silences_all():
    scenario = Scenario(duration_s=120.0, cameras_off=(2,), gap_s=30.0, gap_start_s=40.0)
    motion = truth.fly(scenario, np.random.default_rng(1))["C"]
    t, q = simulate.cameras(motion, scenario, np.random.default_rng(2))
    assert np.isnan(q[1]).all()
    assert np.isnan(q[:, (t >= 40) & (t < 70)]).all()
    with pytest.raises(ValueError, match="multiple of 0.125 s"):
        simulate.cameras(motion, Scenario(duration_s=120.0, shift_s=0.1), np.random.default_rng(2))


def test_angles_of_cameras_need_all_three(hours, tuning):
    out = camera_angles(hours, "C", Tuning(), [(1,), (1, 2, 3)])
    np.testing.assert_array_equal(np.isnan(out["sca1"]), np.isnan(out["sca123"]))
    assert np.nanstd(out["sca1"][:, 2]) > np.nanstd(out["sca123"][:, 2])
