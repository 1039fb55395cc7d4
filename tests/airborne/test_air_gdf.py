"""ASEG-GDF2: definitions as the standard and the contractors write them, read rightly or refused with file and row."""

import gzip

import numpy as np
import pytest

from geokalman.airborne import read
from geokalman.airborne.read.gdf import read_definition
from geokalman.airborne.read.tables import read_table
from geokalman.reading import InputError

WIDTH = {"LINE": 10, "FLIGHT": 8}


@pytest.fixture
def survey_file(rows, tmp_path):
    """Writes SURVEY.DAT and SURVEY.DFN: fields(name, k) is a definition, row(line) a row of data."""

    def write(
        fields=lambda name, k: f"DEFN {k} ST=RECD,RT=DATA;{name}:F{WIDTH.get(name, 16)}.{0 if name in WIDTH else 7}",
        head="DEFN   ST=RECD,RT=COMM;RT:A4;COMMENTS:A76\n",
        tail="DEFN 99 ST=RECD,RT=DATA;END DEFN\n",
        row=lambda line: line,
        first="",
        opener=open,
        **columns,
    ):
        table = {**rows, **columns}
        definition = head + "".join(fields(name, k) + "\n" for k, name in enumerate(table, 1)) + tail
        (tmp_path / "SURVEY.DFN").write_text(definition, encoding="latin-1")
        widths = [WIDTH.get(name, 16) for name in table]
        lines = [
            "".join(w.rjust(n) for w, n in zip(one, widths, strict=True)) for one in zip(*table.values(), strict=True)
        ]
        path = tmp_path / ("SURVEY.DAT" if opener is open else "SURVEY.DAT.gz")
        with opener(path, "wt") as stream:
            stream.write(first + "\n".join(map(row, lines)) + "\n")
        return path

    return write


def plain(name, k, record="DEFN {k} ST=RECD,RT=DATA;", form=None, more=""):
    form = form or f"F{WIDTH.get(name, 16)}.{0 if name in WIDTH else 7}"
    return record.format(k=k) + f"{name}:{form}{more}"


DEFINITIONS = {
    "as the standard": {},
    "lower case": {"fields": lambda n, k: plain(n, k).lower()},
    "an empty record type": {"fields": lambda n, k: plain(n, k, "DEFN {k} ST=RECD,RT=;")},
    "RECORD and numbers without blanks": {"fields": lambda n, k: plain(n, k, "DEFN{k:03d}ST=RECORD,RT=DATA;")},
    "blanks everywhere": {"fields": lambda n, k: plain(n, k, " DEFN {k} ST = RECD , RT = DATA ; ").replace(":", " : ")},
    "no numbers": {"fields": lambda n, k: plain(n, k, "DEFN ST=RECD,RT=DATA;")},
    "attributes by commas": {"fields": lambda n, k: plain(n, k, more=f":UNIT=x,NULL=-99999.999,NAME={n}, final")},
    "attributes by colons": {"fields": lambda n, k: plain(n, k, more=f":NULL=-99999.999:UNIT=x:NAME={n} (MGA50)")},
    "attributes by blanks": {"fields": lambda n, k: plain(n, k, more=f":NULL = -99999.999 UNIT = x NAME = {n}")},
    "a unit by a colon": {"fields": lambda n, k: plain(n, k, more=":UNIT:x:NAME=y")},
    "a name right after the format": {"fields": lambda n, k: plain(n, k, more=f",NAME={n}")},
    "a comment in Latin-1": {"fields": lambda n, k: plain(n, k, more=":NAME=H\u00f6he")},
    "exponents": {"fields": lambda n, k: plain(n, k, form=f"E{WIDTH.get(n, 16)}.7E3")},
    "double precision": {"fields": lambda n, k: plain(n, k, form=f"D{WIDTH.get(n, 16)}.7")},
    "a line in letters": {"fields": lambda n, k: plain(n, k, form="A10" if n == "LINE" else None)},
    "a label": {"fields": lambda n, k: plain(n, k, form="A10" if n == "LINE" else None), "LINE": ["L104000"] * 500},
    "text that nobody needs": {"fields": lambda n, k: plain(n, k, form="A16" if n == "PLANE" else None),
                               "PLANE": ["VH SGL"] * 500},
    "blanks between": {"fields": lambda n, k: plain("SKIP" if n == "GAP" else n, k, form="16X" if n == "GAP" else None),
                       "GAP": ["+++"] * 500},
    "a repeat count": {"fields": lambda n, k: plain(n, k, form="2F8.3" if n == "WIND" else None),
                       "WIND": ["   1.250  -7.500"] * 500},
    "two fields in one": {"fields": lambda n, k: "" if n == "FLIGHT" else plain(n, k) + ";FLIGHT:I8" * (n == "LINE")},
    "a record of projections": {"tail": "DEFN 99 ST=RECD,RT=DATA;END DEFN\nDEFN 1 ST=RECD,RT=PROJ;RT:A4\n"
                                        "DEFN 2 ST=RECD,RT=PROJ;COORDSYS:A40:NAME=x\nDEFN 3 ST=RECD,RT=PROJ;END DEFN\n",
                                "first": "PROJGDA94 / MGA zone 50\n"},
    "comments in the data": {"first": "COMM flown in March\nCOMM and levelled\n"},
    "record types in the data": {"head": "DEFN 1 ST=RECD,RT=DATA;RT:A4\n", "row": lambda line: "DATA" + line,
                                 "fields": lambda n, k: plain(n, k + 1)},
    "a record type without data": {"head": "DEFN 1 ST=RECD,RT=DATA;RT:A4\n", "fields": lambda n, k: plain(n, k + 1)},
    "END DEFN alone": {"tail": "END DEFN\n"},
    "no END DEFN": {"tail": ""},
    "blanks after the rows": {"row": lambda line: line + "   "},
    "blank lines": {"row": lambda line: line + "\n"},
    "free format": {"row": lambda line: " ".join(line.split())},
    "line ends of DOS": {"row": lambda line: line + "\r"},
    "gzip": {"opener": gzip.open},
}  # fmt: skip


@pytest.mark.parametrize("case", DEFINITIONS)
def test_a_sound_definition_is_read_however_it_is_written(case, survey_file, sound):
    flight = read.read_survey(survey_file(**DEFINITIONS[case]))[104000]
    np.testing.assert_allclose(flight.line.z, sound.line.z, atol=1e-6)
    np.testing.assert_array_equal(flight.references["ground"], sound.references["ground"])


@pytest.mark.parametrize(
    ("form", "null", "written"),
    [
        ("F16.3", "-99999.999", "-99999.999"),
        ("F16.8", "-99999.999", "-99999.99900000"),
        ("F16.2", "-99999.999", "-100000.00"),  # rounded by the format
        ("F16.1", "-999.9", "-999.9"),
        ("I16", "-9", "-9"),
        ("F16.0", "9999999", "9999999."),
        ("E16.8", "-1.0E+32", "-1.00000000E+32"),
        ("D16.8", "1.5D10", "0.15000000D+11"),
        ("F16.2", "55.5", "55.50"),  # any number may be declared
        ("F16.2", "DUMMY", "DUMMY"),
        ("F16.2", "void", "void"),
        ("F16.2", "*", "*"),
        ("F6.1", "-99999", "*" * 16),  # the null is wider than its field
        ("F16.2", "", ""),
    ],
)
@pytest.mark.parametrize("key", ["NULL=", "null = "])
def test_a_declared_null_is_one_in_its_column_only(form, null, written, key, survey_file, rows, sound):
    ground = [written if k in (100, 101) else word for k, word in enumerate(rows["GND_FA"])]
    form = form.replace("F6.1", "F16.1")

    def fields(name, k):
        return plain(name, k, form=form, more=f":UNIT=mGal,{key}{null},NAME=x") if name == "GND_FA" else plain(name, k)

    flight = read.read_survey(survey_file(fields, GND_FA=ground))[104000]
    assert np.flatnonzero(np.isnan(flight.references["ground"])).tolist() == [100, 101]
    assert len(flight.line.t) == 500
    np.testing.assert_array_equal(flight.line.z, sound.line.z)


def test_a_declared_null_is_a_value_in_another_column(survey_file, rows):
    """-9 is the null of the ground and no null of the contractor."""
    words = ["-9" if k == 7 else word for k, word in enumerate(rows["FLIGHT"])]
    table = read_table(survey_file(lambda n, k: plain(n, k, more=":NULL=-9" if n == "GND_FA" else ""), FLIGHT=words))
    assert table["FLIGHT"][7] == -9.0


def test_a_null_in_a_correction_makes_a_hole(survey_file, rows):
    lift = ["-999.99" if k in (7, 8, 9) else word for k, word in enumerate(rows["FACOR"])]
    path = survey_file(lambda n, k: plain(n, k, more=":NULL=-999.99,UNIT=mGal" if n == "FACOR" else ""), FACOR=lift)
    with pytest.warns(UserWarning, match="line 104000 is cut into 2 pieces: FACOR null at row 8 of the file"):
        assert [len(f.line.t) for f in read.read_survey(path, shortest=1.0).flights] == [7, 490]


def test_repeated_fields_are_columns_of_their_own(survey_file):
    table = read_table(survey_file(**DEFINITIONS["a repeat count"]))
    assert (table["WIND[0]"] == 1.25).all() and (table["WIND[1]"] == -7.5).all() and "WIND" not in table


@pytest.mark.parametrize(
    ("column", "unit", "factor"),
    [
        ("GPSZ", "ft", 1 / 0.3048), ("GPSZ", "FEET", 1 / 0.3048), ("UTC", "hours", 1 / 3600),
        ("UTC", "days", 1 / 86400), ("LAT", "rad", np.pi / 180), ("LON", "radians", np.pi / 180), ("EASTING", "km", 1e-3), ("FZ", "um/s2", 10.0),
        ("FZ", "m/s^2", 1e-5), ("FACOR", "gu", 10.0), ("GND_FA", "micrometres_per_second_squared", 10.0),
        ("FRAL100", "\u00b5m/s\u00b2", 10.0), ("NORTHING", "metres", 1.0), ("FZ", "mGal", 1.0),
    ],
)  # fmt: skip
def test_units_of_the_definition_are_honoured(column, unit, factor, survey_file, rows, sound):
    words = [f"{float(word) * factor:.10g}"[:15] for word in rows[column]]
    if column == "UTC":
        words = [f"{float(word) * factor:.12f}"[:15] for word in rows[column]]
    path = survey_file(lambda n, k: plain(n, k, more=f":UNIT={unit}" if n == column else ""), **{column: words})
    flight = read.read_survey(path)[104000]
    np.testing.assert_allclose(flight.height, sound.height, atol=1e-4)
    np.testing.assert_allclose(flight.lat, sound.lat, atol=1e-7)
    np.testing.assert_allclose(flight.line.f3, sound.line.f3, atol=1.0)
    for name in ("ground", "contractor"):
        np.testing.assert_allclose(flight.references[name], sound.references[name], atol=1e-6)
    assert abs(flight.line.z - sound.line.z).max() < 1e-4 * abs(sound.line.z).max()


def test_a_unit_of_another_kind_is_told_and_left_aside(survey_file, sound):
    path = survey_file(lambda n, k: plain(n, k, more=":UNIT=m" if n == "GND_FA" else ""))
    with pytest.warns(UserWarning, match="the file gives GND_FA in m, which cannot be; these units are left aside"):
        flight = read.read_survey(path)[104000]
    np.testing.assert_array_equal(flight.references["ground"], sound.references["ground"])


REFUSED = {
    "an unknown format": ({"fields": lambda n, k: plain(n, k, form="Q12")},
                          r"SURVEY.DFN, line 2: the format of LINE is 'Q12', not one like F10.2, I8, A4, 2E16.8"),
    "no format": ({"fields": lambda n, k: f"DEFN {k} ST=RECD,RT=DATA;{n}"}, "line 2: the format of LINE is ''"),
    "no width": ({"fields": lambda n, k: plain(n, k, form="F0.2")}, "'F0.2', which holds nothing or too much"),
    "a huge width": ({"fields": lambda n, k: plain(n, k, form="F100000000.2")}, "which holds nothing or too much"),
    "a huge count": ({"fields": lambda n, k: plain(n, k, form="100000000F8.2")}, "which holds nothing or too much"),
    "a wide row": ({"fields": lambda n, k: plain(n, k, form="9F80000.2")}, "line 3: this makes a row wider than"),
    "an endless width": ({"fields": lambda n, k: plain(n, k, form="F" + "9" * 5000)}, "line 2: the format of LINE is"),
    "an endless number": ({"fields": lambda n, k: plain(n, "9" * 5000)}, "line 2: .* is none; a definition reads"),
    "fields out of order": ({"fields": lambda n, k: plain(n, 18 - k)}, "line 3: DEFN 16 follows DEFN 17; put the def"),
    "a wrapped definition": ({"fields": lambda n, k: plain(n, k) + "\n   :NULL=-9"}, "line 3: ':NULL=-9' is none; a definition"),
    "no data record": ({"fields": lambda n, k: plain(n, k, "DEFN {k} ST=RECD,RT=HEAD;")}, "this defines no column"),
    "two data records": ({"tail": "DEFN 99 ST=RECD,RT=DATA;END DEFN\nDEFN 1 ST=RECD,RT=DATA;LINE:I258\n"},
                         "this defines the record DATA 2 times; keep the definition that belongs to SURVEY.DAT"),
    "a row cut short": ({"row": lambda line: line[:-3] if "517" in line else line},
                        r"SURVEY.DAT, line \d+: this row is 255 characters wide, .*SURVEY.DFN defines 258"),
    "a definition too short": ({"fields": lambda n, k: plain(n, k) if n != "GND_FA" else ""}, "258 char.* 242"),
    "a word among numbers": ({"FZ": ["fast"] * 500}, "SURVEY.DAT, line 1: FZ is 'fast', which is no number"),
    "an empty file": ({"row": lambda line: ""}, "SURVEY.DAT: this is empty"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_read_is_refused(case, survey_file):
    changes, message = REFUSED[case]
    with pytest.raises(InputError, match=message):
        read.read_survey(survey_file(**changes))


def test_of_two_definitions_the_one_that_fits_is_taken(survey_file, sound):
    tail = "DEFN 99 ST=RECD,RT=DATA;END DEFN\nDEFN 1 ST=RECD,RT=DATA;LINE:I8\nDEFN 2 ST=RECD,RT=DATA;END DEFN\n"
    np.testing.assert_allclose(read.read_survey(survey_file(tail=tail))[104000].line.z, sound.line.z, atol=1e-6)


def test_the_definition_itself_is_no_survey(survey_file):
    path = survey_file()
    with pytest.raises(InputError, match="this defines the columns of a fixed-width file; give the .DAT beside it"):
        read_table(path.with_suffix(".DFN"))
    path.with_suffix(".DFN").rename(path.with_name("Survey.dfn"))
    assert len(read_table(path)["FZ"]) == 500


def test_a_csv_may_be_called_dat(text, sound, tmp_path):
    path = tmp_path / "own.dat"
    path.write_text(text())
    np.testing.assert_array_equal(read.read_survey(path)[104000].line.z, sound.line.z)


def test_a_definition_gives_names_widths_nulls_and_units(tmp_path):
    path = tmp_path / "x.dfn"
    path.write_text(
        "DEFN 1 ST=RECD,RT=;MGA-E : f9.1 :NULL=-99999.9:UNIT=m:NAME=MGA_E;2X;WIND:2F8.3\nDEFN 2 ST=RECD,RT=;END DEFN\n"
    )
    (record,), others = read_definition(path)
    assert [(f.name, f.count, f.width, f.null, f.unit) for f in record] == [
        ("MGA_E", 1, 9, "-99999.9", "m"), ("", 1, 2, "", ""), ("WIND", 2, 8, "", "")
    ]  # fmt: skip
    assert others == set() and record[2].names == ["WIND[0]", "WIND[1]"]


def test_a_decimal_comma_between_fixed_columns(survey_file):
    path = survey_file(row=lambda line: line.replace(".", ","))
    assert len(read.read_survey(path, read.KAURING).flights) == 1
