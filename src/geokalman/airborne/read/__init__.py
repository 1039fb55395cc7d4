"""Real surveys: from a table of columns to flight lines that a filter can take, through one documented mapping.

To read a survey of one's own, describe its columns by a `Layout` and call `read_survey(path, layout)`.
"""

from __future__ import annotations

import re
import warnings
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from geokalman.airborne.model import METRE, SHORTEST, Array, Line, double_integral, step_integrals
from geokalman.airborne.read import checks, quality
from geokalman.airborne.read.columns import Table
from geokalman.airborne.read.layout import EASTVIC, KAURING, KAURING_DAT, LAYOUTS, Layout  # noqa: F401 - their usual address
from geokalman.airborne.read.tables import read_table
from geokalman.data import data_path
from geokalman.reading import InputError, counted

SURVEYS = {"kauring": "kauring_2012.xz", "eastvic": "eastvic_repeats.xyz.xz"}
"""Vendored surveys and their files under `data/`."""


@dataclass(frozen=True)
class SurveyLine:
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

    flights: tuple[SurveyLine, ...]
    refused: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    aliased: tuple[str, ...] = ()

    def __getitem__(self, name: str | int | float) -> SurveyLine:
        """One whole line by its number, or a piece by its name. Raises UnknownLine with the lines there are."""
        found = self.pieces(name)
        wanted = _wanted(name)
        if len(found) != 1 or found[0].name != wanted:
            raise UnknownLine(
                f"Line {wanted} is not whole, its pieces are "
                f"{', '.join(f.name for f in found)}: {self._reason(wanted)}."
            )
        return found[0]

    def pieces(self, name: str | int | float) -> tuple[SurveyLine, ...]:
        """A line by its number: itself, or its pieces where it was cut. Raises UnknownLine with the lines there are."""
        wanted = _wanted(name)
        found = tuple(f for f in self.flights if f.name == wanted or f.whole == wanted)
        if not found:
            raise UnknownLine(
                f"There is no line {wanted}; "
                f"{self._reason(wanted) or 'there are ' + _some([f.name for f in self.flights])}."
            )
        return found

    def select(self, names: Sequence[str | int | float]) -> tuple[SurveyLine, ...]:
        """Lines by their numbers, in the order asked for; a line that was cut gives its pieces.

        Raises UnknownLine, ValueError for no line or one that is asked for twice.
        """
        wanted = [_wanted(name) for name in names]
        for name in wanted:
            if wanted.count(name) > 1:
                raise ValueError(f"lines has line {name} twice; once is right.")
        if not wanted:
            raise ValueError(f"lines is empty; there are {_some([f.name for f in self.flights])}.")
        try:
            return tuple(piece for name in wanted for piece in self.pieces(name))
        except UnknownLine as error:
            some = ", ".join(f.whole for f in self.flights[:2])
            raise UnknownLine(f"{str(error).rstrip('.')}; choose lines of the file, as in lines=[{some}].") from None

    def require(self, *references: str) -> None:
        """Raises ValueError where a line lacks one of these references (ground, contractor, ...)."""
        for name in references:
            lacking = [f.name for f in self.flights if name not in f.references]
            if 0 < len(lacking) < len(self.flights):
                raise ValueError(
                    f"The lines {_some(lacking)} have no {name}, against which this page judges; leave them out of the "
                    "file."
                )
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

    Raises InputError, one sentence, for what the readers and the checks refuse (see `tables`, `checks`, `quality`).
    """
    table = read_table(path)
    if layout is None:
        nearest = min(LAYOUTS.values(), key=lambda known: len(known.missing(table)))
        if lacking := nearest.missing(table):
            raise table.error(
                f"its columns are {_some(list(table), most=40)}; no known layout fits "
                f"(the nearest lacks {', '.join(lacking)}); describe it by a Layout."
            )
        layout = nearest
    elif isinstance(layout, str):
        if layout not in LAYOUTS:
            raise InputError(f"There is no layout {layout!r}; there are {', '.join(LAYOUTS)}, or a Layout of your own.")
        layout = LAYOUTS[layout]
    return survey(table, layout, shortest)


def survey(table: Mapping[str, Array], layout: Layout, shortest: float = SHORTEST) -> Survey:
    """Flight lines from a table: checked, repaired where that is safe, split at gaps; below `shortest` [s] refused."""
    table = table if isinstance(table, Table) else Table(table)
    if lacking := layout.missing(table):
        raise table.error(f"the table lacks the columns {', '.join(lacking)}; it has {_some(list(table), most=40)}.")
    try:
        return _survey(table, layout, shortest)
    except InputError as error:
        if table.path is None or str(error).startswith(str(table.path)):
            raise
        raise InputError(f"{table.path}: {error}") from None


def _survey(table: Table, layout: Layout, shortest: float) -> Survey:
    layout, notes = layout.fitted(table)
    factors, odd, unknown = layout.factors(table)
    if unknown:
        notes.append(f"the file gives {_some(unknown)}, which is no known unit; that of the layout is taken")
    if odd:
        notes.append(f"the file gives {_some(odd)}, which cannot be; these units are left aside")
    sources = {**layout.columns, **{column: column for column in layout.corrections}, **layout.references}
    labels = table.labels(sources.pop("line"))
    raw = {key: table.channel(column) for key, column in sources.items()}
    like = {key: checks.looks_null(values) for key, values in raw.items()}
    channels = {key: values * factors[sources[key]] for key, values in raw.items()}
    blocks, doubled = _blocks(table, labels, channels)
    notes += doubled
    checks.middles(channels, blocks, [_label(labels[rows[0]]) for rows in blocks])
    times_flown = Counter(_label(labels[rows[0]]) for rows in blocks)
    flights: list[SurveyLine] = []
    refused: list[str] = []
    swapped: list[str] = []
    aliased: list[str] = []
    noisy: dict[str, float] = {}
    used: Counter[str] = Counter()
    for rows in blocks:
        name = _label(labels[rows[0]])
        columns = {key: values[rows] for key, values in channels.items()}
        references = {key: columns.pop(key) for key in layout.references}
        references[checks.ROW] = rows + 1.0
        if table.rows is not None:
            references[checks.FILE_ROW] = table.rows[rows]
        notes += checks.without_nulls(name, columns, references, {k: mask[rows] for k, mask in like.items()}, layout)
        if "raw" in columns and "a_up" not in columns:
            columns["a_up"] = columns["f3"] - columns["raw"]
        cut, why, turned, said = _clean(name, columns, references, layout, factors[layout.columns["f3"]])
        notes += said
        if turned:
            swapped.append(name)
        several = len(cut) > 1 or times_flown[name] > 1
        if not cut:
            refused.append(f"line {name} cannot be used: {why[0]}")
        elif why:
            notes.append(f"line {name} is cut into {counted(len(cut), 'piece')}: {_some(why)}")
        for part, others in cut:
            used[name] += 1
            label = name + _letters(used[name]) if several else name
            lasts = part["t"][-1] - part["t"][0]
            if len(part["t"]) < 3 or lasts < shortest - 1.0:
                refused.append(f"line {label} lasts {lasts:.1f} s, at least {shortest:g} s are needed")
                continue
            quality.agree(label, part, others, layout)
            follows = quality.height_correlation(part["f3"], part["height"])
            if follows < quality.FOLLOWS and len(part["t"]) >= quality.ENOUGH:
                short, long = quality.height_noise(part["f3"], part["height"], lasts / (len(part["t"]) - 1))
                if long > np.sqrt(quality.EXCESS) * short:
                    aliased.append(label)
                else:
                    noisy[label] = short
            kept = {key: values for key, values in others.items() if key in layout.references}
            flights.append(_flight(label, part, kept, layout))
    notes += [f"line {name} was flown {n} times, its flights carry letters" for name, n in times_flown.items() if n > 1]
    for key in layout.references:
        empty = [f.name for f in flights if not np.nanmax(np.abs(np.diff(f.references[key])), initial=0.0) > 0]
        if empty:
            count = counted(len(empty), "line")
            notes.append(f"{key} is null or one value in all rows of {count} ({_some(empty)}): none there")
            flights = [_without(f, key) if f.name in empty else f for f in flights]
    if not flights:
        raise InputError(f"No line can be used: {_some([*refused, *notes], '; ')}.")
    if swapped:
        count = counted(len(swapped), "line")
        notes.append(f"latitude and longitude are swapped on {count} ({_some(swapped)}); put right")
    if aliased:
        notes.append(
            f"on {len(aliased)} of {len(flights)} lines "
            f"({_some(aliased)}) the specific force follows the height with a "
            f"correlation below {quality.FOLLOWS}: it is probably aliased, so give the height a larger R"
        )
    if noisy:
        notes.append(
            f"on {len(noisy)} of {len(flights)} lines ({_some(list(noisy))}) the height has white noise of up to "
            f"{max(noisy.values()):.2g} m; the filter's R (R_m) should be that"
        )
    if notes:
        warnings.warn("; ".join(notes) + ".", checks.SuspiciousData, stacklevel=3)
    return Survey(tuple(flights), tuple(refused), tuple(notes), tuple(aliased))


def _clean(
    name: str, columns: Table, references: Table, layout: Layout, factor: float
) -> tuple[list[tuple[Table, Table]], list[str], bool, list[str]]:
    """Whole pieces of one line with its references, why it was cut there (or cannot be used), whether latitude and
    longitude had to be swapped, and notes.
    """
    count, lacking = checks.complete(columns)
    if count < 3:
        return [], [lacking], False, []
    columns, references, notes = checks.in_order(name, columns, references)
    checks.unit(name, columns, factor)
    checks.wild(name, columns, references, layout)
    columns, turned = checks.places(f"Line {name}", columns)
    checks.signs(name, columns)
    checks.speed(name, columns)
    cut, why = checks.pieces(name, columns, references)
    parts = [tuple({k: v[piece] for k, v in table.items()} for table in (columns, references)) for piece in cut]
    return parts, why, turned, notes


def _blocks(table: Table, labels: Array, channels: Mapping[str, Array]) -> tuple[list[Array], list[str]]:
    """Rows of each flight of each line, and notes: interleaved lines are taken apart, doubled flights taken once."""
    if not np.isfinite(labels).all():
        raise table.error("this row carries no line number.", int(np.argmin(np.isfinite(labels))))
    if (labels < 0.0).any():
        row = int(np.argmax(labels < 0.0))
        raise table.error(f"the line number is {_label(labels[row])}, and none is negative.", row)
    notes = []
    starts = np.unique([*(np.flatnonzero(np.diff(labels) != 0) + 1), *table.starts])
    blocks = [rows for rows in np.split(np.arange(len(labels)), starts.astype(int)) if rows.size]
    names, first = np.unique(labels, return_index=True)
    if len(blocks) > 20 * len(names):
        blocks = [np.flatnonzero(labels == name) for name in names[np.argsort(first)]]
        notes.append("the rows of different lines stand between each other; those of each line are taken together")
    kept: list[Array] = []
    for rows in blocks:
        twins = [one for one in kept if labels[one[0]] == labels[rows[0]] and len(one) == len(rows)]
        if any(all(np.array_equal(x[one], x[rows], equal_nan=True) for x in channels.values()) for one in twins):
            notes.append(f"line {_label(labels[rows[0]])} occurs twice in the same rows; they are taken once")
        else:
            kept.append(rows)
    return kept, notes


def _flight(name: str, c: Table, references: Table, layout: Layout) -> SurveyLine:
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
    return SurveyLine(line, c["lon"], c["lat"], c["easting"], c["northing"], c["height"], references)


def _without(flight: SurveyLine, key: str) -> SurveyLine:
    return replace(flight, references={k: v for k, v in flight.references.items() if k != key})


def _second_difference(x: Array, dt: float) -> Array:
    out = np.empty_like(x)
    out[1:-1] = np.diff(x, 2) / dt**2
    out[0], out[-1] = out[1], out[-2]
    return out


def _label(number: float) -> str:
    if number == round(number):
        return f"{number:.0f}"
    return f"{number:.2f}" if round(number, 2) == number else f"{number:.10g}"


def _wanted(name: str | int | float) -> str:
    return name if isinstance(name, str) else _label(float(name))


def _letters(k: int) -> str:
    """a, b, ..., z, aa, ab, ... for 1, 2, ...: as many names as there are pieces."""
    text = ""
    while k:
        k, rest = divmod(k - 1, 26)
        text = chr(ord("a") + rest) + text
    return text


def _some(names: Sequence[str], between: str = ", ", most: int = 6) -> str:
    return between.join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")
