"""Quaternions against scipy's Rotation, closed forms, and the compiled kernels against the arrays."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from geokalman.physics import quaternion as quat


@pytest.fixture
def rng():
    return np.random.default_rng(7)


def scipy_of(q):
    return Rotation.from_quat(np.roll(q, -1, axis=-1))


def random_quaternions(rng, n):
    return quat.normalise(rng.standard_normal((n, 4)))


def test_matrix_and_product_agree_with_scipy(rng):
    p, q = random_quaternions(rng, 50), random_quaternions(rng, 50)
    np.testing.assert_allclose(quat.matrix(p), scipy_of(p).as_matrix(), atol=1e-14)
    np.testing.assert_allclose(quat.matrix(quat.multiply(p, q)), quat.matrix(p) @ quat.matrix(q), atol=1e-14)
    v = rng.standard_normal((50, 3))
    np.testing.assert_allclose(quat.rotate(p, v), scipy_of(p).apply(v), atol=1e-13)


def test_units_multiply_as_hamilton_says():
    i, j, k = np.eye(4)[1:]
    np.testing.assert_array_equal(quat.multiply(i, j), k)
    np.testing.assert_array_equal(quat.multiply(j, i), -k)
    np.testing.assert_array_equal(quat.multiply(i, i), [-1, 0, 0, 0])


@pytest.mark.parametrize("size", [0.0, 1e-12, 1e-6, 1e-4, 0.1, 3.0, np.pi - 1e-9])
def test_exp_and_log_are_inverse(rng, size):
    v = rng.standard_normal((20, 3))
    v *= size / np.linalg.norm(v, axis=1, keepdims=True)
    np.testing.assert_allclose(quat.log(quat.exp(v)), v, rtol=1e-9, atol=2e-15)
    np.testing.assert_allclose(quat.log(-quat.exp(v)), v, rtol=1e-9, atol=2e-15)
    np.testing.assert_allclose(quat.matrix(quat.exp(v)), Rotation.from_rotvec(v).as_matrix(), atol=1e-14)


def test_from_matrix_gives_the_rotation_back_in_every_branch(rng):
    turns = [random_quaternions(rng, 200), np.eye(4), quat.normalise(np.eye(4) + 1e-3)]
    q = np.concatenate(turns)
    back = quat.from_matrix(quat.matrix(q))
    np.testing.assert_allclose(np.abs(np.einsum("ki,ki->k", q, back)), 1.0, atol=1e-14)


def test_kernels_agree_with_arrays(rng):
    p, q, v = random_quaternions(rng, 1)[0], random_quaternions(rng, 1)[0], 0.3 * rng.standard_normal(3)
    out, work, vec, R = np.empty(4), np.empty(4), np.empty(3), np.empty((3, 3))
    for compiled in (True, False):
        pick = (lambda f: f) if compiled else (lambda f: getattr(f, "py_func", f))
        pick(quat.multiply_point)(p, q, out)
        np.testing.assert_allclose(out, quat.multiply(p, q), atol=2e-15)
        pick(quat.exp_point)(v, out)
        np.testing.assert_allclose(out, quat.exp(v), atol=2e-15)
        for sign in (1.0, -1.0):
            pick(quat.log_point)(sign * p, vec)
            np.testing.assert_allclose(vec, quat.log(p), atol=1e-14)
        pick(quat.log_point)(np.array([1.0, 1e-12, 0.0, 0.0]), vec)
        np.testing.assert_allclose(vec, [2e-12, 0, 0], atol=1e-24)
        pick(quat.matrix_point)(p, R)
        np.testing.assert_allclose(R, quat.matrix(p), atol=2e-15)
    quat.difference_point(p, q, work, vec)
    np.testing.assert_allclose(vec, quat.difference(p, q), atol=1e-14)
    quat.retract_point(p, v, work, out)
    np.testing.assert_allclose(quat.difference(p, out), v, atol=1e-14)


def test_the_appendix_conjugate_is_the_inverse(rng):
    q = random_quaternions(rng, 5)
    np.testing.assert_allclose(quat.multiply(q, quat.conjugate(q)), np.tile([1.0, 0, 0, 0], (5, 1)), atol=2e-15)


def test_the_angle_of_a7_is_half_the_rotation():
    q = np.array([np.cos(0.3), 0.0, 0.0, np.sin(0.3)])
    np.testing.assert_allclose(quat.log(q), [0, 0, 0.6], atol=2e-15)


def test_signs_become_continuous_over_gaps_and_near_half_a_turn():
    """Near 180 degrees the scalar part changes sign by itself: only the dot product of all four components tells a
    flip."""
    angle = np.linspace(3.0, 3.3, 40)
    smooth = np.stack([np.cos(angle / 2), np.sin(angle / 2), 0 * angle, 0 * angle], axis=1)
    flipped = smooth.copy()
    flipped[[5, 6, 20, 33]] *= -1
    flipped[10:12] = np.nan
    out = quat.continuous(flipped)
    good = np.isfinite(out[:, 0])
    assert good.sum() == 38
    np.testing.assert_array_equal(out[good], smooth[good])


def test_zero_quaternions_are_refused():
    with pytest.raises(ValueError, match="zero or not finite"):
        quat.normalise(np.zeros(4))


def attitude(t):
    """A satellite turning once in 5668 s with a wobble of 0.01 Hz."""
    base = quat.exp(np.stack([0 * t, 1.1085e-3 * t, 0 * t], axis=1))
    return quat.multiply(base, quat.exp(np.stack([2e-4 * np.sin(0.06 * t), 0 * t, 1e-4 * np.cos(0.05 * t)], axis=1)))


@pytest.mark.parametrize(("offset", "method", "worst"), [(0.25, "spline", 2e-8), (0.25, "slerp", 4e-8)])
def test_interpolation_from_2_hz_stays_far_below_noise(offset, method, worst):
    """Section 3.3: the spline errs by up to 1.9e-8 rad (at its ends), turning uniformly by up to 4e-8."""
    t = np.arange(0, 600, 0.5) + offset
    at = np.arange(1.0, 599.0)
    error = quat.difference(getattr(quat, method)(t, attitude(t), at), attitude(at))
    assert np.abs(error).max() < worst
    if method == "spline":
        assert np.sqrt(np.mean(error[10:-10] ** 2)) < 3e-10


def test_a_spline_does_not_extrapolate():
    t = np.arange(10.0)
    with pytest.raises(ValueError, match="reach beyond"):
        quat.spline(t, attitude(t), np.array([9.5]))
