"""Where estimates meet truth and references: the statistics of the paper, and those that it does not have."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from geokalman.airborne.model import Array


class Statistics(NamedTuple):
    """A : mean (16); D_raw : root mean square; D_centred : standard deviation, the two readings of (17) [mGal]."""

    A: float
    D_raw: float
    D_centred: float


def statistics(difference: Array) -> Statistics:
    """Equations (16) and (17) of a difference (n,), in both readings."""
    return Statistics(float(difference.mean()), float(np.sqrt(np.mean(difference**2))), float(difference.std()))


def sd(difference: Array) -> float:
    """Standard deviation of a difference (n,) about its mean where it is finite, NaN where it is so nowhere."""
    return float(np.nanstd(difference)) if np.isfinite(difference).any() else np.nan


def inner(t: Array, trim_s: float) -> slice:
    """Epochs of a line without its first and last `trim_s` seconds. Raises ValueError where nothing is left."""
    n = round(trim_s / (t[1] - t[0]))
    if len(t) - 2 * n < 2:
        raise ValueError(f"A line of {t[-1] - t[0]:.0f} s has nothing left without {trim_s:g} s at either end.")
    return slice(n, len(t) - n)


class Paired(NamedTuple):
    """Mean of paired differences, and its standard error with the pairs taken as independent and in blocks."""

    mean: float
    error: float
    block_error: float
    better: int
    count: int


def paired(ours: Sequence[float], theirs: Sequence[float], block: int = 6) -> Paired:
    """Mean of ours - theirs over lines with standard errors; neighbouring lines go in blocks, since they share
    errors.
    """
    d = np.asarray(ours, float) - np.asarray(theirs, float)
    n = len(d)
    blocks = [part.mean() for part in np.array_split(d, max(1, n // block))]
    error = d.std(ddof=1) / np.sqrt(n) if n > 1 else np.nan
    block_error = np.std(blocks, ddof=1) / np.sqrt(len(blocks)) if len(blocks) > 1 else np.nan
    return Paired(float(d.mean()), float(error), float(block_error), int((d < 0).sum()), n)
