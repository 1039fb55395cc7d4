"""Corrections against printed constants, independent formulas and the contractor's own columns."""

import numpy as np
import pytest

from geokalman.airborne import corrections


def test_normal_gravity_is_the_printed_somigliana_formula():
    lat = np.radians(np.linspace(-90, 90, 19))
    s2 = np.sin(lat) ** 2
    printed = 978032.67715 * (1 + 0.001931851353 * s2) / np.sqrt(1 - 0.0066943800229 * s2)
    np.testing.assert_allclose(corrections.latitude_correction(lat), printed, rtol=0, atol=2e-4)


@pytest.mark.parametrize(("v_east", "v_north", "value"), [(0, 65, 66), (65, 0, 792), (0, 0, 0)])
def test_eotvos_at_forty_degrees(v_east, v_north, value):
    assert corrections.eotvos(np.radians(40), 1500.0, v_east, v_north) == pytest.approx(value, abs=0.6)


def test_one_metre_per_second_costs_eleven_milligals():
    lat = np.radians(40)
    assert corrections.eotvos(lat, 1500.0, 1.0, 65.0) - corrections.eotvos(lat, 1500.0, 0.0, 65.0) == pytest.approx(
        11.2, abs=0.1
    )


def test_eotvos_is_the_centrifugal_and_coriolis_acceleration_of_motion_over_a_turning_sphere():
    # independent: (Omega R cos phi + v_E)^2 / R - (Omega R cos phi)^2 / R + v_N^2 / R, on the equator
    R, omega = 6378137.0, 7.292115e-5
    rotating = ((omega * R + 60) ** 2 - (omega * R) ** 2) / R
    assert corrections.eotvos(0.0, 0.0, 60.0, 0.0) * 1e-5 == pytest.approx(rotating, rel=1e-12)


def test_free_air_is_the_change_of_an_inverse_square_field():
    h = np.array([330.0, 1500.0])
    gm = 3.986005e14
    sphere = gm / 6371000.8**2 - gm / (6371000.8 + h) ** 2
    np.testing.assert_allclose(corrections.free_air(np.radians(45), h), sphere * 1e5, rtol=0.006)


def test_the_contractors_columns_are_reproduced(six):
    for flight in six[:2]:
        lat, t = np.radians(flight.lat), flight.line.t
        ve, vn = np.gradient(flight.easting, t), np.gradient(flight.northing, t)
        g = corrections.normal_gravity(lat, flight.height)
        assert np.all((g > 979_300) & (g < 979_500))
        assert abs(corrections.eotvos(lat, flight.height, ve, vn).mean()) < 60


def test_columns_of_the_file_agree_with_the_formulas():
    from geokalman.airborne.read import tables
    from geokalman.data import data_path

    table = tables.read_table(data_path("kauring_2012.xz"))
    lat = np.radians(table["LAT"])
    assert np.mean(corrections.latitude_correction(lat) - table["LATCOR"]) == pytest.approx(0.037, abs=0.005)
    assert np.std(corrections.latitude_correction(lat) - table["LATCOR"]) < 0.01
    assert np.std(corrections.free_air(lat, table["GPSZ"]) - table["FACOR"]) < 0.005
    one = table["LINE"] == 104000
    t = table["UTC"][one]
    v_e, v_n = (np.gradient(table[c][one], t) for c in ("EASTING", "NORTHING"))
    assert np.std(corrections.eotvos(lat[one], table["GPSZ"][one], v_e, v_n) - table["EOTCOR"][one]) < 0.15
