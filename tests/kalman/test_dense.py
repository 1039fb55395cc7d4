"""The small matrix kernels against numpy and scipy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import solve_triangular

from geokalman.kalman.dense import cholesky_upper, copy_state, root_semidefinite, solve_lower, solve_upper, symmetrise


@pytest.fixture
def spd():
    A = np.random.default_rng(1).standard_normal((7, 7))
    scale = 10.0 ** np.arange(-9, 12, 3)  # units from nanometres to gigametres: the factor must not care
    return (A @ A.T + np.eye(7)) * scale[:, None] * scale


def test_cholesky_is_numpys(spd):
    U = np.full((7, 7), np.nan)
    assert cholesky_upper(spd, U) == 0
    np.testing.assert_allclose(U, np.linalg.cholesky(spd).T, rtol=1e-12)
    in_place = spd.copy()
    assert cholesky_upper(in_place, in_place) == 0
    assert np.array_equal(in_place, U)
    assert root_semidefinite(spd, U) == 0
    np.testing.assert_allclose(U, in_place, rtol=1e-13)


def test_a_state_of_more_components_than_its_error_is_copied_within_bounds(spd):
    """A quaternion and a bias have seven components, their error six."""
    x, covs = np.empty(7), np.full((2, 6, 6), np.nan)
    copy_state(np.arange(7.0), spd[:6, :6].copy(), x, covs[0])
    assert np.array_equal(x, np.arange(7.0)) and np.array_equal(covs[0], spd[:6, :6])
    assert np.isnan(covs[1]).all()


def test_solves_are_scipys(spd):
    U, B = np.linalg.cholesky(spd).T.copy(), np.random.default_rng(2).standard_normal((7, 3))
    X, Y = B.copy(), B.copy()
    solve_lower(U, X)
    solve_upper(U, Y)
    np.testing.assert_allclose(X, solve_triangular(U.T, B, lower=True), rtol=1e-11)
    np.testing.assert_allclose(Y, solve_triangular(U, B), rtol=1e-11)


@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan])
def test_first_bad_pivot_is_returned(bad):
    A = np.diag([4.0, 1.0, bad, 1.0])
    assert cholesky_upper(A, np.empty((4, 4))) == 3


def test_semidefinite_factor_of_a_singular_matrix():
    B = np.random.default_rng(3).standard_normal((5, 2))
    A = B @ B.T
    U = np.full((5, 5), np.nan)
    assert root_semidefinite(A, U) == 0
    np.testing.assert_allclose(U.T @ U, A, atol=1e-13)
    assert np.array_equal(U[2:], np.zeros((3, 5)))  # rank two: three rows vanish
    known = np.diag([0.0, 4.0, 0.0])
    assert root_semidefinite(known, U3 := np.empty((3, 3))) == 0
    assert np.array_equal(U3.T @ U3, known)
    assert root_semidefinite(np.diag([1.0, -1e-3]), np.empty((2, 2))) == 2
    assert root_semidefinite(np.zeros((2, 2)), np.empty((2, 2))) == 0


def test_symmetrise():
    A = np.array([[1.0, 2.0], [4.0, 3.0]])
    symmetrise(A)
    assert np.array_equal(A, [[1.0, 3.0], [3.0, 3.0]])
