"""Shared by the airborne tests: the vendored survey, read once."""

import pytest

from geokalman.airborne import read


@pytest.fixture(scope="session")
def kauring():
    return read.load("kauring", 60.0)


@pytest.fixture(scope="session")
def six(kauring):
    return kauring.select([104000, 104100, 104200, 104300, 104400, 104500])
