"""Separated columns and Geosoft XYZ as strangers write them: read rightly, or refused in one sentence with the row."""

import gzip
import lzma

import numpy as np
import pytest

from geokalman.airborne import read
from geokalman.airborne.read import checks
from geokalman.airborne.read.delimited import read_delimited
from geokalman.airborne.read.tables import read_table
from geokalman.reading import InputError


def units(names):
    """A header with units in brackets."""
    said = {"UTC": "s", "LON": "deg", "LAT": "deg", "EASTING": "m", "NORTHING": "m", "GPSZ": "m"}
    return ",".join(f"{name} ({said.get(name, 'mGal')})" if name not in ("LINE", "FLIGHT") else name for name in names)


SOUND = {
    "plain": lambda text: text(),
    "semicolons": lambda text: text(";"),
    "semicolons and decimal commas": lambda text: text(";", row=lambda line: line.replace(".", ",")),
    "tabs": lambda text: text("\t"),
    "tabs and decimal commas": lambda text: text("\t", row=lambda line: line.replace(".", ",")),
    "blanks": lambda text: text(" "),
    "blanks after commas": lambda text: text(", "),
    "quotes": lambda text: text(row=lambda line: ",".join(f'"{word}"' for word in line.split(","))),
    "quoted names": lambda text: text(header=lambda names: ",".join(f'"{name}"' for name in names)),
    "lower case": lambda text: text(header=lambda names: ",".join(names).lower()),
    "units in brackets": lambda text: text(header=units),
    "a row of units": lambda text: text(header=lambda n: ",".join(n) + "\n,," + "s,deg,deg,m,m,m" + ",mGal" * 9),
    "a ruler": lambda text: text(header=lambda n: ",".join(n) + "\n" + ",".join("-" * len(name) for name in n)),
    "comments and a title": lambda text: "# flown 2012\nKauring, final\n\n" + text(),
    "the header as a comment": lambda text: "#" + text(),
    "comments between": lambda text: text().replace("\n", "\n# page 2\n", 30),
    "the header again": lambda text: text().replace("\n", "\n" + text().split("\n")[0] + "\n", 2),
    "a trailing comma": lambda text: text().replace("\n", ",\n"),
    "a trailing comma in the data": lambda text: text(row=lambda line: line + ","),
    "blank lines": lambda text: text().replace("\n", "\n\n") + "\n\n \n",
    "a byte order mark": lambda text: "\ufeff" + text(),
    "line ends of DOS": lambda text: text().replace("\n", "\r\n"),
    "line ends of old Macs": lambda text: text().replace("\n", "\r"),
    "no last line end": lambda text: text().rstrip("\n"),
    "text in a column that nobody needs": lambda text: text(AIRCRAFT=["VH-SGL"] * 500, DATE=["2012/03/01"] * 500),
    "two columns without a name": lambda text: text(header=lambda n: ",".join([*n, "", ""]), row=lambda r: r + ",7,x"),
    "the same column twice": lambda text: text(
        header=lambda n: ",".join([*n, "FLIGHT"]), row=lambda r: r + "," + r.split(",")[1]
    ),
    "no check column": lambda text: text(GRVRAW=None),
    "no optional columns": lambda text: text(GRVRAW=None, FLIGHT=None, FRA100=None),
    "columns in another order": lambda text: "\n".join(
        ",".join(reversed(line.split(","))) for line in text().splitlines()
    ),
    "labels": lambda text: text(LINE=["L104000"] * 500),
    "exponents": lambda text: text(FZ=[f"{float(r.split(',')[8]):.12E}" for r in text().splitlines()[1:]]),
    "exponents of Fortran": lambda text: text(
        FZ=[f"{float(r.split(',')[8]):.12E}".replace("E", "D") for r in text().splitlines()[1:]]
    ),
}


@pytest.mark.parametrize("case", SOUND)
def test_a_sound_file_is_read_however_it_is_written(case, text, sound, tmp_path):
    path = tmp_path / "own.csv"
    path.write_bytes(SOUND[case](text).encode())
    flight = read.read_survey(path)[104000]
    np.testing.assert_allclose(flight.line.z, sound.line.z, rtol=1e-9, atol=1e-6)
    np.testing.assert_array_equal(flight.references["ground"], sound.references["ground"])


@pytest.mark.parametrize(
    "encode",
    [
        lambda t: ("# Geländehöhe\n" + t).encode("latin-1"),
        lambda t: ("# Geländehöhe\n" + t).encode("utf-8"),
        lambda t: t.encode("utf-16"),
        lambda t: gzip.compress(t.encode()),
        lambda t: lzma.compress(t.encode()),
    ],
    ids=["latin-1", "utf-8", "utf-16", "gzip", "xz"],
)
def test_encodings_and_compression_are_told_by_the_content(encode, text, sound, tmp_path):
    path = tmp_path / "own.txt"
    path.write_bytes(encode(text()))
    np.testing.assert_array_equal(read.read_survey(path)[104000].line.z, sound.line.z)


REFUSED = {
    "a long row": (lambda t: t() + "1," * 18 + "1\n", "line 502: this row has 19 values; row 1 names 17 col"),
    "a short row": (lambda t: t() + "1,2\n", r"own.csv, line 502: this row has 2 values; row 1 names 17 columns"),
    "a short first row": (lambda t: "A,B,C\n1,2\n" + t(), "line 2: .* no row before it names its 2 columns; row 1 has 3"),
    "a word in the data": (lambda t: t(FZ=["fast", *[r.split(",")[8] for r in t().splitlines()[2:]]]),
                           r"own.csv, line 2: FZ is 'fast', which is no number"),
    "decimal commas": (lambda t: t(LON=['"117,5"'] * 500), "LON is '117,5', which is no number; the decimal mark is a point"),
    "thousands": (lambda t: t(";", FZ=["957,977.46"] * 500), r"line 2: FZ is '957,977.46', which is no number"),
    "times of the clock": (lambda t: t(UTC=["04:48:27.5"] * 500), r"UTC is '04:48:27.5', .*; write times as seconds"),
    "a date and time": (lambda t: t(UTC=["2012-03-01T04:48:27"] * 500), "which is no number; write times as seconds"),
    "two columns of one name": (lambda t: t(header=lambda n: ",".join([*n, "FZ"]), row=lambda r: r + ",1"),
                                "two columns have the name FZ and differ; keep one of them"),
    "no header": (lambda t: t().split("\n", 1)[1], "line 1: .* no row before it names its 17 columns"),
    "a label without a number": (lambda t: t(LINE=["north"] * 500), "line 2: LINE is 'north'; a line is labelled by"),
    "a label with an underscore": (lambda t: t(LINE=["10100_1"] * 500), "LINE is '10100_1'; a line is labelled by"),
    "a line without a label": (lambda t: t(LINE=["104000"] * 9 + [""] + ["104000"] * 490),
                               "line 11: this row carries no line number"),
    "a missing column": (lambda t: t(FZ=None), r"no known layout fits \(the nearest lacks FZ\); describe"),
    "a missing correction": (lambda t: t(FACOR=None), r"the nearest lacks FACOR"),
    "a spreadsheet": (lambda t: "PK\x03\x04" + t(), "this is a zip archive"),
    "a web page": (lambda t: "<!DOCTYPE html>" + t(), "this is a web page, not a survey file"),
    "zero bytes": (lambda t: t() + "\0" * 100 + "\n", "line 502: it has a zero byte"),
    "a line without an end": (lambda t: t() + "1," * 600_000, "line 502: the line is longer than"),
    "a header only": (lambda t: t().split("\n")[0], "own.csv: this has no data under its header"),
    "nothing": (lambda t: "", "own.csv: this is empty"),
    "blank lines only": (lambda t: "\n\n \n", "own.csv: this is empty"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_read_is_refused_by_row(case, text, tmp_path):
    make, message = REFUSED[case]
    path = tmp_path / "own.csv"
    path.write_text(make(text), encoding="utf-8")
    with pytest.raises(InputError, match=message) as caught:
        read.read_survey(path)
    assert str(path) in str(caught.value)


NULLS = [
    "", "*", "***", "NaN", "nan", "NA", "N/A", "#N/A", "null", "NULL", "None", "dummy", "empty", "?", "-", "-9999",
    "-9999.0", "-99999.999", "-999.99", "99999.99", "-9999999", "-999999.99", "-1e32", "-1.0E+32", "1e30", "1.70141e38", "inf",
    "-32768", "-999.25",
]  # fmt: skip


@pytest.mark.filterwarnings("ignore::geokalman.airborne.read.checks.SuspiciousData")
@pytest.mark.parametrize("null", NULLS)
def test_every_common_null_is_one_in_a_reference_and_in_a_correction(null, text, rows, sound, tmp_path):
    path = tmp_path / "own.csv"
    ground = [null if k in (100, 101, 300) else word for k, word in enumerate(rows["GND_FA"])]
    lift = [null if k == 496 else word for k, word in enumerate(rows["FACOR"])]
    path.write_text(text(GND_FA=ground, FACOR=lift))
    (flight,) = read.read_survey(path).flights
    assert len(flight.line.t) == 496 and flight.name == "104000a"
    assert np.flatnonzero(np.isnan(flight.references["ground"])).tolist() == [100, 101, 300]
    np.testing.assert_array_equal(flight.line.z, sound.line.z[:496])


@pytest.mark.parametrize("value", ["-9999", "9999", "-999.99"])
def test_a_number_of_nines_is_none_where_the_channel_can_be_there(value, rows, text, tmp_path):
    """A local grid whose easting passes through it, and a clock."""
    shift = float(value) - float(rows["EASTING"][250])
    path = tmp_path / "own.csv"
    path.write_text(
        text(
            EASTING=[f"{float(word) + shift:.2f}" for word in rows["EASTING"]],
            UTC=[f"{9999 - 125 + 0.5 * k:.1f}" for k in range(500)],
        )
    )
    found = read.read_survey(path)
    assert found.notes == () and len(found[104000].line.t) == 500


XYZ = {
    "plain": ("Line 104000", 104000),
    "a letter": ("Line L104000", 104000),
    "a version": ("Line 104000:0", 104000),
    "a tie": ("Tie T200", 200),
    "upper case": ("LINE 104000", 104000),
    "decimals": ("Line 104000.1", 104000.1),
    "the short form": ("L104000", 104000),
    "a base": ("Base 7", 7),
    "more words": ("Line 104000 Flight 3", 104000),
    "a blank after the letter": ("Line  L 104000", 104000),
}


@pytest.mark.parametrize("case", XYZ)
def test_labels_of_geosoft_lines(case, text, sound, tmp_path):
    head, number = XYZ[case]
    path = tmp_path / "own.xyz"
    path.write_text(
        text(" ", header=lambda n: "/ " + " ".join(n) + f"\n//Flight 9\n//Date 2012/03/01\n{head}", LINE=None)
    )
    np.testing.assert_array_equal(read.read_survey(path)[number].line.z, sound.line.z)


@pytest.mark.parametrize("head", ["Line north", "Line", "Tie L100A", "Line 10-20"])
def test_a_geosoft_line_without_a_number_is_refused_by_row(head, text, tmp_path):
    path = tmp_path / "own.xyz"
    path.write_text(text(" ", header=lambda n: "/ " + " ".join(n) + "\n" + head, LINE=None))
    with pytest.raises(InputError, match=f"own.xyz, line 2: '{head}' labels no line; a line is labelled by its number"):
        read.read_survey(path)


@pytest.mark.parametrize(
    "before",
    [
        "/ ----\n/ XYZ EXPORT [2012]\n/\n{names}\n/ {ruler}\n",
        "/Gel\u00e4nde\n{names}\n",
        "\ufeff{names}\n",
        "{names}\n//Flight 1001\n//Date 2012/03/01\n",
        "/{plain}\n/\n/\n",
        "{names}\r\n",
        "/ 17 channels, 500 fiducials\n{names}\n",
    ],
)
def test_names_are_the_last_comment_with_as_many_words(before, text, sound, tmp_path):
    def header(names):
        plain = " ".join(names)
        ruler = " ".join("=" * len(name) for name in names)
        return before.format(names="/ " + plain, plain=plain, ruler=ruler) + "Line 104000"

    path = tmp_path / "own.xyz"
    path.write_bytes(text(" ", header=header, LINE=None).encode("latin-1" if "\ufeff" not in before else "utf-8"))
    np.testing.assert_array_equal(read.read_survey(path)[104000].line.z, sound.line.z)


def test_columns_named_anew_in_another_order_are_refused(text, tmp_path):
    body = text(" ", header=lambda n: "/ " + " ".join(n))
    names = body.split("\n")[0]
    path = tmp_path / "own.xyz"
    path.write_text(body + names + "\n" + body.split("\n")[1] + "\n")
    assert len(read_delimited(path)["FZ"]) == 501
    path.write_text(body + names.replace("LON LAT", "LAT LON") + "\n" + body.split("\n")[1] + "\n")
    with pytest.raises(InputError, match="line 502: the columns are named again, and otherwise than in row 1"):
        read_table(path)


def test_a_line_flown_twice_in_a_row_stays_two(text, rows, sound, tmp_path):
    """Line 5:0 and Line 5:1 next to each other, the second ten minutes later."""
    one = text(" ", header=lambda n: "/ " + " ".join(n) + "\nLine 5:0", LINE=None)
    later = [f"{float(word) + 249.5 + 0.5:.1f}" for word in rows["UTC"]]  # without a gap in time
    two = text(" ", header=lambda n: "Line 5:1", LINE=None, UTC=later)
    path = tmp_path / "own.xyz"
    path.write_text(one + two)
    with pytest.warns(checks.SuspiciousData, match="line 5 was flown 2 times"):
        found = read.read_survey(path)
    assert [f.name for f in found.flights] == ["5a", "5b"]
    np.testing.assert_allclose(found["5b"].line.z, sound.line.z, atol=1e-6)


def test_a_file_that_would_fill_the_memory_stops_early(monkeypatch, text, tmp_path):
    monkeypatch.setattr("geokalman.reading.MAX_BYTES", 1 << 16)
    path = tmp_path / "own.csv"
    path.write_bytes(gzip.compress(text().encode()))
    with pytest.raises(InputError, match="this holds more than 0 GiB; split it"):
        read_table(path)
