"""Flights that are simulated once per session: ten minutes (plain Python bears them) and two hours."""

from __future__ import annotations

import matplotlib

matplotlib.use("Agg")

import numba
import pytest

from geokalman.attitude import experiment as flights
from geokalman.attitude.model import Scenario, Tuning


@pytest.fixture(scope="session")
def tuning():
    return Tuning()


@pytest.fixture(scope="session")
def short():
    """Two minutes."""
    return flights.flight(Scenario(duration_s=120.0), 1)


@pytest.fixture(scope="session")
def hours():
    """Two hours: quick enough for statistics."""
    if numba.config.DISABLE_JIT:
        pytest.skip("hours of flight take minutes in plain Python")
    return flights.flight(Scenario(duration_s=7200.0), 1)


@pytest.fixture(scope="session")
def solved(hours, tuning):
    return {s: flights.solve(hours, s, tuning, ("akf7", "mekf", "rts", "jpl_like")) for s in ("C", "D")}
