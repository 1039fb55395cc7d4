"""numba's compilation cache, its files checked: machine code that a fault damaged is compiled anew and never run.

numba reads what stands in its cache as it is: a truncated file ends in an error of pickle, a flipped bit in a wrong
number. Here every file ends in the SHA-256 of what precedes it (pickle, and so numba alone, does not look behind its
end). A file without it counts as absent, and so does one that may not be read; where one cannot be written, the code is
compiled in each process. Standard library only: numba is guarded when somebody else imports it.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib.util
import sys
from collections.abc import Iterator
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any, BinaryIO

_CACHING = "numba.core.caching"
_DIGEST = 32


class Hashing:
    """Binary stream that digests (SHA-256) what passes to the one below."""

    def __init__(self, stream: BinaryIO) -> None:
        self.stream = stream
        self.digest = hashlib.sha256()

    def write(self, data: Any) -> int:
        """Write the bytes and take them into the digest."""
        self.digest.update(data)
        return self.stream.write(data)


def _sound(path: str) -> bool:
    """Does the file end in the digest of what precedes it?"""
    with open(path, "rb") as stream:
        data = memoryview(stream.read())
    return len(data) > _DIGEST and hashlib.sha256(data[:-_DIGEST]).digest() == data[-_DIGEST:]


def guard(caching: ModuleType) -> None:
    """Let the module `numba.core.caching` check what it reads and close what it writes with a digest."""

    class Checked(caching.IndexDataCacheFile):
        """Index and data files of one function."""

        def _load_index(self) -> dict:
            with contextlib.suppress(Exception):  # whatever it is that cannot be read, it is compiled anew
                if _sound(self._index_path):
                    return super()._load_index()
            return {}

        def _load_data(self, name: str) -> Any:
            with contextlib.suppress(Exception):
                if _sound(self._data_path(name)):
                    return super()._load_data(name)
            return None

        @contextlib.contextmanager
        def _open_for_write(self, path) -> Iterator[Hashing]:
            with super()._open_for_write(path) as stream:
                hashing = Hashing(stream)
                yield hashing
                stream.write(hashing.digest.digest())

    caching.IndexDataCacheFile = Checked
    # around all that numba reads and writes: on a full or read-only disk, what is compiled serves this process alone
    caching.Cache._guard_against_spurious_io_errors = lambda self: contextlib.suppress(OSError)


class _Watch(MetaPathFinder):
    """Finder that guards numba's cache as numba is imported; not before, for most commands do without numba."""

    def find_spec(self, name: str, path=None, target=None) -> ModuleSpec | None:
        if name != _CACHING:
            return None
        sys.meta_path.remove(self)
        spec = importlib.util.find_spec(name)
        execute = spec.loader.exec_module

        def exec_module(module: ModuleType) -> None:
            execute(module)
            guard(module)

        spec.loader.exec_module = exec_module
        return spec


def watch() -> None:
    """Guard numba's cache in this process: now where numba is imported, else when it is."""
    if _CACHING in sys.modules:
        guard(sys.modules[_CACHING])
    elif not any(isinstance(finder, _Watch) for finder in sys.meta_path):
        sys.meta_path.insert(0, _Watch())
