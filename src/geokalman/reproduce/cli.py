"""The command line: list, explain, run, compare and judge the notebooks of the book, and build it."""

from __future__ import annotations

import json
import os
import sys
import time
from pathlib import Path
from typing import Annotated

import typer

from geokalman import files
from geokalman.reproduce.errors import Fault

app = typer.Typer(
    help="Recompute, change and judge the notebooks of the book.", no_args_is_help=True, add_completion=False,
    pretty_exceptions_enable=False, rich_markup_mode=None,
)  # fmt: skip


def _root() -> Path:
    return files.project_root()


@app.callback()
def _options(
    root: Annotated[Path | None, typer.Option(help="Clone of the project (default: found upward from here).")] = None,
) -> None:
    if root is not None:
        os.environ["GEOKALMAN_ROOT"] = str(root.resolve())


@app.command("list")
def list_() -> None:
    """The notebooks of the book."""
    from geokalman.reproduce import notebooks

    root = _root()
    names = notebooks.names(root)
    for name in names:
        print(f"{name:<{max(map(len, names))}}  {notebooks.title(root, name)}")


@app.command()
def params(notebook: str, as_json: Annotated[bool, typer.Option("--json", help="As JSON.")] = False) -> None:
    """The parameters of a notebook: type, default, quick value, range, unit, help."""
    from geokalman.reproduce import parameters

    spec = parameters.load(_root(), notebook)
    if as_json:
        rows = [{"type": p.type, "range": p.range, "unit": p.unit, "default": p.default, "help": p.help} for p in spec.parameters.values()]
        print(json.dumps({"parameters": dict(zip(spec.parameters, rows, strict=True)), "quick": spec.quick}, indent=1))
        return
    from rich.table import Table

    table = Table("name", "type", "default", "quick", "range", "unit", "help", box=None, padding=(0, 2, 0, 0))
    for p in spec.parameters.values():
        quick = repr(spec.quick[p.name]) if p.name in spec.quick else ""
        unit = "" if p.is_path else p.unit
        table.add_row(*map(_plain, (p.name, p.type, repr(p.default), quick, p.range, unit, p.help)))
    _console().print(table)
    print(f"\nas in: geokalman run {notebook} {' '.join(f'{k}={v}' for k, v in list(spec.quick.items())[:1])}".rstrip())


@app.command()
def run(
    notebook: str,
    assignments: Annotated[list[str] | None, typer.Argument(metavar="[NAME=VALUE]...", help="Parameters; values are YAML.")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder of the run (default: under runs/).")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Start from the quick values.")] = False,
    threads: Annotated[int | None, typer.Option(min=1, help="Threads of the numerical libraries.")] = None,
) -> None:
    """Run a notebook with other parameters; the folder of the run is the last line printed."""
    from geokalman.reproduce import execute, parameters

    root = _root()
    given = parameters.load(root, notebook).parse(assignments or [], Path.cwd())
    folder = out if out is not None else execute.default_out(root, notebook, given, quick)
    start = time.perf_counter()
    with _status(notebook) as progress:
        folder = execute.run(root, notebook, given, out=folder, quick=quick, threads=threads, progress=progress)
    sys.stderr.write(f"{notebook} took {time.perf_counter() - start:.1f} s\n")
    print(folder)


class _status:
    """Cell k of n and the seconds on a terminal's standard error; silent elsewhere."""

    def __init__(self, name: str) -> None:
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

        columns = TextColumn("{task.description}"), BarColumn(), TextColumn("cell {task.completed} of {task.total}"), TimeElapsedColumn()
        self._progress = Progress(*columns, console=_console(stderr=True), transient=True, disable=not sys.stderr.isatty())
        self._task = self._progress.add_task(name, total=None)

    def __enter__(self):
        self._progress.start()
        return lambda k, n: self._progress.update(self._task, completed=k, total=n)

    def __exit__(self, *_: object) -> None:
        self._progress.stop()


def _console(stderr: bool = False):
    from rich.console import Console

    return Console(stderr=stderr, highlight=False, soft_wrap=False)


def _plain(text: str) -> str:
    from rich.markup import escape

    return escape(str(text))


def main() -> None:
    """Entry point of the command `geokalman`: faults are one sentence on standard error and an exit code."""
    try:
        app(standalone_mode=False)
    except (Fault, files.ProjectNotFound, files.CorruptedData) as error:
        _leave(str(error), getattr(error, "exit_code", 1))
    except KeyboardInterrupt:
        _leave("interrupted; what was finished stays", 130)
    except BrokenPipeError:  # the reader of our output went away, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(141)
    except typer.Exit as leave:
        sys.exit(leave.exit_code)
    except Exception as error:
        usage = getattr(error, "format_message", None)  # what click knows about wrong usage
        if usage is None:
            raise
        _leave(f"{usage()} (geokalman --help lists the commands)", 2)


def _leave(message: str, code: int) -> None:
    sys.stdout.flush()
    sys.stderr.write(f"geokalman: {message}\n")
    sys.exit(code)


if __name__ == "__main__":
    main()
