"""Shared by the airborne tests: the vendored survey, read once."""

import pytest

from geokalman.airborne import read, tables
from geokalman.files import data_path


@pytest.fixture(scope="session")
def kauring():
    return read.load("kauring", 60.0)


@pytest.fixture(scope="session")
def whole():
    """The table of the vendored survey."""
    return tables.read_table(data_path("kauring_2012.xz"))


@pytest.fixture
def table(whole):
    """One of its lines, to be spoilt."""
    rows = whole["LINE"] == 104000
    return {name: values[rows].copy() for name, values in whole.items()}


@pytest.fixture(scope="session")
def six(kauring):
    return kauring.select([104000, 104100, 104200, 104300, 104400, 104500])
