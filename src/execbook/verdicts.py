"""The tables of claims, controls, errata and verdicts: for pages, scripts and the README."""

from __future__ import annotations

import html
import re
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, get_args

from execbook import contents, display, runfolder
from execbook.claims import Judgement, Metrics, decided_by, judge, judge_paper, recorded
from execbook.errors import Fault, Misuse
from execbook.ledger import HELD, Claim, Verdict, papers
from execbook.multiverse import READINGS, choices

HEADER = ("The paper says", "Printed", "Ours", "Verdict", "Why")
_BLOCK = re.compile(r"(<!-- verdicts -->\n).*?(<!-- /verdicts -->)", re.S)


def row(judgement: Judgement) -> list[str]:
    """Give the cells of an entry under `HEADER`."""
    claim, ours = judgement.claim, judgement.ours

    def shown(value: float | str, digits: int | None = None) -> str:
        if isinstance(value, str):
            return value
        return display.quantity(value, claim.unit, _digits(value) if digits is None else digits)

    prints = [] if claim.printed is None else [shown(claim.printed)]
    reads = [] if claim.reads is None else [f"read as {shown(claim.reads)}"]
    why = "; ".join(filter(None, (claim.because if reads else None, judgement.why, _decided(judgement))))
    cells = [f"{claim.where}: {claim.says}", "; ".join(prints + reads), "" if ours is None else shown(ours, 4)]
    return [*cells, outcome(judgement), why]


def outcome(judgement: Judgement) -> str:
    """Give a verdict in words, with its share of the readings; of a control, whether it holds."""
    claim, share = judgement.claim, judgement.share
    if claim.kind == "erratum":
        return "erratum"
    if claim.kind == "control":
        return HELD[judgement.holds]
    words = (judgement.verdict or "not computed").replace("-", " ")
    return f"{words}, {round(100 * share.part)}{display.NBSP}%" if share else words


def _decided(judgement: Judgement) -> str:
    """Tell how many of the readings a claim survives, and which choice decides."""
    share = judgement.share
    if share is None:
        return ""
    text = f"holds in {round(100 * share.part)}{display.NBSP}% of {share.worlds} readings"
    if not share.decided_by:
        return text
    parts = share.groups[share.decided_by].items()
    listed = ", ".join(f"{g} {round(100 * part)}{display.NBSP}%" for g, part in sorted(parts, key=lambda p: -p[1]))
    return f"{text}; {share.decided_by} decides ({listed})"


def _digits(value: float) -> int:
    """Count the significant digits of a printed number, at most six."""
    return sum(c.isdigit() for c in f"{value:.5e}".partition("e")[0].rstrip("0"))


def labels(claim: Claim) -> tuple[str, ...]:
    """Give the labels of the figures and tables that show an entry: its evidence, else its page's table of claims."""
    if claim.evidence:
        return claim.evidence
    return (label_of(claim.notebooks[0]),) if len(claim.notebooks) == 1 else ()


def label_of(page: str) -> str:
    """Give the label of a page's table of claims."""
    return f"verdicts-{page.replace('/', '-')}"


def link(paper: str, claim: Claim, places: Mapping[str, str]) -> str:
    """Give the address of what shows an entry, relative to the book's folder of pages; places : of its paper."""
    for label in claim.evidence:
        if label in places:
            return f"{places[label]}.html#{label.lower().replace('.', '-').replace('_', '-')}"
    if claim.notebooks:
        page = claim.notebooks[0]
        return f"{page}.html" + (f"#{label_of(page)}" if len(claim.notebooks) == 1 else "")
    return f"{paper}/index.html#claim-{claim.id}"


def places(root: Path, paper: str) -> dict[str, str]:
    """Give the page of a paper on which each label of a figure or table stands, the first of them."""
    pages = [page for page in contents.pages(root) if page.startswith(f"{paper}/")]
    return {label: page for page in reversed(pages) for label in _shown(root, page)}


def _shown(root: Path, page: str) -> list[str]:
    """List the labels of figures and tables on a page: of its last run, and those written in its text."""
    record = runfolder.provenance(runfolder.run_folder(root, page)) or {}
    source = root / "book" / f"{page}.md"
    written = re.findall(r"^:name: (\S+)$", source.read_text(encoding="utf-8"), re.M) if source.is_file() else []
    return [*record.get("figures", ()), *record.get("tables", ()), *written]


def of_notebook(root: Path, notebook: str, metrics: Metrics, judged: bool) -> tuple[list[str], list[list[str]], str]:
    """Give header, rows and caption of the entries that a notebook alone decides; whether they hold where `judged`.

    The verdict stands in the book alone: it may rest on other readings, which another page computes.
    """
    rows = []
    for claim in decided_by(root, notebook):
        judgement = judge(claim, lambda _: metrics)
        *cells, _, why = row(judgement)
        holds = {True: "yes", False: "no", None: ""}[judgement.holds]
        rows.append([*cells, *([holds, why] if judged else ["", ""])])
    header = [name.replace("Verdict", "Holds here") for name in HEADER]
    keep = [k for k, name in enumerate(header) if name in ("The paper says", "Ours") or any(r[k] for r in rows)]
    caption = "What the paper prints, how we read it, our number, and whether the statement holds here."
    if not judged:
        caption = "What the paper prints and our number. The parameters are not the paper's, so nothing is judged."
    return [header[k] for k in keep], [[row[k] for k in keep] for row in rows], caption


def summary_markdown(root: Path, prefix: str = "") -> str:
    """Count the verdicts of each paper in a Markdown table; links start at `prefix`."""
    words = get_args(Verdict)
    rows = []
    for paper in papers(root):
        counts = Counter(j.verdict or "not computed" for j in _judged(root, paper))
        link = f"[{contents.title(root, f'{paper}/index')}]({prefix}{paper}/index.md)"
        rows.append([link, counts.total(), *(counts[v] for v in words), counts["not computed"] or ""])
    header = ["Paper", "Claims", *(v.replace("-", " ") for v in words), "not computed"]
    if not any(row[-1] for row in rows):
        header, rows = header[:-1], [row[:-1] for row in rows]
    return display.markdown_table(header, rows, ["left"] + ["right"] * (len(header) - 1))


def bars(root: Path) -> str:
    """Draw the verdicts of each paper as a bar in HTML, its legend first; `summary_markdown` says the same in words."""
    words = get_args(Verdict)
    counted = {p: Counter(j.verdict for j in _judged(root, p)) for p in papers(root)}
    legend = "".join(f'<span class="verdict verdict-{word}">{word.replace("-", " ")}</span> ' for word in words)
    lines = [f'<p class="verdict-legend">{legend}</p>']
    for paper, counts in counted.items():
        parts = "".join(
            f'<span class="verdict-{word}" style="flex-grow: {counts[word]}">{counts[word]}</span>'
            for word in words
            if counts[word]
        )
        title = html.escape(contents.title(root, f"{paper}/index").partition(":")[0])
        lines.append(f'<p class="verdict-name">{title}</p>\n<div class="verdict-bar">{parts}</div>')
    return '```{raw} html\n<div aria-hidden="true">\n' + "\n".join(lines) + "\n</div>\n```"


def _judged(root: Path, paper: str) -> list[Judgement]:
    return [j for j in judge_paper(root, paper) if j.claim.kind == "claim"]


def as_json(root: Path, paper: str) -> list[dict[str, Any]]:
    """Give the ledger of a paper with our numbers and verdicts beside the `expected` ones."""
    found, labelled = [], places(root, paper)
    for claim, ours, holds, verdict, why, margin, share in judge_paper(root, paper):
        entry = claim.model_dump(mode="json", exclude_none=True, exclude={"verdict", "holds"})
        expected = claim.holds if claim.kind == "control" else claim.verdict
        judged = {"ours": ours, "expected": expected, "holds": holds, "verdict": verdict, "why": why, "margin": margin}
        judged |= {"share": share and share.part, "decided_by": share and share.decided_by}
        found.append({"paper": paper, **entry, **judged, "link": link(paper, claim, labelled)})
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
    return sum(j.verdict is None for paper in papers(root) for j in _judged(root, paper))


def entries_table(root: Path, paper: str, chosen: Callable[[Claim], bool], here: str = "") -> tuple[str, int]:
    """Give a Markdown table of the chosen entries of a paper, and how many they are.

    A row has an address, `claim-<id>`; below what the paper says stand the passage, what shows it and why the verdict.
    here : page that the table stands on, which its rows do not point at.
    """
    rows = [_linked(paper, j, here) for j in judge_paper(root, paper) if chosen(j.claim)]
    return display.markdown_table(HEADER[:-1], rows), len(rows)


def _linked(paper: str, judgement: Judgement, here: str) -> list[str]:
    claim = judgement.claim
    says, printed, ours, verdict, why = (escaped(text) for text in row(judgement))
    shown = [f"{{numref}}`{label}`" for label in labels(claim) if label != label_of(here)]
    if not labels(claim):
        shown = [f"{{doc}}`/{notebook}`" for notebook in claim.notebooks if notebook != here]
    if judgement.share and here != f"{paper}/{READINGS}":
        shown.append(f"{{doc}}`/{paper}/{READINGS}`")
    small = [f"Source: {escaped(claim.source)}."]
    if claim.kind == "control":
        small = ["A control of ours, not a claim of the paper."]
    if shown:
        small.append(f"Shown in {', '.join(shown)}.")
    if why:
        small.append(f"{why[0].upper()}{why[1:]}.")
    for past in claim.history[-1:]:
        moved = f"Until {past.until}: {past.verdict.replace('-', ' ')}; {past.reason}"
        small.append(escaped(moved.rstrip(".")) + ".")
    return [f'<span id="claim-{claim.id}"></span>{says}<br><small>{" ".join(small)}</small>', printed, ours, verdict]


def settled(root: Path) -> tuple[list[str], list[list[str]]]:
    """Rank what the papers leave open by the number of claims that it decides, for a page at the root."""
    header = ["Paper", "What is not said", "Claims", "Where most claims hold together"]
    rows = []
    for paper in papers(root):
        if not (root / "book" / paper / "readings.yml").is_file():
            continue
        judged, numbers = judge_paper(root, paper), recorded(root, f"{paper}/{READINGS}") or {}
        for choice in choices(root, paper):
            decided = [j.claim.id for j in judged if j.share and j.share.decided_by == choice.id]
            key = re.compile(rf"most\.(?:\d+\.)?{choice.id}\.([a-z0-9-]+)")
            match = {m[1]: entry["value"] for name, entry in numbers.items() if (m := key.fullmatch(name))}
            parts = ", ".join(f"{g} {round(100 * p)}{display.NBSP}%" for g, p in sorted(match.items()) if p)
            names = ", ".join(f'<a href="{paper}/index.html#claim-{name}">{name}</a>' for name in decided)
            title = f"{{doc}}`{contents.title(root, f'{paper}/index')} </{paper}/{READINGS}>`"
            asks = f"{escaped(choice.asks)}<br><small>{escaped(choice.passage)}</small>"
            listed = f"<details><summary>{len(decided)}</summary><small>{names}</small></details>" if decided else "0"
            rows.append((len(decided), [title, asks, listed, parts]))
    return header, [row for _, row in sorted(rows, key=lambda pair: -pair[0])]


def escaped(text: str) -> str:
    """Give a text whose marks Markdown leaves alone."""
    return re.sub(r"([\\*_\[\]<>$\{}#~^`])", r"\\\1", text)
