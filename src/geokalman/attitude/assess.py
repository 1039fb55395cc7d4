"""Where truth and estimate meet: errors, their statistics, consistency, the K-band range."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from geokalman.attitude import gyro, pointing
from geokalman.attitude.estimate import Estimate, Processed
from geokalman.attitude.model import AXES, GYRO_HZ, Array
from geokalman.kalman.consistency import chi_square_bounds, nees
from geokalman.physics.quaternion import difference, exp, log, multiply

EDGE_S = 600.0
BAND = (0.01, 0.1)
WIDE_BAND = (0.004, 0.2)  # Hz: where the paper finds its product below the official one
SMOOTHERS = ("rts",)
WINDOWS = ("matched", "half", "sampled")
"""Over what the gyro rate is a mean that rates of an attitude are held against, see `gyro_rates`."""


def inner(n: int, dt: float = 1.0, edge_s: float = EDGE_S) -> slice:
    """Epochs that statistics use: without 600 s, or a sixth of a short flight, at either end."""
    edge = int(min(edge_s / dt, n // 6))
    return slice(edge, n - edge)


def error(q: Array, reference: Array) -> Array:
    """Attitude error Log(q* q_reference) (n, 3) [rad] in SRF axes: roll, pitch, yaw."""
    return difference(q, reference)


def rms(series: Array) -> Array:
    """Root mean square per component, gaps (NaN) left out; keeps the mean."""
    return np.sqrt(np.nanmean(np.asarray(series) ** 2, axis=0))


def std(series: Array) -> Array:
    """Standard deviation per component, gaps left out; removes the mean."""
    return np.nanstd(series, axis=0)


def by_axis(prefix: str, values: Array) -> dict[str, float]:
    """prefix.roll, prefix.pitch, prefix.yaw -> value."""
    return {f"{prefix}.{axis}": float(value) for axis, value in zip(AXES, values, strict=True)}


def gyro_rates(result: Processed, window: str = "matched") -> Array:
    """Gyro rates (n - 2, 3) [rad/s] at the inner epochs of a run, to be held against rates of its attitudes.

    window : matched, the mean over the two steps that a central difference of attitudes spans; half, the mean over
    +-0.5 s (NaN where lost); sampled, the five-point rate (1) at the epoch itself (of whole seconds only). Raises
    ValueError for another window.
    """
    if window == "matched":
        d = exp(result.measured.d)
        return log(multiply(d[:-1], d[1:])) / (2 * result.measured.dt)
    if window == "half":
        return result.rates[1:-1]
    if window == "sampled":
        stride = round(GYRO_HZ * result.measured.dt)
        return GYRO_HZ * gyro.five_point(result.increments).d[stride::stride][: len(result.t) - 2]
    raise ValueError(f"window = {window!r} is unknown; give one of {', '.join(WINDOWS)}.")


def rate_difference(solution: Estimate, result: Processed, window: str = "matched") -> Array:
    """Rates of a solution by central differences minus the gyro rates of a window (n - 2, 3) [rad/s]."""
    return pointing.rates(solution.q, result.measured.dt) - gyro_rates(result, window)


def nees_of(solution: Estimate, reference: Array, bias: Array | None = None) -> Array:
    """NEES (n,) of the attitude, or with the true bias (n, 3) of both; NaN before the start."""
    e, cov = error(solution.q, reference), solution.cov
    if bias is not None:
        e, cov = np.concatenate([e, bias - solution.bias], axis=1), solution.full
    good = np.isfinite(e).all(axis=1) & np.isfinite(cov).all(axis=(1, 2))
    out = np.full(len(e), np.nan)
    out[good] = nees(e[good], cov[good])
    return out


def statistics(
    result: Processed, truth: Array | None, bias: Array | None = None, smoothed: Array | None = None
) -> dict[str, float]:
    """Every number of one satellite's run that the notebooks record, by dotted name.

    Differences to the gyros have the names of `WINDOWS` before them, matched ones none.

    truth : (n, 4) true attitudes at the epochs of the result, bias : (n, 3) true gyro biases [rad/s], or None. Without
    the truth, differences count from `smoothed` (n, 4), or from the run's own smoother, which then has none of its own;
    rates and NEES against the truth are left out. Epochs at an edge of the clock do not count.
    """
    out: dict[str, float] = {}
    dt = result.measured.dt
    keep = inner(len(result.t), dt)
    rates_keep = inner(len(result.t) - 2, dt)
    sound, sound_rates = ~result.edge[keep], ~result.edge[1:-1][rates_keep]
    reference = smoothed if truth is None else truth
    own = reference is None and "rts" in result.solutions
    if own:
        reference = result.solutions["rts"].q
    for name, solution in result.solutions.items():
        if reference is not None and not (own and name == "rts"):
            out |= by_axis(f"attitude_rms.{name}", rms(error(solution.q, reference)[keep][sound]))
        for window in WINDOWS:
            apart = rate_difference(solution, result, window)[rates_keep]
            start = "" if window == "matched" else f"{window}."
            out |= by_axis(f"{start}rate_minus_imu.{name}", std(apart[sound_rates]))
            if np.isfinite(apart).all():
                out |= by_axis(f"{start}band_minus_imu.{name}", pointing.band(apart, dt, *BAND))
                out |= by_axis(f"{start}wide_band_minus_imu.{name}", pointing.band(apart, dt, *WIDE_BAND))
        if name not in SMOOTHERS:
            out[f"nis3.{name}"] = float(np.nanmean(solution.nis[keep][sound]) / 3)
        if truth is not None:
            seconds = slice(None, None, round(1.0 / dt))  # rates over a second either side, at any rate of updates
            apart = pointing.rates(solution.q[seconds]) - pointing.rates(truth[seconds])
            out |= by_axis(f"rate_minus_truth.{name}", std(apart[inner(len(apart))]))
            out[f"nees3.{name}"] = float(np.nanmean(nees_of(solution, truth)[keep]) / 3)
        if bias is not None:
            out |= by_axis(f"bias_rms.{name}", rms((bias - solution.bias)[keep]))
            if solution.full is not None:
                out[f"nees6.{name}"] = float(np.nanmean(nees_of(solution, truth, bias)[keep]) / 6)
    if truth is not None:
        half = pointing.rates(truth, dt)
        out |= by_axis("imu_minus_truth", std((result.rates[1:-1] - half)[rates_keep]))
    return out


def antenna_statistics(
    estimates: Mapping[str, Mapping[str, Array]], truth: Mapping[str, Array], r_C: Array, r_D: Array
) -> dict[str, float]:
    """Antenna correction of the pair: its size, and the rms error of its rate for every filter.

    estimates : filter -> satellite -> (n, 4); truth : satellite -> (n, 4), at 1 Hz; r (n, 3) [m].
    """
    correction = pointing.antenna_correction(truth["C"], truth["D"], r_C, r_D)
    keep, rates_keep = inner(len(correction)), inner(len(correction) - 2)
    out = {
        "aoc.mean": float(correction[keep].mean()),
        "aoc.std": float(correction[keep].std()),
        "aoc.rate_rms": float(rms(pointing.central_rate(correction)[rates_keep])),
    }
    for name, q in estimates.items():
        apart = pointing.antenna_correction(q["C"], q["D"], r_C, r_D) - correction
        out[f"kbr_rate_error.{name}"] = float(rms(pointing.central_rate(apart)[rates_keep]))
    return out


def consistency_bounds(epochs: int, probability: float = 0.95) -> tuple[float, float]:
    """Bounds of the mean NIS/3 of independent epochs with 3 degrees of freedom each."""
    low, high = chi_square_bounds(np.full(epochs, 3), probability)
    return low / 3, high / 3


def table_of(runs: Sequence[Mapping[str, float]]) -> dict[str, tuple[float, float]]:
    """Mean and standard deviation over runs (0 for one) of every name that all of them have."""
    names = [name for name in runs[0] if all(name in run for run in runs)]
    values = {name: np.array([run[name] for run in runs]) for name in names}
    return {name: (float(v.mean()), float(v.std(ddof=1)) if len(v) > 1 else 0.0) for name, v in values.items()}


def axis_mean(table: Mapping[str, tuple[float, float]], prefix: str) -> float:
    """Mean over roll, pitch and yaw of a quantity."""
    return float(np.mean([table[f"{prefix}.{axis}"][0] for axis in AXES]))
