"""The command line: list, explain, run, compare and judge the notebooks of the book, and build it."""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from geokalman import files
from geokalman.reproduce import interrupt
from geokalman.reproduce.errors import Fault, is_plain

if TYPE_CHECKING:
    from rich.console import Console

_WIDE = 120  # characters of a line of text, at most
_LONG = 16  # characters of a cell that its column does not grow for
app = typer.Typer(
    help="Recompute, change and judge the notebooks of the book.", no_args_is_help=True, add_completion=False,
    pretty_exceptions_enable=False, rich_markup_mode=None,
)  # fmt: skip


def _root() -> Path:
    root = files.project_root()
    if not is_plain(str(root)):
        raise Fault(f"The clone's path {str(root)!r} has a control character or bytes that are no UTF-8; rename it.")
    return root


@app.callback()
def _options(
    root: Annotated[Path | None, typer.Option(help="Clone of the project (default: found upward from here).")] = None,
) -> None:
    if root is not None:
        os.environ["GEOKALMAN_ROOT"] = str(root.resolve())


@app.command("list")
def list_() -> None:
    """The notebooks of the book."""
    from geokalman.reproduce import contents, notebooks

    root = _root()
    names = notebooks.names(root)
    for name in names:
        print(f"{name:<{max(map(len, names))}}  {contents.title(root, name)}")


@app.command()
def params(notebook: str, as_json: Annotated[bool, typer.Option("--json", help="As JSON.")] = False) -> None:
    """The parameters of a notebook: type, default, quick value, range, unit, help."""
    from geokalman.reproduce import parameters

    spec = parameters.load(_root(), notebook)
    if as_json:
        rows = [
            {"type": p.type, "range": p.range, "unit": p.unit, "default": p.default, "help": p.help}
            for p in spec.parameters.values()
        ]
        print(json.dumps({"parameters": dict(zip(spec.parameters, rows, strict=True)), "quick": spec.quick}, indent=1))
        return
    header = ("name", "type", "default", "quick", "range", "unit", "help")
    rows = []
    for p in spec.parameters.values():
        quick = repr(spec.quick[p.name]) if p.name in spec.quick else ""
        rows.append((p.name, p.type, repr(p.default), quick, p.range, "" if p.is_path else p.unit, p.help))
    console = _console()
    if sum(max(map(len, column)) + 2 for column in zip(header, *rows, strict=True)) > console.width:
        _print_narrow([header[:-1], *(row[:-1] for row in rows)], ["", *(row[-1] for row in rows)], console.width)
    else:
        _print_table(console, header, rows)
    print(f"\nas in: geokalman run {notebook} {' '.join(f'{k}={v}' for k, v in list(spec.quick.items())[:1])}".rstrip())


@app.command()
def run(
    notebook: str,
    assignments: Annotated[
        list[str] | None, typer.Argument(metavar="[NAME=VALUE]...", help="Parameters; values are YAML.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder of the run (default: under runs/).")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Start from the quick values.")] = False,
    threads: Annotated[
        int, typer.Option(min=1, help="Threads of the numerical libraries; the book's numbers are those of one.")
    ] = 1,
) -> None:
    """Run a notebook with other parameters; the folder of the run is the last line printed."""
    from geokalman.reproduce import execute, parameters, runfolder
    from geokalman.reproduce.progress import Display

    root = _root()
    given = parameters.load(root, notebook).parse(assignments or [], Path.cwd())
    folder = runfolder.chosen(out if out is not None else execute.default_out(root, notebook, given, quick), root)
    runfolder.refuse_foreign(folder)
    with Display() as display, display.notebook(notebook) as progress:
        folder = execute.run(root, notebook, given, out=folder, quick=quick, threads=threads, progress=progress)
        for note in execute.notes(folder):
            display.say(note)
    print(folder)


@app.command()
def claims(
    paper: Annotated[str | None, typer.Argument(help="A paper (default: all).")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="As JSON, a list of claims.")] = False,
    readme: Annotated[bool, typer.Option("--readme", help="Write the summary into README.md.")] = False,
    near: Annotated[bool, typer.Option("--near", help="Only claims within 2 % of a threshold.")] = False,
) -> None:
    """The ledger: what each paper prints, our number, and the verdict."""
    from geokalman.reproduce import atomic, claims, contents

    root = _root()
    if readme:
        atomic.write_text(root / "README.md", claims.readme_with_block(root))
    wanted = [paper] if paper else claims.papers(root)
    if as_json:
        print(json.dumps([entry for p in wanted for entry in claims.as_json(root, p)], indent=1, ensure_ascii=False))
        return
    width = min(_console().width, _WIDE)
    for name in wanted:
        judgements = [j for j in claims.judge_paper(root, name) if not near or j.is_near]
        print(f"{contents.title(root, name + '/index')}\n")
        for judgement in judgements:
            says, printed, ours, verdict, why = claims.row(judgement)
            if not judgement.as_expected:
                verdict += f" (expected {judgement.claim.verdict})"
            print(f"{judgement.claim.id}: {verdict}")
            distance = f"{100 * judgement.margin:.2g} % from its threshold" if judgement.is_near else ""
            numbers = "; ".join(f"{word} {text}" for word, text in (("printed", printed), ("ours", ours)) if text)
            for text in filter(None, (says, numbers, distance, why)):
                print(_indented(text, width))


@app.command()
def build(
    workers: Annotated[int, typer.Option(min=1, help="Notebooks executed at a time.")] = 2,
    html: Annotated[bool, typer.Option(help="Make the pages too.")] = True,
) -> None:
    """Execute what changed, at paper scale, and make the book."""
    from geokalman.reproduce import graph

    start = time.perf_counter()
    outcome = graph.build(_root(), workers, html)
    sys.stderr.write(
        f"{len(outcome.executed)} executed, {len(outcome.fresh)} up to date, {len(outcome.failed)} failed, "
        f"{time.perf_counter() - start:.1f} s\n"
    )
    for message in outcome.failed:
        sys.stderr.write(f"{message}\n")
    if outcome.failed:
        raise typer.Exit(1)
    if outcome.book:
        print(outcome.book / "index.html")


@app.command()
def compare(
    run: Annotated[str, typer.Argument(metavar="RUN", help="Folder of a run, or a notebook (the book's run of it).")],
    other: Annotated[
        str | None, typer.Argument(metavar="[RUN]", help="Another (default: the book's, else the reference).")
    ] = None,
    strict: Annotated[
        bool, typer.Option("--strict", help="Exit with 1 where a number differs by more than --rel.")
    ] = False,
    rel: Annotated[float, typer.Option(min=0, help="Relative difference that --strict accepts.")] = 1e-9,
    out: Annotated[
        Path | None, typer.Option(help="Folder of the page with overlaid figures (default: compare/ in the first run).")
    ] = None,
) -> None:
    """Two runs side by side: numbers with differences, and a page with the figures overlaid, named last."""
    from geokalman.reproduce import compare as comparing
    from geokalman.reproduce import runfolder

    root = _root()
    left = comparing.resolve(root, run, Path.cwd())
    page = runfolder.chosen(out, root) if out is not None else left / "compare"
    found = comparing.compare(root, left, comparing.resolve(root, other, Path.cwd()) if other else None)
    print(f"left:  {found.left}\nright: {found.right}")
    for name, a, b in found.parameters:
        print(f"  {name}: {a!r} | {b!r}")
    _print_table(_console(), comparing.HEADER, [comparing.texts(row) for row in found.rows])
    moved = comparing.moved(found, rel)
    sys.stderr.write(f"{len(moved)} of {len(found.rows)} differ by more than {rel:g} (relative)\n")
    print(comparing.write_page(found, page))
    if strict and moved:
        raise typer.Exit(1)


@app.command()
def check() -> None:
    """Hold the paper-scale results against references, anchors, expected verdicts and README."""
    from geokalman.reproduce import check as checking

    report = checking.check(_root())
    for problem in report.problems:
        sys.stderr.write(f"{problem}\n")
    print(
        f"{report.numbers} stored numbers, {report.anchors} anchors, {report.claims} claims "
        f"({report.near} near a threshold): {len(report.problems)} problems"
    )
    if report.problems:
        raise typer.Exit(1)


@app.command()
def reference(
    reason: Annotated[str, typer.Option(help="Why the numbers move; it goes into CHANGELOG.md.")] = "",
    notebook: Annotated[list[str] | None, typer.Argument(metavar="[NB]...", help="Notebooks (default: all).")] = None,
    quick: Annotated[bool, typer.Option(help="Renew the quick references too (executes the quick notebooks).")] = True,
) -> None:
    """Renew the stored references from the book's runs and from runs in other computing settings; show what moved."""
    from geokalman.reproduce import renewal

    moved = renewal.renew(_root(), reason, notebook or None, quick)
    print(f"{moved} numbers moved or are new")


@app.command()
def portable(
    notebook: Annotated[list[str] | None, typer.Argument(metavar="[NB]...", help="Notebooks (default: all).")] = None,
    quick: Annotated[bool, typer.Option(help="At the quick scale too.")] = True,
) -> None:
    """Compute notebooks in every setting of this machine and widen the stored spreads to what is seen."""
    from geokalman.reproduce import renewal

    print(f"{renewal.widen(_root(), notebook or None, quick)} numbers beyond their tolerance so far")


@app.command()
def setting(name: Annotated[str, typer.Argument(help="native, avx2 or no-fma.")]) -> None:
    """Print a computing setting as environment variables: env $(geokalman setting no-fma) make check."""
    from geokalman.reproduce import settings

    print(" ".join(f"{key}={value}" for key, value in settings.environment(name).items()))


@app.command("notebooks")
def notebooks_(force: Annotated[bool, typer.Option("--force", help="Overwrite edited twins.")] = False) -> None:
    """Write plain .ipynb twins beside the sources, for papermill and Jupyter."""
    from geokalman.reproduce import twins

    for path in twins.write(_root(), force):
        print(path)


def _console() -> Console:
    from rich.console import Console

    console = Console(highlight=False)
    return console if console.is_terminal or "COLUMNS" in os.environ else Console(highlight=False, width=200)


def _print_table(console: Console, header: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    from rich.markup import escape
    from rich.table import Table

    table = Table(*header, box=None, padding=(0, 2, 0, 0))
    for row in rows:
        table.add_row(*map(escape, row))
    console.print(table)


def _print_narrow(rows: Sequence[Sequence[str]], below: Sequence[str], width: int) -> None:
    """Rows in aligned columns, out of line where a cell is long, with a text of its own below each."""
    widths = [max(len(cell) for cell in column if len(cell) <= _LONG) for column in zip(*rows, strict=True)]
    for row, text in zip(rows, below, strict=True):
        line = "  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip()
        print(line if len(line) <= width else _indented("  ".join(filter(None, row)), width).strip())
        if text:
            print(_indented(text, width))


def _indented(text: str, width: int) -> str:
    import textwrap

    look = {"initial_indent": "    ", "subsequent_indent": "    ", "break_long_words": False, "break_on_hyphens": False}
    return textwrap.fill(text, width, **look)


def main() -> None:
    """Entry point of the command `geokalman`: faults are one sentence on standard error and an exit code."""
    os.environ.setdefault("MPLBACKEND", "agg")  # nothing is shown, and windows want the main thread
    message, code = interrupt.attended(_outcome)
    sys.stdout.flush()
    if message:
        sys.stderr.write(f"{message if message.startswith('Usage') else f'geokalman: {message}'}\n")
    sys.exit(code)


def _outcome() -> tuple[str, int]:
    """Run the command; gives what remains to be said and the exit code."""
    try:
        code = app(prog_name="geokalman", standalone_mode=False)  # gives the code of typer.Exit
        sys.stdout.flush()
    except (Fault, files.ProjectNotFound, files.CorruptedData) as error:
        return str(error), getattr(error, "exit_code", 1)
    except BrokenPipeError:  # the reader of our output went away, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return "", 141
    except Exception as error:
        usage = getattr(error, "format_message", None)  # what click knows about wrong usage
        if usage is None:
            raise
        text = usage()
        return text if "\n" in text else f"{text} (geokalman --help lists the commands)", 2
    return "", code or 0


if __name__ == "__main__":
    main()
