"""What could move products apart: signatures against brute force."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from geokalman.attitude import cameras, experiment, hypotheses, pointing
from geokalman.attitude.experiment import angles_of
from geokalman.attitude.model import QSA, Scenario
from geokalman.constants import C_LIGHT
from geokalman.physics.quaternion import conjugate, difference, exp, from_matrix, matrix, multiply


def test_weights_of_turned_cameras(tuning):
    """The linear formula against the combination itself."""
    turns = 1e-4 * np.random.default_rng(1).standard_normal((3, 3))
    q = np.stack([exp(turn)[None] for turn in turns])
    for use, expected in zip(hypotheses.USES, hypotheses.combined(turns, QSA, tuning), strict=True):
        found = cameras.combine(np.zeros(1), q, QSA, tuning.sigma, tuning.k_aniso, use).q[0]
        np.testing.assert_allclose(difference(np.array([1.0, 0, 0, 0]), found), expected, atol=2e-8)


def test_one_late_camera_is_a_turned_one(hours, tuning):
    """Half a second of the orbit's rotation about the pitch axis, by the weights."""
    raw = hours.raw["C"]
    for camera in (1, 2, 3):
        turns = np.zeros((3, 3))
        turns[camera - 1, 1] = 0.5 * 1.1077e-3
        expected = np.ptp(hypotheses.combined(turns, raw.q_qsa, tuning), axis=0)
        np.testing.assert_allclose(hypotheses.spread(hypotheses.late(raw, [camera]), tuning), expected, rtol=0.02)
    together = hypotheses.late(raw, [1, 2, 3])
    assert hypotheses.spread(together, tuning).max() < 2e-6
    assert np.isnan(together.q_camera[:, 0]).all()


def test_all_late_cameras_are_a_shifted_flight(hours, tuning):
    """The simulation with a shift draws the same noise, so that the combinations differ by the shift alone."""
    shifted = experiment.flight(replace(Scenario(duration_s=7200.0), shift_s=0.5), 1)
    one = cameras.combination(hypotheses.late(hours.raw["C"], [1, 2, 3]), tuning).q
    other = cameras.combination(shifted.raw["C"], tuning).q
    assert np.abs(np.nanmean(difference(one, other), axis=0)).max() < 2e-6


def test_the_antenna_frame(hours):
    q = hours.true_attitude("C")
    apart = angles_of(hours, "C", q, pointing.antenna_frame("C")) - angles_of(hours, "C", q)
    np.testing.assert_allclose(apart.mean(axis=0), hypotheses.antenna_offset("C"), atol=2e-8)


def test_aberration_of_a_field_of_stars():
    """Stars around the boresight, moved by the velocity, and the attitude that fits them to their catalogue."""
    rng = np.random.default_rng(2)
    q = exp(rng.standard_normal(3))
    v = np.array([3000.0, -6000.0, 2000.0])
    turns = hypotheses.aberration(q[None], v[None], QSA)[0]
    for camera in range(3):
        to_inertial = matrix(multiply(q, conjugate(QSA[camera])))
        stars = np.concatenate([0.05 * rng.standard_normal((4000, 2)), np.ones((4000, 1))], axis=1)
        stars = np.concatenate([stars, stars * [-1, -1, 1]])
        stars /= np.linalg.norm(stars, axis=1, keepdims=True)  # as seen, in the camera
        seen = stars @ to_inertial.T
        across = v / C_LIGHT - (seen @ v / C_LIGHT)[:, None] * seen
        catalogue = seen - across
        u, _, w = np.linalg.svd(catalogue.T @ stars)  # camera to inertial, by Wahba's problem
        fitted = u @ np.diag([1, 1, np.linalg.det(u @ w)]) @ w
        reported = multiply(from_matrix(fitted), QSA[camera])
        np.testing.assert_allclose(difference(q, reported), turns[camera], atol=3e-7)


def test_the_earth_moves_across_the_sun():
    from geokalman.attitude.model import SUN

    v = hypotheses.earth_velocity()
    assert np.linalg.norm(v) == pytest.approx(30.29e3) and abs(v @ SUN) < 1e-9 * 30.29e3
    assert v[0] < 0 and v[1] < 0  # on 1 January the Earth stands near +y of the ecliptic, and moves towards -x


def test_the_common_frame_without_noise_is_exact(hours):
    clean = experiment.flight(replace(Scenario(duration_s=120.0), sca_sigma_arcsec=1e-9), 1).raw["C"]
    q = experiment.flight(replace(Scenario(duration_s=120.0), sca_sigma_arcsec=1e-9), 1).truth["C"].at(2, 120.0).q
    for pair in ((1, 2), (1, 3), (2, 3)):
        R = hypotheses.common_frame(clean, pair)
        good = np.isfinite(R).all(axis=(1, 2))
        assert good.any()
        np.testing.assert_allclose(R[good], matrix(q)[good], atol=1e-12)


def test_mounting_errors_by_draws(tuning):
    """A seventh of 150 microradians would be an average; weights of a few leave more."""
    signature = hypotheses.mounted(QSA, tuning, 1.5e-4)
    assert signature.spread[1] == pytest.approx(1.9e-4, rel=0.15)
    assert (signature.offset > 5e-5).all() and (signature.offset < 1.5e-4).all()


def test_signatures_name_every_hypothesis(hours, solved, tuning):
    found = hypotheses.signatures(hours.raw["C"], hours.true_attitude("C"), hours.v["C"], tuning)
    assert list(found) == [
        "late1", "late2", "late3", "late123", "antenna", "antenna_twice", "orbital", "annual", "mounting",
    ]  # fmt: skip
    assert abs(found["late123"].offset[1]) == pytest.approx(5.54e-4, rel=0.01)
    assert np.abs(found["orbital"].offset).max() < 26e-6
