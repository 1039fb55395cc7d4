"""Equivalent water height against Wahr's numbers and a layer of water laid on by hand."""

import numpy as np
import pytest

from geokalman.physics.harmonics import cell_centred_grid
from geokalman.physics.loading import water_factors, water_height

RADIUS = 6378136.3


def test_factors_follow_wahr():
    factors = water_factors(60, RADIUS)
    assert factors[2] == pytest.approx(RADIUS * 5.517 / 3 * 5 / (1 - 0.303))
    assert factors[60] == pytest.approx(RADIUS * 5.517 / 3 * 121 / (1 - 0.0235), rel=1e-12)
    with pytest.raises(ValueError, match="end at degree 200"):
        water_factors(201, RADIUS)


def test_one_coefficient_makes_its_own_pattern():
    dC, dS = np.zeros((5, 5)), np.zeros((5, 5))
    dC[2, 0] = 1e-10
    lat, lon = cell_centred_grid(10.0)
    grid = water_height(dC, dS, RADIUS, lat, lon)
    expected = 1e-10 * water_factors(4, RADIUS)[2] * np.sqrt(5) * (1.5 * np.sin(lat) ** 2 - 0.5)
    np.testing.assert_allclose(grid, np.broadcast_to(expected[:, None], grid.shape), atol=1e-12)
    assert np.abs(water_height(dC, dS, RADIUS, lat, lon, 1000.0)).max() < np.abs(grid).max()
