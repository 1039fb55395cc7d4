"""The vendored data, read only when their checksums hold."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

_CLONE = ("book/_config.yml", "data/registry.json")


class CorruptedData(OSError):
    """A vendored file is not the one that the registry describes."""


def _root() -> Path:
    """Find the clone with the data: upward from the working directory, else the one that holds this package."""
    here = Path.cwd()
    for folder in (here, *here.parents, Path(__file__).resolve().parents[2]):
        if all((folder / name).is_file() for name in _CLONE):
            return folder
    raise FileNotFoundError(
        f"No clone of geokalman was found upward from {here}, and the installed package carries the algorithms alone; "
        "call from inside a clone, which has the data."
    )


def sha256(path: Path) -> str:
    """Give the SHA-256 of a file, in hex."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def registry(root: Path | None = None) -> dict[str, dict]:
    """Read `data/registry.json`: relative path -> {sha256, bytes, source, licence, script, ...} of each file.

    Raises
    ------
    CorruptedData
        where it is no such register.
    """
    path = (root or _root()) / "data" / "registry.json"
    try:
        entries = json.loads(path.read_text(encoding="utf-8"))
        all(entry["sha256"] for entry in entries.values())
    except (ValueError, TypeError, KeyError, AttributeError):
        raise CorruptedData(
            f"{path} is damaged: it does not give the SHA-256 of each file; "
            "restore it with: git checkout -- data/registry.json."
        ) from None
    return entries


def data_path(name: str, root: Path | None = None) -> Path:
    """Give the path of the vendored file `data/<name>`, its checksum verified.

    Raises
    ------
    KeyError
        where the file is not registered.
    FileNotFoundError
        where it is missing.
    CorruptedData
        where its checksum differs.
    """
    root = root or _root()
    entries = registry(root)
    if name not in entries:
        raise KeyError(f"data/{name} is not in data/registry.json; registered are {', '.join(sorted(entries))}.")
    path = root / "data" / name
    if not path.is_file():
        raise FileNotFoundError(f"{path} is missing; restore it with: git checkout -- data/{name}.")
    found, wanted = sha256(path), entries[name]["sha256"]
    if found != wanted:
        raise CorruptedData(
            f"{path} has SHA-256 {found[:12]}..., data/registry.json says {wanted[:12]}...; "
            f"restore it with: git checkout -- data/{name} (it is made by {entries[name].get('script', 'no script')})."
        )
    return path


def verified(root: Path | None = None) -> dict[str, str]:
    """Give {name: SHA-256} of all vendored files; raises as `data_path` does for the first that is not sound."""
    root = root or _root()
    entries = registry(root)
    for name in entries:
        data_path(name, root)
    return {name: entry["sha256"] for name, entry in sorted(entries.items())}


def natural_earth_dir(root: Path | None = None) -> Path:
    """Give the folder of the vendored Natural Earth shapefiles, all checksums verified.

    For maps that need no network: ``cartopy.config["pre_existing_data_dir"] = natural_earth_dir()``. Raises as
    `data_path` does.
    """
    root = root or _root()
    for name in registry(root):
        if name.startswith("natural_earth/"):
            data_path(name, root)
    return root / "data" / "natural_earth"
