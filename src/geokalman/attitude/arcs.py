"""Accelerations turned by two attitudes over an arc: Table 1 as a function of what it leaves open, and what adds up."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from geokalman.attitude import effect, pointing, truth
from geokalman.attitude.model import SATELLITES, Array, Scenario
from geokalman.constants import GM_EARTH, R_EARTH
from geokalman.physics.quaternion import conjugate, from_matrix, rotate

STEP = 30.0


class Arc(NamedTuple):
    """Difference of the accelerations (n, 3) [m/s^2] in the ICRF at t (n,) [s]."""

    t: Array
    change: Array


def anomaly(seed: int) -> float:
    """Mean anomaly of the trailing satellite at t = 0 [rad] in the flight of a seed, as `truth.fly` draws it."""
    return float(np.random.default_rng(seed).spawn(3)[0].spawn(3)[0].uniform(0, 2 * np.pi))


def difference(
    scenario: Scenario, seed: int, offset_rad: float, bias: tuple[float, ...], satellite: str = "C",
    edge_s: float = 600.0,
) -> Arc:  # fmt: skip
    """Difference of accelerations between the attitude along the line of sight and the same with a pitch offset.

    The orbit of the scenario and seed every 30 s, without edge_s at either end; drag, radiation and a bias (3,)
    [m/s^2] along the satellite's axes. Pointing angles and noise are left out: they change it by a part in a thousand.
    """
    t = np.arange(edge_s, scenario.duration_s - edge_s + 0.5 * STEP, STEP)
    ahead = scenario.separation / (R_EARTH + scenario.altitude)
    phase = anomaly(seed)
    states = dict(zip(SATELLITES, (truth.orbit(t, scenario, phase + x) for x in (ahead, 0.0)), strict=True))
    other = SATELLITES[1 - SATELLITES.index(satellite)]
    (r, v), r_other = states[satellite], states[other][0]
    q = from_matrix(truth.los_frame(r, r_other))
    a = rotate(conjugate(q), effect.nongravitational(r, v)) + np.asarray(bias)
    return Arc(t, pointing.acceleration_difference(q, effect.turned(q, offset_rad), a))


def left_after_revolutions(arc: Arc, period: float) -> float:
    """Rms of the difference left after a constant and terms at 1 and 2 cycles per revolution, over that before."""
    w = 2 * np.pi / period * arc.t
    A = np.column_stack([np.ones_like(w), *(f(k * w) for k in (1, 2) for f in (np.cos, np.sin))])
    left = arc.change - A @ np.linalg.lstsq(A, arc.change, rcond=None)[0]
    return float(np.sqrt(np.mean(left**2) / np.mean(arc.change**2)))


class Departure(NamedTuple):
    """Largest departure [m] over an arc, by phase of the orbit at its start: from a fixed and an estimated state."""

    fixed: Array
    estimated: Array


def departures(acceleration: float, duration: float, altitude: float = 490e3, phases: int = 36) -> Departure:
    """Departure from a polar circular orbit by a constant inertial acceleration in its plane, for phases of its start.

    The motion is that of `effect.hill_course`. fixed : both orbits start alike; estimated : the initial state (four
    components in the plane) is fitted to the arc by least squares, as in the adjustment of every arc.
    """
    n = float(np.sqrt(GM_EARTH / (R_EARTH + altitude) ** 3))
    start = np.zeros((4, phases + 4))
    start[:, phases:] = np.diag([1.0, 1.0, n, n])  # the four free motions, beside the forced ones
    forced = np.concatenate([np.full(phases, acceleration), np.zeros(4)])
    angle = np.concatenate([2 * np.pi * np.arange(phases) / phases, np.zeros(4)])
    course = effect.hill_course(forced, angle, start, duration, altitude)
    place = course[:, :2].reshape(-1, phases + 4)  # radial and along-track, one below the other
    moved, free = place[:, :phases], place[:, phases:]
    left = moved - free @ np.linalg.lstsq(free, moved, rcond=None)[0]
    fixed, estimated = (np.linalg.norm(y.reshape(-1, 2, phases), axis=1).max(axis=0) for y in (moved, left))
    return Departure(fixed, estimated)


def first_order_step(rate: float, dt: float) -> float:
    """Error [rad] of one step of q + Omega(omega) q dt / 2, normalised, for a constant rate [rad/s].

    The step turns by 2 atan(omega dt / 2) in the place of omega dt; the earlier filter's transition as the paper
    describes it (rates made into small quaternion changes).
    """
    return rate * dt - 2.0 * np.arctan(0.5 * rate * dt)
