"""Survey files whose columns are separated: CSV, semicolons, tabs, blanks, and Geosoft XYZ with a header per line."""

from __future__ import annotations

import contextlib
import csv
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from geokalman.airborne.read.columns import (
    LABELS,
    Table,
    blanked,
    column_name,
    full_rows,
    is_number,
    is_ruler,
    is_value,
    line_number,
)  # fmt: skip
from geokalman.airborne.read.layout import is_unit
from geokalman.reading import Place, counted

_COMMENTS = "/#!%"
_HEADER = re.compile(r"(line|tie|base|test|trend|special|random)(?:\s+(.*))?", re.I)
_SHORT = re.compile(r"[LTBSRPD]\d[\w.:]*")


class _Names(NamedTuple):
    """The row that names the columns: where it stands, its words, what separates them, and units where given."""

    place: Place
    text: str
    words: list[str]
    delimiter: str | None
    units: list[str]


def read_delimited(path: Path | str) -> Table:
    """Read separated columns under one row of names, or a Geosoft XYZ: `Line 10` or `Tie 20` before each line.

    The names are in the last row or comment before the data that has as many words as the first row of data. Units
    may follow them in brackets or in a row of their own. Where an XYZ has no column LINE, its headers make one.
    Raises InputError for a file without names or data, a row of another length, and a line header without a number.
    """
    path = Path(path)
    names: _Names | None = None
    before: list[tuple[Place, str]] = []
    texts: list[str] = []
    rows: list[int] = []
    labels: list[float] = []
    starts: list[int] = []
    label = np.nan
    for place, text in full_rows(path):
        text = text.strip() if "\t" not in text else text.strip(" ")
        if text[0] in _COMMENTS:
            comment = text.lstrip(_COMMENTS).strip()
            if text.startswith("//"):  # //Flight and //Date of a Geosoft XYZ
                continue
            if names:
                _same_names(names, place, comment)
            else:
                before.append((place, comment))
            continue
        header = _line_header(text) if text[0].isalpha() else None
        if header is not None:
            label = line_number(header)
            if np.isnan(label):
                raise place.error(f"{text[:40]!r} labels no line; {LABELS}.")
            starts.append(len(texts))
            continue
        if names is None:
            if not is_data(text):
                before.append((place, text))
                continue
            names = _find_names(place, text, before)
        if text == names.text:
            continue
        texts.append(text)
        rows.append(place.line)
        labels.append(label)
    if not texts:
        raise Place(path).error("this has no data under its header." if before or starts else "this is empty.")
    table = Table(path=path, rows=rows)
    _fill(table, names, texts)
    table.starts = starts
    if starts and "LINE" not in table:
        table["LINE"] = np.array(labels)
    return table


def _fill(table: Table, names: _Names, texts: Sequence[str]) -> None:
    """The columns of a table from its rows."""
    named = [column_name(word) for word in names.words]
    keep = [k for k, (name, _) in enumerate(named) if name]
    try:  # most files are numbers only
        if any("_" in text for text in texts):
            raise ValueError
        block = blanked(np.loadtxt(texts, delimiter=names.delimiter, comments=None, ndmin=2))
        if block.shape[1] != len(named):
            raise ValueError
        for k in keep:
            table.put(named[k][0], block[:, k].copy())
    except ValueError:
        words = list(_words(table, names, texts))
        for k in keep:
            table.add(named[k][0], [row[k] for row in words], comma=names.delimiter != ",")
    table.units = {name: unit or extra for (name, unit), extra in zip(named, names.units, strict=True) if unit or extra}


def _words(table: Table, names: _Names, texts: Sequence[str]) -> Iterator[list[str]]:
    """Rows as words, all of the length of the header. Raises InputError for one that is not."""
    wanted = len(names.words)
    for k, text in enumerate(texts):
        words = _split(text, names.delimiter)
        if len(words) == wanted + 1 and not words[-1].strip():
            words.pop()
        if len(words) != wanted:
            known = f"row {names.place.line} names {wanted} columns"
            raise table.error(f"this row has {counted(len(words), 'value')}; {known}.", k)
        yield words


def _find_names(place: Place, text: str, before: Sequence[tuple[Place, str]]) -> _Names:
    """The row of names before the first row of data, and what separates its words."""
    delimiters: list[str | None] = [one for one in "\t;," if one in text]
    if not delimiters or len(text.split()) > 1:
        delimiters.append(None)
    for delimiter in delimiters:
        first = _split(text, delimiter)
        units: list[str] = []
        for where, candidate in reversed(before):
            words = _split(candidate, delimiter)
            if delimiter and len(words) == len(first) + 1 and not words[-1].strip():
                words.pop()
            if delimiter and len(words) == len(first) - 1 and not first[-1].strip():
                first.pop()
            if len(words) != len(first) or is_ruler(words) or any(is_number(word) for word in words):
                continue
            if not units and any(map(is_unit, words)) and all(is_unit(w) or is_value(w) for w in words):
                units = [word.strip(" ()[]") for word in words]
                continue
            return _Names(where, candidate, words, delimiter, units or [""] * len(words))
    named = [(where.line, len(words)) for where, candidate in before for words in [re.split(r"[,;\s]+", candidate)]]
    nearest = f"; row {named[-1][0]} has {named[-1][1]} words" if named else ""
    count = max(len(_split(text, delimiter)) for delimiter in delimiters)
    raise place.error(
        f"this is the first row of data, and no row before it names its {count} columns{nearest}: a CSV needs "
        "a header line, an XYZ a comment (/ LINE X Y ...)."
    )


def _same_names(names: _Names, place: Place, text: str) -> None:
    """A comment between the data may repeat the names, but not change their order. Raises InputError."""
    words = [column_name(word)[0] for word in _split(text, names.delimiter)]
    known = [column_name(word)[0] for word in names.words]
    if words != known and len(words) == len(known) and len(set(words) & set(known)) > len(known) / 2:
        raise place.error(f"the columns are named again, and otherwise than in row {names.place.line}; split the file.")


def _line_header(text: str) -> str | None:
    """Label of a row such as `Line 10100`, `Tie T20:3` or `L10100`, None for any other row."""
    if _SHORT.fullmatch(text):
        return text
    found = _HEADER.fullmatch(text)
    if found is None:
        return None
    kind, label = found[1].lower(), found[2] or ""
    if np.isnan(line_number(label)) and (len(label.split()) > 1 or kind not in ("line", "tie")):
        return None  # the names of a table, LINE FLIGHT UTC ..., or a title
    return label


def is_data(text: str) -> bool:
    """Whether most words of a row are numbers or nulls, and at least one is a number."""
    words = [word.strip().strip("\"'") for word in re.split(r"[;\t,]|\s+", text)]
    full = [word for word in words if word]
    good = sum(map(is_value, full))
    return any(map(is_number, full)) and 2 * good > len(full)


def _split(text: str, delimiter: str | None) -> list[str]:
    if delimiter is None:
        return text.split()
    if '"' in text:
        with contextlib.suppress(csv.Error):
            return next(csv.reader([text], delimiter=delimiter, skipinitialspace=True))
    return text.split(delimiter)
