"""A session, its world and one draw of its data, made once."""

from __future__ import annotations

import matplotlib

matplotlib.use("Agg")

import numpy as np
import pytest

from geokalman.radioastron import simulate
from geokalman.radioastron.data import Scenario
from geokalman.radioastron.model import find_session, nominal_state, world


@pytest.fixture(scope="session")
def st():
    """Session ST and its dynamics."""
    session = find_session("ST")
    return session, world(session)


@pytest.fixture(scope="session")
def state(st):
    return nominal_state(*st)


@pytest.fixture(scope="session")
def drawn(st):
    """Truth and data of seed 1000."""
    return simulate.draw(*st, Scenario(), (st[0].station,), np.random.default_rng(1000))
