"""Equivalent water height of a change of the gravity field, with the Earth's elastic response to the load."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geokalman.physics.harmonics import gaussian_weights, synthesis

Array = NDArray[np.float64]

DENSITY_EARTH = 5517.0
"""Mean density of the Earth [kg/m^3]."""
DENSITY_WATER = 1000.0
"""Density of water [kg/m^3]."""
LOVE_DEGREES = (0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 12, 15, 20, 30, 40, 50, 70, 100, 150, 200)
LOVE_NUMBERS = (
    0.0, 0.027, -0.303, -0.194, -0.132, -0.104, -0.089, -0.081, -0.076, -0.072, -0.069,
    -0.064, -0.058, -0.051, -0.040, -0.033, -0.027, -0.020, -0.014, -0.010, -0.007,
)  # fmt: skip
"""Load Love numbers k_n of Wahr, Molenaar & Bryan (1998), J. Geophys. Res. 103(B12), Table 1; linear between them."""


def water_factors(n_max: int, radius: float) -> Array:
    """Metres of water per unit of a coefficient's change, by degree (n_max + 1,): a rho_E / (3 rho_W) (2n + 1) / (1 +
    k_n).

    radius : reference radius [m]; n_max up to 200. Raises ValueError beyond. Source: Wahr et al. (1998), equation (14).
    """
    if not 0 <= n_max <= LOVE_DEGREES[-1]:
        raise ValueError(
            f"n_max = {n_max} is beyond the load Love numbers at hand, which end at degree {LOVE_DEGREES[-1]}."
        )
    n = np.arange(n_max + 1)
    k = np.interp(n, LOVE_DEGREES, LOVE_NUMBERS)
    return radius * DENSITY_EARTH / (3 * DENSITY_WATER) * (2 * n + 1) / (1 + k)


def water_height(dC: Array, dS: Array, radius: float, lat: Array, lon: Array, gauss_km: float = 0.0) -> Array:
    """Equivalent water height (n_lat, n_lon) [m] of coefficient changes dC, dS (N+1, N+1) on a grid [rad],
    low-passed."""
    n_max = dC.shape[-1] - 1
    weights = water_factors(n_max, radius) * gaussian_weights(n_max, gauss_km)
    return synthesis(dC, dS, lat, lon, weights=weights)
