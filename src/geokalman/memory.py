"""How much memory there is, asked before much of it is taken. Standard library only."""

from __future__ import annotations

import math
import os
import resource
from pathlib import Path

_CGROUPS = Path("/sys/fs/cgroup")
_FILES = {"": ("memory.max", "memory.current"), "memory": ("memory.limit_in_bytes", "memory.usage_in_bytes")}


class TooLarge(MemoryError):
    """A computation needs more memory than there is; the message says how much, and what to make smaller."""


def require(what: str, size: float, remedy: str) -> None:
    """Raise TooLarge, before anything is computed, where `what` needs more bytes than are available."""
    free = available()
    if size > free:
        raise TooLarge(f"{what} needs {text(size)} of memory, and {text(free)} are available; {remedy}.")


def available() -> float:
    """Bytes that this process can still take: those that the machine, its control groups and `ulimit -v` leave."""
    return max(0.0, min(_machine(), _groups(), _limit()))


def text(size: float) -> str:
    """Bytes for readers."""
    scale, unit = next((s, u) for s, u in ((1e12, "TB"), (1e9, "GB"), (1e6, "MB"), (0.0, "B")) if size >= s)
    return f"{size / (scale or 1.0):.3g} {unit}"


def _lines(path: Path) -> list[str]:
    try:
        return path.read_text(encoding="utf-8").splitlines()
    except OSError:  # macOS has none of these files
        return []


def _number(path: Path, name: str, missing: float) -> float:
    """The number in the line that begins with `name`, or `missing`: some say `max`."""
    values = (line.removeprefix(name).split() for line in _lines(path) if line.startswith(name))
    return next((float(words[0]) for words in values if words and words[0].isdigit()), missing)


def _machine() -> float:
    built_in = float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    return 1024.0 * _number(Path("/proc/meminfo"), "MemAvailable:", built_in / 1024.0)


def _groups() -> float:
    """The least that a control group of this process or one above it leaves, as in a container; version 2 or 1."""
    least = math.inf
    for line in _lines(Path("/proc/self/cgroup")):
        _, controller, inside = line.split(":", 2)
        if controller in _FILES:
            most, used = _FILES[controller]
            top = _CGROUPS / controller
            folder = top / inside.lstrip("/")
            for place in (p for p in (folder, *folder.parents) if p.is_relative_to(top)):
                taken = _number(place / used, "", 0.0) - _number(place / "memory.stat", "inactive_file ", 0.0)
                least = min(least, _number(place / most, "", math.inf) - taken)
    return least


def _limit() -> float:
    most, _ = resource.getrlimit(resource.RLIMIT_AS)
    used = _number(Path("/proc/self/statm"), "", 0.0) * os.sysconf("SC_PAGE_SIZE")
    return math.inf if most == resource.RLIM_INFINITY else most - used
