"""Where truth and estimate meet: residual delay, rate and acceleration of the space baseline, and their statistics."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from geokalman.constants import C_LIGHT
from geokalman.kalman.consistency import nees
from geokalman.physics.satellite import Dynamics
from geokalman.radioastron.estimate import StateEstimate
from geokalman.radioastron.model import BANDS, Array
from geokalman.radioastron.simulate import Truth


class Residual(NamedTuple):
    """Delay [s], its rate [s/s] and acceleration [1/s] that an orbit error makes along the source, (...) each."""

    delay: Array
    rate: Array
    acceleration: Array


class Errors(NamedTuple):
    """Errors of one orbit at times (k,): residual (k,) each, error (k, 6) [m, m/s], nees (k,)."""

    residual: Residual
    error: Array
    nees: Array


class Runs(NamedTuple):
    """Results of an estimator over runs: at mid-observation delay, rate, acceleration (runs,), error (runs, 6), nees
    (runs,); at the scans scan_delay, scan_rate (runs, scans); nees_end (runs,) at the last measurement."""

    delay: Array
    rate: Array
    acceleration: Array
    error: Array
    nees: Array
    scan_delay: Array
    scan_rate: Array
    nees_end: Array


def residual(error: Array, gradient: Array, source: Array) -> Residual:
    """Residual of orbit errors (..., 6) [m, m/s], geocentric: the station's side has no error here.

    delay = dr.s/c, rate = dv.s/c, acceleration = (G dr).s/c; gradient G (..., 3, 3) of the acceleration [s^-2]; source
    s (3,), the unit vector to the source.
    """
    dr, dv = error[..., :3], error[..., 3:]
    da = np.einsum("...ij,...j->...i", gradient, dr)
    return Residual(dr @ source / C_LIGHT, dv @ source / C_LIGHT, da @ source / C_LIGHT)


def errors(orbit: StateEstimate, truth: Truth, world: Dynamics, times: Array, source: Array) -> Errors:
    """Estimate minus truth at sorted times (k,) [s] after the estimate; source (3,) the unit vector to the source.

    world: the forces as the estimator knows them, along which its orbit is extrapolated.
    """
    orbits = []
    for t in times:
        orbit = orbit.at(world, float(t))
        orbits.append(orbit)
    error = np.array([o.mean for o in orbits]) - truth.states(times)
    gradients = np.array([world.gradient(o.t, o.mean) for o in orbits])
    return Errors(residual(error, gradients, source), error, nees(error, np.array([o.cov for o in orbits])))


def rms(values: Array) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def standard_error(values: Array) -> float:
    """Standard error of the rms of (runs,) values, from their fourth moment: heavy tails count."""
    square = np.square(values)
    return float(np.std(square) / np.sqrt(len(square)) / (2.0 * np.sqrt(square.mean())))


def quantiles(values: Array) -> tuple[float, float, float]:
    """Median, and the 16 and 84 % points, between which two thirds of the runs lie."""
    low, middle, high = np.quantile(values, [0.16, 0.5, 0.84])
    return float(middle), float(low), float(high)


class Gain(NamedTuple):
    """One orbit against another over many runs: share that got better, median gain, share that gains the printed 10."""

    better: float
    median: float
    tenfold: float


def gain(before: Array, after: Array) -> Gain:
    """Gain |before| / |after| of errors (runs,)."""
    ratio = np.abs(before) / np.abs(after)
    return Gain(float(np.mean(ratio > 1.0)), float(np.median(ratio)), float(np.mean(ratio >= 10.0)))


def summary(prior: Runs, post: Runs, band: str) -> dict[str, tuple[float, str]]:
    """Numbers of an estimator against the a-priori orbit: name -> (value, unit).

    delay_us, rate: rms, its standard error and median of the size; fringe_hz: rms; gain and shares of both.
    """
    numbers = {
        "fringe_hz.rms": (BANDS[band] * rms(post.rate), "Hz"),
        "acceleration.rms": (rms(post.acceleration), "1/s"),
    }
    for kind, name, factor, unit in (("delay", "delay_us", 1e6, "µs"), ("rate", "rate", 1.0, "s/s")):
        before, after = getattr(prior, kind), getattr(post, kind)
        gained = gain(before, after)
        numbers |= {
            f"{name}.rms": (factor * rms(after), unit),
            f"{name}.rms_error": (factor * standard_error(after), unit),
            f"{name}.median": (factor * float(np.median(np.abs(after))), unit),
            f"gain.{kind}.median": (gained.median, ""),
            f"share.{kind}.better": (gained.better, ""),
            f"share.{kind}.tenfold": (gained.tenfold, ""),
        }
    return numbers


def scan_columns(runs: Mapping[str, Runs]) -> dict[str, Array]:
    """Columns by orbit for a figure of the scans: median, 16 and 84 % points of |delay| [s] and |rate| [s/s]."""
    columns: dict[str, Array] = {}
    for name, r in runs.items():
        for kind, values in (("delay_s", r.scan_delay), ("rate", r.scan_rate)):
            points = np.quantile(np.abs(values), [0.5, 0.16, 0.84], axis=0)
            names = (f"{name}_{kind}_{point}" for point in ("median", "16_percent", "84_percent"))
            columns |= dict(zip(names, points, strict=True))
    return {"scan": np.arange(1.0, len(next(iter(columns.values()))) + 1.0)} | columns


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
    """Share of draws (n, k) of an error of mean zero that lie as far out as a value (k,), in Mahalanobis distance."""
    root = np.linalg.cholesky(draws.T @ draws / len(draws))
    distances = np.sum(np.linalg.solve(root, draws.T) ** 2, axis=0)
    return float(np.mean(distances >= np.sum(np.linalg.solve(root, value) ** 2)))


def delay_of(difference: Array, ra: float, dec: float) -> Array:
    """Delay [s] of a difference (..., 3) [m] towards ra, dec [rad], as the paper's equation at Figure 5.

    dtau = (dX cos(dec) cos(ra) + dY cos(dec) sin(ra) + dZ sin(dec))/c
    """
    x, y, z = np.moveaxis(np.asarray(difference, dtype=float), -1, 0)
    return (x * np.cos(dec) * np.cos(ra) + y * np.cos(dec) * np.sin(ra) + z * np.sin(dec)) / C_LIGHT
