"""Judge transition matrices, Markley's and an integrated one, by differences of the flow."""

from __future__ import annotations

import numpy as np

from geokalman.physics.oblate import oblate_force
from geokalman.physics.orbit import integrate
from geokalman.physics.transition import chain_step, variational_step
from geokalman.pulsar.dynamics import Force, gradient_point, orbit_loop, runge_kutta_step
from geokalman.pulsar.estimate import propagate_loop
from geokalman.pulsar.model import STEP, Array

BLOCKS = {"rr": np.s_[:3, :3], "rv": np.s_[:3, 3:], "vr": np.s_[3:, :3], "vv": np.s_[3:, 3:]}
"""Blocks of a transition matrix of [r, v]: units 1, s, 1/s, 1."""


def markley(force: Force, x: Array, substeps: int, dt: float = STEP, longest: float = 10.0) -> Array:
    """Chain Markley's matrices over dt from x (6,): (6, 6); Runge-Kutta steps up to `longest`."""
    Phi, h = np.empty((6, 6)), dt / substeps
    inner = max(1, int(np.ceil(h / longest - 1e-9)))
    propagate_loop(0.0, dt, x, h, inner, force.head, force.field, force.sun, np.empty(6), Phi)
    return Phi


def integrated(force: Force, x: Array, substeps: int, dt: float = STEP) -> Array:
    """Integrate the variational equations with the J2 gradient by Runge-Kutta steps: (6, 6)."""
    y, work, h = x.copy(), np.empty((3, 6)), dt / substeps
    total, factor, G = np.eye(6), np.empty((6, 6)), np.empty((3, 3, 3))
    for k in range(substeps):
        gradient_point(y[:3], force.head, G[0])
        for half in (1, 2):
            runge_kutta_step(k * h + (half - 1) * h / 2, y, h / 2, force.head, force.field, force.sun, work)
            gradient_point(y[:3], force.head, G[half])
        variational_step(G[0], G[1], G[2], h, factor)
        chain_step(factor, total)
    return total


def by_differences(
    force: Force, x: Array, dt: float = STEP, step: float = 10.0, dr: float = 1.0, dv: float = 1e-3
) -> Array:
    """Difference the flow centrally, dr [m] and dv [m/s] either way: (6, 6)."""
    Phi, ends = np.empty((6, 6)), np.empty((2, 1, 6))
    for j in range(6):
        delta = dr if j < 3 else dv
        for i, sign in enumerate((1.0, -1.0)):
            y = x.copy()
            y[j] += sign * delta
            orbit_loop(y, np.array([dt]), round(dt / step), force.head, force.field, force.sun, ends[i])
        Phi[:, j] = (ends[0, 0] - ends[1, 0]) / (2.0 * delta)
    return Phi


def block_errors(Phi: Array, reference: Array) -> dict[str, float]:
    """Give the largest error of each block: rr [-], rv [s], vr [1/s], vv [-]."""
    return {name: float(np.abs(Phi - reference)[block].max()) for name, block in BLOCKS.items()}


def step_error(force: Force, x: Array, step: float, dt: float = STEP) -> float:
    """Hold the position after dt by steps of `step` seconds in J2 against DOP853: error [m]."""
    out = np.empty((1, 6))
    orbit_loop(x, np.array([dt]), round(dt / step), force.head, force.field, force.sun, out)
    return float(np.linalg.norm(out[0, :3] - precise_orbit(force, x, np.array([dt]))[0, :3]))


def precise_orbit(force: Force, x: Array, t: Array, step: float = 5.0) -> Array:
    """Integrate x (6,) in J2 by DOP853, which stands for RKF7(8): states (n, 6) at t (n,) [s]."""
    return integrate(oblate_force, force.head[:3], x, np.concatenate([[0.0], t]), "dop853", step).y[1:]
