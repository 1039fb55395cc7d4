"""What the prose has filled in when the book is staged.

A block is called by a line `<!-- NAME -->` or `<!-- NAME: ARGUMENT -->`, a recorded number by
`[[<paper>/<notebook>:<key>]]` within a sentence.
"""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from geokalman.reproduce import claims, display, notebooks, reference
from geokalman.reproduce.errors import Fault

if TYPE_CHECKING:
    from nbformat import NotebookNode

_SHELVES = ("kalman", "physics", "geokalman")  # first in the list of the package; the applications follow
_LINE = re.compile(r"^<!--\s*([a-z-]+)\s*(?::\s*(\S+)\s*)?-->[ \t]*$", re.M)
_NUMBER = re.compile(r"\[\[([a-z0-9-]+/[a-z0-9-]+):([^\]\s]+)\]\]")


def fill(text: str, root: Path) -> str:
    """Replace each call of a block or number; raises Fault for a wrong number of arguments or an unknown number."""

    def block(match: re.Match[str]) -> str:
        name, argument = match.groups()
        if name not in BLOCKS:
            return match.group(0)  # an ordinary comment
        make, wanted = BLOCKS[name]
        if bool(argument) != bool(wanted):
            right = f"<!-- {name}: {wanted} -->" if wanted else f"<!-- {name} -->"
            raise Fault(f"{match.group(0).strip()} is no block; write {right}.")
        return f"\n{make(root, argument) if wanted else make(root)}\n"

    return _NUMBER.sub(lambda match: recorded_number(root, *match.groups()), _LINE.sub(block, text))


def recorded_number(root: Path, notebook: str, key: str) -> str:
    """A recorded number of this build with its unit, for a sentence; raises Fault where there is none of that name."""
    metrics = claims.recorded(root, notebook)
    if metrics is None or key not in metrics:
        there = ", ".join(metrics or {}) or "nothing yet"
        raise Fault(f"[[{notebook}:{key}]] names no recorded number; {notebook} records {there}.")
    return display.quantity(metrics[key]["value"], metrics[key]["unit"], 3)


def insert_own(notebook: NotebookNode, name: str, metrics: claims.Metrics, root: Path, lenient: bool) -> None:
    """Put the numbers that an executed notebook recorded into its own prose, so that the run reads well by itself.

    lenient   of a run with other parameters: a number that it did not record becomes a dash, and those of other
              notebooks are the book's. Else such calls stay for staging, which refuses what it cannot find.
    """

    def number(match: re.Match[str]) -> str:
        own = match[1] == name
        if not lenient and not (own and match[2] in metrics):
            return match[0]
        told = (metrics if own else claims.recorded(root, match[1]) or {}).get(match[2])
        return "–" if told is None or told["value"] is None else display.quantity(told["value"], told["unit"], 3)

    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            cell.source = _NUMBER.sub(number, cell.source)


def verdicts(root: Path, paper: str) -> str:
    """Table of all claims of a paper with their verdicts, numbered and captioned."""
    rows = [claims.row(judgement) for judgement in claims.judge_paper(root, paper)]
    caption = "Every number and claim that the paper prints, and what this build found."
    return f"```{{table}} {caption}\n:name: claims-{paper}\n\n{claims_table(claims.HEADER, rows)}\n```\n"


def claims_table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Claims in columns that fit a page: the reason of a verdict stands small below what the paper says."""
    shown = [name for name in header if name != "Why"]
    lines = [f"| {' | '.join(shown)} |", f"|{' --- |' * len(shown)}"]
    for row in rows:
        told = {name: _plain(text) for name, text in zip(header, row, strict=True)}
        if why := told.pop("Why", ""):
            told[shown[0]] += f"<br><small>{why}</small>"
        lines.append(f"| {' | '.join(told[name] for name in shown)} |")
    return "\n".join(lines)


def near_claims(root: Path) -> str:
    """Table of the claims whose number lies near a threshold, the nearest first."""
    rows = []
    found = [j for paper in claims.papers(root) for j in claims.judge_paper(root, paper) if j.is_near]
    for judged in sorted(found, key=lambda j: j.margin):
        says, _, ours, verdict, why = claims.row(judged)
        rows.append([says, ours, verdict, f"{100 * judged.margin:.2g} %", why])
    header = ["The paper says", "Ours", "Verdict", "Distance", "Why"]
    caption = f"Claims within {100 * claims.NEAR:g} % of the threshold that decides them."
    return f"```{{table}} {caption}\n:name: claims-near\n\n{claims_table(header, rows)}\n```\n"


def guards(root: Path) -> str:
    """Table of how many stored numbers and arrays are guarded by which kind of tolerance."""
    counts = reference.kinds(root)
    lines = [f"| {kind} | {counts[kind]['paper']} | {counts[kind]['quick']} |" for kind in sorted(counts)]
    return "\n".join(["| guarded by | papers' scale | quick scale |", "| --- | ---: | ---: |", *lines])


def _plain(text: str) -> str:
    """Text on one line (its no-break spaces kept) whose markup characters are harmless in a cell of a Markdown
    table."""
    return re.sub(r"([\\*_\[\]<>$|{}#~^`])", r"\\\1", re.sub(r"[ \t\r\n]+", " ", text))


def run_times(root: Path) -> str:
    """Table of the notebooks with the time that each took in this build, and the sum of each part."""
    rows: list[str] = []
    totals: dict[str, float] = {}
    for name in notebooks.names(root):
        path = root / "book" / "_build" / "runs" / name / "provenance.json"
        if path.is_file():
            seconds = json.loads(path.read_text(encoding="utf-8"))["seconds"]
            paper = name.partition("/")[0]
            totals[paper] = totals.get(paper, 0.0) + seconds
            rows.append(f"| {{doc}}`/{name}` | {seconds:.1f} |")
    sums = [f"| all of {{doc}}`/{paper}/index` | {total:.1f} |" for paper, total in totals.items()]
    whole = f"| the whole book | {sum(totals.values()):.1f} |"
    return "\n".join(["| notebook | seconds |", "| --- | ---: |", *rows, *sums, whole])


def api(root: Path) -> str:
    """The public functions and classes of the package, module by module: signature and first sentence."""
    package = root / "src" / "geokalman"
    parts: list[str] = []
    shelf = None
    for path in sorted(package.rglob("*.py"), key=_shelf):
        names = path.relative_to(package.parent).with_suffix("").parts
        tree = ast.parse(path.read_text(encoding="utf-8"))
        named = (n for n in tree.body if isinstance(n, ast.FunctionDef | ast.ClassDef) and n.name[0] != "_")
        public = [n for n in named if ast.get_docstring(n)]
        if public and "reproduce" not in names:
            if shelf != names[:-1]:
                shelf = names[:-1]
                parts += [f"## `{'.'.join(shelf)}`", ""]
            if names[-1] != "__init__":  # a rubric, so that the list of the page's sections stays short
                parts += [f"```{{rubric}} {'.'.join(names)}", ":heading-level: 3", "```", ""]
            parts += [_sentence(tree), ""]
            for node in public:
                parts += [f"`{_signature(node)}`", f": {_sentence(node)}", ""]
    return "\n".join(parts)


def _shelf(path: Path) -> tuple[int, Path]:
    """Place of a module in the list of the package."""
    folder = path.parent.name
    return (_SHELVES.index(folder) if folder in _SHELVES else len(_SHELVES), path)


def _signature(node: ast.FunctionDef | ast.ClassDef) -> str:
    if isinstance(node, ast.ClassDef):
        return f"class {node.name}"
    names = [a.arg for a in (*node.args.posonlyargs, *node.args.args)]
    if node.args.vararg:
        names.append(f"*{node.args.vararg.arg}")
    elif node.args.kwonlyargs:
        names.append("*")
    names += [a.arg for a in node.args.kwonlyargs]
    return f"{node.name}({', '.join(names)})"


def _sentence(node: ast.AST) -> str:
    """First sentence of a docstring, its markup characters outside of `code` made harmless."""
    text = " ".join((ast.get_docstring(node) or "").split("\n\n")[0].split())
    text = re.split(r"(?<=[.!?])\s+(?=[A-Z`])", text)[0]
    plain = re.sub(r"``?([^`]+)``?", r"`\1`", text).split("`")
    return "`".join(part if k % 2 else _plain(part) for k, part in enumerate(plain))


BLOCKS: dict[str, tuple[Callable[..., str], str]] = {
    "verdicts": (verdicts, "PAPER"),
    "verdict-summary": (claims.summary_markdown, ""),
    "near-claims": (near_claims, ""),
    "guards": (guards, ""),
    "run-times": (run_times, ""),
    "api": (api, ""),
}
"""Name -> what makes it, and the name of its argument, if it has one."""
