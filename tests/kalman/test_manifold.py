"""Filtering on a manifold: on a vector space it is the linear filter and RTS; on rotations it is the error-state filter
written out here, and honest."""

from __future__ import annotations

import numpy as np
import pytest
from numba import njit
from scipy.spatial.transform import Rotation

from geokalman.kalman import Manifold, Model, NotPositiveDefinite, Sensor, gaussian, run, smooth
from geokalman.kalman.model import DIFFERENCE, OBSERVE, PROPAGATE, RETRACT

VECTORS = Manifold(retract=lambda x, d: x + d, difference=lambda x, y: y - x, n=2)


def turned(x, d):
    return (Rotation.from_quat(x) * Rotation.from_rotvec(d)).as_quat()


def between(x, y):
    return (Rotation.from_quat(x).inv() * Rotation.from_quat(y)).as_rotvec()


ROTATIONS = Manifold(retract=turned, difference=between, n=3)


def error_state_filter(x, P, propagate, observe, epochs):
    """Lefferts, Markley & Shuster (1982) in numpy: what is predicted, filtered and smoothed, as lists of (state, cov).

    propagate(k, x) -> (x_next, A, Q) and observe(k, x) -> (residual, H, R), or None in a gap.
    """
    predicted, filtered, steps, whitened = [], [], [], []
    for k in range(epochs):
        if k:
            x, A, Q = propagate(k - 1, x)
            P = A @ P @ A.T + Q
            steps.append(A)
        predicted.append((x, P))
        if (seen := observe(k, x)) is not None:
            residual, H, R = seen
            S = H @ P @ H.T + R
            K = P @ H.T @ np.linalg.inv(S)
            x, P = turned(x, K @ residual), P - K @ S @ K.T
            whitened.append(np.linalg.solve(np.linalg.cholesky(S), residual))
        else:
            whitened.append(np.full(3, np.nan))
        filtered.append((x, P))
    smoothed = filtered[-1:]
    for k in range(epochs - 2, -1, -1):
        (x, P), (x_next, P_next), (y, P_later) = filtered[k], predicted[k + 1], smoothed[0]
        C = P @ steps[k].T @ np.linalg.inv(P_next)
        smoothed.insert(0, (turned(x, C @ between(x_next, y)), P + C @ (P_later - P_next) @ C.T))
    return predicted, filtered, smoothed, np.array(whitened)


def test_on_a_vector_space_it_is_the_linear_filter_and_smoother(filter_linear):
    rng = np.random.default_rng(3)
    Phi, Q = np.array([[1.0, 1.0], [0.0, 1.0]]), np.diag([0.01, 0.1])
    H, R = np.array([[1.0, 0.0]]), np.array([[0.5]])
    z = rng.standard_normal((30, 1))
    z[[4, 11, 12]] = np.nan
    prior, t = (np.array([0.3, -0.2]), np.array([[2.0, 0.1], [0.1, 1.0]])), np.arange(30.0)
    model = Model(f=lambda x, t0, t1: Phi @ x, F=lambda x, t0, t1: Phi, Q=Q, manifold=VECTORS)
    linear = filter_linear(prior, t, z, H, R, (Phi, Q))
    for sensor in (Sensor(z, R, h=lambda x, t: H @ x, H=lambda x, t: H), Sensor(z, R, H=H)):
        course = run(prior, t, model, [sensor])
        for name in ("predicted_mean", "predicted_cov", "mean", "cov", "whitened"):
            np.testing.assert_allclose(getattr(course, name), getattr(linear, name), atol=1e-12)
        one, other = smooth(course), smooth(linear)
        np.testing.assert_allclose(one.mean, other.mean, atol=1e-11)
        np.testing.assert_allclose(one.cov, other.cov, atol=1e-11)
        assert smooth(course, covariances=False).cov is None


@pytest.mark.parametrize("start_deg", [0.0, 100.0])
def test_rotations_are_estimated_as_written_out_and_honestly(start_deg):
    """A turning body seen with noise and gaps: normalised errors average one per degree of freedom."""
    rng = np.random.default_rng(11)
    N, q, r = 400, 1e-3, 2e-2
    step = np.array([0.0, 0.05, 0.01])
    A, Q, R = Rotation.from_rotvec(step).as_matrix().T, q**2 * np.eye(3), r**2 * np.eye(3)
    true = [Rotation.random(random_state=5).as_quat()]
    for _ in range(N - 1):
        true.append(turned(turned(true[-1], step), q * rng.standard_normal(3)))
    seen = [turned(x, r * rng.standard_normal(3)) for x in true]
    start = turned(true[0], np.radians(start_deg) * np.array([0.6, 0.0, 0.8]))
    P, gaps = (10.0 if start_deg else 0.01) * np.eye(3), np.zeros((N, 3))
    gaps[200:220] = np.nan
    model = Model(f=lambda x, t0, t1: turned(x, step), F=lambda x, t0, t1: A, Q=Q, manifold=ROTATIONS)
    sensor = Sensor(gaps, R, h=lambda x, t: -between(x, seen[int(t)]), H=lambda x, t: np.eye(3))
    course = run((start, P), np.arange(float(N)), model, [sensor])
    smoothed = smooth(course)
    *wanted, whitened = error_state_filter(
        start, P, lambda k, x: (turned(x, step), A, Q),
        lambda k, x: None if np.isnan(gaps[k, 0]) else (between(x, seen[k]), np.eye(3), R), N,
    )  # fmt: skip
    ours = [(course.predicted_mean, course.predicted_cov), (course.mean, course.cov), (smoothed.mean, smoothed.cov)]
    for (states, covs), steps in zip(ours, wanted, strict=True):
        for x, P, (y, P_y) in zip(states, covs, steps, strict=True):
            assert np.abs(between(x, y)).max() < 1e-10
            np.testing.assert_allclose(P, P_y, rtol=1e-7, atol=1e-13)
    np.testing.assert_allclose(course.whitened, whitened, atol=1e-8)
    for states, covs in ours[1:]:
        e = np.array([between(x, y) for x, y in zip(states, true, strict=True)])[20:]
        nees = np.einsum("ki,kij,kj->k", e, np.linalg.inv(covs[20:]), e) / 3
        assert 0.75 < nees.mean() < 1.25
    assert np.trace(smoothed.cov[210]) < np.trace(course.cov[210])


# A wheel: an angle as a point of the unit circle, beside its rate; the error has one component less than the state.


@njit(RETRACT)
def turn(x, d, x_out):
    a = np.arctan2(x[1], x[0]) + d[0]
    x_out[0], x_out[1], x_out[2] = np.cos(a), np.sin(a), x[2] + d[1]


@njit(DIFFERENCE)
def angle(x, y, d):
    d[0], d[1] = np.arctan2(x[0] * y[1] - x[1] * y[0], x[0] * y[0] + x[1] * y[1]), y[2] - x[2]


@njit(PROPAGATE)
def roll(t0, t1, x, u, p, x_out, F, Q):
    a = np.arctan2(x[1], x[0]) + (t1 - t0) * x[2]
    x_out[0], x_out[1], x_out[2] = np.cos(a), np.sin(a), x[2]
    F[0, 0], F[0, 1], F[1, 0], F[1, 1] = 1.0, t1 - t0, 0.0, 1.0
    return 0


@njit(OBSERVE)
def mark(t, x, u, p, h, H, R):
    h[0] = -np.arctan2(x[0] * u[1] - x[1] * u[0], x[0] * u[0] + x[1] * u[1])  # minus the error, beside z = 0
    H[0, 0], H[0, 1] = 1.0, 0.0
    return 0


@pytest.mark.parametrize("options", [{}, {"iterations": 2}, {"gate": 9.0}], ids=str)
def test_compiled_functions_give_what_python_functions_give(options):
    rng = np.random.default_rng(4)
    t = np.cumsum(rng.uniform(0.5, 1.5, 60))
    a = 0.8 * t + 0.05 * rng.standard_normal(60)
    a[20] += 2.0  # an outlier
    z, Q, prior = np.zeros((60, 1)), np.diag([1e-6, 1e-5]), (np.array([1.0, 0.0, 0.7]), np.diag([4.0, 0.1]))
    z[30:33] = np.nan
    seen = np.column_stack([np.cos(a), np.sin(a)])
    wheel = Manifold(retract=turn, difference=angle, n=2)
    compiled = run(
        prior, t, Model(f=roll, Q=Q, manifold=wheel), [Sensor(z, [[2.5e-3]], h=mark, inputs=seen)], **options
    )
    row = dict(zip(t, seen, strict=True))

    def called(function, size):
        def result(*arguments):
            out = np.empty(size)
            function.py_func(*arguments, out)
            return out

        return result

    def rolled(x, t0, t1):
        x_out, F = np.empty(3), np.empty((2, 2))
        roll(t0, t1, x, np.empty(0), np.empty(0), x_out, F, F)
        return x_out, F

    def marked(x, now):
        h, H = np.empty(1), np.empty((1, 2))
        mark(now, x, row[now], np.empty(0), h, H, np.empty((1, 1)))
        return h, H

    space = Manifold(retract=called(turn, 3), difference=called(angle, 2), n=2)
    model = Model(f=lambda *a: rolled(*a)[0], F=lambda *a: rolled(*a)[1], Q=Q, manifold=space)
    plain = run(
        prior, t, model, [Sensor(z, [[2.5e-3]], h=lambda *a: marked(*a)[0], H=lambda *a: marked(*a)[1])], **options
    )
    one, other = smooth(compiled), smooth(plain)
    for name in ("predicted_mean", "predicted_cov", "mean", "cov", "whitened", "transition", "process_noise"):
        np.testing.assert_allclose(getattr(plain, name), getattr(compiled, name), rtol=1e-11, atol=1e-13)
    np.testing.assert_allclose(other.mean, one.mean, rtol=1e-11, atol=1e-13)
    np.testing.assert_allclose(other.cov, one.cov, rtol=1e-11, atol=1e-13)
    assert abs(one.mean[-1, 2] - 0.8) < 0.02 or "gate" not in options  # the gate leaves the outlier out
    assert compiled.whitened[20, 0] ** 2 > 9.0


def test_bad_covariances_are_named():
    line = Manifold(retract=lambda x, d: x + d, difference=lambda x, y: y - x, n=1)
    still = Model(f=lambda x, t0, t1: x, F=lambda x, t0, t1: np.eye(1), Q=np.zeros((1, 1)), manifold=line)
    known = (np.zeros(1), np.zeros((1, 1)))
    with pytest.raises(NotPositiveDefinite, match="innovation covariance is not positive definite at epoch 0"):
        run(known, [0.0], still, [Sensor([[0.0]], [[0.0]], h=lambda x, t: x, H=lambda x, t: np.eye(1))])
    course = run(known, [0.0, 1.0], still, [Sensor([[np.nan]] * 2, [[1.0]], H=[[1.0]])])
    with pytest.raises(NotPositiveDefinite, match="predicted covariance is not positive definite at epoch 1"):
        smooth(course)


def test_what_does_not_go_with_a_manifold_is_refused():
    line = Model(f=lambda x, t0, t1: x, F=lambda x, t0, t1: np.eye(2), Q=np.eye(2), manifold=VECTORS)
    sensor = Sensor(np.zeros((2, 1)), [[1.0]], H=[[1.0, 0.0]])
    with pytest.raises(ValueError, match="belong to the extended filter"):
        run(gaussian([0.0, 0.0], [1.0, 1.0]), [0.0, 1.0], line, [sensor], "unscented")
    with pytest.raises(ValueError, match=r"covariance has the shape \(3, 3\), it must be \(2, 2\)"):
        run((np.zeros(3), np.eye(3)), [0.0, 1.0], line, [sensor])
