"""The ledgers of the real book: every entry has its passage, its rule and its evidence."""

import json
import re
from pathlib import Path

import pytest

from execbook import contents, ledger, multiverse, notebooks, reference, verdicts

ROOT = Path(__file__).resolve().parents[2]
PAPERS = ledger.papers(ROOT)
ENTRIES = [
    pytest.param(paper, entry, id=f"{paper}:{entry.id}") for paper in PAPERS for entry in ledger.ledger(ROOT, paper)
]
WORDS = {"reproduced", "calibrated", "under-interpretation", "not-reproduced", "not-testable", "depends-on-the-reading"}
PLACE = re.compile(
    r"abstract|summary|introduction|conclusion|keywords|title|caption|acknowledg|appendix"
    r"|section|equation|formula|table|fig|step|paragraph|heading|references|\(\d+\)",
    re.I,
)


def labels(paper: str) -> set[str]:
    """Labels of the figures and tables of a part: those that its notebooks make and those in its prose."""
    found = {f"claims-{paper}", f"controls-{paper}", f"errata-{paper}", f"choices-{paper}", f"shares-{paper}"}
    found.add(f"shares-figure-{paper}")
    for page in contents.pages(ROOT):
        if page.startswith(f"{paper}/"):
            text = (ROOT / "book" / f"{page}.md").read_text(encoding="utf-8")
            found.update(re.findall(r"nb\.(?:figure|table)\(\s*f?\"([\w.-]+)\"", text))
            found.update(re.findall(r"^:name: (\S+)$", text, re.M))
            found.update(re.findall(r"^\(([\w.-]+)\)=$", text, re.M))
            found.add(verdicts.label_of(page))
    return found


PLACES = {paper: verdicts.places(ROOT, paper) for paper in PAPERS}
LABELS = {paper: labels(paper) for paper in PAPERS}


@pytest.mark.parametrize(("paper", "entry"), ENTRIES)
def test_an_entry_cites_its_passage_and_shows_its_evidence(paper, entry):
    if entry.kind != "control":
        assert PLACE.search(entry.source), f"{entry.source!r} names no section, equation, table, figure or summary"
    assert entry.evidence or entry.metrics, "neither a number nor a label"
    assert set(entry.evidence) <= LABELS[paper]
    assert set(entry.notebooks) <= set(notebooks.names(ROOT))
    assert verdicts.link(paper, entry, PLACES[paper]).partition(".html")[0] in contents.pages(ROOT)


@pytest.mark.parametrize(("paper", "entry"), ENTRIES)
def test_an_entry_keeps_to_the_rules_of_the_book(paper, entry):
    if entry.kind == "claim" and entry.metrics:
        assert entry.rule in ledger.rules(ROOT)
    assert {past.verdict for past in entry.history} <= WORDS
    assert entry.kind == "claim" or entry.metric is None or entry.rule or entry.accept
    if entry.verdict in ("not-reproduced", "not-testable"):
        assert entry.reason


def share_ids(paper: str) -> set[str]:
    path = reference.path_of(ROOT, f"{paper}/{multiverse.READINGS}", "paper")
    stored = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    return {key.removeprefix("share.") for key in stored if key.startswith("share.")}


def test_a_third_of_the_claims_has_a_share():
    all_claims = [(paper, e.id) for paper in PAPERS for e in ledger.ledger(ROOT, paper) if e.kind == "claim"]
    shared = {(paper, name) for paper in PAPERS for name in share_ids(paper)}
    assert len(shared.intersection(all_claims)) >= len(all_claims) / 3


@pytest.mark.parametrize("paper", PAPERS)
def test_readings_name_their_passages(paper):
    for choice in multiverse.choices(ROOT, paper):
        assert len(choice.passage) > 10 and choice.asks.endswith("?")
