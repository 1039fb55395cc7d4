"""Simulated sensors: four gyro axes with drifting, wrapping, quantised angles, and three star cameras."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from geokalman.attitude.model import (
    CAMERA_HZ,
    EPOCH_2019,
    GYRO_HZ,
    SATELLITES,
    SUN,
    WRAP_DEG,
    Array,
    Scenario,
    Telemetry,
    arw_density,
    gyro_matrix,
    mounting,
)  # fmt: skip
from geokalman.attitude.truth import REVOLUTION, Recording, Truth, fly, increments
from geokalman.physics.quaternion import conjugate, exp, matrix, multiply

AXIS_OFFSETS = (0.0, 0.031, 0.0625, 0.094)  # s: the axes are sampled at different instants
BIAS_DEG_H = 0.1
BIAS_WALK = 4e-11  # rad/s/sqrt(s)
QUANTUM_DEG = 1e-6
SUN_EXCLUSION = math.radians(30.0)
DROPOUTS_PER_DAY, DROPOUT_MEAN = 6.0, 120.0
FLIP_PROBABILITY = 5e-4


def gyros(truth: Truth, satellite: str, scenario: Scenario, rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Sampling times (4, m) [s], filtered angles (4, m) [deg] and true biases (4, m) [rad/s] of the four axes.

    m is one less than the 8 Hz grid has epochs.
    """
    t, H = truth.t, gyro_matrix(satellite)
    angle = np.zeros((len(t), 4))
    np.cumsum(increments(truth.q) @ H.T, axis=0, out=angle[1:])
    m, h = len(t) - 1, 1.0 / GYRO_HZ
    noise = arw_density(scenario.arw_deg_sqrt_h) * math.sqrt(h) * rng.standard_normal((4, m))
    bias = math.radians(BIAS_DEG_H) / 3600.0 * rng.standard_normal((4, 1))
    bias = bias + np.cumsum(BIAS_WALK * math.sqrt(h) * rng.standard_normal((4, m)), axis=1)
    phase = rng.uniform(0, 2 * math.pi, (4, 1))
    start = rng.uniform(-WRAP_DEG, WRAP_DEG, 4)
    times = t[None, :-1] + np.array(AXIS_OFFSETS)[:, None]
    if scenario.bias_1cpr_deg_h:
        turning = math.radians(scenario.bias_1cpr_deg_h) / 3600.0
        bias = bias + turning * np.sin(2 * math.pi * times / REVOLUTION + phase)
    if scenario.near_wrap:
        side = 1.0 if satellite == "C" else -1.0
        start[0], start[2] = side * (WRAP_DEG - 20.0), -side * (WRAP_DEG - 20.0)
    out = np.empty((4, m))
    for axis in range(4):
        true_angle = CubicSpline(t, angle[:, axis])(times[axis])
        drift = np.cumsum(noise[axis] + bias[axis] * h)
        degrees = start[axis] + np.degrees(true_angle + drift)
        degrees = np.round(degrees / QUANTUM_DEG) * QUANTUM_DEG
        out[axis] = (degrees + WRAP_DEG) % (2 * WRAP_DEG) - WRAP_DEG
    return times, out, bias


def cameras(truth: Truth, scenario: Scenario, rng: np.random.Generator) -> tuple[Array, Array]:
    """Times (n,) [s] and quaternions (3, n, 4), SCF to ICRF, of the cameras at 2 Hz; NaN where a camera does not see.

    q_SCA = q_true Exp(mounting error) q_QSA* Exp(n), n white in SCF axes, k times as large about the boresight.
    """
    draws = rng.spawn(5)
    q_qsa = mounting(scenario.mount)
    seen = truth.at(CAMERA_HZ, scenario.duration_s)
    t, n = seen.t, len(seen.t)
    q_true = seen.q
    if scenario.shift_s:
        steps = scenario.shift_s * GYRO_HZ
        if abs(steps - round(steps)) > 1e-9 or abs(scenario.shift_s) > 2:
            raise ValueError(f"shift_s = {scenario.shift_s:g} s must be a multiple of 0.125 s, at most 2 s.")
        first = round((t[0] - truth.t[0]) * GYRO_HZ) - round(steps)
        q_true = truth.q[first : first + (n - 1) * (GYRO_HZ // CAMERA_HZ) + 1 : GYRO_HZ // CAMERA_HZ]
    across = np.array([1.0, 1.0, scenario.k_aniso]) * scenario.sigma
    noise = draws[0].standard_normal((3, n, 3)) * across
    if scenario.fov_rad:
        keep = math.exp(-1.0 / (CAMERA_HZ * scenario.fov_tau_s))
        white = draws[1].standard_normal((3, n, 3)) * np.sqrt(1.0 - keep**2)
        white[:, 0] /= np.sqrt(1.0 - keep**2)
        noise = noise + scenario.fov_rad * np.array([1.0, 1.0, 3.0]) * lfilter([1.0], [1.0, -keep], white, axis=1)
    wrong = scenario.mount_err_rad * draws[2].standard_normal((3, 3))
    out = np.empty((3, n, 4))
    for camera in range(3):
        q = multiply(multiply(q_true, exp(wrong[camera])), conjugate(q_qsa[camera]))
        out[camera] = multiply(q, exp(noise[camera]))
        boresight = matrix(q_qsa[camera])[2]
        to_sun = np.einsum("kij,j,i->k", matrix(q_true), boresight, SUN)
        blind = to_sun > math.cos(SUN_EXCLUSION)
        for start, length in _dropouts(scenario.duration_s, draws[3]):
            blind |= (t >= start) & (t < start + length)
        blind |= (t >= scenario.gap_start_s) & (t < scenario.gap_start_s + scenario.gap_s)
        if camera + 1 in scenario.cameras_off:
            blind[:] = True
        out[camera] *= np.where(draws[4].random(n) < FLIP_PROBABILITY, -1.0, 1.0)[:, None]
        out[camera][blind] = np.nan
    return t, out


def _dropouts(duration: float, rng: np.random.Generator) -> list[tuple[float, float]]:
    count = rng.poisson(DROPOUTS_PER_DAY * duration / 86400.0)
    return list(zip(rng.uniform(0, duration, count), rng.exponential(DROPOUT_MEAN, count), strict=True))


def observe(truth: Truth, satellite: str, scenario: Scenario, rng: np.random.Generator) -> tuple[Truth, Telemetry]:
    """The truth with its gyro biases, and what a satellite's sensors give; rng has a child for gyros and cameras."""
    gyro_rng, camera_rng = rng.spawn(2)
    t_gyro, gyro, bias = gyros(truth, satellite, scenario, gyro_rng)
    t_camera, q_camera = cameras(truth, scenario, camera_rng)
    known = replace(truth, bias=np.concatenate([bias, bias[:, -1:]], axis=1).T)
    return known, Telemetry(satellite, EPOCH_2019, t_camera, q_camera, mounting(scenario.mount), t_gyro, gyro)


def simulate(scenario: Scenario, seed: int, satellites: Sequence[str] = SATELLITES) -> Recording:
    """Truth on the 8 Hz grid and sensor data, run `seed` of an ensemble.

    satellites : those whose sensors are simulated; both fly, and each gets the same data whatever the other does.
    """
    truth_rng, *sensor_rngs = np.random.default_rng(seed).spawn(3)
    motion = fly(scenario, truth_rng)
    rngs = dict(zip(SATELLITES, sensor_rngs, strict=True))
    seen = {s: observe(motion[s], s, scenario, rngs[s]) for s in satellites}
    truth = motion | {s: known for s, (known, _) in seen.items()}
    at = {s: truth[s].at(1, scenario.duration_s) for s in SATELLITES}
    raw = {s: telemetry for s, (_, telemetry) in seen.items()}
    return Recording(at["C"].t, raw, {s: at[s].r for s in SATELLITES}, {s: at[s].v for s in SATELLITES}, truth)


def mounting_errors(seed: int, satellite: str) -> Array:
    """Mounting errors (3, 3) of the cameras of a flight, in units of `mount_err_rad`, as `cameras` draws them."""
    rng = np.random.default_rng(seed).spawn(3)[1 + SATELLITES.index(satellite)]
    return rng.spawn(2)[1].spawn(5)[2].standard_normal((3, 3))
