"""Gravity gradient tensor against closed form, pyharm, and differences of the acceleration."""

import numpy as np
import pytest

from geokalman.physics.gradient import derivative, gradient_point, gradient_tensor, pack_gradient
from geokalman.physics.gravity import acceleration, potential
from geokalman.physics.harmonics import GravityField, load_field


@pytest.fixture(scope="module")
def egm96():
    return load_field("EGM96", 70)


def on_sphere(count, seed, radius=6834e3):
    r = np.random.default_rng(seed).standard_normal((count, 3))
    return radius * r / np.linalg.norm(r, axis=1)[:, None]


def test_point_mass_in_closed_form(egm96):
    r = on_sphere(10, 1)
    d = np.linalg.norm(r, axis=1)[:, None, None]
    exact = egm96.gm / d**3 * (3 * r[:, :, None] * r[:, None, :] / d**2 - np.eye(3))
    np.testing.assert_allclose(gradient_tensor(egm96, r, 0), exact, rtol=0, atol=8 * np.spacing(np.abs(exact).max()))


def test_differences_of_the_acceleration(egm96):
    r, h = np.concatenate([on_sphere(20, 2), [[0, 0, 6834e3]]]), 1000.0
    G = gradient_tensor(egm96, r)
    limit = 8 * 2 * np.spacing(np.abs(acceleration(egm96, r)).max()) / h  # rounding of two accelerations over h
    for j, d in enumerate(h * np.eye(3)):
        odd = [acceleration(egm96, r + k * d) - acceleration(egm96, r - k * d) for k in (1, 2, 3, 4)]
        column = (odd[0] * 4 / 5 - odd[1] / 5 + odd[2] * 4 / 105 - odd[3] / 280) / h
        np.testing.assert_allclose(G[..., j], column, rtol=0, atol=limit)


def test_zz_is_what_laplace_says(egm96):
    """zz is not summed but follows from the trace: sum it here, by the derivative of the derivative."""
    r = on_sphere(5, 3)
    G = gradient_tensor(egm96, r, 20)
    C, S = derivative(*derivative(egm96.C[:21, :21], egm96.S[:21, :21], 2), 2)
    C[0, 0] = 1.0  # a field has C00 = 1: take its potential off again
    series = GravityField("zz", egm96.gm / egm96.radius**2, egm96.radius, C, S)
    np.testing.assert_allclose(potential(series, r) - potential(series, r, 0), G[:, 2, 2], rtol=1e-12)
    np.testing.assert_allclose(np.trace(G, axis1=1, axis2=2), 0.0, atol=1e-21)
    np.testing.assert_array_equal(G, np.swapaxes(G, 1, 2))


def test_equals_pyharm(egm96):
    pyharm = pytest.importorskip("pyharm")
    r = on_sphere(50, 4)
    lat, lon = np.arctan2(r[:, 2], np.hypot(r[:, 0], r[:, 1])), np.arctan2(r[:, 1], r[:, 0])
    c = np.concatenate([egm96.C[m:, m] for m in range(71)])
    s = np.concatenate([egm96.S[m:, m] for m in range(71)])
    coefficients = pyharm.shc.Shc.from_arrays(70, c, s, mu=egm96.gm, r=egm96.radius)
    points = pyharm.crd.PointSctr.from_arrays(lat, lon, np.linalg.norm(r, axis=1))
    xx, xy, xz, yy, yz, zz = pyharm.shs.point_grad2(points, coefficients, 70)
    theirs = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).transpose(2, 0, 1)
    north = np.stack([-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)], axis=1)
    west = np.stack([np.sin(lon), -np.cos(lon), 0 * lon], axis=1)
    up = np.stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)], axis=1)
    R = np.stack([north, west, up], axis=1)  # R_lnof_ecef
    np.testing.assert_allclose(R @ gradient_tensor(egm96, r) @ R.swapaxes(1, 2), theirs, rtol=0, atol=1e-19)


def test_compiled_equals_python(egm96):
    params, r = pack_gradient(egm96, 6), on_sphere(1, 5)[0]
    compiled, plain = np.empty((3, 3)), np.empty((3, 3))
    gradient_point(r, params, compiled)
    getattr(gradient_point, "py_func", gradient_point)(r, params, plain)
    np.testing.assert_allclose(compiled, plain, rtol=0, atol=2e-21)


def test_errors(egm96):
    with pytest.raises(ValueError, match="n_max = 71 is outside 0..70"):
        gradient_tensor(egm96, [7e6, 0, 0], 71)
    with pytest.raises(ValueError, match="position 0 is 1 m from the centre"):
        gradient_tensor(egm96, [1.0, 0, 0])
    C, S = np.zeros((2, 1000, 1000))
    C[0, 0] = 1
    with pytest.raises(ValueError, match="n_max = 999 is above 998"):
        pack_gradient(GravityField("long", 4e14, 6.4e6, C, S))
