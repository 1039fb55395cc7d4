"""What a running notebook shows: cell k of n and the seconds on a terminal, a line now and then elsewhere."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

from geokalman.reproduce.execute import Progress


class Display:
    """Progress of notebooks on standard error; a context manager, safe to call from several threads."""

    def __init__(self, every: float = 30.0) -> None:
        """every: seconds between two lines on one notebook where there is no terminal."""
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

        cells = TextColumn("cell {task.completed} of {task.total}")
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
        task = self._bars.add_task(name, total=None)
        outcome, done = "failed after", threading.Event()
        at = [0, 0]  # cell that runs now, number of cells

        def progress(cell: int, cells: int) -> None:
            at[:] = cell, cells
            self._bars.update(task, completed=cell, total=cells)

        def tell() -> None:
            while not done.wait(self._every):
                self.say(f"... {name}: cell {at[0]} of {at[1]}, {time.perf_counter() - start:.0f} s")

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
