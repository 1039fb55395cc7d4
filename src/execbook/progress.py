"""How far a running notebook is: what its kernel reports, and the command displays."""

from __future__ import annotations

import contextlib
import json
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

VARIABLE = "EXECBOOK_REPORT"
"""Environment variable: path of the file of reports; without it nothing is reported."""
Progress = Callable[[int, int, Path], None]
"""Called with (cell that runs, number of code cells, file of reports)."""
_OFTEN, _STEP = 0.5, 0.01  # s between two reports, or the share between them: whichever comes first


class Reporter:
    """The kernel's end: called with what a loop does and the share of it that is done."""

    def __init__(self) -> None:
        told = os.environ.get(VARIABLE)
        self._path = Path(told) if told else None
        self._report: dict[str, Any] = {}
        self._begun = self._written = -_OFTEN
        self._told = -1.0

    def expect(self, text: str) -> None:
        """Report beforehand what the notebook may take."""
        self._report["expected"] = text
        self._write()

    def __call__(self, what: str, share: float) -> None:
        """Report the share done of a loop; the time left follows from the time that it took."""
        now = time.monotonic()
        if what != self._report.get("what") or share < self._report["share"]:
            self._begun, self._told = now, -1.0
        left = (now - self._begun) * (1.0 / share - 1.0) if share else None
        self._report |= {"what": what, "share": share, "left": left}
        if now - self._written >= _OFTEN or share - self._told >= _STEP or share >= 1.0:
            self._write()
            self._written, self._told = now, share

    def _write(self) -> None:
        if self._path is not None:
            partial = self._path.with_name(f"{self._path.name}.new")
            with contextlib.suppress(OSError):  # a display is not worth an error
                partial.write_text(json.dumps(self._report), encoding="utf-8")
                os.replace(partial, self._path)


def read(path: Path | None) -> dict[str, Any]:
    """Read the last report, if any: some of `expected`, `what`, `share` and `left` (in s)."""
    try:
        return json.loads(path.read_text(encoding="utf-8")) if path else {}
    except (OSError, ValueError):
        return {}


def duration(seconds: float) -> str:
    """Give a rough time in words, such as `about 7 min`."""
    for size, unit in ((86400.0, "days"), (3600.0, "h"), (60.0, "min")):
        if seconds >= 1.5 * size:
            return f"about {seconds / size:.0f} {unit}"
    return f"about {max(1.0, seconds):.0f} s"


class Display:
    """Progress of notebooks on standard error: bars on a terminal, else a line now and then."""

    def __init__(self, every: float = 30.0) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

        console = Console(stderr=True, highlight=False)
        columns = TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[at]}"), TimeElapsedColumn()
        self._bars = Progress(*columns, console=console, transient=True, disable=not console.is_terminal)
        self._every = every

    def __enter__(self) -> Display:
        self._bars.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bars.stop()

    @contextlib.contextmanager
    def notebook(self, name: str) -> Iterator[Progress]:
        """Show one notebook while it runs; yields the function that its execution calls."""
        start = time.perf_counter()
        task = self._bars.add_task(name, total=None, at="")
        outcome, done = "failed after", threading.Event()
        now: list[Any] = [0, 0, None]

        def progress(cell: int, cells: int, report: Path) -> None:
            now[:] = cell, cells, report

        def tell() -> None:
            expected, due = "", self._every
            while not done.wait(min(1.0, self._every)):
                cell, cells, path = now
                report, seconds = read(path), time.perf_counter() - start
                if report.get("expected", expected) != expected:
                    expected = report["expected"]
                    self.say(f"{name}: {expected}")
                at = f"cell {cell} of {cells}{_loop(report)}"
                self._bars.update(task, completed=cell, total=cells, at=at)
                if self._bars.disable and seconds >= due:
                    due += self._every
                    self.say(f"... {name}: {at}, {seconds:.0f} s")

        if self._bars.disable:
            self.say(f"{name} starts")
        teller = threading.Thread(target=tell, daemon=True)
        teller.start()
        try:
            yield progress
            outcome = "took"
        finally:
            done.set()
            teller.join()  # it updates the bar that goes
            self._bars.remove_task(task)
            self.say(f"{name} {outcome} {time.perf_counter() - start:.1f} s")

    def say(self, line: str) -> None:
        """Write a line that stays."""
        if self._bars.disable:
            sys.stderr.write(f"{line}\n")
            sys.stderr.flush()
        else:
            self._bars.console.print(line, markup=False)


def _loop(report: dict[str, Any]) -> str:
    """Give words on the loop that runs, if one does: `, orbits 42 %, about 4 min to go`."""
    if not report.get("what") or report["share"] >= 1.0:
        return ""
    left = f", {duration(report['left'])} to go" if report["left"] is not None else ""
    return f", {report['what']} {100 * report['share']:.0f} %{left}"
