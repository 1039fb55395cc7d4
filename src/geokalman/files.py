"""Where the project is, and the vendored data in it, read only when their checksums hold."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path

_MARK = ("book/_config.yml", "data/registry.json")  # what makes a folder a clone of the project


class ProjectNotFound(FileNotFoundError):
    """No clone of the project was found from here."""


class CorruptedData(OSError):
    """A vendored file is not the one that the registry describes."""


def project_root(start: Path | str | None = None) -> Path:
    """Folder of the clone: `$GEOKALMAN_ROOT`, else upward from `start` (default: where we are), else the editable
    install.

    Raises ProjectNotFound where none of the three is a clone: an installed wheel carries the code alone.
    """
    told = os.environ.get("GEOKALMAN_ROOT")
    if told:
        root = Path(told).resolve()
        if not _is_clone(root):
            raise ProjectNotFound(f"GEOKALMAN_ROOT={told} is no clone of geokalman: it lacks {' or '.join(_MARK)}.")
        return root
    here = Path(start or Path.cwd()).resolve()
    for folder in (here, *here.parents, Path(__file__).resolve().parents[2]):
        if _is_clone(folder):
            return folder
    raise ProjectNotFound(
        f"No clone of geokalman found upward from {here}: the installed package carries the algorithms alone; "
        "data and notebooks stand in the repository. Call from inside a clone, or give --root (or GEOKALMAN_ROOT)."
    )


def _is_clone(folder: Path) -> bool:
    return all((folder / name).is_file() for name in _MARK)


def sha256(path: Path) -> str:
    """SHA-256 of a file, in hex."""
    digest = hashlib.sha256()
    with open(path, "rb") as stream:
        for block in iter(lambda: stream.read(1 << 20), b""):
            digest.update(block)
    return digest.hexdigest()


def registry(root: Path | None = None) -> dict[str, dict]:
    """`data/registry.json`: relative path -> {sha256, bytes, source, licence, script, ...} of every vendored file.

    Raises CorruptedData where it is no such register.
    """
    path = (root or project_root()) / "data" / "registry.json"
    try:
        entries = json.loads(path.read_text(encoding="utf-8"))
        all(entry["sha256"] for entry in entries.values())
    except (ValueError, TypeError, KeyError, AttributeError):
        raise CorruptedData(
            f"{path} is damaged: it does not give the SHA-256 of each file; "
            "restore it with: git checkout -- data/registry.json"
        ) from None
    return entries


def check_data(root: Path | None = None) -> None:
    """Raise as `data_path` does for the first vendored file that is missing or not as registered."""
    for name in registry(root):
        data_path(name, root)


def data_path(name: str, root: Path | None = None) -> Path:
    """Path of the vendored file `data/<name>`, its checksum verified.

    Raises KeyError (not registered), FileNotFoundError (missing) or CorruptedData (checksum differs).
    """
    root = root or project_root()
    entries = registry(root)
    if name not in entries:
        raise KeyError(f"data/{name} is not in data/registry.json; registered are {', '.join(sorted(entries))}.")
    path = root / "data" / name
    if not path.is_file():
        raise FileNotFoundError(f"{path} is missing; restore it with: git checkout -- data/{name}")
    found, wanted = sha256(path), entries[name]["sha256"]
    if found != wanted:
        raise CorruptedData(
            f"{path} has SHA-256 {found[:12]}..., data/registry.json says {wanted[:12]}...; "
            f"restore it with: git checkout -- data/{name} (it is made by {entries[name].get('script', 'no script')})."
        )
    return path


def natural_earth_dir(root: Path | None = None) -> Path:
    """Folder with the vendored Natural Earth shapefiles, all checksums verified.

    For maps that need no network: ``cartopy.config["pre_existing_data_dir"] = natural_earth_dir()``. Raises as
    `data_path` does.
    """
    root = root or project_root()
    for name in registry(root):
        if name.startswith("natural_earth/"):
            data_path(name, root)
    return root / "data" / "natural_earth"
