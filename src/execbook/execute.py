"""Run one notebook, with checked parameters, into a run folder that appears whole."""

from __future__ import annotations

import contextlib
import hashlib
import html
import json
import re
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from filelock import FileLock

from execbook import (
    atomic,
    blocks,
    children,
    notebooks,
    parameters,
    progress,
    project,
    record,
    runfolder,
    settings,
    sockets,
)
from execbook.errors import Fault
from execbook.html import page_of_run

if TYPE_CHECKING:
    from nbclient.exceptions import CellExecutionError
    from nbformat import NotebookNode

_THREADS = (
    "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS", "NUMBA_NUM_THREADS",
)  # fmt: skip
_ANSI = re.compile(r"\x1b\[[0-9;]*m")


class _Job(NamedTuple):
    """One execution: the notebook with its values, where it goes, and how it is computed."""

    root: Path
    name: str
    source: NotebookNode
    values: dict[str, Any]
    out: Path
    variables: dict[str, str]
    progress: progress.Progress | None


def run(
    root: Path, name: str, given: Mapping[str, Any] | None = None, *, out: Path, quick: bool = False, page: bool = True,
    threads: int = 1, setting: str = settings.NATIVE, progress: progress.Progress | None = None,
    key: str = "", replace: bool = False,
) -> Path:  # fmt: skip
    """Execute a notebook into the folder `out`, replaced only by a whole one; returns `out`.

    given     parameter values; a path among them is relative to the working directory
    quick     start from the values of the cell tagged `quick` in place of the paper's
    page      write `page.html`, the run as one self-contained page
    threads   threads of the numerical libraries; more than one sum in another order, which moves last digits
    setting   computing setting, by name
    key       hash of what the run comes from, kept in provenance.json beside the SHA-256 of every file of the run
    replace   remove whatever stands in `out`: the folder is the book's own
    Raises Misuse for wrong parameters or an `out` that holds other things; Fault where a cell raises: then
    `<out>.failed.ipynb` has the traceback and what stood in `out` stays.
    """
    source = notebooks.read(root, name)
    specification = parameters.specification(source, name)
    values = dict(specification.quick) if quick else {}
    values |= specification.check(given or {})
    out = Path(out).resolve()
    variables = settings.environment(setting) | {variable: str(threads) for variable in _THREADS}
    with atomic.explained(out):
        out.parent.mkdir(parents=True, exist_ok=True)
    sweep_runs(root)
    # One writer of `out`: what another left unfinished there can be cleared.
    with atomic.locked(_lock_of(root, out)), children.busy():
        if not replace:
            runfolder.refuse_foreign(out)
        with atomic.explained(out):
            atomic.sweep(out.parent, out.name)
            work = Path(tempfile.mkdtemp(prefix=f".{out.name}.partial-", dir=out.parent))
        try:
            _run_in(work, _Job(root, name, source, values, out, variables, progress), page, key)
        except Fault as error:  # readers know where the run was to stand, not where it was made
            error.args = (str(error).replace(str(work / "run"), str(out)),)
            raise
        finally:
            shutil.rmtree(work, ignore_errors=True)
    return out


def _run_in(work: Path, job: _Job, page: bool, key: str) -> None:
    """Execute in the folder `work`, and put the finished run into its place."""
    made, failed = work / "run", job.out.with_name(f"{job.out.name}.failed.ipynb")
    with sockets.folder() as talk:
        executed, stopped = _execute(job, made, work, talk)
    notebooks.tidy(executed, job.name)
    if stopped:
        message = f"FAILED {job.name}: {stopped}"
        with contextlib.suppress(Fault):  # where even this cannot be written, the error itself is what matters
            notebooks.write(failed, executed)
            message += f"\n  traceback: {failed}"
        raise Fault(message)
    told = runfolder.provenance(made)
    if told is None:
        raise Fault(f"FAILED {job.name}: it ended without nb.finish(), so nothing is recorded.")
    changed = parameters.specification(job.source, job.name).changed(told["parameters"])
    metrics = json.loads((made / "metrics.json").read_text(encoding="utf-8"))
    for cell in executed.cells:
        if cell.cell_type == "markdown":
            cell.source = blocks.fill_own(cell.source, job.root, job.name, metrics, lenient=bool(changed))
    if changed:
        _warn_of(changed, executed)
    notebooks.write(made / "notebook.ipynb", executed)
    if page:
        atomic.write_text(made / "page.html", page_of_run(job.root, job.name, made))
    told |= {"key": key, "files": atomic.digests(made, "provenance.json")}
    atomic.write_json(made / "provenance.json", told)
    atomic.swap_folder(made, job.out)
    failed.unlink(missing_ok=True)


def sweep_runs(root: Path) -> None:
    """Clear what killed runs left in `runs/`; a run that lives holds its lock."""
    for folder in (root / "runs").glob("*/*"):
        for name in atomic.unfinished(folder):
            with contextlib.suppress(OSError), FileLock(_lock_of(root, folder / name), timeout=0):
                atomic.sweep(folder, name)


def _lock_of(root: Path, out: Path) -> Path:
    return root / ".cache" / "locks" / f"{hashlib.sha256(str(out.resolve()).encode()).hexdigest()[:16]}.lock"


def default_out(root: Path, name: str, given: Mapping[str, Any], quick: bool) -> Path:
    """Give `runs/<paper>/<notebook>/<what was asked>`, such as `quick+days=5.0`."""
    text = "+".join(["quick"] * quick + [f"{key}={value}" for key, value in sorted(given.items())]) or "paper"
    plain = re.sub(r"[^A-Za-z0-9=+.,_-]+", "-", text).strip("-")
    if plain != text or len(plain) > 80:
        plain = f"{plain[:70]}-{hashlib.sha256(text.encode()).hexdigest()[:6]}"
    return root / "runs" / name / plain


def _execute(job: _Job, made: Path, work: Path, talk: Path) -> tuple[NotebookNode, str]:
    """Give the executed notebook, and why it stopped where it did before its end."""
    from nbclient import NotebookClient
    from nbclient.exceptions import CellExecutionError
    from papermill.iorw import load_notebook_node
    from papermill.parameterize import parameterize_notebook

    from execbook import kernels

    shared = {
        "PYTHONHASHSEED": "0",
        "MPLBACKEND": "module://matplotlib_inline.backend_inline",
        "PYDEVD_DISABLE_FILE_VALIDATION": "1",
        **job.variables,
    }
    own = {
        project.ROOT: str(job.root),
        record.OUT: str(made),
        progress.VARIABLE: str(talk / "report"),
        "IPYTHONDIR": str(work / "ipython"),  # nobody's start-up files
    }
    ended = contextlib.ExitStack()
    # papermill puts the parameters in, but does not execute: it formats paths, which {} in them does not survive, and
    # changes the working directory of the whole process, where another notebook may be running.
    notebook = load_notebook_node(job.source)
    if job.values:
        notebook = parameterize_notebook(notebook, job.values, kernel_name="python3", language="python")
    index = {id_: k for k, id_ in enumerate(c["id"] for c in job.source.cells if c.cell_type == "code")}

    def started(cell: NotebookNode, cell_index: int) -> None:
        if job.progress and cell.cell_type == "code":
            job.progress(index.get(cell.get("id"), 0) + 1, len(index), talk / "report")

    place = {"transport": "ipc", "ip": str(talk / "s"), "connection_file": str(work / "kernel.json")}
    manager = kernels.Kernel(shared, own, project.read(job.root).preload, ended, **place)
    client = NotebookClient(
        notebook, km=manager, on_cell_start=started, coalesce_streams=True,
        resources={"metadata": {"path": str((job.root / "book" / job.name).parent)}},
        startup_timeout=900, iopub_timeout=120, raise_on_iopub_timeout=True,
    )  # fmt: skip
    try:
        with ended, client.setup_kernel(cleanup_kc=True):
            stopped = ""
            try:
                for k, cell in enumerate(notebook.cells):
                    client.execute_cell(cell, k)
            except CellExecutionError as error:
                stopped = _explain(cell, error)
            told = client.wait_for_reply(client.kc.kernel_info())
            notebook.metadata["language_info"] = told["content"]["language_info"]
        return notebook, stopped
    except RuntimeError as error:  # nbclient's DeadKernelError is one
        why = f"the kernel stopped ({error}); if nobody stopped it, memory ran out: give smaller sizes."
        raise Fault(f"FAILED {job.name}: {why}") from error
    except OSError as error:
        with atomic.explained(job.out):
            raise error


def _warn_of(changed: Mapping[str, Any], notebook: NotebookNode) -> None:
    """Say above a run which parameters differ from the paper's, in HTML for every viewer."""
    from nbformat.v4 import new_markdown_cell

    told = html.escape(", ".join(f"{name}={value}" for name, value in changed.items()))
    words = (
        f'<aside class="changed"><p>This run differs from the paper\'s set-up: <code>{told}</code>. '
        "The words around the numbers describe the paper's run.</p></aside>"
    )
    notebook.cells.insert(0, new_markdown_cell(words, id="changed"))


def _explain(cell: NotebookNode, error: CellExecutionError) -> str:
    """Say where and why a cell stopped, with the line of its own code."""
    said = _ANSI.sub("", error.evalue)
    text = f"cell [{cell.execution_count}]: {error.ename}: {said}"
    if error.ename in ("MemoryError", "_ArrayMemoryError"):
        text = f"cell [{cell.execution_count}]: memory ran out{f' ({said})' if said else ''}; give smaller sizes."
    arrow = re.search(r"^-+> ?(\d+) (.*)$", _ANSI.sub("", error.traceback), re.M)
    lines = cell.source.splitlines()
    if arrow and 0 < int(arrow[1]) <= len(lines) and lines[int(arrow[1]) - 1].strip() == arrow[2].strip():
        text += f"\n  line {arrow[1]}: {arrow[2].strip()}"
    return text
