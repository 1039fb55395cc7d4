"""One short flight for all tests of the orbiter: a day, in J2 and in the real field."""

from types import SimpleNamespace

import matplotlib

matplotlib.use("Agg")

import numpy as np
import pytest

from geokalman.physics import mars
from geokalman.pulsar import simulate
from geokalman.pulsar.dynamics import j2_force
from geokalman.pulsar.model import Mission, preset


@pytest.fixture(scope="session")
def day():
    """Mission of 60 epochs with its truths, the J2 force, and observations of preset B, seed 0."""
    mission, gravity = Mission(days=60 * 500 / 86400), mars.gravity()
    flight, rich = simulate.fly(mission, gravity), simulate.fly(mission, gravity, 1.0)
    data = simulate.observe(flight, mission, preset("B"), np.random.default_rng(0))
    return SimpleNamespace(
        mission=mission, gravity=gravity, flight=flight, rich=rich, force=j2_force(gravity), data=data
    )
