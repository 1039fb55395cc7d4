"""Two attitude products beside each other, as the paper's Figures 3 and 4 show them: pointing, rates, their spectra."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from geokalman.attitude import assess, pointing, tunings
from geokalman.attitude.estimate import Estimate, Processed
from geokalman.attitude.experiment import Table, angles_of, per_satellite, solve
from geokalman.attitude.model import AXES, Array, Scenario, Tuning
from geokalman.attitude.truth import Recording
from geokalman.physics.quaternion import exp, multiply

PAIR = ("akf7", "jpl_like")
TAIL = (0.2, 0.5)
"""Where the paper finds JPL's pointing slightly lower, and rates that drop [Hz]."""
BELOW = (1e-3, 0.2)
ENDS = ((0.2, 0.25), (0.45, 0.5))


def lowpassed(solution: Estimate, cutoff_hz: float) -> Estimate:
    """The same attitudes at 1 Hz after a Gaussian low-pass of their components, normalised; 0 leaves them.

    The kernel's reach at either end keeps its values, and so does an epoch with an undefined attitude in reach.
    """
    kernel, q = tunings.lowpass_kernel(cutoff_hz), solution.q
    reach = len(kernel) // 2
    middle = np.stack([np.convolve(q[:, i], kernel, "valid") for i in range(4)], axis=1)
    middle /= np.linalg.norm(middle, axis=1, keepdims=True)
    whole = q.copy()
    there = np.isfinite(middle[:, 0])
    whole[reach : len(q) - reach][there] = middle[there]
    return replace(solution, q=whole)


def _drop(rates: Array) -> Array:
    first, last = (pointing.band(rates, 1.0, *band) for band in ENDS)
    return first / last


def statistics(recording: Recording, satellite: str, result: Processed) -> dict[str, float]:
    """Numbers of one satellite's run at 1 Hz, by dotted name; without those of spectra where an epoch has no attitude.

    rate.<product | gyro>.<axis> : standard deviation of the rates [rad/s]; drop.<product | gyro>.<axis> : amplitude
    density of the rates at 0.2 to 0.25 Hz over that at 0.45 to 0.5 Hz; tail.<axis>, below.<axis> : density of the
    pointing angles of jpl_like over that of akf7 in 0.2 to 0.5 Hz, and in 0.001 to 0.2 Hz.
    """
    keep = assess.inner(len(result.t))
    q = {name: result.solutions[name].q for name in PAIR}
    rates = {name: pointing.rates(values)[keep] for name, values in q.items()}
    rates["gyro"] = assess.gyro_rates(result)[keep]
    out: dict[str, float] = {}
    for name, values in rates.items():
        values = values[: keep.stop - keep.start]
        out |= assess.by_axis(f"rate.{name}", assess.std(values))
        if np.isfinite(values).all():
            out |= assess.by_axis(f"drop.{name}", _drop(values))
    angles = {name: angles_of(recording, satellite, values)[keep] for name, values in q.items()}
    if all(np.isfinite(values).all() for values in angles.values()):
        for key, band in (("tail", TAIL), ("below", BELOW)):
            density = {name: pointing.band(values, 1.0, *band) for name, values in angles.items()}
            out |= assess.by_axis(key, density["jpl_like"] / density["akf7"])
    return out


def run(recording: Recording, satellite: str, tuning: Tuning, cutoff_hz: float = 0.0) -> dict[str, float]:
    """Both products of one satellite: names of `assess.statistics` and of `statistics`.

    cutoff_hz : low-pass of jpl_like before anything is computed from it; 0 for none.
    """
    result = solve(recording, satellite, tuning, PAIR)
    if cutoff_hz:
        low = lowpassed(result.solutions["jpl_like"], cutoff_hz)
        result = replace(result, solutions=result.solutions | {"jpl_like": low})
    numbers = assess.statistics(result, recording.true_attitude(satellite), recording.true_bias(satellite, tuning.axes))
    return numbers | statistics(recording, satellite, result)


def settings(scenario: Scenario, tuning: Tuning, fit: tunings.Gains) -> tuple[Scenario, Tuning]:
    """Scenario and tuning with the gyro noise and the gains of a fit."""
    noise = fit.arw_deg_sqrt_h
    return (
        replace(scenario, arw_deg_sqrt_h=noise),
        replace(tuning, arw_deg_sqrt_h=noise, apm_factor=fit.apm_factor, kappa=fit.kappa),
    )


def table(
    scenario: Scenario, tuning: Tuning, fit: tunings.Gains, n_seeds: int, seed0: int, satellite: str = "both",
    data_dir: str = "",
) -> Table:  # fmt: skip
    """Statistics of both products with the gyro noise and the gains of a fit, mean and spread over runs.

    Simulated flights have the fit's gyro noise; files have their own. Names as `run` gives them.
    """
    scenario, tuning = settings(scenario, tuning, fit)
    flown = per_satellite(scenario, n_seeds, seed0, satellite, data_dir)
    return assess.table_of([run(recording, s, tuning) for recording, s in flown])


def fitted_numbers(numbers: Mapping[str, tuple[float, float]], window: str = "matched") -> dict[str, tuple[float, str]]:
    """What is judged of a fit, by the name under `fitted.` on the page of the rates: number and unit.

    numbers : a table of `run`'s names; window : of the gyro rate. Names whose numbers are missing are left out.
    """
    start = "" if window == "matched" else f"{window}."
    mean = partial(assess.axis_mean, numbers)
    out: dict[str, tuple[float, str]] = {}
    for name in PAIR:
        for axis in AXES:
            out[f"rate_minus_imu.{name}.{axis}"] = numbers[f"{start}rate_minus_imu.{name}.{axis}"][0], "rad/s"
            out[f"rate.{name}.{axis}"] = numbers[f"rate.{name}.{axis}"][0], "rad/s"
        if f"attitude_rms.{name}.roll" in numbers:
            out[f"attitude_rms.{name}"] = mean(f"attitude_rms.{name}"), "rad"
    for axis in AXES:
        out[f"rate.gyro.{axis}"] = numbers[f"rate.gyro.{axis}"][0], "rad/s"
    for key in ("tail", "below"):
        if f"{key}.roll" in numbers:
            out[f"{key}.jpl_over_apm"] = mean(key), ""
    for name in (*PAIR, "gyro"):
        if f"drop.{name}.roll" in numbers:
            out[f"drop.{name}"] = mean(f"drop.{name}"), ""
    for kind in ("band", "wide_band"):
        if f"{start}{kind}_minus_imu.akf7.roll" in numbers:
            both = (mean(f"{start}{kind}_minus_imu.{name}") for name in ("jpl_like", "akf7"))
            out[f"{kind}_ratio"] = next(both) / next(both), ""
    return out


def gyro_copy(result: Processed) -> Estimate:
    """An attitude that copies the gyro: its increments summed from the first camera on, no covariance, no bias."""
    m = result.measured
    first = int(np.argmax(np.isfinite(m.z[:, 0])))
    q = np.full_like(m.z, np.nan)
    q[first] = m.z[first]
    for k, step in enumerate(exp(m.d[first:]), first):
        q[k + 1] = multiply(q[k], step)
    n = len(q)
    return Estimate(q, np.zeros((n, 3)), np.zeros((n, 3, 3)), np.full(n, np.nan), np.zeros(n, bool))
