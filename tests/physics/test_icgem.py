"""The ICGEM reader: every keyword and line type, and one clear sentence for every way a file can be wrong."""

import bz2
import gzip
import lzma
import math

import numpy as np
import pytest
from gfcfiles import ROWS, gfc

from geokalman.physics.harmonics import load_field
from geokalman.physics.icgem import GfcError, read_gfc, write_gfc


def test_header_and_coefficients(tmp_path):
    field = read_gfc(gfc(tmp_path))
    assert (field.name, field.gm, field.radius, field.n_max) == ("TOY", 3.986004415e14, 6378136.3, 2)
    assert field.tide_system == "tide_free" and field.sigma_C is None
    assert field.C[2, 0] == -4.8e-4 and field.S[2, 1] == 1.2e-9 and field.C[0, 0] == 1.0 and field.C[1, 0] == 0.0


def test_alternative_keyword_gzip_blank_lines_and_absent_degree_zero(tmp_path):
    rows = ["", *ROWS[1:], "  "]
    header = {
        "earth_gravity_constant": None,
        "gravity_constant": "4e14",
        "modelname": None,
        "errors": None,
        "norm": None,
    }
    field = read_gfc(gfc(tmp_path, rows, name="toy.gfc.gz", **header))
    assert field.gm == 4e14 and field.name == "toy" and field.C[0, 0] == 1.0


def test_words_before_begin_of_head_do_not_count(tmp_path):
    field = read_gfc(gfc(tmp_path, before="radius 1.0\nbegin_of_head ====\n"))
    assert field.radius == 6378136.3


@pytest.mark.parametrize(
    ("written", "value"),
    [
        ("-0.48D-09", -4.8e-10),
        ("-.48d-9", -4.8e-10),
        ("-0.48E-009", -4.8e-10),
        ("-4.8-104", -4.8e-104),
        ("1.5-100", 1.5e-100),
    ],
)
def test_numbers_as_fortran_writes_them(tmp_path, written, value):
    rows = [*ROWS[:2], f"gfc 2 1 {written} 0.0D0", ROWS[3]]
    assert read_gfc(gfc(tmp_path, rows)).C[2, 1] == value


@pytest.mark.parametrize(
    ("word", "system"),
    [
        ("zero", "zero_tide"),
        ("Mean_Tide", "mean_tide"),
        ("free", "tide_free"),
        ("?", "unknown"),
        ("zero tide", "zero_tide"),
        ("tide free", "tide_free"),
        ("tide-free (conventional)", "tide_free"),
        (None, "unknown"),
    ],
)
def test_tide_systems_as_files_spell_them(tmp_path, word, system):
    assert read_gfc(gfc(tmp_path, tide_system=word)).tide_system == system


def test_errors_calibrated_before_formal(tmp_path):
    rows = [row + " 1e-12 2e-12 3e-12 4e-12" for row in ROWS]
    field = read_gfc(gfc(tmp_path, rows, errors="calibrated_and_formal"))
    assert field.sigma_C[2, 2] == 1e-12 and field.sigma_S[2, 2] == 2e-12


def test_errors_found_where_the_header_is_silent(tmp_path):
    field = read_gfc(gfc(tmp_path, [row + " 1e-12 2e-12" for row in ROWS], errors=None))
    assert field.sigma_S[2, 1] == 2e-12


def test_meaningless_s_n0_is_dropped(tmp_path):
    assert read_gfc(gfc(tmp_path, ["gfc 2 0 -4.8e-4 3e-14", *ROWS[2:]])).S[2, 0] == 0.0


def test_unnormalised_coefficients_are_normalised_by_the_factorials(tmp_path):
    J2, C21, C22, S22 = 1.0826e-3, -3e-10, 1.57e-6, -9.0e-7
    rows = [f"gfc 2 0 {-J2} 0", f"gfc 2 1 {C21} 0", f"gfc 2 2 {C22} {S22}"]
    field = read_gfc(gfc(tmp_path, rows, norm="unnormalized"))

    def factor(n, m):
        return math.sqrt((2 - (m == 0)) * (2 * n + 1) * math.factorial(n - m) / math.factorial(n + m))

    assert field.C[2, 0] == pytest.approx(-J2 / math.sqrt(5.0), rel=2e-15)
    assert field.C[2, 1] == pytest.approx(C21 / factor(2, 1), rel=2e-15)
    assert field.C[2, 2] == pytest.approx(C22 / factor(2, 2), rel=2e-15)
    assert field.S[2, 2] == pytest.approx(S22 / factor(2, 2), rel=2e-15)


def test_unnormalised_beyond_float64_is_refused(tmp_path):
    rows = [f"gfc {n} {m} 0 0" for n in range(2, 152) for m in range(n + 1)]
    with pytest.raises(GfcError, match="to degree 151 leave the range of float64; at most 150"):
        read_gfc(gfc(tmp_path, rows, norm="unnormalized", max_degree=151))


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"rows": ROWS[:3]}, r"max_degree 2 the file lacks 1 coefficient, \(degree, order\) = \(2, 2\)"),
        ({"rows": []}, r"lacks 3 coefficients, .* = \(2, 0\), \(2, 1\), \(2, 2\); it is truncated"),
        ({"rows": [*ROWS, ROWS[2]]}, r"line 15: coefficient \(2, 1\) occurs twice, first in line 13"),
        ({"rows": [*ROWS, "gfct 2 1 0 0 20050101"]}, r"line 15: coefficient \(2, 1\) occurs twice, first in line 13"),
        ({"rows": [*ROWS[:3], "gfc 2 2 2.4e-6"]}, "line 14: 4 columns where 5 are needed .* truncated"),
        ({"errors": "formal"}, "line 11: 5 columns where 7 are needed"),
        ({"rows": ["gfc 2 0 abc 0.0"]}, "line 11: 'abc' is not a number"),
        ({"rows": ["gfc 2 0 nan 0.0"]}, "line 11: 'nan' is not finite"),
        ({"rows": ["gfc 2 0 1e999 0.0"]}, "line 11: '1e999' is not finite"),
        ({"rows": ["gfc 2 x 1.0 0.0"]}, "line 11: degree and order '2 x' must be integers"),
        ({"rows": ["gfc 2 3 1.0 0.0"]}, "line 11: degree 2 and order 3 must satisfy"),
        ({"rows": ["gfc 3 0 1.0 0.0"]}, "line 11: degree 3 exceeds the header's max_degree 2"),
        ({"rows": ["2 0 1.0 0.0"]}, "line 11: '2' begins no data line"),
        (
            {"rows": ["trnd 2 0 1.0 0.0"]},
            r"line 11: coefficient \(2, 0\) has a trend or periodic term, but no gfct line gives its value",
        ),
        ({"rows": ["gfct 2 0 1.0 0.0 2005-01-01"]}, "line 11: '2005-01-01' is no date of the form yyyymmdd"),
        ({"rows": ["acos 2 0 1.0 0.0 -1.0"]}, r"line 11: period -1.0 must be positive \(years\)"),
        ({"rows": ["gfc 0 0 0.9 0", *ROWS[1:]]}, r"TOY: C\[0, 0\] = 0.9 must be 1"),
        ({"end": False}, "no line 'end_of_head'"),
        ({"earth_gravity_constant": None}, "the header lacks GM"),
        ({"radius": None}, "the header lacks the reference radius"),
        ({"max_degree": None}, "the header lacks the line 'max_degree'"),
        ({"max_degree": "two"}, "line 6: max_degree 'two' is not a number"),
        ({"max_degree": "2.5"}, "line 6: max_degree = 2.5 must be an integer"),
        ({"radius": "-1"}, "line 5: radius = -1 must be positive"),
        ({"norm": "schmidt"}, "line 8: norm 'schmidt' is unknown; it must be one of fully_normalized, unnormalized"),
        ({"errors": "many"}, "line 7: errors 'many' is unknown; it must be one of no, calibrated, formal"),
        ({"product_type": "topography"}, "line 2: product_type 'topography' is unknown; it must be gravity_field"),
    ],
)
def test_one_sentence_for_each_way_to_be_wrong(tmp_path, changes, says):
    path = gfc(tmp_path, **dict(changes.items()))
    with pytest.raises(GfcError, match=says) as caught:
        read_gfc(path)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


# Files as they come


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "latin-1"])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_encodings_and_ends_of_lines(tmp_path, encoding, end):
    """A mark before the first key must not hide it: `norm unnormalized` unseen is wrong by sqrt 5."""
    text = end.join(
        ["norm unnormalized", *gfc(tmp_path, before="").read_text().replace("norm", "remark").splitlines(), "# Förste"]
    )
    path = tmp_path / "odd.gfc"
    path.write_bytes(text.encode(encoding))
    assert read_gfc(path).C[2, 0] == pytest.approx(-4.8e-4 / math.sqrt(5.0), rel=1e-15)


@pytest.mark.parametrize("pack", [bytes, gzip.compress, bz2.compress, lzma.compress])
@pytest.mark.parametrize("name", ["a.gfc", "a.gfc.gz", "a.GZ", "a"])
def test_compression_is_told_by_the_bytes(tmp_path, pack, name):
    path = tmp_path / name
    path.write_bytes(pack(gfc(tmp_path).read_bytes()))
    assert read_gfc(path).C[2, 0] == -4.8e-4


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"PK\x03\x04...", "this is a zip archive; unpack it"),
        (b"<!DOCTYPE html><html>", "this is a web page, not a gravity field"),
        (b"", "no line 'end_of_head'"),
        (b"radius 1\0\0\n", "line 1: it has a zero byte"),
        (b"GRCOF2    2    0 -0.484165E-03 0.0\n", "no line 'end_of_head'"),
        (b"x" * (1 << 21), "line 1: the line is longer than"),
    ],
)
def test_what_is_no_gfc_file(tmp_path, content, says):
    path = tmp_path / "a.gfc"
    path.write_bytes(content)
    with pytest.raises(GfcError, match=says):
        read_gfc(path)


# Rows and times


def test_rows_in_any_order_with_remarks_and_capitals(tmp_path):
    rows = ["# by order", ROWS[3].upper(), "", ROWS[1] + "  ", "#gfc 2 0 0 0", ROWS[2].replace(" ", "\t")]
    assert read_gfc(gfc(tmp_path, rows)) == read_gfc(gfc(tmp_path, name="sorted.gfc"))


FIXED = [f"gfc {n:4d} {m:4d} {C: .6E} {S: .6E}" for n, m, C, S in
         ((2, 0, -4.8e-4, 0.0), (2, 1, -1.8e-10, 1.2e-9), (2, 2, 2.439383e-6, -1.400274e-6))]  # fmt: skip


@pytest.mark.parametrize(
    ("cut", "last"),
    [(1, "-1.400274E-0"), (2, "-1.400274E-"), (3, "-1.400274E"), (4, "-1.400274"), (6, "-1.4002"), (12, "-"),
     (14, "2.439383E-06"), (20, "2.4393"), (29, "2")],
)  # fmt: skip
def test_a_file_that_ends_within_its_last_line_is_truncated(tmp_path, cut, last):
    """Also where what is left of the number is a number."""
    path = gfc(tmp_path, FIXED)
    path.write_bytes(path.read_bytes().rstrip(b"\n")[:-cut])
    with pytest.raises(
        GfcError, match=f"toy.gfc, line 13: the file ends within this line, after '{last}': it is trunc"
    ):
        read_gfc(path)


@pytest.mark.parametrize("rows", [FIXED, ROWS])
def test_a_whole_last_line_needs_no_end(tmp_path, rows):
    path = gfc(tmp_path, rows)
    field = read_gfc(path)
    path.write_bytes(path.read_bytes().rstrip(b"\n"))
    assert read_gfc(path) == field


def test_an_exponent_that_is_broken_off_is_told_in_a_free_format(tmp_path):
    path = gfc(tmp_path, [*ROWS[:3], "gfc 2 2 2.439383576e-6 -1.4e-"])
    path.write_bytes(path.read_bytes().rstrip(b"\n"))
    with pytest.raises(GfcError, match="line 14: the file ends within this line, after '-1.4e-'"):
        read_gfc(path)


def test_truncated_gzip(tmp_path):
    path = gfc(tmp_path, name="toy.gfc.gz")
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(GfcError, match="after line .*: the file is cut short or damaged"):
        read_gfc(path)


def test_no_such_file(tmp_path):
    with pytest.raises(FileNotFoundError, match="No gravity field at .*none.gfc"):
        read_gfc(tmp_path / "none.gfc")


@pytest.mark.parametrize("name", ["copy.gfc", "copy.gfc.gz"])
def test_written_fields_come_back_bit_by_bit(tmp_path, name):
    jgm3 = load_field("JGM3", 12)
    write_gfc(jgm3, tmp_path / name)
    assert read_gfc(tmp_path / name) == jgm3
    assert load_field(tmp_path / name, 8) == jgm3.truncate(8)
    assert [p.name for p in tmp_path.iterdir()] == [name]


def test_a_field_without_errors_is_written_without(tmp_path):
    egm96 = load_field("EGM96", 5)
    path = write_gfc(egm96, tmp_path / "egm96.gfc")
    assert "errors                      no" in path.read_text()
    assert np.array_equal(read_gfc(path).C, egm96.C)


def test_failed_writing_leaves_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr("os.replace", lambda *_: (_ for _ in ()).throw(OSError("disk full")))
    with pytest.raises(OSError, match="disk full"):
        write_gfc(load_field("EGM96", 3), tmp_path / "x.gfc")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("key", ["norm", "normalization", "\ufeffnorm"])
def test_the_norm_is_honoured_however_its_key_is_written(tmp_path, key):
    field = read_gfc(gfc(tmp_path, **{"norm": None, key: "unnormalized"}))
    assert field.C[2, 0] == pytest.approx(-4.8e-4 / math.sqrt(5.0))


@pytest.mark.parametrize("gm", ["moon_gravity_constant", "GM", "planet_gravity_constant"])
def test_other_names_of_gm_and_radius(tmp_path, gm):
    keys = {"earth_gravity_constant": None, "radius": None, gm: "4e14", "reference_radius": "6378137"}
    field = read_gfc(gfc(tmp_path, **keys))
    assert (field.gm, field.radius) == (4e14, 6378137.0)
