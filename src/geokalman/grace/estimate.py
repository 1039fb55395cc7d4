"""The three ways to a range-rate: Newton differentiation, the linear ("extended") filter, the unscented fusion filter.

The filters are one model and two sensors for the core's `run`. Dynamics (50), (51) and position observation (52) are
linear, so the paper's EKF is a plain Kalman filter; the range-rate (53) is the only non-linear part.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numba import njit

from geokalman.grace.differentiate import derivative
from geokalman.grace.model import (
    ACCELERATION,
    POSITION,
    VELOCITY,
    Array,
    Observations,
    Tuning,
    distance,
    kinematic,
    los_acceleration,
    range_rate,
)
from geokalman.kalman.gaussian import Gaussian
from geokalman.kalman.model import OBSERVE, Model, Sensor
from geokalman.kalman.run import Kind, run
from geokalman.kalman.smoothing import smooth

N = 9
SIGMA_POINTS = 2 * N + 1
Update = Literal["sequential", "simultaneous"]


@dataclass(frozen=True)
class Differentiated:
    """Range (n,) [m], its rate (n,) and relative velocity (n, 3) [m/s]; NaN at the edges."""

    dt: float
    rho: Array
    rate: Array
    dv: Array


@dataclass(frozen=True)
class States:
    """States [dr, dv, da] (n, 9) every dt [s], with covariances (n, 9, 9) or None."""

    dt: float
    x: Array
    P: Array | None = None

    @property
    def dr(self) -> Array:
        """Give the relative position (n, 3) [m]."""
        return self.x[:, POSITION]

    @property
    def dv(self) -> Array:
        """Give the relative velocity (n, 3) [m/s]."""
        return self.x[:, VELOCITY]

    @property
    def rho(self) -> Array:
        """Compute the range (44) of the state (n,) [m]."""
        return distance(self.dr)

    @property
    def rate(self) -> Array:
        """Compute the range-rate (45) of the state (n,) [m/s]."""
        return range_rate(self.dr, self.dv)

    @property
    def los(self) -> Array:
        """Compute the line-of-sight acceleration e . da (n,) [m/s^2]: (46) and (47) together."""
        return los_acceleration(self.dr, self.x[:, ACCELERATION])

    def rate_sigma(self, epochs: slice = slice(None)) -> Array:
        """Compute the standard deviation of the range-rate [m/s], linearised at the state.

        epochs : which are wanted; their covariances must be there.
        """
        x = self.x[epochs]
        H = np.zeros_like(x)
        for k, state in enumerate(x):
            _range_rate_row(state, H[k])
        return np.sqrt(np.einsum("ki,kij,kj->k", H, self.P[epochs], H))


@dataclass(frozen=True)
class Estimate:
    """Filtered and smoothed states, and whitened innovations (n, 4): position, range-rate."""

    filtered: States
    smoothed: States
    innovations: Array


def newton(data: Observations, points: int = 9) -> Differentiated:
    """Differentiate ranges and relative positions: the paper's first method.

    points : of the central formula. Raises ValueError where there are fewer epochs than points.
    """
    rho = distance(data.baseline)
    return Differentiated(data.dt, rho, derivative(rho, data.dt, points), derivative(data.baseline, data.dt, points))


def ekf(data: Observations, tuning: Tuning, covariances: bool = False) -> Estimate:
    """Filter relative positions alone, (16) to (20), then smooth: the paper's "EKF".

    covariances : smooth them too (without them the smoother is four times as fast).
    Raises NotPositiveDefinite, naming the epoch.
    """
    return _run(data, tuning, None, "extended", covariances)


def ukf(data: Observations, tuning: Tuning, update: Update = "sequential", covariances: bool = False) -> Estimate:
    """Filter positions and range-rate unscented, (26) to (43), then smooth: the paper's UKF.

    The dynamics are linear, so that the smoother is RTS.
    update : `sequential` takes the position first and draws the sigma points from the updated state, `simultaneous`
    puts both into one vector and linearises (53) at a predicted state that is a metre off, which biases the range-rate;
    covariances : smooth them too. Raises NotPositiveDefinite, naming the epoch.

    >>> from geokalman.grace import assess, simulate
    >>> from geokalman.grace.model import Scenario
    >>> scenario = Scenario(days=1 / 144, dt=10.0, n_max=4)  # ten minutes without noise
    >>> gravity = scenario.gravity()
    >>> orbit = simulate.orbit_pair(scenario, gravity)
    >>> data = simulate.observe(orbit, gravity)
    >>> rates = [method(data, Tuning()).smoothed.rate for method in (ekf, ukf)]
    >>> alone, fused = (assess.statistics(assess.range_rate_residual(rate, orbit), edge=10).std for rate in rates)
    >>> fused < 0.5 * alone < 1e-8  # standard deviations of the range-rate [m/s]
    True
    """
    return _run(data, tuning, update, "unscented", covariances)


def fused_ekf(data: Observations, tuning: Tuning, update: Update = "sequential", covariances: bool = False) -> Estimate:
    """Filter as `ukf`, with the range-rate linearised (18): the control that the paper lacks."""
    return _run(data, tuning, update, "extended", covariances)


def _sensors(data: Observations, tuning: Tuning, update: Update | None) -> list[Sensor]:
    """The position, and where `update` is given the range-rate after it or in one vector with it."""
    r, s = tuning.sigma_r**2, tuning.sigma_rr(data.dt) ** 2
    if update == "simultaneous":
        both = np.column_stack([data.baseline, data.rate])
        return [Sensor(both, np.diag([r, r, r, s]), h=_observe_both)]
    position = Sensor(data.baseline, r * np.eye(3), H=np.eye(3, N))
    return [position, Sensor(data.rate[:, None], [[s]], h=_observe_rate)] if update else [position]


def _run(data: Observations, tuning: Tuning, update: Update | None, kind: Kind, covariances: bool) -> Estimate:
    dt = data.dt
    Phi, Q = kinematic(dt, tuning.q(dt))
    course = run(
        Gaussian(data.prior_mean, data.prior_cov), dt * np.arange(len(data.baseline)), Model(F=Phi, Q=Q),
        _sensors(data, tuning, update), kind, alpha=tuning.alpha, beta=tuning.beta, kappa=tuning.kappa,
    )  # fmt: skip
    smoothed = smooth(course, covariances)
    innovations = np.full((len(data.baseline), 4), np.nan)
    innovations[:, : course.whitened.shape[1]] = course.whitened
    filtered = States(dt, course.mean, course.cov)
    return Estimate(filtered, States(dt, smoothed.mean, smoothed.cov), innovations)


@njit(cache=True)
def _range_rate_row(x, H):
    """Range-rate (45) of the state and its gradient H (9,): d/d(dr) = (dv - rate e) / rho, d/d(dv) = e."""
    rho = np.sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2])
    rate = (x[0] * x[3] + x[1] * x[4] + x[2] * x[5]) / rho
    for j in range(H.size):
        H[j] = 0.0
    for j in range(min(H.size, 3)):
        e = x[j] / rho
        H[j] = (x[3 + j] - rate * e) / rho
        H[3 + j] = e
    return rate


@njit(OBSERVE, cache=True)
def _observe_rate(t, x, u, p, h, H, R):
    """Range-rate (53)."""
    h[0] = _range_rate_row(x, H[0] if H.size else u)
    return 0


@njit(OBSERVE, cache=True)
def _observe_both(t, x, u, p, h, H, R):
    """Position (52) and range-rate (53) in one vector."""
    for j in range(3):
        h[j] = x[j]
    h[3] = _range_rate_row(x, H[3] if H.size else u)
    for j in range(3 if H.size else 0):
        H[j] = 0.0
        H[j, j] = 1.0
    return 0
