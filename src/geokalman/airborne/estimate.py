"""Gravity along one line: the standard filter forward (SAGK), forward and backward combined (SAGFB), and RTS.

The filters are the core's. Nothing here knows a truth or a reference.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from geokalman import kalman
from geokalman.airborne.model import SHORTEST, Array, Line, ScaledModel, Tuning, build
from geokalman.kalman.gaussian import Smoothed, Trajectory
from geokalman.kalman.information import smooth_two_filter
from geokalman.kalman.smoothing import smooth

Smoother = Literal["rts", "two-filter"]


@dataclass(frozen=True)
class States:
    """States along a line with their covariances, in scaled units.

    names : of the m states; scale : (m,) factors to their own units; t : (n,) [s]; mean : (n, m); cov : (n, m, m).
    """

    names: tuple[str, ...]
    scale: Array
    t: Array
    mean: Array
    cov: Array

    def state(self, name: str) -> Array:
        """Give one state (n,), e.g. `dg` [mGal] or `tau3` [s]; ValueError where there is none."""
        k = self._index(name)
        return self.scale[k] * self.mean[:, k]

    def sigma(self, name: str = "dg") -> Array:
        """Compute the standard deviation (n,) of one state."""
        k = self._index(name)
        return self.scale[k] * np.sqrt(self.cov[:, k, k])

    @property
    def gravity(self) -> Array:
        """Give the gravity disturbance along the line (n,) [mGal]."""
        return self.state("dg")

    def _index(self, name: str) -> int:
        if name not in self.names:
            raise ValueError(f"The model has no state {name!r}; it has {', '.join(self.names)}.")
        return self.names.index(name)


@dataclass(frozen=True)
class Estimate:
    """States of one line, forward and smoothed, and the whitened innovations (n,)."""

    line: str
    forward: States
    smoothed: States
    innovations: Array


def run_filter(line: Line, model: ScaledModel) -> Trajectory:
    """Filter a line forward, (1) to (3). Raises NotPositiveDefinite with the epoch."""
    motion, sensor = kalman.Model(F=model.Phi, Q=model.Q), kalman.Sensor(line.z[:, None], model.R, H=model.H)
    return kalman.run(model.prior, line.t, motion, [sensor])


def run_smoother(line: Line, model: ScaledModel, course: Trajectory, smoother: Smoother) -> Smoothed:
    """Smooth a filtered line.

    smoother : `two-filter` is (4) to (6) in information form, `rts` gives the same numbers with less work.
    """
    if smoother == "rts":
        return smooth(course)
    return smooth_two_filter(course, line.z[:, None], model.H, model.R)


def estimate(line: Line, tuning: Tuning, smoother: Smoother = "rts") -> Estimate:
    """Filter a line forward and smooth it.

    Raises ValueError for a line that is too short, NotPositiveDefinite with the epoch.

    >>> from geokalman.airborne import assess, simulate
    >>> [(truth, line)] = simulate.survey_of_seed(simulate.Scenario(n_lines=1, length_km=20.0), seed=1)
    >>> result = estimate(line, Tuning.preset("paper_like"))
    >>> errors = [(part.gravity - truth.gravity)[truth.proper] for part in (result.forward, result.smoothed)]
    >>> forward, smoothed = (assess.statistics(error).D_raw for error in errors)
    >>> smoothed < forward < 1.0  # root mean squares [mGal]
    True
    """
    if line.t[-1] - line.t[0] < SHORTEST - 1.0:
        raise ValueError(f"Line {line.name} lasts {line.t[-1] - line.t[0]:.1f} s; at least {SHORTEST:g} s are needed.")
    model = build(line, tuning)
    course = run_filter(line, model)
    both = run_smoother(line, model, course, smoother)
    return Estimate(
        line.name,
        States(model.names, model.scale, course.t, course.mean, course.cov),
        States(model.names, model.scale, both.t, both.mean, both.cov),
        course.whitened[:, 0],
    )


def settled(tuning: Tuning, V: float, dt: float = 0.5, epochs: int = 1601) -> Estimate:
    """Filter zeros at the speed V [m/s], every dt [s]: covariances alone mean something."""
    steps, zeros = np.zeros((epochs - 1, 4)), np.zeros(epochs)
    return estimate(Line("settled", dt * np.arange(epochs), zeros, zeros, steps, steps, V), tuning)


def innovation_log_likelihood(line: Line, tuning: Tuning) -> float:
    """Compute the log-likelihood of a line from the innovations, up to a constant.

    -1/2 sum (r_k^2 / S_k + log S_k).
    """
    model = build(line, tuning)
    course = run_filter(line, model)
    S = np.einsum("i,kij,j->k", model.H[0], course.predicted_cov, model.H[0]) + model.R[0, 0]
    return float(-0.5 * np.sum(course.whitened[:, 0] ** 2 + np.log(S)))
