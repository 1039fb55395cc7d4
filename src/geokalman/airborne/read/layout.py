"""Layouts: which columns of a survey file hold what, in which unit and with which sign."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from geokalman.airborne.read.columns import Table
from geokalman.reading import InputError

IN_MGAL = {"mGal": 1.0, "um/s2": 0.1, "m/s2": 1e5}
"""Units of acceleration in mGal."""
IN_METRES = {"m": 1.0, "ft": 0.3048}
UNITS = {
    "acceleration": {**dict.fromkeys(("mgal", "mgals"), 1.0), "ugal": 1e-3, "gal": 1e3, "mm/s2": 100.0, "nm/s2": 1e-4,
                     **dict.fromkeys(("gu", "um/s2", "um/s/s", "um.s-2", "micrometre_per_second_squared",
                                      "micrometres_per_second_squared", "micrometers_per_second_squared"), 0.1),
                     **dict.fromkeys(("m/s2", "m/s/s", "m.s-2"), 1e5)},
    "length": {**dict.fromkeys(("m", "metre", "meter"), 1.0), **dict.fromkeys(("ft", "feet", "foot"), 0.3048),
               **dict.fromkeys(("km", "kilometre", "kilometer"), 1e3), "cm": 1e-2, "mm": 1e-3},
    "time": {**dict.fromkeys(("s", "sec", "second"), 1.0), **dict.fromkeys(("min", "minute"), 60.0),
             **dict.fromkeys(("h", "hr", "hour"), 3600.0), **dict.fromkeys(("d", "day"), 86400.0),
             **dict.fromkeys(("ms", "msec", "millisecond"), 1e-3)},
    "angle": {**dict.fromkeys(("deg", "dega", "degree", "dd", "decimal_degree", "°"), 1.0),
              **dict.fromkeys(("rad", "radian"), math.degrees(1.0))},
}  # fmt: skip
NEEDED = ("line", "t", "lon", "lat", "easting", "northing", "height", "f3")
OPTIONAL = ("a_up", "raw", "f1", "f2")
KINDS = ("latitude", "eotvos", "free_air")
_NO_UNIT = ("", "none", "unitless", "n/a", "na", "null")
_DIMENSION = {
    "line": "none", "t": "time", "lon": "angle", "lat": "angle", "easting": "length", "northing": "length",
    "height": "length",
}  # fmt: skip


@dataclass(frozen=True)
class Layout:
    """Which columns of a file hold what, and how.

    columns : our name -> the file's. Needed are line, t [s], lat and lon [degrees], easting, northing [m], height [m]
    and
        f3 (vertical specific force); a_up (vertical kinematic acceleration by GNSS) where there is one, else the
        height is differenced against the integral; raw (= f3 - a_up); f1, f2 (horizontal specific forces), else from
        the second differences of easting and northing.
    corrections : column of a correction -> +1 or -1, the sign with which it is added to give the disturbance.
    kinds : column of a correction -> latitude, eotvos or free_air, for the check of its sign; others are not checked.
    references : our name -> the file's, values that only an assessment may see (contractor, grid, ground, ...).
    acceleration : mGal, um/s2 or m/s2, of all accelerations; height : m or ft. A unit that the file itself gives to a
    column goes first.

    Raises InputError for a name, sign, kind or unit that is none of these.
    """

    columns: Mapping[str, str]
    corrections: Mapping[str, int]
    kinds: Mapping[str, str] = field(default_factory=dict)
    references: Mapping[str, str] = field(default_factory=dict)
    acceleration: str = "mGal"
    height: str = "m"

    def __post_init__(self) -> None:
        lacking = [name for name in NEEDED if name not in self.columns]
        unknown = [name for name in self.columns if name not in NEEDED + OPTIONAL]
        if lacking or unknown:
            wrong = f"lacks {', '.join(lacking)}" if lacking else f"does not know {', '.join(unknown)}"
            raise InputError(f"A layout names columns for {', '.join(NEEDED)} and may for {', '.join(OPTIONAL)}; "
                             f"this one {wrong}.")  # fmt: skip
        for column, sign in self.corrections.items():
            if sign not in (1, -1):
                raise InputError(f"A correction is added with the sign +1 or -1, {column} has {sign!r}.")
        for column, kind in self.kinds.items():
            if column not in self.corrections or kind not in KINDS:
                raise InputError(f"kinds gives a correction its kind, {', '.join(KINDS)}; not {column} {kind!r}.")
        if self.acceleration not in IN_MGAL or self.height not in IN_METRES:
            raise InputError(
                f"A layout has acceleration in {', '.join(IN_MGAL)} and height in {', '.join(IN_METRES)}, "
                f"not {self.acceleration} and {self.height}."
            )

    def missing(self, table: Mapping) -> list[str]:
        """Columns that a table lacks and that cannot be done without."""
        wanted = (*(self.columns[name] for name in NEEDED), *self.corrections)
        return [column for column in wanted if column not in table]

    def fitted(self, table: Table) -> tuple[Layout, list[str]]:
        """The layout without the optional columns that a table lacks, and in words what follows from that."""
        there = {ours: column for ours, column in self.columns.items() if column in table}
        if not {"f1", "f2"} <= there.keys():
            there = {ours: column for ours, column in there.items() if ours not in ("f1", "f2")}
        notes = []
        if "a_up" in self.columns and not {"a_up", "raw"} & there.keys():
            notes.append(f"there is no column {self.columns['a_up']} (a_up): the height is differenced instead")
        references = {ours: column for ours, column in self.references.items() if column in table}
        return replace(self, columns=there, references=references), notes

    def dimensions(self) -> dict[str, str]:
        """What each column measures: none (a number), time, angle, length or acceleration."""
        found = dict.fromkeys((*self.corrections, *self.references.values()), "acceleration")
        return found | {column: _DIMENSION.get(ours, "acceleration") for ours, column in self.columns.items()}

    def factors(self, table: Table) -> tuple[dict[str, float], list[str], list[str]]:
        """Factor of each column to mGal, metres, seconds or degrees; columns whose unit is of another kind, or unknown.

        The unit is the file's own where the file gives one that is known, else that of the layout.
        """
        dimension = self.dimensions()
        usual = {"acceleration": IN_MGAL[self.acceleration]}
        out, odd = {}, []
        unknown = [
            f"{column} in {unit}"
            for column in dimension
            if not _known(unit := table.units.get(column, ""))
            and dimension[column] != "none"
            and unit.strip(" ()[]-").lower() not in _NO_UNIT
        ]
        for column, what in dimension.items():
            out[column] = IN_METRES[self.height] if column == self.columns["height"] else usual.get(what, 1.0)
            found = _known(table.units.get(column, ""))
            if what in found:
                out[column] = found[what]
            elif found and what != "none":
                odd.append(f"{column} in {table.units[column]}")
        return out, odd, unknown


def is_unit(text: str) -> bool:
    """Whether a word is a known unit of acceleration, length, time or angle."""
    return bool(_known(text))


def _known(unit: str) -> dict[str, float]:
    """What a unit may measure, and its factor to the base unit."""
    unit = unit.strip(" ()[]").lower().replace("²", "2").replace("^", "").replace("**", "")
    unit = unit.replace("µ", "u").replace("μ", "u").replace(" ", "_")
    first = unit.partition("_")[0]  # seconds after midnight
    for form in (unit, unit.removesuffix("s"), first, first.removesuffix("s")):
        if found := {what: units[form] for what, units in UNITS.items() if form in units}:
            return found
    return {}


_PLACE = {"lon": "LON", "lat": "LAT", "easting": "EASTING", "northing": "NORTHING", "height": "GPSZ"}
KAURING = Layout(
    columns={"line": "LINE", "t": "UTC", **_PLACE, "f3": "FZ", "a_up": "AZ", "raw": "GRVRAW"},
    corrections={"LATCOR": -1, "EOTCOR": 1, "FACOR": 1},
    kinds={"LATCOR": "latitude", "EOTCOR": "eotvos", "FACOR": "free_air"},
    references={"contractor_raw": "FRA100", "contractor": "FRAL100", "grid": "FAL1000", "ground": "GND_FA"},
)
"""The vendored Kauring survey, and any CSV with the header LINE,FLIGHT,UTC,LON,...,FRAL100,GND_FA."""
KAURING_DAT = Layout(
    columns={**KAURING.columns, "t": "UTCSECOND", "lon": "LATITUDE", "lat": "LONGITUD"},
    corrections=KAURING.corrections,
    kinds=KAURING.kinds,
    references={
        "contractor_raw": "GRVFRA100S", "contractor": "GRVFRAL100S", "grid": "GRVFAL1000M",
        "ground": "GNDGRV_FA_UPWARD",
    },
)  # fmt: skip
"""The contractor's GRAV.DAT with its DFN, which swaps the names of longitude and latitude: so does this layout."""
EASTVIC = Layout(
    columns={"line": "LINE", "t": "FTIME", "lon": "LONG", "lat": "LAT", "easting": "MGA_X", "northing": "MGA_Y",
             "height": "MGA_Z", "f3": "FZ", "f1": "FX", "f2": "FY"},
    corrections={"LATCOR": 1, "EOTCOR": 1, "FACOR_GRS80": 1, "STATCOR": 1, "ATMCOR": 1},
    kinds={"LATCOR": "latitude", "EOTCOR": "eotvos", "FACOR_GRS80": "free_air"},
    references={"contractor": "FA100S_GRS80", "contractor_56s": "FA56S_GRS80"},
)  # fmt: skip
"""The contractor's XYZ of Eastern Victoria; its LATCOR is negative, and it has no kinematic acceleration."""
LAYOUTS = {"kauring": KAURING, "kauring-dat": KAURING_DAT, "eastvic": EASTVIC}
