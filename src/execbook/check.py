"""Whether paper-scale results still agree with references, anchors, verdicts and README."""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from execbook import claims, contents, graph, notebooks, reference, verdicts
from execbook.ledger import HELD
from execbook.errors import Fault


@dataclass
class Report:
    """How much was held against what is stored, and every problem in one sentence."""

    numbers: int = 0
    anchors: int = 0
    claims: int = 0
    near: int = 0
    problems: list[str] = field(default_factory=list)


def check(root: Path) -> Report:
    """Hold the last build against everything that is stored about it."""
    report = Report()
    names = notebooks.names(root)
    shared = graph.shared_inputs(root)

    def hold(part: Callable[..., None], *what: str) -> None:
        try:
            part(root, *what, report)
        except (Fault, OSError) as error:
            report.problems.append(str(error))

    for name in names:
        folder = graph.run_folder(root, name)
        if not (folder / "provenance.json").is_file():
            report.problems.append(f"{name} has no run in the book; execute it with: make book.")
            continue
        if not graph.is_fresh(folder, graph.key(root, name, shared)):
            report.problems.append(f"{name}: its run is older than its sources, or damaged; renew it with: make book.")
        hold(_check_tables, name)
        hold(_check_reference, name)
    papers = {name.partition("/")[0] for name in names} | set(claims.papers(root))
    for paper in sorted(papers, key=contents.order(root)):
        hold(_check_guards, paper)
        if paper in claims.papers(root):
            hold(_check_claims, paper)
    hold(_check_readme)
    return report


def _check_tables(root: Path, name: str, report: Report) -> None:
    """A column without one value is a slip of the notebook."""
    for path in sorted((graph.run_folder(root, name) / "tables").glob("*.csv")):
        with path.open(encoding="utf-8", newline="") as file:
            header, *rows = csv.reader(file)
        for k, word in enumerate(header):
            if rows and not any(row[k].strip() for row in rows):
                report.problems.append(f"{name}: column {word!r} of table {path.stem} is empty.")


def _check_reference(root: Path, name: str, report: Report) -> None:
    found = reference.differences(root, graph.run_folder(root, name), "paper")
    report.anchors += sum(bool(d.source) for d in found)
    report.numbers += sum(not d.source for d in found)
    report.problems.extend(f"{name}: {d}" for d in found if d.problem)


def _check_guards(root: Path, paper: str, report: Report) -> None:
    """A declared guard without a key is a slip, or left over."""
    for guard in reference.guards(root, paper):
        modes = [guard.mode] if guard.mode else ["paper", "quick"]
        stored = [m for m in modes if reference.path_of(root, guard.notebook, m).is_file()]
        keys = [key for m in stored for key in reference.load(root, guard.notebook, m)[0]]
        if not any(guard.covers(guard.notebook, modes[0], key) for key in keys):
            where = f"tests/reference/{paper}/guards.yml"
            words = f"guards {guard.key} of {guard.notebook}, which records nothing of that name."
            report.problems.append(f"{where} {words}")


def _check_claims(root: Path, paper: str, report: Report) -> None:
    judgements = claims.judge_paper(root, paper)
    report.claims += sum(j.claim.kind == "claim" for j in judgements)
    report.near += sum(j.is_near for j in judgements)
    for j in judgements:
        if not j.as_expected:
            now = j.verdict or HELD[j.holds]
            where = f"book/{paper}/claims.yml, claim {j.claim.id}"
            wanted = j.claim.verdict or j.claim.expected
            report.problems.append(f"{where}: {now} ({j.why}; ours {j.ours}), expected {wanted}.")


def _check_readme(root: Path, report: Report) -> None:
    if not verdicts.readme_agrees(root):
        report.problems.append("README.md: its verdicts are not those of the ledgers; renew them with claims --readme.")
