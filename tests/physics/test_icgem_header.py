"""The ICGEM reader on headers: units, spellings, what cannot be honoured and what is unphysical."""

import pytest
from gfcfiles import ROWS, gfc

from geokalman.physics.field import EARTH, GravityField, require_body
from geokalman.physics.harmonics import load_field
from geokalman.physics.icgem import GfcError, GfcWarning, read_gfc


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
        ({"format": "icgem99.0"}, "format 'icgem99.0' is unknown; it must be one of icgem1.0, icgem2.0"),
        ({"radius": "6378136.3 ft"}, "line 5: radius = 6378136.3 has the unknown unit 'ft'"),
        ({"before": "begin_of_head\nradius\n"}, "line 2: radius has no value"),
        ({"before": "radius 6378137.0\n"}, "line 5: radius = 0.63.* is given otherwise in line 1; one is right"),
        ({"gravity_constant": "6.67e-11"}, "line 10: gravity_constant = 6.67e-11 is given otherwise in line 4"),
        ({"before": "begin_of_head\n", "norm": "schmidt semi"}, "line 8: norm 'schmidt' is unknown"),
        ({"max_degree": "1000000000"}, "max_degree = 1000000000 must be an integer of at least 2 and at most"),
        ({"max_degree": "60000"}, "up to its max_degree 60000 the file lacks 1800089995 coefficients"),
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


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"earth_gravity_constant": "4.2828e13", "radius": "3397000", "rows": ["gfc 2 0 -8.745e-4 0", *ROWS[2:]]},
         r"line 4: GM = 4.2828e\+13 is not that of the Earth"),
        ({"radius": "6.0e6"}, r"line 5: radius = 6e\+06 is not that of the Earth, 6.3781.*e\+06 m"),
        ({"rows": ["gfc 2 0 -4.5e-4 0", *ROWS[2:]]}, "line 11: C20 = -0.00045 where the fully normalised one of the Earth"),
    ],
)  # fmt: skip
def test_a_file_of_another_body_is_refused_by_its_line(tmp_path, changes, says):
    path = gfc(tmp_path, **changes)
    with pytest.raises(GfcError, match=f"^{path}, {says}"):
        load_field(path, 2, EARTH)
    assert load_field(path, 2).n_max == 2
    with pytest.raises(ValueError, match="GM = 4.28.* is not that of the Earth"):
        load_field("GMM2B", 4, EARTH)
