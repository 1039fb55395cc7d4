"""Experiments of the chapter beyond the paper: levelling by ties, tuning by likelihood, time per epoch."""

from __future__ import annotations

from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np

from geokalman.airborne import level, simulate, tune
from geokalman.airborne.estimate import estimate, run_filter, run_smoother
from geokalman.airborne.model import Tuning, build


@dataclass(frozen=True)
class Levelled:
    """Root mean square error over a survey [mGal], about the survey's mean: before, after, and with every line's own
    mean out.
    """

    before: float
    after: float
    floor: float


def levelling(
    scenario: simulate.Scenario,
    tuning: Tuning,
    seed: int,
    ties: int = 3,
    tie_bias: float = 2.0,
    tie_noise: float = 0.25,
) -> Levelled:
    """Level a simulated survey by tie lines; a tie is truth with one bias and white noise [mGal], it is not filtered.

    Ties cross all lines at equal distances along them.
    """
    rng = np.random.default_rng(seed)
    flown = simulate.survey(scenario, rng)
    error, track, values = {}, {}, {}
    for truth, line in flown:
        p = truth.proper
        smoothed = estimate(line, tuning).smoothed.gravity
        error[line.name] = (smoothed - truth.gravity)[p]
        track[line.name], values[line.name] = np.column_stack([truth.east, truth.north])[p], smoothed[p]
    half = scenario.length_km * 500.0
    for k in range(ties):
        name, north = f"tie{k + 1}", half * (2 * (k + 1) / (ties + 1) - 1)
        places, truths = [], []
        for truth, _ in sorted(flown, key=lambda one: one[0].east.mean()):
            order = np.argsort(truth.north)
            places.append(np.interp(north, truth.north[order], truth.east[order]))
            truths.append(np.interp(north, truth.north[order], truth.gravity[order]))
        east = np.linspace(places[0] - 1e3, places[-1] + 1e3, 400)
        track[name] = np.column_stack([east, np.full(400, north)])
        noisy = np.array(truths) + tie_bias * rng.standard_normal() + tie_noise * rng.standard_normal(len(truths))
        values[name] = np.interp(east, places, noisy)
    lines = {name: track[name] for name in error}
    points = level.crossovers(lines, {name: t for name, t in track.items() if name not in lines})
    found = level.levels(points, values)
    before = np.concatenate(list(error.values()))
    after = np.concatenate([e - found[name] for name, e in error.items()])
    floor = np.concatenate([e - e.mean() for e in error.values()])
    return Levelled(float(before.std()), float(after.std()), float(floor.std()))


@dataclass(frozen=True)
class Tuned:
    """Error on the test lines [mGal] before and after tuning, and what the likelihood chose."""

    before: float
    after: float
    L_km: float
    sigma_mgal: float
    q_f: float
    R_m: float
    evaluations: int
    converged: bool


def likelihood_tuning(
    scenario: simulate.Scenario,
    tuning: Tuning,
    seed: int,
    colour: tuple[float, float] | None = None,
    evaluations: int = 90,
) -> Tuned:
    """Tune on lines 1 and 2 of a simulated survey, judge on the others; colour : white and coloured height error
    [m].
    """
    start = tuning.coloured(*colour, scenario.gnss_s) if colour else tuning
    flown = simulate.survey(scenario, np.random.default_rng(seed))
    found = tune.fit([line for _, line in flown[:2]], start, evaluations=evaluations)
    errors = []
    for choice in (start, found.tuning):
        errors.append(
            np.mean(
                [
                    (estimate(line, choice).smoothed.gravity - truth.gravity)[truth.proper].std()
                    for truth, line in flown[2:]
                ]
            )
        )
    best = found.tuning
    return Tuned(
        float(errors[0]), float(errors[1]), best.L_km, best.sigma_mgal, best.q_f, best.R_m, found.evaluations,
        found.converged,
    )  # fmt: skip


@dataclass(frozen=True)
class Throughput:
    """Epochs, microseconds an epoch for each part, the difference of both smoothers and the error [mGal]."""

    epochs: int
    forward: float
    rts: float
    two_filter: float
    difference: float
    error: float


def throughput(scenario: simulate.Scenario, tuning: Tuning, seed: int) -> Throughput:
    """Time the filters on one simulated line, best of three."""
    truth, line = simulate.survey(replace(scenario, n_lines=1), np.random.default_rng(seed))[0]
    model = build(line, tuning)
    times = np.full(3, np.inf)
    for _ in range(3):
        start = perf_counter()
        course = run_filter(line, model)
        one = perf_counter()
        rts = run_smoother(line, model, course, "rts")
        two = perf_counter()
        both = run_smoother(line, model, course, "two-filter")
        times = np.minimum(times, [one - start, two - one, perf_counter() - two])
    k = model.names.index("dg")
    gap = model.scale[k] * np.abs(rts.mean[:, k] - both.mean[:, k]).max()
    error = (model.scale[k] * rts.mean[:, k] - truth.gravity)[truth.proper].std()
    return Throughput(len(line.t), *(float(1e6 * t / len(line.t)) for t in times), float(gap), float(error))
