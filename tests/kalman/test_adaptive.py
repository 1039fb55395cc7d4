"""Adaptive factors: their definitions, that they do nothing to a right prediction, what they save of a wrong one."""

import numpy as np
import pytest
from scipy.stats import chi2

from geokalman.kalman import Adaptive, Model, NotPositiveDefinite, Sensor, adaptive, gaussian, robust, run
from geokalman.kalman.linear import update

STILL = Model(F=np.eye(4), Q=np.zeros((4, 4)))


def judged(prior, z, H, R, **settings):
    """One epoch by `run` with a hook: the course."""
    return run(prior, [0.0], STILL, [Sensor(z[None], R, H=H)], adaptive=Adaptive(**settings))


@pytest.fixture
def epoch():
    rng = np.random.default_rng(5)
    root = rng.standard_normal((4, 4))
    prior = gaussian(rng.standard_normal(4), root @ root.T + np.eye(4))
    H, R = rng.standard_normal((5, 4)), np.diag(rng.uniform(0.5, 4.0, 5))
    return prior, H, R, H @ prior.mean + rng.standard_normal(5)


def test_innovation_and_its_covariance(epoch):
    prior, H, R, z = epoch
    V, S, white = z - H @ prior.mean, np.empty((5, 5)), np.empty(5)
    assert adaptive.innovation_step(prior.cov, V, H, R, S, white) == 0
    np.testing.assert_allclose(S, H @ prior.cov @ H.T + R, rtol=1e-13)
    assert white @ white == pytest.approx(V @ np.linalg.solve(S, V), rel=1e-12)
    assert adaptive.predicted_residual(white) == pytest.approx(np.sqrt(V @ np.linalg.solve(S, V) / 5))
    assert adaptive.innovation_step(-10 * prior.cov, V, H, R, S, white) > 0


@pytest.mark.parametrize(
    ("s", "factor"), [(0.0, 1.0), (1.5, 1.0), (-1.5, 1.0), (2.0, 0.75 * 0.25), (2.5, 1e-3), (9.0, 1e-3)]
)
def test_three_part_factor(s, factor):
    assert adaptive.three_part(s, 1.5, 2.5, 1e-3) == pytest.approx(factor)


def test_two_part_factor():
    assert adaptive.two_part(1.5, 1.5, 1e-3) == 1.0
    assert adaptive.two_part(3.0, 1.5, 1e-3) == pytest.approx(0.5)
    assert adaptive.two_part(1e9, 1.5, 1e-3) == 1e-3


def test_ratio_factor_makes_the_sums_agree(epoch):
    prior, H, R, _ = epoch
    S = H @ prior.cov @ H.T + R
    r = np.diag(R)
    V = 5.0 * np.sqrt(np.diag(S))
    alpha = adaptive.ratio_factor(V, S, R, 1e-3)
    predicted = np.diag(H @ (prior.cov / alpha) @ H.T + R) / r
    assert (V**2 / r).sum() == pytest.approx(predicted.sum())
    assert adaptive.ratio_factor(0.1 * V, S, R, 1e-3) == 1.0
    assert adaptive.ratio_factor(1e9 * V, S, R, 1e-3) == 1e-3


def test_unweighted_forms_hear_the_worst_observation_alone():
    """Two ranges, one good to 1 m and 50 sigmas off, one good to 10 km: only the weighted factor notices."""
    R, S = np.diag([1.0, 1e8]), np.diag([2.0, 1e8 + 1.0])
    V = np.array([70.0, 0.0])
    assert adaptive.ratio_factor(V, S, R, 1e-3) < 1e-2
    assert adaptive.trace_factor(V, S, R, 1e-3) == 1.0
    assert adaptive.norm_ratio(V, S) < 0.01
    assert adaptive.trace_factor(np.array([0.0, 3e4]), S, R, 1e-3) == 1e-3


def test_state_discrepancy_is_the_whitened_difference(epoch):
    prior, H, R, z = epoch
    x, U = np.empty(4), np.empty((4, 4))
    assert robust.normal_step(H, z, 1.0 / np.diag(R), x, U) == 0
    A = H.T @ np.linalg.inv(R) @ H
    np.testing.assert_allclose(x, np.linalg.solve(A, H.T @ np.linalg.solve(R, z)), rtol=1e-10)
    d = x - prior.mean
    expected = d @ np.linalg.solve(prior.cov + np.linalg.inv(A), d) / 4
    assert adaptive.state_discrepancy(d, prior.cov, U) == pytest.approx(np.sqrt(expected), rel=1e-10)
    assert np.isnan(adaptive.state_discrepancy(d, -100 * prior.cov, U))


def igg3(s, k0=1.5, k1=2.5):
    s = np.abs(s)
    return np.select([s <= k0, s <= k1], [1.0, k0 / np.maximum(s, k0) * ((k1 - s) / (k1 - k0)) ** 2], 0.0)


def written_out(by, V, P, H, R, k=3, floor=1e-3):
    """Factor and weights of each hook, from mars-pulsar (17)-(21) and the papers behind it, of a full epoch."""
    r, S, m = np.diag(R), H @ P @ H.T + R, len(V)
    N, one = H[:, :k], np.ones(m)
    if by == "ratio":
        s = (V**2 / r).sum()
        return max(min(1.0, np.diag(H @ P @ H.T / r).sum() / (s - m)) if s > m else 1.0, floor), one
    if by == "trace":
        return max(min(1.0, np.trace(H @ P @ H.T) / (V @ V - np.trace(R))) if np.trace(S) < V @ V else 1.0, floor), one
    if by == "three_part":
        return max(igg3(np.sqrt(V @ np.linalg.solve(S, V) / m)), floor), one
    if by == "two_part":
        return max(min(1.0, 1.5 / np.sqrt(V @ np.linalg.solve(S, V) / m)), floor), one
    if by == "norm":
        return max(igg3(np.sqrt(V @ V / np.trace(S))), floor), one
    if by == "innovations":
        return 1.0, np.maximum(igg3(V / np.sqrt(np.diag(S))), robust.FLOOR)
    w = one
    for _ in range(4 if by == "robust" else 1):
        A = N.T @ np.diag(w / r) @ N
        d = np.linalg.solve(A, N.T @ (w / r * V))
        w = np.maximum(igg3((V - N @ d) / np.sqrt(r)), robust.FLOOR)
    spread = d @ d / np.trace(P[:k, :k]) if by == "literal" else (
        d @ np.linalg.solve(P[:k, :k] + np.linalg.inv(A), d) / k
    )  # fmt: skip
    return max(igg3(np.sqrt(spread)), floor), w if by == "robust" else one


@pytest.mark.parametrize("off", [0.0, 2.0, 4.0, 1e4])
@pytest.mark.parametrize("by", adaptive.HOOKS)
def test_every_hook_is_its_formula_and_then_the_update(epoch, by, off):
    """P becomes P / alpha and R_ab becomes R_ab / sqrt(w_a w_b); what is whitened is the innovation before."""
    prior, H, R, z = epoch
    z = z + off * np.array([1.0, -0.5, 0.3, 0.0, 1.0])
    R = R + (0.1 if by in ("three_part", "two_part", "norm", "innovations") else 0.0)
    course = judged(prior, z, H, R, by=by)
    alpha, w = written_out(by, z - H @ prior.mean, prior.cov, H, R)
    assert course.alpha[0] == pytest.approx(alpha, rel=1e-9)
    np.testing.assert_allclose(course.weights[0], w, rtol=1e-7)
    wanted, _ = update(gaussian(prior.mean, prior.cov / alpha), z, H, R / np.sqrt(w[:, None] * w))
    np.testing.assert_allclose(course.mean[0], wanted.mean, rtol=1e-8)
    np.testing.assert_allclose(course.cov[0], wanted.cov, rtol=1e-8, atol=1e-11)
    np.testing.assert_allclose(course.whitened[0], update(prior, z, H, R)[1].whitened, rtol=1e-9)
    np.testing.assert_array_equal(course.predicted_cov[0], prior.cov)


@pytest.mark.parametrize("by", adaptive.HOOKS)
def test_a_hook_judges_what_is_there(epoch, by):
    prior, H, R, z = epoch
    gap = judged(prior, np.full(5, np.nan), H, R, by=by)
    assert gap.alpha[0] == 1.0 and np.isnan(gap.whitened).all() and np.isnan(gap.weights).all()
    np.testing.assert_array_equal(gap.mean[0], prior.mean)
    partly, keep = z + 3.0, [1, 2, 4]
    partly[[0, 3]] = np.nan
    one = judged(prior, partly, H, R, by=by, states=2)
    other = judged(prior, partly[keep], H[keep], R[np.ix_(keep, keep)], by=by, states=2)
    np.testing.assert_allclose(one.mean, other.mean, rtol=1e-12)
    np.testing.assert_array_equal(one.weights[0, keep], other.weights[0])
    assert one.alpha[0] == other.alpha[0] and np.isnan(one.weights[0, [0, 3]]).all()


@pytest.mark.parametrize("by", ["discrepancy", "robust", "literal"])
def test_states_that_an_epoch_does_not_determine_are_not_judged(epoch, by):
    prior, H, R, z = epoch
    few = z + 100.0
    few[:3] = np.nan
    course, (plain, _) = judged(prior, few, H, R, by=by), update(prior, few, H, R)
    assert np.isnan(course.alpha[0])
    np.testing.assert_array_equal(course.weights[0, 3:], 1.0)
    np.testing.assert_allclose(course.mean[0], plain.mean, rtol=1e-12)
    np.testing.assert_allclose(course.cov[0], plain.cov, rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("by", adaptive.HOOKS)
def test_compiled_hooks_equal_plain_python(epoch, by, request):
    """Three epochs, the second with an outlier, of a linear sensor and of one with functions."""
    prior, H, R, z = epoch
    Z = np.array([z, z + [9.0, 0, 0, 0, 0], z - 2.0])
    for sensor in (Sensor(Z, R, H=H), Sensor(Z, R, h=lambda x, t: H @ x, H=lambda x, t: H)):
        courses = []
        for _ in range(2):
            courses.append(run(prior, [0.0, 1.0, 2.0], STILL, [sensor], adaptive=Adaptive(by=by)))
            request.getfixturevalue("interpreted")
        for name in ("mean", "cov", "whitened", "alpha", "weights"):
            one, other = (getattr(course, name) for course in courses)
            np.testing.assert_allclose(one, other, rtol=1e-11, atol=1e-13)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"by": "median"}, "the hook 'median' is unknown: the hooks are ratio, three_part"),
        ({"by": "ratio", "floor": 0.0}, "floor = 0 of the adaptive factor: it must be above 0 and at most 1"),
        ({"by": "ratio", "floor": 1.5}, "above 0 and at most 1"),
        ({"by": "ratio", "floor": np.nan}, "above 0 and at most 1"),
        ({"by": "ratio", "states": 0}, "states = 0: at least one state"),
        ({"by": "ratio", "k0": 2.5, "k1": 1.5}, "k0 below k1"),
    ],
)
def test_settings_out_of_range_are_refused(settings, message):
    with pytest.raises(ValueError, match=message):
        Adaptive(**settings)


def test_what_does_not_go_with_a_hook_is_refused(epoch):
    prior, H, R, z = epoch
    linear, ranges = Sensor(z[None], R, H=H), Sensor(z[None], R, h=lambda x, t: H @ x, H=lambda x, t: H)
    hook = Adaptive(by="ratio")
    for options in ({"iterations": 2}, {"gate": 9.0}):
        with pytest.raises(ValueError, match="one linearisation and no gate"):
            run(prior, [0.0], STILL, [linear], adaptive=hook, **options)
    with pytest.raises(ValueError, match="adaptive hook .* sensor 1 is unscented"):
        run(prior, [0.0], STILL, [linear, ranges], "unscented", adaptive=hook)
    assert run(prior, [0.0], STILL, [linear], "unscented", adaptive=hook).alpha.shape == (1,)
    with pytest.raises(ValueError, match="states = 5 of the adaptive hook: the state has 4"):
        judged(prior, z, H, R, by="discrepancy", states=5)


def test_a_prediction_without_root_is_told():
    with pytest.raises(NotPositiveDefinite, match="innovation covariance is not positive definite at epoch 0"):
        judged((np.zeros(4), np.zeros((4, 4))), np.ones(1), np.eye(1, 4), np.zeros((1, 1)), by="innovations")


@pytest.mark.parametrize(("dof", "rate"), [(7, 0.028), (3, 0.080)])
def test_false_alarms_on_clean_data(dof, rate):
    """What the module says about 1.5: the share of good epochs on which its factor falls below one, drawn and exact."""
    white = np.random.default_rng(11).standard_normal((60_000, dof))
    fired = np.mean([adaptive.three_part(adaptive.predicted_residual(w), 1.5, 2.5, 1e-3) < 1.0 for w in white])
    assert fired == pytest.approx(chi2.sf(1.5**2 * dof, dof), abs=0.0035)  # three binomial standard deviations
    assert fired == pytest.approx(rate, abs=0.0035)


def drift(adapt: bool, process: float) -> float:
    """RMS error of a scalar random walk of step 1 observed with noise 1 by a filter that believes `process`."""
    rng = np.random.default_rng(3)
    truth, noise = np.cumsum(rng.standard_normal(1500)), rng.standard_normal(1500)
    course = run(
        gaussian([0.0], [1.0]), np.arange(1500.0), Model(F=[[1.0]], Q=[[process**2]]),
        [Sensor((truth + noise)[:, None], [[1.0]], H=[[1.0]])], adaptive=Adaptive(by="three_part") if adapt else None,
    )  # fmt: skip
    return float(np.sqrt(np.mean(np.square(course.mean[:, 0] - truth))))


def test_what_adaptation_costs_and_saves():
    assert drift(True, 0.01) < 0.5 * drift(False, 0.01)  # a process noise far too small
    assert drift(False, 1.0) <= drift(True, 1.0) < 1.15 * drift(False, 1.0)  # the right one: a little is lost
    assert drift(False, 1.0) < drift(True, 0.01)  # and the right noise beats adaptation


def test_factors_by_hand():
    """Residuals 3 and 1, variances S 4 and 2, R 1 and 1/2: weighted sums 11 and 6, plain sums 10, 6 and 1.5."""
    V, S, R = np.array([3.0, 1.0]), np.diag([4.0, 2.0]), np.diag([1.0, 0.5])
    assert adaptive.ratio_factor(V, S, R, 0.1) == pytest.approx(6.0 / 9.0)
    assert adaptive.trace_factor(V, S, R, 0.1) == pytest.approx(4.5 / 8.5)
    assert adaptive.ratio_factor(V, S, R, 0.7) == adaptive.trace_factor(V, S, R, 0.7) == 0.7
    assert adaptive.norm_ratio(V, S) == pytest.approx(np.sqrt(10.0 / 6.0))
    assert adaptive.predicted_residual(V) == pytest.approx(np.sqrt(5.0))
    assert adaptive.two_part(-3.0, 1.5, 0.1) == 0.5 and adaptive.two_part(3.0, 1.5, 0.6) == 0.6
