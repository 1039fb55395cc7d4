"""Time per epoch of the estimator core: 9 states and 4 observations, three positions, then a range-rate.

`python tests/benchmarks/bench_kalman.py [--json FILE]` prints the smallest of several runs in microseconds per epoch,
the limits and the load of the machine; the file gets {name: microseconds per epoch}. `run_linear` observes all four by
a matrix; the others observe the range-rate by a function, compiled or (`_python`) of Python. filterpy, statsmodels and
dynamax are timed in the same run where they are installed. Nothing here asserts on time.
"""

from __future__ import annotations

import argparse
import json
import warnings
from pathlib import Path

import numpy as np
from numba import njit
from stopwatch import smallest, told, told_machine

from geokalman.kalman import Gaussian, Model, Sensor, gaussian, run, smooth, white_jerk
from geokalman.kalman.model import OBSERVE

EPOCHS, STEP = 5000, 30.0
SIGMA_R, SIGMA_RATE = 1e-3, 3e-4
LIMITS = {
    "run_linear": 1.5, "run_ekf": 1.5, "run_ukf": 3.5, "run_linear + smooth": 4.5, "run_ekf_python": 40.0,
    "run_ukf_python": 150.0,
}  # fmt: skip


@njit(OBSERVE, cache=True)
def range_rate(t, x, u, p, h, H, R):
    rho = np.sqrt(x[0] ** 2 + x[1] ** 2 + x[2] ** 2)
    h[0] = (x[0] * x[3] + x[1] * x[4] + x[2] * x[5]) / rho
    if H.size:
        for j in range(9):
            H[0, j] = 0.0
        for j in range(3):
            H[0, 3 + j] = x[j] / rho
            H[0, j] = (x[3 + j] - h[0] * H[0, 3 + j]) / rho
    return 0


def h(x, t):
    r, v = x[:3], x[3:6]
    return np.array([r @ v / np.sqrt(r @ r)])


def H(x, t):
    r, v = x[:3], x[3:6]
    rho = np.sqrt(r @ r)
    out = np.zeros((1, 9))
    out[0, :3], out[0, 3:6] = v / rho - (r @ v / rho**3) * r, r / rho
    return out


def motion() -> tuple[np.ndarray, np.ndarray, Gaussian]:
    """Relative motion of a satellite pair: epochs, observations (N, 4) and the prior."""
    rng, t, w = np.random.default_rng(1), STEP * np.arange(EPOCHS), 1.1e-3
    circle = np.column_stack([np.cos(w * t), np.sin(w * t), 0.05 * np.sin(w * t)])
    tangent = np.column_stack([-np.sin(w * t), np.cos(w * t), 0.05 * np.cos(w * t)])
    r, v, a = 2.2e5 * circle, 2.2e5 * w * tangent, -2.2e5 * w**2 * circle
    rate = (r * v).sum(1) / np.linalg.norm(r, axis=1)
    z = np.column_stack([r, rate]) + rng.standard_normal((EPOCHS, 4)) * [SIGMA_R, SIGMA_R, SIGMA_R, SIGMA_RATE]
    return t, z, gaussian(np.r_[r[0], v[0], a[0]], np.repeat([1e-4, 1e-6, 1e-8], 3))


def measure() -> dict[str, float]:
    """Microseconds per epoch, ours and the peers'."""
    t, z, prior = motion()
    Phi, Q = white_jerk(STEP, 1e-4)
    R = np.diag([SIGMA_R**2, SIGMA_R**2, SIGMA_R**2, SIGMA_RATE**2])
    rows = np.zeros((EPOCHS, 4, 9))
    rows[:, :3, :3] = np.eye(3)
    rows[:, 3, 3:6] = z[:, :3] / np.linalg.norm(z[:, :3], axis=1)[:, None]
    model, whole, few = Model(F=Phi, Q=Q), slice(0, EPOCHS), slice(0, 500)

    def each(kind: str, sensor: Sensor | None, part: slice = whole) -> float:
        sensors = [Sensor(z[part], R, H=rows[part])]
        if sensor is not None:
            sensors = [Sensor(z[part, :3], R[:3, :3], H=np.eye(3, 9)), sensor]
        epochs = part.stop
        return 1e6 * smallest(lambda: run(prior, t[part], model, sensors, kind), 7) / epochs

    compiled, python = Sensor(z[:, 3:], R[3:, 3:], h=range_rate), Sensor(z[few, 3:], R[3:, 3:], h, H)
    course = run(prior, t, model, [Sensor(z, R, H=rows)])
    return {
        "run_linear": each("extended", None),
        "run_ekf": each("extended", compiled),
        "run_ukf": each("unscented", compiled),
        "run_ekf_python": each("extended", python, few),
        "run_ukf_python": each("unscented", python, few),
        "smooth": 1e6 * smallest(lambda: smooth(course), 7) / EPOCHS,
        **peers(z, rows, R, Phi, Q, prior),
    }


def peers(z, H, R, Phi, Q, prior) -> dict[str, float]:
    """The linear problem in other packages, where they are installed."""
    found = {}
    warnings.simplefilter("ignore")
    for name, peer in (("filterpy", filterpy), ("statsmodels", statsmodels), ("dynamax", dynamax)):
        try:
            found[name] = peer(z, H, R, Phi, Q, prior)
        except ImportError:
            print(f"{name} is not installed")
    return found


def filterpy(z, H, R, Phi, Q, prior) -> float:
    from filterpy.kalman import KalmanFilter

    few = 500

    def work():
        peer = KalmanFilter(dim_x=9, dim_z=4)
        peer.x, peer.P, peer.F, peer.Q, peer.R = prior.mean.copy(), prior.cov.copy(), Phi, Q, R
        for k in range(few):
            peer.predict()
            peer.update(z[k], H=H[k])

    return 1e6 * smallest(work, 5) / few


def statsmodels(z, H, R, Phi, Q, prior) -> float:
    from statsmodels.tsa.statespace.kalman_filter import KalmanFilter

    peer = KalmanFilter(k_endog=4, k_states=9, k_posdef=9)
    peer.bind(z.copy())
    peer["design"], peer["obs_cov"], peer["selection"] = np.ascontiguousarray(H.transpose(1, 2, 0)), R, np.eye(9)
    peer["transition"], peer["state_cov"] = Phi, Q
    peer.initialize_known(prior.mean, prior.cov)
    return 1e6 * smallest(peer.filter, 5) / len(z)


def dynamax(z, H, R, Phi, Q, prior) -> float:
    import jax
    from dynamax.linear_gaussian_ssm import LinearGaussianSSM, lgssm_filter

    jax.config.update("jax_enable_x64", True)
    model = LinearGaussianSSM(state_dim=9, emission_dim=4)
    params, _ = model.initialize(
        jax.random.PRNGKey(0), initial_mean=prior.mean, initial_covariance=prior.cov, dynamics_weights=Phi,
        dynamics_covariance=Q, emission_weights=H, emission_covariance=R,
    )  # fmt: skip
    work = jax.jit(lgssm_filter)
    return 1e6 * smallest(lambda: jax.block_until_ready(work(params, z)), 5) / len(z)


def main() -> None:
    """Print the table, and write the file that was asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, metavar="FILE", help="write {name: microseconds per epoch} there")
    file = parser.parse_args().json
    values = measure()
    for name, value in {**values, "run_linear + smooth": values["run_linear"] + values["smooth"]}.items():
        told(name, value, "us/epoch", LIMITS.get(name))
    told_machine()
    if file is not None:
        file.write_text(json.dumps(values, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
