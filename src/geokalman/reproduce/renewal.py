"""Renewing the stored references and their spreads: every notebook at both scales, in every computing setting."""

from __future__ import annotations

import io
import json
import math
import re
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from geokalman.reproduce import (
    atomic,
    check,
    children,
    claims,
    execute,
    graph,
    notebooks,
    parameters,
    reference,
    settings,
    tolerance,
)
from geokalman.reproduce.errors import Misuse
from geokalman.reproduce.progress import Display

_SAMPLES = 400  # values of one array that are stored


def renew(root: Path, reason: str, names: Sequence[str] | None = None, quick: bool = True) -> int:
    """Renew the references of `names` (default: all notebooks), print what moved, note the reason; gives how many.

    Raises Misuse where the reason is empty, or a notebook's run in the book is not from the present sources.
    """
    if not reason.strip():
        raise Misuse(
            'references are renewed for a reason: --reason "why the numbers move" (it goes into CHANGELOG.md).'
        )
    moved = sum(len(found) for found in _settle(root, names, quick, moves=True))
    if moved:
        note_reason(root, reason.strip(), moved)
    if claims.papers(root) and (root / "README.md").is_file() and not claims.readme_agrees(root):
        sys.stdout.write("README.md shows other verdicts than the ledgers: geokalman claims --readme renews them.\n")
    return moved


def widen(root: Path, names: Sequence[str] | None = None, quick: bool = True) -> int:
    """Compute `names` in every setting and widen the stored spreads to what is seen; gives how many numbers no setting
    may move so far (they are printed). No stored value changes."""
    return sum(len(found) for found in _settle(root, names, quick, moves=False))


def _settle(
    root: Path, names: Sequence[str] | None, quick: bool, moves: bool
) -> Iterator[list[tuple[str, reference.Difference]]]:
    """Compute and store; gives, for each notebook and scale, what moved or is beyond its tolerance in which setting."""
    names = list(names or notebooks.names(root))
    for name in names:
        if not graph.is_fresh(graph.run_folder(root, name), graph.key(root, name)):
            raise Misuse(f"{name} has no run from the present sources; make book executes it, then renew.")
    scales = [(name, mode) for name in names for mode in ("paper", "quick")[: 1 + (quick and _has_quick(root, name))]]
    runs = _runs(root, scales)
    for name, mode in scales:
        folders = {setting: runs[name, mode, setting] for setting in settings.names()}
        found = [] if moves else _beyond(root, folders)
        stored = [(settings.NATIVE, d) for d in store(root, folders, moves)]
        for setting, difference in stored if moves else found:
            sys.stdout.write(f"{name} ({mode}, {setting}) {check.describe(difference)}\n")
        yield stored if moves else found


def _has_quick(root: Path, name: str) -> bool:
    specification = parameters.load(root, name)
    return specification.mode(specification.defaults | specification.quick) == "quick"


def _runs(root: Path, scales: Iterable[tuple[str, str]]) -> dict[tuple[str, str, str], Path]:
    """Run folders by notebook, scale and setting; what is missing or stale is executed, the book's own runs excepted."""
    runs = {
        (name, mode, setting): graph.run_folder(root, name)
        if (mode, setting) == ("paper", settings.NATIVE)
        else root / "book" / "_build" / "settings" / setting / mode / name
        for name, mode in scales
        for setting in settings.names()
    }

    def one(name: str, mode: str, setting: str, out: Path) -> None:
        if graph.is_fresh(out, key := graph.key(root, name)):
            return
        with display.notebook(f"{name} ({mode}, {setting})") as progress:
            execute.run(
                root, name, out=out, quick=mode == "quick", page=False, setting=setting, progress=progress, key=key
            )

    with Display() as display, ThreadPoolExecutor(graph.WORKERS) as pool:
        tasks = [pool.submit(one, *job, folder) for job, folder in runs.items()]
        try:
            for task in tasks:
                task.result()
        except BaseException:  # the first failure ends it; what is finished stays
            pool.shutdown(wait=False, cancel_futures=True)
            children.stop()
            raise
    return runs


def _beyond(root: Path, folders: Mapping[str, Path]) -> list[tuple[str, reference.Difference]]:
    """What a setting moves beyond the tolerance so far."""
    return [(s, d) for s, folder in folders.items() for d in reference.differences(root, folder) if d.problem]


def store(root: Path, folders: Mapping[str, Path], moves: bool = True) -> list[reference.Difference]:
    """Store the runs of one notebook, setting -> folder, as its reference; gives what moved (all keys of a first one).

    A number within its tolerance natively keeps its stored value, and its spread only grows; one that moved takes the
    native value and the spread of these runs, or, unless `moves`, stays as it is stored. Raises Misuse where the runs
    have parameters of their own.
    """
    runs = [reference.read_run(folder) for folder in folders.values()]
    told, metrics, arrays = reference.read_run(folders[settings.NATIVE])
    name, mode = told["notebook"], told["mode"]
    if mode not in ("paper", "quick"):
        raise Misuse(
            f"{folders[settings.NATIVE]} was run with parameters of its own; "
            "a reference is the paper's scale or the quick one."
        )
    path = reference.path_of(root, name, mode)
    known, samples = reference.load(root, name, mode) if path.is_file() else ({}, {})
    moved = [d for d in reference.differences(root, folders[settings.NATIVE]) if d.problem] if known else [
        reference.Difference(k, None, m["value"], m["unit"], "", "new") for k, m in metrics.items()
    ]  # fmt: skip
    changed = {d.key for d in moved}
    entries = {key: entry for key, entry in known.items() if key not in changed or not moves}
    kept = {key: samples[key] for key in entries if key in samples}
    for key in {*metrics, *arrays} - (set() if moves else changed):
        if key in metrics:
            entry = entries.get(key) or {"value": metrics[key]["value"], "unit": metrics[key]["unit"]}
            seen = [entry["value"], *(run[1][key]["value"] for run in runs if key in run[1])]
        else:
            array = arrays[key]
            stride = max(1, math.ceil(array.size / _SAMPLES))
            entry = entries.get(key) or {
                "shape": list(array.shape), "stride": stride, "unit": told["arrays"][key]["unit"]
            }  # fmt: skip
            kept.setdefault(key, array.ravel()[::stride])
            alike = (run[2][key] for run in runs if key in run[2] and list(run[2][key].shape) == entry["shape"])
            seen = [kept[key], *(a.ravel()[:: entry["stride"]] for a in alike)]
        entry = {k: v for k, v in entry.items() if k not in reference.Tolerance.model_fields}  # an earlier one
        entries[key] = entry | spread(seen, entry)
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **kept)
    lines = [f" {json.dumps(k)}: {json.dumps(v, ensure_ascii=False)}" for k, v in sorted(entries.items())]
    text = "{\n" + ",\n".join(lines) + "\n}\n"  # one key a line: differences read well
    if moved and moves:
        with atomic.open_whole(path.with_suffix(".npz")) as stream:
            stream.write(buffer.getvalue())
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        atomic.write_text(path, text)
    return moved


def spread(seen: Sequence[Any], known: Mapping[str, Any]) -> dict[str, float]:
    """Spread of the values (or samples of an array) seen, and the largest magnitude where they are rounding; never
    below what is known."""
    values = np.array(seen, dtype=float).reshape(len(seen), -1)
    values = values[:, np.isfinite(values).all(axis=0)]
    widest = max(float(np.ptp(values, axis=0).max(initial=0.0)), known.get("spread", 0.0))
    largest = max(float(np.abs(values).max(initial=0.0)), known.get("largest", 0.0))
    rounding = tolerance.is_rounding(float(np.abs(values[0]).max(initial=0.0)), widest)
    return {"spread": widest} | ({"largest": largest} if rounding else {})


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
