"""The linear filter against filterpy, statsmodels, a dense batch solution, and itself in other forms."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from geokalman.kalman import NotPositiveDefinite, gaussian, linear, white_jerk
from geokalman.kalman.linear import observed_update_step, predict_step, scalar_update_step, update_step


def test_agrees_with_statsmodels_with_gaps_and_irregular_steps(problem, close):
    from statsmodels.tsa.statespace.kalman_filter import KalmanFilter

    p, (m, n), N = problem, problem.H.shape[1:], len(problem.t)
    peer = KalmanFilter(k_endog=m, k_states=n, k_posdef=n)
    peer.bind(p.z.copy())
    peer["design"], peer["obs_cov"] = p.H.transpose(1, 2, 0), p.R.transpose(1, 2, 0)
    peer["transition"] = np.concatenate([p.Phi, p.Phi[-1:]]).transpose(1, 2, 0)
    peer["state_cov"] = np.concatenate([p.Q, p.Q[-1:]]).transpose(1, 2, 0)
    peer["selection"] = np.eye(n)
    peer.initialize_known(p.prior.mean, p.prior.cov)
    theirs = peer.filter()
    ours = p.filter()
    close(ours.mean, ours.cov, theirs.filtered_state.T, theirs.filtered_state_cov.transpose(2, 0, 1), 1e-9)
    close(
        ours.predicted_mean,
        ours.predicted_cov,
        theirs.predicted_state.T[:N],
        theirs.predicted_state_cov.transpose(2, 0, 1)[:N],
        1e-9,
    )
    loglike = -0.5 * np.nansum(ours.whitened**2)  # the quadratic form of the likelihood is the sum of all NIS
    log_det = 0.0
    for k in range(N):
        seen = ~np.isnan(p.z[k])
        S = p.H[k][seen] @ ours.predicted_cov[k] @ p.H[k][seen].T + p.R[k][np.ix_(seen, seen)]
        log_det += np.linalg.slogdet(2 * np.pi * S)[1] if seen.any() else 0.0
    assert loglike - 0.5 * log_det == pytest.approx(theirs.llf, rel=1e-10)


def test_agrees_with_filterpy(problem, close):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from filterpy.kalman import KalmanFilter

    p, (m, n) = problem, problem.H.shape[1:]
    peer = KalmanFilter(dim_x=n, dim_z=m)
    peer.x, peer.P = p.prior.mean.copy(), p.prior.cov.copy()
    z = np.where(np.isnan(p.z), 1.5, p.z)  # filterpy has no missing components
    ours = p.filter(z=z, transition=(p.Phi, p.Q))
    for k in range(len(p.t)):
        if k:
            peer.predict(F=p.Phi[k - 1], Q=p.Q[k - 1])
        peer.update(z[k], R=p.R[k], H=p.H[k])
        close(ours.mean[k], ours.cov[k], peer.x, peer.P, 1e-9)


def test_last_state_is_that_of_the_dense_batch_solution(problem, exact, close):
    for sequential in (True, False):
        ours = problem.filter(sequential)
        close(*ours[-1], exact[0][-1], exact[1][-1], 1e-10)


def test_sequential_equals_joint(problem, close):
    p = problem
    diagonal = np.array([np.diag(np.diag(R)) for R in p.R])
    for R in (p.R, diagonal):
        one = p.filter(True, R=R)
        other = p.filter(False, R=R)
        close(one.mean, one.cov, other.mean, other.cov, 1e-11)
        np.testing.assert_allclose(one.whitened, other.whitened, atol=1e-10)
        assert np.array_equal(np.isnan(one.whitened), np.isnan(p.z))


def test_run_equals_single_calls(problem):
    p = problem
    course = p.filter(sequential=False)
    state = p.prior
    for k in range(len(p.t)):
        if k:
            state = linear.predict(state, p.Phi[k - 1], p.Q[k - 1])
        state, innovation = linear.update(state, p.z[k], p.H[k], p.R[k])
        np.testing.assert_allclose(state.mean, course.mean[k], rtol=1e-12)
        np.testing.assert_allclose(innovation.whitened, course.whitened[k], atol=1e-12)
        seen = ~np.isnan(p.z[k])
        root = np.linalg.cholesky(innovation.S[np.ix_(seen, seen)])
        np.testing.assert_allclose(root @ innovation.whitened[seen], innovation.residual[seen], rtol=1e-9, atol=1e-10)


def test_missing_rows_equal_a_shorter_observation_vector(problem, close):
    p = problem
    z = p.z[1].copy()
    z[[1, 3]] = np.nan
    keep = [0, 2]
    for sequential in (True, False):
        masked, _ = linear.update(p.prior, z, p.H[1], p.R[1], sequential)
        short, _ = linear.update(p.prior, z[keep], p.H[1][keep], p.R[1][np.ix_(keep, keep)], sequential)
        close(*masked, *short, 1e-13)
    nothing, innovation = linear.update(p.prior, np.full(4, np.nan), p.H[1], p.R[1])
    assert np.array_equal(nothing.mean, p.prior.mean) and np.isnan(innovation.whitened).all()


def test_covariances_are_exactly_symmetric_and_inputs_untouched(problem):
    p = problem
    before = [a.copy() for a in (p.z, p.H, p.R, p.Phi, p.Q, *p.prior)]
    for sequential in (True, False):
        course = p.filter(sequential, transition=(p.Phi, p.Q))
        for P in (course.cov, course.predicted_cov):
            assert np.array_equal(P, P.transpose(0, 2, 1))
    for one, other in zip(before, (p.z, p.H, p.R, p.Phi, p.Q, *p.prior), strict=True):
        assert np.array_equal(one, other, equal_nan=True)


def test_a_perfect_observation_is_taken_as_it_is():
    prior = gaussian([0.0, 0.0], [[1e16, 1e15], [1e15, 1e16]])
    for sequential in (True, False):
        state, _ = linear.update(prior, [3.0], [[1.0, 0.0]], [[0.0]], sequential)
        assert state.mean[0] == 3.0 and state.cov[0, 0] == 0.0
        assert state.cov[1, 1] == pytest.approx(1e16 - 1e14, rel=1e-12)


def test_joseph_form_keeps_a_tiny_variance_out_of_a_huge_one():
    """P - K S K' would leave the rounding of 1e8, 1e-8, where the right variance is 1e-12."""
    x, P = np.zeros(2), np.array([[1e8, 3e7], [3e7, 1e8]])
    S = scalar_update_step(x, P, 1.0, np.array([1.0, 0.0]), 1e-12)
    assert S == 1e8 + 1e-12
    assert P[0, 0] == pytest.approx(1e-12, rel=1e-6)
    assert P[1, 1] == pytest.approx(1e8 - 9e6, rel=1e-12)


@pytest.mark.parametrize("sequential", [True, False])
def test_compiled_loop_equals_plain_python(problem, sequential, request):
    """The same text, compiled and interpreted, gives the same numbers (fused multiply-adds are off)."""
    compiled = problem.filter(sequential)
    request.getfixturevalue("interpreted")
    plain = problem.filter(sequential)
    for name in ("predicted_mean", "predicted_cov", "mean", "cov", "whitened"):
        wanted = getattr(compiled, name)
        np.testing.assert_allclose(getattr(plain, name), wanted, rtol=1e-12, atol=1e-12 * np.nanmax(np.abs(wanted)))


def test_update_step_of_one_row_is_the_scalar_step(problem):
    p = problem
    x1, P1 = (a.copy() for a in p.prior)
    x2, P2 = (a.copy() for a in p.prior)
    S, w = np.empty((1, 1)), np.empty(1)
    assert update_step(x1, P1, np.array([0.7]), p.H[1][1:2].copy(), np.array([[0.3]]), S, w) == 0
    S2 = scalar_update_step(x2, P2, 0.7, p.H[1][1], 0.3)
    assert S[0, 0] == pytest.approx(S2, rel=1e-14) and w[0] == pytest.approx(0.7 / np.sqrt(S2), rel=1e-14)
    np.testing.assert_allclose(x1, x2, rtol=1e-14)
    np.testing.assert_allclose(P1, P2, rtol=1e-12, atol=1e-16)


def test_axes_of_a_position_only_filter_decouple(filter_linear):
    rng = np.random.default_rng(5)
    t, z = np.arange(40) * 30.0, rng.standard_normal((40, 3))
    full = filter_linear(
        gaussian(np.zeros(9), np.ones(9)), t, z, np.eye(3, 9), 1e-2 * np.eye(3), white_jerk(30.0, 1e-8)
    )
    for axis in range(3):
        one = filter_linear(
            gaussian(np.zeros(3), np.ones(3)), t, z[:, [axis]], np.eye(1, 3), [[1e-2]], white_jerk(30.0, 1e-8, 1)
        )
        np.testing.assert_allclose(full.mean[:, axis::3], one.mean, rtol=1e-12, atol=1e-15)


def test_single_epoch_is_filtered(filter_linear):
    course = filter_linear(gaussian([0.0], [[1.0]]), [7.0], [[2.0]], [[1.0]], [[1.0]], ([[1.0]], [[1.0]]))
    assert course.mean[0, 0] == 1.0 and course.cov[0, 0, 0] == 0.5 and len(course) == 1
    course = filter_linear(gaussian([0.0], [[1.0]]), [7.0], [[2.0]], [[1.0]], [[1.0]], lambda h: 1 / 0)
    assert course.transition.shape == (0, 1, 1)


def test_innovation_covariance_that_is_not_positive_names_the_epoch(filter_linear):
    prior = gaussian([0.0, 0.0], [[1.0, 0.0], [0.0, 0.0]])
    steps = (np.eye(2), np.zeros((2, 2)))
    for sequential in (True, False):
        with pytest.raises(NotPositiveDefinite, match=r"innovation covariance .* at epoch 2 \(t = 20 s\)") as error:
            filter_linear(prior, [0, 10, 20], [[np.nan], [np.nan], [1.0]], [[0.0, 1.0]], [[0.0]], steps, sequential)
        assert error.value.epoch == 2 and error.value.matrix == "innovation covariance" and error.value.t == 20.0


def test_correlated_noise_without_full_rank_cannot_be_decorrelated():
    prior = gaussian([0.0, 0.0], [1.0, 1.0])
    R = [[1.0, 1.0], [1.0, 1.0]]
    with pytest.raises(NotPositiveDefinite, match="observation noise covariance .* component 1"):
        linear.update(prior, [0.0, 0.0], np.eye(2), R, sequential=True)
    joint, _ = linear.update(prior, [0.0, 0.0], np.eye(2), R)  # the joint update needs no inverse of R
    np.testing.assert_allclose(joint.cov, 1.0 / 3.0, rtol=2e-15)  # x1 - x2 is known without error


def test_kernel_returns_where_the_innovation_covariance_fails():
    """The status of a kernel fed with a broken covariance, in each of its three ways."""
    x, w, diagonal, full = np.zeros(2), np.empty(2), np.eye(2), np.array([[1.0, 0.5], [0.5, 1.0]])
    for R, sequential in ((diagonal, True), (full, True), (full, False)):
        P = np.diag([1.0, -4.0])
        assert observed_update_step(x.copy(), P, x, np.eye(2), R, sequential, w) == 2


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"t": [0.0, 1.0, 1.0]}, r"t\[2\] = 1.0 does not come after t\[1\] = 1.0"),
        ({"t": []}, "t is empty"),
        ({"t": [0.0, np.nan, 1.0]}, r"t\[1\] is nan: values must be finite"),
        ({"z": np.zeros((2, 1))}, r"z of sensor 0 has the shape \(2, 1\), it must be \(3, any\)"),
        ({"z": [[0.0], [np.inf], [0.0]]}, r"z of sensor 0\[1, 0\] is inf: values must be finite, or NaN"),
        ({"H": np.ones((2, 2))}, r"H of sensor 0 has the shape \(2, 2\), it must be \(1, 2\)"),
        ({"H": np.ones((2, 1, 2))}, r"H of sensor 0 has the shape \(2, 1, 2\), it must be \(3, 1, 2\)"),
        ({"R": [[-1.0]]}, r"R of sensor 0 is not positive definite: its diagonal element 0 is -1"),
        ({"R": np.array([[[1.0]], [[np.nan]], [[1.0]]])}, r"R of sensor 0\[1, 0, 0\] is nan"),
        ({"transition": (np.eye(3), np.eye(2))}, r"Phi has the shape \(3, 3\), it must be \(2, 2\)"),
        ({"transition": (np.eye(2), [[1.0, 0.5], [0.0, 1.0]])}, r"Q is not symmetric: element \(0, 1\) is 0.5"),
        ({"transition": (np.eye(2), [[1.0, 2.0], [2.0, 1.0]])}, "Q is not positive definite: .* eigenvalue -1"),
        ({"transition": lambda h: (np.eye(2), np.eye(3))}, r"Q has the shape \(3, 3\)"),
    ],
)
def test_wrong_input_is_named(change, message, filter_linear):
    good = {
        "prior": gaussian([0.0, 0.0], [1.0, 1.0]),
        "t": [0.0, 1.0, 2.0],
        "z": np.zeros((3, 1)),
        "H": np.ones((1, 2)),
        "R": [[1.0]],
        "transition": (np.eye(2), np.eye(2)),
    }
    assert len(filter_linear(**good)) == 3
    with pytest.raises(ValueError, match=message):
        filter_linear(**{**good, **change})


def test_per_epoch_noise_with_a_bad_member_names_it(filter_linear):
    Q = np.stack([np.eye(2), -np.eye(2)])
    with pytest.raises(NotPositiveDefinite, match=r"Q\[1\]"):
        filter_linear(gaussian([0, 0], [1, 1]), [0, 1, 2], np.zeros((3, 1)), np.ones((1, 2)), [[1.0]], (np.eye(2), Q))


def test_predict_step_keeps_its_inputs():
    Phi, Q = white_jerk(30.0, 1e-10)
    rng = np.random.default_rng(2)
    A = rng.standard_normal((9, 9))
    x, P = rng.standard_normal(9), A @ A.T
    x_out, P_out = np.empty(9), np.empty((9, 9))
    predict_step(x, P, Phi, Q, x_out, P_out)
    np.testing.assert_allclose(x_out, Phi @ x, rtol=1e-14)
    np.testing.assert_allclose(P_out, Phi @ P @ Phi.T + Q, rtol=1e-13)
    assert observed_update_step(x, P, np.full(1, np.nan), np.ones((1, 9)), np.eye(1), True, np.empty(1)) == 0
