"""A linear problem with gaps and irregular steps, and its exact posterior by dense least squares in 60 digits."""

from __future__ import annotations

import sys
from decimal import Decimal, localcontext

import numpy as np
import pytest

from geokalman.kalman import Model, Sensor, adaptive, gaussian, loop, run, smoothing, white_jerk


def _decimal(array) -> np.ndarray:
    return np.vectorize(lambda v: Decimal(float(v)), otypes=[object])(np.asarray(array, dtype=float))


def _solve(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    """Gauss-Jordan without pivoting, for positive definite A (object arrays of Decimal)."""
    A, B = A.copy(), B.copy()
    for k in range(len(A)):
        pivot = A[k, k]
        A[k], B[k] = A[k] / pivot, B[k] / pivot
        for i in range(len(A)):
            if i != k and A[i, k] != 0:
                factor = A[i, k]
                A[i], B[i] = A[i] - factor * A[k], B[i] - factor * B[k]
    return B


def _inverse(A: np.ndarray) -> np.ndarray:
    return _solve(A, _decimal(np.eye(len(A))))


def dense_posterior(z, H, R, Phi, Q, prior=None, digits=60):
    """Mean (N, n) and covariance (N, n, n) of all states given all observations, from the joint normal equations.

    z : (N, m) with NaN; H, R, Phi (N - 1, n, n), Q : per epoch; prior : Gaussian at epoch 0 or None (diffuse).
    """
    N, n = len(z), H.shape[-1]
    with localcontext() as context:
        context.prec = digits
        normal, right = _decimal(np.zeros((N * n, N * n))), _decimal(np.zeros((N * n, 1)))
        at = [slice(k * n, (k + 1) * n) for k in range(N)]
        if prior is not None:
            weight = _inverse(_decimal(prior.cov))
            normal[at[0], at[0]] += weight
            right[at[0]] += weight @ _decimal(prior.mean)[:, None]
        for k in range(N):
            seen = np.flatnonzero(~np.isnan(z[k]))
            if seen.size:
                design = _decimal(H[k][seen])
                weight = _inverse(_decimal(R[k][np.ix_(seen, seen)]))
                normal[at[k], at[k]] += design.T @ weight @ design
                right[at[k]] += design.T @ weight @ _decimal(z[k][seen])[:, None]
            if k + 1 < N:
                weight, phi = _inverse(_decimal(Q[k])), _decimal(Phi[k])
                normal[at[k], at[k]] += phi.T @ weight @ phi
                normal[at[k], at[k + 1]] -= phi.T @ weight
                normal[at[k + 1], at[k]] -= weight @ phi
                normal[at[k + 1], at[k + 1]] += weight
        inverse = _inverse(normal)
        mean = (inverse @ right)[:, 0]
        return (
            mean.astype(float).reshape(N, n),
            np.array([inverse[at[k], at[k]].astype(float) for k in range(N)]),
        )


def linear_run(prior, t, z, H, R, transition, sequential=True):
    """The linear filter of one sensor; transition : (Phi, Q), or a function of the step."""
    Phi, Q = (transition, None) if callable(transition) else transition
    return run(prior, t, Model(F=Phi, Q=Q), [Sensor(z, R, H=H, sequential=sequential)])


class Problem:
    """Three-axis kinematic motion with full-matrix, time-varying H and R, gaps, and irregular steps."""

    def __init__(self, epochs: int = 9, axes: int = 2, seed: int = 11) -> None:
        rng = np.random.default_rng(seed)
        self.t = np.cumsum(rng.uniform(5.0, 40.0, epochs))
        n, m = 3 * axes, 4
        self.q = 1e-8
        self.transition = lambda h: white_jerk(h, self.q, axes)
        steps = [self.transition(h) for h in np.diff(self.t)]
        self.Phi, self.Q = np.array([s[0] for s in steps]), np.array([s[1] for s in steps])
        P0 = np.diag(np.repeat([4.0, 1e-2, 1e-5], axes)) + 1e-6 * np.ones((n, n))
        mean = np.repeat([50.0, 1.0, 1e-3], axes) * rng.standard_normal(n)
        self.prior = gaussian(mean, P0)
        self.H = rng.standard_normal((epochs, m, n)) * np.repeat([1.0, 10.0, 100.0], axes)
        self.H[:, 0] = np.eye(n)[0]
        root = rng.standard_normal((epochs, m, m)) * np.array([0.1, 0.2, 0.5, 1.0])[:, None]
        self.R = root @ root.transpose(0, 2, 1) + 1e-3 * np.eye(m)
        x = mean + np.linalg.cholesky(P0) @ rng.standard_normal(n)
        self.truth, z = [], []
        for k in range(epochs):
            if k:
                x = self.Phi[k - 1] @ x + np.linalg.cholesky(self.Q[k - 1]) @ rng.standard_normal(n)
            self.truth.append(x)
            z.append(self.H[k] @ x + np.linalg.cholesky(self.R[k]) @ rng.standard_normal(m))
        self.truth, self.z = np.array(self.truth), np.array(z)
        self.z[2] = np.nan
        self.z[4, [0, 2]] = np.nan
        self.z[5, 3] = np.nan
        self.z[0, 1] = np.nan

    def filter(self, sequential=True, z=None, R=None, transition=None):
        """The linear filter of the problem, with what is given instead of its own."""
        z, R, transition = self.z if z is None else z, self.R if R is None else R, transition or self.transition
        return linear_run(self.prior, self.t, z, self.H, R, transition, sequential)

    def exact(self, prior="own"):
        return dense_posterior(
            self.z, self.H, self.R, self.Phi, self.Q, self.prior if isinstance(prior, str) else prior
        )


@pytest.fixture(scope="session")
def problem() -> Problem:
    return Problem()


@pytest.fixture(scope="session")
def exact(problem):
    return problem.exact()


@pytest.fixture(scope="session")
def filter_linear():
    """The function `linear_run`."""
    return linear_run


@pytest.fixture
def interpreted(monkeypatch):
    """Let a run and its kernels be plain Python: the same text, not compiled."""
    for name, module in list(sys.modules.items()):
        if name.startswith("geokalman.kalman."):
            for key, value in list(vars(module).items()):
                if hasattr(value, "py_func"):
                    monkeypatch.setattr(module, key, value.py_func)
    plain = loop._no_propagation, loop._no_observation
    monkeypatch.setattr(sys.modules["geokalman.kalman.run"], "stand_ins", lambda: plain)
    monkeypatch.setattr(sys.modules["geokalman.kalman.run"], "compiled", None)  # whoever calls it is told
    monkeypatch.setattr(sys.modules["geokalman.kalman.run"], "judging_step", lambda hook: adaptive.adapt_step)
    monkeypatch.setattr(smoothing, "compiled_error_rts_loop", lambda: smoothing.error_rts_loop)


@pytest.fixture(scope="session")
def posterior():
    """The function `dense_posterior`."""
    return dense_posterior


@pytest.fixture(scope="session")
def close():
    """Assert that Gaussians agree: means within `rel` standard deviations, covariances within `rel` of the
    variances."""

    def check(mean, cov, mean_ref, cov_ref, rel):
        sigma = np.sqrt(np.diagonal(cov_ref, axis1=-2, axis2=-1))
        assert np.abs((mean - mean_ref) / sigma).max() < rel
        assert np.abs((cov - cov_ref) / (sigma[..., :, None] * sigma[..., None, :])).max() < rel

    return check
