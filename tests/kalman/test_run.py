"""The loop and its hooks: compiled functions give what Python functions give; gates, iterations, stops, repeated
epochs."""

from __future__ import annotations

import numpy as np
import pytest
from numba import njit

from geokalman.kalman import Adaptive, Model, NotPositiveDefinite, Sensor, Stopped, gaussian, run, smooth, unscented
from geokalman.kalman.linear import update
from geokalman.kalman.model import OBSERVE, PROPAGATE

ARRAYS = ("predicted_mean", "predicted_cov", "mean", "cov", "whitened", "transition", "process_noise")


@njit(PROPAGATE)
def fly(t0, t1, x, u, p, x_out, F, Q):
    """Plane motion slowed down by a drag p[0] |v| v and pushed by u; a stop with code 7 where x[1] is above p[1]."""
    h, speed = t1 - t0, np.sqrt(x[2] ** 2 + x[3] ** 2)
    if x[1] > p[1]:
        return 7
    for i in range(2):
        x_out[i] = x[i] + h * x[2 + i]
        x_out[2 + i] = x[2 + i] - h * p[0] * speed * x[2 + i] + h * u[i]
    if F.size:
        for i in range(4):
            for j in range(4):
                F[i, j] = 1.0 if i == j else 0.0
        for i in range(2):
            F[i, 2 + i] = h
            for j in range(2):
                F[2 + i, 2 + j] -= h * p[0] * (x[2 + i] * x[2 + j] / speed + (speed if i == j else 0.0))
    if Q.size:
        Q[2, 2] = Q[3, 3] = 1e-3 * h
    return 0


@njit(OBSERVE)
def sight(t, x, u, p, h, H, R):
    """Distance and bearing from a station that moves by u; a stop with code 3 after p[2]; p[3] rho noise is added."""
    dx, dy = x[0] - p[0] - u[0], x[1] - p[1]
    rho = np.sqrt(dx**2 + dy**2)
    if t > p[2]:
        return 3
    h[0], h[1] = rho, np.arctan2(dy, dx)
    if R.size:
        R[0, 0] += p[3] * rho
    if H.size:
        for j in range(4):
            H[0, j] = H[1, j] = 0.0
        H[0, 0], H[0, 1], H[1, 0], H[1, 1] = dx / rho, dy / rho, -dy / rho**2, dx / rho**2
    return 0


class Flight:
    """Thirty irregular epochs with two sensors, as compiled functions and as Python functions."""

    def __init__(self) -> None:
        rng = np.random.default_rng(7)
        self.t = np.cumsum(rng.uniform(0.5, 1.5, 30))
        self.push, self.moved = rng.standard_normal((29, 2)), 0.3 * np.arange(30.0)[:, None]
        self.prior = gaussian([0.0, 0.0, 5.0, 3.0], [1.0, 1.0, 0.1, 0.1])
        self.R, self.H = np.array([[0.04, 1e-5], [1e-5, 1e-4]]), np.array([[1.0, 1.0, 0.0, 0.0]])
        x, self.z, self.sums = self.prior.mean + rng.normal(0.0, 0.3, 4), np.empty((30, 2)), np.empty((30, 1))
        for k in range(30):
            if k:
                x = self.fly(x, self.t[k - 1], self.t[k])[0] + rng.normal(0.0, 0.03, 4) * [0, 0, 1, 1]
            self.z[k] = self.sight(x, self.t[k])[0] + rng.normal(0.0, [0.2, 0.01])
            self.sums[k] = self.H @ x + rng.normal(0.0, 0.5)
        self.z[3], self.z[8, 0], self.sums[3:5] = np.nan, np.nan, np.nan
        self.z[14, 0] += 3.0

    def compiled(self, epochs=30, highest=1e9, latest=1e9, growth=0.0, **options):
        here = slice(0, epochs)
        model = Model(f=fly, inputs=self.push[: epochs - 1], params=[0.02, highest])
        station = [-10.0, -30.0, latest, growth]
        sensors = [
            Sensor(self.z[here], self.R, h=sight, inputs=self.moved[here], params=station),
            Sensor(self.sums[here], [[0.25]], H=self.H),
        ]
        return run(self.prior, self.t[here], model, sensors, **options)

    def fly(self, x, t0, t1):
        x_out, F, Q = np.empty(4), np.empty((4, 4)), np.zeros((4, 4))
        fly(t0, t1, x, self.push[np.searchsorted(self.t, t0)], np.array([0.02, 1e9]), x_out, F, Q)
        return x_out, F, Q

    def sight(self, x, t):
        h, H, u = np.empty(2), np.empty((2, 4)), self.moved[np.searchsorted(self.t, t)]
        sight(t, x, u, np.array([-10.0, -30.0, 1e9, 0.0]), h, H, np.empty((0, 0)))
        return h, H

    def python(self, **options):
        model = Model(
            f=lambda *a: self.fly(*a)[0], F=lambda *a: self.fly(*a)[1], Q=lambda t0, t1: self.fly(np.ones(4), t0, t1)[2]
        )
        sensors = [
            Sensor(self.z, self.R, lambda *a: self.sight(*a)[0], lambda *a: self.sight(*a)[1]),
            Sensor(self.sums, [[0.25]], H=self.H),
        ]
        return run(self.prior, self.t, model, sensors, **options)


@pytest.fixture(scope="module")
def flight():
    return Flight()


def same(one, other, rtol=1e-11):
    for name in ARRAYS:
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=rtol, atol=1e-12, err_msg=name)


OPTIONS = [
    {},
    {"kind": "unscented", "alpha": 0.5},
    {"iterations": 3},
    {"gate": 9.0},
    {"gate": 9.0, "iterations": 2},
    {"adaptive": Adaptive(by="three_part")},
    {"adaptive": Adaptive(by="innovations")},
]


@pytest.mark.parametrize("options", OPTIONS, ids=str)
def test_compiled_functions_give_what_python_functions_give(flight, options):
    """The same run, filtered and smoothed; the loop is one text, compiled where all functions are."""
    compiled, plain = flight.compiled(**options), flight.python(**options)
    same(plain, compiled)
    one, other = smooth(plain), smooth(compiled)
    np.testing.assert_allclose(one.mean, other.mean, rtol=1e-9)
    np.testing.assert_allclose(one.cov, other.cov, rtol=1e-9, atol=1e-12)
    if "adaptive" in options:
        np.testing.assert_allclose(plain.alpha, compiled.alpha, rtol=1e-9)
        np.testing.assert_allclose(plain.weights, compiled.weights, rtol=1e-9)


@pytest.mark.parametrize("options", OPTIONS[:4], ids=str)
def test_the_loop_equals_its_own_text(flight, options, request):
    compiled = flight.compiled(**options)
    request.getfixturevalue("interpreted")
    same(flight.compiled(**options), compiled)


@pytest.mark.slow
def test_more_sensors_than_one_loop_holds_are_one_vector(problem, close):
    """Seven sensors: the loop is compiled once more, for eight."""
    p = problem
    H, R, z = np.concatenate([p.H, p.H[:, :3]], axis=1), np.eye(7), np.concatenate([p.z, p.z[:, :3]], axis=1)
    model = Model(F=p.transition)
    many = run(p.prior, p.t, model, [Sensor(z[:, [i]], [[1.0]], H=H[:, [i]]) for i in range(7)])
    one = run(p.prior, p.t, model, [Sensor(z, R, H=H)])
    close(many.mean, many.cov, one.mean, one.cov, 1e-11)
    np.testing.assert_allclose(many.whitened, one.whitened, atol=1e-11)


def test_a_sensor_of_functions_makes_its_own_noise(flight):
    """R comes in as the sensor's at every call, however often an update calls; the first sigma point's counts."""
    x, P = flight.prior
    R = flight.R + np.diag([0.01 * np.hypot(10.0, 30.0), 0.0])
    station = [-10.0, -30.0, 1e9, 0.01]
    for options in ({}, {"iterations": 1, "gate": 1e9}, {"kind": "unscented"}):
        own = Sensor(flight.z[:1], flight.R, h=sight, inputs=[[0.0]], params=station)
        given = Sensor(flight.z[:1], R, h=sight, inputs=[[0.0]], params=[*station[:3], 0.0])
        one, other = (run((x, P), [0.0], Model(f=fly), [sensor], **options) for sensor in (own, given))
        np.testing.assert_allclose(one.mean, other.mean, rtol=1e-13)
        np.testing.assert_allclose(one.cov, other.cov, rtol=1e-13, atol=1e-15)
    own, again = (flight.compiled(1, growth=0.01, iterations=i) for i in (4, 5))  # converged: the noise does not grow
    np.testing.assert_allclose(own.cov, again.cov, rtol=1e-4)


def test_iterated_update_is_gauss_newton(flight):
    """x_(i+1) minimises |x - x_0|^2 in P^-1 and |z - h(x_i) - H_i (x - x_i)|^2 in R^-1: normal equations."""
    x0, P = flight.prior
    inverse = np.linalg.inv
    x, t = x0, flight.t[0]
    for iterations in range(1, 5):
        h, H = flight.sight(x, t)
        N = inverse(P) + H.T @ inverse(flight.R) @ H
        x = np.linalg.solve(N, inverse(P) @ x0 + H.T @ inverse(flight.R) @ (flight.z[0] - h + H @ x))
        sensor = Sensor(flight.z[:1], flight.R, lambda *a: flight.sight(*a)[0], lambda *a: flight.sight(*a)[1])
        course = run(flight.prior, [t], Model(f=fly), [sensor], iterations=iterations)
        np.testing.assert_allclose(course.mean[0], x, rtol=1e-10, atol=1e-12)
        np.testing.assert_allclose(course.cov[0], inverse(N), rtol=1e-9, atol=1e-14)
        first = flight.sight(x0, t)
        S = first[1] @ P @ first[1].T + flight.R
        wanted = np.linalg.solve(np.linalg.cholesky(S), flight.z[0] - first[0])  # the innovation is that of the first
        np.testing.assert_allclose(course.whitened[0], wanted, rtol=1e-9)
    linear = [Sensor(flight.sums[:1], [[0.25]], H=flight.H)]
    once, thrice = (run(flight.prior, [t], Model(f=fly), linear, iterations=i) for i in (1, 3))
    np.testing.assert_allclose(once.mean, thrice.mean, rtol=1e-12)  # what is linear is solved at once
    np.testing.assert_allclose(once.cov, thrice.cov, rtol=1e-12, atol=1e-15)


def test_a_gate_refuses_what_lies_beyond_it_and_records_it(flight):
    prior, H, R = gaussian([0.0, 0.0], [3.0, 1.0]), np.array([[1.0, 0.0]]), np.array([[1.0]])
    still = Model(F=np.eye(2), Q=np.zeros((2, 2)))
    for z, admitted in ((5.9, True), (6.1, False), (-6.1, False)):
        course = run(prior, [0.0], still, [Sensor([[z]], R, H=H)], gate=9.0)
        wanted = update(prior, [z], H, R)[0] if admitted else prior
        np.testing.assert_allclose(course.mean[0], wanted.mean)
        np.testing.assert_allclose(course.cov[0], wanted.cov)
        assert course.whitened[0, 0] == pytest.approx(z / 2.0)
    gated, plain = flight.compiled(gate=9.0), flight.compiled()
    refused = (np.nan_to_num(gated.whitened[:, :2]) ** 2).sum(1) > 9.0
    assert refused[14] and refused.sum() < 4
    same(flight.compiled(gate=1e9), plain)
    alone = Flight()
    alone.z[refused] = np.nan
    np.testing.assert_allclose(gated.mean, alone.compiled().mean, rtol=1e-10)
    np.testing.assert_allclose(gated.cov, alone.compiled().cov, rtol=1e-10, atol=1e-13)


@pytest.mark.parametrize("kind", ["extended", "unscented"])
def test_a_run_that_a_function_stops_says_where_and_keeps_its_course(flight, kind):
    whole = flight.compiled(kind=kind)
    with pytest.raises(Stopped, match="the model stopped at epoch") as error:
        flight.compiled(kind=kind, highest=float(whole.mean[11, 1]) + (1.0 if kind == "unscented" else 0.0))
    stop, k = error.value, error.value.epoch
    assert (stop.who, stop.code, stop.t) == ("model", 7, flight.t[k]) and 3 < k < 20
    assert len(stop.course) == k
    np.testing.assert_array_equal(stop.course.mean, whole.mean[:k])
    np.testing.assert_array_equal(smooth(stop.course).mean, smooth(flight.compiled(epochs=k, kind=kind)).mean)
    with pytest.raises(Stopped, match=r"the sensor stopped at epoch 20 \(t = .* s\) with code 3") as error:
        flight.compiled(kind=kind, latest=flight.t[19])
    assert len(error.value.course) == 21  # the epoch where it stopped is there as far as it came
    np.testing.assert_array_equal(error.value.course.predicted_mean, whole.predicted_mean[:21])


def test_a_run_that_loses_its_covariance_keeps_its_course():
    z = np.array([[0.1], [np.nan], [0.3]])
    model = Model(F=np.eye(1), Q=np.zeros((1, 1)))
    with pytest.raises(NotPositiveDefinite, match="innovation covariance .* at epoch 2") as error:
        run(gaussian([0.0], [1.0]), [0.0, 1.0, 2.0], model, [Sensor(z, [[0.0]], H=[[1.0]])])
    assert len(error.value.course) == 3 and error.value.course.mean[1, 0] == 0.1
    f = Model(f=lambda x, t0, t1: x, Q=np.zeros((1, 1)))
    with pytest.raises(NotPositiveDefinite, match="filtered covariance .* at epoch 0") as error:
        run(gaussian([0.0], [1.0]), [0.0, 1.0, 2.0], f, [Sensor(z, [[0.0]], H=[[1.0]])], "unscented")
    assert len(error.value.course) == 1 and error.value.course.mean[0, 0] == 0.1


@pytest.mark.parametrize("kind", ["extended", "unscented"])
def test_equal_epochs_are_one_joint_observation(problem, close, kind):
    """Each epoch twice, with half of the components each time: filtered and smoothed as one."""
    p, N = problem, len(problem.t)
    model = Model(
        f=lambda x, t0, t1: p.transition(t1 - t0)[0] @ x,
        F=lambda x, t0, t1: p.transition(t1 - t0)[0],
        Q=lambda t0, t1: p.transition(t1 - t0)[1],
    )
    R = np.diag([0.3, 0.1, 0.2, 0.5])
    twice = np.repeat(p.z, 2, axis=0)
    twice[::2, 2:], twice[1::2, :2] = np.nan, np.nan
    once = run(p.prior, p.t, model, [Sensor(p.z, R, H=p.H)], kind)
    both = run(p.prior, np.repeat(p.t, 2), model, [Sensor(twice, R, H=np.repeat(p.H, 2, axis=0))], kind)
    close(both.mean[1::2], both.cov[1::2], once.mean, once.cov, 1e-10)
    np.testing.assert_array_equal(both.transition[::2], np.broadcast_to(np.eye(6), (N, 6, 6)))
    np.testing.assert_array_equal(both.process_noise[::2], 0.0)
    one, other = smooth(both), smooth(once)
    for part in (slice(0, None, 2), slice(1, None, 2)):
        close(one.mean[part], one.cov[part], other.mean, other.cov, 1e-8)
    with pytest.raises(ValueError, match="epochs must increase"):
        run(p.prior, np.repeat(p.t, 2), Model(F=p.transition), [Sensor(twice, R, H=np.repeat(p.H, 2, axis=0))], kind)


def test_unscented_updates_of_single_calls_are_the_run(flight):
    course = flight.python(kind="unscented")
    for k in (0, 8, 20):
        state = course.predicted_mean[k], course.predicted_cov[k]
        state, innovation = unscented.update(
            state, flight.z[k], lambda x, k=k: flight.sight(x, flight.t[k])[0], flight.R
        )
        np.testing.assert_allclose(course.whitened[k, :2], innovation.whitened, rtol=1e-9)
        state, _ = update(state, flight.sums[k], flight.H, [[0.25]])
        np.testing.assert_allclose(course.mean[k], state.mean, rtol=1e-11)
        np.testing.assert_allclose(course.cov[k], state.cov, rtol=1e-9, atol=1e-13)


@njit(OBSERVE)
def setting(t, x, u, p, h, H, R):
    """The states themselves, as many as h holds; the last one is not visible from t = p[0] on."""
    for a in range(h.size):
        h[a] = x[a]
        for j in range(x.size):
            H[a, j] = 1.0 if j == a else 0.0
    if t >= p[0]:
        h[h.size - 1] = np.nan
    return 0


@pytest.mark.parametrize("m", [1, 2])
def test_what_a_compiled_sensor_does_not_see_is_missing(m):
    z, model = np.arange(4.0 * m).reshape(4, m), Model(F=np.eye(2), Q=np.eye(2))
    prior, R = gaussian([0.0, 0.0], [1.0, 1.0]), np.eye(m)
    ours = run(prior, np.arange(4.0), model, [Sensor(z, R, h=setting, params=[2.0])])
    z[2:, -1] = np.nan
    same(ours, run(prior, np.arange(4.0), model, [Sensor(z, R, h=setting, params=[9.0])]))


@pytest.mark.parametrize("kind", ["extended", "unscented"])
@pytest.mark.parametrize("what", ["f", "h"])
def test_a_python_function_that_loses_its_numbers_later_is_told(what, kind):
    """The first value of each function is checked where it comes, the later ones where the course ends."""
    lost = {"f": lambda x, t0, t1: x if t1 < 3.0 else x * np.nan, "h": lambda x, t: x if t < 3.0 else x * np.nan}
    f, h = lost["f"] if what == "f" else (lambda x, t0, t1: x), lost["h"] if what == "h" else (lambda x, t: x)
    model = Model(f=f, F=lambda x, t0, t1: np.eye(1), Q=np.eye(1))
    message = rf"{what}\(x\) is not finite at epoch 3 \(t = 3 s\)"
    if (kind, what) == ("unscented", "h"):
        message = "innovation covariance .* at epoch 3"
    sensor = Sensor(np.ones((6, 1)), [[1.0]], h, lambda x, t: np.eye(1))
    with pytest.raises(ValueError, match=message):
        run(gaussian([0.0], [1.0]), np.arange(6.0), model, [sensor], kind)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"kind": "ensemble"}, "kind = 'ensemble' is unknown: take extended or unscented"),
        ({"sensors": []}, "there is no sensor"),
        ({"iterations": 0}, "iterations = 0: an update needs at least one linearisation"),
        ({"gate": 0.0}, "gate = 0.0: it must be positive"),
        ({"gate": 9.0, "kind": "unscented"}, "belong to the extended filter"),
        ({"iterations": 2, "kind": "unscented"}, "belong to the extended filter"),
        ({"model": Model(f=lambda x, t0, t1: x, Q=np.eye(1))}, "the model has no F"),
        ({"model": Model(f=lambda x, t0, t1: x, F=lambda x, t0, t1: np.eye(1))}, "the model has no Q"),
        ({"model": Model(Q=np.eye(1))}, "the model has neither f nor F"),
        ({"model": Model(F=np.eye(1), Q=np.eye(1), inputs=[[1.0]])}, r"inputs of the model has the shape \(1, 1\)"),
        ({"sensors": [Sensor([[1.0]] * 3, [[1.0]])]}, "sensor 0 has neither h nor H"),
        ({"t": [0.0, 0.0, 1.0]}, "epochs must increase"),
        ({"t": [0.0, 2.0, 1.0]}, "epochs must increase"),
    ],
)
def test_wrong_input_is_named(change, message):
    good = {
        "prior": gaussian([0.0], [1.0]), "t": [0.0, 1.0, 2.0], "model": Model(F=np.eye(1), Q=np.eye(1)),
        "sensors": [Sensor([[1.0]] * 3, [[1.0]], H=[[1.0]])],
    }  # fmt: skip
    assert len(run(**good)) == 3
    with pytest.raises(ValueError, match=message):
        run(**{**good, **change})
