"""The filter loop: one run over epochs and sensors for all models and kinds of filters, compiled.

`run` checks what it is given and hands plain arrays to `_loop`, which is compiled where the functions of model and
sensors are, and runs as Python where they are not: the same lines in both cases.
"""

from __future__ import annotations

import functools
import warnings
from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np
from numba import njit, typeof, types
from numba.core.errors import NumbaExperimentalFeatureWarning
from numba.extending import is_jitted, register_jitable

from geokalman.kalman.checks import NotPositiveDefinite, array, covariance, covariances, epochs, matrices
from geokalman.kalman.dense import copy_state, solve_upper
from geokalman.kalman.gaussian import Gaussian, Trajectory, gaussian
from geokalman.kalman.linear import observed_update_step, predict_step, scalar_update_step, steps, update_step
from geokalman.kalman.model import (
    DIFFERENCE, OBSERVE, PROPAGATE, RETRACT, Manifold, Model, Sensor, add, subtract, vector,
)  # fmt: skip
from geokalman.kalman.unscented import sigma_points_step, spread, transform_step, unscented_update_step

Kind = Literal["extended", "unscented"]
LINEAR, EXTENDED, UNSCENTED = range(3)
_PREDICTION, _INNOVATION, _NOISE, _DRAW, _MODEL, _SENSOR = range(1, 7)  # what failed


class Motion(NamedTuple):
    """A model as arrays: kind of prediction; Phi, Q (K, n, n), read by a linear one through step (N - 1,), else written."""

    kind: int
    inputs: np.ndarray
    params: np.ndarray
    Phi: np.ndarray
    Q: np.ndarray
    step: np.ndarray
    flat: bool


class Sensing(NamedTuple):
    """All sensors as arrays: sensor s has the columns first[s] to first[s + 1] of z (N, M), R (K, M, M), H (K, M, n)."""

    first: np.ndarray
    kind: np.ndarray
    scalar: np.ndarray
    sequential: np.ndarray
    z: np.ndarray
    R: np.ndarray
    H: np.ndarray
    inputs: np.ndarray
    inputs_first: np.ndarray
    params: np.ndarray
    params_first: np.ndarray


class Options(NamedTuple):
    """Sigma points c, w of `spread`; passes of an iterated update; gate: largest squared innovation, inf admits all."""

    c: float
    w: float
    iterations: int
    gate: float


class Course(NamedTuple):
    """The course of a run, filled by the loop; row 0 of the predictions holds the prior."""

    predicted_mean: np.ndarray
    predicted_cov: np.ndarray
    mean: np.ndarray
    cov: np.ndarray
    whitened: np.ndarray


@njit(cache=True)
def _nothing_seen(z):
    for a in range(z.size):
        if not np.isnan(z[a]):
            return False
    return True


@njit(cache=True)
def _linear_update(x, P, z, H, R, first, scalar, sequential, whitened):
    """Condition on z = H x + v, in place; R : of all sensors, this one's block begins at `first`. Status."""
    m, n = H.shape
    if not scalar:
        return observed_update_step(x, P, z, H, R[first : first + m, first : first + m].copy(), sequential, whitened)
    for a in range(m):
        if np.isnan(z[a]):
            continue
        residual = z[a]
        for j in range(n):
            residual -= H[a, j] * x[j]
        S = scalar_update_step(x, P, residual, H[a], R[first + a, first + a])
        if not S > 0.0:
            return a + 1
        whitened[a] = residual / np.sqrt(S)
    return 0


@njit(cache=True)
def _rows_seen(residual, H, R):
    """What is left of an observation without the components that are NaN, and their places."""
    m, n = H.shape
    seen = np.empty(m, np.int64)
    count = 0
    for a in range(m):
        if not np.isnan(residual[a]):
            seen[count] = a
            count += 1
    residual_seen, H_seen, R_seen = np.empty(count), np.empty((count, n)), np.empty((count, count))
    for b in range(count):
        residual_seen[b] = residual[seen[b]]
        for j in range(n):
            H_seen[b, j] = H[seen[b], j]
        for d in range(count):
            R_seen[b, d] = R[seen[b], seen[d]]
    return seen[:count], residual_seen, H_seen, R_seen


@njit(cache=True)
def _extended_update(x, P, residual, H, R, whitened):
    """Condition on the components of a linearised observation that are not NaN, in place. Status."""
    m = residual.size
    if m == 1:
        S = scalar_update_step(x, P, residual[0], H[0], R[0, 0])
        if not S > 0.0:
            return 1
        whitened[0] = residual[0] / np.sqrt(S)
        return 0
    whole = True
    for a in range(m):
        if np.isnan(residual[a]):
            whole = False
    if whole:
        return update_step(x, P, residual, H, R, np.empty((m, m)), whitened)
    seen, residual, H, R = _rows_seen(residual, H, R)
    white = np.empty(seen.size)
    status = update_step(x, P, residual, H, R, np.empty(R.shape), white)
    if status == 0:
        for b in range(seen.size):
            whitened[seen[b]] = white[b]
    return status


@njit(cache=True)
def _unscented_update(x, P, U, gamma, z, R, c, w, whitened):
    """Condition on the components of z that are not NaN, given the images gamma (2 n + 1, m) of all, in place. Status."""
    seen, z, gamma_t, R = _rows_seen(z, gamma.T, R)
    white = np.empty(seen.size)
    status = unscented_update_step(x, P, U, gamma_t.T.copy(), z, R, c, w, np.empty(R.shape), white)
    if status == 0:
        for b in range(seen.size):
            whitened[seen[b]] = white[b]
    return status


@register_jitable
def _iterated(observe, retract, difference, options, t, z, u, p, h, H, R, x, P, whitened):
    """An extended update with several linearisations, a gate or a manifold, in place. Returns (what, status) of a failure."""
    prior, P_prior = x.copy(), P.copy()
    d, moved, white = np.zeros(P.shape[0]), np.empty(x.size), np.full(z.size, np.nan)
    for i in range(options.iterations):
        status = observe(t, x, u, p, h, H, R)
        if status != 0:
            return _SENSOR, status
        h[:] = z - h
        if i > 0:  # linearised here, the prior is still that from before
            difference(x, prior, d)
            _less(H, d, h)
        d[:] = 0.0
        P[:] = P_prior
        status = _extended_update(d, P, h, H, R, white)
        if status != 0:
            return _INNOVATION, status
        retract(prior, d, moved)
        x[:] = moved
        if i == 0:
            whitened[:] = white
    if np.nansum(whitened * whitened) > options.gate:
        x[:] = prior
        P[:] = P_prior
    return _INNOVATION, 0


def _loop(propagate, observe, retract, difference, t, motion, sensing, options, course):
    """Filter all epochs. Returns (epoch, what, row): what failed, one of the codes above, in which row; or (-1, 0, 0)."""
    N, M = sensing.z.shape
    n, nx = course.cov.shape[1], course.mean.shape[1]
    points, nothing = 2 * n + 1, np.empty((0, 0))
    h_all, H_all, R_all, gamma_all = np.empty(M), np.empty(M * n), np.empty(M * M), np.empty(points * M)
    chi, U, image = np.empty((points, n)), np.empty((n, n)), np.empty((points, n))
    D, rest, zero, spare = np.empty((n, n)), np.empty((n, n)), np.zeros(n), np.empty(n)
    plain = motion.flat and options.iterations == 1 and options.gate == np.inf
    for k in range(N):
        x, P = course.mean[k], course.cov[k]
        if k > 0:
            x_before, P_before = course.mean[k - 1], course.cov[k - 1]
            x_next, P_next = course.predicted_mean[k], course.predicted_cov[k]
            if motion.kind == LINEAR:
                s = motion.step[k - 1]
                predict_step(x_before, P_before, motion.Phi[s], motion.Q[s], x_next, P_next)
            elif motion.kind == EXTENDED:
                u, Phi, Q = motion.inputs[k - 1], motion.Phi[k - 1], motion.Q[k - 1]
                status = propagate(t[k - 1], t[k], x_before, u, motion.params, x_next, Phi, Q)
                if status != 0:
                    return k, _MODEL, status
                predict_step(zero, P_before, Phi, Q, spare, P_next)
            else:
                u, Q = motion.inputs[k - 1], motion.Q[k - 1]
                status = sigma_points_step(x_before, P_before, options.c, chi, U)
                if status != 0:
                    return k - 1, _PREDICTION, status
                for i in range(points):
                    wanted = Q if i == 0 else nothing
                    status = propagate(t[k - 1], t[k], chi[i], u, motion.params, image[i], nothing, wanted)
                    if status != 0:
                        return k, _MODEL, status
                transform_step(image, Q, options.c, options.w, x_next, D, rest, P_next)
                solve_upper(U, D)  # D' is now the linearisation
                _transposed(D, motion.Phi[k - 1])
                Q[:] = rest
        copy_state(course.predicted_mean[k], course.predicted_cov[k], x, P)
        for s in range(sensing.kind.size):
            first, last = sensing.first[s], sensing.first[s + 1]
            z = sensing.z[k, first:last]
            if _nothing_seen(z):
                continue
            white = course.whitened[k, first:last]
            R_k = sensing.R[k % sensing.R.shape[0]]
            if sensing.kind[s] == LINEAR:
                H_k = sensing.H[k % sensing.H.shape[0], first:last]
                status = _linear_update(x, P, z, H_k, R_k, first, sensing.scalar[s], sensing.sequential[s], white)
                if status != 0:
                    return k, _INNOVATION if status > 0 else _NOISE, first + abs(status)
                continue
            m = last - first
            u = sensing.inputs[k, sensing.inputs_first[s] : sensing.inputs_first[s + 1]]
            p = sensing.params[sensing.params_first[s] : sensing.params_first[s + 1]]
            R = R_all[: m * m].reshape((m, m))
            _block(R_k, first, R)
            what = _INNOVATION
            if sensing.kind[s] == UNSCENTED:
                status = sigma_points_step(x, P, options.c, chi, U)
                if status != 0:
                    return k, _DRAW, status
                gamma = gamma_all[: points * m].reshape((points, m))
                for i in range(points):
                    status = observe[s](t[k], chi[i], u, p, gamma[i], nothing, R)
                    if status != 0:
                        return k, _SENSOR, status
                status = _unscented_update(x, P, U, gamma, z, R, options.c, options.w, white)
            else:
                h, H = h_all[:m], H_all[: m * n].reshape((m, n))
                if plain:
                    status = observe[s](t[k], x, u, p, h, H, R)
                    if status != 0:
                        return k, _SENSOR, status
                    _residual(z, h)
                    status = _extended_update(x, P, h, H, R, white)
                else:
                    what, status = _iterated(observe[s], retract, difference, options, t[k], z, u, p, h, H, R, x, P, white)
            if status != 0:
                return k, what, status if what == _SENSOR else first + status
    return -1, 0, 0


@njit(cache=True)
def _residual(z, h):
    for a in range(h.size):
        h[a] = z[a] - h[a]


@njit(cache=True)
def _less(H, d, residual):
    """residual -= H d."""
    for b in range(H.shape[0]):
        for j in range(H.shape[1]):
            residual[b] -= H[b, j] * d[j]


@njit(cache=True)
def _transposed(A, out):
    for i in range(A.shape[0]):
        for j in range(A.shape[1]):
            out[j, i] = A[i, j]


@njit(cache=True)
def _block(A, first, out):
    for a in range(out.shape[0]):
        for b in range(out.shape[1]):
            out[a, b] = A[first + a, first + b]


def run(
    prior: Gaussian,
    t,
    model: Model,
    sensors: Sequence[Sensor],
    kind: Kind = "extended",
    alpha: float = 1.0,
    beta: float = 2.0,
    kappa: float = 0.0,
    iterations: int = 1,
    gate: float = np.inf,
) -> Trajectory:
    """Filter N epochs of several sensors; the sensors of an epoch are processed in order.

    prior : Gaussian at t[0], before the observations of that epoch; t : (N,) [s], increasing; model, sensors : see
    `Model` and `Sensor`; kind : how what is not linear is treated, "extended" (linearised at the state) or "unscented"
    (from redrawn sigma points; alpha, beta, kappa as in `unscented.spread`).
    iterations : linearisations of each extended update; gate : largest squared whitened innovation that an extended
    update admits (it is recorded where it was refused).
    Returns the Trajectory with Phi and Q of every step, ready for `smooth` (of an unscented filter: its linearisation,
    so that `smooth` is the unscented RTS smoother, Sarkka 2008).
    Raises ValueError for wrong input, NotPositiveDefinite with the epoch.
    Source: grace-fusion (16)-(20), (26)-(43).
    """
    if kind not in ("extended", "unscented"):
        raise ValueError(f"kind = {kind!r} is unknown: take extended or unscented")
    prior, t = gaussian(*prior) if model.manifold is None else _error_gaussian(prior), epochs(t)
    N, n = len(t), len(prior.cov)
    code = EXTENDED if kind == "extended" else UNSCENTED
    propagate, motion = _motion(model, t, n, code)
    observe, sensing = _sensing(sensors, N, n, code)
    options = Options(*spread(n, alpha, beta, kappa), int(iterations), float(gate))
    nx, M = len(prior.mean), sensing.z.shape[1]
    course = Course(np.empty((N, nx)), np.empty((N, n, n)), np.empty((N, nx)), np.empty((N, n, n)), np.full((N, M), np.nan))
    course.predicted_mean[0], course.predicted_cov[0] = prior
    space = model.manifold or Manifold(retract=add, difference=subtract, n=n)
    functions = (propagate, observe, space.retract, space.difference)
    loop = _compiled(len(observe)) if all(map(is_jitted, (propagate, *observe))) else _loop
    found = loop(*functions, t, motion, sensing, options, course)
    _raise(found, t)
    return Trajectory(t, *course[:4], course.whitened, motion.Phi, motion.Q, motion.step)


@functools.cache
def _compiled(sensors: int):
    """The loop as machine code for so many sensors."""
    stack, table, matrix, ints = types.float64[:, :, ::1], types.float64[:, ::1], types.float64[:, ::1], types.int64[::1]

    def record(of, /, **members):
        return types.NamedTuple([members[name] for name in of._fields], of)

    motion = record(
        Motion, kind=types.int64, inputs=table, params=vector, Phi=stack, Q=stack, step=ints, flat=types.boolean
    )
    sensing = record(
        Sensing, first=ints, kind=ints, scalar=types.boolean[::1], sequential=types.boolean[::1], z=table, R=stack, H=stack, inputs=table,
        inputs_first=ints, params=vector, params_first=ints,
    )  # fmt: skip
    options = types.NamedTuple([types.float64, types.float64, types.int64, types.float64], Options)
    course = record(
        Course, predicted_mean=table, predicted_cov=stack, mean=table, cov=stack, whitened=table
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NumbaExperimentalFeatureWarning)
        signature = types.UniTuple(types.int64, 3)(
            types.FunctionType(PROPAGATE), types.UniTuple(types.FunctionType(OBSERVE), sensors),
            types.FunctionType(RETRACT), types.FunctionType(DIFFERENCE), vector, motion, sensing, options, course,
        )  # fmt: skip
        return njit([signature], cache=True, nogil=True)(_loop)


@njit(PROPAGATE, cache=True)
def _no_propagation(t0, t1, x, u, p, x_out, F, Q):
    return 1


@njit(OBSERVE, cache=True)
def _no_observation(t, x, u, p, h, H, R):
    return 1


def _motion(model: Model, t: np.ndarray, n: int, kind: int):
    """The model as a function with the signature PROPAGATE and as arrays."""
    N = len(t)
    params = array("params of the model", model.params, None)
    inputs = np.empty((max(N - 1, 0), 0)) if model.inputs is None else array("inputs of the model", model.inputs, N - 1, None)
    flat = model.manifold is None
    if model.f is None:
        transition = model.F if callable(model.F) else (model.F, model.Q)
        Phi, Q, step = steps(transition, t, n)
        return _no_propagation, Motion(LINEAR, inputs, params, Phi, Q, step, flat)
    Phi, Q = np.empty((N - 1, n, n)), np.empty((N - 1, n, n))
    motion = Motion(kind, inputs, params, Phi, Q, np.arange(N - 1), flat)
    return model.f if is_jitted(model.f) else _propagation(model, n, kind), motion


def _propagation(model: Model, n: int, kind: int):
    """Python functions f, F, Q as one with the signature PROPAGATE; what they give first is checked, then trusted."""
    f, F, Q = model.f, model.F, model.Q
    if kind == EXTENDED and F is None:
        raise ValueError("the model has no F: the extended filter needs the Jacobian of f")
    fixed = None if callable(Q) else covariance("Q", Q, n)
    checked = False

    def propagate(t0, t1, x, u, p, x_out, F_out, Q_out):
        nonlocal checked
        if not checked:
            array("f(x)", f(x, t0, t1), n)
            if F_out.size:
                array("F(x)", F(x, t0, t1), n, n)
            if fixed is None:
                covariance("Q", Q(t0, t1), n)
            checked = True
        x_out[:] = f(x, t0, t1)
        if F_out.size:
            F_out[:] = F(x, t0, t1)
        if Q_out.size:
            Q_out[:] = Q(t0, t1) if fixed is None else fixed
        return 0

    return propagate


def _observation(sensor: Sensor, i: int, m: int, n: int, kind: int):
    h, H = sensor.h, sensor.H
    if kind == EXTENDED and H is None:
        raise ValueError(f"sensor {i} has no H: the extended filter needs the Jacobian of every sensor")
    checked = False

    def observe(t, x, u, p, h_out, H_out, R):
        nonlocal checked
        if not checked:
            array("h(x)", h(x, t), m)
            if H_out.size:
                array("H(x)", H(x, t), m, n)
            checked = True
        h_out[:] = h(x, t)
        if H_out.size:
            H_out[:] = H(x, t)
        return 0

    return observe


def _sensing(sensors: Sequence[Sensor], N: int, n: int, kind: int):
    """The sensors as functions with the signature OBSERVE and as arrays."""
    if not sensors:
        raise ValueError("there is no sensor: give at least one")
    z = [array(f"z of sensor {i}", s.z, N, None, missing=True) for i, s in enumerate(sensors)]
    width = [values.shape[1] for values in z]
    R = [covariances(f"R of sensor {i}", s.R, N, m) for i, (s, m) in enumerate(zip(sensors, width, strict=True))]
    linear = [s.h is None for s in sensors]
    H = [
        matrices(f"H of sensor {i}", s.H, N, m, n) if s.h is None else np.zeros((1, m, n))
        for i, (s, m) in enumerate(zip(sensors, width, strict=True))
    ]
    functions = tuple(
        _no_observation if s.h is None else s.h if is_jitted(s.h) else _observation(s, i, m, n, kind)
        for i, (s, m) in enumerate(zip(sensors, width, strict=True))
    )
    inputs = [
        np.empty((N, 0)) if s.inputs is None else array(f"inputs of sensor {i}", s.inputs, N, None)
        for i, s in enumerate(sensors)
    ]
    params = [array(f"params of sensor {i}", s.params, None) for i, s in enumerate(sensors)]
    return functions, Sensing(
        first=_offsets(width),
        kind=np.where(linear, LINEAR, kind),
        scalar=np.array([s.sequential and _diagonal(noise) for s, noise in zip(sensors, R, strict=True)]),
        sequential=np.array([s.sequential for s in sensors]),
        z=np.hstack(z),
        R=_side_by_side(R, diagonal=True),
        H=_side_by_side(H, diagonal=False),
        inputs=np.hstack(inputs),
        inputs_first=_offsets([values.shape[1] for values in inputs]),
        params=np.concatenate(params),
        params_first=_offsets([values.size for values in params]),
    )


def _diagonal(R: np.ndarray) -> bool:
    return np.count_nonzero(R) == np.count_nonzero(np.diagonal(R, axis1=1, axis2=2))


def _offsets(lengths: Sequence[int]) -> np.ndarray:
    return np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)


def _side_by_side(stacks: Sequence[np.ndarray], diagonal: bool) -> np.ndarray:
    """One stack (K, M, M), block diagonal, or (K, M, n), one below the other, from those of the sensors."""
    if len(stacks) == 1:
        return stacks[0]
    K = max(len(stack) for stack in stacks)
    first = _offsets([stack.shape[1] for stack in stacks])
    out = np.zeros((K, first[-1], first[-1] if diagonal else stacks[0].shape[2]))
    for stack, a, b in zip(stacks, first[:-1], first[1:], strict=True):
        if diagonal:
            out[:, a:b, a:b] = stack
        else:
            out[:, a:b] = stack
    return out


def _raise(found, t: np.ndarray) -> None:
    epoch, what, row = found
    if what == 0:
        return
    if what in (_MODEL, _SENSOR):
        raise ArithmeticError(f"the {'model' if what == _MODEL else 'sensor'} stopped at epoch {epoch} (t = {t[epoch]:g} s) with code {row}")
    matrix = {
        _PREDICTION: "filtered covariance", _INNOVATION: "innovation covariance",
        _NOISE: "observation noise covariance", _DRAW: "prior covariance",
    }[what]  # fmt: skip
    detail = f"the pivot of observed component {row - 1} is not positive"
    if what in (_PREDICTION, _DRAW):
        detail = f"its Cholesky pivot {row - 1} is not positive"
    raise NotPositiveDefinite(matrix, epoch, float(t[epoch]), detail)
