"""Orbits from the data: the extended filter with four kinds of transition matrix, the unscented filter, the batch
with biases.

State: GCRS position and velocity [m, m/s], then, where they are estimated, a range and a range-rate bias of each
station in each pass. Nothing here sees the truth. The estimators step by the kernels of `kalman`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numba import njit
from scipy.linalg import solve_triangular

from geokalman.kalman.gaussian import NotPositiveDefinite
from geokalman.kalman.linear import predict_step, update_step
from geokalman.kalman.unscented import sigma_points_step, spread, transform_step, unscented_update_step
from geokalman.leastsquares import NormalEquations
from geokalman.physics.satellite import (
    Dynamics,
    euler_transition_step,
    propagate_step,
    satellite_force,
    transition_step,
)
from geokalman.physics.timescales import iso_utc
from geokalman.radioastron.data import INFLATED, Observations, Weights
from geokalman.radioastron.model import STATIONS, Array
from geokalman.radioastron.twoway import observe_step, partials_step
from geokalman.radioastron.visibility import check_passes

Transition = Literal["integrated", "substeps", "single"]
STEP = 30.0
"""Longest Runge-Kutta step of the estimators [s]; 10 s gives the same to better than a millimetre."""
SUBSTEP = 10.0
"""Sub-step of the transition matrix I + F T [s]."""
GATE = 5.0
"""Residuals beyond so many sigmas after the first pass are outliers."""
_MODES = {"integrated": 0, "substeps": 1, "single": 2}
_ACCEPTED = 0.01  # change of a batch estimate, in units of its sigma, at which the iteration ends


@dataclass(frozen=True, eq=False)
class Orbit:
    """An estimated state at time t [s]: mean (6,) [m, m/s], cov (6, 6) as the estimator believes; biases with their
    sigmas.
    """

    t: float
    mean: Array
    cov: Array
    biases: Array
    bias_sigmas: Array

    def at(self, world: Dynamics, t: float) -> Orbit:
        """The same orbit at another time [s]."""
        if t == self.t:
            return self
        mean, Phi = world.transition(self.mean, self.t, t)
        return replace(self, t=t, mean=mean, cov=Phi @ self.cov @ Phi.T)


@dataclass(frozen=True, eq=False)
class Filtered:
    """What a filter leaves at each measurement: t (n,), means (n, 6), covariances (n, 6, 6), whitened innovations (n,
    2); the end.
    """

    t: Array
    mean: Array
    cov: Array
    innovations: Array
    orbit: Orbit


def prior_orbit(data: Observations) -> Orbit:
    """The a-priori state as an Orbit: what one has without tracking."""
    return Orbit(float(data.t[0]), data.prior_mean.copy(), data.prior_cov.copy(), np.empty(0), np.empty(0))


def bias_columns(data: Observations, weights: Weights) -> tuple[Array, int]:
    """First bias state of each measurement (n,), -1 without biases, and the number of all states."""
    if not weights.estimate_bias:
        return np.full(len(data.t), -1, dtype=np.int64), 6
    arcs = int(data.arc.max()) + 1
    return 6 + 2 * (data.station * arcs + data.arc).astype(np.int64), 6 + 2 * arcs * len(data.stations)


def _start(data: Observations, weights: Weights) -> tuple[Array, Array, Array]:
    columns, n = bias_columns(data, weights)
    x, P = np.zeros(n), np.zeros((n, n))
    x[:6], P[:6, :6] = data.prior_mean, data.prior_cov
    P[range(6, n, 2), range(6, n, 2)] = weights.bias_range**2
    P[range(7, n, 2), range(7, n, 2)] = weights.bias_rate**2
    return x, P, columns


def _arrays(data: Observations, world: Dynamics):
    if data.day != world.day:
        ours, theirs = (iso_utc(day, 0.0)[:10] for day in (data.day, world.day))
        raise ValueError(f"the data are of {ours}, the forces of {theirs}; both count seconds from 0h of one day")
    world.check_span(float(data.t[0]) - 2.0, float(data.t[-1]) + 2.0)
    check_passes(world, data.t, data.station, data.prior_mean, data.stations)
    z = np.column_stack([data.range, data.rate])
    return (
        np.ascontiguousarray(data.t),
        np.ascontiguousarray(data.station, dtype=np.int64),
        z,
        np.array([STATIONS[s] for s in data.stations]),
    )


def extended(
    data: Observations,
    world: Dynamics,
    weights: Weights = INFLATED,
    transition: Transition = "integrated",
    iterations: int = 1,
    process_noise: float = 0.0,
) -> Filtered:
    """The extended Kalman filter of the paper, (18)-(23), the state integrated and the innovation y - h(x) (errata
    E1, E2).

    transition : "integrated" variational equations, "substeps" I + F T over 10 s (13), "single" I + F T over each
    whole interval;
    iterations : of the update, more than 1 is the iterated filter; process_noise : density of white acceleration [m^2
    s^-3]. Raises ValueError for an unknown transition, NotPositiveDefinite with the epoch.
    """
    if transition not in _MODES:
        raise ValueError(f"transition {transition!r} is unknown; give {', '.join(_MODES)}")
    x, P, columns = _start(data, weights)
    t, station, z, itrs = _arrays(data, world)
    n = len(t)
    mean, cov, innovations = np.empty((n, 6)), np.empty((n, 6, 6)), np.full((n, 2), np.nan)
    failed = _extended(
        t, station, columns, z, weights.sigma_range**2, weights.sigma_rate**2, x, P, itrs, world.params,
        _MODES[transition], iterations, process_noise, STEP, mean, cov, innovations,
    )  # fmt: skip
    return _filtered(data, x, P, mean, cov, innovations, failed)


def unscented(data: Observations, world: Dynamics, weights: Weights = INFLATED, kappa: float = 0.0) -> Filtered:
    """The unscented filter on the same model: sigma points (alpha = 1, beta = 2) through orbit and observation.

    Raises NotPositiveDefinite with the epoch.
    """
    x, P, columns = _start(data, weights)
    t, station, z, itrs = _arrays(data, world)
    n = len(t)
    mean, cov, innovations = np.empty((n, 6)), np.empty((n, 6, 6)), np.full((n, 2), np.nan)
    c, w = spread(len(x), 1.0, 2.0, kappa)
    failed = _unscented(
        t, station, columns, z, weights.sigma_range**2, weights.sigma_rate**2, x, P, itrs, world.params, c, w, STEP,
        mean, cov, innovations,
    )  # fmt: skip
    return _filtered(data, x, P, mean, cov, innovations, failed)


def _filtered(data, x, P, mean, cov, innovations, failed) -> Filtered:
    if failed >= 0:
        raise NotPositiveDefinite("covariance", failed, float(data.t[failed]))
    return Filtered(
        data.t,
        mean,
        cov,
        innovations,
        Orbit(float(data.t[-1]), x[:6].copy(), P[:6, :6].copy(), x[6:], np.sqrt(np.diag(P)[6:])),
    )


def batch(data: Observations, world: Dynamics, weights: Weights = INFLATED, longest: int = 10) -> Orbit:
    """Least squares over all measurements with the a-priori state, iterated: the fixed-interval smoother's state at
    t[0].

    Raises ArithmeticError where `longest` iterations do not settle.
    """
    x0, P0, columns = _start(data, weights)
    t, station, z, itrs = _arrays(data, world)
    root = solve_triangular(np.linalg.cholesky(P0), np.eye(len(x0)), lower=True)  # whitens the a-priori state
    sigma = np.array([weights.sigma_range, weights.sigma_rate])
    x = x0.copy()
    for _ in range(longest):
        residual, design = np.empty((len(t), 2)), np.zeros((len(t), 2, len(x)))
        linearise_step(t, station, columns, z, x, itrs, world.params, STEP, residual, design)
        normals = NormalEquations(len(x))
        normals.add(root, root @ (x0 - x))
        seen = np.isfinite(residual)
        normals.add((design / sigma[:, None])[seen], (residual / sigma)[seen])
        solution = normals.factor()
        step = solution.estimate[:, 0]
        x = x + step
        cov = solution.covariance()
        if np.all(np.abs(step) < _ACCEPTED * np.sqrt(np.diag(cov))):
            return Orbit(float(t[0]), x[:6].copy(), cov[:6, :6].copy(), x[6:], np.sqrt(np.diag(cov)[6:]))
    raise ArithmeticError(
        f"the batch estimate still moves after {longest} iterations; is the a-priori state within its sigma?"
    )


def residuals(data: Observations, world: Dynamics, orbit: Orbit) -> Array:
    """Measured minus computed range [m] and range-rate [m/s] along an estimated orbit, (n, 2), biases not taken off."""
    t, station, z, itrs = _arrays(data, world)
    residual, design = np.empty((len(t), 2)), np.zeros((len(t), 2, 6))
    x = orbit.at(world, float(t[0])).mean
    linearise_step(t, station, np.full(len(t), -1, dtype=np.int64), z, x, itrs, world.params, STEP, residual, design)
    return residual


def without_outliers(
    data: Observations, world: Dynamics, weights: Weights = INFLATED, gate: float = GATE
) -> tuple[Observations, Array]:
    """Take out what lies beyond `gate` sigmas of the fit of a first pass over all data: the data, and a mask (n, 2)
    of what went.

    Not before: an a-priori error of 2 km makes innovations of a hundred sigmas in good data. Each residual, its
    median taken off, is held against the smaller of its weight and the spread (1.4826 times the median absolute
    residual) of its kind, but not against less than a thousandth of its weight: weights are often larger than the
    noise, to make room for a bias.
    """
    residual = residuals(data, world, batch(data, world, weights))
    centred = residual - np.nanmedian(residual, axis=0)
    spread = np.maximum(1.4826 * np.nanmedian(np.abs(centred), axis=0), 1e-12)
    out = np.abs(centred) > gate * np.minimum(
        np.maximum(spread, 1e-3 * np.array([weights.sigma_range, weights.sigma_rate])),
        [weights.sigma_range, weights.sigma_rate],
    )
    kept = [np.where(out[:, k], np.nan, column) for k, column in enumerate((data.range, data.rate))]
    return replace(data, range=kept[0], rate=kept[1]), out


def literal_step(state: Array, gradient: Array, step: float) -> Array:
    """Equations (13) and (19) as printed: X(k+1) = (I + F T) X(k), which doubles gravity and turns it round (erratum
    E1).
    """
    return np.concatenate([state[:3] + step * state[3:], state[3:] + step * (gradient @ state[:3])])


@njit(cache=True)
def _transition(mode, t0, t1, longest, x, params, Phi):
    """Take x[:6] to t1 and put the transition matrix of all states in Phi; biases stay."""
    Phi6, y = np.eye(6), x[:6].copy()
    if mode == 0:
        transition_step(t0, t1, longest, y, params, Phi6)
    else:
        euler_transition_step(t0, t1, SUBSTEP if mode == 1 else 1e9, y, params, Phi6)
    Phi[:] = 0.0
    for i in range(len(x)):
        Phi[i, i] = 1.0
    Phi[:6, :6] = Phi6
    x[:6] = y


@njit(cache=True)
def _white_acceleration(q, T, Q):
    for i in range(3):
        Q[i, i] = q * T * T * T / 3.0
        Q[i, 3 + i] = Q[3 + i, i] = 0.5 * q * T * T
        Q[3 + i, 3 + i] = q * T


@njit(cache=True)
def _predicted(t, x, column, itrs, params, H, z):
    """Observation z (2,) and its partial derivatives H (2, n) at the state x (n,)."""
    a, H6, y = np.empty(3), np.empty((2, 6)), x[:6].copy()
    satellite_force(t, y, params, a)
    observe_step(t, y, a, itrs, params, True, z)
    partials_step(t, y, a, itrs, params, H6)
    H[:] = 0.0
    H[:, :6] = H6
    if column >= 0:
        for i in range(2):
            H[i, column + i] = 1.0
            z[i] += x[column + i]


@njit(cache=True)
def _extended(
    t, station, columns, z, r_range, r_rate, x, P, itrs, params, mode, iterations, q, longest, mean, cov, innovations
):
    """All measurements forward, x and P in place; returns -1, or the epoch at which a covariance is not positive
    definite.
    """
    n = len(x)
    Phi, Q, x_out, P_out = np.empty((n, n)), np.zeros((n, n)), np.empty(n), np.empty((n, n))
    H, h = np.empty((2, n)), np.empty(2)
    for k in range(len(t)):
        if k > 0 and t[k] > t[k - 1]:
            before = x.copy()
            _transition(mode, t[k - 1], t[k], longest, x, params, Phi)
            if q > 0.0:
                _white_acceleration(q, t[k] - t[k - 1], Q)
            predict_step(before, P, Phi, Q, x_out, P_out)
            P[:] = P_out
        seen = np.flatnonzero(~np.isnan(z[k]))
        m = len(seen)
        if m > 0:
            prior, P_prior = x.copy(), P.copy()
            R, S, white = np.zeros((m, m)), np.empty((m, m)), np.empty(m)
            H_seen, residual = np.empty((m, n)), np.empty(m)
            for i in range(m):
                R[i, i] = r_range if seen[i] == 0 else r_rate
            for i in range(iterations):
                _predicted(t[k], x, columns[k], itrs[station[k]], params, H, h)
                for j in range(m):
                    H_seen[j] = H[seen[j]]
                    residual[j] = z[k, seen[j]] - h[seen[j]]
                    for d in range(n):
                        residual[j] -= H_seen[j, d] * (prior[d] - x[d])
                x[:] = prior
                P[:] = P_prior
                if update_step(x, P, residual, H_seen, R, S, white) != 0:
                    return k
                if i == 0:
                    for j in range(m):
                        innovations[k, seen[j]] = white[j]
        mean[k] = x[:6]
        cov[k] = P[:6, :6]
    return -1


@njit(cache=True)
def _unscented(t, station, columns, z, r_range, r_rate, x, P, itrs, params, c, w, longest, mean, cov, innovations):
    """As `_extended` with sigma points."""
    n = len(x)
    points = 2 * n + 1
    chi, U = np.empty((points, n)), np.empty((n, n))
    D, rest, none = np.empty((n, n)), np.empty((n, n)), np.zeros((n, n))
    a, h, y = np.empty(3), np.empty(2), np.empty(6)
    for k in range(len(t)):
        if k > 0 and t[k] > t[k - 1]:
            if sigma_points_step(x, P, c, chi, U) != 0:
                return k
            for i in range(points):
                y[:] = chi[i, :6]
                propagate_step(t[k - 1], t[k], longest, y, params)
                chi[i, :6] = y
            transform_step(chi, none, c, w, x, D, rest, P)
        seen = np.flatnonzero(~np.isnan(z[k]))
        m = len(seen)
        if m > 0:
            if sigma_points_step(x, P, c, chi, U) != 0:
                return k
            gamma, R, S, white, z_seen = (
                np.empty((points, m)),
                np.zeros((m, m)),
                np.empty((m, m)),
                np.empty(m),
                np.empty(m),
            )
            for i in range(m):
                R[i, i] = r_range if seen[i] == 0 else r_rate
                z_seen[i] = z[k, seen[i]]
            for i in range(points):
                y[:] = chi[i, :6]
                satellite_force(t[k], y, params, a)
                observe_step(t[k], y, a, itrs[station[k]], params, True, h)
                for j in range(m):
                    gamma[i, j] = h[seen[j]]
                    if columns[k] >= 0:
                        gamma[i, j] += chi[i, columns[k] + seen[j]]
            if unscented_update_step(x, P, U, gamma, z_seen, R, c, w, S, white) != 0:
                return k
            for j in range(m):
                innovations[k, seen[j]] = white[j]
        mean[k] = x[:6]
        cov[k] = P[:6, :6]
    return -1


@njit(cache=True)
def linearise_step(t, station, columns, z, x, itrs, params, longest, residual, design):
    """Residuals (n, 2) and design (n, 2, states) of all measurements with respect to the states x at t[0]."""
    n = len(x)
    y, Phi = x.copy(), np.eye(n)
    Phi6 = np.eye(6)
    H, h, state = np.empty((2, n)), np.empty(2), x[:6].copy()
    for k in range(len(t)):
        if k > 0 and t[k] > t[k - 1]:
            transition_step(t[k - 1], t[k], longest, state, params, Phi6)
            y[:6] = state
            Phi[:6, :6] = Phi6
        _predicted(t[k], y, columns[k], itrs[station[k]], params, H, h)
        for i in range(2):
            residual[k, i] = z[k, i] - h[i]
            for d in range(n):
                total = 0.0
                for e in range(n):
                    total += H[i, e] * Phi[e, d]
                design[k, i, d] = total
