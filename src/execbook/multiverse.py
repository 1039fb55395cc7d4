"""The readings that a paper admits: its open choices, worlds made of them, and how many of these a claim survives.

`book/<paper>/readings.yml` lists what the paper leaves open: each choice with its admissible options, or a range, and
the passage that leaves it open. A world is one option of every choice. Choices are independent and the options of a
choice weigh equally, so a claim's share is the part of the worlds in which it holds.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import combinations
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from execbook import yamltext
from execbook.errors import Fault, Misuse, explain
from execbook.ledger import Claim

READINGS = "90-readings"
"""Stem of the page of each part that runs its worlds."""
World = dict[str, str | float]
"""Choice -> option, or number."""
_BELOW, _ABOVE = "below", "above"
"""The halves of a range."""
_CERTAIN = 3.0
"""A choice decides where two groups of its options differ by so many standard errors."""
Word = Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9-]*$")]


class _Strict(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Option(_Strict):
    """One way to read a passage: its name, what it means, and the passage that supports it."""

    id: Word
    says: str
    passage: str | None = None


class Choice(_Strict):
    """What the paper leaves open, where it does, and the options or the range that it admits."""

    id: Word
    asks: str
    passage: str
    default: str | float
    options: tuple[Option, ...] = ()
    range: tuple[float, float] | None = None
    unit: str = ""

    @model_validator(mode="after")
    def _coherent(self) -> Choice:
        names = [option.id for option in self.options]
        low, high = self.range or (0.0, 1.0)
        faults = [
            (bool(names) == (self.range is not None), "a choice has options or a range"),
            (len(set(names)) < len(names), "an option is named twice"),
            (names and (len(names) < 2 or self.default not in names), f"the default is one of two or more: {names}"),
            (not low < high, f"the range [{low:g}, {high:g}] is empty"),
            (self.range and not isinstance(self.default, float), "the default of a range is a number"),
        ]
        for found, words in faults:
            if found:
                raise ValueError(words)
        return self

    @property
    def groups(self) -> tuple[str, ...]:
        """Name the options, or the halves of the range."""
        return tuple(option.id for option in self.options) or (_BELOW, _ABOVE)

    def group(self, value: str | float) -> str:
        """Name the option, or the half of the range, of a value."""
        return value if self.range is None else _BELOW if value < self.middle else _ABOVE

    @property
    def middle(self) -> float:
        """Give the middle of the range."""
        return sum(self.range) / 2.0

    def draw(self, size: int, rng: np.random.Generator) -> list[str | float]:
        """Draw so many values: every option equally often, or one from each stratum of the range."""
        if self.range is None:
            names = rng.permutation(self.groups)  # which are drawn once more where size is no multiple
            return rng.permutation(np.resize(names, size)).tolist()
        low, high = self.range
        return (low + (high - low) * (rng.permutation(size) + rng.random(size)) / size).tolist()


class Share(NamedTuple):
    """How often a claim holds: part of the worlds, by group of each choice, and the choice that decides.

    groups : choice -> group -> part.
    """

    part: float
    worlds: int
    groups: Mapping[str, Mapping[str, float]]
    decided_by: str | None

    @property
    def error(self) -> float:
        """Give the standard error of the part (one half of a world where all agree)."""
        return max(math.sqrt(self.part * (1.0 - self.part) / self.worlds), 0.5 / self.worlds)


def choices(root: Path, paper: str) -> list[Choice]:
    """Read what a paper leaves open; raises Misuse where nothing is declared, Fault for a wrong entry."""
    where = f"book/{paper}/readings.yml"
    try:
        text = (root / where).read_text(encoding="utf-8")
    except OSError as error:
        raise Misuse(f"{paper!r} declares no readings: {where} is missing.") from error
    found = []
    for k, entry in enumerate(_entries(text, where), 1):
        name = entry.get("id", f"number {k}") if isinstance(entry, dict) else f"number {k}"
        try:
            found.append(Choice.model_validate(entry))
        except ValidationError as error:
            raise Fault(f"{where}, choice {name}: {explain(error)}.") from error
    if len({choice.id for choice in found}) < len(found):
        raise Fault(f"{where}: a choice is named twice.")
    return found


def _entries(text: str, where: str) -> list[Any]:
    try:
        entries = yamltext.parse(text)
    except ValueError as error:
        raise Fault(f"{where}, {error}.") from error
    if not isinstance(entries, list) or not entries:
        raise Fault(f"{where} holds no list of choices.")
    return entries


def default(declared: Iterable[Choice]) -> World:
    """Give the world of the part's own set-up."""
    return {choice.id: choice.default for choice in declared}


def draw(declared: Sequence[Choice], size: int, seed: int) -> list[World]:
    """Draw worlds in which every option of every choice occurs equally often."""
    rng = np.random.default_rng(seed)
    columns = [choice.draw(size, rng) for choice in declared]
    return [dict(zip((choice.id for choice in declared), row, strict=True)) for row in zip(*columns, strict=True)]


def count(declared: Sequence[Choice], worlds: Sequence[World], held: Mapping[str, Sequence[bool]]) -> dict[str, float]:
    """Count in which part of the worlds each claim held.

    held : claim -> one bool a world. Returns the numbers to record: `worlds`, `share.<claim>` and
    `part.<choice>.<group>.<claim>`.
    """
    numbers: dict[str, float] = {"worlds": len(worlds)}
    for claim, outcomes in held.items():
        outcome = np.asarray(outcomes, dtype=float)
        numbers[f"share.{claim}"] = float(outcome.mean())
        for choice in declared:
            groups = np.array([choice.group(world[choice.id]) for world in worlds])
            for group in choice.groups:
                if (groups == group).any():
                    numbers[f"part.{choice.id}.{group}.{claim}"] = float(outcome[groups == group].mean())
    return numbers


def share_of(claim: str, readings: Mapping[str, Mapping[str, Any]]) -> Share | None:
    """Give the share of a claim from the recorded numbers of the page of readings, or None where it has none."""
    total = readings.get(f"share.{claim}")
    if total is None:
        return None
    groups: dict[str, dict[str, float]] = {}
    for key, entry in _parts(readings, claim):
        _, choice, group, _ = key.split(".", 3)
        groups.setdefault(choice, {})[group] = entry["value"]
    worlds = int(readings["worlds"]["value"])
    return Share(total["value"], worlds, groups, _decisive(groups, worlds, total["value"]))


def _parts(readings: Mapping[str, Any], claim: str) -> list[tuple[str, Any]]:
    return [(k, v) for k, v in readings.items() if k.startswith("part.") and k.split(".", 3)[3] == claim]


def _decisive(groups: Mapping[str, Mapping[str, float]], worlds: int, part: float) -> str | None:
    """Name the choice of the first split of a decision tree: two groups of its options that differ most.

    Groups have equal weight; the split with the largest variance between them wins.
    """
    best, name = 0.0, None
    for choice, parts in groups.items():
        for size in range(1, len(parts) // 2 + 1):
            for left in combinations(parts, size):
                one = float(np.mean([parts[g] for g in left]))
                other = float(np.mean([parts[g] for g in parts if g not in left]))
                weight = size / len(parts)
                error = math.sqrt(part * (1.0 - part) / (worlds * weight * (1.0 - weight)))
                gain = weight * (1.0 - weight) * (one - other) ** 2
                if abs(one - other) > _CERTAIN * error > 0.0 and gain > best:
                    best, name = gain, choice
    return name


def survived(
    judge: Callable[[Claim, Callable[[str], Any]], bool | None],
    claims: Iterable[Claim],
    results: Sequence[Mapping[str, float]],
) -> dict[str, list[bool]]:
    """Tell for each claim in which worlds it held.

    judge : gives whether a claim holds by the numbers of a notebook;  results : of each world, `notebook:key` -> number,
    the same keys in all. Claims whose numbers a world does not give have no share.
    """
    given = set(results[0]) if results else set()
    tables = [functools.partial(_of_notebook, result) for result in results]
    return {c.id: [bool(judge(c, t)) for t in tables] for c in claims if c.metrics and given.issuperset(c.metrics)}


def _of_notebook(result: Mapping[str, float], notebook: str) -> dict[str, dict[str, Any]]:
    start = f"{notebook}:"
    finite = {k: (v if math.isfinite(v) else None) for k, v in result.items() if k.startswith(start)}
    return {key.removeprefix(start): {"value": value, "unit": ""} for key, value in finite.items()}
