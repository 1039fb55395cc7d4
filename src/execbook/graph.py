"""The build of the book: notebooks whose inputs changed are executed, then pages made.

What is done is known by the run folders alone: `provenance.json` holds a hash of everything the run came from and of
every file of it. A folder appears whole, so a build that was killed resumes; a damaged result is noticed
and computed again.
"""

from __future__ import annotations

import hashlib
import json
import platform
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from execbook import atomic, children, claims, execute, multiverse, notebooks, project, runfolder, sources, stage
from execbook import html as sphinx
from execbook.errors import Fault
from execbook.progress import Display
from execbook.runfolder import run_folder

WORKERS = 2


@dataclass
class Outcome:
    """What a build did: notebooks executed or up to date, messages of failures, the book."""

    executed: list[str] = field(default_factory=list)
    fresh: list[str] = field(default_factory=list)
    failed: list[str] = field(default_factory=list)
    book: Path | None = None


def build(root: Path, workers: int = WORKERS, html: bool = True) -> Outcome:
    """Bring all runs up to date and, where none failed, stage the book and make its HTML.

    A second build in the same clone waits for the first. A failing notebook leaves the others, its own last good run
    and the last good book; the outcome lists it.
    """
    with Display() as display:
        waiting = partial(display.say, "Another build runs in this clone; waiting for it.")
        with atomic.locked(root / ".cache" / "build.lock", waiting):
            return _build(root, workers, html, display)


def _build(root: Path, workers: int, html: bool, display: Display) -> Outcome:
    names = notebooks.names(root)
    if not names:
        raise Fault(f"{root / 'book'} has no notebooks; write MyST files book/<paper>/NN-title.md with a header.")
    shared = shared_inputs(root)
    _clear(root, names)
    keys = {name: key(root, name, shared) for name in names}
    outcome = Outcome(fresh=[name for name in names if is_fresh(run_folder(root, name), keys[name])])
    for name in outcome.fresh:
        _publish_metrics(root, name)
    failed: dict[str, str] = {}

    @contextmanager
    def apart(name: str) -> Iterator[None]:
        """Let what fails here leave the others."""
        try:
            yield
        except Fault as error:
            failed[name] = str(error)
        except Exception as error:  # a fault of the machinery must not pass for a good build
            failed[name] = f"FAILED {name}: {type(error).__name__}: {error}"

    def execute_one(name: str) -> None:
        out = run_folder(root, name)
        with apart(name):
            with display.notebook(name) as progress:
                execute.run(root, name, out=out, page=False, progress=progress, key=keys[name], replace=True)
                _publish_metrics(root, name)
            for note in runfolder.provenance(out)["notes"]:
                display.say(f"{name}: {note}")
            outcome.executed.append(name)

    stale = [name for name in names if name not in outcome.fresh]
    longest_first = sorted(stale, key=lambda name: -_seconds(root, name))  # so that two workers end together
    children.in_parallel(workers, execute_one, longest_first)
    if html and not failed:
        with apart("book"):
            stage.stage(root)
            outcome.book = sphinx.build(root)
    outcome.executed.sort()
    outcome.failed = [failed[name] for name in (*names, "book") if name in failed]
    return outcome


def key(root: Path, name: str, shared: str | None = None) -> str:
    """Give the SHA-256 (hex) over all that a run of the notebook comes from.

    The notebook's code with its tags (its prose is staged anew), the modules that it imports with all they import,
    the machinery that executes it, the claims it judges, the readings that it runs, the vendored data and the locked
    environment.
    """
    notebook = notebooks.read(root, name)
    code = notebooks.code(notebook)
    try:
        modules = sources.imported_modules(code, {project.read(root).package, "execbook"})
    except SyntaxError:  # it will say so itself when executed
        modules = set()
    paper = name.partition("/")[0]
    worlds = ".multiverse(" in code and paper in claims.papers(root)
    judges = re.search(r"\.(verdicts|claims|printed)\(", code)
    judged = claims.ledger(root, paper) if worlds else claims.decided_by(root, name) if judges else []
    readings = multiverse.choices(root, paper) if worlds else []
    parts = {
        "source": [(c.source, c.metadata.get("tags", [])) for c in notebook.cells if c.cell_type == "code"],
        "code": sources.code_hash(modules | {"execbook.execute"}),
        "claims": [c.model_dump(mode="json") for c in judged],
        "readings": [choice.model_dump(mode="json") for choice in readings],
        "shared": shared or shared_inputs(root),
    }
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


def shared_inputs(root: Path) -> str:
    """Hash what every notebook depends on: vendored data, locked environment, interpreter."""
    lock = root / "environment.txt"
    parts = [platform.python_version(), project.vendored(root), atomic.sha256(lock) if lock.is_file() else ""]
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()


def is_fresh(folder: Path, wanted: str) -> bool:
    """Tell whether `folder` holds a whole, undamaged run made from the inputs with this key."""
    return atomic.intact(folder, "provenance.json", wanted)


def _publish_metrics(root: Path, name: str) -> None:
    """Copy the numbers of a run to `book/_build/metrics`, where scripts look for them."""
    target = root / "book" / "_build" / "metrics" / f"{name}.json"
    text = (run_folder(root, name) / "metrics.json").read_text(encoding="utf-8")
    if not target.is_file() or target.read_text(encoding="utf-8") != text:
        atomic.write_text(target, text)


def _clear(root: Path, names: list[str]) -> None:
    """Remove what killed builds and runs left, and the products of notebooks that are no more."""
    execute.sweep_runs(root)
    wanted = {f"{name}{suffix}" for name in names for suffix in ("", ".json", ".failed.ipynb")}
    for paper in [p for kind in ("runs", "metrics") for p in (root / "book" / "_build" / kind).glob("*") if p.is_dir()]:
        atomic.sweep(paper)
        for path in sorted(paper.iterdir()):
            if f"{paper.name}/{path.name}" not in wanted:
                shutil.rmtree(path, ignore_errors=True) if path.is_dir() else path.unlink()
        if not any(paper.iterdir()):
            paper.rmdir()


def _seconds(root: Path, name: str) -> float:
    """Give how long a notebook took last time."""
    try:
        return float(runfolder.provenance(run_folder(root, name))["seconds"])
    except (OSError, ValueError, KeyError, TypeError):
        return 0.0
