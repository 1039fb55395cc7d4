"""Run a filter over epochs and sensors: what a user gives is checked, then filtered."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numba.extending import is_jitted

from geokalman.kalman.adaptive import HOOKS, Adaptive, judging_step
from geokalman.kalman.checks import NotPositiveDefinite, array, covariance, covariances, epochs, matrices, scalar, whole
from geokalman.kalman.gaussian import Gaussian, Stopped, Trajectory, gaussian
from geokalman.kalman.linear import steps
from geokalman.kalman.loop import (
    DRAW, EXTENDED, FUNCTIONS, INNOVATION, LINEAR, MODEL, NOISE, PREDICTION, SENSOR, UNSCENTED, History, ModelArrays,
    Options, SensorArrays, compiled, loop, stand_ins,
)  # fmt: skip
from geokalman.kalman.model import OBSERVE, PROPAGATE, Manifold, Model, Sensor, checked_once, flat, is_kernel
from geokalman.kalman.unscented import spread

Kind = Literal["extended", "unscented"]


def run(
    prior: Gaussian,
    t,
    model: Model,
    sensors: Sequence[Sensor],
    kind: Kind = "extended",
    *,
    alpha: float = 1.0,
    beta: float = 2.0,
    kappa: float = 0.0,
    iterations: int = 1,
    gate: float = np.inf,
    adaptive: Adaptive | None = None,
) -> Trajectory:
    """Filter N epochs of several sensors, those of an epoch in their order.

    prior : Gaussian at t[0], before the observations of that epoch; t : (N,) [s], increasing, or with equal neighbours
    where f is a function; model, sensors : see `Model` and `Sensor`; kind : how what is not linear is treated,
    "extended" (linearised at the state) or "unscented" (from redrawn sigma points; alpha, beta, kappa as in
    `unscented.spread`); iterations : linearisations of each extended update; gate : largest squared whitened innovation
    that an extended update admits (it is recorded where it was refused); adaptive : a hook that judges each epoch.
    Returns the Trajectory with transition and noise of every step, ready for `smooth` (of an unscented filter: its
    linearisation, so that `smooth` is the unscented RTS smoother, Sarkka 2008).
    Raises ValueError for wrong input; NotPositiveDefinite, or Stopped where a compiled function says so, both with the
    epoch and the course so far.
    Source: grace-fusion (16)-(20), (26)-(43).

    >>> from geokalman.kalman import Model, Sensor, gaussian
    >>> walk, sensor = Model(F=[[1.0]], Q=[[1.0]]), Sensor([[2.0], [np.nan]], [[1.0]], H=[[1.0]])
    >>> course = run(gaussian([0.0], [3.0]), [0.0, 1.0], walk, [sensor])
    >>> course.mean[:, 0].tolist(), course.cov[:, 0, 0].tolist()
    ([1.5, 1.5], [0.75, 1.75])
    """
    if kind not in ("extended", "unscented"):
        raise ValueError(f"kind = {kind!r} is unknown: take extended or unscented.")
    code = EXTENDED if kind == "extended" else UNSCENTED
    space = model.manifold or flat()
    if model.manifold is None:
        prior = gaussian(*prior)
    else:
        prior = Gaussian(array("mean", prior[0], None), covariance("covariance", prior[1], space.n))
    t, n = epochs(t, repeated=model.f is not None), len(prior.cov)
    N = len(t)
    propagate, motion = _motion(model, t, len(prior.mean), n, code)
    observe, sensing = _sensing(sensors, N, n, code)
    options = _options(spread(n, alpha, beta, kappa), iterations, gate, adaptive, model.manifold, code)
    nx, M = len(prior.mean), sensing.z.shape[1]
    if adaptive is not None:
        _judgeable(adaptive, sensing.kind, n)
    if nx != n and LINEAR in sensing.kind:
        i = list(sensing.kind).index(LINEAR)
        raise ValueError(f"sensor {i} is linear: where a state of {nx} numbers has an error of {n}, give h.")
    judged = 0 if adaptive is None else N
    course = History(
        np.empty((N, nx)), np.empty((N, n, n)), np.empty((N, nx)), np.empty((N, n, n)), np.full((N, M), np.nan),
        np.ones(judged), np.full((judged, M), np.nan),
    )  # fmt: skip
    course.predicted_mean[0], course.predicted_cov[0] = prior
    machine = space.compiled and len(observe) <= FUNCTIONS and all(map(is_jitted, (propagate, *observe)))
    arrays = (judging_step(adaptive is not None), t, motion, sensing, options, course)
    if machine:
        observe += (stand_ins()[1],) * (FUNCTIONS - len(observe))
        epoch, what, row = compiled()(propagate, *observe, *space.kernels(nx), *arrays)
    else:
        epoch, what, row = loop(propagate, observe, *space.kernels(nx), *arrays)
    last = N if what == 0 else epoch if what == MODEL else epoch + 1  # beyond, nothing was computed
    done = History(*(part[:last] for part in course))
    trajectory = Trajectory(
        t[:last], done.predicted_mean, done.predicted_cov, done.mean, done.cov, done.whitened,
        motion.Phi, motion.Q, motion.step[: max(last - 1, 0)],
        alpha=done.alpha if judged else None, weights=done.weights if judged else None, manifold=model.manifold,
    )  # fmt: skip
    if not machine:
        _finite(trajectory, sensing.z, stopped=what != 0)
    if what:
        error = _failure(epoch, what, row, t)
        error.course = trajectory
        raise error
    return trajectory


def _judgeable(hook: Adaptive, kinds: np.ndarray, n: int) -> None:
    """Raise ValueError where an adaptive hook cannot judge."""
    if UNSCENTED in kinds:
        i = list(kinds).index(UNSCENTED)
        raise ValueError(f"an adaptive hook judges linearised observations: sensor {i} is unscented.")
    if hook.states > n and HOOKS[hook.by] >= HOOKS["discrepancy"]:
        raise ValueError(f"states = {hook.states} of the adaptive hook: the state has {n}.")


def _finite(course: Trajectory, z: np.ndarray, stopped: bool) -> None:
    """Raise ValueError for the first epoch at which a Python function gave no number."""
    seen = ~np.isnan(z[: len(course)])
    for name, lost in (
        ("f(x)", ~np.isfinite(course.predicted_mean).all(axis=1)),
        ("h(x)", (np.isnan(course.whitened) & seen).any(axis=1) | ~np.isfinite(course.mean).all(axis=1)),
    ):
        if lost.any() and not (stopped and name == "h(x)"):  # the epoch of the stop is not complete
            k = int(np.argmax(lost))
            raise ValueError(f"{name} is not finite at epoch {k} (t = {course.t[k]:g} s).")


def _options(scaling, iterations, gate, adaptive: Adaptive | None, space: Manifold | None, kind: int) -> Options:
    if whole("iterations", iterations) < 1:
        raise ValueError(f"iterations = {iterations}: an update needs at least one linearisation.")
    if not (gate == np.inf or scalar("gate", gate) > 0.0):
        raise ValueError(f"gate = {gate}: it must be positive; inf admits every observation.")
    iterated = space is not None or iterations > 1 or gate < np.inf
    if iterated and kind == UNSCENTED:
        raise ValueError("manifold, iterations and gate belong to the extended filter: take kind = 'extended'.")
    if iterated and adaptive is not None:
        raise ValueError("an adaptive hook takes a flat state, one linearisation and no gate.")
    hook = Adaptive(by="ratio") if adaptive is None else adaptive
    return Options(
        *scaling, plain=not iterated and adaptive is None, iterations=int(iterations), gate=float(gate),
        adapt=0 if adaptive is None else HOOKS[hook.by], k0=float(hook.k0), k1=float(hook.k1), floor=float(hook.floor),
        states=int(hook.states),
    )  # fmt: skip


def _motion(model: Model, t: np.ndarray, nx: int, n: int, kind: int):
    """Give the model as a function with the signature PROPAGATE and as arrays."""
    count, params = len(t) - 1, array("params of the model", model.params, None)
    inputs = _inputs("the model", model.inputs, count)
    if model.f is None and model.F is None:
        raise ValueError("the model has neither f nor F: give a function or matrices.")
    if model.f is None:
        transition = model.F if callable(model.F) else (model.F, model.Q)
        Phi, Q, step = steps(transition, t, n)
        return stand_ins()[0], ModelArrays(LINEAR, inputs, params, Phi, Q, step)
    Phi, Q = np.zeros((2, count, n, n))
    if model.Q is not None and not callable(model.Q):
        Q[:] = covariances("Q", model.Q, count, n)
    motion = ModelArrays(kind, inputs, params, Phi, Q, np.arange(count))
    return model.f if is_kernel(model.f, PROPAGATE) else _propagation(model, nx, n, kind), motion


def _propagation(model: Model, nx: int, n: int, kind: int):
    """Join Python functions f, F, Q to one with the signature PROPAGATE."""
    f, F = model.f, model.F
    if kind == EXTENDED and F is None:
        raise ValueError("the model has no F: the extended filter needs the Jacobian of f.")
    if model.Q is None:
        raise ValueError("the model has no Q: give the covariance of a step.")
    f, F = checked_once(array, "f(x)", f, nx), checked_once(array, "F(x)", F, n, n)
    Q = checked_once(covariance, "Q", model.Q, n) if callable(model.Q) else None

    def propagate(t0, t1, x, u, p, x_out, F_out, Q_out):
        x_out[:] = f(x, t0, t1)
        if F_out.size:
            F_out[:] = F(x, t0, t1)
        if Q is not None and Q_out.size:
            Q_out[:] = Q(t0, t1)
        return 0

    return propagate


def _observation(sensor: Sensor, i: int, m: int, n: int, kind: int):
    """Join Python functions h, H to one with the signature OBSERVE."""
    h, H = sensor.h, sensor.H
    if kind == EXTENDED and H is None:
        raise ValueError(f"sensor {i} has no H: the extended filter needs the Jacobian of every sensor.")
    h, H = checked_once(array, "h(x)", h, m), checked_once(array, "H(x)", H, m, n)

    def observe(t, x, u, p, h_out, H_out, R):
        h_out[:] = h(x, t)
        if H_out.size:
            H_out[:] = H(x, t)
        return 0

    return observe


def _sensing(sensors: Sequence[Sensor], N: int, n: int, kind: int):
    """Give the sensors as functions with the signature OBSERVE and as arrays."""
    if not sensors:
        raise ValueError("there is no sensor: give at least one.")
    z = [array(f"z of sensor {i}", s.z, N, None, missing=True) for i, s in enumerate(sensors)]
    first = _offsets([values.shape[1] for values in z])
    R, H, functions = [], [], []
    for i, (s, m) in enumerate(zip(sensors, np.diff(first), strict=True)):
        if s.h is None and s.H is None:
            raise ValueError(f"sensor {i} has neither h nor H: give a function or a matrix.")
        R.append(covariances(f"R of sensor {i}", s.R, N, m))
        H.append(matrices(f"H of sensor {i}", s.H, N, m, n) if s.h is None else np.zeros((1, m, n)))
        if s.h is None:
            functions.append(stand_ins()[1])
        else:
            functions.append(s.h if is_kernel(s.h, OBSERVE) else _observation(s, i, m, n, kind))
    R_all, H_all = np.zeros((max(map(len, R)), first[-1], first[-1])), np.zeros((max(map(len, H)), first[-1], n))
    for a, b, R_own, H_own in zip(first[:-1], first[1:], R, H, strict=True):
        R_all[:, a:b, a:b], H_all[:, a:b] = R_own, H_own
    inputs = [_inputs(f"sensor {i}", s.inputs, N) for i, s in enumerate(sensors)]
    params = [array(f"params of sensor {i}", s.params, None) for i, s in enumerate(sensors)]
    different = tuple(dict.fromkeys(functions))
    return different, SensorArrays(
        first=first, kind=np.where([s.h is None for s in sensors], LINEAR, kind),
        function=np.array([different.index(function) for function in functions]),
        sequential=np.array([s.sequential for s in sensors]), z=np.hstack(z), R=R_all, H=H_all,
        inputs=np.hstack(inputs), inputs_first=_offsets([values.shape[1] for values in inputs]),
        params=np.concatenate(params), params_first=_offsets([values.size for values in params]),
    )  # fmt: skip


def _inputs(whose: str, inputs, count: int) -> np.ndarray:
    return np.empty((count, 0)) if inputs is None else array(f"inputs of {whose}", inputs, count, None)


def _offsets(lengths: Sequence[int]) -> np.ndarray:
    return np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)


def _failure(epoch: int, what: int, row: int, t: np.ndarray) -> Exception:
    if what in (MODEL, SENSOR):
        return Stopped("model" if what == MODEL else "sensor", epoch, float(t[epoch]), row)
    matrix = {
        PREDICTION: "filtered covariance", INNOVATION: "innovation covariance", NOISE: "observation noise covariance",
        DRAW: "covariance of the state",
    }[what]  # fmt: skip
    detail = f"the pivot of observed component {row - 1} is not positive"
    if what in (PREDICTION, DRAW):
        detail = f"its Cholesky pivot {row - 1} is not positive"
    return NotPositiveDefinite(matrix, epoch, float(t[epoch]), detail)
