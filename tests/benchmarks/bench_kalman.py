"""Time per epoch of the estimator core: 9 states, 4 observations (3 positions, then a range-rate), compiled loops.

`python tests/benchmarks/bench_kalman.py` prints minima of several runs and the load of the machine; filterpy and
statsmodels are timed in the same run where they are installed. Nothing here asserts on time.
"""

from __future__ import annotations

import os
import warnings

import numpy as np
from numba import njit
from stopwatch import smallest

from geokalman.kalman.discretise import white_jerk
from geokalman.kalman.gaussian import gaussian
from geokalman.kalman.linear import filter_linear, predict_step, scalar_update_step
from geokalman.kalman.smoothing import rts_mean_step, rts_step, smooth
from geokalman.kalman.unscented import sigma_points_step, spread, unscented_update_step

EPOCHS, STEP = 5000, 30.0
SIGMA_R, SIGMA_RATE = 1e-3, 3e-4


@njit
def range_rate(x):
    return (x[0] * x[3] + x[1] * x[4] + x[2] * x[5]) / np.sqrt(x[0] ** 2 + x[1] ** 2 + x[2] ** 2)


@njit
def extended_loop(z, Phi, Q, r, r_rate, xp, Pp, xf, Pf, whitened):
    H, row = np.eye(9), np.zeros(9)
    for k in range(z.shape[0]):
        if k > 0:
            predict_step(xf[k - 1], Pf[k - 1], Phi, Q, xp[k], Pp[k])
        xf[k] = xp[k]
        Pf[k] = Pp[k]
        x, P = xf[k], Pf[k]
        for j in range(3):
            residual = z[k, j] - x[j]
            whitened[k, j] = residual / np.sqrt(scalar_update_step(x, P, residual, H[j], r))
        rho = np.sqrt(x[0] ** 2 + x[1] ** 2 + x[2] ** 2)
        rate = range_rate(x)
        for j in range(3):
            row[3 + j] = x[j] / rho
            row[j] = (x[3 + j] - rate * row[3 + j]) / rho
        residual = z[k, 3] - rate
        whitened[k, 3] = residual / np.sqrt(scalar_update_step(x, P, residual, row, r_rate))


@njit
def unscented_loop(z, Phi, Q, r, r_rate, c, w, xp, Pp, xf, Pf, whitened):
    H, R, S = np.eye(9), np.full((1, 1), r_rate), np.empty((1, 1))
    chi, U, gamma = np.empty((19, 9)), np.empty((9, 9)), np.empty((19, 1))
    for k in range(z.shape[0]):
        if k > 0:
            predict_step(xf[k - 1], Pf[k - 1], Phi, Q, xp[k], Pp[k])
        xf[k] = xp[k]
        Pf[k] = Pp[k]
        x, P = xf[k], Pf[k]
        for j in range(3):
            residual = z[k, j] - x[j]
            whitened[k, j] = residual / np.sqrt(scalar_update_step(x, P, residual, H[j], r))
        sigma_points_step(x, P, c, chi, U)
        for i in range(19):
            gamma[i, 0] = range_rate(chi[i])
        unscented_update_step(x, P, U, gamma, z[k, 3:], R, c, w, S, whitened[k, 3:])


@njit
def smoother_loop(xp, Pp, xf, Pf, Phi, Q, xs, Ps, mean_only):
    last = xp.shape[0] - 1
    xs[last] = xf[last]
    Ps[last] = Pf[last]
    for k in range(last - 1, -1, -1):
        if mean_only:
            rts_mean_step(xf[k], Pf[k], xp[k + 1], Pp[k + 1], Phi, xs[k + 1], xs[k])
        else:
            rts_step(xf[k], Pf[k], xp[k + 1], Pp[k + 1], Phi, Q, xs[k + 1], Ps[k + 1], xs[k], Ps[k])


def best(function, epochs=EPOCHS, repeats=15):
    """Smallest time of `repeats` calls after a first one, in microseconds per epoch."""
    return 1e6 * smallest(function, repeats) / epochs


def motion():
    """Relative motion of a satellite pair: observations (N, 4) and the prior."""
    rng, t, w = np.random.default_rng(1), STEP * np.arange(EPOCHS), 1.1e-3
    circle = np.column_stack([np.cos(w * t), np.sin(w * t), 0.05 * np.sin(w * t)])
    tangent = np.column_stack([-np.sin(w * t), np.cos(w * t), 0.05 * np.cos(w * t)])
    r, v, a = 2.2e5 * circle, 2.2e5 * w * tangent, -2.2e5 * w**2 * circle
    rate = (r * v).sum(1) / np.linalg.norm(r, axis=1)
    z = np.column_stack([r, rate]) + rng.standard_normal((EPOCHS, 4)) * [SIGMA_R, SIGMA_R, SIGMA_R, SIGMA_RATE]
    return t, z, gaussian(np.r_[r[0], v[0], a[0]], np.repeat([1e-4, 1e-6, 1e-8], 3))


def measure() -> dict[str, float]:
    """Microseconds per epoch of each stage, ours and the peers'."""
    t, z, prior = motion()
    Phi, Q = white_jerk(STEP, 1e-4)
    arrays = [np.empty((EPOCHS, 9)), np.empty((EPOCHS, 9, 9)), np.empty((EPOCHS, 9)), np.empty((EPOCHS, 9, 9))]
    whitened, xs, Ps = np.empty((EPOCHS, 4)), np.empty((EPOCHS, 9)), np.empty((EPOCHS, 9, 9))
    arrays[0][0], arrays[1][0] = prior
    r, r_rate = SIGMA_R**2, SIGMA_RATE**2
    c, w = spread(9, 1.0, 0.0, 2.0)
    H = np.zeros((EPOCHS, 4, 9))
    H[:, :3, :3] = np.eye(3)
    H[:, 3, 3:6] = z[:, :3] / np.linalg.norm(z[:, :3], axis=1)[:, None]
    R = np.diag([r, r, r, r_rate])
    run = filter_linear(prior, t, z, H, R, (Phi, Q))
    result = {
        "filter step, compiled loop": best(lambda: extended_loop(z, Phi, Q, r, r_rate, *arrays, whitened)),
        "UKF step, compiled loop": best(lambda: unscented_loop(z, Phi, Q, r, r_rate, c, w, *arrays, whitened)),
        "RTS step, mean only": best(lambda: smoother_loop(*arrays, Phi, Q, xs, Ps, True)),
        "RTS step, with covariance": best(lambda: smoother_loop(*arrays, Phi, Q, xs, Ps, False)),
        "filter_linear, sequential": best(lambda: filter_linear(prior, t, z, H, R, (Phi, Q)), repeats=5),
        "filter_linear, joint": best(lambda: filter_linear(prior, t, z, H, R, (Phi, Q), sequential=False), repeats=5),
        "smooth": best(lambda: smooth(run)),
    }
    result.update(peers(z, H, R, Phi, Q, prior))
    return result


def peers(z, H, R, Phi, Q, prior) -> dict[str, float]:
    """The same linear problem in filterpy and statsmodels."""
    result = {}
    warnings.simplefilter("ignore")
    try:
        from filterpy.kalman import KalmanFilter
    except ImportError:
        pass
    else:
        few = 500

        def filterpy():
            peer = KalmanFilter(dim_x=9, dim_z=4)
            peer.x, peer.P, peer.F, peer.Q, peer.R = prior.mean.copy(), prior.cov.copy(), Phi, Q, R
            for k in range(few):
                peer.predict()
                peer.update(z[k], H=H[k])

        result["filterpy KalmanFilter"] = best(filterpy, few, 5)
    try:
        from statsmodels.tsa.statespace.kalman_smoother import KalmanSmoother
    except ImportError:
        pass
    else:
        peer = KalmanSmoother(k_endog=4, k_states=9, k_posdef=9)
        peer.bind(z.copy())
        peer["design"], peer["obs_cov"], peer["selection"] = np.ascontiguousarray(H.transpose(1, 2, 0)), R, np.eye(9)
        peer["transition"], peer["state_cov"] = Phi, Q
        peer.initialize_known(prior.mean, prior.cov)
        result["statsmodels filter"] = best(peer.filter, repeats=5)
        result["statsmodels filter + smoother"] = best(peer.smooth, repeats=5)
    return result


def main() -> None:
    """Print the table."""
    before = os.getloadavg()[0]
    for name, value in measure().items():
        print(f"{name:32s} {value:8.2f} us/epoch")
    print(f"load of the machine {before:.1f} before, {os.getloadavg()[0]:.1f} after, {os.cpu_count()} CPUs")


if __name__ == "__main__":
    main()
