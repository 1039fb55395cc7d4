"""Level ellipsoids against their published derived constants; the geoid of EGM96 against NGA's test points."""

import math

import numpy as np
import pytest

from geokalman.physics.ellipsoid import GRS80, WGS84, Ellipsoid, geoid_height
from geokalman.physics.field import GravityField
from geokalman.physics.harmonics import load_field, synthesis_points


def test_derived_constants_of_grs80():
    # Moritz (2000), Geodetic Reference System 1980, J. Geodesy 74, 128-133
    assert GRS80.j2 == pytest.approx(108263e-8, rel=1e-10)  # defining; f is derived from it and rounded
    assert GRS80.b == pytest.approx(6356752.3141, abs=5e-5)
    assert GRS80.e2 == pytest.approx(0.00669438002290, abs=1e-14)
    assert GRS80.gravity_equator == pytest.approx(9.7803267715, abs=6e-11)
    assert GRS80.gravity_pole == pytest.approx(9.8321863685, abs=6e-11)
    J = -GRS80.even_zonals(8)[[4, 6, 8]] * np.sqrt([9, 13, 17])
    np.testing.assert_allclose(J, [-0.00000237091222, 0.00000000608347, -0.00000000001427], rtol=0, atol=6e-15)


def test_derived_constants_of_wgs84():
    # NIMA TR8350.2, third edition, table 3.4, amendment 1
    assert WGS84.even_zonals(2)[2] == pytest.approx(-0.484166774985e-3, abs=5e-14)
    assert WGS84.gravity_equator == pytest.approx(9.7803253359, abs=6e-11)
    assert WGS84.gravity_pole == pytest.approx(9.8321849379, abs=1.1e-10)


def test_normal_gravity_is_somigliana_and_normal_to_a_level_surface():
    lat = np.radians([-90.0, -45.0, 0.0, 30.0, 90.0])
    gravity = WGS84.gravity(lat)
    np.testing.assert_allclose(gravity[[0, 2, 4]], [WGS84.gravity_pole, WGS84.gravity_equator, WGS84.gravity_pole])
    # the normal potential plus the centrifugal one is constant on the ellipsoid
    geocentric, r = WGS84.geocentric(lat)
    C = np.diag(np.zeros(21))
    C[:, 0] = WGS84.even_zonals(20)
    V = WGS84.gm / r * synthesis_points(C, 0 * C, geocentric, 0.0, q=WGS84.a / r)
    W = V + 0.5 * WGS84.omega**2 * (r * np.cos(geocentric)) ** 2
    np.testing.assert_allclose(W, 62636851.7146, rtol=0, atol=1e-4)  # U_0 of TR8350.2


def test_geocentric_coordinates_at_equator_and_pole():
    lat, r = GRS80.geocentric(np.radians([0.0, 90.0, -45.0]))
    np.testing.assert_allclose(r[:2], [GRS80.a, GRS80.b], rtol=2e-15)
    assert math.tan(lat[2]) == pytest.approx(-(1 - GRS80.e2), rel=1e-14)


NGA = [  # latitude, longitude [deg], geoid height [m] of NGA's program, what plain synthesis - 0.53 m differs by [m]
    (38.628155, 269.779155, -31.628, 0.003),
    (-14.621217, 305.021114, -2.969, 0.031),
    (46.874319, 102.448729, -43.575, 0.355),  # mountains of Mongolia: height anomaly against geoid
    (-23.617446, 133.874712, 15.871, 0.058),
    (38.625473, 359.9995, 50.066, 0.006),
    (-0.466744, 0.0023, 17.329, 0.001),
]


@pytest.mark.parametrize(("lat", "lon", "printed", "difference"), NGA)
def test_geoid_of_egm96_at_the_test_points_of_nga(lat, lon, printed, difference):
    N = geoid_height(load_field(), math.radians(lat), math.radians(lon), zero_degree=-0.53)
    assert N.shape == (1,)
    assert N[0] - printed == pytest.approx(difference, abs=1e-3)  # the printed heights have three decimals


def test_geoid_on_a_grid_is_that_at_its_points():
    field = load_field("EGM96", 90)
    lat, lon = np.radians([-60.0, 0.0, 33.0]), np.radians([-10.0, 100.0])
    grid = geoid_height(field, lat, lon, ellipsoid=GRS80, grid=True)
    points = geoid_height(field, np.repeat(lat, 2), np.tile(lon, 3), ellipsoid=GRS80)
    np.testing.assert_allclose(grid.ravel(), points, rtol=0, atol=1e-10)


def test_the_ellipsoid_has_no_geoid_over_itself():
    other = Ellipsoid("flatter", 6.37e6, 1 / 400.0, 3.9e14, 7e-5)
    C = np.zeros((21, 21))
    C[:, 0] = other.even_zonals(20)
    field = GravityField("itself", other.gm, other.a, C, 0 * C)
    np.testing.assert_allclose(geoid_height(field, np.linspace(-1.5, 1.5, 7), 0.3, other), 0.0, atol=1e-9)
