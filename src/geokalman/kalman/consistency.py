"""Is a filter honest? NEES, NIS, whiteness, chi-square bounds, and Monte Carlo over seeds.

NEES compares the error with the covariance and needs the truth; NIS compares the innovations with theirs and does not.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import Executor
from functools import partial
from typing import NamedTuple, TypeVar

import numpy as np

from geokalman.kalman.checks import NotPositiveDefinite, array, plain, scalar, whole

Result = TypeVar("Result")


class Whiteness(NamedTuple):
    """Whiteness of innovations, by their autocorrelation and the portmanteau test.

    autocorrelation : (lags, m) at lags 1, 2, ...;
    statistic ~ chi-square with dof degrees of freedom if they are white; p_value : its upper tail probability.
    """

    autocorrelation: np.ndarray
    statistic: float
    dof: int
    p_value: float


def nees(error, cov) -> np.ndarray:
    """Compute the normalised estimation error squared, error' cov^-1 error.

    It is chi-square with n degrees of freedom if cov is honest.
    error : (..., n) estimate minus truth; cov : (..., n, n). Returns (...).
    Raises ValueError for shapes that do not agree or values that are not finite, NotPositiveDefinite with the first
    covariance (counted over the leading axes) that has no root of full rank.

    >>> nees([3.0, 4.0], [[9.0, 0.0], [0.0, 4.0]]).item()
    5.0
    """
    e, P = plain("error", error), plain("cov", cov)
    if e.ndim < 1 or P.shape != (*e.shape, e.shape[-1]):
        raise ValueError(f"cov has the shape {P.shape}, for errors {e.shape} it must be (..., n, n).")
    n, shape = e.shape[-1], e.shape[:-1]
    e, P = array("error", e.reshape(-1, n), None, n), array("cov", P.reshape(-1, n, n), None, n, n)
    sigma = np.sqrt(np.maximum(np.diagonal(P, axis1=1, axis2=2), np.finfo(float).tiny))  # scale before factoring
    e, P = e / sigma, P / sigma[:, :, None] / sigma[:, None, :]
    try:
        roots = np.linalg.cholesky(P)
    except np.linalg.LinAlgError:
        for k in range(len(P)):
            try:
                np.linalg.cholesky(P[k])
            except np.linalg.LinAlgError:
                raise NotPositiveDefinite("covariance", k) from None
        raise
    w = np.linalg.solve(roots, e[:, :, None])
    return (w * w).sum(axis=(1, 2)).reshape(shape)


def nis(whitened) -> tuple[np.ndarray, np.ndarray]:
    """Compute the normalised innovation squared of each epoch and its degrees of freedom.

    whitened : (..., m) whitened innovations. Returns the sums of squares (...) and the counts (...) of what is
    not NaN, both 0 in a gap.

    >>> values, dof = nis([[1.0, 2.0], [float("nan"), 3.0]])
    >>> values.tolist(), dof.tolist()
    ([5.0, 9.0], [2, 1])
    """
    w = plain("whitened", whitened, missing=True)
    if np.isinf(w).any():
        raise ValueError("whitened has an infinite value: values must be finite, or NaN where missing.")
    return np.nansum(w**2, axis=-1), np.isfinite(w).sum(axis=-1)


def chi_square_bounds(dof, probability: float = 0.95) -> tuple[float, float]:
    """Compute two-sided bounds for the mean of independent chi-square values.

    It lies between them with `probability`.
    dof : degrees of freedom of each value, one per run or epoch. Bounds are the quantiles of chi-square(sum of dof),
    divided by the number of values with dof > 0.
    Raises ValueError where no degree of freedom is left or probability is not inside (0, 1).
    Source: Bar-Shalom, Li and Kirubarajan (2001), Estimation with Applications, section 5.4.

    >>> low, high = chi_square_bounds([4] * 100)  # a hundred epochs of four components
    >>> round(low, 2), round(high, 2)
    (3.46, 4.57)
    """
    from scipy.special import gammaincinv  # a third of a second

    probability = scalar("probability", probability)
    if not 0.0 < probability < 1.0:
        raise ValueError(f"probability = {probability}: it must lie between 0 and 1.")
    dof = np.atleast_1d(plain("dof", dof))
    if not ((dof >= 0) & (dof < np.inf)).all():
        wrong = dof[~((dof >= 0) & (dof < np.inf))][0]
        raise ValueError(f"dof holds {wrong:g}: degrees of freedom are finite and not negative.")
    count, total = int((dof > 0).sum()), float(dof.sum())
    if count == 0:
        raise ValueError("there is no degree of freedom: every epoch is missing.")
    tail = 0.5 * (1.0 - probability)
    low, high = 2.0 * gammaincinv(0.5 * total, [tail, 1.0 - tail]) / count
    return float(low), float(high)


def whiteness(whitened, lags: int) -> Whiteness:
    """Test by Ljung and Box whether whitened innovations are uncorrelated in time.

    r_l = [sum_t w_t w_(t+l) / n_l] / [sum_t w_t^2 / n_0],  statistic = (1 + 2 / n_0) sum_l n_l r_l^2,
    each component for itself, summed over them; n_l is the number of pairs with both values there. Without gaps this
    is the usual Ljung-Box statistic of a zero-mean series.
    whitened : (N, m), NaN where missing; lags : largest lag, 1 <= lags < N.
    Raises ValueError for another shape, for lags out of range and where a lag has no pair.
    Source: Ljung and Box (1978), Biometrika 65, 297-303.

    >>> w = np.random.default_rng(1).standard_normal((500, 1))
    >>> whiteness(w, 10).p_value > 0.01 > whiteness(np.cumsum(w, axis=0), 10).p_value
    True
    """
    from scipy.special import gammaincc

    w = array("whitened", whitened, None, None, missing=True)
    N, m = w.shape
    lags = whole("lags", lags)
    if not 1 <= lags < N:
        raise ValueError(f"lags = {lags} with {N} epochs: it must be at least 1 and below the number of epochs.")
    there = np.isfinite(w)
    w = np.where(there, w, 0.0)
    pairs = np.array([(there[lag:] & there[: N - lag]).sum(0) for lag in range(lags + 1)])
    if (pairs == 0).any():
        lag, component = (int(i) for i in np.argwhere(pairs == 0)[0])
        raise ValueError(f"component {component} has no pair of values at lag {lag}: too many are missing.")
    moments = np.array([(w[lag:] * w[: N - lag]).sum(0) for lag in range(lags + 1)]) / pairs
    r = moments[1:] / moments[0]
    statistic = float(((1.0 + 2.0 / pairs[0]) * pairs[1:] * r**2).sum())
    return Whiteness(r, statistic, lags * m, float(gammaincc(0.5 * lags * m, 0.5 * statistic)))


def monte_carlo(
    run: Callable[[np.random.Generator], Result], seeds: Iterable[int], executor: Executor | None = None
) -> list[Result]:
    """Call run(default_rng(seed)) for each seed, the results in the order of the seeds.

    run : takes a Generator and nothing else, so that run i is the same on 1 and on many workers (a module-level
    function where a process pool is to send it); seeds : e.g. range(seed0, seed0 + count); executor : any
    concurrent.futures.Executor, None runs here. An error of a run is raised here.

    >>> draws = monte_carlo(lambda rng: rng.standard_normal(), range(7, 10))
    >>> draws[1] == np.random.default_rng(8).standard_normal()
    True
    """
    job = partial(_seeded, run)
    return list(executor.map(job, seeds)) if executor else [job(seed) for seed in seeds]


def _seeded(run: Callable[[np.random.Generator], Result], seed: int) -> Result:
    return run(np.random.default_rng(seed))
