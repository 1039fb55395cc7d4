"""The table of columns on the page of one's own data is that of the layout."""

from pathlib import Path

from geokalman.airborne.read.layout import KAURING, NEEDED

PAGE = Path(__file__).parents[2] / "book" / "practice" / "own-data.md"
UNITS = {"none": "", "time": "s", "angle": "degrees", "length": "m", "acceleration": "mGal"}
SIGNS = {1: "added", -1: "subtracted"}


def test_the_page_says_of_each_column_what_the_layout_says():
    rows = [[cell.strip() for cell in line.strip("|\n").split("|")] for line in PAGE.read_text().splitlines()
            if line.startswith("| `")]  # fmt: skip
    told = {column.strip("`"): (unit, sign, needed) for column, _, unit, sign, needed in rows}
    needed = {*(KAURING.columns[name] for name in NEEDED), *KAURING.corrections}
    assert told.keys() == KAURING.dimensions().keys()
    for column, what in KAURING.dimensions().items():
        unit, sign, said = told[column]
        assert (unit, said) == (UNITS[what], "yes" if column in needed else "no"), column
        if column in KAURING.corrections:
            assert sign == SIGNS[KAURING.corrections[column]], column
