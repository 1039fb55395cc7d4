"""Where truth and estimate meet: residual delay, delay rate and acceleration of the space baseline, and their
statistics.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from geokalman.constants import C_LIGHT
from geokalman.kalman.consistency import nees
from geokalman.physics.satellite import Dynamics
from geokalman.radioastron.estimate import Orbit
from geokalman.radioastron.model import Array
from geokalman.radioastron.simulate import Truth

TEN_TIMES = 10.0
"""The paper's gain in fringe rate."""


class Residual(NamedTuple):
    """What an orbit error does to the space baseline, (...): delay [s], its rate [s/s] and acceleration [1/s] along
    the source.

    delay = dr.s/c, rate = dv.s/c, acceleration = da.s/c, geocentric (the station's side has no error here).
    """

    delay: Array
    rate: Array
    acceleration: Array


class Errors(NamedTuple):
    """Errors of one orbit at times (k,): residual (k,) each, error (k, 6) [m, m/s], nees (k,)."""

    residual: Residual
    error: Array
    nees: Array


def errors(orbit: Orbit, truth: Truth, world: Dynamics, times: Array, source: Array) -> Errors:
    """Estimate minus truth at sorted times (k,) [s] after the estimate; source (3,) the unit vector to the source.

    world: the forces as the estimator knows them, along which its orbit is extrapolated.
    """
    true = truth.states(times)
    found, spread, gradients = [], [], []
    for t in times:
        orbit = orbit.at(world, float(t))
        found.append(orbit.mean)
        spread.append(orbit.cov)
        gradients.append(world.gradient(float(t), orbit.mean[:3]))
    error = np.array(found) - true
    da = np.einsum("kij,kj->ki", np.array(gradients), error[:, :3])
    residual = Residual(error[:, :3] @ source / C_LIGHT, error[:, 3:] @ source / C_LIGHT, da @ source / C_LIGHT)
    return Errors(residual, error, nees(error, np.array(spread)))


def rms(values: Array) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def quantiles(values: Array) -> tuple[float, float, float]:
    """Median, and the 16 and 84 % points, between which two thirds of the runs lie."""
    low, middle, high = np.quantile(values, [0.16, 0.5, 0.84])
    return float(middle), float(low), float(high)


class Gain(NamedTuple):
    """How one orbit does against another over many runs: share of runs that got better, median gain, share of runs
    that gain 10.
    """

    better: float
    median: float
    tenfold: float


def gain(before: Array, after: Array) -> Gain:
    """Gain |before| / |after| of errors (runs,)."""
    ratio = np.abs(before) / np.abs(after)
    return Gain(float(np.mean(ratio > 1.0)), float(np.median(ratio)), float(np.mean(ratio >= TEN_TIMES)))


def standard_error(values: Array) -> float:
    """Standard error of the rms of (runs,) values, from their fourth moment: heavy tails count."""
    square = np.square(values)
    return float(np.std(square) / np.sqrt(len(square)) / (2.0 * np.sqrt(square.mean())))


class Correction(NamedTuple):
    """A correction of the orbit (runs,) [m]: its size, its part along the source, and its part across."""

    total: Array
    along: Array
    across: Array


def correction(prior: Array, post: Array, source: Array) -> Correction:
    """Post minus prior error of position (runs, 3) [m], split along the unit vector to the source."""
    d = post - prior
    along = d @ source
    return Correction(np.linalg.norm(d, axis=-1), np.abs(along), np.linalg.norm(d - along[..., None] * source, axis=-1))


def rarity(draws: Array, value: Array) -> float:
    """Share of draws (n, k) of an error of mean zero that lie as far out as a value (k,), by their Mahalanobis
    distance.
    """
    root = np.linalg.cholesky(draws.T @ draws / len(draws))
    distances = np.sum(np.linalg.solve(root, draws.T) ** 2, axis=0)
    return float(np.mean(distances >= np.sum(np.linalg.solve(root, value) ** 2)))


def delay_of(difference: Array, ra: float, dec: float) -> Array:
    """The paper's equation (Fig. 5): dtau = (dX cos(dec) cos(ra) + dY cos(dec) sin(ra) + dZ sin(dec))/c [s]; (..., 3)
    [m], rad.
    """
    x, y, z = np.moveaxis(np.asarray(difference, dtype=float), -1, 0)
    return (x * np.cos(dec) * np.cos(ra) + y * np.cos(dec) * np.sin(ra) + z * np.sin(dec)) / C_LIGHT
