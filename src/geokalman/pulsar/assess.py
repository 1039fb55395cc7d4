"""Hold estimates against the truth: errors in ICRF axes, consistency, convergence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import gammaincc

from geokalman.kalman.consistency import nees
from geokalman.physics import mars
from geokalman.pulsar.estimate import Diverged, Estimate
from geokalman.pulsar.model import CENTURIES, Array
from geokalman.pulsar.simulate import Truth

SETTLED = 100
"""First row of the statistics: rows 100 to the last, as all statistics of the part."""


class Score(NamedTuple):
    """One run: RMS of position [m] and of velocity in Mars axes [m/s], and consistency.

    x, y, z, d3 : in ICRF axes and in three dimensions; nees6, nis : NEES/6, NIS per range of the forward filter;
    early : 3-D RMS over rows 100 to 199 [m]; last : last k with a 3-D error above 1 km (0: none); fired : share of
    epochs with a factor below 1; skipped : share of epochs whose adaptation was skipped for want of three independent
    pulsars.
    """

    x: float
    y: float
    z: float
    d3: float
    vx: float
    vy: float
    vz: float
    nees6: float
    nis: float
    early: float
    last: int
    fired: float
    skipped: float


def errors(estimate: Estimate, flight: Truth) -> tuple[Array, Array]:
    """Give the errors of position, ICRF axes [m], and velocity, Mars axes [m/s], (n, 3) each."""
    error = estimate.x - flight.x
    return error[:, :3] @ mars.smci_from_icrf(CENTURIES), error[:, 3:]


def sigmas(estimate: Estimate) -> tuple[Array, Array]:
    """Give the sigmas that the filter states of what `errors` gives, (n, 3) each."""
    R = mars.icrf_from_smci(CENTURIES)
    turned = np.einsum("ij,kjl,il->ki", R, estimate.P[:, :3, :3], R)
    return np.sqrt(turned), np.sqrt(np.diagonal(estimate.P[:, 3:, 3:], axis1=1, axis2=2))


def rms(series: Array) -> Array:
    """Give the root mean square over time, the first axis."""
    return np.sqrt((series**2).mean(axis=0))


def score(estimate: Estimate, flight: Truth, first: int = SETTLED) -> Score:
    """Score one run over rows `first` to the last. Raises ValueError where none is left."""
    n = len(flight.t)
    if not 0 <= first < n:
        raise ValueError(f"first = {first} leaves no epoch of {n}; give more days.")
    position, velocity = errors(estimate, flight)
    distance = np.sqrt((position**2).sum(axis=1))
    axes, speed = rms(position[first:]), rms(velocity[first:])
    kept = estimate.observed[first:] > 0
    nis = float(estimate.nis[first:][kept].sum() / estimate.observed[first:].sum()) if kept.any() else np.nan
    beyond = np.flatnonzero(distance > 1000.0)
    return Score(
        *map(float, axes), float(rms(distance[first:])), *map(float, speed),
        float(nees(estimate.x[first:] - flight.x[first:], estimate.P[first:]).mean() / 6.0), nis,
        float(rms(distance[first : first + 100])), int(beyond[-1]) + 1 if beyond.size else 0,
        float((estimate.alpha < 1.0).mean()), float(estimate.skipped.mean()),
    )  # fmt: skip


def kept(scores: Sequence[Score | Diverged]) -> list[Score]:
    """Keep the runs of an ensemble that were not stopped."""
    return [score for score in scores if isinstance(score, Score)]


def distance(scores: Sequence[Score | Diverged]) -> float:
    """Give the mean 3-D RMS [m] of the runs that were not stopped, NaN where all were."""
    rest = kept(scores)
    return mean(rest).d3 if rest else np.nan


def _numbers(scores: Sequence[Score | Diverged]) -> Array:
    """Put scores into an array (runs, fields). Raises ValueError for none, or one stopped."""
    if not scores:
        raise ValueError("an ensemble without runs has no mean; give at least one seed.")
    for i, score in enumerate(scores):
        if isinstance(score, Diverged):
            raise ValueError(f"run {i + 1} of {len(scores)} has no score: {score} Leave such runs out with `kept`.")
    return np.array(scores, dtype=float)


def mean(scores: Sequence[Score]) -> Score:
    """Average over an ensemble. Raises ValueError where a run was stopped."""
    return Score(*_numbers(scores).mean(axis=0).tolist())


def spread(scores: Sequence[Score]) -> Score:
    """Give standard deviations over an ensemble (n - 1), zeros for one run. Raises as `mean`."""
    values = _numbers(scores)
    return Score(*(values.std(axis=0, ddof=1) if len(values) > 1 else np.zeros(values.shape[1])).tolist())


def false_alarm(k0: float, dof: int) -> float:
    """Give the chance that s = sqrt(chi^2_dof / dof) of a good prediction exceeds k0."""
    return float(gammaincc(0.5 * dof, 0.5 * dof * k0**2))


def paired(first: Sequence[Score], second: Sequence[Score]) -> tuple[float, float]:
    """Average the difference first - second of the 3-D RMS [m]; the mean and its standard error.

    The runs of one seed share their observations: the right statistic for filters whose results are close.
    """
    difference = np.array([a.d3 - b.d3 for a, b in zip(first, second, strict=True)])
    error = difference.std(ddof=1) / np.sqrt(len(difference)) if len(difference) > 1 else 0.0
    return float(difference.mean()), float(error)


def ordered(scores: Mapping[str, Sequence[Score]], names: Sequence[str]) -> bool:
    """Tell whether the mean 3-D errors of the named filters increase in this order."""
    means = [mean(scores[name]).d3 for name in names]
    return all(a < b for a, b in zip(means, means[1:], strict=False))
