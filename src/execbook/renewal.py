"""Renewing stored references and spreads: each notebook at both scales, in every setting."""

from __future__ import annotations

import io
import json
import math
import re
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from execbook import (
    atomic,
    children,
    claims,
    execute,
    graph,
    notebooks,
    parameters,
    reference,
    runfolder,
    settings,
    tolerance,
    verdicts,
)
from execbook.errors import Misuse
from execbook.progress import Display
from execbook.reference import Difference

_SAMPLES = 400  # values of one array that are stored


def renew(root: Path, reason: str, names: Sequence[str] | None = None, quick: bool = True) -> int:
    """Renew the references of `names`, print what moved, note the reason; gives how many.

    Raises Misuse where the reason is empty, or a notebook's run in the book is not from the present sources.
    """
    if not reason.strip():
        raise Misuse('A renewal needs a reason, for CHANGELOG.md; give --reason "why the numbers move".')
    moved = _settle(root, names, quick, moves=True)
    if moved:
        note_reason(root, reason.strip(), moved)
    if claims.papers(root) and (root / "README.md").is_file() and not verdicts.readme_agrees(root):
        sys.stdout.write("README.md shows other verdicts than the ledgers; the command claims --readme renews them.\n")
    return moved


def widen(root: Path, names: Sequence[str] | None = None, quick: bool = True) -> int:
    """Widen the stored spreads to what is seen in every setting; no stored value changes.

    Gives how many numbers are beyond their tolerance so far; they are printed.
    """
    return _settle(root, names, quick, moves=False)


def _settle(root: Path, names: Sequence[str] | None, quick: bool, moves: bool) -> int:
    """Compute and store; prints and counts what moved, or what is beyond its tolerance."""
    names = list(names or notebooks.names(root))
    for name in names:
        if not graph.is_fresh(graph.run_folder(root, name), graph.key(root, name)):
            raise Misuse(f"{name} has no run from the present sources; make book executes it, then renew.")
    quicks = {name for name in names if quick and _has_quick(root, name)}
    scales = [(name, mode) for name in names for mode in ("paper", "quick") if mode == "paper" or name in quicks]
    runs, count = _runs(root, scales), 0
    for name, mode in scales:
        folders = {setting: runs[name, mode, setting] for setting in settings.names()}
        beyond = [] if moves else [(s, d) for s, f in folders.items() for d in _problems(root, f)]
        stored = [(settings.NATIVE, d) for d in store(root, folders, moves)]
        for setting, difference in stored if moves else beyond:
            sys.stdout.write(f"{name} ({mode}, {setting}) {difference}\n")
            count += 1
    return count


def _problems(root: Path, folder: Path) -> list[Difference]:
    """List what in a run is beyond the stored tolerance, anchors aside."""
    return [d for d in reference.differences(root, folder) if d.problem and not d.source]


def _has_quick(root: Path, name: str) -> bool:
    specification = parameters.load(root, name)
    return specification.mode(specification.defaults | specification.quick) == "quick"


def _runs(root: Path, scales: Sequence[tuple[str, str]]) -> dict[tuple[str, str, str], Path]:
    """Give run folders by notebook, scale and setting; what is missing or stale is executed."""
    runs = {}
    for name, mode in scales:
        for setting in settings.names():
            made = root / "book" / "_build" / "settings" / setting / mode / name
            books = (mode, setting) == ("paper", settings.NATIVE)
            runs[name, mode, setting] = graph.run_folder(root, name) if books else made

    def compute(job: tuple[str, str, str]) -> None:
        name, mode, setting = job
        if graph.is_fresh(runs[job], key := graph.key(root, name)):
            return
        quick = mode == "quick"
        with display.notebook(f"{name} ({mode}, {setting})") as progress:
            execute.run(root, name, out=runs[job], quick=quick, page=False, setting=setting, progress=progress, key=key)

    with Display() as display:
        children.in_parallel(graph.WORKERS, compute, runs)  # the first failure ends it; what is finished stays
    return runs


def store(root: Path, folders: Mapping[str, Path], moves: bool = True) -> list[Difference]:
    """Store the runs of one notebook, setting -> folder, as its reference; gives what moved.

    A number within its tolerance natively keeps its stored value, and its spread only grows; one that moved takes the
    native value and the spread of these runs, or, unless `moves`, stays as it is stored. Anchors stay. Raises Misuse
    where the runs have parameters of their own.
    """
    runs = [runfolder.read(folder) for folder in folders.values()]
    native = folders[settings.NATIVE]
    told, metrics, arrays = runfolder.read(native)
    name, mode = told["notebook"], told["mode"]
    if mode not in ("paper", "quick"):
        raise Misuse(f"{native} was run with other parameters; a reference is the paper's scale or the quick one.")
    path = reference.path_of(root, name, mode)
    known, samples = reference.load(root, name, mode) if path.is_file() else ({}, {})
    if any(map(reference.is_stored, known.values())):
        moved = _problems(root, native)
    else:
        moved = [Difference(k, None, m["value"], m["unit"], "new") for k, m in metrics.items()]
    changed = {d.key for d in moved} if moves else set()
    entries = {key: entry for key, entry in known.items() if key not in changed and reference.is_stored(entry)}
    kept = {key: samples[key] for key in entries if key in samples}
    for key in {*metrics, *arrays} - (set() if moves else {d.key for d in moved}):
        if key in metrics:
            entry = entries.get(key) or {"value": metrics[key]["value"], "unit": metrics[key]["unit"]}
            seen = [entry["value"], *(run[1][key]["value"] for run in runs if key in run[1])]
        else:
            array, unit = arrays[key], told["arrays"][key]["unit"]
            stride = max(1, math.ceil(array.size / _SAMPLES))
            entry = entries.get(key) or {"shape": list(array.shape), "stride": stride, "unit": unit}
            kept.setdefault(key, array.ravel()[::stride])
            alike = (run[2][key] for run in runs if key in run[2] and list(run[2][key].shape) == entry["shape"])
            seen = [kept[key], *(a.ravel()[:: entry["stride"]] for a in alike)]
        entries[key] = entry | spread(seen, entry)
    for key, entry in known.items():
        if anchors := entry.get("anchors"):
            rest = {k: v for k, v in entries.get(key, {}).items() if k != "anchors"}
            entries[key] = rest | {"anchors": anchors}
    _write(path, entries, kept if moved and moves else None)
    return moved


def _write(path: Path, entries: Mapping[str, Any], samples: Mapping[str, np.ndarray] | None) -> None:
    """Write the stored entries, where they changed, and the samples, where there are new ones."""
    if samples is not None:
        buffer = io.BytesIO()
        np.savez_compressed(buffer, **samples)
        with atomic.open_whole(path.with_suffix(".npz")) as stream:
            stream.write(buffer.getvalue())
    lines = [f" {json.dumps(k)}: {json.dumps(v, ensure_ascii=False)}" for k, v in sorted(entries.items())]
    text = "{\n" + ",\n".join(lines) + "\n}\n"  # one key a line: differences read well
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        atomic.write_text(path, text)


def spread(seen: Sequence[Any], known: Mapping[str, Any]) -> dict[str, float]:
    """Give the spread of the values or samples seen, and the largest where they are rounding."""
    values = np.array(seen, dtype=float).reshape(len(seen), -1)
    values = values[:, np.isfinite(values).all(axis=0)]
    widest = max(float(np.ptp(values, axis=0).max(initial=0.0)), known.get("spread", 0.0))
    largest = max(float(np.abs(values).max(initial=0.0)), known.get("largest", 0.0))
    rounding = tolerance.is_rounding(float(np.abs(values[0]).max(initial=0.0)), widest)
    return {"spread": widest} | ({"largest": largest} if rounding else {})


def note_reason(root: Path, reason: str, moved: int) -> None:
    """Add the reason to the section `## Unreleased` of CHANGELOG.md, made where it is missing."""
    path = root / "CHANGELOG.md"
    text = path.read_text(encoding="utf-8") if path.is_file() else "# Changelog\n"
    line = f"- References renewed ({moved} {'number' if moved == 1 else 'numbers'} moved or new): {reason}\n"
    heading = re.search(r"^## \[?Unreleased\]?.*\n+", text, re.M | re.I)
    first = re.search(r"^## ", text, re.M)
    place = heading.end() if heading else first.start() if first else len(text)
    added = line if heading else f"\n## Unreleased\n\n{line}\n"
    atomic.write_text(path, text[:place] + added + text[place:])
