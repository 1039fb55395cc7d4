"""Stored references of recorded numbers and arrays, each with its spread over computing settings and its anchors.

`tests/reference/<paper>/<notebook>.json` (paper scale) and `.quick.json` hold key -> {value, unit, spread}; arrays are
sampled into the `.npz` beside and have {shape, stride, unit, spread}. `largest` is the largest magnitude seen of what
is rounding. The tolerance follows from these (`tolerance.by_rule`) unless `guards.yml` declares one. `anchors` are
numbers of other origin that ours must meet, each with tolerance and source; a file of another scale holds them alone.
"""

from __future__ import annotations

import json
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError, model_validator

from execbook import tolerance, yamltext
from execbook.claims import explain
from execbook.errors import Fault
from execbook.runfolder import read as read_run
from execbook.tolerance import Tolerance


class Difference(NamedTuple):
    """One key held against what is stored; `problem` is empty where it agrees, `source` names that of an anchor."""

    key: str
    stored: float | None
    ours: float | None
    unit: str
    problem: str
    source: str = ""


class Anchor(BaseModel):
    """A number of other origin that a recorded one must meet."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    value: float | None = None
    source: str
    tolerance: Tolerance
    _gather = model_validator(mode="before")(tolerance.gathered)

    @model_validator(mode="after")
    def _has_a_value(self) -> Anchor:
        if self.value is None and not self.tolerance.alone:
            raise ValueError("an anchor without a value has size, min or max")
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
        """Tell whether it is about this key."""
        return notebook == self.notebook and self.mode in (None, mode) and fnmatchcase(key, self.key)


def path_of(root: Path, name: str, mode: str) -> Path:
    """Give the path of the stored reference of a notebook at a scale, such as `paper` or `quick`."""
    return root / "tests" / "reference" / f"{name}{'' if mode == 'paper' else f'.{mode}'}.json"


def load(root: Path, name: str, mode: str) -> tuple[dict[str, dict[str, Any]], dict[str, np.ndarray]]:
    """Read the stored entries and array samples of a notebook; raises Fault where there are none to be read."""
    path = path_of(root, name, mode)
    where = path.relative_to(root)
    if not path.is_file():
        raise Fault(f"{name} has no reference at {mode} scale ({where}); make one with: make reference.")
    try:
        entries = json.loads(path.read_text(encoding="utf-8"))
        if not path.with_suffix(".npz").is_file():
            return entries, {}
        with np.load(path.with_suffix(".npz")) as stored:
            return entries, {key: stored[key] for key in stored.files}
    except (OSError, ValueError) as error:
        raise Fault(f"{where} (or the .npz beside it) cannot be read: {error}.") from error


def differences(root: Path, folder: Path, mode: str | None = None) -> list[Difference]:
    """Hold the run in `folder` against the stored reference and anchors; `mode` defaults to the run's own.

    Raises Fault where there is no reference.
    """
    told, metrics, arrays = read_run(folder)
    name, mode = told["notebook"], mode or told["mode"]
    entries, samples = load(root, name, mode)
    declared = guards(root, name.partition("/")[0])
    whole = any(is_stored(entry) for entry in entries.values())
    usual = _usual(entries, samples)
    found = []
    for key in sorted({*entries, *metrics, *arrays}):
        entry = entries.get(key, {})
        now = metrics.get(key)
        if is_stored(entry):
            allowed = _allowed(declared, name, mode, key, entry, samples, usual)[1]
            if "shape" in entry:
                found.append(_array_difference(key, entry, allowed, samples.get(key), arrays.get(key)))
            else:
                found.append(_number_difference(key, entry, allowed, now))
        elif whole and (key in metrics or key in arrays):
            unit = now["unit"] if now else told["arrays"][key]["unit"]
            found.append(Difference(key, None, now["value"] if now else None, unit, "not in the reference"))
        found.extend(hold(key, entry.get("anchors", ()), now))
    return found


def is_stored(entry: Mapping[str, Any]) -> bool:
    """Tell whether an entry holds a number or an array, and not anchors alone."""
    return "value" in entry or "shape" in entry


def _allowed(
    declared: Iterable[Guard],
    name: str,
    mode: str,
    key: str,
    entry: Mapping[str, Any],
    samples: Mapping[str, Any],
    usual: float,
) -> tuple[str, Tolerance]:
    """Give how a stored number or array is guarded, in words, and its tolerance."""
    for guard in declared:
        if guard.covers(name, mode, key):
            return "nothing, as declared" if guard.tolerance.none else "a declared bound", guard.tolerance
    try:
        if "spread" not in entry and (earlier := {k: v for k, v in entry.items() if k in Tolerance.model_fields}):
            return "an earlier tolerance (no spread yet)", Tolerance.model_validate(earlier)
        found = tolerance.by_rule(_size(key, entry, samples), entry["spread"], entry.get("largest"), usual)
    except KeyError as error:
        raise Fault(f"The stored reference of {key} is malformed: it has no {error}.") from error
    return "a size (rounding)" if found.size is not None else f"a relative difference of {found.rel:.0e}", found


def _size(key: str, entry: Mapping[str, Any], samples: Mapping[str, Any]) -> float | None:
    """Give the stored number, or the largest element of the stored array."""
    return largest(samples[key]) if "shape" in entry else entry["value"]


def _usual(entries: Mapping[str, Any], samples: Mapping[str, Any]) -> float:
    """Give the usual relative spread of what a notebook stores."""
    whole = {key: entry for key, entry in entries.items() if is_stored(entry) and "spread" in entry}
    return tolerance.usual_spread((_size(key, entry, samples), entry["spread"]) for key, entry in whole.items())


def kinds(root: Path) -> dict[str, Counter[str]]:
    """Count the stored numbers and arrays by the kind of tolerance: kind -> scale -> number."""
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    for path in sorted((root / "tests" / "reference").glob("*/*.json")):
        stem, _, scale = path.stem.partition(".")
        name, mode = f"{path.parent.name}/{stem}", scale or "paper"
        declared = guards(root, path.parent.name)
        entries, samples = load(root, name, mode)
        usual = _usual(entries, samples)
        for key, entry in entries.items():
            if is_stored(entry):
                counts[_allowed(declared, name, mode, key, entry, samples, usual)[0]][mode] += 1
    return counts


def _number_difference(
    key: str, entry: Mapping[str, Any], allowed: Tolerance, now: Mapping[str, Any] | None
) -> Difference:
    stored = entry["value"]
    if now is None:
        return Difference(key, stored, None, entry["unit"], "no longer recorded")
    ours = now["value"]
    problem = ""
    if now["unit"] != entry["unit"]:
        problem = f"its unit was {entry['unit'] or 'none'}, now it is {now['unit'] or 'none'}"
    elif ours is None or (stored is None and not allowed.alone):
        problem = "" if ours == stored or allowed.none else "finite in one of the two only"
    elif not allowed.holds(ours, stored):
        problem = f"beyond {allowed}"
    return Difference(key, stored, ours, entry["unit"], problem)


def _array_difference(
    key: str, entry: Mapping[str, Any], allowed: Tolerance, stored: np.ndarray | None, now: np.ndarray | None
) -> Difference:
    def found(worst: float | None, problem: str) -> Difference:
        return Difference(key, None, worst, entry["unit"], problem)

    if now is None or stored is None:
        return found(None, "no longer recorded" if now is None else "its samples are missing from the .npz")
    if allowed.none:
        return found(None, "")
    if list(now.shape) != entry["shape"]:
        return found(None, f"its shape was {entry['shape']}, now it is {list(now.shape)}")
    ours = now.ravel()[:: entry["stride"]]
    worst, size = largest(ours - stored), largest(stored)
    if allowed.alone:
        good = all(allowed.holds(v, None) for v in ours[~np.isnan(ours)])
    else:
        good = (np.isnan(ours) == np.isnan(stored)).all() and worst <= allowed.allowed(size)
    return found(worst, "" if good else f"differs by up to {worst:.3g}, beyond {allowed} of {size:.3g}")


def largest(array: np.ndarray) -> float:
    """Give the largest magnitude in an array."""
    return float(np.nanmax(np.abs(array), initial=0.0))


def hold(key: str, anchors: Iterable[Any], now: Mapping[str, Any] | None) -> Iterator[Difference]:
    """Hold a recorded number against its anchors; raises Fault where one is malformed."""
    for entry in anchors:
        try:
            anchor = Anchor.model_validate(entry)
        except ValidationError as error:
            raise Fault(f"An anchor of {key} is malformed: {explain(error)}.") from error
        ours = now["value"] if now else None
        problem = (
            "" if ours is not None and anchor.tolerance.holds(ours, anchor.value) else f"beyond {anchor.tolerance}"
        )
        problem = "not recorded" if ours is None else problem
        yield Difference(key, anchor.value, ours, now["unit"] if now else "", problem, anchor.source)


def guards(root: Path, paper: str) -> list[Guard]:
    """Read the declared tolerances of a paper, none where it has no file; raises Fault where one is malformed."""
    path = root / "tests" / "reference" / paper / "guards.yml"
    if not path.is_file():
        return []
    try:
        return TypeAdapter(list[Guard]).validate_python(yamltext.parse(path.read_text(encoding="utf-8")) or [])
    except ValidationError as error:
        raise Fault(f"{path.relative_to(root)}, guard {explain(error)}.") from error
    except ValueError as error:
        raise Fault(f"{path.relative_to(root)}, {error}.") from error
