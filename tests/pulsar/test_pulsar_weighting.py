"""RAEKF in its readings: the same as the core's hooks where they overlap, fixed points, and a wrong range found."""

import numba
import numpy as np
import pytest

from geokalman.kalman.robust import igg3
from geokalman.pulsar import assess, estimate, simulate, weighting
from geokalman.pulsar.estimate import Diverged, Tuning
from geokalman.pulsar.model import preset
from geokalman.pulsar.observations import Observations
from geokalman.pulsar.weighting import RESIDUALS, Weighting, weighted_update_step

days_of_orbit = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="days of orbit take minutes in plain Python")


@days_of_orbit
@pytest.mark.parametrize(
    ("given", "kind", "tuning"),
    [
        (Weighting("least-squares", (1.5, 2.5), (1.5, 2.5)), "raekf", Tuning()),
        (Weighting("innovations", (3.0, 8.0)), "igg", Tuning(3.0, 8.0)),
        (Weighting("posterior", (1e6, 2e6)), "ekf", Tuning()),
    ],
)
def test_the_core_filters_where_the_readings_overlap(day, given, kind, tuning):
    data = simulate.observe(day.flight, day.mission, preset("B").world, np.random.default_rng(4), 0.05)
    data = data.masked(np.random.default_rng(5).random(data.z.shape) < 0.2)
    ours = weighting.run(data, day.flight.x0, preset("B").belief, day.force, given)
    core = estimate.run(kind, data, day.flight.x0, preset("B").belief, day.force, tuning)
    np.testing.assert_allclose(ours.x, core.x, rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(ours.P, core.P, rtol=1e-6)
    np.testing.assert_allclose(ours.alpha, core.alpha, rtol=1e-6)
    np.testing.assert_allclose(ours.weights, core.weights, rtol=1e-6)
    np.testing.assert_allclose(ours.nis, core.nis, rtol=1e-6)
    assert (ours.skipped == core.skipped).all() or kind != "raekf"


def posterior(V, H, P, variance, k0, k1):
    """Iterate weights and update by dense algebra: the fixed point, and its weights."""
    w = np.ones(len(V))
    for _ in range(500):
        S = H @ P @ H.T + np.diag(variance / w)
        x = P @ H.T @ np.linalg.solve(S, V)
        w = 0.5 * (w + np.maximum([igg3(s, k0, k1) for s in (V - H @ x) / np.sqrt(variance)], 1e-8))
    return x, w


def test_posterior_weights_are_a_fixed_point_and_find_a_wrong_range():
    rng = np.random.default_rng(2)
    N = rng.standard_normal((5, 3))
    H = np.hstack([N / np.linalg.norm(N, axis=1)[:, None], np.zeros((5, 3))])
    variance, P = np.array([1.0, 4.0, 4.0, 9.0, 25.0]), np.diag([1.0, 1.0, 1.0, 1e-2, 1e-2, 1e-2])
    V = rng.standard_normal(5) * 0.3 * np.sqrt(variance)
    V[0] += 10.0
    x, P_out, weight, white = np.zeros(6), P.copy(), np.ones(5), np.empty(5)
    judged = RESIDUALS["posterior"], 1.5, 2.5, 0.0, 0.0, 1e-3
    assert weighted_update_step(judged, x, P_out, V, H, np.diag(variance), weight, white) == (0, 1.0)
    expected, weights = posterior(V, H, P, variance, 1.5, 2.5)
    np.testing.assert_allclose(x, expected, atol=1e-3)
    np.testing.assert_allclose(weight, weights, atol=1e-3)
    assert weight[0] < 1e-6 < 0.9 < weight[1:].min()
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + np.diag(variance / weight))
    np.testing.assert_allclose(P_out, P - K @ H @ P, atol=1e-9)


def test_a_factor_has_thresholds_of_its_own():
    H = np.hstack([np.vstack([np.eye(3), np.eye(3)]), np.zeros((6, 3))])
    V = np.tile([3.0, 0.0, 0.0], 2)
    P, s = 0.5 * np.eye(6), 3.0 / np.sqrt(3.0 * (0.5 + 0.5))  # two unit ranges an axis: covariance 1/2
    for pair in ((1.5, 2.5), (1.0, 8.0), (2.0, 3.0)):
        x, P_out, weight, white = np.zeros(6), P.copy(), np.ones(6), np.empty(6)
        judged = RESIDUALS["least-squares"], 1.5, 2.5, *pair, 1e-3
        status, alpha = weighted_update_step(judged, x, P_out, V, H, np.eye(6), weight, white)
        assert status == 0 and alpha == pytest.approx(max(igg3(s, *pair), 1e-3))
        assert x[0] == pytest.approx(3.0 * 0.5 / alpha / (0.5 / alpha + 0.5))


def test_epochs_without_enough_pulsars(day):
    z = day.data.z.copy()
    z[:, 2:] = np.nan
    z[7] = np.nan
    data = Observations(day.data.t[:12], z[:12], day.data.H, day.data.variance)
    given = Weighting("least-squares", (1.5, 2.5), (1.5, 2.5))
    run = weighting.run(data, day.flight.x0, preset("B").belief, day.force, given)
    plain = estimate.run("ekf", data, day.flight.x0, preset("B").belief, day.force)
    np.testing.assert_allclose(run.x, plain.x, rtol=1e-9, atol=1e-6)
    assert run.skipped[[0, 6, 8]].all() and (run.alpha == 1.0).all() and np.isnan(run.weights[7]).all()


def test_what_a_reading_refuses(day):
    with pytest.raises(ValueError, match="residuals 'prior' are unknown"):
        Weighting("prior")
    for wrong in ({"weights": (2.5, 1.5)}, {"factor": (0.0, 1.0)}):
        with pytest.raises(ValueError, match="k0 below k1"):
            Weighting(**wrong)
    with pytest.raises(Diverged, match="sigma"):
        belief = preset("A", p0=(1e9, 1.0)).belief
        weighting.run(day.data, day.flight.x0, belief, day.force, Weighting())


@days_of_orbit
def test_posterior_weights_resist_outliers_and_a_factor_spoils_it(day):
    """Over a day: what the page shows over five."""
    data = simulate.observe(day.flight, day.mission, preset("B").world, np.random.default_rng(1), 0.05)
    scores = {
        factor: assess.score(
            weighting.run(data, day.flight.x0, preset("B").belief, day.force, Weighting("posterior", factor=factor)),
            day.flight, 10,
        ).d3
        for factor in (None, (1.5, 2.5))
    }  # fmt: skip
    assert scores[None] < 0.2 * scores[1.5, 2.5]
