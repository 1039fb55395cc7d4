"""A recovered field to draw: degrees, observables, errors by degree and maps."""

from __future__ import annotations

import numpy as np

DEGREE = np.arange(2, 71)
IDS = ("X", "N1", "N2", "E0", "E1", "E2", "U1", "U2", "K0", "B11", "P2")


def errors(names=IDS) -> dict[str, np.ndarray]:
    return {name: 1e-4 * (k + 1) * np.exp(DEGREE / 20) for k, name in enumerate(names)}


def grids() -> dict[str, np.ndarray]:
    lat = np.radians(np.arange(-85.0, 90.0, 10.0))[:, None]
    lon = np.radians(np.arange(5.0, 360.0, 10.0))
    pattern = np.cos(lat) * np.cos(lon)
    return {"(a) Newton": 5e-3 * pattern, "(b) EKF": 4e-3 * pattern, "(c) UKF": 1e-3 * pattern}
