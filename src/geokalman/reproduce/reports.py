"""What a running notebook tells the process that started it: the time it may take, and how far its loop has come.

One small JSON file, replaced whole: the notebook's kernel writes it, the display reads it.
"""

from __future__ import annotations

import contextlib
import json
import os
import time
from pathlib import Path
from typing import Any

VARIABLE = "GEOKALMAN_REPORT"
"""Environment variable: path of the file; without it nothing is told."""
_OFTEN = 0.5  # s between two reports, at least


class Reporter:
    """The notebook's end; also a listener of `geokalman.progress`."""

    def __init__(self) -> None:
        told = os.environ.get(VARIABLE)
        self._path = Path(told) if told else None
        self._report: dict[str, Any] = {}
        self._begun = self._written = -_OFTEN

    def expect(self, text: str) -> None:
        """Say beforehand what the notebook may take."""
        self._report["expected"] = text
        self._write()

    def __call__(self, what: str, share: float) -> None:
        """Say the share done of the loop that runs now; the time left follows from the time that it took."""
        now = time.monotonic()
        if what != self._report.get("what") or share < self._report["share"]:
            self._begun, self._written = now, -_OFTEN
        self._report |= {"what": what, "share": share}
        self._report["left"] = (now - self._begun) * (1.0 / share - 1.0) if share else None
        if now - self._written >= _OFTEN or share >= 1.0:
            self._write()
            self._written = now

    def _write(self) -> None:
        if self._path is not None:
            partial = self._path.with_name(f"{self._path.name}.new")
            with contextlib.suppress(OSError):  # a display is not worth an error
                partial.write_text(json.dumps(self._report), encoding="utf-8")
                os.replace(partial, self._path)


def read(path: Path) -> dict[str, Any]:
    """The last report, with some of `expected`, `what`, `share` and `left` [s]; nothing where there is none."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}


def duration(seconds: float) -> str:
    """A rough time in words: `about 7 min`."""
    for size, unit in ((86400.0, "days"), (3600.0, "h"), (60.0, "min")):
        if seconds >= 1.5 * size:
            return f"about {seconds / size:.0f} {unit}"
    return f"about {max(1.0, seconds):.0f} s"
