"""Where numbers come from: versions, commit, data and machine, without names of hosts or places."""

from __future__ import annotations

import importlib.metadata
import platform
import subprocess
from pathlib import Path
from typing import Any

from geokalman import files
from geokalman.reproduce import settings

_PACKAGES = ("geokalman", "numpy", "scipy", "numba", "matplotlib")


def describe(root: Path) -> dict[str, Any]:
    """Versions, git commit with a flag for uncommitted changes, SHA-256 of the vendored data, processor and what of it
    is used (BLAS kernel and threads, numba's target)."""
    versions = {"python": platform.python_version()}
    for package in _PACKAGES:
        try:
            versions[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            versions[package] = "unknown"
    return {
        "versions": versions,
        "commit": _git(root, "rev-parse", "HEAD"),
        "uncommitted_changes": bool(_git(root, "status", "--porcelain", "--untracked-files=no")),
        "data": {name: entry.get("sha256") for name, entry in sorted(files.registry(root).items())},
        "processor": processor(),
        "setting": settings.present(),
    }


def processor() -> str:
    """Model of the processor."""
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass  # not Linux
    return platform.processor() or platform.machine()


def _git(root: Path, *words: str) -> str | None:
    try:
        done = subprocess.run(["git", "-C", str(root), *words], capture_output=True, text=True, timeout=20, check=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip() or None
