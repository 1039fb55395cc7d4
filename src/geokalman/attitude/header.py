"""Headers of GRACE-FO Level-1 files: YAML, of which only what gives the records their meaning must be sound."""

from __future__ import annotations

import datetime
import math
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import yaml

from geokalman.attitude.products import GRACE_FO, KEYS, Column
from geokalman.reading import InputError, Place, number

END = "# End of YAML header"
EPOCH = datetime.datetime(2000, 1, 1, 12)
NAME = re.compile(
    r"^(?P<product>[A-Z0-9]{5})_(?P<date>\d{4}-\d{2}-\d{2})_(?P<satellite>[A-Z])_(?P<version>\d{2})\.(txt|asc)"
    r"(\.(gz|xz|bz2))?$"
)
_END = re.compile(r"#\s*end of yaml header", re.IGNORECASE)
_CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f]")  # no YAML may hold them
_LONGEST = 5000  # lines of a header
_MOST_BROKEN = 10  # lines of metadata that are passed over
_METADATA = re.compile(r"\s+(?:- )?(?P<key>[\w-]+): +\S")
_NEEDED = {"header", "dimensions", "num_records", "variables", "name", "units", "flag_meanings", "epoch_time"}
_NO_UNIT = {"", "n/a", "na", "none", "unitless", "dimensionless", "-", "1", "~", "null"}
_WORDS = (  # spellings of units -> ours
    (r"kilomet(?:er|re)s?", "km"),
    (r"micros(?:ec(?:ond)?s?)?|µs|usecs?", "us"),
    (r"nanosec(?:ond)?s?|nsecs?", "ns"),
    (r"millisec(?:ond)?s?|msecs?", "ms"),
    (r"sec(?:ond)?s?", "s"),
    (r"met(?:er|re)s?", "m"),
    (r"degrees?", "deg"),
    (r"radians?", "rad"),
    (r"\s*per\s*", "/"),
    (r"\s+s(?:\^|\*\*)?-1$", "/s"),
    (r"\s+s(?:\^|\*\*)?-2$", "/s2"),
    (r"\^|\*\*|\s", ""),
)
_FACTORS = {  # a unit that is no other spelling, in the one that is needed
    ("km", "m"): 1e3, ("km/s", "m/s"): 1e3, ("mm", "m"): 1e-3, ("rad", "deg"): 180.0 / math.pi,
    ("deg/s2", "rad/s2"): math.pi / 180.0, ("ms", "s"): 1e-3, ("us", "s"): 1e-6, ("ns", "s"): 1e-9,
    ("mgal", "m/s2"): 1e-5, ("km/s2", "m/s2"): 1e3, ("nm/s2", "m/s2"): 1e-9,
}  # fmt: skip


class Level1Error(InputError):
    """A Level-1 file that cannot be used; the sentence names the file, the line where there is one, and the reason."""


def parts_of(
    path: Path, known: Iterable[str], product: str | None = None, satellite: str | None = None, date: str | None = None
) -> dict[str, str]:
    """Product, date, satellite and version in a file's name, of the known products.

    Raises Level1Error where the name is none of a Level-1 file, or another product, satellite or date is expected.
    """
    found = NAME.match(path.name)
    if not found:
        raise Level1Error(
            f"{path}: the name is not PPPPP_YYYY-MM-DD_S_VV.txt; product, date and satellite are read from it."
        )
    parts = found.groupdict()
    try:
        datetime.date.fromisoformat(parts["date"])
    except ValueError:
        raise Level1Error(f"{path}: the date {parts['date']} in the name is no date.") from None
    for what, wanted in (("product", product), ("satellite", satellite), ("date", date)):
        if wanted is not None and parts[what] != wanted:
            raise Level1Error(f"{path}: {what} {parts[what]} in the file name, {wanted} was expected.")
    if parts["product"] not in known:
        raise Level1Error(f"{path}: product {parts['product']} is unknown; it must be one of {', '.join(known)}.")
    return parts


def read_header(path: Path, stream: Iterator[tuple[Place, str]]) -> tuple[dict[str, Any], int, list[str]]:
    """The header as text values, the number of the first line after it, and notes on what was passed over."""
    texts: list[str] = []
    for place, line in stream:
        if _END.fullmatch(line.strip()):
            break
        if place.line > _LONGEST:
            raise Level1Error(
                f"{path}: no line {END!r} among the first {_LONGEST}; this is not a GRACE-FO Level-1 file."
            )
        texts.append(_CONTROL.sub(" ", line.rstrip("\n")))
    else:
        raise Level1Error(f"{path}: no line {END!r}; this is not a GRACE-FO Level-1 file in ASCII, or it is cut short.")
    notes: list[str] = []
    if not any(text.strip() for text in texts):
        return {}, place.line + 1, ["the header is empty; the columns were taken in the order of the product"]
    content = _parse(path, texts, notes)
    header = content.get("header") if isinstance(content, dict) else None
    if not isinstance(header, dict):
        raise Level1Error(f"{path}, line 1: the YAML header has no mapping `header`.")
    return header, place.line + 1, notes


def _parse(path: Path, texts: list[str], notes: list[str]) -> Any:
    """The YAML in `texts`, every value as text: metadata may hold what is no date and no number."""
    loader = getattr(yaml, "CBaseLoader", yaml.BaseLoader)
    first: Exception | None = None
    for _ in range(_MOST_BROKEN + 1):
        try:
            return yaml.load("\n".join(texts), Loader=loader)
        except (yaml.YAMLError, ValueError, OverflowError, RecursionError) as error:
            first = first or error
            k = _broken(error, texts)
            if k is None:
                break
            notes.append(f"line {k + 1} of the header is not YAML and was passed over: {texts[k].strip()[:60]!r}")
            texts[k] = ""
    mark = getattr(first, "problem_mark", None)
    where = f", line {mark.line + 1}" if mark else ""
    words = getattr(first, "problem", None) or str(first).splitlines()[0]
    raise Level1Error(f"{path}{where}: the header is not YAML ({words}).")


def _broken(error: Exception, texts: list[str]) -> int | None:
    """Index of the line of metadata that is to blame, or None where the fault is not one of metadata."""
    marks = [getattr(error, "problem_mark", None)]
    if re.search("flow|quoted", str(getattr(error, "context", ""))):  # what was opened there is not closed
        marks.insert(0, getattr(error, "context_mark", None))
    for mark in marks:
        if mark is not None and mark.line < len(texts):
            found = _METADATA.match(texts[mark.line])
            if found and found["key"] not in _NEEDED:
                return mark.line
    return None


def agree(path: Path, parts: dict[str, str], header: dict[str, Any]) -> None:
    """Refuse a header of another product, satellite, day or epoch than the name says."""
    attributes = _mapping(header, "global_attributes")
    for key in ("title", "id", "product_name"):
        named = re.findall(
            r"\b(?:SCA1[AB]|QSA1B|IMU1[AB]|TIM1B|CLK1B|ACT1B|GN[IV]1B|KBR1B|VKB1B)\b", str(attributes.get(key, ""))
        )
        if named and parts["product"] not in named:
            raise Level1Error(f"{path}: the header's {key} says {named[0]}, the file name {parts['product']}.")
    platform = re.findall(r"GRACE(?:-FO)?[ _-]?([CD])\b", str(attributes.get("platform", "")))
    if len(platform) == 1 and parts["satellite"] in "CD" and platform[0] != parts["satellite"]:
        raise Level1Error(
            f"{path}: the header's platform is GRACE-{platform[0]}, the file name says {parts['satellite']}."
        )
    start, stop = (str(attributes.get(f"time_coverage_{word}", ""))[:10] for word in ("start", "stop"))
    last = stop if re.match(r"\d{4}-\d{2}-\d{2}$", stop) else start
    if re.match(r"\d{4}-\d{2}-\d{2}$", start) and not start <= parts["date"] <= last:
        raise Level1Error(f"{path}: the header covers {start} to {stop or start}, the file name says {parts['date']}.")
    same_epoch(path, str(_mapping(header, "non-standard_attributes").get("epoch_time", "")))


def same_epoch(path: Path, text: str) -> None:
    """Refuse another epoch than that of GPS seconds; an absent one is taken for it."""
    found = re.match(r"\s*(\d{4}-\d{2}-\d{2})[T ]+(\d{2}:\d{2}:\d{2})", text.replace("/", "-"))
    known = f"{found[1]} {found[2]}" == str(EPOCH) if found else "J2000" in text.upper() or not re.search(r"\d", text)
    if not known:
        raise Level1Error(f"{path}: times count from {text.strip()}; seconds past {EPOCH} (GPS) are needed.")


def _mapping(header: dict[str, Any], key: str) -> dict[str, Any]:
    found = header.get(key)
    return found if isinstance(found, dict) else {}


def _variables(header: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Name -> attributes of the header's variables, in both forms in use; raises KeyError(name) for a double."""
    out: dict[str, dict[str, Any]] = {}
    entries = header.get("variables")
    for entry in entries if isinstance(entries, list) else []:
        if isinstance(entry, dict) and len(entry) == 1 and "name" not in entry:
            [(name, inner)] = entry.items()
        else:
            name, inner = (entry.get("name", ""), entry) if isinstance(entry, dict) else (entry, {})
        if str(name) in out:
            raise KeyError(str(name))
        out[str(name)] = inner if isinstance(inner, dict) else {}
    return out


def schema(path: Path, parts: dict[str, str], header: dict[str, Any], notes: list[str]) -> list[Column | None]:
    """Columns in the order of the file: by the header's variables where present, else as known; None is left out.

    Units, fill values, scale factors and offsets that the header gives are honoured or refused.
    """
    product = parts["product"]
    known = {column.name: column for column in within_day(GRACE_FO[product], product, parts["date"])}
    try:
        variables = _variables(header)
    except KeyError as error:
        raise Level1Error(f"{path}: the header names the variable {error.args[0]} twice.") from None
    if not variables:
        return list(known.values())
    missing = [name for name in known if name not in variables]
    if missing:
        raise Level1Error(f"{path}: the header's variables lack {', '.join(missing)}, which {product} needs.")
    return [
        _as_stated(path, known[name], attributes, notes) if name in known else None
        for name, attributes in variables.items()
    ]


def within_day(columns: tuple[Column, ...], product: str, date: str) -> list[Column]:
    """The columns, the time tag limited to the file's day and a day on either side; cameras of level 1A are 1 to 3."""
    start = (datetime.datetime.fromisoformat(date) - EPOCH).total_seconds()
    limits = {KEYS[product][0]: (start - 86400.0, start + 2 * 86400.0)} if product in KEYS else {}
    if product == "SCA1A":
        limits["sca_id"] = (1.0, 3.0)
    return [c._replace(low=limits[c.name][0], high=limits[c.name][1]) if c.name in limits else c for c in columns]


def _as_stated(path: Path, column: Column, attributes: dict[str, Any], notes: list[str]) -> Column:
    """The column with what the header says of its numbers."""

    def stated(key: str) -> float | None:
        text = str(attributes.get(key, "")).strip()
        try:
            return number(text) if text else None
        except ValueError as error:
            raise Level1Error(f"{path}: {key} of {column.name}: {error}") from None

    for key, neutral in (("scale_factor", 1.0), ("add_offset", 0.0)):
        if stated(key) not in (None, neutral):
            raise Level1Error(
                f"{path}: the header gives {column.name} the {key} {stated(key):g}; {neutral:g} is needed."
            )
    if column.kind in ("text", "flags"):
        return column
    fill = tuple(value for key in ("_FillValue", "missing_value") if (value := stated(key)) is not None)
    return column._replace(factor=_factor(path, column, str(attributes.get("units", "")), notes), fill=fill)


def _factor(path: Path, column: Column, text: str, notes: list[str]) -> float:
    """What turns the header's unit into ours."""
    unit = text.strip().lower()
    if unit in _NO_UNIT or not column.unit:
        return 1.0
    for pattern, word in _WORDS:
        unit = re.sub(pattern, word, unit)
    if unit == column.unit:
        return 1.0
    factor = _FACTORS.get((unit, column.unit))
    if factor is not None and column.kind == "float":
        notes.append(f"{column.name} was turned from {text.strip()} into {column.unit}")
        return factor
    raise Level1Error(f"{path}: the header gives {column.name} in {text.strip()[:30]!r}; {column.unit} is needed.")


def flag_meanings(header: dict[str, Any], variable: str) -> dict[int, str]:
    """Meanings of the bits of a flag variable, bit -> words, where the header's `flag_meanings` say them."""
    try:
        words = _variables(header).get(variable, {}).get("flag_meanings", "")
    except KeyError:
        return {}
    found = {}
    for line in words if isinstance(words, list) else [words]:
        if isinstance(line, dict):  # "- bit 2: Sun" is a mapping to YAML
            line = ", ".join(f"{key}: {text}" for key, text in line.items())
        pairs = re.findall(r"\bbit\s*([0-9]{1,2})\s*[=:]\s*(.*?)(?=[,;]?\s*\bbit\s*[0-9]|$)", str(line))
        found.update({int(bit): text for bit, text in pairs})
    return found


def promised(path: Path, header: dict[str, Any], key: str = "num_records") -> int | None:
    """How many records the header, or its `dimensions`, says there are, or None."""
    text = header.get(key, _mapping(header, "dimensions").get(key))
    if text is not None and not re.fullmatch(r"[0-9]{1,12}", str(text)):
        raise Level1Error(f"{path}: {key} is {text!r:.40}, it must be a number of records.")
    return None if text is None else int(text)
