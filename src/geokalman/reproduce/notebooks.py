"""The notebooks of the book: where they are, how they are read, and what makes a copy of one deterministic."""

from __future__ import annotations

import difflib
import re
from pathlib import Path
from typing import TYPE_CHECKING

from geokalman.reproduce import contents
from geokalman.reproduce.errors import Fault, Misuse, shown

if TYPE_CHECKING:
    from nbformat import NotebookNode

_KERNELSPEC = {"display_name": "Python 3", "language": "python", "name": "python3"}
_HEADER = re.compile(r"\A---\n(.*?)\n---\n", re.S)


def names(root: Path) -> list[str]:
    """Names `<paper>/<notebook>` of all notebooks: MyST files under `book/` with a jupytext header, in its order."""
    return sorted((name for name, path in _pages(root).items() if _is_notebook(path)), key=contents.order(root))


def source_path(root: Path, name: str) -> Path:
    """Path of the source of notebook `name`; raises Misuse, with the nearest names there are, for any other word.

    Only what the book lists is a notebook: a path to another file is none, wherever it leads.
    """
    path = _pages(root).get(name)
    if path is not None and _is_notebook(path):
        return path
    known = names(root)
    near = difflib.get_close_matches(name[:200], known, n=3, cutoff=0.7) or [n for n in known if n.rpartition("/")[2] in name]
    hint = f"did you mean {' or '.join(near[:3])}?" if near else "geokalman list names them."
    raise Misuse(f"{shown(repr(name), 100)} is no notebook of the book in {root}; {hint}")


def _pages(root: Path) -> dict[str, Path]:
    """All Markdown files of the papers, by name."""
    files = (root / "book").glob("*/*.md")
    return {f"{p.parent.name}/{p.stem}": p for p in files if not p.parent.name.startswith(("_", "."))}


def _is_notebook(path: Path) -> bool:
    header = _HEADER.match(path.read_text(encoding="utf-8"))
    return bool(header and re.search(r"^(jupytext|kernelspec):", header[1], re.M))


def read(root: Path, name: str) -> NotebookNode:
    """The notebook as nbformat node, with deterministic cell ids; raises Fault where the file cannot be read as one."""
    import jupytext

    path = source_path(root, name)
    try:
        notebook = jupytext.read(path)
    except Exception as error:  # jupytext raises many kinds, from YAML's to its own
        raise Fault(f"{path} is no readable MyST notebook: {' '.join(str(error).split())}.") from error
    return tidy(notebook, name)


def tidy(notebook: NotebookNode, name: str) -> NotebookNode:
    """Give the cells ids made of name and position, drop times, and name the plain Python kernel, in place."""
    stem = re.sub(r"[^A-Za-z0-9]+", "-", name)[:58]
    notebook.nbformat, notebook.nbformat_minor = 4, 5
    for k, cell in enumerate(notebook.cells):
        cell["id"] = f"{stem}-{k:02d}"
        for key in ("papermill", "execution", "ExecuteTime"):
            cell.metadata.pop(key, None)
    notebook.metadata.pop("papermill", None)
    notebook.metadata["kernelspec"] = dict(_KERNELSPEC)
    return notebook


def code(notebook: NotebookNode) -> str:
    """All code of a notebook as one Python text (IPython magics left out)."""
    lines = "\n".join(cell.source for cell in notebook.cells if cell.cell_type == "code").splitlines()
    return "\n".join(line for line in lines if not line.lstrip().startswith(("%", "!")))


def tagged(notebook: NotebookNode, tag: str) -> str | None:
    """Source of the code cell with this tag, or None; raises Fault where there are two."""
    cells = [c.source for c in notebook.cells if c.cell_type == "code" and tag in c.metadata.get("tags", [])]
    if len(cells) > 1:
        raise Fault(f"{len(cells)} cells are tagged {tag}; a notebook has one.")
    return cells[0] if cells else None
