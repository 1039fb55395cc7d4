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

from execbook import display, yamltext
from execbook.errors import Fault, Misuse, explain
from execbook.ledger import Claim

READINGS = "90-readings"
"""Stem of the page of each part that runs its worlds."""
World = dict[str, str | float]
"""Choice -> option, or number; and `world` -> its place, for seeds."""
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
        """Give the standard error of the part."""
        return sampling_error(self.part, self.worlds)


def sampling_error(part: float, worlds: int) -> float:
    """Give the standard error of a share of so many worlds; where nearly all agree, one and a half worlds."""
    return max(math.sqrt(part * (1.0 - part) / worlds), 1.5 / worlds)


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
    return {"world": 0, **{choice.id: choice.default for choice in declared}}


def draw(declared: Sequence[Choice], size: int, seed: int) -> list[World]:
    """Draw worlds in which every option of every choice occurs equally often; their places start at 1."""
    rng = np.random.default_rng(seed)
    columns = [choice.draw(size, rng) for choice in declared]
    names = ["world", *(choice.id for choice in declared)]
    return [dict(zip(names, row, strict=True)) for row in zip(range(1, size + 1), *columns, strict=True)]


def count(declared: Sequence[Choice], worlds: Sequence[World], held: Mapping[str, Sequence[bool]]) -> dict[str, float]:
    """Count in which part of the worlds each claim held.

    held : claim -> one bool a world. Returns the numbers to record: `share.<claim>`, `count.<claim>`, the number of
    worlds, `part.<choice>.<group>.<claim>`, and the settings that match most claims, see `_matching`.
    """
    numbers: dict[str, float] = {}
    for claim, outcomes in held.items():
        outcome = np.asarray(outcomes, dtype=float)
        numbers[f"share.{claim}"], numbers[f"count.{claim}"] = float(outcome.mean()), outcome.size
        for choice in declared:
            groups = np.array([choice.group(world[choice.id]) for world in worlds])
            for group in choice.groups:
                if (groups == group).any():
                    numbers[f"part.{choice.id}.{group}.{claim}"] = float(outcome[groups == group].mean())
    return numbers | _matching(declared, worlds, held)


def _matching(
    declared: Sequence[Choice], worlds: Sequence[World], held: Mapping[str, Sequence[bool]]
) -> dict[str, float]:
    """Find the worlds in which most claims hold together: which settings the authors can have used.

    Returns `most.claims`, the largest number of claims that hold in one world; `most.worlds`, in how many worlds so
    many do; and `most.<choice>.<group>`, the part of these worlds with this option.
    """
    if not held:
        return {}
    together = np.sum([np.asarray(outcomes, dtype=int) for outcomes in held.values()], axis=0)
    best = [world for world, number in zip(worlds, together, strict=True) if number == together.max()]
    numbers: dict[str, float] = {"most.claims": int(together.max()), "most.worlds": len(best)}
    for choice in declared:
        chosen = [choice.group(world[choice.id]) for world in best]
        numbers |= {f"most.{choice.id}.{group}": chosen.count(group) / len(best) for group in choice.groups}
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
    worlds = int(readings[f"count.{claim}"]["value"])
    return Share(total["value"], worlds, groups, _decisive(groups, worlds, total["value"]))


def guarded(key: str, entries: Mapping[str, Mapping[str, Any]]) -> float | None:
    """Give how far a recorded share may move, its sampling error, or None for another key."""
    if not key.startswith(("share.", "part.")):
        return None
    claim = key.split(".", 1)[1] if key.startswith("share.") else key.split(".", 3)[3]
    worlds = int(entries[f"count.{claim}"]["value"])
    if key.startswith("part."):
        worlds = max(worlds // sum(k.split(".")[1] == key.split(".")[1] for k, _ in _parts(entries, claim)), 1)
    return sampling_error(entries[key]["value"], worlds)


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

    judge : gives whether a claim holds by the numbers of a notebook;  results : of each world, `notebook:key` ->
    number, the same keys in all. Claims whose numbers a world does not give have no share.
    """
    given = set(results[0]) if results else set()
    tables = [functools.cache(functools.partial(_of_notebook, result)) for result in results]
    return {c.id: [bool(judge(c, t)) for t in tables] for c in claims if c.metrics and given.issuperset(c.metrics)}


def _of_notebook(result: Mapping[str, float], notebook: str) -> dict[str, dict[str, Any]]:
    start = f"{notebook}:"
    finite = {k: (v if math.isfinite(v) else None) for k, v in result.items() if k.startswith(start)}
    return {key.removeprefix(start): {"value": value, "unit": ""} for key, value in finite.items()}


def choices_table(declared: Iterable[Choice]) -> tuple[list[str], list[list[str]], str]:
    """Give header, rows and caption of what a paper leaves open."""
    rows = []
    for choice in declared:
        options = [f"{o.id}{' (here)' * (o.id == choice.default)}: {o.says}" for o in choice.options]
        if choice.range:
            low, high, usual = (display.quantity(v, choice.unit) for v in (*choice.range, choice.default))
            options = [f"{low} to {high}, here {usual}"]
        rows.append([choice.id, choice.asks, "; ".join(options), choice.passage])
    return ["choice", "question", "options", "passage that leaves it open"], rows, "What the paper leaves open."


def shares_table(entries: Iterable[Claim], shares: Mapping[str, Share]) -> tuple[list[str], list[list[Any]], str]:
    """Give header, rows and caption of the shares of the worlds in which each entry holds."""
    rows = []
    for entry in entries:
        if (share := shares.get(entry.id)) is None:
            continue
        parts = {c: ", ".join(f"{g} {100 * p:.0f}" for g, p in groups.items()) for c, groups in share.groups.items()}
        by = share.decided_by
        rows.append(
            [entry.id, f"{100 * share.part:.0f} ± {100 * share.error:.0f}", share.worlds, by, parts.get(by, "")]
        )
    caption = "Share of the worlds in which each claim holds, with its sampling error, and the choice that decides."
    return ["claim", "share (%)", "worlds", "decided by", "share by option (%)"], rows, caption


def sorted_shares(entries: Iterable[Claim], shares: Mapping[str, Share]) -> list[tuple[str, Share]]:
    """List entries and their shares, the smallest first."""
    listed = [(entry.id, shares[entry.id]) for entry in entries if entry.id in shares]
    return sorted(listed, key=lambda pair: (pair[1].part, pair[1].error, pair[0]))


def columns(listed: Sequence[tuple[str, Share]]) -> dict[str, list[Any]]:
    """Give the columns of the figure's data."""
    return {
        "claim": [name for name, _ in listed],
        "share_percent": [100.0 * share.part for _, share in listed],
        "error_percent": [100.0 * share.error for _, share in listed],
    }


def draw_shares(listed: Sequence[tuple[str, Share]]) -> Any:
    """Draw the shares as bars, the largest on top, with the limits of the verdicts."""
    from matplotlib.figure import Figure

    names, parts, errors = columns(listed).values()
    figure = Figure(figsize=(7.0, 1.2 + 0.19 * len(names)), layout="constrained")
    axes = figure.add_subplot()
    axes.barh(names, parts, xerr=errors, height=0.7, error_kw={"linewidth": 0.8})
    for limit in (10, 90):
        axes.axvline(limit, linestyle="--", linewidth=0.8, color="0.5")
    axes.set(xlabel="share of the worlds in which the claim holds (%)", xlim=(0, 100), ylim=(-0.6, len(names) - 0.4))
    axes.tick_params(axis="y", labelsize=7)
    return figure


SHARES_WORDS = {
    "caption": "Share of the worlds in which each claim holds, with its sampling error. From the right dashed line on, "
    "nine worlds of ten, a claim is reproduced; up to the left one, one of ten, it is not.",
    "alt": "Horizontal bars, one for each claim, from 0 to 100 per cent, with dashed lines at 10 and 90 per cent.",
}
