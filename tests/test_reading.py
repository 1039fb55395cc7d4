"""The opener and the number parser that all readers share."""

import bz2
import gzip
import lzma
import math

import pytest

from geokalman import reading
from geokalman.reading import InputError


class OwnError(InputError):
    pass


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1.5", 1.5),
        (" -2 ", -2.0),
        ("1.5D-03", 1.5e-3),
        ("1.5d3", 1.5e3),
        ("-.5D0", -0.5),
        ("1.5-103", 1.5e-103),
        ("7.017765933D-11", 7.017765933e-11),
        ("1E5", 1e5),
        ("\N{MINUS SIGN}1.5", -1.5),
    ],
)
def test_numbers_of_c_and_fortran(text, value):
    assert reading.number(text) == value


@pytest.mark.parametrize(
    "text", ["", "x", "1,5", "nan", "inf", "-Infinity", "1_000", "0x10", "1.5D", "D3", "1 2", "١٢x"]
)
def test_what_is_no_number_is_said_with_the_word(text):
    with pytest.raises(ValueError, match="is not (a number|finite)") as caught:
        reading.number(text)
    assert repr(text) in str(caught.value)


def test_a_decimal_comma_is_named():
    with pytest.raises(ValueError, match="decimal mark is a point"):
        reading.number("1,5")


@pytest.mark.parametrize(("text", "value"), [("12", 12), ("12.0", 12), ("1.2e1", 12), ("9007199254740993", 2**53 + 1)])
def test_whole_numbers(text, value):
    assert reading.integer(text) == value


def test_a_fraction_is_no_whole_number():
    with pytest.raises(ValueError, match="'12.5' is not a whole number"):
        reading.integer("12.5")


def test_a_place_names_file_line_and_field(tmp_path):
    place = reading.Place(tmp_path / "a.txt", 7, OwnError)
    with pytest.raises(OwnError, match=r"a\.txt, line 7: radius 'x' is not a number\.$"):
        place.number("x", "radius")
    with pytest.raises(OwnError, match=r"line 7: degree '2\.5' is not a whole number\.$"):
        place.integer("2.5", "degree")
    assert str(reading.Place(tmp_path / "a.txt").error("empty.")).endswith("a.txt: empty.")


TEXT = "first\nsecond 1.0\n"


@pytest.mark.parametrize("pack", [bytes, gzip.compress, lzma.compress, bz2.compress])
@pytest.mark.parametrize("name", ["a.txt", "a.gz", "a.GZ"])
def test_compression_is_told_by_the_first_bytes(tmp_path, pack, name):
    path = tmp_path / name
    path.write_bytes(pack(TEXT.encode()))
    assert [line for _, line in reading.lines(path)] == TEXT.splitlines()
    assert reading.read_bytes(path) == TEXT.encode()


@pytest.mark.parametrize("pack", [gzip.compress, lzma.compress, bz2.compress])
@pytest.mark.parametrize("cut", [8, 40])
def test_a_cut_file_is_one_sentence(tmp_path, pack, cut):
    path = tmp_path / "a"
    path.write_bytes(pack(b"".join(b"%d\n" % k for k in range(1000)))[:-cut])
    for read in (reading.read_bytes, lambda *a: list(reading.lines(*a))):
        with pytest.raises(OwnError, match="cut short or damaged"):
            read(path, "file", OwnError)


@pytest.mark.parametrize(
    ("encoding", "mark"),
    [
        ("utf-8", b""),
        ("utf-8", b"\xef\xbb\xbf"),
        ("utf-16-le", b"\xff\xfe"),
        ("utf-16-be", b"\xfe\xff"),
        ("latin-1", b""),
    ],
)
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_encodings_and_line_ends(tmp_path, encoding, mark, end):
    path = tmp_path / "a.txt"
    path.write_bytes(mark + f"Größe{end}1.0{end}".encode(encoding))
    assert [(place.line, line) for place, line in reading.lines(path)] == [(1, "Größe"), (2, "1.0")]


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"PK\x03\x04rest", "zip archive; unpack it"),
        (b"\x1f\x9drest", "Unix compress"),
        (b"\x28\xb5\x2f\xfdrest", "zstd"),
        (bytes(257) + b"ustar", "tar archive"),
        (gzip.compress(bytes(257) + b"ustar", mtime=0), "tar archive"),
        (gzip.compress(gzip.compress(b"x", mtime=0), mtime=0), "compressed twice"),
        (b"PK\x05\x06" + bytes(18), "zip archive"),
        (lzma.compress(b"x", lzma.FORMAT_ALONE), "compressed by lzma"),
        (b"\x89HDF\r\n", "HDF5 or netCDF file, not a gravity field"),
        (b"CDF\x01", "netCDF file"),
        (b"version https://git-lfs.github.com/spec/v1\n", "git lfs pull"),
        (b'<?xml version="1.0"?><Error>', "XML document"),
        (b"\n<!DOCTYPE html><title>Log in</title>", "web page, not a gravity field"),
    ],
)
def test_what_must_be_unpacked_or_fetched_anew_is_said(tmp_path, content, words):
    path = tmp_path / "a.gfc"
    path.write_bytes(content)
    with pytest.raises(OwnError, match=words):
        list(reading.lines(path, "gravity field", OwnError))


def test_a_line_without_end_is_not_read_to_its_end(tmp_path, monkeypatch):
    monkeypatch.setattr(reading, "MAX_LINE", 100)
    path = tmp_path / "a.txt"
    path.write_bytes(b"short\n" + gzip.compress(b"")[:0] + b"x" * 1000)
    with pytest.raises(InputError, match="line 2: the line is longer than 100"):
        list(reading.lines(path))


def test_a_small_file_that_unpacks_to_a_giant_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(reading, "MAX_BYTES", 1 << 20)
    path = tmp_path / "a.gz"
    path.write_bytes(gzip.compress(bytes(1 << 22)))
    with pytest.raises(InputError, match="more than"):
        reading.read_bytes(path)


def test_zero_bytes_are_no_text(tmp_path):
    path = tmp_path / "a.txt"
    path.write_bytes(b"abc\n\0\0\0\n")
    with pytest.raises(InputError, match="line 2: it has a zero byte"):
        list(reading.lines(path))


def test_no_file_and_a_folder(tmp_path):
    with pytest.raises(FileNotFoundError, match="No gravity field at"):
        reading.read_bytes(tmp_path / "none", "gravity field")
    with pytest.raises(IsADirectoryError, match="is a folder; give the path of a gravity field"):
        reading.read_bytes(tmp_path, "gravity field")


def test_every_finite_float_survives():
    for value in (math.pi, 5e-324, 1.7976931348623157e308, -0.1):
        assert reading.number(repr(value)) == value


def test_byte_order_marks_inside_a_file_are_no_text(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("\ufeff\ufeffa\n\ufeffb 1\n", encoding="utf-8")
    assert [line for _, line in reading.lines(path)] == ["a", "b 1"]


def test_a_broken_utf_16_is_one_sentence_without_codecs(tmp_path):
    path = tmp_path / "a.txt"
    path.write_bytes("a\nb\n".encode("utf-16")[:-1])
    with pytest.raises(InputError, match="no UTF-16, as the byte order mark promises"):
        list(reading.lines(path))


def test_a_pipe_is_refused_before_it_loses_its_beginning(tmp_path):
    with pytest.raises(InputError, match="pipe or a device"):
        reading.read_bytes("/dev/null")


def test_many_short_lines_are_counted_too(tmp_path, monkeypatch):
    monkeypatch.setattr(reading, "MAX_BYTES", 100)
    path = tmp_path / "a.gz"
    path.write_bytes(gzip.compress(b"x\n" * 1000))
    with pytest.raises(InputError, match="holds more than"):
        list(reading.lines(path))
