"""What the prose has filled in when the book is staged.

A block is called by a line `<!-- NAME -->` or `<!-- NAME: ARGUMENT -->`, a recorded number by
`[[<paper>/<notebook>:<key>]]` within a sentence.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from execbook import claims, contents, display, ledger, notebooks, reference, runfolder, sources, verdicts
from execbook.errors import Fault

_LINE = re.compile(r"^<!--\s*([a-z-]+)\s*(?::\s*(\S+)\s*)?-->[ \t]*$", re.M)
_NUMBER = re.compile(r"\[\[([a-z0-9-]+/[a-z0-9-]+):([^\]\s]+)\]\]")


def fill(text: str, root: Path) -> str:
    """Replace each call of a block or number; raises Fault for one that is wrong or unknown."""

    def block(match: re.Match[str]) -> str:
        name, argument = match.groups()
        if name not in BLOCKS:
            return match[0]  # an ordinary comment
        make, wanted = BLOCKS[name]
        if bool(argument) != bool(wanted):
            right = f"<!-- {name}: {wanted} -->" if wanted else f"<!-- {name} -->"
            raise Fault(f"{match[0].strip()} is no block; write {right}.")
        return f"\n{make(root, argument) if wanted else make(root)}\n"

    def number(match: re.Match[str]) -> str:
        metrics = claims.recorded(root, match[1]) or {}
        if match[2] not in metrics:
            there = ", ".join(metrics) or "nothing yet"
            raise Fault(f"{match[0]} names no recorded number; {match[1]} records {there}.")
        return _quantity(metrics[match[2]])

    return _NUMBER.sub(number, _LINE.sub(block, text))


def fill_own(text: str, root: Path, name: str, metrics: claims.Metrics, lenient: bool) -> str:
    """Put the numbers that the notebook `name` recorded into its own prose.

    lenient   a number that it did not record becomes a dash, and those of other notebooks are the book's; else such
              calls stay for staging, which refuses what it cannot find.
    """

    def number(match: re.Match[str]) -> str:
        own = match[1] == name
        if not lenient and not (own and match[2] in metrics):
            return match[0]
        return _quantity((metrics if own else claims.recorded(root, match[1]) or {}).get(match[2]))

    return _NUMBER.sub(number, text)


def _quantity(entry: Mapping[str, Any] | None) -> str:
    return "–" if entry is None or entry["value"] is None else display.quantity(entry["value"], entry["unit"], 3)


def table_directive(caption: str, label: str, table: str) -> str:
    """Give a Markdown table with a caption, to which {numref} can refer by its label."""
    return f"```{{table}} {caption}\n:name: {label}\n\n{table}\n```\n"


def claims_table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Give claims in columns that fit a page: a reason stands small below what the paper says."""
    shown, lines = [name for name in header if name != "Why"], []
    for row in rows:
        told = dict(zip(header, map(verdicts.escaped, row), strict=True))
        if why := told.pop("Why", ""):
            told[shown[0]] += f"<br><small>{why}</small>"
        lines.append(list(told.values()))
    return display.markdown_table(shown, lines)


def _verdicts(root: Path, paper: str) -> str:
    """Show the claims of a paper, then our controls, then the errata that its ledger holds."""
    parts = []
    for kind, caption in _KINDS.items():
        table, rows = verdicts.entries_table(root, paper, lambda claim, kind=kind: claim.kind == kind)
        if rows:
            parts.append(table_directive(caption, f"{kind}s-{paper}", table))
    if errata := [claim for claim in claims.ledger(root, paper) if claim.kind == "erratum"]:
        rows = [
            [f"{c.where}: {verdicts.escaped(c.says)}", f"{{math}}`{c.text}`", f"{{math}}`{c.should}`"] for c in errata
        ]
        table = display.markdown_table(["Where", "In the text we have", "Should read"], rows)
        parts.append(table_directive("Formulas that cannot stand as they are.", f"errata-{paper}", table))
    return "\n".join(parts)


def _verdicts_of(root: Path, page: str) -> str:
    """Show the entries that the numbers of one notebook alone decide."""
    table, rows = verdicts.entries_table(root, page.partition("/")[0], lambda c: c.notebooks == [page], page)
    caption = "What the paper prints, how we read it, our number, and the verdict."
    return table_directive(caption, verdicts.label_of(page), table) if rows else ""


def _all_claims(root: Path) -> str:
    """Show the claims of all papers in one table a paper, for the page with the filter."""
    parts = []
    for paper in claims.papers(root):
        table, _ = verdicts.entries_table(root, paper, lambda claim: claim.kind == "claim", "claims")
        title = contents.title(root, f"{paper}/index")
        parts.append(f"## {title}\n\n{table_directive(f'{title}: all claims.', f'all-claims-{paper}', table)}")
    return "\n".join(parts)


def _settled(root: Path) -> str:
    """Show what the papers leave open, by the number of claims that it decides."""
    table = display.markdown_table(*verdicts.settled(root))
    return table_directive("What the papers leave open, by the number of claims that it decides.", "settled", table)


def _rules(root: Path) -> str:
    """Show what each kind of statement asks for."""
    rows = [[name.replace("-", " "), rule.means] for name, rule in ledger.rules(root).items()]
    table = display.markdown_table(["Kind of statement", "What it asks for"], rows)
    return table_directive("What each kind of statement asks for, the same for all papers.", "rules", table)


def _near_claims(root: Path) -> str:
    """List the claims whose number lies near a threshold, the nearest first."""
    rows = []
    found = [j for paper in claims.papers(root) for j in claims.judge_paper(root, paper) if j.is_near]
    for judged in sorted(found, key=lambda j: (j.share is not None, j.margin or 0.0)):
        says, _, ours, verdict, why = verdicts.row(judged)
        distance = "share within its error" if judged.share else f"{100 * judged.margin:.2g} %"
        rows.append([says, ours, verdict, distance, why])
    table = claims_table(["The paper says", "Ours", "Verdict", "Distance", "Why"], rows)
    return table_directive(
        f"Claims within {100 * claims.NEAR:g} % of the threshold that decides them, or with a share within its error "
        "of a limit.",
        "claims-near",
        table,
    )


def _guards(root: Path) -> str:
    """Count how many stored numbers and arrays are guarded by which kind of tolerance."""
    rows = [[kind, counts["paper"], counts["quick"]] for kind, counts in sorted(reference.kinds(root).items())]
    header = ["guarded by", "papers' scale", "quick scale"]
    return display.markdown_table(header, rows, ["left", "right", "right"])


def _run_times(root: Path) -> str:
    """List the time that each notebook took in this build, with the sum of each part."""
    rows, totals = [], Counter()
    for name in notebooks.names(root):
        if told := runfolder.provenance(runfolder.run_folder(root, name)):
            totals[name.partition("/")[0]] += told["seconds"]
            rows.append([f"{{doc}}`/{name}`", f"{told['seconds']:.1f}"])
    rows += [[f"all of {{doc}}`/{paper}/index`", f"{total:.1f}"] for paper, total in totals.items()]
    rows.append(["the whole book", f"{totals.total():.1f}"])
    return display.markdown_table(["notebook", "seconds"], rows, ["left", "right"])


def _api(root: Path, package: str) -> str:
    """Document the modules of a package by autodoc, below a line that changes with the code."""
    parts = []
    for path in sorted((root / "src").joinpath(*package.split(".")).glob("*.py")):
        name = package if path.stem == "__init__" else f"{package}.{path.stem}"
        source = f"{{download}}`{path.name} </../../../{path.relative_to(root).as_posix()}>`"  # from book/_build/site
        directive = f"```{{eval-rst}}\n.. automodule:: {name}\n   :members:\n   :ignore-module-all:\n```\n"
        parts.append(f"% {sources.code_hash([name])}\n\n## {name}\n\nSource: {source}\n\n{directive}")
    return "\n".join(parts)


_KINDS = {
    "claim": "Every number and claim that the paper prints, and what this build computed.",
    "control": "Controls of ours, which the paper does not print.",
}
BLOCKS: dict[str, tuple[Callable[..., str], str]] = {
    "verdicts": (_verdicts, "PAPER"),
    "verdicts-of": (_verdicts_of, "PAPER/NOTEBOOK"),
    "all-claims": (_all_claims, ""),
    "rules": (_rules, ""),
    "settled": (_settled, ""),
    "verdict-summary": (verdicts.summary_markdown, ""),
    "verdict-bars": (verdicts.bars, ""),
    "near-claims": (_near_claims, ""),
    "guards": (_guards, ""),
    "run-times": (_run_times, ""),
    "api": (_api, "PACKAGE"),
}
"""Name -> what makes it, and the name of its argument, if it has one."""
