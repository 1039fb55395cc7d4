"""How the benchmarks measure and tell: the smallest of several runs, beside the limit that the project set itself."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable

from execbook.project import root as project_root


def smallest(work: Callable[[], object], runs: int = 7) -> float:
    """Smallest wall time of `runs` calls after one that is not counted (compilation, tables) [s]."""
    work()
    times = []
    for _ in range(runs):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def told(label: str, value: float, unit: str, limit: float | None = None, note: str = "") -> None:
    """Print a line: what was measured, a note, and the limit with what came of it."""
    verdict = "" if limit is None else f"   at most {limit:g}: {'met' if value <= limit else 'NOT MET'}"
    print(f"{label:56s}{value:10.3f} {unit}{f'   {note}' if note else ''}{verdict}")


def told_machine() -> None:
    """Print what the times depend on."""
    threads = os.environ.get("OPENBLAS_NUM_THREADS", "all")
    print(
        f"load {os.getloadavg()[0]:.2f} on {os.cpu_count()} cores, {threads} thread(s) of BLAS; smallest of several"
        " runs"
    )


def told_part(paper: str, minutes: float) -> None:
    """Print what the notebooks of a part took in the last build, which runs two at a time."""
    runs = (project_root() / "book" / "_build" / "runs" / paper).glob("*/provenance.json")
    seconds = [json.loads(path.read_text(encoding="utf-8"))["seconds"] for path in runs]
    if seconds:
        told(f"{len(seconds)} notebooks of the last build, halved", sum(seconds) / 2, "s", 60.0 * minutes)
