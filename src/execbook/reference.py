"""Stored references of recorded numbers and arrays, with their spread over settings.

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
from pydantic import TypeAdapter, ValidationError, model_validator

from execbook import display, multiverse, tolerance, yamltext
from execbook.errors import Fault, explain
from execbook.runfolder import read as read_run
from execbook.tolerance import Tolerance


class Difference(NamedTuple):
    """One key held against what is stored, or against the anchor from `source`."""

    key: str
    stored: float | None
    ours: float | None
    unit: str
    problem: str  # empty where the two agree
    source: str = ""

    def __str__(self) -> str:
        stored, ours = ("nothing" if v is None else display.number(v, 7) for v in (self.stored, self.ours))
        unit = f" {self.unit}" if self.unit else ""
        wanted = f"its anchor ({self.source}) is" if self.source else "stored is"
        return f"{self.key}: {ours}{unit}, {wanted} {stored}{unit}: {self.problem}."


class Anchor(Tolerance):
    """A number of other origin that a recorded one must meet, within this tolerance."""

    value: float | None = None
    source: str

    @model_validator(mode="after")
    def _has_a_value(self) -> Anchor:
        if self.value is None and not self.alone:
            raise ValueError("an anchor without a value has size, min or max")
        return self


class Guard(Tolerance):
    """A tolerance for keys (a pattern with `*`) that the rule does not fit, and why."""

    notebook: str
    mode: Literal["quick", "paper"] | None = None
    key: str
    why: str

    def covers(self, notebook: str, mode: str, key: str) -> bool:
        """Tell whether it is about this key."""
        return notebook == self.notebook and self.mode in (None, mode) and fnmatchcase(key, self.key)


class Stored:
    """All that is stored of one notebook at one scale; raises Fault where it cannot be read."""

    def __init__(self, root: Path, name: str, mode: str) -> None:
        self.name, self.mode = name, mode
        self.entries, self.samples = load(root, name, mode)
        self._guards = guards(root, name.partition("/")[0])
        spread = ((self._size(key), e["spread"]) for key, e in self.entries.items() if "spread" in e)
        self._usual = tolerance.usual_spread(spread)

    def _size(self, key: str) -> float | None:
        """Give the stored number, or the largest element of the stored array."""
        return largest(self.samples[key]) if key in self.samples else self.entries[key].get("value")

    def allowed(self, key: str) -> tuple[str, Tolerance]:
        """Give how a stored number or array is guarded, in words, and its tolerance."""
        for guard in self._guards:
            if guard.covers(self.name, self.mode, key):
                return "nothing, as declared" if guard.none else "a declared bound", guard
        entry = self.entries[key]
        if self.name.endswith(f"/{multiverse.READINGS}") and (error := multiverse.guarded(key, self.entries)):
            return "the sampling error of a share", Tolerance(abs=error)
        if "spread" not in entry:
            raise Fault(f"The stored reference of {key} is malformed: it has no 'spread'.")
        found = tolerance.by_rule(self._size(key), entry["spread"], entry.get("largest"), self._usual)
        return "a size (rounding)" if found.size is not None else f"a relative difference of {found.rel:.0e}", found


def path_of(root: Path, name: str, mode: str) -> Path:
    """Give the path of the reference of a notebook at a scale, such as `paper` or `quick`."""
    return root / "tests" / "reference" / f"{name}{'' if mode == 'paper' else f'.{mode}'}.json"


def load(root: Path, name: str, mode: str) -> tuple[dict[str, dict[str, Any]], dict[str, np.ndarray]]:
    """Read stored entries and array samples; raises Fault where there are none."""
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
    """Hold a run against the stored reference and anchors of its scale, or of `mode`.

    Raises Fault where there is no reference.
    """
    told, metrics, arrays = read_run(folder)
    stored = Stored(root, told["notebook"], mode or told["mode"])
    whole = any(is_stored(entry) for entry in stored.entries.values())
    found = []
    for key in sorted({*stored.entries, *metrics, *arrays}):
        entry, now = stored.entries.get(key, {}), metrics.get(key)
        if "shape" in entry:
            allowed = stored.allowed(key)[1]
            worst, problem = _array_problem(entry, allowed, stored.samples.get(key), arrays.get(key))
            found.append(Difference(key, None, worst, entry["unit"], problem))
        elif "value" in entry:
            problem = _number_problem(entry, stored.allowed(key)[1], now)
            found.append(Difference(key, entry["value"], now["value"] if now else None, entry["unit"], problem))
        elif whole and (key in metrics or key in arrays):
            unit = (now or told["arrays"][key])["unit"]
            found.append(Difference(key, None, now["value"] if now else None, unit, "not in the reference"))
        found.extend(hold(key, entry.get("anchors", ()), now))
    return found


def is_stored(entry: Mapping[str, Any]) -> bool:
    """Tell whether an entry holds a number or an array, and not anchors alone."""
    return "value" in entry or "shape" in entry


def kinds(root: Path) -> dict[str, Counter[str]]:
    """Count the stored numbers and arrays by the kind of tolerance: kind -> scale -> number."""
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    for path in sorted((root / "tests" / "reference").glob("*/*.json")):
        name, _, scale = path.stem.partition(".")
        stored = Stored(root, f"{path.parent.name}/{name}", scale or "paper")
        for key, entry in stored.entries.items():
            if is_stored(entry):
                counts[stored.allowed(key)[0]][stored.mode] += 1
    return counts


def _number_problem(entry: Mapping[str, Any], allowed: Tolerance, now: Mapping[str, Any] | None) -> str:
    if now is None:
        return "no longer recorded"
    stored, ours = entry["value"], now["value"]
    if now["unit"] != entry["unit"]:
        return f"its unit was {entry['unit'] or 'none'}, now it is {now['unit'] or 'none'}"
    if ours is None or (stored is None and not allowed.alone):
        return "" if ours == stored or allowed.none else "finite in one of the two only"
    return "" if allowed.holds(ours, stored) else f"beyond {allowed}"


def _array_problem(
    entry: Mapping[str, Any], allowed: Tolerance, stored: np.ndarray | None, now: np.ndarray | None
) -> tuple[float | None, str]:
    """Give the largest difference, where the arrays can be compared, and the problem."""
    if now is None or stored is None:
        return None, "no longer recorded" if now is None else "its samples are missing from the .npz"
    if allowed.none:
        return None, ""
    if list(now.shape) != entry["shape"]:
        return None, f"its shape was {entry['shape']}, now it is {list(now.shape)}"
    ours = now.ravel()[:: entry["stride"]]
    worst, size = largest(ours - stored), largest(stored)
    if allowed.alone:
        good = all(allowed.holds(v, None) for v in ours[~np.isnan(ours)])
    else:
        good = (np.isnan(ours) == np.isnan(stored)).all() and worst <= allowed.allowed(size)
    return worst, "" if good else f"differs by up to {worst:.3g}, beyond {allowed} of {size:.3g}"


def largest(array: np.ndarray) -> float:
    """Give the largest magnitude in an array."""
    return float(np.nanmax(np.abs(array), initial=0.0))


def hold(key: str, anchors: Iterable[Any], now: Mapping[str, Any] | None) -> Iterator[Difference]:
    """Hold a recorded number against its anchors; raises Fault where one is malformed."""
    ours, unit = (now["value"], now["unit"]) if now else (None, "")
    for entry in anchors:
        try:
            anchor = Anchor.model_validate(entry)
        except ValidationError as error:
            raise Fault(f"An anchor of {key} is malformed: {explain(error)}.") from error
        problem = "not recorded" if ours is None else "" if anchor.holds(ours, anchor.value) else f"beyond {anchor}"
        yield Difference(key, anchor.value, ours, unit, problem, anchor.source)


def guards(root: Path, paper: str) -> list[Guard]:
    """Read the declared tolerances of a paper, if any; raises Fault where one is malformed."""
    path = root / "tests" / "reference" / paper / "guards.yml"
    if not path.is_file():
        return []
    try:
        return TypeAdapter(list[Guard]).validate_python(yamltext.parse(path.read_text(encoding="utf-8")) or [])
    except ValidationError as error:
        raise Fault(f"{path.relative_to(root)}, guard {explain(error)}.") from error
    except ValueError as error:
        raise Fault(f"{path.relative_to(root)}, {error}.") from error
