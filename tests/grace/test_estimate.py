"""The three methods: against other filters, closed forms, plain Python; gaps, bad input, errata."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numba
import numpy as np
import pytest

from geokalman import kalman
from geokalman.grace import estimate
from geokalman.grace.estimate import _range_rate_row
from geokalman.grace.model import Observations, Tuning, kinematic, range_rate
from geokalman.kalman import unscented
from geokalman.kalman.checks import NotPositiveDefinite

METHODS = {"ekf": estimate.ekf, "ukf": estimate.ukf, "fused_ekf": estimate.fused_ekf}


@pytest.fixture(scope="module")
def short(tiny) -> Observations:
    """The first 60 epochs of the short pair, with gaps: a component, a position, a range-rate, a whole epoch."""
    baseline, rate = tiny.data.baseline[:60].copy(), tiny.data.rate[:60].copy()
    baseline[7, 1] = baseline[20] = baseline[33] = np.nan
    rate[12] = rate[33] = np.nan
    return Observations(tiny.data.dt, baseline, rate, tiny.data.prior_mean, tiny.data.prior_cov)


def core_position_filter(data: Observations, tuning: Tuning):
    """The position-only filter written out: the core's run on matrices."""
    Phi, Q = kinematic(data.dt, tuning.q(data.dt))
    position = kalman.Sensor(data.baseline, tuning.sigma_r**2 * np.eye(3), H=np.eye(3, 9))
    t = data.dt * np.arange(len(data.rate))
    return kalman.run(kalman.gaussian(data.prior_mean, data.prior_cov), t, kalman.Model(F=Phi, Q=Q), [position])


def core_fused_filter(data: Observations, tuning: Tuning, which: str):
    """Position, then range-rate, by the core's generic extended or unscented filter."""
    Phi, Q = kinematic(data.dt, tuning.q(data.dt))

    def gradient(x, t):
        H = np.empty(9)
        _range_rate_row(x, H)
        return H[None]

    sensors = [
        kalman.Sensor(
            z=data.baseline, h=lambda x, t: x[:3], H=lambda x, t: np.eye(3, 9), R=tuning.sigma_r**2 * np.eye(3)
        ),
        kalman.Sensor(
            z=data.rate[:, None],
            h=lambda x, t: np.array([range_rate(x[:3], x[3:6])]),
            H=gradient,
            R=tuning.sigma_rr(data.dt) ** 2 * np.eye(1),
        ),
    ]
    prior, t = kalman.gaussian(data.prior_mean, data.prior_cov), data.dt * np.arange(len(data.rate))
    model = kalman.Model(f=lambda x, t0, t1: Phi @ x, F=lambda x, t0, t1: Phi, Q=Q)
    if which == "ukf":
        scaling = {"alpha": tuning.alpha, "beta": tuning.beta, "kappa": tuning.kappa}
        return kalman.run(prior, t, model, sensors, "unscented", **scaling)
    return kalman.run(prior, t, model, sensors)


def assert_same(ours, theirs, P, rel):
    """States that agree within `rel` of their standard deviations."""
    sigma = np.sqrt(np.diagonal(P, axis1=1, axis2=2))
    assert np.abs((ours - theirs) / sigma).max() <= rel


# --- against other filters -------------------------------------------------------------------------------------------


def test_position_filter_is_the_core_linear_filter(short):
    ours, theirs = estimate.ekf(short, Tuning(), covariances=True), core_position_filter(short, Tuning())
    assert_same(ours.filtered.x, theirs.mean, theirs.cov, 1e-5)
    np.testing.assert_allclose(ours.filtered.P, theirs.cov, rtol=1e-9, atol=1e-16)
    smooth = kalman.smooth(theirs)
    assert_same(ours.smoothed.x, smooth.mean, smooth.cov, 1e-5)
    np.testing.assert_allclose(ours.smoothed.P, smooth.cov, rtol=1e-7, atol=1e-16)


@pytest.mark.parametrize("which", ["ukf", "ekf"])
def test_fused_filters_are_the_core_filters(short, which):
    theirs = core_fused_filter(short, Tuning(), which)
    ours = {"ukf": estimate.ukf, "ekf": estimate.fused_ekf}[which](short, Tuning())
    assert_same(ours.filtered.x, theirs.mean, theirs.cov, 1e-5)
    np.testing.assert_allclose(ours.innovations, theirs.whitened, rtol=0, atol=1e-4)
    smooth = kalman.smooth(theirs)
    assert_same(ours.smoothed.x, smooth.mean, smooth.cov, 1e-4)


@pytest.mark.parametrize("which", ["ukf", "ekf"])
def test_simultaneous_filters_are_the_core_filters_of_one_vector(tiny, which):
    """Position and range-rate in one sensor of four components."""
    data, tuning = (
        Observations(30.0, tiny.data.baseline[:40], tiny.data.rate[:40], tiny.data.prior_mean, tiny.data.prior_cov),
        Tuning(),
    )
    Phi, Q = kinematic(30.0, tuning.q(30.0))

    def gradient(x, t):
        H = np.eye(4, 9)
        _range_rate_row(x, H[3])
        return H

    R = np.diag(np.r_[np.full(3, tuning.sigma_r**2), tuning.sigma_rr(30.0) ** 2])
    sensor = kalman.Sensor(
        z=np.column_stack([data.baseline, data.rate]),
        R=R,
        H=gradient,
        h=lambda x, t: np.append(x[:3], range_rate(x[:3], x[3:6])),
    )
    prior, t = kalman.gaussian(data.prior_mean, data.prior_cov), 30.0 * np.arange(40)
    model = kalman.Model(f=lambda x, t0, t1: Phi @ x, F=lambda x, t0, t1: Phi, Q=Q)
    kind = {"ukf": "unscented", "ekf": "extended"}[which]
    theirs = kalman.run(prior, t, model, [sensor], kind, alpha=1.0, beta=0.0, kappa=2.0)
    ours = {"ukf": estimate.ukf, "ekf": estimate.fused_ekf}[which](data, tuning, "simultaneous")
    assert_same(ours.filtered.x, theirs.mean, theirs.cov, 1e-4)
    np.testing.assert_allclose(ours.innovations, theirs.whitened, rtol=0, atol=1e-4)


def test_three_states_per_axis_are_the_nine_states(tiny):
    """Without range-rates the axes decouple: section 7's unit test, to 1e-9 m (positions are 2e5 m)."""
    tuning, data = Tuning(), tiny.data
    nine = estimate.ekf(data, tuning)
    t = data.dt * np.arange(len(data.rate))
    for axis in range(3):
        prior = kalman.gaussian(data.prior_mean[axis::3], np.diag(data.prior_cov)[axis::3])
        Phi, Q = kalman.white_jerk(data.dt, tuning.q(data.dt), axes=1)
        position = kalman.Sensor(data.baseline[:, axis : axis + 1], [[tuning.sigma_r**2]], H=[[1.0, 0.0, 0.0]])
        three = kalman.run(prior, t, kalman.Model(F=Phi, Q=Q), [position])
        np.testing.assert_allclose(nine.filtered.x[:, axis::3], three.mean, rtol=0, atol=1e-9)
        np.testing.assert_allclose(nine.smoothed.x[:, axis::3], kalman.smooth(three).mean, rtol=0, atol=1e-9)


def test_unscented_update_of_a_linear_observation_is_the_kalman_update():
    """Section 8: UKF = KF for a linear observation to 1e-10, at the prior of the application."""
    Phi, Q = kinematic(30.0, Tuning().q(30.0))
    prior = kalman.gaussian(
        [2e5, 1e4, -3e4, 20.0, -5.0, 3.0, 0.1, 0.2, -0.3], Phi @ np.diag(np.repeat([1e-4, 1e-6, 1e-8], 3)) @ Phi.T + Q
    )
    H, R, z = np.eye(3, 9), 1e-6 * np.eye(3), np.array([2e5 + 0.3, 1e4 - 0.2, -3e4 + 0.1])
    linear, _ = kalman.linear.update(prior, z, H, R)
    sigma, _ = unscented.update(prior, z, lambda x: H @ x, R, alpha=1.0, beta=0.0, kappa=2.0)
    scale = np.sqrt(np.diag(linear.cov))
    np.testing.assert_allclose((sigma.mean - linear.mean) / scale, 0.0, atol=1e-7)  # 1e-10 m on 2e5 m
    np.testing.assert_allclose(sigma.mean, linear.mean, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(
        sigma.cov / np.outer(scale, scale), linear.cov / np.outer(scale, scale), rtol=0, atol=1e-9
    )


def test_sequential_position_is_joint_position(short):
    """Scalar updates of the three components are one vector update, where no range-rate is there to differ."""
    silent = Observations(short.dt, short.baseline, np.full(60, np.nan), short.prior_mean, short.prior_cov)
    reference = estimate.ekf(silent, Tuning()).filtered
    for method in (estimate.ukf, estimate.fused_ekf):
        for update in ("sequential", "simultaneous"):
            theirs = method(silent, Tuning(), update).filtered
            assert_same(theirs.x, reference.x, reference.P, 0.0 if update == "sequential" else 1e-6)


# --- gradient of the range-rate --------------------------------------------------------------------------------------


def test_gradient_of_the_range_rate_by_complex_step(tiny):
    x = np.concatenate([tiny.orbit.dr[17], tiny.orbit.dv[17], [0.1, -0.2, 0.3]])
    H = np.full(9, np.nan)
    assert _range_rate_row(x, H) == pytest.approx(float(range_rate(x[:3], x[3:6])), rel=1e-14)
    for j in range(9):
        moved = x.astype(complex)
        moved[j] += 1e-20j
        rate = moved[:3] @ moved[3:6] / np.sqrt(moved[:3] @ moved[:3])
        assert H[j] == pytest.approx(rate.imag / 1e-20, rel=1e-12, abs=1e-18)


def test_gradient_of_the_range_rate_by_central_differences(tiny):
    x = np.concatenate([tiny.orbit.dr[5], tiny.orbit.dv[5], np.zeros(3)])
    H = np.empty(9)
    _range_rate_row(x, H)
    for j, step in enumerate([1.0] * 3 + [1e-3] * 6):
        up, down = x.copy(), x.copy()
        up[j] += step
        down[j] -= step
        slope = (range_rate(up[:3], up[3:6]) - range_rate(down[:3], down[3:6])) / (2 * step)
        assert H[j] == pytest.approx(slope, rel=1e-7, abs=1e-11)


def test_rate_sigma_is_the_propagated_covariance(short):
    filtered = estimate.ekf(short, Tuning()).filtered
    sigma = filtered.rate_sigma(slice(10, 15))
    H = np.empty(9)
    for k, s in zip(range(10, 15), sigma, strict=True):
        _range_rate_row(filtered.x[k], H)
        assert s == pytest.approx(np.sqrt(H @ filtered.P[k] @ H), rel=1e-12)


# --- compiled and plain ----------------------------------------------------------------------------------------------

_PLAIN = """
import json, sys
import numpy as np
from geokalman.grace import estimate
from geokalman.grace.model import Observations, Tuning
data = Observations(**{k: np.array(v) if isinstance(v, list) else v for k, v in json.load(sys.stdin).items()})
out = {}
for name, method in (("ekf", estimate.ekf), ("ukf", estimate.ukf), ("fused_ekf", estimate.fused_ekf)):
    for update in ("sequential", "simultaneous") if name != "ekf" else (None,):
        words = {"update": update} if update else {}
        found = method(data, Tuning(), covariances=True, **words)
        out[f"{name}-{update}"] = [a.tolist() for a in (found.filtered.x, found.smoothed.x, found.smoothed.P, found.innovations)]
json.dump(out, sys.stdout)
"""


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")
def test_compiled_loops_are_the_plain_ones(short):
    """Every loop with all its callees, without compilation, in another process; only fused multiply-adds may differ."""
    given = {
        "dt": short.dt,
        "baseline": short.baseline,
        "rate": short.rate,
        "prior_mean": short.prior_mean,
        "prior_cov": short.prior_cov,
    }
    text = json.dumps({k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in given.items()})
    done = subprocess.run(
        [sys.executable, "-c", _PLAIN],
        input=text,
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | {"NUMBA_DISABLE_JIT": "1"},
    )
    for key, (filtered, smoothed, P, innovations) in json.loads(done.stdout).items():
        name, update = key.split("-")
        words = {} if update == "None" else {"update": update}
        ours = METHODS[name](short, Tuning(), covariances=True, **words)
        assert_same(ours.filtered.x, np.array(filtered), ours.filtered.P, 1e-5)
        assert_same(ours.smoothed.x, np.array(smoothed), ours.smoothed.P, 1e-4)
        np.testing.assert_allclose(ours.smoothed.P, np.array(P), rtol=1e-6, atol=1e-15)
        np.testing.assert_allclose(ours.innovations, np.array(innovations), rtol=0, atol=1e-4)


# --- gaps ------------------------------------------------------------------------------------------------------------


def test_gaps_leave_no_innovation_and_no_nan(short):
    for update in ("sequential", "simultaneous"):
        found = estimate.ukf(short, Tuning(), update, covariances=True)
        np.testing.assert_array_equal(
            np.isnan(found.innovations), np.column_stack([np.isnan(short.baseline), np.isnan(short.rate)])
        )
        assert np.isfinite(found.filtered.x).all() and np.isfinite(found.smoothed.x).all()


def test_a_gap_is_predicted_across(short):
    """At an epoch with nothing, filtered is predicted; the smoother closes the gap from both sides."""
    found = estimate.ukf(short, Tuning(), covariances=True)
    Phi, Q = kinematic(short.dt, Tuning().q(short.dt))
    np.testing.assert_allclose(found.filtered.x[33], Phi @ found.filtered.x[32], rtol=1e-14)
    np.testing.assert_allclose(found.filtered.P[33], Phi @ found.filtered.P[32] @ Phi.T + Q, rtol=1e-12)
    sigma = np.sqrt(found.smoothed.P[:, 0, 0])
    assert sigma[33] > 2 * sigma[30]
    assert sigma[33] < 0.25 * np.sqrt(found.filtered.P[33, 0, 0])


def test_position_filter_needs_no_range_rates(short):
    silent = Observations(short.dt, short.baseline, np.full(60, np.nan), short.prior_mean, short.prior_cov)
    np.testing.assert_array_equal(estimate.ekf(silent, Tuning()).smoothed.x, estimate.ekf(short, Tuning()).smoothed.x)


# --- what cannot be estimated ----------------------------------------------------------------------------------------


def test_a_singular_covariance_is_refused_with_its_epoch(tiny):
    """A prior of variance zero has no sigma points; the extended filter needs none."""
    certain = Observations(30.0, tiny.data.baseline[:20], tiny.data.rate[:20], tiny.data.prior_mean, np.zeros((9, 9)))
    with pytest.raises(NotPositiveDefinite, match="not positive definite at epoch 0") as caught:
        estimate.ukf(certain, Tuning())
    assert caught.value.epoch == 0
    with pytest.raises(NotPositiveDefinite, match="at epoch 0"):
        estimate.ukf(certain, Tuning(), "simultaneous")
    assert np.isfinite(estimate.fused_ekf(certain, Tuning()).filtered.x).all()


def test_an_overflow_is_refused_with_its_epoch(tiny):
    """A prior so wide that the predicted covariance overflows: an error, not a silent NaN."""
    wide = np.diag(np.repeat([1e-4, 1e-6, 1e306], 3))
    data = Observations(30.0, tiny.data.baseline[:20], tiny.data.rate[:20], tiny.data.prior_mean, wide)
    for method in METHODS.values():
        with (
            pytest.raises(
                NotPositiveDefinite,
                match=r"(innovation covariance|covariance of the state) is not positive definite at epoch 1\b",
            ),
            np.errstate(all="ignore"),
        ):
            method(data, Tuning())
    for method in (estimate.ukf, estimate.fused_ekf):
        with pytest.raises(NotPositiveDefinite, match=r"at epoch 1\b"), np.errstate(all="ignore"):
            method(data, Tuning(), "simultaneous")


@pytest.mark.parametrize(
    ("method", "matrix"),
    [
        ("ekf", "predicted covariance"),
        ("ukf", "covariance of the state"),
        ("fused_ekf", "innovation covariance"),
    ],
)
def test_a_prior_too_wide_for_double_precision_is_refused_with_its_epoch(tiny, method, matrix):
    """Forty orders of magnitude between prior and observation: filter or smoother says where it lost its digits."""
    wide = np.diag(np.repeat([1e-4, 1e-6, 1e20], 3))
    data = Observations(30.0, tiny.data.baseline, tiny.data.rate, tiny.data.prior_mean, wide)
    with pytest.raises(NotPositiveDefinite, match=rf"the {matrix} is not positive definite at epoch \d+"):
        METHODS[method](data, Tuning(lambda_q=1e-8))


def test_newton_needs_nine_epochs(tiny):
    few = Observations(30.0, tiny.data.baseline[:8], tiny.data.rate[:8], tiny.data.prior_mean, tiny.data.prior_cov)
    with pytest.raises(ValueError, match="8 epochs are too few for a 9-point stencil"):
        estimate.newton(few)


def test_one_epoch_is_enough_for_a_filter(tiny):
    one = Observations(30.0, tiny.data.baseline[:1], tiny.data.rate[:1], tiny.data.prior_mean, tiny.data.prior_cov)
    found = estimate.ukf(one, Tuning(), covariances=True)
    np.testing.assert_array_equal(found.smoothed.x, found.filtered.x)
    np.testing.assert_array_equal(found.smoothed.P, found.filtered.P)


# --- errata of the text ------------------------------------------------------------------------------------------------


def test_erratum_sigma_points_are_2n_plus_1_and_their_weights():
    """alpha 1, beta 0, kappa 2, n 9: lambda = 2, W0 = 2/11, Wi = 1/22; 19 points whose weights add up to one, 18 do
    not."""
    Wm, Wc = unscented.weights(9, 1.0, 0.0, 2.0)
    assert Wm.shape == Wc.shape == (2 * estimate.N + 1,) == (19,)
    assert Wm[0] == pytest.approx(2 / 11) and Wc[0] == pytest.approx(2 / 11)
    np.testing.assert_allclose(Wm[1:], 1 / 22)
    assert Wm.sum() == pytest.approx(1.0, abs=2e-15)
    assert Wm[1:].sum() == pytest.approx(9 / 11)  # the paper's "2n" points


def test_erratum_sigma_points_use_the_columns_of_a_root_of_n_plus_lambda_P():
    """(29)-(31): the points have the mean and covariance of the Gaussian."""
    P = np.diag(np.repeat([1e-4, 1e-6, 1e-8], 3)) + 1e-9
    chi = unscented.sigma_points(kalman.gaussian(np.arange(9.0), P), 1.0, 0.0, 2.0)
    Wm, Wc = unscented.weights(9, 1.0, 0.0, 2.0)
    np.testing.assert_allclose(Wm @ chi, np.arange(9.0), rtol=0, atol=1e-14)
    spread = chi - np.arange(9.0)
    np.testing.assert_allclose((Wc[:, None] * spread).T @ spread, P, rtol=1e-9, atol=1e-16)


def test_erratum_27_plus_sign_makes_the_covariance_grow(short):
    """P+ = P- + K Pee K' in the text we have: an observation that makes the state less certain."""
    Phi, Q = kinematic(30.0, Tuning().q(30.0))
    P = Phi @ short.prior_cov @ Phi.T + Q
    H, R = np.eye(3, 9), 1e-6 * np.eye(3)
    posterior, innovation = unscented.update(kalman.gaussian(np.zeros(9), P), np.zeros(3), lambda x: H @ x, R)
    K = np.linalg.solve(innovation.S, H @ P).T
    np.testing.assert_allclose(posterior.cov, P - K @ innovation.S @ K.T, rtol=0, atol=1e-9 * P.max())
    printed = P + K @ innovation.S @ K.T
    assert (np.linalg.eigvalsh(P - posterior.cov) > -1e-9 * P.max()).all()
    assert np.linalg.eigvalsh(P - printed).min() < -0.5 * P.max()


def test_erratum_30_root_of_a_column():
    """sqrt((n + lambda) p_i), p_i a column of P, as in the text we have: the points do not have covariance P."""
    P = np.eye(9) + 0.5
    chi = np.sqrt(11.0 * P)
    assert np.abs(2 / 22 * chi @ chi.T - P).max() > P.max()


def test_errata_39_41_need_process_and_observation_noise(short):
    """Without Q_d the filter's steady velocity sigma falls towards zero; without R a position is believed exactly."""
    Phi, Q = kinematic(30.0, Tuning().q(30.0))
    with_Q = unscented.predict(kalman.gaussian(np.zeros(9), short.prior_cov), lambda x: Phi @ x, Q, 1.0, 0.0, 2.0)
    np.testing.assert_allclose(with_Q.cov, Phi @ short.prior_cov @ Phi.T + Q, rtol=1e-12, atol=1e-18)
    _, innovation = unscented.update(with_Q, np.zeros(3), lambda x: x[:3], 1e-6 * np.eye(3), 1.0, 0.0, 2.0)
    np.testing.assert_allclose(innovation.S, with_Q.cov[:3, :3] + 1e-6 * np.eye(3), rtol=1e-12, atol=1e-18)


def test_erratum_52_order_of_the_state(short):
    """H of (52) picks the relative position from [dr, dv, da]; in the printed order it would observe an
    acceleration."""
    x = estimate.ekf(short, Tuning()).filtered
    there = ~np.isnan(short.baseline).any(axis=1)
    assert np.abs(x.dr - short.baseline)[there].max() < 1.0
    assert np.abs(x.x[:, 6:] - short.baseline)[there].max() > 1e4
