"""The ledger of a paper: every claim that it prints, held against our numbers."""

from __future__ import annotations

import functools
import json
import math
import operator
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from execbook import contents, display, yamltext
from execbook.errors import Fault, Misuse, explain
from execbook.tolerance import Tolerance

Verdict = Literal["reproduced", "calibrated", "under-interpretation", "not-reproduced", "not-testable"]
_SAME = 1e-6  # relative difference of numbers that are one but for rounding
_OPERATORS = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "=": functools.partial(math.isclose, rel_tol=_SAME),
}
NEAR = 0.02
"""Distance from its threshold, relative to it, up to which a claim is listed as near."""
MetricName = Annotated[str, Field(pattern=r"^[\w.-]+/[\w.-]+:[A-Za-z0-9_.+-]+$")]
Metrics = Mapping[str, Mapping[str, Any]]
"""Recorded numbers of one notebook: key -> {value, unit}."""


class Accept(Tolerance):
    """How far ours may be from the paper's: rel, abs, by a factor, or in a range of its own."""

    @model_validator(mode="before")
    @classmethod
    def _of_a_claim(cls, data: Any) -> Any:
        if not isinstance(data, dict) or len(data) != 1 or not data.keys() <= {"rel", "abs", "factor", "range"}:
            raise ValueError("accept wants exactly one of rel, abs, factor, range")
        if "range" not in data:
            return data
        low, high = data["range"]
        return {"min": low, "max": high}

    def __str__(self) -> str:
        if self.min is not None:
            return f"accepted {display.number(self.min)} to {display.number(self.max)}"
        if self.factor is not None:
            return f"accepted within a factor {self.factor:g}"
        return f"accepted ±{self.rel * 100:g} %" if self.abs is None else f"accepted ±{display.number(self.abs)}"


class _Strict(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Compare(_Strict):
    """A comparison of recorded numbers, left op factor * right; = holds within 1e-6."""

    left: MetricName
    op: Literal["<", "<=", ">", ">=", "="]
    right: MetricName | float
    factor: float = 1.0

    def sides(self, values: Mapping[str, float]) -> tuple[float, float]:
        """Give the left number, and the right one times the factor."""
        return values[self.left], self.factor * values.get(self.right, self.right)

    def holds(self, values: Mapping[str, float]) -> bool:
        """Tell whether it holds."""
        return _OPERATORS[self.op](*self.sides(values))

    def shown(self, values: Mapping[str, float], unit: str) -> str:
        """Give both sides with their unit and name."""
        numbers = values[self.left], values.get(self.right, self.right)
        sides = [f"{display.number(value)} {unit}".rstrip() for value in numbers]
        pairs = zip(sides, _names(self.left, self.right), strict=True)
        left, right = (f"{side} ({name})" if name else side for side, name in pairs)
        factor = f"{self.factor:g} × " if self.factor != 1 else ""
        return f"{left} {self.op if self.holds(values) else f'not {self.op}'} {factor}{right}"


class Claim(_Strict):
    """A number or statement of the paper, what decides it, and the expected verdict."""

    id: str = Field(pattern=r"^[a-z0-9][a-z0-9.-]*$")
    where: str
    says: str
    printed: float | str | None = None
    reads: float | None = None
    because: str | None = None
    unit: str = ""
    metric: MetricName | None = None
    compare: tuple[Compare, ...] = ()
    accept: Accept | None = None
    assumes: str | None = None
    calibrated: str | None = None
    reason: str | None = None
    verdict: Verdict

    @model_validator(mode="before")
    @classmethod
    def _listed(cls, data: Any) -> Any:
        if isinstance(data, dict) and isinstance(data.get("compare"), dict):
            return data | {"compare": [data["compare"]]}
        return data

    @model_validator(mode="after")
    def _coherent(self) -> Claim:
        by_number, alone = bool(self.accept) and not self.accept.alone, not (self.metric or self.compare)
        faults = [
            (self.metric and self.compare, "a claim has a metric or a compare, not both"),
            (
                (self.reads is None) != (self.because is None),
                "reads and because go together: why is it not read as printed?",
            ),
            (self.metric and not self.accept, "a metric needs accept"),
            (self.accept and not self.metric, "accept needs a metric"),
            (by_number and self.reference is None, "accept needs a printed (or reads) number to compare with"),
            (alone and not self.reason, "a claim that nothing decides needs a reason"),
        ]
        for found, words in faults:
            if found:
                raise ValueError(words)
        return self

    @property
    def reference(self) -> float | None:
        """Give the paper's number: as we read it, else as printed."""
        if self.reads is not None:
            return self.reads
        return self.printed if isinstance(self.printed, float) else None

    @property
    def metrics(self) -> list[str]:
        """Name the recorded numbers that decide the claim."""
        sides = [side for c in self.compare for side in (c.left, c.right) if isinstance(side, str)]
        return [self.metric] if self.metric else sides


class Judgement(NamedTuple):
    """A claim with our number and its verdict now (None where a number is not recorded)."""

    claim: Claim
    ours: float | str | None
    verdict: Verdict | None
    why: str
    margin: float | None = None  # distance of ours from the nearest threshold, relative to it

    @property
    def as_expected(self) -> bool:
        """Tell whether the verdict is the one that the ledger expects."""
        return self.verdict == self.claim.verdict

    @property
    def is_near(self) -> bool:
        """Tell whether our number lies within `NEAR` of a threshold."""
        return self.margin is not None and self.margin <= NEAR


def papers(root: Path) -> list[str]:
    """List the papers that have a ledger, in the order of the book."""
    found = (p.parent.name for p in (root / "book").glob("*/claims.yml") if not p.parent.name.startswith("_"))
    return sorted(found, key=contents.order(root))


def ledger(root: Path, paper: str) -> list[Claim]:
    """Read the claims of a paper; raises Fault for a wrong entry, Misuse for an unknown paper."""
    path = root / "book" / paper / "claims.yml"
    if not re.fullmatch(r"\w[\w.-]*", paper) or not path.is_file():
        raise Misuse(f"{paper!r} has no ledger ({path}); papers with one are {', '.join(papers(root)) or 'none yet'}.")
    return list(_claims(path.read_text(encoding="utf-8"), f"book/{paper}/claims.yml"))


@functools.lru_cache(maxsize=16)
def _claims(text: str, where: str) -> tuple[Claim, ...]:
    try:
        entries = yamltext.parse(text)
    except ValueError as error:
        raise Fault(f"{where}, {error}.") from error
    if not isinstance(entries, list):
        raise Fault(f"{where} holds no list of claims.")
    claims: dict[str, Claim] = {}
    for k, entry in enumerate(entries, 1):
        name = entry.get("id", f"number {k}") if isinstance(entry, dict) else f"number {k}"
        try:
            claim = Claim.model_validate(entry)
        except ValidationError as error:
            raise Fault(f"{where}, claim {name}: {explain(error)}.") from error
        if claim.id in claims:
            raise Fault(f"{where}, claim {name}: the id is taken by an earlier claim.")
        claims[claim.id] = claim
    return tuple(claims.values())


def recorded(root: Path, notebook: str) -> Metrics | None:
    """Read the numbers of a notebook from the last build, or give None where it was not run."""
    path = root / "book" / "_build" / "metrics" / f"{notebook}.json"
    return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else None


def judge(claim: Claim, metrics: Callable[[str], Metrics | None]) -> Judgement:
    """Give the verdict of a claim by the recorded numbers that `metrics(notebook)` gives.

    The most critical word that applies: not-testable, not-reproduced, calibrated, under-interpretation, reproduced.
    """
    if not claim.metrics:
        return Judgement(claim, None, "not-testable", claim.reason or "")
    entries = {name: (metrics(name.partition(":")[0]) or {}).get(name.partition(":")[2]) for name in claim.metrics}
    for name, entry in entries.items():
        if entry is None:
            return Judgement(claim, None, None, f"{name} is not recorded")
    values = {name: entry["value"] for name, entry in entries.items()}
    units = {name: entry["unit"] for name, entry in entries.items()}
    _require_one_unit(claim, units)
    for name, value in values.items():
        if value is None:
            return Judgement(claim, None, "not-reproduced", f"{name} is not finite")
    if claim.accept:
        ours: float | str = values[claim.metric]
        holds, why = claim.accept.holds(ours, claim.reference), str(claim.accept)
        edges = set(claim.accept.edges(claim.reference))  # what must be equal is near nothing
        thresholds = [(ours, edge) for edge in edges if len(edges) > 1]
    else:
        shown = [c.shown(values, display.unit_text(units[c.left])) for c in claim.compare]
        ours, holds, why = "; ".join(shown), all(c.holds(values) for c in claim.compare), None
        thresholds = [c.sides(values) for c in claim.compare if c.op != "="]
    if not holds:
        verdict, words = "not-reproduced", claim.reason
    elif claim.calibrated:
        verdict, words = "calibrated", claim.calibrated
    elif claim.assumes:
        verdict, words = "under-interpretation", claim.assumes
    else:
        verdict, words = "reproduced", None
    margin = min((abs(number / edge - 1) for number, edge in thresholds if edge and math.isfinite(edge)), default=None)
    return Judgement(claim, ours, verdict, "; ".join(filter(None, (words, why))), margin)


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


def _names(left: str, right: str | float) -> tuple[str, str]:
    """Give what tells two recorded numbers apart: parts of their names, else their notebooks."""
    book, _, key = left.partition(":")
    other_book, _, other = str(right).partition(":")
    if not other:
        return " ".join(key.split(".")[-2:]).replace("_", " "), ""
    if key == other:
        return book.partition("/")[2], other_book.partition("/")[2]
    parts = key.split("."), other.split(".")
    own = [[p for p in mine if p not in theirs] for mine, theirs in (parts, parts[::-1])]
    short = all(words and not words[0].isdigit() for words in own)
    one, two = (" ".join(words).replace("_", " ") for words in (own if short else parts))
    return one, two


def judge_paper(root: Path, paper: str) -> list[Judgement]:
    """Give the verdicts of all claims of a paper by the numbers of the last build."""
    claims, metrics = ledger(root, paper), functools.cache(functools.partial(recorded, root))
    try:
        return [judge(claim, metrics) for claim in claims]
    except Fault as error:
        raise Fault(f"book/{paper}/claims.yml, {error}") from error


def decided_by(root: Path, notebook: str) -> list[Claim]:
    """List the claims of the paper's ledger that the numbers of this notebook alone decide."""
    paper = notebook.partition("/")[0]
    if paper not in papers(root):
        return []
    return [c for c in ledger(root, paper) if c.metrics and all(m.startswith(f"{notebook}:") for m in c.metrics)]
