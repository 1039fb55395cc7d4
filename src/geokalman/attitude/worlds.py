"""Worlds of the attitude part: one combination of what the paper leaves open, run through this part's own functions.

A world flies one satellite for 50 minutes once (the pages: both, six hours, several times); Table 1 and the offsets are
computed without noise. The default world has the pages' first seed, and where a page averages over flights, so does it;
every other world has a seed of its own, which follows from its place.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from itertools import combinations
from typing import NamedTuple

import numpy as np

from geokalman.attitude import arcs, assess, comparison, experiment, hypotheses, pointing, simulate, tunings
from geokalman.attitude.model import AXES, QSA, SATELLITES, Array, Scenario, Tuning
from geokalman.attitude.truth import REVOLUTION, Recording
from geokalman.constants import GM_EARTH, R_EARTH

World = Mapping[str, str | float]
FIRST_SEED = 1000
PART = "gracefo-attitude"
DURATION = 3000.0
OFFSET = 6e-4
"""Printed pitch between the products [rad], which Table 1 is computed with."""
DRIFT = 4.61e-10
"""Printed mean of the acceleration difference in Z [m/s^2], of the six-hour arc."""
ORBIT_RATE = 1.1077e-3
CUTOFF = {"none": 0.0, "weak": 0.3, "middle": 0.15, "strong": 0.1}
BIAS_AXES = {"xz": (1.0, 0.0, 1.0), "x": (1.0, 0.0, 0.0), "z": (0.0, 0.0, 1.0)}
SPAN = {"six-hours": 21600.0, "day": 86400.0}
DEFAULT: dict[str, str | float] = {
    "world": 0,
    "window": "matched", "gain": 0.0, "jpl-output": "none", "anisotropy": 9.0, "single": "own",
    "between-combinations": "mounting", "mounting-error": 1.5e-4, "between-products": "time-tag", "node": 100.0,
    "bias": -6.0, "bias-axis": "xz", "span": "six-hours", "arc": "estimated", "order-of-magnitude": "amplitude",
}  # fmt: skip
"""The pages' own set-up; `readings.yml` has the same defaults."""


class Seeds(NamedTuple):
    """Seeds of a world: of its flight, of the mounting errors, and of the orbits of Table 1."""

    flight: int
    mounting: tuple[int, ...]
    orbits: tuple[int, ...]


def seeds(world: World) -> Seeds:
    """Give the seeds that follow from the place of a world; those of the pages for place 0, the default."""
    place = int(world["world"])
    if place == 0:
        return Seeds(1, tuple(range(1, 13)), tuple(range(1, 5)))
    own = FIRST_SEED + place
    return Seeds(own, (own,), (own,))


def metrics(world: World) -> dict[str, float]:
    """Numbers of the pages in one world, `gracefo-attitude/notebook:key` -> number in the pages' units.

    world : choice -> option or number, all of `readings.yml`, and world -> its place. Raises KeyError for a choice or
    an option that is missing.
    """
    chosen = seeds(world)
    k = float(world["anisotropy"])
    apm, jpl = tunings.level(tunings.APM), tunings.level(tunings.JPL)
    cutoff = CUTOFF[world["jpl-output"]]
    fit = tunings.fit(apm, jpl, 10.0 ** float(world["gain"]), world["window"], cutoff)
    scenario, tuning = comparison.settings(Scenario(duration_s=DURATION, k_aniso=k), Tuning(k_aniso=k), fit)
    recording = simulate.simulate(scenario, chosen.flight, ("C",))
    errors = experiment.camera_run(recording, "C", tuning)
    numbers = {f"{PART}/01-single-cameras:{key}": v for key, v in single_cameras(recording, tuning, errors).items()}
    pairs = combined(recording, tuning, errors, world["single"]) | spreads(world, chosen, tuning)
    numbers |= {f"{PART}/02-combination:{key}": v for key, v in pairs.items()}
    rates = assess.table_of([comparison.run(recording, "C", tuning, cutoff)])
    fitted = comparison.fitted_numbers(rates, world["window"])
    numbers |= {f"{PART}/05-rates:fitted.{key}": v for key, (v, _) in fitted.items()}
    if world["order-of-magnitude"] == "power":
        numbers[f"{PART}/05-rates:fitted.band_ratio"] **= 2
    numbers |= {f"{PART}/07-acceleration:{key}": v for key, v in accelerations(world, chosen).items()}
    numbers |= {f"{PART}/10-time-tags:{key}": v for key, v in offsets(world, chosen, tuning).items()}
    correction = pointing.antenna_correction(
        *(recording.true_attitude(s) for s in SATELLITES), recording.r["C"], recording.r["D"]
    )
    rate = pointing.central_rate(correction)
    numbers[f"{PART}/08-antenna:aoc.rate_rms"] = float(assess.rms(rate[assess.inner(len(rate))]))
    return numbers


def single_cameras(recording: Recording, tuning: Tuning, errors: Mapping[str, float]) -> dict[str, float]:
    """Numbers of 01-single-cameras, of GRACE-C; errors : of `experiment.camera_run`."""
    out = {key: value for key, value in errors.items() if key.startswith("single.")}
    angles = experiment.camera_angles(recording, "C", tuning, [(1,), (2,), (3,)])
    high = {}
    for name, values in angles.items():
        filled = np.where(np.isnan(values), np.nanmean(values, axis=0), values)
        high[name] = pointing.band(filled, 1.0, 0.1, 0.5)
        out |= assess.by_axis(f"high_frequency.{name}", high[name])
    out |= assess.by_axis("high_frequency.sca1_over_mean", 2 * high["sca1"] / (high["sca2"] + high["sca3"]))
    pairs = list(combinations(angles.values(), 2))
    out |= assess.by_axis("apart", np.mean([assess.rms(one - other) for one, other in pairs], axis=0))
    out["largest_angle"] = max(float(np.nanmax(np.abs(values[:, 1:]))) for values in angles.values())
    return out


def combined(recording: Recording, tuning: Tuning, errors: Mapping[str, float], against: str) -> dict[str, float]:
    """Numbers of 02-combination but the spread, of GRACE-C; against : own or best, the single cameras of a pair."""

    def rms(name: str) -> Array:
        return np.array([errors[f"{name}.rms.{axis}"] for axis in AXES])

    single = {c: rms(f"single.{c}") for c in (1, 2, 3)}
    pairs = {pair: rms(f"combined.{pair[0]}{pair[1]}") for pair in combinations((1, 2, 3), 2)}
    three, best = rms("combined.123"), np.min(list(single.values()), axis=0)
    out = assess.by_axis("best_two_over_three", np.min(list(pairs.values()), axis=0) / three)
    out |= assess.by_axis("best_single_over_three", best / three)
    held = {pair: best if against == "best" else np.min([single[c] for c in pair], axis=0) for pair in pairs}
    out["pair_over_own_single.largest"] = float(np.max([pairs[pair] / held[pair] for pair in pairs]))
    raw = recording.raw["C"]
    seen = np.isfinite(raw.q_camera).all(axis=(0, 2))
    edge = assess.inner(len(seen), 0.5)
    seen[: edge.start] = seen[edge.stop :] = False
    base = experiment.reference_at(recording, "C", raw.t_camera, tuning)
    framed = list(hypotheses.common_frame_errors(raw, base, tuning, seen).values())
    out |= {"common_frame.largest": float(np.max(framed)), "common_frame.smallest": float(np.min(framed))}
    angles = experiment.camera_angles(recording, "C", tuning, list(hypotheses.USES))
    series = [values[np.isfinite(values).all(axis=1)] for values in angles.values()]
    alike = [np.corrcoef(a[:, i], b[:, i])[0, 1] for a, b in combinations(series, 2) for i in range(3)]
    return out | {"trend_correlation.smallest": float(min(alike))}


def spreads(world: World, chosen: Seeds, tuning: Tuning) -> dict[str, float]:
    """Spread of the combinations of GRACE-C on 02-combination, by what moves them apart (linear, without noise)."""
    cause = world["between-combinations"]
    if cause == "mounting":
        size = float(world["mounting-error"])
        turns = [size * simulate.mounting_errors(seed, "C") for seed in chosen.mounting]
    elif cause == "aberration":
        speed = np.sqrt(GM_EARTH / (R_EARTH + Scenario().altitude))  # C flies backwards: its velocity is along -x
        identity = np.array([[1.0, 0.0, 0.0, 0.0]])
        turns = [hypotheses.aberration(identity, np.array([[-speed, 0.0, 0.0]]), QSA)[0]]
    else:
        late = np.zeros((3, 3))
        late[("sca1-late", "sca2-late", "sca3-late").index(cause), 1] = 0.5 * ORBIT_RATE
        turns = [late]
    spread = np.mean([np.ptp(hypotheses.combined(t, QSA, tuning), axis=0) for t in turns], axis=0)
    return assess.by_axis("spread", spread)


def offsets(world: World, chosen: Seeds, tuning: Tuning) -> dict[str, float]:
    """Offset of the two products on 10-time-tags, by its cause: size in pitch (mean of C and D), largest beside it."""
    cause = world["between-products"]
    if cause == "time-tag":
        angles = {s: np.array([0.0, 0.5 * ORBIT_RATE, 0.0]) for s in SATELLITES}
    elif cause == "mounting":
        size = float(world["mounting-error"])
        angles = {
            s: hypotheses.combined(size * simulate.mounting_errors(chosen.flight, s), QSA, tuning)[3]
            for s in SATELLITES
        }
    else:
        factor = {"antenna-missing": 1.0, "antenna-sign": 2.0}[cause]
        angles = {s: factor * hypotheses.antenna_offset(s) for s in SATELLITES}
    sizes = np.abs(list(angles.values()))
    return {"shift.pitch_size": float(sizes[:, 1].mean()), "shift.off_pitch": float(sizes[:, [0, 2]].max())}


def accelerations(world: World, chosen: Seeds) -> dict[str, float]:
    """Numbers of 07-acceleration, of GRACE-C without pointing angles and noise; the arc of six hours."""
    scenario = Scenario(duration_s=SPAN[world["span"]], raan=np.radians(float(world["node"])))
    size = 10.0 ** float(world["bias"])
    bias = tuple(size * part for part in BIAS_AXES[world["bias-axis"]])
    flown = [arcs.difference(scenario, seed, OFFSET, bias) for seed in chosen.orbits]
    out: dict[str, float] = {}
    std = np.mean([arc.change.std(axis=0) for arc in flown], axis=0)
    mean = np.mean([np.abs(arc.change.mean(axis=0)) for arc in flown], axis=0)
    for i, axis in enumerate("xyz"):
        out |= {f"offset_bias.std.{axis}": float(std[i]), f"offset_bias.mean_size.{axis}": float(mean[i])}
    physical = arcs.difference(scenario, chosen.orbits[0], OFFSET, (0.0, 0.0, 0.0))
    span = physical.t[-1] - physical.t[0]
    f, density = pointing.asd(physical.change, arcs.STEP, min(4 * REVOLUTION, span))
    power = np.sum(density**2, axis=1)
    out["share_below_two_cpr"] = float(power[f < 2.6 / REVOLUTION].sum() / power.sum())
    out["left_after_one_and_two_cpr.offset_bias"] = arcs.left_after_revolutions(flown[0], 2 * np.pi / ORBIT_RATE)
    out["drift_6h.estimated.largest"] = _departure(world["arc"], chosen)
    return out


@functools.cache
def _departures() -> arcs.Departure:
    return arcs.departures(DRIFT, 21600.0)


def _departure(state: str, chosen: Seeds) -> float:
    """Largest departure in the arc [m]: over all phases with an estimated state, of one phase with a fixed state."""
    departures = _departures()
    if state == "estimated":
        return float(departures.estimated.max())
    turn = arcs.anomaly(chosen.orbits[0]) / (2 * np.pi)
    return float(departures.fixed[int(turn * len(departures.fixed))])
