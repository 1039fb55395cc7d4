"""Gyros: unwrapping, common epochs, four axes to three with parity, and increments composed over a filter step."""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from geokalman.attitude.cameras import Combined, at_seconds
from geokalman.attitude.header import Level1Error
from geokalman.attitude.model import GYRO_HZ, WRAP_DEG, Array, Telemetry, Tuning, arw_density, gyro_matrix
from geokalman.physics.quaternion import difference, exp, log, multiply

LONGEST_GAP = 1.0  # s: an angle is not interpolated over more
LARGEST_STEP = 0.1  # deg per 1/8 s: more is a fault, not motion
FEWEST = 0.5  # of the fullest axis' samples: an axis with fewer counts as missing


class GyroWarning(UserWarning):
    """A gyro axis is missing or faulty and was left out."""


class Increments(NamedTuple):
    """Angle increments d (n - 1, 3) [rad] in SRF axes between the epochs t (n,) [s]; NaN where the gyros gave none.

    parity : (n - 1, axes) residual m - H omega dt of each axis [rad]; NaN without redundancy.
    """

    t: Array
    d: Array
    parity: Array


def unwrap(angle_deg: Array) -> Array:
    """Continuous angles from wrapping ones (n,) [deg]: d = ((a_k+1 - a_k + 5758) mod 11516) - 5758, summed; exact."""
    steps = (np.diff(angle_deg) + WRAP_DEG) % (2 * WRAP_DEG) - WRAP_DEG
    return angle_deg[0] + np.concatenate([[0.0], np.cumsum(steps)])


def clean(t: Array, angle_deg: Array) -> tuple[Array, Array, int]:
    """Times and unwrapped angles without faulty samples, and how many there were.

    A sample is dropped where the step to it and the step from it both exceed 0.1 deg per 1/8 s after unwrapping, or
    where it is not finite; a lasting jump of the angle is kept as it is and its one step reported by `common` as a gap.
    """
    good = np.isfinite(t) & np.isfinite(angle_deg)
    t, angle = t[good], angle_deg[good]
    lost = int((~good).sum())
    if len(t) < 2:
        return t, angle, lost
    step = (np.diff(angle) + WRAP_DEG) % (2 * WRAP_DEG) - WRAP_DEG
    large = np.abs(step) > LARGEST_STEP * np.maximum(1.0, GYRO_HZ * np.diff(t))
    spike = np.zeros(len(t), bool)
    spike[1:-1] = large[:-1] & large[1:]
    spike[0], spike[-1] = large[0] and not spike[1], large[-1] and not spike[-2]
    return t[~spike], unwrap(angle[~spike]), lost + int(spike.sum())


def common(t: Array, angle: Array, epochs: Array) -> Array:
    """Unwrapped angle (n,) [deg] at common epochs by cubic splines, continuous within each arc.

    t, angle : (m,) [s, deg]. NaN beyond the data, across gaps of more than 1 s and across jumps.
    """
    out = np.full(len(epochs), np.nan)
    jump = np.abs(np.diff(angle)) > LARGEST_STEP * np.maximum(1.0, GYRO_HZ * np.diff(t))
    edges = np.flatnonzero((np.diff(t) > LONGEST_GAP) | jump) + 1
    for arc in np.split(np.arange(len(t)), edges):
        if len(arc) < 4:
            continue
        inside = (epochs >= t[arc[0]]) & (epochs <= t[arc[-1]])
        out[inside] = CubicSpline(t[arc], angle[arc])(epochs[inside])
    return out


def reduce(
    t_gyro: Array, gyro: Array, satellite: str, epochs: Array, axes: tuple[int, ...] = (1, 2, 3, 4)
) -> Increments:
    """Increments in SRF axes between the epochs from the raw angles of the axes in use, equation (2) on increments.

    t_gyro, gyro : (4, m) [s, deg]. Increments are NaN where fewer than the axes in use have angles at both ends.
    """
    H = gyro_matrix(satellite, axes)
    steps = np.empty((len(epochs) - 1, len(axes)))
    for column, axis in enumerate(axes):
        t, angle, _ = clean(t_gyro[axis - 1], gyro[axis - 1])
        # The origin is taken off first: differences of thousands of degrees would cost digits.
        steps[:, column] = np.radians(np.diff(common(t, angle - angle[0], epochs)))
    d = np.linalg.lstsq(H, np.nan_to_num(steps).T, rcond=None)[0].T
    lost = np.isnan(steps).any(axis=1)
    d[lost] = np.nan
    parity = steps - d @ H.T if len(axes) > 3 else np.full_like(steps, np.nan)
    return Increments(np.asarray(epochs, dtype=float), d, parity)


def parity_fault(parity: Array, sigma: float, satellite: str, samples: int = GYRO_HZ) -> int | None:
    """Index of the increment at which a gyro fault begins, or None: the parity number stays above 6 sigma for 1 s.

    parity : (n, 4) [rad]; sigma : standard deviation of one component's sound residual [rad], its median taken off (the
    biases of the gyros leave a constant; a fault must be shorter than half the series). Four axes leave one parity
    number, the component along the null vector of H'.
    """
    null = np.linalg.svd(gyro_matrix(satellite))[0][:, 3]
    series = parity @ null
    above = np.abs(np.nan_to_num(series - np.nanmedian(series))) > 6 * 2 * sigma  # |null_i| is 1/2 within 0.1 %
    runs = np.convolve(above, np.ones(samples, int), mode="valid") == samples
    return int(np.argmax(runs)) if runs.any() else None


def isolate(steps: Array, reference: Array, satellite: str, block: int = 60) -> int:
    """The axis (1 to 4) whose increments disagree most with those of a reference attitude (cameras).

    steps : (n, 4) increments of the axes [rad]; reference : (n, 3) increments of the reference over the same epochs;
    compared are means over blocks, in which the noise of the cameras all but cancels and a drift does not. One parity
    number detects a fault but cannot name the axis; the cameras can. Raises ValueError where they have fewer than two
    whole blocks.
    """
    residual = steps - reference @ gyro_matrix(satellite).T
    n = len(residual) // block
    means = residual[: n * block].reshape(n, block, 4).mean(axis=1)
    means = means[np.isfinite(means).all(axis=1)]
    if len(means) < 2:
        raise ValueError(
            f"{len(means)} blocks of {block} increments with cameras cannot name a faulty gyro axis; give 2 or more."
        )
    return int(np.argmax(np.mean((means - np.median(means, axis=0)) ** 2, axis=0))) + 1


def preintegrate(increments: Increments, hz: int) -> Increments:
    """Increments over the steps of a filter at `hz` (1, 2, 8): Log of products, parity summed."""
    s = GYRO_HZ // hz
    n = len(increments.d) // s
    turns = exp(increments.d[: n * s].reshape(n, s, 3))
    q = turns[:, 0]
    for j in range(1, s):
        q = multiply(q, turns[:, j])
    parity = increments.parity[: n * s].reshape(n, s, -1).sum(axis=1)
    return Increments(increments.t[: n * s + 1 : s], log(q), parity)


def mean_rates(increments: Increments) -> tuple[Array, Array]:
    """Mean angular rate (n, 3) [rad/s] over +-0.5 s about each integer second t (n,) [s], as IMU1B's here."""
    half = GYRO_HZ // 2
    t = increments.t
    seconds = np.arange(np.ceil(t[0] + 0.5 - 1e-9), np.floor(t[-1] - 0.5 + 1e-9) + 0.5)
    total = np.concatenate([np.zeros((1, 3)), np.cumsum(np.nan_to_num(increments.d), axis=0)])
    lost = np.concatenate([[0], np.cumsum(np.isnan(increments.d[:, 0]))])
    k = np.round((seconds - t[0]) * GYRO_HZ).astype(int)
    rates = total[k + half] - total[k - half]
    rates[lost[k + half] > lost[k - half]] = np.nan
    return seconds, rates


def five_point_rates(angle: Array, dt: float) -> Array:
    """Equation (1): m' = (-m_+2 + 8 m_+1 - 8 m_-1 + m_-2) / (12 dt); angle (n,) -> (n - 4,)."""
    return (-angle[4:] + 8 * angle[3:-1] - 8 * angle[1:-3] + angle[:-4]) / (12 * dt)


def between(increments: Increments, first: float, last: float) -> Increments:
    """The increments from epoch `first` to `last` [s]. Raises ValueError where they do not reach."""
    t = increments.t
    k, m = (round((x - t[0]) * GYRO_HZ) for x in (first, last))
    if k < 0 or m > len(t) - 1:
        raise ValueError(f"the gyros span {t[0]:g} to {t[-1]:g} s, not {first:g} to {last:g} s.")
    return Increments(t[k : m + 1], increments.d[k:m], increments.parity[k:m])


def present(raw: Telemetry) -> tuple[int, ...]:
    """Axes (1 to 4) with half the samples of the fullest. Raises Level1Error for fewer than three."""
    counts = (np.isfinite(raw.t_gyro) & np.isfinite(raw.gyro)).sum(axis=1)
    there = tuple(axis for axis in (1, 2, 3, 4) if counts[axis - 1] > 0 and counts[axis - 1] >= FEWEST * counts.max())
    if len(there) < 3:
        raise Level1Error(
            f"GRACE-{raw.satellite}: gyro axes {list(there)} alone have samples ({', '.join(map(str, counts))} on "
            "axes 1 to 4); three are needed."
        )
    return there


def sound(raw: Telemetry, tuning: Tuning) -> Tuning:
    """The tuning with those of its gyro axes that gave samples; a missing one is left out with a GyroWarning.

    Raises Level1Error where fewer than three remain.
    """
    there = present(raw)
    axes = tuple(axis for axis in tuning.axes if axis in there)
    if axes == tuning.axes:
        return tuning
    missing = " and ".join(str(axis) for axis in tuning.axes if axis not in there)
    if len(axes) < 3:
        raise Level1Error(
            f"GRACE-{raw.satellite}: of gyro axes {list(tuning.axes)}, {missing} gave no samples; three are needed."
        )
    warnings.warn(
        f"GRACE-{raw.satellite}: gyro axis {missing} gave no samples and was left out.", GyroWarning, stacklevel=3
    )
    return replace(tuning, axes=axes)


def reduced(raw: Telemetry, tuning: Tuning) -> Increments:
    """8 Hz increments from the first to the last camera second, half a second more at both ends.

    Missing axes are left out as `sound` says. Raises Level1Error where fewer than three remain.
    """
    tuning = sound(raw, tuning)
    first, last = np.ceil(raw.t_camera[0] - 1e-3), np.floor(raw.t_camera[-1] + 1e-3)
    used = [axis - 1 for axis in tuning.axes]
    start, end = np.nanmin(raw.t_gyro[used], axis=1).max(), np.nanmax(raw.t_gyro[used], axis=1).min()
    first, last = first - 1.0 if start <= first - 1.0 else first, last + 1.0 if end >= last + 1.0 else last
    epochs = np.arange(round((last - first) * GYRO_HZ) + 1) / GYRO_HZ + first
    return reduce(raw.t_gyro, raw.gyro, raw.satellite, epochs, tuning.axes)


def sound_increments(raw: Telemetry, tuning: Tuning, combined: Combined) -> tuple[Increments, Tuning]:
    """8 Hz increments, and the tuning with the axes that they were made of.

    An axis without samples is left out; so is, where the parity of four axes stays beyond 6 sigma for a second, the
    axis that disagrees most with the cameras. Both with a GyroWarning. Raises Level1Error where fewer than three axes
    remain.
    """
    tuning = sound(raw, tuning)
    increments = reduced(raw, tuning)
    if len(tuning.axes) < 4:
        return increments, tuning
    sigma = 0.5 * arw_density(tuning.arw_deg_sqrt_h) / GYRO_HZ**0.5  # of one of the four residuals
    start = parity_fault(increments.parity, sigma, raw.satellite)
    if start is None:
        return increments, tuning
    whole = at_seconds(combined)
    seen = preintegrate(between(increments, whole.t[0], whole.t[-1]), 1)
    steps = seen.d @ gyro_matrix(raw.satellite).T + seen.parity
    axis = isolate(steps, difference(whole.q[:-1], whole.q[1:]), raw.satellite)
    warnings.warn(
        f"GRACE-{raw.satellite}: gyro axis {axis} disagrees with the others from {increments.t[start]:.1f} s on and "
        "was left out.", GyroWarning, stacklevel=2,
    )  # fmt: skip
    fewer = replace(tuning, axes=tuple(a for a in tuning.axes if a != axis))
    return reduced(raw, fewer), fewer


def decimated(increments: Increments) -> Array:
    """Increments (n, 3) [rad] over 1 s from every eighth 8 Hz rate: what a filter that takes rates at 1 Hz gets."""
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
