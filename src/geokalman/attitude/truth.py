"""True orbits and attitudes of the pair: an analytic orbit with secular J2, and pointing angles like GRACE-FO's.

A `Recording` holds what the sensors gave together with that truth, where there is one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numba import njit

from geokalman.attitude.model import GYRO_HZ, Array, Scenario, Telemetry, gyro_matrix, los_frame
from geokalman.constants import GM_EARTH, R_EARTH
from geokalman.physics.quaternion import continuous, difference, exp, from_matrix, multiply

J2 = 1.0826e-3
REVOLUTION = 5668.0  # s, of the pointing sines: a fixed constant, not the orbit's
ANGLE_SCALE = (3e-4, 1.5e-4, 2e-4)
THRUSTER = (6e-6, 2e-6, 3e-6)
THRUSTER_TAU = 25.0
EVENTS_PER_DAY = 500.0
MARGIN = 2  # s more at either end, so that no interpolation meets an edge


@dataclass(frozen=True)
class Truth:
    """True motion of one satellite on the 8 Hz grid t (n,) [s]: r (n, 3) [m], v (n, 3) [m/s], q (n, 4) SRF to ICRF.

    bias : (n, 4) [rad/s] of the gyro axes, once the sensors are simulated.
    """

    t: Array
    r: Array
    v: Array
    q: Array
    bias: Array | None = None

    def at(self, hz: int, duration: float) -> Truth:
        """The same at `hz` (a divisor of 8) from 0 to the duration."""
        start = int(MARGIN * GYRO_HZ)
        pick = slice(start, start + int(duration) * GYRO_HZ + 1, GYRO_HZ // hz)
        return Truth(
            self.t[pick], self.r[pick], self.v[pick], self.q[pick], None if self.bias is None else self.bias[pick]
        )


@dataclass(frozen=True)
class Recording:
    """Raw data of both satellites, their orbits r, v (n, 3) at the whole seconds t (n,), and the truth where simulated.

    accelerations : satellite -> (n, 3) [m/s^2] in the SRF from ACT1B, where there are any; edge : satellite -> those of
    the seconds t at which the clock of its files was carried beyond its tables or across a break, where read.
    """

    t: Array
    raw: dict[str, Telemetry]
    r: dict[str, Array]
    v: dict[str, Array]
    truth: dict[str, Truth] = field(default_factory=dict)
    accelerations: dict[str, Array] = field(default_factory=dict)
    edge: dict[str, Array] = field(default_factory=dict)

    @property
    def duration(self) -> float:
        """Length [s]."""
        return float(self.t[-1] - self.t[0])

    def true_attitude(self, satellite: str, hz: int = 1) -> Array | None:
        """True attitudes (n, 4) at `hz`, or None for real data."""
        return self.truth[satellite].at(hz, self.duration).q if self.truth else None

    def true_bias(self, satellite: str, axes: tuple[int, ...], hz: int = 1) -> Array | None:
        """True gyro biases (n, 3) [rad/s] in SRF axes, as the gyros in use see them, at `hz`; None for real data."""
        if not self.truth:
            return None
        of_axes = self.truth[satellite].at(hz, self.duration).bias[:, [axis - 1 for axis in axes]]
        return np.linalg.lstsq(gyro_matrix(satellite, axes), of_axes.T, rcond=None)[0].T


def grid(scenario: Scenario) -> Array:
    """The 8 Hz grid (n,) [s], with its margins."""
    return np.arange(-MARGIN * GYRO_HZ, (int(scenario.duration_s) + MARGIN) * GYRO_HZ + 1) / GYRO_HZ


def orbit(t: Array, scenario: Scenario, anomaly: float) -> tuple[Array, Array]:
    """Positions [m] and velocities [m/s] (n, 3) on an ellipse whose node, perigee and mean anomaly drift by J2.

    anomaly : mean anomaly at t = 0 [rad].
    """
    a, e, inc = R_EARTH + scenario.altitude, scenario.eccentricity, scenario.inc
    n = math.sqrt(GM_EARTH / a**3)
    factor = 1.5 * J2 * n * (R_EARTH / (a * (1 - e * e))) ** 2
    raan_rate = -factor * math.cos(inc)
    argp_rate = factor * (2 - 2.5 * math.sin(inc) ** 2)
    mean_rate = n + factor * math.sqrt(1 - e * e) * (1 - 1.5 * math.sin(inc) ** 2)
    r, v = np.empty((len(t), 3)), np.empty((len(t), 3))
    _orbit(t, a, e, inc, scenario.raan, raan_rate, scenario.argp, argp_rate, anomaly, mean_rate, r, v)
    return r, v


@njit(cache=True)
def _orbit(t, a, e, inc, raan0, raan_rate, argp0, argp_rate, anomaly, mean_rate, r, v):
    """Kepler's equation by Newton, then the turning ellipse; velocity is the exact derivative of the position."""
    ci, si = math.cos(inc), math.sin(inc)
    for k in range(len(t)):
        M = anomaly + mean_rate * t[k]
        E = M
        for _ in range(6):
            E -= (E - e * math.sin(E) - M) / (1.0 - e * math.cos(E))
        c, s = math.cos(E), math.sin(E)
        b = a * math.sqrt(1.0 - e * e)
        E_rate = mean_rate / (1.0 - e * c)
        x, y = a * (c - e), b * s
        vx, vy = -a * s * E_rate - argp_rate * y, b * c * E_rate + argp_rate * x
        argp, raan = argp0 + argp_rate * t[k], raan0 + raan_rate * t[k]
        cw, sw, co, so = math.cos(argp), math.sin(argp), math.cos(raan), math.sin(raan)
        u, w = cw * x - sw * y, sw * x + cw * y
        vu, vw = cw * vx - sw * vy, sw * vx + cw * vy
        r[k, 0], r[k, 1], r[k, 2] = co * u - so * ci * w, so * u + co * ci * w, si * w
        v[k, 0] = co * vu - so * ci * vw - raan_rate * r[k, 1]
        v[k, 1] = so * vu + co * ci * vw + raan_rate * r[k, 0]
        v[k, 2] = si * vw


def pointing_angles(t: Array, rng: np.random.Generator) -> Array:
    """Roll, pitch, yaw (n, 3) [rad]: sines at 1 to 3 per revolution, 80 sines up to 0.05 Hz, and thruster responses."""
    angles = np.zeros((len(t), 3))
    n_events = rng.poisson(EVENTS_PER_DAY * (t[-1] - t[0] + 200.0) / 86400.0)
    events = rng.uniform(t[0] - 200.0, t[-1], n_events)
    kicks = rng.standard_normal((n_events, 3)) * np.array(THRUSTER)
    for axis, scale in enumerate(ANGLE_SCALE):
        f = np.exp(rng.uniform(math.log(3e-4), math.log(0.05), 80))
        amplitude = np.sqrt(f) / (1.0 + (f / 3e-3) ** 2)
        amplitude *= 0.7 * scale / math.sqrt(0.5 * np.sum(amplitude**2))
        f = np.concatenate([np.arange(1, 4) / REVOLUTION, f])
        amplitude = np.concatenate([scale * np.array([0.7, 0.5, 0.25]), amplitude])
        _sines(t, 2 * math.pi * f, amplitude, rng.uniform(0, 2 * math.pi, len(f)), angles[:, axis])
    _kicks(t, events, kicks, THRUSTER_TAU, angles)
    return angles


@njit(cache=True)
def _sines(t, omega, amplitude, phase, out):
    """Sum of sines by turning phasors, set anew every 256 samples so that rounding does not grow.

    Eight turn at a time: a phasor alone waits for its own last product.
    """
    h = t[1] - t[0]
    x, y = np.empty(8), np.empty(8)
    for first in range(0, len(omega), 8):
        w, a, p = omega[first : first + 8], amplitude[first : first + 8], phase[first : first + 8]
        c, s = np.cos(w * h), np.sin(w * h)
        for k in range(len(t)):
            if k % 256 == 0:
                for j in range(len(w)):
                    x[j], y[j] = math.cos(w[j] * t[k] + p[j]), math.sin(w[j] * t[k] + p[j])
            total = out[k]
            for j in range(len(w)):
                total += a[j] * y[j]
                x[j], y[j] = x[j] * c[j] - y[j] * s[j], x[j] * s[j] + y[j] * c[j]
            out[k] = total


@njit(cache=True)
def _kicks(t, events, kicks, tau, out):
    """Add a tau d^2 exp(-d), d = (t - t_e) / tau, cut at 14 tau."""
    h = t[1] - t[0]
    for e in range(len(events)):
        first = max(0, int(math.ceil((events[e] - t[0]) / h)))
        last = min(len(t), int((events[e] + 14.0 * tau - t[0]) / h) + 1)
        for k in range(first, last):
            d = (t[k] - events[e]) / tau
            shape = tau * d * d * math.exp(-d)
            for i in range(3):
                out[k, i] += kicks[e, i] * shape


def attitude(r_self: Array, r_other: Array, angles: Array) -> Array:
    """Attitudes q (n, 4), SRF to ICRF, that point by `angles` (roll, pitch, yaw) off the line of sight.

    q = q_LOS q_z(yaw) q_y(pitch) q_x(roll), since C_LOS->SRF = R1(roll) R2(pitch) R3(yaw) of passive rotations.
    """
    q = from_matrix(los_frame(r_self, r_other))
    for i in (2, 1, 0):
        q = multiply(q, exp(angles[:, i, None] * np.eye(3)[i]))
    return continuous(q)


def increments(q: Array) -> Array:
    """Rotation vectors Log(q_k* q_k+1) (n - 1, 3) [rad] between neighbouring attitudes (n, 4)."""
    return difference(q[:-1], q[1:])


def fly(scenario: Scenario, rng: np.random.Generator) -> dict[str, Truth]:
    """True motion of C (leading) and D at 8 Hz; rng has children for the anomaly and each pointing."""
    t = grid(scenario)
    children = rng.spawn(3)
    anomaly = children[0].uniform(0, 2 * math.pi)
    ahead = scenario.separation / (R_EARTH + scenario.altitude)
    (r_C, v_C), (r_D, v_D) = orbit(t, scenario, anomaly + ahead), orbit(t, scenario, anomaly)
    q_C = attitude(r_C, r_D, pointing_angles(t, children[1]))
    q_D = attitude(r_D, r_C, pointing_angles(t, children[2]))
    return {"C": Truth(t, r_C, v_C, q_C), "D": Truth(t, r_D, v_D, q_D)}
