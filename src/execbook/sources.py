"""The code behind a result: a hash of modules and all that they import of their own.

The memo of heavy results and the cache of executed notebooks ask it whether the code is still the one they know.
"""

from __future__ import annotations

import ast
import functools
import hashlib
import importlib.util
from collections.abc import Collection, Iterator
from pathlib import Path


def module_path(name: str) -> Path | None:
    """Give the file of the module `name` (dotted), or None where there is none."""
    package, *inside = name.split(".")
    for folder in _folders(package):
        stem = Path(folder, *inside)
        for path in (stem / "__init__.py", stem.with_suffix(".py")):
            if path.is_file():
                return path
    return None


@functools.cache
def _folders(package: str) -> tuple[str, ...]:
    spec = importlib.util.find_spec(package) if package.isidentifier() else None
    return tuple(spec.submodule_search_locations or ()) if spec else ()


def _statements(node: ast.AST) -> Iterator[ast.AST]:
    """Give all statements below a node; expressions, which are most of a tree, hold no import."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.stmt | ast.excepthandler | ast.match_case):
            yield child
            yield from _statements(child)


def imported_modules(source: str, packages: Collection[str], parent: str = "") -> set[str]:
    """Give the modules of `packages` that a text imports; `parent` resolves relative imports."""
    names: set[str] = set()
    for node in _statements(ast.parse(source)):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = parent.split(".")[: parent.count(".") + 2 - node.level] if node.level else []
            base = ".".join([*above, *filter(None, [node.module])])
            names.update([base, *(f"{base}.{alias.name}" for alias in node.names)])
    return {name for name in names if name.partition(".")[0] in packages and module_path(name)}


@functools.cache
def _read(path: Path) -> str:
    return path.read_text(encoding="utf-8")


@functools.cache
def _direct(name: str, packages: frozenset[str]) -> frozenset[str]:
    path = module_path(name)
    if path is None:
        return frozenset()
    parent = name if path.name == "__init__.py" else name.rpartition(".")[0]
    above = {name.rsplit(".", k)[0] for k in range(1, name.count(".") + 1)}  # importing a.b.c runs a/__init__ too
    return frozenset(imported_modules(_read(path), packages, parent) | above)


def closure(modules: Collection[str]) -> set[str]:
    """Give `modules` and all modules of their packages that they import, directly or not."""
    packages = frozenset(name.partition(".")[0] for name in modules)
    seen: set[str] = set()
    todo = set(modules)
    while todo:
        name = todo.pop()
        seen.add(name)
        todo |= _direct(name, packages) - seen
    return seen


def code_hash(modules: Collection[str]) -> str:
    """Give the SHA-256 (hex) over the sources of the closure of `modules`."""
    digest = hashlib.sha256()
    for name in sorted(closure(modules)):
        path = module_path(name)
        digest.update(f"{name}\0{_read(path) if path else ''}\0".encode())
    return digest.hexdigest()


def edited(modules: Collection[str]) -> set[str]:
    """Give the modules of the closure whose file is no longer what this process read."""
    paths = {name: module_path(name) for name in closure(modules)}
    return {name for name, path in paths.items() if path is None or path.read_text(encoding="utf-8") != _read(path)}
