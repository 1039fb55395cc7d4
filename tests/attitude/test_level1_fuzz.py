"""Readers of Level-1 files under fuzzing: no crash, no silent wrong number."""

from __future__ import annotations

import re
import warnings

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from level1files import FIXTURES, edit, written

from geokalman.attitude.header import Level1Error
from geokalman.attitude.legacy import read_grace
from geokalman.attitude.level1 import Level1Warning, read
from geokalman.attitude.products import GRACE_FO, KEYS

_TEXT = st.text(
    alphabet=st.characters(codec="utf-8", exclude_characters="\r\x0b\x0c\x1c\x1d\x1e\x85\u2028\u2029"), max_size=40
)
_FIELD = st.one_of(
    st.sampled_from(
        [
            "nan",
            "inf",
            "-inf",
            "1e999",
            "-0",
            "1_0",
            "٣",
            "0x1p3",
            "1d0",
            "",
            "1.0.0",
            "9" * 30,
            "00000000",
            "1",
            "C",
            "+5",
            "1e-320",
        ]
    ),
    st.floats(allow_nan=False).map(repr),
    st.integers(-(10**20), 10**20).map(str),
    _TEXT,
)
OF_THE_WHOLE = re.compile(
    r"no line '|the header|variables lack|num_records is|NUMBER OF DATA RECORDS is|records of the \d+ that|no "
    r"records after|cut short or damaged|unpack it|a web page|not a Level-1 "
    r"file|compressed twice|no UTF-16|times count from"
)
"""Reasons that concern a file as a whole, not one of its lines."""
_SLOW = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def sane(table):
    """Whatever came through is finite, in range and of unit norm."""
    for column in GRACE_FO.get(table.product, ()):
        if column.kind in ("int", "float"):
            assert np.isfinite(table[column.name].astype(float)).all()
    if "quatangle" in table.columns:
        q = table.stacked("quatangle", "quaticoeff", "quatjcoeff", "quatkcoeff")
        np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1.0, atol=2e-9)
    key = KEYS.get(table.product)
    if key:
        assert (np.diff(table[key[0]]) >= 0).all()


@pytest.mark.parametrize("product", sorted(GRACE_FO))
@_SLOW
@given(data=st.data())
def test_fuzzed_fields_never_crash_nor_lie(tmp_path, product, data):
    """One field of one record replaced by anything: the record is left out with its line, or the number that is there
    is read.
    """
    path = written(tmp_path, product, 120, "Y" if product == "KBR1B" else "C")
    row, position, text = (
        data.draw(st.integers(0, 119)),
        data.draw(st.integers(0, len(GRACE_FO[product]) - 1)),
        data.draw(_FIELD),
    )
    k = edit(
        path,
        lambda body: [
            *body[:row],
            " ".join([*body[row].split()[:position], text, *body[row].split()[position + 1 :]]) + "\n",
            *body[row + 1 :],
        ],
    )
    first = k + row + 1  # a line break within the text makes two lines of one
    where = rf"line ({'|'.join(str(first + n) for n in range(text.count(chr(10)) + 1))})\b"
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always", Level1Warning)
        try:
            table = read(path)
        except Level1Error as error:
            assert path.name in str(error) and re.search(where, str(error))
            return
    said = " ".join(str(w.message) for w in seen)
    sane(table)
    assert 118 <= len(table) <= 121
    if len(table) < 120:
        assert path.name in said and (re.search(where, said) or "duplicate time tag" in said)
    column = GRACE_FO[product][position]
    if len(table) == 120 and column.kind in ("int", "float") and len(text.split()) == 1 and "quat" not in column.name:
        number = int(text) if column.kind == "int" else float(text.upper().replace("D", "E"))  # 1D0 as Fortran has it
        assert number in table[column.name]


@pytest.mark.parametrize("product", sorted(GRACE_FO))
@_SLOW
@given(data=st.data())
def test_fuzzed_bytes_never_crash(tmp_path, product, data):
    """Bytes cut out of, put into, or changed in the file: one sentence that names it, or a table that is sane."""
    path = written(tmp_path, product, 60, "Y" if product == "KBR1B" else "C")
    content = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        k = data.draw(st.integers(0, len(content)))
        length = data.draw(st.integers(0, 30))
        content[k : k + length] = data.draw(st.binary(max_size=30))
    path.write_bytes(bytes(content))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", Level1Warning)
        try:
            sane(read(path))
        except Level1Error as error:
            assert path.name in str(error) and (re.search(r", line \d+", str(error)) or OF_THE_WHOLE.search(str(error)))


@pytest.mark.parametrize("name", ["SCA1B_2003-09-14_A_00.asc", "KBR1B_2003-09-14_X_00.asc"])
@_SLOW
@given(data=st.data())
def test_fuzzed_files_of_the_older_layout(tmp_path, name, data):
    content = bytearray((FIXTURES / name).read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        k = data.draw(st.integers(0, len(content)))
        length = data.draw(st.integers(0, 30))
        content[k : k + length] = data.draw(st.binary(max_size=30))
    (tmp_path / name).write_bytes(bytes(content))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", Level1Warning)
        try:
            sane(read_grace(tmp_path / name))
        except Level1Error as error:
            assert name in str(error) and (re.search(r", line \d+", str(error)) or OF_THE_WHOLE.search(str(error)))
