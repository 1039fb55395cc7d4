"""The extended filter: the linear filter on a linear problem, and honest on a nonlinear one."""

from __future__ import annotations

import numpy as np
import pytest

from geokalman.kalman import Model, NotPositiveDefinite, Sensor, extended, gaussian, run, smooth


def index(t, now):
    return int(np.flatnonzero(t == now)[0])


def linear_run(p, sensors):
    model = Model(
        f=lambda x, t0, t1: p.transition(t1 - t0)[0] @ x,
        F=lambda x, t0, t1: p.transition(t1 - t0)[0],
        Q=lambda t0, t1: p.transition(t1 - t0)[1],
    )
    return run(p.prior, p.t, model, sensors)


def test_is_the_linear_filter_on_a_linear_problem(problem, close):
    p = problem
    sensor = Sensor(p.z, p.R, lambda x, t: p.H[index(p.t, t)] @ x, lambda x, t: p.H[index(p.t, t)])
    ours, ref = linear_run(p, [sensor]), p.filter()
    close(ours.mean, ours.cov, ref.mean, ref.cov, 1e-10)
    close(ours.predicted_mean, ours.predicted_cov, ref.predicted_mean, ref.predicted_cov, 1e-10)
    np.testing.assert_allclose(ours.whitened, ref.whitened, atol=1e-10)
    one, other = smooth(ours), smooth(ref)
    close(one.mean, one.cov, other.mean, other.cov, 1e-9)


def test_two_sensors_in_turn_are_one_vector_on_a_linear_problem(problem, close):
    p = problem
    R = np.array([np.kron(np.eye(2), [[0.3, 0.1], [0.1, 0.2]])] * len(p.t))
    H = lambda rows: lambda x, t: p.H[index(p.t, t)][rows]
    h = lambda rows: lambda x, t: p.H[index(p.t, t)][rows] @ x
    parts = [Sensor(p.z[:, s], R[:, s, s], h(s), H(s)) for s in (slice(0, 2), slice(2, 4))]
    ours, ref = linear_run(p, parts), p.filter(R=R)
    close(ours.mean, ours.cov, ref.mean, ref.cov, 1e-10)
    np.testing.assert_allclose(ours.whitened, ref.whitened, atol=1e-10)


def test_single_steps_are_the_run(problem, filter_linear):
    p = problem
    state, innovation = extended.update(p.prior, p.z[1], p.H[1] @ p.prior.mean, p.H[1], p.R[1])
    state = extended.predict(state, p.Phi[0] @ state.mean, p.Phi[0], p.Q[0])
    course = filter_linear(p.prior, p.t[:2], np.array([p.z[1], p.z[2]]), p.H[1:3], p.R[1:3], (p.Phi[0], p.Q[0]))
    np.testing.assert_allclose(state.mean, course.predicted_mean[1], rtol=1e-11)
    np.testing.assert_allclose(state.cov, course.predicted_cov[1], rtol=1e-9, atol=1e-14)
    np.testing.assert_allclose(innovation.whitened, course.whitened[0], atol=1e-11)
    gap, innovation = extended.update(p.prior, np.full(4, np.nan), p.H[1] @ p.prior.mean, p.H[1], p.R[1])
    assert np.array_equal(gap.cov, p.prior.cov) and np.isnan(innovation.whitened).all()


def test_finds_a_position_from_ranges():
    """Three ranges fix a point: repeated updates without noise of the state converge to it."""
    stations, truth = np.array([[0.0, 0.0], [100.0, 0.0], [0.0, 100.0]]), np.array([30.0, 40.0])
    h = lambda x, t: np.linalg.norm(x - stations, axis=1)
    H = lambda x, t: (x - stations) / h(x, t)[:, None]
    z = np.tile(h(truth, 0.0), (50, 1))
    still = Model(f=lambda x, t0, t1: x, F=lambda x, t0, t1: np.eye(2), Q=np.zeros((2, 2)))
    prior = gaussian([20.0, 50.0], [100.0, 100.0])
    course = run(prior, np.arange(50.0), still, [Sensor(z, np.eye(3), h, H)])
    np.testing.assert_allclose(course.mean[-1], truth, atol=0.05)
    assert np.sqrt(np.diag(course.cov[-1])).max() < 0.2


def test_wrong_input_is_named():
    prior, Q = gaussian([0.0], [1.0]), np.eye(1)
    f, F = (lambda x, t0, t1: x), (lambda x, t0, t1: np.eye(1))
    h, H = (lambda x, t: x), (lambda x, t: np.eye(1))
    z = [[1.0], [1.0]]

    known = (Sensor(z, Q, h, H),)

    def filtered(sensors=known, **new):
        return run(prior, [0.0, 1.0], Model(**{"f": f, "F": F, "Q": Q, **new}), sensors)

    assert len(filtered()) == 2
    for change, message in [
        ({"sensors": [Sensor(z, Q, h)]}, "sensor 0 has no H"),
        ({"sensors": [Sensor(z[:1], Q, h, H)]}, r"z of sensor 0 has the shape \(1, 1\), it must be \(2, any\)"),
        ({"sensors": [Sensor(z, -Q, h, H)]}, "R of sensor 0 is not positive definite"),
        ({"sensors": [Sensor(z, Q, lambda x, t: np.array([np.nan]), H)]}, r"h\(x\)\[0\] is nan"),
        ({"sensors": [Sensor(z, Q, h, lambda x, t: np.ones((2, 1)))]}, r"H\(x\) has the shape \(2, 1\)"),
        ({"f": lambda x, t0, t1: np.zeros(2)}, r"f\(x\) has the shape \(2,\)"),
        ({"F": lambda x, t0, t1: np.zeros((2, 2))}, r"F\(x\) has the shape \(2, 2\)"),
        ({"Q": lambda t0, t1: -np.eye(1)}, "Q is not positive definite"),
    ]:
        with pytest.raises(ValueError, match=message):
            filtered(**change)
    with pytest.raises(NotPositiveDefinite, match="innovation covariance .* at epoch 1") as error:
        filtered(sensors=[Sensor([[np.nan], [1.0]], [[0.0]], h, lambda x, t: np.zeros((1, 1)))])
    assert error.value.epoch == 1
