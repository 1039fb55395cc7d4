"""Heavy results kept on disk, keyed by arguments, computing setting and code.

`joblib.Memory` keys a result by the source of the one function, gives wrong numbers after a flipped bit, and lets two
processes that ask at once both compute. Its hash of arguments is used here, with a key, a digest and a lock of our own.
Entries are pickles, which run code when they are read; never use a memo folder from a stranger.
"""

from __future__ import annotations

import functools
import hashlib
import pickle
import warnings
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, TypeVar

import joblib
from filelock import FileLock

from execbook import atomic, settings, sources
from execbook.errors import Fault

T = TypeVar("T")
LIMIT = 2 * 1024**3
"""Bytes that all entries together may take."""
_DIGEST = 32


class Memo:
    """A folder of results of at most `limit` bytes; the ones not used for longest go first.

    `note` is called with a sentence where a result could not be read or kept; it is computed then.
    """

    def __init__(
        self, folder: Path, package: str, limit: int = LIMIT, note: Callable[[str], None] = warnings.warn
    ) -> None:
        self.folder, self.package, self.limit, self.note = folder, package, limit, note

    def __call__(self, function: Callable[..., T], ignore: Iterable[str] = ()) -> Callable[..., T]:
        """Give `function` with its results kept, by all arguments but the keywords in `ignore`.

        Raises Fault for a function that is not of the package, whose code is not known.
        """
        module = getattr(function, "__module__", "")
        if not self._is_known(module):
            name = getattr(function, "__name__", function)
            raise Fault(f"{name} belongs to {module or 'no module'}; only functions of {self.package} can be kept.")

        @functools.wraps(function)
        def kept(*args: Any, **kwargs: Any) -> T:
            if edited := sources.edited({module}):
                self.note(f"{', '.join(sorted(edited))} changed since the import; nothing is kept until a restart.")
                return function(*args, **kwargs)
            named = {k: self._stable(v) for k, v in sorted(kwargs.items()) if k not in set(ignore)}
            code = (module, function.__qualname__, sources.code_hash({module}), settings.present())
            key = joblib.hash((*code, [self._stable(a) for a in args], named))
            return self._get(key, lambda: function(*args, **kwargs))

        return kept

    def _is_known(self, module: str) -> bool:
        return module.partition(".")[0] == self.package and sources.module_path(module) is not None

    def _stable(self, value: Any) -> Any:
        """Give what stands for an argument in the key: a function's code, a file's bytes."""
        if callable(value) and self._is_known(getattr(value, "__module__", None) or ""):
            return ("function", value.__module__, value.__qualname__, sources.code_hash({value.__module__}))
        return ("file", atomic.sha256(value)) if isinstance(value, Path) and value.is_file() else value

    def _get(self, key: str, compute: Callable[[], T]) -> T:
        entry = self.folder / f"{key}.pickle"
        lock = FileLock(self.folder / f"{key}.lock")
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            lock.acquire()
        except OSError as error:
            self.note(f"The memo cannot be used ({error.strerror or error}); results are computed again.")
            return compute()
        try:
            try:
                return _read(entry)
            except FileNotFoundError:
                pass
            except (OSError, ValueError) as error:
                self.note(f"A kept result was damaged ({error}); it is computed again.")
            result = compute()
            data = pickle.dumps(result, protocol=5)
            try:
                with atomic.open_whole(entry) as stream:
                    stream.write(hashlib.sha256(data).digest())
                    stream.write(data)
            except Fault as error:
                self.note(f"A result was not kept: {error}")
            else:
                self._prune(keep=entry)
            return result
        finally:
            lock.release()

    def _prune(self, keep: Path) -> None:
        """Remove the entries beyond the limit, the least recently used first."""
        total = 0
        for path in sorted(self.folder.glob("*.pickle"), key=_used, reverse=True):
            total += path.stat().st_size if path.exists() else 0
            if total > self.limit and path != keep:
                path.unlink(missing_ok=True)
                path.with_suffix(".lock").unlink(missing_ok=True)


def _used(path: Path) -> float:
    return path.stat().st_mtime if path.exists() else 0.0  # another process may have removed it


def _read(path: Path) -> Any:
    """Read a result; raises ValueError where the bytes are not those that were written."""
    data = memoryview(path.read_bytes())
    if hashlib.sha256(data[_DIGEST:]).digest() != bytes(data[:_DIGEST]):
        raise ValueError("its checksum does not hold")
    path.touch()
    return pickle.loads(data[_DIGEST:])
