"""Real surveys: from a table of columns to flight lines that a filter can take, through one documented mapping.

To read a survey of one's own, describe its columns by a `Layout` and call `read_survey(path, layout)`.
"""

from __future__ import annotations

import re
import warnings
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from geokalman.airborne import checks
from geokalman.airborne.model import METRE, SHORTEST, Array, Line, double_integral, step_integrals
from geokalman.airborne.tables import Table, read_table
from geokalman.files import data_path

SURVEYS = {"kauring": "kauring_2012.xz", "eastvic": "eastvic_repeats.xyz.xz"}
"""Vendored surveys and their files under `data/`."""


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
    acceleration : mGal, um/s2 or m/s2; height : m or ft.
    """

    columns: Mapping[str, str]
    corrections: Mapping[str, int]
    kinds: Mapping[str, str] = field(default_factory=dict)
    references: Mapping[str, str] = field(default_factory=dict)
    acceleration: str = "mGal"
    height: str = "m"


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


@dataclass(frozen=True)
class Flight:
    """A flight line (or a piece between gaps): what the filter takes, where it was flown, what others made of it.

    line : for the filter; lon, lat [degrees], easting, northing, height [m] : (n,); references : name -> (n,) [mGal].
    """

    line: Line
    lon: Array
    lat: Array
    easting: Array
    northing: Array
    height: Array
    references: Mapping[str, Array]

    @property
    def name(self) -> str:
        """The line's number as the file has it; pieces after a gap, and lines flown twice, carry a letter."""
        return self.line.name

    @property
    def whole(self) -> str:
        """The line's number as the file has it, without the letter of a piece."""
        return self.name.rstrip("abcdefghijklmnopqrstuvwxyz")

    @property
    def number(self) -> float:
        """The line's number."""
        return float(self.whole)


class UnknownLine(KeyError):
    """A line that the survey does not hold; the message says which there are, or why it was refused."""

    def __str__(self) -> str:  # KeyError shows its message in quotes
        return str(self.args[0])


@dataclass(frozen=True)
class Survey:
    """All usable lines of a file in its order.

    refused : one sentence for each piece that was refused; notes : one for everything else that was repaired or looks
    wrong (lines that were cut, coordinates put right, aliasing); aliased : names of the lines whose specific force is
    probably aliased, for a larger R.
    """

    flights: tuple[Flight, ...]
    refused: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    aliased: tuple[str, ...] = ()

    def __getitem__(self, name: str | int | float) -> Flight:
        """One whole line by its number, or a piece by its name. Raises UnknownLine with the lines there are."""
        found = self.pieces(name)
        wanted = _wanted(name)
        if len(found) != 1 or found[0].name != wanted:
            raise UnknownLine(
                f"Line {wanted} is not whole, its pieces are "
                f"{', '.join(f.name for f in found)}: {self._reason(wanted)}."
            )
        return found[0]

    def pieces(self, name: str | int | float) -> tuple[Flight, ...]:
        """A line by its number: itself, or its pieces where it was cut. Raises UnknownLine with the lines there are."""
        wanted = _wanted(name)
        found = tuple(f for f in self.flights if f.name == wanted or f.whole == wanted)
        if not found:
            raise UnknownLine(
                f"There is no line {wanted}; "
                f"{self._reason(wanted) or 'there are ' + _some([f.name for f in self.flights])}."
            )
        return found

    def select(self, names: Sequence[str | int | float]) -> tuple[Flight, ...]:
        """Lines by their numbers, in the order asked for; a line that was cut gives its pieces.

        Raises UnknownLine, ValueError for no line or one that is asked for twice.
        """
        wanted = [_wanted(name) for name in names]
        for name in wanted:
            if wanted.count(name) > 1:
                raise ValueError(f"Line {name} is asked for twice; once is right.")
        if not wanted:
            raise ValueError(f"No line is asked for; there are {_some([f.name for f in self.flights])}.")
        return tuple(piece for name in wanted for piece in self.pieces(name))

    def require(self, *references: str) -> None:
        """Raises ValueError where a line lacks one of these references (ground, contractor, ...)."""
        for name in references:
            lacking = [f.name for f in self.flights if name not in f.references]
            if lacking:
                said = (layout.references.get(name, "") for layout in LAYOUTS.values())
                known = ", ".join(dict.fromkeys(column for column in said if column))
                raise ValueError(
                    f"The survey has no column {known} ({name}), against which this page judges; it has "
                    f"{', '.join(self.flights[0].references) or 'no reference at all'}."
                )

    def _reason(self, wanted: str) -> str:
        said = (*self.refused, *self.notes)
        return "; ".join(text for text in said if re.match(rf"line {re.escape(wanted)}[a-z]* ", text))


def load(name: str = "kauring", shortest: float = SHORTEST) -> Survey:
    """A vendored survey: kauring (all 224 lines) or eastvic (ten passes of one line). Its checksum is verified."""
    return survey(read_table(data_path(SURVEYS[name])), LAYOUTS[name], shortest)


def read_survey(path: Path | str, layout: Layout | str | None = None, shortest: float = SHORTEST) -> Survey:
    """Read a file of any format that `tables` knows; layout: a Layout, the name of one of LAYOUTS, None to find it.

    Lines below `shortest` [s] are refused.

    Raises ValueError, one sentence, for what the checks refuse (see `checks`).
    """
    table = read_table(path)
    if layout is None:
        fits = [one for one in LAYOUTS.values() if _missing(table, one) == []]
        if not fits:
            nearest = min((_missing(table, one) for one in LAYOUTS.values()), key=len)
            raise ValueError(
                f"{path} has the columns {', '.join(table)}; no known layout fits "
                f"(the nearest lacks {', '.join(nearest)}); describe it by a Layout."
            )
        layout = fits[0]
    return survey(table, LAYOUTS[layout] if isinstance(layout, str) else layout, shortest)


def survey(table: Table, layout: Layout, shortest: float = SHORTEST) -> Survey:
    """Flight lines from a table: checked, repaired where that is safe, split at gaps; below `shortest` [s] refused."""
    lacking = _missing(table, layout)
    if lacking:
        raise ValueError(f"The table lacks the columns {', '.join(lacking)}; it has {', '.join(table)}.")
    labels = table[layout.columns["line"]]
    blocks = np.split(np.arange(len(labels)), np.flatnonzero(np.diff(labels) != 0) + 1)
    for rows in blocks:
        if not np.isfinite(labels[rows[0]]):
            raise ValueError(f"Row {rows[0] + 1} of the data carries no line number.")
    times_flown = Counter(_label(labels[rows[0]]) for rows in blocks)
    flights: list[Flight] = []
    refused: list[str] = []
    notes: list[str] = []
    swapped: list[str] = []
    aliased: list[str] = []
    used: Counter[str] = Counter()
    for rows in blocks:
        name = _label(labels[rows[0]])
        columns = {ours: table[theirs][rows] for ours, theirs in layout.columns.items()}
        columns |= {theirs: table[theirs][rows] for theirs in layout.corrections}
        references = {ours: table[theirs][rows] for ours, theirs in layout.references.items() if theirs in table}
        references[checks.ROW] = rows + 1.0
        cut, why = _clean(name, columns, references, layout, swapped)
        several = len(cut) > 1 or times_flown[name] > 1
        if not cut:
            refused.append(f"line {name} cannot be used: {why[0]}")
        elif why:
            notes.append(f"line {name} is cut into {len(cut)} pieces: {_some(why)}")
        for part, others in cut:
            used[name] += 1
            label = name + _letters(used[name]) if several else name
            lasts = part["t"][-1] - part["t"][0]
            if len(part["t"]) < 3 or lasts < shortest - 1.0:
                refused.append(f"line {label} lasts {lasts:.1f} s, at least {shortest:g} s are needed")
                continue
            checks.quality(label, part, layout)
            if checks.height_correlation(part["f3"], part["height"]) < checks.ALIASED:
                aliased.append(label)
            others.pop(checks.ROW)
            flights.append(_flight(label, part, others, layout))
    notes += [f"line {name} was flown {n} times, its flights carry letters" for name, n in times_flown.items() if n > 1]
    if not flights:
        raise ValueError(f"No line can be used: {_some(refused, '; ')}.")
    if swapped:
        notes.append(f"latitude and longitude are swapped on {len(swapped)} lines ({_some(swapped)}); put right")
    if aliased:
        notes.append(
            f"on {len(aliased)} of {len(flights)} lines "
            f"({_some(aliased)}) the specific force follows the height with a "
            f"correlation below {checks.ALIASED}: it is probably aliased, so give the height a larger R"
        )
    if notes:
        warnings.warn("; ".join(notes) + ".", checks.SuspiciousData, stacklevel=2)
    return Survey(tuple(flights), tuple(refused), tuple(notes), tuple(aliased))


def _clean(
    name: str, columns: Table, references: Table, layout: Layout, swapped: list[str]
) -> tuple[list[tuple[Table, Table]], list[str]]:
    """Whole pieces of one line with its references, and why it was cut there (or cannot be used)."""
    count, lacking = checks.complete(columns)
    if count < 3:
        return [], [lacking]
    columns, references = checks.in_order(name, columns, references)
    checks.wild(name, columns, references)
    checks.units(name, columns, layout)
    columns, turned = checks.places(name, columns)
    if turned:
        swapped.append(name)
    cut, why = checks.pieces(name, columns, references)
    parts = [tuple({k: v[piece] for k, v in table.items()} for table in (columns, references)) for piece in cut]
    return parts, why


def _flight(name: str, c: Table, references: Table, layout: Layout) -> Flight:
    n = len(c["t"])
    dt = (c["t"][-1] - c["t"][0]) / (n - 1)
    raw = c["raw"] if "raw" in c else c["f3"] - c["a_up"] if "a_up" in c else c["f3"]
    a = raw + sum(sign * c[column] for column, sign in layout.corrections.items())
    if "a_up" in c:
        z = double_integral(a, dt)[1]
    else:
        h = METRE * c["height"]
        z = double_integral(a, dt, (h[1] - h[0]) / dt)[1] - (h - h[0])
    if "f1" in c:
        f1, f2 = c["f1"], c["f2"]
    else:
        f1, f2 = (_second_difference(METRE * c[key], dt) for key in ("easting", "northing"))
    first, second = step_integrals(np.column_stack([f1, f2, c["f3"]]), dt)
    V = np.hypot(np.diff(c["easting"]), np.diff(c["northing"])).sum() / ((n - 1) * dt)
    line = Line(name, dt * np.arange(n) + c["t"][0], z, c["f3"], first, second, float(V))
    return Flight(line, c["lon"], c["lat"], c["easting"], c["northing"], c["height"], references)


def _second_difference(x: Array, dt: float) -> Array:
    out = np.empty_like(x)
    out[1:-1] = np.diff(x, 2) / dt**2
    out[0], out[-1] = out[1], out[-2]
    return out


def _missing(table: Table, layout: Layout) -> list[str]:
    return [name for name in (*layout.columns.values(), *layout.corrections) if name not in table]


def _label(number: float) -> str:
    return f"{number:.0f}" if number == round(number) else f"{number:.2f}"


def _wanted(name: str | int | float) -> str:
    return name if isinstance(name, str) else _label(float(name))


def _letters(k: int) -> str:
    """a, b, ..., z, aa, ab, ... for 1, 2, ...: as many names as there are pieces."""
    text = ""
    while k:
        k, rest = divmod(k - 1, 26)
        text = chr(ord("a") + rest) + text
    return text


def _some(names: Sequence[str], between: str = ", ") -> str:
    return between.join(names[:6]) + (f" and {len(names) - 6} more" if len(names) > 6 else "")
