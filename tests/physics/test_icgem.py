"""The ICGEM reader: every keyword and line type, and one clear sentence for every way a file can be wrong."""

import bz2
import datetime
import gzip
import lzma
import math
import warnings

import numpy as np
import pytest

from geokalman.physics.field import EARTH, GravityField, require_body
from geokalman.physics.harmonics import load_field
from geokalman.physics.icgem import GfcError, GfcWarning, read_gfc, write_gfc

HEADER = {
    "product_type": "gravity_field",
    "modelname": "TOY",
    "earth_gravity_constant": "0.3986004415E+15",
    "radius": "0.6378136300E+07",
    "max_degree": "2",
    "errors": "no",
    "norm": "fully_normalized",
    "tide_system": "tide_free",
}
ROWS = ["gfc 0 0 1.0 0.0", "gfc 2 0 -4.8e-4 0.0", "gfc 2 1 -1.8e-10 1.2e-9", "gfc 2 2 2.4e-6 -1.4e-6"]


def gfc(folder, rows=ROWS, name="toy.gfc", end=True, before="some words\n", **header):
    lines = [f"{key}   {value}" for key, value in {**HEADER, **header}.items() if value is not None]
    text = before + "\n".join([*lines, *(["end_of_head ======"] if end else []), *rows]) + "\n"
    path = folder / name
    path.write_bytes(gzip.compress(text.encode()) if name.endswith(".gz") else text.encode())
    return path


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


VARIABLE = [*ROWS[:1], "gfct 2 0 -4.8e-4 0.0 20050101", "trnd 2 0 1.1e-11 0.0", "acos 2 0 4e-11 0.0 1.0",
            "asin 2 0 5e-11 0.0 0.5", *ROWS[2:]]  # fmt: skip


def test_time_variable_coefficient_at_its_reference_epoch(tmp_path):
    assert read_gfc(gfc(tmp_path, VARIABLE)).C[2, 0] == -4.8e-4


def test_time_variable_coefficient_at_an_epoch(tmp_path):
    field = read_gfc(gfc(tmp_path, VARIABLE), epoch=datetime.date(2007, 4, 2))
    years = (datetime.date(2007, 4, 2) - datetime.date(2005, 1, 1)).days / 365.25
    wanted = -4.8e-4 + 1.1e-11 * years + 4e-11 * math.cos(2 * math.pi * years) + 5e-11 * math.sin(4 * math.pi * years)
    assert field.C[2, 0] == pytest.approx(wanted, rel=2e-15)
    assert field.C[2, 0] != -4.8e-4


def test_errors_of_a_time_variable_coefficient(tmp_path):
    rows = ["gfct 2 0 -4.8e-4 0.0 1e-12 0.0 20050101", *(row + " 2e-12 3e-12" for row in ROWS[2:])]
    field = read_gfc(gfc(tmp_path, rows, errors="formal"))
    assert field.sigma_C[2, 0] == 1e-12 and field.sigma_C[2, 1] == 2e-12


INTERVALS = ["gfct 2 0 -4.8e-4 0.0 20000101.0000 20100101.1200", "trnd 2 0 1e-11 0.0 20000101 20100101.1200",
             "gfct 2 0 -4.9e-4 0.0 20100101.1200 20200101", "asin 2 0 1e-11 0.0 20100101.1200 20200101 1.0",
             *ROWS[2:]]  # fmt: skip


@pytest.mark.parametrize(
    ("epoch", "base", "slope"),
    [(datetime.date(2001, 1, 1), -4.8e-4, 1e-11 * 366 / 365.25), (datetime.datetime(2010, 1, 1, 12), -4.9e-4, 0.0)],
)
def test_second_format_takes_the_interval_of_the_epoch(tmp_path, epoch, base, slope):
    path = gfc(tmp_path, INTERVALS, format="icgem2.0")
    assert read_gfc(path, epoch).C[2, 0] == pytest.approx(base + slope, rel=2e-15)


def test_second_format_without_an_epoch_asks_for_one(tmp_path):
    path = gfc(tmp_path, INTERVALS, format="icgem2.0")
    with pytest.raises(
        GfcError, match=r"line 14: coefficient \(2, 0\) has 2 gfct lines, first in line 12; give one epoch"
    ):
        read_gfc(path)
    with pytest.raises(GfcError, match="no gfct line covers 2030-01-01"):
        read_gfc(path, datetime.date(2030, 1, 1))


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"rows": ROWS[:3]}, r"1 coefficients up to its max_degree 2 are missing, \(degree, order\) = \(2, 2\)"),
        ({"rows": []}, r"3 coefficients .* are missing, .* = \(2, 0\), \(2, 1\), \(2, 2\); the file is truncated"),
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
        ({"norm": "schmidt"}, "line 8: norm 'schmidt' is unknown; known are fully_normalized, unnormalized"),
        ({"errors": "many"}, "line 7: errors 'many' is unknown; known are no, calibrated, formal"),
        ({"product_type": "topography"}, "line 2: product_type 'topography' is unknown"),
    ],
)
def test_one_sentence_for_each_way_to_be_wrong(tmp_path, changes, says):
    path = gfc(tmp_path, **{k: v for k, v in changes.items()})
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
        (b"radius 1\0\0\n", "line 1: a zero byte stands there"),
        (b"GRCOF2    2    0 -0.484165E-03 0.0\n", "no line 'end_of_head'"),
        (b"x" * (1 << 21), "line 1: the line is longer than"),
    ],
)
def test_what_is_no_gfc_file(tmp_path, content, says):
    path = tmp_path / "a.gfc"
    path.write_bytes(content)
    with pytest.raises(GfcError, match=says):
        read_gfc(path)


# Keywords that give the numbers their meaning


@pytest.mark.parametrize(
    "header",
    [
        {"radius": "6378.1363 km"},
        {"radius": "6378.1363 [km]", "earth_gravity_constant": "398600.4415 [km^3/s^2]"},
        {"radius": "6378136.3 (m)", "earth_gravity_constant": "398600.4415 km**3/sec**2"},
        {"radius": "= 6378136.3 m", "earth_gravity_constant": "= 3.986004415d14 m3 s-2"},
        {"radius:": "6378136.3   # of the model", "radius": None},
        {"norm": "Fully Normalised", "errors": "NO"},
        {"norm": "fully-normalized", "format": "ICGEM1.0", "product_type": "Gravity_Field"},
        {"body": "earth", "url": "http://icgem.gfz-potsdam.de/radius", "generating_institute": "GFZ"},
        {"errors": "unknown"},
    ],
)
def test_units_and_spellings_are_honoured(tmp_path, header):
    field = read_gfc(gfc(tmp_path, **header))
    assert field.gm == pytest.approx(3.986004415e14, rel=1e-15) and field.radius == pytest.approx(6378136.3, rel=1e-15)
    assert field.C[2, 0] == -4.8e-4 and field.sigma_C is None


def test_a_name_of_several_words_and_a_factor_behind_the_errors(tmp_path):
    rows = [row + " 1e-12 2e-12" for row in ROWS]
    field = read_gfc(gfc(tmp_path, rows, modelname="TOY (version 2)", errors="calibrated (factor = 2.00)"))
    assert field.name == "TOY (version 2)" and field.sigma_S[2, 1] == 2e-12
    four = gfc(tmp_path, [row + " 1e-12 2e-12 3e-12 4e-12" for row in ROWS], errors="calibrated and formal")
    assert read_gfc(four).sigma_C[2, 1] == 1e-12


@pytest.mark.parametrize("before", ["", "begin_of_head\nmodelname a\nmodelname b\n"])
def test_a_name_is_not_needed(tmp_path, before):
    assert read_gfc(gfc(tmp_path, before=before, modelname="")).name == ("a" if before else "toy")


def test_prose_before_a_header_without_its_begin(tmp_path):
    prose = "errors of it are calibrated\nradius of 6378 km\nformat description: www\nnorm is the usual\nerrors\n"
    assert read_gfc(gfc(tmp_path, before=prose)).n_max == 2


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"format": "icgem99.0"}, "format 'icgem99.0' is unknown; known are icgem1.0, icgem2.0"),
        ({"radius": "6378136.3 ft"}, "line 5: radius = 6378136.3 has the unknown unit 'ft'"),
        ({"before": "begin_of_head\nradius\n"}, "line 2: radius has no value"),
        ({"before": "radius 6378137.0\n"}, "line 5: radius = 0.63.* stands otherwise in line 1; one is right"),
        ({"gravity_constant": "6.67e-11"}, "line 10: gravity_constant = 6.67e-11 stands otherwise in line 4"),
        ({"before": "begin_of_head\n", "norm": "schmidt semi"}, "line 8: norm 'schmidt' is unknown"),
        ({"max_degree": "1000000000"}, "max_degree = 1000000000 must be an integer of at least 2 and at most"),
        ({"max_degree": "60000"}, "1800089995 coefficients up to its max_degree 60000 are missing"),
        ({"before": "prose\nerrors of it\n", "errors": "of it"}, "line 8: errors 'of' is unknown"),
        ({"radius": "6378,1363"}, "radius '6378,1363' is not a number; the decimal mark is a point"),
    ],
)
def test_keywords_that_cannot_be_honoured(tmp_path, changes, says):
    with pytest.raises(GfcError, match=says):
        read_gfc(gfc(tmp_path, **changes))


# What no body has


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"radius": "6378.1363"}, "line 5: GM = 3.98.* and radius = 6378.1363 m give the density 5.49e.12"),
        ({"radius": "1e-200"}, "give the density inf kg"),
        ({"radius": "1e200"}, "give the density 0 kg"),
        ({"earth_gravity_constant": "398600.4415"}, "line 4: GM = 398600.4415 .* give the density 5.49e-06"),
        ({"earth_gravity_constant": "398600.4415", "radius": "6378.1363"}, "line 4: .* of a planet in km"),
        ({"earth_gravity_constant": "42828.37", "radius": "3397.0"}, "line 4: .* of a planet in km"),
        ({"rows": ["gfc 2 0 -1.0826e-3 0", *ROWS[2:]]}, r"line 11: coefficient \(2, 0\) .*'norm unnormalized'"),
        ({"rows": ["gfc 2 0 4.84e-4 0", *ROWS[2:]]}, "line 11: C20 = 0.000484 has the wrong sign"),
        (
            {"rows": [*ROWS[:2], "gfc 2 1 0 -1.2e-2", ROWS[3]]},
            r"line 13: coefficient \(2, 1\) = 0, -0.012: of the Earth",
        ),
        ({"rows": [*ROWS[:3], "gfc 2 2 1.5e100 0"]}, r"line 14: coefficient \(2, 2\) = 1.5e\+100, 0"),
        (
            {"gravity_constant": "3.2e14", "earth_gravity_constant": None, "rows": ["gfc 2 0 2 0", *ROWS[2:]]},
            "of no body",
        ),
        ({"rows": ["gfc 0 0 0 0", *ROWS[1:]]}, "line 11: C_00 is 0: this is a difference of fields"),
        ({"rows": [*ROWS, "gfc 1 0 1e-7 0"]}, "degree 1 .* 1.1 m from the origin; at most 0.1 m is left out"),
        (
            {"errors": "formal", "rows": [r + " 1e-12 -1e-12" for r in ROWS]},
            "line 11: standard deviations .* not be neg",
        ),
    ],
)
def test_unphysical_files_are_refused(tmp_path, changes, says):
    with pytest.raises(GfcError, match=says):
        read_gfc(gfc(tmp_path, **changes))


@pytest.mark.parametrize(
    ("gm", "radius", "C20"),
    [
        ("4.9028010560e+12", "1.7380e+06", "-9.087956e-05"),  # the Moon
        ("4.28283763830d13", "3.39420d6", "-0.87596e-03"),  # Mars
        ("3.248585920790d14", "6.0510d6", "-0.19697e-05"),  # Venus
        ("1.26687e17", "7.1492e7", "-6.57e-3"),  # Jupiter
        ("4.463e5", "16000", "-5.2e-2"),  # Eros
    ],
)
def test_other_bodies_are_accepted(tmp_path, gm, radius, C20):
    header = {"earth_gravity_constant": None, "gravity_constant": gm, "radius": radius}
    assert read_gfc(gfc(tmp_path, [f"gfc 2 0 {C20} 0", *ROWS[2:]], **header)).C[2, 0] == float(C20)


def test_a_small_degree_one_is_left_out_with_a_warning(tmp_path):
    """7e-11 is 0.8 mm: models of satellites carry the geocentre."""
    path = gfc(tmp_path, [*ROWS, "gfc 1 0 7.017765933D-11 0.0", "gfc 1 1 0 0"])
    with pytest.warns(GfcWarning, match=r"degree 1 \(C10 = 7.01777e-11, .* 0.78 mm from the origin; it is left out"):
        field = read_gfc(path)
    assert not field.C[1].any() and field == read_gfc(gfc(tmp_path, name="without.gfc"))


def test_a_field_is_held_to_its_body(tmp_path):
    assert require_body(read_gfc(gfc(tmp_path)), EARTH).n_max == 2
    earth = load_field("JGM3", 3)
    moon = GravityField("moon", 4.9e12, 1.738e6, earth.C, earth.S)
    with pytest.raises(ValueError, match="moon: GM = 4.9e.12 is not that of the Earth, .*; it is that of another body"):
        require_body(moon, EARTH)


# Rows and times


def test_rows_in_any_order_with_remarks_and_capitals(tmp_path):
    rows = ["# by order", ROWS[3].upper(), "", ROWS[1] + "  ", "#gfc 2 0 0 0", ROWS[2].replace(" ", "\t")]
    assert read_gfc(gfc(tmp_path, rows)) == read_gfc(gfc(tmp_path, name="sorted.gfc"))


def test_a_term_may_stand_before_its_value_and_without_errors(tmp_path):
    rows = ["trnd 2 0 1e-11 0", "acos 2 0 4e-11 0 1.0", "gfct 2 0 -4.8e-4 0 1e-12 0 20050101.0000",
            *(row + " 1e-12 1e-12" for row in ROWS[2:])]  # fmt: skip
    field = read_gfc(gfc(tmp_path, rows, errors="formal"), datetime.date(2006, 1, 1))
    years = 365 / 365.25
    assert field.C[2, 0] == pytest.approx(-4.8e-4 + 1e-11 * years + 4e-11 * math.cos(2 * math.pi * years), rel=1e-15)


def test_a_term_counts_from_its_own_epoch(tmp_path):
    """EIGEN-6S4: one annual term from 1950 to 2003 beside values that hold for a year each."""
    rows = ["gfct 2 0 -4.8e-4 0 20020815.0817 20030101", "acos 2 0 4e-11 0 19500101 20030101 1.0", *ROWS[2:]]
    field = read_gfc(gfc(tmp_path, rows, format="icgem2.0"), datetime.date(2002, 9, 1))
    years = (datetime.date(2002, 9, 1) - datetime.date(1950, 1, 1)).days / 365.25
    assert field.C[2, 0] == pytest.approx(-4.8e-4 + 4e-11 * math.cos(2 * math.pi * years), rel=1e-15)


@pytest.mark.parametrize(
    ("epoch", "hours"),
    [
        (datetime.datetime(2007, 4, 2, 12), 12),
        (datetime.datetime(2007, 4, 2, 12, tzinfo=datetime.timezone(datetime.timedelta(hours=-10))), 22),
        (np.datetime64("2007-04-02T06:00"), 6),
    ],
)
def test_epochs_with_and_without_a_zone(tmp_path, epoch, hours):
    rows = ["gfct 2 0 -4.8e-4 0.0 20050101", "trnd 2 0 1e-6 0.0", *ROWS[2:]]
    years = ((datetime.date(2007, 4, 2) - datetime.date(2005, 1, 1)).days + hours / 24) / 365.25
    assert read_gfc(gfc(tmp_path, rows), epoch).C[2, 0] == pytest.approx(-4.8e-4 + 1e-6 * years, rel=1e-14)


@pytest.mark.parametrize("epoch", ["2007-04-02", 2007.25, np.datetime64("NaT")])
def test_what_is_no_epoch_is_refused(tmp_path, epoch):
    with pytest.raises(ValueError, match="is no date; give a datetime.date"):
        read_gfc(gfc(tmp_path), epoch)


V2 = {"format": "icgem2.0"}
YEARS = "20000101 20100101"


@pytest.mark.parametrize(
    ("rows", "header", "says"),
    [
        ([*ROWS, "dot 2 0 1e-11 0"], {}, r"line 15: coefficient \(2, 0\) has a trend .* no gfct line"),
        ([*ROWS, "GFC 2 1 -1.8e-10 1.2e-9"], {}, r"line 15: coefficient \(2, 1\) occurs twice, first in line 13"),
        ([ROWS[2], ROWS[2], *ROWS[2:]], {}, r"line 12: coefficient \(2, 1\) occurs twice, first in line 11"),
        (
            [*VARIABLE, "trnd 2 0 1.1e-11 0.0"],
            {},
            r"line 18: this term of coefficient \(2, 0\) stands there already, in line 13",
        ),
        ([f"gfct 2 0 -4.8e-4 0 {YEARS}", *ROWS[2:]], {}, "line 11: 7 columns where 6 are right .* 'format icgem2.0'"),
        (
            ["gfct 2 0 -4.8e-4 0 20100101 20000101", *ROWS[2:]],
            V2,
            "line 12: the interval 20100101 to 20000101 is empty",
        ),
        (["gfct 2 0 -4.8e-4 0 20000101", *ROWS[2:]], V2, "line 12: 6 columns where 7 are needed"),
        (
            [f"gfct 2 0 -4.8e-4 0 {YEARS}"] * 2 + ROWS[2:],
            V2,
            "line 13: coefficient .* 2 gfct lines, first in line 12; one is right",
        ),
        (["gfct 2 0 -4.8e-4 0 2005111", *ROWS[2:]], {}, "'2005111' is no date"),
        (["gfct 2 0 -4.8e-4 0 20050101.5", *ROWS[2:]], {}, "'20050101.5' is no date"),
        (["gfct 2 0 -4.8e-4 0 2005.0", *ROWS[2:]], {}, "'2005.0' is no date"),
        ([*ROWS, "\x01"], {}, "begins no data line; they begin with gfc, gfct"),
        (["gfc 2 0 -0.48E-03-0.1E-09"], {}, "4 columns where 5 are needed"),
        (["gfc 2 0 **** 0"], {}, r"line 11: '\*\*\*\*' is not a number"),
        (["gfc 2 -1 0 0"], {}, "degree 2 and order -1 must satisfy"),
    ],
)
def test_rows_are_refused_by_line(tmp_path, rows, header, says):
    with pytest.raises(GfcError, match=says), warnings.catch_warnings():
        warnings.simplefilter("error")
        read_gfc(gfc(tmp_path, rows, **header), datetime.date(2005, 6, 1))


def test_a_date_between_intervals_names_them(tmp_path):
    with pytest.raises(
        GfcError, match="no gfct line covers 2030-01-01, only 2000-01-01 to 2010-01-01, 2010-01-01 to 2020-"
    ):
        read_gfc(gfc(tmp_path, INTERVALS, format="icgem2.0"), datetime.date(2030, 1, 1))


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
