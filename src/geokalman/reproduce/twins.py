"""Plain `.ipynb` twins of the notebooks, for people who use papermill or Jupyter directly. Git ignores them."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import TYPE_CHECKING

from geokalman.reproduce import atomic, notebooks
from geokalman.reproduce.errors import Misuse

if TYPE_CHECKING:
    from nbformat import NotebookNode

_MARK = "geokalman"


def write(root: Path, force: bool = False) -> list[Path]:
    """Write `book/<paper>/<notebook>.ipynb` for every notebook; returns the paths.

    Raises Misuse, before anything is written, where a twin was edited since it was made (unless `force`).
    """
    import nbformat

    made = {path_of(root, name): notebooks.read(root, name) for name in notebooks.names(root)}
    edited = [] if force else [str(path.relative_to(root)) for path in made if _is_edited(path)]
    if edited:
        raise Misuse(f"{', '.join(edited)} was edited; move it away, or overwrite it with --force.")
    for path, notebook in made.items():
        notebook.metadata[_MARK] = {"twin_of": path.with_suffix(".md").name, "sources": _digest(notebook)}
        atomic.write_text(path, nbformat.writes(notebook) + "\n")
    return list(made)


def path_of(root: Path, name: str) -> Path:
    """Where the twin of a notebook stands."""
    return root / "book" / f"{name}.ipynb"


def _digest(notebook: NotebookNode) -> str:
    cells = [[cell["cell_type"], "".join(cell["source"])] for cell in notebook["cells"]]
    return hashlib.sha256(json.dumps(cells).encode()).hexdigest()


def _is_edited(path: Path) -> bool:
    if not path.is_file():
        return False
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        return found["metadata"][_MARK]["sources"] != _digest(found)
    except (ValueError, KeyError, TypeError):
        return True  # not one that we made
