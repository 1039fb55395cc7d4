"""Orbits from the data: extended and unscented filters by the core's `run`, the batch with biases, the gate.

State: GCRS position and velocity [m, m/s], then, where they are estimated, a range and a range-rate bias of each
station in each pass. Nothing here sees the truth.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from geokalman.kalman.gaussian import Gaussian
from geokalman.kalman.model import OBSERVE, PROPAGATE, Model, Sensor
from geokalman.kalman.run import Kind, run
from geokalman.leastsquares import NormalEquations
from geokalman.physics.satellite import (
    Dynamics,
    euler_transition_step,
    propagate_step,
    satellite_force,
    transition_step,
)  # fmt: skip
from geokalman.physics.timescales import iso_utc
from geokalman.radioastron.data import INFLATED, LONGEST_GAP, Observations, Tuning
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
_TRANSITIONS = {"integrated": (0.0, STEP), "substeps": (1.0, SUBSTEP), "single": (1.0, LONGEST_GAP)}
_ACCEPTED = 0.01  # change of a batch estimate, in units of its sigma, at which the iteration ends


@dataclass(frozen=True, eq=False)
class StateEstimate:
    """An estimated state at t [s]: mean (6,) [m, m/s], its cov (6, 6); biases and sigmas."""

    t: float
    mean: Array
    cov: Array
    biases: Array
    bias_sigmas: Array

    def at(self, world: Dynamics, t: float) -> StateEstimate:
        """Move the orbit to another time [s]."""
        if t == self.t:
            return self
        mean, Phi = world.transition(self.mean, self.t, t)
        return replace(self, t=t, mean=mean, cov=Phi @ self.cov @ Phi.T)


@dataclass(frozen=True, eq=False)
class Estimate:
    """The course of a filter, and its orbit at the end.

    t : (n,) [s]; mean : (n, 6) [m, m/s]; cov : (n, 6, 6); innovations : (n, 2), whitened.
    """

    t: Array
    mean: Array
    cov: Array
    innovations: Array
    orbit: StateEstimate


def prior_orbit(data: Observations) -> StateEstimate:
    """Give the a-priori state: what one has without tracking."""
    return _orbit(data.t[0], data.prior_mean.copy(), data.prior_cov.copy())


def _orbit(t: float, x: Array, P: Array) -> StateEstimate:
    """The StateEstimate of a state with its biases."""
    return StateEstimate(float(t), x[:6], P[:6, :6], x[6:], np.sqrt(np.diag(P)[6:]))


def links(stations: tuple[str, ...], station: NDArray[np.int64], column: Array | float = -1.0) -> Array:
    """Make the inputs of the observation (n, 4).

    Earth-fixed station [m], and the first state of its biases, -1 for none.
    """
    itrs = np.array([STATIONS[name] for name in stations])[station]
    return np.column_stack([itrs, np.broadcast_to(column, len(itrs))])


def _start(data: Observations, world: Dynamics, weights: Tuning) -> tuple[Gaussian, Array, Array]:
    """A-priori state with its biases, observations (n, 2) and inputs (n, 4), checked."""
    if data.day != world.day:
        ours, theirs = (iso_utc(day, 0.0)[:10] for day in (data.day, world.day))
        raise ValueError(f"the data are of {ours}, the forces of {theirs}; both count seconds from 0h of one day.")
    world.check_span(float(data.t[0]) - 2.0, float(data.t[-1]) + 2.0)
    check_passes(world, data.t, data.station, data.prior_mean, data.stations)
    column, pairs = -1.0, 0
    if weights.estimate_bias:
        arcs = int(data.arc.max()) + 1
        column, pairs = 6.0 + 2.0 * (data.station * arcs + data.arc), arcs * len(data.stations)
    variances = np.tile([weights.bias_range**2, weights.bias_rate**2], pairs)
    P = np.diag(np.concatenate([np.zeros(6), variances]))
    P[:6, :6] = data.prior_cov
    prior = Gaussian(np.concatenate([data.prior_mean, np.zeros(2 * pairs)]), P)
    return prior, np.column_stack([data.range, data.rate]), links(data.stations, data.station, column)


def extended(
    data: Observations,
    world: Dynamics,
    weights: Tuning = INFLATED,
    transition: Transition = "integrated",
    iterations: int = 1,
    process_noise: float = 0.0,
) -> Estimate:
    """Filter by the extended filter of the paper, (18)-(23).

    The state is integrated, the innovation is y - h(x); errata E1, E2.
    transition : "integrated" variational equations, "substeps" I + F T over 10 s (13), "single" I + F T over each
    whole interval; iterations : of the update, more than 1 is the iterated filter; process_noise : density of white
    acceleration [m^2 s^-3].
    Raises ValueError for an unknown transition, NotPositiveDefinite with the epoch.

    >>> from geokalman.radioastron import assess, simulate
    >>> from geokalman.radioastron.data import Scenario
    >>> from geokalman.radioastron.model import find_session, find_stations, toward, world
    >>> session = find_session("OE")
    >>> forces, stations = world(session), find_stations((), session)
    >>> truth, data = simulate.draw(session, forces, Scenario(), stations, np.random.default_rng(1))
    >>> orbits, middle = (prior_orbit(data), extended(data, forces).orbit), np.array([session.middle])
    >>> errors = [assess.errors(orbit, truth, forces, middle, toward(session)) for orbit in orbits]
    >>> before, after = (abs(error.residual.delay.item()) for error in errors)
    >>> after < 0.2 * before < 1e-5  # delay of the baseline at mid-observation [s]
    True
    """
    if transition not in _TRANSITIONS:
        raise ValueError(f"transition {transition!r} is unknown; give {', '.join(_TRANSITIONS)}.")
    motion = *_TRANSITIONS[transition], process_noise
    return _filtered(data, world, weights, motion, "extended", iterations=iterations)


def unscented(data: Observations, world: Dynamics, weights: Tuning = INFLATED, kappa: float = 0.0) -> Estimate:
    """Filter the same model by the unscented filter, with alpha = 1 and beta = 2.

    Raises NotPositiveDefinite with the epoch.
    """
    return _filtered(data, world, weights, (*_TRANSITIONS["integrated"], 0.0), "unscented", kappa=kappa)


def _filtered(data, world, weights, motion: tuple[float, float, float], kind: Kind, **options) -> Estimate:
    prior, z, inputs = _start(data, world, weights)
    model = Model(f=_propagate, params=np.concatenate([world.params, motion]))
    R = np.diag([weights.sigma_range**2, weights.sigma_rate**2])
    course = run(prior, data.t, model, [Sensor(z, R, h=_observe, inputs=inputs, params=world.params)], kind, **options)
    end = _orbit(data.t[-1], course.mean[-1], course.cov[-1])
    return Estimate(data.t, course.mean[:, :6], course.cov[:, :6, :6], course.whitened, end)


def batch(data: Observations, world: Dynamics, weights: Tuning = INFLATED, longest: int = 10) -> StateEstimate:
    """Estimate the state at t[0] by iterated least squares over all measurements.

    The a-priori state counts too: this is the smoother's state there. Raises ArithmeticError where `longest`
    iterations do not settle.
    """
    prior, z, inputs = _start(data, world, weights)
    n = len(prior.mean)
    root = solve_triangular(np.linalg.cholesky(prior.cov), np.eye(n), lower=True)  # whitens the a-priori state
    sigma = np.array([weights.sigma_range, weights.sigma_rate])
    x = prior.mean
    for _ in range(longest):
        predicted, design = linearise_step(data.t, x, inputs, world.params)
        residual = (z - predicted) / sigma
        normals = NormalEquations(n)
        normals.add(root, root @ (prior.mean - x))
        seen = np.isfinite(residual)
        normals.add((design / sigma[:, None])[seen], residual[seen])
        solution = normals.factor()
        step, cov = solution.estimate[:, 0], solution.covariance()
        x = x + step
        if np.all(np.abs(step) < _ACCEPTED * np.sqrt(np.diag(cov))):
            return _orbit(data.t[0], x, cov)
    raise ArithmeticError(
        f"the batch estimate still moves after {longest} iterations; is the a-priori state within its sigma?"
    )


def residuals(data: Observations, world: Dynamics, orbit: StateEstimate) -> Array:
    """Compute measured minus computed range [m] and range-rate [m/s] along an orbit (n, 2).

    Biases are not taken off.
    """
    _, z, inputs = _start(data, world, Tuning())
    return z - linearise_step(data.t, orbit.at(world, float(data.t[0])).mean, inputs, world.params)[0]


def without_outliers(
    data: Observations, world: Dynamics, weights: Tuning = INFLATED, gate: float = GATE
) -> tuple[Observations, Array]:
    """Take out what lies beyond `gate` sigmas of a first fit to all data.

    Returns the data, and a mask (n, 2) of what went.
    Not before: an a-priori error of 2 km makes innovations of a hundred sigmas in good data. Each residual, its
    median taken off, is held against the smaller of its weight and the spread (1.4826 times the median absolute
    residual) of its kind, but not against less than a thousandth of its weight: weights are often larger than the
    noise, to make room for a bias.
    """
    residual = residuals(data, world, batch(data, world, weights))
    centred = residual - np.nanmedian(residual, axis=0)
    spread = np.maximum(1.4826 * np.nanmedian(np.abs(centred), axis=0), 1e-12)
    sigma = np.array([weights.sigma_range, weights.sigma_rate])
    out = np.abs(centred) > gate * np.minimum(np.maximum(spread, 1e-3 * sigma), sigma)
    kept = [np.where(out[:, k], np.nan, column) for k, column in enumerate((data.range, data.rate))]
    return replace(data, range=kept[0], rate=kept[1]), out


def literal_step(state: Array, gradient: Array, step: float) -> Array:
    """Step by (13) and (19) as printed, X(k+1) = (I + F T) X(k).

    They double gravity and turn it round (E1).
    """
    return np.concatenate([state[:3] + step * state[3:], state[3:] + step * (gradient @ state[:3])])


@njit(PROPAGATE, cache=True)
def _propagate(t0, t1, x, u, p, x_out, F, Q):
    """State at t1; biases stay. p : params of `Dynamics`, then 0 for the variational equations or 1 for I + F T,
    the longest step [s], and the density q of white acceleration [m^2 s^-3]."""
    params, euler, longest, q, T = p[:-3], p[-3], p[-2], p[-1], t1 - t0
    x_out[:] = x
    if F.size == 0:
        propagate_step(t0, t1, longest, x_out[:6], params)
    else:
        Phi = np.eye(6)
        if euler == 0.0:
            transition_step(t0, t1, longest, x_out[:6], params, Phi)
        else:
            euler_transition_step(t0, t1, longest, x_out[:6], params, Phi)
        F[:] = np.eye(x.size)
        F[:6, :6] = Phi
    if q > 0.0 and Q.size > 0:
        for i in range(3):
            Q[i, i] = q * T * T * T / 3.0
            Q[i, 3 + i] = Q[3 + i, i] = 0.5 * q * T * T
            Q[3 + i, 3 + i] = q * T
    return 0


@njit(OBSERVE, cache=True)
def _observe(t, x, u, p, h, H, R):
    """Two-way range and range-rate, and the biases of a link. u : a row of `links`; p : params of `Dynamics`."""
    a, H6, column = np.empty(3), np.empty((2, 6)), int(u[3])
    satellite_force(t, x[:6], p, a)
    observe_step(t, x[:6], a, u[:3], p, True, h)
    if H.size > 0:
        partials_step(t, x[:6], a, u[:3], p, H6)
        H[:] = 0.0
        H[:, :6] = H6
    if column >= 0:
        for i in range(2):
            h[i] += x[column + i]
            if H.size > 0:
                H[i, column + i] = 1.0
    return 0


@njit(cache=True)
def linearise_step(t, x, inputs, params):
    """Predict observations (n, 2) along the orbit of the states x at t[0].

    Returns them and their derivatives by x (n, 2, states).
    t : (n,) [s]; inputs : (n, 4) of `links`; params of `Dynamics`.
    """
    n = x.size
    predicted, design = np.empty((t.size, 2)), np.zeros((t.size, 2, n))
    y, Phi, Phi6, H, no_noise = x.copy(), np.eye(n), np.eye(6), np.empty((2, n)), np.empty((0, 0))
    for k in range(t.size):
        if k > 0 and t[k] > t[k - 1]:
            transition_step(t[k - 1], t[k], STEP, y[:6], params, Phi6)
            Phi[:6, :6] = Phi6
        _observe(t[k], y, inputs[k], params, predicted[k], H, no_noise)
        for i in range(2):
            for d in range(n):
                for e in range(n):
                    design[k, i, d] += H[i, e] * Phi[e, d]
    return predicted, design
