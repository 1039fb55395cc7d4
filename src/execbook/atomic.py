"""Files and folders that appear under their name only when they are complete."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import re
import shutil
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

from filelock import FileLock, Timeout

from execbook.children import busy
from execbook.errors import Fault

_LEFT = re.compile(r"\.(?P<name>.+)\.(?P<kind>partial|old)-(?P<mark>[^.]+)")
_PROCESS = re.compile(r"[1-9]\d{0,6}")  # shorter than the random marks
_WHY = {
    errno.ENOSPC: "the disk is full; free some space",
    errno.EDQUOT: "the disk quota is used up; free some space",
    errno.EACCES: "permission denied; choose a folder that you may write to",
    errno.EPERM: "permission denied; choose a folder that you may write to",
    errno.EROFS: "the file system is read-only; choose another folder",
    errno.ENOTDIR: "a file stands where a folder is needed; choose another name",
    errno.EEXIST: "a file stands where a folder is needed; choose another name",
}


@contextmanager
def explained(path: Path, remedy: str = "") -> Iterator[None]:
    """Turn an error of the system while `path` is written into a Fault, with a `remedy`."""
    try:
        yield
    except OSError as error:
        why, _, helps = _WHY.get(error.errno, f"{error.strerror or error}; choose another folder").partition("; ")
        helps = remedy if remedy and "free" not in helps else helps
        raise Fault(f"Cannot write {path}: {why}; {helps}; nothing there was changed.") from error


@contextmanager
def locked(path: Path, waiting: Callable[[], None] | None = None) -> Iterator[None]:
    """Hold the lock file `path`; where another process holds it, call `waiting` and wait."""
    lock = FileLock(path)
    with explained(path, f"{path.parent} must be a folder that you may write to"):
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            lock.acquire(timeout=0)
        except Timeout:
            if waiting is not None:
                waiting()
            lock.acquire()
    try:
        yield
    finally:
        lock.release()


def sha256(path: Path) -> str:
    """Give the SHA-256 of a file, in hex."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def digests(folder: Path, record: str) -> dict[str, str]:
    """Give the SHA-256 of every file of `folder` but `record`, by name."""
    found = sorted(p for p in folder.rglob("*") if p.is_file() and p.name != record)
    return {p.relative_to(folder).as_posix(): sha256(p) for p in found}


def intact(folder: Path, record: str, key: str) -> bool:
    """Tell whether `folder` is whole, undamaged and made from the inputs with this key.

    The JSON file `record` in it has the `key`, and in `files` the SHA-256 of every other file.
    """
    try:
        told = json.loads((folder / record).read_text(encoding="utf-8"))
        return told["key"] == key and all(sha256(folder / name) == digest for name, digest in told["files"].items())
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return False


def partial_path(path: Path) -> Path:
    """Give a new hidden name beside `path`, for what is not complete yet."""
    return path.with_name(f".{path.name}.partial-{uuid.uuid4().hex[:8]}")


@contextmanager
def open_whole(path: Path) -> Iterator[BinaryIO]:
    """Open a stream of bytes that appear as `path` when the block ends without an error."""
    partial = partial_path(path)
    with explained(path), busy():
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            with partial.open("wb") as stream:
                yield stream
                stream.flush()
                os.fsync(stream.fileno())  # a power failure must not leave an empty file under the name
            os.replace(partial, path)
        except BaseException:
            partial.unlink(missing_ok=True)
            raise


def write_text(path: Path, text: str) -> None:
    """Write a text file (UTF-8) whole or not at all."""
    with open_whole(path) as stream:
        stream.write(text.encode())


def as_json(value: Any) -> str:
    """Give a value as the text of a JSON file; raises ValueError where a number is not finite."""
    return json.dumps(value, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def write_json(path: Path, value: Any) -> None:
    """Write a JSON file whole or not at all; raises ValueError where a number is not finite."""
    write_text(path, as_json(value))


def swap_folder(complete: Path, target: Path) -> None:
    """Put the folder `complete` in the place of `target`, which is removed only then."""
    old = target.with_name(f".{target.name}.old-{uuid.uuid4().hex[:8]}")
    with explained(target):
        target.parent.mkdir(parents=True, exist_ok=True)
        if target.exists():
            os.rename(target, old)
        try:
            os.rename(complete, target)
        except BaseException:
            if old.exists():
                os.rename(old, target)
            raise
    shutil.rmtree(old, ignore_errors=True)


def unfinished(folder: Path) -> set[str]:
    """Give the names of the entries of which something unfinished stands directly in `folder`."""
    return {left["name"] for path in folder.glob(".*") if (left := _LEFT.fullmatch(path.name))}


def sweep(folder: Path, name: str = "") -> None:
    """Clear what an interrupted process left in `folder`, or of its entry `name` alone.

    A complete old folder comes back where nothing new stands; what a living process writes stays.
    """
    for path in sorted(folder.glob(".*")):
        left = _LEFT.fullmatch(path.name)
        if not left or (name and left["name"] != name) or lives(left["mark"]):
            continue
        target = path.with_name(left["name"])
        if left["kind"] == "old" and not target.exists():
            path.rename(target)
        elif path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)


def lives(mark: str) -> bool:
    """Tell whether a text is the number of a process that runs."""
    if not _PROCESS.fullmatch(mark):
        return False
    try:
        os.kill(int(mark), 0)
    except OSError as error:  # permission is denied to another user's process, which lives
        return not isinstance(error, ProcessLookupError)
    return True
