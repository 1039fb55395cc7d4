"""The notebooks of the book: where they are, how they are read, their twins for Jupyter."""

from __future__ import annotations

import difflib
import hashlib
import json
import os
import re
from pathlib import Path
from typing import TYPE_CHECKING

from execbook import atomic, contents
from execbook.errors import Fault, Misuse, shown

if TYPE_CHECKING:
    from nbformat import NotebookNode

_KERNELSPEC = {"display_name": "Python 3", "language": "python", "name": "python3"}
_HEADER = re.compile(r"\A---\n(.*?)\n---\n", re.S)
_MARK = "execbook"


def names(root: Path) -> list[str]:
    """List the names `<paper>/<notebook>` of the notebooks, in the order of the book."""
    return sorted(_sources(root), key=contents.order(root))


def source_path(root: Path, name: str) -> Path:
    """Give the source of a notebook; raises Misuse, with near names, for any other word."""
    known = _sources(root)
    if name in known:
        return known[name]
    near = difflib.get_close_matches(name[:200], known, n=3, cutoff=0.7)
    near = near or [other for other in sorted(known) if name in other]
    hint = f"did you mean {' or '.join(near[:3])}?" if near else "the command list names them."
    raise Misuse(f"{shown(repr(name), 100)} is no notebook of the book in {root}; {hint}")


def name_of(root: Path, text: str) -> str:
    """Give the name of the notebook whose source is at the path `text`, else the text itself."""
    listed = {str(source_path(root, name)): name for name in names(root)}
    places = (os.path.abspath(os.path.join(base, text)) for base in (os.getcwd(), root))
    return next((listed[place] for place in places if place in listed), text)


def _sources(root: Path) -> dict[str, Path]:
    """Give the MyST files with a jupytext header, by name."""
    files = [p for p in (root / "book").glob("*/*.md") if not p.parent.name.startswith(("_", "."))]
    headers = ((path, _HEADER.match(path.read_text(encoding="utf-8"))) for path in files)
    return {
        f"{path.parent.name}/{path.stem}": path
        for path, header in headers
        if header and re.search(r"^(jupytext|kernelspec):", header[1], re.M)
    }


def read(root: Path, name: str) -> NotebookNode:
    """Read a notebook, with deterministic cell ids; raises Fault where it cannot be read."""
    import jupytext

    path = source_path(root, name)
    try:
        notebook = jupytext.read(path)
    except Exception as error:  # jupytext raises many kinds, from YAML's to its own
        raise Fault(f"{path} is no readable MyST notebook: {' '.join(str(error).split())}.") from error
    return tidy(notebook, name)


def tidy(notebook: NotebookNode, name: str) -> NotebookNode:
    """Name cells by their place and the plain Python kernel, and drop times, in place."""
    stem = re.sub(r"[^A-Za-z0-9]+", "-", name)[:58]
    notebook.nbformat, notebook.nbformat_minor = 4, 5
    for k, cell in enumerate(notebook.cells):
        cell["id"] = f"{stem}-{k:02d}"
        for key in ("papermill", "execution", "ExecuteTime"):
            cell.metadata.pop(key, None)
    notebook.metadata.pop("papermill", None)
    notebook.metadata["kernelspec"] = dict(_KERNELSPEC)
    return notebook


def write(path: Path, notebook: NotebookNode) -> None:
    """Write a notebook whole or not at all."""
    import nbformat

    atomic.write_text(path, nbformat.writes(notebook) + "\n")


def code(notebook: NotebookNode) -> str:
    """Give all code of a notebook as one Python text (IPython magics left out)."""
    lines = "\n".join(cell.source for cell in notebook.cells if cell.cell_type == "code").splitlines()
    return "\n".join(line for line in lines if not line.lstrip().startswith(("%", "!")))


def tagged(notebook: NotebookNode, tag: str) -> str | None:
    """Give the source of the code cell with this tag, or None; raises Fault for two of them."""
    cells = [c.source for c in notebook.cells if c.cell_type == "code" and tag in c.metadata.get("tags", [])]
    if len(cells) > 1:
        raise Fault(f"{len(cells)} cells are tagged {tag}; a notebook has one.")
    return cells[0] if cells else None


def write_twins(root: Path, force: bool = False) -> list[Path]:
    """Write `book/<paper>/<notebook>.ipynb` for every notebook; returns the paths.

    Raises Misuse, before anything is written, where a twin was edited since it was made (unless `force`).
    """
    made = {root / "book" / f"{name}.ipynb": read(root, name) for name in names(root)}
    edited = [] if force else [str(path.relative_to(root)) for path in made if path.is_file() and _is_edited(path)]
    if edited:
        raise Misuse(f"{', '.join(edited)} was edited; move it away, or overwrite it with --force.")
    for path, notebook in made.items():
        notebook.metadata[_MARK] = {"twin_of": path.with_suffix(".md").name, "sources": _digest(notebook)}
        write(path, notebook)
    return list(made)


def _digest(notebook: NotebookNode) -> str:
    cells = [[cell["cell_type"], "".join(cell["source"])] for cell in notebook["cells"]]
    return hashlib.sha256(json.dumps(cells).encode()).hexdigest()


def _is_edited(path: Path) -> bool:
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        return found["metadata"][_MARK]["sources"] != _digest(found)
    except (ValueError, KeyError, TypeError):
        return True  # not one of ours
