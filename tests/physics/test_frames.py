"""Frames against scipy's rotations, derivatives and the definitions."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from geokalman.physics import frames

OMEGA = 7.292115e-5


def vectors(*shape):
    return np.random.default_rng(1).standard_normal((*shape, 3))


def test_rotation_z_turns_the_axes():
    """Turning the axes by +a is turning a vector by -a: scipy's active rotation, inverted."""
    angles = np.array([0.0, 0.3, -2.0, 7.0])
    expected = Rotation.from_euler("z", angles[:, None]).inv().as_matrix()
    np.testing.assert_allclose(frames.rotation_z(angles), expected, atol=2e-15)
    np.testing.assert_allclose(frames.rotation_z(np.pi / 2) @ [0, 1, 0], [1, 0, 0], atol=2e-15)


def test_a_fixed_station_moves_eastward_in_space():
    r = frames.to_eci(10.0, np.array([7e6, 0.0, 0.0]), OMEGA)
    assert r[1] > 0.0
    np.testing.assert_allclose(np.arctan2(r[1], r[0]), 10.0 * OMEGA, rtol=1e-14)


@pytest.mark.parametrize("shape", [(5,), (5, 2), (5, 2, 3)])
def test_to_ecef_is_the_matrix_and_to_eci_its_inverse(shape):
    t, v = np.linspace(0, 90000, 5), vectors(*shape)
    R_ecef_eci = frames.ecef_from_eci(t, OMEGA)
    expected = np.einsum("nij,n...j->n...i", R_ecef_eci, v)
    fixed = frames.to_ecef(t, v, OMEGA)
    np.testing.assert_allclose(fixed, expected, atol=2e-15)
    np.testing.assert_allclose(frames.to_eci(t, fixed, OMEGA), v, atol=2e-15)
    np.testing.assert_allclose(frames.to_ecef(t[2], v[2], OMEGA), fixed[2], atol=2e-15)


def test_velocity_is_the_derivative_of_the_fixed_position():
    t, h = 4000.0, 0.5
    r, v = np.array([5e6, 3e6, -3e6]), np.array([-3e3, 5e3, 4e3])
    position = {k: frames.to_ecef(t + k * h, r + k * h * v, OMEGA) for k in (-2, -1, 1, 2)}
    numeric = (8 * (position[1] - position[-1]) - (position[2] - position[-2])) / (12 * h)
    np.testing.assert_allclose(frames.velocity_to_ecef(t, r, v, OMEGA), numeric, atol=1e-8)


def test_spherical_coordinates():
    radius, lat, lon = frames.spherical(np.array([[0, 0, 2.0], [0, -3.0, 0], [1.0, 1.0, np.sqrt(2)]]))
    np.testing.assert_allclose(radius, [2, 3, 2])
    np.testing.assert_allclose(lat, [np.pi / 2, 0, np.pi / 4])
    np.testing.assert_allclose(lon, [0, -np.pi / 2, np.pi / 4])


def test_local_frame_follows_the_coordinates():
    r = np.array([[4e6, -3e6, 4.5e6], [-5e6, 1e6, -3e6]])
    R = frames.enu_from_ecef(r)
    np.testing.assert_allclose(R @ R.swapaxes(1, 2), np.broadcast_to(np.eye(3), (2, 3, 3)), atol=2e-15)
    np.testing.assert_allclose(np.linalg.det(R), 1.0)
    radius, lat, lon = frames.spherical(r)
    for row, step, moved in zip(range(3), (1.0, 1.0, 1.0), (lon, lat, radius), strict=True):
        ahead = frames.spherical(r + step * R[:, row])
        change = np.stack([ahead[2] - lon, ahead[1] - lat, ahead[0] - radius], axis=1)
        assert np.all(change[:, row] > 0), f"axis {row} must lead to larger {moved}"
        scaled = change * np.stack([radius * np.cos(lat), radius, np.ones(2)], axis=1)
        np.testing.assert_allclose(scaled[:, row], 1.0, rtol=1e-6)
        np.testing.assert_allclose(np.delete(scaled, row, axis=1), 0.0, atol=1e-6)


def test_local_frame_on_the_axis():
    R = frames.enu_from_ecef(np.array([0.0, 0.0, 7e6]))
    np.testing.assert_allclose(R, [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], atol=2e-15)


def test_errors():
    with pytest.raises(ValueError, match=r"vectors have shape \(4, 2\)"):
        frames.to_ecef(0.0, np.zeros((4, 2)), OMEGA)
    with pytest.raises(ValueError, match=r"times of shape \(3,\) do not fit vectors of shape \(4, 3\)"):
        frames.to_ecef(np.zeros(3), np.zeros((4, 3)), OMEGA)
