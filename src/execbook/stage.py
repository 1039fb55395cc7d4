"""Staging: executed runs and prose become the sources of the book, `book/_build/site/`.

A figure or table that a notebook recorded becomes a numbered, captioned, downloadable MyST directive; code is folded
away, one click from the reader; each page says how it was made and how to rerun it.
"""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import nbformat
from nbformat import NotebookNode

from execbook import children, contents, notebooks, pagefoot
from execbook.atomic import explained, locked, partial_path, swap_folder, sweep
from execbook.blocks import claims_table, fill
from execbook.display import FIGURE_TYPE, TABLE_TYPE, markdown_table
from execbook.errors import Fault

_ASSETS = {".bib", ".css", ".js", ".svg", ".png", ".py", ".csv", ".txt"}


class StageError(Fault):
    """The sources of the book cannot be put together; the message says what is missing and where."""


def stage(root: Path) -> Path:
    """Write `book/_build/site/` from the pages of `book/_toc.yml` and the run folders; returns that folder.

    The folder appears whole or not at all, and holds nothing of pages that left the book. Raises StageError where a
    page, a run or a part of a run is missing.
    """
    book, site = root / "book", root / "book" / "_build" / "site"
    pages = contents.pages(root)
    names = notebooks.names(root)
    for name in names:
        if name not in pages:
            raise StageError(f"book/{name}.md is not in book/_toc.yml; add it there.")
    runs = {page: book / "_build" / "runs" / page for page in pages if page in names}
    _require_all(book, pages, runs)
    _require_distinct_names(runs)
    with explained(site), alone(site):
        new = partial_path(site)
        new.mkdir()
        _copy_assets(book, new)
        for page in pages:
            children.check()
            target = new / page
            target.parent.mkdir(parents=True, exist_ok=True)
            if page in runs:
                files = target.with_name(f"{target.name}.files")
                notebook = stage_notebook(page, runs[page], files, partial(fill, root=root))
                notebook.cells.append(_markdown(pagefoot.foot(root, page, runs[page], files)))
                nbformat.write(_identified(notebook, page), target.with_name(f"{target.name}.ipynb"))
            else:
                text = fill((book / f"{page}.md").read_text(encoding="utf-8"), root)
                target.with_name(f"{target.name}.md").write_text(text, encoding="utf-8")
        swap_folder(new, site)
    return site


@contextmanager
def alone(target: Path) -> Iterator[None]:
    """Make a folder of `book/_build` while no other process does; what a killed one left there is cleared first."""
    with locked(target.parent / ".book.lock"), children.busy():
        sweep(target.parent)
        try:
            yield
        finally:
            sweep(target.parent)


def stage_notebook(
    page: str, run: Path, files: Path, filled: Callable[[str], str] = str, offer: bool = True
) -> NotebookNode:
    """Make a page of the executed notebook of `run`; what it shows is copied into `files`.

    filled  what fills in the prose;  offer: whether the data of figures and tables are offered as downloads
    """
    notebook = nbformat.read(run / "notebook.ipynb", as_version=4)
    files.mkdir(parents=True)
    cells: list[NotebookNode] = []
    for cell in notebook.cells:
        tags = cell.metadata.get("tags", [])
        if cell.cell_type == "markdown":
            cells.append(_markdown(filled(cell.source)))
        elif cell.cell_type == "code" and "quick" not in tags:
            _drop_finish(cell)
            if not cell.source:
                continue
            shown = [_directive(page, output, run, files, offer) for output in cell.outputs]
            kept = (output for output, text in zip(cell.outputs, shown, strict=True) if text is None)
            cell.outputs = [output for output in kept if not _echo(output)]
            _fold(cell)
            if cells and _joins(cells[-1], cell):
                cells[-1].source += "\n\n" + cell.source
                cells[-1].outputs = cell.outputs
            else:
                cells.append(cell)
            cells.extend(_markdown(text) for text in shown if text is not None)
    metadata = {key: notebook.metadata[key] for key in ("kernelspec", "language_info") if key in notebook.metadata}
    return _identified(nbformat.v4.new_notebook(cells=cells, metadata=metadata), page)


def _identified(notebook: NotebookNode, page: str) -> NotebookNode:
    for number, cell in enumerate(notebook.cells):
        cell["id"] = f"{page.replace('/', '-')}-{number}"[-64:]
    return notebook


def _require_all(book: Path, pages: list[str], runs: dict[str, Path]) -> None:
    absent = [f"book/{page}.md" for page in pages if not (book / f"{page}.md").is_file()]
    if absent:
        raise StageError(f"book/_toc.yml lists pages that do not exist: {', '.join(absent)}.")
    missing = [page for page, run in runs.items() if not (run / "notebook.ipynb").is_file()]
    if missing:
        raise StageError(f"not executed yet: {', '.join(missing)}; the command build executes them.")


def _require_distinct_names(runs: dict[str, Path]) -> None:
    """Figures and tables are cross-referenced by name from everywhere, so a name stands once in the whole book."""
    owner: dict[str, str] = {}
    for page, run in runs.items():
        cells = nbformat.read(run / "notebook.ipynb", as_version=4).cells
        found = [output.get("data", {}) for cell in cells for output in cell.get("outputs", [])]
        for name in (
            label(page, data[kind]["name"]) for data in found for kind in (FIGURE_TYPE, TABLE_TYPE) if kind in data
        ):
            if name in owner:
                raise StageError(
                    f"{name!r} names a figure or table of {owner[name]} and another of {page}; rename one."
                )
            owner[name] = page


def _copy_assets(book: Path, new: Path) -> None:
    for path in sorted(book.rglob("*")):
        inside = path.relative_to(book)
        wanted = path.suffix in _ASSETS or path.name in ("_config.yml", "_toc.yml")
        if wanted and path.is_file() and not {"_build", "__pycache__", ".ipynb_checkpoints"} & set(inside.parts):
            _copy(path, new / inside)


def _copy(source: Path, target: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(source, target)


def _markdown(text: str) -> NotebookNode:
    return nbformat.v4.new_markdown_cell(text)


def _fold(cell: NotebookNode) -> None:
    """Fold a code cell's source away unless its author tagged it `show-input`."""
    tags = list(cell.metadata.get("tags", []))
    if "show-input" not in tags:
        label = "Parameters" if "parameters" in tags else "Code"
        cell.metadata["mystnb"] = {"code_prompt_show": f"{label}: show", "code_prompt_hide": f"{label}: hide"}
        tags.append("hide-input")
    cell.metadata["tags"] = tags
    cell.metadata.pop("papermill", None)


def _drop_finish(cell: NotebookNode) -> None:
    """Take `nb.finish()` and the line that it prints out of the notebook's last cell: they say nothing to a reader."""
    lines = cell.source.rstrip().splitlines()
    if not lines or lines[-1] != "nb.finish()":
        return
    cell.source = "\n".join(lines[:-1]).rstrip()
    for output in cell.outputs:
        if output.get("name") == "stdout":
            output.text = "".join(output.text.splitlines(keepends=True)[:-1])
    cell.outputs = [output for output in cell.outputs if output.get("text", "kept")]


def _joins(before: NotebookNode, cell: NotebookNode) -> bool:
    """Tell whether two folded code cells with nothing shown between them become one."""
    folded = all("hide-input" in c.metadata.get("tags", []) for c in (before, cell))
    return before.cell_type == "code" and folded and not before.outputs


def _echo(output: NotebookNode) -> bool:
    """Tell whether an output only echoes a cell's last expression; readers get what is displayed or printed."""
    return output.get("output_type") == "execute_result" and set(output.get("data", {})) <= {"text/plain"}


def _directive(page: str, output: NotebookNode, run: Path, files: Path, offer: bool) -> str | None:
    """Give the MyST text that stands for one output of a code cell, or None where the output stays as it is."""
    data = output.get("data", {})
    record = data.get(FIGURE_TYPE) or data.get(TABLE_TYPE)
    if not record:
        return str(data["text/markdown"]) if "text/markdown" in data else None
    link = _data_link(record, run, files) if offer else ""
    name, caption = label(page, record["name"]), _line(record["caption"])
    if FIGURE_TYPE in data:
        for theme in ("light", "dark"):
            _copied(record["files"][theme], run, files)
        return (
            f"```{{figure}} {files.name}/{record['name']}.light.png\n:name: {name}\n"
            f":alt: {json.dumps(_line(record['alt']), ensure_ascii=False)}\n:width: {record['width']}px\n\n"
            f"{caption}\n{link}```"
        )
    if _of_verdicts(record["name"]):
        body = claims_table(record["header"], record["rows"])
    else:
        body = markdown_table(record["header"], [[_line(t) for t in row] for row in record["rows"]], record["align"])
    return f"```{{table}} {caption}\n:name: {name}\n\n{body}\n```\n{link}"


def label(page: str, name: str) -> str:
    """Give the label of a figure or table: its name; the table of `nb.verdicts()` takes the page's."""
    return f"verdicts-{page.replace('/', '-')}" if _of_verdicts(name) else name


def _of_verdicts(name: str) -> bool:
    return name.startswith("verdicts-")


def _data_link(record: dict, run: Path, files: Path) -> str:
    """Offer the numbers behind a figure or table in a line, or give nothing where none were kept."""
    if "csv" not in record["files"]:
        return ""
    source = _copied(record["files"]["csv"], run, files)
    every = record.get("data_every", 1)
    thinned = f", one row in {every}" if every > 1 else ""
    return f"\n{{download}}`Data (CSV{thinned}) <{files.name}/{source.name}>`\n"


def _copied(inside: str, run: Path, files: Path) -> Path:
    """Copy a part of a run into `files`; gives its path in the run."""
    path = run / inside
    if not path.is_file():
        raise StageError(f"{path} is missing, though the notebook recorded it; renew the run with the command build.")
    _copy(path, files / path.name)
    return path


def _line(text: str) -> str:
    return re.sub(r"[ \t\r\n]+", " ", text).strip(" ")  # no-break spaces stay
