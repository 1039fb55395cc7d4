"""Tuning by maximum likelihood: what the innovations of some lines say about R, q_f, L and sigma, without any truth."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize

from geokalman import progress
from geokalman.airborne.estimate import innovation_log_likelihood
from geokalman.airborne.model import Line, Tuning, build
from geokalman.kalman.whitening import whiten_columns


@dataclass(frozen=True)
class Fit:
    """A tuning with its log-likelihood, the number of evaluations, and whether the search converged."""

    tuning: Tuning
    log_likelihood: float
    evaluations: int
    converged: bool


def fit(
    lines: Sequence[Line],
    start: Tuning,
    names: Sequence[str] = ("R_m", "q_f", "L_km", "sigma_mgal"),
    evaluations: int = 120,
) -> Fit:
    """Maximise the likelihood of lines over some positive fields of a tuning (Nelder-Mead in their logarithms).

    Raises ValueError for no lines, or a field that is not positive at the start.
    """
    if not lines:
        raise ValueError("There are no lines to tune on.")
    first = np.array([getattr(start, name) for name in names], dtype=float)
    if not (first > 0).all():
        raise ValueError(
            f"{names[int(np.argmin(first))]} = {first.min():g}: a search in logarithms needs positive starts."
        )

    tell, count = progress.share("evaluations"), itertools.count(1)

    def cost(x: np.ndarray) -> float:
        tell(min(1.0, next(count) / evaluations))
        if np.abs(x).max() > np.log(30.0):  # beyond a factor of 30 nothing is learned
            return np.inf
        trial = replace(start, **dict(zip(names, (first * np.exp(x)).tolist(), strict=True)))
        return -sum(innovation_log_likelihood(line, trial) for line in lines)

    simplex = np.vstack([np.zeros(len(names)), 0.4 * np.eye(len(names))])
    found = minimize(
        cost, np.zeros(len(names)), method="Nelder-Mead",
        options={"maxfev": evaluations, "initial_simplex": simplex, "xatol": 0.01, "fatol": 0.1},
    )  # fmt: skip
    best = replace(start, **dict(zip(names, (first * np.exp(found.x)).tolist(), strict=True)))
    return Fit(best, -float(found.fun), int(found.nfev), bool(found.success))


def second_order_lag(lines: Sequence[Line], tuning: Tuning) -> tuple[float, np.ndarray]:
    """Second-order lag c [s^2] from flight data alone: the likelihood is quadratic in it, so one whitened regression
    does.

    z = model - c (f3' - f3'(0)).  Returns the pooled value and that of each line.
    """
    if not lines:
        raise ValueError("There are no lines to estimate a lag from.")
    top, bottom = np.empty(len(lines)), np.empty(len(lines))
    for k, line in enumerate(lines):
        model = build(line, tuning)
        columns = np.column_stack([line.z, line.f3 - line.f3[0]])
        w = whiten_columns(model.prior.cov, line.t, model.H, model.R, (model.Phi, model.Q), columns)
        top[k], bottom[k] = -w[:, 0] @ w[:, 1], w[:, 1] @ w[:, 1]
    return float(top.sum() / bottom.sum()), top / bottom
