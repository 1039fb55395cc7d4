"""Shared by the airborne tests: the vendored survey, read once."""

import numpy as np
import pytest
from surveyfiles import HEADER

from geokalman.airborne import read
from geokalman.airborne.read import tables
from geokalman.data import data_path


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


@pytest.fixture(scope="session")
def rows(whole):
    """500 epochs of one line as the words of a file, by column; the first epoch stands in row 2 of a CSV."""
    start = int(np.argmax(whole["LINE"] == 104000))
    return {name: [f"{v:.7f}".rstrip("0").rstrip(".") for v in whole[name][start : start + 500]] for name in HEADER}


@pytest.fixture(scope="session")
def sound(rows):
    """The flight that these rows are."""
    return read.survey({name: np.array(words, float) for name, words in rows.items()}, read.KAURING)[104000]


@pytest.fixture
def text(rows):
    """The rows as text: joined by a delimiter, with other words where asked, and without columns."""

    def text(delimiter=",", header=None, row=None, **columns):
        table = {**rows, **{name: words for name, words in columns.items() if words is not None}}
        table = {name: words for name, words in table.items() if columns.get(name, words) is not None}
        head = delimiter.join(table) if header is None else header(list(table))
        lines = [delimiter.join(words) for words in zip(*table.values(), strict=True)]
        return "\n".join([head, *(lines if row is None else map(row, lines))]) + "\n"

    return text
