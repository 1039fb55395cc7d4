"""Trials of the filter: gaps of all cameras, outliers, wrong starts, and rates in the place of summed increments."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from geokalman.attitude import assess, estimate
from geokalman.attitude.estimate import Measured, Solution
from geokalman.attitude.flight import Flight, Solved, reference
from geokalman.attitude.gyro import Increments, five_point_rates
from geokalman.attitude.model import GYRO_HZ, Array, Tuning
from geokalman.physics.quaternion import exp, multiply


class Gap(NamedTuple):
    """Errors (n, 3) and standard deviations (n, 3) [rad] of filter and smoother; first, last : epochs without a
    camera.
    """

    error: dict[str, Array]
    sigma: dict[str, Array]
    first: int
    last: int
    solutions: dict[str, Solution]

    def flagged(self, limit_rad: float) -> Array:
        """Epochs (n,) of the filter whose standard deviation exceeds the limit [rad], or that have no estimate."""
        return self.solutions["mekf"].flagged(limit_rad)


def with_gap(measured: Measured, first: int, count: int) -> Measured:
    """The same without any camera at `count` epochs from `first` on."""
    z, R = measured.z.copy(), measured.R.copy()
    z[first : first + count], R[first : first + count] = np.nan, np.nan
    return measured._replace(z=z, R=R)


def gap(trip: Flight, satellite: str, result: Solved, tuning: Tuning, gap_s: float, start_s: float) -> Gap:
    """Filter and smoother over a gap of all cameras of gap_s from start_s after the first epoch on."""
    first, count = round(start_s / result.measured.dt), round(gap_s / result.measured.dt)
    if not 0 < first < first + count < len(result.t):
        raise ValueError(
            (
                f"a gap of {gap_s:g} s does not lie inside {result.t[-1] - result.t[0]:g} s of data; shorten it or "
                "lengthen the flight."
            )
        )
    forward, smooth = estimate.mekf(with_gap(result.measured, first, count), tuning, smooth=True)
    base = reference(trip, satellite, result)
    solutions = {"mekf": forward, "rts": smooth}
    return Gap(
        {name: assess.error(x.q, base) for name, x in solutions.items()},
        {name: np.sqrt(np.einsum("kii->ki", x.cov)) for name, x in solutions.items()},
        first,
        first + count - 1,
        solutions,
    )


class Outliers(NamedTuple):
    """Rms errors (3,) [rad] with and without the gate, and how many of the outliers and of the sound updates it
    refused.
    """

    gated: Array
    ungated: Array
    found: int
    false_alarms: int


def outliers(
    trip: Flight,
    satellite: str,
    result: Solved,
    tuning: Tuning,
    count: int,
    size_rad: float,
    gate: float,
    rng: np.random.Generator,
) -> Outliers:
    """Outliers of +-size on every axis with random signs, at random epochs of the combined quaternion."""
    z = result.measured.z.copy()
    keep = assess.inner(len(z), result.measured.dt)
    seen = np.flatnonzero(np.isfinite(z[keep, 0])) + keep.start
    where = rng.choice(seen, count, replace=False)
    z[where] = multiply(z[where], exp(size_rad * rng.choice([-1.0, 1.0], (count, 3))))
    spoiled = result.measured._replace(z=z)
    base = reference(trip, satellite, result)
    rms = {}
    for word, limit in (("gated", gate), ("ungated", 0.0)):
        solution = estimate.mekf(spoiled, replace(tuning, gate=limit))
        rms[word] = assess.rms(assess.error(solution.q, base)[keep])
        if word == "gated":
            hit = np.zeros(len(z), bool)
            hit[where] = True
            found, false = int((solution.rejected & hit).sum()), int((solution.rejected & ~hit).sum())
    return Outliers(rms["gated"], rms["ungated"], found, false)


def wrong_start(
    trip: Flight,
    satellite: str,
    result: Solved,
    tuning: Tuning,
    angle_rad: float,
    rng: np.random.Generator,
    seconds: int = 60,
    method: str = "mekf",
) -> Array:
    """Angle of the attitude error (seconds + 1,) [rad] after a start wrong by an angle about a random axis.

    P0 = 1 rad^2. method : mekf, akf7, or vector_part, a MEKF whose residual is twice the vector part of q* z:
    2 sin(angle / 2), short of the angle by angle^3 / 24: nothing at the level of noise, a tenth at 90 deg.
    """
    base = reference(trip, satellite, result)
    first = int(np.argmax(np.isfinite(result.measured.z[:, 0])))
    axis = rng.standard_normal(3)
    start = multiply(base[first], exp(angle_rad * axis / np.linalg.norm(axis)))
    part = slice(first, first + seconds + 1)
    short = result.measured._replace(
        z=result.measured.z[part], R=result.measured.R[part], d=result.measured.d[first : first + seconds]
    )
    wide = replace(tuning, p0_attitude=1.0)
    if method == "akf7":
        solution = estimate.akf7(short, wide, start=start)
    elif method == "mekf":
        solution = estimate.mekf(short, wide, start=start)
    else:  # a gate would refuse what the wrong residual makes of sound cameras
        solution = estimate.mekf(short, replace(wide, gate=0.0), start=start, vector_part=True)
    return np.linalg.norm(assess.error(solution.q, base[part]), axis=1)


def decimated(increments: Increments) -> Array:
    """Increments (n, 3) [rad] over 1 s from every eighth 8 Hz rate, without summing: what a filter that takes rates at
    1 Hz gets.
    """
    return increments.d[: len(increments.d) // GYRO_HZ * GYRO_HZ : GYRO_HZ] * GYRO_HZ


def five_point(increments: Increments) -> Increments:
    """The 8 Hz increments that equation (1) gives: the five-point rate at the start of each step, times the step.

    The rates of the first and last two epochs are those of their neighbours; a step whose stencil meets a lost one is
    lost.
    """
    lost = np.isnan(increments.d[:, 0])
    angle = np.concatenate([np.zeros((1, 3)), np.cumsum(np.nan_to_num(increments.d), axis=0)])
    rates = np.pad(five_point_rates(angle, 1.0 / GYRO_HZ), ((2, 2), (0, 0)), mode="edge")
    d = rates[:-1] / GYRO_HZ
    d[np.convolve(lost, np.ones(5), "same") > 0] = np.nan
    return increments._replace(d=d)
