"""The package's own sources: a content hash of a piece of code and of everything in the package it stands on.

Three caches ask the same question, "is this still the code that made that result?": numba's compilation cache, the memo
of heavy results and the cache of executed notebooks. They all ask it here. Standard library only.
"""

from __future__ import annotations

import ast
import atexit
import functools
import hashlib
import os
import re
import shutil
import stat
import sys
import tempfile
import time
from pathlib import Path

from geokalman import compilation

PACKAGE = "geokalman"
PACKAGE_DIR = Path(__file__).resolve().parent
# Parsing these alone takes a twentieth of the time of parsing whole files, which every process would pay for.
_IMPORT = re.compile(
    r"(?:^|[;:])[ \t]*(from[ \t]+[\w.]+[ \t]+import[ \t]*(?:\([^)]*\)|.*)|import[ \t].*)", re.MULTILINE
)
_KEEP_COMPILED = 4  # compilation caches of earlier sources kept beside the present one


def module_path(name: str) -> Path | None:
    """Path of the file of the package's module `name` (dotted), or None where there is no such module."""
    stem = PACKAGE_DIR.joinpath(*name.split(".")[1:])
    for path in (stem / "__init__.py", stem.with_suffix(".py")):
        if path.is_file():
            return path
    return None


def imported_modules(source: str, package: str = "") -> set[str]:
    """Dotted names of the package's modules that the Python text `source` imports; `package` resolves relative
    imports."""
    found = set()
    try:
        nodes = [node for statement in _IMPORT.findall(source) for node in ast.parse(statement).body]
    except SyntaxError:  # an import over several lines, or a sentence that begins like one
        nodes = list(ast.walk(ast.parse(source)))
    for node in nodes:
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                parent = package.split(".")[: len(package.split(".")) - node.level + 1]
                base = ".".join([*parent, *([base] if base else [])])
            names = [base, *(f"{base}.{alias.name}" for alias in node.names)]
        found.update(n for n in names if n.split(".")[0] == PACKAGE and module_path(n) is not None)
    return found


@functools.cache
def _read(path: Path) -> str:
    return path.read_text(encoding="utf-8")


@functools.cache
def _direct(name: str) -> frozenset[str]:
    path = module_path(name)
    package = name if path.name == "__init__.py" else name.rpartition(".")[0]
    parents = {name.rsplit(".", k)[0] for k in range(1, name.count("."))}  # importing a.b.c runs a.b/__init__ too
    return frozenset(imported_modules(_read(path), package) | parents)


def closure(modules: set[str]) -> set[str]:
    """The package's modules that `modules` import, directly or not, themselves included."""
    seen: set[str] = set()
    todo = set(modules)
    while todo:
        name = todo.pop()
        seen.add(name)
        todo |= _direct(name) - seen
    return seen


def code_hash(modules: set[str]) -> str:
    """SHA-256 (hex) over the sources of `modules` and of all modules of the package that they import, transitively."""
    digest = hashlib.sha256()
    for name in sorted(closure(modules)):
        digest.update(name.encode() + b"\0" + _read(module_path(name)).encode() + b"\0")
    return digest.hexdigest()


def edited(modules: set[str]) -> set[str]:
    """Those of the modules behind `modules` whose file is no longer what this process read: its hash would be a lie."""
    changed = set()
    for name in closure(modules):
        path = module_path(name)
        if path is None or path.read_text(encoding="utf-8") != _read(path):
            changed.add(name)
    return changed


def _compiled_modules() -> set[str]:
    names = set()
    for path in PACKAGE_DIR.rglob("*.py"):
        if "numba" in _read(path) and path != Path(__file__).resolve():
            parts = path.relative_to(PACKAGE_DIR).with_suffix("").parts
            parts = parts[:-1] if parts[-1] == "__init__" else parts
            names.add(".".join([PACKAGE, *parts]))
    return names


def _cache_home() -> Path:
    if os.environ.get("NUMBA_CACHE_DIR"):
        return Path(os.environ["NUMBA_CACHE_DIR"])
    clone = PACKAGE_DIR.parent.parent
    if (clone / "pyproject.toml").is_file():
        return clone / ".cache" / "numba"
    return Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / PACKAGE / "numba"


def key_compilation_cache() -> Path:
    """Send numba's on-disk cache to a folder named after a hash of all compiled modules and what they import.

    An edited kernel therefore never meets machine code of its older self, nor of an older callee. Older folders are
    pruned. Must run before a compiled function of the package is defined. Returns the folder.
    """
    inherited = os.environ.get("GEOKALMAN_NUMBA_HOME")  # a parent process has keyed it: keep to its home, not its key
    home = Path(inherited) if inherited else _cache_home()
    folder = home / f"{PACKAGE}-{code_hash(_compiled_modules())[:16]}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        os.utime(folder)
        if not os.access(folder, os.W_OK):
            raise PermissionError(folder)
    except OSError:  # a read-only home: compile anew in this process, and say nothing of it to the reader
        folder = _temporary_home() / folder.name
        folder.mkdir(exist_ok=True)
    else:
        _prune(home, keep=folder)
    compilation.watch()
    os.environ["GEOKALMAN_NUMBA_HOME"] = str(home)
    os.environ["NUMBA_CACHE_DIR"] = str(folder)
    if "numba" in sys.modules:  # imported before us: its settings were read already
        sys.modules["numba"].config.CACHE_DIR = str(folder)
    return folder


def _temporary_home() -> Path:
    """A folder that nobody else can have put machine code into: ours in the system's temporary one, else a fresh one."""
    home = Path(tempfile.gettempdir()) / f"{PACKAGE}-{os.getuid()}"
    try:
        home.mkdir(mode=0o700, exist_ok=True)
        found = home.lstat()  # of a link itself, which may lead anywhere
        if stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid() and found.st_mode & 0o777 == 0o700:
            return home
    except OSError:  # a file, or a link to nowhere
        pass
    fresh = tempfile.mkdtemp(prefix=f"{PACKAGE}-")
    atexit.register(shutil.rmtree, fresh, ignore_errors=True)
    return Path(fresh)


def _prune(home: Path, keep: Path) -> None:
    old = sorted((p for p in home.glob(f"{PACKAGE}-*") if p != keep), key=lambda p: p.stat().st_mtime)
    for path in old[:-_KEEP_COMPILED]:
        if time.time() - path.stat().st_mtime > 3600:  # another process may still be using a fresh one
            shutil.rmtree(path, ignore_errors=True)
