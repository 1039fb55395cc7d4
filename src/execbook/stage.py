"""Staging: executed runs and prose become the sources of the book, `book/_build/site/`.

A figure or table that a notebook recorded becomes a numbered, captioned, downloadable MyST directive; code is folded
away, one click from the reader; each page ends with how it was made and how to rerun it.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import nbformat
from nbformat import NotebookNode
from nbformat.v4 import new_markdown_cell, new_notebook

from execbook import children, contents, notebooks, parameters, project, runfolder, verdicts
from execbook.atomic import explained, locked, partial_path, swap_folder, sweep
from execbook.blocks import claims_table, fill, table_directive
from execbook.display import FIGURE_TYPE, TABLE_TYPE, line, markdown_table
from execbook.errors import Fault

_ASSETS = {".bib", ".css", ".js", ".svg", ".png", ".py", ".csv", ".txt"}
_CONFIG = {"_config.yml", "_toc.yml"}
_SKIPPED = {"_build", "__pycache__", ".ipynb_checkpoints"}
_OFFERED = {
    "notebook.ipynb": "the executed notebook",
    "metrics.json": "every recorded number with its unit",
    "arrays.npz": "the recorded arrays",
    "provenance.json": "parameters, versions and data behind this page",
}
_LARGEST = 20e6  # bytes; a larger file is made by the rerun, not carried in the book
_FOOT = """## Rerun this page

From a clone of the project ([how](/practice/rerun.md)), with {which} changed:

```bash
{command} run {page} {example}
```

````{{dropdown}} Parameters
{table}
````

{offers}

{made}"""


def stage(root: Path) -> Path:
    """Write `book/_build/site/` from the pages of `book/_toc.yml` and the runs; returns it.

    The folder appears whole or not at all, and holds nothing of pages that left the book. Raises Fault where a page, a
    run or a part of a run is missing.
    """
    book, site = root / "book", root / "book" / "_build" / "site"
    pages, names = contents.pages(root), notebooks.names(root)
    if outside := [f"book/{name}.md" for name in names if name not in pages]:
        raise Fault(f"{', '.join(outside)} is not in book/_toc.yml; add it there.")
    if absent := [f"book/{page}.md" for page in pages if not (book / f"{page}.md").is_file()]:
        raise Fault(f"book/_toc.yml lists pages that do not exist: {', '.join(absent)}.")
    runs = {page: runfolder.run_folder(root, page) for page in pages if page in names}
    if missing := [page for page, run in runs.items() if not (run / "notebook.ipynb").is_file()]:
        raise Fault(f"Some notebooks are not executed yet: {', '.join(missing)}; the command build executes them.")
    with explained(site), alone(site):
        new = partial_path(site)
        for path in sorted(book.rglob("*")):
            inside = path.relative_to(book)
            wanted = path.suffix in _ASSETS or path.name in _CONFIG
            if wanted and path.is_file() and not _SKIPPED & set(inside.parts):
                _copy(path, new / inside)
        for page in pages:
            children.check()
            target = new / page
            target.parent.mkdir(parents=True, exist_ok=True)
            if page in runs:
                files = target.with_name(f"{target.name}.files")
                source = notebooks.read(root, page)
                notebook = stage_notebook(page, runs[page], files, partial(fill, root=root), source=source)
                notebook.cells.append(new_markdown_cell(_foot(root, page, runs[page], files)))
                nbformat.write(notebooks.tidy(notebook, page), target.with_name(f"{target.name}.ipynb"))
            else:
                text = fill((book / f"{page}.md").read_text(encoding="utf-8"), root)
                target.with_name(f"{target.name}.md").write_text(text, encoding="utf-8")
        swap_folder(new, site)
    return site


@contextmanager
def alone(target: Path) -> Iterator[None]:
    """Make a folder of `book/_build` while no other process does, and clear what it leaves."""
    with locked(target.parent / ".book.lock"), children.busy():
        sweep(target.parent)
        try:
            yield
        finally:
            sweep(target.parent)


def stage_notebook(
    page: str, run: Path, files: Path, filled: Callable[[str], str] = str, offer: bool = True,
    source: NotebookNode | None = None,
) -> NotebookNode:  # fmt: skip
    """Make a page of the executed notebook of `run`; what it shows is copied into `files`.

    A table of claims is made anew where `filled` knows how, since verdicts may rest on other pages' numbers.

    filled  what fills in the prose;  offer: whether the data of figures and tables are offered as downloads
    source  the notebook as it is now, whose prose may have changed since the run
    """
    notebook = nbformat.read(run / "notebook.ipynb", as_version=4)
    if source is not None:
        notebook.cells = _with_prose(source, notebook)
    files.mkdir(parents=True)
    cells: list[NotebookNode] = []
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            cells.append(new_markdown_cell(filled(cell.source)))
        elif cell.cell_type == "code" and "quick" not in cell.metadata.get("tags", []):
            _drop_finish(cell)
            if not cell.source:
                continue
            shown = [
                _claims(page, output, filled) or _directive(page, output, run, files, offer) for output in cell.outputs
            ]
            kept = (output for output, text in zip(cell.outputs, shown, strict=True) if text is None)
            cell.outputs = [output for output in kept if not _is_echo(output)]
            _fold(cell)
            if cells and _is_bare(cells[-1]) and "hide-input" in cell.metadata.tags:
                cells[-1].source += "\n\n" + cell.source
                cells[-1].outputs = cell.outputs
            else:
                cells.append(cell)
            cells.extend(new_markdown_cell(text) for text in shown if text is not None)
    metadata = {key: value for key, value in notebook.metadata.items() if key == "language_info"}
    return notebooks.tidy(new_notebook(cells=cells, metadata=metadata), page)


def _with_prose(source: NotebookNode, executed: NotebookNode) -> list[NotebookNode]:
    """Give the cells of `source`, those of code as they were executed; all executed ones where the code differs."""
    done = [cell for cell in executed.cells if cell.cell_type == "code"]
    if [cell.source for cell in done] != [cell.source for cell in source.cells if cell.cell_type == "code"]:
        return list(executed.cells)
    remaining = iter(done)
    return [next(remaining) if cell.cell_type == "code" else cell for cell in source.cells]


def _fold(cell: NotebookNode) -> None:
    """Fold a code cell's source away unless its author tagged it `show-input`."""
    tags = list(cell.metadata.get("tags", []))
    if "show-input" not in tags:
        tags = [tag for tag in tags if tag != "hide-input"]  # which an author may give as well
        label = "Parameters" if "parameters" in tags else "Code"
        cell.metadata["mystnb"] = {"code_prompt_show": f"{label}: show", "code_prompt_hide": f"{label}: hide"}
        tags.append("hide-input")
    cell.metadata["tags"] = tags


def _drop_finish(cell: NotebookNode) -> None:
    """Take `nb.finish()` and the line that it prints out of the last cell."""
    *lines, last = cell.source.rstrip().splitlines() or [""]
    if last != "nb.finish()":
        return
    cell.source = "\n".join(lines).rstrip()
    for output in cell.outputs:
        if output.get("name") == "stdout":
            output.text = "".join(output.text.splitlines(keepends=True)[:-1])
    cell.outputs = [output for output in cell.outputs if output.get("text", "kept")]


def _is_bare(cell: NotebookNode) -> bool:
    """Tell whether a cell is folded code with nothing shown below, which the next one joins."""
    return cell.cell_type == "code" and "hide-input" in cell.metadata.tags and not cell.outputs


def _is_echo(output: NotebookNode) -> bool:
    """Tell whether an output only echoes a cell's last expression."""
    return output.get("output_type") == "execute_result" and set(output.get("data", {})) <= {"text/plain"}


def _claims(page: str, output: NotebookNode, filled: Callable[[str], str]) -> str | None:
    """Give the book's table of the claims that a page decides, where an output is one and `filled` makes it."""
    record = output.get("data", {}).get(TABLE_TYPE)
    call = f"<!-- verdicts-of: {page} -->"
    text = filled(call) if record and _of_verdicts(record["name"]) else call
    return None if text == call else text


def _directive(page: str, output: NotebookNode, run: Path, files: Path, offer: bool) -> str | None:
    """Give the MyST text that stands for an output, or None where the output stays as it is."""
    data = output.get("data", {})
    record = data.get(FIGURE_TYPE) or data.get(TABLE_TYPE)
    if not record:
        return str(data["text/markdown"]) if "text/markdown" in data else None
    paths = {kind: path for kind, path in record["files"].items() if offer or kind not in ("csv", "js")}
    for path in paths.values():
        if not (run / path).is_file():
            raise Fault(f"{run / path} is missing, though the notebook recorded it; the command build renews the run.")
        _copy(run / path, files / Path(path).name)
    link = ""
    if "csv" in paths:
        every = record.get("data_every", 1)
        thinned = f", one row in {every}" if every > 1 else ""
        link = f"\n{{download}}`Data (CSV{thinned}) <{files.name}/{Path(paths['csv']).name}>`\n"
    name, caption = label(page, record["name"]), line(record["caption"])
    if FIGURE_TYPE in data:
        return (
            f"```{{figure}} {files.name}/{record['name']}.light.png\n:name: {name}\n"
            f":alt: {json.dumps(line(record['alt']), ensure_ascii=False)}\n:width: {record['width']}px\n\n"
            f"{caption}\n{link}```"
        )
    header, rows = record["header"], record["rows"]
    judged = _of_verdicts(record["name"])
    table = claims_table(header, rows) if judged else markdown_table(header, rows, record["align"])
    return table_directive(caption, name, table) + link


def label(page: str, name: str) -> str:
    """Give the label of a figure or table: its name, or the page's for a table of verdicts."""
    return verdicts.label_of(page) if _of_verdicts(name) else name


def _of_verdicts(name: str) -> bool:
    return name.startswith("verdicts-")


def _copy(source: Path, target: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(source, target)


def _foot(root: Path, page: str, run: Path, files: Path) -> str:
    """Give the foot of a page: how to rerun it, what it offers in `files`, how it was made."""
    shown = list(parameters.load(root, page).parameters.values())
    stem, offers = page.rpartition("/")[2], []
    for name, what in _OFFERED.items():
        if (run / name).is_file() and (run / name).stat().st_size <= _LARGEST:
            offered = f"{stem}.ipynb" if name == "notebook.ipynb" else f"{stem}.{name}"
            shutil.copyfile(run / name, files / offered)
            offers.append(f"- {{download}}`{offered} <{files.name}/{offered}>`: {what}")
    header = ["name", "default", "unit", "range", "what it is"]
    rows = [[f"`{p.name}`", _code(p.default), p.unit, _code(p.range), p.help] for p in shown]
    return _FOOT.format(
        which="any of the parameters below" if len(shown) > 1 else "its one parameter",
        command=project.read(root).command,
        page=page,
        example=_example(shown),
        table=markdown_table(header, rows),
        offers="\n".join(offers),
        made=_made(runfolder.provenance(run)),
    )


def _code(value: object) -> str:
    return "" if value is None or value == "" else f"`{value}`"


def _example(shown: list[parameters.Parameter]) -> str:
    """Change a parameter: halve the first number whose range allows it, or shorten a list."""
    for p in shown:
        if p.kind in ("float", "int") and not p.many and p.default:
            half = p.default / 2 if p.kind == "float" else p.default // 2
            if p.interval is None or p.interval.holds(half):
                return f"{p.name}={half:g}"
    lists = (p for p in shown if p.many and len(p.default or ()) > 1)
    return next((f"{p.name}=[{','.join(map(str, p.default[:-1]))}]" for p in lists), "")


def _made(record: dict[str, Any]) -> str:
    commit = f"commit `{record['commit'][:10]}`" if record["commit"] else "sources outside git"
    if record["commit"] and record["uncommitted_changes"]:
        commit += " with uncommitted changes"
    versions = ", ".join(f"{name} {record['versions'][name]}" for name in ("python", "numpy", "scipy", "numba"))
    made = f"Computed {record['finished']} in {record['seconds']:.1f} s"
    return f"{made} from {commit} ({versions}; {record['processor']})."
