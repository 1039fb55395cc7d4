"""Star cameras: attitudes of the satellite, their weighted combination, relative mounting."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import njit

from geokalman.attitude.model import Array, Telemetry, Tuning, camera_information
from geokalman.physics.quaternion import (
    continuous,
    difference,
    difference_point,
    exp,
    multiply,
    retract_point,
    spline,
)  # fmt: skip

LONGEST_GAP = 5.0  # s: a quaternion is not interpolated over more
SNAP = 1e-5  # s: a tag so near the second counts as there; the attitude turns by 1e-8 rad in it


class Combined(NamedTuple):
    """Attitudes q (n, 4), SRF to ICRF, and covariances cov (n, 3, 3) [rad^2] in SRF axes.

    used : (n,) bit mask of the cameras in each (1, 2, 4), as in SCA1B. NaN where no camera sees.
    """

    t: Array
    q: Array
    cov: Array
    used: Array


def to_satellite(q_camera: Array, q_qsa: Array) -> Array:
    """Attitudes (3, n, 4), SRF to ICRF, from each camera: q_SRF = q_SCA q_QSA, continuous signs."""
    return np.stack([continuous(multiply(q, mount)) for q, mount in zip(q_camera, q_qsa, strict=True)])


def combine(
    t: Array, q: Array, q_qsa: Array, sigma: float, k_aniso: float, use: tuple[int, ...] = (1, 2, 3)
) -> Combined:
    """Weighted combination of the cameras, per epoch over those that see.

    q_r of any valid camera; delta = (sum L_i)^-1 sum L_i Log(q_r* q_i); q = q_r Exp(delta); covariance (sum L_i)^-1.
    t : (n,) [s]; q : (3, n, 4) SRF to ICRF, NaN where invalid; q_qsa : (3, 4); sigma [rad], k_aniso : camera noise; use
    : cameras. Source: Romans (2003), with Log for twice the vector part.
    """
    information = camera_information(q_qsa, sigma, k_aniso)
    n = q.shape[1]
    out, cov, used = np.empty((n, 4)), np.empty((n, 3, 3)), np.empty(n, np.int64)
    inverses = np.full((8, 3, 3), np.nan)
    for mask in range(1, 8):
        total = sum(information[i] for i in range(3) if mask >> i & 1)
        inverses[mask] = np.linalg.solve(total, np.eye(3))
    allowed = np.array([i + 1 in use for i in range(3)])
    _combine(np.ascontiguousarray(q), information, inverses, allowed, out, cov, used)
    return Combined(np.asarray(t, dtype=float), continuous(out), cov, used)


@njit(cache=True)
def _combine(q, information, inverses, allowed, out, cov, used):
    work, d, total, delta = np.empty(4), np.empty(3), np.empty(3), np.empty(3)
    for k in range(q.shape[1]):
        reference, mask = -1, 0
        for i in range(3):
            if allowed[i] and not np.isnan(q[i, k, 0]):
                mask |= 1 << i
                if reference < 0:
                    reference = i
        used[k] = mask
        cov[k] = inverses[mask]
        if mask == 0:
            out[k] = np.nan
            continue
        total[:] = 0.0
        for i in range(3):
            if mask >> i & 1 and i != reference:
                difference_point(q[reference, k], q[i, k], work, d)
                for a in range(3):
                    for b in range(3):
                        total[a] += information[i, a, b] * d[b]
        for a in range(3):
            delta[a] = 0.0
            for b in range(3):
                delta[a] += inverses[mask, a, b] * total[b]
        retract_point(q[reference, k], delta, work, out[k])


def calibrate_mounting(
    t: Array, q: Array, q_qsa: Array, sigma: float, k_aniso: float, iterations: int = 2
) -> tuple[Array, Array]:
    """Relative mounting of the cameras: the mean of Log(q_123* q_i) over epochs at which all three see, taken off each.

    Returns the corrected attitudes (3, n, 4) and the rotation vectors taken off (3, 3) [rad, SRF axes]; what all three
    share cannot be seen and stays. Raises ValueError where the three never see together.
    """
    together = np.isfinite(q).all(axis=(0, 2))
    if not together.any():
        raise ValueError("the three cameras never see together: their relative mounting cannot be calibrated.")
    q, taken = q.copy(), np.zeros((3, 3))
    for _ in range(iterations):
        mean = combine(t, q, q_qsa, sigma, k_aniso).q[together]
        for i in range(3):
            offset = difference(mean, q[i, together]).mean(axis=0)
            q[i] = multiply(q[i], exp(-offset))
            taken[i] += offset
    return q, taken


def at_seconds(combined: Combined, hz: int = 1) -> Combined:
    """The combination at `hz` epochs per second: samples where they stand there, else a spline.

    Where the samples stand off these epochs, none inside a gap longer than 5 s is filled: it stays NaN. The covariance
    and the mask are those of the nearest sample. A spline averages two samples, which the covariance then overstates at
    1 Hz; at the cameras' own 2 Hz neighbouring epochs share them, and the covariance of single samples is what their
    mean over time has.
    """
    t = combined.t
    seconds = np.arange(np.ceil((t[0] - SNAP) * hz), np.floor((t[-1] + SNAP) * hz) + 0.5) / hz
    near = np.clip(np.searchsorted(t, seconds - SNAP), 0, len(t) - 1)
    if (np.abs(t[near] - seconds) < SNAP).all():
        return Combined(seconds, combined.q[near], combined.cov[near], combined.used[near])
    there = np.isfinite(combined.q[:, 0])
    ts, qs = t[there], combined.q[there]
    out = np.full((len(seconds), 4), np.nan)
    edges = np.flatnonzero(np.diff(ts) > LONGEST_GAP) + 1
    for arc in np.split(np.arange(len(ts)), edges):
        inside = (seconds >= ts[arc[0]]) & (seconds <= ts[arc[-1]])
        if len(arc) >= 4:
            out[inside] = spline(ts[arc], qs[arc], seconds[inside])
    right = np.clip(np.searchsorted(ts, seconds), 1, len(ts) - 1)
    nearest = right - (seconds - ts[right - 1] < ts[right] - seconds)
    cov, used = combined.cov[there][nearest], combined.used[there][nearest]
    lost = np.isnan(out[:, 0])
    cov[lost], used[lost] = np.nan, 0
    return Combined(seconds, continuous(out), cov, used)


def in_satellite_axes(raw: Telemetry) -> Array:
    """Attitudes (3, n, 4) from each camera, SRF to ICRF."""
    return to_satellite(raw.q_camera, raw.q_qsa)


def combination(raw: Telemetry, tuning: Tuning, use: Sequence[int] = (1, 2, 3), calibrate: bool = False) -> Combined:
    """The cameras combined at their own epochs, after calibration of their relative mounting where asked for."""
    q = in_satellite_axes(raw)
    if calibrate:
        q, _ = calibrate_mounting(raw.t_camera, q, raw.q_qsa, tuning.sigma, tuning.k_aniso)
    return combine(raw.t_camera, q, raw.q_qsa, tuning.sigma, tuning.k_aniso, tuple(use))
