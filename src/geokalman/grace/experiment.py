"""Drivers of the comparisons: the methods in other settings, the filters' consistency, weights tuned for gravity."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from geokalman.grace import assess, estimate, simulate
from geokalman.grace.assess import Statistics
from geokalman.grace.model import Array, Observations, Scenario, Tuning
from geokalman.grace.simulate import Truth
from geokalman.kalman.consistency import nees
from geokalman.physics.field import GravityField

THINNED = 10  # every so many epochs the error of a state is held against its covariance


def table(orbit: Truth, data: Observations, tuning: Tuning, edge: int = 100) -> dict[str, Statistics]:
    """Table 1: statistics of the range-rate residual of the three methods [m/s]."""
    rates = {
        "newton": estimate.newton(data).rate,
        "ekf": estimate.ekf(data, tuning).smoothed.rate,
        "ukf": estimate.ukf(data, tuning).smoothed.rate,
    }
    return {name: assess.statistics(assess.range_rate_residual(rate, orbit), edge) for name, rate in rates.items()}


def setting(
    scenario: Scenario,
    gravity: GravityField,
    tuning: Tuning,
    sigma_pos: float = 0.0,
    seed: int = 0,
    edge: int = 100,
) -> dict[str, Statistics]:
    """Table 1 on another orbit, in another field, or with white noise of sigma_pos [m] per axis and satellite."""
    orbit = simulate.orbit_pair(scenario, gravity)
    data = simulate.observe(orbit, gravity, np.random.default_rng(seed), sigma_pos)
    return table(orbit, data, tuning, edge)


class Consistency(NamedTuple):
    """Means over the epochs, each divided by its degrees of freedom, so that a consistent filter has 1.

    nis : squared whitened innovations;  nees : squared whitened errors of the filtered states;  smoothed : of the
    smoothed ones.
    """

    nis: float
    nees: float
    smoothed: float


def consistency(
    orbit: Truth, gravity: GravityField, data: Observations, tuning: Tuning, edge: int = 100
) -> dict[str, Consistency]:
    """Whether the covariances of the "EKF" and of the UKF describe their errors."""
    a_A, a_B = simulate.accelerations(orbit, gravity)
    x = np.column_stack([orbit.dr, orbit.dv, a_A - a_B])
    out = {}
    for name, method in (("ekf", estimate.ekf), ("ukf", estimate.ukf)):
        got = method(data, tuning, covariances=True)
        innovations = assess.inner(got.innovations, edge)
        errors = []
        for states in (got.filtered, got.smoothed):
            e, P = (assess.inner(series, edge)[::THINNED] for series in (states.x - x, states.P))
            errors.append(float(nees(e, P).mean() / estimate.N))
        out[name] = Consistency(float(np.nanmean(innovations**2)), *errors)
    return out


class Weighted(NamedTuple):
    """The weights with the smallest line-of-sight acceleration error, and that error [m/s^2]."""

    lambda_q: float
    mu: float
    los_std: float


def tuned(
    data: Observations, exact: Array, lambdas: Iterable[float], mus: Iterable[float], edge: int = 100
) -> dict[str, Weighted]:
    """Tune the smoothers of positions alone and of positions with range-rates for accelerations, on a grid of weights.

    exact : (n,) line-of-sight gravity difference of the field [m/s^2], which no receiver knows: a bound, not a method.
    """
    grids = {"ekf": (estimate.ekf, (Tuning.mu,)), "ukf": (estimate.ukf, tuple(mus))}
    weights, out = tuple(lambdas), {}
    for name, (method, column) in grids.items():
        tried = []
        for lambda_q in weights:
            for mu in column:
                los = method(data, Tuning(lambda_q=lambda_q, mu=mu)).smoothed.los
                tried.append(Weighted(lambda_q, mu, assess.statistics(los - exact, edge).std))
        out[name] = min(tried, key=lambda t: t.los_std)
    return out
