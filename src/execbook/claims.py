"""Verdicts: each entry of a ledger, held against our numbers and against the readings that the paper admits."""

from __future__ import annotations

import functools
import json
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from execbook import display
from execbook.errors import Fault
from execbook.ledger import Claim, Verdict, ledger, papers
from execbook.multiverse import READINGS, Share, share_of

NEAR = 0.02
"""Distance from its threshold, relative to it, up to which a claim is listed as near."""
OFTEN, SELDOM = 0.9, 0.1
"""Shares of the readings from which a claim is reproduced, and up to which it is not."""
Metrics = Mapping[str, Mapping[str, Any]]
"""Recorded numbers of one notebook: key -> {value, unit}."""


class Judgement(NamedTuple):
    """An entry with our number, whether it holds, and its verdict now (None where a number is not recorded)."""

    claim: Claim
    ours: float | str | None
    holds: bool | None
    verdict: Verdict | None
    why: str
    margin: float | None = None  # distance of ours from the nearest threshold, relative to it
    share: Share | None = None

    @property
    def as_expected(self) -> bool:
        """Tell whether verdict or outcome is the one that the ledger expects."""
        return self.holds == self.claim.holds if self.claim.kind == "control" else self.verdict == self.claim.verdict

    @property
    def is_near(self) -> bool:
        """Tell whether our number lies within `NEAR` of a threshold, or the share within its error of a limit."""
        if self.share is not None:
            return any(abs(self.share.part - limit) <= self.share.error for limit in (OFTEN, SELDOM))
        return self.margin is not None and self.margin <= NEAR


def recorded(root: Path, notebook: str) -> Metrics | None:
    """Read the numbers of a notebook from the last build, or give None where it was not run."""
    path = root / "book" / "_build" / "metrics" / f"{notebook}.json"
    return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else None


def judge(claim: Claim, metrics: Callable[[str], Metrics | None], share: Share | None = None) -> Judgement:
    """Hold an entry against the recorded numbers that `metrics(notebook)` gives, and its share of the readings.

    A claim has the first word that applies: not-testable, not-reproduced, calibrated, depends-on-the-reading,
    reproduced. With a share of the readings this decides; else whether it holds in the one reading there is.
    """
    if not claim.metrics:
        verdict = "not-testable" if claim.kind == "claim" else None
        return Judgement(claim, None, None, verdict, claim.reason or claim.should or "")
    entries = {name: (metrics(name.partition(":")[0]) or {}).get(name.partition(":")[2]) for name in claim.metrics}
    for name, entry in entries.items():
        if entry is None:
            return Judgement(claim, None, None, None, f"{name} is not recorded")
    values = {name: entry["value"] for name, entry in entries.items()}
    units = {name: entry["unit"] for name, entry in entries.items()}
    _require_one_unit(claim, units)
    thresholds: list[tuple[float, float]] = []
    if unknown := next((name for name, value in values.items() if value is None), None):
        ours, holds, why = None, False, f"{unknown} is not finite"
    elif claim.accept:
        ours = values[claim.metric]
        holds, why = claim.accept.holds(ours, claim.reference), str(claim.accept)
        edges = set(claim.accept.edges(claim.reference))  # what must be equal is near nothing
        thresholds = [(ours, edge) for edge in edges if len(edges) > 1]
    else:
        shown = [c.shown(values, display.unit_text(units[c.left])) for c in claim.compare]
        ours, holds, why = "; ".join(shown), all(c.holds(values) for c in claim.compare), None
        thresholds = [c.sides(values) for c in claim.compare if c.op != "="]
    verdict = _verdict(claim, holds, share) if claim.kind == "claim" else None
    words = {"not-reproduced": claim.reason, "calibrated": claim.calibrated}.get(verdict, claim.assumes)
    if claim.kind == "control":
        words = claim.reason
    margin = min((abs(number / edge - 1) for number, edge in thresholds if edge and math.isfinite(edge)), default=None)
    return Judgement(claim, ours, holds, verdict, "; ".join(filter(None, (words, why))), margin, share)


def _verdict(claim: Claim, holds: bool, share: Share | None) -> Verdict:
    part = float(holds) if share is None else share.part
    if part <= SELDOM:
        return "not-reproduced"
    if claim.calibrated:
        return "calibrated"
    if part < OFTEN or (share is None and claim.assumes):
        return "depends-on-the-reading"
    return "reproduced"


def _require_one_unit(claim: Claim, units: Mapping[str, str]) -> None:
    if claim.metric and len({claim.unit, units[claim.metric]} - {""}) > 1:
        raise Fault(
            f"claim {claim.id} is in {claim.unit}, but {claim.metric} is recorded in {units[claim.metric]}; "
            "they must agree."
        )
    for c in claim.compare:
        if isinstance(c.right, str) and len({units[c.left], units[c.right]} - {""}) > 1:
            raise Fault(
                f"claim {claim.id} compares {c.left}, recorded in {units[c.left]}, with {c.right}, recorded in "
                f"{units[c.right]}; they must agree."
            )


def judge_paper(root: Path, paper: str) -> list[Judgement]:
    """Judge all entries of a paper by the numbers of the last build."""
    entries, metrics = ledger(root, paper), functools.cache(functools.partial(recorded, root))
    readings = metrics(f"{paper}/{READINGS}") or {}
    try:
        judged = [judge(claim, metrics, share_of(claim.id, readings)) for claim in entries]
    except Fault as error:
        raise Fault(f"book/{paper}/claims.yml, {error}") from error
    by_id = {judgement.claim.id: judgement for judgement in judged}
    return [_resting(judgement, by_id) for judgement in judged]


def _resting(judgement: Judgement, by_id: Mapping[str, Judgement]) -> Judgement:
    """Add to the reason of a claim those that it rests on, at any remove, and that are not reproduced."""
    open_ids, seen = list(judgement.claim.requires), {judgement.claim.id}
    while open_ids:
        if (name := open_ids.pop()) not in seen:
            seen.add(name)
            open_ids += by_id[name].claim.requires
    failed = [name for name in sorted(seen - {judgement.claim.id}) if by_id[name].verdict == "not-reproduced"]
    if not failed:
        return judgement
    words = f"rests on {', '.join(failed)}, {'which is' if len(failed) == 1 else 'which are'} not reproduced"
    return judgement._replace(why="; ".join(filter(None, (judgement.why, words))))


def decided_by(root: Path, notebook: str) -> list[Claim]:
    """List the entries of the paper's ledger that the numbers of this notebook alone decide."""
    paper = notebook.partition("/")[0]
    return [c for c in ledger(root, paper) if c.notebooks == [notebook]] if paper in papers(root) else []
