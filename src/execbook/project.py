"""The project that a book belongs to: its folder, and what `book/execbook.toml` declares.

command   name of the command, for the line that reruns a page
package   Python package with the algorithms; a run depends on the modules of it that the notebook imports
theme     `module:function`, a context manager called with `light` or `dark` while a figure is drawn
data      `module:function`, called with the root; gives {name: SHA-256} of the vendored files, each verified
progress  `module:function`, called with the function that long loops of the package are to report to
preload   modules that most notebooks import; none of the package, whose sources may change
"""

from __future__ import annotations

import importlib
import os
import tomllib
from collections.abc import Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, NamedTuple

from execbook.errors import Fault, is_plain

MARK = "book/execbook.toml"
ROOT = "EXECBOOK_ROOT"
"""Environment variable: folder of the project."""


class Project(NamedTuple):
    """The declarations of `book/execbook.toml`."""

    command: str = "execbook"
    package: str = ""
    theme: str = ""
    data: str = ""
    progress: str = ""
    preload: Sequence[str] = ()


def root(start: Path | None = None, home: Path | None = None) -> Path:
    """Find the project: `$EXECBOOK_ROOT`, else upward from `start` or from here, else `home`."""
    told = os.environ.get(ROOT)
    here = Path(told or start or Path.cwd()).resolve()
    for folder in (here, *([] if told else [*here.parents, *filter(None, [home])])):
        if (folder / MARK).is_file():
            if not is_plain(str(folder)):
                raise Fault(f"The path {str(folder)!r} has control characters or is not UTF-8; rename the folder.")
            return folder
    if told:
        raise Fault(f"{told!r} is no clone of the project: it lacks {MARK}; correct --root or {ROOT}.")
    raise Fault(
        f"No clone of the project was found upward from {here}, and the installed package carries the code alone; "
        f"change into a clone, or name it with --root or {ROOT}."
    )


def read(root: Path) -> Project:
    """Read the declarations of the project; raises Fault where the file is malformed."""
    try:
        return Project(**tomllib.loads((root / MARK).read_text(encoding="utf-8")))
    except (OSError, TypeError, ValueError) as error:
        raise Fault(f"{MARK} cannot be read ({error}); its keys are {', '.join(Project._fields)}.") from error


def theme(root: Path, name: str) -> AbstractContextManager[Any]:
    """Give the context in which a figure is drawn for the theme `light` or `dark`."""
    declared = read(root).theme
    if declared:
        return named(declared)(name)
    import matplotlib.pyplot as plt

    return plt.style.context("dark_background" if name == "dark" else "default")


def vendored(root: Path) -> dict[str, str]:
    """Give the SHA-256 of each vendored file; raises Fault where one is missing or damaged."""
    declared = read(root).data
    try:
        return dict(named(declared)(root)) if declared else {}
    except OSError as error:
        raise Fault(str(error)) from error


def named(declared: str) -> Any:
    """Import what `module:function` names."""
    module, _, name = declared.partition(":")
    try:
        return getattr(importlib.import_module(module), name)
    except (ImportError, AttributeError, ValueError) as error:
        raise Fault(f"{MARK} names {declared!r}, which cannot be imported ({error}); write module:function.") from error
