"""Fixed-width survey files with a definition beside them: ASEG-GDF2, a .DAT and its .DFN.

Source: Pratt (2003), The ASEG-GDF2 standard for point located data, draft 4; and how contractors write it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path

import numpy as np

from geokalman import reading
from geokalman.airborne.read.columns import Table, full_rows, is_number, is_value
from geokalman.reading import Place, number

_RECORD = re.compile(r"\s*DEFN\s*(\d{0,9})\s*ST\s*=\s*RECO?R?D\s*,\s*RT\s*=\s*(\w*)\s*(?:;(.*))?", re.I)
_END = re.compile(r"\s*END\s*DEFN\W*", re.I)
_FORMAT = re.compile(r"(\d{0,9})\s*([IFEDGA])\s*(\d{1,9})(?:\.(\d{0,3})(?:E\d+)?)?|(\d{0,9})X(\d{0,9})", re.I)
_ATTRIBUTE = re.compile(r"\b(NULL|UNIT)S?\s*[=:]\s*((?:(?!\b(?:NULL|UNIT|UNITS|NAME)\s*=)[^,:;])*)", re.I)


@dataclass(frozen=True)
class Field:
    """One field of a record: its name (empty: not kept), how often it repeats, its width, and its null and unit.

    precision : half a unit of its last decimal, to which a value and the null agree.
    """

    name: str
    count: int
    width: int
    null: str = ""
    unit: str = ""
    precision: float = 0.0

    @property
    def names(self) -> list[str]:
        """Names of its columns: NAME, or NAME[0], NAME[1], ... where it repeats."""
        return [self.name] if self.count == 1 else [f"{self.name}[{k}]" for k in range(self.count)]


def read_fixed_width(path: Path | str, definition: Path | str) -> Table:
    """Read a fixed-width file by its DFN (ASEG-GDF2).

    NULL of the definition makes NaN in its own column; UNIT goes into the table's `units`. Rows of record types other
    than DATA (COMM, PROJ) are left out. Where no row has the width that the definition gives, but each as many words
    as it has fields, the words are taken. Raises InputError, naming the row, where the two do not agree.
    """
    path, definition = Path(path), Path(definition)
    records, others = read_definition(definition)
    texts, rows = [], []
    for place, text in full_rows(path):
        if text[:4].upper() not in others:
            texts.append(text)
            rows.append(place.line)
    if not texts:
        raise Place(path).error("this is empty.")
    table = Table(path=path, rows=rows)
    fitting = [fields for fields in records if _width(fields) == len(texts[0].rstrip())] or records
    if len(fitting) > 1:
        raise Place(definition).error(
            f"this defines the record DATA {len(records)} times; keep the definition that belongs to {path.name}."
        )
    fields = _without_type(fitting[0], texts)
    columns = _columns(table, fields, texts, definition)
    for one in fields:
        for name in one.names:
            words = next(columns)
            if one.name:
                _add(table, name, words, one)
    return table


def read_definition(path: Path | str) -> tuple[list[list[Field]], set[str]]:
    """The fields of each record DATA that a DFN defines, and the names of its other records. Raises InputError."""
    records: list[list[Field]] = []
    others: set[str] = set()
    last, ended = 0, True
    for place, text in reading.lines(path, "definition (.DFN)"):
        found = _RECORD.fullmatch(text)
        if found is None:
            ended = ended or bool(_END.fullmatch(text))
            if not _END.fullmatch(text) and re.search(r"DEFN|NULL\s*=|:\s*\d*[IFEDGA]\d", text, re.I):
                raise place.error(
                    f"{text.strip()[:60]!r} is none; a definition reads DEFN 1 ST=RECD,RT=DATA;NAME:F10.2."
                )
            continue
        count, kind, body = int(found[1] or 0), found[2].upper(), found[3] or ""
        if kind not in ("", "DATA"):
            others.add(kind[:4])
            continue
        if ended and not _END.fullmatch(body):
            records.append([])
            last, ended = 0, False
        if found[1] and not _END.fullmatch(body):
            if count < last:
                raise place.error(f"DEFN {count} follows DEFN {last}; put the definitions in the order of the fields.")
            last = count
        for one in body.split(";"):
            if _END.fullmatch(one):
                ended = True
            elif one.strip():
                records[-1].append(_field(place, one))
        if records and _width(records[-1]) > reading.MAX_LINE:
            raise place.error(f"this makes a row wider than {reading.MAX_LINE} characters; check the formats.")
    records = [fields for fields in records if fields]
    if not records:
        raise Place(Path(path)).error("this defines no column (no RT=DATA).")
    return records, others - {""}


def _field(place: Place, text: str) -> Field:
    name, _, rest = text.partition(":")
    if not rest and re.fullmatch(r"\s*\d*X\s*", name, re.I):  # blanks need no name
        name, rest = "", name
    form = re.split("[:,]", rest, maxsplit=1)[0].strip()
    found = _FORMAT.fullmatch(form)
    if found is None:
        raise place.error(
            f"the format of {name.strip()[:40]} is {form[:40]!r}, not one like F10.2, I8, A4, 2E16.8, 5X."
        )
    blank = found[2] is None  # nX
    count, width = (1, int(found[5] or 1) * int(found[6] or 1)) if blank else (int(found[1] or 1), int(found[3]))
    if not 0 < count * width <= reading.MAX_LINE:
        raise place.error(f"the format of {name.strip()[:40]} is {form[:40]!r}, which holds nothing or too much.")
    given = {key.upper(): value.strip() for key, value in _ATTRIBUTE.findall(rest[len(form) :])}
    null = (given.get("NULL") or " ").split(" ")[0]
    precision = 0.5 * 10.0 ** -int(found[4] or 0)
    if not blank and found[2].upper() in "EDG" and is_number(null):
        precision *= abs(number(null))
    name = "" if blank else re.sub(r"[\s-]+", "_", name.strip().upper())
    return Field(name, count, width, null, given.get("UNIT", ""), precision)


def _width(fields: Sequence[Field]) -> int:
    return sum(one.count * one.width for one in fields)


def _without_type(fields: list[Field], texts: Sequence[str]) -> list[Field]:
    """The fields without the record type RT:A4 that the definition may have and the rows may not."""
    if fields[0].name != "RT":
        return fields
    types = {text[: fields[0].width].strip().upper() for text in texts}
    wide = any(len(text.rstrip()) == _width(fields) for text in texts)
    carried = types == {"DATA"} or (types <= {"DATA", ""} and wide)
    return [Field("", 1, fields[0].width), *fields[1:]] if carried else fields[1:]


def _columns(table: Table, fields: Sequence[Field], texts: Sequence[str], definition: Path) -> Iterator[Sequence[str]]:
    """The words of each column. Raises InputError for a row of another width."""
    widths = [one.width for one in fields for _ in range(one.count)]
    ends = list(accumulate(widths))
    lengths = np.array([len(text.rstrip()) for text in texts])
    whole = lengths == ends[-1]
    good = whole | (np.array([len(text) for text in texts]) == ends[-1])
    if good.any():
        good |= np.isin(lengths, ends)  # the last fields are blank, and blanks at the end were taken off
    if good.all():
        yield from ([text[end - width : end] for text in texts] for width, end in zip(widths, ends, strict=True))
        return
    words = [] if whole.any() else [text.split() for text in texts]
    if not words or any(len(row) != len(widths) for row in words):
        k = int(np.argmin(good))
        raise table.error(f"this row is {lengths[k]} characters wide, {definition} defines {ends[-1]}.", k)
    yield from zip(*words, strict=True)


def _add(table: Table, name: str, words: Sequence[str], field: Field) -> None:
    """Add a column; the null that is declared for it becomes NaN, as a word or by its value."""
    if field.null and not is_value(field.null):
        words = ["" if word.strip() == field.null else word for word in words]
    table.add(name, words, comma=True)
    if is_number(field.null) and name not in table.texts:
        table[name][np.abs(table[name] - number(field.null)) <= field.precision] = np.nan
    if field.unit:
        table.units[name] = field.unit
