"""The ledger of a paper: every claim that it prints, our controls and its errata, as `book/<paper>/claims.yml`."""

from __future__ import annotations

import datetime
import functools
import math
import operator
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from execbook import contents, display, yamltext
from execbook.errors import Fault, Misuse, explain
from execbook.tolerance import Tolerance

Kind = Literal["claim", "control", "erratum"]
"""Printed by the paper; added by us; a formula that is damaged in the text. Only claims have a verdict."""
Verdict = Literal["reproduced", "depends-on-the-reading", "calibrated", "not-reproduced", "not-testable"]
HELD = {True: "holds", False: "does not hold", None: "not computed"}
"""Outcome of a control, in words."""
_SAME = 1e-6  # relative difference of numbers that are one but for rounding
_OPERATORS = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "=": functools.partial(math.isclose, rel_tol=_SAME),
}
MetricName = Annotated[str, Field(pattern=r"^[\w.-]+/[\w.-]+:[A-Za-z0-9_.+-]+$")]
Label = Annotated[str, Field(pattern=r"^[a-z0-9][\w.-]*$")]
Id = Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9.-]*$")]


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


class Rule(_Strict):
    """What a kind of statement asks for, the same in all parts of the book (`book/rules.yml`).

    between : the smallest and largest ratio ours / printed;  factors : those that a comparison may use.
    """

    means: str
    between: tuple[float, float] | None = None
    factors: tuple[float, ...] = ()

    def accept(self, printed: float) -> dict[str, list[float]]:
        """Give the range of our number for a printed one."""
        return {"range": sorted(ratio * printed for ratio in self.between)}


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


class Past(_Strict):
    """A verdict that a claim had until a day, and why it moved."""

    until: datetime.date
    verdict: str
    reason: str


class Claim(_Strict):
    """An entry of the ledger: what decides it, and what is expected.

    source : the passage of the text;  rule : of `book/rules.yml`;  evidence : labels of figures and tables that show
    it;  requires : claims that must hold for this one;  text, should : the formula of an erratum as it stands in the
    text, and as it should read;  holds : whether a control does.
    """

    id: Id
    kind: Kind = "claim"
    where: str
    source: str
    says: str
    printed: float | str | None = None
    reads: float | None = None
    because: str | None = None
    unit: str = ""
    rule: str | None = None
    metric: MetricName | None = None
    compare: tuple[Compare, ...] = ()
    accept: Accept | None = None
    assumes: str | None = None
    calibrated: str | None = None
    reason: str | None = None
    evidence: tuple[Label, ...] = ()
    requires: tuple[Id, ...] = ()
    text: str | None = None
    should: str | None = None
    history: tuple[Past, ...] = ()
    verdict: Verdict | None = None
    holds: bool | None = None

    @model_validator(mode="before")
    @classmethod
    def _listed(cls, data: Any) -> Any:
        if isinstance(data, dict) and isinstance(data.get("compare"), dict):
            return data | {"compare": [data["compare"]]}
        return data

    @model_validator(mode="after")
    def _coherent(self) -> Claim:
        by_number, alone = bool(self.accept) and not self.accept.alone, not self.metrics
        claim, control, erratum = (self.kind == kind for kind in ("claim", "control", "erratum"))
        faults = [
            (self.metric and self.compare, "a claim has a metric or a compare, not both"),
            (
                (self.reads is None) != (self.because is None),
                "reads and because go together: why is it not read as printed?",
            ),
            (self.metric and not self.accept, "a metric needs accept, or a rule with a range"),
            (self.accept and not self.metric, "accept needs a metric"),
            (by_number and self.reference is None, "accept needs a printed (or reads) number to compare with"),
            (claim and alone and not self.reason, "a claim that nothing decides needs a reason"),
            (claim != (self.verdict is not None), "a claim has a verdict, a control or an erratum has none"),
            (
                control != (self.holds is not None),
                "a control says holds: true or false, a claim or an erratum does not",
            ),
            (control and alone, "a control needs a metric or a compare"),
            (control and self.printed is not None, "a control is ours: nothing of it is printed"),
            (erratum != (self.text is not None), "an erratum quotes the text, another entry does not"),
            (erratum != (self.should is not None), "an erratum says what should stand there, another entry does not"),
            (erratum and not alone, "an erratum is not decided by a number"),
        ]
        for found, words in faults:
            if found:
                raise ValueError(words)
        return self

    @property
    def expected(self) -> str:
        """Give the outcome that the entry expects, in words."""
        return self.verdict.replace("-", " ") if self.verdict else HELD[self.holds]

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

    @property
    def notebooks(self) -> list[str]:
        """Name the notebooks that record these numbers, each once."""
        return list(dict.fromkeys(name.partition(":")[0] for name in self.metrics))


def papers(root: Path) -> list[str]:
    """List the papers that have a ledger, in the order of the book."""
    found = (p.parent.name for p in (root / "book").glob("*/claims.yml") if not p.parent.name.startswith("_"))
    return sorted(found, key=contents.order(root))


def ledger(root: Path, paper: str) -> list[Claim]:
    """Read the entries of a paper; raises Fault for a wrong entry, Misuse for an unknown paper."""
    path = root / "book" / paper / "claims.yml"
    if not re.fullmatch(r"\w[\w.-]*", paper) or not path.is_file():
        raise Misuse(f"{paper!r} has no ledger ({path}); papers with one are {', '.join(papers(root)) or 'none yet'}.")
    return list(_claims(path.read_text(encoding="utf-8"), f"book/{paper}/claims.yml", _text_of_rules(root)))


def rules(root: Path) -> dict[str, Rule]:
    """Read what each kind of statement asks for, by name; raises Fault where the file is malformed."""
    return dict(_rules(_text_of_rules(root)))


def _text_of_rules(root: Path) -> str:
    path = root / "book" / "rules.yml"
    return path.read_text(encoding="utf-8") if path.is_file() else "{}"


@functools.lru_cache(maxsize=4)
def _rules(text: str) -> dict[str, Rule]:
    try:
        return {name: Rule.model_validate(entry) for name, entry in yamltext.parse(text).items()}
    except (ValueError, AttributeError) as error:
        words = explain(error) if isinstance(error, ValidationError) else error
        raise Fault(f"book/rules.yml: {words}.") from error


@functools.lru_cache(maxsize=16)
def _claims(text: str, where: str, rules_text: str) -> tuple[Claim, ...]:
    known = _rules(rules_text)
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
            claim = Claim.model_validate(_ruled(entry, known) if isinstance(entry, dict) and known else entry)
        except ValidationError as error:
            raise Fault(f"{where}, claim {name}: {explain(error)}.") from error
        except ValueError as error:
            raise Fault(f"{where}, claim {name}: {error}.") from error
        if claim.id in claims:
            raise Fault(f"{where}, claim {name}: the id is taken by an earlier claim.")
        claims[claim.id] = claim
    for claim in claims.values():
        if missing := [name for name in claim.requires if name not in claims]:
            raise Fault(f"{where}, claim {claim.id}: it requires {missing[0]}, which is no claim of this ledger.")
    return tuple(claims.values())


def _ruled(entry: Mapping[str, Any], known: Mapping[str, Rule]) -> Mapping[str, Any]:
    """Give an entry with what its rule accepts; raises ValueError where rule and entry disagree."""
    name = entry.get("rule")
    if name is None:
        return entry
    if name not in known:
        raise ValueError(f"rule {name!r} is none of {', '.join(known)}")
    rule = known[name]
    if rule.between is not None and entry.get("metric"):
        if "accept" in entry:
            raise ValueError(f"rule {name} says what is accepted; leave accept out")
        number = entry.get("reads", entry.get("printed"))
        if not isinstance(number, (int, float)):
            raise ValueError(f"rule {name} needs a printed (or reads) number")
        return {**entry, "accept": rule.accept(float(number))}
    pairs = entry.get("compare") or ()
    for pair in [pairs] if isinstance(pairs, dict) else pairs:
        given, allowed = pair.get("factor", 1.0), [f for factor in rule.factors for f in (factor, 1.0 / factor)]
        if rule.factors and not any(math.isclose(given, factor) for factor in allowed):
            raise ValueError(f"rule {name} compares with one of {', '.join(f'{f:g}' for f in allowed)}, not {given:g}")
    return entry
