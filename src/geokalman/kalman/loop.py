"""The one filter loop: all epochs and sensors forward, whatever model and kind of filter.

`run` checks what a user gives and hands plain arrays to `loop`. Where the functions of model and sensors are compiled,
so is the loop (`compiled`); where they are Python functions, the same lines run as Python.
"""

from __future__ import annotations

import functools
import warnings
from typing import NamedTuple

import numpy as np
from numba import njit, types
from numba.core.errors import NumbaExperimentalFeatureWarning
from numba.extending import register_jitable

from geokalman.kalman.adaptive import JUDGE
from geokalman.kalman.dense import add_vector_product, copy, copy_state, copy_vector, identity, solve_upper, transposed
from geokalman.kalman.linear import joint_update_step, observed_update_step, predict_step, rows_seen, update_step
from geokalman.kalman.model import DIFFERENCE, OBSERVE, PROPAGATE, RETRACT, vector
from geokalman.kalman.unscented import seen_update_step, sigma_points_step, transform_step

LINEAR, EXTENDED, UNSCENTED = range(3)
PREDICTION, INNOVATION, NOISE, DRAW, MODEL, SENSOR = range(1, 7)
"""What failed: a root of the filtered covariance, of the innovation covariance, of the sensor's noise, of the prior
covariance; or the model's or the sensor's own function stopped."""
FUNCTIONS = 4
"""The compiled loop takes so many different functions of sensors; with more the loop runs as Python."""


class ModelArrays(NamedTuple):
    """A model as arrays.

    kind : how it is predicted; Phi, Q : (K, n, n), read through step (N - 1,) by a linear one, else written;
    inputs : (N - 1, i); params : (p,).
    """

    kind: int
    inputs: np.ndarray
    params: np.ndarray
    Phi: np.ndarray
    Q: np.ndarray
    step: np.ndarray


class SensorArrays(NamedTuple):
    """All sensors as arrays: sensor s has the columns first[s] to first[s + 1] of z (N, M).

    function : which of the functions is its own; R : (K, M, M), block diagonal; H : (K, M, n); inputs, params likewise
    side by side; sequential : a linear sensor's components are taken one after the other.
    """

    first: np.ndarray
    kind: np.ndarray
    function: np.ndarray
    sequential: np.ndarray
    z: np.ndarray
    R: np.ndarray
    H: np.ndarray
    inputs: np.ndarray
    inputs_first: np.ndarray
    params: np.ndarray
    params_first: np.ndarray


class Options(NamedTuple):
    """What `run` was asked for.

    c, w : of the sigma points, see `unscented.spread`; plain : no hook, no gate, one linearisation and a flat state;
    adapt, k0, k1, floor, states : see `adaptive.adapt_step`, adapt = 0 for none.
    """

    c: float
    w: float
    plain: bool
    iterations: int
    gate: float
    adapt: int
    k0: float
    k1: float
    floor: float
    states: int


class History(NamedTuple):
    """What the loop fills; row 0 of the predictions holds the prior.

    whitened : (N, M); alpha : (N,), weights : (N, M) of the hook; else as in a `Trajectory`.
    """

    predicted_mean: np.ndarray
    predicted_cov: np.ndarray
    mean: np.ndarray
    cov: np.ndarray
    whitened: np.ndarray
    alpha: np.ndarray
    weights: np.ndarray


@njit(cache=True)
def _nothing_seen(z):
    for a in range(z.size):
        if not np.isnan(z[a]):
            return False
    return True


@njit(cache=True)
def _block(A, first, out):
    for a in range(out.shape[0]):
        for b in range(out.shape[1]):
            out[a, b] = A[first + a, first + b]


@register_jitable
def _innovation(observe, linear, t, x, z, u, p, h, H, R):
    """Write z - h(x) into h, with the H and R of this state. Returns a status."""
    if linear:
        status = 0
        for a in range(h.size):
            h[a] = 0.0
        add_vector_product(h, 1.0, x, transposed(H))
    else:
        status = observe(t, x, u, p, h, H, R)
    for a in range(h.size):
        h[a] = z[a] - h[a]
    return status


@register_jitable
def _adapted(judge, options, x, P, residual, H, R, whitened, weights):
    """Update after a hook judged prediction and observations. Returns (status, factor)."""
    seen, residual, H, R = rows_seen(residual, H, R)
    white, weight = np.empty(seen.size), np.ones(seen.size)
    status, alpha = judge(
        options.adapt, P, residual, H, R, options.k0, options.k1, options.floor, options.states, white, weight
    )
    if status == 0:
        for b in range(seen.size):
            whitened[seen[b]] = white[b]
            weights[seen[b]] = weight[b]
        status = update_step(x, P, residual, H, R, np.empty(R.shape), white)
    return status, alpha


@register_jitable
def _iterated(observe, retract, difference, options, linear, t, z, u, p, h, H, R_all, first, R, x, P, whitened):
    """Update by linearisation, once or more, with a gate. Returns (what failed, status)."""
    prior, P_prior, d, moved, white = x.copy(), P.copy(), np.zeros(P.shape[0]), np.empty(x.size), whitened.copy()
    squares = 0.0
    for i in range(options.iterations):
        _block(R_all, first, R)
        status = _innovation(observe, linear, t, x, z, u, p, h, H, R)
        if status != 0:
            return SENSOR, status
        if i > 0:  # linearised here, the prior is still that from before
            difference(x, prior, d)
            add_vector_product(h, -1.0, d, transposed(H))
            for j in range(d.size):
                d[j] = 0.0
            copy(P_prior, P)
        status = joint_update_step(d, P, h, H, R, white)
        if status != 0:
            return INNOVATION, status
        if i == 0:
            for a in range(white.size):
                whitened[a] = white[a]
                if not np.isnan(white[a]):
                    squares += white[a] * white[a]
            if squares > options.gate:
                copy(P_prior, P)
                return INNOVATION, 0
        retract(prior, d, moved)
        copy_vector(moved, x)
    return INNOVATION, 0


def loop(propagate, observe, retract, difference, judge, t, motion, sensing, options, course):
    """Filter all epochs.

    Returns (epoch, what, row): what failed, a code from above, in which row; or (-1, 0, 0).
    """
    N, M = sensing.z.shape
    n = course.cov.shape[1]
    points, nothing = 2 * n + 1, np.empty((0, 0))
    h_all, H_all, R_all, gamma_all = np.empty(M), np.empty(M * n), np.empty(M * M), np.empty(points * M)
    chi, U, image = np.empty((points, n)), np.empty((n, n)), np.empty((points, n))
    D, rest, zero, spare, R_spare = np.empty((n, n)), np.empty((n, n)), np.zeros(n), np.empty(n), np.empty(M * M)
    unit, none = identity(n), np.zeros((n, n))
    for k in range(N):
        x, P = course.mean[k], course.cov[k]
        if k > 0:
            x_before, P_before = course.mean[k - 1], course.cov[k - 1]
            x_next, P_next = course.predicted_mean[k], course.predicted_cov[k]
            u = motion.inputs[k - 1]
            if motion.kind == LINEAR:
                s = motion.step[k - 1]
                predict_step(x_before, P_before, motion.Phi[s], motion.Q[s], x_next, P_next)
            elif t[k] == t[k - 1]:  # another observation of the same epoch
                copy_state(x_before, P_before, x_next, P_next)
                copy(unit, motion.Phi[k - 1])
                copy(none, motion.Q[k - 1])
            elif motion.kind == EXTENDED:
                Phi, Q = motion.Phi[k - 1], motion.Q[k - 1]
                status = propagate(t[k - 1], t[k], x_before, u, motion.params, x_next, Phi, Q)
                if status != 0:
                    return k, MODEL, status
                predict_step(zero, P_before, Phi, Q, spare, P_next)
            else:
                Q = motion.Q[k - 1]
                status = sigma_points_step(x_before, P_before, options.c, chi, U)
                if status != 0:
                    return k - 1, PREDICTION, status
                for i in range(points):
                    wanted = Q if i == 0 else nothing
                    status = propagate(t[k - 1], t[k], chi[i], u, motion.params, image[i], nothing, wanted)
                    if status != 0:
                        return k, MODEL, status
                transform_step(image, Q, options.c, options.w, x_next, D, rest, P_next)
                solve_upper(U, D)  # D' is now the linearisation
                copy(transposed(D), motion.Phi[k - 1])
                copy(rest, Q)
        copy_state(course.predicted_mean[k], course.predicted_cov[k], x, P)
        for s in range(sensing.kind.size):
            first, last = sensing.first[s], sensing.first[s + 1]
            z = sensing.z[k, first:last]
            if _nothing_seen(z):
                continue
            m, white = last - first, course.whitened[k, first:last]
            R_k, H_k = sensing.R[k % sensing.R.shape[0]], sensing.H[k % sensing.H.shape[0], first:last]
            linear = sensing.kind[s] == LINEAR
            R = R_all[: m * m].reshape((m, m))
            _block(R_k, first, R)
            if linear and options.plain:
                status = observed_update_step(x, P, z, H_k, R, sensing.sequential[s], white)
                if status != 0:
                    return k, INNOVATION if status > 0 else NOISE, first + abs(status)
                continue
            function = observe[sensing.function[s]]
            u = sensing.inputs[k, sensing.inputs_first[s] : sensing.inputs_first[s + 1]]
            p = sensing.params[sensing.params_first[s] : sensing.params_first[s + 1]]
            if sensing.kind[s] == UNSCENTED:
                status = sigma_points_step(x, P, options.c, chi, U)
                if status != 0:
                    return k, DRAW, status
                gamma, R_rest = gamma_all[: points * m].reshape((points, m)), R_spare[: m * m].reshape((m, m))
                for i in range(points):  # the noise is that of the first point, the mean
                    status = function(t[k], chi[i], u, p, gamma[i], nothing, R if i == 0 else R_rest)
                    if status != 0:
                        return k, SENSOR, status
                status = seen_update_step(x, P, U, gamma, z, R, options.c, options.w, white)
                if status != 0:
                    return k, INNOVATION, first + status
                continue
            h, H = h_all[:m], H_all[: m * n].reshape((m, n))
            if linear:
                copy(H_k, H)
            what = SENSOR
            if options.adapt > 0 or options.plain:
                status = _innovation(function, linear, t[k], x, z, u, p, h, H, R)
                if status == 0:
                    what = INNOVATION
                    if options.plain:
                        status = joint_update_step(x, P, h, H, R, white)
                    else:
                        weights = course.weights[k, first:last]
                        status, course.alpha[k] = _adapted(judge, options, x, P, h, H, R, white, weights)
            else:
                what, status = _iterated(
                    function, retract, difference, options, linear, t[k], z, u, p, h, H, R_k, first, R, x, P, white
                )
            if status != 0:
                return k, what, status if what == SENSOR else first + status
    return -1, 0, 0


_jitable = register_jitable(loop)


def _four(propagate, a, b, c, d, retract, difference, judge, t, motion, sensing, options, course):
    """Run `loop` with a tuple of functions made here: numba warns of one from outside."""
    return _jitable(propagate, (a, b, c, d), retract, difference, judge, t, motion, sensing, options, course)


@functools.cache
def compiled():
    """Compile the loop, once."""
    stack, table, ints, flags = types.float64[:, :, ::1], types.float64[:, ::1], types.int64[::1], types.boolean[::1]
    real, whole, flag = types.float64, types.int64, types.boolean
    motion = types.NamedTuple([whole, table, vector, stack, stack, ints], ModelArrays)
    sensing = types.NamedTuple([ints, ints, ints, flags, table, stack, stack, table, ints, vector, ints], SensorArrays)
    options = types.NamedTuple([real, real, flag, whole, real, whole, real, real, real, whole], Options)
    course = types.NamedTuple([table, stack, table, stack, table, vector, table], History)
    observe = [types.FunctionType(OBSERVE)] * FUNCTIONS
    signature = types.UniTuple(whole, 3)(
        types.FunctionType(PROPAGATE), *observe, types.FunctionType(RETRACT), types.FunctionType(DIFFERENCE),
        types.FunctionType(JUDGE), vector, motion, sensing, options, course,
    )  # fmt: skip
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NumbaExperimentalFeatureWarning)
        return njit([signature], cache=True, nogil=True)(_four)


@functools.cache
def stand_ins():
    """Compile what stands in for the functions of a linear model and a linear sensor."""
    return njit([PROPAGATE], cache=True)(_no_propagation), njit([OBSERVE], cache=True)(_no_observation)


def _no_propagation(t0, t1, x, u, p, x_out, F, Q):
    return 1


def _no_observation(t, x, u, p, h, H, R):
    return 1
