"""The command line: list, explain, run, compare and judge notebooks, and build the book.

`app` is the command, to which a project may add its own; `main` runs it under the project's name.
"""

from __future__ import annotations

import json
import os
import shlex
import sys
import textwrap
import time
from pathlib import Path
from typing import Annotated

import typer

from execbook import interrupt, project
from execbook.errors import Fault

_WIDE = 120  # characters of a line of text, at most
_home: list[Path] = []
app = typer.Typer(
    help="Recompute, change and judge the notebooks of the book.", no_args_is_help=True, add_completion=False,
    pretty_exceptions_enable=False, rich_markup_mode=None,
)  # fmt: skip
AsJson = Annotated[bool, typer.Option("--json", help="As JSON.")]
Notebooks = Annotated[list[str] | None, typer.Argument(metavar="[NB]...", help="Notebooks (default: all).")]


def root() -> Path:
    """Find the project that the command works on."""
    return project.root(home=_home[0] if _home else None)


@app.callback()
def _options(
    root: Annotated[Path | None, typer.Option(help="Clone of the project (default: found upward from here).")] = None,
) -> None:
    if root is not None:
        os.environ[project.ROOT] = str(root.resolve())


@app.command("list")
def list_() -> None:
    """The notebooks of the book."""
    from execbook import contents, notebooks

    names = notebooks.names(root())
    for name in names:
        print(f"{name:<{max(map(len, names))}}  {contents.title(root(), name)}")


@app.command()
def params(notebook: str, as_json: AsJson = False) -> None:
    """The parameters of a notebook: type, default, quick value, range, unit, help."""
    from execbook import display, notebooks, parameters

    spec = parameters.load(root(), notebooks.name_of(root(), notebook))
    if as_json:
        rows = [
            {"type": p.type, "range": p.range, "unit": p.unit, "default": p.default, "help": p.help}
            for p in spec.parameters.values()
        ]
        print(json.dumps({"parameters": dict(zip(spec.parameters, rows, strict=True)), "quick": spec.quick}, indent=1))
        return
    rows = []
    for p in spec.parameters.values():
        quick = repr(spec.quick[p.name]) if p.name in spec.quick else ""
        rows.append([p.name, p.type, repr(p.default), quick, p.range, "" if p.is_path else p.unit, p.help])
    print(display.table(["name", "type", "default", "quick", "range", "unit", "help"], rows))
    example = " ".join(shlex.quote(f"{k}={v}") for k, v in list(spec.quick.items())[:1])
    print(f"\nas in: {project.read(root()).command} run {spec.notebook} {example}".rstrip())


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
    from execbook import execute, notebooks, parameters, runfolder
    from execbook.progress import Display

    here = root()
    notebook = notebooks.name_of(here, notebook)
    given = parameters.load(here, notebook).parse(assignments or [], Path.cwd())
    folder = runfolder.chosen(out if out is not None else execute.default_out(here, notebook, given, quick), here)
    runfolder.refuse_foreign(folder)
    with Display() as display, display.notebook(notebook) as progress:
        folder = execute.run(here, notebook, given, out=folder, quick=quick, threads=threads, progress=progress)
        for note in runfolder.provenance(folder)["notes"]:
            display.say(note)
    print(folder)


@app.command()
def multiverse(
    paper: str,
    size: Annotated[int | None, typer.Option(min=1, help="Number of worlds (default: the book's).")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder of the run (default: under runs/).")] = None,
) -> None:
    """Judge a paper's claims in more readings of it: a share for each claim, and the choice that decides."""
    from execbook import multiverse

    multiverse.choices(root(), paper)  # refuse before a run
    run(f"{paper}/{multiverse.READINGS}", [] if size is None else [f"size={size}"], out)


@app.command()
def claims(
    paper: Annotated[str | None, typer.Argument(help="A paper (default: all).")] = None,
    as_json: AsJson = False,
    readme: Annotated[bool, typer.Option("--readme", help="Write the summary into README.md.")] = False,
    near: Annotated[bool, typer.Option("--near", help="Only claims near a threshold.")] = False,
) -> None:
    """The ledger: what each paper prints, our number, and the verdict."""
    from execbook import atomic, claims, contents, verdicts

    here = root()
    if readme:
        atomic.write_text(here / "README.md", verdicts.readme_with_block(here))
    wanted = [paper] if paper else claims.papers(here)
    if as_json:
        found = [entry for p in wanted for entry in verdicts.as_json(here, p)]
        print(json.dumps(found, indent=1, ensure_ascii=False))
        return
    judged = {name: claims.judge_paper(here, name) for name in wanted}
    for name, judgements in judged.items():
        print(f"{contents.title(here, name + '/index')}\n")
        for judgement in judgements:
            if judgement.is_near or not near:
                _print_claim(judgement)
    verdicts = [j.holds for judgements in judged.values() for j in judgements if j.claim.metrics]
    if missing := verdicts.count(None):
        what = "Nothing has been" if missing == len(verdicts) else f"{missing} of {len(verdicts)} claims are not"
        sys.stderr.write(f"{what} computed yet; make book computes what is missing.\n")


def _print_claim(judgement) -> None:
    from execbook import verdicts

    says, printed, ours, outcome, why = verdicts.row(judgement)
    expected = "" if judgement.as_expected else f" (expected {judgement.claim.expected})"
    print(f"{judgement.claim.id}: {outcome}{expected}")
    margin = f"{100 * (judgement.margin or 0.0):.2g} % from its threshold"
    distance = ("share within its error of a limit" if judgement.share else margin) if judgement.is_near else ""
    numbers = "; ".join(f"{word} {text}" for word, text in (("printed", printed), ("ours", ours)) if text)
    width = min(int(os.environ.get("COLUMNS") or _WIDE), _WIDE)
    for text in filter(None, (says, numbers, distance, why)):
        indent = {"initial_indent": "    ", "subsequent_indent": "    "}
        print(textwrap.fill(text, width, **indent, break_long_words=False, break_on_hyphens=False))


@app.command()
def build(
    workers: Annotated[int, typer.Option(min=1, help="Notebooks executed at a time.")] = 2,
    html: Annotated[bool, typer.Option(help="Make the pages too.")] = True,
) -> None:
    """Execute what changed, at paper scale, and make the book."""
    from execbook import graph

    start = time.perf_counter()
    outcome = graph.build(root(), workers, html)
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
        Path | None, typer.Option(help="Folder of the page with overlaid figures (default: the first run).")
    ] = None,
) -> None:
    """Two runs side by side: numbers, and a page with the figures overlaid, named last."""
    from execbook import compare, runfolder

    here = root()
    left = compare.resolve(here, run, Path.cwd())
    folder = runfolder.chosen(out, here) if out is not None else left
    found = compare.compare(here, left, compare.resolve(here, other, Path.cwd()) if other else None)
    print("\n".join(filter(None, [found.note, f"left:  {found.left}", f"right: {found.right}"])))
    for name, a, b in found.parameters:
        print(f"  {name}: {a!r} | {b!r}")
    print(compare.table(found))
    moved = compare.moved(found, rel)
    sys.stderr.write(f"{len(moved)} of {len(found.rows)} differ by more than {rel:g} (relative)\n")
    print(compare.write_page(found, folder))
    if strict and moved:
        raise typer.Exit(1)


@app.command()
def check() -> None:
    """Hold the paper-scale results against references, anchors, expected verdicts and README."""
    from execbook import check

    report = check.check(root())
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
    notebook: Notebooks = None,
    quick: Annotated[bool, typer.Option(help="Renew the quick references too (executes the quick notebooks).")] = True,
) -> None:
    """Renew the stored references from runs in all computing settings; show what moved."""
    from execbook import notebooks, renewal

    named = [notebooks.name_of(root(), word) for word in notebook or []]
    print(f"{renewal.renew(root(), reason, named or None, quick)} numbers moved or are new")


@app.command()
def portable(
    notebook: Notebooks = None,
    quick: Annotated[bool, typer.Option(help="At the quick scale too.")] = True,
) -> None:
    """Widen the stored spreads to what is seen in every computing setting of this machine."""
    from execbook import notebooks, renewal

    named = [notebooks.name_of(root(), word) for word in notebook or []]
    print(f"{renewal.widen(root(), named or None, quick)} numbers beyond their tolerance so far")


@app.command()
def setting(name: Annotated[str, typer.Argument(help="native, avx2 or no-fma.")]) -> None:
    """Print a computing setting as environment variables, for `env`."""
    from execbook import settings

    print(" ".join(f"{key}={value}" for key, value in settings.environment(name).items()))


@app.command("notebooks")
def notebooks_(force: Annotated[bool, typer.Option("--force", help="Overwrite edited twins.")] = False) -> None:
    """Write plain .ipynb twins beside the sources, for papermill and Jupyter."""
    from execbook import notebooks

    for path in notebooks.write_twins(root(), force):
        print(path)


def main(name: str, home: Path | None = None) -> None:
    """Run the command; faults are one sentence on standard error and an exit code.

    home: the project where none is found upward from the working directory
    """
    _home[:] = filter(None, [home])
    os.environ.setdefault("MPLBACKEND", "agg")  # nothing is shown, and windows want the main thread
    message, code = interrupt.attended(lambda: _outcome(name), name)
    sys.stdout.flush()
    if message:
        sys.stderr.write(f"{message if message.startswith('Usage') else f'{name}: {message}'}\n")
    sys.exit(code)


def _outcome(name: str) -> tuple[str, int]:
    """Run the command; gives what remains to be said and the exit code."""
    try:
        code = app(prog_name=name, standalone_mode=False)  # gives the code of typer.Exit
        sys.stdout.flush()
    except Fault as error:
        return str(error), error.exit_code
    except BrokenPipeError:  # the reader of our output went away, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return "", 141
    except Exception as error:
        usage = getattr(error, "format_message", None)  # what click knows about wrong usage
        if usage is None:
            raise
        text = usage()
        return text if "\n" in text else f"{text} ({name} --help lists the commands)", 2
    return "", code or 0
