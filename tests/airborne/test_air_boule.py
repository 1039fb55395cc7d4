"""Normal gravity at flight height against boule, an independent closed form (Li & Goetze), no series in height."""

import numpy as np
import pytest

from geokalman.airborne import corrections

boule = pytest.importorskip("boule", reason="boule is a test dependency (tools/locks/test.txt)")


def test_normal_gravity_on_the_ellipsoid():
    lat = np.linspace(-90.0, 90.0, 37)
    ours = corrections.latitude_correction(np.radians(lat))
    np.testing.assert_allclose(ours, boule.GRS80.normal_gravity((0 * lat, lat, 0 * lat)), rtol=0, atol=1e-6)


@pytest.mark.parametrize(("height", "allowed"), [(330.0, 0.005), (1500.0, 0.02), (4000.0, 0.05)])
def test_normal_gravity_at_flight_height(height, allowed):
    lat = np.linspace(-90.0, 90.0, 37)
    ours = corrections.normal_gravity(np.radians(lat), height)
    theirs = boule.GRS80.normal_gravity((0 * lat, lat, 0 * lat + height))
    assert np.abs(ours - theirs).max() < allowed  # the free-air term stops at the second order in height
