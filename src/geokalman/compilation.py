"""Numba's on-disk cache for the compiled functions of this package, and of no other.

A cached function is valid for the sources of its module and of all modules of the package that this imports, so an
edited callee never meets the machine code of an older caller. Each file of the cache ends in the SHA-256 of what
precedes it: a damaged file counts as absent, and the function is compiled anew. Importing this module registers a
locator with numba; every subpackage with compiled functions imports it first.
"""

from __future__ import annotations

import ast
import atexit
import contextlib
import functools
import hashlib
import os
import shutil
import stat
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

from numba.core import caching, config

PACKAGE = Path(__file__).resolve().parent
_DIGEST = 32
_KEPT = 3  # folders for earlier sources of a module


def _statements(node: ast.AST) -> Iterator[ast.AST]:
    """Give all statements below a node; expressions, which are most of a tree, hold no import."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.stmt | ast.excepthandler | ast.match_case):
            yield child
            yield from _statements(child)


@functools.cache
def _imports(path: Path) -> tuple[bytes, frozenset[Path]]:
    """Read a module of the package; gives its source and the files of the package that it imports."""
    source = path.read_bytes()
    names: set[str] = set()
    for node in _statements(ast.parse(source)):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = path.relative_to(PACKAGE.parent).parts[: -node.level] if node.level else ()
            base = ".".join([*above, *filter(None, [node.module])])
            names.update([base, *(f"{base}.{alias.name}" for alias in node.names)])
    stems = [PACKAGE.parent.joinpath(*n.split(".")) for n in names if n.partition(".")[0] == PACKAGE.name]
    files = [file for stem in stems for file in (stem / "__init__.py", stem.with_suffix(".py"))]
    return source, frozenset(file for file in files if file.is_file())


@functools.cache
def stamp(path: Path) -> str:
    """Give the SHA-256 (hex) over the source of a module and of all modules of the package that it imports."""
    seen: set[Path] = set()
    todo = {path}
    while todo:
        file = todo.pop()
        seen.add(file)
        todo |= _imports(file)[1] - seen
    digest = hashlib.sha256()
    for file in sorted(seen):
        digest.update(str(file.relative_to(PACKAGE)).encode() + b"\0" + _imports(file)[0] + b"\0")
    return digest.hexdigest()


@functools.cache
def folder() -> Path:
    """Give the folder of the cache; where it cannot be written, a private one among the temporary files."""
    clone = PACKAGE.parent.parent
    if config.CACHE_DIR:
        home = Path(config.CACHE_DIR) / PACKAGE.name
    elif (clone / "pyproject.toml").is_file():
        home = clone / ".cache" / "numba"
    else:
        home = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / PACKAGE.name
    try:
        home.mkdir(parents=True, exist_ok=True)
        if os.access(home, os.W_OK):
            return home
    except OSError:
        pass
    return _temporary()


def _temporary() -> Path:
    """Give a folder that no other user can have put machine code into: ours of an earlier process, else a new one."""
    home = Path(tempfile.gettempdir()) / f"{PACKAGE.name}-{os.getuid()}"
    try:
        home.mkdir(mode=0o700, exist_ok=True)
        found = home.lstat()  # of a link itself, which may lead anywhere
        if stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid() and found.st_mode & 0o777 == 0o700:
            return home
    except OSError:  # a file, or a link to nowhere
        pass
    fresh = tempfile.mkdtemp(prefix=f"{PACKAGE.name}-")
    atexit.register(shutil.rmtree, fresh, ignore_errors=True)
    return Path(fresh)


class Locator(caching._CacheLocator):
    """Place and validity of the cached functions of one module of the package."""

    def __init__(self, py_func: Any, py_file: str) -> None:
        self._file = Path(py_file).resolve()
        self._line = py_func.__code__.co_firstlineno

    def get_cache_path(self) -> str:
        """Give the folder for the module and its present sources."""
        return str(folder() / self._file.relative_to(PACKAGE).with_suffix("") / stamp(self._file)[:16])

    def ensure_cache_path(self) -> None:
        """Make the folder; of the folders for earlier sources the latest stay, for a process may still use them."""
        place = Path(self.get_cache_path())
        with contextlib.suppress(OSError):  # a full or read-only disk: what is compiled serves this process alone
            if not place.is_dir():
                place.mkdir(parents=True)
                earlier = sorted(place.parent.glob("?" * len(place.name)), key=lambda path: path.stat().st_mtime)
                for old in earlier[: -_KEPT - 1]:
                    shutil.rmtree(old, ignore_errors=True)

    def get_source_stamp(self) -> str:
        """Give the hash of the sources that the module stands on."""
        return stamp(self._file)

    def get_disambiguator(self) -> str:
        """Tell functions of the same name apart."""
        return str(self._line)

    @classmethod
    def from_function(cls, py_func: Any, py_file: str) -> Locator | None:
        """Give a locator for a function of this package, None for any other."""
        return cls(py_func, py_file) if Path(py_file).resolve().is_relative_to(PACKAGE) else None


class _Hashing:
    """A stream that digests what passes to the one below."""

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self.digest = hashlib.sha256()

    def write(self, data: Any) -> int:
        self.digest.update(data)
        return self._stream.write(data)


def is_sound(path: str | Path) -> bool:
    """Tell whether a file ends in the digest of what precedes it."""
    data = memoryview(Path(path).read_bytes())
    return len(data) > _DIGEST and hashlib.sha256(data[:-_DIGEST]).digest() == data[-_DIGEST:]


class _CheckedFiles(caching.IndexDataCacheFile):
    """Index and data files of one function; pickle, and so numba, does not look behind its own end."""

    def save(self, key: Any, data: Any) -> None:
        with contextlib.suppress(OSError):  # a full disk: what is compiled serves this process alone
            super().save(key, data)

    def _load_index(self) -> dict:
        with contextlib.suppress(Exception):  # whatever cannot be read is compiled anew
            if is_sound(self._index_path):
                return super()._load_index()
        return {}

    def _load_data(self, name: str) -> Any:
        with contextlib.suppress(Exception):
            if is_sound(self._data_path(name)):
                return super()._load_data(name)
        return None

    @contextlib.contextmanager
    def _open_for_write(self, filepath: str) -> Iterator[_Hashing]:
        with super()._open_for_write(filepath) as stream:
            hashing = _Hashing(stream)
            yield hashing
            stream.write(hashing.digest.digest())


def _files(cache_path: str, filename_base: str, source_stamp: Any) -> caching.IndexDataCacheFile:
    """Give checked files for a function of this package, numba's own for any other."""
    ours = Path(cache_path).is_relative_to(folder())
    return (_CheckedFiles if ours else _NUMBAS_FILES)(cache_path, filename_base, source_stamp)


_NUMBAS_FILES = caching.IndexDataCacheFile
caching.IndexDataCacheFile = _files
caching.CacheImpl._locator_classes.insert(0, Locator)
