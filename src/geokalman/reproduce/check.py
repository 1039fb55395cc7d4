"""Do the paper-scale results still say what is stored: references, anchors of the specification, verdicts, README?"""

from __future__ import annotations

import csv
from dataclasses import dataclass, field
from pathlib import Path

from geokalman.reproduce import claims, contents, display, graph, notebooks, reference
from geokalman.reproduce.errors import Fault


@dataclass
class Report:
    """What was held against what, how many claims are near a threshold, and every problem in one sentence."""

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
    built = []
    for name in names:
        folder = graph.run_folder(root, name)
        if not (folder / "provenance.json").is_file():
            report.problems.append(f"{name} has no run in the book; execute it with: make book.")
            continue
        if not graph.is_fresh(folder, graph.key(root, name, shared)):
            report.problems.append(
                f"{name}: its run is older than its sources, or damaged; make it anew with: make book."
            )
        built.append(name)
        _check_tables(name, folder, report)
        _check_reference(root, name, folder, report)
    papers = {name.partition("/")[0] for name in names} | set(claims.papers(root))
    for paper in sorted(papers, key=contents.order(root)):
        _check_anchors(root, paper, names, built, report)
        _check_guards(root, paper, report)
        if paper in claims.papers(root):
            _check_claims(root, paper, report)
    try:
        if not claims.readme_agrees(root):
            report.problems.append(
                "README.md: its verdicts are not those of the ledgers; renew them with: geokalman claims --readme."
            )
    except (Fault, OSError) as error:
        report.problems.append(str(error))
    return report


def describe(difference: reference.Difference) -> str:
    """One sentence about a key that moved."""
    stored, ours = (display.number(v, 7) if v is not None else "nothing" for v in (difference.stored, difference.ours))
    unit = f" {difference.unit}" if difference.unit else ""
    return f"{difference.key}: {ours}{unit}, stored is {stored}{unit}: {difference.problem}."


def _check_tables(name: str, folder: Path, report: Report) -> None:
    """A column without one value is a slip of the notebook: nobody wants to read dashes."""
    for path in sorted((folder / "tables").glob("*.csv")):
        with path.open(encoding="utf-8", newline="") as file:
            header, *rows = csv.reader(file)
        for k, word in enumerate(header):
            if rows and not any(row[k].strip() for row in rows):
                report.problems.append(f"{name}: column {word!r} of table {path.stem} is empty.")


def _check_reference(root: Path, name: str, folder: Path, report: Report) -> None:
    try:
        found = reference.differences(root, folder, "paper")
    except Fault as error:
        report.problems.append(str(error))
        return
    report.numbers += len(found)
    report.problems.extend(f"{name}: {describe(d)}" for d in found if d.problem)


def _check_anchors(root: Path, paper: str, names: list[str], built: list[str], report: Report) -> None:
    try:
        wanted = reference.anchors(root, paper)
    except Fault as error:
        report.problems.append(str(error))
        return
    for stray in sorted({a.notebook for a in wanted} - set(names)):
        report.problems.append(f"tests/reference/{paper}/anchors.yml names {stray}, which is no notebook.")
    for name in built:
        mine = [a for a in wanted if a.notebook == name and a.mode == "book"]
        found = reference.hold(mine, claims.recorded(root, name) or {})
        report.anchors += len(found)
        report.problems.extend(f"{name}, anchor {describe(d)}" for d in found if d.problem)


def _check_guards(root: Path, paper: str, report: Report) -> None:
    """A declared guard without a key is a slip, or left over."""
    for guard in reference.guards(root, paper):
        modes = [guard.mode] if guard.mode else ["paper", "quick"]
        keys = [k for m in modes if reference.path_of(root, guard.notebook, m).is_file()
                for k in reference.load(root, guard.notebook, m)[0]]  # fmt: skip
        if not any(guard.covers(guard.notebook, modes[0], key) for key in keys):
            report.problems.append(
                f"tests/reference/{paper}/guards.yml guards {guard.key} of {guard.notebook}, which records nothing of "
                "that name."
            )


def _check_claims(root: Path, paper: str, report: Report) -> None:
    try:
        judgements = claims.judge_paper(root, paper)
    except Fault as error:
        report.problems.append(str(error))
        return
    report.claims += len(judgements)
    report.near += sum(j.is_near for j in judgements)
    for j in judgements:
        if not j.as_expected:
            now = j.verdict or "not computed"
            report.problems.append(
                f"book/{paper}/claims.yml, claim {j.claim.id}: "
                f"{now} ({j.why}; ours {j.ours}), expected {j.claim.verdict}."
            )
