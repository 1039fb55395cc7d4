"""Writing whole or not at all: files and folders appear under their name only when complete."""

from __future__ import annotations

import errno
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

from geokalman.files import sha256
from geokalman.reproduce.children import busy
from geokalman.reproduce.errors import Fault

_PARTIAL = ".partial-"
_OLD = ".old-"
_LEFT = re.compile(r"\.(?P<name>.+)\.(?P<kind>partial|old)-(?P<mark>[^.]+)")
_PROCESS = re.compile(r"[1-9]\d{0,6}")  # shorter than the random marks


@contextmanager
def explained(path: Path, remedy: str = "") -> Iterator[None]:
    """Turn an operating-system error while writing to `path` into one sentence (Fault); what stood there stays.

    remedy: what helps where `path` cannot be written; default is to choose another folder.
    """
    try:
        yield
    except OSError as error:
        if error.errno == errno.ENOSPC:
            why = "the disk is full; free some space"
        elif error.errno == errno.EDQUOT:
            why = "the disk quota is used up; free some space"
        elif error.errno in (errno.EACCES, errno.EPERM):
            why = f"permission denied; {remedy or 'choose a folder that you may write to'}"
        elif error.errno == errno.EROFS:
            why = f"the file system is read-only; {remedy or 'choose another folder'}"
        elif error.errno in (errno.ENOTDIR, errno.EEXIST):
            why = f"a file stands where a folder is needed; {remedy or 'choose another name'}"
        else:
            why = f"{error.strerror or error}; {remedy or 'choose another folder'}"
        raise Fault(f"Cannot write {path}: {why}; nothing there was changed.") from error


@contextmanager
def locked(path: Path, waiting: Callable[[], None] | None = None) -> Iterator[None]:
    """Hold the lock file `path`, which one process does at a time; that of a killed process is free.

    waiting: called where another process holds it, before we wait. Raises Fault where no lock can be made.
    """
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


def intact(folder: Path, record: str, key: str) -> bool:
    """Does `folder` hold a whole, undamaged product made from the inputs with this key?

    The JSON file `record` in it says so: `key`, and `files`, the SHA-256 of every other file by its name.
    """
    try:
        told = json.loads((folder / record).read_text(encoding="utf-8"))
        return told["key"] == key and all(sha256(folder / name) == digest for name, digest in told["files"].items())
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return False


def digests(folder: Path, record: str) -> dict[str, str]:
    """SHA-256 of every file of `folder` but `record`, by name, for `intact`."""
    found = sorted(p for p in folder.rglob("*") if p.is_file() and p.name != record)
    return {p.relative_to(folder).as_posix(): sha256(p) for p in found}


def partial_path(path: Path) -> Path:
    """A fresh hidden name beside `path`, for what is not complete yet."""
    return path.with_name(f".{path.name}{_PARTIAL}{uuid.uuid4().hex[:8]}")


@contextmanager
def open_whole(path: Path, durable: bool = True) -> Iterator[BinaryIO]:
    """Binary stream whose contents appear as `path` when the block ends without an error; raises Fault where it cannot.

    `durable` waits until the disk has them, so that a power failure cannot leave an empty file under the name.
    """
    partial = partial_path(path)
    with explained(path), busy():
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            with open(partial, "wb") as stream:
                yield stream
                if durable:
                    stream.flush()
                    os.fsync(stream.fileno())
            os.replace(partial, path)
        except BaseException:
            partial.unlink(missing_ok=True)
            raise


def write_text(path: Path, text: str) -> None:
    """Write a text file (UTF-8, as given) whole or not at all."""
    with open_whole(path) as stream:
        stream.write(text.encode())


def write_json(path: Path, value: Any) -> None:
    """Write a JSON file, indented, with a final newline, whole or not at all. Not-a-number is refused (ValueError)."""
    write_text(path, json.dumps(value, indent=1, ensure_ascii=False, allow_nan=False) + "\n")


def swap_folder(complete: Path, target: Path) -> None:
    """Put the folder `complete` in the place of `target`; the old one is removed only after the new one stands."""
    old = target.with_name(f".{target.name}{_OLD}{uuid.uuid4().hex[:8]}")
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
    """Names of the entries of which something unfinished stands directly in `folder`."""
    found = (_LEFT.fullmatch(path.name) for path in folder.glob(".*"))
    return {left["name"] for left in found if left}


def sweep(folder: Path, name: str = "") -> None:
    """Clear what an interrupted process left directly in `folder` (of the entry `name` alone, where given).

    Complete old folders come back where nothing new stands; partial ones go, but for those of a process that lives.
    """
    if not folder.is_dir():
        return
    for path in sorted(folder.iterdir()):
        left = _LEFT.fullmatch(path.name)
        if not left or (name and left["name"] != name) or lives(left["mark"]):
            continue
        target = path.with_name(left["name"])
        if f".{left['kind']}-" == _OLD and not target.exists():
            path.rename(target)
        elif path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)


def lives(mark: str) -> bool:
    """Is this the number of a process that runs? No other text is."""
    if not _PROCESS.fullmatch(mark):
        return False
    try:
        os.kill(int(mark), 0)
    except OSError as error:  # permission is denied to another user's process, which lives
        return not isinstance(error, ProcessLookupError)
    return True
