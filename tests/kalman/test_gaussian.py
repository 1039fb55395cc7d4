"""What the border of the core lets in, and how its errors read."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from geokalman.kalman import NotPositiveDefinite, Stopped, gaussian, smooth


def test_gaussian_copies_and_symmetrises():
    cov = np.array([[2.0, 1.0 + 1e-16], [1.0, 2.0]])
    mean = np.array([1.0, 2.0])
    x = gaussian(mean, cov)
    mean[0] = 9.0
    assert x.mean[0] == 1.0 and np.array_equal(x.cov, x.cov.T)
    assert np.array_equal(gaussian([0, 0], [1, 4]).cov, np.diag([1.0, 4.0]))
    assert gaussian([0.0, 0.0], np.zeros((2, 2))).cov.max() == 0.0  # a known state is a Gaussian too


@pytest.mark.parametrize(
    ("mean", "cov", "message"),
    [
        ([[1.0]], [[1.0]], r"mean has the shape \(1, 1\), it must be \(any,\)"),
        ([1.0, 2.0], np.eye(3), r"covariance has the shape \(3, 3\), it must be \(2, 2\)"),
        ([1.0, np.nan], np.eye(2), r"mean\[1\] is nan: values must be finite"),
        ([1.0, 2.0], [[1.0, np.inf], [np.inf, 1.0]], r"covariance\[0, 1\] is inf"),
        ([1.0, 2.0], [[1.0, 0.2], [0.1, 1.0]], r"covariance is not symmetric: element \(0, 1\) is 0.2"),
        ([1.0, 2.0], [[1e12, 2e-6], [1e-6, 1e-12]], "not symmetric"),  # a gap that is large in units of its own sigmas
    ],
)
def test_wrong_values_are_named(mean, cov, message):
    with pytest.raises(ValueError, match=message):
        gaussian(mean, cov)


@pytest.mark.parametrize("cov", [[1.0, -1e-30], [[1.0, 1.1], [1.1, 1.0]], [[1.0, 0.1], [0.1, 0.0]]])
def test_a_covariance_must_not_be_negative_in_any_direction(cov):
    with pytest.raises(NotPositiveDefinite, match="covariance is not positive definite"):
        gaussian([0.0, 0.0], cov)


def test_units_do_not_decide_what_a_covariance_is():
    good = np.array([[1e16, 0.99], [0.99, 1e-16]])
    assert gaussian([0, 0], good).cov[0, 1] == 0.99
    with pytest.raises(NotPositiveDefinite):
        gaussian([0, 0], np.array([[1e16, 1.01], [1.01, 1e-16]]))


def test_error_survives_a_process_border():
    error = pickle.loads(pickle.dumps(NotPositiveDefinite("innovation covariance", 3, 90.0, "too small")))
    assert isinstance(error, NotPositiveDefinite) and isinstance(error, ValueError)
    assert (error.matrix, error.epoch, error.t) == ("innovation covariance", 3, 90.0)
    assert str(error) == "the innovation covariance is not positive definite at epoch 3 (t = 90 s): too small."
    error = pickle.loads(pickle.dumps(Stopped("sensor", 3, 90.0, 7)))
    assert (error.who, error.epoch, error.t, error.code) == ("sensor", 3, 90.0, 7)
    assert str(error) == "the sensor stopped at epoch 3 (t = 90 s) with code 7"


def test_trajectories_are_frozen_and_indexed_by_epoch(problem):
    filtered = problem.filter()
    for course in (filtered, smooth(filtered)):
        assert len(course) == len(problem.t) and np.array_equal(course[3].cov, course.cov[3])
        with pytest.raises(AttributeError):
            course.mean = None
