"""The true motion of the pair, on the line and in the plane, and what its instruments observe."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geokalman.kalman.discretise import van_loan
from geokalman.kalman.gaussian import Gaussian, gaussian
from geokalman.pair.model import Array, Observations, Scenario, along_the_line, in_the_plane

PRIOR_SIGMAS = (1.0, 1e-2)
"""Standard deviations of the prior position [m] and rate [m/s]; that of the acceleration is the scenario's."""
LOUD = 20.0
"""Standard deviation of an outlier over that of the noise."""


@dataclass(frozen=True)
class Truth:
    """True states: t (N,) [s]; x (N, 3) on the line or (N, 4) in the plane, as `geokalman.pair.model` orders them."""

    t: Array
    x: Array

    @property
    def range(self) -> Array:
        """Distance (N,) [m]; on the line less its mean."""
        return self.x[:, 0] if self.x.shape[1] == 3 else np.hypot(self.x[:, 0], self.x[:, 1])

    @property
    def rate(self) -> Array:
        """Range-rate (N,) [m/s]."""
        if self.x.shape[1] == 3:
            return self.x[:, 1]
        return (self.x[:, :2] * self.x[:, 2:]).sum(axis=1) / self.range


def _walk(x: Array, t: Array, Phi: Array, Q: Array, rng: np.random.Generator) -> Truth:
    """x_next = Phi x + w, w ~ N(0, Q), from x at t[0]; the draws are (N - 1, n)."""
    scale = np.sqrt(np.maximum(np.diag(Q), np.finfo(float).tiny))  # variances differ by many orders
    values, vectors = np.linalg.eigh(Q / scale[:, None] / scale)
    root = scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    noise = rng.standard_normal((len(t) - 1, len(x))) @ root.T
    states = np.empty((len(t), len(x)))
    states[0] = x
    for k, w in enumerate(noise):
        states[k + 1] = Phi @ states[k] + w
    return Truth(t, states)


def on_the_line(scenario: Scenario, rng: np.random.Generator) -> Truth:
    """Move the pair on the line: it breathes once per revolution and is pushed by a Gauss-Markov acceleration.

    The first state is amplitude [cos phase, -n sin phase] with an acceleration drawn from its distribution; the draws
    are, in this order, that one and (N - 1, 3) for the steps. The motion is that of `along_the_line`, exactly.
    """
    n, phase = scenario.n, scenario.phase
    swing = scenario.amplitude * np.array([np.cos(phase), -n * np.sin(phase)])
    first = np.append(swing, scenario.sigma_a * rng.standard_normal())
    Phi, Q = van_loan(*along_the_line(n, scenario.sigma_a, scenario.tau), scenario.step)
    return _walk(first, scenario.t, Phi, Q, rng)


def in_plane(scenario: Scenario, rng: np.random.Generator) -> Truth:
    """Move the pair in the plane by Hill's equations with white accelerations of density 2 sigma_a^2 tau.

    The free motion is an ellipse twice as long as high about the mean separation, without drift: y = separation +
    amplitude cos(n t + phase), x = amplitude/2 sin(n t + phase). The draws are (N - 1, 4).
    """
    n, phase, half = scenario.n, scenario.phase, 0.5 * scenario.amplitude
    x, y = half * np.sin(phase), 2.0 * half * np.cos(phase)
    first = np.array([x, scenario.separation + y, half * n * np.cos(phase), -2.0 * n * x])
    Phi, Q = van_loan(*in_the_plane(n, 2.0 * scenario.sigma_a**2 * scenario.tau), scenario.step)
    return _walk(first, scenario.t, Phi, Q, rng)


def prior_of(truth: Truth, scenario: Scenario, rng: np.random.Generator) -> Gaussian:
    """Draw a prior whose error has the covariance that it states; the draws are (n,)."""
    position, rate = PRIOR_SIGMAS
    flat = [position, rate, scenario.sigma_a] if truth.x.shape[1] == 3 else [position, position, rate, rate]
    sigma = np.array(flat)
    error = sigma * rng.standard_normal(len(sigma))
    mean = truth.x[0] + error
    if len(sigma) == 3:  # of the acceleration only its distribution is known
        mean[2] = 0.0
    return gaussian(mean, sigma**2)


def observe(truth: Truth, scenario: Scenario, rng: np.random.Generator) -> Observations:
    """Observe the pair by every instrument.

    The draws are, in this order: the prior; GNSS (N, 1) or (N, 2), range-rate (N, 1), range (N, 1), and (N, 1) uniform
    numbers that choose the outliers among the GNSS positions.
    """
    prior, N = prior_of(truth, scenario, rng), len(truth.t)
    position = truth.x[:, :1] if truth.x.shape[1] == 3 else truth.x[:, :2]
    noise = scenario.sigma_gnss * rng.standard_normal(position.shape)
    rate = truth.rate[:, None] + scenario.rate_bias + scenario.sigma_rate * rng.standard_normal((N, 1))
    range_ = truth.range[:, None] + scenario.range_bias + scenario.sigma_range * rng.standard_normal((N, 1))
    loud = rng.random((N, 1)) < scenario.outliers
    gnss = position + np.where(loud, LOUD, 1.0) * noise
    gnss[np.arange(N) % scenario.every != 0] = np.nan
    return Observations(truth.t, gnss, rate, range_, prior)
