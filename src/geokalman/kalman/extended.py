"""The extended Kalman filter: the linear steps at the Jacobians of nonlinear f and h, and a run over several
sensors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from geokalman.kalman.checks import NotPositiveDefinite, array, covariance, covariances, epochs
from geokalman.kalman.gaussian import Gaussian, Innovation, Trajectory, gaussian
from geokalman.kalman.linear import predict_step, update_step

NoiseCovariance = np.ndarray | Callable[[float, float], np.ndarray]


class Sensor(NamedTuple):
    """One instrument's observations z = h(x, t) + v, v ~ N(0, R), on the epochs of a run.

    z : (N, m), NaN where a component or an epoch is missing [its units]; R : (m, m) or (N, m, m); h(x, t) : (m,);
    H(x, t) : (m, n) = dh/dx, needed by the extended filter only. Observations in one sensor are processed jointly at
    one linearisation, sensors one after the other, each at the state that the one before left.
    """

    z: np.ndarray
    R: np.ndarray
    h: Callable[[np.ndarray, float], np.ndarray]
    H: Callable[[np.ndarray, float], np.ndarray] | None = None


def predict(posterior: Gaussian, f, F, Q) -> Gaussian:
    """Propagate a Gaussian through x_next = f(x) + w, w ~ N(0, Q), linearised at posterior.mean.

    mean = f,   cov = F cov F' + Q.
    f : (n,) the propagated mean; F : (n, n) = df/dx; Q : (n, n), positive semidefinite. Returns the next prior.
    Raises ValueError for wrong shapes, values that are not finite, a Q that is no covariance.
    """
    x, P = gaussian(*posterior)
    n = len(x)
    P_out = np.empty((n, n))
    predict_step(x, P, array("F", F, n, n), covariance("Q", Q, n), np.empty(n), P_out)
    return Gaussian(array("f", f, n), P_out)


def update(prior: Gaussian, z, h, H, R) -> tuple[Gaussian, Innovation]:
    """Condition a Gaussian on z = h(x) + v, v ~ N(0, R), linearised at prior.mean (Joseph form).

    z, h : (m,)   measured (NaN where missing) and predicted observation [sensor units]
    H, R : (m, n), (m, m)
    Returns the posterior and Innovation(residual, S, whitened), whitened ~ N(0, I) if the model is right.
    Raises ValueError for wrong shapes and infinite values, NotPositiveDefinite for S.
    Source: grace-fusion (18)-(20).
    """
    x, P = gaussian(*prior)
    z = array("z", z, None, missing=True)
    m = len(z)
    return _update(x, P, z, array("h", h, m), array("H", H, m, len(x)), covariance("R", R, m))


def filter_extended(
    prior: Gaussian,
    t,
    f: Callable[[np.ndarray, float, float], np.ndarray],
    F: Callable[[np.ndarray, float, float], np.ndarray],
    Q: NoiseCovariance,
    sensors: Sequence[Sensor],
) -> Trajectory:
    """Extended Kalman filter over N epochs; the sensors of an epoch are processed in order, each linearised anew.

    prior : Gaussian at t[0], before the observations of that epoch; t : (N,) [s]; f(x, t0, t1) : (n,) state at t1 from
    that at t0; F(x, t0, t1) : (n, n) = df/dx; Q : (n, n), or Q(t0, t1); sensors : see `Sensor`.
    Returns the Trajectory with F and Q of every step, ready for `smoothing.smooth`.
    Raises ValueError for wrong input, NotPositiveDefinite with the epoch.
    """
    prior, t, z, R, out = prepare(prior, t, sensors)
    if any(sensor.H is None for sensor in sensors):
        raise ValueError("a sensor has no H: the extended filter needs the Jacobian of every sensor")
    n = len(prior.mean)
    x, P = prior.mean.copy(), prior.cov.copy()
    for k, now in enumerate(map(float, t)):
        if k > 0:
            before = float(t[k - 1])
            Phi = array("F(x)", F(x, before, now), n, n)
            noise = noise_at(Q, before, now, n)
            P_out = np.empty((n, n))
            predict_step(x, P, Phi, noise, np.empty(n), P_out)
            x, P = array("f(x)", f(x, before, now), n), P_out
            out.transition[k - 1], out.process_noise[k - 1] = Phi, noise
        out.predicted_mean[k], out.predicted_cov[k] = x, P
        column = 0
        for sensor, z_s, R_s in zip(sensors, z, R, strict=True):
            m = z_s.shape[1]
            h, H = array("h(x)", sensor.h(x, now), m), array("H(x)", sensor.H(x, now), m, n)
            (x, P), innovation = _update(x.copy(), P.copy(), z_s[k], h, H, R_s[k % len(R_s)], k, now)
            out.whitened[k, column : column + m] = innovation.whitened
            column += m
        out.mean[k], out.cov[k] = x, P
    return out


def noise_at(Q: NoiseCovariance, t0: float, t1: float, n: int) -> np.ndarray:
    """The checked process noise (n, n) of the step from t0 to t1 [s]; a matrix is the same for all steps."""
    return covariance("Q", Q(t0, t1) if callable(Q) else Q, n)


def prepare(prior: Gaussian, t, sensors: Sequence[Sensor]):
    """Check what a run of a nonlinear filter is given.

    Returns the prior, t, the list of z (N, m), the list of R (N or 1, m, m), and a Trajectory to be filled.
    """
    prior, t = gaussian(*prior), epochs(t)
    N, n = len(t), len(prior.mean)
    z = [array(f"z of sensor {i}", sensor.z, N, None, missing=True) for i, sensor in enumerate(sensors)]
    R = [covariances(f"R of sensor {i}", sensor.R, N, z[i].shape[1]) for i, sensor in enumerate(sensors)]
    out = Trajectory(
        t=t,
        predicted_mean=np.empty((N, n)),
        predicted_cov=np.empty((N, n, n)),
        mean=np.empty((N, n)),
        cov=np.empty((N, n, n)),
        whitened=np.empty((N, sum(values.shape[1] for values in z))),
        transition=np.empty((N - 1, n, n)),
        process_noise=np.empty((N - 1, n, n)),
        step=np.arange(N - 1),
    )
    return prior, t, z, R, out


def _update(x, P, z, h, H, R, epoch: int | None = None, t: float | None = None) -> tuple[Gaussian, Innovation]:
    residual, S, whitened = z - h, H @ P @ H.T + R, np.full(len(z), np.nan)
    seen = np.flatnonzero(~np.isnan(z))
    if seen.size:
        S_seen, w_seen = np.empty((seen.size, seen.size)), np.empty(seen.size)
        status = update_step(x, P, residual[seen], H[seen], R[np.ix_(seen, seen)], S_seen, w_seen)
        if status != 0:
            detail = f"the pivot of observed component {status - 1} is not positive"
            raise NotPositiveDefinite("innovation covariance", epoch, t, detail)
        whitened[seen] = w_seen
    return Gaussian(x, P), Innovation(residual, 0.5 * (S + S.T), whitened)
