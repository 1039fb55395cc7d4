"""The ledger of a paper: every claim it prints, held against the recorded numbers, with a computed verdict."""

from __future__ import annotations

import json
import operator
import re
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from geokalman.reproduce import contents, display, yamltext
from geokalman.reproduce.errors import Fault, Misuse

Verdict = Literal["reproduced", "calibrated", "under-interpretation", "not-reproduced", "not-testable"]
VERDICTS: tuple[Verdict, ...] = ("reproduced", "calibrated", "under-interpretation", "not-reproduced", "not-testable")
_OPERATORS: dict[str, Callable[[float, float], bool]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}
NEAR = 0.02
"""Distance from its threshold, relative to it, up to which a claim is listed as near."""
_METRIC = r"^[\w.-]+/[\w.-]+:[A-Za-z0-9_.+-]+$"
MetricName = Annotated[str, Field(pattern=_METRIC)]
Metrics = Mapping[str, Mapping[str, Any]]
"""Recorded numbers of one notebook: key -> {value, unit}."""


class _Strict(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Accept(_Strict):
    """How far ours may be from the paper's: relative, absolute, by a factor, or in a range of its own."""

    rel: float | None = Field(default=None, ge=0)
    abs: float | None = Field(default=None, ge=0)
    factor: float | None = Field(default=None, ge=1)
    range: tuple[float, float] | None = None

    @model_validator(mode="after")
    def _one(self) -> Accept:
        if len(self.model_fields_set) != 1:
            raise ValueError("accept wants exactly one of rel, abs, factor, range")
        if self.range and self.range[0] > self.range[1]:
            raise ValueError(f"the range {list(self.range)} is empty")
        return self

    def holds(self, ours: float, printed: float | None) -> bool:
        """Is `ours` within tolerance of `printed`?"""
        low, high = self.edges(printed)
        return low <= ours <= high

    def edges(self, printed: float | None) -> tuple[float, float]:
        """Smallest and largest number accepted."""
        if self.range is not None:
            return self.range
        assert printed is not None
        if self.factor is not None:
            low, high = sorted((printed / self.factor, printed * self.factor))
            return low, high
        allowed = self.abs if self.abs is not None else (self.rel or 0.0) * abs(printed)
        return printed - allowed, printed + allowed

    def __str__(self) -> str:
        if self.range is not None:
            return f"accepted {display.number(self.range[0])} to {display.number(self.range[1])}"
        if self.factor is not None:
            return f"accepted within a factor {self.factor:g}"
        return (
            f"accepted ±{self.rel * 100:g} %" if self.rel is not None else f"accepted ±{display.number(self.abs or 0)}"
        )


class Compare(_Strict):
    """left op factor * right."""

    left: MetricName
    op: Literal["<", "<=", ">", ">="]
    right: MetricName | float
    factor: float = 1.0

    def threshold(self, values: Mapping[str, float]) -> float:
        """The right side, of the recorded `values`."""
        return self.factor * (values[self.right] if isinstance(self.right, str) else self.right)


class Claim(_Strict):
    """One number or statement of the paper, how we read it, what decides it, and the expected verdict."""

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
        if self.metric and self.compare:
            raise ValueError("a claim has a metric or a compare, not both")
        if (self.reads is None) != (self.because is None):
            raise ValueError("reads and because go together: why do we read another number than the printed one?")
        if self.metric and self.accept is None:
            raise ValueError("a metric needs accept")
        if self.accept and not self.metric:
            raise ValueError("accept needs a metric")
        if self.accept and self.accept.range is None and self.reference is None:
            raise ValueError("accept needs a printed (or reads) number to compare with")
        if not self.metric and not self.compare and not self.reason:
            raise ValueError("a claim that nothing decides needs a reason")
        return self

    @property
    def reference(self) -> float | None:
        """The paper's number: as we read it, else as printed."""
        if self.reads is not None:
            return self.reads
        return self.printed if isinstance(self.printed, float) else None

    @property
    def metrics(self) -> list[str]:
        """Names of the recorded numbers that decide the claim."""
        sides = [side for c in self.compare for side in (c.left, c.right) if isinstance(side, str)]
        return [self.metric] if self.metric else sides


class Judgement(NamedTuple):
    """A claim with our number and the verdict it has now (None where a number is not recorded)."""

    claim: Claim
    ours: float | str | None
    verdict: Verdict | None
    why: str
    margin: float | None = None  # distance of ours from the nearest threshold, relative to it

    @property
    def as_expected(self) -> bool:
        """Is the verdict the one that the ledger expects?"""
        return self.verdict == self.claim.verdict

    @property
    def is_near(self) -> bool:
        """Does our number lie within `NEAR` of a threshold?"""
        return self.margin is not None and self.margin <= NEAR


def papers(root: Path) -> list[str]:
    """Papers that have a ledger, in the order of the book."""
    found = (p.parent.name for p in (root / "book").glob("*/claims.yml") if not p.parent.name.startswith("_"))
    return sorted(found, key=contents.order(root))


def ledger(root: Path, paper: str) -> list[Claim]:
    """The claims of a paper; raises Fault with file and claim for a malformed entry, Misuse for an unknown paper."""
    path = root / "book" / paper / "claims.yml"
    if not re.fullmatch(r"\w[\w.-]*", paper) or not path.is_file():
        raise Misuse(f"{paper!r} has no ledger ({path}); papers with one are {', '.join(papers(root)) or 'none yet'}.")
    where = f"book/{paper}/claims.yml"
    try:
        entries = yamltext.parse(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise Fault(f"{where}, {error}") from error
    if not isinstance(entries, list):
        raise Fault(f"{where} holds no list of claims.")
    claims: dict[str, Claim] = {}
    for k, entry in enumerate(entries, 1):
        name = entry.get("id", f"number {k}") if isinstance(entry, dict) else f"number {k}"
        try:
            claim = Claim.model_validate(entry)
        except ValidationError as error:
            raise Fault(f"{where}, claim {name}: {_explain(error)}.") from error
        if claim.id in claims:
            raise Fault(f"{where}, claim {name}: the id is taken by an earlier claim.")
        claims[claim.id] = claim
    return list(claims.values())


def _explain(error: ValidationError) -> str:
    found = []
    for problem in error.errors():
        place = ".".join(str(p) for p in problem["loc"])
        text = problem["msg"].removeprefix("Value error, ")
        found.append(f"{place}: {text}" if place else text)
    return "; ".join(dict.fromkeys(found))


def recorded(root: Path, notebook: str) -> Metrics | None:
    """Paper-scale numbers of a notebook from the last build, or None where it was not run."""
    path = root / "book" / "_build" / "metrics" / f"{notebook}.json"
    return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else None


def judge(claim: Claim, metrics: Callable[[str], Metrics | None]) -> Judgement:
    """The verdict of a claim, by the recorded numbers that `metrics(notebook)` gives.

    The most critical word that applies: not-testable, not-reproduced, calibrated, under-interpretation, reproduced.
    """
    if not claim.metrics:
        return Judgement(claim, None, "not-testable", claim.reason or "")
    values: dict[str, float] = {}
    units: dict[str, str] = {}
    for name in claim.metrics:
        notebook, _, key = name.partition(":")
        entry = (metrics(notebook) or {}).get(key)
        if entry is None:
            return Judgement(claim, None, None, f"{name} is not recorded")
        if claim.metric and claim.unit and entry["unit"] and claim.unit != entry["unit"]:
            raise Fault(
                f"claim {claim.id} is in {claim.unit}, but {name} is recorded in {entry['unit']}; they must agree."
            )
        if entry["value"] is None:
            return Judgement(claim, None, "not-reproduced", f"{name} is not finite")
        values[name], units[name] = entry["value"], entry["unit"]
    for c in claim.compare:
        if isinstance(c.right, str) and units[c.left] and units[c.right] and units[c.left] != units[c.right]:
            raise Fault(
                f"claim {claim.id} compares {c.left}, recorded in {units[c.left]}, with {c.right}, recorded in "
                f"{units[c.right]}; they must agree."
            )
    if claim.metric:
        ours: float | str = values[claim.metric]
        assert claim.accept is not None
        holds, why = claim.accept.holds(ours, claim.reference), str(claim.accept)
        edges = set(claim.accept.edges(claim.reference))  # what must be equal is near nothing
        thresholds = [(ours, edge) for edge in edges if len(edges) > 1]
    else:
        ours, holds = _compare(claim.compare, values, units)
        why = ""
        thresholds = [(values[c.left], c.threshold(values)) for c in claim.compare]
    if not holds:
        verdict, words = "not-reproduced", claim.reason
    elif claim.calibrated:
        verdict, words = "calibrated", claim.calibrated
    elif claim.assumes:
        verdict, words = "under-interpretation", claim.assumes
    else:
        verdict, words = "reproduced", None
    margin = min((abs(number / edge - 1) for number, edge in thresholds if edge), default=None)
    return Judgement(claim, ours, verdict, "; ".join(filter(None, (words, why))), margin)


def _compare(
    comparisons: tuple[Compare, ...], values: Mapping[str, float], units: Mapping[str, str]
) -> tuple[str, bool]:
    """Both sides of each comparison with their unit and what tells their names apart, and whether all hold."""
    texts, all_hold = [], True
    for c in comparisons:
        left, right = values[c.left], values[c.right] if isinstance(c.right, str) else c.right
        holds = _OPERATORS[c.op](left, c.threshold(values))
        factor = f"{c.factor:g} × " if c.factor != 1 else ""
        names = _told_apart(c.left, c.right) if isinstance(c.right, str) else (_short(c.left), "")
        op, unit = c.op if holds else f"not {c.op}", display.unit_text(units[c.left])
        sides = [f"{display.number(value)} {unit}".rstrip() for value in (left, right)]
        told = [f" ({re.sub(r'[._]', ' ', name)})" if name else "" for name in names]
        texts.append(f"{sides[0]}{told[0]} {op} {factor}{sides[1]}{told[1]}")
        all_hold &= holds
    return "; ".join(texts), all_hold


def _short(metric: str) -> str:
    """The last two parts of a recorded name."""
    return ".".join(metric.partition(":")[2].split(".")[-2:])


def _told_apart(left: str, right: str) -> tuple[str, str]:
    """Two recorded names without the parts, at their ends, that they share; where all is shared, their notebooks."""
    keys = [metric.partition(":")[2].split(".") for metric in (left, right)]
    if keys[0] == keys[1]:
        return left.partition(":")[0].partition("/")[2], right.partition(":")[0].partition("/")[2]
    for end in (0, -1):
        while all(len(key) > 1 for key in keys) and keys[0][end] == keys[1][end]:
            if end == 0 and any(key[1].isdigit() for key in keys):
                break  # a bare number is no name
            for key in keys:
                del key[end]
    return ".".join(keys[0]), ".".join(keys[1])


def judge_paper(root: Path, paper: str) -> list[Judgement]:
    """Verdicts of all claims of a paper, by the numbers of the last build."""
    known: dict[str, Metrics | None] = {}

    def metrics(notebook: str) -> Metrics | None:
        if notebook not in known:
            known[notebook] = recorded(root, notebook)
        return known[notebook]

    try:
        return [judge(claim, metrics) for claim in ledger(root, paper)]
    except Fault as error:
        if str(error).startswith("claim "):
            raise Fault(f"book/{paper}/claims.yml, {error}") from error
        raise


def decided_by(root: Path, notebook: str) -> list[Claim]:
    """Claims of the paper's ledger that the numbers of this notebook alone decide."""
    paper = notebook.partition("/")[0]
    if paper not in papers(root):
        return []
    return [c for c in ledger(root, paper) if c.metrics and all(m.startswith(f"{notebook}:") for m in c.metrics)]


# Tables

HEADER = ("The paper says", "Printed", "Ours", "Verdict", "Why")


def row(judgement: Judgement, judged: bool = True) -> list[str]:
    """Cells of a claim under `HEADER`: place and words, printed number and our reading, ours, verdict, reason."""
    claim, ours = judgement.claim, judgement.ours

    def shown(value: float | str | None, digits: int = 4) -> str:
        if value is None:
            return ""
        return value if isinstance(value, str) else display.quantity(value, claim.unit, digits)

    printed = "" if claim.printed is None else shown(claim.printed, _digits(claim.printed))
    if claim.reads is not None:
        printed = "; ".join([*([printed] if printed else []), f"read as {shown(claim.reads, _digits(claim.reads))}"])
    why = "; ".join(text for text in (claim.because if claim.reads is not None else None, judgement.why) if text)
    says = f"{claim.where}: {claim.says}"
    return [says, printed, shown(ours), (judgement.verdict or "not computed") if judged else "", why if judged else ""]


def _digits(value: float | str) -> int:
    """Significant digits of a printed number, at most six."""
    return 0 if isinstance(value, str) else sum(c.isdigit() for c in f"{value:.5e}".partition("e")[0].rstrip("0"))


def of_notebook(root: Path, notebook: str, metrics: Metrics, judge: bool) -> tuple[list[str], list[list[str]], str]:
    """Header, rows and caption of the table of claims that this notebook decides; no verdicts unless `judge`."""
    judgements = [_judge(claim, lambda _: metrics) for claim in decided_by(root, notebook)]
    caption = "What the paper prints, how we read it, our number, and the verdict."
    if not judge:
        caption = "What the paper prints and our number. The parameters are not the paper's, so nothing is judged."
    rows = [row(j, judge) for j in judgements]
    keep = [k for k, name in enumerate(HEADER) if name in ("The paper says", "Ours") or any(r[k] for r in rows)]
    return [HEADER[k] for k in keep], [[row[k] for k in keep] for row in rows], caption


_judge = judge


def summary_markdown(root: Path, prefix: str = "") -> str:
    """Markdown table of how many claims of each paper have which verdict; links start at `prefix`."""
    rows = []
    for paper in papers(root):
        counts = Counter(j.verdict or "not computed" for j in judge_paper(root, paper))
        title = contents.title(root, f"{paper}/index")
        link = [f"[{title}]({prefix}{paper}/index.md)", str(sum(counts.values()))]
        rows.append(link + [str(counts[v]) for v in VERDICTS] + [str(counts["not computed"] or "")])
    header = ["Paper", "Claims", *(v.replace("-", " ") for v in VERDICTS), "not computed"]
    if not any(row[-1] for row in rows):
        header, rows = header[:-1], [row[:-1] for row in rows]
    return display.markdown_table(header, rows, ["left"] + ["right"] * (len(header) - 1))


def as_json(root: Path, paper: str) -> list[dict[str, Any]]:
    """The ledger of a paper with our numbers and verdicts, for scripts; `expected` is the verdict of the file."""
    found = []
    for claim, ours, verdict, why, margin in judge_paper(root, paper):
        entry = claim.model_dump(mode="json", exclude_none=True, exclude={"verdict"})
        judged = {"expected": claim.verdict, "verdict": verdict, "why": why, "margin": margin}
        found.append({"paper": paper, **entry, "ours": ours, **judged})
    return found


_BLOCK = re.compile(r"(<!-- verdicts -->\n).*?(<!-- /verdicts -->)", re.S)


def readme_with_block(root: Path) -> str:
    """The README's text with its block `<!-- verdicts -->` to `<!-- /verdicts -->` as the ledgers have it now."""
    text = (root / "README.md").read_text(encoding="utf-8")
    if not _BLOCK.search(text):
        raise Fault(
            "README.md lacks the lines <!-- verdicts --> and <!-- /verdicts -->, between which the verdicts stand."
        )
    return _BLOCK.sub(lambda m: f"{m[1]}{summary_markdown(root, 'book/')}\n{m[2]}", text)


def readme_agrees(root: Path) -> bool:
    """Is the README's block what the ledgers say now?"""
    return readme_with_block(root) == (root / "README.md").read_text(encoding="utf-8")
