"""The tables of claims and verdicts: for pages, scripts and the README."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path
from typing import Any, get_args

from execbook import contents, display
from execbook.claims import Judgement, Metrics, decided_by, judge, judge_paper
from execbook.errors import Fault, Misuse
from execbook.ledger import Claim, Verdict, papers

HEADER = ("The paper says", "Printed", "Ours", "Verdict", "Why")
_BLOCK = re.compile(r"(<!-- verdicts -->\n).*?(<!-- /verdicts -->)", re.S)


def row(judgement: Judgement, judged: bool = True) -> list[str]:
    """Give the cells of a claim under `HEADER`; verdict and reason are empty unless `judged`."""
    claim, ours = judgement.claim, judgement.ours

    def shown(value: float | str, digits: int | None = None) -> str:
        if isinstance(value, str):
            return value
        return display.quantity(value, claim.unit, _digits(value) if digits is None else digits)

    prints = [] if claim.printed is None else [shown(claim.printed)]
    reads = [] if claim.reads is None else [f"read as {shown(claim.reads)}"]
    why = "; ".join(filter(None, (claim.because if reads else None, judgement.why)))
    verdict = _outcome(judgement)
    cells = [f"{claim.where}: {claim.says}", "; ".join(prints + reads), "" if ours is None else shown(ours, 4)]
    return [*cells, *([verdict, why] if judged else ["", ""])]


def _outcome(judgement: Judgement) -> str:
    """Give the verdict in words, with the share of the readings; of a control, whether it holds."""
    claim, share = judgement.claim, judgement.share
    if claim.kind == "erratum":
        return "erratum"
    if claim.kind == "control":
        return {True: "holds", False: "does not hold", None: "not computed"}[judgement.holds]
    words = (judgement.verdict or "not computed").replace("-", " ")
    return f"{words} ({display.number(round(100 * share.part))}{display.NBSP}%)" if share else words


def link(root: Path, claim: Claim) -> str:
    """Give the address of what shows a claim, below the book's folder: a figure or table, else its notebook."""
    return claim.evidence[0] if claim.evidence else ""


def _digits(value: float) -> int:
    """Count the significant digits of a printed number, at most six."""
    return sum(c.isdigit() for c in f"{value:.5e}".partition("e")[0].rstrip("0"))


def of_notebook(root: Path, notebook: str, metrics: Metrics, judged: bool) -> tuple[list[str], list[list[str]], str]:
    """Give header, rows and caption of the claims that a notebook decides, `judged` or not."""
    rows = [row(judge(claim, lambda _: metrics), judged) for claim in decided_by(root, notebook)]
    keep = [k for k, name in enumerate(HEADER) if name in ("The paper says", "Ours") or any(r[k] for r in rows)]
    caption = "What the paper prints, how we read it, our number, and the verdict."
    if not judged:
        caption = "What the paper prints and our number. The parameters are not the paper's, so nothing is judged."
    return [HEADER[k] for k in keep], [[row[k] for k in keep] for row in rows], caption


def summary_markdown(root: Path, prefix: str = "") -> str:
    """Count the verdicts of each paper in a Markdown table; links start at `prefix`."""
    verdicts = get_args(Verdict)
    rows = []
    for paper in papers(root):
        counts = Counter(j.verdict or "not computed" for j in judge_paper(root, paper) if j.claim.kind == "claim")
        link = f"[{contents.title(root, f'{paper}/index')}]({prefix}{paper}/index.md)"
        rows.append([link, counts.total(), *(counts[v] for v in verdicts), counts["not computed"] or ""])
    header = ["Paper", "Claims", *(v.replace("-", " ") for v in verdicts), "not computed"]
    if not any(row[-1] for row in rows):
        header, rows = header[:-1], [row[:-1] for row in rows]
    return display.markdown_table(header, rows, ["left"] + ["right"] * (len(header) - 1))


def as_json(root: Path, paper: str) -> list[dict[str, Any]]:
    """Give the ledger of a paper with our numbers and verdicts beside the `expected` ones."""
    found = []
    for claim, ours, holds, verdict, why, margin, share in judge_paper(root, paper):
        entry = claim.model_dump(mode="json", exclude_none=True, exclude={"verdict", "holds"})
        expected = claim.holds if claim.kind == "control" else claim.verdict
        judged = {"expected": expected, "holds": holds, "verdict": verdict, "why": why, "margin": margin}
        judged |= {"share": share and share.part, "decided_by": share and share.decided_by, "link": link(root, claim)}
        found.append({"paper": paper, **entry, "ours": ours, **judged})
    return found


def readme_with_block(root: Path) -> str:
    """Give the README's text with its block of verdicts as the ledgers have it now.

    Raises Fault where the block is not there, Misuse where a claim is not computed.
    """
    open_claims = _not_computed(root)
    if open_claims:
        what = "1 claim is" if open_claims == 1 else f"{open_claims} claims are"
        raise Misuse(f"{what} not computed yet: call make book, then renew the README's verdicts.")
    text = (root / "README.md").read_text(encoding="utf-8")
    if not _BLOCK.search(text):
        raise Fault("README.md lacks the lines <!-- verdicts --> and <!-- /verdicts -->; write them where they stood.")
    return _BLOCK.sub(lambda m: f"{m[1]}{summary_markdown(root, 'book/')}\n{m[2]}", text)


def readme_agrees(root: Path) -> bool:
    """Tell whether the README's block is what the ledgers say; nothing is, until computed."""
    return _not_computed(root) > 0 or readme_with_block(root) == (root / "README.md").read_text(encoding="utf-8")


def _not_computed(root: Path) -> int:
    return sum(
        j.verdict is None for paper in papers(root) for j in judge_paper(root, paper) if j.claim.kind == "claim"
    )
