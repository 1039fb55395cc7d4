"""The header of an ICGEM file: the keywords that give its coefficients their meaning.

Source: Barthelmes & Foerste (2011), "The ICGEM-format", GFZ Potsdam.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from geokalman.physics.field import TIDE_SYSTEMS
from geokalman.reading import InputError, Place

MAX_DEGREE = 100_000
"""Largest max_degree that is taken for one: five billion coefficients."""
_ERROR_COLUMNS = {"no": 0, "calibrated": 2, "formal": 2, "calibrated_and_formal": 4, "unknown": None}
_CHOICES = {
    "product_type": ("gravity_field",),
    "errors": tuple(_ERROR_COLUMNS),
    "norm": ("fully_normalized", "unnormalized"),
    "format": ("icgem1.0", "icgem2.0"),
}
_UNITS = {
    "gravity_constant": {"m3/s2": 1.0, "m3s-2": 1.0, "km3/s2": 1e9, "km3s-2": 1e9},
    "radius": {"m": 1.0, "meter": 1.0, "metre": 1.0, "meters": 1.0, "metres": 1.0, "km": 1e3},
}
_ALIASES = {
    "gm": "gravity_constant", "reference_radius": "radius", "earth_radius": "radius", "normalization": "norm",
    "normalisation": "norm", "error": "errors", "maximum_degree": "max_degree", "degree_max": "max_degree",
}  # fmt: skip
_KEYWORDS = {*_CHOICES, *_UNITS, "max_degree", "modelname", "tide_system"}


class GfcError(InputError):
    """A `.gfc` file that is not what it claims to be; the message names file, line and what would be right."""


@dataclass(frozen=True)
class Header:
    """What a header says, in SI units; `places` tells where GM and radius stand."""

    name: str
    gm: float
    radius: float
    n_max: int
    errors: int | None  # columns of standard deviations; None where the header does not say
    unnormalised: bool
    tide_system: str
    version: int  # 0: icgem1.0, 1: icgem2.0
    places: dict[str, Place]


def read_header(path: Path, lines: Iterator[tuple[Place, str]]) -> Header:
    """The header, read from lines up to `end_of_head`.

    What stands before `begin_of_head` is no header. Where that line is absent, the header begins with the first keyword
    that has a value, and prose before it may begin with a keyword. A unit behind GM or radius is honoured.
    Raises GfcError for a keyword that is absent, unknown in value, or given twice with other values.
    """
    values: dict[str, tuple[Any, Place]] = {}
    begun, fault = False, None
    for place, line in lines:
        words = [word for word in line.replace("=", " ").split() if word != ":"]
        key = words.pop(0).lower().rstrip(":") if words else ""
        key = "gravity_constant" if re.fullmatch(r"[a-z]+_gravity_constant", key) else _ALIASES.get(key, key)
        if key == "begin_of_head":
            values.clear()
            begun, fault = True, None
        elif key.startswith("end_of_head"):
            break
        elif key in _KEYWORDS:
            try:
                value = _parsed(key, words, place)
            except GfcError as error:
                fault = fault or (error if begun or len(words) == 1 else None)
                continue
            begun = True
            if values.setdefault(key, (value, place))[0] != value and key != "modelname":
                said = f"{key} = {' '.join(words)} is given otherwise in line {values[key][1].line}; one is right."
                fault = fault or place.error(said)
    else:
        raise GfcError(f"{path}: no line 'end_of_head'; this is no ICGEM file, or it is truncated.")
    if fault is not None:
        raise fault
    for key, meaning in (
        ("max_degree", "the line 'max_degree'"),
        ("gravity_constant", "GM (a line 'earth_gravity_constant' or 'gravity_constant')"),
        ("radius", "the reference radius (a line 'radius')"),
    ):
        if key not in values:
            raise GfcError(f"{path}: the header lacks {meaning}.")
    said = {key: value for key, (value, _) in values.items()}
    return Header(
        name=said.get("modelname") or path.name.split(".")[0],
        gm=said["gravity_constant"],
        radius=said["radius"],
        n_max=said["max_degree"],
        errors=_ERROR_COLUMNS[said.get("errors", "unknown")],
        unnormalised=said.get("norm") == "unnormalized",
        tide_system=said.get("tide_system", "unknown"),
        version=int(said.get("format") == "icgem2.0"),
        places={key: place for key, (_, place) in values.items()},
    )


def _parsed(key: str, words: list[str], place: Place) -> Any:
    """The value that the words behind a keyword give."""
    if not words and key not in ("modelname", "tide_system"):
        raise place.error(f"{key} has no value.")
    if key in _CHOICES:
        known = {_squashed(word): word for word in _CHOICES[key]}
        for count in (3, 2, 1):  # `calibrated and formal` before `calibrated`
            if (word := known.get(_squashed("".join(words[:count])))) is not None:
                return word
        several = "one of " * (len(_CHOICES[key]) > 1)
        raise place.error(f"{key} '{words[0]}' is unknown; it must be {several}{', '.join(_CHOICES[key])}.")
    if key == "modelname":
        return " ".join(words)
    if key == "tide_system":  # as files spell it: `tide_free`, `zero`, `Zero-Tide`, `tide free`, ...
        text = "".join(words).lower()
        spoken = (system for system in TIDE_SYSTEMS[:3] if system.replace("_", "").replace("tide", "") in text)
        return next(spoken, "unknown")
    value = place.number(words[0], key)
    if key == "max_degree":
        if value != int(value) or not 2 <= value <= MAX_DEGREE:
            raise place.error(f"max_degree = {words[0]} must be an integer of at least 2 and at most {MAX_DEGREE}.")
        return int(value)
    if value <= 0:
        raise place.error(f"{key} = {words[0]} must be positive.")
    unit = re.sub(r"[\[\](){}*^]", "", "".join(words[1:])).lower().replace("sec", "s")
    if unit in _UNITS[key]:
        return value * _UNITS[key][unit]
    if unit and words[1][0] not in "#!%;(":  # a remark
        raise place.error(
            f"{key} = {words[0]} has the unknown unit '{' '.join(words[1:])}'; metres and seconds are right."
        )
    return value


def _squashed(text: str) -> str:
    return re.sub(r"[\s_-]", "", text.lower()).replace("normalis", "normaliz")
