"""From one satellite's raw sensors to attitudes: combination, increments, filters. Nothing here has seen the truth.

mekf : state [q; b] with an error [delta; db] of six components, q_true = q Exp(delta), and its RTS smoother; with more
gyro noise it stands in for the official product (JPL-like). akf7 : the paper's, additive in the seven states.
Both are models and sensors for the core's `run`: what is observed is zero, and the sensor's function gives minus the
error between prediction and camera.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from geokalman.attitude import cameras, gyro
from geokalman.attitude.model import GYRO_HZ, Array, Telemetry, Tuning
from geokalman.kalman import smoothing
from geokalman.kalman.checks import NotPositiveDefinite
from geokalman.kalman.gaussian import Gaussian, Trajectory
from geokalman.kalman.linear import predict_step
from geokalman.kalman.model import DIFFERENCE, OBSERVE, PROPAGATE, RETRACT, Manifold, Model, Sensor, flat
from geokalman.kalman.run import run
from geokalman.physics.quaternion import difference_point, exp_point, multiply, multiply_point, retract_point

FILTERS = ("akf7", "mekf", "rts", "jpl_like")
LOST_RATE = 5e-6  # rad/s: how far the rate may wander while the gyros are silent; the pointing rates are 2 to 4e-6


class Observations(NamedTuple):
    """What a filter of one satellite sees, every dt [s].

    d : (n - 1, 3) gyro increments [rad], NaN where lost; z : (n, 4) combined quaternions, NaN where none; R : (n, 3, 3)
    [rad^2]; rate_cov [rad^2/s], bias_cov [(rad/s)^2/s] : (3, 3) densities of the gyro noise and of the bias walk.
    """

    dt: float
    d: Array
    z: Array
    R: Array
    rate_cov: Array
    bias_cov: Array


@dataclass(frozen=True)
class Estimate:
    """Attitudes q (n, 4), covariances cov (n, 3, 3) [rad^2] of their errors in SRF axes, gyro biases (n, 3) [rad/s].

    full : (n, 6, 6) covariances of attitude and bias of the multiplicative filter, None for the paper's. nis : (n,)
    normalised innovations squared, 3 degrees of freedom, NaN without an update; rejected : (n,) updates that the gate
    refused. Epochs before the first camera are NaN.
    """

    q: Array
    bias: Array
    cov: Array
    nis: Array
    rejected: Array
    full: Array | None = None

    def flagged(self, limit_rad: float) -> Array:
        """Epochs (n,) whose standard deviation about some axis exceeds the limit [rad], or that have no estimate."""
        sigma = np.sqrt(np.einsum("kii->ki", self.cov)).max(axis=1)
        return ~(sigma <= limit_rad)


@dataclass(frozen=True)
class Processed:
    """What the chain made of one satellite at the epochs t (n,) [s] of the filter.

    combined : cameras at those epochs; increments : at 8 Hz; rates (n, 3) : mean gyro rates over +-0.5 s there (1 Hz
    only), NaN where lost; measured : what the filters saw; solutions : filter -> Estimate; edge (n,) : epochs at an
    edge of the clock of the files (bad input 11), none where simulated.
    """

    t: Array
    combined: cameras.Combined
    increments: gyro.Increments
    rates: Array
    measured: Observations
    solutions: dict[str, Estimate]
    edge: Array

    def flagged(self, name: str, limit_rad: float) -> Array:
        """Epochs (n,) of a solution at an edge of the clock, or less certain than the limit [rad]."""
        return self.edge | self.solutions[name].flagged(limit_rad)


def solve(
    raw: Telemetry, t: Array, tuning: Tuning, filters: Iterable[str] = FILTERS, use: Sequence[int] = (1, 2, 3),
    calibrate: bool = False, edge: Sequence[float] = (),
) -> Processed:  # fmt: skip
    """The whole chain for one satellite between the first and the last of the seconds t.

    filters : of akf7, akf7_iso, mekf, rts, jpl_like; use : cameras; calibrate : their relative mounting; edge : seconds
    at an edge of the clock. With tuning.update_hz = 2 the epochs are every half second.
    """
    combined = cameras.combination(raw, tuning, use, calibrate)
    increments, tuning = gyro.sound_increments(raw, tuning, combined)
    hz, wanted = tuning.update_hz, set(filters)
    main = gyro.between(increments, t[0], t[-1])
    steps, combined = gyro.preintegrate(main, hz), cameras.at_seconds(combined, hz)
    inside = (combined.t > t[0] - 0.1) & (combined.t < t[-1] + 0.1)
    combined, epochs = cameras.Combined(*(part[inside] for part in combined)), steps.t
    if len(combined.t) != len(epochs):
        raise ValueError(
            f"{len(combined.t)} camera epochs and {len(epochs)} gyro epochs at {hz} Hz do not belong together."
        )
    covs = tuning.rate_covariance(raw.satellite), tuning.bias_covariance(raw.satellite)
    measured = Observations(1.0 / hz, steps.d, combined.q, combined.cov, *covs)
    at_8_hz, stride, found = measured._replace(d=main.d), GYRO_HZ // hz, {}
    if wanted & {"mekf", "rts"}:
        found["mekf"], found["rts"] = mekf(measured, tuning, tuning.apm_factor, smooth=True)
    if "jpl_like" in wanted:
        found["jpl_like"] = mekf(measured, tuning, tuning.kappa)
    if "akf7" in wanted:
        found["akf7"] = akf7(at_8_hz, tuning, tuning.apm_factor, stride)
    if "akf7_iso" in wanted:
        r = 0.5 * float(np.nanmean(np.sqrt(np.einsum("kii->ki", combined.cov))))
        found["akf7_iso"] = akf7(at_8_hz, tuning, tuning.apm_factor, stride, isotropic=r)
    seconds, mean_rates = gyro.mean_rates(increments)
    rates = np.full((len(epochs), 3), np.nan)
    _, mine, theirs = np.intersect1d(np.round(epochs * 8), np.round(seconds * 8), return_indices=True)
    rates[mine] = mean_rates[theirs]
    solutions = {name: solution for name, solution in found.items() if name in wanted}
    at_edge = np.isin(np.floor(epochs + 1e-6), np.round(edge))
    return Processed(epochs, combined, main, rates, measured, solutions, at_edge)


def mekf(
    data: Observations, tuning: Tuning, scale: float = 1.0, start: Array | None = None, smooth: bool = False,
    vector_part: bool = False,
):  # fmt: skip
    """Multiplicative filter on pre-integrated increments: q_true = q Exp(delta), error [delta; db], section 3.6.

    scale : factor on the gyro noise (kappa for the JPL-like stand-in); start : first attitude in the place of the first
    camera's; smooth : give the pair (forward, RTS); vector_part : the residual is twice the vector part of q* z instead
    of its rotation vector. tuning.gate : largest NIS admitted, 0 admits all.
    Returns an Estimate, or two. Raises ValueError without data, NotPositiveDefinite with the epoch.
    """
    first, (d, lost), h = _first(data), _filled(data), data.dt
    S, B = scale**2 * data.rate_cov, data.bias_cov
    Q = np.block([[S * h + B * h**3 / 3, -B * h**2 / 2], [-B * h**2 / 2, B * h]])
    model = Model(
        f=_turn, inputs=np.column_stack([d, lost])[first:], params=[h, (LOST_RATE * h) ** 2], Q=Q,
        manifold=Manifold(retract=_retract, difference=_difference, n=6),
    )  # fmt: skip
    P0 = np.diag(np.repeat([tuning.p0_attitude, tuning.p0_bias], 3))
    gate = tuning.gate or np.inf
    course = _run(data, first, start, P0, model, _camera, 3, float(vector_part), gate)

    def solution(mean: Array, cov: Array) -> Estimate:
        full = _padded(first, cov)
        return _solution(first, mean, full[:, :3, :3].copy(), course, gate, full)

    forward = solution(course.mean, course.cov)
    if not smooth:
        return forward
    smoothed = smoothing.smooth(course)
    return forward, solution(smoothed.mean, smoothed.cov)


def akf7(
    data: Observations, tuning: Tuning, scale: float = 1.0, stride: int = 1, isotropic: float = 0.0,
    start: Array | None = None,
) -> Estimate:  # fmt: skip
    """The paper's filter: seven states [q; b], transition (4), (5), (21), update (24) to (26), then q normalised.

    data.d holds `stride` increments, each of data.dt / stride seconds, per epoch of data.z (8 for 8 Hz prediction).
    R = Xi R_theta Xi' / 4 + 1e-14 I; isotropic > 0 : R = isotropic^2 I instead. The attitude covariance given is 4 Xi'
    P_qq Xi. Raises ValueError without data, NotPositiveDefinite with the epoch.
    """
    first, (d, lost), h = _first(data), _filled(data), data.dt / stride
    steps = len(data.z) - 1
    if len(d) != steps * stride:
        raise ValueError(
            f"{len(d)} increments do not belong to {steps + 1} epochs of {stride} increments each; "
            f"give {steps * stride}."
        )
    rate, walk = scale**2 * data.rate_cov * h, data.bias_cov * h
    model = Model(
        f=_turn_additive, inputs=np.column_stack([d.reshape(steps, -1), lost.reshape(steps, -1)])[first:],
        params=np.concatenate([[h, (LOST_RATE * h) ** 2], rate.ravel(), walk.ravel()]),
        manifold=Manifold(retract=_add_and_normalise, difference=flat().difference, n=7),
    )  # fmt: skip
    P0 = np.diag(np.repeat([0.25 * tuning.p0_attitude, tuning.p0_bias], [4, 3]))
    course = _run(data, first, start, P0, model, _camera_additive, 4, isotropic)
    Xi = np.stack([multiply(course.mean[:, :4], unit) for unit in np.eye(4)[1:]], axis=-1)
    cov = 4.0 * Xi.transpose(0, 2, 1) @ course.cov[:, :4, :4] @ Xi
    return _solution(first, course.mean, _padded(first, cov), course)


def _first(data: Observations) -> int:
    """The first epoch with a camera, at which the filters start."""
    seen = np.isfinite(data.z[:, 0])
    if not seen.any():
        raise ValueError("no epoch has a camera: the filter has nothing to start from.")
    return int(np.argmax(seen))


def _filled(data: Observations) -> tuple[Array, Array]:
    """Increments with the last sound one in the place of lost ones, and which were lost."""
    d = np.asarray(data.d, dtype=float)
    lost = np.isnan(d).any(axis=1)
    if lost.all():
        raise ValueError("no gyro increment is there at all: the filter cannot predict.")
    last = np.maximum.accumulate(np.where(lost, -1, np.arange(len(d))))
    last[last < 0] = np.argmax(~lost)
    return d[last], lost


def _run(
    data: Observations, first: int, start: Array | None, P0: Array, model: Model, observe, m: int, param: float,
    gate: float = np.inf,
) -> Trajectory:  # fmt: skip
    """The core's filter from epoch `first` on; observe finds the quaternion and R (9 numbers) in its inputs."""
    z = data.z[first:]
    inputs = np.column_stack([z, data.R[first:].reshape(-1, 9)])
    inputs[np.isnan(z[:, 0])] = 0.0
    zero = np.where(np.isnan(z[:, :1]), np.nan, np.zeros(m))
    if start is None:  # the first camera is the start and tells nothing more
        start, zero[0] = z[0], np.nan
    sensor = Sensor(zero, np.eye(m), h=observe, inputs=inputs, params=[param])
    prior = Gaussian(np.append(start, np.zeros(3)), P0)
    try:
        return run(prior, data.dt * np.arange(first, len(data.z)), model, [sensor], gate=gate)
    except NotPositiveDefinite as error:
        epoch = None if error.epoch is None else first + error.epoch
        raise NotPositiveDefinite(error.matrix, epoch, error.t) from None


def _padded(first: int, values: Array) -> Array:
    """The values of the epochs from `first` on, NaN before."""
    return np.concatenate([np.full((first, *values.shape[1:]), np.nan), values])


def _solution(
    first: int, mean: Array, cov: Array, course: Trajectory, gate: float = np.inf, full: Array | None = None
) -> Estimate:
    nis = _padded(first, (course.whitened**2).sum(axis=1))
    q, bias = _padded(first, mean[:, :4]), _padded(first, mean[:, 4:])
    return Estimate(q, bias, cov, nis, nis > gate, full)


@njit(RETRACT, cache=True)
def _retract(x, d, x_out):
    """q Exp(delta), b + db."""
    retract_point(x[:4], d[:3], np.empty(4), x_out[:4])
    for i in range(3):
        x_out[4 + i] = x[4 + i] + d[3 + i]


@njit(DIFFERENCE, cache=True)
def _difference(x, y, d):
    """Log(q_x* q_y), b_y - b_x."""
    difference_point(x[:4], y[:4], np.empty(4), d[:3])
    for i in range(3):
        d[3 + i] = y[4 + i] - x[4 + i]


@njit(PROPAGATE, cache=True)
def _turn(t0, t1, x, u, p, x_out, F, Q):
    """Turn by v = u - b h.  F = [R(Exp v)', -J h; 0, I], J = I - [v x] / 2, the rotation by Rodrigues' formula.

    u : increment [rad], and 1 where it was lost; p : h [s], variance of a lost increment [rad^2].
    """
    h, v = p[0], np.empty(3)
    for i in range(3):
        v[i] = u[i] - x[4 + i] * h
        x_out[4 + i] = x[4 + i]
        Q[i, i] += p[1] * u[3]
    retract_point(x[:4], v, np.empty(4), x_out[:4])
    angle = np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    s = 1.0 - angle**2 / 6.0 if angle < 1e-4 else np.sin(angle) / angle
    c = 0.5 - angle**2 / 24.0 if angle < 1e-4 else (1.0 - np.cos(angle)) / angle**2
    F[:] = 0.0
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        F[i, i] = 1.0 - c * (v[j] * v[j] + v[k] * v[k])
        F[i, j] = c * v[i] * v[j] + s * v[k]
        F[i, k] = c * v[i] * v[k] - s * v[j]
        F[i, 3 + i] = -h
        F[i, 3 + j] = -0.5 * h * v[k]
        F[i, 3 + k] = 0.5 * h * v[j]
        F[3 + i, 3 + i] = 1.0
    return 0


@njit(OBSERVE, cache=True)
def _camera(t, x, u, p, h, H, R):
    """Minus the rotation vector from the state to the camera; p[0] != 0: minus twice the vector part of q* z."""
    apart = np.empty(4)
    difference_point(x[:4], u[:4], apart, h)
    for i in range(3):
        h[i] = -h[i] if p[0] == 0.0 else -2.0 * np.copysign(1.0, apart[0]) * apart[1 + i]
        for j in range(6):
            H[i, j] = 1.0 if i == j else 0.0
        for j in range(3):
            R[i, j] = u[4 + 3 * i + j]
    return 0


@njit(RETRACT, cache=True)
def _add_and_normalise(x, d, x_out):
    """x + d, then q normalised."""
    for i in range(7):
        x_out[i] = x[i] + d[i]
    norm = np.sqrt(x_out[0] ** 2 + x_out[1] ** 2 + x_out[2] ** 2 + x_out[3] ** 2)
    for i in range(4):
        x_out[i] /= norm


@njit(cache=True)
def _xi(q, X):
    """Xi(q) (4, 3): q (0, v) = Xi v. Equation (18)."""
    X[0, 0], X[0, 1], X[0, 2] = -q[1], -q[2], -q[3]
    X[1, 0], X[1, 1], X[1, 2] = q[0], -q[3], q[2]
    X[2, 0], X[2, 1], X[2, 2] = q[3], q[0], -q[1]
    X[3, 0], X[3, 1], X[3, 2] = -q[2], q[1], q[0]


@njit(cache=True)
def _congruence(M, N, factor, out):
    """out = factor M N M' in the upper left block (4, 4); M (4, 3), N (3, 3)."""
    for i in range(4):
        x = M[i, 0] * N[0, 0] + M[i, 1] * N[1, 0] + M[i, 2] * N[2, 0]
        y = M[i, 0] * N[0, 1] + M[i, 1] * N[1, 1] + M[i, 2] * N[2, 1]
        z = M[i, 0] * N[0, 2] + M[i, 1] * N[1, 2] + M[i, 2] * N[2, 2]
        for j in range(4):
            out[i, j] = factor * (x * M[j, 0] + y * M[j, 1] + z * M[j, 2])


@njit(PROPAGATE, cache=True)
def _turn_additive(t0, t1, x, u, p, x_out, F, Q):
    """Turn by every increment in u; F and Q are those of all of them together, F_2 F_1 and F_2 Q_1 F_2' + Q_2.

    u : increments [rad] one after the other, then for each 1 where it was lost; p : h [s], variance of a lost increment
    [rad^2], covariance of an increment [rad^2] and of the walk of the bias in h (9 numbers each).
    """
    h, count = p[0], u.size // 4
    rate, walk = p[2:11].reshape((3, 3)), p[11:20].reshape((3, 3))
    v, e, turned, zero, spare = np.empty(3), np.empty(4), np.empty(4), np.zeros(7), np.empty(7)
    X, M, N = np.empty((4, 3)), np.empty((4, 3)), np.empty((3, 3))
    F_s, Q_s, rest = np.zeros((7, 7)), np.zeros((7, 7)), np.empty((7, 7))
    for i in range(3):
        F_s[4 + i, 4 + i] = 1.0
        for j in range(3):
            Q_s[4 + i, 4 + j] = walk[i, j]
    x_out[:] = x
    for s in range(count):
        for i in range(3):
            v[i] = u[3 * s + i] - x[4 + i] * h
            for j in range(3):
                N[i, j] = rate[i, j]
            N[i, i] += p[1] * u[3 * count + s]
        exp_point(v, e)
        F_s[0, 0], F_s[0, 1], F_s[0, 2], F_s[0, 3] = e[0], -e[1], -e[2], -e[3]  # Phi: q e = Phi q, equation (5)
        F_s[1, 0], F_s[1, 1], F_s[1, 2], F_s[1, 3] = e[1], e[0], e[3], -e[2]
        F_s[2, 0], F_s[2, 1], F_s[2, 2], F_s[2, 3] = e[2], -e[3], e[0], e[1]
        F_s[3, 0], F_s[3, 1], F_s[3, 2], F_s[3, 3] = e[3], e[2], -e[1], e[0]
        _xi(x_out[:4], X)
        for i in range(4):
            for j in range(3):
                M[i, j] = 0.0
                for a in range(4):
                    M[i, j] += 0.5 * F_s[i, a] * X[a, j]
                F_s[i, 4 + j] = -h * M[i, j]
        _congruence(M, N, 1.0, Q_s)
        multiply_point(x_out[:4], e, turned)  # the mean goes by (16), not by its linearisation
        x_out[:4] = turned
        if s == 0:
            F[:] = F_s
            Q[:] = Q_s
            continue
        predict_step(zero, Q, F_s, Q_s, spare, rest)
        Q[:] = rest
        rest[:] = F
        for i in range(4):
            for j in range(7):
                F[i, j] = F_s[i, j] if j > 3 else 0.0
                for a in range(4):
                    F[i, j] += F_s[i, a] * rest[a, j]
    return 0


@njit(OBSERVE, cache=True)
def _camera_additive(t, x, u, p, h, H, R):
    """Minus the difference of the camera's quaternion, of either sign, to the state; p[0] > 0: isotropic."""
    sign = 1.0 if u[0] * x[0] + u[1] * x[1] + u[2] * x[2] + u[3] * x[3] >= 0.0 else -1.0
    X = np.empty((4, 3))
    _xi(x[:4], X)
    _congruence(X, u[4:13].reshape((3, 3)), 0.25 if p[0] <= 0.0 else 0.0, R)
    for i in range(4):
        h[i] = x[i] - sign * u[i]
        R[i, i] += 1e-14 if p[0] <= 0.0 else p[0] ** 2
        for j in range(7):
            H[i, j] = 1.0 if i == j else 0.0
    return 0
