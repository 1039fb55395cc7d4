"""Pairs that are integrated once per session: the specification's QUICK and MID, and a short one at degree 4."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import matplotlib

matplotlib.use("Agg")

import numba
import numpy as np
import pytest

from geokalman.grace import estimate, observables, recover, simulate
from geokalman.grace.estimate import Estimate
from geokalman.grace.model import Observations, Scenario, Tuning
from geokalman.grace.recover import Recovery
from geokalman.grace.simulate import Truth
from geokalman.physics.field import GravityField


class Flight(NamedTuple):
    """A scenario, the field it is flown in, the pair, and its noise-free data."""

    scenario: Scenario
    gravity: GravityField
    orbit: Truth
    data: Observations


def _fly(**changes) -> Flight:
    scenario = Scenario(**changes)
    gravity = scenario.gravity()
    orbit = simulate.orbit_pair(scenario, gravity)
    return Flight(scenario, gravity, orbit, simulate.observe(orbit, gravity))


@pytest.fixture(scope="session")
def fly() -> Callable[..., Flight]:
    """The function that flies a scenario."""
    return _fly


def needs_compilation() -> None:
    if numba.config.DISABLE_JIT:
        pytest.skip("days of orbit take hours in plain Python")


@pytest.fixture(scope="session")
def tiny() -> Flight:
    """Two hours at degree 4: quick enough for plain Python."""
    return _fly(days=2 / 24, n_max=4)


@pytest.fixture(scope="session")
def quick() -> Flight:
    """Config QUICK: degree 30, 5 days."""
    needs_compilation()
    return _fly(days=5.0, n_max=30)


@pytest.fixture(scope="session")
def mid() -> Flight:
    """Config MID: degree 70, 5 days."""
    needs_compilation()
    return _fly(days=5.0, n_max=70)


@pytest.fixture(scope="session")
def mid_ekf(mid: Flight) -> Estimate:
    return estimate.ekf(mid.data, Tuning())


@pytest.fixture(scope="session")
def mid_ukf(mid: Flight) -> Estimate:
    return estimate.ukf(mid.data, Tuning())


@pytest.fixture(scope="session")
def quick_los(quick: Flight) -> dict[str, np.ndarray]:
    """Every observable of QUICK."""
    return observables.observables(quick.orbit, quick.gravity, quick.data, Tuning(), Tuning(lambda_q=1500.0))


@pytest.fixture(scope="session")
def quick_recovery(quick: Flight, quick_los: dict[str, np.ndarray]) -> Recovery:
    return recover.recover(quick.orbit, quick.gravity, quick_los)
