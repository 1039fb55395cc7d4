"""Filter with three empirical accelerations, Gauss-Markov processes of first order.

State [r, v, a] (9,): v' = a_J2(r) + a, a' = -a/tau + w, with w so strong that a has the standard deviation sigma in the
long run; otherwise as `estimate`. How an acceleration and its noise reach velocity and position within a substep is
discretised exactly by van Loan's method; gravity couples them by Markley's matrix.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from scipy.linalg import block_diag

from geokalman.kalman.dense import copy_state
from geokalman.kalman.discretise import van_loan
from geokalman.kalman.gaussian import Gaussian
from geokalman.kalman.linear import predict_step
from geokalman.kalman.model import PROPAGATE, Model
from geokalman.physics.transition import chain_step, markley_step
from geokalman.pulsar.dynamics import Force, gradient_point, runge_kutta_step, unpack
from geokalman.pulsar.estimate import Estimate, filtered
from geokalman.pulsar.model import STEP, Array
from geokalman.pulsar.observations import Observations

STEPS = 50
"""Runge-Kutta steps and transition factors in an epoch."""
NOISE = (1.0, 1e-3)
"""Process noise of position [m] and velocity [m/s] in 500 s beside that of the accelerations."""


def run(data: Observations, x0: Array, P0: Array, force: Force, sigma: float, tau: float) -> Estimate:
    """Filter with empirical accelerations, which start at zero.

    sigma : their standard deviation [m s^-2]; tau : their time constant [s]; x0 (6,), P0 (6, 6) and force as for
    `estimate.run`; every range must be there, epochs STEP apart.
    Raises ValueError for sigma or tau not positive and for gaps, Diverged as `estimate.filtered`.
    """
    if not (sigma > 0.0 and tau > 0.0):
        raise ValueError(f"sigma = {sigma:g} m/s^2, tau = {tau:g} s of empirical accelerations must be positive.")
    if np.isnan(data.z).any() or not np.allclose(np.diff(data.t, prepend=0.0), STEP):
        raise ValueError(f"empirical accelerations take epochs {STEP:g} s apart without gaps; use estimate.run else.")
    F = np.kron([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0 / tau]], np.eye(3))
    W = np.kron(np.diag([0.0, 0.0, 2.0 * sigma**2 / tau]), np.eye(3))
    drift, noise = van_loan(F, W, STEP / STEPS)
    model = Model(
        f=_propagate, Q=np.diag(np.repeat([*NOISE, 0.0], 3) ** 2),
        params=np.r_[tau, drift.ravel(), noise.ravel(), force.packed],
    )  # fmt: skip
    return filtered(data, Gaussian(np.r_[x0, np.zeros(3)], block_diag(P0, sigma**2 * np.eye(3))), model, force)


@njit(PROPAGATE, cache=True)
def _propagate(t0, t1, x, u, p, x_out, F, Q):
    """Move by the parameters tau, drift and noise of a substep, and force; add noise to Q."""
    tau, factor, added = p[0], p[1:82].copy().reshape(9, 9), p[82:163].reshape(9, 9)
    head, field, sun = unpack(p[163:])
    G, work, h = np.empty((2, 3, 3)), np.empty((3, 9)), (t1 - t0) / STEPS
    noise, before = np.zeros((9, 9)), np.empty((9, 9))
    copy_state(x, np.eye(9), x_out, F)
    gradient_point(x_out[:3], head, G[0])
    for i in range(STEPS):
        runge_kutta_step(t0 + i * h, x_out, h, head, field, sun, work, tau)
        gradient_point(x_out[:3], head, G[(i + 1) % 2])
        markley_step(G[i % 2], G[(i + 1) % 2], h, factor)  # its block of position and velocity
        copy_state(x_out, noise, work[0], before)
        predict_step(work[0], before, factor, added, work[1], noise)
        chain_step(factor, F)
    for i in range(9):
        for j in range(9):
            Q[i, j] += noise[i, j]
    return 0 if np.isfinite(x_out.sum()) else 1
