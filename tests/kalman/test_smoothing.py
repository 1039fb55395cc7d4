"""RTS, two filters and information smoothing: equal to each other, to statsmodels and to the dense posterior."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from geokalman.kalman import (
    Information,
    NotPositiveDefinite,
    gaussian,
    smooth,
    smooth_information,
    smooth_two_filter,
    white_jerk,
)
from geokalman.kalman.information import combine_step, information_back_step, information_predict_step
from geokalman.kalman.smoothing import rts_mean_step, rts_step


@pytest.fixture(scope="module")
def course(problem):
    return problem.filter()


def test_rts_is_the_dense_posterior(course, exact, close):
    s = smooth(course)
    close(s.mean, s.cov, *exact, 1e-9)
    assert np.array_equal(s.cov, s.cov.transpose(0, 2, 1))


def test_two_filter_is_the_dense_posterior(problem, course, exact, close):
    s = smooth_two_filter(course, problem.z, problem.H, problem.R)
    close(s.mean, s.cov, *exact, 1e-9)


def test_two_filter_is_rts(problem, course, close):
    one, other = smooth(course), smooth_two_filter(course, problem.z, problem.H, problem.R)
    close(one.mean, one.cov, other.mean, other.cov, 1e-9)


def test_information_smoother_is_the_dense_posterior_with_and_without_prior(problem, exact, close):
    p = problem
    prior = Information(np.linalg.solve(p.prior.cov, p.prior.mean), np.linalg.inv(p.prior.cov))
    s = smooth_information(p.t, p.z, p.H, p.R, p.transition, prior)
    close(s.mean, s.cov, *exact, 1e-9)
    s = smooth_information(p.t, p.z, p.H, p.R, p.transition)
    close(s.mean, s.cov, *p.exact(prior=None), 1e-9)


def test_agrees_with_statsmodels_smoother(problem, course, close):
    from statsmodels.tsa.statespace.kalman_smoother import KalmanSmoother

    p, (m, n) = problem, problem.H.shape[1:]
    peer = KalmanSmoother(k_endog=m, k_states=n, k_posdef=n)
    peer.bind(p.z.copy())
    peer["design"], peer["obs_cov"] = p.H.transpose(1, 2, 0), p.R.transpose(1, 2, 0)
    peer["transition"] = np.concatenate([p.Phi, p.Phi[-1:]]).transpose(1, 2, 0)
    peer["state_cov"] = np.concatenate([p.Q, p.Q[-1:]]).transpose(1, 2, 0)
    peer["selection"] = np.eye(n)
    peer.initialize_known(p.prior.mean, p.prior.cov)
    theirs, ours = peer.smooth(), smooth(course)
    close(ours.mean, ours.cov, theirs.smoothed_state.T, theirs.smoothed_state_cov.transpose(2, 0, 1), 1e-9)


def test_smoothing_never_adds_uncertainty_and_leaves_the_last_state(course):
    s = smooth(course)
    gain = course.cov - s.cov
    sigma = np.sqrt(np.diagonal(course.cov, axis1=1, axis2=2))
    assert np.linalg.eigvalsh(gain / sigma[:, :, None] / sigma[:, None, :]).min() > -1e-12
    assert np.array_equal(s.mean[-1], course.mean[-1]) and np.array_equal(s.cov[-1], course.cov[-1])


def test_mean_step_is_the_mean_of_the_full_step(course):
    k = 3
    args = [course.mean[k], course.cov[k], course.predicted_mean[k + 1], course.predicted_cov[k + 1]]
    Phi, Q = course.transition[course.step[k]], course.process_noise[course.step[k]]
    x_next, P_next = course.mean[k + 1], course.cov[k + 1]
    n = len(x_next)
    x1, x2, P = np.empty(n), np.empty(n), np.empty((n, n))
    assert rts_mean_step(*args, Phi, x_next, x1) == 0
    assert rts_step(*args, Phi, Q, x_next, P_next, x2, P) == 0
    np.testing.assert_allclose(x1, x2, rtol=1e-11)
    textbook = args[1] @ Phi.T @ np.linalg.inv(args[3])
    np.testing.assert_allclose(P, args[1] + textbook @ (P_next - args[3]) @ textbook.T, rtol=1e-7, atol=1e-12)
    x_in_place = args[0].copy()
    assert rts_mean_step(x_in_place, args[1], args[2], args[3], Phi, x_next, x_in_place) == 0
    assert np.array_equal(x_in_place, x1)


def test_compiled_smoother_equals_plain_python(course, request):
    compiled = smooth(course)
    request.getfixturevalue("interpreted")
    plain = smooth(course)
    np.testing.assert_allclose(plain.mean, compiled.mean, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(plain.cov, compiled.cov, rtol=1e-9, atol=1e-14)


def test_steps_of_the_information_form_are_those_of_the_covariance_form():
    rng = np.random.default_rng(8)
    A, B = rng.standard_normal((2, 6, 6))
    P, Q = A @ A.T, B[:, :3] @ B[:, :3].T  # noise of rank three
    x, Phi = rng.standard_normal(6), white_jerk(2.0, 1.0, 2)[0]
    G = np.zeros((6, 6))
    G[:3] = B[:, :3].T
    Y = np.linalg.inv(P)
    y = Y @ x
    information_predict_step(y, Y, np.linalg.inv(Phi), G)
    cov = np.linalg.inv(Y)
    np.testing.assert_allclose(cov, Phi @ P @ Phi.T + Q, rtol=1e-8)
    np.testing.assert_allclose(cov @ y, Phi @ x, rtol=1e-7, atol=1e-9)
    Y = np.linalg.inv(P)
    y = Y @ x
    information_back_step(y, Y, Phi, G)  # x_before = Phi^-1 (x - w)
    back = np.linalg.inv(Phi)
    np.testing.assert_allclose(np.linalg.inv(Y), back @ (P + Q) @ back.T, rtol=1e-8)
    np.testing.assert_allclose(np.linalg.solve(Y, y), back @ x, rtol=1e-7, atol=1e-9)


def test_combination_of_a_known_state_with_anything_leaves_it():
    x, P = np.array([1.0, 2.0]), np.diag([0.0, 4.0])
    x_out, P_out = np.empty(2), np.empty((2, 2))
    assert combine_step(x, P, np.array([0.0, 0.5]), np.diag([9.0, 0.25]), x_out, P_out) == 0
    np.testing.assert_allclose(x_out, [1.0, 3.0], rtol=2e-15)
    np.testing.assert_allclose(P_out, [[0.0, 0.0], [0.0, 2.0]], rtol=2e-15)
    assert combine_step(x, np.diag([1.0, -4.0]), x, np.eye(2), x_out, P_out) == 2


def test_undetermined_states_are_named():
    t, H = [0.0, 1.0, 2.0], np.eye(1, 3)
    z = [[1.0], [np.nan], [2.0]]  # two positions cannot give three states
    with pytest.raises(NotPositiveDefinite, match=r"information matrix .* at epoch 0 .* do not determine state 2"):
        smooth_information(t, z, H, [[1.0]], (white_jerk(1.0, 1.0, 1)[0], np.zeros((3, 3))))


def test_singular_predicted_covariance_names_the_epoch(filter_linear):
    steps = (np.eye(2), np.zeros((2, 2)))
    run = filter_linear(gaussian([0, 0], [1.0, 0.0]), [0.0, 10.0, 20.0], np.zeros((3, 1)), [[1.0, 0.0]], [[1.0]], steps)
    match = r"predicted covariance .* at epoch 2 \(t = 20 s\).* pivot 1"
    with pytest.raises(NotPositiveDefinite, match=match) as error:
        smooth(run)
    assert error.value.epoch == 2
    s = smooth_two_filter(run, np.zeros((3, 1)), [[1.0, 0.0]], [[1.0]])  # needs no inverse of a covariance
    np.testing.assert_allclose(s.cov, np.broadcast_to(np.diag([0.25, 0.0]), (3, 2, 2)), rtol=1e-14)


def test_a_trajectory_from_elsewhere_is_judged_too(problem, course):
    bad = replace(course, process_noise=-course.process_noise)
    with pytest.raises(NotPositiveDefinite, match="process noise covariance"):
        smooth_two_filter(bad, problem.z, problem.H, problem.R)
    bad = replace(course, cov=-course.cov)
    with pytest.raises(NotPositiveDefinite, match="filtered covariance is not positive definite at epoch 0"):
        smooth_two_filter(bad, problem.z, problem.H, problem.R)
    x = np.zeros(2)
    assert rts_mean_step(x, np.eye(2), x, np.diag([1.0, 0.0]), np.eye(2), x, x) == 2


def test_information_form_needs_observation_noise(filter_linear):
    steps = (np.eye(1), np.eye(1))
    run = filter_linear(gaussian([0.0], [1.0]), [0.0, 1.0], [[1.0], [2.0]], [[1.0]], [[0.0]], steps)
    with pytest.raises(NotPositiveDefinite, match="observation noise covariance .* at epoch 1"):
        smooth_two_filter(run, [[1.0], [2.0]], [[1.0]], [[0.0]])
    with pytest.raises(NotPositiveDefinite, match="observation noise covariance .* at epoch 0"):
        smooth_information([0.0, 1.0], [[1.0], [2.0]], [[1.0]], [[0.0]], steps)
    with pytest.raises(ValueError, match=r"z has the shape \(3, 1\), it must be \(2, any\)"):
        smooth_two_filter(run, [[1.0], [2.0], [3.0]], [[1.0]], [[1.0]])
