"""Writing whole or not at all: files and folders appear under their name only when complete."""

from __future__ import annotations

import errno
import json
import os
import re
import shutil
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

from geokalman.reproduce.children import busy
from geokalman.reproduce.errors import Fault

_PARTIAL = ".partial-"
_OLD = ".old-"
_LEFT = re.compile(r"\.(?P<name>.+)\.(?P<kind>partial|old)-[^.]+")


@contextmanager
def explained(path: Path) -> Iterator[None]:
    """Turn an operating-system error while writing to `path` into one sentence (Fault); what stood there stays."""
    try:
        yield
    except OSError as error:
        if error.errno == errno.ENOSPC:
            why = "the disk is full; free some space"
        elif error.errno == errno.EDQUOT:
            why = "the disk quota is used up; free some space"
        elif error.errno in (errno.EACCES, errno.EPERM):
            why = "permission denied; choose a folder that you may write to"
        elif error.errno == errno.EROFS:
            why = "the file system is read-only; choose another folder"
        elif error.errno in (errno.ENOTDIR, errno.EEXIST):
            why = "a file stands where a folder is needed; choose another name"
        else:
            why = f"{error.strerror or error}; choose another folder"
        raise Fault(f"Cannot write {path}: {why}; nothing there was changed.") from error


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


def sweep(folder: Path, name: str = "") -> None:
    """Clear what an interrupted process left directly in `folder` (of the entry `name` alone, where given).

    Complete old folders come back where nothing new stands; partial ones go.
    """
    if not folder.is_dir():
        return
    for path in sorted(folder.iterdir()):
        left = _LEFT.fullmatch(path.name)
        if not left or (name and left["name"] != name):
            continue
        target = path.with_name(left["name"])
        if f".{left['kind']}-" == _OLD and not target.exists():
            path.rename(target)
        elif path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)
