"""The filters: seed-0 anchors, the same filter in plain numpy over the core's Gaussians, and everything they refuse."""

import numba
import numpy as np
import pytest

from geokalman.kalman import NotPositiveDefinite, adaptive, gaussian, robust
from geokalman.kalman import unscented as core_unscented
from geokalman.kalman.linear import update
from geokalman.physics.transition import TransitionWarning
from geokalman.pulsar import accelerations, assess, estimate, linearise, simulate
from geokalman.pulsar.estimate import KINDS, Diverged, Tuning
from geokalman.pulsar.model import TRANSFER, Mission, preset
from geokalman.pulsar.observations import Observations

days_of_orbit = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="days of orbit take minutes in plain Python")


def judged(kind, V, S, R, white, x, P, H, z, r):
    """Factor and weights of a filter, from the public functions of the core and dense algebra."""
    m = len(V)
    if kind in ("ekf", "ukf"):
        return 1.0, np.ones(m)
    if kind == "igg":
        return 1.0, np.maximum(
            [robust.igg3(v / np.sqrt(s), 1.5, 2.5) for v, s in zip(V, np.diag(S), strict=True)], robust.FLOOR
        )
    if kind == "aekf1_prw":
        to, tp = (V**2 / r).sum(), (np.diag(H @ P @ H.T) / r).sum()
        return (1.0 if to <= tp + m else max(tp / (to - m), 1e-3)), np.ones(m)
    s = np.sqrt(V @ np.linalg.solve(S, V) / m)
    if kind == "aekf1_pr3":
        return max(robust.igg3(s, 1.5, 2.5), 1e-3), np.ones(m)
    if kind == "aekf1_pr2":
        return min(1.0, 1.5 / s), np.ones(m)
    if kind == "trace":
        left, right = V @ V, np.trace(S)
        return (1.0 if left <= right else max((right - r.sum()) / (left - r.sum()), 1e-3)), np.ones(m)
    if kind == "norm":
        return max(robust.igg3(np.sqrt(V @ V / np.trace(S)), 1.5, 2.5), 1e-3), np.ones(m)
    N, w = H[:, :3], np.ones(m)
    for _ in range(4 if kind == "raekf" else 1):
        A = N.T @ np.diag(w / r) @ N
        X = np.linalg.solve(A, N.T @ (w / r * z))
        if kind == "raekf":
            w = np.maximum([robust.igg3(v, 1.5, 2.5) for v in (z - N @ X) / np.sqrt(r)], robust.FLOOR)
    d = X - x[:3]
    if kind == "literal":
        return max(robust.igg3(np.linalg.norm(d) / np.sqrt(np.trace(P[:3, :3])), 1.5, 2.5), 1e-3), w
    s = np.sqrt(d @ np.linalg.solve(P[:3, :3] + np.linalg.inv(A), d) / 3)
    return max(robust.igg3(s, 1.5, 2.5), 1e-3), w


def plain(kind, data, x, belief, force):
    """The same filter epoch by epoch: transition from `linearise`, update from the core's Gaussians."""
    P, out, H, r = belief.P0, [], np.hstack([data.H, np.zeros((len(data.H), 3))]), data.variance
    for k in range(len(data.t)):
        t0 = data.t[k - 1] if k else 0.0
        Phi = linearise.markley(force, x, 50)
        x = simulate.fly_in(force, x, np.array([data.t[k] - t0])).x[0]
        P = Phi @ P @ Phi.T + belief.process_noise(500.0)
        seen = np.isfinite(data.z[k])
        Hs, z, rs = H[seen], data.z[k, seen], r[seen]
        V, S = z - Hs @ x, Hs @ P @ Hs.T + np.diag(rs)
        alpha, w = judged(kind, V, S, np.diag(rs), None, x, P, Hs, z, rs)
        posterior, _ = update(gaussian(x, P / alpha), z, Hs, np.diag(rs / w))
        x, P = posterior
        out.append((x, np.diag(P), alpha, V @ np.linalg.solve(S, V)))
    return [np.array(column) for column in zip(*out, strict=True)]


@pytest.mark.parametrize("kind", [k for k in KINDS if k != "ukf"])
@pytest.mark.parametrize("name", ["A", "E"])
def test_each_filter_is_what_its_equations_say(day, kind, name):
    chosen = preset(name)
    flight = day.rich if chosen.world.mismatch else day.flight
    data = simulate.observe(flight, day.mission, chosen.world, np.random.default_rng(7), 0.02)
    short = Observations(data.t[:25], data.z[:25], data.H, data.variance)
    x0 = flight.x0 + np.repeat(chosen.world.error, 3)
    found = estimate.run(kind, short, x0, chosen.belief, day.force)
    x, variance, alpha, nis = plain(kind, short, x0, chosen.belief, day.force)
    scale = np.sqrt(variance)
    assert np.abs((found.x - x) / scale).max() < 1e-4
    np.testing.assert_allclose(np.diagonal(found.P, axis1=1, axis2=2), variance, rtol=1e-5)
    np.testing.assert_allclose(found.alpha, alpha, rtol=1e-5)
    np.testing.assert_allclose(found.nis, nis, rtol=1e-5)


def test_the_unscented_filter_is_the_cores(day):
    chosen = preset("B")
    n = 8
    data = Observations(day.data.t[:n], day.data.z[:n], day.data.H, day.data.variance)
    found = estimate.run("ukf", data, day.flight.x0, chosen.belief, day.force)
    H = np.hstack([data.H, np.zeros((7, 3))])
    x = gaussian(day.flight.x0, chosen.belief.P0)
    for k in range(n):
        x = core_unscented.predict(
            x,
            lambda s: simulate.fly_in(day.force, np.ascontiguousarray(s), np.array([500.0])).x[0],
            chosen.belief.process_noise(500.0),
            1.0,
            0.0,
            -3.0,
        )
        x, _ = update(x, data.z[k], H, np.diag(data.variance))
        assert np.abs((found.x[k] - x.mean) / np.sqrt(np.diag(x.cov))).max() < 1e-6
        np.testing.assert_allclose(found.P[k], x.cov, rtol=1e-6, atol=1e-8 * np.abs(x.cov).max())


def test_the_filters_never_see_the_world():
    for module in (estimate, accelerations):
        assert not {"World", "Preset", "preset", "PRESETS"} & vars(module).keys()


@pytest.fixture(scope="module")
def five_days(day):
    mission = Mission()
    return mission, simulate.fly(mission, day.gravity), simulate.fly(mission, day.gravity, 1.0)


@days_of_orbit
@pytest.mark.parametrize(
    ("name", "kind", "expected"),
    [
        ("B", "ekf", (114.53, 21.28, 70.88)), ("A", "aekf1_pr3", (106.49, 22.40, 67.60)),
        ("A", "ekf", (765.45, 532.73, 765.05)),
        ("C", "ekf", (1841.86, 1786.16, 1967.67)), ("D", "ekf", (826.80, 205.94, 588.78)),
    ],
)  # fmt: skip
def test_seed_0_anchors_of_the_specification(day, five_days, name, kind, expected):
    mission, j2, rich = five_days
    chosen = preset(name)
    flight = rich if chosen.world.mismatch else j2
    data = simulate.observe(flight, mission, chosen.world, np.random.default_rng(0))
    x0 = flight.x0 + np.repeat(chosen.world.error, 3)
    score = assess.score(estimate.run(kind, data, x0, chosen.belief, day.force), flight)
    np.testing.assert_allclose((score.x, score.y, score.z), expected, rtol=0.005)


@days_of_orbit
def test_long_states_of_the_specification(five_days):
    _, j2, rich = five_days
    np.testing.assert_allclose(j2.x[-1, :3], [-2541091.575, -1485751.559, -2329949.393], atol=0.01)
    np.testing.assert_allclose(rich.x[-1, :3], [-2254408.9, -1274416.3, -2724700.3], atol=0.1)


def test_the_smoother_is_at_the_end_the_filter_and_before_it_better(day):
    chosen = preset("B", q_acc=1e-5)
    forward = estimate.run("ekf", day.data, day.flight.x0, chosen.belief, day.force)
    smoothed = estimate.smooth(forward)
    np.testing.assert_array_equal(smoothed.x[-1], forward.x[-1])
    assert (
        np.diagonal(smoothed.P[:-1, :3, :3], axis1=1, axis2=2) < np.diagonal(forward.P[:-1, :3, :3], axis1=1, axis2=2)
    ).all()
    assert assess.score(smoothed, day.flight, 5).d3 < assess.score(forward, day.flight, 5).d3


def test_gaps_predict_only(day):
    z = day.data.z.copy()
    z[10] = np.nan
    z[20, [0, 3]] = np.nan
    data = Observations(day.data.t, z, day.data.H, day.data.variance)
    found = estimate.run("aekf1_pr3", data, day.flight.x0, preset("B").belief, day.force)
    course = found.course  # its first row holds the initial estimate
    np.testing.assert_array_equal(found.x[10], course.predicted_mean[11])
    np.testing.assert_array_equal(found.P[10], course.predicted_cov[11])
    assert found.observed[10] == 0 and found.nis[10] == 0 and found.observed[20] == 5
    assert np.isnan(found.weights[20, [0, 3]]).all() and np.isfinite(found.weights[20, [1, 2]]).all()


def test_irregular_epochs_use_the_actual_interval(day):
    """Every second epoch alone: the same prediction as through an epoch without observation."""
    z = day.data.z.copy()
    z[::2] = np.nan
    gaps = estimate.run(
        "ekf", Observations(day.data.t, z, day.data.H, day.data.variance), day.flight.x0, preset("C").belief, day.force
    )
    sparse = Observations(day.data.t[1::2], day.data.z[1::2], day.data.H, day.data.variance)
    jumps = estimate.run("ekf", sparse, day.flight.x0, preset("C").belief, day.force)
    np.testing.assert_allclose(jumps.course.predicted_mean[1], gaps.course.predicted_mean[2], atol=1e-4)
    assert np.abs((jumps.x - gaps.x[1::2]) / np.sqrt(np.diagonal(jumps.P, axis1=1, axis2=2))).max() < 0.1


@pytest.mark.parametrize("kind", ["aekf2", "raekf"])
def test_fewer_than_three_pulsars_skip_the_adaptation(day, kind):
    data = simulate.one_at_a_time(day.data, [1, 2, 3], day.mission.columns)
    found = estimate.run(kind, data, day.flight.x0, preset("B").belief, day.force)
    ekf = estimate.run("ekf", data, day.flight.x0, preset("B").belief, day.force)
    assert found.skipped.all() and (found.alpha == 1.0).all()
    # the hook sums the innovation in another order
    assert (np.abs(found.x - ekf.x) < 1e-8 * np.sqrt(np.diagonal(ekf.P, axis1=1, axis2=2))).all()


def test_three_pulsars_have_no_redundancy(day):
    three = Observations(day.data.t, np.ascontiguousarray(day.data.z[:, :3]), day.data.H[:3], day.data.variance[:3])
    found = estimate.run("raekf", three, day.flight.x0, preset("B").belief, day.force)
    assert not found.skipped.any() and (found.weights == 1.0).all()
    np.testing.assert_array_equal(found.x, estimate.run("aekf2", three, day.flight.x0, preset("B").belief, day.force).x)


def test_the_floor_matters_little(day):
    data = simulate.observe(day.rich, day.mission, preset("E").world, np.random.default_rng(3))
    args = (data, day.rich.x0, preset("E").belief, day.force)
    runs = [estimate.run("aekf1_prw", *args, Tuning(floor=floor)) for floor in (1e-6, 1e-3, 1e-2)]
    d3 = [assess.score(run, day.rich, 10).d3 for run in runs]
    assert np.ptp(d3) < 0.04 * d3[0]


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"k0": 2.5, "k1": 1.5}, "k0 below k1"), ({"k0": 0.0}, "k0 below k1"), ({"k0": -1.0}, "k0 below k1"),
        ({"floor": 0.0}, "floor = 0"), ({"floor": -1.0}, "floor = -1"), ({"substeps": 0}, "at least 1"),
        ({"rk_step": 0.0}, "rk_step"), ({"substeps": 1}, "too long for Markley"),
    ],
)  # fmt: skip
def test_tunings_that_are_refused(change, match):
    with pytest.raises(ValueError, match=match):
        Tuning(**change)


def test_coarse_substeps_warn_or_need_permission():
    with pytest.warns(TransitionWarning, match="250 s"):
        Tuning(substeps=2)
    with pytest.warns(TransitionWarning, match="500 s"):
        Tuning(substeps=1, allow_coarse=True)


def test_what_run_refuses(day):
    args = (day.data, day.flight.x0, preset("B").belief, day.force)
    with pytest.raises(ValueError, match="the filters are ekf"):
        estimate.run("kalman", *args)
    with pytest.raises(ValueError, match=r"x0 has the shape \(5,\)"):
        estimate.run("ekf", day.data, np.zeros(5), preset("B").belief, day.force)
    with pytest.raises(ValueError, match="P0 is not symmetric"):
        estimate.run("ekf", *args, P0=np.eye(6) + np.eye(6, k=1))
    with pytest.raises(NotPositiveDefinite, match="P0"):
        estimate.run("ekf", *args, P0=-np.eye(6))
    with pytest.raises(ValueError, match="P0 has the shape"):
        estimate.run("ekf", *args, P0=np.eye(3))
    with pytest.raises(ValueError, match="must be positive"):
        estimate.run("ekf", *args, R=np.diag([0.0] + 6 * [1.0]))
    correlated = np.diag(day.data.variance)
    correlated[0, 1] = correlated[1, 0] = 0.1 * np.sqrt(correlated[0, 0] * correlated[1, 1])
    with pytest.raises(ValueError, match="off its diagonal"):
        estimate.run("ekf", *args, R=correlated)
    with pytest.raises(ValueError, match="R has the shape"):
        estimate.run("ekf", *args, R=np.eye(3))


def test_a_lost_orbit_stops_the_filter_with_its_epoch(day):
    inside = day.flight.x0.copy()
    inside[3:] *= 0.3
    with pytest.raises(Diverged, match="k = 1: its position came inside Mars") as stopped:
        estimate.run("ekf", day.data, inside, preset("B").belief, day.force)
    assert stopped.value.epoch == 1
    fast = day.flight.x0.copy()
    fast[3:] *= 1.5
    with pytest.raises(Diverged, match="hyperbola"):
        estimate.run("ekf", day.data, fast, preset("B").belief, day.force)
    with pytest.raises(Diverged, match="position sigma"):
        estimate.run("ekf", day.data, day.flight.x0, preset("B").belief, day.force, P0=1e16 * np.eye(6))
    with pytest.raises(Diverged, match="k = 1: its covariance lost its root"):
        estimate.run("ukf", day.data, day.flight.x0, preset("B").belief, day.force, P0=np.zeros((6, 6)))
    endless = np.r_[day.flight.x0[:3], np.full(3, 1e306)]
    with pytest.raises(Diverged, match="k = 1: its state is not finite"):
        estimate.run("ekf", day.data, endless, preset("B").belief, day.force)
    z = day.data.z.copy()
    z[4, 2] += 3e7
    with pytest.raises(Diverged, match="k = 5: an innovation"):
        far = Observations(day.data.t, z, day.data.H, day.data.variance)
        estimate.run("ekf", far, day.flight.x0, preset("B").belief, day.force)


@days_of_orbit
def test_empirical_accelerations_take_up_what_the_force_misses(day):
    chosen = preset("E")
    data = simulate.observe(day.rich, day.mission, chosen.world, np.random.default_rng(0))
    args = (day.rich.x0, chosen.belief.P0, day.force)
    found = accelerations.run(data, *args, 1e-3, 1000.0)
    plain_ekf = estimate.run("ekf", data, day.rich.x0, chosen.belief, day.force)
    tuned = estimate.run("ekf", data, day.rich.x0, chosen.tuned_belief(), day.force)
    scores = [assess.score(e, day.rich, 10) for e in (found, plain_ekf, tuned)]
    assert scores[0].d3 < 0.2 * scores[1].d3 and scores[0].d3 < 1.15 * scores[2].d3
    assert scores[0].vz < scores[2].vz
    with pytest.raises(ValueError, match="must be positive"):
        accelerations.run(data, *args, 0.0, 1000.0)
    with pytest.raises(ValueError, match="without gaps"):
        accelerations.run(data.masked(np.ones(data.z.shape, bool)), *args, 1e-3, 1000.0)


def test_redundancy_numbers_of_the_specification(day):
    found = robust.redundancy_numbers(day.mission.H(), day.mission.sigmas() ** 2 + TRANSFER**2)
    np.testing.assert_allclose(found, [0.007, 0.106, 0.053, 0.873, 0.963, 0.999, 0.999], atol=6e-4)


@pytest.mark.parametrize(
    ("step", "own", "n"),
    [(estimate._propagate, [100.0, 2.0], 6), (accelerations._propagate, [900.0, *np.eye(9).flat, *np.eye(9).flat], 9)],
)
def test_the_motion_is_the_same_in_plain_python(day, step, own, n):
    """One step of the model, compiled and interpreted."""
    x, params = np.r_[day.flight.x0, np.full(n - 6, 1e-3)], np.r_[own, day.force.packed]
    results = []
    for function in (step, getattr(step, "py_func", step)):
        out, F, Q = np.empty(n), np.empty((n, n)), np.eye(n)
        assert function(0.0, 500.0, x, np.empty(0), params, out, F, Q) == 0
        results.append((out, F, Q))
    for compiled, slow in zip(*results, strict=True):
        np.testing.assert_allclose(slow, compiled, rtol=1e-9, atol=1e-12 * np.abs(compiled).max())


def test_factors_of_the_traps_are_those_of_the_core():
    V, S, R = np.array([3.0, 1.0]), np.array([[2.0, 0.3], [0.3, 1.5]]), np.diag([0.5, 0.5])
    assert adaptive.norm_ratio(V, S) == pytest.approx(np.sqrt(10.0 / 3.5))
    assert adaptive.trace_factor(V, S, R, 1e-3) == pytest.approx(2.5 / 9.0)
