"""Stored references of recorded numbers and arrays, each with its spread over computing settings.

`tests/reference/<paper>/<notebook>.json` (paper scale) and `.quick.json` hold key -> {value, unit, spread}; arrays are
sampled into the `.npz` beside and have {shape, stride, unit, spread}. `largest` is the largest magnitude seen of what
is rounding. The tolerance follows from these (`tolerance.by_rule`) unless `guards.yml` declares one. `anchors.yml`
holds the numbers of the specification that ours must meet.
"""

from __future__ import annotations

import json
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError, model_validator

from geokalman.reproduce import runfolder, tolerance, yamltext
from geokalman.reproduce.errors import Fault
from geokalman.reproduce.tolerance import Tolerance

M = TypeVar("M", bound=BaseModel)
Mode = Literal["quick", "mid", "book"]


class Difference(NamedTuple):
    """One key held against what is stored; `problem` is empty where it agrees."""

    key: str
    stored: float | None
    ours: float | None
    unit: str
    tolerance: str
    problem: str


class Anchor(BaseModel):
    """A number of the specification that a recorded one must meet, at one scale."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    notebook: str
    mode: Mode
    key: str
    value: float | None = None
    tolerance: Tolerance
    _gather = model_validator(mode="before")(tolerance.gathered)

    @model_validator(mode="after")
    def _has_a_value(self) -> Anchor:
        if self.value is None and not self.tolerance.alone:
            raise ValueError(f"({self.key}) has no value; only size, min and max stand alone")
        return self


class Guard(BaseModel):
    """Keys of one notebook (a pattern with `*`) that are not guarded by the rule, and why."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    notebook: str
    mode: Literal["quick", "paper"] | None = None
    key: str
    why: str
    tolerance: Tolerance
    _gather = model_validator(mode="before")(tolerance.gathered)

    def covers(self, notebook: str, mode: str, key: str) -> bool:
        """Is it about this key?"""
        return notebook == self.notebook and self.mode in (None, mode) and fnmatchcase(key, self.key)


def path_of(root: Path, name: str, mode: str) -> Path:
    """Path of the stored reference of a notebook at `paper` or `quick` scale."""
    return root / "tests" / "reference" / f"{name}{'.quick' if mode == 'quick' else ''}.json"


def load(root: Path, name: str, mode: str) -> tuple[dict[str, dict[str, Any]], dict[str, np.ndarray]]:
    """Stored entries and array samples of a notebook; raises Fault where there is no reference or it is malformed."""
    path = path_of(root, name, mode)
    if not path.is_file():
        raise Fault(
            f"{name} has no reference at {mode} scale ({path.relative_to(root)}); make one with: make reference."
        )
    try:
        entries = json.loads(path.read_text(encoding="utf-8"))
        with np.load(path.with_suffix(".npz")) as stored:
            return entries, {key: stored[key] for key in stored.files}
    except (OSError, ValueError) as error:
        raise Fault(f"{path.relative_to(root)} (or the .npz beside it) cannot be read: {error}.") from error


def read_run(folder: Path) -> tuple[dict[str, Any], dict[str, dict[str, Any]], dict[str, np.ndarray]]:
    """Provenance, numbers and arrays of a run folder; raises Misuse where it is none."""
    return runfolder.read(folder)


def differences(root: Path, folder: Path, mode: str | None = None) -> list[Difference]:
    """The run in `folder` held against the stored reference, key by key; `mode` defaults to the run's own.

    Raises Fault where there is no reference.
    """
    told, metrics, arrays = read_run(folder)
    name, mode = told["notebook"], mode or told["mode"]
    entries, samples = load(root, name, mode)
    declared = guards(root, name.partition("/")[0])
    found = []
    for key in sorted({*entries, *metrics, *arrays}):
        entry = entries.get(key)
        if entry is None:
            ours = metrics.get(key, {}).get("value")
            unit = metrics[key]["unit"] if key in metrics else told["arrays"][key]["unit"]
            found.append(Difference(key, None, ours, unit, "", "not in the reference"))
            continue
        allowed = _allowed(declared, name, mode, key, entry, samples)[1]
        if "shape" in entry:
            found.append(_array_difference(key, entry, allowed, samples.get(key), arrays.get(key)))
        else:
            found.append(_number_difference(key, entry, allowed, metrics.get(key)))
    return found


def _allowed(
    declared: Iterable[Guard], name: str, mode: str, key: str, entry: Mapping[str, Any], samples: Mapping[str, Any]
) -> tuple[str, Tolerance]:
    """How a stored number or array is guarded, in words, and its tolerance: a declared one, else by the rule."""
    for guard in declared:
        if guard.covers(name, mode, key):
            return "a declared bound" if not guard.tolerance.none else "nothing, as declared", guard.tolerance
    try:
        if "spread" not in entry and (earlier := {k: v for k, v in entry.items() if k in Tolerance.model_fields}):
            return "an earlier tolerance (no spread yet)", Tolerance.model_validate(earlier)
        value = _largest(samples[key]) if "shape" in entry else entry["value"]
        found = tolerance.by_rule(value, entry["spread"], entry.get("largest"))
    except KeyError as error:
        raise Fault(f"the stored reference of {key} is malformed: it has no {error}.") from error
    return "a size (rounding)" if found.size is not None else f"a relative difference of {found.rel:.0e}", found


def kinds(root: Path) -> dict[str, Counter[str]]:
    """How many stored numbers and arrays are guarded by which kind of tolerance: kind -> scale -> number."""
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    for path in sorted((root / "tests" / "reference").glob("*/*.json")):
        stem, _, quick = path.stem.partition(".")
        name, mode = f"{path.parent.name}/{stem}", quick or "paper"
        declared = guards(root, path.parent.name)
        entries, samples = load(root, name, mode)
        for key, entry in entries.items():
            counts[_allowed(declared, name, mode, key, entry, samples)[0]][mode] += 1
    return counts


def _number_difference(
    key: str, entry: Mapping[str, Any], allowed: Tolerance, now: Mapping[str, Any] | None
) -> Difference:
    stored = entry["value"]
    if now is None:
        return Difference(key, stored, None, entry["unit"], str(allowed), "no longer recorded")
    ours = now["value"]
    problem = ""
    if now["unit"] != entry["unit"]:
        problem = f"its unit was {entry['unit'] or 'none'}, now it is {now['unit'] or 'none'}"
    elif ours is None or (stored is None and not allowed.alone):
        problem = "" if ours == stored or allowed.none else "finite in one of the two only"
    elif not allowed.holds(ours, stored):
        problem = f"beyond {allowed}"
    return Difference(key, stored, ours, entry["unit"], str(allowed), problem)


def _array_difference(
    key: str, entry: Mapping[str, Any], allowed: Tolerance, stored: np.ndarray | None, now: np.ndarray | None
) -> Difference:
    def found(worst: float | None, problem: str) -> Difference:
        return Difference(key, None, worst, entry["unit"], f"{allowed} of the largest", problem)

    if now is None or stored is None:
        return found(None, "no longer recorded" if now is None else "its samples are missing from the .npz")
    if allowed.none:
        return found(None, "")
    if list(now.shape) != entry["shape"]:
        return found(None, f"its shape was {entry['shape']}, now it is {list(now.shape)}")
    ours = now.ravel()[:: entry["stride"]]
    worst, largest = _largest(ours - stored), _largest(stored)
    if allowed.alone:
        good = all(allowed.holds(v, None) for v in ours[~np.isnan(ours)])
    else:
        good = (np.isnan(ours) == np.isnan(stored)).all() and worst <= allowed.allowed(largest)
    return found(worst, "" if good else f"differs by up to {worst:.3g}, beyond {allowed} of {largest:.3g}")


def _largest(array: np.ndarray) -> float:
    return float(np.nanmax(np.abs(array), initial=0.0))


def anchors(root: Path, paper: str) -> list[Anchor]:
    """Anchors of a paper, none where it has no file; raises Fault with file and number where one is malformed."""
    return _entries(root, paper, "anchor", Anchor)


def guards(root: Path, paper: str) -> list[Guard]:
    """Declared tolerances of a paper, none where it has no file; raises Fault as `anchors` does."""
    return _entries(root, paper, "guard", Guard)


def _entries(root: Path, paper: str, word: str, kind: type[M]) -> list[M]:
    path = root / "tests" / "reference" / paper / f"{word}s.yml"
    if not path.is_file():
        return []
    where, k = path.relative_to(root), 0
    found = []
    try:
        for k, entry in enumerate(yamltext.parse(path.read_text(encoding="utf-8")), 1):
            found.append(kind.model_validate(entry))
    except ValidationError as error:
        problem = error.errors()[0]
        place = ".".join(str(p) for p in problem["loc"])
        words = f"{place} {problem['msg'].removeprefix('Value error, ')}".strip()
        raise Fault(f"{where}, {word} {k}: {words}.") from error
    except (ValueError, TypeError) as error:
        raise Fault(f"{where}: {error}.") from error
    return found


def hold(wanted: Iterable[Anchor], metrics: Mapping[str, Mapping[str, Any]]) -> list[Difference]:
    """Recorded numbers of one notebook held against anchors of it."""
    found = []
    for anchor in wanted:
        now = metrics.get(anchor.key)
        ours = now["value"] if now else None
        problem = (
            "not recorded"
            if ours is None
            else ""
            if anchor.tolerance.holds(ours, anchor.value)
            else f"beyond {anchor.tolerance}"
        )
        found.append(
            Difference(anchor.key, anchor.value, ours, now["unit"] if now else "", str(anchor.tolerance), problem)
        )
    return found
