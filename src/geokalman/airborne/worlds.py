"""One simulated survey under one set of readings of the paper, as `book/airborne-gravity/readings.yml` declares them.

A world runs at a reduced scale: one survey of six lines, integrated at `RATE` instead of 100 Hz.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from geokalman.airborne import assess, backward, classical, simulate
from geokalman.airborne.estimate import States, run_filter
from geokalman.airborne.model import Array, Line, Tuning, build
from geokalman.airborne.simulate import Scenario, Truth
from geokalman.kalman.smoothing import smooth

RATE = 20.0
"""Rate of the simulated gravimeter in a world [Hz]."""
COMMON = {
    "reference": {"reference": 0.79, "drift": 0.4, "drift_s": 1500.0},
    "shared": {"reference": 0.6, "drift": 0.8, "drift_s": 900.0},
    "gravimeter": {"reference": 0.2, "drift": 0.98, "drift_s": 900.0},
}
"""Who carries the common error: settings of a Scenario that meet the printed mean of SAGFB."""
UP_VELOCITY = 1e-3
"""White error [m/s] of the vertical GNSS velocity where its integral is the height."""
WANDER_S = 1500.0
"""Time [s] in which the error states wander by their prior standard deviations, where they do."""


class Curves(NamedTuple):
    """Gravity along one line by the estimators of a world (n,) [mGal], and what to judge it by."""

    truth: Truth
    line: Line
    forward: Array
    fb: Array
    order1: Array

    def proper(self, name: str) -> Array:
        """A curve, or the `reference`, on the line proper."""
        return (self.truth.reference if name == "reference" else getattr(self, name))[self.truth.proper]

    def error(self, name: str) -> Array:
        """Error of a curve, or of the `reference`, on the line proper."""
        return self.proper(name) - self.truth.gravity[self.truth.proper]


def settings(world: Mapping[str, str | float]) -> tuple[Scenario, Tuning]:
    """What is flown in a world, and the filter's tuning. Raises KeyError for an option that is not known."""
    markov = {"field": False, "gauss-markov": True}[world["gravity"]]
    field = {"truth": "gm3", "L_km": float(world["filter-length"])} if markov else {}
    scenario = Scenario(
        imu_rate=RATE, length_km=float(world["line-length"]), source_km=float(world["depth"]),
        sigma_mgal=float(world["signal"]), lead_s={"flown": 150.0, "cut": 0.0}[world["lead-in"]],
        gnss_up={"height": 0.0, "velocity": UP_VELOCITY}[world["height"]], **COMMON[world["common-error"]], **field,
    )  # fmt: skip
    tuning = Tuning(
        L_km=float(world["filter-length"]), sigma_mgal=float(world["signal"]), q_f=float(world["filter-noise"]),
        R_m=float(world["filter-height"]) / 100.0,
        wander_s={"constant": 0.0, "wandering": WANDER_S}[world["error-states"]],
    )  # fmt: skip
    return scenario, tuning


def metrics(world: Mapping[str, str | float]) -> dict[str, float]:
    """Numbers of the pages 02, 04, 05 and 07 in one world: "airborne-gravity/<notebook>:<key>" -> number.

    world : an option or a number for every choice; `world`, its place, is the seed (0 where it is not given).
    Where a page gives a mean over surveys, this is the number of one survey. Raises KeyError for a choice or an option
    that is missing or not known.
    """
    scenario, tuning = settings(world)
    literal = {"inverse": False, "correction": False, "literal": True}[world["backward-start"]]
    flown = simulate.survey_of_seed(scenario, int(world.get("world", 0)))
    lines = [_curves(truth, line, tuning, literal) for truth, line in flown]
    return (
        _sizes(lines[0])
        | _table_one(lines, str(world["mean-square"]))
        | _start(lines[0])
        | _low_pass(lines, scenario, tuning, str(world["low-pass"]))
    )


def _curves(truth: Truth, line: Line, tuning: Tuning, literal: bool) -> Curves:
    smoothed = {}
    for order in (3, 1):
        model = build(line, replace(tuning, order=order))
        course = run_filter(line, model)
        k = model.names.index("dg")
        if literal:
            smoothed[order] = backward.ended_in_zero(model, course).gravity
        else:  # no information, or no correction to the last state: RTS has the mean of both
            smoothed[order] = model.scale[k] * smooth(course, covariances=False).mean[:, k]
        if order == 3:
            forward = States(model.names, model.scale, course.t, course.mean, course.cov).gravity
    return Curves(truth, line, forward, smoothed[3], smoothed[1])


def _sizes(first: Curves) -> dict[str, float]:
    p = first.truth.proper
    page = "airborne-gravity/02-survey"
    return {
        f"{page}:apparent.sd": float(classical.apparent_gravity(first.line)[p].std()),
        f"{page}:gravity.sd": float(first.truth.gravity[p].std()),
    }


def _table_one(lines: Sequence[Curves], mean_square: str) -> dict[str, float]:
    what = {"raw": "D_raw", "centred": "D_centred"}[mean_square]
    D = {
        name: np.array([getattr(assess.statistics(c.proper("reference") - c.proper(name)), what) for c in lines])
        for name in ("fb", "forward", "order1")
    }
    table = {"fb.D_raw": D["fb"].mean(), "forward.D_raw": D["forward"].mean(), "model.order1.D_raw": D["order1"].mean()}
    table |= {"every.fb_below_1": (D["fb"] < 1).all(), "every.forward_above_1": (D["forward"] > 1).all()}
    for name in ("fb", "forward"):
        table[f"{name}.truth"] = np.mean([c.error(name).std() for c in lines])
        table[f"correlation.{name}"] = np.mean(
            [np.corrcoef(c.proper(name), c.proper("reference"))[0, 1] for c in lines]
        )
    for name, curve in (("sag", "fb"), ("reference", "reference")):
        table[f"error.{name}"] = np.mean([np.sqrt(np.mean(c.error(curve) ** 2)) for c in lines])
    return {f"airborne-gravity/04-six-lines:{key}": float(value) for key, value in table.items()}


def _start(first: Curves) -> dict[str, float]:
    page = "airborne-gravity/05-backward-start"
    return {
        f"{page}:reading.error": float(first.error("fb").std()),
        f"{page}:forward.filter_error": float(first.error("forward").std()),
    }


def _low_pass(lines: Sequence[Curves], scenario: Scenario, tuning: Tuning, name: str) -> dict[str, float]:
    family, _, cutoff = name.partition("-")
    seconds, page = float(cutoff), "airborne-gravity/07-model-free:paper_like"
    along, variance = simulate.along_track(scenario)
    low_pass = {
        "fir": (classical.fir, classical.fir_gain(seconds, lines[0].line.dt, scenario.V / along)),
        "butterworth": (classical.butterworth, classical.butterworth_gain(seconds, scenario.V / along)),
    }
    filtered, gain = low_pass[family]
    error = [(filtered(c.line, seconds, cut_ends=True) - c.truth.gravity)[c.truth.proper].std() for c in lines]
    own = classical.smoother_gain(tuning, scenario.V, lines[0].line.dt, along)
    return {
        f"{page}.fb.truth": float(np.mean([c.error("fb").std() for c in lines])),
        f"{page}.lowpass.truth": float(np.mean(error)),
        f"{page}.signal_lost.fb": classical.signal_lost(own, variance),
        f"{page}.signal_lost.lowpass": classical.signal_lost(gain, variance),
    }
