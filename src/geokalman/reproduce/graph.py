"""The build of the book: notebooks whose inputs changed are executed, two at a time, then the pages are made.

What is done is known by the run folders alone: `provenance.json` holds a hash of everything the run came from and of
every file of it. A folder appears whole, so a build that was killed resumes; a damaged result is noticed and made anew.
"""

from __future__ import annotations

import hashlib
import json
import platform
import re
import shutil
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from geokalman import files, sources
from geokalman.reproduce import atomic, children, claims, execute, notebooks
from geokalman.reproduce.errors import Fault
from geokalman.reproduce.progress import Display

WORKERS = 2
_MACHINERY = {"geokalman.reproduce.execute", "geokalman.reproduce.page"}


@dataclass
class Outcome:
    """What a build did: notebooks executed, already up to date, and the messages of what failed."""

    executed: list[str] = field(default_factory=list)
    fresh: list[str] = field(default_factory=list)
    failed: list[str] = field(default_factory=list)
    book: Path | None = None


def run_folder(root: Path, name: str) -> Path:
    """Run folder of a notebook in the book."""
    return root / "book" / "_build" / "runs" / name


def build(root: Path, workers: int = WORKERS, html: bool = True) -> Outcome:
    """Bring all runs up to date and, where none failed, stage the book and make its HTML.

    A second build in the same clone waits for the first. A failing notebook leaves the others, its own last good run
    and the last good book; the outcome lists it.
    """
    with Display() as display:

        def waiting() -> None:
            display.say("Another build runs in this clone; waiting for it.")

        with atomic.locked(root / ".cache" / "build.lock", waiting):
            return _build(root, workers, html, display)


def _build(root: Path, workers: int, html: bool, display: Display) -> Outcome:
    names = notebooks.names(root)
    if not names:
        raise Fault(
            f"{root / 'book'} has no notebooks; they are MyST files book/<paper>/NN-title.md with a jupytext header."
        )
    try:
        files.check_data(root)
    except OSError as error:
        raise Fault(str(error)) from None
    _clear(root, names)
    shared = shared_inputs(root)
    keys = {name: key(root, name, shared) for name in names}
    outcome = Outcome(fresh=[name for name in names if is_fresh(run_folder(root, name), keys[name])])
    for name in outcome.fresh:
        _publish_metrics(root, name)

    def one(name: str) -> None:
        with display.notebook(name) as progress:
            folder = execute.run(
                root, name, out=run_folder(root, name), page=False, progress=progress, key=keys[name],
                replace=True,
            )  # fmt: skip
            _publish_metrics(root, name)
        for note in execute.notes(folder):
            display.say(f"{name}: {note}")
        outcome.executed.append(name)

    def book(_: str) -> None:
        from geokalman.reproduce import html as pages
        from geokalman.reproduce import stage

        stage.stage(root)
        outcome.book = pages.build(root, strict=True)

    try:
        stale = [name for name in names if name not in outcome.fresh]
        failed = _run_all(_longest_first(root, stale), workers, one)
        if html and not failed:
            failed = _run_all(["book"], 1, book)
    finally:
        outcome.executed.sort()
    outcome.failed = [failed[name] for name in (*names, "book") if name in failed]
    return outcome


def key(root: Path, name: str, shared: str | None = None) -> str:
    """SHA-256 (hex) over all that a run of the notebook comes from.

    The notebook's source (its default parameters among it), the package modules it imports with all they import, the
    machinery that executes it, the claims it judges, the vendored data and the locked environment.
    """
    text = notebooks.source_path(root, name).read_text(encoding="utf-8")
    code = notebooks.code(notebooks.read(root, name))
    try:
        modules = sources.imported_modules(code)
    except SyntaxError:  # it will say so itself when executed
        modules = set()
    parts: dict[str, Any] = {
        "source": text,
        "code": sources.code_hash(modules | _MACHINERY),
        "claims": [c.model_dump(mode="json") for c in claims.decided_by(root, name)]
        if re.search(r"\.(verdicts|claims)\(", code)
        else [],
        "shared": shared or shared_inputs(root),
    }
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


def shared_inputs(root: Path) -> str:
    """Hash of what every notebook depends on: vendored data as they stand on disk, locked environment, interpreter."""
    digest = hashlib.sha256(platform.python_version().encode())
    data, lock = root / "data", root / "environment.txt"
    for name in sorted(files.registry(root)):
        digest.update(f"{name} {files.sha256(data / name) if (data / name).is_file() else 'missing'}\n".encode())
    digest.update((data / "registry.json").read_bytes())
    digest.update(lock.read_bytes() if lock.is_file() else b"")
    return digest.hexdigest()


def is_fresh(folder: Path, wanted: str) -> bool:
    """Does `folder` hold a whole, undamaged run made from the inputs with this key?"""
    return atomic.intact(folder, "provenance.json", wanted)


def _publish_metrics(root: Path, name: str) -> None:
    """Copy the numbers of a run to `book/_build/metrics`, where scripts look for them."""
    target = root / "book" / "_build" / "metrics" / f"{name}.json"
    text = (run_folder(root, name) / "metrics.json").read_text(encoding="utf-8")
    if not target.is_file() or target.read_text(encoding="utf-8") != text:
        atomic.write_text(target, text)


def _clear(root: Path, names: list[str]) -> None:
    """Remove what killed builds and runs left half done, and the products of notebooks that are no more."""
    execute.sweep_runs(root)
    made = root / "book" / "_build"
    wanted = {f"{name}{suffix}" for name in names for suffix in ("", ".json", ".failed.ipynb")}
    for kind in ("runs", "metrics"):
        for paper in sorted((made / kind).glob("*")):
            if not paper.is_dir():
                continue
            atomic.sweep(paper)
            for path in sorted(paper.iterdir()):
                if f"{paper.name}/{path.name}" not in wanted:
                    shutil.rmtree(path, ignore_errors=True) if path.is_dir() else path.unlink()
            if not any(paper.iterdir()):
                paper.rmdir()


def _longest_first(root: Path, names: list[str]) -> list[str]:
    """The notebooks that took longest last time come first, so that two workers end together."""

    def seconds(name: str) -> float:
        try:
            return float(
                json.loads((run_folder(root, name) / "provenance.json").read_text(encoding="utf-8"))["seconds"]
            )
        except (OSError, ValueError, KeyError, TypeError):
            return 0.0

    return sorted(names, key=seconds, reverse=True)


def _run_all(names: list[str], workers: int, action: Callable[[str], None]) -> dict[str, str]:
    """Call action(name) for all names, `workers` at a time; gives the messages of those that failed, by name."""
    failed: dict[str, str] = {}

    def guarded(name: str) -> None:
        try:
            action(name)
        except Fault as error:
            failed[name] = str(error)
        except Exception as error:  # a fault of ours must not pass for a good build
            failed[name] = f"FAILED {name}: {type(error).__name__}: {error}"

    pool = ThreadPoolExecutor(workers)
    try:
        for task in [pool.submit(guarded, name) for name in names]:
            task.result()
    except BaseException:  # Ctrl-C: no kernel outlives us
        pool.shutdown(wait=False, cancel_futures=True)
        children.stop()
        raise
    finally:
        pool.shutdown()
    return failed
