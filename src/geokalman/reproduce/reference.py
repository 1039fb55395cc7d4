"""Stored references of recorded numbers and arrays: a tolerance beside every key, renewed only with a reason.

`tests/reference/<paper>/<notebook>.json` (paper scale) and `.quick.json` hold key -> {value, unit, tolerance}; arrays
are sampled into the `.npz` beside and have {shape, stride, unit, tolerance}. `anchors.yml` holds the numbers of the
specification that ours must meet. A tolerance is one of rel, abs, factor, max, min.
"""

from __future__ import annotations

import io
import json
import math
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError, model_validator

from geokalman.reproduce import atomic, runfolder, yamltext
from geokalman.reproduce.errors import Fault, Misuse

Mode = Literal["quick", "mid", "book"]
DEFAULT_REL = 1e-6
"""Tolerance of a key that is stored for the first time; loosen or tighten it in the file, renewing keeps it."""
_SAMPLES = 400  # values of one array that are stored


class Tolerance(BaseModel):
    """Exactly one of: relative, absolute, within a factor, at most, at least."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
    rel: float | None = None
    abs: float | None = None
    factor: float | None = None
    max: float | None = None
    min: float | None = None

    @model_validator(mode="after")
    def _one(self) -> Tolerance:
        if len(self.model_fields_set) != 1:
            raise ValueError("a tolerance is exactly one of rel, abs, factor, max, min")
        return self

    def holds(self, ours: float, wanted: float | None) -> bool:
        """Is `ours` right, where the stored value is `wanted`?"""
        if self.max is not None:
            return ours <= self.max
        if self.min is not None:
            return ours >= self.min
        if wanted is None:
            return False
        if self.factor is not None:
            return ours * wanted > 0 and 1 / self.factor <= ours / wanted <= self.factor
        return abs(ours - wanted) <= (self.abs if self.abs is not None else (self.rel or 0.0) * abs(wanted))

    def __str__(self) -> str:
        [(kind, value)] = self.model_dump(exclude_none=True).items()
        return f"{kind} {value:g}"


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

    @model_validator(mode="before")
    @classmethod
    def _gather(cls, data: Any) -> Any:
        if not isinstance(data, dict) or "tolerance" in data:
            return data
        kinds = set(Tolerance.model_fields) & set(data)
        return {k: v for k, v in data.items() if k not in kinds} | {"tolerance": {k: data[k] for k in kinds}}


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
    entries, samples = load(root, told["notebook"], mode or told["mode"])
    found = []
    for key in sorted({*entries, *metrics, *arrays}):
        entry = entries.get(key)
        if entry is None:
            ours = metrics.get(key, {}).get("value")
            unit = metrics[key]["unit"] if key in metrics else told["arrays"][key]["unit"]
            found.append(Difference(key, None, ours, unit, "", "not in the reference"))
        elif "shape" in entry:
            found.append(_array_difference(key, entry, samples.get(key), arrays.get(key)))
        else:
            found.append(_number_difference(key, entry, metrics.get(key)))
    return found


def _tolerance(key: str, entry: Mapping[str, Any]) -> Tolerance:
    try:
        return Tolerance.model_validate({k: v for k, v in entry.items() if k in Tolerance.model_fields})
    except ValidationError as error:
        raise Fault(f"the stored reference of {key} is malformed: {error.errors()[0]['msg']}.") from error


def _number_difference(key: str, entry: Mapping[str, Any], now: Mapping[str, Any] | None) -> Difference:
    tolerance, stored = _tolerance(key, entry), entry["value"]
    if now is None:
        return Difference(key, stored, None, entry["unit"], str(tolerance), "no longer recorded")
    ours = now["value"]
    problem = ""
    if now["unit"] != entry["unit"]:
        problem = f"its unit was {entry['unit'] or 'none'}, now it is {now['unit'] or 'none'}"
    elif ours is None or (stored is None and tolerance.max is None and tolerance.min is None):
        problem = "" if ours == stored else "finite in one of the two only"
    elif not tolerance.holds(ours, stored):
        problem = f"beyond {tolerance}"
    return Difference(key, stored, ours, entry["unit"], str(tolerance), problem)


def _array_difference(
    key: str, entry: Mapping[str, Any], stored: np.ndarray | None, now: np.ndarray | None
) -> Difference:
    tolerance, unit = _tolerance(key, entry), entry["unit"]

    def found(worst: float | None, problem: str) -> Difference:
        return Difference(key, None, worst, unit, f"{tolerance} of the largest", problem)

    if now is None or stored is None:
        return found(None, "no longer recorded" if now is None else "its samples are missing from the .npz")
    if list(now.shape) != entry["shape"]:
        return found(None, f"its shape was {entry['shape']}, now it is {list(now.shape)}")
    ours = now.ravel()[:: entry["stride"]]
    same = (np.isnan(ours) == np.isnan(stored)).all()
    worst = float(np.nanmax(np.abs(ours - stored), initial=0.0))
    largest = float(np.nanmax(np.abs(stored), initial=0.0))
    limit = tolerance.abs if tolerance.abs is not None else (tolerance.rel or 0.0) * largest
    if tolerance.max is not None:
        worst, limit = float(np.nanmax(np.abs(ours), initial=0.0)), tolerance.max
    return found(
        worst, "" if same and worst <= limit else f"differs by up to {worst:.3g}, beyond {tolerance} of {largest:.3g}"
    )


def renew(root: Path, folder: Path) -> list[Difference]:
    """Store the run in `folder` as reference, keeping the tolerances; gives what moved (all keys of a first one)."""
    told, metrics, arrays = read_run(folder)
    name, mode = told["notebook"], told["mode"]
    if mode not in ("paper", "quick"):
        raise Misuse(f"{folder} was run with parameters of its own; a reference is the paper's scale or the quick one.")
    path = path_of(root, name, mode)
    known = load(root, name, mode)[0] if path.is_file() else {}
    moved = [d for d in differences(root, folder) if d.problem] if known else [
        Difference(k, None, m["value"], m["unit"], f"rel {DEFAULT_REL:g}", "new") for k, m in metrics.items()
    ]  # fmt: skip
    if known and not moved:
        return []

    def kept(key: str) -> dict[str, float]:
        old = {k: v for k, v in known.get(key, {}).items() if k in Tolerance.model_fields}
        return old or {"rel": DEFAULT_REL}

    entries: dict[str, Any] = {k: {"value": m["value"], "unit": m["unit"], **kept(k)} for k, m in metrics.items()}
    samples = {}
    for key, array in arrays.items():
        stride = max(1, math.ceil(array.size / _SAMPLES))
        samples[key] = array.ravel()[::stride]
        entries[key] = {"shape": list(array.shape), "stride": stride, "unit": told["arrays"][key]["unit"], **kept(key)}
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **samples)
    with atomic.open_whole(path.with_suffix(".npz")) as stream:
        stream.write(buffer.getvalue())
    lines = [f" {json.dumps(k)}: {json.dumps(v, ensure_ascii=False)}" for k, v in sorted(entries.items())]
    atomic.write_text(path, "{\n" + ",\n".join(lines) + "\n}\n")  # one key a line: differences read well
    return moved


def note_reason(root: Path, reason: str, moved: int) -> None:
    """Add the reason to the top section of CHANGELOG.md (`## Unreleased`, made where it is missing)."""
    path = root / "CHANGELOG.md"
    text = path.read_text(encoding="utf-8") if path.is_file() else "# Changelog\n"
    line = f"- References renewed ({moved} {'number' if moved == 1 else 'numbers'} moved or new): {reason}\n"
    heading = re.search(r"^## \[?Unreleased\]?.*\n+", text, re.M | re.I)
    if heading:
        text = text[: heading.end()] + line + text[heading.end() :]
    else:
        first = re.search(r"^## ", text, re.M)
        place = first.start() if first else len(text)
        text = text[:place] + f"\n## Unreleased\n\n{line}\n" + text[place:]
    atomic.write_text(path, text)


def anchors(root: Path, paper: str) -> list[Anchor]:
    """Anchors of a paper, none where it has no file; raises Fault with file and number where one is malformed."""
    path = root / "tests" / "reference" / paper / "anchors.yml"
    if not path.is_file():
        return []
    where = path.relative_to(root)
    try:
        entries = yamltext.parse(path.read_text(encoding="utf-8"))
        return [_anchor(entry, f"{where}, anchor {k}") for k, entry in enumerate(entries, 1)]
    except (ValueError, TypeError) as error:
        raise Fault(f"{where}: {error}.") from error


def _anchor(entry: Any, where: str) -> Anchor:
    try:
        found = Anchor.model_validate(entry)
        if found.value is None and found.tolerance.max is None and found.tolerance.min is None:
            raise Fault(f"{where} ({found.key}) has no value; only max and min stand alone.")
        return found
    except ValidationError as error:
        problem = error.errors()[0]
        place = ".".join(str(p) for p in problem["loc"])
        raise Fault(f"{where}: {place} {problem['msg']}.") from error


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
