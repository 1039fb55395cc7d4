"""Heavy intermediate results kept on disk, keyed by arguments, computing setting and all the code that computes them.

Why not joblib.Memory, whose hash of arguments we keep: it keys a result on the source of the decorated function alone,
so an edited callee gives a stale result; it has no checksum, so a flipped bit in a stored array is returned as a
result; and two processes that ask at once both compute. Here the key adds `sources.code_hash` of the function's module
and the computing setting (another number of threads sums in another order), the entry carries a SHA-256 digest, and a
file lock makes the second one wait. Processor time measured for 200 MB: 0.6 s to store, 0.24 s to fetch, and 0.5 s to
hash where an argument is that large.

The entries are pickles, which run code when they are read: they have the trust of the sources. The digest guards
against damage, not against a stranger, who can compute it as well; never use a memo folder that is not your own.
"""

from __future__ import annotations

import functools
import hashlib
import os
import pickle
import time
import warnings
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, BinaryIO, TypeVar

import joblib
from filelock import FileLock

from geokalman import files, sources
from geokalman.compilation import Hashing
from geokalman.reproduce import atomic, settings
from geokalman.reproduce.errors import Fault

T = TypeVar("T")
LIMIT = 2 * 1024**3
"""Bytes that all entries together may take."""
_MAGIC = b"geokalman memo 1\n"
_DIGEST = 32
_LOCK_AGE = 7 * 86400.0  # s; a lock file not taken for this long is nobody's


class Memo:
    """A folder of results, at most `limit` bytes: the ones not used for longest go first.

    Where a result could not be read or kept, `note` is told in one sentence (default: a warning), and it is computed.
    """

    def __init__(self, folder: Path, limit: int = LIMIT, note: Callable[[str], None] = warnings.warn) -> None:
        self.folder = folder
        self.limit = limit
        self.note = note

    def __call__(self, function: Callable[..., T], ignore: Iterable[str] = ()) -> Callable[..., T]:
        """`function` with its results kept; keyword arguments named in `ignore` (an executor) do not enter the key.

        The function must be one of the package's modules and its result picklable. Raises Fault for another function.
        """
        module = getattr(function, "__module__", "")
        if sources.module_path(module) is None or module.split(".")[0] != sources.PACKAGE:
            name = getattr(function, "__name__", function)
            raise Fault(
                f"{name} stands in {module or 'no module'}; "
                f"only functions of {sources.PACKAGE} can be kept, whose code is known."
            )

        @functools.wraps(function)
        def kept(*args: Any, **kwargs: Any) -> T:
            if edited := sources.edited({module}):
                self.note(
                    f"{', '.join(sorted(edited))} changed since it was imported; nothing is kept until a restart."
                )
                return function(*args, **kwargs)
            named = {k: _stable(v) for k, v in sorted(kwargs.items()) if k not in set(ignore)}
            code = (module, function.__qualname__, sources.code_hash({module}), settings.present())
            return self._get(joblib.hash((*code, [_stable(a) for a in args], named)), lambda: function(*args, **kwargs))

        return kept

    def _get(self, key: str, compute: Callable[[], T]) -> T:
        entry = self.folder / f"{key}.pickle"
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            lock = FileLock(self.folder / f"{key}.lock")
            lock.acquire()
        except OSError as error:
            self.note(f"The memo cannot be used ({error.strerror or error}); computing anew.")
            return compute()
        try:
            if entry.exists():
                try:
                    result = _read(entry)
                    os.utime(entry)
                    return result
                except (OSError, ValueError) as error:
                    self.note(f"A kept result was damaged ({error}); computing it anew.")
            result = compute()
            try:
                with atomic.open_whole(entry, durable=False) as stream:  # a checksum guards it
                    _write(stream, result)
            except Fault as error:
                self.note(f"A result was not kept: {error}")
            else:
                self._prune(keep=entry)
            return result
        finally:
            lock.release()

    def _prune(self, keep: Path) -> None:
        """Remove the least recently used entries beyond the limit, and lock files that nobody takes any more."""
        entries = sorted(((s.st_mtime, s.st_size, p) for p, s in _stats(self.folder, "*.pickle")), reverse=True)
        total = 0
        for _, size, path in entries:
            total += size
            if total > self.limit and path != keep:
                path.unlink(missing_ok=True)
        for path, stat in _stats(self.folder, "*.lock"):
            if time.time() - stat.st_mtime > _LOCK_AGE:
                path.unlink(missing_ok=True)


def _stats(folder: Path, pattern: str) -> list[tuple[Path, os.stat_result]]:
    found = []
    for path in folder.glob(pattern):
        try:
            found.append((path, path.stat()))
        except FileNotFoundError:  # another process pruned it
            continue
    return found


def _stable(value: Any) -> Any:
    """What stands for an argument in the key: a function of the package by name and code, a Path by its contents."""
    module = getattr(value, "__module__", None)
    name = getattr(value, "__qualname__", None)
    if callable(value) and name and isinstance(module, str) and module.split(".")[0] == sources.PACKAGE:
        return ("function", module, name, sources.code_hash({module}))
    if isinstance(value, Path):
        return ("file", files.sha256(value)) if value.is_file() else str(value)
    return value


def _write(stream: BinaryIO, result: Any) -> None:
    hashing = Hashing(stream)
    hashing.write(_MAGIC)
    pickle.dump(result, hashing, protocol=5)  # type: ignore[arg-type]
    stream.write(hashing.digest.digest())


def _read(path: Path) -> Any:
    """The result stored at `path`; raises ValueError where the bytes are not those that were written."""
    size = path.stat().st_size - _DIGEST
    with open(path, "rb") as stream:
        digest = hashlib.sha256()
        left = size
        while left > 0 and (block := stream.read(min(left, 1 << 20))):
            digest.update(block)
            left -= len(block)
        if size < len(_MAGIC) or stream.read() != digest.digest():
            raise ValueError("its checksum does not hold")
        stream.seek(len(_MAGIC))
        return pickle.load(stream)
