"""Normal equations against orthogonal decompositions of the whole design matrix, and the ways to be singular."""

from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor

import numpy as np
import pytest
from scipy.linalg import lstsq

from geokalman.leastsquares import NormalEquations, SingularNormalMatrix, sum_normals


def problem(seed=0, rows=60, n=9, q=3):
    rng = np.random.default_rng(seed)
    return rng.standard_normal((rows, n)), rng.standard_normal((rows, q)), rng.uniform(0.1, 4.0, rows)


def normals_of(A, y, w=None, step=None, names=None):
    normals = NormalEquations(A.shape[1], 1 if y.ndim == 1 else y.shape[1], names)
    step = step or A.shape[0]
    for i in range(0, A.shape[0], step):
        rows = slice(i, i + step)
        normals.add(A[rows], y[rows], None if w is None else w[rows])
    return normals


@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("step", [1, 7, 60])
@pytest.mark.parametrize("weighted", [False, True])
def test_solution_residuals_and_covariance_agree_with_orthogonal_decomposition(order, step, weighted):
    A, y, w = problem()
    root = np.sqrt(w)[:, None] if weighted else np.ones((60, 1))
    solution = normals_of(np.array(A, order=order), np.array(y, order=order), w if weighted else None, step).factor()
    x, residues, _, _ = lstsq(root * A, root * y, lapack_driver="gelsd")
    np.testing.assert_allclose(solution.estimate, x, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(solution.residual_sum_of_squares, residues, rtol=1e-12)
    np.testing.assert_allclose(solution.variance_factor, residues / (60 - 9), rtol=1e-12)
    pseudo = np.linalg.pinv(root * A)
    np.testing.assert_allclose(solution.covariance(), pseudo @ pseudo.T, rtol=1e-11, atol=1e-15)
    np.testing.assert_allclose(solution.variances(), np.sum(pseudo**2, axis=1), rtol=1e-12)
    assert solution.observations == 60 and solution.unknowns == 9


def test_views_that_are_in_neither_order_are_taken_too():
    A, y, _ = problem()
    wide, tall = np.zeros((60, 18)), np.zeros((120, 9))
    wide[:, ::2], tall[::2] = A, A
    for view in (wide[:, ::2], tall[::2]):
        np.testing.assert_allclose(normals_of(view, y).full_matrix(), A.T @ A, rtol=1e-12, atol=1e-12)


def test_columns_of_very_different_size_lose_nothing():
    # geopotential columns span ten orders of magnitude; scaling to unit diagonal makes that harmless
    A, y, _ = problem()
    size = np.logspace(-12, 12, 9)
    plain, scaled = normals_of(A, y).factor(), normals_of(A * size, y).factor()
    np.testing.assert_allclose(scaled.estimate * size[:, None], plain.estimate, rtol=1e-12, atol=1e-14)
    assert scaled.condition() == pytest.approx(plain.condition(), rel=1e-10)


@pytest.mark.parametrize("n", [9, 64, 65, 150])
def test_condition_is_the_ratio_of_the_extreme_eigenvalues_of_the_scaled_matrix(n):
    A, y, _ = problem(rows=2 * n, n=n, q=1)
    N = A.T @ A
    d = 1 / np.sqrt(N.diagonal())
    values = np.linalg.eigvalsh(N * d * d[:, None])
    solution = normals_of(A, y).factor()
    assert solution.condition() == pytest.approx(values[-1] / values[0], rel=1e-5)
    assert solution.condition() == solution.condition()


def test_log_determinant_is_that_of_the_unscaled_matrix():
    A = np.random.default_rng(3).standard_normal((40, 7)) * 10.0 ** np.arange(-3, 4)
    normals = NormalEquations(7)
    normals.add(A, A[:, 0])
    assert normals.factor().log_determinant == pytest.approx(np.linalg.slogdet(A.T @ A)[1], rel=1e-10)


def test_new_right_hand_sides():
    A, y, _ = problem()
    solution = normals_of(A, y).factor()
    b = np.random.default_rng(5).standard_normal(9)
    np.testing.assert_allclose(A.T @ A @ solution.solve(b), b, atol=1e-13)
    np.testing.assert_allclose(solution.solve(np.stack([b, 2 * b], axis=1))[:, 1], 2 * solution.solve(b), rtol=1e-13)


def test_one_right_hand_side_may_be_a_vector():
    A, y, _ = problem(q=1)
    np.testing.assert_array_equal(normals_of(A, y[:, 0]).rhs, normals_of(A, y).rhs)


def test_overwriting_gives_the_same_solution_in_the_same_memory():
    A, y, _ = problem()
    kept, given = normals_of(A, y), normals_of(A, y)
    memory = given.matrix
    one, other = kept.factor(), given.factor(overwrite=True)
    assert np.shares_memory(other.factor, memory) and not np.shares_memory(one.factor, kept.matrix)
    np.testing.assert_array_equal(one.estimate, other.estimate)
    np.testing.assert_array_equal(kept.matrix, normals_of(A, y).matrix)


def test_adding_does_not_copy_the_matrix():
    A, y, _ = problem()
    normals = NormalEquations(9, 3)
    memory = normals.matrix
    normals.add(A, y)
    assert normals.matrix is memory and np.any(memory)
    assert not np.any(np.triu(memory, 1))


def test_partial_normals_add_up():
    A, y, w = problem()
    one, other = normals_of(A[:25], y[:25], w[:25]), normals_of(A[25:], y[25:], w[25:])
    total, whole = one + other, normals_of(A, y, w)
    np.testing.assert_allclose(total.full_matrix(), whole.full_matrix(), rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(total.rhs, whole.rhs, rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(total.squares, whole.squares, rtol=1e-13)
    assert total.observations == 60 and one.observations == 25


def build(arc):
    A, y, _ = problem(seed=arc, rows=20)
    return normals_of(A, y)


@pytest.mark.parametrize("pool", [None, ThreadPoolExecutor, ProcessPoolExecutor])
@pytest.mark.parametrize("at_once", [1, 2, 9])
def test_arcs_sum_to_the_same_bits_with_any_executor(pool, at_once):
    if pool is None:
        total = sum_normals(build, range(5))
    else:
        with pool(2) as executor:
            total = sum_normals(build, range(5), executor, at_once)
    wanted = build(0)
    for arc in range(1, 5):
        wanted += build(arc)
    np.testing.assert_array_equal(total.matrix, wanted.matrix)
    np.testing.assert_array_equal(total.rhs, wanted.rhs)
    assert total.observations == 100


def test_a_failing_arc_is_heard_of():
    with ThreadPoolExecutor(2) as executor, pytest.raises(ZeroDivisionError):
        sum_normals(lambda arc: build(arc) if arc < 2 else 1 // 0, range(30), executor, 2)
    with pytest.raises(ValueError, match="There is no arc"):
        sum_normals(build, [])


def test_regularisation_is_an_observation_of_the_unknowns():
    A, y, _ = problem(rows=4)
    weight = np.array([1.0, 2.0, 0.5, 3.0, 1.0, 1.0, 4.0, 0.0, 2.0])
    A = np.vstack([A, np.eye(9)[7]])  # the unknown of weight 0 is seen by this row alone
    y = np.vstack([y, np.ones(3)])
    prior = np.random.default_rng(2).standard_normal((9, 3))
    normals = normals_of(A, y)
    normals.regularise(weight, prior)
    root = np.sqrt(weight)[:, None]
    x, residues, _, _ = lstsq(np.vstack([A, root * np.eye(9)]), np.vstack([y, root * prior]))
    solution = normals.factor()
    np.testing.assert_allclose(solution.estimate, x, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(solution.residual_sum_of_squares, residues, rtol=1e-11)
    assert normals.observations == 5 + 8


def test_regularisation_towards_zero_and_towards_one_vector():
    A, y, _ = problem()
    normals, same = normals_of(A, y), normals_of(A, y)
    normals.regularise(0.5)
    np.testing.assert_allclose(normals.full_matrix(), A.T @ A + 0.5 * np.eye(9), rtol=1e-13, atol=1e-13)
    np.testing.assert_array_equal(normals.rhs, same.rhs)
    same.regularise(0.5, np.arange(9.0))
    np.testing.assert_allclose(same.rhs - normals.rhs, np.repeat(0.5 * np.arange(9.0)[:, None], 3, 1), atol=1e-13)


def test_rows_of_weight_zero_are_no_observations():
    A, y, w = problem()
    w[:30] = 0.0
    y[:30] = 1e9
    normals = normals_of(A, y, w)
    assert normals.observations == 30
    np.testing.assert_array_equal(normals.squares, normals_of(A[30:], y[30:], w[30:]).squares)


def spoilt(values, row, value):
    values = values.copy()
    values[row] = value
    return values


NAMES = [f"C_{n}_{m}" for n in (2, 3, 4) for m in range(3)]


def test_too_few_observations():
    A, y, _ = problem(rows=8)
    with pytest.raises(ValueError, match="9 unknowns need at least 9 observations; only 8 were added"):
        normals_of(A, y).factor()


def test_unknowns_that_nothing_depends_on_are_named():
    A, y, _ = problem()
    A[:, [2, 7]] = 0.0
    with pytest.raises(SingularNormalMatrix, match="No observation depends on 2 of 9 unknowns: C_2_2, C_4_1"):
        normals_of(A, y, names=NAMES).factor()


@pytest.mark.parametrize("overwrite", [False, True])
def test_unknowns_that_cannot_be_told_apart_are_named(overwrite):
    A, y, _ = problem()
    A[:, 4] = 3e6 * A[:, 1] - 2e6 * A[:, 8]
    with pytest.raises(SingularNormalMatrix, match="tell from one another, 3 of 9 unknowns: C_2_1, C_3_1, C_4_2"):
        normals_of(A, y, names=NAMES).factor(overwrite)


def test_two_separate_defects_and_a_long_list_without_names():
    A, y, _ = problem(rows=80, n=24)
    A[:, 5], A[:, 20] = A[:, 3], -A[:, 22]
    with pytest.raises(SingularNormalMatrix, match=r"4 of 24 unknowns: x\[3\], x\[5\], x\[20\], x\[22\]"):
        normals_of(A, y).factor()
    A, y, _ = problem(rows=15, n=24)
    with pytest.raises(SingularNormalMatrix, match="of 24 unknowns: x.* and .* more"):
        normals_of(np.vstack([A, A]), np.vstack([y, y])).factor()


def test_nearly_singular_matrices_are_refused_from_n_eps_on():
    # a pivot of the scaled matrix is the share 1 - R^2 of a column that no other explains
    A, y, _ = problem()
    for share, refused in ((1e-7, False), (1e-8, True)):
        B = A.copy()
        B[:, 3] = B[:, 0] + share * A[:, 3]
        if refused:
            with pytest.raises(SingularNormalMatrix, match="x.0., x.3."):
                normals_of(B, y).factor()
        else:
            assert normals_of(B, y).factor().condition() > 1e13


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda N, A, y: N.add(A[:, :8], y), r"shape \(60, 8\); \(k, 9\) is right"),
        (lambda N, A, y: N.add(A, y[:, :2]), r"shape \(60, 2\); \(60, 3\) is right"),
        (lambda N, A, y: N.add(spoilt(A, 17, np.nan), y), "Row 17 of the design matrix of a block is not finite"),
        (lambda N, A, y: N.add(A, spoilt(y, 4, np.inf)), "Row 4 of the right-hand side of a block is not finite"),
        (lambda N, A, y: N.add(A, y, -np.ones(60)), r"weights\[0\] = -1.0 must be finite and not negative"),
        (lambda N, A, y: N.add(A, y, np.ones(59)), r"weights has shape \(59,\); a scalar or \(60,\), one per row"),
        (lambda N, A, y: N.regularise(np.ones(8)), r"a scalar or \(9,\), one per unknown"),
        (lambda N, A, y: N.regularise(1.0, spoilt(np.zeros(9), 3, np.nan)), r"The prior of x\[3\] is not finite"),
        (lambda N, A, y: N.__iadd__(NormalEquations(8, 3)), "9 unknowns and 3 .* do not add to those of 8 and 3"),
        (lambda N, A, y: N.__iadd__(NormalEquations(9, 3, NAMES)), "other names"),
        (lambda N, A, y: NormalEquations(0), "at least 1 unknown"),
        (lambda N, A, y: NormalEquations(3, names=["a"]), "1 names for 3 unknowns"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_refused(call, says):
    A, y, _ = problem()
    with pytest.raises(ValueError, match=says):
        call(NormalEquations(9, 3), A, y)


def test_matrices_of_several_tiles():
    A, y, _ = problem(rows=700, n=600, q=1)
    solution = normals_of(A, y, step=256).factor()
    inverse = np.linalg.inv(A.T @ A)
    np.testing.assert_allclose(solution.covariance(), inverse, rtol=0, atol=1e-9 * np.abs(inverse).max())
    values = np.linalg.eigvalsh(np.triu(solution.factor, 1) + np.triu(solution.factor, 1).T + np.eye(600))
    assert solution.condition() == pytest.approx(values[-1] / values[0], rel=1e-5)
    A[:, 599] = A[:, 7]
    with pytest.raises(SingularNormalMatrix, match=r"2 of 600 unknowns: x\[7\], x\[599\]"):
        normals_of(A, y).factor()


def test_without_redundancy_there_is_no_variance():
    A, y, _ = problem(rows=9)
    solution = normals_of(A, y).factor()
    np.testing.assert_allclose(A @ solution.estimate, y, atol=1e-10)
    with pytest.raises(ValueError, match="9 observations of as many unknowns leave no redundancy"):
        _ = solution.variance_factor


def test_whitened_rows_are_weighted_by_their_full_covariance():
    A, y, _ = problem(rows=30, q=1)
    L = np.tril(np.random.default_rng(1).standard_normal((30, 30)) * 0.2) + np.eye(30)
    W = np.linalg.inv(L @ L.T)
    normals = normals_of(np.linalg.solve(L, A), np.linalg.solve(L, y))
    wanted = np.linalg.solve(A.T @ W @ A, A.T @ W @ y)
    np.testing.assert_allclose(normals.factor().estimate, wanted, rtol=1e-10, atol=1e-12)
