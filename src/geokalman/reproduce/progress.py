"""What a running notebook shows: the cell, the share of its loop, the seconds; on a terminal, or in a line now and
then."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from geokalman.reproduce import reports
from geokalman.reproduce.execute import Progress

_LOOK = 1.0  # s between two looks at what the notebook tells


class Display:
    """Progress of notebooks on standard error; a context manager, safe to call from several threads."""

    def __init__(self, every: float = 30.0) -> None:
        """every: seconds between two lines on one notebook where there is no terminal."""
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

        cells = TextColumn("cell {task.completed} of {task.total}{task.fields[loop]}")
        console = Console(stderr=True, highlight=False)
        self._bars = Progress(
            TextColumn("{task.description}"), BarColumn(), cells, TimeElapsedColumn(),
            console=console, transient=True, disable=not console.is_terminal,
        )  # fmt: skip
        self._lock = threading.Lock()
        self._every = every

    def __enter__(self) -> Display:
        self._bars.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bars.stop()

    @contextmanager
    def notebook(self, name: str) -> Iterator[Progress]:
        """Show one notebook while it runs; yields the function that its execution reports to."""
        start = time.perf_counter()
        task = self._bars.add_task(name, total=None, loop="")
        outcome, done = "failed after", threading.Event()
        at: list[Any] = [0, 0, None]  # cell that runs now, number of cells, path of the notebook's reports

        def progress(cell: int, cells: int, report: Path) -> None:
            at[:] = cell, cells, report
            self._bars.update(task, completed=cell, total=cells)

        def tell() -> None:
            expected, due = "", self._every
            while not done.wait(min(_LOOK, self._every)):
                cell, cells, path = at
                report = reports.read(path) if path else {}
                loop, seconds = _loop(report), time.perf_counter() - start
                if report.get("expected", expected) != expected:
                    expected = report["expected"]
                    self.say(f"{name}: {expected}")
                if not self._bars.disable:
                    self._bars.update(task, loop=loop)
                elif seconds >= due:
                    due += self._every
                    self.say(f"... {name}: cell {cell} of {cells}{loop}, {seconds:.0f} s")

        if self._bars.disable:
            self.say(f"{name} starts")
        threading.Thread(target=tell, daemon=True).start()
        try:
            yield progress
            outcome = "took"
        finally:
            done.set()
            self._bars.remove_task(task)
            self.say(f"{name} {outcome} {time.perf_counter() - start:.1f} s")

    def say(self, line: str) -> None:
        """Write a line that stays."""
        with self._lock:
            if self._bars.disable:
                sys.stderr.write(f"{line}\n")
                sys.stderr.flush()
            else:
                self._bars.console.print(line, markup=False)


def _loop(report: dict[str, Any]) -> str:
    """Words on the loop that runs: `, normal equations 42 %, about 4 min to go`; nothing where none does."""
    if not report.get("what") or report["share"] >= 1.0:
        return ""
    left = f", {reports.duration(report['left'])} to go" if report["left"] is not None else ""
    return f", {report['what']} {100 * report['share']:.0f} %{left}"
