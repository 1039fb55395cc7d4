"""The notebooks of the book: where they are, how they are read, and what makes a copy of one deterministic."""

from __future__ import annotations

import difflib
import re
from pathlib import Path
from typing import TYPE_CHECKING

from geokalman.reproduce import contents
from geokalman.reproduce.errors import Fault, Misuse

if TYPE_CHECKING:
    from nbformat import NotebookNode

_KERNELSPEC = {"display_name": "Python 3", "language": "python", "name": "python3"}
_HEADER = re.compile(r"\A---\n(.*?)\n---\n", re.S)


def names(root: Path) -> list[str]:
    """Names `<paper>/<notebook>` of all notebooks: MyST files under `book/` with a jupytext header, in its order."""
    book = root / "book"
    found = []
    for path in book.glob("*/*.md"):
        if path.parent.name.startswith(("_", ".")):
            continue
        header = _HEADER.match(path.read_text(encoding="utf-8"))
        if header and re.search(r"^(jupytext|kernelspec):", header[1], re.M):
            found.append(f"{path.parent.name}/{path.stem}")
    return sorted(found, key=contents.order(root))


def source_path(root: Path, name: str) -> Path:
    """Path of the source of notebook `name`; raises Misuse, with the names there are, for an unknown one."""
    path = root / "book" / f"{name}.md"
    if re.fullmatch(r"[\w.-]+/[\w.-]+", name) and path.is_file():
        return path
    known = names(root)
    near = difflib.get_close_matches(name, known, n=1)
    hint = f"did you mean {near[0]}?" if near else f"the notebooks are {', '.join(known) or 'none yet'}."
    raise Misuse(f"{name!r} is no notebook of the book in {root}; {hint}")


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
