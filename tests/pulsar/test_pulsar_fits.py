"""Binary tables of FITS files: cards and columns as the standard has them, and files that no one should trust."""

import gzip
import random

import numpy as np
import pytest

from geokalman.pulsar.fits import FitsError, FitsWarning, parse_fits, read_fits

TIME = ("TIME", "D", np.array([1.0, 2.5], ">f8"))
BITS = ("BITS", "11X", np.zeros((2, 2), "u1"))


@pytest.mark.parametrize(
    ("text", "value"),
    [
        (b"  12 / comment", 12), (b"1.5D3", 1500.0), (b"-1.5E-3/ no blank", -1.5e-3), (b".5", 0.5), (b"", None),
        (b"/ only a comment", None), (b"T / yes", True), (b"'it''s  ' / quote", "it's"), (b"'a/b' / slash", "a/b"),
        (b"''", ""), (b"'no end", "no end"), (b"(1.0, 2.0)", "(1.0, 2.0)"), (b"1.2.3", "1.2.3"), (b"+7", 7),
    ],
)  # fmt: skip
def test_values_of_cards(fits_bytes, text, value):
    [table] = parse_fits(fits_bytes(({"KEY": text, "key2": 5}, [TIME])), "x")
    found = table.header["KEY"]
    assert (found, type(found)) == (value, type(value)) and table.header["KEY2"] == 5


def test_long_strings_and_conventions(fits_bytes):
    content = fits_bytes(({"LONG": "one &", "XXXXXXXX": 1, "YYYYYYYY": 2}, [TIME]))
    for key, text in ((b"XXXXXXXX=", b"CONTINUE  'and two'"), (b"YYYYYYYY=", b"HIERARCH E LONG = 5")):
        place = content.index(key)
        content = content[:place] + text.ljust(80) + content[place + 80 :]
    assert parse_fits(content, "x")[0].header["LONG"] == "one and two"


@pytest.mark.parametrize(
    ("form", "header", "raw", "wanted"),
    [
        ("I", {"TZERO2": 32768}, np.array([-32768, 32767], ">i2"), np.array([0, 65535], "u2")),
        ("J", {"TZERO2": 2147483648, "TSCAL2": 1.0}, np.array([-1, 5], ">i4"), np.array([2**31 - 1, 2**31 + 5], "u4")),
        ("K", {"TZERO2": 2**63}, np.array([-(2**63), 1], ">i8"), np.array([0, 2**63 + 1], "u8")),
        ("B", {"TZERO2": -128}, np.array([0, 255], "u1"), np.array([-128.0, 127.0])),
        ("K", {}, np.array([2**53 + 1, -1], ">i8"), np.array([2**53 + 1, -1])),
        ("I", {"TNULL2": -99}, np.array([-99, 7], ">i2"), np.array([np.nan, 7.0])),
        ("J", {"TNULL2": 5, "TSCAL2": b"5.D-1"}, np.array([5, 6], ">i4"), np.array([np.nan, 3.0])),
        ("I", {"TSCAL2": 0.5, "TZERO2": 100}, np.array([7, -3], ">i2"), np.array([103.5, 98.5])),
        ("E", {"TZERO2": 1e9}, np.array([1.0, 2.0], ">f4"), np.array([1e9 + 1, 1e9 + 2])),
        ("1L", {}, np.array([[84], [0]], "u1"), np.array([1.0, np.nan])),
        ("3D", {"TDIM2": "(3)"}, np.arange(6.0).reshape(2, 3).astype(">f8"), np.arange(6.0).reshape(2, 3)),
    ],
)  # fmt: skip
def test_columns_mean_what_their_keywords_say(fits_bytes, form, header, raw, wanted):
    [table] = parse_fits(fits_bytes((header, [BITS, ("V", form, raw), TIME])), "x")
    np.testing.assert_array_equal(table.columns["v"], wanted, strict=form != "K" or bool(header))
    assert table.columns["TIME"].tolist() == [1.0, 2.5] and list(table.columns) == ["BITS", "V", "TIME"]


@pytest.mark.parametrize(
    ("form", "raw", "what"),
    [
        ("4A", np.zeros((2, 4), "u1"), "text"), ("11X", np.zeros((2, 2), "u1"), "bits"),
        ("1PE(12)", np.zeros((2, 8), "u1"), "various length"), ("QD", np.zeros((2, 16), "u1"), "various length"),
        ("M", np.zeros((2, 16), "u1"), "complex"), ("0D", np.zeros((2, 0), "u1"), "nothing"),
    ],
)  # fmt: skip
def test_columns_that_hold_no_numbers_are_passed_over_until_asked_for(fits_bytes, form, raw, what):
    [table] = parse_fits(fits_bytes(({"EXTNAME": "E"}, [("V", form, raw), TIME])), "x")
    assert table.columns["TIME"].tolist() == [1.0, 2.5]
    with pytest.raises(FitsError, match=rf"x, extension 1 \(E\): column V holds .*{what}"):
        table.column("V")


@pytest.mark.parametrize(
    ("header", "match"),
    [
        ({"PCOUNT": -2880}, "PCOUNT = -2880"), ({"NAXIS2": -5}, "NAXIS2 = -5"), ({"NAXIS2": 10**15}, "truncated"),
        ({"NAXIS2": 10**30}, "NAXIS2 = 1000"), ({"GCOUNT": 0}, "GCOUNT = 0"), ({"BITPIX": 7}, "BITPIX = 7"),
        ({"BITPIX": 16, "NAXIS2": 1}, "has BITPIX = 8"), ({"BITPIX": None}, "lacks BITPIX"),
        ({"NAXIS": 10**9}, "NAXIS = 1"),
        ({"NAXIS": 1}, "NAXIS = 2"), ({"NAXIS": None}, "lacks NAXIS"), ({"NAXIS2": None}, "lacks NAXIS2"),
        ({"NAXIS2": "many"}, "NAXIS2 = 'many' is not a number"), ({"NAXIS2": 1.5}, "NAXIS2 = '1.5' is not a whole"),
        ({"NAXIS2": True}, "NAXIS2 = 'True' is not a number"), ({"NAXIS2": b""}, "lacks NAXIS2"),
        ({"NAXIS1": 7}, "NAXIS1 = 7 bytes, but .* take 8"), ({"TFORM1": "2D"}, "NAXIS1 = 8 bytes, but .* take 16"),
        ({"TFIELDS": None}, "lacks TFIELDS"), ({"TFIELDS": -1}, "TFIELDS = -1"), ({"TFIELDS": 2}, "TFORM2 = None"),
        ({"TFORM1": None}, "TFORM1 = None"), ({"TFORM1": "Z"}, "TFORM1 = 'Z' .* unknown format"),
        ({"TFORM1": 8}, "TFORM1 = 8"), ({"naxis2": 3}, "NAXIS2 is given twice"),
    ],
)  # fmt: skip
def test_sizes_of_a_header_are_not_trusted(fits_bytes, header, match):
    with pytest.raises(FitsError, match=match) as caught:
        parse_fits(fits_bytes((header, [TIME])), "x")
    assert str(caught.value).startswith("x, extension 1: ") and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("header", "match"),
    [
        ({"TSCAL1": "big"}, "TSCAL1 = 'big'"), ({"TZERO1": b"1.E400"}, "TZERO1"),
        ({"TTYPE2": "time"}, "1 and 2 are both"),
        ({"TNULL2": 1.5}, "TNULL2 = '1.5' is not a whole"),
        ({"TTYPE1": "TIME_TAG"}, "no column TIME; the columns are TIME_TAG, N"),
    ],
)  # fmt: skip
def test_columns_that_contradict_themselves(fits_bytes, header, match):
    [table] = parse_fits(fits_bytes((header, [TIME, ("N", "J", np.array([1, 2], ">i4"))])), "x")
    with pytest.raises(FitsError, match=match):
        table.column("N" if "TNULL2" in header else "TIME")


def test_null_and_infinite_numbers_are_named_by_row(fits_bytes):
    columns = [
        ("N", "J", np.array([1, 2, 2], ">i4")),
        ("V", "3D", np.array([[0, 0, 0], [0, np.inf, 0], [0, 0, 0]], ">f8")),
    ]
    [table] = parse_fits(fits_bytes(({"TNULL1": 2}, columns)), "x")
    with pytest.raises(FitsError, match="column N is null or not finite in row 2, as are 1 other rows"):
        table.finite("N")
    with pytest.raises(FitsError, match="column V is null or not finite in row 2;"):
        table.finite("V")


def test_what_may_stand_around_a_table(fits_bytes):
    image = {"XTENSION": "IMAGE", "BITPIX": -32, "NAXIS1": 10, "NAXIS2": 90, "TFIELDS": None}
    content = fits_bytes((image, []), ({"XTENSION": "A3DTABLE"}, [TIME]))
    end = content.rindex(b"XTENSION= ")
    content = content[:end] + bytes(2880 * 2) + content[end:]  # the image has 3600 bytes
    assert [t.columns["TIME"].tolist() for t in parse_fits(content, "x")] == [[1.0, 2.5]]
    groups = {
        "BITPIX": 16,
        "NAXIS": 3,
        "NAXIS1": 0,
        "NAXIS2": 5,
        "NAXIS3": 7,
        "GROUPS": True,
        "PCOUNT": 3,
        "GCOUNT": 20,
    }
    head = fits_bytes(primary=groups)
    [table] = parse_fits(head + bytes(2880) + fits_bytes(({}, [TIME]))[2880:], "x")  # 2 * 20 * (3 + 35) = 1520 bytes
    assert len(table.columns["TIME"]) == 2


@pytest.mark.parametrize("tail", [b"", bytes(2880), b" " * 2880, b"\r\n\x1a", bytes(100)])
def test_filling_after_the_last_table(fits_bytes, tail, recwarn):
    content = fits_bytes(({}, [TIME]))
    assert len(parse_fits(content + tail, "x")) == 1
    assert len(parse_fits(content[: 2 * 2880 + 16], "x")) == 1  # the last block is not filled
    assert not recwarn


def test_other_bytes_after_the_last_table_are_told(fits_bytes):
    with pytest.warns(FitsWarning, match="the 4 bytes after the last table"):
        assert len(parse_fits(fits_bytes(({}, [TIME])) + b"junk", "x")) == 1


@pytest.mark.parametrize(("header", "what"), [({"XTENSION": "TABLE"}, "as text"), ({"ZTABLE": True}, "funpack")])
def test_tables_of_other_kinds_are_refused_only_when_asked_for(fits_bytes, header, what):
    other, table = parse_fits(fits_bytes((header, [("TIME", "F10.3", TIME[2])]), ({}, [TIME])), "x")
    assert "TIME" in other.columns and table.columns["TIME"].tolist() == [1.0, 2.5]
    with pytest.raises(FitsError, match=what):
        other.column("TIME")


@pytest.mark.parametrize(
    ("content", "match"),
    [
        (b"", "no FITS file"), (b"hello", "no FITS file"), (b"SIMPLE  =" + b" " * 2871, "no END"),
        (b"SIMPLE  = " + b"x" * 80 * 250_000, "no END in 16000000 bytes"), (b"\x89PNG\r\n\x1a\n", "no FITS file"),
    ],
    ids=["empty", "text", "no end", "endless", "image"],
)  # fmt: skip
def test_what_is_no_fits_file(content, match):
    with pytest.raises(FitsError, match=match):
        parse_fits(content, "x")


def test_files_are_opened_by_their_first_bytes(tmp_path, fits_bytes):
    content = fits_bytes(({}, [TIME]))
    path = tmp_path / "events.fits"  # gzipped without the name saying so
    path.write_bytes(gzip.compress(content))
    assert len(read_fits(path)) == 1
    path.write_bytes(gzip.compress(content)[:-20])
    with pytest.raises(FitsError, match="cut short or damaged"):
        read_fits(path)
    for cut in (2900, 5000, 2 * 2880 + 15):
        path.write_bytes(content[:cut])
        with pytest.raises(FitsError, match="truncated"):
            read_fits(path)
    with pytest.raises(FileNotFoundError, match="No FITS file at .*nothing"):
        read_fits(tmp_path / "nothing")


@pytest.mark.filterwarnings("ignore::geokalman.pulsar.fits.FitsWarning")
def test_damaged_bytes_give_tables_or_one_sentence(fits_bytes):
    content = bytearray(fits_bytes(({"TNULL2": 7, "TSCAL1": 2.0}, [TIME, ("N", "J", np.array([1, 2], ">i4"))])))
    rng = random.Random(0)
    refused = 0
    for _ in range(2000):
        damaged = bytearray(content)
        for _ in range(rng.choice((1, 3))):
            damaged[2880 + rng.randrange(14 * 80)] = rng.choice(b"-0123456789 'TFDEIJPQX=./\0\xff")
        try:
            for table in parse_fits(bytes(damaged), "x"):
                for name in table.columns:
                    table.finite(name)
        except FitsError as error:
            refused += 1
            assert "\n" not in str(error)
    assert 200 < refused < 1800
