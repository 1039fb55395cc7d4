"""How far a number may be from another: declared, or by the rule from its spread.

The rule, for a stored value v whose spread s is the largest difference between computing settings ever seen:

    s > 1e-3 |v|   the number is rounding: |ours| <= ten times the largest magnitude seen
    else           |ours - v| <= r |v|, with r = 30 s / |v| rounded up to a power of ten, at least 1e-9

A few settings are a small sample, and by luck a number may have come out nearly alike in all of them. A number that
moves at all therefore has at least a tenth of the median s / |v| of its notebook, but at most thirty times its own.

An array is judged by its largest element. `tests/reference/<paper>/guards.yml` declares the keys that the rule does not
fit (chaotic ones, arguments of a maximum, times), each with a reason.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from statistics import median

from pydantic import BaseModel, ConfigDict, Field, model_validator

_ROUNDING, _SPREADS, _FLOOR, _LARGEST = 1e-3, 30, 1e-9, 10
_FIXED, _LUCK = 1e-12, 0.1
_KINDS = {"rel", "abs", "factor", "size", "min", "max", "none"}
_TOGETHER = ({"rel", "abs"}, {"min", "max"})


class Tolerance(BaseModel):
    """One of: rel and abs (their sum), within a factor, a size, min and max, none at all."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
    rel: float | None = Field(default=None, ge=0)
    abs: float | None = Field(default=None, ge=0)
    factor: float | None = Field(default=None, ge=1)
    size: float | None = Field(default=None, ge=0)
    min: float | None = None
    max: float | None = None
    none: bool | None = None

    @model_validator(mode="after")
    def _one(self) -> Tolerance:
        kinds = self.model_fields_set & _KINDS
        if len(kinds) != 1 and kinds not in _TOGETHER:
            raise ValueError("a tolerance is exactly one of rel with abs, factor, size, min with max, none")
        if self.min is not None and self.max is not None and self.min > self.max:
            raise ValueError(f"the range [{self.min:g}, {self.max:g}] is empty")
        return self

    @property
    def alone(self) -> bool:
        """Tell whether it judges a number without a wanted one."""
        return not self.model_fields_set & {"rel", "abs", "factor"}

    def edges(self, wanted: float | None) -> tuple[float, float]:
        """Give the smallest and the largest number that is right."""
        if self.none:
            return -math.inf, math.inf
        if self.size is not None:
            return -self.size, self.size
        if self.alone:
            return -math.inf if self.min is None else self.min, math.inf if self.max is None else self.max
        if wanted is None:
            return math.inf, -math.inf
        if self.factor is not None:
            low, high = sorted((wanted / self.factor, wanted * self.factor))
            return low, high
        return wanted - self.allowed(wanted), wanted + self.allowed(wanted)

    def holds(self, ours: float, wanted: float | None) -> bool:
        """Tell whether `ours` is right, where `wanted` is printed or stored."""
        low, high = self.edges(wanted)
        return low <= ours <= high

    def allowed(self, largest: float) -> float:
        """Give the absolute difference that `rel` and `abs` allow to a number of this size."""
        return (self.abs or 0.0) + (self.rel or 0.0) * abs(largest)

    def __str__(self) -> str:
        words = self.model_dump(include=_KINDS, exclude_none=True)
        return "not guarded" if self.none else " + ".join(f"{kind} {value:g}" for kind, value in words.items())


def is_rounding(size: float, spread: float) -> bool:
    """Tell whether a number of this magnitude has no digits of its own."""
    return spread > _ROUNDING * size


def usual_spread(numbers: Iterable[tuple[float | None, float]]) -> float:
    """Give the median s / |v| of the numbers (v, s) that move and are not rounding, or 0."""
    sized = [(abs(value), spread) for value, spread in numbers if value]
    moving = [spread / size for size, spread in sized if spread > _FIXED * size and not is_rounding(size, spread)]
    return median(moving) if moving else 0.0


def by_rule(value: float | None, spread: float, largest: float | None = None, usual: float = 0.0) -> Tolerance:
    """Give the tolerance of a number (of an array: its largest element) by the rule.

    spread, largest : of all that was ever seen;  usual : the `usual_spread` of its notebook.
    """
    size = abs(value or 0.0)
    if is_rounding(size, spread):
        return Tolerance(size=_LARGEST * max(size, largest or 0.0))
    relative = spread / size if size else 0.0
    if relative > _FIXED:
        relative = max(relative, min(_LUCK * usual, _SPREADS * relative))
    ratio = _SPREADS * relative
    return Tolerance(rel=max(_FLOOR, float(f"1e{math.ceil(math.log10(ratio))}")) if ratio else _FLOOR)
