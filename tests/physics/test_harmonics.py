"""Legendre functions, synthesis, spectra and smoothing against closed forms, quadrature, Parseval and pyharm."""

import numba
import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss

from geokalman.physics.harmonics import (
    area_rms,
    cell_centred_grid,
    degree_amplitude,
    degree_variance,
    error_degree_variance,
    gaussian_weights,
    geoid_difference,
    legendre,
    load_field,
    synthesis,
    synthesis_points,
)
from geokalman.physics.sphere import N_MAX_VALID


def random_coefficients(n_max, seed, power=2.0):
    """Coefficients of all degrees from 0 with a falling spectrum."""
    rng = np.random.default_rng(seed)
    fall = (1.0 + np.arange(n_max + 1.0))[:, None] ** -power
    C, S = (np.tril(rng.standard_normal((n_max + 1, n_max + 1))) * fall for _ in range(2))
    S[:, 0] = 0.0
    return C, S


def test_low_degrees_in_closed_form():
    lat = np.radians([-90.0, -89.0, -33.3, 0.0, 12.5, 60.0, 90.0])
    t, u = np.sin(lat), np.cos(lat)
    P = legendre(4, lat)
    closed = {
        (0, 0): np.ones_like(t),
        (1, 0): np.sqrt(3) * t,
        (1, 1): np.sqrt(3) * u,
        (2, 0): np.sqrt(5) / 2 * (3 * t**2 - 1),
        (2, 1): np.sqrt(15) * t * u,
        (2, 2): np.sqrt(15) / 2 * u**2,
        (3, 0): np.sqrt(7) / 2 * (5 * t**3 - 3 * t),
        (3, 1): np.sqrt(42) / 4 * u * (5 * t**2 - 1),
        (3, 2): np.sqrt(105) / 2 * t * u**2,
        (3, 3): np.sqrt(70) / 4 * u**3,
        (4, 4): np.sqrt(315) / 8 * u**4,
    }
    for (n, m), value in closed.items():
        np.testing.assert_allclose(P[:, n, m], value, rtol=0, atol=2e-15 * np.sqrt(2 * n + 1))
    assert np.all(P[:, 2, 3:] == 0.0)


@pytest.fixture(scope="module")
def gauss_360():
    """Nodes that integrate P_nm P_km exactly, a polynomial of degree n + k <= 720 in t, weights, and the functions."""
    t, w = leggauss(361)
    return w, legendre(360, np.arcsin(t))


@pytest.mark.parametrize("m", [0, 1, 60, 200, 359])
def test_legendre_functions_are_orthonormal_to_degree_360(gauss_360, m):
    w, P = gauss_360
    P = P[:, m:, m]
    gram = 0.5 * (P * w[:, None]).T @ P / (2.0 if m else 1.0)  # mean over longitude of cos^2 is 1/2
    np.testing.assert_allclose(gram, np.eye(361 - m), atol=2e-12)


@pytest.mark.parametrize(
    "n",
    [
        10,
        360,
        pytest.param(2190, marks=pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="minutes uncompiled")),
    ],
)
def test_addition_theorem_up_to_the_highest_degree(n):
    # sum_m P_nm^2 = 2 n + 1 everywhere, near a pole as well
    lat = np.radians([37.0, 89.9, 90.0])
    P = legendre(n, lat)[:, n]
    np.testing.assert_allclose(
        np.sum(P**2, axis=1), 2 * n + 1, rtol=1e-14 + 2e-16 * n**2
    )  # rounding grows as n^2 at a pole


@pytest.mark.parametrize("n_max", [2, 70, 360])
def test_synthesis_agrees_with_pyharm(n_max):
    pyharm = pytest.importorskip("pyharm")
    field = load_field("EGM96", n_max)
    C, S = field.C.copy(), field.S
    C[0, 0] = C[2, 0] = 0.0  # the large terms would hide the small ones
    lat, lon = cell_centred_grid(5.0 if n_max < 360 else 0.5)
    lat = lat[:: max(1, lat.size // 36)].copy()  # pyharm wants contiguous memory
    m, n = np.triu_indices(n_max + 1)
    peer = pyharm.shc.Shc.from_arrays(n_max, C[n, m], S[n, m], 1.0, 1.0)
    wanted = pyharm.shs.point(pyharm.crd.PointGrid.from_arrays(lat, lon, np.ones(lat.size)), peer, n_max)
    # the peer's rounding grows along a parallel, that of both as n^2 at a pole
    limit = (8 * lon.size + n_max**2) * np.finfo(float).eps
    np.testing.assert_allclose(synthesis(C, S, lat, lon), wanted, rtol=0, atol=limit * np.abs(wanted).max())


def test_scattered_points_off_the_sphere_agree_with_pyharm(monkeypatch):
    pyharm = pytest.importorskip("pyharm")
    monkeypatch.setattr("geokalman.physics.sphere._POINTS_AT_ONCE", 64)
    rng = np.random.default_rng(8)
    field = load_field("EGM96", 120)
    lat, lon = np.arcsin(rng.uniform(-1, 1, 150)), rng.uniform(-7, 7, 150)
    q = rng.uniform(0.9, 1.001, 150)
    m, n = np.triu_indices(121)
    peer = pyharm.shc.Shc.from_arrays(120, field.C[n, m], field.S[n, m], 1.0, 1.0)
    wanted = (
        pyharm.shs.point(pyharm.crd.PointSctr.from_arrays(lat, lon, 1.0 / q), peer, 120) / q
    )  # it has 1/r before it
    np.testing.assert_allclose(synthesis_points(field.C, field.S, lat, lon, q=q), wanted, rtol=1e-12)


@pytest.mark.parametrize(
    "lon",
    [
        np.radians(np.arange(0.0, 360.0, 9.0)),  # 40 > 2 N: FFT
        np.radians(np.arange(-175.0, 185.0, 10.0)),  # 36 = 2 N: FFT with the Nyquist order
        np.radians(np.arange(0.0, 360.0, 10.0) + 3.7),
        np.radians(np.arange(0.0, 360.0, 15.0)),  # 24 < 2 N: matrix product
        np.radians([3.0, -8.0, 400.0]),  # anywhere
    ],
)
def test_every_way_along_the_parallels_gives_the_same_sum(lon):
    C, S = random_coefficients(18, 4)
    lat = np.radians([-71.0, -20.0, 0.0, 20.0, 33.0])  # one pair of parallels, the others alone
    q = np.array([1.0, 0.97, 1.0, 0.97, 0.9])
    P = legendre(18, lat) * q[:, None, None] ** np.arange(19)[:, None]
    angle = np.arange(19)[:, None] * lon
    wanted = np.einsum("inm,nm,mj->ij", P, C, np.cos(angle)) + np.einsum("inm,nm,mj->ij", P, S, np.sin(angle))
    np.testing.assert_allclose(synthesis(C, S, lat, lon, q=q), wanted, atol=1e-13)
    points = synthesis_points(C, S, np.repeat(lat, lon.size), np.tile(lon, lat.size), q=np.repeat(q, lon.size))
    np.testing.assert_allclose(points.reshape(lat.size, lon.size), wanted, atol=1e-13)


def test_orders_left_out_near_the_poles_do_not_matter():
    n_max = 360
    C, S = random_coefficients(n_max, 6, power=0.0)  # a white spectrum: the hardest case
    lat, lon = np.radians([89.75, 88.25, 80.25, -89.75]), np.radians([0.0, 77.0])
    P = legendre(n_max, lat)  # leaves nothing out
    angle = np.arange(n_max + 1)[:, None] * lon
    wanted = np.einsum("inm,nm,mj->ij", P, C, np.cos(angle)) + np.einsum("inm,nm,mj->ij", P, S, np.sin(angle))
    # the peer's rounding grows along a parallel, that of both as n^2 at a pole
    limit = (8 * lon.size + n_max**2) * np.finfo(float).eps
    np.testing.assert_allclose(synthesis(C, S, lat, lon), wanted, rtol=0, atol=limit * np.abs(wanted).max())


@pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="minutes without compilation")
def test_highest_degree_stays_finite_and_right():
    # one sectorial pair of the highest degree: f = P_NN(sin phi) cos N lambda, P_NN in logarithms
    n = N_MAX_VALID
    C, S = np.zeros((n + 1, n + 1)), np.zeros((n + 1, n + 1))
    C[n, n] = 1.0
    k = np.arange(2, n + 1)
    log_seed = 0.5 * np.log(3.0) + 0.5 * np.sum(np.log1p(1.0 / (2.0 * k)))
    lat = np.radians([5.0, 20.0])
    wanted = np.exp(log_seed + n * np.log(np.cos(lat)))
    np.testing.assert_allclose(synthesis(C, S, lat, [0.0])[:, 0], wanted, rtol=1e-11, atol=1e-15)  # 7e-59 is left out


def test_parseval():
    # the mean of f^2 over the sphere is the sum of the degree variances; 61 Gauss latitudes make it exact
    C, S = random_coefficients(60, 2, power=1.0)
    t, w = leggauss(61)
    grid = synthesis(C, S, np.arcsin(t), np.arange(122) * 2 * np.pi / 122)
    assert 0.5 * w @ np.mean(grid**2, axis=1) == pytest.approx(degree_variance(C, S).sum(), rel=1e-13)
    lat, lon = cell_centred_grid(0.5)
    assert area_rms(synthesis(C, S, lat, lon), lat) ** 2 == pytest.approx(degree_variance(C, S).sum(), rel=1e-5)


def test_weights_multiply_degree_by_degree():
    C, S = random_coefficients(20, 3)
    w = np.random.default_rng(1).random(21)
    lat, lon = cell_centred_grid(10.0)
    np.testing.assert_array_equal(
        synthesis(C, S, lat, lon, weights=w), synthesis(C * w[:, None], S * w[:, None], lat, lon)
    )


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: synthesis(np.eye(3), np.eye(4), [0.0], [0.0]), r"C \(3, 3\) and S \(4, 4\) must both be"),
        (lambda: synthesis(np.eye(3), np.eye(3), [1.6], [0.0]), "Latitude 1.6 rad is outside"),
        (lambda: synthesis(np.eye(3), np.eye(3), [np.nan], [0.0]), "Latitude nan rad is outside"),
        (lambda: synthesis(np.eye(3), np.eye(3), [0.0], [0.0], weights=[1.0]), r"weights has shape \(1,\)"),
        (lambda: synthesis(*[np.broadcast_to(0.0, (2192, 2192))] * 2, [0.0], [0.0]), "Degree 2191 exceeds 2190"),
        (lambda: degree_variance(np.eye(3), np.ones(3)), r"must both be \(..., N\+1, N\+1\)"),
        (lambda: cell_centred_grid(0.7), "A cell of 0.7 deg does not tile the sphere"),
        (lambda: cell_centred_grid(0.0), "A cell of 0.0 deg does not tile"),
        (lambda: area_rms(np.ones((3, 4)), [0.0]), "1 latitudes do not fit a grid of 3 rows"),
        (lambda: area_rms(np.ones(3)), r"shape \(n_lat, n_lon\), not \(3,\)"),
        (lambda: gaussian_weights(5, -1.0), "Gaussian radius -1.0 km is outside"),
        (lambda: gaussian_weights(5, np.nan), "Gaussian radius nan km is outside"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_refused(call, says):
    with pytest.raises(ValueError, match=says):
        call()


def test_cell_centred_grid():
    lat, lon = cell_centred_grid(0.5)
    assert lat.shape == (360,) and lon.shape == (720,)
    np.testing.assert_allclose(np.degrees(lat[[0, 1, -1]]), [-89.75, -89.25, 89.75], rtol=2e-15)
    np.testing.assert_allclose(np.degrees(lon[[0, -1]]), [0.25, 359.75], rtol=2e-15)
    assert np.array_equal(lat, -lat[::-1])


def test_area_rms_weighs_by_area():
    lat, _ = cell_centred_grid(1.0)
    grid = np.repeat(np.sin(lat)[:, None], 360, axis=1)
    assert area_rms(grid) == pytest.approx(np.sqrt(1.0 / 3.0), rel=1e-4)  # midpoint rule at 1 deg
    assert area_rms(np.full((4, 8), -3.0)) == pytest.approx(3.0, rel=2e-15)


@pytest.mark.parametrize("radius_km", [200.0, 300.0, 500.0, 2000.0, 9000.0])
def test_gaussian_weights_are_the_spectrum_of_the_gaussian(radius_km):
    # W_n = integral of exp(-b (1 - cos psi)) P_n(cos psi), over that of n = 0, by quadrature in x = cos psi
    n_max = 150
    weights = gaussian_weights(n_max, radius_km)
    b = np.log(2.0) / (1.0 - np.cos(radius_km / 6371.0))
    x, w = leggauss(2000)
    kernel = w * np.exp(-b * (1.0 - x))
    wanted = np.polynomial.legendre.legvander(x, n_max).T @ kernel / kernel.sum()
    assert weights[0] == 1.0 and np.all(np.diff(weights) <= 0.0) and np.all(weights >= 0.0)
    keep = weights > 0.0
    np.testing.assert_allclose(
        weights[keep], wanted[keep], rtol=0, atol=3e-9
    )  # eps times the growth of the other solution, 1e7 at the cut
    assert np.all(wanted[~keep] < 1.1e-7)


def test_gaussian_weights_at_the_borders():
    np.testing.assert_array_equal(gaussian_weights(7, 0.0), np.ones(8))
    assert gaussian_weights(0, 500.0).tolist() == [1.0]
    assert gaussian_weights(1, 500.0)[1] == pytest.approx(0.9955594, abs=1e-7)


def test_kernel_falls_to_one_half_at_the_radius():
    # the smoothed delta function at distance psi is sum W_n (2n+1) P_n(cos psi)
    weights = gaussian_weights(200, 800.0) * (2 * np.arange(201) + 1)
    kernel = np.polynomial.legendre.legval(np.cos([0.0, 800.0 / 6371.0]), weights)
    assert kernel[1] / kernel[0] == pytest.approx(0.5, rel=1e-6)


def test_geoid_difference_of_one_zonal_in_closed_form():
    dC, dS = np.zeros((8, 8)), np.zeros((8, 8))
    dC[2, 0] = 1e-9
    grid = geoid_difference(dC, dS, 6378136.3, 1.0, 500.0)
    lat, _ = cell_centred_grid(1.0)
    wanted = 6378136.3 * 1e-9 * gaussian_weights(7, 500.0)[2] * np.sqrt(5) / 2 * (3 * np.sin(lat) ** 2 - 1)
    assert grid.shape == (180, 360)
    np.testing.assert_allclose(
        grid, np.repeat(wanted[:, None], 360, axis=1), rtol=0, atol=8 * np.spacing(np.abs(wanted).max())
    )


def test_geoid_rms_of_jgm3_against_egm96_is_that_of_the_specification():
    # section 9.1: a-priori geoid error 0.224 m at degree 30, 0.121 m at degree 20
    for n_max, printed in ((30, 0.224), (20, 0.121)):
        egm96, jgm3 = load_field("EGM96", n_max), load_field("JGM3", n_max)
        grid = geoid_difference(egm96.C - jgm3.C, egm96.S - jgm3.S, egm96.radius)
        assert area_rms(grid) == pytest.approx(printed, rel=0.01)


def test_degree_amplitudes_of_egm96_are_those_of_the_specification():
    egm96 = load_field("EGM96", 70)
    amplitude = degree_amplitude(degree_variance(egm96.C, egm96.S), egm96.radius)
    for n, metres in {2: 3088.12, 10: 2.26684, 20: 0.60503, 40: 0.27893, 60: 0.19724, 70: 0.14971}.items():
        assert amplitude[n] == pytest.approx(metres, rel=2e-5)


def test_degree_variance_of_a_stack_and_of_errors():
    C, S = random_coefficients(6, 9)
    stacked = degree_variance(np.stack([C, 2 * C]), np.stack([S, 2 * S]))
    wanted = np.array([sum(C[n, m] ** 2 + S[n, m] ** 2 for m in range(n + 1)) for n in range(7)])
    np.testing.assert_allclose(stacked, [wanted, 4 * wanted], rtol=1e-14)
    np.testing.assert_array_equal(error_degree_variance(C, S), stacked[0])
