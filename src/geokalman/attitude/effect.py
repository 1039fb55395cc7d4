"""What attitude errors do downstream: accelerations in the ICRF, the antenna correction's rate, range-rates."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from geokalman.attitude import pointing
from geokalman.attitude.model import SATELLITES, SUN, Array
from geokalman.attitude.truth import Recording
from geokalman.constants import GM_EARTH, R_EARTH
from geokalman.physics.quaternion import conjugate, exp, multiply, rotate

Attitudes = Mapping[str, Array]


def nongravitational(r: Array, v: Array) -> Array:
    """Drag and radiation (n, 3) [m/s^2] in the ICRF at states r [m], v [m/s].

    Drag 2.5e-8 (1 + 0.7 r.s) against the velocity, sunlight 2e-8 away from the Sun where it shines (shadow: r.s < 0 and
    |r x s| below the Earth's radius), the Earth's light 8e-9 (0.3 + max(r.s, 0)) upward.
    """
    up = r / np.linalg.norm(r, axis=1, keepdims=True)
    ahead = v / np.linalg.norm(v, axis=1, keepdims=True)
    day = up @ SUN
    dark = (day < 0) & (np.linalg.norm(np.cross(r, SUN), axis=1) < R_EARTH)
    return (
        -2.5e-8 * (1 + 0.7 * day)[:, None] * ahead
        - 2e-8 * np.where(dark, 0.0, 1.0)[:, None] * SUN
        + 8e-9 * (0.3 + np.maximum(day, 0.0))[:, None] * up
    )


def accelerometer(
    recording: Recording, satellite: str, q: Array, acc_bias: tuple[float, ...] = (0.0, 0.0, 0.0)
) -> Array:
    """Accelerations (n, 3) [m/s^2] in the SRF plus a bias: from ACT1B for real data, else of the model at attitudes q.

    Raises ValueError for a bias without three components.
    """
    if len(acc_bias) != 3:
        raise ValueError(f"acc_bias = {list(acc_bias)} must have three components, along x, y and z of the satellite.")
    if satellite in recording.accelerations:
        return recording.accelerations[satellite] + np.array(acc_bias)
    return rotate(conjugate(q), nongravitational(recording.r[satellite], recording.v[satellite])) + np.array(acc_bias)


def turned(q: Array, pitch_offset_rad: float) -> Array:
    """Attitudes with a constant added to the pitch: q Exp(0, offset, 0)."""
    return multiply(q, exp(np.array([0.0, pitch_offset_rad, 0.0])))


def range_rate_difference(
    recording: Recording, changed: Attitudes, nominal: Attitudes, truth: Attitudes, step: int = 30
) -> Array:
    """Change of the range-rate (m,) [m/s] from attitudes `nominal` to `changed`, every `step` seconds.

    Rate of the antenna correction's difference (mean over a step) plus the time integral of e . (da_D - da_C), 3.12.
    """
    r_C, r_D = recording.r["C"], recording.r["D"]
    e = (r_D - r_C) / np.linalg.norm(r_D - r_C, axis=1, keepdims=True)
    antenna = pointing.antenna_correction(changed["C"], changed["D"], r_C, r_D) - pointing.antenna_correction(
        nominal["C"], nominal["D"], r_C, r_D
    )
    change = {
        s: pointing.acceleration_difference(changed[s], nominal[s], accelerometer(recording, s, truth[s]))
        for s in SATELLITES
    }
    along = np.einsum("ki,ki->k", e, change["D"] - change["C"])
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (along[1:] + along[:-1]))])
    k = np.arange(0, len(antenna) - step, step)
    return (antenna[k + step] - antenna[k]) / step + integral[k + step // 2]


def hill_course(force: Array, phase: Array, start: Array, duration: float, altitude: float) -> Array:
    """Motions about a polar circular orbit under constant inertial forces in its plane (steps + 1, 4, m).

    Hill's equations, radial and along-track place and velocity [m, m/s], by the classical Runge-Kutta method at 10 s;
    a force turns once a revolution in the orbital frame. force : (m,) [m/s^2]; phase : (m,) of the orbit at the start
    [rad]; start : (4, m).
    """
    n = float(np.sqrt(GM_EARTH / (R_EARTH + altitude) ** 3))

    def rate(t: float, x: Array) -> Array:
        up, along = force * np.sin(n * t + phase), force * np.cos(n * t + phase)
        return np.array([x[2], x[3], 3 * n * n * x[0] + 2 * n * x[3] + up, -2 * n * x[2] + along])

    course, h = [start], 10.0
    for k in range(round(duration / h)):
        t, x = k * h, course[-1]
        k1 = rate(t, x)
        k2 = rate(t + h / 2, x + h / 2 * k1)
        k3 = rate(t + h / 2, x + h / 2 * k2)
        k4 = rate(t + h, x + h * k3)
        course.append(x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4))
    return np.array(course)


def constant_force_departure(acceleration: float, duration: float, altitude: float = 490e3) -> float:
    """Largest departure [m] from a polar circular orbit by a constant inertial acceleration in Z, see `hill_course`."""
    course = hill_course(np.array([acceleration]), np.zeros(1), np.zeros((4, 1)), duration, altitude)
    return float(np.hypot(course[:, 0], course[:, 1]).max())


def span(series: Array, n: int, rng: np.random.Generator) -> Array:
    """A series of n samples with the spectrum of the measured one (m,): itself where it is long enough, else drawn.

    Drawn: the discrete spectrum of the measured series, interpolated in frequency, times complex normal numbers.
    """
    m = len(series)
    if n <= m:
        return series[:n].copy()
    power = np.abs(np.fft.rfft(series - series.mean())) ** 2 / m
    f = np.fft.rfftfreq(n)
    amplitude = np.sqrt(np.interp(f, np.fft.rfftfreq(m), power) * n / 2)
    draw = amplitude * (rng.standard_normal(len(f)) + 1j * rng.standard_normal(len(f)))
    draw[0] = 0.0
    return np.fft.irfft(draw, n)
