"""Readers and every item of bad input: refused in one sentence, or repaired."""

import gzip

import numpy as np
import pytest
from surveyfiles import HEADER, cut, write_csv

from geokalman.airborne import read
from geokalman.airborne.read import KAURING, checks, quality, survey, tables
from geokalman.data import data_path
from geokalman.reading import InputError


def test_the_vendored_survey(whole, kauring):
    assert len(whole["LINE"]) == 135_250 and len(np.unique(whole["LINE"])) == 224
    assert len(kauring.flights) == 224 and kauring.refused == ()
    assert [len(kauring[n].line.t) for n in (104000, 104100, 104200, 104300, 104400, 104500)] == [
        888,
        893,
        913,
        892,
        840,
        835,
    ]
    assert all(43 < f.line.V < 52 for f in kauring.select([104000, 104500]))
    assert data_path("kauring_2012.xz").stat().st_size < 5e6


@pytest.mark.parametrize("opener", [open, gzip.open])
def test_csv_plain_and_gzip_give_the_same_line(table, kauring, tmp_path, opener):
    path = tmp_path / "own.csv"
    write_csv(path, table, opener=opener)
    flight = read.read_survey(path)[104000]
    np.testing.assert_allclose(flight.line.z, kauring[104000].line.z, atol=1e-2)
    assert set(flight.references) == {"contractor_raw", "contractor", "ground"}


def test_packing_is_without_loss(table, tmp_path):
    names = {"FZ": 2, "AZ": 2, "GRVRAW": 2, "LAT": 7}
    (tmp_path / "x.xz").write_bytes(tables.pack(table, names, {"GRVRAW": ("FZ", "AZ")}))
    again = tables.read_table(tmp_path / "x.xz")
    for name in names:
        np.testing.assert_array_equal(again[name], table[name])
    table["FZ"][3] = np.nan
    with pytest.raises(ValueError, match="Column FZ has a null"):
        tables.pack(table, names, {})


def test_eastern_victoria_and_its_aliasing():
    with pytest.warns(
        checks.SuspiciousData, match="on 10 of 10 lines .* probably aliased, so give the height a larger R"
    ):
        eastvic = read.load("eastvic")
    assert len(eastvic.flights) == 10 and eastvic.flights[4].name == "7001.20"
    follows = [quality.height_correlation(f.line.f3, f.height) for f in eastvic.flights]
    assert max(follows) < 0.95
    assert np.all([abs(f.line.z).max() < 1e12 for f in eastvic.flights])


def test_kauring_is_not_aliased(kauring, six):
    assert kauring.aliased == ()
    assert min(quality.height_correlation(f.line.f3, f.height) for f in six) > 0.95


def fixed_width(tmp_path, rows, definition=None):
    fields = [
        ("EASTING", "F15.2"),
        ("NORTHING", "F15.2"),
        ("LINE", "I8"),
        ("UTCSECOND", "F12.2"),
        ("LATITUDE", "F15.7"),
        ("LONGITUD", "F15.7"),
    ]
    text = "".join(f"DEFN {k} ST=RECD,RT=DATA; {name}:  {form}:  UNIT=m\n" for k, (name, form) in enumerate(fields, 1))
    (tmp_path / "X.DFN").write_text(
        definition or text + "DEFN 7  ST=RECD,RT=DATA; END DEFN\nDEFN 1 ST=RECD,RT=PROJ; RT: A4\n"
    )
    (tmp_path / "X.DAT").write_text("\n".join(rows) + "\n")
    return tmp_path / "X.DAT"


ROW = f"{516120.39:15.2f}{6460474.05:15.2f}{10100:8d}{17307.5:12.2f}{117.1706513:15.7f}{-31.9916777:15.7f}"


def test_fixed_width_by_its_definition(tmp_path):
    table = tables.read_table(fixed_width(tmp_path, [ROW, ROW.replace("516120.39", "-999999.99"[:9].rjust(9))]))
    assert table["EASTING"][0] == 516120.39 and table["LONGITUD"][0] == -31.9916777 and table["LINE"][1] == 10100


def test_fixed_width_nulls(tmp_path):
    rows = [ROW, " " * 4 + "-999999.99 "[:11].rjust(11) + ROW[15:], " " * 14 + "*" + ROW[15:]]
    assert np.isnan(tables.read_table(fixed_width(tmp_path, rows))["EASTING"][1:]).all()


def test_definition_of_another_width(tmp_path):
    with pytest.raises(InputError, match=r"X.DAT, line 2: this row is 77 characters wide, .*X.DFN defines 80"):
        tables.read_table(fixed_width(tmp_path, [ROW, ROW[:-3]]))
    with pytest.raises(ValueError, match="X.DFN: this defines no column"):
        tables.read_table(fixed_width(tmp_path, [ROW], "nothing\n"))
    (tmp_path / "X.DFN").unlink()
    with pytest.raises(ValueError, match="X.DAT: this needs the file X.DFN beside it"):
        tables.read_table(tmp_path / "X.DAT")


XYZ = """/
/   LINE FLIGHT  MGA-X  MGA_Z  FZ
Line 7001.16
 7001.16 1 430043.21 591.81 951564.138
 7001.16 1 430065.64 * 957133.954
Tie  7002
 7002 1 430043.21 -999999.99 951564.138
"""


def test_xyz_with_comments_ties_dashes_and_nulls(tmp_path):
    (tmp_path / "a.xyz").write_text(XYZ)
    table = tables.read_table(tmp_path / "a.xyz")
    assert set(table) == {"LINE", "FLIGHT", "MGA_X", "MGA_Z", "FZ"}
    np.testing.assert_array_equal(np.isnan(table["MGA_Z"]), [False, True, True])
    (tmp_path / "b.xyz").write_text(XYZ.replace("LINE ", "").replace(" 7001.16 1", " 1").replace(" 7002 1", " 1"))
    np.testing.assert_array_equal(tables.read_table(tmp_path / "b.xyz")["LINE"], [7001.16, 7001.16, 7002])
    (tmp_path / "c.xyz").write_text("Line 1\n1 2 3\n")
    with pytest.raises(InputError, match="c.xyz, line 2: .* no row before it names its 3 columns: a CSV needs"):
        tables.read_table(tmp_path / "c.xyz")
    (tmp_path / "d.xyz").write_text(XYZ.replace(" 951564.138\nTie", "\nTie").replace("957133.954", "957133.954 8"))
    with pytest.raises(InputError, match=r"d.xyz, line 5: this row has 6 values; row 2 names 5 columns"):
        tables.read_table(tmp_path / "d.xyz")
    (tmp_path / "e.xyz").write_text(XYZ.replace("957133.954", "fast"))
    with pytest.raises(InputError, match=r"e.xyz, line 5: FZ is 'fast', which is no number"):
        tables.read_table(tmp_path / "e.xyz").channel("FZ")


def test_csv_nulls_blanks_and_a_missing_header(tmp_path):
    (tmp_path / "a.csv").write_text("MGA-Z,B\n1,\n*,2\n-999999.99,3\n")
    table = tables.read_table(tmp_path / "a.csv")
    np.testing.assert_array_equal(table["MGA_Z"], [1, np.nan, np.nan])
    np.testing.assert_array_equal(table["B"], [np.nan, 2, 3])
    (tmp_path / "b.csv").write_text("1,2\n3,4\n")
    with pytest.raises(ValueError, match="b.csv, line 1: .* no row before it names its 2 columns"):
        tables.read_table(tmp_path / "b.csv")
    (tmp_path / "c.csv").write_text("A,B\n1,2,3\n")
    with pytest.raises(ValueError, match="c.csv, line 2: .* names its 3 columns; row 1 has 2 words"):
        tables.read_table(tmp_path / "c.csv")


def test_a_file_of_unknown_layout_names_what_it_lacks(table, tmp_path):
    write_csv(tmp_path / "a.csv", table, [name for name in HEADER if name != "FZ"])
    with pytest.raises(ValueError, match="no known layout fits .the nearest lacks FZ.; describe it by a Layout"):
        read.read_survey(tmp_path / "a.csv")
    with pytest.raises(ValueError, match="lacks the columns FZ"):
        survey({k: v for k, v in table.items() if k != "FZ"}, KAURING)


def test_ones_own_layout(table, kauring):
    own = read.Layout(
        columns={**KAURING.columns, "f3": "UPFORCE"},
        corrections=KAURING.corrections,
        kinds=KAURING.kinds,
        acceleration="m/s2",
    )
    moved = {
        "UPFORCE" if k == "FZ" else k: v * 1e-5 if k in ("FZ", "AZ", "GRVRAW", "LATCOR", "EOTCOR", "FACOR") else v
        for k, v in table.items()
    }
    np.testing.assert_allclose(survey(moved, own)[104000].line.z, kauring[104000].line.z, atol=1e-3)


def test_files_that_are_no_tables(table, tmp_path):
    path = tmp_path / "a.csv"
    path.write_bytes(b"LINE,UTC\n\xf8\x00,2\n")
    with pytest.raises(InputError, match="a.csv, line 2: it has a zero byte; this is no text survey file"):
        tables.read_table(path)
    write_csv(path, cut(table, slice(0, 300)), opener=gzip.open)
    path.write_bytes(path.read_bytes()[:-400])
    with pytest.raises(ValueError, match="a.csv, after line .* cut short or damaged"):
        tables.read_table(path)
    cases = (("", "is empty"), ("A,B\n", "has no data under its header"))
    for text, message in cases:
        path.write_text(text)
        with pytest.raises(ValueError, match=message):
            tables.read_table(path)
    (tmp_path / "b.xyz").write_text("/ LINE X\n")
    with pytest.raises(InputError, match="has no data under its header"):
        tables.read_table(tmp_path / "b.xyz")
    with pytest.raises(FileNotFoundError):
        tables.read_table(tmp_path / "none.csv")


def test_an_unknown_unit_is_said(table, tmp_path):
    path = tmp_path / "a.csv"
    write_csv(path, table)
    path.write_text(path.read_text().replace("GPSZ", "GPSZ (cubits)", 1))
    with pytest.warns(checks.SuspiciousData, match="gives GPSZ in cubits, which is no known unit"):
        read.read_survey(path, KAURING)


def test_the_mark_that_ends_files_of_dos_is_no_row(table, tmp_path):
    path = tmp_path / "a.csv"
    write_csv(path, table)
    path.write_bytes(path.read_bytes() + b"\x1a")
    assert len(read.read_survey(path, KAURING).flights) == 1
