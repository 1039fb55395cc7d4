"""Potential and acceleration against a field in closed form, extended precision, pyharm and finite differences."""

import math

import numpy as np
import pytest

from geokalman.physics import gravity
from geokalman.physics.gravity import acceleration, acceleration_point, monic_factors, pack, potential, potential_point
from geokalman.physics.harmonics import GravityField, load_field

RADIUS_ORBIT = 6834e3


def normalised_legendre(n_max, t, u, dtype=np.float64):
    """Fully normalised P_nm by the forward column recursion of Holmes & Featherstone 2002, eqs 11 and 13."""
    t, u = dtype(t), dtype(u)
    P = np.zeros((n_max + 1, n_max + 1), dtype)
    P[0, 0] = 1
    for m in range(n_max + 1):
        if m > 0:
            P[m, m] = u * np.sqrt(dtype(2 * m + 1) / (2 * m) * (2 if m == 1 else 1)) * P[m - 1, m - 1]
        for n in range(m + 1, n_max + 1):
            a = np.sqrt(dtype((2 * n - 1) * (2 * n + 1)) / ((n - m) * (n + m)))
            P[n, m] = a * t * P[n - 1, m]
            if n > m + 1:
                b = np.sqrt(dtype((2 * n + 1) * (n + m - 1) * (n - m - 1)) / ((n - m) * (n + m) * (2 * n - 3)))
                P[n, m] -= b * P[n - 2, m]
    return P


def acceleration_enu(field, r, n_max, dtype=np.longdouble):
    """Equation (49): components east, north, up at one point, written out in extended precision, turned to x, y, z."""
    x, y, z = (dtype(v) for v in r)
    distance, across = np.sqrt(x * x + y * y + z * z), np.sqrt(x * x + y * y)
    t, u, lam = z / distance, across / distance, np.arctan2(y, x)
    P = normalised_legendre(n_max, t, u, dtype)
    east = north = up = dtype(0)
    for n in range(n_max, -1, -1):
        scale = (dtype(field.radius) / distance) ** n
        for m in range(n + 1):
            C, S = dtype(field.C[n, m]), dtype(field.S[n, m])
            cos, sin = np.cos(m * lam), np.sin(m * lam)
            f = np.sqrt(dtype((n * n - m * m) * (2 * n + 1)) / (2 * n - 1)) if n > m else dtype(0)
            slope = ((f * P[n - 1, m] if n > m else dtype(0)) - n * t * P[n, m]) / u
            east += scale * m * (S * cos - C * sin) * P[n, m] / u
            north += scale * (C * cos + S * sin) * slope
            up -= scale * (n + 1) * (C * cos + S * sin) * P[n, m]
    g = dtype(field.gm) / (distance * distance)
    e = np.array([-y / across, x / across, 0])
    nrth = np.array([-t * x / across, -t * y / across, u])
    return g * (east * e + north * nrth + up * np.array([x, y, z]) / distance)


def on_sphere(count, seed, radius=RADIUS_ORBIT):
    r = np.random.default_rng(seed).standard_normal((count, 3))
    return radius * r / np.linalg.norm(r, axis=1)[:, None]


@pytest.fixture(scope="module")
def egm96():
    return load_field("EGM96", 70)


@pytest.fixture(scope="module")
def four_masses():
    """Four equal masses on a turned tetrahedron (no degree 1) of a tenth of the radius: coefficients and masses."""
    gm, radius, n_max = 4e14, 6.4e6, 24
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / np.sqrt(3)
    a, b = 0.7, 0.4
    turn = np.array([[np.cos(a), np.sin(a), 0], [-np.sin(a), np.cos(a), 0], [0, 0, 1]])
    tilt = np.array([[1, 0, 0], [0, np.cos(b), np.sin(b)], [0, -np.sin(b), np.cos(b)]])
    unit = corners @ (turn @ tilt).T
    C, S = np.zeros((2, n_max + 1, n_max + 1))
    n = np.arange(n_max + 1)
    for x, y, z in unit:
        P, lam = normalised_legendre(n_max, z, np.hypot(x, y)), np.arctan2(y, x)
        weight = 0.25 * (0.1**n / (2 * n + 1))[:, None] * P
        C += weight * np.cos(n * lam)
        S += weight * np.sin(n * lam)
    C[0, 0], C[1], S[1] = 1.0, 0.0, 0.0  # zero up to rounding
    return GravityField("four masses", gm, radius, C, S), 0.1 * radius * unit


def test_closed_form_of_four_masses(four_masses):
    field, masses = four_masses
    axes = [[0, 0, 7e6], [0, 0, -7e6], [6.9e6, 0, 0], [0, -7e6, 0]]
    r = np.concatenate([on_sphere(40, 1, 1.05 * field.radius), axes])
    away = r[:, None, :] - masses
    distance = np.linalg.norm(away, axis=2)
    V = 0.25 * field.gm * (1 / distance).sum(axis=1)
    g = -0.25 * field.gm * (away / distance[..., None] ** 3).sum(axis=1)
    # degree 25 would add 0.1^25 of the whole: rounding alone is left
    np.testing.assert_allclose(potential(field, r), V, rtol=2e-15)
    np.testing.assert_allclose(acceleration(field, r), g, rtol=0, atol=2e-15 * np.abs(g).max() * 2)


@pytest.mark.skipif(np.finfo(np.longdouble).eps > 2e-19, reason="needs 80-bit long double for the reference")
def test_accuracy_against_extended_precision(egm96):
    r = on_sphere(12, 2)
    r[0] = [3.0, 4.0, 6834e3]  # 5 m beside the axis
    exact = np.array([acceleration_enu(egm96, x, 70) for x in r])
    assert np.abs(acceleration(egm96, r) - exact).max() < 8 * np.spacing(float(np.abs(exact).max()))


def test_equals_equation_49_at_low_degree(egm96):
    r = on_sphere(5, 3)
    for n_max in (0, 2, 3, 8):
        written_out = [acceleration_enu(egm96, x, n_max, np.float64) for x in r]
        np.testing.assert_allclose(acceleration(egm96, r, n_max), written_out, rtol=0, atol=2e-14)


def test_equals_pyharm(egm96):
    pyharm = pytest.importorskip("pyharm")
    r = on_sphere(300, 4)
    across = np.hypot(r[:, 0], r[:, 1])
    lat, lon = np.arctan2(r[:, 2], across), np.arctan2(r[:, 1], r[:, 0])
    c = np.concatenate([egm96.C[m:, m] for m in range(71)])
    s = np.concatenate([egm96.S[m:, m] for m in range(71)])
    coefficients = pyharm.shc.Shc.from_arrays(70, c, s, mu=egm96.gm, r=egm96.radius)
    points = pyharm.crd.PointSctr.from_arrays(lat, lon, np.linalg.norm(r, axis=1))
    north, west, up = pyharm.shs.point_grad1(points, coefficients, 70)
    e = np.stack([-np.sin(lon), np.cos(lon), 0 * lon], axis=1)
    n = np.stack([-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)], axis=1)
    u = np.stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)], axis=1)
    theirs = north[:, None] * n - west[:, None] * e + up[:, None] * u
    size = np.linalg.norm(theirs, axis=1, keepdims=True)
    assert (np.abs(acceleration(egm96, r) - theirs) / size).max() < 1e-14
    np.testing.assert_allclose(potential(egm96, r), pyharm.shs.point(points, coefficients, 70), rtol=1e-14)


def test_gradient_of_potential_by_central_differences(egm96):
    r, h = on_sphere(20, 5), 2000.0
    g = np.empty_like(r)
    for i, d in enumerate(h * np.eye(3)):
        odd = [potential(egm96, r + k * d) - potential(egm96, r - k * d) for k in (1, 2, 3, 4)]
        g[:, i] = (odd[0] * 4 / 5 - odd[1] / 5 + odd[2] * 4 / 105 - odd[3] / 280) / h
    limit = 8 * 2 * np.spacing(6e7) / h  # rounding of two potentials of 6e7 m^2/s^2 over h
    np.testing.assert_allclose(acceleration(egm96, r), g, rtol=0, atol=limit)


def test_poles_are_ordinary_points(egm96):
    for z in (6834e3, -6834e3):
        at = acceleration(egm96, [0.0, 0.0, z])
        around = [acceleration(egm96, [0.1 * np.cos(a), 0.1 * np.sin(a), z]) for a in np.arange(8) * np.pi / 4]
        np.testing.assert_allclose(at, np.mean(around, axis=0), rtol=0, atol=2e-14)
        assert np.abs(at[:2]).min() > 1e-7  # the pole has a deflection: order 1 is not lost there


def test_shapes_and_scalar_point(egm96):
    r = on_sphere(6, 6).reshape(2, 3, 3)
    g = acceleration(egm96, r)
    assert g.shape == (2, 3, 3) and potential(egm96, r).shape == (2, 3)
    np.testing.assert_array_equal(acceleration(egm96, r[1, 2]), g[1, 2])
    assert potential(egm96, r[0, 0]).shape == ()


def acceleration_one_order_at_a_time(field, r, n_max):
    """The kernel's recursion in its simplest form: one order after the other, in plain Python."""
    k, (x, y, z) = monic_factors(n_max), np.asarray(r) * field.radius / (r @ r)
    q = x * x + y * y + z * z
    h, weighted = np.zeros(3), 0.0
    zeta, below = 1.0 + 0.0j, 0.0j
    for m in range(n_max + 1):
        p, d = [1.0, 0.0], [0.0, 0.0]  # degrees n - 1 and n - 2
        for n in range(m, n_max + 1):
            if n > m:
                beta = ((n - 1) ** 2 - m * m) / (4 * (n - 1) ** 2 - 1)
                d = [p[0] + z * d[0] - beta * q * d[1], d[0]]
                p = [z * p[0] - beta * q * p[1], p[0]]
            if n > 0:
                c = k[n, m] * (field.C[n, m] - 1j * field.S[n, m])
                h += [(c * m * below * p[0]).real, (c * 1j * m * below * p[0]).real, (c * zeta * d[0]).real]
                weighted += (c * zeta * ((n + m + 1) * p[0] + z * d[0])).real
        below, zeta = zeta, zeta * (x + 1j * y)
    return field.gm / field.radius**2 * np.sqrt(q) * (q * h - np.array([x, y, z]) * (1.0 + weighted))


@pytest.mark.parametrize("n_max", [0, 2, 6, 7, 8, 9, 15, 16, 33, 70])
def test_eight_lanes_equal_one_order_at_a_time(egm96, n_max):
    """Degrees that fill the last block of eight orders, and that do not."""
    params = pack(egm96, n_max)
    for x in on_sphere(3, 7):
        out = np.empty(3)
        acceleration_point(x, params, out)
        limit = 8 * np.spacing(np.abs(out).max())
        np.testing.assert_allclose(out, acceleration_one_order_at_a_time(egm96, x, n_max), rtol=0, atol=limit)
        python = getattr(potential_point, "py_func", potential_point)(x, params)
        np.testing.assert_allclose(potential_point(x, params), python, rtol=8 * np.finfo(float).eps)


def test_degree_360_at_the_surface():
    field = load_field("EGM96", 360)
    r = on_sphere(3, 8, field.radius)
    np.testing.assert_allclose(acceleration(field, r), [acceleration_enu(field, x, 360) for x in r], rtol=0, atol=1e-13)


def test_highest_degree_stays_in_range():
    """At degree 1000 the folded normalisation is near 1e301 and still finite; one more order of growth would not be."""
    k = monic_factors(gravity.MAX_DEGREE)
    assert np.all(np.isfinite(k)) and 1e298 < k.max() < 1e304
    C, S = np.zeros((2, 1001, 1001))
    C[0, 0], C[1000, 0], C[1000, 500], S[1000, 1000] = 1.0, 1e-9, 1e-9, 1e-9
    field = GravityField("degree 1000", 4e14, 6.4e6, C, S)
    r = on_sphere(4, 9, 6.4e6)
    difference = acceleration(field, r) - acceleration(field, r, 0)
    assert np.all(np.isfinite(difference))
    for x, got in zip(r, difference, strict=True):
        expected = acceleration_of_degree_1000(field, x)
        np.testing.assert_allclose(got, expected, rtol=0, atol=1e-7 * np.abs(expected).max() + 1e-14)


def acceleration_of_degree_1000(field, x):
    """Gradient of the three terms of degree 1000 alone by an 8th-order difference of the written-out potential."""

    def one(m, t, u):
        P = math.sqrt(2.0 if m else 1.0) * math.prod(u * math.sqrt((2 * k + 1) / (2 * k)) for k in range(1, m + 1))
        below = 0.0
        for n in range(m + 1, 1001):
            a = math.sqrt((2 * n - 1) * (2 * n + 1) / ((n - m) * (n + m)))
            b = math.sqrt((2 * n + 1) * (n + m - 1) * (n - m - 1) / ((n - m) * (n + m) * (2 * n - 3)))
            P, below = a * t * P - b * below, P
        return P

    def V(p):
        distance, across = np.linalg.norm(p), np.hypot(p[0], p[1])
        t, u, lam = p[2] / distance, across / distance, np.arctan2(p[1], p[0])
        terms = one(0, t, u) + one(500, t, u) * np.cos(500 * lam) + one(1000, t, u) * np.sin(1000 * lam)
        return 1e-9 * field.gm / distance * (field.radius / distance) ** 1000 * terms

    h = 300.0
    weights = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}
    return np.array([sum(w * (V(x + k * d) - V(x - k * d)) for k, w in weights.items()) / h for d in h * np.eye(3)])


def test_errors_say_what_and_where(egm96):
    with pytest.raises(ValueError, match=r"position 1 is 1000 m from the centre, .* at least 0.9 of its radius"):
        acceleration(egm96, [[7e6, 0, 0], [0, 1000, 0]])
    with pytest.raises(ValueError, match="position 0 is nan m"):
        potential(egm96, [np.nan, 0, 7e6])
    with pytest.raises(ValueError, match=r"shape \(2,\), their last axis"):
        acceleration(egm96, [7e6, 0])
    with pytest.raises(ValueError, match=r"n_max = 71 is outside 0..70, the degrees of the field EGM96"):
        pack(egm96, 71)
    with pytest.raises(ValueError, match="n_max = -1 is outside"):
        acceleration(egm96, [7e6, 0, 0], -1)
    with pytest.raises(ValueError, match="degree 1001 is outside 0..1000"):
        monic_factors(1001)
    C, S = np.zeros((2, 1003, 1003))
    C[0, 0] = 1
    with pytest.raises(ValueError, match="n_max = 1002 is above 1000, .* truncate the field"):
        pack(GravityField("too long", 4e14, 6.4e6, C, S))
